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
/// The distance to the surface is estimated by the density there and its slope, (ρ − ½)/|∇ρ|, which
/// reaches about a voxel to either side of it and is right to a tenth of a voxel near it. So of a contact sphere no more than a voxel counts, and a
/// node deep in bone, where every direction is as good, is left alone. Where there is no bone within a voxel
/// of a node, that costs one look-up of a density. A node that moves farther than about a voxel in a frame may pass.
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
    let step = volume.spacing().min_element();
    let coarse = gradient.length();
    if coarse * step <= LEAST_SLOPE {
        return None;
    }
    // Across a voxel only: an edge that is one voxel wide is steeper than the gradient, over two, says.
    let normal = -gradient / coarse;
    let aside = normal * (0.5 * step);
    let slope = (volume.density_at(point - aside) - volume.density_at(point + aside)) / step;
    Some(((density - 0.5) / slope.max(coarse), normal))
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use parry3d::math::Pose;

    use super::*;
    use crate::behavior::Fixed;
    use crate::geometry::{Geometry, Mesh, Topology};
    use crate::object::{Group, ObjectId};

    const SPACING: f32 = 5e-4;
    /// The surface of a slab of full bone that is 5 mm thick.
    const SURFACE: f32 = 10e-3;

    fn slab() -> Object {
        let full = |voxel: [u32; 3]| if (10..20).contains(&voxel[2]) { 255 } else { 0 };
        let volume = Volume::from_fn([40; 3], Vec3::splat(SPACING), Pose::IDENTITY, full);
        let volume = Geometry::Volume(volume.expect("it is small"));
        Object::new(ObjectId(1), Group(1), volume, Fixed)
    }

    /// Nodes so high over the slab's surface.
    fn tissue(heights: &[f32], radius: f32) -> Object {
        let place = |(node, &height): (usize, &f32)| {
            Vec3::new(8e-3 + 1e-4 * node as f32, 9.1e-3, SURFACE + height)
        };
        let places: Vec<Vec3> = heights.iter().enumerate().map(place).collect();
        // At rest they are somewhere, wherever they have gone since.
        let rest = vec![Vec3::ZERO; places.len()];
        let topology = Topology::new(&rest, Vec::new(), &[], false).expect("some nodes");
        let masses = vec![1e-3; places.len()];
        let mesh = Mesh::new(Arc::new(topology), &places, &masses, radius).expect("as many masses");
        Object::new(ObjectId(0), Group(0), Geometry::Mesh(mesh), Fixed)
    }

    fn touches(heights: &[f32], radius: f32) -> Vec<Touch> {
        let mut touches = Touches::default();
        NodesInBone.detect(&tissue(heights, radius), &slab(), &mut touches);
        touches.list().to_vec()
    }

    #[test]
    fn nodes_near_the_surface_are_pushed_out() {
        let radius = 0.4 * SPACING;
        let heights = [0.2, 0.1, 0.0, -0.1, -0.2].map(|voxels: f32| voxels * SPACING);
        let found = touches(&heights, radius);
        assert_eq!(found.len(), heights.len());
        for (touch, height) in found.iter().zip(heights) {
            assert_eq!(touch.nodes[1], Contact::BODY);
            assert!(touch.normal[2] > 0.999, "{:?}", touch.normal);
            let off = touch.depth - (radius - height);
            assert!(off.abs() < 0.1 * SPACING, "{off} m off at {height} m");
        }
        let numbers: Vec<u32> = found.iter().map(|touch| touch.nodes[0]).collect();
        assert_eq!(numbers, [0, 1, 2, 3, 4]);
    }

    #[test]
    fn others_are_left_alone() {
        // Too high, deep inside, far outside, in no place at all.
        let heights = [0.45, 2.0, -5.0, 30.0, f32::NAN].map(|voxels: f32| voxels * SPACING);
        assert_eq!(touches(&heights, 0.4 * SPACING), []);
        // From below they are pushed down.
        let below = touches(&[-5e-3 - 0.1 * SPACING], 0.4 * SPACING);
        assert!(below[0].normal[2] < -0.999 && below[0].depth > 0.0, "{below:?}");
        // Of a great contact sphere a voxel counts.
        let depth = touches(&[0.0], 5e-3)[0].depth;
        assert!((depth - SPACING).abs() < 0.1 * SPACING, "{depth}");
    }

    /// Bone up to the end of its grid ends there, and reaches as far beyond as it does within a grid.
    #[test]
    fn a_grids_end_is_a_surface_like_any() {
        let volume = Volume::from_fn([40, 40, 20], Vec3::splat(SPACING), Pose::IDENTITY, |_| 255);
        let volume = Geometry::Volume(volume.expect("it is small"));
        let full = Object::new(ObjectId(1), Group(1), volume, Fixed);
        let (height, radius) = (0.2 * SPACING, 0.4 * SPACING);
        let mut found = Touches::default();
        NodesInBone.detect(&tissue(&[height], radius), &full, &mut found);
        assert_eq!(found.list().len(), 1);
        let off = found.list()[0].depth - (radius - height);
        assert!(off.abs() < 0.1 * SPACING, "{off} m off");
    }

    #[test]
    fn only_meshes_and_volumes() {
        let mut touches = Touches::default();
        NodesInBone.detect(&slab(), &slab(), &mut touches);
        NodesInBone.detect(&tissue(&[0.0], 1e-3), &tissue(&[0.0], 1e-3), &mut touches);
        assert_eq!(touches.list(), []);
    }
}
