//! A flood for tables of given sizes.

use std::sync::atomic::{AtomicUsize, Ordering::SeqCst};

use dualframe_core::contacts::{ContactSlot, Contacts, SegmentSlot};
use dualframe_core::environment::{Environment, Pair};
use dualframe_core::error::{SetupError, Table, TableFull};
use dualframe_core::frame::Frame;
use dualframe_core::inbox::{From as Sender, LetterSlot};
use dualframe_core::inputs::Inputs;
use dualframe_core::pipeline::{BroadPhase, Config, Pipeline};
use dualframe_core::ring::QueueSlot;
use dualframe_core::storage::{InteractionSlot, Memory, UnitSlot, queue_slots};
use dualframe_core::unit::UnitId;
use dualframe_core::wait::Spin;

/// Every two units meet, each unit with itself too; each interaction pushes `records`, each
/// update posts `letters`. What was done and refused is counted.
#[derive(Default)]
pub(crate) struct Flood {
    pub(crate) records: usize,
    pub(crate) letters: usize,
    pub(crate) interactions: AtomicUsize,
    pub(crate) pushes_refused: AtomicUsize,
    pub(crate) contacts_read: AtomicUsize,
    pub(crate) posted: AtomicUsize,
    pub(crate) posts_refused: AtomicUsize,
    pub(crate) read: AtomicUsize,
    pub(crate) swaps: AtomicUsize,
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
pub(crate) struct Sizes {
    pub(crate) units: usize,
    pub(crate) interactions: Vec<[u32; 2]>,
    pub(crate) contacts: usize,
    pub(crate) segments: usize,
    pub(crate) letters: usize,
    pub(crate) queues: Option<usize>,
    pub(crate) config: Config,
}

impl Sizes {
    pub(crate) fn spatial(
        units: usize,
        candidates: usize,
        contacts: usize,
        letters: usize,
    ) -> Self {
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

    pub(crate) fn pairwise(units: usize, ends: &[[u32; 2]]) -> Self {
        let config = Config { broad_phase: BroadPhase::Pairwise, ..Config::default() };
        Self { interactions: ends.to_vec(), config, ..Self::spatial(units, 0, 64, 1) }
    }

    /// Builds a pipeline of these sizes and hands it on.
    pub(crate) fn with<R>(
        &self,
        then: impl FnOnce(Result<Pipeline<'_, Flood>, SetupError>) -> R,
    ) -> R {
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

    pub(crate) fn refused(&self) -> Option<SetupError> {
        self.with(|pipeline| pipeline.err())
    }

    /// Runs `frames` on one thread and returns the errors of its steps.
    pub(crate) fn run(&self, flood: &Flood, frames: u32) -> Vec<TableFull> {
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
pub(crate) fn drive(pipeline: &Pipeline<'_, Flood>, flood: &Flood) -> Vec<TableFull> {
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

pub(crate) fn full(table: Table, capacity: usize, needed: usize) -> TableFull {
    TableFull { table, capacity, needed }
}
