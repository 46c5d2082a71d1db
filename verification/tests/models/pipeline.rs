//! The whole pipeline: the real code, a small environment that checks every callback.

use super::ve::Event::{Met, Rendered, Swapped};
use super::ve::{Event, Screen, Setup, World, build, step, verify, work};
use super::{Guarded, Model, Role, check, lend, lock, together};
use dualframe_core_model::frame::Entry;
use dualframe_core_model::pipeline::BroadPhase;
use dualframe_core_model::worker::{Step, Worker};

pub(crate) const ALL: &[Model] = &[
    ("pipeline::spatial_after_update", spatial_after_update),
    ("pipeline::spatial_after_render", spatial_after_render),
    ("pipeline::spatial_after_swap", spatial_after_swap),
    ("pipeline::pairwise_after_update", pairwise_after_update),
    ("pipeline::pairwise_after_render", pairwise_after_render),
    ("pipeline::pairwise_after_swap", pairwise_after_swap),
    ("pipeline::pools_come_round", pools_come_round),
    ("pipeline::two_tokens", two_tokens),
    ("pipeline::solitary_unit", solitary_unit),
    ("pipeline::letters", letters),
    ("pipeline::errors_do_no_harm", errors_do_no_harm),
    ("pipeline::finished_shows_all", finished_shows_all),
];

/// Who did anything in the window that was explored, and how far frame 1 overlapped frame 0.
type Outcome = ([bool; 2], Overlap);

/// Frame 1's first test came after frame 0 was swapped, before that, or before all was rendered.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Overlap {
    AfterSwap,
    BeforeSwap,
    BeforeRender,
}
use Overlap::{AfterSwap, BeforeRender, BeforeSwap};

fn overlap(journal: &[Event]) -> Overlap {
    let at = |event: Event| journal.iter().position(|&logged| logged == event);
    let met = at(Met([0, 1], 1));
    match (met < at(Swapped(0)), met < at(Rendered(0, 0)).max(at(Rendered(1, 0)))) {
        (false, _) => AfterSwap,
        (true, false) => BeforeSwap,
        (true, true) => BeforeRender,
    }
}

/// A worker that goes from thread to thread.
type Moving = Worker<'static, 'static, World>;

/// Explores a window of two workers' steps, wherever in the run it lies.
///
/// `order / 2` steps are made first, turn by turn; then each worker makes `window` steps in a
/// thread of its own, and this is what loom explores; then one worker finishes the run. The other
/// one leaves inside the window, in its own thread, with what it carries; it is the token's holder
/// or not. Windows are laid everywhere from before the first step to after the last. Without
/// windows loom spends all its time on the stale hints that an idle worker may read.
fn two_workers(
    name: &str,
    setup: Setup,
    (bound, window, starts): (usize, u32, usize),
    overlaps: &[Overlap],
) {
    let did = [[false, false], [false, true], [true, false], [true, true]];
    // A window before or after the overlap may find either worker without work.
    let alone = did.map(|did| (did, AfterSwap));
    let both = overlaps.iter().map(|&overlap| ([true, true], overlap));
    // A solitary unit is one more that the other worker may be busy with meanwhile.
    let other = overlaps.iter().map(|&overlap| ([false, true], overlap));
    let other = other.filter(|_| setup.solitary_from < setup.units);
    let expected: Vec<_> = alone.into_iter().chain(both).chain(other).collect();
    let body = move |order: usize| -> Outcome {
        let (pipeline, world) = build(setup);
        let screen: Screen = lend(Guarded::new(0));
        let hold = |worker: &mut Moving| {
            if let Ok(token) = pipeline.token(screen) {
                assert!(worker.hold(token).is_ok());
            }
        };
        let mut workers = [pipeline.worker_at(0), pipeline.worker_at(1)];
        hold(&mut workers[0]);
        if setup.tokens > 1 {
            hold(&mut workers[1]);
        }
        for turn in 0..order / 2 {
            step(&mut workers[turn % 2], world);
        }
        let role = |mut worker: Moving, leaves: bool| -> Role<(bool, Option<Moving>)> {
            Box::new(move || {
                let mut did = false;
                for _ in 0..window {
                    did |= step(&mut worker, world) != Step::Idle;
                }
                (did, (!leaves).then_some(worker))
            })
        };
        let [holder, other] = workers;
        let holder_leaves = order / 2 % 2 == 1;
        let parts = together(order, vec![role(holder, holder_leaves), role(other, !holder_leaves)]);
        let did = [parts[0].0, parts[1].0];
        let mut left: Vec<_> = parts.into_iter().filter_map(|(_, worker)| worker).collect();
        if left[0].token().is_none() {
            hold(&mut left[0]);
        }
        let mut idle = 0;
        while !pipeline.finished() {
            idle = if step(&mut left[0], world) == Step::Idle { idle + 1 } else { 0 };
            assert!(idle < 4, "unfinished, and no work to be seen: {:?}", lock(&world.journal));
        }
        (did, overlap(&verify(pipeline, world)))
    };
    check(name, Some(bound), 2 * starts, expected, body);
}

