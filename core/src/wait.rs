//! Waiting without missing a wake-up, and without burning a core.
//!
//! The core waits for nobody by itself: a host says through [`Waiting`] how a worker sleeps
//! (spin, WFE/SEV, a futex, a condition variable) and the bells here make it sound. A sleeper
//! announces itself, fences, and looks for work again; a worker that queued work fences and looks
//! for sleepers. Of two fences one is first, so one of the two sees the other.

use crate::sync::{Atomic, CachePadded, fence, seeded, site};

/// How a host's workers sleep and are woken.
///
/// With threads, a condition variable for each bell:
///
/// ```
/// use dualframe_core::wait::{Bell, Epoch, Waiting};
/// use std::sync::{Condvar, Mutex, PoisonError};
///
/// #[derive(Default)]
/// struct Park {
///     lock: Mutex<()>,
///     rung: [Condvar; 2],
/// }
///
/// impl Waiting for Park {
///     fn sleep(&self, bell: &Bell, seen: Epoch) {
///         let rung = &self.rung[usize::from(bell.is_for_holders())];
///         let lock = self.lock.lock().unwrap_or_else(PoisonError::into_inner);
///         let woken = rung.wait_while(lock, |()| !bell.rung_since(seen));
///         drop(woken.unwrap_or_else(PoisonError::into_inner));
///     }
///
///     fn wake(&self, bell: &Bell, count: u32) {
///         // Whoever did not see the ring yet waits for its notice once the lock can be had.
///         drop(self.lock.lock().unwrap_or_else(PoisonError::into_inner));
///         let rung = &self.rung[usize::from(bell.is_for_holders())];
///         (0..count).for_each(|_| rung.notify_one());
///     }
/// }
/// ```
pub trait Waiting: Sync {
    /// Returns once `bell` has been rung past `seen`; may return earlier.
    fn sleep(&self, bell: &Bell, seen: Epoch);

    /// Wakes at least `count` of the workers that sleep on `bell`, or all if they are fewer; to wake more does no
    /// harm. Called after the bell's epoch moved on.
    fn wake(&self, bell: &Bell, count: u32);
}

/// Waits by looking again and again: for a host that has a core to itself for each worker. One that steps several in
/// turn on one core, or one of them in an interrupt above others, must not let any of them
/// [wait](crate::worker::Worker::wait) in this way: who could ring is never reached.
#[derive(Clone, Copy, Debug, Default)]
pub struct Spin;

impl Waiting for Spin {
    fn sleep(&self, bell: &Bell, seen: Epoch) {
        while !bell.rung_since(seen) {
            crate::sync::spin_hint();
        }
    }

    fn wake(&self, _: &Bell, _: u32) {}
}

impl<W: Waiting + ?Sized> Waiting for &W {
    fn sleep(&self, bell: &Bell, seen: Epoch) {
        (**self).sleep(bell, seen);
    }

    fn wake(&self, bell: &Bell, count: u32) {
        (**self).wake(bell, count);
    }
}

/// How often a bell had been rung.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Epoch(u32);

/// What sleeping workers listen to. Token holders have their own, so that a call to render never
/// wakes a worker that cannot. (A shared renderer is anybody's: who is called for it may find it taken.)
#[derive(Debug)]
pub struct Bell {
    epoch: CachePadded<Atomic>,
    sleepers: CachePadded<Atomic>,
    for_holders: bool,
}

impl Bell {
    pub(crate) fn new(for_holders: bool) -> Self {
        Self {
            epoch: CachePadded::new(Atomic::new(0)),
            sleepers: CachePadded::new(Atomic::new(0)),
            for_holders,
        }
    }

    /// Whether the token's holders listen to this bell, or all other workers.
    pub fn is_for_holders(&self) -> bool {
        self.for_holders
    }

    /// Whether the bell was rung after `seen` was taken.
    #[inline]
    pub fn rung_since(&self, seen: Epoch) -> bool {
        self.epoch.load(site::BELL_EPOCH_CHECK) != seen.0
    }

