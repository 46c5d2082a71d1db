//! The arithmetic of mass–spring bodies: a whole frame of one body, in lanes of nodes.
//!
//! Every set of instructions comes to the same bits, because each does these operations in this order:
//! 1. The centre is the lanes' sums over the chunks of nodes in ascending order, [`fold`]ed, over the
//!    number of nodes.
//! 2. A node's force is 0, plus the pulls of its own springs in the order of the slots of its chunk,
//!    plus the pull to the centre.
//! 3. The springs to the centre pull at all nodes alike by the sum of their forces, lane by lane over
//!    the chunks, then folded, times −1 over the number of nodes.
//! 4. A velocity changes by ((force + 3. + mass · gravity) · inverse mass) · time, then the position by
//!    velocity · time.
//!
//! Both ends of a spring compute its pull: gathering is cheaper than scattering, and needs no order.
//!
//! [`fold`]: crate::simd::fold

use super::Workspace;
use crate::geometry::{KernelParts, Lanes, lane_sum};
use crate::simd::{Isa, Kernel};

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
        let Self { mut parts, workspace, gravity, time, .. } = self;
        if self.damping > 0.0 {
            let law = Dashpot { damping: isa.splat(self.damping) };
            let shared = compute(isa, &parts, workspace, law, law);
            kick(isa, &mut parts, workspace, shared, [0.0; 3], time);
        }
        let step = time / self.substeps as f32;
        let edges = Elastic { stiffness: isa.splat(self.stiffness), one: isa.splat(1.0) };
        let to_center = Elastic { stiffness: isa.splat(self.center_stiffness), ..edges };
        for _ in 0..self.substeps {
            let shared = compute(isa, &parts, workspace, edges, to_center);
            kick(isa, &mut parts, workspace, shared, gravity, step);
            drift(isa, &mut parts, step);
        }
    }
}

/// How a spring pulls its first end, in newtons per metre of the way to its second end.
trait Law<I: Isa>: Copy {
    /// Whether the relative velocity matters; looking it up costs as much as the rest.
    const NEEDS_VELOCITY: bool;

    /// The pull over the way (m) to the second end, which moves with the relative velocity (m/s).
    fn pull(self, isa: I, way: [I::Vector; 3], relative: [I::Vector; 3], rest: I::Vector)
    -> I::Vector;
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
fn load<I: Isa>(isa: I, components: [&[Lanes]; 3], chunk: usize) -> [I::Vector; 3] {
    let [x, y, z] = components;
    [isa.load(&x[chunk]), isa.load(&y[chunk]), isa.load(&z[chunk])]
}

/// Leaves the force on each node in the workspace, and returns the one on all nodes alike: their share
/// of what the springs to the centre pull at the centre. All in newtons.
#[inline(always)]
fn compute<I: Isa, L: Law<I>>(
    isa: I,
    parts: &KernelParts<'_>,
    workspace: &mut Workspace,
    edges: L,
    to_center: L,
) -> [f32; 3] {
    let chunks = parts.present.len();
    let [px, py, pz] = parts.positions.components.each_ref();
    let positions = [&px[..chunks], &py[..chunks], &pz[..chunks]];
    let [vx, vy, vz] = parts.velocities.components.each_ref();
    let velocities = [&vx[..chunks], &vy[..chunks], &vz[..chunks]];
    let Workspace { forces, tables } = workspace;
    let [for_positions, for_velocities] = tables;
    let near = isa.table(positions, for_positions);
    let near_velocity =
        if L::NEEDS_VELOCITY { isa.table(velocities, for_velocities) } else { near };
    let nodes = parts.topology.nodes() as f32;
    let center = mean(isa, positions, nodes);
    let center_velocity =
        if L::NEEDS_VELOCITY { mean(isa, velocities, nodes) } else { [isa.splat(0.0); 3] };
    let center_rest = parts.topology.center_lanes();
    let mut total = [isa.splat(0.0); 3];
    for chunk in 0..chunks {
        let own = load(isa, positions, chunk);
        let own_velocity = if L::NEEDS_VELOCITY { load(isa, velocities, chunk) } else { own };
        let mut force = [isa.splat(0.0); 3];
        for slot in parts.topology.slots(chunk) {
            let way = minus(isa, isa.look_up(near, &slot.neighbour), own);
            let relative = if L::NEEDS_VELOCITY {
                minus(isa, isa.look_up(near_velocity, &slot.neighbour), own_velocity)
            } else {
                way
            };
            let pull = edges.pull(isa, way, relative, isa.load(&slot.rest));
            for axis in 0..3 {
                force[axis] = isa.add(force[axis], isa.mul(pull, way[axis]));
            }
        }
        if let Some(rest) = center_rest {
            let way = minus(isa, center, own);
            let relative = minus(isa, center_velocity, own_velocity);
            let pull = to_center.pull(isa, way, relative, isa.load(&rest[chunk]));
            // Nothing pulls at the padding.
            let pull = isa.mul(isa.load(&parts.present[chunk]), pull);
            for axis in 0..3 {
                let pulled = isa.mul(pull, way[axis]);
                force[axis] = isa.add(force[axis], pulled);
                total[axis] = isa.add(total[axis], pulled);
            }
        }
        for axis in 0..3 {
            isa.store(force[axis], &mut forces[axis][chunk]);
        }
    }
    let share = -1.0 / nodes;
    [isa.sum(total[0]) * share, isa.sum(total[1]) * share, isa.sum(total[2]) * share]
}

/// The mean of all nodes, in every lane.
#[inline(always)]
fn mean<I: Isa>(isa: I, components: [&[Lanes]; 3], nodes: f32) -> [I::Vector; 3] {
    let [x, y, z] = components;
    let mean = |lanes| isa.splat(lane_sum(lanes) / nodes);
    [mean(x), mean(y), mean(z)]
}

/// Changes the velocities by the forces in the workspace, what is on all nodes alike (N), and gravity
/// (m/s²) over a time (s).
#[inline(always)]
fn kick<I: Isa>(
    isa: I,
    parts: &mut KernelParts<'_>,
    workspace: &Workspace,
    shared: [f32; 3],
    gravity: [f32; 3],
    time: f32,
) {
    let chunks = parts.present.len();
    let (masses, inverse_masses) = (&parts.masses[..chunks], &parts.inverse_masses[..chunks]);
    let time = isa.splat(time);
    for axis in 0..3 {
        let velocities = &mut parts.velocities.components[axis][..chunks];
        let forces = &workspace.forces[axis][..chunks];
        let (shared, gravity) = (isa.splat(shared[axis]), isa.splat(gravity[axis]));
        for chunk in 0..chunks {
            // Gravity as a force, so that it moves neither held nodes nor the padding.
            let weight = isa.mul(isa.load(&masses[chunk]), gravity);
            let total = isa.add(isa.add(isa.load(&forces[chunk]), shared), weight);
            let change = isa.mul(isa.mul(total, isa.load(&inverse_masses[chunk])), time);
            isa.store(isa.add(isa.load(&velocities[chunk]), change), &mut velocities[chunk]);
        }
    }
}

/// Moves the nodes with their velocities for a time (s).
#[inline(always)]
fn drift<I: Isa>(isa: I, parts: &mut KernelParts<'_>, time: f32) {
    let time = isa.splat(time);
    for axis in 0..3 {
        let positions = parts.positions.components[axis].iter_mut();
        for (position, velocity) in positions.zip(&parts.velocities.components[axis]) {
            let way = isa.mul(isa.load(velocity), time);
            isa.store(isa.add(isa.load(position), way), position);
        }
    }
}
