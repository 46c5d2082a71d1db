//! Room in a table that many workers take from: each claim a range of its own, by one addition.
//!
//! Of compare-and-swaps in a loop all but one would be in vain each time, where many workers claim at once. An addition
//! is made before it is known whether there is room. What was added too much is not subtracted again: others may have
//! added to it meanwhile, and would be given what is theirs a second time. The counter is set to the capacity instead.

use ::core::ops::Range;

use crate::error::{Table, TableFull};
use crate::sync::{AtomicWord, const_fn, seeded, site};

/// How many slots of a table are taken.
#[derive(Debug)]
pub struct Room(AtomicWord);

impl Room {
    const_fn! {
        /// Nothing is taken.
        pub const fn new() -> Self {
            Self(AtomicWord::new(0))
        }
    }

    /// The most slots there may be: 65,535 where a word has 32 bits, so that as many claims would have to be refused
    /// at once for their sum to wrap.
    pub const MOST: u32 = if usize::BITS > u32::BITS { u32::MAX } else { u16::MAX as u32 };

    /// Nothing is taken any more. Nobody claims meanwhile.
    pub fn reset(&self) {
        self.0.store(0, site::POOL_RESET);
    }

    /// Slots taken so far. While claims are refused it may be more than there are.
    pub fn used(&self) -> u32 {
        saturated(self.0.load(site::POOL_CLAIM))
    }

    /// Claims `count` slots of `capacity`, which is the same in every call and at most [`Self::MOST`]; or what is left, if
    /// that is less, and then nothing is left.
    #[inline]
    pub fn claim(&self, count: u32, capacity: u32) -> Range<u32> {
        // One too many is refused like more: so the sum does not wrap.
        let step = count.min(capacity.saturating_add(1)) as usize;
        let start = self.0.fetch_add(step, site::POOL_CLAIM).min(capacity as usize) as u32;
        let left = capacity - start;
        if count > left {
            if seeded!(RefusedClaimTakenBack) {
                self.0.fetch_sub(step, site::POOL_CLAIM);
                return start..start;
            }
            // Nobody has made it less than that since the addition.
            self.0.store(capacity as usize, site::POOL_CLAIM);
        }
        start..start + count.min(left)
    }
}

impl Default for Room {
    fn default() -> Self {
        Self::new()
    }
}

fn saturated(count: usize) -> u32 {
    u32::try_from(count).unwrap_or(u32::MAX)
}

/// A frame's table: how much is taken, and how much more was asked for.
#[derive(Debug)]
pub(crate) struct FrameRoom {
    room: Room,
    /// Slots that were asked for in vain. It only serves to name the capacity needed.
    refused: AtomicWord,
}

impl FrameRoom {
    pub(crate) fn new() -> Self {
        Self { room: Room::new(), refused: AtomicWord::new(0) }
    }

    pub(crate) fn reset(&self) {
        self.room.reset();
        self.refused.store(0, site::POOL_RESET);
    }

    /// Slots asked for so far, also in vain.
    pub(crate) fn asked(&self) -> u32 {
        self.room.used().saturating_add(saturated(self.refused.load(site::POOL_CLAIM)))
    }

    /// Claims `count` slots, or as many as are left, and says what is missing; nothing is left then.
    #[inline]
    pub(crate) fn claim(
        &self,
        count: u32,
        capacity: u32,
        table: Table,
    ) -> (Range<u32>, Result<(), TableFull>) {
        let claimed = self.room.claim(count, capacity);
        let missing = count - claimed.len() as u32;
        if missing == 0 {
            return (claimed, Ok(()));
        }
        let [missing, capacity] = [missing as usize, capacity as usize];
        let refused = self.refused.fetch_add(missing, site::POOL_CLAIM);
        let needed = capacity.saturating_add(refused).saturating_add(missing);
        (claimed, Err(TableFull { table, capacity, needed }))
    }
}

#[cfg(all(test, not(loom)))]
mod tests {
    use super::*;

    #[test]
    fn what_does_not_fit_takes_what_is_left() {
        let room = Room::new();
        assert_eq!((room.claim(2, 5), room.claim(2, 5)), (0..2, 2..4));
        assert_eq!(room.claim(u32::MAX, 5), 4..5);
        assert_eq!((room.claim(1, 5), room.used()), (5..5, 5));
        room.reset();
        assert_eq!((room.claim(5, 5), room.claim(0, 5), room.used()), (0..5, 5..5, 5));
    }

    #[test]
    fn refusals_without_number_do_not_wrap() {
        for capacity in [0, 1, Room::MOST] {
            let room = Room::new();
            assert_eq!(room.claim(capacity, capacity), 0..capacity);
            for _ in 0..5 {
                assert_eq!(room.claim(u32::MAX, capacity), capacity..capacity);
            }
            assert_eq!(room.used(), capacity);
        }
    }
}
