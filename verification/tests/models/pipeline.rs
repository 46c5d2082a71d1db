//! The whole pipeline: the real code, a small environment that checks every callback.

use super::{Guarded, Model, Role, check, lend, lend_slice, lock, together};
use dualframe_core_model::contacts::{ContactSlot, Contacts, SegmentSlot};
use dualframe_core_model::environment::{Environment, Pair};
use dualframe_core_model::error::TableFull;
use dualframe_core_model::frame::{Entry, Frame};
use dualframe_core_model::inbox::LetterSlot;
use dualframe_core_model::inputs::Inputs;
use dualframe_core_model::pipeline::{BroadPhase, Config, Pipeline};
use dualframe_core_model::ring::QueueSlot;
use dualframe_core_model::stage::Stage;
use dualframe_core_model::storage::{InteractionSlot, Memory, UnitSlot, queue_slots};
use dualframe_core_model::unit::UnitId;
use dualframe_core_model::wait::{Spin, Waiting};
use dualframe_core_model::worker::{Step, Worker};
use std::sync::Mutex;

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

/// What a callback saw.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Event {
    /// Two units were tested in a frame.
    Met([u32; 2], u32),
    /// An interaction was detected.
    Interacted([u32; 2], u32),
    /// A unit was updated.
    Updated(u32, u32),
    /// A unit was rendered.
    Rendered(u32, u32),
    /// A frame was swapped.
    Swapped(u32),
}
use Event::{Interacted, Met, Rendered, Swapped, Updated};

/// A unit's object.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Body {
    id: u32,
    /// Updates so far.
    updates: u32,
    value: u32,
}

/// Size and configuration of a model.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Setup {
    /// Units; each two of them interact.
    pub(crate) units: u32,
    /// Frames.
    pub(crate) frames: u32,
    /// Kind of broad phase.
    pub(crate) broad_phase: BroadPhase,
    /// Overlap of frames.
    pub(crate) entry: Entry,
    /// Render tokens.
    pub(crate) tokens: u32,
    /// Units from this number on are solitary.
    pub(crate) solitary_from: u32,
    /// Whether unit 0 posts a letter to the last unit in every update.
    pub(crate) letters: bool,
    /// Whether every callback returns an error, after its work.
    pub(crate) fail: bool,
}

impl Default for Setup {
    fn default() -> Self {
        Self {
            units: 2,
            frames: 2,
            broad_phase: BroadPhase::Spatial,
            entry: Entry::AfterUpdate,
            tokens: 1,
            solitary_from: u32::MAX,
            letters: false,
            fail: false,
        }
    }
}

impl Setup {
    fn pairs(&self) -> Vec<[u32; 2]> {
        let social = self.units.min(self.solitary_from);
        (0..social).flat_map(|b| (0..b).map(move |a| [a, b])).collect()
    }
}

/// The environment. Its journal is a std mutex, which loom does not see: it adds no ordering.
pub(crate) struct World {
    setup: Setup,
    journal: Mutex<Vec<Event>>,
    /// Every unit's value after its last update.
    values: Mutex<Vec<u32>>,
}

/// What the token guards: rendering shares it, swapping has it alone.
pub(crate) type Screen = &'static Guarded<u32>;

/// A callback's error, or a full table.
#[derive(Debug)]
pub(crate) enum Failure {
    /// As `Setup::fail` asks for.
    Asked,
    /// No model wants one.
    Full(TableFull),
}

impl From<TableFull> for Failure {
    fn from(full: TableFull) -> Self {
        Self::Full(full)
    }
}

fn response(a: u32, b: u32, frame: u32) -> u32 {
    a.wrapping_mul(7).wrapping_add(b.wrapping_mul(13)).wrapping_add(frame)
}

/// One term of an update; not commutative, so that the order of the terms shows.
fn fold(value: u32, term: u32) -> u32 {
    value.wrapping_mul(31).wrapping_add(term)
}

impl World {
    fn log(&self, event: Event) {
        lock(&self.journal).push(event);
    }

    fn outcome(&self) -> Result<(), Failure> {
        if self.setup.fail { Err(Failure::Asked) } else { Ok(()) }
    }
}

impl Environment for World {
    type Object = Body;
    type Interaction = u32;
    type Contact = u32;
    type Message = u32;
    type Renderer = Screen;
    type Error = Failure;

