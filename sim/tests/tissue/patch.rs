//! A patch of tissue, alone in the world.

use std::collections::BTreeMap;

use dualframe_sim::behavior::tissue::{Material, Pin, Tissue};
use dualframe_sim::executor::{Executor, SerialExecutor};
use dualframe_sim::geometry::{Blade, Geometry, Mesh};
use dualframe_sim::message::{Custom, Message};
use dualframe_sim::object::{Group, Object, ObjectId};
use dualframe_sim::scene::Scene;
use glam::Vec3;

use crate::common::{no_rules, serial};

/// The length of an edge, in metres.
pub(crate) const EDGE: f32 = 5e-3;
pub(crate) const TOOL: ObjectId = ObjectId(99);
pub(crate) const PATCH: ObjectId = ObjectId(0);
pub(crate) const GRAVITY: f32 = 9.81;

/// Scalp: E·t of 1 MPa × 5 mm, 5 kg/m².
pub(crate) fn scalp() -> Material {
    Material { stiffness: 4_330.0, bending: 80.0, to_center: 0.0, damping: 2.0, area_density: 5.0 }
}

/// A patch of equilateral triangles, flat in z = 0, of `side` nodes a side.
pub(crate) fn lattice(side: usize, edge: f32) -> (Vec<Vec3>, Vec<[u32; 3]>) {
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

pub(crate) fn patch(side: usize, material: Material, substeps: u32) -> (Mesh, Tissue) {
    let (rest, triangles) = lattice(side, EDGE);
    Tissue::new(&rest, triangles, material, 1e-3, substeps).expect("a valid patch")
}

/// The nodes at the border of a lattice.
pub(crate) fn border(side: usize) -> impl Iterator<Item = u32> {
    let at_border = move |index: &usize| {
        let (column, row) = (index % side, index / side);
        [column, row].into_iter().any(|place| place == 0 || place == side - 1)
    };
    (0..side * side).filter(at_border).map(|index| index as u32)
}

pub(crate) fn object(id: u32, mesh: Mesh, tissue: Tissue) -> Object {
    Object::new(ObjectId(id), Group(0), Geometry::Mesh(mesh), tissue)
}

pub(crate) fn scene(objects: Vec<Object>, gravity: Vec3) -> Scene {
    let mut stages = no_rules();
    stages.time_step = 1.0 / 60.0;
    stages.gravity = gravity;
    Scene::new(objects, stages)
}

/// One patch alone.
pub(crate) fn alone(mesh: Mesh, tissue: Tissue, gravity: Vec3) -> SerialExecutor {
    serial(scene(vec![object(0, mesh, tissue)], gravity))
}

pub(crate) fn tell(executor: &SerialExecutor, message: impl Custom + 'static) {
    executor.mailbox().post(PATCH, Message::Custom(Box::new(message)));
}

pub(crate) fn look<T>(executor: &SerialExecutor, look: impl Fn(&Tissue, &Mesh) -> T) -> T {
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

pub(crate) fn node(executor: &SerialExecutor, node: u32) -> Vec3 {
    look(executor, |_, mesh| mesh.positions.get(node as usize).expect("a node"))
}

pub(crate) fn total_mass(mesh: &Mesh) -> f64 {
    mesh.masses().iter().map(|&mass| f64::from(mass)).sum()
}

pub(crate) fn kinetic_energy(mesh: &Mesh) -> f64 {
    let nodes = mesh.velocities.iter().zip(mesh.masses());
    nodes.map(|(v, &mass)| 0.5 * f64::from(mass) * v.as_dvec3().length_squared()).sum()
}

/// The kinetic energy, and that of the springs along the edges.
pub(crate) fn energy(executor: &SerialExecutor) -> f64 {
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
pub(crate) fn noise(seed: &mut u32) -> f32 {
    *seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
    (*seed >> 8) as f32 / 16_777_216.0
}

pub(crate) fn replace_positions(mesh: &mut Mesh, new: impl Fn(Vec3, &mut u32) -> Vec3) {
    let mut seed = 1;
    for index in 0..mesh.positions.len() {
        let old = mesh.positions.get(index).expect("a node");
        mesh.positions.set(index, new(old, &mut seed));
    }
}

/// A blade that stands upright through a patch in z = 0.
pub(crate) fn blade(x: f32, y: f32) -> Blade {
    Blade { tip: Vec3::new(x, y, -5e-3), heel: Vec3::new(x, y, 0.1) }
}

/// A patch whose border is pinned at 1.15 times its rest shape.
pub(crate) fn drum(side: usize, substeps: u32) -> (Mesh, Tissue) {
    let (mut mesh, tissue) = patch(side, scalp(), substeps);
    replace_positions(&mut mesh, |position, _| position * 1.15);
    let (stiffness, strength) = (f32::INFINITY, f32::INFINITY);
    let point = |node: u32| mesh.positions.get(node as usize).expect("a node");
    let pins = border(side).map(|node| Pin { node, point: point(node), stiffness, strength });
    let pins = pins.collect();
    (mesh, tissue.with_pins(pins).expect("its own nodes"))
}

/// The greatest distance between nodes that are one at rest, in metres: how far a cut is open.
pub(crate) fn opening(tissue: &Tissue, mesh: &Mesh) -> f32 {
    let mut open = BTreeMap::<[u32; 3], Vec3>::new();
    let mut widest: f32 = 0.0;
    for (rest, position) in tissue.rest().iter().zip(mesh.positions.iter()) {
        let other = *open.entry(rest.to_array().map(f32::to_bits)).or_insert(position);
        widest = widest.max((position - other).length());
    }
    widest
}
