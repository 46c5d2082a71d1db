//! The window: an environment that a person watches and touches.
//!
//! The main thread is worker number 0 and holds the render token. Frames run in short runs; between two
//! of them is done what cannot be done while frames run. Events are looked at after every frame.

mod charts;
mod controls;
mod hand;
mod input;
mod overlay;
mod pace;
mod paint;
mod stats;
mod surface;
mod view;

use std::fs::File;
use std::rc::Rc;
use std::sync::Arc;
use std::time::Duration;

use dualframe_render_wgpu::error::GraphicsError;
use dualframe_sim::blocking::Grain;
use dualframe_sim::executor::{ExecutorKind, FrameRecord};
use dualframe_sim::manager::{Settings, VeManager};
use dualframe_sim::message::Message;
use dualframe_sim::object::ObjectId;
use dualframe_sim::record::Control;
use dualframe_sim::scene::{ParticleScene, Scene};
use dualframe_sim::stages;
use dualframe_sim::timeline::Timeline;
use glam::Vec3;

use self::controls::Controls;
pub(super) use self::controls::most_threads;
use self::view::{Shown, View};
use crate::app::args::Particles;
use crate::app::particles::{self, RunError};
use crate::app::pictures;
use crate::app::recording::Recording;

/// How long a run of frames takes, about; usually 50 ms: so late may controls take effect.
const RUN_SECONDS: f32 = 0.05;
/// The most frames of a run.
const RUN_FRAMES: u64 = 32;
/// How long one waits for events while nothing moves.
const IDLE: Duration = Duration::from_millis(100);
/// The stiffness of springs to the centre over that of springs between nodes, in particles.
const CENTER_STIFFNESS: f32 = 5.0;

/// A window and the environment in it.
pub(super) struct Session<'a> {
    args: &'a Particles,
    view: View,
    /// What the environment was last told.
    applied: Controls,
    /// Its particles.
    objects: usize,
    /// Is told what the person at the terminal should know.
    note: &'a dyn Fn(&str),
}

impl<'a> Session<'a> {
    /// Opens a window.
    ///
    /// # Errors
    /// No display, no window, no adapter that can draw to it.
    pub(super) fn open(
        args: &'a Particles,
        timeline: Arc<Timeline>,
        note: &'a dyn Fn(&str),
    ) -> Result<Self, GraphicsError> {
        let scene = particles::scene_of(args, args.objects);
        let shown = Shown {
            title: "dualframe".to_owned(),
            size: args.products.size,
            focus: scene.room(),
            time_step: Duration::from_secs_f32(ParticleScene::TIME_STEP),
            timeline,
        };
        let controls = Controls::new(args);
        let view = View::open(shown, args.products.adapter.as_deref(), controls)?;
        Ok(Self { args, view, applied: controls, objects: args.objects, note })
    }

    /// Runs the environment until the window is closed, or so many frames are done; gives back the
    /// environment as it is then.
    ///
    /// # Errors
    /// The executor cannot go on, or the window can no longer be drawn to.
    pub(super) fn run(
        mut self,
        mut manager: VeManager,
        mut recording: Recording<'_>,
        frames: Option<u64>,
        picture: Option<&File>,
        on_frame: &mut dyn FnMut(&FrameRecord),
    ) -> Result<VeManager, RunError> {
        self.view.turn_to(self.view.painter.look.focus, manager.mailbox());
        let mut left = frames.unwrap_or(u64::MAX);
        while left > 0 && !self.view.is_closing() {
            manager = self.apply(manager, &mut recording)?;
            let controls = &mut self.view.controls;
            let wanted = match (controls.is_paused, std::mem::take(&mut controls.steps)) {
                (false, _) => self.frames_of_a_run(),
                (true, steps) => steps,
            };
            if wanted == 0 {
                self.stand_still(&manager);
                continue;
            }
            let count = wanted.min(left);
            self.advance((&mut manager, &mut recording), count, on_frame)?;
            left -= count;
        }
        recording.end(&manager)?;
        if let Some(failure) = self.view.failure() {
            return Err(failure.into());
        }
        if let Some(file) = picture {
            self.take(&manager);
            pictures::write(&self.view.picture()?, file)?;
        }
        Ok(manager)
    }

