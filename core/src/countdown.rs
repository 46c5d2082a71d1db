//! The one synchronisation primitive: whoever takes a countdown to zero carries on.

use crate::sync::{Atomic, const_fn, site};

/// Counts arrivals down; the last arriver owns what comes next.
///
/// The paper's three counters are all this (§5.4): a unit's pending work in a frame (in `pending.rs`, with
/// the list of that work in the same word), a modelled interaction's two ends, a frame's renders.
///
/// ```
/// use dualframe_core::countdown::Countdown;
/// let both_ends = Countdown::new(2);
/// assert!(!both_ends.arrive());
/// assert!(both_ends.arrive(), "the second arriver carries on");
/// ```
#[derive(Debug)]
pub struct Countdown(Atomic);

impl Countdown {
    const_fn! {
        /// A countdown that ends at its `arrivals`-th arrival.
        pub const fn new(arrivals: u32) -> Self {
            Self(Atomic::new(arrivals))
        }
    }

    /// Arrives once; `true` for the last arriver, who then sees everything that the others did
    /// before they arrived.
    #[inline]
    pub fn arrive(&self) -> bool {
        self.0.fetch_sub(1, site::COUNTDOWN_ARRIVE) == 1
    }

    /// Starts again at `arrivals`. Only the last arriver may, before it lets anyone arrive anew.
    #[inline]
    pub fn arm(&self, arrivals: u32) {
        self.0.store(arrivals, site::COUNTDOWN_ARM);
    }
}
