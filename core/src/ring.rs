//! A lock-free queue of indices, many producers and many consumers.
//!
//! A cell is one word, (cycle, index). Push CASes the cell from the last lap's cycle to this
//! lap's, then anyone may help the tail on; pop loads the cell, then CASes the head. No state is
//! half written, so a thread that is suspended anywhere inside stops nobody (invariant 7). The
//! idea is iceoryx's `MpmcIndexQueue`; tickets that are filled later would block whoever waits.
//!
//! Every index is in at most one place at a time, so a ring with a slot for every index is never
//! full, and push cannot fail.

use crate::error::{Table, TableFull};
use crate::storage::at;
use crate::sync::{AtomicWord, CachePadded, const_fn, seeded, site, spin_hint};

/// Memory of one slot of a queue, of the list of arrivals, or of an offer.
#[derive(Debug)]
pub struct QueueSlot(pub(crate) AtomicWord);

impl QueueSlot {
    const_fn! {
        /// An unused slot.
        pub const fn new() -> Self {
            Self(AtomicWord::new(0))
        }
    }

    /// Puts `index` in.
    pub fn set(&mut self, index: u32) {
        self.0.store(index as usize, site::EXCLUSIVE);
    }
}

impl Default for QueueSlot {
    fn default() -> Self {
        Self::new()
    }
}

/// Slots that a ring needs for `indices` different indices: the next power of two.
pub const fn slots_for(indices: usize) -> usize {
    if indices == 0 { 1 } else { indices.next_power_of_two() }
}

/// The queue. It borrows its slots, so the algorithm stands apart from the storage.
///
/// Positions wrap after as many pushes as a word counts: 2^64, or 2^32 on a 32-bit target. To mistake one for
/// another, a thread would have to sleep, within one operation, through a multiple of that many.
#[derive(Debug)]
pub struct IndexRing<'m> {
    cells: &'m [QueueSlot],
    /// In one cache line: most looks find a ring empty, and learn it from both ends. Who pushes or pops has to have the
    /// line of a cell anyway.
    ends: CachePadded<Ends>,
    slot_bits: u32,
}

/// Positions count up for ever; their low bits are the slot, their high bits the cycle.
#[derive(Debug)]
struct Ends {
    /// Next position to pop.
    head: AtomicWord,
    /// Next position to push; may lag by one push that has not been helped on yet, even behind the head.
    tail: AtomicWord,
}

impl<'m> IndexRing<'m> {
    /// An empty ring over the largest power of two of `slots`, at most 2^32: so many indices there are.
    ///
    /// # Errors
    /// [`TableFull`] if `slots` is empty.
    pub fn new(slots: &'m mut [QueueSlot]) -> Result<Self, TableFull> {
        Self::holding(0, slots)
    }

    /// A ring over the largest power of two of `slots`, at most 2^32, which holds the indices below
    /// `count`, the least first.
    ///
    /// # Errors
    /// [`TableFull`] if the ring has fewer slots than that, or none.
    pub fn holding(count: usize, slots: &'m mut [QueueSlot]) -> Result<Self, TableFull> {
        let slot_bits = slots.len().checked_ilog2().unwrap_or(0).min(u32::BITS);
        let capacity = if slots.is_empty() { 0 } else { 1 << slot_bits };
        let needed = count.max(1);
        let full = TableFull { table: Table::Queues, capacity, needed };
        let cells = slots.get(..capacity).filter(|_| needed <= capacity).ok_or(full)?;
        // Laps are counted from 1: a cell of lap 0 is free for lap 1.
        let first = 1 << slot_bits;
        for (index, cell) in cells.iter().enumerate() {
            cell.0.store(if index < count { first | index } else { 0 }, site::EXCLUSIVE);
        }
        Ok(Self {
            cells,
            ends: CachePadded::new(Ends {
                head: AtomicWord::new(first),
                tail: AtomicWord::new(first + count),
            }),
            slot_bits,
        })
    }

    fn slot(&self, position: usize) -> &AtomicWord {
        // SAFETY: `new` made the number of cells a power of two, at least one.
        unsafe { &at(self.cells, position & (self.cells.len() - 1)).0 }
    }

    /// The cycle of a position, or of a cell's word: both keep it above `slot_bits`.
    fn cycle(&self, word: usize) -> usize {
        word >> self.slot_bits
    }

