//! The whole pipeline: the real code, a small environment that checks every callback.

use super::ve::Event::{Met, Rendered, Swapped, Updated};
use super::ve::{Event, Piped, Screen, Setup, World, build, step, verify, work};
use super::{Guarded, Model, Role, check, lend, lock, together};
use dualframe_core_model::frame::Entry;
use dualframe_core_model::pipeline::BroadPhase;
use dualframe_core_model::stage::Stage;
use dualframe_core_model::wait::Spin;
use dualframe_core_model::worker::{Step, Worker};

pub(crate) const ALL: &[Model] = &[
    ("pipeline::two_holders_at_a_swap", two_holders_at_a_swap),
    ("pipeline::rendering_waits_for_a_swap", rendering_waits_for_a_swap),
    ("pipeline::sleeps_through_a_swap", sleeps_through_a_swap),
    ("pipeline::rendering_comes_first", rendering_comes_first),
    ("pipeline::spatial_after_update", spatial_after_update),
    ("pipeline::spatial_after_render", spatial_after_render),
    ("pipeline::spatial_after_swap", spatial_after_swap),
    ("pipeline::pairwise_after_update", pairwise_after_update),
    ("pipeline::pairwise_after_render", pairwise_after_render),
    ("pipeline::pairwise_after_swap", pairwise_after_swap),
    ("pipeline::pools_come_round", pools_come_round),
    ("pipeline::two_tokens", two_tokens),
    ("pipeline::shared_renderer", shared_renderer),
    ("pipeline::solitary_unit", solitary_unit),
    ("pipeline::letters", letters),
    ("pipeline::errors_do_no_harm", errors_do_no_harm),
    ("pipeline::within", within),
    SEVERAL_INTERACTIONS[0],
    ("pipeline::finished_shows_all", finished_shows_all),
];

/// Units that wait for more than one interaction, which two workers may end.
pub(crate) const SEVERAL_INTERACTIONS: &[Model] = &[("pipeline::three_pairs", three_pairs)];

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

/// A worker that goes from thread to thread. It is not asked to leave a model that has failed:
/// what it shared is gone by then.
struct Moving(Option<Worker<'static, 'static, World>>);

impl Moving {
    fn at(pipeline: &'static Piped<Spin>, home: u32) -> Self {
        Self(Some(pipeline.worker_at(home)))
    }

    fn worker(&mut self) -> &mut Worker<'static, 'static, World> {
        self.0.as_mut().unwrap()
    }

    /// With a token for `screen`, if one is left.
    fn hold(&mut self, pipeline: &'static Piped<Spin>, screen: Screen) {
        if let Ok(token) = pipeline.token(screen) {
            assert!(self.worker().hold(token).is_ok());
        }
    }

    fn step(&mut self, world: &World) -> Step {
        step(self.worker(), world)
    }

    /// Steps until `event`, however long others keep this worker waiting.
    fn step_until(&mut self, world: &World, event: Event) {
        while !lock(&world.journal).contains(&event) {
            if self.step(world) == Step::Idle {
                loom::thread::yield_now();
            }
        }
    }

    /// Finishes the run, alone.
    fn finish(mut self, pipeline: &'static Piped<Spin>, world: &World) -> Vec<Event> {
        let mut idle = 0;
        while !pipeline.finished() {
            idle = if self.step(world) == Step::Idle { idle + 1 } else { 0 };
            assert!(idle < 4, "unfinished, and no work to be seen: {:?}", lock(&world.journal));
        }
        verify(pipeline, world)
    }
}

