//! Seeded bugs: the same models, run on parts that are broken the way such parts usually are, must
//! fail, and for the reason that was seeded.

use crate::models::arrivals::Meets;
use crate::models::countdown::Counts;
use crate::models::offer::Offers;
use crate::models::ring::Queue;
use crate::models::{
    Guarded, Role, arrivals, check, cost, countdown, lend, lend_slice, named, offer, ring, together,
};
use loom::sync::atomic::{AtomicU32, AtomicUsize, Ordering};
use std::panic::catch_unwind;

/// Asserts that `model` fails, saying `reason`.
fn caught(model: fn(), reason: &str) {
    let failure = catch_unwind(model).expect_err("the seeded bug was not noticed");
    let said = failure
        .downcast_ref::<String>()
        .map(String::as_str)
        .or_else(|| failure.downcast_ref::<&str>().copied())
        .unwrap_or_default();
    assert!(said.contains(reason), "failed for another reason: {said}");
}

/// The bounds of a step, made smaller than a step is.
#[test]
fn a_bound_that_is_too_small_is_noticed() {
    cost::tighten(50);
    caught(cost::ALL[0].1, "accesses, ");
    cost::tighten(20);
    caught(named("pipeline::spatial_after_update"), "accesses, ");
}

/// A ring whose push takes a ticket first and fills the slot later. Positions count from 1.
struct Ticket {
    cells: &'static [AtomicUsize],
    head: AtomicUsize,
    tail: AtomicUsize,
}

impl Queue for Ticket {
    fn make(_: usize) -> Self {
        let cells = lend_slice(8, |_| AtomicUsize::new(usize::MAX));
        Self { cells, head: AtomicUsize::new(0), tail: AtomicUsize::new(0) }
    }
    fn push(&self, index: u32) {
        let ticket = self.tail.fetch_add(1, Ordering::AcqRel);
        self.cells[ticket].store(index as usize, Ordering::Release);
    }
    fn pop(&self) -> Option<u32> {
        let head = self.head.load(Ordering::Acquire);
        let word = self.cells[head].load(Ordering::Acquire);
        let free = word != usize::MAX
            && self
                .head
                .compare_exchange(head, head + 1, Ordering::AcqRel, Ordering::Relaxed)
                .is_ok();
        free.then_some(word as u32)
    }
}

#[test]
fn a_ring_of_tickets_hides_later_pushes() {
    caught(ring::earlier_push_is_found::<Ticket>, "a push that happened before was missed");
}

/// A ring whose pop moves the head without a compare.
struct BlindPop(Ticket);

impl Queue for BlindPop {
    fn make(indices: usize) -> Self {
        Self(Ticket::make(indices))
    }
    fn push(&self, index: u32) {
        self.0.push(index);
    }
    fn pop(&self) -> Option<u32> {
        let head = self.0.head.load(Ordering::Acquire);
        let word = self.0.cells[head].load(Ordering::Acquire);
        if word == usize::MAX {
            return None;
        }
        self.0.head.store(head + 1, Ordering::Release);
        Some(word as u32)
    }
}

#[test]
fn a_blind_pop_doubles() {
    caught(ring::one_slot_laps::<BlindPop>, "");
    caught(ring::two_consumers::<BlindPop>, "outcomes seen");
}

/// A countdown that loads, then stores.
struct LoadStore(AtomicU32);

impl Counts for LoadStore {
    fn make(arrivals: u32) -> Self {
        Self(AtomicU32::new(arrivals))
    }
    fn arrive(&self) -> bool {
        let left = self.0.load(Ordering::Acquire);
        self.0.store(left.wrapping_sub(1), Ordering::Release);
        left == 1
    }
    fn arm(&self, arrivals: u32) {
        self.0.store(arrivals, Ordering::Release);
    }
}

#[test]
fn a_countdown_that_loads_then_stores_loses_arrivals() {
    caught(countdown::last_sees_all::<LoadStore>, "one last arriver");
}

/// An offer that loads, then stores.
struct TakenTwice {
    next: AtomicU32,
    count: u32,
}

impl Offers for TakenTwice {
    fn make(count: usize) -> Self {
        Self { next: AtomicU32::new(count as u32), count: count as u32 }
    }
    fn offer(&self) {
        self.next.store(0, Ordering::Release);
    }
    fn take(&self) -> Option<u32> {
        let place = self.next.load(Ordering::Acquire);
        (place < self.count).then(|| {
            self.next.store(place + 1, Ordering::Release);
            place
        })
    }
}

