//! Workers: one step, one work unit (§5.3).

use heapless::{Deque, Vec};

use crate::environment::Environment;
use crate::error::TableFull;
use crate::migrate::migrate;
use crate::pipeline::Pipeline;
use crate::probe::{NoProbe, Probe};
use crate::stage::{Stage, Stages};
use crate::sync::{fence, seeded, site};
use crate::tables::Home;
use crate::token::Token;
use crate::unit::{InteractionId, UnitId, Work};
use crate::wait::{Spin, Waiting};

/// What a step did.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Step {
    /// One work unit of this stage.
    Worked(Stage),
    /// Nothing: no work was visible. A hint, and may be stale.
    Idle,
}

/// Takes what a work unit sets free.
pub(crate) trait Outputs {
    /// `work` can be done now, by this worker too.
    fn emit(&mut self, work: Work);
    /// `work` is for whoever comes for it first: this worker cannot do it now, or is not to keep it.
    fn queue(&mut self, work: Work);
    /// Work that was queued already can be done now, by holders.
    fn renders_visible(&mut self);
    /// The pipeline is at rest.
    fn all_done(&mut self);
}

/// Interactions, and other work units, that a worker may carry at once: more than one block has neighbours,
/// so that a unit's interactions need no queue. Usually 32; beyond it they are queued.
#[cfg(not(loom))]
const MOST_CARRIED: usize = 32;
/// Nobody else sees what is carried: what is queued is what models are about.
#[cfg(loom)]
const MOST_CARRIED: usize = 1;

/// Interactions of the frame being gathered that a worker keeps while it can update: what it does when
/// nothing is left but updates that others are at, for which the frame's opening waits. Usually 16, about
/// an update's time.
const RESERVE: usize = MOST_CARRIED / 2;

/// Carry-over (§4.2): outputs are carried as long as nobody is hungry; and how many sleepers what was
/// queued is to wake.
struct Carry<'p, 'm, E: Environment, W: Waiting> {
    pipeline: &'p Pipeline<'m, E, W>,
    /// Interactions, oldest first.
    interactions: Deque<InteractionId, MOST_CARRIED>,
    /// All else, newest first.
    works: Vec<Work, MOST_CARRIED>,
    queued: u32,
    renders: u32,
    /// Whether this worker is counted among the hungry.
    hungry: bool,
    home: u32,
}

impl<E: Environment, W: Waiting> Carry<'_, '_, E, W> {
    #[inline]
    fn is_empty(&self) -> bool {
        self.works.is_empty() && self.interactions.is_empty()
    }

    /// Gives what is carried to whoever comes first.
    fn shed(&mut self) {
        while let Some(id) = self.interactions.pop_front() {
            self.queue(Work::Interact(id));
        }
        while let Some(work) = self.works.pop() {
            self.queue(work);
        }
    }

    /// Gives what is carried to those who found nothing to do, if there are any.
    #[inline]
    fn share(&mut self) {
        if !self.is_empty() && self.pipeline.bells.somebody_is_hungry() {
            self.shed();
            self.announce();
        }
    }

    /// Carries `work`, if there is room for it.
    #[inline]
    fn carry(&mut self, work: Work) -> bool {
        if let Work::Interact(id) = work {
            return self.interactions.push_back(id).is_ok();
        }
        if self.works.push(work).is_err() {
            return false;
        }
        // A rendering stays on top: only holders can do it.
        if let [.., below @ Work::Render(_), top] = self.works.as_mut_slice() {
            ::core::mem::swap(below, top);
        }
        true
    }

    /// The next that is carried, or an update at home: first what others wait for.
    fn take(&mut self) -> Option<Work> {
        let Some(&id) = self.interactions.front() else { return self.works.pop() };
        let oldest = Work::Interact(id);
        // Updates wait for the open frame's; for the next frame's nobody does before it is open.
        let is_awaited = self.pipeline.frame_of(oldest) == self.pipeline.window.open();
        let before_updates = is_awaited || self.interactions.len() > RESERVE;
        let other = match self.works.last() {
            Some(Work::Update(_)) | None if before_updates => None,
            Some(_) => self.works.pop(),
            None => self.pop_update(),
        };
        other.or_else(|| self.interactions.pop_front().map(Work::Interact))
    }

    /// An update that is queued at this worker's home.
    #[inline]
    fn pop_update(&mut self) -> Option<Work> {
        let home = self.pipeline.tables.queues.homes.at(self.home);
        if home.update.looks_empty() { None } else { self.pop(home, Stage::Update) }
    }

