//! The models: plain functions that panic on a violation, so that the tests, the ordering mutants
//! and the seeded bugs all run the same code.
#![allow(dead_code, reason = "each test binary runs some of the models")]

pub(crate) mod arrivals;
pub(crate) mod bell;
pub(crate) mod cost;
pub(crate) mod countdown;
pub(crate) mod hunt;
pub(crate) mod inbox;
pub(crate) mod latest;
pub(crate) mod offer;
pub(crate) mod pipeline;
pub(crate) mod ring;
pub(crate) mod room;
pub(crate) mod shared;
pub(crate) mod token;
mod ve;

use std::cell::{Cell, RefCell};
use std::collections::BTreeSet;
use std::fmt::Debug;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Instant;

/// A model, by the name that the table of mutants prints.
pub(crate) type Model = (&'static str, fn());

/// Every access to what a std mutex guards goes through here: a model that failed poisons it.
pub(crate) fn lock<T>(mutex: &Mutex<T>) -> std::sync::MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

type Free = Box<dyn FnOnce()>;

thread_local! {
    /// Executions explored by this thread so far, of all models.
    static EXPLORED: Cell<usize> = const { Cell::new(0) };
    static LENT: RefCell<Vec<Free>> = const { RefCell::new(Vec::new()) };
}

/// Memory that lives until the next execution of a model begins on this thread.
///
/// Loom's threads want `'static`, and a reference count under loom's eyes would add ordering that
/// the code under test does not have.
pub(crate) fn lend<T: 'static>(value: T) -> &'static mut T {
    let place = Box::into_raw(Box::new(value));
    // SAFETY: made by `Box::into_raw` above; run once, by `check`, when all threads of the
    // execution that could reach it have ended. Loom runs them all on this one OS thread.
    let free = move || drop(unsafe { Box::from_raw(place) });
    LENT.with(|lent| lent.borrow_mut().push(Box::new(free)));
    // SAFETY: the allocation is this caller's alone, and stays until `check` frees it.
    unsafe { &mut *place }
}

/// Gives back what this thread lent.
pub(crate) fn free_lent() {
    LENT.with(RefCell::take).into_iter().for_each(|free| free());
}

/// A slice of `count` values, lent as by `lend`.
pub(crate) fn lend_slice<T: 'static>(
    count: usize,
    value: impl FnMut(usize) -> T,
) -> &'static mut [T] {
    lend((0..count).map(value).collect::<Vec<_>>()).as_mut_slice()
}

/// Explores `body` in `orders` spawn orders, at most `bound` preemptions each (`None`: all), and
/// asserts that the outcomes it returned, over all orders, are exactly `expected`: an exploration
/// that misses an outcome, or runs no interleaving, fails. How deep one goes where all have one outcome is what the
/// mutants show.
pub(crate) fn check<T: Ord + Debug + Send + 'static>(
    name: &str,
    bound: Option<usize>,
    orders: usize,
    expected: impl IntoIterator<Item = T>,
    body: impl Fn(usize) -> T + Copy + Send + Sync + 'static,
) {
    let start = Instant::now();
    let seen = Arc::new(Mutex::new(BTreeSet::new()));
    let executions = Arc::new(AtomicUsize::new(0));
    for order in 0..orders {
        let (seen, counted) = (Arc::clone(&seen), Arc::clone(&executions));
        let before = counted.load(Ordering::Relaxed);
        let mut builder = loom::model::Builder::new();
        builder.preemption_bound = bound;
        builder.max_branches = 20_000;
        // The environment must not be able to cut the exploration short.
        (builder.max_permutations, builder.max_duration) = (None, None);
        (builder.checkpoint_file, builder.max_threads) = (None, 4);
        builder.check(move || {
            free_lent();
            counted.fetch_add(1, Ordering::Relaxed);
            EXPLORED.set(EXPLORED.get() + 1);
            let outcome = body(order);
            lock(&seen).insert(outcome);
        });
        assert!(executions.load(Ordering::Relaxed) > before, "{name}: nothing was explored");
    }
    let expected: BTreeSet<T> = expected.into_iter().collect();
    let seen = std::mem::take(&mut *lock(&seen));
    assert!(!expected.is_empty(), "{name}: a model without outcomes shows nothing");
    assert_eq!(seen, expected, "{name}: outcomes seen, and those expected");
    let executions = executions.load(Ordering::Relaxed);
    let (outcomes, seconds) = (seen.len(), start.elapsed().as_secs_f64());
    let bound = bound.map_or("none".into(), |bound| bound.to_string());
    println!("{name}: {executions} executions, {outcomes} outcomes, bound {bound}, {seconds:.2} s");
}

/// A thread's part in a model.
pub(crate) type Role<T> = Box<dyn FnOnce() -> T>;

/// Runs `roles` at once: `order` says which is spawned first, the last one runs on the model's
/// own thread. The results are in the order of `roles`.
pub(crate) fn together<T: 'static>(order: usize, roles: Vec<Role<T>>) -> Vec<T> {
    let count = roles.len();
    let mut ordered: Vec<_> = roles.into_iter().enumerate().collect();
    ordered.rotate_left(order % count);
    let last = ordered.pop();
    let spawned: Vec<_> =
        ordered.into_iter().map(|(at, role)| (at, loom::thread::spawn(role))).collect();
    let mut results: Vec<_> = last.map(|(at, role)| (at, role())).into_iter().collect();
    results.extend(spawned.into_iter().map(|(at, thread)| (at, thread.join().unwrap())));
    results.sort_by_key(|(at, _)| *at);
    results.into_iter().map(|(_, result)| result).collect()
}

/// A value that the protocol under test guards; loom watches the lends.
#[derive(Debug)]
pub(crate) struct Guarded<T>(loom::cell::UnsafeCell<T>);

// SAFETY: loom runs all threads of a model on one OS thread, and fails the model when two lends
// are not ordered.
unsafe impl<T: Send + Sync> Sync for Guarded<T> {}

impl<T: Copy> Guarded<T> {
    pub(crate) fn new(value: T) -> Self {
        Self(loom::cell::UnsafeCell::new(value))
    }

    pub(crate) fn get(&self) -> T {
        // SAFETY: loom fails the model if anyone may be writing.
        self.0.with(|value| unsafe { *value })
    }

    pub(crate) fn set(&self, value: T) {
        // SAFETY: loom fails the model if anyone else may have it.
        self.0.with_mut(|place| unsafe { *place = value });
    }
}

/// All models.
pub(crate) fn all() -> impl Iterator<Item = Model> {
    let lists = [
        ring::ALL,
        countdown::ALL,
        arrivals::ALL,
        offer::ALL,
        room::ALL,
        inbox::ALL,
        latest::ALL,
        bell::ALL,
        token::ALL,
        shared::ALL,
        pipeline::ALL,
        cost::ALL,
    ];
    lists.into_iter().flatten().copied()
}

/// The model called `name`.
pub(crate) fn named(name: &str) -> fn() {
    let found = all().find(|model| model.0 == name);
    found.unwrap_or_else(|| panic!("no model {name}")).1
}
