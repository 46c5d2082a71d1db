//! Sleeping, waking, leaving (`core/src/wait.rs`, and what a worker does about it).

use crate::config::{Bug, Config};
use crate::state::{At, State, Worker};
use crate::step::Step;
use crate::work::{Work, Works};

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
        self.end();
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
        self.goes_to(At::Leaving { gone });
    }

    pub(crate) fn hold(&mut self) {
        self.state.tokens -= 1;
        self.worker().holds = true;
        if self.state.tokens == 0 {
            self.state.workers.iter_mut().for_each(|worker| worker.offers = false);
        }
    }

    pub(crate) fn go_waiting(&mut self) {
        let next = match self.at() {
            At::Awake => At::Idle,
            At::Idle => At::Announced(false),
            At::Announced(_) if self.has_cause_to_wake() => At::Returning,
            At::Announced(rung) => At::Looked(rung),
            At::Looked(true) => At::Returning,
            At::Looked(false) => At::Asleep,
            At::Returning => At::Awake,
            at => unreachable!("nothing comes next at {at:?}"),
        };
        self.goes_to(next);
    }

    fn has_cause_to_wake(&self) -> bool {
        let worker = &self.state.workers[self.number];
        !self.config.has(Bug::NoSecondLook)
            && (self.state.visible(worker.holds).next().is_some()
                || self.state.finished(self.config))
    }

    /// Rings the bells for what was queued, and goes on.
    pub(crate) fn ring(&mut self, woken: u8) {
        for holders in [false, true] {
            if Call::of(self.config, &self.state, self.number).woken(&self.state, holders) == 0 {
                continue;
            }
            for (number, worker) in self.state.workers.iter_mut().enumerate() {
                worker.at = match worker.at {
                    at if worker.holds != holders => at,
                    At::Announced(_) => At::Announced(true),
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
            let is_render = |work: Work| matches!(work, Work::Render(_));
            renders += usize::from(state.visible(true).any(is_render));
            any += usize::from(state.visible(true).any(|work| !is_render(work)));
        }
        if config.has(Bug::WrongBell) {
            (any, renders) = (any + renders, 0);
        }
        Self { any, renders }
    }

    /// How many of a bell's sleepers this wakes: holders only for what the others are too few for,
    /// or to render.
    pub(crate) fn woken(self, state: &State, holders: bool) -> usize {
        let sleepers = |holders: bool| {
            let asleep = |worker: &&Worker| worker.is_counted_asleep() && worker.holds == holders;
            state.workers.iter().filter(asleep).count()
        };
        let others = sleepers(false).min(self.any);
        if holders { sleepers(true).min(self.any - others + self.renders) } else { others }
    }
}
