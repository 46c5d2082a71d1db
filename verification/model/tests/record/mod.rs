//! A small virtual environment on the real core, whose callbacks and probe record what they see, and
//! what must hold of the record. Each test binary that uses it says which build of the core is meant
//! by `dut`, and which threads by `os`.
#![allow(dead_code, reason = "each test binary uses some of it")]

mod drive;
mod host;
mod judge;

pub(crate) use drive::{Park, run};
pub(crate) use host::{Body, Host, Recorder, Renderer, Screen, Setup};
pub(crate) use judge::judge;

use crate::dut::contacts::{ContactSlot, SegmentSlot};
use crate::dut::inbox::LetterSlot;
use crate::dut::pipeline::{BroadPhase, Config, Pipeline};
use crate::dut::ring::QueueSlot;
use crate::dut::storage::{InteractionSlot, Memory, UnitSlot, queue_slots};
use crate::dut::unit::UnitId;
use crate::dut::wait::Waiting;

/// The memory of a run.
pub(crate) struct Slots {
    units: Vec<UnitSlot<Body>>,
    interactions: Vec<InteractionSlot<u32>>,
    contacts: Vec<ContactSlot<u32>>,
    segments: Vec<SegmentSlot>,
    letters: Vec<LetterSlot<u32>>,
    queues: Vec<QueueSlot>,
}

impl Slots {
    /// Exactly what two frames of `setup` may need.
    pub(crate) fn new(setup: &Setup) -> Self {
        let pairs = setup.pairs();
        let interactions: Vec<_> = match setup.broad_phase {
            BroadPhase::Pairwise => pairs
                .iter()
                .map(|&[a, b]| InteractionSlot::between(UnitId(a), UnitId(b), 0))
                .collect(),
            BroadPhase::Spatial => {
                (0..2 * pairs.len()).map(|_| InteractionSlot::spare(0)).collect()
            }
        };
        let records = 4 * pairs.len();
        let units = setup.units as usize;
        let queues = queue_slots(units, interactions.len(), 0, setup.homes as usize);
        let unit = |id| {
            let body = Body::new(id);
            if setup.is_solitary(id) { UnitSlot::solitary(body) } else { UnitSlot::new(body) }
        };
        Self {
            units: (0..setup.units).map(unit).collect(),
            interactions,
            contacts: (0..records).map(|_| ContactSlot::new()).collect(),
            segments: (0..records).map(|_| SegmentSlot::new()).collect(),
            letters: vec![],
            queues: (0..queues).map(|_| QueueSlot::new()).collect(),
        }
    }

    /// A pipeline over this memory, with all frames let run.
    pub(crate) fn pipeline<'m, W: Waiting>(
        &'m mut self,
        setup: &Setup,
        waiting: W,
    ) -> Pipeline<'m, Host<'m>, W> {
        let memory = Memory {
            units: &mut self.units,
            interactions: &mut self.interactions,
            contacts: &mut self.contacts,
            segments: &mut self.segments,
            letters: &mut self.letters,
            queues: &mut self.queues,
        };
        let Setup { broad_phase, entry, renderer, homes, .. } = *setup;
        let config = Config { broad_phase, entry, tokens: renderer.tokens(), homes };
        let mut pipeline = Pipeline::new(memory, config, waiting).expect("memory that fits");
        pipeline.run(setup.frames).expect("a pipeline at rest");
        pipeline
    }
}
