//! An object of one's own: a ball that bounces on a floor, and flies off once it is told that it weighs nothing.
//!
//! What a simulator plugs in is here once each: a behaviour, an interaction, a renderer, a message from outside.

use std::error::Error;
use std::hash::Hasher;

use dualframe_sim::behavior::{Behavior, Fixed, Input};
use dualframe_sim::geometry::{Geometry, Rigid};
use dualframe_sim::interaction::{
    Contact, Detection, InteractionPair, Penalty, Rules, Touch, Touches,
};
use dualframe_sim::manager::{Settings, VeManager};
use dualframe_sim::message::Message;
use dualframe_sim::object::{Group, Object, ObjectId};
use dualframe_sim::render::Renderer;
use dualframe_sim::scene::Scene;
use dualframe_sim::simd::Simd;
use dualframe_sim::stages::Stages;
use glam::Vec3;
use parry3d::{math::Pose, shape::SharedShape};

const BALL: ObjectId = ObjectId(0);
const RADIUS: f32 = 0.1; // m
const MASS: f32 = 0.5; // kg

/// Falls, and goes where it is pushed.
struct Falling {
    weightless: bool,
}

impl Behavior for Falling {
    fn update(&mut self, geometry: &mut Geometry, input: &mut Input<'_>) {
        let Some(ball) = geometry.as_rigid_mut() else { return };
        let impulse: Vec3 = input.contacts().map(|contact| Vec3::from_array(contact.impulse)).sum();
        let gravity = if self.weightless { Vec3::ZERO } else { input.gravity };
        ball.velocity += impulse / MASS + gravity * input.time_step;
        ball.pose.translation += ball.velocity * input.time_step;
    }

    fn process(&mut self, message: &Message) {
        if let Message::Weightless(weightless) = message {
            self.weightless = *weightless;
        }
    }

    fn hash_state(&self, hasher: &mut dyn Hasher) {
        hasher.write_u8(self.weightless.into());
    }
}

/// Finds how deep a ball is in a wall. What that does to it is [`Penalty`]'s.
struct BallOnWall;

impl Detection for BallOnWall {
    fn detect(&self, first: &Object, second: &Object, touches: &mut Touches) {
        let wall = second.geometry.as_rigid().and_then(Rigid::plane);
        let Some((point, normal)) = wall else { return };
        let depth = RADIUS - (first.center() - point).dot(normal);
        if depth > 0.0 {
            touches.push(Touch { nodes: [Contact::BODY; 2], normal: normal.to_array(), depth });
        }
    }
}

/// A picture of one number.
struct Height(f32);

impl Renderer for Height {
    fn draw(&mut self, object: &Object) {
        if object.id() == BALL {
            self.0 = object.center().y;
        }
    }

    fn swap(&mut self, frame: u64) {
        if frame % 30 == 29 {
            println!("frame {frame}: {:.2} m", self.0);
        }
    }
}

fn main() -> Result<(), Box<dyn Error>> {
    let ball = Rigid::new(SharedShape::ball(RADIUS), Pose::from_translation(Vec3::Y));
    let floor = Rigid::wall(Vec3::ZERO, Vec3::Y);
    let (balls, walls) = (Group(0), Group(1));
    let objects = vec![
        Object::new(BALL, balls, Geometry::Rigid(ball), Falling { weightless: false }),
        Object::new(ObjectId(1), walls, Geometry::Rigid(floor), Fixed),
    ];
    let (detection, response) = (Box::new(BallOnWall), Box::new(Penalty::new(2_000.0, 0.0, 0.0)?));
    let mut rules = Rules::new();
    rules.model(balls, walls, InteractionPair { detection, response })?;
    let (time_step, gravity) = (1.0 / 240.0, Vec3::new(0.0, -9.81, 0.0));
    let stages = Stages { rules, time_step, gravity, callback_budget: None, simd: Simd::detect() };

    let settings = Settings { threads: 2, ..Settings::default() };
    let mut manager = VeManager::new(Scene::new(objects, stages), settings)?;
    let (mailbox, mut height) = (manager.mailbox(), Height(0.0));
    // Told when it is on its way up.
    manager.run(360, &mut height, &mut |record| {
        if record.frame == 150 {
            mailbox.post(BALL, Message::Weightless(true));
        }
    })?;
    println!("state hash: {:016x}", manager.state_hash());
    if let Some((id, fault)) = manager.quarantined().first() {
        return Err(format!("{id} was excluded: {fault:?}").into());
    }
    if height.0 > 1.5 { Ok(()) } else { Err("the ball did not fly off".into()) }
}
