//! The thread pool of the pipeline (§6.1): how many workers there are, and how they sleep.

use std::num::NonZero;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use core_affinity::CoreId;
use dualframe_core::environment::Environment;
use dualframe_core::probe::Probe;
use dualframe_core::wait::{Bell, Epoch, Waiting};
use dualframe_core::worker::Worker;

use crate::executor::MAX_THREADS;

/// How long a worker without work looks for some before it sleeps. Usually 50 µs: about what it
/// costs to put a thread to sleep and to wake it again.
const SPIN: Duration = Duration::from_micros(50);

/// How long a worker looks for the next batch of a run before it sleeps. Usually 2 ms: longer than it takes to form the
/// blocks of thousands of objects anew, for who sleeps then is woken by the thread that has formed them, one after the
/// other, while all others wait.
const SPIN_BETWEEN: Duration = Duration::from_millis(2);

/// The number of cores that this process may use, as the system counts them: each hardware thread is one.
#[must_use]
pub fn cores() -> usize {
    std::thread::available_parallelism().map_or(1, NonZero::get)
}

/// How many workers a pipeline has. It may be changed at any time, from any thread: workers beyond
/// the number leave after the work unit in hand, further ones join within
/// [`crate::blocking::FRAMES_PER_BLOCKING`] frames, and more of them than ever before get blocks of their own.
#[derive(Debug)]
pub struct Pool {
    threads: AtomicUsize,
    /// The cores that threads are bound to, if they are.
    pinned_to: Vec<CoreId>,
    cores: usize,
}

impl Pool {
    /// A pool of so many threads, the calling one included, 1 to [`MAX_THREADS`]; others are taken
    /// for the nearest.
    ///
    /// `pinned` binds the hired threads to the cores that this process may use, one after the other from the second on;
    /// the calling thread is left to the system, and may be on any. With more threads than cores the first core has one
    /// too, and then cores have several. Where the system cannot bind a thread, or does not say what cores there are,
    /// the thread is left to it, and nobody is told.
    #[must_use]
    pub fn new(threads: usize, pinned: bool) -> Self {
        let threads = AtomicUsize::new(threads.clamp(1, MAX_THREADS));
        let pinned_to = pinned.then(core_affinity::get_core_ids).flatten().unwrap_or_default();
        Self { threads, pinned_to, cores: cores() }
    }

    /// The number of threads asked for.
    pub fn threads(&self) -> usize {
        // Relaxed: the number orders nothing; a worker that sees it late leaves late.
        self.threads.load(Ordering::Relaxed)
    }

    /// Asks for another number of threads, 1 to [`MAX_THREADS`].
    pub fn resize(&self, threads: usize) {
        self.threads.store(threads.clamp(1, MAX_THREADS), Ordering::Relaxed);
    }

    /// Binds the calling thread, which is worker number `index`, to a core.
    pub(crate) fn pin(&self, index: usize) {
        // A system that cannot pin, or does not say what cores there are, is as good without.
        if !self.pinned_to.is_empty() {
            core_affinity::set_for_current(self.pinned_to[index % self.pinned_to.len()]);
        }
    }

    /// Looks for a cause to stop waiting, as long as that is cheaper than to sleep. `false` if
    /// there was none.
    pub(crate) fn spin(&self, has_cause: impl FnMut() -> bool) -> bool {
        self.spin_for(SPIN, has_cause)
    }

    fn spin_for(&self, time: Duration, mut has_cause: impl FnMut() -> bool) -> bool {
        // With fewer cores than threads looking takes the core from somebody who works.
        if self.threads() > self.cores {
            return false;
        }
        let began = Instant::now();
        while began.elapsed() < time {
            if has_cause() {
                return true;
            }
            std::hint::spin_loop();
        }
        false
    }
}

/// Where workers sleep, and what they wait for between runs.
#[derive(Debug, Default)]
pub(crate) struct Crew {
    holders: Room,
    others: Room,
    /// A run failed, or its host panicked: everybody leaves.
    aborted: AtomicBool,
    phase: Mutex<Phase>,
    changed: Condvar,
    /// `Phase` once more, to look at without the lock.
    run: AtomicUsize,
    present: AtomicUsize,
    closed: AtomicBool,
}

#[derive(Debug, Default)]
struct Room {
    door: Mutex<()>,
    bell: Condvar,
}

#[derive(Debug, Default)]
struct Phase {
    /// Counts runs; 0 before the first.
    run: usize,
    /// Threads that have reported for work.
    present: usize,
    /// Threads that sleep until any of this changes.
    asleep: usize,
    closed: bool,
}

