//! The arithmetic of mass–spring bodies: a whole frame of one body, in lanes of nodes.
//!
//! Every set of instructions comes to the same bits, because each does these operations in this order:
//! 1. The centre is the lanes' sums over the chunks of nodes in ascending order, [`fold`]ed, times the
//!    inverse of the number of nodes.
//! 2. The springs to the centre pull at all nodes alike by the sum of their forces, lane by lane over
//!    the chunks, then folded, times minus that inverse.
//! 3. A node's force is 0, plus the pulls of its own springs in the order of the slots of its chunk,
//!    plus the pull to the centre, plus 2., plus mass · gravity.
//! 4. Its velocity changes by (force · inverse mass) · time, then its position by velocity · time.
//!
//! Both ends of a spring compute its pull: gathering is cheaper than scattering, and needs no order.
//!
//! [`fold`]: crate::simd::fold

use super::Workspace;
use crate::geometry::{KernelParts, Lanes, Slot};
use crate::simd::{Isa, Kernel, Lanes3};

/// The least squared length of a spring, m², which keeps a spring without length from dividing by 0.
/// It is far below the rounding error of any other.
const LEAST_SQUARE: f32 = 1e-30;

/// One frame of a mass–spring body.
pub(super) struct Advance<'a> {
    pub(super) parts: KernelParts<'a>,
    pub(super) workspace: &'a mut Workspace,
    /// c of all dashpots, in newton seconds per metre.
    pub(super) damping: f32,
    /// k of the springs between nodes, in newtons per metre.
    pub(super) stiffness: f32,
    /// k of the springs to the centre, in newtons per metre.
    pub(super) center_stiffness: f32,
    /// In metres per second squared.
    pub(super) gravity: [f32; 3],
    /// The frame's time, in seconds.
    pub(super) time: f32,
    /// Steps in which springs and gravity act.
    pub(super) substeps: u32,
}

impl Kernel for Advance<'_> {
    type Output = ();

    #[inline(always)]
    fn run<I: Isa>(self, isa: I) {
        let Self { parts, workspace, .. } = self;
        let chunks = parts.topology.present().len();
        gather(&mut workspace.positions, &parts.positions.components, chunks);
        gather(&mut workspace.velocities, &parts.velocities.components, chunks);
        workspace.pulled.resize(chunks, Lanes3::default());
        if self.damping > 0.0 {
            let law = Dashpot { damping: isa.splat(self.damping) };
            let whole = Step { gravity: [0.0; 3], time: self.time, drifts: false };
            whole.advance(isa, &parts, workspace, law, law);
        }
        let time = self.time / self.substeps as f32;
        let edges = Elastic { stiffness: isa.splat(self.stiffness), one: isa.splat(1.0) };
        let to_center = Elastic { stiffness: isa.splat(self.center_stiffness), ..edges };
        let step = Step { gravity: self.gravity, time, drifts: true };
        for _ in 0..self.substeps {
            step.advance(isa, &parts, workspace, edges, to_center);
        }
        scatter(&workspace.positions, &mut parts.positions.components);
        scatter(&workspace.velocities, &mut parts.velocities.components);
    }
}

/// Puts the components of each chunk side by side. There are `len` chunks then, or a panic.
#[inline(always)]
fn gather(chunks: &mut Vec<Lanes3>, components: &[Vec<Lanes>; 3], len: usize) {
    let [x, y, z] = components.each_ref().map(|component| &component[..len]);
    chunks.clear();
    chunks.extend(x.iter().zip(y).zip(z).map(|((&x, &y), &z)| Lanes3([x, y, z])));
}

/// The other way.
#[inline(always)]
fn scatter(chunks: &[Lanes3], components: &mut [Vec<Lanes>; 3]) {
    for (axis, component) in components.iter_mut().enumerate() {
        for (lanes, chunk) in component.iter_mut().zip(chunks) {
            *lanes = chunk.0[axis];
        }
    }
}

