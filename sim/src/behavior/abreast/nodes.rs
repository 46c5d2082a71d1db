//! The nodes of bodies side by side: each body's numbers a column.

use std::fmt::Debug;
use std::slice;

use super::super::spring_kernel::Springs;
use super::WIDEST;
use crate::geometry::{Extent, KernelParts, LANES, Lanes, component, component_mut};
use crate::simd::{Arithmetic, HALF, HalfIsa, HalfLanes};

/// One number of each body.
pub(in super::super) trait Columns: Copy + Debug + Default {
    /// How many bodies there can be.
    const COUNT: usize;
    /// Where forces are loaded and stored fastest.
    type Alignment: Copy + Debug + Default;

    /// `number` of each lane.
    fn each(number: impl Fn(usize) -> f32) -> Self;
    /// That of one lane.
    fn at(&self, lane: usize) -> f32;
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
    fn at(&self, lane: usize) -> f32 {
        self[lane]
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
    fn at(&self, lane: usize) -> f32 {
        self[lane]
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
}

impl<C> Node<C> {
    #[inline(always)]
    fn row(&self, index: usize) -> &C {
        if index < 3 { &self.position[index] } else { &self.velocity[index - 3] }
    }
}

/// What one node of each body weighs.
#[derive(Clone, Copy, Debug, Default)]
pub(in super::super) struct Weight<C> {
    /// In kilograms.
    pub(super) mass: C,
    /// In 1/kg.
    pub(super) inverse: C,
}

/// Some numbers of one node of each body, a row each.
pub(super) trait Rows<C> {
    const COUNT: usize;
    /// A row of the node.
    fn row_mut(&mut self, index: usize) -> &mut C;
    /// What all nodes of one body have in that row.
    fn of<'b>(body: &'b KernelParts<'_>, index: usize) -> &'b [Lanes];
}

impl<C> Rows<C> for Node<C> {
    const COUNT: usize = 6;

    #[inline(always)]
    fn row_mut(&mut self, index: usize) -> &mut C {
        if index < 3 { &mut self.position[index] } else { &mut self.velocity[index - 3] }
    }

    #[inline(always)]
    fn of<'b>(body: &'b KernelParts<'_>, index: usize) -> &'b [Lanes] {
        let KernelParts { positions, velocities, .. } = body;
        if index < 3 { component(positions, index) } else { component(velocities, index - 3) }
    }
}

impl<C> Rows<C> for Weight<C> {
    const COUNT: usize = 2;

    #[inline(always)]
    fn row_mut(&mut self, index: usize) -> &mut C {
        if index == 0 { &mut self.mass } else { &mut self.inverse }
    }

    #[inline(always)]
    fn of<'b>(body: &'b KernelParts<'_>, index: usize) -> &'b [Lanes] {
        if index == 0 { body.masses } else { body.inverse_masses }
    }
}

/// The force on one node of each body, in newtons.
#[derive(Clone, Copy, Debug, Default)]
pub(in super::super) struct Force<C: Columns>(pub(super) [C; 3], pub(super) C::Alignment);

/// Memory for the nodes of bodies side by side.
#[derive(Debug, Default)]
pub(in super::super) struct Set<C: Columns> {
    /// The bodies under way, and those which wait for a lane or are done; in whole [`LANES`] of nodes.
    pub(super) nodes: [Vec<Node<C>>; 2],
    /// Of the same bodies.
    pub(super) weights: [Vec<Weight<C>>; 2],
    pub(super) forces: Vec<Force<C>>,
}

impl<C: Columns> Set<C> {
    /// Makes room for bodies of so many nodes.
    pub(super) fn reserve(&mut self, nodes: usize) {
        let room = nodes.next_multiple_of(LANES);
        for nodes in &mut self.nodes {
            nodes.resize(nodes.len().max(room), Node::default());
        }
        for weights in &mut self.weights {
            weights.resize(weights.len().max(room), Weight::default());
        }
        self.forces.resize(self.forces.len().max(room), Force::default());
    }
}

/// The nodes of all bodies, what they weigh and the forces on them.
pub(super) type Motion<'n, C> = (&'n mut [Node<C>], &'n [Weight<C>], &'n mut [Force<C>]);

/// A body with its numbers.
pub(in super::super) struct Body<'a> {
    pub(in super::super) parts: KernelParts<'a>,
    pub(in super::super) springs: Springs,
    /// Set to where it is in the end.
    pub(in super::super) extent: &'a mut Extent,
}

