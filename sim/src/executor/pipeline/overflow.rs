//! Letters that the pipeline has no room for.

use std::collections::BTreeMap;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};

use dualframe_core::inbox::From;
use dualframe_core::unit::UnitId;

use super::host::Parcel;

/// Letters that found the pipeline's table full, until they are due: nothing is lost while the table is too
/// small. It is given more room after the batch.
#[derive(Default)]
pub(super) struct Overflow {
    /// How many letters are waiting. Written by whoever has the lock.
    waiting: AtomicUsize,
    late: Mutex<Late>,
}

#[derive(Default)]
struct Late {
    /// By whom they are for.
    letters: BTreeMap<UnitId, Vec<Letter>>,
    /// The most letters that waited at once.
    most: usize,
}

struct Letter {
    due: u64,
    from: From,
    parcel: Parcel,
}

impl Overflow {
    /// Keeps a letter for the update of a unit in the frame `due`.
    pub(super) fn keep(&self, due: u64, to: UnitId, from: From, parcel: Parcel) {
        let mut late = self.lock();
        late.letters.entry(to).or_default().push(Letter { due, from, parcel });
        // Relaxed, as are the others: an update comes after all updates of the frame before, in which its
        // letters were kept, by the pipeline; none of later writes is 0 before they are taken.
        let waiting = self.waiting.load(Ordering::Relaxed) + 1;
        self.waiting.store(waiting, Ordering::Relaxed);
        late.most = late.most.max(waiting);
    }

    /// Hands over the letters to a unit for its update in a frame.
    pub(super) fn deliver(&self, to: UnitId, frame: u64, take: impl FnMut((From, Parcel))) {
        if self.waiting.load(Ordering::Relaxed) == 0 {
            return;
        }
        let mut late = self.lock();
        let Some(letters) = late.letters.get_mut(&to) else { return };
        let before = letters.len();
        let due = letters.extract_if(.., |letter| letter.due <= frame);
        due.map(|letter| (letter.from, letter.parcel)).for_each(take);
        let delivered = before - letters.len();
        let waiting = self.waiting.load(Ordering::Relaxed) - delivered;
        self.waiting.store(waiting, Ordering::Relaxed);
    }

    /// Hands over all letters.
    pub(super) fn empty(&self, take: impl FnMut((From, Parcel))) {
        let letters = std::mem::take(&mut self.lock().letters);
        self.waiting.store(0, Ordering::Relaxed);
        let letters = letters.into_values().flatten();
        letters.map(|letter| (letter.from, letter.parcel)).for_each(take);
    }

    /// The most letters that waited at once.
    pub(super) fn most(&self) -> usize {
        self.lock().most
    }

    fn lock(&self) -> MutexGuard<'_, Late> {
        self.late.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::message::Message;
    use crate::object::ObjectId;

    #[test]
    fn letters_are_delivered_when_they_are_due_and_once() {
        let overflow = Overflow::default();
        for (sequence, due) in [(0, 5), (1, 6), (2, 5)] {
            let parcel = Parcel { to: ObjectId(7), message: Message::Release };
            overflow.keep(due, UnitId(1), From { sender: 3, sequence }, parcel);
        }
        let delivered = |to: u32, frame: u64| {
            let mut letters = Vec::new();
            overflow.deliver(UnitId(to), frame, |(from, _)| letters.push(from.sequence));
            letters
        };
        assert_eq!(delivered(1, 4), []);
        assert_eq!(delivered(2, 5), [], "to another unit");
        assert_eq!(delivered(1, 5), [0, 2]);
        assert_eq!(delivered(1, 5), []);
        let mut left = Vec::new();
        overflow.empty(|(from, _)| left.push(from.sequence));
        assert_eq!((left, overflow.most()), (vec![1], 3));
        assert_eq!(delivered(1, 6), []);
    }
}