/// Nothing behind these locks can be left half done.
fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Room {
    fn wake(&self, count: u32) {
        // Whoever looked at the bell before it was rung is in the condition variable by now.
        drop(lock(&self.door));
        if count == 1 { self.bell.notify_one() } else { self.bell.notify_all() }
    }
}

impl Crew {
    /// Starts the next run: wakes the workers that wait for one.
    pub(crate) fn start(&self) {
        let mut phase = lock(&self.phase);
        phase.run += 1;
        // Release: with the Acquire in `await_run`; the pipeline itself is behind its own lock.
        self.run.store(phase.run, Ordering::Release);
        self.announce(phase);
    }

    /// Wakes whoever sleeps until something changes, which it has.
    fn announce(&self, phase: MutexGuard<'_, Phase>) {
        let asleep = phase.asleep;
        drop(phase);
        if asleep > 0 {
            self.changed.notify_all();
        }
    }

    /// Sleeps until something changes.
    fn sleep_on<'p>(&self, mut phase: MutexGuard<'p, Phase>) -> MutexGuard<'p, Phase> {
        phase.asleep += 1;
        phase = self.changed.wait(phase).unwrap_or_else(PoisonError::into_inner);
        phase.asleep -= 1;
        phase
    }

    /// Waits until a run after number `last` starts and returns its number; `None` to leave.
    pub(crate) fn await_run(&self, last: usize, pool: &Pool, index: usize) -> Option<usize> {
        let wanted = || index < pool.threads();
        let run = || self.run.load(Ordering::Acquire);
        // Acquire: with the Release in `close`; nothing else is read by it.
        let closed = || self.closed.load(Ordering::Acquire);
        if pool.spin_for(SPIN_BETWEEN, || run() != last && wanted() || closed()) {
            return (!closed()).then(run);
        }
        let mut phase = lock(&self.phase);
        loop {
            if phase.closed {
                return None;
            }
            if phase.run != last && wanted() {
                return Some(phase.run);
            }
            phase = self.sleep_on(phase);
        }
    }

    /// A hired thread is ready: it has taken the memory that it needs.
    pub(crate) fn report(&self) {
        let mut phase = lock(&self.phase);
        phase.present += 1;
        // Release: with the Acquire in `await_present`, which need not see more than the number.
        self.present.store(phase.present, Ordering::Release);
        self.announce(phase);
    }

    /// Waits until so many hired threads are ready.
    pub(crate) fn await_present(&self, hired: usize, pool: &Pool) {
        if pool.spin(|| self.present.load(Ordering::Acquire) >= hired) {
            return;
        }
        let mut phase = lock(&self.phase);
        while phase.present < hired {
            phase = self.sleep_on(phase);
        }
    }

    /// A hired thread goes home.
    pub(crate) fn leave(&self) {
        let mut phase = lock(&self.phase);
        phase.present -= 1;
        // Release: as in `report`, with the Acquire in `see_off`.
        self.present.store(phase.present, Ordering::Release);
    }

    /// Sends everybody home.
    pub(crate) fn close(&self) {
        let mut phase = lock(&self.phase);
        phase.closed = true;
        self.closed.store(true, Ordering::Release);
        self.announce(phase);
    }

    /// Waits until everybody who was sent home has gone, unless that takes so long that the caller had
    /// better sleep.
    pub(crate) fn see_off(&self, pool: &Pool) {
        pool.spin(|| self.present.load(Ordering::Acquire) == 0);
    }

    /// Makes everybody leave the run under way.
    pub(crate) fn abort(&self) {
        // Release: with the Acquire in `is_aborted`.
        self.aborted.store(true, Ordering::Release);
        self.holders.wake(u32::MAX);
        self.others.wake(u32::MAX);
    }

    pub(crate) fn is_aborted(&self) -> bool {
        self.aborted.load(Ordering::Acquire)
    }

    fn room(&self, bell: &Bell) -> &Room {
        if bell.is_for_holders() { &self.holders } else { &self.others }
    }

    /// Waits for work, for the end of the run or for an order to leave.
    pub(crate) fn idle<E: Environment, P: Probe>(
        &self,
        pool: &Pool,
        worker: &Worker<'_, '_, E, &Self, P>,
    ) {
        if !pool.spin(|| worker.has_cause_to_wake() || self.is_aborted()) {
            worker.wait();
        }
    }
}

impl Waiting for Crew {
    fn sleep(&self, bell: &Bell, seen: Epoch) {
        let room = self.room(bell);
        let mut door = lock(&room.door);
        while !bell.rung_since(seen) && !self.is_aborted() {
            door = room.bell.wait(door).unwrap_or_else(PoisonError::into_inner);
        }
    }

    fn wake(&self, bell: &Bell, count: u32) {
        self.room(bell).wake(count);
    }
}
