//! What travels, and sets of it.

use std::fmt;

/// A work unit. Units and pairs are numbered; a pair is an interaction of the host's list.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Work {
    /// Enter the unit's next frame.
    Enter(u8),
    /// Detect and respond.
    Interact(u8),
    /// Update the unit.
    Update(u8),
    /// Render the unit.
    Render(u8),
}

/// Units that a model may have.
pub const MOST_UNITS: usize = 8;
/// Pairs that a model may have: all of eight units, and those units with themselves.
pub const MOST_PAIRS: usize = 36;

impl Work {
    pub(crate) fn is_rendering(self) -> bool {
        matches!(self, Self::Render(_))
    }

    fn bit(self) -> u64 {
        let most = MOST_UNITS as u8;
        1 << match self {
            Self::Enter(unit) => unit,
            Self::Update(unit) => most + unit,
            Self::Render(unit) => 2 * most + unit,
            Self::Interact(pair) => 3 * most + pair,
        }
    }

    fn of_bit(bit: u32) -> Self {
        let (kind, index) = (bit as usize / MOST_UNITS, (bit as usize % MOST_UNITS) as u8);
        match kind {
            0 => Self::Enter(index),
            1 => Self::Update(index),
            2 => Self::Render(index),
            _ => Self::Interact(bit as u8 - 3 * MOST_UNITS as u8),
        }
    }
}

/// A set of work units: the queues, or what a worker carries. Neither the queue nor the order in it
/// matters to the protocol.
#[derive(Clone, Copy, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Works(u64);

impl Works {
    /// Whether there is none.
    pub fn is_empty(self) -> bool {
        self.0 == 0
    }

    /// Whether `work` is among them.
    pub fn has(self, work: Work) -> bool {
        self.0 & work.bit() != 0
    }

    /// Puts `work` in; `false` if it was in already, which the protocol rules out.
    pub fn put(&mut self, work: Work) -> bool {
        let fresh = !self.has(work);
        self.0 |= work.bit();
        fresh
    }

    /// Takes `work` out; `false` if it was not in.
    pub fn take(&mut self, work: Work) -> bool {
        let found = self.has(work);
        self.0 &= !work.bit();
        found
    }

    /// All of them, in a fixed order.
    pub fn iter(self) -> impl Iterator<Item = Work> {
        indices(self.0).map(Work::of_bit)
    }
}

impl fmt::Debug for Works {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_set().entries(self.iter()).finish()
    }
}

/// The numbers of the bits that are set, lowest first.
pub(crate) fn indices(mut bits: u64) -> impl Iterator<Item = u32> {
    std::iter::from_fn(move || {
        let lowest = bits.trailing_zeros();
        let found = (bits != 0).then_some(lowest);
        bits &= bits.wrapping_sub(1);
        found
    })
}