impl Drop for Moving {
    fn drop(&mut self) {
        if std::thread::panicking() {
            std::mem::forget(self.0.take());
        }
    }
}

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
    let mut expected: Vec<_> = alone.into_iter().chain(both).collect();
    if setup.units > 2 {
        // One of several pairs of units is met before another unit is rendered.
        expected.push(([false, true], BeforeSwap));
    }
    if setup.shared {
        // Who finds the renderer taken enters the next frame before it renders: without a window always.
        expected.retain(|&(did, _)| did != [false, false]);
        expected.extend(did[..3].iter().map(|&did| (did, BeforeRender)));
    }
    if setup.solitary_from < setup.units {
        // With one unit more to turn to, frames overlap wherever the window lies.
        expected = vec![([false, false], BeforeRender)];
        let somebody = did.into_iter().skip(1);
        expected.extend(somebody.flat_map(|did| overlaps.iter().map(move |&over| (did, over))));
    }
    let body = move |order: usize| -> Outcome {
        let (pipeline, world) = build(setup);
        let screen: Screen = lend(Guarded::new(0));
        let mut workers = [Moving::at(pipeline, 0), Moving::at(pipeline, 1)];
        // The second holds one only if there are two.
        workers.iter_mut().for_each(|worker| worker.hold(pipeline, screen));
        for turn in 0..order / 2 {
            workers[turn % 2].step(world);
        }
        let role = |mut worker: Moving, leaves: bool| -> Role<(bool, Option<Moving>)> {
            Box::new(move || {
                let mut did = false;
                for _ in 0..window {
                    did |= worker.step(world) != Step::Idle;
                }
                (did, (!leaves).then_some(worker))
            })
        };
        let [holder, other] = workers;
        let holder_leaves = order / 2 % 2 == 1;
        let parts = together(order, vec![role(holder, holder_leaves), role(other, !holder_leaves)]);
        let did = [parts[0].0, parts[1].0];
        let mut left: Vec<_> = parts.into_iter().filter_map(|(_, worker)| worker).collect();
        let mut last = left.remove(0);
        if last.worker().renderer().is_none() {
            last.hold(pipeline, screen);
        }
        (did, overlap(&last.finish(pipeline, world)))
    };
    check(name, Some(bound), 2 * starts, expected, body);
}

fn run(name: &str, broad_phase: BroadPhase, entry: Entry) {
    // What each entry forbids is not among them. Who renders a unit last also swaps, and does so
    // before it does anything else. What it let go another worker may meet in between, but those steps
    // touch nothing that the swap does, and loom does not vary their order.
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
    for broad_phase in [BroadPhase::Spatial, BroadPhase::Pairwise] {
        let setup = Setup { frames: 4, broad_phase, ..Setup::default() };
        two_workers("pipeline::pools_come_round", setup, (1, 3, 34), ANY);
    }
}

/// Both workers hold a token: two render at once, one swaps, no one renders ahead.
fn two_tokens() {
    let setup = Setup { tokens: 2, ..Setup::default() };
    two_workers("pipeline::two_tokens", setup, (2, 3, 20), ANY);
}

