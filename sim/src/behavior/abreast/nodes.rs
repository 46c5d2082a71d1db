//! The nodes of bodies side by side: each body's numbers a column.

use super::super::spring_kernel::Springs;
use crate::geometry::{KernelParts, LANES};
use crate::simd::{HALF, HalfIsa, HalfLanes};

/// One node of each body, where loads and stores are fastest.
#[derive(Clone, Copy, Debug, Default)]
#[repr(align(64))]
pub(super) struct Node {
    /// In metres.
    pub(super) position: [HalfLanes; 3],
    /// In metres per second.
    pub(super) velocity: [HalfLanes; 3],
    /// In kilograms.
    pub(super) mass: HalfLanes,
    /// In 1/kg.
    pub(super) inverse_mass: HalfLanes,
}

impl Node {
    #[inline(always)]
    fn rows(&mut self) -> [&mut HalfLanes; ROWS] {
        let ([x, y, z], [vx, vy, vz]) = (&mut self.position, &mut self.velocity);
        [x, y, z, vx, vy, vz, &mut self.mass, &mut self.inverse_mass]
    }
}

/// The numbers of a node.
const ROWS: usize = 8;

/// The force on one node of each body, in newtons.
#[derive(Clone, Copy, Debug, Default)]
#[repr(align(32))]
pub(super) struct Force(pub(super) [HalfLanes; 3]);

/// Memory for the bodies' nodes.
#[derive(Debug, Default)]
pub(in super::super) struct Nodes {
    /// The bodies under way, and those which wait for a lane or are done; in whole [`LANES`] of nodes.
    pub(super) sets: [Vec<Node>; 2],
    pub(super) forces: Vec<Force>,
}

impl Nodes {
    /// Makes room for bodies of so many nodes.
    pub(in crate::behavior) fn reserve(&mut self, nodes: usize) {
        let room = nodes.next_multiple_of(LANES);
        for set in &mut self.sets {
            set.resize(set.len().max(room), Node::default());
        }
        self.forces.resize(self.forces.len().max(room), Force::default());
    }
}

/// A body with its numbers.
pub(in super::super) type Body<'a> = (KernelParts<'a>, Springs);

/// Exchanges the bodies of the lanes in which all bits are set.
#[inline(always)]
pub(super) fn exchange<H: HalfIsa>(isa: H, a: &mut [Node], b: &mut [Node], lanes: H::Vector) {
    for (a, b) in a.iter_mut().zip(b) {
        for (a, b) in a.rows().into_iter().zip(b.rows()) {
            let (old_a, old_b) = (isa.load(a), isa.load(b));
            isa.store(isa.choose(lanes, old_b, old_a), a);
            isa.store(isa.choose(lanes, old_a, old_b), b);
        }
    }
}

/// Brings the bodies side by side.
#[inline(always)]
pub(super) fn gather<H: HalfIsa>(isa: H, bodies: &[Option<Body<'_>>; HALF], nodes: &mut [Node]) {
    let Some((any, _)) = bodies.iter().flatten().next() else { return };
    // Lanes without a body repeat one.
    let bodies = bodies.each_ref().map(|body| body.as_ref().map_or(any, |(body, _)| body));
    for (half, nodes) in nodes.as_chunks_mut::<HALF>().0.iter_mut().enumerate() {
        for row in 0..ROWS {
            let mut rows = [isa.splat(0.0); HALF];
            for lane in 0..HALF {
                let KernelParts { positions, velocities, masses, inverse_masses, .. } =
                    bodies[lane];
                let values = match row {
                    0..3 => &positions.components[row],
                    3..6 => &velocities.components[row - 3],
                    6 => *masses,
                    _ => *inverse_masses,
                };
                rows[lane] = isa.load(&values[half / 2].as_chunks().0[half % 2]);
            }
            let columns = isa.transpose(rows);
            for lane in 0..HALF {
                isa.store(columns[lane], nodes[lane].rows()[row]);
            }
        }
    }
}

/// Brings positions and velocities back.
#[inline(always)]
pub(super) fn scatter<H: HalfIsa>(isa: H, nodes: &[Node], bodies: &mut [Option<Body<'_>>; HALF]) {
    for (half, nodes) in nodes.as_chunks::<HALF>().0.iter().enumerate() {
        for axis in 0..3 {
            let mut columns = [[isa.splat(0.0); HALF]; 2];
            for lane in 0..HALF {
                columns[0][lane] = isa.load(&nodes[lane].position[axis]);
                columns[1][lane] = isa.load(&nodes[lane].velocity[axis]);
            }
            let [positions, velocities] = [isa.transpose(columns[0]), isa.transpose(columns[1])];
            for lane in 0..HALF {
                let Some((body, _)) = &mut bodies[lane] else { continue };
                let row = &mut body.positions.components[axis][half / 2];
                isa.store(positions[lane], &mut row.as_chunks_mut().0[half % 2]);
                let row = &mut body.velocities.components[axis][half / 2];
                isa.store(velocities[lane], &mut row.as_chunks_mut().0[half % 2]);
            }
        }
    }
}