    fn broad_phase(&self, a: &Body, b: &Body) -> bool {
        assert_eq!(a.updates, b.updates, "both ends are in one frame");
        self.log(Met([a.id.min(b.id), a.id.max(b.id)], a.updates));
        true
    }

    fn interact(
        &self,
        pair: Pair,
        a: &Body,
        b: &Body,
        state: &mut u32,
        contacts: &mut Contacts<'_, '_, u32>,
    ) -> Result<(), Failure> {
        assert_eq!([a.id, b.id], pair.ends.map(|end| end.0));
        assert_eq!([a.updates, b.updates], [pair.frame.0; 2], "interact between the updates");
        *state = pair.frame.0;
        let result = response(a.value, b.value, pair.frame.0);
        contacts.push(&[result])?;
        contacts.push(&[result ^ 1])?;
        self.log(Interacted([a.id, b.id], pair.frame.0));
        self.outcome()
    }

    fn update(
        &self,
        unit: UnitId,
        frame: Frame,
        body: &mut Body,
        inputs: &mut Inputs<'_, '_, Self>,
    ) -> Result<(), Failure> {
        assert_eq!((unit.0, frame.0), (body.id, body.updates), "updates in order");
        let mut before = None;
        for interaction in inputs.interactions() {
            assert!(before < Some(interaction.other), "interactions in pair order");
            before = Some(interaction.other);
            assert_eq!(*interaction.state, frame.0, "the interaction of this frame");
            for segment in interaction.contacts {
                body.value = segment.iter().fold(body.value, |value, &term| fold(value, term));
            }
        }
        while let Some((from, message)) = inputs.next_letter() {
            assert_eq!((from.sender, from.sequence), (0, 0));
            assert_eq!(message + 1, frame.0, "posted in the frame before");
            body.value = fold(body.value, message);
        }
        if self.setup.letters && unit.0 == 0 {
            let posted = inputs.post(UnitId(self.setup.units - 1), 0, frame.0);
            assert!(posted.is_ok(), "letters for two frames");
        }
        body.updates += 1;
        lock(&self.values)[unit.index()] = body.value;
        self.log(Updated(unit.0, frame.0));
        self.outcome()
    }

    fn render(
        &self,
        unit: UnitId,
        frame: Frame,
        body: &Body,
        screen: &mut Screen,
    ) -> Result<(), Failure> {
        assert_eq!((unit.0, frame.0 + 1), (body.id, body.updates), "rendered as updated");
        assert_eq!(screen.get(), frame.0, "all frames before are swapped, this one is not");
        self.log(Rendered(unit.0, frame.0));
        self.outcome()
    }

    fn swap(&self, frame: Frame, screen: &mut Screen) -> Result<(), Failure> {
        assert_eq!(screen.get(), frame.0, "frames swap in order");
        screen.set(frame.0 + 1);
        self.log(Swapped(frame.0));
        self.outcome()
    }
}

/// The pipeline of a model.
pub(crate) type Piped<W> = Pipeline<'static, World, W>;

/// A pipeline with its frames let run.
pub(crate) fn build_with<W: Waiting + 'static>(
    setup: Setup,
    waiting: W,
) -> (&'static Piped<W>, &'static World) {
    let units = setup.units as usize;
    let pairs = setup.pairs();
    let interactions = match setup.broad_phase {
        BroadPhase::Pairwise => lend(
            pairs
                .iter()
                .map(|&[a, b]| InteractionSlot::between(UnitId(b), UnitId(a), 0))
                .collect::<Vec<_>>(),
        ),
        BroadPhase::Spatial => {
            lend((0..2 * pairs.len()).map(|_| InteractionSlot::spare(0)).collect())
        }
    };
    // Exactly what two frames need.
    let contacts = 4 * pairs.len();
    let letters = if setup.letters { 2 } else { 0 };
    let queues = queue_slots(units, interactions.len(), letters);
    let unit = |id: usize| {
        let body = Body { id: id as u32, updates: 0, value: id as u32 + 1 };
        if body.id >= setup.solitary_from { UnitSlot::solitary(body) } else { UnitSlot::new(body) }
    };
    let memory = Memory {
        units: lend_slice(units, unit),
        interactions,
        contacts: lend_slice(contacts, |_| ContactSlot::new()),
        segments: lend_slice(contacts, |_| SegmentSlot::new()),
        letters: lend_slice(letters, |_| LetterSlot::new()),
        queues: lend_slice(queues, |_| QueueSlot::new()),
    };
    let Setup { broad_phase, entry, tokens, .. } = setup;
    let config = Config { broad_phase, entry, tokens };
    let pipeline = lend(Pipeline::new(memory, config, waiting).unwrap());
    pipeline.run(setup.frames).unwrap();
    (pipeline, lend(World { setup, journal: Mutex::default(), values: Mutex::new(vec![0; units]) }))
}