    /// How many laps `word` is ahead of `position`, modulo the width of a cycle.
    fn laps_ahead(&self, word: usize, position: usize) -> usize {
        self.cycle(word).wrapping_sub(self.cycle(position)) & (usize::MAX >> self.slot_bits)
    }

    /// Appends `index`, which must not be in the ring: there would be more than the ring holds, others would be
    /// lost, and `pop` might never return.
    ///
    /// # Errors
    /// [`TableFull`] if `index` is not below the number of slots: caught before it can be mistaken
    /// for another index. Nothing is pushed then.
    #[inline]
    pub fn push(&self, index: u32) -> Result<(), TableFull> {
        let index = index as usize;
        let capacity = self.cells.len();
        if index >= capacity {
            let needed = index.saturating_add(1);
            return Err(TableFull { table: Table::Queues, capacity, needed });
        }
        if seeded!(TicketPush) {
            let place = self.ends.tail.fetch_add(1, site::RING_TAIL_HELP);
            let word = (self.cycle(place) << self.slot_bits) | index;
            self.slot(place).store(word, site::RING_CELL_PUBLISH);
            return Ok(());
        }
        loop {
            let tail = self.ends.tail.load(site::RING_TAIL_LOAD);
            let cell = self.slot(tail);
            let seen = cell.load(site::RING_CELL_LOOK);
            match self.laps_ahead(tail, seen) {
                // Last lap's cell: free. Publishing is this one CAS.
                1 => {
                    let word = (self.cycle(tail) << self.slot_bits) | index;
                    if cell.exchange(seen, word, site::RING_CELL_PUBLISH).is_ok() {
                        self.help_tail(tail);
                        return Ok(());
                    }
                }
                // This lap's already: its pusher has not moved the tail yet.
                0 => self.help_tail(tail),
                // The tail that was loaded is old.
                _ => {}
            }
            spin_hint();
        }
    }

    fn help_tail(&self, tail: usize) {
        // Failure means that somebody else helped; either way the tail has moved on.
        let _ = self.ends.tail.exchange(tail, tail.wrapping_add(1), site::RING_TAIL_HELP);
    }

    /// Takes the oldest index; `None` when every push that happened before the call is popped. One
    /// that is under way meanwhile may be missed.
    #[inline]
    pub fn pop(&self) -> Option<u32> {
        loop {
            let head = self.ends.head.load(site::RING_HEAD_LOAD);
            let word = self.slot(head).load(site::RING_CELL_TAKE);
            match self.laps_ahead(head, word) {
                0 => {
                    let next = head.wrapping_add(1);
                    if self.ends.head.exchange(head, next, site::RING_HEAD_CLAIM).is_ok()
                        || seeded!(PopNotRetried)
                    {
                        return Some((word & (self.cells.len() - 1)) as u32);
                    }
                }
                // Still last lap's: empty, unless the head that was loaded is old.
                1 if self.ends.head.load(site::RING_HEAD_LOAD) == head => return None,
                _ => {}
            }
            spin_hint();
        }
    }

    /// Whether the ring looks empty: a hint, stale as soon as it is given. It never takes a
    /// push for absent that happened before.
    #[inline]
    pub fn looks_empty(&self) -> bool {
        let head = self.ends.head.load(site::RING_HEAD_LOAD);
        let tail = self.ends.tail.load(site::RING_TAIL_LOAD);
        // A tail behind the head lags behind a push that was popped already; one that is ahead by more than the ring holds
        // was loaded when the head had moved on.
        tail.wrapping_sub(head).cast_signed() <= 0
    }
}

#[cfg(all(test, not(loom)))]
mod tests {
    use super::*;

    fn full(capacity: usize, needed: usize) -> TableFull {
        TableFull { table: Table::Queues, capacity, needed }
    }

    #[test]
    fn what_does_not_fit_is_refused() {
        let mut slots = [const { QueueSlot::new() }; 6];
        let ring = IndexRing::new(&mut slots).unwrap_or_else(|full| panic!("{full}"));
        assert_eq!(ring.push(3), Ok(()));
        assert_eq!(ring.push(4), Err(full(4, 5)), "four of six slots are a power of two");
        assert_eq!((ring.pop(), ring.pop()), (Some(3), None));
        assert_eq!(IndexRing::new(&mut []).map(drop), Err(full(0, 1)));
    }

