//! Mass–spring bodies of one topology side by side: a whole frame of several at once, a lane each.
//!
//! It comes to the same bits as a body by itself (see [`spring_kernel`]), at about half the cost: every
//! spring is computed once, added at one end and subtracted at the other. As bodies make different
//! numbers of substeps, two may share a lane: when the first is done the second takes its place.
//!
//! [`spring_kernel`]: super::spring_kernel

mod measure;
mod nodes;
mod wide;

use std::hint::black_box;
use std::ptr;

use self::measure::measure;
pub(super) use self::nodes::Body;
use self::nodes::{Columns, Force, Motion, Node, Set, Weight, exchange, gather, scatter, weigh};
pub(super) use self::wide::{cost_of_all_lanes, measure_cost_of_all_lanes};
use super::spring_kernel::Springs;
use super::spring_law::{Dashpot, Elastic, Law, load, minus, plus, store, times};
use crate::geometry::{KernelParts, LANES, Lanes, Spring, Topology};
use crate::simd::{Arithmetic, HALF, HalfIsa, HalfLanes, Isa, Kernel};

/// The most lanes.
pub(super) const WIDEST: usize = LANES;

/// The lane of a body by its place in descending order of substeps, and whether it comes second there:
/// the longest shares with the shortest.
pub(super) fn seat(place: usize, lanes: usize) -> (usize, usize) {
    if place < lanes { (0, place) } else { (1, 2 * lanes - 1 - place) }
}

/// Memory for the bodies' nodes.
#[derive(Debug, Default)]
pub(super) struct Nodes {
    half: Set<HalfLanes>,
    all: Set<Lanes>,
}

impl Nodes {
    /// Makes room for bodies of so many nodes.
    pub(super) fn reserve(&mut self, nodes: usize) {
        self.half.reserve(nodes);
        self.all.reserve(nodes);
    }
}

/// One frame of some bodies: those first in the lanes and those second. The first lane has a body, and
/// no lane has a second one without a first. All share their topology, whose number of nodes all their
/// lists have, and are damped or all not.
pub(super) struct AdvanceAbreast<'a> {
    /// Beyond [`HALF`] only if the instructions have registers for that.
    pub(super) bodies: [[Option<Body<'a>>; WIDEST]; 2],
    pub(super) nodes: &'a mut Nodes,
}

impl Kernel for AdvanceAbreast<'_> {
    type Output = ();

    #[inline(always)]
    fn run<I: Isa>(self, isa: I) {
        let Self { mut bodies, nodes } = self;
        if bodies[0][HALF].is_some() {
            advance_all(isa, isa.half(), &mut bodies, &mut nodes.all);
        } else {
            advance_all(isa.half(), isa.half(), &mut bodies, &mut nodes.half);
        }
    }
}

