//! A barrier that spins for a moment and then sleeps.

use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Condvar, Mutex, PoisonError};
use std::thread::available_parallelism;

/// How often a thread looks before it goes to sleep: some tens of microseconds, about a stage's tail; on
/// processors that take long to pause, up to 200.
const SPINS: u32 = 4_000;

/// A barrier for a fixed number of threads, to be used again and again.
#[derive(Debug)]
pub(super) struct Barrier {
    threads: usize,
    spins: u32,
    arrived: AtomicUsize,
    generation: AtomicUsize,
    broken: AtomicBool,
    sleep: Mutex<()>,
    woken: Condvar,
}

impl Barrier {
    pub(super) fn new(threads: usize) -> Self {
        // Where processors are fewer, whoever spins keeps those from running that are waited for.
        let processors = available_parallelism().map_or(1, usize::from);
        Self {
            threads,
            spins: if threads > processors { 0 } else { SPINS },
            arrived: AtomicUsize::new(0),
            generation: AtomicUsize::new(0),
            broken: AtomicBool::new(false),
            sleep: Mutex::new(()),
            woken: Condvar::new(),
        }
    }

    /// Counts as a thread that is here, without waiting for the others.
    pub(super) fn arrive(&self) {
        if self.arrived.fetch_add(1, Ordering::AcqRel) + 1 == self.threads {
            self.arrived.store(0, Ordering::Relaxed);
            // Under the lock, so that nobody is between looking and falling asleep.
            let guard = self.sleep.lock().unwrap_or_else(PoisonError::into_inner);
            self.generation.fetch_add(1, Ordering::Release);
            drop(guard);
            self.woken.notify_all();
        }
    }

    /// Waits until all threads are here.
    ///
    /// # Panics
    /// The barrier is broken: somebody will never be here.
    pub(super) fn wait(&self) {
        let generation = self.generation.load(Ordering::Acquire);
        let waits = || self.generation.load(Ordering::Acquire) == generation && !self.is_broken();
        self.arrive();
        let mut spins = self.spins;
        while waits() && spins > 0 {
            spins -= 1;
            std::hint::spin_loop();
        }
        if waits() {
            let mut guard = self.sleep.lock().unwrap_or_else(PoisonError::into_inner);
            while waits() {
                guard = self.woken.wait(guard).unwrap_or_else(PoisonError::into_inner);
            }
        }
        assert!(!self.is_broken(), "another thread has panicked");
    }

    /// Lets everybody who waits, now or later, panic.
    pub(super) fn break_off(&self) {
        // Under the lock, as in `arrive`. Release: with the Acquire in `is_broken`; nothing else is read by it.
        let guard = self.sleep.lock().unwrap_or_else(PoisonError::into_inner);
        self.broken.store(true, Ordering::Release);
        drop(guard);
        self.woken.notify_all();
    }

    pub(super) fn is_broken(&self) -> bool {
        self.broken.load(Ordering::Acquire)
    }
}

#[cfg(test)]
mod tests {
    use std::thread;

    use super::*;
    use crate::executor::on_panic::OnPanic;

    #[test]
    fn nobody_waits_for_who_has_panicked() {
        let barrier = Barrier::new(3);
        thread::scope(|scope| {
            let waits = || scope.spawn(|| barrier.wait());
            let waiting = [waits(), waits()];
            let panics = scope.spawn(|| {
                let _guard = OnPanic::new(|| barrier.break_off());
                panic!("on purpose");
            });
            assert!(panics.join().is_err());
            assert!(waiting.into_iter().all(|thread| thread.join().is_err()));
        });
        assert!(barrier.is_broken());
    }

    #[test]
    fn nobody_passes_before_the_last_arrives() {
        const THREADS: usize = 3;
        let barrier = Barrier::new(THREADS);
        let entered = AtomicUsize::new(0);
        thread::scope(|scope| {
            for _ in 0..THREADS {
                scope.spawn(|| {
                    for round in 1..=200 {
                        entered.fetch_add(1, Ordering::Relaxed);
                        barrier.wait();
                        assert_eq!(entered.load(Ordering::Relaxed), round * THREADS);
                        barrier.wait();
                    }
                });
            }
        });
    }
}
