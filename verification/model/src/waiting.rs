//! Sleeping, waking, leaving (`core/src/wait.rs`, and what a worker does about it).

use crate::config::{Bug, Config};
use crate::state::{At, Because, State, Worker};
use crate::step::Step;
use crate::work::Works;

impl Step<'_> {
    /// What is carried goes to the queues.
    pub(crate) fn shed(&mut self) {
        let carried = std::mem::take(&mut self.worker().carried);
        for work in carried.iter() {
            self.state.queue.put(work);
            self.count_queued(work);
        }
    }

    pub(crate) fn share(&mut self) {
        self.shed();
        self.announce_between();
    }

    /// Announces what is queued ahead of a work unit.
    pub(crate) fn announce_between(&mut self) {
        if self.at() == At::GoingOn {
            self.announce(At::Calling, At::GoingOn);
        } else {
            self.end();
        }
    }

    /// Leaves, for good or without the token.
    pub(crate) fn leave(&mut self, gone: bool) {
        if gone {
            self.state.departures -= 1;
        } else {
            self.state.handovers -= 1;
        }
        if self.config.has(Bug::LeaverDropsCarried) {
            self.worker().carried = Works::default();
        }
        self.shed();
        let puts_back = self.config.shared && self.worker().holds;
        self.goes_to(if puts_back && !self.config.has(Bug::LeavesWithRenderer) {
            At::PuttingBack(Because::Leaves)
        } else {
            At::Leaving { gone }
        });
    }

    pub(crate) fn hold(&mut self) {
        self.state.tokens -= 1;
        self.worker().holds = true;
        if self.state.tokens == 0 {
            self.state.workers.iter_mut().for_each(|worker| worker.offers = false);
        }
    }

    pub(crate) fn go_waiting(&mut self) {
        if self.at() == At::GoingOn && !self.worker().carried.is_empty() {
            return self.queue_kept();
        }
        let holds = self.worker().holds;
        let next = match self.at() {
            At::GoingOn if !self.config.sleep => At::Awake,
            At::Awake | At::GoingOn => At::Idle,
            At::Idle => At::Announced(false),
            At::Announced(rung) if self.config.shared => {
                At::Glanced { rung, free: self.state.tokens > 0 }
            }
            At::Announced(rung) => self.looked(rung, holds),
            At::Glanced { rung, free } => self.looked(rung, free),
            At::Looked(true) => At::Returning,
            At::Looked(false) => At::Asleep,
            At::Returning => At::Awake,
            at => unreachable!("nothing comes next at {at:?}"),
        };
        self.goes_to(next);
    }

    /// Nobody else sees the renderings that it keeps, which are all that it carries.
    fn queue_kept(&mut self) {
        if self.config.has(Bug::SleepsWithRendering) {
            self.goes_to(At::Idle);
        } else {
            self.shed();
            self.announce(At::RingingToSleep, At::Idle);
        }
    }

    /// Has looked for work, for renderings too if it `renders`.
    fn looked(&self, rung: bool, renders: bool) -> At {
        let has_cause_to_wake =
            self.state.anything_is_visible(renders) || self.state.finished(self.config);
        if has_cause_to_wake && !self.config.has(Bug::NoSecondLook) {
            At::Returning
        } else {
            At::Looked(rung)
        }
    }

    /// Rings the bells for what was queued, and goes on.
    pub(crate) fn ring(&mut self, woken: u8) {
        for holders in [false, true] {
            let call = Call::of(self.config, &self.state, self.number);
            if call.woken(self.config, &self.state, holders) == 0 {
                continue;
            }
            for (number, worker) in self.state.workers.iter_mut().enumerate() {
                worker.at = match worker.at {
                    at if worker.is_holder(self.config) != holders => at,
                    At::Announced(_) => At::Announced(true),
                    At::Glanced { free, .. } => At::Glanced { rung: true, free },
                    At::Looked(_) => At::Looked(true),
                    At::Asleep if woken >> number & 1 == 1 => At::Returning,
                    at => at,
                };
            }
        }
        let doubled = self.config.has(Bug::TokenDoubled);
        let leaving = self.at();
        let worker = self.worker();
        (worker.queued, worker.renders, worker.at) = (0, 0, At::Awake);
        match leaving {
            At::Calling => worker.at = At::GoingOn,
            At::RingingToSwap => worker.at = At::Swapping,
            At::RingingToSleep => worker.at = At::Idle,
            At::Leaving { gone: true } => worker.at = At::Gone,
            At::Leaving { gone: false } => {
                (worker.holds, worker.offers) = (doubled, true);
                self.state.tokens += 1;
            }
            _ => {}
        }
    }
}

/// How many work units are announced: those that every worker can do, and those of holders only.
#[derive(Clone, Copy)]
pub(crate) struct Call {
    any: usize,
    renders: usize,
}

impl Call {
    /// What worker `number` announces. One that leaves also announces what it leaves behind: it
    /// may have been woken for that.
    pub(crate) fn of(config: &Config, state: &State, number: usize) -> Self {
        let worker = &state.workers[number];
        let (mut any, mut renders) = (worker.queued as usize, worker.renders as usize);
        if matches!(worker.at, At::Leaving { .. }) && !config.has(Bug::LeaverSwallowsCall) {
            let called = if config.renderings_call_holders() { &mut renders } else { &mut any };
            *called += usize::from(state.rendering_is_visible());
            any += usize::from(state.anything_is_visible(false));
        }
        if config.has(Bug::WrongBell) {
            (any, renders) = (any + renders, 0);
        }
        Self { any, renders }
    }

    /// How many of a bell's sleepers this wakes: holders only for what the others are too few for,
    /// or to render.
    pub(crate) fn woken(self, config: &Config, state: &State, holders: bool) -> usize {
        let sleepers = |holders: bool| {
            let asleep = |worker: &&Worker| {
                worker.is_counted_asleep() && worker.is_holder(config) == holders
            };
            state.workers.iter().filter(asleep).count()
        };
        let others = sleepers(false).min(self.any);
        if holders { sleepers(true).min(self.any - others + self.renders) } else { others }
    }
}
