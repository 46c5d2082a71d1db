//! The protocol as a model that `stateright` explores.

use std::collections::BTreeSet;

use stateright::{Model, Property};

use crate::config::{Bug, Config};
use crate::state::{At, Rule, State, Worker};
use crate::step::{Act, Step};
use crate::waiting::Call;
use crate::work::{Work, indices};

/// The protocol, in one configuration.
#[derive(Clone, Debug)]
pub struct Protocol(pub Config);

/// A worker and what it does.
pub type Action = (u8, Act);

impl Protocol {
    /// What `worker` may do in `state`.
    pub fn acts(&self, state: &State, worker: u8, acts: &mut Vec<Action>) {
        let config = &self.0;
        let me = &state.workers[worker as usize];
        let mut may = |act| acts.push((worker, act));
        let carries: &[bool] = if config.sleep { &[false, true] } else { &[false] };
        match me.at {
            At::Gone => {}
            At::Outside if state.finished(config) => {}
            At::Outside => may(Act::Join),
            At::Awake => self.awake(state, me, &mut may),
            At::GoingOn => self.next_work(state, me, &mut may),
            At::Entering(unit) => {
                let mut due = state.due(config, unit).peekable();
                if due.peek().is_none() {
                    may(Act::Go { carry: false });
                }
                due.for_each(|pair| self.tests(pair, &mut may));
            }
            At::Arriving(_, left) => {
                let pair = left.trailing_zeros();
                if state.arrived >> pair & 1 == 1 {
                    self.tests(pair as u8, &mut may);
                } else {
                    may(Act::Go { carry: false });
                }
            }
            At::Interacting(_) | At::Updating(_) | At::Rendering(_) => {
                carries.iter().for_each(|&carry| may(Act::Call { carry }));
            }
            At::Swapping => may(Act::Call { carry: false }),
            At::Found(..)
            | At::Coming { .. }
            | At::Interacted(_)
            | At::Passing { .. }
            | At::Advancing(_)
            | At::Rendered(_)
            | At::Reentering(_) => carries.iter().for_each(|&carry| may(Act::Go { carry })),
            At::Ringing
            | At::RingingToSwap
            | At::RingingToSleep
            | At::Calling
            | At::Leaving { .. } => {
                self.rings(state, worker, &mut may);
            }
            At::Asleep => {}
            _ => may(Act::Go { carry: false }),
        }
    }

    fn awake(&self, state: &State, me: &Worker, may: &mut impl FnMut(Act)) {
        let config = &self.0;
        if state.finished(config) {
            return;
        }
        self.by_host(state, me, may);
        if !config.shared {
            self.next_work(state, me, may);
        } else if config.sleep
            || me.holds
            || state.opened != 0
            || state.work(me, state.tokens > 0).next().is_some()
        {
            may(Act::Turn);
        }
    }

    /// Any work that it carries or sees, a rendering first if the renderer is shared and it has it; or else it puts
    /// that back, or will sleep.
    fn next_work(&self, state: &State, me: &Worker, may: &mut impl FnMut(Act)) {
        let config = &self.0;
        let blind = config.has(Bug::RenderedAhead) && me.holds;
        let seen = state.queue.iter().filter(|work| blind && work.is_rendering());
        let mut all = state.work(me, me.holds);
        let goes_on = config.has(Bug::GoesOnWithRenderer) && !all.any(Work::is_rendering);
        let renders = config.shared && me.holds && !goes_on;
        let all = state.work(me, me.holds).chain(seen);
        let work: BTreeSet<Work> = all.filter(|work| !renders || work.is_rendering()).collect();
        work.iter().for_each(|&work| may(Act::Take(work)));
        // Who has the shared renderer renders, or puts it back ahead of all else.
        let opened = if renders { 0 } else { state.opened };
        indices(u64::from(opened)).for_each(|unit| may(Act::Come(unit as u8)));
        // What it keeps it queues where somebody is hungry, or before it goes to another home.
        if me.at == At::GoingOn && !me.holds && me.carried.iter().any(Work::is_rendering) {
            may(Act::Share);
        }
        let awaits = config.sleep || me.at == At::GoingOn;
        if awaits && work.is_empty() && opened == 0 && !me.offers {
            may(Act::Go { carry: false });
        }
    }

    /// What the host may do to a worker between two steps, and what others' hunger may.
    fn by_host(&self, state: &State, me: &Worker, may: &mut impl FnMut(Act)) {
        let config = &self.0;
        let others = state.workers.iter().filter(|worker| worker.is_present()).count() - 1;
        if !config.shared && me.holds && state.handovers > 0 && others > 0 {
            may(Act::Release);
        }
        if !config.shared && !me.holds && state.tokens > 0 {
            may(Act::Hold);
        }
        if !me.carried.is_empty() && config.sleep {
            may(Act::Share);
        }
        // Somebody stays: whoever holds a token, or else anyone.
        let stays = |worker: &&Worker| worker.is_present() && !worker.is_leaving();
        let others = state.workers.iter().filter(stays).count() - 1;
        if state.departures > 0 && others > 0 && !me.is_holder(config) && !me.offers {
            may(Act::Leave);
        }
    }

    fn tests(&self, pair: u8, may: &mut impl FnMut(Act)) {
        may(Act::Test { pair, near: true });
        if self.0.may_miss {
            may(Act::Test { pair, near: false });
        }
    }