/// One frame of bodies in as many lanes as `isa` has; `half` brings them there.
#[inline(always)]
fn advance_all<A: Arithmetic<Lanes: Columns>, H: HalfIsa>(
    isa: A,
    half: H,
    [first, second]: &mut [[Option<Body<'_>>; WIDEST]; 2],
    set: &mut Set<A::Lanes>,
) {
    let Some(Body { parts: any @ KernelParts { topology, .. }, springs, .. }) = &first[0] else {
        return;
    };
    let (topology, idle) = (*topology, Seat { springs: *springs, left: 0 });
    let mut bodies = first.iter().chain(&*second).flatten();
    let alike = bodies.all(|body| ptr::eq(body.parts.masses, any.masses));
    set.reserve(topology.nodes());
    let len = topology.present().len() * LANES;
    let Set { nodes: [now, next], weights: [weights, next_weights], forces } = set;
    let (now, next) = (&mut now[..len], &mut next[..len]);
    let (weights, next_weights) = (&mut weights[..len], &mut next_weights[..len]);
    let forces = &mut forces[..len];
    // Where another topology's nodes may have been.
    forces[topology.nodes()..].fill(Force::default());
    if alike {
        weigh(isa, any, weights);
    } else {
        gather(half, first, weights);
        gather(half, second, next_weights);
    }
    let mut moving = begin(isa, half, topology, first, idle, (&mut *now, weights, &mut *forces));
    let next_weighed = if alike { &*weights } else { &*next_weights };
    let mut later =
        begin(isa, half, topology, second, idle, (&mut *next, next_weighed, &mut *forces));
    loop {
        let takes = |lane: usize| moving[lane].left == 0 && later[lane].left > 0;
        let takes: [bool; WIDEST] = std::array::from_fn(takes);
        if takes.contains(&true) {
            let lanes = mask(isa, takes);
            exchange(isa, now, next, lanes);
            if !alike {
                exchange(isa, weights, next_weights, lanes);
            }
            for lane in (0..WIDEST).filter(|&lane| takes[lane]) {
                moving[lane] = std::mem::replace(&mut later[lane], idle);
            }
        }
        let left = moving.iter().map(|seat| seat.left).filter(|&left| left > 0);
        let Some(substeps) = left.min() else { break };
        advance(isa, topology, &moving, substeps, (&mut *now, weights, &mut *forces));
        for seat in &mut moving {
            seat.left = seat.left.saturating_sub(substeps);
        }
    }
    // In lanes with two bodies the first one's place is where the second one began.
    for (first, second) in first.iter_mut().zip(&mut *second) {
        if second.is_some() {
            std::mem::swap(first, second);
        }
    }
    for (nodes, bodies) in [(&*now, first), (&*next, second)] {
        if bodies.iter().any(Option::is_some) {
            measure(isa, nodes, topology.nodes(), bodies);
            scatter(half, nodes, bodies);
        }
    }
}

/// What a lane computes with.
#[derive(Clone, Copy)]
struct Seat {
    springs: Springs,
    /// Substeps that are left.
    left: u32,
}

/// One number of each lane.
#[inline(always)]
fn numbers<A: Arithmetic<Lanes: Columns>>(
    isa: A,
    seats: &[Seat; WIDEST],
    number: fn(&Springs) -> f32,
) -> A::Vector {
    isa.load(&A::Lanes::each(|lane| number(&seats[lane].springs)))
}

/// All bits of the lanes in the set.
#[inline(always)]
fn mask<A: Arithmetic<Lanes: Columns>>(isa: A, set: [bool; WIDEST]) -> A::Vector {
    let bits = A::Lanes::each(|lane| f32::from_bits(if set[lane] { u32::MAX } else { 0 }));
    // A compiler that sees through it makes masked stores of choices, which are slow on some machines.
    isa.load(black_box(&bits))
}

/// Brings bodies side by side and lets the dashpots act. A lane without a body is `idle`.
#[inline(always)]
fn begin<A: Arithmetic<Lanes: Columns>, H: HalfIsa>(
    isa: A,
    half: H,
    topology: &Topology,
    bodies: &[Option<Body<'_>>; WIDEST],
    idle: Seat,
    (nodes, weights, forces): Motion<'_, A::Lanes>,
) -> [Seat; WIDEST] {
    let mut seats = [idle; WIDEST];
    for (seat, body) in seats.iter_mut().zip(bodies) {
        if let Some(Body { springs, .. }) = body {
            *seat = Seat { springs: *springs, left: springs.substeps };
        }
    }
    if bodies.iter().any(Option::is_some) {
        gather(half, bodies, nodes);
        if idle.springs.damping > 0.0 {
            let law = Dashpot { damping: numbers(isa, &seats, |springs| springs.damping) };
            let time = numbers(isa, &seats, |springs| springs.time);
            let step = Step { gravity: [isa.splat(0.0); 3], time, drifts: false };
            step.advance(isa, topology, (nodes, weights, forces), [law, law], None);
        }
    }
    seats
}

/// Makes some substeps in the lanes where some are left.
#[inline(always)]
fn advance<A: Arithmetic<Lanes: Columns>>(
    isa: A,
    topology: &Topology,
    seats: &[Seat; WIDEST],
    substeps: u32,
    (nodes, weights, forces): Motion<'_, A::Lanes>,
) {
    let stiffness = numbers(isa, seats, |springs| springs.stiffness);
    let edges = Elastic { stiffness, one: isa.splat(1.0) };
    let stiffness = numbers(isa, seats, |springs| springs.center_stiffness);
    let laws = [edges, Elastic { stiffness, ..edges }];
    let gravity = [
        numbers(isa, seats, |springs| springs.gravity[0]),
        numbers(isa, seats, |springs| springs.gravity[1]),
        numbers(isa, seats, |springs| springs.gravity[2]),
    ];
    let step = Step { gravity, time: numbers(isa, seats, Springs::step_time), drifts: true };
    let rests: [bool; WIDEST] = std::array::from_fn(|lane| seats[lane].left == 0);
    if !rests[..A::Lanes::COUNT].contains(&true) {
        for _ in 0..substeps {
            step.advance(isa, topology, (&mut *nodes, weights, &mut *forces), laws, None);
        }
    } else {
        let moving = mask(isa, rests.map(|rests| !rests));
        for _ in 0..substeps {
            step.advance(isa, topology, (&mut *nodes, weights, &mut *forces), laws, Some(moving));
        }
    }
}

/// One step with one kind of force.
#[derive(Clone, Copy)]
struct Step<V> {
    /// In metres per second squared.
    gravity: [V; 3],
    /// In seconds.
    time: V,
    /// Whether positions change too.
    drifts: bool,
}

impl<V: Copy> Step<V> {
    /// Makes the step, with one law for the springs between nodes and another for those to the centre,
    /// in all lanes or those where the bits of `moving` are set.
    #[inline(always)]
    fn advance<A: Arithmetic<Lanes: Columns, Vector = V>, L: Law<A>>(
        self,
        isa: A,
        topology: &Topology,
        (nodes, weights, forces): Motion<'_, A::Lanes>,
        [edges, to_center]: [L; 2],
        moving: Option<V>,
    ) {
        let shared = pull_to_center(isa, topology, nodes, forces, to_center);
        edge_forces(isa, topology, nodes, forces, edges);
        for ((node, Weight { mass, inverse }), Force(force, _)) in
            nodes.iter_mut().zip(weights).zip(&forces[..topology.nodes()])
        {
            // Else the compiler takes four nodes at a time where registers are short, which takes longer.
            black_box(());
            let force = plus(isa, load(isa, force), shared);
            let weight = times(isa, self.gravity, isa.load(mass));
            let factor = isa.mul(isa.load(inverse), self.time);
            let before = load(isa, &node.velocity);
            let velocity = plus(isa, before, times(isa, plus(isa, force, weight), factor));
            store(isa, choose(isa, moving, velocity, before), &mut node.velocity);
            if self.drifts {
                let before = load(isa, &node.position);
                let position = plus(isa, before, times(isa, velocity, self.time));
                store(isa, choose(isa, moving, position, before), &mut node.position);
            }
        }
    }
}

#[inline(always)]
fn choose<A: Arithmetic>(
    isa: A,
    chooser: Option<A::Vector>,
    a: [A::Vector; 3],
    b: [A::Vector; 3],
) -> [A::Vector; 3] {
    let Some(chooser) = chooser else { return a };
    [
        isa.choose(chooser, a[0], b[0]),
        isa.choose(chooser, a[1], b[1]),
        isa.choose(chooser, a[2], b[2]),
    ]
}

/// Adds the forces of the springs between nodes.
#[inline(always)]
fn edge_forces<A: Arithmetic<Lanes: Columns>, L: Law<A>>(
    isa: A,
    topology: &Topology,
    nodes: &[Node<A::Lanes>],
    forces: &mut [Force<A::Lanes>],
    law: L,
) {
    // Springs mostly follow others from the same node: its numbers stay at hand.
    let mut from = 0;
    let Some(Force(force, _)) = forces.first() else { return };
    let mut force = load(isa, force);
    let mut own = [load(isa, &nodes[from].position), load(isa, &nodes[from].velocity)];
    for Spring { nodes: [a, b], rest } in topology.springs() {
        let (a, b) = (*a as usize, *b as usize);
        if a != from {
            store(isa, force, &mut forces[from].0);
            from = a;
            force = load(isa, &forces[from].0);
            own = [load(isa, &nodes[from].position), load(isa, &nodes[from].velocity)];
        }
        let other = &nodes[b];
        // The way from the second end, and the force on it: what is subtracted or added may then be
        // in memory.
        let way = minus(isa, own[0], load(isa, &other.position));
        let relative =
            if L::NEEDS_VELOCITY { minus(isa, own[1], load(isa, &other.velocity)) } else { way };
        let pulled = times(isa, way, law.pull(isa, way, relative, isa.splat(*rest)));
        force = minus(isa, force, pulled);
        let Force(other, _) = &mut forces[b];
        store(isa, plus(isa, load(isa, other), pulled), other);
    }
    store(isa, force, &mut forces[from].0);
}

/// Sets the forces to those of the springs to the centre, and returns the force on all nodes of a body
/// alike: their share of what is pulled at its centre. All in newtons.
#[inline(always)]
fn pull_to_center<A: Arithmetic<Lanes: Columns>, L: Law<A>>(
    isa: A,
    topology: &Topology,
    nodes: &[Node<A::Lanes>],
    forces: &mut [Force<A::Lanes>],
    law: L,
) -> [A::Vector; 3] {
    let zero = [isa.splat(0.0); 3];
    let Some(rests) = topology.center_rest() else {
        forces.fill(Force::default());
        return zero;
    };
    let share = 1.0 / topology.nodes() as f32;
    let center = sum(isa, nodes, |node| &node.position);
    let center = times(isa, center, isa.splat(share));
    let velocity = if L::NEEDS_VELOCITY { sum(isa, nodes, |node| &node.velocity) } else { zero };
    let velocity = times(isa, velocity, isa.splat(share));
    for ((node, Force(force, _)), rest) in nodes.iter().zip(&mut *forces).zip(rests) {
        let way = minus(isa, center, load(isa, &node.position));
        let relative =
            if L::NEEDS_VELOCITY { minus(isa, velocity, load(isa, &node.velocity)) } else { way };
        let pull = law.pull(isa, way, relative, isa.splat(*rest));
        store(isa, times(isa, way, pull), force);
    }
    let total = sum(isa, forces, |force| &force.0);
    plus(isa, times(isa, total, isa.splat(-share)), zero)
}

/// The sum over a body's nodes, in whole [`LANES`] of which those beyond the last are 0, in the order in which a body by
/// itself takes it: over every [`LANES`]th node, then these sums as in [`fold`]. Where all are −0 it may be −0, and that
/// one is +0; nothing that is computed with it shows which.
///
/// [`fold`]: crate::simd::fold
#[inline(always)]
fn sum<A: Arithmetic, T>(isa: A, nodes: &[T], of: fn(&T) -> &[A::Lanes; 3]) -> [A::Vector; 3] {
    let mut total = [isa.splat(0.0); 3];
    let (chunks, _) = nodes.as_chunks::<LANES>();
    let Some((first, rest)) = chunks.split_first() else { return total };
    for (axis, total) in total.iter_mut().enumerate() {
        let mut sums = [*total; LANES];
        for lane in 0..LANES {
            sums[lane] = isa.load(&of(&first[lane])[axis]);
        }
        for chunk in rest {
            for lane in 0..LANES {
                sums[lane] = isa.add(sums[lane], isa.load(&of(&chunk[lane])[axis]));
            }
        }
        let mut half = HALF;
        while half > 0 {
            for lane in 0..half {
                sums[lane] = isa.add(sums[lane], sums[lane + half]);
            }
            half /= 2;
        }
        *total = sums[0];
    }
    total
}
