//! Who has arrived in this frame: each pair meets exactly once, at its second arriver.
//!
//! A unit looks through the frame's list from its beginning, meets whoever is there, and arrives by one
//! CAS that writes it into the first free cell; who comes before it *are* those it was to meet. Of any two
//! units one comes later in the list, and only that one meets the other: every pair meets exactly once,
//! with no gate, no sort and no wait. Cells are words side by side, so that a long list is read as fast as
//! memory gives it, where links from unit to unit would be followed one miss after the other; and any
//! number of units fits, where a set of bits would need a word for every pair of groups beyond the word's
//! width.
//!
//! No state is half written, and nothing is tried twice: who loses a cell meets its winner, and goes on to
//! the next.

use crate::frame::Frame;
use crate::ring::QueueSlot;
use crate::sync::{seeded, site};

/// The frame's arrivals. A cell holds a unit's index and, in its lowest bit, the parity of the frame
/// that the unit arrived in. As many arrive in every frame and nobody looks beyond the first free cell, so a cell that
/// is looked at and not yet written in this frame was written in the one before, and is free.
#[derive(Debug)]
pub struct Arrivals<'m> {
    cells: &'m [QueueSlot],
}

impl<'m> Arrivals<'m> {
    /// Nobody has arrived in a frame of even number; a cell for each unit that ever arrives.
    pub fn new(cells: &'m mut [QueueSlot]) -> Self {
        cells.iter().for_each(|cell| cell.0.store(1, site::EXCLUSIVE));
        Self { cells }
    }

    /// Calls `meet` with each that arrived before in this frame, oldest first, and arrives as `index`.
    /// Nobody arrives in a frame before all have arrived in the one before.
    ///
    /// The caller sees all that they did before they arrived.
    #[inline]
    pub fn arrive(&self, index: u32, frame: Frame, mut meet: impl FnMut(u32)) {
        let word = (index as usize) << 1 | frame.parity();
        // There is a cell for each unit that arrives.
        for cell in self.cells {
            let mut seen = cell.0.load(site::ARRIVALS_READ);
            if seen & 1 != frame.parity() {
                // Publishing is this one CAS.
                let published = cell.0.exchange(seen, word, site::ARRIVALS_PUBLISH).is_ok();
                if published || seeded!(ArrivalNotRetried) {
                    return;
                }
                seen = cell.0.load(site::ARRIVALS_READ);
            }
            meet((seen >> 1) as u32);
        }
    }
}
