//! The same indices for whoever comes first, round after round: the units that a frame's opening sets free.
//!
//! The list is made once. To offer all of it is one store, however long it is; who comes takes the next by one CAS. A
//! queue would have every index pushed, by one worker and while the others wait, and popped again.

use crate::ring::QueueSlot;
use crate::sync::{Atomic, CachePadded, const_fn, site};

/// A list of indices, each of which is taken once a round.
///
/// ```
/// use dualframe_core::{offer::Offer, ring::QueueSlot};
/// let mut slots = [const { QueueSlot::new() }; 2];
/// for (slot, index) in slots.iter_mut().zip([7, 3]) {
///     slot.set(index);
/// }
/// let mut offer = Offer::new();
/// offer.set(&slots);
/// assert_eq!(offer.take(), None, "nothing is offered yet");
/// for _round in 0..2 {
///     offer.offer();
///     assert_eq!([(); 3].map(|()| offer.take()), [Some(7), Some(3), None]);
/// }
/// ```
#[derive(Debug)]
pub struct Offer<'m> {
    indices: &'m [QueueSlot],
    /// Place of the first that nobody has taken; their number if all are.
    next: CachePadded<Atomic>,
}

impl<'m> Offer<'m> {
    const_fn! {
        /// Of no index.
        pub const fn new() -> Self {
            Self { indices: &[], next: CachePadded::new(Atomic::new(0)) }
        }
    }

    /// Of what is in `indices`, in their order, at most 2^32 − 1 of them. None is offered before the next round.
    pub fn set(&mut self, indices: &'m [QueueSlot]) {
        self.indices = indices;
        self.next.store(indices.len() as u32, site::EXCLUSIVE);
    }

    /// The number of indices.
    #[inline]
    pub fn len(&self) -> usize {
        self.indices.len()
    }

    /// Whether there are no indices at all.
    #[inline]
    pub fn is_empty(&self) -> bool {
        self.indices.is_empty()
    }

    /// Offers all of them, when all that were offered before are taken. Who takes one sees what the caller did before.
    #[inline]
    pub fn offer(&self) {
        self.next.store(0, site::OFFER_SET);
    }

    /// Whether none is left: a hint, stale as soon as it is given.
    #[inline]
    pub fn looks_empty(&self) -> bool {
        self.next.load(site::OFFER_LOOK) as usize >= self.indices.len()
    }

    /// Takes the next one, if one is left.
    #[inline]
    pub fn take(&self) -> Option<u32> {
        let mut place = self.next.load(site::OFFER_LOOK);
        loop {
            let slot = self.indices.get(place as usize)?;
            match self.next.exchange(place, place + 1, site::OFFER_TAKE) {
                Ok(_) => return Some(slot.0.load(site::OFFER_READ) as u32),
                Err(found) => place = found,
            }
        }
    }
}

impl Default for Offer<'_> {
    fn default() -> Self {
        Self::new()
    }
}

#[cfg(all(test, not(loom)))]
mod tests {
    use super::*;

    #[test]
    fn each_is_taken_once_a_round() {
        let mut slots = [const { QueueSlot::new() }; 3];
        (5..).zip(&mut slots).for_each(|(index, slot)| slot.set(index));
        let mut offer = Offer::default();
        assert!(offer.is_empty() && offer.looks_empty());
        offer.offer();
        assert_eq!((offer.take(), offer.looks_empty()), (None, true), "of nothing");
        offer.set(&slots);
        assert_eq!((offer.len(), offer.is_empty(), offer.take()), (3, false, None));
        for _round in 0..3 {
            offer.offer();
            for index in 5..8 {
                assert!(!offer.looks_empty());
                assert_eq!(offer.take(), Some(index));
            }
            assert_eq!((offer.take(), offer.looks_empty()), (None, true));
        }
        offer.offer();
        offer.set(&slots[..2]);
        assert_eq!((offer.take(), offer.looks_empty()), (None, true), "it is another round's");
    }
}
