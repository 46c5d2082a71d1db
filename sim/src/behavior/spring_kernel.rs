//! The arithmetic of mass–spring bodies: forces gathered node by node, in lanes.

use crate::geometry::{KernelParts, LANES, Lanes, lane_sum};

/// The least squared length of a spring, m², which keeps a spring without length from dividing by 0.
/// It is far below the rounding error of any other.
const LEAST_SQUARE: f32 = 1e-30;

/// How a spring pulls its first end, in newtons per metre of the way to its second end.
pub(super) trait Law: Copy {
    /// Whether the relative velocity matters; gathering it costs as much as the rest.
    const NEEDS_VELOCITY: bool;

    /// The pull over the way (m) to the second end, which moves with the relative velocity (m/s).
    fn pull(self, way: [f32; 3], relative: [f32; 3], rest: f32) -> f32;
}

/// Hooke's law: k (1 − r/l).
#[derive(Clone, Copy)]
pub(super) struct Elastic {
    /// k, in newtons per metre.
    pub(super) stiffness: f32,
}

impl Law for Elastic {
    const NEEDS_VELOCITY: bool = false;

    #[inline(always)]
    fn pull(self, way: [f32; 3], _relative: [f32; 3], rest: f32) -> f32 {
        self.stiffness * (1.0 - rest / (dot(way, way) + LEAST_SQUARE).sqrt())
    }
}

/// A dashpot along the spring: c (w·d)/l².
#[derive(Clone, Copy)]
pub(super) struct Dashpot {
    /// c, in newton seconds per metre.
    pub(super) damping: f32,
}

impl Law for Dashpot {
    const NEEDS_VELOCITY: bool = true;

    #[inline(always)]
    fn pull(self, way: [f32; 3], relative: [f32; 3], _rest: f32) -> f32 {
        self.damping * dot(way, relative) / (dot(way, way) + LEAST_SQUARE)
    }
}

#[inline(always)]
fn dot(a: [f32; 3], b: [f32; 3]) -> f32 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// Forces of all springs, in newtons.
pub(super) struct Forces<'a> {
    /// On each node.
    nodes: [&'a mut [Lanes]; 3],
    /// On every node alike: its share of what the springs to the centre pull at the centre.
    shared: [f32; 3],
}

