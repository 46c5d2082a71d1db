//! Floods: a table that is too small is a typed error that names what it holds and what it would
//! have had to hold; the frame swaps all the same, and nothing is dropped without an error.
#![forbid(unsafe_code)]

use std::sync::atomic::{AtomicUsize, Ordering::SeqCst};

use dualframe_core::contacts::{ContactSlot, Contacts, SegmentSlot};
use dualframe_core::environment::{Environment, Pair};
use dualframe_core::error::{NotShared, SetupError, StillRunning, Table, TableFull};
use dualframe_core::frame::Frame;
use dualframe_core::inbox::{From as Sender, LetterSlot};
use dualframe_core::inputs::Inputs;
use dualframe_core::latest::Latest;
use dualframe_core::pipeline::{BroadPhase, Config, MOST_HOMES, Pipeline};
use dualframe_core::ring::QueueSlot;
use dualframe_core::storage::{InteractionSlot, Memory, UnitSlot, queue_slots};
use dualframe_core::unit::UnitId;
use dualframe_core::wait::Spin;

/// Every two units meet, each unit with itself too; each interaction pushes `records`, each
/// update posts `letters`. What was done and refused is counted.
#[derive(Default)]
struct Flood {
    records: usize,
    letters: usize,
    interactions: AtomicUsize,
    pushes_refused: AtomicUsize,
    contacts_read: AtomicUsize,
    posted: AtomicUsize,
    posts_refused: AtomicUsize,
    read: AtomicUsize,
    swaps: AtomicUsize,
}

impl Environment for Flood {
    type Object = ();
    type Interaction = ();
    type Contact = u32;
    type Message = u32;
    type Renderer = ();
    type Error = TableFull;

    fn broad_phase(&self, (): &(), (): &()) -> bool {
        true
    }

    fn interacts_within(&self, (): &()) -> bool {
        true
    }

    fn interact(
        &self,
        _: Pair,
        (): &(),
        (): &(),
        (): &mut (),
        contacts: &mut Contacts<'_, '_, u32>,
    ) -> Result<(), TableFull> {
        self.interactions.fetch_add(1, SeqCst);
        let pushed = contacts.push(&vec![7; self.records]);
        self.pushes_refused.fetch_add(usize::from(pushed.is_err()), SeqCst);
        pushed
    }

    fn update(
        &self,
        unit: UnitId,
        _: Frame,
        (): &mut (),
        inputs: &mut Inputs<'_, '_, Self>,
    ) -> Result<(), TableFull> {
        for interaction in inputs.interactions() {
            let count = interaction.contacts.flatten().inspect(|&&word| assert_eq!(word, 7));
            self.contacts_read.fetch_add(count.count(), SeqCst);
        }
        while inputs.next_letter().is_some() {
            self.read.fetch_add(1, SeqCst);
        }
        let mut outcome = Ok(());
        for letter in 0..self.letters as u32 {
            match inputs.post(unit, unit.0, letter) {
                Ok(()) => self.posted.fetch_add(1, SeqCst),
                Err(rejected) => {
                    let from = Sender { sender: unit.0, sequence: letter };
                    assert_eq!((rejected.from, rejected.message), (from, letter), "it comes back");
                    outcome = Err(rejected.full);
                    self.posts_refused.fetch_add(1, SeqCst)
                }
            };
        }
        outcome
    }

    fn render(&self, _: UnitId, _: Frame, (): &(), (): &mut ()) -> Result<(), TableFull> {
        Ok(())
    }

    fn swap(&self, _: Frame, (): &mut ()) -> Result<(), TableFull> {
        self.swaps.fetch_add(1, SeqCst);
        Ok(())
    }
}

/// Sizes of tables.
#[derive(Clone)]
struct Sizes {
    units: usize,
    interactions: Vec<[u32; 2]>,
    contacts: usize,
    segments: usize,
    letters: usize,
    queues: Option<usize>,
    config: Config,
}

