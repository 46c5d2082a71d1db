//! The arithmetic of mass–spring bodies: a whole frame of one body, in lanes of nodes.
//!
//! Every set of instructions comes to the same bits, here and where bodies are [`abreast`], because
//! each does these operations in this order:
//! 1. The centre is the lanes' sums over the chunks of nodes in ascending order, [`fold`]ed, times the
//!    inverse of the number of nodes.
//! 2. The springs to the centre pull at all nodes alike by the sum of their forces, lane by lane over
//!    the chunks, then folded, times minus that inverse, plus 0: it is never −0.
//! 3. A node's force is the pull to the centre (0 without one), plus the pulls of its own springs in
//!    the order in which the topology lists them, plus 2., plus mass · gravity.
//! 4. Its velocity changes by force · (inverse mass · time), then its position by velocity · time.
//!
//! Here both ends of a spring compute its pull: within a body gathering is cheaper than scattering, and needs no order.
//!
//! [`abreast`]: super::abreast
//! [`fold`]: crate::simd::fold

use super::spring_law::{Dashpot, Elastic, Law, load, minus, plus, splat, store, times};
use super::{Input, batch};
use crate::geometry::{KernelParts, LANES, Lanes, Mesh, Slot, components, components_mut};
use crate::simd::{Isa, Kernel, Lanes3, Quad};

/// What one frame of a mass–spring body is computed from, besides its mesh: what [`MassSpring::begin`]
/// leaves to be done.
///
/// [`MassSpring::begin`]: super::MassSpring::begin
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Springs {
    /// c of all dashpots, in newton seconds per metre. They act first, over the whole frame.
    pub damping: f32,
    /// k of the springs between nodes, in newtons per metre.
    pub stiffness: f32,
    /// k of the springs to the centre, in newtons per metre.
    pub center_stiffness: f32,
    /// In metres per second squared.
    pub gravity: [f32; 3],
    /// The frame's time, in seconds.
    pub time: f32,
    /// Equal steps in which springs and gravity act, at least 1.
    pub substeps: u32,
}

impl Springs {
    /// The time of a substep, in seconds.
    #[must_use]
    pub fn step_time(&self) -> f32 {
        self.time / self.substeps as f32
    }

    /// Advances positions and velocities by the frame.
    ///
    /// # Panics
    /// The mesh has more or fewer positions or velocities than its topology has nodes.
    pub fn advance(self, mesh: &mut Mesh, input: &mut Input<'_>) {
        assert!(mesh.is_whole(), "a position and a velocity for each node");
        batch::advance_alone(mesh, self, &mut input.springs.alone, input.simd);
    }
}

/// Memory for a body's nodes.
#[derive(Debug, Default)]
pub(super) struct Nodes {
    /// In metres.
    positions: Vec<Lanes3>,
    /// In metres per second.
    velocities: Vec<Lanes3>,
    /// What the springs to the centre pull at each, in newtons.
    pulled: Vec<Lanes3>,
    /// Where positions and velocities are looked up.
    tables: [Vec<Quad>; 2],
}

impl Nodes {
    /// Makes room for a body of so many nodes.
    pub(super) fn reserve(&mut self, nodes: usize) {
        let chunks = nodes.div_ceil(LANES);
        for vectors in [&mut self.positions, &mut self.velocities, &mut self.pulled] {
            vectors.clear();
            vectors.reserve(chunks);
        }
        for table in &mut self.tables {
            table.clear();
            table.reserve(chunks * LANES);
        }
    }
}

/// One frame of a mass–spring body.
pub(super) struct Advance<'a> {
    pub(super) parts: KernelParts<'a>,
    pub(super) nodes: &'a mut Nodes,
    pub(super) springs: Springs,
}