fn run(name: &str, broad_phase: BroadPhase, entry: Entry) {
    // What each entry forbids is not among them. Who renders a unit last also swaps, and does so
    // before it does anything else: of two units, none is met in between.
    let overlaps = match entry {
        Entry::AfterUpdate => &[AfterSwap, BeforeSwap, BeforeRender][..],
        Entry::AfterRender => &[AfterSwap],
        Entry::AfterSwap => &[AfterSwap],
    };
    two_workers(name, Setup { broad_phase, entry, ..Setup::default() }, (3, 3, 20), overlaps);
}

fn spatial_after_update() {
    run("pipeline::spatial_after_update", BroadPhase::Spatial, Entry::AfterUpdate);
}

fn spatial_after_render() {
    run("pipeline::spatial_after_render", BroadPhase::Spatial, Entry::AfterRender);
}

fn spatial_after_swap() {
    run("pipeline::spatial_after_swap", BroadPhase::Spatial, Entry::AfterSwap);
}

fn pairwise_after_update() {
    run("pipeline::pairwise_after_update", BroadPhase::Pairwise, Entry::AfterUpdate);
}

fn pairwise_after_render() {
    run("pipeline::pairwise_after_render", BroadPhase::Pairwise, Entry::AfterRender);
}

fn pairwise_after_swap() {
    run("pipeline::pairwise_after_swap", BroadPhase::Pairwise, Entry::AfterSwap);
}

const ANY: &[Overlap] = &[AfterSwap, BeforeSwap, BeforeRender];

/// Four frames: the pools of contacts and candidates, sized for two, serve twice.
fn pools_come_round() {
    let setup = Setup { frames: 4, ..Setup::default() };
    two_workers("pipeline::pools_come_round", setup, (1, 3, 34), ANY);
}

/// Both workers hold a token: two render at once, one swaps, no one renders ahead.
fn two_tokens() {
    let setup = Setup { tokens: 2, ..Setup::default() };
    two_workers("pipeline::two_tokens", setup, (2, 3, 20), ANY);
}

/// Two that interact and one that does not.
fn solitary_unit() {
    let setup = Setup { units: 3, solitary_from: 2, ..Setup::default() };
    two_workers("pipeline::solitary_unit", setup, (1, 3, 22), ANY);
}

/// What is posted in a frame is in the next frame's update, in the values too.
fn letters() {
    let setup = Setup { letters: true, ..Setup::default() };
    two_workers("pipeline::letters", setup, (1, 3, 20), ANY);
}

/// Every callback returns an error, after its work: all is as without.
fn errors_do_no_harm() {
    let setup = Setup { fail: true, ..Setup::default() };
    two_workers("pipeline::errors_do_no_harm", setup, (1, 3, 20), ANY);
}

/// Who sees that the pipeline has finished sees all that was rendered: no join in between.
fn finished_shows_all() {
    check("pipeline::finished_shows_all", None, 2, [false, true], |order| {
        let (pipeline, world) = build(Setup { units: 1, frames: 1, ..Setup::default() });
        let screen: Screen = lend(Guarded::new(0));
        let worker: Role<bool> = Box::new(move || {
            work(pipeline, world, Some(screen));
            true
        });
        let watcher: Role<bool> = Box::new(move || {
            let finished = pipeline.finished();
            if finished {
                assert_eq!(screen.get(), 1);
            }
            finished
        });
        together(order, vec![worker, watcher])[1]
    });
}
