//! What is seen of a real run: a sequence of these, in the order in which they were recorded.

use std::fmt;

/// A work unit as the core's probe names it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Task {
    /// A unit's entry.
    Enter(u32),
    /// An interaction between two units, the lower first; `slot` is its slot.
    Interact {
        /// Its ends.
        ends: [u32; 2],
        /// Its slot.
        slot: u32,
    },
    /// A unit's update.
    Update(u32),
    /// A unit's rendering.
    Render(u32),
}

/// One thing that was seen.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Event {
    /// The worker joins.
    Join,
    /// The worker has left.
    Leave,
    /// The worker is about to give its token away.
    Release,
    /// The worker has taken a token.
    Hold,
    /// The worker turns to a work unit of this frame.
    Begin(Task, u32),
    /// The broad phase has tested two units (or one about itself), and accepted them or not.
    Test([u32; 2], bool),
    /// The callback of an interaction, an update or a rendering has run, for this task and frame.
    Call(Task, u32),
    /// A frame was swapped.
    Swap(u32),
    /// The worker is done with its work unit.
    End,
}

/// What a worker was seen to do.
#[derive(Clone, Copy, PartialEq, Eq)]
pub struct Seen {
    /// The worker.
    pub worker: u32,
    /// What it did.
    pub event: Event,
}

impl fmt::Debug for Seen {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "worker {}: {:?}", self.worker, self.event)
    }
}
