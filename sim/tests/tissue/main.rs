//! Soft tissue: its physics, what tools do to it, and its cuts.

mod common;

use std::collections::BTreeMap;

use common::{Acting, no_rules, point, run, serial};
use dualframe_sim::behavior::Input;
use dualframe_sim::behavior::tissue::{
    Cut, Grasp, Hold, LetGo, Material, Pin, Scrape, Tissue, TissueError,
};
use dualframe_sim::blocking::Grain;
use dualframe_sim::executor::{Executor, ExecutorKind, SerialExecutor};
use dualframe_sim::geometry::{Blade, Geometry, Mesh};
use dualframe_sim::manager::{Settings, VeManager};
use dualframe_sim::message::{Custom, Message};
use dualframe_sim::object::{Group, Object, ObjectId};
use dualframe_sim::render::NullRenderer;
use dualframe_sim::scene::Scene;
use glam::Vec3;

/// The length of an edge, in metres.
const EDGE: f32 = 5e-3;
const TOOL: ObjectId = ObjectId(99);
const PATCH: ObjectId = ObjectId(0);
const GRAVITY: f32 = 9.81;

/// Scalp: E·t of 1 MPa × 5 mm, 5 kg/m².
fn scalp() -> Material {
    Material { stiffness: 4_330.0, bending: 80.0, to_center: 0.0, damping: 2.0, area_density: 5.0 }
}

/// A patch of equilateral triangles, flat in z = 0, of `side` nodes a side.
fn lattice(side: usize, edge: f32) -> (Vec<Vec3>, Vec<[u32; 3]>) {
    let place = |index: usize| {
        let (column, row) = (index % side, index / side);
        let x = column as f32 + 0.5 * (row % 2) as f32;
        Vec3::new(x, row as f32 * 0.866_025_4, 0.0) * edge
    };
    let mut triangles = Vec::new();
    for row in 0..side - 1 {
        for column in 0..side - 1 {
            let at = |c: usize, r: usize| ((row + r) * side + column + c) as u32;
            let [a, b, c, d] = [at(0, 0), at(1, 0), at(0, 1), at(1, 1)];
            triangles.extend(if row % 2 == 0 {
                [[a, b, c], [b, d, c]]
            } else {
                [[a, b, d], [a, d, c]]
            });
        }
    }
    ((0..side * side).map(place).collect(), triangles)
}

fn patch(side: usize, material: Material, substeps: u32) -> (Mesh, Tissue) {
    let (rest, triangles) = lattice(side, EDGE);
    Tissue::new(&rest, triangles, material, 1e-3, substeps).expect("a valid patch")
}

/// The nodes at the border of a lattice.
fn border(side: usize) -> impl Iterator<Item = u32> {
    let at_border = move |index: &usize| {
        let (column, row) = (index % side, index / side);
        [column, row].into_iter().any(|place| place == 0 || place == side - 1)
    };
    (0..side * side).filter(at_border).map(|index| index as u32)
}

fn object(id: u32, mesh: Mesh, tissue: Tissue) -> Object {
    Object::new(ObjectId(id), Group(0), Geometry::Mesh(mesh), tissue)
}

fn scene(objects: Vec<Object>, gravity: Vec3) -> Scene {
    let mut stages = no_rules();
    stages.time_step = 1.0 / 60.0;
    stages.gravity = gravity;
    Scene::new(objects, stages)
}

/// One patch alone.
fn alone(mesh: Mesh, tissue: Tissue, gravity: Vec3) -> SerialExecutor {
    serial(scene(vec![object(0, mesh, tissue)], gravity))
}

fn tell(executor: &SerialExecutor, message: impl Custom + 'static) {
    executor.mailbox().post(PATCH, Message::Custom(Box::new(message)));
}

