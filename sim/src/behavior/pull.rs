//! A pull from outside: a person who holds a body at one node.

use std::hash::Hasher;

use glam::Vec3;

use crate::geometry::Mesh;

/// The most that a pull may take a resting node of the way to its target in one frame; usually 1/2.
const MOST_OF_THE_WAY: f32 = 0.5;

/// A damped spring from a node to a fixed point in space, as impulses at the beginning of each frame.
///
/// The spring acts at the node: t·k·d, for the way d to the target and the frame's time t. Its k is at
/// most m/(2t²), for the node's mass m: more would throw the node beyond half its way in one frame.
///
/// The damping acts on all nodes alike, or the body would swing from its node for long: it is critical
/// for the mass M of the whole body on the spring, with the angular frequency ω = √(k/M), in one
/// implicit step: velocities are divided by 1 + 2ωt.
///
/// With one substep a frame that is Störmer's scheme for a body with the stiffness matrix B/t² over its
/// masses, the pull's κ·e·eᵀ/t² and the damping γ/t, which is stable where 4 − 2γ − κ·e·eᵀ − B is
/// positive definite. Here κ ≤ 1/2 and γ = 2ωt/(1 + 2ωt) ≤ 0.59, as ωt ≤ √κ; so every k is stable
/// if the body's own greatest angular frequency times t is below 1.5. With more substeps the tests say
/// so: a particle's energy stays below 1.5 times what the pull began with.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Pull {
    node: u32,
    /// In metres.
    target: Vec3,
    /// In newtons per metre.
    stiffness: f32,
}

impl Pull {
    /// A pull of so many newtons per metre, if the stiffness is finite and not negative, and the target
    /// finite.
    pub(super) fn new(node: u32, target: [f32; 3], stiffness: f32) -> Option<Self> {
        let target = Vec3::from_array(target);
        let valid = stiffness >= 0.0 && stiffness.is_finite() && target.is_finite();
        valid.then_some(Self { node, target, stiffness })
    }

    /// What it does to a body in a frame of `time` seconds. A node that does not exist, or that is held
    /// fast, is not pulled.
    pub(super) fn apply(&self, mesh: &mut Mesh, time: f32) {
        let node = self.node as usize;
        let mass = mesh.masses().get(node).copied().unwrap_or(0.0);
        let Some(position) = mesh.positions.get(node).filter(|_| mass > 0.0) else { return };
        let stiffness = self.stiffness.min(MOST_OF_THE_WAY * mass / (time * time));
        let whole: f32 = mesh.masses().iter().sum();
        mesh.damp(1.0 / (1.0 + 2.0 * time * (stiffness / whole).sqrt()));
        mesh.apply_impulse(self.node, (self.target - position) * (stiffness * time));
    }

    pub(super) fn hash_state(&self, hasher: &mut dyn Hasher) {
        hasher.write(&self.node.to_le_bytes());
        for value in self.target.to_array().into_iter().chain([self.stiffness]) {
            hasher.write(&value.to_le_bytes());
        }
    }
}
