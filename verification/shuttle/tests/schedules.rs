//! Random and PCT schedules of whole runs of the real core: four workers, twelve units, four frames.
//! What callbacks see is judged after each; a wake-up that is lost is a deadlock, which shuttle
//! reports. A failure prints its schedule: `ReplayScheduler::new_from_encoded` in place of the scheduler of
//! the `Runner` that failed plays it again, on stacks of [`os::config`]'s size, which `shuttle::replay` has not.

use dualframe_core_shuttle as dut;

mod os;
#[path = "../../model/tests/record/mod.rs"]
mod record;

use std::fs;
use std::panic::catch_unwind;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Instant;

use dut::frame::Entry;
use dut::pipeline::BroadPhase;
use dut::wait::{Bell, Epoch, Waiting};
use os::{Condvar, Mutex};
use record::{Park, Renderer, Setup, judge, run};
use shuttle::scheduler::{PctScheduler, RandomScheduler, ReplayScheduler, Scheduler};
use shuttle::{FailurePersistence, Runner};

/// The ways of running among which the schedules are divided.
const WAYS: [(BroadPhase, Entry, Renderer); 5] = [
    (BroadPhase::Spatial, Entry::AfterUpdate, Renderer::Tokens(1)),
    (BroadPhase::Spatial, Entry::AfterUpdate, Renderer::Shared),
    (BroadPhase::Pairwise, Entry::AfterUpdate, Renderer::Tokens(1)),
    (BroadPhase::Spatial, Entry::AfterRender, Renderer::Tokens(1)),
    (BroadPhase::Pairwise, Entry::AfterSwap, Renderer::Shared),
];

fn setup((broad_phase, entry, renderer): (BroadPhase, Entry, Renderer)) -> Setup {
    let (seed, near_percent, solitary) = (7, 15, 0);
    Setup {
        units: 12,
        frames: 4,
        broad_phase,
        entry,
        renderer,
        homes: 2,
        seed,
        near_percent,
        solitary,
    }
}

/// Runs `schedules` schedules of `scheduler`'s making in each way, and asserts that it did.
fn explore<S: Scheduler + 'static>(name: &str, schedules: usize, scheduler: impl Fn(usize) -> S) {
    let start = Instant::now();
    let points = Arc::new(AtomicUsize::new(0));
    for way in WAYS {
        let setup = setup(way);
        let sum = Arc::clone(&points);
        let explored = Runner::new(scheduler(schedules), os::config()).run(move || {
            let (record, values) = run(&setup, 4, Park::default());
            judge(&setup, &record, &values);
            sum.fetch_add(shuttle::current::context_switches(), Ordering::Relaxed);
        });
        assert_eq!(explored, schedules, "{name}, {way:?}");
    }
    let all = WAYS.len() * schedules;
    let points = points.load(Ordering::Relaxed) / all;
    let seconds = start.elapsed().as_secs_f64();
    println!("{name}: {all} schedules, each of {points} points of choice, {seconds:.1} s");
    assert!(points > 1000, "next to nothing was interleaved");
}

/// Schedules that take any thread at each point.
fn random(schedules: usize) {
    explore("random", schedules, |count| RandomScheduler::new_from_seed(1, count));
}

/// Schedules with few preemptions, at random places: depth 4 is three of them.
fn pct(schedules: usize) {
    explore("PCT", schedules, |count| PctScheduler::new_from_seed(2, 4, count));
}

#[test]
fn random_schedules() {
    random(400);
}

#[test]
fn pct_schedules() {
    pct(400);
}

#[test]
#[ignore = "minutes, see README.md"]
fn random_schedules_full() {
    random(10_000);
}

#[test]
#[ignore = "minutes, see README.md"]
fn pct_schedules_full() {
    pct(10_000);
}

/// The library's accesses are points at which shuttle may switch.
#[test]
fn the_library_is_compiled_under_shuttle() {
    shuttle::check_random(
        || {
            let before = shuttle::current::context_switches();
            assert!(dut::countdown::Countdown::new(1).arrive());
            let points = shuttle::current::context_switches() - before;
            assert_eq!(points, 1, "these would be schedules of nothing");
        },
        1,
    );
}

/// A sleeper that does not look at its bell before it sleeps, as a host might wrongly have it.
#[derive(Default)]
struct Hasty([(Mutex<()>, Condvar); 2]);

impl Waiting for Hasty {
    fn sleep(&self, bell: &Bell, _: Epoch) {
        let (room, awake) = &self.0[usize::from(bell.is_for_holders())];
        drop(awake.wait(room.lock().expect("no poison")).expect("no poison"));
    }

    fn wake(&self, bell: &Bell, _: u32) {
        let (room, awake) = &self.0[usize::from(bell.is_for_holders())];
        drop(room.lock().expect("no poison"));
        awake.notify_all();
    }
}

/// What a test that panicked said.
fn said(failure: &(dyn std::any::Any + Send)) -> String {
    let said = failure.downcast_ref::<String>().cloned();
    said.or_else(|| failure.downcast_ref::<&str>().map(ToString::to_string)).unwrap_or_default()
}

/// A seeded bug is found, and the schedule that shuttle keeps of it finds it again.
#[test]
fn a_lost_wake_up_is_found_and_replayed() {
    fn hasty() {
        let setup = Setup { units: 3, frames: 2, ..setup(WAYS[0]) };
        run(&setup, 2, Hasty::default());
    }
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("lost_wake_up");
    let _ = fs::remove_dir_all(&folder);
    fs::create_dir_all(&folder).expect("a folder for the schedule");
    let mut config = os::config();
    config.failure_persistence = FailurePersistence::File(Some(folder.clone()));
    let found = catch_unwind(move || {
        Runner::new(RandomScheduler::new_from_seed(3, 100_000), config).run(hasty);
    });
    let failure = said(&*found.expect_err("the seeded bug was not noticed"));
    assert!(failure.contains("deadlock"), "failed for another reason: {failure}");
    let file = fs::read_dir(&folder).expect("the folder").next().expect("a schedule");
    let schedule = file.expect("a schedule").path();
    let length = fs::read_to_string(&schedule).expect("a schedule").len();
    println!("found; the schedule that shuttle would print has {length} characters");
    let again = catch_unwind(move || {
        let kept = ReplayScheduler::new_from_file(schedule).expect("a schedule");
        Runner::new(kept, os::config()).run(hasty);
    });
    let again = said(&*again.expect_err("the schedule did not find the bug again"));
    assert!(again.contains("deadlock"), "failed for another reason: {again}");
}
