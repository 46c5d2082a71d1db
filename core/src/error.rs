//! Typed errors: each names the thing and the limit.

use ::core::fmt;

use crate::unit::UnitId;

/// A table that the host gave memory for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Table {
    /// Units.
    Units,
    /// Interactions that can be found in one frame.
    Interactions,
    /// Result records of one frame's interactions.
    Contacts,
    /// Letters under way to inboxes.
    Letters,
    /// Slots of the queues, see [`crate::storage::queue_slots`].
    Queues,
    /// Render tokens.
    Tokens,
    /// Readers of a latest-value cell.
    Readers,
}

impl fmt::Display for Table {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Units => "units",
            Self::Interactions => "interactions found in a frame",
            Self::Contacts => "contacts of a frame",
            Self::Letters => "letters under way",
            Self::Queues => "queue slots",
            Self::Tokens => "render tokens",
            Self::Readers => "readers of a latest-value cell",
        })
    }
}

/// A table is full. Whatever was to go into it did not, and nothing else was harmed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TableFull {
    /// Which table.
    pub table: Table,
    /// What it holds.
    pub capacity: usize,
    /// Of interactions and contacts: what it would have had to hold for all that was asked of it so far in this
    /// frame. The last such error of a frame names the capacity needed; memory takes twice that, for two frames. Of letters, tokens and readers,
    /// which are given back at any time: one more than there are. Of units: one more than the greatest number asked
    /// for; and at setup, as of queues, what was handed over or what is needed for the rest.
    pub needed: usize,
}

impl fmt::Display for TableFull {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "table of {} is full: {} fit, {} needed", self.table, self.capacity, self.needed)
    }
}

impl ::core::error::Error for TableFull {}

/// Memory or wiring that a pipeline cannot be built on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SetupError {
    /// A table is too small, or larger than the core can count.
    Table(TableFull),
    /// There is no unit at all.
    NoUnits,
    /// A modelled interaction names a unit that does not exist, or one unit twice.
    BadEnds {
        /// Index of the interaction.
        interaction: usize,
        /// Its two ends.
        ends: [UnitId; 2],
    },
    /// `contacts` and `segments` must have one length.
    UnequalContacts {
        /// Slots for contacts.
        contacts: usize,
        /// Slots for their segments.
        segments: usize,
    },
}

impl fmt::Display for SetupError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Table(full) => full.fmt(f),
            Self::NoUnits => f.write_str("a pipeline needs at least one unit"),
            Self::BadEnds { interaction, ends: [a, b] } => {
                write!(f, "interaction {interaction} cannot join {a} and {b}")
            }
            Self::UnequalContacts { contacts, segments } => {
                write!(f, "{contacts} contact slots need as many segment slots, not {segments}")
            }
        }
    }
}

impl ::core::error::Error for SetupError {}

impl From<TableFull> for SetupError {
    fn from(full: TableFull) -> Self {
        Self::Table(full)
    }
}

/// The renderer was not left to all workers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct NotShared {
    /// The render tokens that there are; all of them must be free, and there must be one.
    pub tokens: u32,
}

impl fmt::Display for NotShared {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.tokens {
            0 => f.write_str("a pipeline without a render token shares no renderer"),
            1 => f.write_str("the render token is out, or the renderer is shared already"),
            tokens => {
                write!(
                    f,
                    "of {tokens} render tokens some are out, or the renderer is shared already"
                )
            }
        }
    }
}

impl ::core::error::Error for NotShared {}

/// Frames that were let run have not all been swapped.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct StillRunning;

impl fmt::Display for StillRunning {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("the pipeline is still running: step its workers until it has finished")
    }
}

impl ::core::error::Error for StillRunning {}