    #[test]
    fn a_ring_that_holds_indices_from_the_start() {
        let mut slots = [const { QueueSlot::new() }; 4];
        for count in 0..=4 {
            let ring =
                IndexRing::holding(count, &mut slots).unwrap_or_else(|full| panic!("{full}"));
            assert_eq!(ring.looks_empty(), count == 0);
            for _lap in 0..3 {
                for index in 0..count as u32 {
                    assert_eq!(ring.pop(), Some(index), "of {count}");
                    assert_eq!(ring.push(index), Ok(()));
                }
            }
            (0..count).for_each(|_| assert!(ring.pop().is_some()));
            assert_eq!((ring.pop(), ring.looks_empty()), (None, true));
        }
        assert_eq!(IndexRing::holding(5, &mut slots).map(drop), Err(full(4, 5)));
        assert_eq!(IndexRing::holding(5, &mut slots[..3]).map(drop), Err(full(2, 5)));
    }

    /// Pushes `index`, but for the tail, whose position before that it returns.
    fn publish_only(ring: &IndexRing<'_>, index: usize) -> usize {
        let tail = ring.ends.tail.load(site::EXCLUSIVE);
        let word = ring.cycle(tail) << ring.slot_bits | index;
        ring.slot(tail).store(word, site::EXCLUSIVE);
        tail
    }

    /// Invariant 7: the cell is written, its pusher sleeps before it moves the tail.
    #[test]
    fn a_pusher_that_is_suspended_stops_nobody() {
        let mut slots = [const { QueueSlot::new() }; 4];
        let ring = IndexRing::new(&mut slots).unwrap_or_else(|full| panic!("{full}"));
        for _lap in 0..3 {
            assert_eq!(ring.push(1), Ok(()));
            publish_only(&ring, 2);
            assert_eq!(ring.push(3), Ok(()));
            assert_eq!([(); 4].map(|()| ring.pop()), [Some(1), Some(2), Some(3), None]);
            assert!(ring.looks_empty());
        }
    }

    /// A look does not see it, since the push is not over; but a pop has it, and what is pushed next is seen.
    #[test]
    fn what_a_suspended_pusher_pushed_is_popped() {
        let mut slots = [const { QueueSlot::new() }; 4];
        let ring = IndexRing::new(&mut slots).unwrap_or_else(|full| panic!("{full}"));
        for _lap in 0..3 {
            let tail = publish_only(&ring, 2);
            assert!(ring.looks_empty());
            assert_eq!((ring.pop(), ring.pop(), ring.looks_empty()), (Some(2), None, true));
            assert_eq!(ring.push(3), Ok(()));
            assert!(!ring.looks_empty());
            assert_eq!((ring.pop(), ring.pop(), ring.looks_empty()), (Some(3), None, true));
            // Its pusher goes on, and finds that the tail was helped on.
            ring.help_tail(tail);
            assert!(ring.looks_empty());
        }
    }

    /// An empty ring that has been pushed to and popped from up to position `start`.
    fn come_to(start: usize, slots: &mut [QueueSlot]) -> IndexRing<'_> {
        let ring = IndexRing::new(slots).unwrap_or_else(|full| panic!("{full}"));
        for popped in start - ring.cells.len()..start {
            ring.slot(popped).store(ring.cycle(popped) << ring.slot_bits, site::EXCLUSIVE);
        }
        ring.ends.head.store(start, site::EXCLUSIVE);
        ring.ends.tail.store(start, site::EXCLUSIVE);
        ring
    }

    #[test]
    fn positions_wrap() {
        let mut slots = [const { QueueSlot::new() }; 4];
        // One index at a time first: a lap that is miscounted is seen before a push could look for it for ever.
        for filled in [1, 4] {
            let ring = come_to(usize::MAX - 2 * 4, &mut slots);
            while ring.cycle(ring.ends.head.load(site::EXCLUSIVE)) != 2 {
                assert!(ring.looks_empty());
                assert_eq!(ring.pop(), None);
                (0..filled).for_each(|index| assert_eq!(ring.push(index), Ok(())));
                assert!(!ring.looks_empty());
                (0..filled).for_each(|index| assert_eq!(ring.pop(), Some(index)));
            }
        }
    }
}