fn look<T>(executor: &SerialExecutor, look: impl Fn(&Tissue, &Mesh) -> T) -> T {
    let mut seen = None;
    executor.visit(&mut |object| {
        if object.id() == PATCH {
            assert_eq!(object.quarantined(), None);
            let mesh = object.geometry.as_mesh().expect("a mesh");
            seen = Some(look(Tissue::of(object).expect("tissue"), mesh));
        }
    });
    seen.expect("a patch")
}

fn node(executor: &SerialExecutor, node: u32) -> Vec3 {
    look(executor, |_, mesh| mesh.positions.get(node as usize).expect("a node"))
}

fn total_mass(mesh: &Mesh) -> f64 {
    mesh.masses().iter().map(|&mass| f64::from(mass)).sum()
}

fn kinetic_energy(mesh: &Mesh) -> f64 {
    let nodes = mesh.velocities.iter().zip(mesh.masses());
    nodes.map(|(v, &mass)| 0.5 * f64::from(mass) * v.as_dvec3().length_squared()).sum()
}

/// The kinetic energy, and that of the springs along the edges.
fn energy(executor: &SerialExecutor) -> f64 {
    look(executor, |tissue, mesh| {
        let at = |node: u32| mesh.positions.get(node as usize).expect("a node").as_dvec3();
        let stored = mesh.topology().springs().iter().map(|spring| {
            let [a, b] = spring.nodes.map(at);
            let longer = (a - b).length() - f64::from(spring.rest);
            0.5 * f64::from(tissue.material().stiffness) * longer * longer
        });
        kinetic_energy(mesh) + stored.sum::<f64>()
    })
}

/// A number from 0 to 1 with no pattern.
fn noise(seed: &mut u32) -> f32 {
    *seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
    (*seed >> 8) as f32 / 16_777_216.0
}

fn replace_positions(mesh: &mut Mesh, new: impl Fn(Vec3, &mut u32) -> Vec3) {
    let mut seed = 1;
    for index in 0..mesh.positions.len() {
        let old = mesh.positions.get(index).expect("a node");
        mesh.positions.set(index, new(old, &mut seed));
    }
}

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

/// A blade that stands upright through a patch in z = 0.
fn blade(x: f32, y: f32) -> Blade {
    Blade { tip: Vec3::new(x, y, -5e-3), heel: Vec3::new(x, y, 0.1) }
}

/// A patch whose border is pinned at 1.15 times its rest shape.
fn drum(side: usize, substeps: u32) -> (Mesh, Tissue) {
    let (mut mesh, tissue) = patch(side, scalp(), substeps);
    replace_positions(&mut mesh, |position, _| position * 1.15);
    let (stiffness, strength) = (f32::INFINITY, f32::INFINITY);
    let point = |node: u32| mesh.positions.get(node as usize).expect("a node");
    let pins = border(side).map(|node| Pin { node, point: point(node), stiffness, strength });
    let pins = pins.collect();
    (mesh, tissue.with_pins(pins).expect("its own nodes"))
}

/// The greatest distance between nodes that are one at rest, in metres: how far a cut is open.
fn opening(tissue: &Tissue, mesh: &Mesh) -> f32 {
    let mut open = BTreeMap::<[u32; 3], Vec3>::new();
    let mut widest: f32 = 0.0;
    for (rest, position) in tissue.rest().iter().zip(mesh.positions.iter()) {
        let other = *open.entry(rest.to_array().map(f32::to_bits)).or_insert(position);
        widest = widest.max((position - other).length());
    }
    widest
}

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

