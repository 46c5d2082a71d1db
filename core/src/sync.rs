//! The only file that names atomics, fences and cells: `core`'s, `portable-atomic`'s, or loom's. The records of
//! `contacts.rs` alone are in cells that loom does not watch. Under shuttle, which runs all threads on one, they are
//! `core`'s, and each access lets others run first.
//!
//! Every atomic access elsewhere passes a [`Site`]: a name and the memory order that
//! `core/PROTOCOL.md` gives it a reason for. An access without a site does not compile, and
//! `verification` can weaken one site at a time, by name, to show that a model notices.

use ::core::sync::atomic::Ordering;

#[cfg(all(not(loom), not(feature = "portable-atomic")))]
use ::core::sync::atomic as imp;
#[cfg(loom)]
use loom::sync::atomic as imp;
#[cfg(all(not(loom), feature = "portable-atomic"))]
use portable_atomic as imp;

/// Makes a constructor `const`, except under loom, whose atomics register themselves at run time.
macro_rules! const_fn {
    ($(#[$meta:meta])* $vis:vis const fn $($rest:tt)*) => {
        #[cfg(not(loom))]
        $(#[$meta])* $vis const fn $($rest)*
        #[cfg(loom)]
        $(#[$meta])* $vis fn $($rest)*
    };
    ($(#[$meta:meta])* $vis:vis const unsafe fn $($rest:tt)*) => {
        #[cfg(not(loom))]
        $(#[$meta])* $vis const unsafe fn $($rest)*
        #[cfg(loom)]
        $(#[$meta])* $vis unsafe fn $($rest)*
    };
}
pub(crate) use const_fn;

#[cfg(not(loom))]
pub(crate) use crossbeam_utils::CachePadded;

/// No padding: loom's stacks are small, and it knows no cache lines.
#[cfg(loom)]
#[derive(Debug)]
pub(crate) struct CachePadded<T>(T);

#[cfg(loom)]
impl<T> CachePadded<T> {
    pub(crate) fn new(value: T) -> Self {
        Self(value)
    }
}

#[cfg(loom)]
impl<T> ::core::ops::Deref for CachePadded<T> {
    type Target = T;

    fn deref(&self) -> &T {
        &self.0
    }
}

/// A named atomic access and its memory order.
#[derive(Clone, Copy, Debug)]
pub struct Site {
    /// Name used by PROTOCOL.md and by the ordering mutants.
    pub name: &'static str,
    /// The order this access is made with.
    pub order: Ordering,
}

/// What an access does to the cache line of its word: told to those who watch a schedule.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Access {
    /// It has to be read.
    Load,
    /// It is to be written; nobody waits for that.
    Store,
    /// It has to be this core's alone: a swap, an addition, a compare-and-swap, be it in vain.
    Exchange,
    /// No word: a fence.
    Fence,
}

impl Site {
    /// The order that this access, to `word`, is made with.
    #[cfg(not(any(loom, shuttle)))]
    #[inline(always)]
    fn effective<T>(self, _: Access, _word: &T) -> Ordering {
        self.order
    }

    #[cfg(shuttle)]
    fn effective<T>(self, access: Access, word: &T) -> Ordering {
        crate::observer::before(self, access, ::core::ptr::from_ref(word).addr());
        self.order
    }

    #[cfg(loom)]
    fn effective<T>(self, _: Access, _word: &T) -> Ordering {
        crate::instrument::effective(self)
    }
}

/// A point at which shuttle may schedule another thread. Unlike `yield_now`, it does not ask for it.
#[cfg(shuttle)]
pub fn let_others_run() {
    shuttle::sync::atomic::AtomicBool::new(false).load(Ordering::SeqCst);
}

/// Whether a model runs with this bug of `instrument::Fault`; `false` in every other build, which
/// has no trace of it.
macro_rules! seeded {
    ($fault:ident) => {{
        #[cfg(loom)]
        let seeded = crate::instrument::is_seeded(crate::instrument::Fault::$fault);
        #[cfg(not(loom))]
        let seeded = false;
        seeded
    }};
}
pub(crate) use seeded;

macro_rules! sites {
    ($($(#[$doc:meta])* $name:ident = $order:ident;)*) => {
        /// Every atomic access of the core, by name.
        pub mod site {
            use super::{Ordering, Site};
            $($(#[$doc])* pub const $name: Site =
                Site { name: stringify!($name), order: Ordering::$order };)*
            /// All sites, for the runner of ordering mutants.
            pub const ALL: &[Site] = &[$($name),*];
        }
    };
}

sites! {
    /// Relaxed: the construction and every `&mut` path; exclusive access orders it.
    EXCLUSIVE = Relaxed;
    /// Acquire: pairs with `RING_TAIL_HELP`. Whoever sees this push also sees the cells before it,
    /// and cannot take the ring for empty because an earlier cell still looks unwritten.
    RING_TAIL_LOAD = Acquire;
    /// Relaxed: re-validated by the CAS that follows.
    RING_CELL_LOOK = Relaxed;
    /// Release: publishes what the pusher wrote about the index to whoever pops it.
    RING_CELL_PUBLISH = Release;
    /// Release: the cell below the new tail was written, or seen written, before.
    RING_TAIL_HELP = Release;
    /// Relaxed: a hint that is re-validated by the CAS on the head; or a hint only, a sleeper's behind
    /// `FENCE_SLEEP`.
    RING_HEAD_LOAD = Relaxed;
    /// Acquire: pairs with `RING_CELL_PUBLISH`.
    RING_CELL_TAKE = Acquire;
    /// Relaxed: the claim; the cell was acquired already and the head carries no data.
    RING_HEAD_CLAIM = Relaxed;
    /// Acquire and Release: the last arriver must see what all others did before they arrived.
    COUNTDOWN_ARRIVE = AcqRel;
    /// Relaxed: nobody arrives before the re-armed counter was published by something else.
    COUNTDOWN_ARM = Relaxed;
    /// Acquire and Release: as `COUNTDOWN_ARRIVE`, of a unit's pending work.
    PENDING_ARRIVE = AcqRel;
    /// Relaxed: as `COUNTDOWN_ARM`.
    PENDING_ARM = Relaxed;
    /// Release: an arriver's object is read by those after it.
    ARRIVALS_PUBLISH = Release;
    /// Acquire: pairs with `ARRIVALS_PUBLISH`.
    ARRIVALS_READ = Acquire;
    /// Relaxed: lists of candidates and letters are walked only by the unit's updater, after
    /// its countdown ended, letters after `MAIL_TAKE`; those of modelled interactions do not change while workers run.
    LIST_LINK = Relaxed;
    /// Relaxed: see `LIST_LINK`.
    LIST_FOLLOW = Relaxed;
    /// Relaxed: re-validated by the CAS that follows.
    CANDIDATE_LOOK = Relaxed;
    /// Relaxed: the count cannot reach zero meanwhile, and whoever could take it there, to walk the list,
    /// is ordered after this by the hold that keeps it up.
    CANDIDATE_PUSH = Relaxed;
    /// Relaxed: exclusive to the updater.
    CANDIDATE_HEAD = Relaxed;
    /// Relaxed: what an interaction slot says of its pair is published by the queue or the gate, what a
    /// letter says by its push. What a latest-value cell notes of a retired slot is its writer's own; that nobody
    /// has left a slot is noted when all who had entered it have (`LATEST_REUSE`), and before others can
    /// (`LATEST_PUBLISH`).
    SLOT_FIELD = Relaxed;
    /// Relaxed: a unit's frame tag changes only in its update and travels with the unit.
    FRAME_TAG = Relaxed;
    /// Relaxed: claims room in a pool; the claim carries no data.
    POOL_CLAIM = Relaxed;
    /// Relaxed: a pool is reset at a gate, between its last reader and its next claimer.
    POOL_RESET = Relaxed;
    /// Relaxed: re-validated by the CAS that follows; and what an update is to read was posted before all
    /// that it is ordered after, so that it does not take its inbox for empty.
    MAIL_LOOK = Relaxed;
    /// Release: publishes the letter to the receiving unit's updater, also from outside.
    MAIL_PUSH = Release;
    /// Acquire: pairs with `MAIL_PUSH`.
    MAIL_TAKE = Acquire;
    /// Relaxed: stamps a letter from outside, and says which interactions others wait for; an older frame only
    /// delivers sooner, or has what can be done in any order done in another.
    FRAME_OPEN_LOOK = Relaxed;
    /// Relaxed: see `FRAME_OPEN_LOOK`.
    FRAME_OPEN_SET = Relaxed;
    /// Release: publishes the swap, and all that was rendered, to renderers of the next frame.
    DISPLAY_ADVANCE = Release;
    /// Acquire: pairs with `DISPLAY_ADVANCE`.
    DISPLAY_LOAD = Acquire;
    /// Release: whoever opens a frame publishes what its gate acquired.
    OFFER_SET = Release;
    /// Relaxed: re-validated by the CAS that follows; or a hint, a sleeper's behind `FENCE_SLEEP`.
    OFFER_LOOK = Relaxed;
    /// Acquire: pairs with `OFFER_SET`, whose release sequence the CASes of others continue.
    OFFER_TAKE = Acquire;
    /// Relaxed: changed by exclusive access only, as `HOME`.
    OFFER_READ = Relaxed;
    /// Relaxed: changed by exclusive access only, while there is no worker.
    HOME = Relaxed;
    /// Relaxed: a hint. Who misses it carries on with what it has, and looks again at its next step.
    HUNGRY = Relaxed;
    /// Relaxed: a sleeper announces itself before `FENCE_SLEEP`.
    BELL_ANNOUNCE = Relaxed;
    /// Relaxed: read before `FENCE_SLEEP`; a ring after that changes it.
    BELL_EPOCH_SEEN = Relaxed;
    /// Relaxed: decides whether to ring, after `FENCE_RING`.
    BELL_SLEEPERS_LOOK = Relaxed;
    /// Relaxed: `FENCE_RING`, before it, releases the pushes that the new epoch announces.
    BELL_EPOCH_RING = Relaxed;
    /// Acquire: pairs with `FENCE_RING` and the `BELL_EPOCH_RING` after it.
    BELL_EPOCH_CHECK = Acquire;
    /// Sequentially consistent fence between announcing and looking again.
    FENCE_SLEEP = SeqCst;
    /// Sequentially consistent fence between pushing and looking for sleepers.
    FENCE_RING = SeqCst;
    /// Sequentially consistent fence between ceasing to be a sleeper and looking at what is left
    /// behind.
    FENCE_LEAVE = SeqCst;
    /// Sequentially consistent fence between putting the shared renderer back and looking for what to render.
    FENCE_PUT_BACK = SeqCst;
    /// Relaxed: how many tokens or readers are left; re-validated by the CAS that follows.
    COUNT_LOOK = Relaxed;
    /// Acquire and Release: a returned token's last use is before its reissue. Its renderer moves within it.
    TOKEN_COUNT = AcqRel;
    /// Relaxed: a hint, and the CAS after it decides; or looked at after `FENCE_SLEEP`, as queues are.
    SHARED_LOOK = Relaxed;
    /// Acquire: pairs with `SHARED_PUT`.
    SHARED_TAKE = Acquire;
    /// Release: the shared renderer moves on to whoever takes it next.
    SHARED_PUT = Release;
    /// Acquire and Release: a new reader enters after the one whose place it takes has left, so
    /// that the writer, who sees it enter, sees the other's slot free.
    READERS_COUNT = AcqRel;
    /// Acquire and Release: a reader enters the newest slot; the writer learns who is inside.
    LATEST_ENTER = AcqRel;
    /// Relaxed: only compares indices, to skip `LATEST_ENTER`; the slot was acquired before.
    LATEST_LOOK = Relaxed;
    /// Acquire and Release: publishes the new value, collects the readers of the old one.
    LATEST_PUBLISH = AcqRel;
    /// Release: the reader is done with the slot before the writer reuses it.
    LATEST_LEAVE = Release;
    /// Acquire: pairs with `LATEST_LEAVE`.
    LATEST_REUSE = Acquire;
    /// Relaxed: one exchange succeeds, ever, and nothing was written before it that whoever has the
    /// reference does not see already.
    STATIC_TAKE = Relaxed;
}

macro_rules! atomic {
    ($(#[$doc:meta])* $name:ident, $imp:ident, $int:ty) => {
        $(#[$doc])*
        #[derive(Debug)]
        pub(crate) struct $name(imp::$imp);

        #[allow(dead_code, reason = "one set of accesses for both widths")]
        impl $name {
            const_fn! {
                pub(crate) const fn new(value: $int) -> Self {
                    Self(imp::$imp::new(value))
                }
            }
            #[inline(always)]
            pub(crate) fn load(&self, site: Site) -> $int {
                self.0.load(site.effective(Access::Load, &self.0))
            }
            #[inline(always)]
            pub(crate) fn store(&self, value: $int, site: Site) {
                self.0.store(value, site.effective(Access::Store, &self.0));
            }
            #[inline(always)]
            pub(crate) fn swap(&self, value: $int, site: Site) -> $int {
                self.0.swap(value, site.effective(Access::Exchange, &self.0))
            }
            #[inline(always)]
            pub(crate) fn fetch_add(&self, value: $int, site: Site) -> $int {
                self.0.fetch_add(value, site.effective(Access::Exchange, &self.0))
            }
            #[inline(always)]
            pub(crate) fn fetch_sub(&self, value: $int, site: Site) -> $int {
                self.0.fetch_sub(value, site.effective(Access::Exchange, &self.0))
            }
            /// On failure the value found is only a hint for the retry, hence Relaxed.
            #[inline(always)]
            pub(crate) fn exchange(&self, old: $int, new: $int, site: Site) -> Result<$int, $int> {
                let order = site.effective(Access::Exchange, &self.0);
                let outcome = self.0.compare_exchange(old, new, order, Ordering::Relaxed);
                #[cfg(loom)]
                if outcome.is_err() {
                    crate::instrument::retried();
                }
                outcome
            }
        }
    };
}

atomic!(/// 32 bits: counters, tags, links: what a unit or a slot carries.
    Atomic, AtomicU32, u32);
atomic!(/// A machine word: the ring's cells (cycle and index) and positions.
    AtomicWord, AtomicUsize, usize);

/// A fence whose order is a named site.
#[inline(always)]
pub(crate) fn fence(site: Site) {
    let order = site.effective(Access::Fence, &());
    // A mutant may turn the fence off; Relaxed is no valid order for one.
    if order != Ordering::Relaxed {
        imp::fence(order);
    }
}

/// Says inside a retry loop that another thread has to move first.
#[inline(always)]
pub(crate) fn spin_hint() {
    #[cfg(loom)]
    crate::instrument::retried();
    #[cfg(loom)]
    loom::hint::spin_loop();
    #[cfg(shuttle)]
    shuttle::hint::spin_loop();
    #[cfg(not(any(loom, shuttle)))]
    ::core::hint::spin_loop();
}

/// Interior memory whose exclusive and shared lends the protocol guarantees and loom watches.
#[derive(Debug)]
pub(crate) struct Cell<T>(
    #[cfg(loom)] loom::cell::UnsafeCell<T>,
    #[cfg(not(loom))] ::core::cell::UnsafeCell<T>,
);

// SAFETY: the protocol lends the content either shared (needs `Sync`) or exclusively (needs
// `Send`); each lend is a call of `with` or `with_mut`, whose callers state why it is allowed.
unsafe impl<T: Send + Sync> Sync for Cell<T> {}

impl<T> Cell<T> {
    const_fn! {
        pub(crate) const fn new(value: T) -> Self {
            #[cfg(loom)]
            return Self(loom::cell::UnsafeCell::new(value));
            #[cfg(not(loom))]
            return Self(::core::cell::UnsafeCell::new(value));
        }
    }

    /// Lends the content read-only.
    ///
    /// # Safety
    /// Nobody may have it exclusively until `f` returns.
    #[inline(always)]
    pub(crate) unsafe fn with<R>(&self, f: impl FnOnce(&T) -> R) -> R {
        #[cfg(loom)]
        // SAFETY: the caller's promise; loom checks it.
        return self.0.with(|p| f(unsafe { &*p }));
        #[cfg(not(loom))]
        // SAFETY: the caller's promise.
        return f(unsafe { &*self.0.get() });
    }

    /// Lends the content exclusively.
    ///
    /// # Safety
    /// Nobody else may have it, shared or exclusively, until `f` returns.
    #[inline(always)]
    pub(crate) unsafe fn with_mut<R>(&self, f: impl FnOnce(&mut T) -> R) -> R {
        #[cfg(loom)]
        // SAFETY: the caller's promise; loom checks it.
        return self.0.with_mut(|p| f(unsafe { &mut *p }));
        #[cfg(not(loom))]
        // SAFETY: the caller's promise.
        return f(unsafe { &mut *self.0.get() });
    }

    /// The content, by exclusive access to the cell itself.
    pub(crate) fn get_mut(&mut self) -> &mut T {
        #[cfg(loom)]
        // SAFETY: `&mut self` excludes every other lend.
        return self.0.with_mut(|p| unsafe { &mut *p });
        #[cfg(not(loom))]
        return self.0.get_mut();
    }

    /// Takes the content out of a cell that is owned.
    pub(crate) fn into_inner(self) -> T {
        self.0.into_inner()
    }
}
