//! A small environment that checks every callback, for the models of the whole pipeline.

use super::cost::{metered, note};
use super::{Guarded, lend, lend_slice, lock};
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

/// What a callback saw.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Event {
    /// Two units were tested in a frame, or one asked whether it interacts with itself, and does.
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

/// A callback that takes until a unit is rendered in frame 0.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Patience {
    /// None does.
    None,
    /// Unit 0's entry into frame 1, until unit 1 is.
    Entry,
    /// Unit 1's update in frame 0, until unit 3 is.
    Update,
}

/// Size and configuration of a model.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Setup {
    /// Units; each two of them interact, unless they are `far`.
    pub(crate) units: u32,
    /// Whether no bounding volumes overlap.
    pub(crate) far: bool,
    /// Whether each also interacts with itself; for `Spatial`, not `far`.
    pub(crate) within: bool,
    /// Frames.
    pub(crate) frames: u32,
    /// Kind of broad phase.
    pub(crate) broad_phase: BroadPhase,
    /// Overlap of frames.
    pub(crate) entry: Entry,
    /// Render tokens.
    pub(crate) tokens: u32,
    /// Whether the renderer is left to all workers.
    pub(crate) shared: bool,
    /// What takes long.
    pub(crate) patience: Patience,
    /// Units from this number on are solitary.
    pub(crate) solitary_from: u32,
    /// Whether unit 0 posts a letter to the last unit in every update.
    pub(crate) letters: bool,
    /// Whether every callback returns an error, after its work.
    pub(crate) fail: bool,
}

impl Default for Setup {
    fn default() -> Self {
        Self::DEFAULT
    }
}

impl Setup {
    pub(crate) const DEFAULT: Self = Self {
        units: 2,
        far: false,
        within: false,
        frames: 2,
        broad_phase: BroadPhase::Spatial,
        entry: Entry::AfterUpdate,
        tokens: 1,
        shared: false,
        patience: Patience::None,
        solitary_from: u32::MAX,
        letters: false,
        fail: false,
    };

    pub(crate) fn pairs(&self) -> Vec<[u32; 2]> {
        let social = self.units.min(self.solitary_from);
        let others = |b| if self.within { 0..b + 1 } else { 0..b };
        (0..social).flat_map(|b| others(b).map(move |a| [a, b])).collect()
    }
}

/// The environment. Its journal is a std mutex, which loom does not see: it adds no ordering.
pub(crate) struct World {
    setup: Setup,
    pub(crate) journal: Mutex<Vec<Event>>,
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

    fn await_rendering(&self, unit: u32) {
        while !lock(&self.journal).contains(&Rendered(unit, 0)) {
            loom::thread::yield_now();
        }
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
        let near = !self.setup.far;
        note(|did| (did.tests, did.found) = (did.tests + 1, did.found + u32::from(near)));
        near
    }

    fn interacts_within(&self, body: &Body) -> bool {
        if self.setup.patience == Patience::Entry && (body.id, body.updates) == (0, 1) {
            self.await_rendering(1);
        }
        if self.setup.within {
            self.log(Met([body.id; 2], body.updates));
            note(|did| did.found += 1);
        }
        self.setup.within
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
        note(|did| (did.stage, did.pushes) = (Stage::Interaction, 2));
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
        note(|did| did.stage = Stage::Update);
        if self.setup.patience == Patience::Update && (unit.0, frame.0) == (1, 0) {
            self.await_rendering(3);
        }
        let mut before = None;
        for interaction in inputs.interactions() {
            assert!(before < Some(interaction.other), "interactions in pair order");
            before = Some(interaction.other);
            note(|did| did.candidates += 1);
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
            note(|did| did.posts += 1);
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
        note(|did| did.stage = Stage::Render);
        assert_eq!((unit.0, frame.0 + 1), (body.id, body.updates), "rendered as updated");
        assert_eq!(screen.get(), frame.0, "all frames before are swapped, this one is not");
        self.log(Rendered(unit.0, frame.0));
        self.outcome()
    }

    fn swap(&self, frame: Frame, screen: &mut Screen) -> Result<(), Failure> {
        assert_eq!(screen.get(), frame.0, "frames swap in order");
        screen.set(frame.0 + 1);
        note(|did| did.swaps = true);
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
    let queues = queue_slots(units, interactions.len(), letters, HOMES);
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
    let config = Config { broad_phase, entry, tokens, homes: HOMES as u32 };
    let pipeline = lend(Pipeline::new(memory, config, waiting).unwrap());
    pipeline.run(setup.frames).unwrap();
    if setup.shared {
        let screen: Screen = lend(Guarded::new(0));
        assert!(pipeline.share(screen).is_ok());
    }
    (pipeline, lend(World { setup, journal: Mutex::default(), values: Mutex::new(vec![0; units]) }))
}

/// Of two units each has a home of its own, so that workers meet both at home and elsewhere.
pub(crate) const HOMES: usize = 2;

/// A pipeline whose workers spin where they wait.
pub(crate) fn build(setup: Setup) -> (&'static Piped<Spin>, &'static World) {
    build_with(setup, Spin)
}

/// One step; asserts that it fails only where it was asked to, and what it cost.
pub(crate) fn step<W: Waiting>(
    worker: &mut Worker<'static, 'static, World, W>,
    world: &World,
) -> Step {
    step_metered(worker, world, None)
}

/// A step with which nobody interferes; `opens` says whether it opens a frame.
pub(crate) fn step_alone<W: Waiting>(
    worker: &mut Worker<'static, 'static, World, W>,
    world: &World,
    opens: bool,
) -> Step {
    step_metered(worker, world, Some(opens))
}

fn step_metered<W: Waiting>(
    worker: &mut Worker<'static, 'static, World, W>,
    world: &World,
    opens: Option<bool>,
) -> Step {
    match metered(world.setup.units, opens, || worker.step(world)) {
        Ok(step) => {
            // Entering a frame calls nothing that could fail.
            let may_succeed = matches!(step, Step::Idle | Step::Worked(Stage::BroadPhase));
            assert!(!world.setup.fail || may_succeed, "an error is lost: {step:?}");
            step
        }
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
            pairs.retain(|pair| !setup.far && pair.contains(&(unit as u32)));
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

/// Checks a finished run (invariants 1 to 3, 6, 9, and 4, which follows from 2 and 3) and returns the order of its
/// callbacks.
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
            expected += if setup.far { 1 } else { 2 };
            if !setup.far {
                before(Met(pair, frame), Interacted(pair, frame));
            }
            for end in pair {
                if !setup.far {
                    before(Interacted(pair, frame), Updated(end, frame));
                }
                before(Met(pair, frame), Updated(end, frame));
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
