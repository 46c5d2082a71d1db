//! The arithmetic of tissue: a whole frame of one body.
//!
//! A substep predicts positions from velocities and gravity, corrects each constraint once (XPBD, Macklin et al. 2016,
//! with the small steps of Macklin et al. 2019: many substeps of one iteration beat one step of many iterations), and
//! adds to the velocities what the corrections came to: taken from how far the nodes came, they would lose in each
//! substep what rounds away in a place (at 1 m and 400 substeps all of gravity). The constraints' multipliers start
//! from 0 in every substep; with what they were before, which would make stiff springs stiffer, the forces lag behind
//! the motion and its energy grows (tried: with 0.9 of them, a sheet of 5 mm edges and 4,330 N/m flies apart).
//!
//! Every number is the result of the same IEEE 754 operations in the same order, whatever the
//! instructions.

use std::array::from_fn;

use glam::Vec3;

use super::super::spring_law::LEAST_SQUARE;
use super::anchors::Anchor;
use super::springs::{Block, WIDTH};
use crate::geometry::{Mesh, Vectors};
use crate::simd::{Isa, Kernel, Quad};

/// A body's nodes, and after them one that nothing moves.
#[derive(Clone, Debug, Default)]
pub(super) struct Nodes {
    /// Where the first node was, in metres, from which positions count: what a body is far from does not blur it.
    origin: Vec3,
    /// x, y, z in metres, and the inverse mass in 1/kg.
    positions: Vec<Quad>,
    /// The positions before the last substep's corrections.
    predicted: Vec<Quad>,
    /// In metres per second, and 0.
    velocities: Vec<Quad>,
}

impl Nodes {
    /// Takes over a mesh's nodes.
    pub(super) fn load(&mut self, mesh: &Mesh) {
        let [x, y, z] = mesh.positions.as_slices();
        let inverse_masses = mesh.inverse_masses();
        let origin = mesh.positions.get(0).unwrap_or_default();
        self.origin = origin;
        self.positions.clear();
        let places = x.iter().zip(y).zip(z).zip(inverse_masses);
        let place = |(((&x, &y), &z), &w)| [x - origin.x, y - origin.y, z - origin.z, w];
        self.positions.extend(places.map(place));
        self.positions.push([0.0; 4]);
        let [x, y, z] = mesh.velocities.as_slices();
        self.velocities.clear();
        self.velocities.extend(x.iter().zip(y).zip(z).map(|((&x, &y), &z)| [x, y, z, 0.0]));
        self.predicted.clone_from(&self.positions);
    }

    /// Gives them back.
    pub(super) fn store(&self, mesh: &mut Mesh) {
        let give = |from: &[Quad], to: &mut Vectors, origin: Vec3| {
            let [x, y, z] = to.as_mut_slices();
            for (((x, y), z), from) in x.iter_mut().zip(y).zip(z).zip(from) {
                (*x, *y, *z) = (origin.x + from[0], origin.y + from[1], origin.z + from[2]);
            }
        };
        give(&self.positions, &mut mesh.positions, self.origin);
        give(&self.velocities, &mut mesh.velocities, Vec3::ZERO);
    }

    /// From where positions count, in metres.
    pub(super) fn origin(&self) -> Vec3 {
        self.origin
    }
}

/// The springs to the centre of a solid body.
#[derive(Clone, Copy)]
pub(super) struct ToCenter<'a> {
    /// The nodes' distances to the centre of mass at rest, in metres.
    pub(super) rest: &'a [f32],
    /// 1/(k h²) of each, in 1/kg.
    pub(super) compliance: f32,
}

/// One frame of tissue.
pub(super) struct Advance<'a> {
    pub(super) nodes: &'a mut Nodes,
    pub(super) springs: [&'a [Block]; 2],
    pub(super) to_center: Option<ToCenter<'a>>,
    pub(super) anchors: &'a mut [Anchor],
    /// The change of velocity by gravity in a substep, in metres per second.
    pub(super) fall: Quad,
    /// By what velocities are multiplied in a substep.
    pub(super) decay: f32,
    /// A substep's time, in seconds.
    pub(super) time: f32,
    pub(super) substeps: u32,
}