impl Kernel for Advance<'_> {
    type Output = ();

    #[inline(always)]
    fn run<I: Isa>(self, isa: I) {
        let Self { parts, nodes, springs } = self;
        let chunks = parts.topology.present().len();
        gather(&mut nodes.positions, components(parts.positions), chunks);
        gather(&mut nodes.velocities, components(parts.velocities), chunks);
        nodes.pulled.clear();
        nodes.pulled.resize(chunks, Lanes3::default());
        if springs.damping > 0.0 {
            let law = Dashpot { damping: isa.splat(springs.damping) };
            let whole = Step { gravity: [0.0; 3], time: springs.time, drifts: false };
            whole.advance(isa, &parts, nodes, law, law);
        }
        let edges = Elastic { stiffness: isa.splat(springs.stiffness), one: isa.splat(1.0) };
        let to_center = Elastic { stiffness: isa.splat(springs.center_stiffness), ..edges };
        let step = Step { gravity: springs.gravity, time: springs.step_time(), drifts: true };
        for _ in 0..springs.substeps {
            step.advance(isa, &parts, nodes, edges, to_center);
        }
        scatter(&nodes.positions, components_mut(parts.positions));
        scatter(&nodes.velocities, components_mut(parts.velocities));
    }
}

/// Puts the components of each chunk side by side. There are `len` chunks then, or a panic.
#[inline(always)]
fn gather(chunks: &mut Vec<Lanes3>, components: [&[Lanes]; 3], len: usize) {
    let [x, y, z] = components.map(|component| &component[..len]);
    chunks.clear();
    chunks.extend(x.iter().zip(y).zip(z).map(|((&x, &y), &z)| Lanes3([x, y, z])));
}

/// The other way.
#[inline(always)]
fn scatter(chunks: &[Lanes3], components: [&mut [Lanes]; 3]) {
    for (axis, component) in components.into_iter().enumerate() {
        for (lanes, chunk) in component.iter_mut().zip(chunks) {
            *lanes = chunk.0[axis];
        }
    }
}

/// One step with one kind of force.
#[derive(Clone, Copy)]
struct Step {
    /// In metres per second squared.
    gravity: [f32; 3],
    /// In seconds.
    time: f32,
    /// Whether positions change too.
    drifts: bool,
}

impl Step {
    /// Makes the step, with one law for the springs between nodes and another for those to the centre.
    #[inline(always)]
    fn advance<I: Isa, L: Law<I>>(
        self,
        isa: I,
        parts: &KernelParts<'_>,
        nodes: &mut Nodes,
        edges: L,
        to_center: L,
    ) {
        let shared = splat(isa, pull_to_center(isa, parts, nodes, to_center));
        let Nodes { positions, velocities, pulled, tables } = nodes;
        let [of_positions, of_velocities] = tables;
        let chunks = positions.len();
        let (velocities, pulled) = (&mut velocities[..chunks], &pulled[..chunks]);
        let (masses, inverse_masses) = (&parts.masses[..chunks], &parts.inverse_masses[..chunks]);
        // From here on the nodes move, but what is looked up is where they were.
        let near = isa.table(positions, of_positions);
        let near_velocity =
            if L::NEEDS_VELOCITY { isa.table(velocities, of_velocities) } else { near };
        let gravity = splat(isa, self.gravity);
        let time = isa.splat(self.time);
        for chunk in 0..chunks {
            let position = load(isa, &positions[chunk].0);
            let velocity = load(isa, &velocities[chunk].0);
            let slots = parts.topology.slots(chunk);
            let tables = [near, near_velocity];
            let pulled = load(isa, &pulled[chunk].0);
            // SAFETY: a topology's slots name its own nodes only, and the tables hold all chunks of
            // them (see `gather`).
            let force =
                unsafe { edge_forces(isa, slots, tables, [position, velocity], edges, pulled) };
            let (mass, inverse_mass) = (isa.load(&masses[chunk]), isa.load(&inverse_masses[chunk]));
            // Gravity as a force, so that it moves neither held nodes nor the padding.
            let force = plus(isa, plus(isa, force, shared), times(isa, gravity, mass));
            let change = times(isa, force, isa.mul(inverse_mass, time));
            let velocity = plus(isa, velocity, change);
            store(isa, velocity, &mut velocities[chunk].0);
            if self.drifts {
                let position = plus(isa, position, times(isa, velocity, time));
                store(isa, position, &mut positions[chunk].0);
            }
        }
    }
}

