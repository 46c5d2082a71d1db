//! What the arithmetic alone allows: an edge list over sixteen bodies at once, a lane each.

use dualframe_sim::geometry::Topology;
use dualframe_sim::simd::Instructions;
use glam::Vec3;

/// A node's inverse mass, in 1/kg.
const INVERSE_MASS: f32 = 100.0;
/// Bodies, one in each lane.
const LANES: usize = 16;
/// One number of every body.
type Lanes = [f32; LANES];
/// One vector of every body.
#[derive(Clone, Copy)]
#[repr(align(64))]
struct Node([Lanes; 3]);

impl Node {
    const ZERO: Self = Self([[0.0; LANES]; 3]);
}

pub(crate) struct Ceiling {
    springs: Vec<([usize; 2], f32)>,
    center_rest: Vec<f32>,
    positions: Vec<Node>,
    velocities: Vec<Node>,
    forces: Vec<Node>,
    stiffness: f32,
    step: f32,
    substeps: u32,
}

impl Ceiling {
    pub(crate) fn new(
        topology: &Topology,
        positions: &[Vec3],
        stiffness: f32,
        step: f32,
        substeps: u32,
    ) -> Self {
        let springs = topology.springs().iter();
        let springs = springs.map(|spring| (spring.nodes.map(|node| node as usize), spring.rest));
        let node = |position: &Vec3| Node(position.to_array().map(|part| [part; LANES]));
        let none = vec![Node::ZERO; positions.len()];
        Self {
            springs: springs.collect(),
            center_rest: topology.center_rest().expect("springs to the centre").to_vec(),
            positions: positions.iter().map(node).collect(),
            velocities: none.clone(),
            forces: none,
            stiffness,
            step,
            substeps,
        }
    }

    /// Where the nodes of the first body are.
    pub(crate) fn positions(&self) -> impl Iterator<Item = Vec3> {
        self.positions.iter().map(|Node([x, y, z])| Vec3::new(x[0], y[0], z[0]))
    }

    /// Integrates all substeps, compiled for these instructions.
    pub(crate) fn advance(&mut self, instructions: Instructions) {
        match instructions {
            // SAFETY: the caller has the instructions' name from what the machine has.
            #[cfg(target_arch = "x86_64")]
            Instructions::Avx2 => unsafe { with_avx2(self) },
            // SAFETY: likewise.
            #[cfg(target_arch = "x86_64")]
            Instructions::Avx512 => unsafe { with_avx512(self) },
            _ => integrate(self),
        }
    }
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn with_avx2(ceiling: &mut Ceiling) {
    integrate(ceiling);
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx512f")]
fn with_avx512(ceiling: &mut Ceiling) {
    integrate(ceiling);
}

#[inline(always)]
fn integrate(bodies: &mut Ceiling) {
    let Ceiling { springs, center_rest, positions, velocities, forces, .. } = bodies;
    for _ in 0..bodies.substeps {
        forces.fill(Node::ZERO);
        for &([a, b], rest) in springs.iter() {
            let force = pull(&positions[a], &positions[b], rest, bodies.stiffness);
            add(&mut forces[a], &force, 1.0);
            add(&mut forces[b], &force, -1.0);
        }
        let share = 1.0 / positions.len() as f32;
        let mut center = Node::ZERO;
        for position in positions.iter() {
            add(&mut center, position, share);
        }
        let mut total = Node::ZERO;
        for ((position, force), &rest) in
            positions.iter().zip(forces.iter_mut()).zip(center_rest.iter())
        {
            let pulled = pull(position, &center, rest, bodies.stiffness);
            add(force, &pulled, 1.0);
            add(&mut total, &pulled, -share);
        }
        let nodes = positions.iter_mut().zip(velocities.iter_mut()).zip(forces.iter_mut());
        for ((position, velocity), force) in nodes {
            add(force, &total, 1.0);
            add(velocity, force, INVERSE_MASS * bodies.step);
            add(position, velocity, bodies.step);
        }
    }
}

/// Adds a vector times a number.
#[inline(always)]
fn add(to: &mut Node, vector: &Node, factor: f32) {
    for axis in 0..3 {
        for lane in 0..LANES {
            to.0[axis][lane] += vector.0[axis][lane] * factor;
        }
    }
}

/// The force of a spring on its first end.
#[inline(always)]
fn pull(Node(a): &Node, Node(b): &Node, rest: f32, stiffness: f32) -> Node {
    let mut force = Node::ZERO;
    for lane in 0..LANES {
        let way = [b[0][lane] - a[0][lane], b[1][lane] - a[1][lane], b[2][lane] - a[2][lane]];
        let square = way[0] * way[0] + way[1] * way[1] + way[2] * way[2] + 1e-30;
        let pull = stiffness * (1.0 - rest / square.sqrt());
        for (force, way) in force.0.iter_mut().zip(way) {
            force[lane] = pull * way;
        }
    }
    force
}
