//! Detection between two deformable surfaces.

use glam::Vec3;

use super::Detection;
use super::contact::Contact;
use super::touches::{NearNodes, Touch, Touches};
use crate::geometry::{LANES, Lanes};
use crate::object::Object;

/// Finds the pairs of nodes whose contact spheres overlap. With spheres of about 0.3 of a body's
/// radius the surface is closed: no node of another body fits between them.
///
/// Fast or heavily loaded bodies can still be pressed through each other, and once inside, nodes push
/// the wrong way. So each body may also have a core, a sphere around the mean of its nodes; cores that
/// overlap touch as whole bodies.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct NodeSpheres {
    /// The radius of a body's core, in metres; 0 for none.
    pub core_radius: f32,
}

impl Detection for NodeSpheres {
    fn detect(&self, first: &Object, second: &Object, touches: &mut Touches) {
        let (Some(a), Some(b)) = (first.geometry.as_mesh(), second.geometry.as_mesh()) else {
            return;
        };
        self.detect_cores(first.center(), second.center(), touches);
        let (list, [near_a, near_b]) = touches.parts();
        // A node touches only if its sphere reaches the box around the other's spheres; and only
        // those of the other's nodes matter that are in reach of one that does.
        near_a.select(a, &second.bounds().inflated(a.contact_radius()));
        if near_a.nodes().is_empty() {
            return;
        }
        let reach = a.contact_radius() + b.contact_radius();
        near_b.select(b, &near_a.bounds().inflated(reach * ROUNDING_MARGIN));
        for (index, &node) in near_a.nodes().iter().enumerate() {
            against_all(near_a.position(index), node, near_b, reach, list);
        }
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

/// Keeps the rounding of a box from hiding a touch that the distance would show.
const ROUNDING_MARGIN: f32 = 1.001;

/// Tests one node's sphere against all near spheres of the other body.
fn against_all(own: [f32; 3], node: u32, others: &NearNodes, reach: f32, list: &mut Vec<Touch>) {
    let reach_squared = reach * reach;
    for (chunk, other) in others.chunks().enumerate() {
        let squares = squared_distances(own, other);
        let mut hits = [false; LANES];
        for lane in 0..LANES {
            hits[lane] = squares[lane] < reach_squared;
        }
        if hits == [false; LANES] {
            continue;
        }
        for lane in (0..LANES).filter(|&lane| hits[lane]) {
            let distance = squares[lane].sqrt();
            list.push(Touch {
                nodes: [node, others.nodes()[chunk * LANES + lane]],
                normal: direction(own, other.map(|component| component[lane]), distance),
                depth: reach - distance,
            });
        }
    }
}

#[inline(always)]
fn squared_distances(own: [f32; 3], other: [&Lanes; 3]) -> Lanes {
    let mut squares = [0.0; LANES];
    for axis in 0..3 {
        for lane in 0..LANES {
            let way = own[axis] - other[axis][lane];
            squares[lane] += way * way;
        }
    }
    squares
}

/// The unit vector from `b` to `a`; upwards where they coincide.
fn direction(a: [f32; 3], b: [f32; 3], distance: f32) -> [f32; 3] {
    if distance > 0.0 {
        std::array::from_fn(|axis| (a[axis] - b[axis]) / distance)
    } else {
        [0.0, 1.0, 0.0]
    }
}
