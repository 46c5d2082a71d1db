//! What a unit's update waits for, and the list of what it then reads.
//!
//! Both are in one word: an interaction is listed and counted at once, by one CAS at the unit that it is
//! found for.

use crate::sync::{AtomicWord, const_fn, site};
use crate::unit::{InteractionId, NONE};

/// Bits of the word that are the index of the list's first interaction; those above them are the count.
const INDEX_BITS: u32 = usize::BITS / 2;
/// The index that an empty list begins with.
const EMPTY: usize = (1 << INDEX_BITS) - 1;

/// A countdown to a unit's update, and the list of this frame's candidates: interactions of the unit that
/// passed the broad phase.
#[derive(Debug)]
pub(crate) struct Pending(AtomicWord);

impl Pending {
    /// The most interactions that there may be, 65,533 where a word has 32 bits: one unit may have them all,
    /// and waits for two things more.
    pub(crate) const MOST_INTERACTIONS: usize = EMPTY - 2;

    const_fn! {
        /// A countdown that ends at its `arrivals`-th arrival, and no candidates.
        pub(crate) const fn new(arrivals: u32) -> Self {
            Self(AtomicWord::new(word(arrivals as usize, EMPTY)))
        }
    }

    /// Arrives once; `true` for the last arriver, who then sees everything that the others did before they
    /// arrived.
    #[inline]
    pub(crate) fn arrive(&self) -> bool {
        let before = self.0.fetch_sub(word(1, 0), site::PENDING_ARRIVE);
        before >> INDEX_BITS == 1
    }

    /// Lists a chain of `count` interactions before those listed so far, and expects as many arrivals more.
    /// The caller must hold an arrival that has not been made yet, or the countdown might have ended
    /// already. `link` is told what is to follow the chain's last one; more than once where others push.
    #[inline]
    pub(crate) fn push(&self, first: InteractionId, count: u32, link: impl Fn(u32)) {
        let mut seen = self.0.load(site::CANDIDATE_LOOK);
        loop {
            link(index_of(seen));
            let pushed = word((seen >> INDEX_BITS) + count as usize, first.index());
            match self.0.exchange(seen, pushed, site::CANDIDATE_PUSH) {
                Ok(_) => return,
                Err(found) => seen = found,
            }
        }
    }

    /// The first candidate. Only for who took the countdown to its end.
    #[inline]
    pub(crate) fn first(&self) -> u32 {
        index_of(self.0.load(site::CANDIDATE_HEAD))
    }

    /// Lets the list begin with another of its candidates: it has been sorted. Only for who took the
    /// countdown to its end.
    pub(crate) fn set_first(&self, first: u32) {
        self.0.store(word(0, first as usize & EMPTY), site::CANDIDATE_HEAD);
    }

    /// Starts again at `arrivals`, without candidates. Only the last arriver may, before it lets anyone
    /// arrive anew.
    #[inline]
    pub(crate) fn arm(&self, arrivals: u32) {
        self.0.store(word(arrivals as usize, EMPTY), site::PENDING_ARM);
    }
}

const fn word(count: usize, index: usize) -> usize {
    count << INDEX_BITS | index
}

fn index_of(word: usize) -> u32 {
    match word & EMPTY {
        EMPTY => NONE,
        index => index as u32,
    }
}

#[cfg(all(test, not(loom)))]
mod tests {
    use super::*;
    use std::cell::Cell;

    #[test]
    fn what_is_listed_is_counted() {
        let pending = Pending::new(1);
        assert_eq!(pending.first(), NONE);
        let follows = Cell::new(7);
        pending.push(InteractionId(4), 1, |next| follows.set(next));
        assert_eq!((pending.first(), follows.get()), (4, NONE));
        pending.push(InteractionId(0), 2, |next| follows.set(next));
        assert_eq!((pending.first(), follows.get()), (0, 4));
        assert_eq!([(); 4].map(|()| pending.arrive()), [false, false, false, true]);
        assert_eq!(pending.first(), 0, "the list stays when the countdown ends");
        pending.set_first(4);
        assert_eq!(pending.first(), 4);
        pending.set_first(NONE);
        assert_eq!(pending.first(), NONE);
        pending.arm(2);
        assert_eq!(pending.first(), NONE);
        assert_eq!([(); 2].map(|()| pending.arrive()), [false, true]);
    }

    #[test]
    fn the_greatest_index_and_the_most_candidates() {
        let pending = Pending::new(2);
        let most = Pending::MOST_INTERACTIONS as u32;
        pending.push(InteractionId(most - 1), most, |next| assert_eq!(next, NONE));
        assert_eq!(pending.first(), most - 1);
        let count = pending.0.load(site::EXCLUSIVE) >> INDEX_BITS;
        assert_eq!(count, EMPTY, "the count has as many bits as the index, and all are set");
    }
}
