//! Pictures as they must be, and that faults in them are seen.
//!
//! `DUALFRAME_NEW_PICTURES=1 cargo test -p dualframe-render-wgpu --test pictures -- --ignored golden`
//! draws them anew: look at them before they are committed.

mod common;

use std::sync::Arc;

use common::{after, agree, draw, golden, room, scene};
use dualframe_render_wgpu::look::Coloring;
use dualframe_render_wgpu::picture::Picture;
use dualframe_sim::geometry::{Geometry, Mesh, Topology};
use dualframe_sim::object::{Drawing, Object};
use glam::Vec3;

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
