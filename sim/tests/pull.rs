//! Bodies that somebody pulls, and springs whose damping is changed.

mod common;

use std::any::Any;

use common::{executors, no_rules, particles, point, run, serial, springs};
use dualframe_sim::behavior::MassSpring;
use dualframe_sim::blocking::Grain;
use dualframe_sim::executor::{Executor, SerialExecutor, state_hash};
use dualframe_sim::geometry::Mesh;
use dualframe_sim::message::Message;
use dualframe_sim::object::{Object, ObjectId};
use dualframe_sim::scene::Scene;
use glam::Vec3;

/// A particle's springs (N/m), mass (kg), and the time of a frame (s).
const STIFFNESS: f32 = 60.0;
const MASS: f64 = 0.42;
const TIME: f64 = 1.0 / 240.0;
/// The greatest stiffness that a pull at one node of 0.01 kg has, in newtons per metre.
const MOST: f64 = 0.01 / (2.0 * TIME * TIME);
/// The node pulled.
const NODE: u32 = 7;

/// One particle without walls, on springs with so much damping, in so many substeps a frame.
fn alone(gravity: bool, damping: f32, substeps: u32) -> Scene {
    let mut scene = particles(1, gravity, false);
    scene.objects.truncate(1);
    let particle = scene.objects.remove(0);
    let springs = MassSpring::new(STIFFNESS, damping, substeps).expect("valid springs");
    let springs = springs.with_center_stiffness(5.0 * STIFFNESS).expect("a valid stiffness");
    let mut particle = Object::new(particle.id(), particle.group(), particle.geometry, springs);
    particle.geometry.as_mesh_mut().expect("a particle").set_velocity(Vec3::ZERO);
    scene.objects.push(particle);
    scene
}

fn post(executor: &SerialExecutor, message: Message) {
    executor.mailbox().post(ObjectId(0), message);
}

fn pull(executor: &SerialExecutor, target: Vec3, stiffness: f32) {
    post(executor, Message::Pull { node: NODE, target: target.to_array(), stiffness });
}

fn look<T>(executor: &SerialExecutor, look: impl Fn(&MassSpring, &Mesh) -> T) -> T {
    let mut seen = None;
    executor.visit(&mut |object| {
        let behavior: &dyn Any = &*object.behavior;
        let springs = behavior.downcast_ref().expect("springs");
        seen = Some(look(springs, object.geometry.as_mesh().expect("a mesh")));
    });
    seen.expect("one particle")
}

/// Where the pulled node is, in metres.
fn node(executor: &SerialExecutor) -> Vec3 {
    look(executor, |_, mesh| mesh.positions.get(NODE as usize).expect("a node"))
}

/// The kinetic and elastic energy of the particle, in joules.
fn energy(executor: &SerialExecutor) -> f64 {
    look(executor, |springs, mesh| {
        let nodes = mesh.velocities.iter().zip(mesh.masses());
        let kinetic = nodes
            .map(|(velocity, &mass)| 0.5 * f64::from(mass) * velocity.as_dvec3().length_squared());
        springs.elastic_energy(mesh) + kinetic.sum::<f64>()
    })
}

#[test]
fn no_stiffness_makes_the_energy_grow_and_the_node_comes_to_its_target() {
    for damping in [0.0, 0.02] {
        for substeps in [1, 2, 5, 10] {
            for stiffness in [0.0, 1.0, 50.0, 200.0, 1e3, 1e6, 1e9] {
                let mut executor = serial(alone(false, damping, substeps));
                let target = node(&executor) + Vec3::new(0.2, -0.3, 0.1);
                let effective = f64::from(stiffness).min(MOST);
                let stored = |executor: &SerialExecutor| {
                    0.5 * effective * f64::from((target - node(executor)).length()).powi(2)
                };
                let before = stored(&executor);
                pull(&executor, target, stiffness);
                for frame in 0..3_000 {
                    run(&mut executor, 1);
                    let now = energy(&executor) + stored(&executor);
                    assert!(
                        now <= 1.5 * before + 1e-9,
                        "{now} of {before} J, {stiffness} N/m, {substeps} substeps, frame {frame}"
                    );
                }
                if stiffness > 0.0 {
                    let off = (target - node(&executor)).length();
                    let left = energy(&executor);
                    assert!(off < 1e-4 && left < 1e-6, "{off} m, {left} J, {stiffness} N/m");
                }
            }
        }
    }
}

#[test]
fn a_resting_body_hangs_by_its_weight_over_the_stiffness() {
    for substeps in [1, 2, 10] {
        for stiffness in [50.0_f32, 200.0, 1e9] {
            let mut executor = serial(alone(true, 0.02, substeps));
            let target = node(&executor);
            pull(&executor, target, stiffness);
            run(&mut executor, 3_000);
            let expected = MASS * 9.81 / f64::from(stiffness).min(MOST);
            let way = target - node(&executor);
            let error = f64::from(way.y) / expected - 1.0;
            // The motion within frames is damped too, which takes up to ωt of it.
            let close = (-0.12..0.01).contains(&error);
            assert!(close, "{error} of {expected} m, {stiffness} N/m, {substeps} substeps");
            assert!(way.x.abs() < 1e-4 && way.z.abs() < 1e-4, "{way} m");
        }
    }
}

