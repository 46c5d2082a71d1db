//! Results of interactions: the paper's temp buffers (§5.6), one pool for each frame in flight.
//!
//! Response never writes into an object. It pushes records; the updates of the two objects read
//! them. A push claims [`room`](crate::room) and is then contiguous; an interaction's pushes are
//! chained. The pool of a frame is emptied when the next frame opens, when all its readers are
//! done.

use ::core::cell::UnsafeCell;
use ::core::mem::MaybeUninit;

use crate::error::{Table, TableFull};
use crate::frame::Frame;
use crate::room::FrameRoom;
use crate::storage::at;
use crate::sync::{CachePadded, Cell, const_fn};
use crate::unit::NONE;

/// Memory of one result record. Contiguous and unwatched by loom: the segment that covers it is
/// watched instead.
#[derive(Debug)]
#[repr(transparent)]
pub struct ContactSlot<C>(UnsafeCell<MaybeUninit<C>>);

// SAFETY: a slot is written by the one claimer of its range and read by others only after the
// interaction was released to its ends' countdowns; see `Pools::write` and `Segments::next`.
unsafe impl<C: Send + Sync> Sync for ContactSlot<C> {}

impl<C> ContactSlot<C> {
    /// An empty slot; it costs nothing to make.
    pub const fn new() -> Self {
        Self(UnsafeCell::new(MaybeUninit::uninit()))
    }
}

impl<C> Default for ContactSlot<C> {
    fn default() -> Self {
        Self::new()
    }
}

#[derive(Clone, Copy, Debug)]
struct Header {
    length: u32,
    /// The interaction's next segment.
    next: u32,
}

/// Memory of the header that a segment starting at the contact slot of the same index would have.
#[derive(Debug)]
pub struct SegmentSlot(Cell<Header>);

impl SegmentSlot {
    const_fn! {
        /// An unused header.
        pub const fn new() -> Self {
            Self(Cell::new(Header { length: 0, next: NONE }))
        }
    }
}

impl Default for SegmentSlot {
    fn default() -> Self {
        Self::new()
    }
}

/// The two frames' pools: even frames have the first half of the slots, odd ones the second.
#[derive(Debug)]
pub(crate) struct Pools<'m, C> {
    contacts: &'m [ContactSlot<C>],
    segments: &'m [SegmentSlot],
    rooms: [CachePadded<FrameRoom>; 2],
    /// Slots of one frame.
    half: u32,
}

impl<'m, C: Copy> Pools<'m, C> {
    pub(crate) fn new(contacts: &'m [ContactSlot<C>], segments: &'m [SegmentSlot]) -> Self {
        let rooms = [FrameRoom::new(), FrameRoom::new()].map(CachePadded::new);
        let half = (contacts.len().min(segments.len()) / 2) as u32;
        Self { contacts, segments, rooms, half }
    }

    /// Empties `frame`'s pool.
    pub(crate) fn reset(&self, frame: Frame) {
        self.rooms[frame.parity()].reset();
    }

    /// Slots that `frame` has asked for so far.
    pub(crate) fn asked(&self, frame: Frame) -> u32 {
        self.rooms[frame.parity()].asked()
    }

    /// Writes `records`, whose segments are still to be marked, and returns the index of the first.
    fn write(&self, frame: Frame, records: &[C]) -> Result<u32, TableFull> {
        // A longer slice cannot fit either, and is named by the length that does not.
        let length = u32::try_from(records.len()).unwrap_or(u32::MAX);
        let room = &self.rooms[frame.parity()];
        let (claimed, outcome) = room.claim(length, self.half, Table::Contacts);
        outcome?;
        let start = claimed.start + frame.parity() as u32 * self.half;
        // SAFETY: `claim` gave this range, which is within the frame's half, to this call alone, until
        // `reset`, which happens after the last reader; the slots are contiguous and `transparent`.
        unsafe {
            let room = self.contacts.as_ptr().add(start as usize);
            let first = UnsafeCell::raw_get(room.cast::<UnsafeCell<MaybeUninit<C>>>());
            ::core::ptr::copy_nonoverlapping(records.as_ptr(), first.cast::<C>(), records.len());
        }
        Ok(start)
    }

    /// The records of the interaction whose first segment is `first`.
    ///
    /// # Safety
    /// `first` is the interaction's [`Contacts::first`], the interaction is done, and this frame's
    /// pool has not been reset, for as long as the iterator and what it yields live.
    pub(crate) unsafe fn segments<'a>(&'a self, first: u32) -> Segments<'a, 'm, C> {
        Segments { pools: self, next: first }
    }
}

/// Where an interaction's response puts its results.
#[derive(Debug)]
pub struct Contacts<'a, 'm, C> {
    pools: &'a Pools<'m, C>,
    frame: Frame,
    first: u32,
    last: u32,
}

