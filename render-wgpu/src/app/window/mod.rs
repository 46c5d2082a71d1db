//! The window: an environment that a person watches and touches.
//!
//! The main thread is worker number 0, and the window stays with it. Frames run in short runs; between two
//! of them is done what cannot be done while frames run. Events are looked at after every frame.
//!
//! What is shown, and what a person can do to it, is a [`Scenario`]; all else is the same for all.

mod charts;
mod controls;
mod craniotomy;
mod hand;
mod input;
mod overlay;
mod pace;
mod paint;
mod particles;
mod stats;
mod surface;
mod view;

use std::sync::Arc;
use std::time::Duration;

use dualframe_render_wgpu::camera::Camera;
use dualframe_render_wgpu::look::Look;
use dualframe_sim::blocking::Grain;
use dualframe_sim::executor::{ExecutorError, ExecutorKind, FrameRecord, OnFrame};
use dualframe_sim::manager::{Settings, VeManager};
use dualframe_sim::scene::Scene;
use dualframe_sim::stages;
use dualframe_sim::timeline::Timeline;

use self::controls::{Controls, most_threads};
pub(super) use self::craniotomy::CraniotomyAtHand;
use self::hand::Hand;
pub(super) use self::particles::ParticlesAtHand;
use self::view::{Shown, View};
use super::args::{Products, Way, entry};
use super::error::RunError;
use super::manage::{Manage, Spent, go_on, manage, timeline_of};
use super::measure::Measure;
use super::outputs::Output;
use super::pictures;
use super::recording::Recording;
use super::told::Told;

/// How long a run of frames takes, about; usually 50 ms: so late may controls take effect.
const RUN_SECONDS: f32 = 0.05;
/// The most frames of a run.
const RUN_FRAMES: u64 = 32;
/// How long one waits for events while nothing moves.
const IDLE: Duration = Duration::from_millis(100);

/// What a window shows, and what a person can do to it.
pub(super) trait Scenario {
    /// The person's hand.
    type Hand: Hand;

    /// Its usual broad phase.
    const GRAIN: Grain;

    /// What it looks like, and from where it is seen at first.
    fn look(&self) -> (Look, Camera);

    /// The environment, to begin anew.
    fn build(&self, hand: &Self::Hand) -> Result<Scene, RunError>;

    /// It is begun anew, in an environment that was built for it.
    fn begin_anew(&mut self, hand: &Self::Hand);

    /// Does what is new in the hand's part of the overlay.
    fn apply(&mut self, hand: &Self::Hand, manager: &mut VeManager, recording: &mut Recording<'_>);

    /// Advances by so many frames or fewer, but one at least.
    fn advance(
        &mut self,
        view: &mut View<Self::Hand>,
        manager: &mut VeManager,
        recording: &mut Recording<'_>,
        frames: u64,
        on_frame: &mut OnFrame<'_>,
    ) -> Result<(), ExecutorError>;

    /// Does what takes the environment out of its manager, and gives back one in which it is.
    fn tend(
        &mut self,
        view: &mut View<Self::Hand>,
        manager: VeManager,
        recording: &mut Recording<'_>,
        manage: Manage<'_>,
    ) -> Result<VeManager, RunError>;
}

/// A window and the environment in it.
pub(super) struct Session<'a, S: Scenario> {
    scenario: S,
    view: View<S::Hand>,
    /// What the environment was last told.
    applied: Controls,
    /// As many threads as could be had.
    hired: usize,
    /// Whether the window has gone, since it failed.
    is_left: bool,
    way: &'a Way,
    spent: &'a Spent,
    told: &'a Told,
}

