//! What travels: units and interactions, by index.

use ::core::fmt;

/// End of a list, no index.
pub(crate) const NONE: u32 = u32::MAX;

/// Number of a unit: one object, or a block of objects that the host schedules together.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct UnitId(pub u32);

/// Number of an interaction's slot.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct InteractionId(pub u32);

impl UnitId {
    /// The unit's index in the host's slice of units.
    #[inline]
    pub fn index(self) -> usize {
        self.0 as usize
    }
}

impl InteractionId {
    /// The interaction's index in the host's slice of interactions.
    #[inline]
    pub fn index(self) -> usize {
        self.0 as usize
    }
}

impl fmt::Display for UnitId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "unit {}", self.0)
    }
}

/// A work unit: what one step of a worker does.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Work {
    /// Enter the unit's next frame: arrive, and test bounding volumes (broad phase).
    Enter(UnitId),
    /// Detect and respond to one interaction.
    Interact(InteractionId),
    /// Update the unit.
    Update(UnitId),
    /// Render the unit.
    Render(UnitId),
}