/// Exchanges the bodies of the lanes in which all bits are set.
#[inline(always)]
pub(super) fn exchange<A: Arithmetic, R: Rows<A::Lanes>>(
    isa: A,
    a: &mut [R],
    b: &mut [R],
    lanes: A::Vector,
) {
    for (a, b) in a.iter_mut().zip(b) {
        for row in 0..R::COUNT {
            let (a, b) = (a.row_mut(row), b.row_mut(row));
            let (old_a, old_b) = (isa.load(a), isa.load(b));
            isa.store(isa.choose(lanes, old_b, old_a), a);
            isa.store(isa.choose(lanes, old_a, old_b), b);
        }
    }
}

/// Brings the bodies side by side.
#[inline(always)]
pub(super) fn gather<H: HalfIsa, C: Columns, R: Rows<C>>(
    isa: H,
    bodies: &[Option<Body<'_>>; WIDEST],
    nodes: &mut [R],
) {
    let Some(Body { parts: any, .. }) = bodies.iter().flatten().next() else { return };
    let ((bodies, _), (nodes, _)) = (bodies.as_chunks::<HALF>(), nodes.as_chunks_mut::<HALF>());
    let chunks = nodes.len();
    for row in 0..R::COUNT {
        for (half, bodies) in bodies[..C::COUNT / HALF].iter().enumerate() {
            // Looked up and cut to their length here: in the loop below that took as long as the rest.
            let values = bodies.each_ref().map(|body| {
                // Lanes without a body repeat one.
                let body = body.as_ref().map_or(any, |body| &body.parts);
                let (values, _) = R::of(body, row).as_flattened().as_chunks();
                &values[..chunks]
            });
            for (chunk, nodes) in nodes.iter_mut().enumerate() {
                let mut rows = [isa.splat(0.0); HALF];
                for lane in 0..HALF {
                    rows[lane] = isa.load(&values[lane][chunk]);
                }
                let columns = isa.transpose(rows);
                for lane in 0..HALF {
                    isa.store(columns[lane], &mut nodes[lane].row_mut(row).halves_mut()[half]);
                }
            }
        }
    }
}

/// What bodies weigh that share their masses.
#[inline(always)]
pub(super) fn weigh<A: Arithmetic>(
    isa: A,
    body: &KernelParts<'_>,
    weights: &mut [Weight<A::Lanes>],
) {
    let masses = body.masses.as_flattened().iter().zip(body.inverse_masses.as_flattened());
    for (Weight { mass: to, inverse: to_inverse }, (&mass, &inverse)) in
        weights.iter_mut().zip(masses)
    {
        isa.store(isa.splat(mass), to);
        isa.store(isa.splat(inverse), to_inverse);
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
    for row in 0..Node::<C>::COUNT {
        for (half, bodies) in bodies[..C::COUNT / HALF].iter_mut().enumerate() {
            let values = bodies.each_mut().map(|body| match body {
                Some(Body { parts: KernelParts { positions, velocities, .. }, .. }) => {
                    let vectors = if row < 3 { positions } else { velocities };
                    let values = component_mut(vectors, row % 3).as_flattened_mut();
                    &mut values.as_chunks_mut().0[..chunks]
                }
                None => &mut [],
            });
            for (chunk, nodes) in nodes.iter().enumerate() {
                let mut columns = [isa.splat(0.0); HALF];
                for lane in 0..HALF {
                    columns[lane] = isa.load(&nodes[lane].row(row).halves()[half]);
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
