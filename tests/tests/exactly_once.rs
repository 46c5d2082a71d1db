//! Exactly once, in order, at most two frames, and the same bits as a plain loop: checked on
//! random virtual environments, on threads that come and go.
#![forbid(unsafe_code)]

use dualframe_core::pipeline::BroadPhase;
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

proptest! {
    #![proptest_config(config())]

    #[test]
    fn modelled_pairs(case in random_ve::cases(BroadPhase::Pairwise, false)) {
        drive::run(&case).map_err(TestCaseError::fail)?;
    }

    #[test]
    fn modelled_pairs_and_sleeping_workers(case in random_ve::cases(BroadPhase::Pairwise, true)) {
        drive::run(&case).map_err(TestCaseError::fail)?;
    }

    #[test]
    fn anything_meets_anything(case in random_ve::cases(BroadPhase::Spatial, false)) {
        drive::run(&case).map_err(TestCaseError::fail)?;
    }

    #[test]
    fn anything_and_sleeping_workers(case in random_ve::cases(BroadPhase::Spatial, true)) {
        drive::run(&case).map_err(TestCaseError::fail)?;
    }
}
