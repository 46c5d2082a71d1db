//! Who has arrived in this frame: each pair meets exactly once, at its second arriver.
//!
//! A unit arrives by one CAS that writes it into the first free cell of the frame's list; the cells
//! before it *are* the list of those it must be tested against. Of any two units one comes later in
//! the list, and only that one finds the other before it: every pair meets exactly once, with no gate,
//! no sort and no wait. Cells are words side by side, so that a long list is read as fast as memory
//! gives it, where links from unit to unit would be followed one miss after the other; and any number
//! of units fits, where a set of bits would need a word for every pair of groups beyond the word's
//! width.
//!
//! No state is half written: the CAS publishes, then anyone may help the end of the list on.

use crossbeam_utils::CachePadded;

use crate::frame::Frame;
use crate::ring::QueueSlot;
use crate::sync::{AtomicWord, site, spin_hint};

/// The frame's arrivals. A cell holds a unit's index and, in its lowest bit, the parity of the frame
/// that the unit arrived in: every unit arrives in every frame, so a cell that is not yet written in
/// this frame was written in the one before.
#[derive(Debug)]
pub struct Arrivals<'m> {
    cells: &'m [QueueSlot],
    /// The first free cell; may lag by one arrival that has not been helped on yet.
    end: CachePadded<AtomicWord>,
}

impl<'m> Arrivals<'m> {
    /// Nobody has arrived in a frame of even number; a cell for each unit that ever arrives.
    pub fn new(cells: &'m mut [QueueSlot]) -> Self {
        cells.iter().for_each(|cell| cell.0.store(1, site::EXCLUSIVE));
        Self { cells, end: CachePadded::new(AtomicWord::new(0)) }
    }

    /// Arrives as `index` and returns those that arrived before in this frame, oldest first.
    ///
    /// The caller sees all that they did before they arrived.
    #[inline]
    pub fn arrive(&self, index: u32, frame: Frame) -> impl Iterator<Item = u32> + use<'m> {
        let word = (index as usize) << 1 | frame.parity();
        let place = loop {
            let end = self.end.load(site::ARRIVALS_END_LOAD);
            // There is a cell for each unit that arrives.
            let Some(cell) = self.cells.get(end) else { break end };
            let seen = cell.0.load(site::ARRIVALS_LOOK);
            // Last frame's cell is free. Publishing is this one CAS.
            if seen & 1 != frame.parity()
                && cell.0.exchange(seen, word, site::ARRIVALS_PUBLISH).is_ok()
            {
                self.help_end(end);
                break end;
            }
            // This frame's already: who wrote it has not moved the end yet.
            self.help_end(end);
            spin_hint();
        };
        let earlier = self.cells.get(..place).unwrap_or_default();
        earlier.iter().map(|cell| (cell.0.load(site::ARRIVALS_READ) >> 1) as u32)
    }

    fn help_end(&self, end: usize) {
        // Failure means that somebody else helped; either way the end has moved on.
        let _ = self.end.exchange(end, end + 1, site::ARRIVALS_END_HELP);
    }

    /// Forgets all. Only when every arriver of the frame has read its list to the end, and
    /// before any arrives in the next.
    #[inline]
    pub fn clear(&self) {
        self.end.store(0, site::ARRIVALS_RESET);
    }
}
