//! The nodes of bodies side by side: each body's numbers a column.

use std::fmt::Debug;
use std::slice;

use super::super::spring_kernel::Springs;
use super::WIDEST;
use crate::geometry::{KernelParts, LANES, Lanes};
use crate::simd::{Arithmetic, HALF, HalfIsa, HalfLanes};

/// One number of each body.
pub(in super::super) trait Columns: Copy + Debug + Default {
    /// How many bodies there can be.
    const COUNT: usize;
    /// Where forces are loaded and stored fastest.
    type Alignment: Copy + Debug + Default;

    /// `number` of each lane.
    fn each(number: impl Fn(usize) -> f32) -> Self;
    fn halves(&self) -> &[HalfLanes];
    fn halves_mut(&mut self) -> &mut [HalfLanes];
}

#[derive(Clone, Copy, Debug, Default)]
#[repr(align(32))]
pub(in super::super) struct OfHalf;

impl Columns for HalfLanes {
    const COUNT: usize = HALF;
    type Alignment = OfHalf;

    #[inline(always)]
    fn each(number: impl Fn(usize) -> f32) -> Self {
        let mut lanes = [0.0; HALF];
        for (lane, own) in lanes.iter_mut().enumerate() {
            *own = number(lane);
        }
        lanes
    }

    #[inline(always)]
    fn halves(&self) -> &[HalfLanes] {
        slice::from_ref(self)
    }

    #[inline(always)]
    fn halves_mut(&mut self) -> &mut [HalfLanes] {
        slice::from_mut(self)
    }
}

#[derive(Clone, Copy, Debug, Default)]
#[repr(align(64))]
pub(in super::super) struct OfAll;

impl Columns for Lanes {
    const COUNT: usize = LANES;
    type Alignment = OfAll;

    #[inline(always)]
    fn each(number: impl Fn(usize) -> f32) -> Self {
        let mut lanes = [0.0; LANES];
        for (lane, own) in lanes.iter_mut().enumerate() {
            *own = number(lane);
        }
        lanes
    }

    #[inline(always)]
    fn halves(&self) -> &[HalfLanes] {
        self.as_chunks().0
    }

    #[inline(always)]
    fn halves_mut(&mut self) -> &mut [HalfLanes] {
        self.as_chunks_mut().0
    }
}

/// One node of each body, where loads and stores are fastest.
#[derive(Clone, Copy, Debug, Default)]
#[repr(align(64))]
pub(in super::super) struct Node<C> {
    /// In metres.
    pub(super) position: [C; 3],
    /// In metres per second.
    pub(super) velocity: [C; 3],
    /// In kilograms.
    pub(super) mass: C,
    /// In 1/kg.
    pub(super) inverse_mass: C,
}

/// The numbers of a node, those that change first.
const ROWS: usize = 8;
/// Those that change: its position and velocity.
const CHANGING: usize = 6;

impl<C> Node<C> {
    #[inline(always)]
    fn row(&self, row: usize) -> &C {
        let ([x, y, z], [vx, vy, vz]) = (&self.position, &self.velocity);
        [x, y, z, vx, vy, vz, &self.mass, &self.inverse_mass][row]
    }

    #[inline(always)]
    fn row_mut(&mut self, row: usize) -> &mut C {
        let ([x, y, z], [vx, vy, vz]) = (&mut self.position, &mut self.velocity);
        [x, y, z, vx, vy, vz, &mut self.mass, &mut self.inverse_mass][row]
    }
}

/// What all nodes of one body have in a row.
#[inline(always)]
fn numbers<'b>(body: &'b KernelParts<'_>, row: usize) -> &'b [Lanes] {
    let ([x, y, z], [vx, vy, vz]) = (&body.positions.components, &body.velocities.components);
    [x, y, z, vx, vy, vz, body.masses, body.inverse_masses][row]
}

/// Those of the rows that change.
#[inline(always)]
fn numbers_mut<'b>(body: &'b mut KernelParts<'_>, row: usize) -> &'b mut [Lanes] {
    let ([x, y, z], [vx, vy, vz]) =
        (&mut body.positions.components, &mut body.velocities.components);
    [x, y, z, vx, vy, vz][row]
}

/// The force on one node of each body, in newtons.
#[derive(Clone, Copy, Debug, Default)]
pub(in super::super) struct Force<C: Columns>(pub(super) [C; 3], pub(super) C::Alignment);

/// Memory for the nodes of bodies side by side.
#[derive(Debug, Default)]
pub(in super::super) struct Set<C: Columns> {
    /// The bodies under way, and those which wait for a lane or are done; in whole [`LANES`] of nodes.
    pub(super) nodes: [Vec<Node<C>>; 2],
    pub(super) forces: Vec<Force<C>>,
}

