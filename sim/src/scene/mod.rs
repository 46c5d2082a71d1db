//! Environments ready to run.

mod particles;
mod random;

use crate::object::Object;
use crate::stages::Stages;

pub use particles::{ParticleScene, SceneError};

/// An environment at its start.
pub struct Scene {
    /// The objects, numbered from 0.
    pub objects: Vec<Object>,
    /// The modelled interactions and the numbers all stages share.
    pub stages: Stages,
}
