//! Environments ready to run.

mod bone;
#[cfg(feature = "image")]
pub mod head;
mod particles;
mod random;

use crate::mailbox::Mailbox;
use crate::message::Letter;
use crate::object::Object;
use crate::stages::Stages;

pub use bone::{bone_piece, drill_burr_hole};
pub use particles::{ParticleScene, SceneError};

/// An environment between two frames: at its start, or taken out of an executor.
pub struct Scene {
    /// The objects, numbered from 0.
    pub objects: Vec<Object>,
    /// The modelled interactions and the numbers all stages share.
    pub stages: Stages,
    /// The number of the next frame; 0 at the start.
    pub frame: u64,
    /// Messages that were posted and not yet processed, in the order in which objects are to process
    /// those of one sender and frame. None at the start. Those of objects are due in the next frame,
    /// those from outside in the next or the one after; others are lost.
    pub mail: Vec<Letter>,
    /// Where messages from outside are posted.
    pub mailbox: Mailbox,
}

impl Scene {
    /// An environment at its start.
    #[must_use]
    pub fn new(objects: Vec<Object>, stages: Stages) -> Self {
        Self { objects, stages, frame: 0, mail: Vec::new(), mailbox: Mailbox::new() }
    }
}