impl<'a> Forces<'a> {
    /// Forces on as many chunks of nodes as there is room for.
    pub(super) fn new(nodes: [&'a mut [Lanes]; 3]) -> Self {
        Self { nodes, shared: [0.0; 3] }
    }

    /// Computes the forces of springs with one law between nodes and another to the centre.
    pub(super) fn compute<L: Law>(&mut self, parts: &KernelParts<'_>, edges: L, to_center: L) {
        let center = Center::new(parts, to_center);
        let mut total = [[0.0; LANES]; 3];
        let [fx, fy, fz] = self.nodes.each_mut();
        let places = fx.iter_mut().zip(fy.iter_mut()).zip(fz.iter_mut());
        for (chunk, ((fx, fy), fz)) in places.enumerate() {
            let mut force = edge_forces(parts, chunk, edges);
            if let Some(center) = &center {
                let pulls = center.forces(parts, chunk);
                for axis in 0..3 {
                    for lane in 0..LANES {
                        force[axis][lane] += pulls[axis][lane];
                        total[axis][lane] += pulls[axis][lane];
                    }
                }
            }
            [*fx, *fy, *fz] = force;
        }
        let share = -1.0 / parts.topology.nodes() as f32;
        self.shared = total.map(|lanes| lanes.iter().sum::<f32>() * share);
    }

    /// Changes the velocities by the forces and gravity (m/s²) over a time (s).
    pub(super) fn kick(&self, parts: &mut KernelParts<'_>, gravity: [f32; 3], time: f32) {
        let shared_and_gravity = self.shared.into_iter().zip(gravity);
        let components = parts.velocities.components.iter_mut().zip(&self.nodes);
        for ((velocities, forces), (shared, gravity)) in components.zip(shared_and_gravity) {
            let len = velocities.len();
            let (forces, masses) = (&forces[..len], &parts.masses[..len]);
            let inverse_masses = &parts.inverse_masses[..len];
            for chunk in 0..len {
                for lane in 0..LANES {
                    // Gravity as a force, so that it moves neither held nodes nor the padding.
                    let total = forces[chunk][lane] + shared + masses[chunk][lane] * gravity;
                    velocities[chunk][lane] += total * inverse_masses[chunk][lane] * time;
                }
            }
        }
    }
}

/// Moves the nodes with their velocities for a time (s).
pub(super) fn drift(parts: &mut KernelParts<'_>, time: f32) {
    for axis in 0..3 {
        let positions = parts.positions.components[axis].iter_mut();
        for (position, velocity) in positions.zip(&parts.velocities.components[axis]) {
            for lane in 0..LANES {
                position[lane] += velocity[lane] * time;
            }
        }
    }
}

/// The forces of the springs between nodes on the nodes of one chunk.
#[inline(always)]
fn edge_forces<L: Law>(parts: &KernelParts<'_>, chunk: usize, law: L) -> [Lanes; 3] {
    let positions = parts.positions.components.each_ref().map(Vec::as_slice);
    let velocities = parts.velocities.components.each_ref().map(Vec::as_slice);
    let own = positions.map(|component| component[chunk]);
    let own_velocity = velocities.map(|component| component[chunk]);
    let mut force = [[0.0; LANES]; 3];
    for slot in parts.topology.slots(chunk) {
        let other = gather(positions, &slot.neighbour);
        let other_velocity =
            if L::NEEDS_VELOCITY { gather(velocities, &slot.neighbour) } else { own_velocity };
        for lane in 0..LANES {
            let way: [f32; 3] = std::array::from_fn(|axis| other[axis][lane] - own[axis][lane]);
            let relative: [f32; 3] =
                std::array::from_fn(|axis| other_velocity[axis][lane] - own_velocity[axis][lane]);
            let pull = slot.weight[lane] * law.pull(way, relative, slot.rest[lane]);
            for axis in 0..3 {
                force[axis][lane] += pull * way[axis];
            }
        }
    }
    force
}

/// The vectors of the named nodes.
#[inline(always)]
fn gather(components: [&[Lanes]; 3], nodes: &[u32; LANES]) -> [Lanes; 3] {
    // One length for all three, so that one comparison a node is enough.
    let len = components[0].len();
    let [x, y, z] = components.map(|component| component[..len].as_flattened());
    let mut gathered = [[0.0; LANES]; 3];
    for (lane, &node) in nodes.iter().enumerate() {
        let node = node as usize;
        gathered[0][lane] = x[node];
        gathered[1][lane] = y[node];
        gathered[2][lane] = z[node];
    }
    gathered
}

/// The mean of all nodes, and the springs that lead there.
struct Center<'a, L> {
    rest: &'a [Lanes],
    position: [f32; 3],
    velocity: [f32; 3],
    law: L,
}

impl<'a, L: Law> Center<'a, L> {
    fn new(parts: &KernelParts<'a>, law: L) -> Option<Self> {
        let nodes = parts.topology.nodes() as f32;
        let mean = |components: &[Vec<Lanes>; 3]| {
            components.each_ref().map(|component| lane_sum(component) / nodes)
        };
        Some(Self {
            rest: parts.topology.center_lanes()?,
            position: mean(&parts.positions.components),
            velocity: if L::NEEDS_VELOCITY { mean(&parts.velocities.components) } else { [0.0; 3] },
            law,
        })
    }

    /// Their forces on the nodes of one chunk.
    #[inline(always)]
    fn forces(&self, parts: &KernelParts<'_>, chunk: usize) -> [Lanes; 3] {
        let own = parts.positions.components.each_ref().map(|component| component[chunk]);
        let own_velocity = parts.velocities.components.each_ref().map(|component| component[chunk]);
        let nodes = parts.topology.nodes();
        let mut force = [[0.0; LANES]; 3];
        for lane in 0..LANES {
            let way: [f32; 3] = std::array::from_fn(|axis| self.position[axis] - own[axis][lane]);
            let relative: [f32; 3] =
                std::array::from_fn(|axis| self.velocity[axis] - own_velocity[axis][lane]);
            // Nothing pulls at the padding.
            let weight = if chunk * LANES + lane < nodes { 1.0 } else { 0.0 };
            let pull = weight * self.law.pull(way, relative, self.rest[chunk][lane]);
            for axis in 0..3 {
                force[axis][lane] = pull * way[axis];
            }
        }
        force
    }
}
