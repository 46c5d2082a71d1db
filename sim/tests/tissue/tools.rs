//! What tools and the host do to tissue, cuts aside, and what is refused.

use dualframe_sim::behavior::tissue::{Material, Pin, Scrape, Tissue, TissueError};
use dualframe_sim::behavior::{Grasp, Hold, LetGo};
use dualframe_sim::executor::Executor;
use dualframe_sim::message::Message;
use dualframe_sim::object::ObjectId;
use glam::Vec3;

use crate::common::run;
use crate::patch::*;

#[test]
fn what_a_tool_holds_follows_it_and_weighs_on_it() {
    let (mesh, tissue) = patch(9, scalp(), 16);
    let weight = total_mass(&mesh) as f32 * GRAVITY;
    let mut executor = alone(mesh, tissue, Vec3::NEG_Z * GRAVITY);
    let (middle, strength) = (node(&executor, 40), f32::INFINITY);
    let grasp = Grasp { by: TOOL, point: middle, radius: 0.006, stiffness: 500.0, strength };
    tell(&executor, grasp);
    // Another tool takes hold of nothing.
    tell(&executor, Grasp { by: ObjectId(98), point: Vec3::X, ..grasp });
    for frame in 1..=60_u16 {
        let position = middle + Vec3::new(0.0, 0.0, 0.03) * (f32::from(frame) / 60.0);
        tell(&executor, Hold { by: TOOL, position });
        run(&mut executor, 1);
    }
    run(&mut executor, 240);
    assert_eq!(look(&executor, |tissue, _| tissue.held_nodes(TOOL)), 7);
    assert_eq!(look(&executor, |tissue, _| tissue.held_nodes(ObjectId(98))), 0);
    let lag = (node(&executor, 40) - (middle + Vec3::Z * 0.03)).length();
    assert!(lag < 1e-3, "{lag} m behind");
    let force = look(&executor, |tissue, _| tissue.held_force(TOOL));
    assert!((force + Vec3::Z * weight).length() < 0.02 * weight, "{force} N of {weight} N");
    tell(&executor, LetGo { by: TOOL });
    run(&mut executor, 60);
    assert_eq!(look(&executor, |tissue, _| tissue.held_force(TOOL)), Vec3::ZERO);
    assert!(node(&executor, 40).z < -1.0, "it falls");
}

#[test]
fn what_is_held_too_weakly_slips_off() {
    let held = |share: f32| {
        let (mesh, tissue) = patch(9, scalp(), 16);
        let weight = total_mass(&mesh) as f32 * GRAVITY;
        let mut executor = alone(mesh, tissue, Vec3::NEG_Z * GRAVITY);
        let (point, strength) = (node(&executor, 40), share * weight / 7.0);
        tell(&executor, Grasp { by: TOOL, point, radius: 0.006, stiffness: 500.0, strength });
        run(&mut executor, 240);
        look(&executor, |tissue, _| tissue.held_nodes(TOOL))
    };
    assert_eq!(held(0.5), 0);
    // The outer ones bear more, and more while it swings.
    assert_eq!(held(20.0), 7);
}

#[test]
fn scraping_breaks_the_pins_in_a_ball() {
    let (mesh, tissue) = patch(9, scalp(), 8);
    let places: Vec<Vec3> = mesh.positions.iter().collect();
    let (stiffness, strength) = (1e3, f32::INFINITY);
    let pins = (0..81).map(|node| Pin { node, point: places[node as usize], stiffness, strength });
    let mut executor = alone(mesh, tissue.with_pins(pins.collect()).expect("pins"), Vec3::ZERO);
    tell(&executor, Scrape { center: places[40], radius: 1.1 * EDGE });
    run(&mut executor, 1);
    let left: Vec<u32> =
        look(&executor, |tissue, _| tissue.pins().iter().map(|pin| pin.node).collect());
    assert_eq!(left.len(), 81 - 7);
    let near = |node: &&u32| (places[**node as usize] - places[40]).length() < 1.1 * EDGE;
    assert_eq!(left.iter().find(near), None);
}

#[test]
fn radii_that_are_no_numbers_are_ignored() {
    let (mesh, tissue) = patch(9, scalp(), 8);
    let (point, stiffness, strength) =
        (mesh.positions.get(40).expect("a node"), 1e3, f32::INFINITY);
    let pins = vec![Pin { node: 40, point, stiffness, strength }];
    let mut executor = alone(mesh, tissue.with_pins(pins).expect("a pin"), Vec3::ZERO);
    for radius in [f32::INFINITY, f32::NAN, -1.0] {
        tell(&executor, Scrape { center: point, radius });
        tell(&executor, Grasp { by: TOOL, point, radius, stiffness, strength });
    }
    run(&mut executor, 1);
    assert_eq!(look(&executor, |tissue, _| tissue.pins().len()), 1);
    assert_eq!(look(&executor, |tissue, _| tissue.held_nodes(TOOL)), 0);
}

