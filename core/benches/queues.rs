//! The core's ring of indices and queues it could have been: one pop and one push of a queue that is
//! half full, by several threads at once.

use std::collections::VecDeque;
use std::sync::{Mutex, MutexGuard, PoisonError};

use concurrent_queue::ConcurrentQueue;
use crossbeam_queue::ArrayQueue;
use divan::Bencher;
use dualframe_core::ring::{IndexRing, QueueSlot};

/// Room in each queue.
const SLOTS: usize = 128;
/// Indices that go round.
const INDICES: u32 = SLOTS as u32 / 2;

fn main() {
    divan::main();
}

/// A queue with room for [`SLOTS`] indices.
trait Queue: Sync {
    fn new() -> Self;
    fn push(&self, index: u32);
    fn pop(&self) -> Option<u32>;
}

// Samples of some ten milliseconds, so that threads that do not start together still meet.
#[divan::bench(
    types = [Core, Crossbeam, Heapless, Concurrent, Locked],
    threads = [1, 2, 4],
    sample_count = 20,
    sample_size = 2_000_000,
)]
fn pop_and_push<Q: Queue>(bencher: Bencher<'_, '_>) {
    let queue = Q::new();
    (0..INDICES).for_each(|index| queue.push(index));
    bencher.bench(|| {
        // It never is empty, but some queues say so while another thread is suspended inside.
        let index = loop {
            if let Some(index) = queue.pop() {
                break index;
            }
            std::hint::spin_loop();
        };
        queue.push(index);
    });
}

struct Core(IndexRing<'static>);

impl Queue for Core {
    fn new() -> Self {
        // Leaked: a ring borrows its memory, and a benchmark ends soon.
        let slots: Vec<_> = (0..SLOTS).map(|_| QueueSlot::new()).collect();
        Self(IndexRing::new(slots.leak()).expect("slots"))
    }

    fn push(&self, index: u32) {
        self.0.push(index).expect("an index below the slots");
    }

    fn pop(&self) -> Option<u32> {
        self.0.pop()
    }
}

struct Crossbeam(ArrayQueue<u32>);

impl Queue for Crossbeam {
    fn new() -> Self {
        Self(ArrayQueue::new(SLOTS))
    }

    fn push(&self, index: u32) {
        // A push can be refused while another thread's pop is half done.
        while self.0.push(index).is_err() {
            std::hint::spin_loop();
        }
    }

    fn pop(&self) -> Option<u32> {
        self.0.pop()
    }
}

/// What the core would use if it were lock-free.
struct Heapless(heapless::mpmc::Queue<u32, SLOTS>);

#[expect(deprecated, reason = "for not being lock-free, which is no matter here")]
impl Queue for Heapless {
    fn new() -> Self {
        Self(heapless::mpmc::Queue::new())
    }

    fn push(&self, index: u32) {
        // As crossbeam's.
        while self.0.enqueue(index).is_err() {
            std::hint::spin_loop();
        }
    }

    fn pop(&self) -> Option<u32> {
        self.0.dequeue()
    }
}

struct Concurrent(ConcurrentQueue<u32>);

impl Queue for Concurrent {
    fn new() -> Self {
        Self(ConcurrentQueue::bounded(SLOTS))
    }

    fn push(&self, index: u32) {
        // As crossbeam's.
        while self.0.push(index).is_err() {
            std::hint::spin_loop();
        }
    }

    fn pop(&self) -> Option<u32> {
        self.0.pop().ok()
    }
}

/// A ring behind a lock; it never grows.
struct Locked(Mutex<VecDeque<u32>>);

impl Locked {
    fn lock(&self) -> MutexGuard<'_, VecDeque<u32>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Queue for Locked {
    fn new() -> Self {
        Self(Mutex::new(VecDeque::with_capacity(SLOTS)))
    }

    fn push(&self, index: u32) {
        self.lock().push_back(index);
    }

    fn pop(&self) -> Option<u32> {
        self.lock().pop_front()
    }
}
