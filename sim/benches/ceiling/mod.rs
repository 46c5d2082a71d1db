//! What the arithmetic alone allows: an edge list over sixteen bodies at once, a lane each.

use dualframe_sim::geometry::Topology;
use dualframe_sim::simd::Instructions;
use glam::Vec3;

/// Bodies, one in each lane.
const LANES: usize = 16;
/// One number of every body.
type Lanes = [f32; LANES];
/// One vector of every body.
type Node = [Lanes; 3];

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
        let node = |position: &Vec3| position.to_array().map(|component| [component; LANES]);
        let none = vec![[[0.0; LANES]; 3]; positions.len()];
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
    for _ in 0..bodies.substeps {
        bodies.forces.fill([[0.0; LANES]; 3]);
        for &([a, b], rest) in &bodies.springs {
            let force = pull(&bodies.positions[a], &bodies.positions[b], rest, bodies.stiffness);
            for axis in 0..3 {
                for lane in 0..LANES {
                    bodies.forces[a][axis][lane] += force[axis][lane];
                    bodies.forces[b][axis][lane] -= force[axis][lane];
                }
            }
        }
        let center = mean(&bodies.positions);
        let mut total = [[0.0; LANES]; 3];
        for (node, &rest) in bodies.center_rest.iter().enumerate() {
            let force = pull(&bodies.positions[node], &center, rest, bodies.stiffness);
            for axis in 0..3 {
                for lane in 0..LANES {
                    bodies.forces[node][axis][lane] += force[axis][lane];
                    total[axis][lane] += force[axis][lane];
                }
            }
        }
        let share = -1.0 / bodies.positions.len() as f32;
        let nodes = bodies.positions.iter_mut().zip(&mut bodies.velocities).zip(&bodies.forces);
        for ((position, velocity), force) in nodes {
            for axis in 0..3 {
                for lane in 0..LANES {
                    let force = force[axis][lane] + total[axis][lane] * share;
                    velocity[axis][lane] += force * 100.0 * bodies.step;
                    position[axis][lane] += velocity[axis][lane] * bodies.step;
                }
            }
        }
    }
}

/// The force of a spring on its first end.
#[inline(always)]
fn pull(a: &Node, b: &Node, rest: f32, stiffness: f32) -> Node {
    let mut force = [[0.0; LANES]; 3];
    for lane in 0..LANES {
        let way = [b[0][lane] - a[0][lane], b[1][lane] - a[1][lane], b[2][lane] - a[2][lane]];
        let square = way[0] * way[0] + way[1] * way[1] + way[2] * way[2] + 1e-30;
        let pull = stiffness * (1.0 - rest / square.sqrt());
        for axis in 0..3 {
            force[axis][lane] = pull * way[axis];
        }
    }
    force
}

#[inline(always)]
fn mean(nodes: &[Node]) -> Node {
    let mut sum = [[0.0; LANES]; 3];
    for node in nodes {
        for axis in 0..3 {
            for lane in 0..LANES {
                sum[axis][lane] += node[axis][lane];
            }
        }
    }
    sum.map(|lanes| lanes.map(|value| value / nodes.len() as f32))
}
