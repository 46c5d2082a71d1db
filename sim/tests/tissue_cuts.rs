//! Any cuts of a stretched patch of tissue: mass and area stay, the springs fit the triangles, nothing
//! flies apart, and it is the same every time.

mod common;

use std::collections::BTreeMap;

use common::{no_rules, run, serial};
use dualframe_sim::behavior::tissue::{Cut, Material, Pin, Tissue};
use dualframe_sim::executor::Executor;
use dualframe_sim::geometry::{Blade, Geometry, Mesh, edges};
use dualframe_sim::message::Message;
use dualframe_sim::object::{Group, Object, ObjectId};
use dualframe_sim::scene::Scene;
use glam::Vec3;
use proptest::prelude::*;

/// The length of an edge, in metres.
const EDGE: f32 = 5e-3;
const SIDE: usize = 8;
/// How much the patch is stretched.
const STRETCH: f32 = 1.1;

fn patch() -> Object {
    let place = |index: usize| {
        let (column, row) = (index % SIDE, index / SIDE);
        Vec3::new(column as f32 + 0.5 * (row % 2) as f32, row as f32 * 0.866_025_4, 0.0) * EDGE
    };
    let rest: Vec<Vec3> = (0..SIDE * SIDE).map(place).collect();
    let mut triangles = Vec::new();
    for row in 0..SIDE - 1 {
        for column in 0..SIDE - 1 {
            let at = |c: usize, r: usize| ((row + r) * SIDE + column + c) as u32;
            let [a, b, c, d] = [at(0, 0), at(1, 0), at(0, 1), at(1, 1)];
            let odd = row % 2 == 1;
            triangles.extend(if odd { [[a, b, d], [a, d, c]] } else { [[a, b, c], [b, d, c]] });
        }
    }
    let material = Material {
        stiffness: 4_330.0,
        bending: 80.0,
        to_center: 0.0,
        damping: 2.0,
        area_density: 5.0,
    };
    let (mut mesh, tissue) = Tissue::new(&rest, triangles, material, 1e-3, 12).expect("a patch");
    let pins = (0..SIDE * SIDE).filter(|node| node % SIDE == 0).map(|node| Pin {
        node: node as u32,
        point: rest[node] * STRETCH,
        stiffness: 5e3,
        strength: 5.0,
    });
    let tissue = tissue.with_pins(pins.collect()).expect("its own nodes");
    for (index, &rest) in rest.iter().enumerate() {
        mesh.positions.set(index, rest * STRETCH);
    }
    Object::new(ObjectId(0), Group(0), Geometry::Mesh(mesh), tissue)
}

fn blade([x, y]: [f32; 2]) -> Blade {
    let at = |z| Vec3::new(x * 1e-3, y * 1e-3, z);
    Blade { tip: at(-0.02), heel: at(0.1) }
}

/// Checks what holds for tissue whatever is cut.
fn check(tissue: &Tissue, mesh: &Mesh, mass: f64, area: f64) {
    let now: f64 = mesh.masses().iter().map(|&mass| f64::from(mass)).sum();
    assert!((now / mass - 1.0).abs() < 1e-6, "{mass} kg, then {now} kg");
    let now = tissue.rest_area(mesh);
    assert!((now / area - 1.0).abs() < 1e-6, "{area} m², then {now} m²");
    let triangles = mesh.topology().triangles();
    let springs: Vec<[u32; 2]> = mesh.topology().springs().iter().map(|s| s.nodes).collect();
    assert_eq!(springs, edges(triangles), "a spring along each edge");
    let mut counts = BTreeMap::new();
    for &[a, b, c] in triangles {
        for [p, q] in [[a, b], [b, c], [c, a]] {
            *counts.entry([p.min(q), p.max(q)]).or_insert(0) += 1;
        }
    }
    assert!(counts.values().all(|&count| count <= 2), "more than two triangles at an edge");
    for spring in mesh.topology().springs() {
        let [a, b] = spring.nodes.map(|node| tissue.rest()[node as usize]);
        assert_eq!(spring.rest, (a - b).length(), "lengths are those of the rest shape");
    }
    let fastest = mesh.velocities.iter().map(Vec3::length).fold(0.0, f32::max);
    assert!(fastest < 50.0, "{fastest} m/s");
}

/// Cuts along polylines (mm), so many frames a segment, and the hash of the state after each frame.
fn cut_all(cuts: &[(Vec<[f32; 2]>, u8)], check_each: bool) -> Vec<u64> {
    let mut stages = no_rules();
    stages.time_step = 1.0 / 60.0;
    let mut executor = serial(Scene::new(vec![patch()], stages));
    let (mut before, mut hashes) = (None, Vec::new());
    for (tool, (corners, frames)) in (1..).zip(cuts) {
        let mut messages = Vec::new();
        for ends in corners.windows(2) {
            let at = |frame: u8| {
                let share = f32::from(frame) / f32::from(*frames);
                blade([0, 1].map(|axis| ends[0][axis] + (ends[1][axis] - ends[0][axis]) * share))
            };
            let cut = |frame| Cut { by: ObjectId(tool), before: at(frame), now: at(frame + 1) };
            messages.extend((0..*frames).map(cut));
        }
        for cut in messages {
            executor.mailbox().post(ObjectId(0), Message::Custom(Box::new(cut)));
            hashes.push(run(&mut executor, 1).1);
        }
        hashes.push(run(&mut executor, 5).1);
        if check_each {
            executor.visit(&mut |object| {
                assert_eq!(object.quarantined(), None);
                let mesh = object.geometry.as_mesh().expect("a mesh");
                let tissue = Tissue::of(object).expect("tissue");
                let whole = patch();
                let whole_mesh = whole.geometry.as_mesh().expect("a mesh");
                let (mass, area) = *before.get_or_insert_with(|| {
                    let mass = whole_mesh.masses().iter().map(|&mass| f64::from(mass)).sum();
                    (mass, Tissue::of(&whole).expect("tissue").rest_area(whole_mesh))
                });
                check(tissue, mesh, mass, area);
            });
        }
    }
    hashes
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]

    #[test]
    fn any_cuts(
        cuts in prop::collection::vec(
            (prop::collection::vec([-5.0_f32..48.0, -5.0_f32..40.0], 2..5), 1_u8..8),
            1..4,
        ),
    ) {
        prop_assert_eq!(cut_all(&cuts, true), cut_all(&cuts, false));
    }
}
