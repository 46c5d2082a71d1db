//! Traces of the real core under shuttle's schedules are replayed in the model, step by step.

use dualframe_core_shuttle as dut;

mod os;
#[path = "../../model/tests/record/mod.rs"]
mod record;

use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Instant;

use dualframe_protocol::replay::replay;
use dut::frame::Entry;
use dut::pipeline::BroadPhase;
use record::Renderer::{Shared, Tokens};
use record::{Park, Setup, judge, run};
use shuttle::Runner;
use shuttle::scheduler::{PctScheduler, RandomScheduler, Scheduler};

/// Every way of running, with one token, two, or a shared renderer; with two there is a solitary unit, too.
fn setups() -> impl Iterator<Item = Setup> {
    let entries = [Entry::AfterUpdate, Entry::AfterRender, Entry::AfterSwap];
    let ways = [BroadPhase::Spatial, BroadPhase::Pairwise]
        .into_iter()
        .flat_map(move |broad_phase| entries.map(|entry| (broad_phase, entry)))
        .flat_map(|way| [Tokens(1), Tokens(2), Shared].map(|renderer| (way, renderer)));
    (1..).zip(ways).map(|(seed, ((broad_phase, entry), renderer))| {
        let (units, frames, near_percent) = (5, 3, 40);
        let solitary = if renderer == Tokens(2) { 4 } else { 0 };
        Setup {
            units,
            frames,
            broad_phase,
            entry,
            renderer,
            homes: 2,
            seed,
            near_percent,
            solitary,
        }
    })
}

/// Runs `setup` and replays what was seen; returns the number of steps.
fn replayed(setup: &Setup) -> usize {
    let (record, values) = run(setup, 4, Park::default());
    match replay(&setup.model(), &record) {
        Ok(replayed) => {
            judge(setup, &record, &values);
            replayed.steps
        }
        Err(refused) => panic!("{refused}"),
    }
}

/// Replays `schedules` schedules of each setup.
fn conform<S: Scheduler + 'static>(
    name: &str,
    schedules: usize,
    scheduler: impl Fn(usize, u64) -> S,
) {
    let start = Instant::now();
    let steps = Arc::new(AtomicUsize::new(0));
    let mut traces = 0;
    for setup in setups() {
        let steps = Arc::clone(&steps);
        let runner = Runner::new(scheduler(schedules, setup.seed), os::config());
        traces += runner.run(move || _ = steps.fetch_add(replayed(&setup), Ordering::Relaxed));
    }
    let (steps, seconds) = (steps.load(Ordering::Relaxed), start.elapsed().as_secs_f64());
    println!("{name}: {traces} traces, {steps} steps replayed, {seconds:.1} s");
    assert_eq!(traces, 18 * schedules);
    assert!(steps > 100 * traces, "next to nothing was replayed");
}

fn random(schedules: usize) {
    conform("random", schedules, |count, seed| RandomScheduler::new_from_seed(seed, count));
}

fn pct(schedules: usize) {
    conform("PCT", schedules, |count, seed| PctScheduler::new_from_seed(seed, 4, count));
}

#[test]
fn random_traces_are_the_models() {
    random(100);
}

#[test]
fn pct_traces_are_the_models() {
    pct(100);
}

#[test]
#[ignore = "minutes, see README.md"]
fn random_traces_are_the_models_full() {
    random(2_000);
}

#[test]
#[ignore = "minutes, see README.md"]
fn pct_traces_are_the_models_full() {
    pct(2_000);
}
