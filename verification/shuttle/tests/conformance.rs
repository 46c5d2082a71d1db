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
use record::{Park, Setup, judge, run};
use shuttle::scheduler::{PctScheduler, RandomScheduler, Scheduler};
use shuttle::{Config, Runner};

/// Runs and replays `schedules` schedules in each way of running.
fn conform<S: Scheduler + 'static>(
    name: &str,
    schedules: usize,
    scheduler: impl Fn(usize, u64) -> S,
) {
    let start = Instant::now();
    let steps = Arc::new(AtomicUsize::new(0));
    let mut seed = 0;
    for broad_phase in [BroadPhase::Spatial, BroadPhase::Pairwise] {
        for entry in [Entry::AfterUpdate, Entry::AfterRender, Entry::AfterSwap] {
            for tokens in [1, 2] {
                seed += 1;
                let (units, frames, near_percent) = (5, 3, 40);
                let solitary = if tokens == 2 { 4 } else { 0 };
                let setup = Setup {
                    units,
                    frames,
                    broad_phase,
                    entry,
                    tokens,
                    seed,
                    near_percent,
                    solitary,
                };
                let steps = Arc::clone(&steps);
                let explored =
                    Runner::new(scheduler(schedules, seed), Config::default()).run(move || {
                        let (record, values) = run(&setup, 4, Park::default());
                        judge(&setup, &record, &values);
                        match replay(&setup.model(), &record) {
                            Ok(replayed) => _ = steps.fetch_add(replayed.steps, Ordering::Relaxed),
                            Err(refusal) => panic!("{refusal}"),
                        }
                    });
                assert_eq!(explored, schedules);
            }
        }
    }
    let (all, steps) = (12 * schedules, steps.load(Ordering::Relaxed));
    println!(
        "{name}: {all} traces, {steps} steps replayed, {:.1} s",
        start.elapsed().as_secs_f64()
    );
    assert!(steps > 100 * all, "next to nothing was replayed");
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