/// Adds the forces of the springs between nodes on the nodes of one chunk to `force`. The tables are
/// those of positions and, where the law asks for them, velocities; `own` are the nodes'.
///
/// # Safety
/// Both tables hold every neighbour that the slots name.
#[inline(always)]
unsafe fn edge_forces<I: Isa, L: Law<I>>(
    isa: I,
    slots: &[Slot],
    [near, near_velocity]: [I::Table<'_>; 2],
    own: [[I::Vector; 3]; 2],
    law: L,
    mut force: [I::Vector; 3],
) -> [I::Vector; 3] {
    let [position, velocity] = own;
    for slot in slots {
        // SAFETY: the caller promises it.
        let other = unsafe { isa.look_up(near, &slot.neighbour) };
        let way = minus(isa, other, position);
        let relative = if L::NEEDS_VELOCITY {
            // SAFETY: likewise.
            minus(isa, unsafe { isa.look_up(near_velocity, &slot.neighbour) }, velocity)
        } else {
            way
        };
        let pull = law.pull(isa, way, relative, isa.load(&slot.rest));
        force = plus(isa, force, times(isa, way, pull));
    }
    force
}

/// Leaves what the springs to the centre pull at each node among the nodes, and returns the force on
/// all nodes alike: their share of what is pulled at the centre. All in newtons.
#[inline(always)]
fn pull_to_center<I: Isa, L: Law<I>>(
    isa: I,
    parts: &KernelParts<'_>,
    nodes: &mut Nodes,
    law: L,
) -> [f32; 3] {
    let Some(rest) = parts.topology.center_lanes() else { return [0.0; 3] };
    let Nodes { positions, velocities, pulled, .. } = nodes;
    let chunks = positions.len();
    let (velocities, pulled) = (&velocities[..chunks], &mut pulled[..chunks]);
    let (rest, present) = (&rest[..chunks], &parts.topology.present()[..chunks]);
    let share = 1.0 / parts.topology.nodes() as f32;
    let center = mean(isa, positions, share);
    let center_velocity =
        if L::NEEDS_VELOCITY { mean(isa, velocities, share) } else { [isa.splat(0.0); 3] };
    let mut total = [isa.splat(0.0); 3];
    for chunk in 0..chunks {
        let way = minus(isa, center, load(isa, &positions[chunk].0));
        let relative = if L::NEEDS_VELOCITY {
            // The padding is at rest: what the centre's velocity would do there may be infinite.
            let present = isa.load(&present[chunk]);
            times(isa, minus(isa, center_velocity, load(isa, &velocities[chunk].0)), present)
        } else {
            way
        };
        // Nothing pulls at the padding.
        let pull = law.pull(isa, way, relative, isa.load(&rest[chunk]));
        let force = times(isa, way, isa.mul(isa.load(&present[chunk]), pull));
        total = plus(isa, total, force);
        store(isa, force, &mut pulled[chunk].0);
    }
    let total = sum(isa, total);
    [total[0] * -share + 0.0, total[1] * -share + 0.0, total[2] * -share + 0.0]
}

/// The mean of all nodes, in every lane; `share` is the inverse of their number.
#[inline(always)]
fn mean<I: Isa>(isa: I, chunks: &[Lanes3], share: f32) -> [I::Vector; 3] {
    let mut lanes = [isa.splat(0.0); 3];
    for chunk in chunks {
        lanes = plus(isa, lanes, load(isa, &chunk.0));
    }
    let sum = sum(isa, lanes);
    splat(isa, [sum[0] * share, sum[1] * share, sum[2] * share])
}

#[inline(always)]
fn sum<I: Isa>(isa: I, lanes: [I::Vector; 3]) -> [f32; 3] {
    [isa.sum(lanes[0]), isa.sum(lanes[1]), isa.sum(lanes[2])]
}
