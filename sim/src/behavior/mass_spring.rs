//! Deformable mass–spring bodies (Fig. 7, §7.1.1).

use std::hash::Hasher;

use glam::Vec3;
use thiserror::Error;

use super::{Behavior, Input};
use crate::geometry::{Geometry, KernelParts, LANES, Lanes, Topology};
use crate::message::Message;

/// Why a mass–spring behaviour cannot be built.
#[derive(Clone, Copy, Debug, Error, PartialEq)]
pub enum MassSpringError {
    /// A stiffness or a damping is negative or not finite.
    #[error("{what} is {value}; it must be finite and not negative")]
    Value {
        /// The name of the value.
        what: &'static str,
        /// The value.
        value: f32,
    },
    /// There are no substeps.
    #[error("a frame needs at least one substep")]
    NoSubsteps,
}

/// A body of point masses and springs with dashpots along them.
///
/// The contact impulses of a frame are applied at once when it begins; springs and gravity then act
/// in equal substeps of symplectic Euler. That is the impulse (Verlet-I) multiple-time-step method of
/// Grubmüller et al. 1991 and Tuckerman et al. 1992, symplectic as long as nothing is damped. A step
/// is stable while ω·h < 2, for the greatest angular frequency ω of the body and the substep h.
///
/// Every force is central and comes with its opposite, so linear and angular momentum are kept up to
/// rounding. The force of a spring to the centre is taken up by all nodes in equal shares: the centre
/// is their mean, not a node.
#[derive(Clone, Debug, PartialEq)]
pub struct MassSpring {
    stiffness: f32,
    damping: f32,
    substeps: u32,
    weightless: bool,
}

impl MassSpring {
    /// Springs of `stiffness` newtons per metre, dashpots of `damping` newton seconds per metre beside
    /// them, integrated in `substeps` steps a frame.
    ///
    /// # Errors
    /// A negative or non-finite stiffness or damping, or no substeps.
    pub fn new(stiffness: f32, damping: f32, substeps: u32) -> Result<Self, MassSpringError> {
        for (what, value) in [("the stiffness", stiffness), ("the damping", damping)] {
            if !(value >= 0.0 && value.is_finite()) {
                return Err(MassSpringError::Value { what, value });
            }
        }
        if substeps == 0 {
            return Err(MassSpringError::NoSubsteps);
        }
        Ok(Self { stiffness, damping, substeps, weightless: false })
    }

    /// The number of substeps a frame.
    #[must_use]
    pub fn substeps(&self) -> u32 {
        self.substeps
    }
}

impl Behavior for MassSpring {
    fn update(&mut self, geometry: &mut Geometry, input: &mut Input<'_>) {
        let Some(mesh) = geometry.as_mesh_mut() else { return };
        for contact in input.contacts() {
            mesh.apply_impulse(contact.node, Vec3::from_array(contact.impulse));
        }
        let gravity = if self.weightless { Vec3::ZERO } else { input.gravity };
        let step = input.time_step / self.substeps as f32;
        let mut parts = mesh.kernel_parts();
        let mut forces = input.workspace.forces(parts.masses.len());
        for _ in 0..self.substeps {
            let reaction = if self.damping > 0.0 {
                spring_forces::<true>(&parts, self.stiffness, self.damping, &mut forces)
            } else {
                spring_forces::<false>(&parts, self.stiffness, 0.0, &mut forces)
            };
            integrate(&mut parts, &forces, reaction, gravity, step);
        }
    }

    fn process(&mut self, message: &Message) {
        match *message {
            Message::Stiffness(stiffness) if stiffness >= 0.0 && stiffness.is_finite() => {
                self.stiffness = stiffness;
            }
            Message::Weightless(weightless) => self.weightless = weightless,
            _ => {}
        }
    }

    fn hash_state(&self, hasher: &mut dyn Hasher) {
        hasher.write_u32(self.stiffness.to_bits());
        hasher.write_u8(u8::from(self.weightless));
    }
}

/// The least squared length of a spring, m², which keeps a spring without length from dividing by 0.
/// It is far below the rounding error of any other.
const LEAST_SQUARE: f32 = 1e-30;

/// The force of a spring with a dashpot on its first end, per metre of the way to the other end:
/// k (1 − r/l) + c (w·d)/l², for the way d of length l, the rest length r and the relative velocity w.
#[inline(always)]
fn pull<const DAMPED: bool>(
    way: [f32; 3],
    relative: [f32; 3],
    rest: f32,
    stiffness: f32,
    damping: f32,
) -> f32 {
    let square = way[0] * way[0] + way[1] * way[1] + way[2] * way[2];
    let inverse = 1.0 / (square + LEAST_SQUARE).sqrt();
    let spring = stiffness * (1.0 - rest * inverse);
    if DAMPED {
        let along = way[0] * relative[0] + way[1] * relative[1] + way[2] * relative[2];
        spring + damping * along * (inverse * inverse)
    } else {
        spring
    }
}

