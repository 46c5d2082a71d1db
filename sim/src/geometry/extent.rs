//! Where a geometry is: what the stages have to know of it after every update.

use glam::Vec3;

use super::bounds::Bounds;
use super::mesh::Mesh;
use super::vectors::{LANES, Lanes};
use crate::simd::{Isa, Kernel, greatest, least};

/// Where a geometry is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Extent {
    /// The box around it, contact spheres and a volume's margin included. Of no meaning if it is not
    /// finite.
    pub bounds: Bounds,
    /// The middle of it, in metres: the mean of a surface's nodes, a rigid shape's origin, a volume's
    /// middle.
    pub center: Vec3,
    /// The radius of a sphere around `center` that holds all of a surface, contact spheres included, in metres;
    /// infinite for what is no surface.
    pub radius: f32,
    /// Whether every number in it that changes is finite, a surface's sums of them too, and the box, unless it is empty.
    pub finite: bool,
}

/// Keeps rounding from hiding a touch that the distance would show: that of a sphere always, that of a box as far as
/// coordinates of about the size of the bodies are rounded; usually 1.001. Far away, and where boxes are tested
/// alone, a touch may be missed by as much as a coordinate is rounded.
pub(crate) const ROUNDING_MARGIN: f32 = 1.001;

impl Default for Extent {
    fn default() -> Self {
        Self::EMPTY
    }
}

impl Extent {
    /// Of nothing: it overlaps no other.
    pub const EMPTY: Self =
        Self { bounds: Bounds::EMPTY, center: Vec3::ZERO, radius: f32::INFINITY, finite: true };

    /// Of no object: NaNs, which no box overlaps; one without end would overlap the empty one.
    pub(crate) const NONE: Self = Self {
        bounds: Bounds { min: Vec3::NAN, max: Vec3::NAN },
        center: Vec3::NAN,
        radius: f32::NAN,
        finite: false,
    };

    /// Whether the objects in them may touch: the boxes share a point, and the spheres do so or miss each other by
    /// less than a thousandth.
    #[must_use]
    #[inline]
    pub fn overlaps(&self, other: &Self) -> bool {
        let reach = (self.radius + other.radius) * ROUNDING_MARGIN;
        self.bounds.overlaps(&other.bounds)
            && self.center.distance_squared(other.center) <= reach * reach
    }

    /// Of whatever is in a box: nothing is known of a sphere.
    pub(crate) fn of_box(bounds: Bounds) -> Self {
        Self { bounds, ..Self::EMPTY }
    }

    /// The same around contact spheres of this radius, in metres, on nodes that it is around.
    #[inline(always)]
    pub(crate) fn with_contact_spheres(self, contact_radius: f32) -> Self {
        let bounds = self.bounds.inflated(contact_radius);
        Self { radius: self.radius + contact_radius, ..Self::new(bounds, self.center, self.finite) }
    }

    /// Of a geometry whose numbers are finite or not. Finite numbers may still be too large for a box.
    pub(super) fn new(bounds: Bounds, center: Vec3, finite: bool) -> Self {
        let boxed = bounds.is_finite() || bounds == Bounds::EMPTY;
        Self { center, finite: finite && boxed, ..Self::of_box(bounds) }
    }
}

/// Zeros, and after them what hides a lane of padding from a search for the least number.
const HIDDEN: [f32; 2 * LANES] = {
    let mut hidden = [0.0; 2 * LANES];
    let mut lane = LANES;
    while lane < 2 * LANES {
        hidden[lane] = f32::INFINITY;
        lane += 1;
    }
    hidden
};

/// The measuring of a mesh: box and middle in one pass over its nodes, the radius in a second.
pub(super) struct Measure<'a>(pub(super) &'a Mesh);

impl Kernel for Measure<'_> {
    type Output = Extent;

    #[inline(always)]
    fn run<I: Isa>(self, isa: I) -> Extent {
        let Self(mesh) = self;
        let nodes = mesh.positions.len();
        let mut extent = Extent::EMPTY;
        let nothing = isa.splat(0.0);
        let (positions, velocities) = (mesh.positions.components(), mesh.velocities.components());
        for axis in 0..3 {
            let mut low = isa.splat(f32::INFINITY);
            let mut high = isa.splat(f32::NEG_INFINITY);
            let (mut sum, mut velocity) = (nothing, nothing);
            for (chunk, lanes) in positions[axis].iter().enumerate() {
                let values = isa.load(lanes);
                let hidden = isa.load(hidden_after(nodes - chunk * LANES));
                low = isa.min(isa.add(values, hidden), low);
                high = isa.max(isa.sub(values, hidden), high);
                sum = isa.add(sum, values);
            }
            for lanes in velocities[axis] {
                velocity = isa.add(velocity, isa.load(lanes));
            }
            extent.bounds.min[axis] = least(isa, low);
            extent.bounds.max[axis] = greatest(isa, high);
            extent.center[axis] = isa.sum(sum) / nodes.max(1) as f32;
            // An infinity or a NaN makes any sum one.
            extent.finite &= extent.center[axis].is_finite() && isa.sum(velocity).is_finite();
        }
        extent.radius = farthest(isa, positions, nodes, extent.center);
        extent.with_contact_spheres(mesh.contact_radius())
    }
}

