//! Detection between a deformable surface and voxel bone.

use glam::Vec3;

use super::Detection;
use super::contact::Contact;
use super::shape::Select;
use super::touches::{Touch, Touches};
use crate::geometry::Volume;
use crate::object::Object;

/// Finds the nodes whose contact spheres reach into bone. The pair's first object is the deformable one,
/// the second a volume.
///
/// The distance to the surface is estimated by the density there and its gradient, (ρ − ½)/|∇ρ|, which
/// reaches about a voxel to either side of it. So of a contact sphere no more than a voxel counts, and a
/// node deep in bone, where every direction is as good, is left alone. Where there is no bone within a voxel
/// of a node, that costs one look-up of a density.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct NodesInBone;

impl Detection for NodesInBone {
    fn detect(&self, first: &Object, second: &Object, touches: &mut Touches) {
        let (Some(mesh), Some(volume)) = (first.geometry.as_mesh(), second.geometry.as_volume())
        else {
            return;
        };
        let simd = touches.simd;
        let (list, [near, _]) = touches.parts();
        let bounds = second.bounds().inflated(volume.spacing().max_element());
        simd.run(Select { mesh, bounds, near });
        let radius = mesh.contact_radius().min(volume.spacing().min_element());
        for (index, &node) in near.nodes().iter().enumerate() {
            let position = Vec3::from_array(near.position(index));
            let Some((depth, normal)) = in_bone(volume, position) else { continue };
            let depth = depth + radius;
            if depth > 0.0 {
                let nodes = [node, Contact::BODY];
                list.push(Touch { nodes, normal: normal.to_array(), depth });
            }
        }
    }
}

/// The least change of density that tells where the surface is, per voxel; usually 0.1. At the surface it is
/// about a half.
const LEAST_SLOPE: f32 = 0.1;

/// How deep a point (metres) is in bone, in metres, less than 0 outside, and the outward normal: near the
/// surface, within about a voxel.
pub(super) fn in_bone(volume: &Volume, point: Vec3) -> Option<(f32, Vec3)> {
    let density = volume.density_at(point);
    if density == 0.0 {
        return None;
    }
    let gradient = volume.gradient_at(point);
    let slope = gradient.length();
    let steep = slope * volume.spacing().min_element() > LEAST_SLOPE;
    steep.then(|| ((density - 0.5) / slope, -gradient / slope))
}
