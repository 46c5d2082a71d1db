//! Particles in a window: grabbed, pulled, and changed while they move.

mod grip;
mod physics;

use dualframe_render_wgpu::camera::Camera;
use dualframe_render_wgpu::look::Look;
use dualframe_sim::blocking::Grain;
use dualframe_sim::executor::{ExecutorError, OnFrame};
use dualframe_sim::manager::VeManager;
use dualframe_sim::message::Message;
use dualframe_sim::object::ObjectId;
use dualframe_sim::record::Control;
use dualframe_sim::scene::Scene;
use glam::Vec3;

use self::grip::Grip;
use self::physics::Physics;
use super::Scenario;
use super::view::View;
use crate::app::args::Particles;
use crate::app::error::RunError;
use crate::app::manage::Manage;
use crate::app::particles;
use crate::app::recording::Recording;

/// The stiffness of springs to the centre over that of springs between nodes, in particles.
const CENTER_STIFFNESS: f32 = 5.0;

/// Particles in a window.
pub(in crate::app) struct ParticlesAtHand<'a> {
    args: &'a Particles,
    /// What they were last told.
    applied: Physics,
    /// How many they are.
    objects: usize,
}

impl<'a> ParticlesAtHand<'a> {
    /// They, and the hand that pulls at them.
    pub(in crate::app) fn begin(args: &'a Particles) -> (Self, Grip) {
        let applied = Physics::new(args);
        (Self { args, applied, objects: args.objects }, Grip::new(applied))
    }

    /// Posts a message to every particle.
    fn tell_all(&self, manager: &VeManager, message: impl Fn() -> Message) {
        let mailbox = manager.mailbox();
        (0..self.objects as u32).for_each(|object| mailbox.post(ObjectId(object), message()));
    }
}

impl Scenario for ParticlesAtHand<'_> {
    type Hand = Grip;

    const GRAIN: Grain = Grain::Spatial;

    fn look(&self) -> (Look, Camera) {
        particles::look(particles::scene_of(self.args, self.objects).room())
    }

    fn build(&self, hand: &Grip) -> Result<Scene, RunError> {
        let mut scene = particles::scene_of(self.args, hand.physics.objects).build()?;
        scene.stages.simd = self.args.way.simd();
        scene.stages.gravity = Vec3::NEG_Y * hand.physics.gravity;
        Ok(scene)
    }

    fn begin_anew(&mut self, hand: &Grip) {
        self.objects = hand.physics.objects;
        // They are as they are built, and are told what is set otherwise.
        self.applied = Physics { gravity: hand.physics.gravity, ..Physics::new(self.args) };
    }

    fn apply(&mut self, hand: &Grip, manager: &mut VeManager, recording: &mut Recording<'_>) {
        let (now, before) = (hand.physics, self.applied);
        self.applied = now;
        if now.gravity != before.gravity {
            recording.control(manager, Control::Gravity(Vec3::NEG_Y * now.gravity));
        }
        if now.stiffness != before.stiffness {
            let (between_nodes, to_center) = (now.stiffness, now.stiffness * CENTER_STIFFNESS);
            self.tell_all(manager, || Message::Stiffness { between_nodes, to_center });
        }
        if now.damping != before.damping {
            self.tell_all(manager, || Message::Damping(now.damping));
        }
    }

    fn advance(
        &mut self,
        view: &mut View<Grip>,
        manager: &mut VeManager,
        recording: &mut Recording<'_>,
        frames: u64,
        on_frame: &mut OnFrame<'_>,
    ) -> Result<(), ExecutorError> {
        recording.run(manager, frames, view, on_frame)
    }

    fn tend(
        &mut self,
        _view: &mut View<Grip>,
        manager: VeManager,
        _recording: &mut Recording<'_>,
        _manage: Manage<'_>,
    ) -> Result<VeManager, RunError> {
        Ok(manager)
    }
}
