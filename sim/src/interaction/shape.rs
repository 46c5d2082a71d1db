//! Detection between a deformable surface and a rigid shape.

use glam::Vec3;
use parry3d::query::PointProjection;

use super::Detection;
use super::contact::Contact;
use super::touches::{NearNodes, Touch, Touches};
use crate::geometry::{Bounds, LANES, Mesh, Rigid};
use crate::object::Object;
use crate::simd::{Isa, Kernel};

/// Finds the nodes whose contact spheres reach into a rigid shape. The pair's first object is the
/// deformable one. Walls are tested directly, other shapes by parry's exact point projection.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct NodesInShape;

impl Detection for NodesInShape {
    fn detect(&self, first: &Object, second: &Object, touches: &mut Touches) {
        let (Some(mesh), Some(rigid)) = (first.geometry.as_mesh(), second.geometry.as_rigid())
        else {
            return;
        };
        match rigid.plane() {
            Some((point, normal)) => behind_plane(mesh, point, normal, touches),
            None => in_shape(mesh, rigid, &second.bounds(), touches),
        }
    }
}

fn behind_plane(mesh: &Mesh, point: Vec3, normal: Vec3, touches: &mut Touches) {
    let reach = mesh.contact_radius() + point.dot(normal);
    let [nx, ny, nz] = normal.to_array();
    let [x, y, z] = mesh.positions.components();
    for (chunk, ((x, y), z)) in x.iter().zip(y).zip(z).enumerate() {
        let mut depths = [0.0; LANES];
        for lane in 0..LANES {
            depths[lane] = reach - (nx * x[lane] + ny * y[lane] + nz * z[lane]);
        }
        if depths.iter().all(|&depth| depth <= 0.0) {
            continue;
        }
        for (lane, &depth) in depths.iter().enumerate() {
            let node = chunk * LANES + lane;
            if depth > 0.0 && node < mesh.positions.len() {
                let nodes = [node as u32, Contact::BODY];
                touches.push(Touch { nodes, normal: normal.to_array(), depth });
            }
        }
    }
}

/// The search for a mesh's nodes in a box.
pub(super) struct Select<'a> {
    pub(super) mesh: &'a Mesh,
    pub(super) bounds: Bounds,
    pub(super) near: &'a mut NearNodes,
}

impl Kernel for Select<'_> {
    type Output = ();

    #[inline(always)]
    fn run<I: Isa>(self, isa: I) {
        self.near.select(isa, self.mesh, &self.bounds);
    }
}

fn in_shape(mesh: &Mesh, rigid: &Rigid, bounds: &Bounds, touches: &mut Touches) {
    let radius = mesh.contact_radius();
    let simd = touches.simd;
    let (list, [near, _]) = touches.parts();
    simd.run(Select { mesh, bounds: bounds.inflated(radius), near });
    for (index, &node) in near.nodes().iter().enumerate() {
        let position = Vec3::from_array(near.position(index));
        if let Some((depth, normal)) = deepest(rigid, position, radius) {
            list.push(Touch { nodes: [node, Contact::BODY], normal: normal.to_array(), depth });
        }
    }
}

/// How deep a node's contact sphere is in a shape, and the direction out. Of a shape's parts the one in which it is
/// deepest counts: another one's surface may be nearer, but within this one.
fn deepest(rigid: &Rigid, position: Vec3, radius: f32) -> Option<(f32, Vec3)> {
    let touch = |projection: PointProjection| {
        let out = position - projection.transform_by(&rigid.pose).point;
        let distance = out.length();
        let (depth, side) =
            if projection.is_inside { (radius + distance, -1.0) } else { (radius - distance, 1.0) };
        // A node exactly on the surface has no direction out; the next frame will tell.
        (depth > 0.0 && distance > 0.0).then(|| (depth, out * (side / distance)))
    };
    let place = rigid.pose.inverse_transform_point(position);
    match rigid.shape.as_compound() {
        Some(compound) => {
            let parts = compound.shapes().iter();
            let touches = parts.map(|(pose, part)| part.project_point(pose, place, false));
            touches.filter_map(touch).max_by(|a, b| a.0.total_cmp(&b.0))
        }
        None => touch(rigid.shape.project_local_point(place, false)),
    }
}
