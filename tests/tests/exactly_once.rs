//! Exactly once, in order, at most two frames, and the same bits as a plain loop: checked on
//! random virtual environments, on threads that come and go.
#![forbid(unsafe_code)]

use std::cell::Cell;

use dualframe_core::pipeline::BroadPhase;
use dualframe_tests::seen::Seen;
use dualframe_tests::{drive, random_ve};
use proptest::prelude::*;

/// 1,000 cases each unless `PROPTEST_CASES` says otherwise. What fails depends on the machine's
/// interleaving as well as on the case, so a file of failed seeds would promise too much: the
/// message shows the case itself.
fn config() -> ProptestConfig {
    let default = ProptestConfig::default();
    let cases = std::env::var("PROPTEST_CASES").map_or(1000, |_| default.cases);
    ProptestConfig { cases, failure_persistence: None, max_shrink_iters: 64, ..default }
}

/// Asserts a tenth of what is usually seen. Twenty runs are the fewest of which that much can be expected.
fn assert_enough(seen: Seen) {
    println!("{seen:?}");
    let twenties = seen.runs / 20;
    assert!(seen.pairs >= 20 * twenties, "next to nobody met");
    assert!(seen.letters >= 40 * twenties, "next to nothing was read");
    assert!(seen.failures >= 5 * twenties, "next to nothing failed");
    assert!(seen.overlaps >= 20 * twenties, "next to nothing ran at once");
    assert!(2 * seen.ahead >= twenties, "next to no frames overlapped");
}

/// Runs random cases of one broad phase.
fn hold(broad_phase: BroadPhase, sleep: bool) {
    let seen = Cell::new(Seen::default());
    proptest!(config(), |(case in random_ve::cases(broad_phase, sleep))| {
        let mut all = seen.get();
        all += drive::run(&case).map_err(TestCaseError::fail)?;
        seen.set(all);
    });
    assert_enough(seen.into_inner());
}

#[test]
fn modelled_pairs() {
    hold(BroadPhase::Pairwise, false);
}

#[test]
fn modelled_pairs_and_sleeping_workers() {
    hold(BroadPhase::Pairwise, true);
}

#[test]
fn anything_meets_anything() {
    hold(BroadPhase::Spatial, false);
}

#[test]
fn anything_and_sleeping_workers() {
    hold(BroadPhase::Spatial, true);
}