/// Whoever updates a unit renders it, at once or when the other is not rendering any more.
fn shared_renderer() {
    let setup = Setup { shared: true, ..Setup::default() };
    two_workers("pipeline::shared_renderer", setup, (2, 3, 20), ANY);
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

/// Two units that interact with each other and each with itself, as blocks of objects do.
fn within() {
    let setup = Setup { within: true, ..Setup::default() };
    two_workers("pipeline::within", setup, (1, 2, 20), ANY);
}

/// Three units, each pair of which interacts: a unit that enters last finds two, and its worker
/// carries one and queues the other.
fn three_pairs() {
    let setup = Setup { units: 3, ..Setup::default() };
    two_workers("pipeline::three_pairs", setup, (1, 2, 26), ANY);
}

/// In whatever order two workers step, the holder renders whenever a rendering waits: what it
/// carries must not starve it. Nothing runs at once here.
fn rendering_comes_first() {
    check("pipeline::rendering_comes_first", None, 1 << 10, [()], |order| {
        let setup = Setup { entry: Entry::AfterRender, ..Setup::default() };
        let (pipeline, world) = build(setup);
        let mut workers = [Moving::at(pipeline, 0), Moving::at(pipeline, 1)];
        workers[0].hold(pipeline, lend(Guarded::new(0)));
        let turns = (0..10).map(|turn| order >> turn & 1).chain((0..).map(|turn| turn % 2));
        for turn in turns.take_while(|_| !pipeline.finished()).take(40) {
            let logged = |event| lock(&world.journal).contains(&event);
            let frame = pipeline.frame().0;
            let waits = |unit| logged(Updated(unit, frame)) && !logged(Rendered(unit, frame));
            let due = turn == 0 && (waits(0) || waits(1));
            let did = workers[turn].step(world);
            assert!(!due || did == Step::Worked(Stage::Render), "a rendering waits: {did:?}");
        }
        verify(pipeline, world);
    });
}

/// Two units that do not interact, two tokens: unit 0 is rendered in frame 0, unit 1 waits for it.
fn half_rendered(frames: u32) -> (&'static Piped<Spin>, &'static World, Screen, Moving) {
    let setup = Setup { units: 2, frames, tokens: 2, solitary_from: 0, ..Setup::default() };
    let (pipeline, world) = build(setup);
    let screen: Screen = lend(Guarded::new(0));
    let mut worker = Moving::at(pipeline, 0);
    worker.step_until(world, Updated(1, 0));
    // Somebody has come for both units of the frame that this opened: from now on they wait for their renderings only.
    assert_eq!(Moving::at(pipeline, 0).step(world), Step::Idle);
    worker.hold(pipeline, screen);
    worker.step_until(world, Rendered(0, 0));
    (pipeline, world, screen, worker)
}

/// One holder renders the frame's last unit and swaps while another is about to render the next
/// frame's first one.
fn two_holders_at_a_swap() {
    let worked = [Stage::Update, Stage::Render].map(Step::Worked);
    let expected = [Step::Idle].into_iter().chain(worked).map(|step| format!("{step:?}"));
    check("pipeline::two_holders_at_a_swap", Some(2), 2, expected, |order| {
        let (pipeline, world, screen, mut swaps) = half_rendered(2);
        drop(swaps.worker().release());
        swaps.step_until(world, Updated(0, 1));
        swaps.hold(pipeline, screen);
        let mut follows = Moving::at(pipeline, 0);
        follows.hold(pipeline, screen);
        let swap: Role<(Step, Moving)> = Box::new(move || (swaps.step(world), swaps));
        let follow: Role<(Step, Moving)> = Box::new(move || (follows.step(world), follows));
        let mut parts = together(order, vec![swap, follow]);
        let (did, last) = parts.remove(1);
        drop(parts);
        last.finish(pipeline, world);
        format!("{did:?}")
    });
}

/// One holder renders the frame's last unit and swaps while another goes on with the next frame: what
/// that one updates it may not render before the swap, however long that takes. It may update both units before that:
/// who swaps has let go what it carried.
fn rendering_waits_for_a_swap() {
    let [update, render] = [Stage::Update, Stage::Render].map(Step::Worked);
    let idle = Step::Idle;
    let expected = [
        [idle, idle],
        [idle, update],
        [render, render],
        [render, update],
        [update, idle],
        [update, render],
        [update, update],
    ];
    let expected = expected.map(|did| format!("{did:?}"));
    check("pipeline::rendering_waits_for_a_swap", Some(2), 2, expected, |order| {
        let (pipeline, world, screen, mut swaps) = half_rendered(2);
        let mut goes_on = Moving::at(pipeline, 0);
        goes_on.hold(pipeline, screen);
        let swap: Role<([Step; 2], Moving)> =
            Box::new(move || ([swaps.step(world), Step::Idle], swaps));
        let go_on: Role<([Step; 2], Moving)> =
            Box::new(move || ([0, 1].map(|_| goes_on.step(world)), goes_on));
        let mut parts = together(order, vec![swap, go_on]);
        let (did, last) = parts.remove(1);
        drop(parts);
        last.finish(pipeline, world);
        format!("{did:?}")
    });
}

/// A holder looks which frame is on display and is suspended through the swap, until the queue that
/// it looked at holds a unit of the frame after next: it must not render that.
fn sleeps_through_a_swap() {
    let worked = [Stage::Update, Stage::Render].map(Step::Worked);
    let expected = [Step::Idle].into_iter().chain(worked).map(|step| format!("{step:?}"));
    check("pipeline::sleeps_through_a_swap", Some(1), 2, expected, |order| {
        let (pipeline, world, screen, mut busy) = half_rendered(3);
        let mut sleepy = Moving::at(pipeline, 0);
        sleepy.hold(pipeline, screen);
        let pass: Role<Option<Step>> = Box::new(move || {
            busy.step_until(world, Rendered(0, 1));
            // Without a token it leaves the other unit's rendering to others, and goes on.
            drop(busy.worker().release());
            busy.step_until(world, Updated(0, 2));
            None
        });
        let look: Role<Option<Step>> = Box::new(move || Some(sleepy.step(world)));
        let did = together(order, vec![pass, look])[1].unwrap();
        let mut last = Moving::at(pipeline, 0);
        last.hold(pipeline, screen);
        last.finish(pipeline, world);
        format!("{did:?}")
    });
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
