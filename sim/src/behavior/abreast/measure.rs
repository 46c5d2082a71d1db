//! Where bodies side by side are: to the same bits as a mesh by itself is measured, a lane each.

use glam::Vec3;

use super::super::spring_law::{load, minus, plus};
use super::nodes::{Body, Columns, Node};
use super::{WIDEST, sum};
use crate::geometry::{Bounds, Extent};
use crate::simd::Arithmetic;

/// Notes where the bodies with these nodes are, so many and 0 in whole [`LANES`](crate::geometry::LANES).
#[inline(always)]
pub(super) fn measure<A: Arithmetic<Lanes: Columns>>(
    isa: A,
    all: &[Node<A::Lanes>],
    count: usize,
    bodies: &mut [Option<Body<'_>>; WIDEST],
) {
    let nodes = &all[..count];
    let zero = isa.splat(0.0);
    let (mut low, mut high) = ([isa.splat(f32::INFINITY); 3], [isa.splat(f32::NEG_INFINITY); 3]);
    for node in nodes {
        let [x, y, z] = load(isa, &node.position);
        low = [isa.min(x, low[0]), isa.min(y, low[1]), isa.min(z, low[2])];
        high = [isa.max(x, high[0]), isa.max(y, high[1]), isa.max(z, high[2])];
    }
    // By itself a mesh adds zeros: neither is ever −0.
    let low = plus(isa, low, [zero; 3]);
    let center = plus(isa, sum(isa, all, |node| &node.position), [zero; 3]);
    let center = center.map(|axis| isa.div(axis, isa.splat(count.max(1) as f32)));
    let mut most = zero;
    for node in nodes {
        let [x, y, z] = minus(isa, load(isa, &node.position), center);
        let square = isa.add(isa.add(isa.mul(x, x), isa.mul(y, y)), isa.mul(z, z));
        most = isa.max(square, most);
    }
    let velocities = sum(isa, all, |node| &node.velocity);
    let [low, high, center, velocities] =
        [low, high, center, velocities].map(|vector| vector.map(|axis| stored(isa, axis)));
    let radius = stored(isa, isa.sqrt(most));
    for (lane, body) in bodies.iter_mut().enumerate().take(A::Lanes::COUNT) {
        let Some(body) = body else { continue };
        let vector =
            |axes: &[A::Lanes; 3]| Vec3::new(axes[0].at(lane), axes[1].at(lane), axes[2].at(lane));
        let center = vector(&center);
        let extent = Extent {
            bounds: Bounds { min: vector(&low), max: vector(&high) },
            center,
            radius: radius.at(lane),
            finite: center.is_finite() && vector(&velocities).is_finite(),
        };
        *body.extent = extent.with_contact_spheres(body.parts.contact_radius);
    }
}

#[inline(always)]
fn stored<A: Arithmetic<Lanes: Columns>>(isa: A, vector: A::Vector) -> A::Lanes {
    let mut lanes = A::Lanes::default();
    isa.store(vector, &mut lanes);
    lanes
}
