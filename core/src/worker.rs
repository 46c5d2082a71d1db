//! Workers: one step, one work unit (§5.3).

use crate::carry::Carry;
use crate::environment::Environment;
use crate::error::TableFull;
use crate::migrate::migrate;
use crate::pipeline::Pipeline;
use crate::probe::{NoProbe, Probe};
use crate::stage::Stage;
use crate::sync::seeded;
use crate::token::Token;
use crate::unit::{UnitId, Work};
use crate::wait::{Spin, Waiting};

/// What a step did.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Step {
    /// One work unit of this stage.
    Worked(Stage),
    /// Nothing: no work was visible, but for updates that are left to the workers of other homes for some steps. A hint,
    /// and may be stale.
    ///
    /// For a worker that has found nothing, others queue what they would else carry on. One that will not step again
    /// for long, as in a task that runs once a period, had better be dropped.
    Idle,
}

/// A worker, driven by its host: in a thread, a task, an interrupt-driven loop, a simulator.
///
/// Dropping it is leaving: what it carries goes to the queues, and the others carry on. One that holds a token drops
/// that and the renderer, too; then nothing is rendered until another holds one.
#[must_use = "dropping it is leaving"]
pub struct Worker<'p, 'm, E: Environment, W: Waiting = Spin, P: Probe = NoProbe> {
    carry: Carry<'p, 'm, E, W>,
    stage: Stage,
    token: Option<Token<'p, E::Renderer>>,
    probe: P,
}

impl<'p, 'm, E: Environment, W: Waiting, P: Probe> Worker<'p, 'm, E, W, P> {
    pub(crate) fn new(pipeline: &'p Pipeline<'m, E, W>, home: u32, probe: P) -> Self {
        let carry = Carry::new(pipeline, home);
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

    /// Takes the token away, to give it to another worker. As one that is dropped does, the worker queues all that it
    /// carries, puts a shared renderer back and wakes whoever that is for.
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
            // A rendering may have been put back; and nobody else sees those that are kept.
            if seeded!(SleepsWithRendering) {
                self.carry.announce();
            } else {
                self.carry.let_go();
            }
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
            (Work::Render(unit), Some(token)) => {
                pipeline.render(env, unit, token.renderer(), &mut self.carry)
            }
            (Work::Render(unit), None) if self.carry.renders_shared => {
                self.render_shared(env, unit)
            }
            // A rendering comes to holders only.
            (Work::Render(_), None) => {
                self.carry.queue(work);
                Ok(())
            }
        };
        self.probe.end(work, frame);
        self.carry.announce();
        outcome.map(|()| Step::Worked(self.stage))
    }

    /// Renders by the shared renderer, which this worker has.
    fn render_shared(&mut self, env: &E, unit: UnitId) -> Result<(), E::Error> {
        let Self { carry, .. } = self;
        let pipeline = carry.pipeline;
        // If the callback panics, nobody else is to have what it leaves of the renderer.
        carry.renders_shared = false;
        // SAFETY: this worker took it, and has not put it back.
        let outcome = unsafe {
            pipeline.shared.with_mut(|renderer| match renderer {
                Some(renderer) => pipeline.render(env, unit, renderer, carry),
                // It is there as long as it is offered.
                None => Ok(()),
            })
        };
        carry.renders_shared = true;
        outcome
    }

    /// What is carried, or what migration finds (Fig. 8).
    fn next_work(&mut self) -> Option<Work> {
        let pipeline = self.carry.pipeline;
        self.carry.share_renderer();
        // What this worker updated first: it is in this core's cache.
        if !self.carry.has_rendering()
            && let Some(work) = self.carry.take_kept()
        {
            return Some(work);
        }
        let holder = self.token.is_some() || self.carry.renders_shared;
        // Rendering first: only holders can, and a chain of carry-overs must not starve it.
        if holder
            && !seeded!(CarriedBeforeRendering)
            && !self.carry.has_rendering()
            && pipeline.render_visible()
            && let Some(work) = self.carry.pop_render()
        {
            return Some(work);
        }
        // All that was seen is rendered, by somebody else: no rendering is to wait for what this worker does instead.
        if !self.carry.has_rendering() && !seeded!(GoesOnWithRenderer) {
            self.carry.gives_renderer_up();
        }
        let holder = self.token.is_some() || self.carry.renders_shared;
        if let Some(work) = self.carry.take() {
            return Some(work);
        }
        // Visible work may be gone when it is popped: look again, but only so often, so that a step is bounded.
        let homes = &pipeline.tables.queues.homes;
        for number in homes.round_by_way_of(self.carry.home) {
            // Who has nothing left at home may find what takes long: no rendering is to wait for that.
            if number != self.carry.home && !seeded!(TakesRenderingElsewhere) {
                self.carry.queue_kept();
            }
            for _ in Stage::ALL {
                let updates = self.carry.takes_updates_of(number);
                let visible = pipeline.visible(homes.at(number), updates, holder);
                let Some(stage) = migrate(self.stage, visible) else { break };
                if let Some(work) = self.carry.pop(number, stage) {
                    return Some(work);
                }
            }
        }
        None
    }

    /// Whether a step would find work now, or this worker has the shared renderer to put back, or the pipeline is at
    /// rest.
    pub fn has_cause_to_wake(&self) -> bool {
        let pipeline = self.carry.pipeline;
        let renders = self.token.is_some() || pipeline.shared.is_free();
        !self.carry.is_empty()
            || (self.carry.renders_shared && !seeded!(SleepsWithRenderer))
            || (renders && pipeline.render_visible())
            || pipeline.visible_anywhere(self.carry.home)
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
