//! The memory that a host hands over: plain slices, from arrays in a `static`, from the stack or
//! from a heap. The core allocates nothing.

use crate::contacts::{ContactSlot, SegmentSlot};
use crate::countdown::Countdown;
use crate::environment::Environment;
use crate::inbox::{Inbox, LetterSlot};
use crate::pending::Pending;
use crate::pipeline::MOST_HOMES;
use crate::ring::{QueueSlot, slots_for};
use crate::sync::{Atomic, Cell, const_fn, site};
use crate::unit::{NONE, UnitId};

/// Memory of one unit and what the protocol knows of it. Units have cache lines of their own, and what
/// others write of a unit is side by side in the first.
#[derive(Debug)]
#[repr(C)]
// Where lines are of 128 bytes, or are fetched in pairs.
#[cfg_attr(
    any(target_arch = "x86_64", target_arch = "aarch64", target_arch = "powerpc64"),
    repr(align(128))
)]
#[cfg_attr(
    not(any(target_arch = "x86_64", target_arch = "aarch64", target_arch = "powerpc64")),
    repr(align(64))
)]
pub struct UnitSlot<O> {
    /// What has to happen before the unit's next update: its interactions, the opening of the
    /// frame, and its rendering in the frame before; and the list of the interactions.
    pub(crate) pending: Pending,
    /// The frame of the unit's next update.
    pub(crate) frame: Atomic,
    /// Whose it is, in the pipeline at hand: see [`Config::homes`](crate::pipeline::Config::homes).
    pub(crate) home: Atomic,
    /// First of the modelled interactions.
    pub(crate) modelled: Atomic,
    pub(crate) inbox: Inbox,
    /// Made so by the host.
    pub(crate) solitary: bool,
    /// Whether it bypasses the first two stages, in the pipeline at hand.
    pub(crate) bypasses: bool,
    pub(crate) object: Cell<O>,
}

impl<O> UnitSlot<O> {
    const_fn! {
        /// A unit that may interact.
        pub const fn new(object: O) -> Self {
            Self {
                pending: Pending::new(0),
                frame: Atomic::new(0),
                home: Atomic::new(0),
                modelled: Atomic::new(NONE),
                // SAFETY: a pipeline gives the unit another, which stays with the pipeline's letters.
                inbox: unsafe { Inbox::new() },
                solitary: false,
                bypasses: false,
                object: Cell::new(object),
            }
        }
    }

    const_fn! {
        /// A unit that never interacts, neither with others nor within itself: it bypasses the first two stages
        /// (§5.1). Under modelled interactions every unit without any does, and none with one, whether made so or
        /// not.
        pub const fn solitary(object: O) -> Self {
            let mut slot = Self::new(object);
            slot.solitary = true;
            slot
        }
    }

    /// The object.
    pub fn object_mut(&mut self) -> &mut O {
        self.object.get_mut()
    }

    /// The object, out of its slot.
    pub fn into_object(self) -> O {
        self.object.into_inner()
    }
}

/// Memory of one interaction: a modelled one for good, or a candidate of one frame.
#[derive(Debug)]
pub struct InteractionSlot<I> {
    pub(crate) state: Cell<I>,
    ends: [Atomic; 2],
    /// Next modelled interaction of each end.
    modelled: [Atomic; 2],
    /// Next candidate of each end.
    candidates: [Atomic; 2],
    /// First segment of its results.
    pub(crate) contacts: Atomic,
    /// Ends that have not entered the frame.
    pub(crate) arrivals: Countdown,
}

/// Which of the two lists that an interaction slot is in.
#[derive(Clone, Copy)]
pub(crate) enum Chain {
    Modelled,
    Candidates,
}

impl<I> InteractionSlot<I> {
    const_fn! {
        /// An interaction between `a` and `b`, modelled by the host, with its own state. A pipeline with the
        /// spatial broad phase overwrites the ends: make its slots anew for a pairwise one.
        pub const fn between(a: UnitId, b: UnitId, state: I) -> Self {
            Self {
                state: Cell::new(state),
                ends: [Atomic::new(a.0), Atomic::new(b.0)],
                modelled: [Atomic::new(NONE), Atomic::new(NONE)],
                candidates: [Atomic::new(NONE), Atomic::new(NONE)],
                contacts: Atomic::new(NONE),
                arrivals: Countdown::new(2),
            }
        }
    }

    const_fn! {
        /// Room for interactions found at run time; `state` is memory that they may reuse.
        pub const fn spare(state: I) -> Self {
            Self::between(UnitId(NONE), UnitId(NONE), state)
        }
    }

    /// The state.
    pub fn state_mut(&mut self) -> &mut I {
        self.state.get_mut()
    }

