//! Implicit springs between bodies.

use std::sync::Arc;

use dualframe_sim::behavior::MassSpring;
use dualframe_sim::executor::ExecutorKind;
use dualframe_sim::geometry::{Geometry, Mesh, Topology};
use dualframe_sim::interaction::{Attached, Compliant, InteractionPair, Link, Rules};
use dualframe_sim::manager::{Settings, VeManager};
use dualframe_sim::object::{Group, Object, ObjectId};
use dualframe_sim::render::NullRenderer;
use dualframe_sim::scene::Scene;
use dualframe_sim::simd::Simd;
use dualframe_sim::stages::Stages;
use glam::Vec3;

const TIME_STEP: f32 = 1.0 / 60.0;
const MASSES: [f32; 2] = [0.000_2, 0.000_4];

/// A single node.
fn dot(id: u32, place: Vec3) -> Object {
    let topology = Topology::new(&[place], Vec::new(), &[], false).expect("one node is a body");
    let masses = &MASSES[id as usize..=id as usize];
    let mesh = Mesh::new(Arc::new(topology), &[place], masses, 0.2).expect("one mass for one node");
    let behavior = MassSpring::new(0.0, 0.0, 1).expect("no stiffness is allowed");
    Object::new(ObjectId(id), Group(id as u8), Geometry::Mesh(mesh), behavior)
}

/// Two dots, 0.2 m apart, joined by a link of 0.1 m.
fn joined(link: Link, response: Compliant) -> VeManager {
    joined_by(Attached::new(vec![link]), response)
}

fn joined_by(attached: Attached, response: Compliant) -> VeManager {
    let objects = vec![dot(0, Vec3::ZERO), dot(1, Vec3::X * 0.2)];
    let mut rules = Rules::new();
    let detection = Box::new(attached);
    let pair = InteractionPair { detection, response: Box::new(response) };
    rules.model(Group(0), Group(1), pair).expect("the groups exist");
    let (gravity, simd) = (Vec3::ZERO, Simd::detect());
    let stages = Stages { rules, time_step: TIME_STEP, gravity, callback_budget: None, simd };
    let settings = Settings { executor: ExecutorKind::Serial, threads: 1, ..Settings::default() };
    VeManager::new(Scene::new(objects, stages), settings).expect("two objects can be run")
}

/// The two dots' places and velocities along x, which is all that may change.
fn state(manager: &VeManager) -> [[f32; 2]; 2] {
    let mut state = [[f32::NAN; 2]; 2];
    manager.visit(&mut |object| {
        let mesh = object.geometry.as_mesh().expect("a dot is a mesh");
        let (place, velocity) = mesh.positions.get(0).zip(mesh.velocities.get(0)).expect("a node");
        assert_eq!([place.y, place.z, velocity.y, velocity.z], [0.0; 4]);
        state[object.id().0 as usize] = [place.x, velocity.x];
    });
    state
}

fn run(manager: &mut VeManager, frames: u64) {
    manager.run(frames, &mut NullRenderer::new(), &mut |_| {}).expect("no table is full");
}

const LINK: Link = Link { nodes: [0, 0], rest: 0.1 };

#[test]
fn follows_implicit_euler_and_keeps_momentum() {
    let (stiffness, damping) = (5.0_f32, 0.002_f32);
    let mut manager = joined(LINK, Compliant::link(stiffness, damping).expect("both are positive"));
    let (k, c, t) = (f64::from(stiffness), f64::from(damping), f64::from(TIME_STEP));
    let weight: f64 = MASSES.iter().map(|&mass| 1.0 / f64::from(mass)).sum();
    let (mut stretch, mut rate) = (0.1_f64, 0.0_f64);
    for frame in 0..60 {
        run(&mut manager, 1);
        rate += -t * (k * stretch + (k * t + c) * rate) * weight / (1.0 + (k * t + c) * t * weight);
        stretch += t * rate;
        let [first, second] = state(&manager);
        let seen = f64::from(second[0] - first[0]) - 0.1;
        assert!((seen - stretch).abs() < 1e-5, "{seen} instead of {stretch} in frame {frame}");
        let momentum = MASSES[0] * first[1] + MASSES[1] * second[1];
        assert!(momentum.abs() < 1e-9, "momentum {momentum} in frame {frame}");
    }
    assert!(stretch.abs() < 0.01, "the spring is still {stretch} m too long");
}

#[test]
fn the_stiffest_link_is_at_rest_after_a_frame() {
    let mut manager = joined(LINK, Compliant::link(1e9, 0.0).expect("it is positive"));
    for _ in 0..100 {
        run(&mut manager, 1);
        let [first, second] = state(&manager);
        assert!((second[0] - first[0] - 0.1).abs() < 1e-4, "{first:?} {second:?}");
    }
}

#[test]
fn a_contact_never_pulls() {
    let mut manager = joined(LINK, Compliant::contact(5.0, 0.1).expect("both are positive"));
    run(&mut manager, 10);
    assert_eq!(state(&manager), [[0.0, 0.0], [0.2, 0.0]]);
    // Too short by 0.1 m, it pushes.
    let link = Link { rest: 0.3, ..LINK };
    let mut manager = joined(link, Compliant::contact(5.0, 0.1).expect("both are positive"));
    run(&mut manager, 1);
    let [first, second] = state(&manager);
    assert!(first[1] < 0.0 && second[1] > 0.0);
}

#[test]
fn a_loose_link_holds_only_near_its_length() {
    let response = Compliant::link(5.0, 0.0).expect("it is positive");
    for (stretch, holds) in [(0.05, false), (0.15, true)] {
        let mut manager = joined_by(Attached::new(vec![LINK]).within(stretch), response);
        run(&mut manager, 1);
        assert_eq!(state(&manager)[0][1] > 0.0, holds, "{stretch}");
    }
}

#[test]
fn links_to_nowhere_are_passed_over() {
    let link = Link { nodes: [0, 7], ..LINK };
    let mut manager = joined(link, Compliant::link(5.0, 0.0).expect("both are positive"));
    run(&mut manager, 10);
    assert_eq!(state(&manager), [[0.0, 0.0], [0.2, 0.0]]);
    for wrong in [-1.0, f32::NAN, f32::INFINITY] {
        assert!(Compliant::link(wrong, 0.0).is_err());
        assert!(Compliant::contact(1.0, wrong).is_err());
    }
}