/// The distance from `center` to the farthest of so many nodes.
#[inline(always)]
fn farthest<I: Isa>(isa: I, positions: [&[Lanes]; 3], nodes: usize, center: Vec3) -> f32 {
    let mut most = isa.splat(0.0);
    let [xs, ys, zs] = positions;
    for (chunk, ((x, y), z)) in xs.iter().zip(ys).zip(zs).enumerate() {
        // Negative where there is no node.
        let mut square = isa.sub(isa.splat(0.0), isa.load(hidden_after(nodes - chunk * LANES)));
        for (values, middle) in [x, y, z].into_iter().zip(center.to_array()) {
            let way = isa.sub(isa.load(values), isa.splat(middle));
            square = isa.add(square, isa.mul(way, way));
        }
        most = isa.max(square, most);
    }
    greatest(isa, most).sqrt()
}

/// What hides all lanes after the first so many.
#[inline(always)]
fn hidden_after(count: usize) -> &'static Lanes {
    HIDDEN[LANES - count.min(LANES)..].first_chunk().unwrap_or_else(|| unreachable!("two chunks"))
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::geometry::{Geometry, Topology};
    use crate::simd::Simd;

    const RADIUS: f32 = 0.5;

    /// `count` nodes away from the origin, where the padding is.
    fn mesh(count: usize) -> Mesh {
        let node = |index: usize| Vec3::new(3.0, 4.0, 5.0) + Vec3::splat(0.1 * index as f32);
        let nodes: Vec<Vec3> = (0..count).map(node).collect();
        let topology = Topology::new(&nodes, Vec::new(), &[], false).expect("a topology");
        Mesh::new(Arc::new(topology), &nodes, &vec![1.0; count], RADIUS).expect("a mesh")
    }

    fn extent(mesh: Mesh, simd: Simd) -> Extent {
        Geometry::Mesh(mesh).extent(simd)
    }

    #[test]
    fn padding_is_outside_of_box_and_sphere() {
        for count in [1, LANES - 1, LANES, LANES + 1, 42, 48] {
            for simd in Simd::available() {
                let (first, last) = (Vec3::new(3.0, 4.0, 5.0), 0.1 * (count - 1) as f32);
                let Extent { bounds, center, radius, finite } = extent(mesh(count), simd);
                assert!((bounds.min - (first - RADIUS)).length() < 1e-5, "{count}, {simd:?}");
                assert!(
                    (bounds.max - (first + last + RADIUS)).length() < 1e-5,
                    "{count}, {simd:?}"
                );
                assert!((center - (first + last / 2.0)).length() < 1e-5, "{count}, {simd:?}");
                let to_the_ends = Vec3::splat(last / 2.0).length();
                assert!((radius - (to_the_ends + RADIUS)).abs() < 1e-5, "{count}, {simd:?}");
                assert!(finite, "{count}, {simd:?}");
            }
        }
    }

    #[test]
    fn every_width_measures_the_same() {
        let all: Vec<Extent> = Simd::available().map(|simd| extent(mesh(42), simd)).collect();
        assert!(all.windows(2).all(|pair| pair[0] == pair[1]), "{all:?}");
    }

    #[test]
    fn whatever_is_not_finite_is_found() {
        for simd in Simd::available() {
            for node in [0, 15, 16, 41] {
                for wrong in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
                    let [mut moved, mut pushed] = [mesh(42), mesh(42)];
                    moved.positions.set(node, Vec3::new(0.0, wrong, 0.0));
                    pushed.velocities.set(node, Vec3::new(wrong, 0.0, 0.0));
                    assert!(!extent(moved, simd).finite, "{node}, {wrong}, {simd:?}");
                    assert!(!extent(pushed, simd).finite, "{node}, {wrong}, {simd:?}");
                }
            }
        }
    }
}
