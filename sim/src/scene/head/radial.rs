//! Radii by direction: a surface that is star-shaped around the middle of the head.

use std::cmp::Ordering;

use glam::Vec3;
use rayon::prelude::*;

use crate::parallel::on_all_cores;

/// The cells along an edge of the cube; 64 give steps of 1.8° at most, 2.6 mm on a skull.
const CELLS: usize = 64;
/// The nodes along an edge of the cube.
const NODES: usize = CELLS + 1;
/// The distance of what a filter gathers, as a tangent: usually 0.03, a node's distance.
const STEP: f32 = 0.03;

/// A radius in metres for every direction: at the nodes of grids on the faces of a cube, which share
/// the nodes on its edges, and bilinear between them.
#[derive(Clone, Debug)]
pub(super) struct RadialMap(Vec<f32>);

impl RadialMap {
    /// The radii that `radius` says of each node's direction.
    pub(super) fn from_fn(radius: impl Fn(Vec3) -> f32 + Send + Sync) -> Self {
        let [map] = Self::several(|direction| [radius(direction)]);
        map
    }

    /// Several maps, whose radii `radii` says of each node's direction.
    pub(super) fn several<const N: usize>(
        radii: impl Fn(Vec3) -> [f32; N] + Send + Sync,
    ) -> [Self; N] {
        let directions: Vec<Vec3> = directions().collect();
        let all: Vec<[f32; N]> = on_all_cores(|| directions.into_par_iter().map(radii).collect());
        std::array::from_fn(|map| Self(all.iter().map(|radii| radii[map]).collect()))
    }

    /// The radius along a direction of any length but 0.
    pub(super) fn at(&self, direction: Vec3) -> f32 {
        let (face, at) = on_cube(direction);
        let low = at.map(|value| (value as usize).min(CELLS - 1));
        let share = [at[0] - low[0] as f32, at[1] - low[1] as f32];
        let node = |i: usize, j: usize| self.0[number(face, [low[0] + i, low[1] + j])];
        let row = |j| node(0, j) + (node(1, j) - node(0, j)) * share[0];
        row(0) + (row(1) - row(0)) * share[1]
    }

    /// All nodes' directions and radii.
    pub(super) fn nodes(&self) -> impl Iterator<Item = (Vec3, f32)> {
        directions().zip(self.0.iter().copied())
    }

    /// Gives nodes whose radius is not a number the mean of their neighbours, from the edge of a gap
    /// inwards. All stay as they are if none is a number.
    pub(super) fn filled(mut self) -> Self {
        let mut left = usize::MAX;
        loop {
            let gaps = self.0.iter().filter(|radius| radius.is_nan()).count();
            if gaps == 0 || gaps == left {
                return self;
            }
            left = gaps;
            let fill = |(direction, radius): (Vec3, f32)| {
                if !radius.is_nan() {
                    return radius;
                }
                let known = self.around(direction, 1).filter(|radius| !radius.is_nan());
                let (sum, count) = known.fold((0.0, 0.0), |(sum, count), r| (sum + r, count + 1.0));
                if count > 0.0 { sum / count } else { radius }
            };
            self = Self(self.nodes().map(fill).collect());
        }
    }

    /// The median of the radii within `reach` steps of each node: holes and bumps smaller than half of
    /// that go, edges stay.
    pub(super) fn median(&self, reach: i32) -> Self {
        Self::from_fn(|direction| {
            let mut near: Vec<f32> = self.around(direction, reach).collect();
            let middle = near.len() / 2;
            let order = |a: &f32, b: &f32| a.partial_cmp(b).unwrap_or(Ordering::Equal);
            *near.select_nth_unstable_by(middle, order).1
        })
    }

    /// The mean of the radii within `reach` steps of each node.
    pub(super) fn mean(&self, reach: i32) -> Self {
        let count = ((2 * reach + 1) * (2 * reach + 1)) as f32;
        Self::from_fn(|direction| self.around(direction, reach).sum::<f32>() / count)
    }

    /// The radius at each direction as `radius` makes it of this map's and another's.
    pub(super) fn with(&self, other: &Self, radius: impl Fn(f32, f32) -> f32) -> Self {
        Self(self.0.iter().zip(&other.0).map(|(&a, &b)| radius(a, b)).collect())
    }

