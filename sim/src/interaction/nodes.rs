//! Detection between two deformable surfaces.

use glam::Vec3;

use super::Detection;
use super::contact::Contact;
use super::touches::{NearNodes, Touch, Touches};
use crate::geometry::{Bounds, LANES, Mesh, ROUNDING_MARGIN};
use crate::object::Object;
use crate::simd::{Isa, Kernel, lanes};

/// Finds the pairs of nodes whose contact spheres overlap. With spheres of about 0.3 of a body's
/// radius the surface is closed: no node of another body fits between them.
///
/// Fast or heavily loaded bodies can still be pressed through each other, and once inside, nodes push
/// the wrong way. So each body may also have a core, a sphere around the mean of its nodes; cores that
/// overlap touch as whole bodies.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct NodeSpheres {
    /// The radius of a body's core, in metres; 0 for none. A core that is larger than the body may go unnoticed.
    pub core_radius: f32,
}

impl Detection for NodeSpheres {
    fn detect(&self, first: &Object, second: &Object, touches: &mut Touches) {
        let (Some(a), Some(b)) = (first.geometry.as_mesh(), second.geometry.as_mesh()) else {
            return;
        };
        self.detect_cores(first.center(), second.center(), touches);
        let bounds = second.bounds().inflated(a.contact_radius());
        let simd = touches.simd;
        let (list, near) = touches.parts();
        simd.run(Overlaps { meshes: [a, b], bounds, near, list });
    }
}

impl NodeSpheres {
    fn detect_cores(&self, first: Vec3, second: Vec3, touches: &mut Touches) {
        let reach = 2.0 * self.core_radius;
        let distance = (first - second).length();
        if distance < reach {
            touches.push(Touch {
                nodes: [Contact::BODY; 2],
                normal: direction(first.to_array(), second.to_array(), distance),
                depth: reach - distance,
            });
        }
    }
}

/// The search for overlapping spheres of two meshes.
struct Overlaps<'a> {
    meshes: [&'a Mesh; 2],
    /// Around the second's spheres, grown by the first's radius.
    bounds: Bounds,
    near: &'a mut [NearNodes; 2],
    list: &'a mut Vec<Touch>,
}

impl Kernel for Overlaps<'_> {
    type Output = ();

    #[inline(always)]
    fn run<I: Isa>(self, isa: I) {
        let Self { meshes: [a, b], bounds, near: [near_a, near_b], list } = self;
        // A node touches only if its sphere reaches the box around the other's spheres; and only
        // those of the other's nodes matter that are in reach of one that does.
        near_a.select(isa, a, &bounds);
        if near_a.nodes().is_empty() {
            return;
        }
        let reach = a.contact_radius() + b.contact_radius();
        near_b.select(isa, b, &near_a.bounds(isa).inflated(reach * ROUNDING_MARGIN));
        for (index, &node) in near_a.nodes().iter().enumerate() {
            against_all(isa, near_a.position(index), node, near_b, reach, list);
        }
    }
}

/// Tests one node's sphere against all near spheres of the other body.
#[inline(always)]
fn against_all<I: Isa>(
    isa: I,
    own: [f32; 3],
    node: u32,
    others: &NearNodes,
    reach: f32,
    list: &mut Vec<Touch>,
) {
    let reach_squared = isa.splat(reach * reach);
    for (chunk, (other, there)) in others.chunks().enumerate() {
        let mut square = isa.splat(0.0);
        for axis in 0..3 {
            let way = isa.sub(isa.splat(own[axis]), isa.load(other[axis]));
            square = isa.add(square, isa.mul(way, way));
        }
        let hits = isa.less(square, reach_squared) & there;
        if hits == 0 {
            continue;
        }
        let mut squares = [0.0; LANES];
        isa.store(square, &mut squares);
        for lane in lanes(hits) {
            let distance = squares[lane].sqrt();
            list.push(Touch {
                nodes: [node, others.nodes()[chunk * LANES + lane]],
                normal: direction(own, other.map(|component| component[lane]), distance),
                depth: reach - distance,
            });
        }
    }
}

/// The unit vector from `b` to `a`; upwards where they coincide.
fn direction(a: [f32; 3], b: [f32; 3], distance: f32) -> [f32; 3] {
    if distance > 0.0 {
        std::array::from_fn(|axis| (a[axis] - b[axis]) / distance)
    } else {
        [0.0, 1.0, 0.0]
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use proptest::prelude::*;

    use super::*;
    use crate::behavior::Fixed;
    use crate::geometry::{Geometry, Topology};
    use crate::object::{Group, ObjectId};
    use crate::simd::Simd;

    /// Of nodes, in metres.
    const RADIUS: f32 = 0.1;

    fn on_a_sphere() -> impl Strategy<Value = Vec3> {
        [-1.0..1.0_f32, -1.0..1.0_f32, -1.0..1.0_f32]
            .prop_map(|way| 0.5 * Vec3::from_array(way).normalize_or(Vec3::X))
    }

    fn body(id: u32, nodes: &[Vec3]) -> Object {
        let topology = Topology::new(nodes, Vec::new(), &[], false).expect("a topology");
        let masses = vec![1.0; nodes.len()];
        let mesh = Mesh::new(Arc::new(topology), nodes, &masses, RADIUS).expect("a mesh");
        Object::new(ObjectId(id), Group(0), Geometry::Mesh(mesh), Fixed)
    }

    proptest! {
        #[test]
        fn spheres_that_overlap_touch_and_no_others(
            a in prop::collection::vec(on_a_sphere(), 1..100),
            b in prop::collection::vec(on_a_sphere(), 1..100),
            way in on_a_sphere(),
            distance in 0.5..1.25_f32,
        ) {
            let b: Vec<Vec3> = b.into_iter().map(|node| node + 2.0 * distance * way).collect();
            // Those that hardly touch, if at all, are found or not as they are rounded.
            let deep = |depth: f32| depth > 1e-5;
            let depth = |one: usize, other: usize| 2.0 * RADIUS - a[one].distance(b[other]);
            let pairs = (0..a.len()).flat_map(|one| (0..b.len()).map(move |other| [one, other]));
            let expected: Vec<[u32; 2]> = pairs
                .filter(|&[one, other]| deep(depth(one, other)))
                .map(|nodes| nodes.map(|node| node as u32))
                .collect();
            for simd in Simd::available() {
                let mut touches = Touches::default();
                touches.simd = simd;
                NodeSpheres::default().detect(&body(0, &a), &body(1, &b), &mut touches);
                let found = touches.list().iter().filter(|touch| deep(touch.depth));
                let mut found: Vec<[u32; 2]> = found.map(|touch| touch.nodes).collect();
                found.sort_unstable();
                prop_assert_eq!(&found, &expected);
            }
        }
    }
}
