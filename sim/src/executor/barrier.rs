//! A barrier that spins for a moment and then sleeps.

use std::sync::atomic::{AtomicUsize, Ordering};
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
    pub(super) fn wait(&self) {
        let generation = self.generation.load(Ordering::Acquire);
        self.arrive();
        for _ in 0..self.spins {
            if self.generation.load(Ordering::Acquire) != generation {
                return;
            }
            std::hint::spin_loop();
        }
        let mut guard = self.sleep.lock().unwrap_or_else(PoisonError::into_inner);
        while self.generation.load(Ordering::Acquire) == generation {
            guard = self.woken.wait(guard).unwrap_or_else(PoisonError::into_inner);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nobody_passes_before_the_last_arrives() {
        const THREADS: usize = 3;
        let barrier = Barrier::new(THREADS);
        let entered = AtomicUsize::new(0);
        std::thread::scope(|scope| {
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
