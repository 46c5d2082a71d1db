//! Deformable mass–spring bodies (Fig. 7, §7.1.1).

use std::hash::Hasher;

use glam::Vec3;
use thiserror::Error;

use super::pull::Pull;
use super::spring_kernel::Springs;
use super::{Behavior, Input};
use crate::geometry::{Geometry, Mesh, Spring};
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
/// A frame begins with the slow forces: the contacts' and the dashpots' impulses over the whole frame.
/// Springs and gravity then act in equal substeps of symplectic Euler. That is the impulse (Verlet-I)
/// multiple-time-step method of Grubmüller et al. 1991 and Tuckerman et al. 1992; it is symplectic as
/// long as nothing is damped. It is stable while ω·h < 2, for the greatest angular frequency ω of the
/// body and the substep h, and λ·t < 2, for the greatest decay rate λ of the dashpots and the frame's
/// time t: for a node of mass m with n springs ω² is at most 2nk/m, λ at most 2nc/m.
///
/// Every force is central and comes with its opposite, so linear and angular momentum are kept up to
/// rounding. The force of a spring to the centre is taken up by all nodes in equal shares: the centre
/// is their mean, not a node.
///
/// A place moves by v·h in each substep, and no finer than its last digit: at 3 m (2.4e-7 m) and 1,000 substeps at 240
/// frames a second what is slower than 0.03 m/s stays where it is, at the usual 10 what is slower than 0.0003 m/s.
#[derive(Clone, Debug, PartialEq)]
pub struct MassSpring {
    stiffness: f32,
    center_stiffness: f32,
    damping: f32,
    substeps: u32,
    weightless: bool,
    pull: Option<Pull>,
}

impl MassSpring {
    /// Springs of `stiffness` newtons per metre, dashpots of `damping` newton seconds per metre beside
    /// them, integrated in `substeps` steps a frame.
    ///
    /// # Errors
    /// A negative or non-finite stiffness or damping, or no substeps.
    pub fn new(stiffness: f32, damping: f32, substeps: u32) -> Result<Self, MassSpringError> {
        check("the stiffness", stiffness)?;
        check("the damping", damping)?;
        if substeps == 0 {
            return Err(MassSpringError::NoSubsteps);
        }
        Ok(Self {
            stiffness,
            center_stiffness: stiffness,
            damping,
            substeps,
            weightless: false,
            pull: None,
        })
    }

    /// The same with another stiffness, in newtons per metre, for the springs to the centre, which
    /// keep the body's volume.
    ///
    /// # Errors
    /// A negative or non-finite stiffness.
    pub fn with_center_stiffness(mut self, stiffness: f32) -> Result<Self, MassSpringError> {
        check("the stiffness to the centre", stiffness)?;
        self.center_stiffness = stiffness;
        Ok(self)
    }

    /// The energy stored in the springs of a mesh, in joules: ½ k (l − r)² each.
    #[must_use]
    pub fn elastic_energy(&self, mesh: &Mesh) -> f64 {
        let stored = |stiffness: f32, length: f32, rest: f32| {
            0.5 * f64::from(stiffness) * f64::from(length - rest).powi(2)
        };
        let node = |index: u32| mesh.positions.get(index as usize).unwrap_or(Vec3::ZERO);
        let springs = mesh.topology().springs().iter();
        let between = springs.map(|&Spring { nodes: [a, b], rest }| {
            stored(self.stiffness, (node(a) - node(b)).length(), rest)
        });
        let center = mesh.center();
        let rests = mesh.topology().center_rest().unwrap_or_default();
        let to_center = mesh.positions.iter().zip(rests).map(|(position, &rest)| {
            stored(self.center_stiffness, (position - center).length(), rest)
        });
        between.sum::<f64>() + to_center.sum::<f64>()
    }

    /// Whether its springs are damped.
    pub(super) fn is_damped(&self) -> bool {
        self.damping > 0.0
    }

    /// The number of substeps a frame.
    #[must_use]
    pub fn substeps(&self) -> u32 {
        self.substeps
    }
}

fn check(what: &'static str, value: f32) -> Result<(), MassSpringError> {
    if value >= 0.0 && value.is_finite() {
        Ok(())
    } else {
        Err(MassSpringError::Value { what, value })
    }
}

impl MassSpring {
    /// Begins an update: what the frame's contacts do, and whoever pulls. What is left are the springs.
    #[must_use]
    pub fn begin(&self, mesh: &mut Mesh, input: &Input<'_>) -> Springs {
        input.apply_contacts(mesh);
        if let Some(pull) = self.pull {
            pull.apply(mesh, input.time_step);
        }
        Springs {
            damping: self.damping,
            stiffness: self.stiffness,
            center_stiffness: self.center_stiffness,
            gravity: if self.weightless { [0.0; 3] } else { input.gravity.to_array() },
            time: input.time_step,
            substeps: self.substeps,
        }
    }
}

impl Behavior for MassSpring {
    fn update(&mut self, geometry: &mut Geometry, input: &mut Input<'_>) {
        let Some(mesh) = geometry.as_mesh_mut() else { return };
        self.begin(mesh, input).advance(mesh, input);
    }

    fn process(&mut self, message: &Message) {
        match *message {
            Message::Stiffness { between_nodes, to_center } => {
                for (value, new) in
                    [(&mut self.stiffness, between_nodes), (&mut self.center_stiffness, to_center)]
                {
                    if check("the stiffness", new).is_ok() {
                        *value = new;
                    }
                }
            }
            Message::Damping(damping) if check("the damping", damping).is_ok() => {
                self.damping = damping;
            }
            Message::Pull { node, target, stiffness } => {
                self.pull = Pull::new(node, target, stiffness).or(self.pull);
            }
            Message::Release => self.pull = None,
            Message::Weightless(weightless) => self.weightless = weightless,
            _ => {}
        }
    }

    fn hash_state(&self, hasher: &mut dyn Hasher) {
        for value in [self.stiffness, self.center_stiffness, self.damping] {
            hasher.write(&value.to_le_bytes());
        }
        hasher.write_u8(u8::from(self.weightless));
        if let Some(pull) = self.pull {
            pull.hash_state(hasher);
        }
    }
}