    /// The radii of the nodes nearest to a square grid of directions around one.
    fn around(&self, direction: Vec3, reach: i32) -> impl Iterator<Item = f32> {
        let [x, y] = tangents(direction).map(|tangent| tangent * STEP);
        let steps = move || (-reach..=reach).map(|step| step as f32);
        let places = steps().flat_map(move |j| steps().map(move |i| direction + x * i + y * j));
        places.map(|place| {
            let (face, at) = on_cube(place);
            self.0[number(face, at.map(|value| ((value + 0.5) as usize).min(CELLS)))]
        })
    }
}

/// Two unit vectors that are perpendicular to a unit vector and to each other.
pub(super) fn tangents(direction: Vec3) -> [Vec3; 2] {
    let pole = if direction.z.abs() < 0.9 { Vec3::Z } else { Vec3::X };
    let first = pole.cross(direction).normalize();
    [first, direction.cross(first)]
}

/// The directions of all nodes, face by face.
fn directions() -> impl Iterator<Item = Vec3> {
    // Exact, and so the same on both faces of an edge.
    cube(CELLS).map(Vec3::normalize)
}

/// The nodes on the faces of a cube from −1 to 1, face by face: so many cells along each edge, and a node more.
pub(super) fn cube(cells: usize) -> impl Iterator<Item = Vec3> {
    let coordinate = move |index: usize| (2 * index) as f32 / cells as f32 - 1.0;
    let nodes = move |face| (0..=cells).flat_map(move |j| (0..=cells).map(move |i| (face, i, j)));
    (0..6).flat_map(nodes).map(move |(face, i, j)| {
        let axis = face / 2;
        let mut node = Vec3::ZERO;
        node[axis] = if face % 2 == 0 { 1.0 } else { -1.0 };
        node[(axis + 1) % 3] = coordinate(i);
        node[(axis + 2) % 3] = coordinate(j);
        node
    })
}

/// The face that a direction goes through, and where, in cells.
fn on_cube(direction: Vec3) -> (usize, [f32; 2]) {
    let length = direction.abs();
    let axis = if length.x >= length.y && length.x >= length.z {
        0
    } else if length.y >= length.z {
        1
    } else {
        2
    };
    let face = 2 * axis + usize::from(direction[axis] < 0.0);
    let at = |other: usize| (direction[other % 3] / length[axis] + 1.0) * (0.5 * CELLS as f32);
    (face, [at(axis + 1), at(axis + 2)])
}

fn number(face: usize, [i, j]: [usize; 2]) -> usize {
    (face * NODES + j) * NODES + i
}

#[cfg(test)]
mod tests {
    use super::*;

    /// An ellipsoid's radius.
    fn ellipsoid(direction: Vec3) -> f32 {
        1.0 / (direction / Vec3::new(0.08, 0.07, 0.06)).length()
    }

    #[test]
    fn a_smooth_surface_comes_back() {
        let map = RadialMap::from_fn(ellipsoid);
        for (number, (direction, _)) in map.clone().nodes().enumerate().step_by(7) {
            let beside = (direction + Vec3::new(0.011, -0.007, 0.013)).normalize();
            let error = map.at(beside) - ellipsoid(beside);
            assert!(error.abs() < 1e-5, "{error} m at node {number}");
        }
    }

    #[test]
    fn faces_agree_on_their_edges() {
        let map = RadialMap::from_fn(ellipsoid).median(2).mean(1);
        for step in 0..=CELLS {
            let along = (2 * step) as f32 / CELLS as f32 - 1.0;
            let [a, b] = [1e-6, -1e-6].map(|side| map.at(Vec3::new(1.0 + side, along, 1.0)));
            assert!((a - b).abs() < 1e-6, "{a} {b}");
        }
    }

    #[test]
    fn gaps_close_and_spikes_go() {
        let leak = |center: Vec3, width: f32, value: f32| {
            move |direction: Vec3| {
                if direction.dot(center) > 1.0 - width { value } else { 0.08 }
            }
        };
        let center = Vec3::new(0.5, -0.6, 0.3).normalize();
        let hole = RadialMap::from_fn(leak(center, 0.02, f32::NAN));
        assert!(hole.at(center).is_nan());
        assert!((hole.filled().at(center) - 0.08).abs() < 1e-6);
        let spike = RadialMap::from_fn(leak(center, 0.001, 0.2));
        assert_eq!(spike.at(center), 0.2);
        assert_eq!(spike.median(3).at(center), 0.08);
        let nothing = RadialMap::from_fn(|_| f32::NAN).filled();
        assert!(nothing.at(center).is_nan());
    }
}
