//! The index ring: nothing lost, nothing doubled, data published, an earlier push never missed.

use super::{Guarded, Model, Role, check, lend, lend_slice, together};
use dualframe_core_model::ring::{IndexRing, QueueSlot};
use loom::sync::atomic::{AtomicBool, Ordering};

pub(crate) const ALL: &[Model] = &[
    ("ring::hand_over", hand_over::<IndexRing<'static>>),
    ("ring::earlier_push_is_found", earlier_push_is_found::<IndexRing<'static>>),
    ("ring::two_producers", two_producers::<IndexRing<'static>>),
    ("ring::one_slot_laps", one_slot_laps::<IndexRing<'static>>),
    ("ring::two_slot_laps", two_slot_laps::<IndexRing<'static>>),
    ("ring::two_consumers", two_consumers::<IndexRing<'static>>),
];

/// What the models ask of a queue, so that a broken one can take the ring's place.
pub(crate) trait Queue: 'static {
    /// An empty queue for `indices` indices.
    fn make(indices: usize) -> Self;
    /// Appends.
    fn push(&self, index: u32);
    /// Takes the oldest.
    fn pop(&self) -> Option<u32>;
    /// Whether it looks empty; a queue that has no such hint never does.
    fn looks_empty(&self) -> bool {
        false
    }
}

impl Queue for IndexRing<'static> {
    fn make(indices: usize) -> Self {
        Self::new(lend_slice(indices, |_| QueueSlot::new())).unwrap()
    }

    fn push(&self, index: u32) {
        IndexRing::push(self, index).unwrap();
    }

    fn pop(&self) -> Option<u32> {
        IndexRing::pop(self)
    }

    fn looks_empty(&self) -> bool {
        IndexRing::looks_empty(self)
    }
}

fn cells(count: usize) -> &'static [Guarded<u32>] {
    lend_slice(count, |_| Guarded::new(0))
}

/// One producer, one consumer: what is popped was written. Small and unbounded.
pub(crate) fn hand_over<Q: Queue>() {
    check("ring::hand_over", None, 2, [None, Some(0)], |order| {
        let (queue, data) = (&*lend(Q::make(1)), cells(1));
        let producer: Role<_> = Box::new(move || {
            data[0].set(7);
            queue.push(0);
            None
        });
        let consumer: Role<_> = Box::new(move || {
            let index = queue.pop();
            assert!(index.is_none_or(|index| data[index as usize].get() == 7));
            index
        });
        together(order, vec![producer, consumer])[1]
    });
}

/// Two producers and a consumer that pops twice: it sees any of the seven possible sequences, no
/// other; nothing is lost or doubled, and what an index guards is there when it is popped.
pub(crate) fn two_producers<Q: Queue>() {
    let expected = [
        [None, None],
        [None, Some(0)],
        [None, Some(1)],
        [Some(0), None],
        [Some(1), None],
        [Some(0), Some(1)],
        [Some(1), Some(0)],
    ];
    check("ring::two_producers", Some(3), 3, expected, |order| {
        let (queue, data) = (&*lend(Q::make(2)), cells(2));
        let producer = move |index: u32| -> Role<[Option<u32>; 2]> {
            Box::new(move || {
                data[index as usize].set(10 + index);
                queue.push(index);
                [None, None]
            })
        };
        let consumer = Box::new(move || {
            [(), ()].map(|()| {
                let index = queue.pop();
                assert!(index.is_none_or(|index| data[index as usize].get() == 10 + index));
                index
            })
        });
        let seen = together(order, vec![producer(0), producer(1), consumer])[2];
        let mut all: Vec<u32> = seen.into_iter().flatten().collect();
        all.extend(std::iter::from_fn(|| queue.pop()));
        all.sort_unstable();
        assert_eq!(all, [0, 1], "each index comes out once");
        seen
    });
}

/// A push that happened before a pop is found by it even while another producer is anywhere inside
/// its own push: the queue is empty only if it was (invariant 7, and the bells' second look).
pub(crate) fn earlier_push_is_found<Q: Queue>() {
    let expected = [None, Some(0), Some(1)];
    check("ring::earlier_push_is_found", Some(3), 3, expected, |order| {
        let queue = &*lend(Q::make(2));
        let pushed = &*lend(AtomicBool::new(false));
        let slow: Role<_> = Box::new(move || {
            queue.push(0);
            None
        });
        let quick: Role<_> = Box::new(move || {
            queue.push(1);
            pushed.store(true, Ordering::Release);
            None
        });
        let consumer: Role<_> = Box::new(move || {
            if !pushed.load(Ordering::Acquire) {
                return None;
            }
            let looks_empty = queue.looks_empty();
            assert!(!looks_empty, "a push that happened before was not seen");
            let index = queue.pop();
            assert!(index.is_some(), "a push that happened before was missed");
            index
        });
        together(order, vec![slow, quick, consumer])[2]
    });
}

/// An index travels between two threads that both pop, change what it guards, and push it back.
fn laps<Q: Queue>(name: &str, bound: Option<usize>, indices: usize, expected: &[u32]) {
    let expected: Vec<u32> = expected.to_vec();
    let two = indices == 2;
    check(name, bound, 2, expected, move |order| {
        let count = if two { 2 } else { 1 };
        let (queue, data) = (&*lend(Q::make(count)), cells(count));
        (0..count as u32).for_each(|index| queue.push(index));
        let role = || -> Role<u32> {
            Box::new(move || {
                let mut changed = 0;
                for _ in 0..2 {
                    if let Some(index) = queue.pop() {
                        let cell = &data[index as usize];
                        cell.set(cell.get() + 1);
                        queue.push(index);
                        changed += 1;
                    }
                }
                changed
            })
        };
        let changed: u32 = together(order, vec![role(), role()]).iter().sum();
        let mut all: Vec<u32> = std::iter::from_fn(|| queue.pop()).collect();
        all.sort_unstable();
        assert_eq!(all, (0..count as u32).collect::<Vec<_>>(), "each index is there once");
        assert_eq!(data.iter().map(Guarded::get).sum::<u32>(), changed, "no change is lost");
        changed
    });
}

/// A ring of one slot, lap upon lap.
pub(crate) fn one_slot_laps<Q: Queue>() {
    laps::<Q>("ring::one_slot_laps", Some(4), 1, &[2, 3, 4]);
}

/// A ring of two slots, both taken, lap upon lap. Fewer than four: a push of the other thread that
/// did not happen before may still look unwritten, even when its pops are seen.
pub(crate) fn two_slot_laps<Q: Queue>() {
    laps::<Q>("ring::two_slot_laps", Some(3), 2, &[2, 3, 4]);
}

/// One producer of two indices, two consumers: each index goes to one of them, oldest first.
pub(crate) fn two_consumers<Q: Queue>() {
    let all = [None, Some(0), Some(1)];
    let pairs = all.into_iter().flat_map(|a| all.map(|b| [a, b]));
    // Nobody takes 1 before 0 is taken; both cannot take the same.
    let expected =
        pairs.filter(|pair| pair.contains(&Some(0)) && pair[0] != pair[1] || *pair == [None, None]);
    check("ring::two_consumers", Some(3), 3, expected, |order| {
        let (queue, data) = (&*lend(Q::make(2)), cells(2));
        let producer: Role<_> = Box::new(move || {
            for index in [0, 1] {
                data[index as usize].set(10 + index);
                queue.push(index);
            }
            None
        });
        let consumer = || -> Role<Option<u32>> {
            Box::new(move || {
                let index = queue.pop();
                assert!(index.is_none_or(|index| data[index as usize].get() == 10 + index));
                index
            })
        };
        let seen = together(order, vec![producer, consumer(), consumer()]);
        [seen[1], seen[2]]
    });
}
