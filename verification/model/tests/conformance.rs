//! The model is of this code: traces of random virtual environments on the real core are replayed
//! in it, step by step.

use dualframe_core as dut;

mod os;
mod record;

use std::cell::Cell;

use dualframe_protocol::replay::{Replayed, replay};
use dut::frame::Entry;
use dut::pipeline::BroadPhase;
use proptest::prelude::*;
use record::{Park, Renderer, Setup, judge, run};

fn setups() -> impl Strategy<Value = (Setup, u32)> {
    let broad_phase = prop_oneof![Just(BroadPhase::Spatial), Just(BroadPhase::Pairwise)];
    let entry =
        prop_oneof![Just(Entry::AfterUpdate), Just(Entry::AfterRender), Just(Entry::AfterSwap)];
    let renderer = prop_oneof![(1..=2_u32).prop_map(Renderer::Tokens), Just(Renderer::Shared)];
    let sizes = (1..=7_u32, 1..=5_u32, renderer, 1..=4_u32);
    let chances = (any::<u64>(), 0..100_u64, prop_oneof![Just(0), 0..128_u32]);
    (broad_phase, entry, sizes, chances).prop_map(|(broad_phase, entry, sizes, chances)| {
        let (units, frames, renderer, workers) = sizes;
        let (seed, near_percent, solitary) = chances;
        let setup = Setup {
            units,
            frames,
            broad_phase,
            entry,
            renderer,
            homes: 2,
            seed,
            near_percent,
            solitary,
        };
        (setup, workers)
    })
}

thread_local! {
    static REPLAYED: Cell<[usize; 3]> = const { Cell::new([0; 3]) };
}

fn count(replayed: Replayed) {
    let [runs, steps, states] = REPLAYED.get();
    REPLAYED.set([runs + 1, steps + replayed.steps, states.max(replayed.states)]);
}

/// Runs and replays `cases` random environments.
fn conform(cases: u32) {
    let config = ProptestConfig { cases, failure_persistence: None, ..ProptestConfig::default() };
    proptest!(config, |((setup, workers) in setups())| {
        let (record, values) = run(&setup, workers, Park::default());
        match replay(&setup.model(), &record) {
            Ok(replayed) => count(replayed),
            Err(refused) => return Err(TestCaseError::fail(refused.to_string())),
        }
        judge(&setup, &record, &values);
    });
    let [runs, steps, states] = REPLAYED.get();
    println!("{runs} runs, {steps} steps replayed, at most {states} states in mind at once");
    assert!(runs >= cases as usize && steps > 50 * runs, "next to nothing was replayed");
}

#[test]
fn traces_are_the_models() {
    conform(1_000);
}

#[test]
#[ignore = "minutes, see README.md"]
fn traces_are_the_models_full() {
    conform(100_000);
}
