//! Who has arrived in this frame: each pair meets exactly once, at its second arriver.
//!
//! A unit arrives by one CAS that pushes it onto the frame's list; the head that it replaced *is*
//! the list of those it must be tested against. Of any two units one pushed later, and only that
//! one finds the other in its list: every pair meets exactly once, with no gate, no sort and no
//! wait. One word serves any number of units, where a set of bits would need a word for every
//! pair of groups beyond the word's width; and it is cleared by one store.

use crossbeam_utils::CachePadded;

use crate::sync::{Atomic, const_fn, seeded, site, spin_hint};
use crate::unit::NONE;

/// A unit's place in the list of arrivals.
#[derive(Debug)]
pub struct Arrival(Atomic);

impl Arrival {
    const_fn! {
        /// A place that is in no list yet.
        pub const fn new() -> Self {
            Self(Atomic::new(NONE))
        }
    }
}

impl Default for Arrival {
    fn default() -> Self {
        Self::new()
    }
}

/// The frame's arrival set.
#[derive(Debug)]
pub struct Arrivals {
    newest: CachePadded<Atomic>,
}

impl Arrivals {
    const_fn! {
        /// Nobody has arrived.
        pub const fn new() -> Self {
            Self { newest: CachePadded::new(Atomic::new(NONE)) }
        }
    }

    /// Arrives as `index`, whose place is `own`, and returns the newest earlier arrival, from
    /// which [`Arrivals::before`] leads to all others.
    ///
    /// The caller sees all that the earlier arrivers did before they arrived.
    #[inline]
    pub fn arrive(&self, index: u32, own: &Arrival) -> Option<u32> {
        let mut newest = self.newest.load(site::ARRIVALS_LOOK);
        loop {
            own.0.store(newest, site::ARRIVALS_LINK);
            match self.newest.exchange(newest, index, site::ARRIVALS_PUSH) {
                Ok(earlier) => return (earlier != NONE).then_some(earlier),
                Err(_) if seeded!(ArrivalNotRetried) => return (newest != NONE).then_some(newest),
                Err(found) => newest = found,
            }
            spin_hint();
        }
    }

    /// Who arrived just before the unit whose place is `place`.
    #[inline]
    pub fn before(place: &Arrival) -> Option<u32> {
        let earlier = place.0.load(site::ARRIVALS_FOLLOW);
        (earlier != NONE).then_some(earlier)
    }

    /// Forgets all. Only when every arriver of the frame has read its list to the end, and
    /// before any arrives in the next.
    #[inline]
    pub fn clear(&self) {
        self.newest.store(NONE, site::ARRIVALS_RESET);
    }
}

impl Default for Arrivals {
    fn default() -> Self {
        Self::new()
    }
}
