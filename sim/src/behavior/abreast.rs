//! Mass–spring bodies of one topology side by side: a whole frame of several at once, a lane each.
//!
//! It comes to the same bits as a body by itself (see [`spring_kernel`]), at about half the cost: every
//! spring is computed once, added at one end and subtracted at the other.
//!
//! [`spring_kernel`]: super::spring_kernel

use super::spring_kernel::Springs;
use super::spring_law::{Dashpot, Elastic, Law, load, minus, plus, splat, store, times};
use crate::geometry::{KernelParts, LANES, Lanes, Spring, Topology};
use crate::simd::{Arithmetic, HALF, HalfIsa, HalfLanes, Isa, Kernel};

/// The most bodies side by side.
pub(super) const MOST: usize = HALF;

/// One number of each body, where loads and stores are fastest.
#[derive(Clone, Copy, Debug, Default)]
#[repr(align(32))]
struct Numbers(HalfLanes);

/// One vector of each body, likewise.
#[derive(Clone, Copy, Debug, Default)]
#[repr(align(32))]
struct Node([HalfLanes; 3]);

/// The bodies' nodes, in whole [`LANES`] of them.
#[derive(Debug, Default)]
pub(super) struct Nodes {
    /// In metres.
    positions: Vec<Node>,
    /// In metres per second.
    velocities: Vec<Node>,
    /// In newtons.
    forces: Vec<Node>,
    /// In kilograms.
    masses: Vec<Numbers>,
    /// In 1/kg.
    inverse_masses: Vec<Numbers>,
}

impl Nodes {
    fn resize(&mut self, nodes: usize) {
        for vectors in [&mut self.positions, &mut self.velocities, &mut self.forces] {
            vectors.resize(nodes, Node::default());
        }
        self.masses.resize(nodes, Numbers::default());
        self.inverse_masses.resize(nodes, Numbers::default());
    }
}

/// A body with its numbers.
pub(super) type Body<'a> = (KernelParts<'a>, Springs);

/// One frame of the bodies in the first lanes, in descending order of their substeps. They share
/// their topology, whose number of nodes all their lists have, and are all damped or all not.
pub(super) struct AdvanceAbreast<'a> {
    pub(super) bodies: [Option<Body<'a>>; MOST],
    pub(super) nodes: &'a mut Nodes,
}

impl Kernel for AdvanceAbreast<'_> {
    type Output = ();

    #[inline(always)]
    fn run<I: Isa>(self, isa: I) {
        let (Self { mut bodies, nodes }, isa) = (self, isa.half());
        let Some((KernelParts { topology, .. }, first)) = &bodies[0] else { return };
        let (topology, damped) = (*topology, first.damping > 0.0);
        nodes.resize(topology.present().len() * LANES);
        gather(isa, &bodies, nodes);
        let springs: [Option<&Springs>; MOST] = bodies.each_ref().map(|b| b.as_ref().map(|b| &b.1));
        // Lanes without a body repeat the first.
        let of = |number: fn(&Springs) -> f32| springs.map(|own| number(own.unwrap_or(first)));
        let substeps = springs.map(|own| own.map_or(0, |own| own.substeps));
        if damped {
            let law = Dashpot { damping: isa.load(&of(|springs| springs.damping)) };
            let time = isa.load(&of(|springs| springs.time));
            let step = Step { gravity: splat(isa, [0.0; 3]), time, drifts: false };
            step.advance(isa, topology, nodes, [law, law], None);
        }
        let edges =
            Elastic { stiffness: isa.load(&of(|springs| springs.stiffness)), one: isa.splat(1.0) };
        let to_center =
            Elastic { stiffness: isa.load(&of(|springs| springs.center_stiffness)), ..edges };
        let gravity = [
            isa.load(&of(|springs| springs.gravity[0])),
            isa.load(&of(|springs| springs.gravity[1])),
            isa.load(&of(|springs| springs.gravity[2])),
        ];
        let step = Step { gravity, time: isa.load(&of(Springs::step)), drifts: true };
        let mut done = substeps[MOST - 1];
        for _ in 0..done {
            step.advance(isa, topology, nodes, [edges, to_center], None);
        }
        for last in (0..MOST - 1).rev() {
            let mut moving = [0.0; HALF];
            moving[..=last].fill(f32::from_bits(u32::MAX));
            let moving = Some(isa.load(&moving));
            for _ in done..substeps[last] {
                step.advance(isa, topology, nodes, [edges, to_center], moving);
            }
            done = substeps[last];
        }
        scatter(isa, nodes, &mut bodies);
    }
}