/// Three patches that a tool and the host do everything to.
fn operation() -> Scene {
    let mut objects = Vec::new();
    for id in 0..3 {
        let (mesh, tissue) = drum(9 + id as usize, 8 + 4 * id);
        objects.push(object(id, mesh, tissue));
    }
    let tool = |_: &mut Geometry, input: &mut Input<'_>| {
        let frame = input.frame as f32;
        let mut post = |to: u32, message: Box<dyn Custom>| {
            input.post(ObjectId(to), Message::Custom(message));
        };
        let at = |frame: f32| blade(5e-4 * frame, 0.013 + 2e-4 * frame);
        for patch in 0..2 {
            post(patch, Box::new(Cut { by: TOOL, before: at(frame), now: at(frame + 1.0) }));
        }
        let point = Vec3::new(0.02, 0.02, 0.0);
        if frame == 3.0 {
            let (stiffness, strength) = (300.0, 0.5);
            post(2, Box::new(Grasp { by: TOOL, point, radius: 7e-3, stiffness, strength }));
        }
        post(2, Box::new(Hold { by: TOOL, position: point + Vec3::Z * (4e-4 * frame) }));
        if frame == 50.0 {
            post(2, Box::new(LetGo { by: TOOL }));
            post(0, Box::new(Scrape { center: Vec3::ZERO, radius: 0.02 }));
        }
    };
    objects.push(point(3, Acting(tool)));
    scene(objects, Vec3::NEG_Z * GRAVITY)
}

#[test]
fn the_same_bits_for_every_executor_while_cuts_are_made() {
    let hashes = |executor: ExecutorKind, threads: usize, grain: Grain| {
        let settings = Settings { executor, threads, grain, ..Settings::default() };
        let mut manager = VeManager::new(operation(), settings).expect("a small scene");
        let mailbox = manager.mailbox();
        let mut hashes = Vec::new();
        for round in 0..4_u16 {
            // From outside too: a second blade, across the first one's cut.
            let at = |x: f32| blade(0.01 + x, 0.05 - 3.0 * x);
            let x = 4e-3 * f32::from(round);
            let cut = Cut { by: ObjectId::HOST, before: at(x), now: at(x + 4e-3) };
            mailbox.post(ObjectId(0), Message::Custom(Box::new(cut)));
            manager.run(20, &mut NullRenderer::new(), &mut |_| {}).expect("no table is full");
            hashes.push(manager.state_hash());
        }
        assert_eq!(manager.quarantined(), []);
        let mut nodes = Vec::new();
        manager.visit(&mut |object| {
            nodes.extend(Tissue::of(object).map(|tissue| (object.id().0, tissue.rest().len())));
        });
        nodes.sort_unstable();
        (hashes, nodes)
    };
    let expected = hashes(ExecutorKind::Serial, 1, Grain::Spatial);
    assert!(expected.1[0].1 > 90 && expected.1[1].1 > 110, "cuts were made: {:?}", expected.1);
    for &executor in ExecutorKind::ALL {
        for threads in 1..=3 {
            for grain in [Grain::Spatial, Grain::Pairwise] {
                let result = hashes(executor, threads, grain);
                assert_eq!(result, expected, "{executor:?}, {threads} threads, {grain:?}");
            }
        }
    }
}

#[test]
fn a_hash_shows_everything_that_is_remembered() {
    let hash = |told: Option<Box<dyn Custom>>| {
        let (mesh, tissue) = drum(7, 8);
        let mut executor = alone(mesh, tissue, Vec3::ZERO);
        told.into_iter().for_each(|told| executor.mailbox().post(PATCH, Message::Custom(told)));
        run(&mut executor, 1).1
    };
    // None of these moves a node within the frame.
    let far = Vec3::X;
    let (stiffness, strength) = (1.0, 1.0);
    let held = Grasp { by: TOOL, point: far, radius: 0.0, stiffness, strength };
    let other = Grasp { by: ObjectId(98), ..held };
    let plain = hash(None);
    let all = [plain, hash(Some(Box::new(held))), hash(Some(Box::new(other)))];
    assert!(all[0] != all[1] && all[1] != all[2] && all[0] != all[2]);
    assert_eq!(plain, hash(None));
    let pinless = Scrape { center: lattice(7, EDGE).0[0] * 1.15, radius: 1e-6 };
    assert_ne!(hash(Some(Box::new(pinless))), plain);
}
