//! Environments ready to run.

mod bone;
mod particles;
mod random;

use crate::object::Object;
use crate::stages::Stages;

pub use bone::{bone_piece, drill_burr_hole};
pub use particles::{ParticleScene, SceneError};

/// An environment at its start.
pub struct Scene {
    /// The objects, numbered from 0.
    pub objects: Vec<Object>,
    /// The modelled interactions and the numbers all stages share.
    pub stages: Stages,
}
