//! How tissue moves by itself.

use std::sync::Arc;

use dualframe_sim::behavior::tissue::{Material, Pin, Tissue};
use dualframe_sim::executor::Executor;
use dualframe_sim::geometry::{Mesh, Topology, edges, icosphere};
use dualframe_sim::message::Message;
use glam::Vec3;

use crate::common::run;
use crate::patch::*;

#[test]
fn stretched_threefold_and_crumpled_it_stays_stable() {
    let stretched: fn(Vec3, &mut u32) -> Vec3 = |position, _| position * 3.0;
    let crumpled: fn(Vec3, &mut u32) -> Vec3 =
        |_, seed| Vec3::from_array(std::array::from_fn(|_| 0.02 * noise(seed)));
    for (number, deform) in [stretched, crumpled].into_iter().enumerate() {
        for substeps in [8, 12, 20] {
            let (mut mesh, tissue) = patch(15, Material { bending: 0.0, ..scalp() }, substeps);
            replace_positions(&mut mesh, deform);
            let mut executor = alone(mesh, tissue, Vec3::ZERO);
            let before = energy(&executor);
            let mut last = before;
            for frame in 0..240 {
                run(&mut executor, 1);
                last = energy(&executor);
                assert!(last <= before, "{number}: {last} of {before} J in frame {frame}");
            }
            assert!(last < 0.5 * before, "{number}: {last} of {before} J are left");
        }
    }
    // And with springs that resist bending, and thrown about by a node that is held.
    let (mesh, tissue) = patch(15, scalp(), 8);
    let mut executor = alone(mesh, tissue, Vec3::NEG_Z * GRAVITY);
    for frame in 0..240_u16 {
        let far = if frame % 20 < 10 { 0.2 } else { -0.2 };
        let target = [far, 0.03, far];
        executor.mailbox().post(PATCH, Message::Pull { node: 112, target, stiffness: 1e6 });
        run(&mut executor, 1);
        let fastest =
            look(&executor, |_, mesh| mesh.velocities.iter().map(Vec3::length).fold(0.0, f32::max));
        assert!(fastest < 100.0, "{fastest} m/s in frame {frame}");
    }
}

/// A ball of 50 mm, one of whose faces is finer than the others: cuts make light nodes like these too.
fn ball_with_a_finer_face() -> (Vec<Vec3>, Vec<[u32; 3]>) {
    let (mut nodes, mut triangles) = icosphere(0.05);
    let mut outer = triangles.swap_remove(0);
    let corners = outer.map(|node| nodes[node as usize]);
    let middle = corners.iter().sum::<Vec3>() / 3.0;
    for scale in [0.2, 0.1] {
        let first = nodes.len() as u32;
        nodes.extend(corners.map(|corner| middle + (corner - middle) * scale));
        let inner = [first, first + 1, first + 2];
        for (side, next) in [(0, 1), (1, 2), (2, 0)] {
            triangles.push([outer[side], outer[next], inner[side]]);
            triangles.push([outer[next], inner[next], inner[side]]);
        }
        outer = inner;
    }
    triangles.push(outer);
    (nodes, triangles)
}

#[test]
fn a_solid_body_whose_nodes_differ_in_mass_comes_to_rest() {
    for stiffness in [200.0, 5_000.0, 100_000.0] {
        let (rest, triangles) = ball_with_a_finer_face();
        let material =
            Material { stiffness, bending: 0.0, to_center: stiffness, damping: 2.0, ..scalp() };
        let (mesh, tissue) = Tissue::new(&rest, triangles, material, 1e-3, 16).expect("a ball");
        let masses = mesh.masses();
        let least = masses.iter().copied().fold(f32::INFINITY, f32::min);
        assert!(masses.iter().sum::<f32>() > 100.0 * least * masses.len() as f32);
        let mut executor = alone(mesh, tissue, Vec3::ZERO);
        let impulse = [1e-6, 0.0, 0.0];
        executor.mailbox().post(PATCH, Message::Impulse { node: 5, impulse });
        run(&mut executor, 300);
        let fastest =
            look(&executor, |_, mesh| mesh.velocities.iter().map(Vec3::length).fold(0.0, f32::max));
        assert!(fastest < 1e-3, "{fastest} m/s at {stiffness} N/m");
    }
}