impl<'a, S: Scenario> Session<'a, S> {
    /// Opens a window, where one is wanted and possible, of a scenario and a hand that are made
    /// for it.
    ///
    /// # Errors
    /// No display, no window, no adapter that can draw to it, where one was asked for; what `make` says.
    pub(super) fn open(
        make: impl FnOnce() -> Result<(S, S::Hand), RunError>,
        (way, products): (&'a Way, &Products),
        time_step: f32,
        spent: &'a Spent,
        told: &'a Told,
    ) -> Result<Option<Self>, RunError> {
        if !products.prefers_window() {
            return Ok(None);
        }
        let (scenario, hand) = make()?;
        let controls = Controls::new(way);
        let shown = Shown {
            size: products.size,
            time_step: Duration::from_secs_f32(time_step),
            timeline: timeline_of(products, most_threads(way.threads)),
            hand,
        };
        match View::open(shown, scenario.look(), products.adapter.as_deref(), controls) {
            Ok(view) => {
                let (applied, hired) = (controls, way.threads);
                Ok(Some(Self { scenario, view, applied, hired, is_left: false, way, spent, told }))
            }
            Err(error) if products.window => Err(error.into()),
            Err(error) => {
                told.note(&format!(
                    "running without a window, since {error}; --picture FILE.png draws without one"
                ));
                Ok(None)
            }
        }
    }

    /// What tells what its workers do.
    pub(super) fn timeline(&self) -> Arc<Timeline> {
        Arc::clone(&self.view.timeline)
    }

    /// Runs the environment until the window is closed, so many frames are done, or they cannot go on; gives back the
    /// environment as it is then, and the scenario.
    ///
    /// # Errors
    /// No other manager could be made of an environment that was taken out of one, for other reasons than threads that
    /// cannot be had: it is lost.
    pub(super) fn run(
        mut self,
        mut manager: VeManager,
        mut recording: Recording<'_>,
        frames: Option<u64>,
        picture: Option<&Output>,
        measure: &mut Measure<'_>,
    ) -> Result<(VeManager, S), RunError> {
        self.view.turn_to(self.scenario.look(), manager.mailbox());
        let mut left = frames.unwrap_or(u64::MAX);
        while left > 0 && !self.is_over(frames) {
            manager = self.apply(manager, &mut recording, measure)?;
            let controls = &mut self.view.controls;
            let is_paused = controls.is_paused;
            let wanted = match (is_paused, std::mem::take(&mut controls.steps)) {
                (false, _) => self.frames_of_a_run(),
                (true, steps) => steps,
            };
            if wanted == 0 {
                self.stand_still(&manager);
                measure.interrupt();
                continue;
            }
            // Not before time goes on: what is told meanwhile would pile up.
            self.scenario.apply(&self.view.hand, &mut manager, &mut recording);
            let before = manager.frame();
            let advanced = self.advance(&mut manager, &mut recording, wanted.min(left), measure);
            let done = manager.frame() - before;
            left -= done;
            if is_paused {
                self.view.controls.steps += wanted - done;
            }
            match advanced.map_err(|error| self.goes_on_after(error)) {
                Ok(()) => self.hired = self.applied.threads,
                Err(true) => continue,
                Err(false) => break,
            }
            manager = self.tend(manager, &mut recording)?;
        }
        recording.end(&manager);
        if !self.has_failed()
            && let Some(file) = picture
        {
            self.take(&manager);
            self.told.attempt(pictures::write(self.view.picture(), file));
        }
        Ok((manager, self.scenario))
    }

    /// Whether it was closed, or nothing is to be seen any more and nobody said how many frames are to be done.
    fn is_over(&mut self, frames: Option<u64>) -> bool {
        self.view.is_closed() || (self.has_failed() && frames.is_none())
    }

    /// Whether the window has failed, which is told once.
    fn has_failed(&mut self) -> bool {
        if !self.is_left
            && let Some(failure) = self.view.failure()
        {
            self.told.failure(&failure.into());
            self.view.leave();
            self.is_left = true;
        }
        self.is_left
    }

    fn frames_of_a_run(&self) -> u64 {
        let frames = stats::lock(&self.view.stats).rate() * RUN_SECONDS;
        (frames as u64).clamp(1, RUN_FRAMES)
    }

    fn advance(
        &mut self,
        manager: &mut VeManager,
        recording: &mut Recording<'_>,
        frames: u64,
        measure: &mut Measure<'_>,
    ) -> Result<(), ExecutorError> {
        let stats = Arc::clone(&self.view.stats);
        let mut on_frame = |record: &FrameRecord| {
            stats::lock(&stats).note(record);
            measure.frame(record);
        };
        self.scenario.advance(&mut self.view, manager, recording, frames, &mut on_frame)
    }

    /// Says why frames could not run, and whether others can: where threads could not be had, with those that there
    /// were before.
    fn goes_on_after(&mut self, error: ExecutorError) -> bool {
        let asked = std::mem::replace(&mut self.view.controls.threads, self.hired);
        let goes_on = error.can_go_on() && asked != self.hired;
        self.told.failure(&error.into());
        goes_on
    }

    fn tend(
        &mut self,
        manager: VeManager,
        recording: &mut Recording<'_>,
    ) -> Result<VeManager, RunError> {
        let (settings, timeline, told) = (self.settings(), self.timeline(), self.told);
        let make = move |scene| go_on(scene, settings, Some(&timeline), told);
        let manage = Manage { make: &make, spent: self.spent };
        let manager = self.scenario.tend(&mut self.view, manager, recording, manage)?;
        self.show_executor(&manager);
        Ok(manager)
    }

    /// Shows by what the environment is run: not as was asked for, where that could not be had.
    fn show_executor(&mut self, manager: &VeManager) {
        let executor = manager.settings().executor;
        if std::mem::replace(&mut self.applied.executor, executor) != executor {
            self.view.controls.executor = executor;
        }
    }

    /// Takes all objects as they are, to be drawn.
    fn take(&mut self, manager: &VeManager) {
        self.view.show_next();
        manager.visit(&mut |object| stages::draw(object, &mut self.view));
    }

    /// Shows the environment as it is.
    fn stand_still(&mut self, manager: &VeManager) {
        self.take(manager);
        self.view.redraw();
        self.view.attend(IDLE);
        self.view.follow(false);
        self.view.interrupt();
    }

    /// Does what is new in the controls.
    fn apply(
        &mut self,
        mut manager: VeManager,
        recording: &mut Recording<'_>,
        measure: &mut Measure<'_>,
    ) -> Result<VeManager, RunError> {
        let (now, before) = (self.view.controls, self.applied);
        self.applied = now;
        let is_restarted = now.restarts != before.restarts;
        if is_restarted && let Some(other) = self.told.attempt(self.restart()) {
            if recording.end(&manager) {
                let frame = manager.frame();
                self.told.note(&format!("the recording ends before frame {frame}: started anew"));
            }
            self.spent.add(&manager.stage_seconds());
            manager = other;
        }
        let is_pipeline = now.executor == ExecutorKind::Pipeline;
        let is_rebuilt = now.executor != before.executor
            || (is_pipeline && now.frames_in_flight != before.frames_in_flight)
            || (!is_pipeline && now.threads != before.threads);
        if is_rebuilt {
            self.spent.add(&manager.stage_seconds());
            let (scene, timeline) = (manager.into_scene(), self.timeline());
            manager = go_on(scene, self.settings(), Some(&timeline), self.told)?;
            self.hired = self.applied.threads;
            self.show_executor(&manager);
        }
        if is_restarted || is_rebuilt {
            // That was no frame's time.
            self.view.interrupt();
            measure.interrupt();
        }
        manager.pool().resize(now.threads);
        Ok(manager)
    }

    /// Starts anew, if it can.
    fn restart(&mut self) -> Result<VeManager, RunError> {
        let scene = self.scenario.build(&self.view.hand)?;
        let manager = manage(scene, self.settings(), Some(&self.view.timeline))?;
        self.hired = self.applied.threads;
        self.scenario.begin_anew(&self.view.hand);
        self.view.turn_to(self.scenario.look(), manager.mailbox());
        Ok(manager)
    }

    /// What the person has set.
    fn settings(&self) -> Settings {
        let Controls { executor, threads, frames_in_flight, .. } = self.applied;
        let entry = entry(frames_in_flight);
        Settings { executor, threads, entry, ..self.way.settings(S::GRAIN) }
    }
}
