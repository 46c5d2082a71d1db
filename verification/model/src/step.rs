//! A transition: what a worker does, and what has to hold when it begins a work unit.

use crate::config::{BroadPhase, Bug, Config};
use crate::state::{At, Rule, State, Then, Worker};
use crate::work::{Work, indices};

/// What a worker does. Where something is set free, `carry` says whether it is carried or queued.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Act {
    /// The host makes the worker.
    Join,
    /// The host drops the worker.
    Leave,
    /// The host takes the worker's token.
    Release,
    /// The host gives the worker a token.
    Hold,
    /// The worker gives what it carries to the queues.
    Share,
    /// It looks for renderings: it is about to take the shared renderer, or to put it back.
    Turn,
    /// It takes a unit of the open frame that nobody has come for.
    Come(u8),
    /// It begins a work unit.
    Take(Work),
    /// It tests a pair, which is a candidate or not.
    Test {
        /// The pair.
        pair: u8,
        /// Whether it is a candidate.
        near: bool,
    },
    /// The callback that it is in returns.
    Call {
        /// Carry.
        carry: bool,
    },
    /// It makes its next arrival, or whatever else comes next.
    Go {
        /// Carry.
        carry: bool,
    },
    /// It announces what it queued; a bit for each worker that this wakes.
    Ring {
        /// Who is woken, if asleep.
        woken: u8,
    },
}

/// A transition of one worker.
pub(crate) struct Step<'c> {
    pub(crate) config: &'c Config,
    pub(crate) state: State,
    pub(crate) number: usize,
    carry: bool,
}

impl<'c> Step<'c> {
    /// The state after worker `number` has done `act`, which must be possible.
    pub(crate) fn made(config: &'c Config, state: &State, number: usize, act: Act) -> State {
        let carry = matches!(act, Act::Call { carry: true } | Act::Go { carry: true });
        let mut step = Self { config, state: state.clone(), number, carry };
        match act {
            Act::Join => step.worker().at = At::Awake,
            Act::Leave => step.leave(true),
            Act::Release => step.leave(false),
            Act::Hold => step.hold(),
            Act::Share => step.share(),
            Act::Turn => step.turn(),
            Act::Come(unit) => step.come(unit),
            Act::Take(work) => step.take(work),
            Act::Test { pair, near } => step.test(pair, near),
            Act::Call { .. } => step.call(),
            Act::Go { .. } => step.go(),
            Act::Ring { woken } => step.ring(woken),
        }
        step.state
    }

    pub(crate) fn worker(&mut self) -> &mut Worker {
        &mut self.state.workers[self.number]
    }

    pub(crate) fn at(&self) -> At {
        self.state.workers[self.number].at
    }

    pub(crate) fn goes_to(&mut self, at: At) {
        self.worker().at = at;
    }

    pub(crate) fn claim(&mut self, rule: Rule, holds: bool) {
        if !holds {
            self.state.broken.get_or_insert(rule);
        }
    }

    /// The work unit is done; what it has queued is announced.
    pub(crate) fn end(&mut self) {
        self.announce(At::Ringing, At::Awake);
    }

    /// Announces, at `ringing`, what is queued, if anybody may sleep, and goes on to `next`.
    pub(crate) fn announce(&mut self, ringing: At, next: At) {
        let sleep = self.config.sleep;
        let worker = self.worker();
        let silent = !sleep || worker.queued + worker.renders == 0;
        if silent {
            (worker.queued, worker.renders) = (0, 0);
        }
        self.goes_to(if silent { next } else { ringing });
    }

    /// `work` is free: carried, or queued.
    pub(crate) fn emit(&mut self, work: Work) {
        let elsewhere = self.state.workers.iter().any(|worker| worker.carried.has(work));
        self.claim(Rule::ExactlyOnce, !elsewhere && !self.state.queue.has(work));
        if self.carry {
            self.worker().carried.put(work);
        } else {
            self.state.queue.put(work);
            self.count_queued(work);
        }
    }

    pub(crate) fn count_queued(&mut self, work: Work) {
        let (config, worker) = (self.config, &mut self.state.workers[self.number]);
        let most = config.workers;
        let calls_holders = work.is_rendering() && config.renderings_call_holders();
        let count = if calls_holders { &mut worker.renders } else { &mut worker.queued };
        *count = (*count + 1).min(most);
    }

    /// `work` is free, and not for this worker.
    pub(crate) fn queue(&mut self, work: Work) {
        let carry = std::mem::replace(&mut self.carry, false);
        self.emit(work);
        self.carry = carry;
    }

    /// Comes for `unit`, whose frame is open.
    fn come(&mut self, unit: u8) {
        self.state.opened &= !(1 << unit);
        let turned = self.at() == At::GoingOn;
        self.goes_to(At::Coming { unit, turned });
    }

    /// Takes the opening off `unit`'s countdown, and updates it, or lets it go, if it waits for nothing else.
    pub(crate) fn came(&mut self, unit: u8, turned: bool) {
        if self.take_off(unit) || self.config.has(Bug::UpdatedWhenOpened) {
            self.emit(Work::Update(unit));
        }
        self.goes_to(if turned { At::GoingOn } else { At::Awake });
        self.announce_between();
    }

    fn take(&mut self, work: Work) {
        let keeps = self.config.has(Bug::QueueKeeps) && matches!(work, Work::Render(_));
        if !self.worker().carried.take(work) && !keeps {
            self.state.queue.take(work);
        }
        let at = match work {
            Work::Enter(unit) => self.begin_entering(unit),
            Work::Interact(pair) => {
                self.claim(Rule::ExactlyOnce, self.state.found >> pair & 1 == 1);
                At::Interacting(pair)
            }
            Work::Update(unit) => {
                self.check_update(unit);
                At::Updating(unit)
            }
            Work::Render(unit) => {
                let drawn = *self.state.unit(unit);
                let display = self.state.display;
                self.claim(Rule::ExactlyOnce, drawn.rendered + 1 == drawn.frame);
                self.claim(Rule::Swap, drawn.frame == display + 1);
                let holds = self.worker().holds;
                self.claim(Rule::Token, holds);
                At::Rendering(unit)
            }
        };
        self.goes_to(at);
    }

    fn begin_entering(&self, unit: u8) -> At {
        if self.config.bypasses(unit) {
            return At::AtGate(unit, Then::End);
        }
        match self.config.broad_phase {
            BroadPhase::Spatial => At::Entering(unit),
            BroadPhase::Pairwise => At::Arriving(unit, self.config.pairs_of(unit)),
        }
    }

    fn check_update(&mut self, unit: u8) {
        let updated = *self.state.unit(unit);
        let pairs = self.config.pairs_of(unit);
        let tested = |pair: u32| self.state.tests[pair as usize] == updated.frame + 1;
        let all_tested = self.config.bypasses(unit) || indices(pairs).all(tested);
        let waits = self.state.found & pairs != 0;
        self.claim(Rule::Order, all_tested && !waits && updated.rendered == updated.frame);
        self.claim(Rule::TwoFrames, updated.frame < self.state.display + 2);
        self.claim(Rule::ExactlyOnce, updated.frame < self.config.frames);
    }
}