impl<'a, 'm, C: Copy> Contacts<'a, 'm, C> {
    pub(crate) fn new(pools: &'a Pools<'m, C>, frame: Frame) -> Self {
        Self { pools, frame, first: NONE, last: NONE }
    }

    pub(crate) fn first(&self) -> u32 {
        self.first
    }

    /// Appends `records` as one segment, which the updates read as one slice. What belongs together is best
    /// pushed together: claiming room takes as long for one record as for many.
    ///
    /// # Errors
    /// [`TableFull`] if the frame's pool has no room for all; nothing is written then, nor by later pushes of the frame.
    #[inline]
    pub fn push(&mut self, records: &[C]) -> Result<(), TableFull> {
        if !records.is_empty() {
            let segment = self.pools.write(self.frame, records)?;
            self.append(segment, records.len() as u32);
        }
        Ok(())
    }

    /// Marks `length` records from `segment` on, which were just claimed, as the next segment.
    #[inline]
    fn append(&mut self, segment: u32, length: u32) {
        // SAFETY: the header belongs to the range just claimed.
        unsafe {
            let header = &at(self.pools.segments, segment as usize).0;
            header.with_mut(|header| *header = Header { length, next: NONE });
        }
        if self.last == NONE {
            self.first = segment;
        } else {
            // SAFETY: `last` was claimed by this interaction, whose results nobody reads yet.
            unsafe {
                let last = &at(self.pools.segments, self.last as usize).0;
                last.with_mut(|header| header.next = segment);
            }
        }
        self.last = segment;
    }
}

/// An interaction's results: a slice for each segment, in the order of the pushes.
#[derive(Debug)]
pub struct Segments<'a, 'm, C> {
    pools: &'a Pools<'m, C>,
    next: u32,
}

impl<'a, C> Iterator for Segments<'a, '_, C> {
    type Item = &'a [C];

    #[inline]
    fn next(&mut self) -> Option<&'a [C]> {
        if self.next == NONE {
            return None;
        }
        let start = self.next as usize;
        // SAFETY: a segment of the interaction's, which is done (`Pools::segments`), so that nobody
        // writes its headers.
        let header = unsafe { at(self.pools.segments, start).0.with(|header| *header) };
        self.next = header.next;
        // SAFETY: `write` initialised the range before the header was written; it is not written
        // again while this frame's results are read.
        Some(unsafe {
            let first = self.pools.contacts.as_ptr().add(start).cast::<C>();
            ::core::slice::from_raw_parts(first, header.length as usize)
        })
    }
}

#[cfg(all(test, not(loom)))]
mod tests {
    use super::*;

    #[test]
    fn slices_are_read_as_they_were_pushed() {
        let contacts: [ContactSlot<u8>; 16] = [const { ContactSlot::new() }; 16];
        let segments = [const { SegmentSlot::new() }; 16];
        let pools = Pools::new(&contacts, &segments);
        let mut pushed = Contacts::new(&pools, Frame(1));
        let slices: [&[u8]; 4] = [&[9], &[1, 2], &[], &[3]];
        for slice in slices {
            assert_eq!(pushed.push(slice), Ok(()));
        }
        // SAFETY: nothing is pushed and nothing is reset while the segments are read.
        let read = unsafe { pools.segments(pushed.first()) };
        assert!(read.eq([&[9][..], &[1, 2], &[3]]), "nothing is nothing");
    }

    #[test]
    fn all_records_fit_or_none() {
        let contacts: [ContactSlot<u8>; 8] = [const { ContactSlot::new() }; 8];
        let segments = [const { SegmentSlot::new() }; 8];
        let pools = Pools::new(&contacts, &segments);
        let mut pushed = Contacts::new(&pools, Frame(0));
        let full = TableFull { table: Table::Contacts, capacity: 4, needed: 5 };
        assert_eq!(pushed.push(&[1, 2, 3, 4, 5]), Err(full));
        assert_eq!((pushed.first(), pools.asked(Frame(0))), (NONE, 5));
        // What was left is not to be had any more.
        let full = TableFull { needed: 6, ..full };
        assert_eq!((pushed.push(&[1]), pools.asked(Frame(0))), (Err(full), 6));
    }

    #[test]
    fn two_frames_share_no_room() {
        let contacts: [ContactSlot<u8>; 8] = [const { ContactSlot::new() }; 8];
        let segments = [const { SegmentSlot::new() }; 8];
        let pools = Pools::new(&contacts, &segments);
        let mut pushed = [0, 1].map(|frame| Contacts::new(&pools, Frame(frame)));
        for round in 0..2 {
            for (frame, pushed) in (0..).zip(&mut pushed) {
                assert_eq!(pushed.push(&[round, frame]), Ok(()));
            }
        }
        for (frame, pushed) in (0..).zip(pushed) {
            // SAFETY: nothing is pushed and nothing is reset while the segments are read.
            let read = unsafe { pools.segments(pushed.first()) };
            assert!(read.eq([[0, frame], [1, frame]]), "frame {frame}");
        }
    }
}