/// Brings the bodies side by side.
#[inline(always)]
fn gather<H: HalfIsa>(isa: H, bodies: &[Option<Body<'_>>; MOST], nodes: &mut Nodes) {
    let Some((first, _)) = &bodies[0] else { return };
    let mut parts = [first; MOST];
    for (part, (body, _)) in parts.iter_mut().zip(bodies.iter().flatten()) {
        *part = body;
    }
    let (positions, _) = nodes.positions.as_chunks_mut::<HALF>();
    let (velocities, _) = nodes.velocities.as_chunks_mut::<HALF>();
    let (masses, _) = nodes.masses.as_chunks_mut::<HALF>();
    let (inverse_masses, _) = nodes.inverse_masses.as_chunks_mut::<HALF>();
    for half in 0..positions.len() {
        for axis in 0..3 {
            let mut rows = [isa.splat(0.0); HALF];
            let mut velocity_rows = rows;
            for lane in 0..HALF {
                rows[lane] = isa.load(row(&parts[lane].positions.components[axis], half));
                velocity_rows[lane] = isa.load(row(&parts[lane].velocities.components[axis], half));
            }
            let columns = isa.transpose(rows);
            for lane in 0..HALF {
                isa.store(columns[lane], &mut positions[half][lane].0[axis]);
            }
            let columns = isa.transpose(velocity_rows);
            for lane in 0..HALF {
                isa.store(columns[lane], &mut velocities[half][lane].0[axis]);
            }
        }
        let mut rows = [isa.splat(0.0); HALF];
        let mut inverse_rows = rows;
        for lane in 0..HALF {
            rows[lane] = isa.load(row(parts[lane].masses, half));
            inverse_rows[lane] = isa.load(row(parts[lane].inverse_masses, half));
        }
        let columns = isa.transpose(rows);
        for lane in 0..HALF {
            isa.store(columns[lane], &mut masses[half][lane].0);
        }
        let columns = isa.transpose(inverse_rows);
        for lane in 0..HALF {
            isa.store(columns[lane], &mut inverse_masses[half][lane].0);
        }
    }
}

/// Brings the bodies back.
#[inline(always)]
fn scatter<H: HalfIsa>(isa: H, nodes: &Nodes, bodies: &mut [Option<Body<'_>>; MOST]) {
    let (positions, _) = nodes.positions.as_chunks::<HALF>();
    let (velocities, _) = nodes.velocities.as_chunks::<HALF>();
    for half in 0..positions.len() {
        for axis in 0..3 {
            let mut columns = [isa.splat(0.0); HALF];
            let mut velocity_columns = columns;
            for lane in 0..HALF {
                columns[lane] = isa.load(&positions[half][lane].0[axis]);
                velocity_columns[lane] = isa.load(&velocities[half][lane].0[axis]);
            }
            let rows = isa.transpose(columns);
            let velocity_rows = isa.transpose(velocity_columns);
            for (lane, (body, _)) in bodies.iter_mut().flatten().enumerate() {
                isa.store(rows[lane], row_mut(&mut body.positions.components[axis], half));
                isa.store(
                    velocity_rows[lane],
                    row_mut(&mut body.velocities.components[axis], half),
                );
            }
        }
    }
}

#[inline(always)]
fn row(lanes: &[Lanes], half: usize) -> &HalfLanes {
    let (halves, _) = lanes[half / 2].as_chunks();
    &halves[half % 2]
}

#[inline(always)]
fn row_mut(lanes: &mut [Lanes], half: usize) -> &mut HalfLanes {
    let (halves, _) = lanes[half / 2].as_chunks_mut();
    &mut halves[half % 2]
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
    fn advance<H: HalfIsa<Vector = V>, L: Law<H>>(
        self,
        isa: H,
        topology: &Topology,
        nodes: &mut Nodes,
        [edges, to_center]: [L; 2],
        moving: Option<V>,
    ) {
        let shared = pull_to_center(isa, topology, nodes, to_center);
        edge_forces(isa, topology, nodes, edges);
        let len = topology.nodes();
        let (positions, velocities) = (&mut nodes.positions[..len], &mut nodes.velocities[..len]);
        let (masses, inverse_masses) = (&nodes.masses[..len], &nodes.inverse_masses[..len]);
        let forces = &nodes.forces[..len];
        for node in 0..len {
            let force = plus(isa, load(isa, &forces[node].0), shared);
            let weight = times(isa, self.gravity, isa.load(&masses[node].0));
            let factor = isa.mul(isa.load(&inverse_masses[node].0), self.time);
            let change = times(isa, plus(isa, force, weight), factor);
            let before = load(isa, &velocities[node].0);
            let velocity = plus(isa, before, change);
            store(isa, choose(isa, moving, velocity, before), &mut velocities[node].0);
            if self.drifts {
                let before = load(isa, &positions[node].0);
                let position = plus(isa, before, times(isa, velocity, self.time));
                store(isa, choose(isa, moving, position, before), &mut positions[node].0);
            }
        }
    }
}

#[inline(always)]
fn choose<H: HalfIsa>(
    isa: H,
    chooser: Option<H::Vector>,
    a: [H::Vector; 3],
    b: [H::Vector; 3],
) -> [H::Vector; 3] {
    let Some(chooser) = chooser else { return a };
    [
        isa.choose(chooser, a[0], b[0]),
        isa.choose(chooser, a[1], b[1]),
        isa.choose(chooser, a[2], b[2]),
    ]
}

/// Adds the forces of the springs between nodes.
#[inline(always)]
fn edge_forces<H: HalfIsa, L: Law<H>>(isa: H, topology: &Topology, nodes: &mut Nodes, law: L) {
    let len = topology.nodes();
    let (positions, velocities) = (&nodes.positions[..len], &nodes.velocities[..len]);
    let forces = &mut nodes.forces[..len];
    let Some(&Spring { nodes: [first, _], .. }) = topology.springs().first() else { return };
    // Springs mostly follow others from the same node: its numbers stay at hand.
    let mut from = first as usize;
    let mut force = load(isa, &forces[from].0);
    let mut own = [load(isa, &positions[from].0), load(isa, &velocities[from].0)];
    for Spring { nodes: [a, b], rest } in topology.springs() {
        let (a, b) = (*a as usize, *b as usize);
        if a != from {
            store(isa, force, &mut forces[from].0);
            from = a;
            force = load(isa, &forces[from].0);
            own = [load(isa, &positions[from].0), load(isa, &velocities[from].0)];
        }
        // The way from the second end, because what is subtracted may be in memory, and the same for
        // the force on it.
        let way = minus(isa, own[0], load(isa, &positions[b].0));
        let relative =
            if L::NEEDS_VELOCITY { minus(isa, own[1], load(isa, &velocities[b].0)) } else { way };
        let pull = law.pull(isa, way, relative, isa.splat(*rest));
        let pulled = times(isa, way, pull);
        force = minus(isa, force, pulled);
        let other = plus(isa, load(isa, &forces[b].0), pulled);
        store(isa, other, &mut forces[b].0);
    }
    store(isa, force, &mut forces[from].0);
}

/// Sets the forces to those of the springs to the centre, and returns the force on all nodes of a body
/// alike: their share of what is pulled at its centre. All in newtons.
#[inline(always)]
fn pull_to_center<H: HalfIsa, L: Law<H>>(
    isa: H,
    topology: &Topology,
    nodes: &mut Nodes,
    law: L,
) -> [H::Vector; 3] {
    let len = topology.nodes();
    let zero = [isa.splat(0.0); 3];
    let Some(rest) = topology.center_rest() else {
        nodes.forces[..len].fill(Node::default());
        return zero;
    };
    let (positions, velocities) = (&nodes.positions[..len], &nodes.velocities[..len]);
    let (forces, rest) = (&mut nodes.forces[..len], &rest[..len]);
    let share = 1.0 / len as f32;
    let center = times(isa, sum(isa, positions), isa.splat(share));
    let center_velocity =
        if L::NEEDS_VELOCITY { times(isa, sum(isa, velocities), isa.splat(share)) } else { zero };
    for node in 0..len {
        let way = minus(isa, center, load(isa, &positions[node].0));
        let relative = if L::NEEDS_VELOCITY {
            minus(isa, center_velocity, load(isa, &velocities[node].0))
        } else {
            way
        };
        let pull = law.pull(isa, way, relative, isa.splat(rest[node]));
        store(isa, times(isa, way, pull), &mut forces[node].0);
    }
    plus(isa, times(isa, sum(isa, forces), isa.splat(-share)), zero)
}

/// The sum over a body's nodes in the order in which a body by itself takes it: over every
/// [`LANES`]th node, then these sums as in [`fold`].
///
/// [`fold`]: crate::simd::fold
#[inline(always)]
fn sum<H: HalfIsa>(isa: H, nodes: &[Node]) -> [H::Vector; 3] {
    let zero = [isa.splat(0.0); 3];
    let mut sums = [zero; HALF];
    for lane in 0..HALF {
        let (low, high) = (every(isa, nodes, lane), every(isa, nodes, lane + HALF));
        sums[lane] = plus(isa, low, high);
    }
    let mut half = HALF / 2;
    while half > 0 {
        for lane in 0..half {
            sums[lane] = plus(isa, sums[lane], sums[lane + half]);
        }
        half /= 2;
    }
    // The other order begins with 0, which makes +0 of −0.
    plus(isa, sums[0], zero)
}

/// The sum over every [`LANES`]th node from the first given on.
#[inline(always)]
fn every<H: HalfIsa>(isa: H, nodes: &[Node], first: usize) -> [H::Vector; 3] {
    let Some(node) = nodes.get(first) else { return [isa.splat(0.0); 3] };
    let mut sum = load(isa, &node.0);
    let mut next = first + LANES;
    while let Some(node) = nodes.get(next) {
        sum = plus(isa, sum, load(isa, &node.0));
        next += LANES;
    }
    sum
}