    /// Sleeps unless `look` still finds work after the announcement.
    pub(crate) fn sleep_unless(&self, waiting: &impl Waiting, look: impl FnOnce() -> bool) {
        let _announced = Announced::at(self);
        let mut seen = Epoch(self.epoch.load(site::BELL_EPOCH_SEEN));
        fence(site::FENCE_SLEEP);
        if !look() {
            if seeded!(EpochNotedLate) {
                seen = Epoch(self.epoch.load(site::BELL_EPOCH_SEEN));
            }
            waiting.sleep(self, seen);
        }
    }

    /// Wakes up to `count` sleepers and returns how many there were to wake. The caller has
    /// fenced with `FENCE_RING` since it queued the work.
    pub(crate) fn ring(&self, waiting: &impl Waiting, count: u32) -> u32 {
        let woken = self.sleepers.load(site::BELL_SLEEPERS_LOOK).min(count);
        if woken > 0 {
            self.epoch.fetch_add(1, site::BELL_EPOCH_RING);
            waiting.wake(self, woken);
        }
        woken
    }
}

/// A sleeper, counted at its bell; no longer when it wakes, or its host's way of sleeping panics.
struct Announced<'b>(&'b Bell);

impl<'b> Announced<'b> {
    fn at(bell: &'b Bell) -> Self {
        bell.sleepers.fetch_add(1, site::BELL_ANNOUNCE);
        Self(bell)
    }
}

impl Drop for Announced<'_> {
    fn drop(&mut self) {
        self.0.sleepers.fetch_sub(1, site::BELL_ANNOUNCE);
    }
}

/// The two bells of a pipeline.
#[derive(Debug)]
pub(crate) struct Bells {
    pub(crate) holders: Bell,
    pub(crate) others: Bell,
    /// Workers whose last step found nothing to do, awake or asleep.
    hungry: CachePadded<Atomic>,
}

impl Bells {
    pub(crate) fn new() -> Self {
        let hungry = CachePadded::new(Atomic::new(0));
        Self { holders: Bell::new(true), others: Bell::new(false), hungry }
    }

    /// Whether some worker found nothing to do: a hint, so that others queue what they carry.
    #[inline]
    pub(crate) fn somebody_is_hungry(&self) -> bool {
        self.hungry.load(site::HUNGRY) != 0
    }

    /// One more worker, or one less, finds nothing to do.
    pub(crate) fn count_hungry(&self, hungry: bool) {
        if hungry {
            self.hungry.fetch_add(1, site::HUNGRY);
        } else {
            self.hungry.fetch_sub(1, site::HUNGRY);
        }
    }

    /// Nobody is hungry: by exclusive access no worker is left, though one that was forgotten may be counted still.
    pub(crate) fn forget_hunger(&mut self) {
        self.hungry.store(0, site::EXCLUSIVE);
    }

    /// Announces `any` work units that every worker can do, and `renders` that only holders can.
    ///
    /// As many sleepers are woken at once as there is work for, not one by one in a chain (where a frame opens as many as
    /// there are units, though some of those may turn out to wait for more); a holder only for what the others are too few
    /// for, or to render. Who was woken before and is not awake yet
    /// counts as a sleeper still: a holder may then come late, but what there is to do waits in a queue.
    pub(crate) fn announce(&self, waiting: &impl Waiting, any: u32, renders: u32) {
        fence(site::FENCE_RING);
        let any = if seeded!(RenderingCallsAnyone) { any.saturating_add(renders) } else { any };
        let others = if any > 0 { self.others.ring(waiting, any) } else { 0 };
        let for_holders = any - others + renders;
        if for_holders > 0 {
            self.holders.ring(waiting, for_holders);
        }
    }
}

#[cfg(all(test, not(loom)))]
mod tests {
    use super::*;
    use std::sync::Mutex;
    use std::{vec, vec::Vec};

