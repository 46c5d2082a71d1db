//! Pictures as they must be, and that faults in them are seen.
//!
//! `DUALFRAME_NEW_PICTURES=1 cargo test -p dualframe-render-wgpu --test pictures -- --ignored golden`
//! draws them anew: look at them before they are committed.

mod common;

use std::sync::Arc;

use common::{after, agree, draw, golden, room, scene};
use dualframe_render_wgpu::look::Coloring;
use dualframe_render_wgpu::picture::Picture;
use dualframe_sim::behavior::Fixed;
use dualframe_sim::geometry::{Geometry, Mesh, Topology, Volume};
use dualframe_sim::object::{Drawing, Group, Object, ObjectId};
use dualframe_sim::scene::{bone_piece, drill_burr_hole};
use glam::Vec3;
use parry3d::math::Pose;

const PARTICLES: usize = 40;

fn particles() -> Vec<Object> {
    scene(PARTICLES).objects
}

fn colored(objects: &[Object], coloring: Coloring) -> Picture {
    draw(objects, room(PARTICLES), coloring)
}

/// That a picture of other objects is seen to be another one.
fn is_seen(objects: &[Object]) {
    let [right, wrong] = [&particles(), objects].map(|list| colored(list, Coloring::Object));
    assert!(agree(&right, &wrong).is_err());
}

#[test]
#[ignore = "needs a graphics adapter; .ci/run has one"]
fn golden_particles() {
    for frame in [1, 60, 240] {
        golden(&format!("particles-{frame}"), &after(PARTICLES, frame));
    }
}

#[test]
#[ignore = "needs a graphics adapter; .ci/run has one"]
fn a_missing_object_is_seen() {
    for missing in [0, 17, 39] {
        let mut objects = particles();
        objects[missing].drawing = Drawing::Hidden;
        is_seen(&objects);
    }
}

#[test]
#[ignore = "needs a graphics adapter; .ci/run has one"]
fn a_wrong_color_is_seen() {
    let mut objects = particles();
    objects[3].visual.color = [0.9, 0.1, 0.1, 1.0];
    is_seen(&objects);
}

/// The same surface with a normal for each triangle instead of each node.
fn faceted(mesh: &Mesh) -> Mesh {
    let triangles = mesh.topology().triangles();
    let corners = triangles.as_flattened().iter();
    let nodes: Vec<Vec3> = corners.filter_map(|&node| mesh.positions.get(node as usize)).collect();
    let count = triangles.len() as u32;
    let own = (0..count).map(|index| [0, 1, 2].map(|corner| 3 * index + corner)).collect();
    let topology = Topology::new(&nodes, own, &[], false).expect("nodes are the triangles' own");
    let masses = vec![0.01; nodes.len()];
    Mesh::new(Arc::new(topology), &nodes, &masses, mesh.contact_radius()).expect("as many masses")
}

#[test]
#[ignore = "needs a graphics adapter; .ci/run has one"]
fn wrong_normals_are_seen() {
    let mut objects = particles();
    for object in &mut objects[..PARTICLES] {
        let mesh = object.geometry.as_mesh().map(faceted);
        object.geometry = Geometry::Mesh(mesh.expect("a particle is a mesh"));
    }
    is_seen(&objects);
}

/// A drilled piece of skull.
fn drilled() -> Volume {
    let mut bone = bone_piece(96, Pose::IDENTITY).expect("a small piece");
    let side = bone.extent().x;
    let entry = Vec3::new(0.5 * side, 0.5 * side, side);
    drill_burr_hole(&mut bone, entry, Vec3::NEG_Z, 0.006, side);
    bone
}

fn bone_of(volume: Volume) -> Picture {
    let focus = volume.bounds();
    let mut object = Object::new(ObjectId(0), Group(0), Geometry::Volume(volume), Fixed);
    object.visual.color = [0.85, 0.8, 0.7, 1.0];
    draw(&[object], focus, Coloring::Object)
}

#[test]
#[ignore = "needs a graphics adapter; .ci/run has one"]
fn golden_drilled_bone() {
    golden("drilled-bone", &bone_of(drilled()));
}

#[test]
#[ignore = "needs a graphics adapter; .ci/run has one"]
fn an_undrawn_brick_is_seen() {
    let right = drilled();
    let (dims, spacing) = (right.dims(), right.spacing());
    let all: Vec<u8> = right.densities().collect();
    let whole = bone_of(right.clone());
    // Of a brick that the picture shows, nothing was sent.
    let brick = Vec3::new(2.0, 2.0, 4.0) * 16.0;
    let is_sent = |[x, y, z]: [u32; 3]| {
        let inside = |at: u32, first: f32| (first as u32..first as u32 + 16).contains(&at);
        !(inside(x, brick.x) && inside(y, brick.y) && inside(z, brick.z))
    };
    let number = |[x, y, z]: [u32; 3]| ((z * dims[1] + y) * dims[0] + x) as usize;
    let sent = |voxel| if is_sent(voxel) { all[number(voxel)] } else { 0 };
    let without = Volume::from_fn(dims, spacing, right.pose, sent).expect("as large as before");
    assert_ne!(without.digest(), right.digest(), "the brick is empty");
    assert!(agree(&whole, &bone_of(without)).is_err());
}

#[test]
#[ignore = "needs a graphics adapter; .ci/run has one"]
fn pictures_do_not_depend_on_the_order_of_objects() {
    let mut objects = particles();
    let forwards = colored(&objects, Coloring::Object);
    objects.reverse();
    assert_eq!(agree(&forwards, &colored(&objects, Coloring::Object)), Ok(()));
}

#[test]
#[ignore = "needs a graphics adapter; .ci/run has one"]
fn colors_say_strain_and_speed() {
    let objects = particles();
    let [object, strain, speed] = Coloring::ALL.map(|coloring| colored(&objects, coloring));
    assert!(agree(&object, &strain).is_err() && agree(&object, &speed).is_err());
    assert!(agree(&strain, &speed).is_err());
}