    /// A work unit of `stage` that is queued at a home or for everybody.
    #[inline]
    fn pop(&mut self, home: &Home<'_>, stage: Stage) -> Option<Work> {
        let interact = &self.pipeline.tables.queues.interact;
        match stage {
            Stage::BroadPhase => home.enter.pop().map(|unit| Work::Enter(UnitId(unit))),
            Stage::Interaction => interact.pop().map(|id| Work::Interact(InteractionId(id))),
            Stage::Update => home.update.pop().map(|unit| Work::Update(UnitId(unit))),
            Stage::Render => self.pop_render(),
        }
    }

    /// A unit of the frame on display. Another holder may have swapped since `display` was read, and the
    /// queue may then hold units of a frame that may not be rendered yet: those go back, and who has
    /// looked for them in vain meanwhile is called.
    fn pop_render(&mut self) -> Option<Work> {
        let display = self.pipeline.window.display();
        let queue = &self.pipeline.tables.queues.render[display.parity()];
        let unit = UnitId(queue.pop()?);
        let work = Work::Render(unit);
        if self.pipeline.rendered_frame(unit) == display || seeded!(TagNotChecked) {
            return Some(work);
        }
        self.queue(work);
        None
    }

    /// Whether `unit` is another home's, whose worker is to have it if it comes for it in time.
    #[inline]
    fn is_at_home_elsewhere(&self, unit: UnitId) -> bool {
        self.pipeline.tables.home_of(unit) != self.home
    }

    /// Counts this worker among the hungry, or not.
    #[inline]
    fn set_hungry(&mut self, hungry: bool) {
        if self.hungry != hungry {
            self.hungry = hungry;
            self.pipeline.bells.count_hungry(hungry);
        }
    }

    /// Gives away what is carried, and any call that this worker was woken by and has not
    /// answered: whoever called counted on it, and may sleep or have left by now.
    fn leave(&mut self) {
        self.set_hungry(false);
        if seeded!(LeavesWithCarry) {
            self.works.clear();
            self.interactions.clear();
        }
        self.shed();
        if seeded!(CallNotPassedOn) {
            return self.announce();
        }
        // Whoever still counts this worker among the sleepers has queued its work before this.
        fence(site::FENCE_LEAVE);
        let left = self.pipeline.visible_anywhere(true);
        self.renders += u32::from(left.contains(Stage::Render));
        self.queued += u32::from(left.without(Stage::Render) != Stages::NONE);
        self.announce();
    }

    fn announce(&mut self) {
        if seeded!(BatchNotFlushed) && self.queued + self.renders < 3 {
            return;
        }
        if self.queued > 0 || self.renders > 0 {
            self.pipeline.bells.announce(&self.pipeline.waiting, self.queued, self.renders);
            (self.queued, self.renders) = (0, 0);
        }
    }
}

impl<E: Environment, W: Waiting> Outputs for Carry<'_, '_, E, W> {
    #[inline]
    fn emit(&mut self, work: Work) {
        if matches!(work, Work::Update(unit) if self.is_at_home_elsewhere(unit)) {
            self.queue(work);
            return;
        }
        // One work unit is for this worker itself.
        if (!self.is_empty() && self.pipeline.bells.somebody_is_hungry()) || !self.carry(work) {
            self.queue(work);
        }
    }

    #[inline]
    fn queue(&mut self, work: Work) {
        self.pipeline.push(work);
        match Stage::of(work) {
            Stage::Render => self.renders += 1,
            _ => self.queued += 1,
        }
    }

    fn renders_visible(&mut self) {
        self.renders = u32::MAX / 2;
    }

    fn all_done(&mut self) {
        (self.queued, self.renders) = (u32::MAX / 2, u32::MAX / 2);
    }
}

/// A worker, driven by its host: in a thread, a task, an interrupt-driven loop, a simulator.
///
/// Dropping it is leaving: what it carries goes to the queues, and the others carry on.
pub struct Worker<'p, 'm, E: Environment, W: Waiting = Spin, P: Probe = NoProbe> {
    carry: Carry<'p, 'm, E, W>,
    stage: Stage,
    token: Option<Token<'p, E::Renderer>>,
    probe: P,
}

impl<'p, 'm, E: Environment, W: Waiting, P: Probe> Worker<'p, 'm, E, W, P> {
    pub(crate) fn new(pipeline: &'p Pipeline<'m, E, W>, home: u32, probe: P) -> Self {
        let carry = Carry {
            pipeline,
            works: Vec::new(),
            interactions: Deque::new(),
            queued: 0,
            renders: 0,
            hungry: false,
            home,
        };
        Self { carry, stage: Stage::BroadPhase, token: None, probe }
    }