/// How a spring pulls its first end, in newtons per metre of the way to its second end.
trait Law<I: Isa>: Copy {
    /// Whether the relative velocity matters; looking it up costs as much as the rest.
    const NEEDS_VELOCITY: bool;

    /// The pull over the way (m) to the second end, which moves with the relative velocity (m/s).
    fn pull(
        self,
        isa: I,
        way: [I::Vector; 3],
        relative: [I::Vector; 3],
        rest: I::Vector,
    ) -> I::Vector;
}

/// Hooke's law: k (1 − r/l).
#[derive(Clone, Copy)]
struct Elastic<V> {
    stiffness: V,
    one: V,
}

impl<I: Isa> Law<I> for Elastic<I::Vector> {
    const NEEDS_VELOCITY: bool = false;

    #[inline(always)]
    fn pull(
        self,
        isa: I,
        way: [I::Vector; 3],
        _relative: [I::Vector; 3],
        rest: I::Vector,
    ) -> I::Vector {
        let length = isa.sqrt(square(isa, way));
        isa.mul(self.stiffness, isa.sub(self.one, isa.div(rest, length)))
    }
}

/// A dashpot along the spring: c (w·d)/l².
#[derive(Clone, Copy)]
struct Dashpot<V> {
    damping: V,
}

impl<I: Isa> Law<I> for Dashpot<I::Vector> {
    const NEEDS_VELOCITY: bool = true;

    #[inline(always)]
    fn pull(
        self,
        isa: I,
        way: [I::Vector; 3],
        relative: [I::Vector; 3],
        _rest: I::Vector,
    ) -> I::Vector {
        isa.div(isa.mul(self.damping, dot(isa, way, relative)), square(isa, way))
    }
}

#[inline(always)]
fn dot<I: Isa>(isa: I, a: [I::Vector; 3], b: [I::Vector; 3]) -> I::Vector {
    let in_plane = isa.add(isa.mul(a[0], b[0]), isa.mul(a[1], b[1]));
    isa.add(in_plane, isa.mul(a[2], b[2]))
}

/// The squared length, and a bit more.
#[inline(always)]
fn square<I: Isa>(isa: I, way: [I::Vector; 3]) -> I::Vector {
    isa.add(dot(isa, way, way), isa.splat(LEAST_SQUARE))
}

#[inline(always)]
fn minus<I: Isa>(isa: I, a: [I::Vector; 3], b: [I::Vector; 3]) -> [I::Vector; 3] {
    [isa.sub(a[0], b[0]), isa.sub(a[1], b[1]), isa.sub(a[2], b[2])]
}

#[inline(always)]
fn load<I: Isa>(isa: I, lanes: &Lanes3) -> [I::Vector; 3] {
    let [x, y, z] = &lanes.0;
    [isa.load(x), isa.load(y), isa.load(z)]
}

#[inline(always)]
fn store<I: Isa>(isa: I, vectors: [I::Vector; 3], lanes: &mut Lanes3) {
    let ([x, y, z], [to_x, to_y, to_z]) = (vectors, &mut lanes.0);
    isa.store(x, to_x);
    isa.store(y, to_y);
    isa.store(z, to_z);
}

// Not by `map`: what the library does not inline is compiled for the baseline.
#[inline(always)]
fn splat<I: Isa>(isa: I, vector: [f32; 3]) -> [I::Vector; 3] {
    [isa.splat(vector[0]), isa.splat(vector[1]), isa.splat(vector[2])]
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
        workspace: &mut Workspace,
        edges: L,
        to_center: L,
    ) {
        let shared = splat(isa, pull_to_center(isa, parts, workspace, to_center));
        let Workspace { positions, velocities, pulled, tables } = workspace;
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
            let mut position = load(isa, &positions[chunk]);
            let mut velocity = load(isa, &velocities[chunk]);
            let slots = parts.topology.slots(chunk);
            let tables = [near, near_velocity];
            // SAFETY: a topology's slots name its own nodes only, and the tables hold all chunks of
            // them (see `gather`).
            let own = unsafe { edge_forces(isa, slots, tables, position, velocity, edges) };
            let to_center = load(isa, &pulled[chunk]);
            let (mass, inverse_mass) = (isa.load(&masses[chunk]), isa.load(&inverse_masses[chunk]));
            for axis in 0..3 {
                let springs = isa.add(isa.add(own[axis], to_center[axis]), shared[axis]);
                // Gravity as a force, so that it moves neither held nodes nor the padding.
                let force = isa.add(springs, isa.mul(mass, gravity[axis]));
                let change = isa.mul(isa.mul(force, inverse_mass), time);
                velocity[axis] = isa.add(velocity[axis], change);
                position[axis] = isa.add(position[axis], isa.mul(velocity[axis], time));
            }
            store(isa, velocity, &mut velocities[chunk]);
            if self.drifts {
                store(isa, position, &mut positions[chunk]);
            }
        }
    }
}