/// Writes the force of all springs on each node, in newtons, and returns the share of the springs to
/// the centre that every node takes up on top of that.
fn spring_forces<const DAMPED: bool>(
    parts: &KernelParts<'_>,
    stiffness: f32,
    damping: f32,
    forces: &mut [&mut [Lanes]; 3],
) -> [f32; 3] {
    let center = CenterSprings::<DAMPED>::new(parts, stiffness, damping);
    let mut total = [[0.0; LANES]; 3];
    let [fx, fy, fz] = forces;
    let places = fx.iter_mut().zip(fy.iter_mut()).zip(fz.iter_mut());
    for (chunk, ((fx, fy), fz)) in places.enumerate() {
        let mut force = edge_forces::<DAMPED>(parts, chunk, stiffness, damping);
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
    total.map(|lanes| lanes.iter().sum::<f32>() * share)
}

/// The forces of the springs between nodes on the nodes of one chunk.
#[inline(always)]
fn edge_forces<const DAMPED: bool>(
    parts: &KernelParts<'_>,
    chunk: usize,
    stiffness: f32,
    damping: f32,
) -> [Lanes; 3] {
    let positions = parts.positions.components.each_ref().map(Vec::as_slice);
    let velocities = parts.velocities.components.each_ref().map(Vec::as_slice);
    let own = positions.map(|component| component[chunk]);
    let own_velocity = velocities.map(|component| component[chunk]);
    let mut force = [[0.0; LANES]; 3];
    for slot in parts.topology.slots(chunk) {
        let other = gather(positions, &slot.neighbour);
        let other_velocity =
            if DAMPED { gather(velocities, &slot.neighbour) } else { [[0.0; LANES]; 3] };
        for lane in 0..LANES {
            let way: [f32; 3] = std::array::from_fn(|axis| other[axis][lane] - own[axis][lane]);
            let relative: [f32; 3] =
                std::array::from_fn(|axis| other_velocity[axis][lane] - own_velocity[axis][lane]);
            let pull = slot.weight[lane]
                * pull::<DAMPED>(way, relative, slot.rest[lane], stiffness, damping);
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

/// The springs from each node to the mean of all nodes.
struct CenterSprings<'a, const DAMPED: bool> {
    rest: &'a [Lanes],
    position: [f32; 3],
    velocity: [f32; 3],
    stiffness: f32,
    damping: f32,
}

impl<'a, const DAMPED: bool> CenterSprings<'a, DAMPED> {
    fn new(parts: &KernelParts<'a>, stiffness: f32, damping: f32) -> Option<Self> {
        let nodes = parts.topology.nodes();
        let mean = |components: &[Vec<Lanes>; 3]| {
            components.each_ref().map(|lanes| lane_sum(lanes) / nodes as f32)
        };
        Some(Self {
            rest: Topology::center_lanes(parts.topology)?,
            position: mean(&parts.positions.components),
            velocity: if DAMPED { mean(&parts.velocities.components) } else { [0.0; 3] },
            stiffness,
            damping,
        })
    }

    /// Their forces on the nodes of one chunk.
    #[inline(always)]
    fn forces(&self, parts: &KernelParts<'_>, chunk: usize) -> [Lanes; 3] {
        let mut force = [[0.0; LANES]; 3];
        let own = parts.positions.components.each_ref().map(|component| component[chunk]);
        let own_velocity = parts.velocities.components.each_ref().map(|component| component[chunk]);
        let nodes = parts.topology.nodes();
        for lane in 0..LANES {
            let way: [f32; 3] = std::array::from_fn(|axis| self.position[axis] - own[axis][lane]);
            let relative: [f32; 3] =
                std::array::from_fn(|axis| self.velocity[axis] - own_velocity[axis][lane]);
            let pull =
                pull::<DAMPED>(way, relative, self.rest[chunk][lane], self.stiffness, self.damping);
            let weight = if chunk * LANES + lane < nodes { 1.0 } else { 0.0 };
            for axis in 0..3 {
                force[axis][lane] = weight * pull * way[axis];
            }
        }
        force
    }
}

/// The sum of all numbers, lane by lane first. The padding is zero.
fn lane_sum(lanes: &[Lanes]) -> f32 {
    let mut sum = [0.0; LANES];
    for chunk in lanes {
        for lane in 0..LANES {
            sum[lane] += chunk[lane];
        }
    }
    sum.iter().sum()
}

/// One step of symplectic Euler: velocities from forces, then positions from the new velocities.
fn integrate(
    parts: &mut KernelParts<'_>,
    forces: &[&mut [Lanes]; 3],
    reaction: [f32; 3],
    gravity: Vec3,
    step: f32,
) {
    let gravity = gravity.to_array();
    for axis in 0..3 {
        let positions = parts.positions.components[axis].iter_mut();
        let velocities = parts.velocities.components[axis].iter_mut();
        let masses = parts.masses.iter().zip(parts.inverse_masses);
        let nodes = positions.zip(velocities).zip(forces[axis].iter()).zip(masses);
        for (((position, velocity), force), (mass, inverse_mass)) in nodes {
            for lane in 0..LANES {
                // Gravity as a force, so that it moves neither held nodes nor the padding.
                let total = force[lane] + reaction[axis] + mass[lane] * gravity[axis];
                velocity[lane] += total * inverse_mass[lane] * step;
                position[lane] += velocity[lane] * step;
            }
        }
    }
}