    pub(crate) fn ends(&self) -> [UnitId; 2] {
        [0, 1].map(|end| UnitId(self.ends[end].load(site::SLOT_FIELD)))
    }

    pub(crate) fn join(&self, ends: [UnitId; 2]) {
        for (field, end) in self.ends.iter().zip(ends) {
            field.store(end.0, site::SLOT_FIELD);
        }
    }

    /// The end that is not `unit`; `unit` itself for an interaction within a unit.
    pub(crate) fn other(&self, unit: UnitId) -> UnitId {
        let [a, b] = self.ends();
        if a == unit { b } else { a }
    }

    fn link(&self, chain: Chain, unit: UnitId) -> &Atomic {
        let links = match chain {
            Chain::Modelled => &self.modelled,
            Chain::Candidates => &self.candidates,
        };
        &links[usize::from(self.ends()[0] != unit)]
    }

    /// The next interaction of `unit` in `chain`.
    pub(crate) fn next(&self, chain: Chain, unit: UnitId) -> u32 {
        self.link(chain, unit).load(site::LIST_FOLLOW)
    }

    pub(crate) fn set_next(&self, chain: Chain, unit: UnitId, next: u32) {
        self.link(chain, unit).store(next, site::LIST_LINK);
    }
}

/// All memory of a pipeline. Sizes:
#[derive(Debug)]
pub struct Memory<'m, E: Environment> {
    /// One for each unit, with its object.
    pub units: &'m mut [UnitSlot<E::Object>],
    /// `Pairwise`: the modelled interactions. `Spatial`: spare ones, twice as many as pairs of
    /// units (and units with themselves) may be candidates in one frame. 65,533 at most where pointers have 32
    /// bits.
    pub interactions: &'m mut [InteractionSlot<E::Interaction>],
    /// Twice as many as one frame's interactions may push records. 131,070 at most where pointers have 32 bits.
    pub contacts: &'m mut [ContactSlot<E::Contact>],
    /// As many as `contacts`.
    pub segments: &'m mut [SegmentSlot],
    /// As many as are posted in two frames, from outside too: those of a frame are read by the updates of the
    /// next, some of which have posted theirs by then.
    pub letters: &'m mut [LetterSlot<E::Message>],
    /// [`queue_slots`] of the numbers above and of homes.
    pub queues: &'m mut [QueueSlot],
}

/// `table[index]`; only tests and models check it.
///
/// # Safety
/// `index` is below the table's length.
#[inline(always)]
pub(crate) unsafe fn at<T>(table: &[T], index: usize) -> &T {
    if cfg!(any(loom, debug_assertions)) {
        // A weakened memory order, or a fault in the core, is to be seen.
        return &table[index];
    }
    // SAFETY: the caller's promise.
    unsafe { table.get_unchecked(index) }
}

/// How many queue slots a pipeline of these sizes needs; it has 1 to [`MOST_HOMES`] homes, the nearest is taken.
pub const fn queue_slots(units: usize, interactions: usize, letters: usize, homes: usize) -> usize {
    let homes = match homes {
        0 => 1,
        1..MOST_HOMES => homes,
        _ => MOST_HOMES,
    };
    let shared_out = homes * slots_for(interactions.div_ceil(homes));
    let rings = 2 * (homes + 1) * slots_for(units) + shared_out + slots_for(letters);
    // The lists of arrivals and of homes' units.
    rings + 2 * units
}

/// Hands a `static` out exactly once, for hosts without a heap.
///
/// ```
/// use dualframe_core::{ring::QueueSlot, storage::Static};
/// static QUEUES: Static<[QueueSlot; 64]> = Static::new([const { QueueSlot::new() }; 64]);
/// assert!(QUEUES.take().is_some());
/// assert!(QUEUES.take().is_none());
/// ```
#[derive(Debug)]
pub struct Static<T> {
    value: Cell<T>,
    taken: Atomic,
}

// SAFETY: `take` lends the value to one caller only, who may be on another thread.
unsafe impl<T: Send> Sync for Static<T> {}

impl<T> Static<T> {
    const_fn! {
        /// A value to be taken once.
        pub const fn new(value: T) -> Self {
            Self { value: Cell::new(value), taken: Atomic::new(0) }
        }
    }

    /// The value, at the first call.
    #[expect(clippy::mut_from_ref, reason = "the flag lets one call pass, ever")]
    pub fn take(&'static self) -> Option<&'static mut T> {
        if self.taken.exchange(0, 1, site::STATIC_TAKE).is_err() {
            return None;
        }
        // SAFETY: only one call gets here, and nothing else reaches the cell.
        unsafe { self.value.with_mut(|value| Some(&mut *::core::ptr::from_mut(value))) }
    }
}