#[test]
fn an_offer_that_loads_then_stores_is_taken_twice() {
    caught(offer::takers_see_what_came_before::<TakenTwice>, "outcomes seen");
    caught(offer::once_a_round::<TakenTwice>, "Causality violation");
}

/// An arrival set that loads, then stores.
struct Forgetful {
    newest: AtomicU32,
    before: &'static [AtomicU32],
}

impl Meets for Forgetful {
    fn make(units: usize) -> Self {
        let before = lend_slice(units, |_| AtomicU32::new(u32::MAX));
        Self { newest: AtomicU32::new(u32::MAX), before }
    }
    fn arrive(&self, unit: u32, _: u32) -> Vec<u32> {
        let newest = self.newest.load(Ordering::Acquire);
        self.before[unit as usize].store(newest, Ordering::Release);
        self.newest.store(unit, Ordering::Release);
        let first = (newest != u32::MAX).then_some(newest);
        std::iter::successors(first, |&at| {
            let before = self.before[at as usize].load(Ordering::Acquire);
            (before != u32::MAX).then_some(before)
        })
        .collect()
    }
}

#[test]
fn arrivals_that_load_then_store_miss_pairs() {
    caught(arrivals::pairs_meet_once::<Forgetful>, "each pair meets once");
}

/// A list of letters that loads, then stores.
#[test]
fn an_inbox_that_loads_then_stores_loses_letters() {
    fn model() {
        check("seeded inbox", None, 2, [2], |order| {
            let newest = &*lend(AtomicU32::new(u32::MAX));
            let next: &[AtomicU32] = lend_slice(2, |_| AtomicU32::new(u32::MAX));
            let send = |letter: u32| -> Role<()> {
                Box::new(move || {
                    next[letter as usize].store(newest.load(Ordering::Acquire), Ordering::Relaxed);
                    newest.store(letter, Ordering::Release);
                })
            };
            together(order, vec![send(0), send(1)]);
            let mut count = 0;
            let mut at = newest.load(Ordering::Acquire);
            while at != u32::MAX {
                count += 1;
                at = next[at as usize].load(Ordering::Relaxed);
            }
            count
        });
    }
    caught(model, "outcomes seen");
}

/// Two slots in turn, whoever is reading.
#[test]
fn a_double_buffer_is_written_while_it_is_read() {
    fn model() {
        check("seeded latest", None, 2, [0, 1, 2], |order| {
            let slots: &[Guarded<u32>] = lend_slice(2, |_| Guarded::new(0));
            let newest = &*lend(AtomicUsize::new(0));
            let write: Role<u32> = Box::new(move || {
                for value in 1..=2 {
                    slots[value as usize % 2].set(value);
                    newest.store(value as usize % 2, Ordering::Release);
                }
                0
            });
            let read: Role<u32> = Box::new(move || slots[newest.load(Ordering::Acquire)].get());
            together(order, vec![write, read])[1]
        });
    }
    caught(model, "Causality violation");
}

/// A token that is looked for, then taken.
#[test]
fn a_token_that_is_looked_for_then_taken_is_doubled() {
    fn model() {
        check("seeded token", None, 2, [1, 2], |order| {
            let left = &*lend(AtomicU32::new(1));
            let context = &*lend(Guarded::new(0));
            let role = || -> Role<u32> {
                Box::new(move || {
                    if left.load(Ordering::Acquire) == 0 {
                        return 0;
                    }
                    left.store(0, Ordering::Release);
                    context.set(context.get() + 1);
                    left.store(1, Ordering::Release);
                    1
                })
            };
            together(order, vec![role(), role()]).iter().sum()
        });
    }
    caught(model, "Causality violation");
}

/// A sleeper that announces itself only after it has looked.
#[test]
fn a_sleeper_that_looks_first_sleeps_on() {
    fn model() {
        check("seeded bell", None, 2, [()], |order| {
            let [work, sleepers, epoch] = &*lend([(); 3].map(|()| AtomicU32::new(0)));
            let ring: Role<()> = Box::new(move || {
                work.store(1, Ordering::Release);
                loom::sync::atomic::fence(Ordering::SeqCst);
                if sleepers.load(Ordering::Acquire) > 0 {
                    epoch.fetch_add(1, Ordering::AcqRel);
                }
            });
            let sleep: Role<()> = Box::new(move || {
                let seen = epoch.load(Ordering::Acquire);
                if work.load(Ordering::Acquire) == 0 {
                    sleepers.fetch_add(1, Ordering::AcqRel);
                    while epoch.load(Ordering::Acquire) == seen {
                        loom::hint::spin_loop();
                    }
                }
            });
            together(order, vec![ring, sleep]);
        });
    }
    caught(model, "exceeded maximum number of branches");
}