    /// A ring wakes any of those that are counted, as many as are called.
    fn rings(&self, state: &State, worker: u8, may: &mut impl FnMut(Act)) {
        let call = Call::of(&self.0, state, worker as usize);
        let counted = |holders: bool| {
            let workers = state.workers.iter().enumerate();
            let of_bell = workers.filter(|(_, worker)| {
                worker.is_counted_asleep() && worker.is_holder(&self.0) == holders
            });
            of_bell.fold(0_u8, |bits, (number, _)| bits | 1 << number)
        };
        let [others, holders] =
            [false, true].map(|holders| (counted(holders), call.woken(&self.0, state, holders)));
        let all = others.0 | holders.0;
        for woken in (0..=all).filter(|woken| woken & !all == 0) {
            let fits = |(bell, count): (u8, usize)| (woken & bell).count_ones() as usize == count;
            if fits(others) && fits(holders) {
                may(Act::Ring { woken });
            }
        }
    }

    /// Whether nobody will do anything unless the host does, though frames are left or workers are
    /// not between two steps.
    pub fn is_stuck(&self, state: &State) -> bool {
        let mut acts = vec![];
        for worker in 0..state.workers.len() {
            self.acts(state, worker as u8, &mut acts);
        }
        let by_host = |act: &Act| matches!(act, Act::Join | Act::Leave | Act::Release | Act::Share);
        if acts.iter().any(|(_, act)| !by_host(act)) {
            return false;
        }
        let at_rest = |at: At| matches!(at, At::Awake | At::Gone | At::Outside);
        !state.finished(&self.0) || !state.workers.iter().all(|worker| at_rest(worker.at))
    }
}

/// The names of the properties.
pub mod property {
    use crate::state::Rule;

    /// Invariant 5.
    pub const ACCESS: &str = "5 access: an update has its unit alone";
    /// Invariant 6.
    pub const TOKEN: &str = "6 token: as many as there are, and none renders without";
    /// Invariant 7.
    pub const PROGRESS: &str = "7 progress: nobody is stuck while frames are left";
    /// Of the shared renderer: a queued rendering waits for nobody who does anything else while another sleeps.
    pub const WAKES: &str =
        "7 progress: no queued rendering waits for other work while somebody sleeps";
    /// A swap holds nothing back that others could do.
    pub const SWAPS: &str =
        "7 progress: who swaps carries nothing and has called for what it queued";
    /// Not a property that may fail: the model comes to its end.
    pub const FINISHES: &str = "all frames are swapped";
    /// Nor this one: two frames are in flight.
    pub const OVERLAPS: &str = "a unit is updated while the frame before is not swapped";
    /// Nor this one.
    pub const SLEEPS: &str = "somebody sleeps while frames are left";

    /// The property that a broken rule breaks.
    pub const fn of(rule: Rule) -> &'static str {
        match rule {
            Rule::ExactlyOnce => "1 exactly once",
            Rule::Order => "2 order",
            Rule::Swap => "3 swap",
            Rule::TwoFrames => "4 two frames",
            Rule::Token => TOKEN,
        }
    }
}

impl Model for Protocol {
    type State = State;
    type Action = Action;

    fn init_states(&self) -> Vec<State> {
        vec![State::initial(&self.0)]
    }

    fn actions(&self, state: &State, actions: &mut Vec<Action>) {
        if state.broken.is_none() {
            for worker in 0..state.workers.len() {
                self.acts(state, worker as u8, actions);
            }
        }
    }

    fn next_state(&self, state: &State, (worker, act): Action) -> Option<State> {
        Some(Step::made(&self.0, state, worker as usize, act))
    }

    fn properties(&self) -> Vec<Property<Self>> {
        vec![
            Property::always(property::of(Rule::ExactlyOnce), |_, state: &State| {
                state.broken != Some(Rule::ExactlyOnce)
            }),
            Property::always(property::of(Rule::Order), |_, state: &State| {
                state.broken != Some(Rule::Order)
            }),
            Property::always(property::of(Rule::Swap), |_, state: &State| {
                state.broken != Some(Rule::Swap)
            }),
            Property::always(property::of(Rule::TwoFrames), |_, state: &State| {
                state.broken != Some(Rule::TwoFrames)
            }),
            Property::always(property::ACCESS, |model: &Self, state: &State| {
                state.access(&model.0)
            }),
            Property::always(property::TOKEN, |model: &Self, state: &State| {
                state.broken != Some(Rule::Token) && state.tokens(&model.0)
            }),
            Property::always(property::PROGRESS, |model: &Self, state: &State| {
                state.broken.is_some() || !model.is_stuck(state)
            }),
            Property::always(property::WAKES, |model: &Self, state: &State| {
                state.wakes_for_rendering(&model.0)
            }),
            Property::always(property::SWAPS, |_, state: &State| state.swaps_empty_handed()),
            Property::sometimes(property::FINISHES, |model: &Self, state: &State| {
                state.finished(&model.0)
            }),
            Property::sometimes(property::OVERLAPS, |_, state: &State| {
                let updating = |at: At| match at {
                    At::Updating(unit) => state.units[unit as usize].frame > state.display,
                    _ => false,
                };
                state.workers.iter().any(|worker| updating(worker.at))
            }),
            Property::sometimes(property::SLEEPS, |model: &Self, state: &State| {
                let asleep = state.workers.iter().any(|worker| worker.at == At::Asleep);
                asleep && !state.finished(&model.0)
            }),
        ]
    }
}