impl Sizes {
    fn spatial(units: usize, candidates: usize, contacts: usize, letters: usize) -> Self {
        Self {
            units,
            interactions: vec![[u32::MAX; 2]; candidates],
            contacts,
            segments: contacts,
            letters,
            queues: None,
            config: Config::default(),
        }
    }

    fn pairwise(units: usize, ends: &[[u32; 2]]) -> Self {
        let config = Config { broad_phase: BroadPhase::Pairwise, ..Config::default() };
        Self { interactions: ends.to_vec(), config, ..Self::spatial(units, 0, 64, 1) }
    }

    /// Builds a pipeline of these sizes and hands it on.
    fn with<R>(&self, then: impl FnOnce(Result<Pipeline<'_, Flood>, SetupError>) -> R) -> R {
        let needed = queue_slots(self.units, self.interactions.len(), self.letters, 1);
        let queues = self.queues.unwrap_or(needed);
        let slot = |&[a, b]: &[u32; 2]| InteractionSlot::between(UnitId(a), UnitId(b), ());
        let memory = Memory {
            units: &mut Vec::from_iter((0..self.units).map(|_| UnitSlot::new(()))),
            interactions: &mut Vec::from_iter(self.interactions.iter().map(slot)),
            contacts: &mut Vec::from_iter((0..self.contacts).map(|_| ContactSlot::new())),
            segments: &mut Vec::from_iter((0..self.segments).map(|_| SegmentSlot::new())),
            letters: &mut Vec::from_iter((0..self.letters).map(|_| LetterSlot::new())),
            queues: &mut Vec::from_iter((0..queues).map(|_| QueueSlot::new())),
        };
        then(Pipeline::new(memory, self.config, Spin))
    }

    fn refused(&self) -> Option<SetupError> {
        self.with(|pipeline| pipeline.err())
    }

    /// Runs `frames` on one thread and returns the errors of its steps.
    fn run(&self, flood: &Flood, frames: u32) -> Vec<TableFull> {
        self.with(|pipeline| {
            let mut pipeline = pipeline.expect("tables that fit");
            pipeline.run(frames).expect("at rest");
            let errors = drive(&pipeline, flood);
            assert_eq!(flood.swaps.load(SeqCst), frames as usize, "every frame swaps");
            assert_eq!(pipeline.frame(), Frame(frames));
            let (candidates, contacts) = pipeline.high_water();
            for full in &errors {
                let interactions = full.table == Table::Interactions;
                let asked = if interactions { candidates } else { contacts };
                assert!(full.table == Table::Letters || asked >= full.needed, "{asked}: {full}");
            }
            errors
        })
    }
}

/// Steps one worker until the pipeline is at rest.
fn drive(pipeline: &Pipeline<'_, Flood>, flood: &Flood) -> Vec<TableFull> {
    let mut worker = pipeline.worker();
    worker.hold(pipeline.token(()).map_err(drop).expect("a token")).map_err(drop).expect("ours");
    let mut errors = vec![];
    let mut steps = 0;
    while !pipeline.finished() {
        errors.extend(worker.step(flood).err());
        steps += 1;
        assert!(steps < 100_000, "no progress");
    }
    errors
}

fn full(table: Table, capacity: usize, needed: usize) -> TableFull {
    TableFull { table, capacity, needed }
}

#[test]
fn candidates_beyond_the_table() {
    // 6 units: 15 pairs and 6 units with themselves, in each of 3 frames; room for 4 in a frame.
    let flood = Flood::default();
    let errors = Sizes::spatial(6, 8, 0, 1).run(&flood, 3);
    // Each of a frame's errors names what was needed up to then; the last one names it all.
    let needs = [6, 10, 15, 21].map(|needed| full(Table::Interactions, 4, needed));
    assert_eq!(errors, needs.repeat(3));
    assert_eq!(flood.interactions.load(SeqCst), 3 * 4, "what fits is done");
    // The first unit to enter finds itself and the second itself and the first, which leaves room
    // for one more: it and the others all report.
}

#[test]
fn no_room_for_candidates_at_all() {
    for candidates in [0, 1] {
        let flood = Flood::default();
        let errors = Sizes::spatial(3, candidates, 0, 1).run(&flood, 2);
        let needs = [1, 3, 6].map(|needed| full(Table::Interactions, 0, needed));
        assert_eq!(errors, needs.repeat(2));
        assert_eq!(flood.interactions.load(SeqCst), 0);
    }
}

#[test]
fn exactly_enough_candidates_are_enough() {
    let flood = Flood::default();
    assert_eq!(Sizes::spatial(6, 2 * 21, 0, 1).run(&flood, 5), []);
    assert_eq!(flood.interactions.load(SeqCst), 5 * 21);
}

#[test]
fn more_pairs_than_are_counted_together() {
    // Whoever enters last finds 40 others at once, or 39 and itself.
    let flood = Flood::default();
    assert_eq!(Sizes::spatial(40, 2 * 820, 0, 1).run(&flood, 3), []);
    assert_eq!(flood.interactions.load(SeqCst), 3 * 820);
    let star: Vec<_> = (0..40).map(|unit| [unit, 40]).collect();
    let flood = Flood::default();
    assert_eq!(Sizes::pairwise(41, &star).run(&flood, 3), []);
    assert_eq!(flood.interactions.load(SeqCst), 3 * 40);
}

#[test]
fn contacts_beyond_the_table() {
    // 6 interactions a frame, 3 records each, room for 8 in a frame: 2 pushes fit, 4 do not.
    let flood = Flood { records: 3, ..Flood::default() };
    let mut errors = Sizes::spatial(3, 12, 16, 1).run(&flood, 4);
    // The interactions of two frames may alternate.
    errors.sort_by_key(|error| error.needed);
    let needs = [9, 12, 15, 18].map(|needed| [full(Table::Contacts, 8, needed); 4]);
    assert_eq!(errors, needs.concat());
    assert_eq!(flood.interactions.load(SeqCst), 4 * 6);
    assert_eq!(flood.pushes_refused.load(SeqCst), errors.len(), "no push is lost silently");
    // Each record is read by each end: the pushes that fit, wholly, and nothing of the others.
    let read = flood.contacts_read.load(SeqCst);
    assert!(read.is_multiple_of(3) && (4 * 2 * 3..=4 * 2 * 6).contains(&read), "{read}");
}

#[test]
fn a_push_longer_than_the_table() {
    let flood = Flood { records: 100, ..Flood::default() };
    let errors = Sizes::spatial(1, 2, 16, 1).run(&flood, 3);
    assert_eq!(errors, [full(Table::Contacts, 8, 100); 3]);
    assert_eq!(flood.contacts_read.load(SeqCst), 0);
}

#[test]
fn letters_beyond_the_pool() {
    // 2 units post 3 letters each in each of 5 frames; room for 4 under way.
    let flood = Flood { letters: 3, ..Flood::default() };
    let sizes = Sizes::spatial(2, 6, 0, 4);
    let errors = sizes.run(&flood, 5);
    assert!(!errors.is_empty());
    assert!(errors.iter().all(|&error| error == full(Table::Letters, 4, 5)), "{errors:?}");
    let [posted, refused, read] =
        [&flood.posted, &flood.posts_refused, &flood.read].map(|count| count.load(SeqCst));
    assert_eq!(posted + refused, 2 * 3 * 5);
    // What is not read is what was posted in the last frame, and that fits the pool.
    assert!(read <= posted && posted - read <= 4, "{posted} posted, {read} read");
    assert!(read >= 4 * 4, "a letter slot is free again when its letter is read: {read}");
}

#[test]
fn letters_from_outside_beyond_the_pool() {
    Sizes::spatial(2, 6, 0, 3).with(|pipeline| {
        let mut pipeline = pipeline.expect("tables that fit");
        let flood = Flood::default();
        for round in 0..3_usize {
            for sequence in 0..3 {
                let from = Sender { sender: 9, sequence };
                assert_eq!(pipeline.post(UnitId(1), from, 40 + sequence), Ok(()));
            }
            let from = Sender { sender: 9, sequence: 3 };
            let rejected = pipeline.post(UnitId(0), from, 43).expect_err("no room");
            assert_eq!((rejected.message, rejected.full), (43, full(Table::Letters, 3, 4)));
            pipeline.run(1).expect("at rest");
            assert_eq!(drive(&pipeline, &flood), []);
            assert_eq!(flood.read.load(SeqCst), 3 * (round + 1), "all that were taken are read");
        }
    });
}

#[test]
fn letters_to_nobody() {
    Sizes::spatial(2, 6, 0, 3).with(|pipeline| {
        let pipeline = pipeline.expect("tables that fit");
        for (nobody, needed) in [(2, 3), (u32::MAX, 1 << 32)] {
            let from = Sender { sender: 9, sequence: 0 };
            let rejected = pipeline.post(UnitId(nobody), from, 41).expect_err("nobody's letter");
            assert_eq!((rejected.message, rejected.full), (41, full(Table::Units, 2, needed)));
        }
    });
}

#[test]
fn memory_that_does_not_fit() {
    let good = Sizes::spatial(5, 20, 10, 3);
    assert_eq!(good.refused(), None);
    let needed = queue_slots(5, 20, 3, 1);
    // Two queues of the home and two of rendering; interactions; free letters; arrivals and the home's units.
    let [of_units, others] = [8, 4 + 2 * 5];
    assert_eq!(needed, 4 * of_units + 32 + others);
    assert_eq!(
        queue_slots(5, 20, 3, 3),
        8 * of_units + 3 * 8 + others,
        "seven interactions at each"
    );
    let most = queue_slots(5, 65, 3, MOST_HOMES);
    assert_eq!(queue_slots(5, 65, 3, MOST_HOMES + 1), most, "there are no more homes than that");
    assert_eq!(queue_slots(5, 20, 3, 0), needed, "there is always one home");
    for queues in [0, needed - 1] {
        let few = Sizes { queues: Some(queues), ..good.clone() };
        assert_eq!(few.refused(), Some(SetupError::Table(full(Table::Queues, queues, needed))));
    }
    assert_eq!(Sizes { queues: Some(needed + 5), ..good.clone() }.refused(), None);
    assert_eq!(Sizes { units: 0, ..good.clone() }.refused(), Some(SetupError::NoUnits));
    let unequal = SetupError::UnequalContacts { contacts: 10, segments: 9 };
    assert_eq!(Sizes { segments: 9, ..good }.refused(), Some(unequal));
    // Where a word has 32 bits refused claims are added to one half of it at most.
    let narrow = 2 * usize::from(u16::MAX);
    let wide = Sizes::spatial(5, 20, narrow + 1, 3).refused();
    let refused = SetupError::Table(full(Table::Contacts, narrow, narrow + 1));
    assert_eq!(wide, (usize::BITS == 32).then_some(refused));
}

#[test]
fn interactions_that_join_nothing() {
    for ends in [[0, 0], [0, 3], [3, 1], [u32::MAX, 0], [u32::MAX; 2]] {
        let bad = Sizes::pairwise(3, &[[0, 1], ends, [1, 2]]);
        let expected = SetupError::BadEnds { interaction: 1, ends: ends.map(UnitId) };
        assert_eq!(bad.refused(), Some(expected));
    }
    assert_eq!(Sizes::pairwise(3, &[[0, 1], [1, 0], [2, 1]]).refused(), None);
}

#[test]
fn as_many_tokens_as_there_are() {
    for tokens in [0, 1, 3] {
        let sizes = Sizes::spatial(1, 2, 0, 1);
        let sizes = Sizes { config: Config { tokens, ..sizes.config }, ..sizes };
        sizes.with(|pipeline| {
            let pipeline = pipeline.expect("tables that fit");
            let capacity = tokens as usize;
            let mut held = vec![];
            for _ in 0..3 {
                held.extend((0..tokens).map(|_| pipeline.token(()).map_err(drop).expect("one")));
                let error = pipeline.token(()).map_err(|((), error)| error).expect_err("all out");
                assert_eq!(error, full(Table::Tokens, capacity, capacity + 1));
                held.clear();
            }
        });
    }
}

#[test]
fn all_tokens_or_a_shared_renderer() {
    for tokens in [0, 1, 3] {
        let sizes = Sizes::spatial(1, 2, 0, 1);
        let sizes = Sizes { config: Config { tokens, ..sizes.config }, ..sizes };
        sizes.with(|pipeline| {
            let mut pipeline = pipeline.expect("tables that fit");
            let capacity = tokens as usize;
            let none_left = Err(((), full(Table::Tokens, capacity, capacity + 1)));
            let not_shared = Err(((), NotShared { tokens }));
            assert_eq!(pipeline.take_back(), None);
            if tokens == 0 {
                assert_eq!(pipeline.share(()), not_shared);
                return;
            }
            assert_eq!(pipeline.share(()), Ok(()));
            assert_eq!(pipeline.token(()).map(drop), none_left);
            assert_eq!(pipeline.share(()), not_shared, "there is one");
            assert_eq!(pipeline.take_back(), Some(()));
            assert_eq!(pipeline.take_back(), None);
            std::mem::forget(pipeline.token(()));
            assert_eq!(pipeline.share(()), not_shared, "one is out");
        });
    }
}

#[test]
fn no_token_of_another_pipeline_and_no_second_one() {
    let sizes = Sizes::spatial(1, 2, 0, 1);
    let sizes = Sizes { config: Config { tokens: 2, ..sizes.config }, ..sizes };
    sizes.with(|ours| {
        sizes.with(|theirs| {
            let (ours, theirs) = (ours.expect("fits"), theirs.expect("fits"));
            let mut worker = ours.worker();
            let foreign = theirs.token(()).map_err(drop).expect("one");
            assert!(worker.hold(foreign).is_err());
            assert!(worker.hold(ours.token(()).map_err(drop).expect("one")).is_ok());
            assert!(worker.hold(ours.token(()).map_err(drop).expect("two")).is_err());
        });
    });
}

#[test]
fn no_run_while_running() {
    Sizes::spatial(2, 6, 0, 1).with(|pipeline| {
        let mut pipeline = pipeline.expect("tables that fit");
        pipeline.run(2).expect("at rest");
        assert_eq!(pipeline.run(1), Err(StillRunning));
        let flood = Flood::default();
        drive(&pipeline, &flood);
        assert_eq!(pipeline.run(0), Ok(()));
        assert!(pipeline.finished(), "no frame was added");
        pipeline.run(1).expect("at rest");
        drive(&pipeline, &flood);
        assert_eq!(flood.swaps.load(SeqCst), 3);
    });
}

#[test]
fn readers_beyond_the_cell() {
    let mut cell = Latest::<u32, 5>::new(1);
    let (mut writer, readers) = cell.split();
    for value in 2..5 {
        let mut held = vec![];
        for _ in 0..3 {
            held.push(readers.reader().expect("room for three"));
        }
        for _ in 0..3 {
            assert_eq!(readers.reader().err(), Some(full(Table::Readers, 3, 4)));
        }
        // A refused reader takes nothing: the writer still finds room, the others still read.
        for _ in 0..20 {
            writer.publish(value);
        }
        assert!(held.iter_mut().all(|reader| reader.read() == value));
    }
}

#[test]
fn errors_speak() {
    let said = full(Table::Interactions, 4, 5).to_string();
    assert_eq!(said, "table of interactions found in a frame is full: 4 fit, 5 needed");
    let said = SetupError::BadEnds { interaction: 1, ends: [UnitId(0), UnitId(3)] }.to_string();
    assert!(said.contains("interaction 1") && said.contains("unit 3"), "{said}");
    let said = SetupError::from(full(Table::Units, 4, 5)).to_string();
    assert_eq!(said, full(Table::Units, 4, 5).to_string());
    assert!(StillRunning.to_string().contains("still running"));
    for (tokens, what) in [(0, "without a render token"), (1, "the render token"), (3, "of 3")] {
        let said = NotShared { tokens }.to_string();
        assert!(said.contains(what), "{said}");
    }
}