/// A pipeline whose workers spin where they wait.
pub(crate) fn build(setup: Setup) -> (&'static Piped<Spin>, &'static World) {
    build_with(setup, Spin)
}

/// One step; asserts that it fails only where it was asked to.
pub(crate) fn step<W: Waiting>(
    worker: &mut Worker<'static, 'static, World, W>,
    world: &World,
) -> Step {
    match worker.step(world) {
        Ok(step) => step,
        Err(Failure::Asked) => {
            assert!(world.setup.fail);
            // The error does not say of which stage it is; nor does any model ask.
            Step::Worked(Stage::Interaction)
        }
        Err(Failure::Full(full)) => panic!("{full}"),
    }
}

/// A worker's life: steps until all frames are swapped.
pub(crate) fn work<W: Waiting>(pipeline: &'static Piped<W>, world: &World, screen: Option<Screen>) {
    let mut worker = pipeline.worker();
    if let Some(screen) = screen {
        let Ok(token) = pipeline.token(screen) else { panic!("a token is left") };
        assert!(worker.hold(token).is_ok());
    }
    while !pipeline.finished() {
        if step(&mut worker, world) == Step::Idle {
            loom::thread::yield_now();
        }
    }
}

/// The values that a plain serial loop computes.
fn serial(setup: Setup) -> Vec<u32> {
    let mut values: Vec<u32> = (1..=setup.units).collect();
    for frame in 0..setup.frames {
        let old = values.clone();
        for (unit, value) in values.iter_mut().enumerate() {
            // In the order of the other end.
            let mut pairs = setup.pairs();
            pairs.retain(|pair| pair.contains(&(unit as u32)));
            pairs.sort_unstable_by_key(|&[a, b]| if a == unit as u32 { b } else { a });
            for [a, b] in pairs {
                let result = response(old[a as usize], old[b as usize], frame);
                *value = fold(fold(*value, result), result ^ 1);
            }
            if setup.letters && unit as u32 == setup.units - 1 && frame > 0 {
                *value = fold(*value, frame - 1);
            }
        }
    }
    values
}

/// Checks a finished run (invariants 1 to 4, 6, 9) and returns the order of its callbacks.
pub(crate) fn verify<W: Waiting>(pipeline: &'static Piped<W>, world: &World) -> Vec<Event> {
    let setup = world.setup;
    assert!(pipeline.finished());
    let journal = lock(&world.journal).clone();
    let at = |event: Event| {
        let mut found = journal.iter().enumerate().filter(|(_, logged)| **logged == event);
        let first = found.next().unwrap_or_else(|| panic!("{event:?} is missing: {journal:?}")).0;
        assert!(found.next().is_none(), "{event:?} twice: {journal:?}");
        first
    };
    let mut expected = 0;
    let before = |first: Event, then: Event| {
        assert!(at(first) < at(then), "{then:?} before {first:?}: {journal:?}");
    };
    for frame in 0..setup.frames {
        for pair in setup.pairs() {
            expected += 2;
            before(Met(pair, frame), Interacted(pair, frame));
            for end in pair {
                before(Interacted(pair, frame), Updated(end, frame));
                if frame > 0 {
                    before(Updated(end, frame - 1), Met(pair, frame));
                }
            }
        }
        for unit in 0..setup.units {
            expected += 2;
            before(Updated(unit, frame), Rendered(unit, frame));
            before(Rendered(unit, frame), Swapped(frame));
            if frame > 0 {
                before(Rendered(unit, frame - 1), Updated(unit, frame));
                before(Swapped(frame - 1), Rendered(unit, frame));
            }
            if frame > 1 {
                before(Swapped(frame - 2), Updated(unit, frame));
            }
            if frame > 0 && setup.entry == Entry::AfterSwap {
                before(Swapped(frame - 1), Updated(unit, frame));
            }
        }
        expected += 1;
    }
    assert_eq!(journal.len(), expected, "nothing else happened: {journal:?}");
    assert_eq!(*lock(&world.values), serial(setup), "the state is the same over all interleavings");
    journal
}

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
        let mut workers = [pipeline.worker(), pipeline.worker()];
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