    /// Notes on which bell somebody is to sleep, and how many are to be woken. The holders' bell is `true`.
    #[derive(Default)]
    struct Notes {
        slept: Mutex<Vec<bool>>,
        woken: Mutex<Vec<(bool, u32)>>,
    }

    impl Waiting for Notes {
        fn sleep(&self, bell: &Bell, _: Epoch) {
            self.slept.lock().unwrap_or_else(|poison| poison.into_inner()).push(bell.for_holders);
        }

        fn wake(&self, bell: &Bell, count: u32) {
            let mut woken = self.woken.lock().unwrap_or_else(|poison| poison.into_inner());
            woken.push((bell.is_for_holders(), count));
        }
    }

    impl Notes {
        fn slept(self) -> Vec<bool> {
            self.slept.into_inner().unwrap_or_default()
        }

        fn woken(self) -> Vec<(bool, u32)> {
            self.woken.into_inner().unwrap_or_default()
        }
    }

    /// Who is woken for `any` work units and `renders`, while so many holders and others sleep.
    fn woken(holders: u32, others: u32, any: u32, renders: u32) -> Vec<(bool, u32)> {
        let (bells, notes) = (Bells::new(), Notes::default());
        bells.holders.sleepers.fetch_add(holders, site::BELL_ANNOUNCE);
        bells.others.sleepers.fetch_add(others, site::BELL_ANNOUNCE);
        bells.announce(&notes, any, renders);
        notes.woken()
    }

    #[test]
    fn as_many_are_woken_as_there_is_work_for() {
        assert_eq!(woken(1, 3, 2, 0), [(false, 2)]);
        assert_eq!(woken(3, 1, 3, 0), [(false, 1), (true, 2)], "the others are too few");
        assert_eq!(woken(2, 3, 0, 1), [(true, 1)], "only holders can render");
        assert_eq!(woken(3, 3, 2, 1), [(false, 2), (true, 1)]);
        assert_eq!(woken(3, 0, 1, 1), [(true, 2)]);
        assert_eq!(woken(1, 1, 9, 9), [(false, 1), (true, 1)]);
        assert_eq!(woken(0, 0, 9, 9), [], "nobody sleeps");
    }

    #[test]
    fn who_finds_work_does_not_sleep() {
        for finds in [false, true] {
            let (bell, notes) = (Bell::new(true), Notes::default());
            let mut looked = false;
            bell.sleep_unless(&notes, || {
                looked = true;
                finds
            });
            assert!(looked);
            assert_eq!(bell.ring(&notes, 1), 0, "nobody is a sleeper any more");
            assert_eq!(notes.slept(), if finds { vec![] } else { vec![true] });
        }
    }

    #[test]
    fn who_was_called_meanwhile_does_not_sleep() {
        let bell = Bell::new(false);
        // Comes back at all: the bell is rung between the look for work and the sleep.
        bell.sleep_unless(&Spin, || {
            assert_eq!(bell.ring(&Spin, 3), 1, "one listens");
            false
        });
    }

    #[test]
    fn whose_sleep_panics_is_no_sleeper() {
        struct Restless;
        impl Waiting for Restless {
            fn sleep(&self, _: &Bell, _: Epoch) {
                panic!("the host's");
            }

            fn wake(&self, _: &Bell, _: u32) {}
        }
        let bell = Bell::new(false);
        let sleep = || bell.sleep_unless(&Restless, || false);
        assert!(std::panic::catch_unwind(std::panic::AssertUnwindSafe(sleep)).is_err());
        assert_eq!(bell.ring(&Restless, 1), 0);
    }

    #[test]
    fn a_reference_waits_like_what_it_refers_to() {
        let (bell, notes) = (Bell::new(true), Notes::default());
        Waiting::sleep(&&notes, &bell, Epoch(0));
        Waiting::wake(&&notes, &bell, 5);
        assert_eq!((notes.slept(), bell.rung_since(Epoch(0))), (vec![true], false));
        let notes = Notes::default();
        Waiting::wake(&&notes, &bell, 5);
        assert_eq!(notes.woken(), [(true, 5)]);
    }
}