    /// This worker, watched by `probe` from now on.
    pub fn probed<Q: Probe>(self, probe: Q) -> Worker<'p, 'm, E, W, Q> {
        let Self { carry, stage, token, .. } = self;
        Worker { carry, stage, token, probe }
    }

    /// Gives this worker the right to render, and its renderer.
    ///
    /// # Errors
    /// The token back, if it is another pipeline's or if this worker has one.
    pub fn hold(&mut self, token: Token<'p, E::Renderer>) -> Result<(), Token<'p, E::Renderer>> {
        if self.token.is_some() || !token.is_from(&self.carry.pipeline.office) {
            return Err(token);
        }
        self.token = Some(token);
        Ok(())
    }

    /// Takes the token away, to give it to another worker.
    pub fn release(&mut self) -> Option<Token<'p, E::Renderer>> {
        // A carried rendering stays behind for the next holder.
        self.carry.leave();
        self.token.take()
    }

    /// The renderer of the token that this worker holds, to reach it between two steps.
    pub fn renderer(&mut self) -> Option<&mut E::Renderer> {
        self.token.as_mut().map(Token::renderer)
    }

    /// The probe.
    pub fn probe(&mut self) -> &mut P {
        &mut self.probe
    }

    /// Does at most one work unit and says what it did.
    ///
    /// # Errors
    /// The callback's error, or a full table of candidates. The work unit counts as done either
    /// way, and the pipeline is sound: stepping may go on. Where a frame's last rendering and its
    /// swap both fail, the rendering's error is returned.
    pub fn step(&mut self, env: &E) -> Result<Step, E::Error> {
        let Some(work) = self.next_work() else {
            self.carry.set_hungry(true);
            // A rendering may have been put back.
            self.carry.announce();
            return Ok(Step::Idle);
        };
        self.carry.set_hungry(false);
        self.carry.share();
        self.stage = Stage::of(work);
        let pipeline = self.carry.pipeline;
        let frame = pipeline.frame_of(work);
        self.probe.begin(work, frame);
        let outcome = match (work, &mut self.token) {
            (Work::Enter(unit), _) => pipeline
                .enter(env, unit, &mut self.carry)
                .map_err(<E::Error as From<TableFull>>::from),
            (Work::Interact(id), _) => pipeline.interact(env, id, &mut self.carry),
            (Work::Update(unit), token) => {
                pipeline.update(env, unit, token.is_some(), &mut self.carry)
            }
            (Work::Render(unit), Some(token)) => pipeline.render(env, unit, token, &mut self.carry),
            (Work::Render(_), None) => {
                self.carry.queue(work);
                Ok(())
            }
        };
        self.probe.end(work, frame);
        self.carry.announce();
        outcome.map(|()| Step::Worked(self.stage))
    }

    /// What is carried, or what migration finds (Fig. 8).
    fn next_work(&mut self) -> Option<Work> {
        let pipeline = self.carry.pipeline;
        let holder = self.token.is_some();
        // Rendering first: only holders can, and a chain of carry-overs must not starve it.
        if holder
            && !seeded!(CarriedBeforeRendering)
            && !matches!(self.carry.works.last(), Some(Work::Render(_)))
            && pipeline.render_visible()
            && let Some(work) = self.carry.pop_render()
        {
            return Some(work);
        }
        if let Some(work) = self.carry.take() {
            return Some(work);
        }
        // Visible work may be gone when it is popped: look again, but no stage more than once,
        // so that a step is bounded.
        for home in pipeline.tables.queues.homes.from(self.carry.home) {
            for _ in Stage::ALL {
                let Some(stage) = migrate(self.stage, pipeline.visible(home, holder)) else {
                    break;
                };
                if let Some(work) = self.carry.pop(home, stage) {
                    return Some(work);
                }
            }
        }
        None
    }

    /// Whether a step would find work now, or the pipeline is at rest.
    pub fn has_cause_to_wake(&self) -> bool {
        let pipeline = self.carry.pipeline;
        !self.carry.is_empty()
            || !pipeline.visible_anywhere(self.token.is_some()).is_empty()
            || pipeline.finished()
    }

    /// Sleeps, in the host's way of [`Waiting`], until there is cause to wake; may return earlier.
    pub fn wait(&self) {
        let pipeline = self.carry.pipeline;
        let bells = &pipeline.bells;
        let bell = if self.token.is_some() { &bells.holders } else { &bells.others };
        bell.sleep_unless(&pipeline.waiting, || self.has_cause_to_wake());
    }
}

impl<E: Environment, W: Waiting> Drop for Carry<'_, '_, E, W> {
    fn drop(&mut self) {
        self.leave();
    }
}