/// The particle's momentum, in newton seconds.
fn momentum(executor: &SerialExecutor) -> Vec3 {
    look(executor, |_, mesh| {
        mesh.velocities.iter().zip(mesh.masses()).map(|(velocity, &mass)| velocity * mass).sum()
    })
}

#[test]
fn a_released_body_flies_on() {
    let mut executor = serial(alone(false, 0.02, 3));
    let target = node(&executor) + Vec3::X;
    pull(&executor, target, 100.0);
    run(&mut executor, 20);
    let pulled = momentum(&executor);
    run(&mut executor, 1);
    assert!((momentum(&executor) - pulled).length() > 1e-3, "it is pulled in every frame");
    post(&executor, Message::Release);
    let before = momentum(&executor);
    assert!(before.x > 0.1, "{before} N s");
    run(&mut executor, 100);
    assert!((momentum(&executor) - before).length() < 1e-5, "{before} N s");
}

#[test]
fn the_last_valid_pull_counts() {
    let outcome = |pulls: &[(u32, f32, f32)]| {
        let mut executor = serial(alone(false, 0.02, 3));
        for &(node, x, stiffness) in pulls {
            let target = [x, 0.5, 0.5];
            post(&executor, Message::Pull { node, target, stiffness });
        }
        run(&mut executor, 10);
        state_hash(&executor)
    };
    let one = outcome(&[(NODE, 1.0, 100.0)]);
    let invalid = [
        (NODE, 1.0, -1.0),
        (NODE, 1.0, f32::NAN),
        (NODE, 1.0, f32::INFINITY),
        (NODE, f32::NAN, 100.0),
    ];
    for pull in invalid {
        assert_eq!(outcome(&[(NODE, 1.0, 100.0), pull]), one, "{pull:?}");
        assert_eq!(outcome(&[pull]), outcome(&[]), "{pull:?}");
    }
    assert_eq!(outcome(&[(NODE, 2.0, 50.0), (NODE, 1.0, 100.0)]), one);
    assert_ne!(outcome(&[(NODE, 2.0, 100.0)]), one);
    // It stays, and counts as state, but pulls at nothing.
    let mut executor = serial(alone(false, 0.02, 3));
    let before = energy(&executor);
    post(&executor, Message::Pull { node: 42, target: [1.0; 3], stiffness: 100.0 });
    run(&mut executor, 10);
    assert!((energy(&executor) - before).abs() < 1e-9);
}

#[test]
fn damping_is_changed_by_a_message() {
    let kicked = |damping, message: Option<Message>| {
        let mut executor = serial(alone(false, damping, 3));
        post(&executor, Message::Impulse { node: NODE, impulse: [0.01, 0.02, 0.0] });
        message.into_iter().for_each(|message| post(&executor, message));
        run(&mut executor, 30);
        state_hash(&executor)
    };
    assert_eq!(kicked(0.0, Some(Message::Damping(0.02))), kicked(0.02, None));
    assert_eq!(kicked(0.02, Some(Message::Damping(0.0))), kicked(0.0, None));
    assert_ne!(kicked(0.02, None), kicked(0.0, None));
    for invalid in [-1.0, f32::NAN, f32::INFINITY] {
        assert_eq!(kicked(0.02, Some(Message::Damping(invalid))), kicked(0.02, None));
    }
}

#[test]
fn the_same_for_every_executor() {
    // More than have a block each.
    let scene = || particles(100, true, true);
    let outcome = |executor: &mut dyn Executor| {
        let mailbox = executor.mailbox().clone();
        let mut renderer = dualframe_sim::render::NullRenderer::new();
        let done = executor.advance(40, &mut renderer, &mut |record| {
            let frame = record.frame as u32;
            let target = [0.02 * frame as f32, 0.5, -0.3];
            mailbox.post(ObjectId(3), Message::Pull { node: 5, target, stiffness: 80.0 });
            let one = ObjectId(frame % 100);
            mailbox.post(one, Message::Pull { node: frame % 42, target, stiffness: 1e9 });
            mailbox.post(ObjectId((frame + 20) % 100), Message::Release);
            // Damped bodies and others are not advanced together.
            mailbox.post(one, Message::Damping(0.01 * (frame % 3) as f32));
        });
        done.expect("no table is full");
        state_hash(executor)
    };
    let expected = outcome(&mut serial(scene()));
    for grain in [Grain::Spatial, Grain::Pairwise] {
        for threads in [1, 3] {
            for (name, mut executor) in executors(scene, grain, threads) {
                assert_eq!(outcome(&mut *executor), expected, "{name}, {threads}, {grain:?}");
            }
        }
    }
}

/// The damping of a pull is critical: the body comes to the target without going past it.
#[test]
fn a_pulled_body_does_not_swing() {
    let mut executor = serial(Scene::new(vec![point(0, springs(0.0))], no_rules()));
    let (target, stiffness) = ([0.1, 0.0, 0.0], 100.0);
    post(&executor, Message::Pull { node: 0, target, stiffness });
    let (mut farthest, mut last) = (0.0_f32, 0.0);
    for _ in 0..480 {
        run(&mut executor, 1);
        last = look(&executor, |_, mesh| mesh.positions.get(0).expect("a node").x);
        farthest = farthest.max(last);
    }
    assert!((last - 0.1).abs() < 1e-4, "{last} m after two seconds");
    assert!(farthest < 0.100_1, "{farthest} m, which is too far");
}