    fn frames_of_a_run(&self) -> u64 {
        let frames = self.view.stats.borrow().rate() * RUN_SECONDS;
        (frames as u64).clamp(1, RUN_FRAMES)
    }

    fn advance(
        &mut self,
        (manager, recording): (&mut VeManager, &mut Recording<'_>),
        frames: u64,
        on_frame: &mut dyn FnMut(&FrameRecord),
    ) -> Result<(), RunError> {
        let stats = Rc::clone(&self.view.stats);
        recording.run(manager, frames, &mut self.view, &mut |record| {
            stats.borrow_mut().note(record);
            on_frame(record);
        })
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
        self.view.interrupt();
    }

    /// Does what is new in the controls.
    fn apply(
        &mut self,
        mut manager: VeManager,
        recording: &mut Recording<'_>,
    ) -> Result<VeManager, RunError> {
        let (now, before) = (self.view.controls, self.applied);
        self.applied = now;
        if now.restarts != before.restarts {
            if recording.end(&manager)? {
                let frame = manager.frame();
                (self.note)(&format!("the recording ends before frame {frame}: started anew"));
            }
            return self.restart();
        }
        let is_pipeline = now.executor == ExecutorKind::Pipeline;
        let is_rebuilt = now.executor != before.executor
            || (is_pipeline && now.frames_in_flight != before.frames_in_flight)
            || (!is_pipeline && now.threads != before.threads);
        if is_rebuilt {
            manager = self.manage(manager.into_scene())?;
        }
        manager.pool().resize(now.threads);
        if now.gravity != before.gravity {
            let gravity = Control::Gravity(Vec3::NEG_Y * now.gravity);
            recording.control(&mut manager, gravity)?;
        }
        if now.stiffness != before.stiffness {
            let (between_nodes, to_center) = (now.stiffness, now.stiffness * CENTER_STIFFNESS);
            tell_all(&manager, self.objects, || Message::Stiffness { between_nodes, to_center });
        }
        if now.damping != before.damping {
            tell_all(&manager, self.objects, || Message::Damping(now.damping));
        }
        Ok(manager)
    }

    /// Starts anew with as many objects as asked for.
    fn restart(&mut self) -> Result<VeManager, RunError> {
        let now = self.view.controls;
        self.objects = now.objects;
        let particles = particles::scene_of(self.args, now.objects);
        let mut scene = particles.build()?;
        scene.stages.simd = self.args.way.simd();
        scene.stages.gravity = Vec3::NEG_Y * now.gravity;
        let manager = self.manage(scene)?;
        let (between_nodes, to_center) = (now.stiffness, now.stiffness * CENTER_STIFFNESS);
        tell_all(&manager, self.objects, || Message::Stiffness { between_nodes, to_center });
        tell_all(&manager, self.objects, || Message::Damping(now.damping));
        self.view.turn_to(particles.room(), manager.mailbox());
        Ok(manager)
    }

    fn manage(&self, scene: Scene) -> Result<VeManager, RunError> {
        let Controls { executor, threads, .. } = self.view.controls;
        let entry = self.view.controls.entry();
        let settings =
            Settings { executor, threads, entry, ..self.args.way.settings(Grain::Spatial) };
        let mut manager = VeManager::new(scene, settings)?;
        manager.watch(Arc::clone(&self.view.timeline));
        Ok(manager)
    }
}

/// Posts a message to every particle.
fn tell_all(manager: &VeManager, objects: usize, message: impl Fn() -> Message) {
    let mailbox = manager.mailbox();
    (0..objects as u32).for_each(|object| mailbox.post(ObjectId(object), message()));
}