/// Tissue is held by pins; a mesh that somebody has put in its place may have such a node all the same.
#[test]
fn a_node_without_mass_is_no_end_of_a_solid_body() {
    let (rest, triangles) = icosphere(0.05);
    let material = Material { stiffness: 500.0, bending: 0.0, to_center: 500.0, ..scalp() };
    let (mesh, tissue) = Tissue::new(&rest, triangles.clone(), material, 1e-3, 16).expect("a ball");
    let mut masses = mesh.masses().to_vec();
    masses[0] = 0.0;
    let edges = edges(&triangles);
    let topology = Arc::new(Topology::new(&rest, triangles, &edges, true).expect("a ball"));
    let other = Mesh::new(topology, &rest, &masses, 1e-3).expect("as many masses as nodes");
    let mut executor = alone(other, tissue, Vec3::NEG_Y * GRAVITY);
    run(&mut executor, 60);
    let far = look(&executor, |_, mesh| {
        let first = mesh.positions.get(0).expect("a node");
        mesh.positions.iter().map(|place| place.distance(first)).fold(0.0, f32::max)
    });
    assert!((0.09..0.11).contains(&far), "{far} m: it stays whole");
    assert_eq!(node(&executor, 0), rest[0], "it is held fast");
}

/// What of a velocity or of gravity is less than a place rounds to in a substep is not lost.
#[test]
fn far_from_the_origin_a_free_body_moves_as_theory_says() {
    let far = Vec3::new(1.0, -2.0, 0.2);
    let (mut rest, triangles) = lattice(3, 0.01);
    rest.iter_mut().for_each(|place| *place += far);
    for (substeps, damping, gravity) in [(16, 2.0, 0.0), (400, 0.0, GRAVITY), (400, 3.0, GRAVITY)] {
        let material = Material { damping, ..scalp() };
        let (mut mesh, tissue) =
            Tissue::new(&rest, triangles.clone(), material, 1e-3, substeps).expect("a patch");
        let began = Vec3::new(0.03, 0.0, -0.005);
        mesh.set_velocity(began);
        let mut executor = alone(mesh, tissue, Vec3::NEG_Y * gravity);
        let frames = 60;
        run(&mut executor, frames);
        let time = frames as f32 / 60.0;
        let left = (-damping * time).exp();
        let fallen = if damping > 0.0 { gravity * (1.0 - left) / damping } else { gravity * time };
        let expected = began * left + Vec3::NEG_Y * fallen;
        let velocity = look(&executor, |_, mesh| mesh.velocities.get(4).expect("a node"));
        let apart = velocity.distance(expected) / expected.length();
        assert!(apart < 0.01, "{substeps} substeps: {velocity} m/s, expected {expected}");
    }
}

#[test]
fn a_hanging_sheet_is_as_long_as_theory_says() {
    // Soft enough for the substeps, see `Material`.
    let (side, edge, stiffness) = (21, 0.01, 200.0);
    let (rest, triangles) = lattice(side, edge);
    let upper = (0..side as u32).map(|node| Pin {
        node,
        point: rest[node as usize],
        stiffness: f32::INFINITY,
        strength: f32::INFINITY,
    });
    let material = Material { stiffness, bending: 0.0, damping: 10.0, ..scalp() };
    let (mesh, tissue) = Tissue::new(&rest, triangles, material, 1e-3, 64).expect("a sheet");
    let tissue = tissue.with_pins(upper.collect()).expect("its nodes");
    let mut executor = alone(mesh, tissue, Vec3::Y * GRAVITY);
    run(&mut executor, 300);
    let last = (side * side - 1 - side / 2) as u32;
    let length = rest[last as usize].y;
    let longer = node(&executor, last).y - length;
    // ρ g L²/(2 E t), with E t = 2 k/√3.
    let expected = 5.0 * GRAVITY * length * length / (2.0 * 2.0 * stiffness / 3.0_f32.sqrt());
    assert!((longer / expected - 1.0).abs() < 0.08, "{longer} m, expected {expected} m");
}