impl<C: Columns> Set<C> {
    /// Makes room for bodies of so many nodes.
    pub(super) fn reserve(&mut self, nodes: usize) {
        let room = nodes.next_multiple_of(LANES);
        for set in &mut self.nodes {
            set.resize(set.len().max(room), Node::default());
        }
        self.forces.resize(self.forces.len().max(room), Force::default());
    }
}

/// The nodes of all bodies and the forces on them.
pub(super) type Motion<'n, C> = (&'n mut [Node<C>], &'n mut [Force<C>]);

/// A body with its numbers.
pub(in super::super) type Body<'a> = (KernelParts<'a>, Springs);

/// Exchanges the bodies of the lanes in which all bits are set; those that are `alike` have their masses in common.
#[inline(always)]
pub(super) fn exchange<A: Arithmetic>(
    isa: A,
    a: &mut [Node<A::Lanes>],
    b: &mut [Node<A::Lanes>],
    lanes: A::Vector,
    alike: bool,
) {
    for (a, b) in a.iter_mut().zip(b) {
        for row in 0..ROWS {
            if alike && row == CHANGING {
                break;
            }
            let (a, b) = (a.row_mut(row), b.row_mut(row));
            let (old_a, old_b) = (isa.load(a), isa.load(b));
            isa.store(isa.choose(lanes, old_b, old_a), a);
            isa.store(isa.choose(lanes, old_a, old_b), b);
        }
    }
}

/// Brings the bodies side by side; if they are `alike`, their masses are those of one.
#[inline(always)]
pub(super) fn gather<A: Arithmetic<Lanes: Columns>, H: HalfIsa>(
    isa: A,
    half: H,
    bodies: &[Option<Body<'_>>; WIDEST],
    nodes: &mut [Node<A::Lanes>],
    alike: bool,
) {
    let Some((any, _)) = bodies.iter().flatten().next() else { return };
    if alike {
        let masses = any.masses.as_flattened().iter().zip(any.inverse_masses.as_flattened());
        for (node, (&mass, &inverse_mass)) in nodes.iter_mut().zip(masses) {
            isa.store(isa.splat(mass), &mut node.mass);
            isa.store(isa.splat(inverse_mass), &mut node.inverse_mass);
        }
    }
    let ((bodies, _), (nodes, _)) = (bodies.as_chunks::<HALF>(), nodes.as_chunks_mut::<HALF>());
    let chunks = nodes.len();
    // As many rows as the compiler knows, so that it knows where each of them is.
    for row in 0..ROWS {
        if alike && row == CHANGING {
            break;
        }
        for (side, bodies) in bodies[..A::Lanes::COUNT / HALF].iter().enumerate() {
            // Looked up and cut to their length here: in the loop below that took as long as the rest.
            let values = bodies.each_ref().map(|body| {
                // Lanes without a body repeat one.
                let body = body.as_ref().map_or(any, |(body, _)| body);
                let (values, _) = numbers(body, row).as_flattened().as_chunks();
                &values[..chunks]
            });
            for (chunk, nodes) in nodes.iter_mut().enumerate() {
                let mut rows = [half.splat(0.0); HALF];
                for lane in 0..HALF {
                    rows[lane] = half.load(&values[lane][chunk]);
                }
                let columns = half.transpose(rows);
                for lane in 0..HALF {
                    half.store(columns[lane], &mut nodes[lane].row_mut(row).halves_mut()[side]);
                }
            }
        }
    }
}

/// Brings positions and velocities back.
#[inline(always)]
pub(super) fn scatter<H: HalfIsa, C: Columns>(
    isa: H,
    nodes: &[Node<C>],
    bodies: &mut [Option<Body<'_>>; WIDEST],
) {
    let ((bodies, _), (nodes, _)) = (bodies.as_chunks_mut::<HALF>(), nodes.as_chunks::<HALF>());
    let chunks = nodes.len();
    for row in 0..CHANGING {
        for (side, bodies) in bodies[..C::COUNT / HALF].iter_mut().enumerate() {
            let values = bodies.each_mut().map(|body| match body {
                Some((body, _)) => {
                    &mut numbers_mut(body, row).as_flattened_mut().as_chunks_mut().0[..chunks]
                }
                None => &mut [],
            });
            for (chunk, nodes) in nodes.iter().enumerate() {
                let mut columns = [isa.splat(0.0); HALF];
                for lane in 0..HALF {
                    columns[lane] = isa.load(&nodes[lane].row(row).halves()[side]);
                }
                let rows = isa.transpose(columns);
                for lane in 0..HALF {
                    if let Some(values) = values[lane].get_mut(chunk) {
                        isa.store(rows[lane], values);
                    }
                }
            }
        }
    }
}