/// The forces of the springs between nodes on the nodes of one chunk. The tables are those of positions
/// and, where the law asks for them, velocities.
///
/// # Safety
/// Both tables hold every neighbour that the slots name.
#[inline(always)]
unsafe fn edge_forces<I: Isa, L: Law<I>>(
    isa: I,
    slots: &[Slot],
    [near, near_velocity]: [I::Table<'_>; 2],
    position: [I::Vector; 3],
    velocity: [I::Vector; 3],
    law: L,
) -> [I::Vector; 3] {
    let mut force = [isa.splat(0.0); 3];
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
        for axis in 0..3 {
            force[axis] = isa.add(force[axis], isa.mul(pull, way[axis]));
        }
    }
    force
}

/// Leaves what the springs to the centre pull at each node in the workspace, and returns the force on
/// all nodes alike: their share of what is pulled at the centre. All in newtons.
#[inline(always)]
fn pull_to_center<I: Isa, L: Law<I>>(
    isa: I,
    parts: &KernelParts<'_>,
    workspace: &mut Workspace,
    law: L,
) -> [f32; 3] {
    let Some(rest) = parts.topology.center_lanes() else { return [0.0; 3] };
    let Workspace { positions, velocities, pulled, .. } = workspace;
    let chunks = positions.len();
    let (velocities, pulled) = (&velocities[..chunks], &mut pulled[..chunks]);
    let (rest, present) = (&rest[..chunks], &parts.topology.present()[..chunks]);
    let share = 1.0 / parts.topology.nodes() as f32;
    let center = mean(isa, positions, share);
    let center_velocity =
        if L::NEEDS_VELOCITY { mean(isa, velocities, share) } else { [isa.splat(0.0); 3] };
    let mut total = [isa.splat(0.0); 3];
    for chunk in 0..chunks {
        let way = minus(isa, center, load(isa, &positions[chunk]));
        let relative = if L::NEEDS_VELOCITY {
            minus(isa, center_velocity, load(isa, &velocities[chunk]))
        } else {
            way
        };
        // Nothing pulls at the padding.
        let pull = law.pull(isa, way, relative, isa.load(&rest[chunk]));
        let pull = isa.mul(isa.load(&present[chunk]), pull);
        let forces = [isa.mul(pull, way[0]), isa.mul(pull, way[1]), isa.mul(pull, way[2])];
        for axis in 0..3 {
            total[axis] = isa.add(total[axis], forces[axis]);
        }
        store(isa, forces, &mut pulled[chunk]);
    }
    [isa.sum(total[0]) * -share, isa.sum(total[1]) * -share, isa.sum(total[2]) * -share]
}

/// The mean of all nodes, in every lane; `share` is the inverse of their number.
#[inline(always)]
fn mean<I: Isa>(isa: I, chunks: &[Lanes3], share: f32) -> [I::Vector; 3] {
    let mut sum = [isa.splat(0.0); 3];
    for chunk in chunks {
        let vectors = load(isa, chunk);
        for axis in 0..3 {
            sum[axis] = isa.add(sum[axis], vectors[axis]);
        }
    }
    splat(isa, [isa.sum(sum[0]) * share, isa.sum(sum[1]) * share, isa.sum(sum[2]) * share])
}