#[test]
fn momentum_is_kept() {
    for to_center in [0.0, 500.0] {
        let material = Material { damping: 0.0, to_center, ..scalp() };
        let (mut mesh, tissue) = patch(9, material, 12);
        replace_positions(&mut mesh, |position, seed| {
            position + Vec3::from_array(std::array::from_fn(|_| 1e-3 * noise(seed)))
        });
        let mut seed = 7;
        for index in 0..mesh.velocities.len() {
            let velocity = std::array::from_fn(|_| noise(&mut seed) - 0.3);
            mesh.velocities.set(index, Vec3::from_array(velocity));
        }
        let momentum = |mesh: &Mesh| -> glam::DVec3 {
            let nodes = mesh.velocities.iter().zip(mesh.masses());
            nodes.map(|(velocity, &mass)| velocity.as_dvec3() * f64::from(mass)).sum()
        };
        let before = momentum(&mesh);
        let mut executor = alone(mesh, tissue, Vec3::ZERO);
        run(&mut executor, 60);
        let after = look(&executor, |_, mesh| momentum(mesh));
        let change = (after - before).length() / before.length();
        assert!(change < 1e-3, "{before} and then {after} kg·m/s, with {to_center} N/m");
    }
}

#[test]
fn a_solid_body_comes_back_to_its_shape() {
    // An octahedron whose edges do nothing.
    let corners = [Vec3::X, Vec3::NEG_X, Vec3::Y, Vec3::NEG_Y, Vec3::Z, Vec3::NEG_Z];
    let rest = corners.map(|corner| corner * 0.02);
    let triangles = vec![
        [0, 2, 4],
        [2, 1, 4],
        [1, 3, 4],
        [3, 0, 4],
        [2, 0, 5],
        [1, 2, 5],
        [3, 1, 5],
        [0, 3, 5],
    ];
    let material = Material { stiffness: 0.0, bending: 0.0, to_center: 50.0, ..scalp() };
    let (mut mesh, tissue) = Tissue::new(&rest, triangles, material, 1e-3, 16).expect("a solid");
    replace_positions(&mut mesh, |position, _| position * 1.5);
    let mut executor = alone(mesh, tissue, Vec3::ZERO);
    run(&mut executor, 300);
    for (index, corner) in rest.iter().enumerate() {
        let off = (node(&executor, index as u32) - corner).length();
        assert!(off < 1e-4, "corner {index} is {off} m off");
    }
}

#[test]
fn a_pinned_node_hangs_by_its_weight_over_the_stiffness() {
    let material = Material { stiffness: 0.0, bending: 0.0, damping: 20.0, ..scalp() };
    let (mesh, tissue) = patch(5, material, 16);
    let (masses, places): (Vec<f32>, Vec<Vec3>) =
        (mesh.masses().to_vec(), mesh.positions.iter().collect());
    let (stiffness, strength) = (3.0, f32::INFINITY);
    let pins = (0..25).map(|node| Pin { node, point: places[node as usize], stiffness, strength });
    let mut executor =
        alone(mesh, tissue.with_pins(pins.collect()).expect("pins"), Vec3::Y * GRAVITY);
    run(&mut executor, 300);
    for (index, (mass, place)) in masses.iter().zip(&places).enumerate() {
        let below = (node(&executor, index as u32) - place).y;
        let expected = mass * GRAVITY / stiffness;
        assert!((below / expected - 1.0).abs() < 0.02, "{below} m, expected {expected} m");
    }
    assert_eq!(look(&executor, |_, mesh| mesh.masses().to_vec()), masses);
}

#[test]
fn pins_tear_off_beyond_their_strength() {
    let hang = |strength: f32| {
        let (mesh, tissue) = patch(7, scalp(), 16);
        let point = |node: u32| mesh.positions.get(node as usize).expect("a node");
        let pins = (0..7).map(|node| Pin { node, point: point(node), stiffness: 5e3, strength });
        let weight = total_mass(&mesh) as f32 * GRAVITY;
        let tissue = tissue.with_pins(pins.collect()).expect("pins");
        let mut executor = alone(mesh, tissue, Vec3::Y * GRAVITY);
        run(&mut executor, 120);
        (look(&executor, |tissue, _| tissue.pins().len()), weight / 7.0)
    };
    let share = hang(f32::INFINITY).1;
    assert_eq!(hang(f32::INFINITY).0, 7);
    assert_eq!(hang(4.0 * share).0, 7);
    assert_eq!(hang(0.5 * share).0, 0);
}