impl Kernel for Advance<'_> {
    type Output = ();

    #[inline(always)]
    fn run<I: Isa>(self, _isa: I) {
        let Nodes { positions, predicted, velocities, .. } = self.nodes;
        let rate = 1.0 / self.time;
        for _ in 0..self.substeps {
            // What the last substep corrected, and this one's prediction, in one go over the nodes.
            for ((position, predicted), velocity) in
                positions.iter_mut().zip(predicted.iter_mut()).zip(velocities.iter_mut())
            {
                // Whole quads at a time: number by number in place it took a quarter longer in all.
                let (place, moves) = (*position, if position[3] > 0.0 { 1.0 } else { 0.0 });
                let before = corrected(*velocity, place, *predicted, rate);
                let now: Quad = from_fn(|axis| before[axis] * self.decay + self.fall[axis] * moves);
                *position = from_fn(|axis| place[axis] + now[axis] * self.time);
                *velocity = now;
                *predicted = *position;
            }
            for block in self.springs.into_iter().flatten() {
                correct(block, positions);
            }
            if let Some(to_center) = self.to_center {
                to_center.correct(positions);
            }
            for anchor in &mut *self.anchors {
                anchor.correct(positions);
            }
        }
        for ((position, predicted), velocity) in
            positions.iter().zip(predicted.iter()).zip(velocities.iter_mut())
        {
            *velocity = corrected(*velocity, *position, *predicted, rate);
        }
    }
}

/// A velocity with what corrections came to since a node was predicted; `rate` is the inverse of the time for that.
#[inline(always)]
fn corrected(velocity: Quad, position: Quad, predicted: Quad, rate: f32) -> Quad {
    from_fn(|axis| velocity[axis] + (position[axis] - predicted[axis]) * rate)
}

/// Corrects the springs of a block: those of length l and rest r move their ends towards each other
/// by w·(l − r)/(w₁ + w₂ + 1/(k h²)).
#[inline(always)]
fn correct(block: &Block, positions: &mut [Quad]) {
    let (mut ways, mut squares) = ([[0.0; 4]; WIDTH], [0.0; WIDTH]);
    for lane in 0..WIDTH {
        let [a, b] = block.nodes[lane].map(|node| positions[node as usize]);
        let way = [b[0] - a[0], b[1] - a[1], b[2] - a[2], 0.0];
        squares[lane] = way[0] * way[0] + way[1] * way[1] + way[2] * way[2];
        ways[lane] = way;
    }
    let mut shares = [0.0; WIDTH];
    for lane in 0..WIDTH {
        let length = (squares[lane] + LEAST_SQUARE).sqrt();
        shares[lane] = (1.0 - block.rest[lane] / length) * block.gain[lane];
    }
    for lane in 0..WIDTH {
        let [a, b] = block.nodes[lane].map(|node| node as usize);
        let (to_a, to_b) = (shares[lane] * positions[a][3], shares[lane] * positions[b][3]);
        for axis in 0..4 {
            positions[a][axis] += ways[lane][axis] * to_a;
            positions[b][axis] -= ways[lane][axis] * to_b;
        }
    }
}

impl ToCenter<'_> {
    /// Corrects all springs to the centre at once. Each is a constraint of its node with the centre of mass as it
    /// was; what pulls at that, all nodes give back by the same way, so that momentum is kept and no light node is
    /// thrown by what heavy ones pull. Unlike a constraint of the volume, they also keep the shape, and go on doing so
    /// when the surface is cut open.
    #[inline(always)]
    fn correct(self, positions: &mut [Quad]) {
        let positions = &mut positions[..self.rest.len()];
        let (mut center, mut whole) = ([0.0; 4], 0.0);
        for position in &*positions {
            // What is held, in a mesh that somebody has put in the place of the tissue's own, has no part in it.
            let mass = if position[3] > 0.0 { 1.0 / position[3] } else { 0.0 };
            whole += mass;
            for axis in 0..4 {
                center[axis] += position[axis] * mass;
            }
        }
        center = center.map(|sum| sum / whole);
        let mut total = [0.0; 4];
        for (position, &rest) in positions.iter().zip(self.rest) {
            let pull = self.pull(position, rest, &center);
            for axis in 0..4 {
                total[axis] += pull[axis];
            }
        }
        let back = total.map(|sum| sum / whole);
        for (position, &rest) in positions.iter_mut().zip(self.rest) {
            let pull = self.pull(position, rest, &center);
            let inverse_mass = position[3];
            if inverse_mass > 0.0 {
                for axis in 0..4 {
                    position[axis] += pull[axis] * inverse_mass - back[axis];
                }
            }
        }
    }

    /// The impulse of a node's spring to the centre times the substep's time, in kilogram metres.
    #[inline(always)]
    fn pull(self, position: &Quad, rest: f32, center: &Quad) -> Quad {
        let way = [center[0] - position[0], center[1] - position[1], center[2] - position[2], 0.0];
        let square = way[0] * way[0] + way[1] * way[1] + way[2] * way[2];
        let length = (square + LEAST_SQUARE).sqrt();
        let share = (1.0 - rest / length) / (position[3] + self.compliance);
        way.map(|component| component * share)
    }
}
