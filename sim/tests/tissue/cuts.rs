//! Tissue that is cut.

use dualframe_sim::behavior::Grasp;
use dualframe_sim::behavior::tissue::{Cut, Material, Pin};
use dualframe_sim::executor::Executor;
use dualframe_sim::geometry::Mesh;
use glam::Vec3;

use crate::common::run;
use crate::patch::*;

#[test]
fn an_incision_opens() {
    let side = 17;
    let (mesh, tissue) = drum(side, 16);
    let mut executor = alone(mesh, tissue, Vec3::ZERO);
    run(&mut executor, 30);
    let (mass, area) = look(&executor, |tissue, mesh| (total_mass(mesh), tissue.rest_area(mesh)));
    assert_eq!(look(&executor, opening), 0.0);
    // 30 mm in 40 frames, along the middle.
    let at =
        |frame: u16| blade(0.033 + 7.5e-4 * f32::from(frame), 0.0402 + 1e-5 * f32::from(frame));
    let mut widths = Vec::new();
    for frame in 0..40 {
        tell(&executor, Cut { by: TOOL, before: at(frame), now: at(frame + 1) });
        run(&mut executor, 1);
        widths.push(look(&executor, opening));
    }
    assert!(widths.iter().skip(20).all(|&width| width > 1e-3), "it opens behind the blade");
    assert!(look(&executor, |tissue, _| tissue.cut_front(TOOL)).is_some());
    run(&mut executor, 120);
    let width = look(&executor, opening);
    println!("the incision is {:.2} mm wide", 1e3 * width);
    assert!(width > 4e-3, "the edges part by {width} m");
    let (mass_after, area_after) =
        look(&executor, |tissue, mesh| (total_mass(mesh), tissue.rest_area(mesh)));
    assert!((mass_after / mass - 1.0).abs() < 1e-6, "{mass} kg, then {mass_after} kg");
    assert!((area_after / area - 1.0).abs() < 1e-6, "{area} m², then {area_after} m²");
    // It has come to rest.
    let speed =
        look(&executor, |_, mesh| mesh.velocities.iter().map(Vec3::length).fold(0.0, f32::max));
    assert!(speed < 0.02, "{speed} m/s");
}

#[test]
fn cutting_takes_nothing_from_old_nodes_and_hands_pins_on() {
    let (mesh, tissue) = drum(9, 12);
    let mut executor = alone(mesh, tissue, Vec3::ZERO);
    run(&mut executor, 5);
    let rest_before = look(&executor, |tissue, _| tissue.rest().to_vec());
    let velocity_of = |mesh: &Mesh| mesh.velocities.iter().collect::<Vec<_>>();
    // Right across, and out over the border on both sides.
    tell(&executor, Cut { by: TOOL, before: blade(-0.01, 0.0193), now: blade(0.06, 0.0214) });
    run(&mut executor, 1);
    let (rest, pins, velocities) = look(&executor, |tissue, mesh| {
        (tissue.rest().to_vec(), tissue.pins().to_vec(), velocity_of(mesh))
    });
    assert!(rest.len() > rest_before.len());
    assert_eq!(rest[..rest_before.len()], rest_before, "nodes keep their numbers");
    assert_eq!(velocities.len(), rest.len());
    // Every node at the border, new ones included, is pinned where it was.
    let pinned: Vec<u32> = pins.iter().map(|pin| pin.node).collect();
    let old = border(9).count();
    assert!(pinned.len() > old, "{} pins", pinned.len());
    for pin in &pins {
        let off = (pin.point - rest[pin.node as usize] * 1.15).length();
        assert!(off < 1e-6, "the pin of node {} is {off} m off", pin.node);
    }
    assert_eq!(look(&executor, |tissue, _| tissue.cut_front(TOOL)), None);
}

#[test]
fn no_spring_leads_across_a_full_cut() {
    let (mesh, tissue) = patch(9, scalp(), 12);
    let mut executor = alone(mesh, tissue, Vec3::ZERO);
    tell(&executor, Cut { by: TOOL, before: blade(-0.01, 0.0193), now: blade(0.06, 0.0214) });
    run(&mut executor, 1);
    // One half is held, the other is pulled away by gravity.
    let (strength, stiffness) = (f32::INFINITY, 1e3);
    tell(&executor, Grasp { by: TOOL, point: Vec3::ZERO, radius: 0.012, stiffness, strength });
    executor.change(&mut |stages| stages.gravity = Vec3::Y * GRAVITY);
    run(&mut executor, 60);
    assert!(node(&executor, 80).y > 1.0, "the far half falls freely: {}", node(&executor, 80));
    assert!(node(&executor, 4).y < 0.2, "the near half is held");
}

/// What holds both ends of an edge holds a node that a cut makes on it, as firmly.
#[test]
fn new_nodes_are_held_as_those_they_come_from() {
    let (mesh, tissue) = patch(9, scalp(), 12);
    let places: Vec<Vec3> = mesh.positions.iter().collect();
    let (stiffness, strength) = (2e3, 30.0);
    let pins = (0..).zip(places).map(|(node, point)| Pin { node, point, stiffness, strength });
    let tissue = tissue.with_pins(pins.collect()).expect("its own nodes");
    let mut executor = alone(mesh, tissue, Vec3::ZERO);
    let point = node(&executor, 40);
    tell(&executor, Grasp { by: TOOL, point, radius: 0.012, stiffness, strength });
    run(&mut executor, 1);
    let held = look(&executor, |tissue, _| tissue.held_nodes(TOOL));
    tell(&executor, Cut { by: TOOL, before: blade(-0.01, 0.0193), now: blade(0.06, 0.0214) });
    run(&mut executor, 1);
    look(&executor, |tissue, mesh| {
        assert!(mesh.positions.len() > 81);
        assert_eq!(tissue.pins().len(), mesh.positions.len());
        for pin in tissue.pins() {
            let off = (pin.point - tissue.rest()[pin.node as usize]).length();
            assert!(off < 1e-6, "{pin:?} is {off} m off");
            assert!((pin.stiffness / stiffness - 1.0).abs() < 1e-5, "{pin:?}");
            assert!((pin.strength / strength - 1.0).abs() < 1e-5, "{pin:?}");
        }
        assert!(tissue.held_nodes(TOOL) > held, "{} nodes held", tissue.held_nodes(TOOL));
    });
}

#[test]
fn a_cut_does_not_stop_what_flies() {
    let (mut mesh, tissue) = patch(9, Material { damping: 0.0, ..scalp() }, 12);
    let velocity = Vec3::new(0.1, 0.2, 0.3);
    mesh.set_velocity(velocity);
    let mut executor = alone(mesh, tissue, Vec3::ZERO);
    tell(&executor, Cut { by: TOOL, before: blade(-0.01, 0.0193), now: blade(0.06, 0.0214) });
    run(&mut executor, 1);
    look(&executor, |_, mesh| {
        assert!(mesh.positions.len() > 81);
        let off = mesh.velocities.iter().map(|own| (own - velocity).length()).fold(0.0, f32::max);
        assert!(off < 1e-3, "{off} m/s");
    });
}