#[test]
fn the_engines_messages() {
    let (mesh, tissue) = patch(5, scalp(), 8);
    let mut executor = alone(mesh, tissue, Vec3::NEG_Z * GRAVITY);
    let post = |message| executor.mailbox().post(PATCH, message);
    post(Message::Stiffness { between_nodes: 7.0, to_center: f32::NAN });
    post(Message::Damping(3.0));
    post(Message::Damping(-3.0));
    post(Message::Weightless(true));
    run(&mut executor, 10);
    let material = look(&executor, |tissue, _| *tissue.material());
    assert_eq!(material, Material { stiffness: 7.0, damping: 3.0, ..scalp() });
    assert_eq!(node(&executor, 12), lattice(5, EDGE).0[12], "it does not fall");
    let target = (node(&executor, 12) + Vec3::Z * 0.01).to_array();
    executor.mailbox().post(PATCH, Message::Pull { node: 12, target, stiffness: 100.0 });
    executor.mailbox().post(PATCH, Message::Pull { node: 25, target, stiffness: 100.0 });
    run(&mut executor, 240);
    assert!((node(&executor, 12) - Vec3::from_array(target)).length() < 1e-4);
    assert_eq!(look(&executor, |tissue, _| tissue.held_nodes(ObjectId::HOST)), 1);
    executor.mailbox().post(PATCH, Message::Release);
    run(&mut executor, 1);
    assert_eq!(look(&executor, |tissue, _| tissue.held_nodes(ObjectId::HOST)), 0);
}

/// Springs are fitted to the time of a substep: to another one anew, as to another stiffness.
#[test]
fn springs_act_as_the_time_step_is() {
    let hash = |told: Option<Message>| {
        let (mut mesh, tissue) = patch(5, scalp(), 8);
        replace_positions(&mut mesh, |position, _| position * 1.1);
        let mut executor = alone(mesh, tissue, Vec3::ZERO);
        run(&mut executor, 3);
        executor.change(&mut |stages| stages.time_step = 1.0 / 240.0);
        told.into_iter().for_each(|told| executor.mailbox().post(PATCH, told));
        run(&mut executor, 3).1
    };
    let same = Message::Stiffness { between_nodes: scalp().stiffness, to_center: 0.0 };
    assert_eq!(hash(None), hash(Some(same)));
}

#[test]
fn springs_of_another_stiffness_act_as_if_they_had_always_been_so() {
    let pulled = |built: f32, told: Option<f32>| {
        let (mesh, tissue) = patch(5, Material { stiffness: built, bending: 0.0, ..scalp() }, 8);
        let mut executor = alone(mesh, tissue, Vec3::ZERO);
        run(&mut executor, 2);
        if let Some(between_nodes) = told {
            let message = Message::Stiffness { between_nodes, to_center: 0.0 };
            executor.mailbox().post(PATCH, message);
        }
        let target = (node(&executor, 12) + Vec3::Z * 0.01).to_array();
        executor.mailbox().post(PATCH, Message::Pull { node: 12, target, stiffness: 100.0 });
        run(&mut executor, 4);
        node(&executor, 12)
    };
    let (soft, hard) = (pulled(0.1, None), pulled(4_330.0, None));
    assert!((soft - hard).length() > 5e-5, "{soft} {hard}");
    let softened = pulled(4_330.0, Some(0.1));
    assert!((softened - soft).length() < 1e-6, "{softened}, not {soft}");
}

#[test]
fn nonsense_is_refused() {
    let (rest, triangles) = lattice(3, EDGE);
    let build = |triangles: Vec<[u32; 3]>, material, substeps| {
        Tissue::new(&rest, triangles, material, 1e-3, substeps).map(|_| ())
    };
    let ok = || triangles.clone();
    assert_eq!(build(ok(), scalp(), 0), Err(TissueError::NoSubsteps));
    let wrong = build(ok(), Material { bending: -1.0, ..scalp() }, 8);
    assert_eq!(wrong, Err(TissueError::Value { what: "the bending stiffness", value: -1.0 }));
    assert_eq!(build(vec![[0, 1, 3]], scalp(), 8), Err(TissueError::Massless { node: 2 }));
    let twice = build(triangles.iter().chain(&triangles).copied().collect(), scalp(), 8);
    assert_eq!(twice, Err(TissueError::Manifold { edge: [0, 1] }));
    assert!(matches!(build(vec![[0, 1, 9]], scalp(), 8), Err(TissueError::Topology(_))));
    let (_, tissue) = patch(3, scalp(), 8);
    let pin = Pin { node: 9, point: Vec3::ZERO, stiffness: 1.0, strength: 1.0 };
    let refused = |pin| tissue.clone().with_pins(vec![pin]).map(|_| ());
    assert_eq!(refused(pin), Err(TissueError::NoSuchNode { node: 9, nodes: 9 }));
    assert!(refused(Pin { node: 0, stiffness: -1.0, ..pin }).is_err());
    assert!(refused(Pin { node: 0, strength: f32::NAN, ..pin }).is_err());
    assert!(refused(Pin { node: 0, point: Vec3::NAN, ..pin }).is_err());
}
