//! Memory that served one pipeline serves another, of another kind.
#![forbid(unsafe_code)]

use std::sync::atomic::{AtomicU32, Ordering::SeqCst};

use dualframe_core::contacts::{ContactSlot, Contacts, SegmentSlot};
use dualframe_core::environment::{Environment, Pair};
use dualframe_core::error::TableFull;
use dualframe_core::frame::Frame;
use dualframe_core::inbox::LetterSlot;
use dualframe_core::inputs::Inputs;
use dualframe_core::pipeline::{BroadPhase, Config, Pipeline};
use dualframe_core::ring::QueueSlot;
use dualframe_core::storage::{InteractionSlot, Memory, UnitSlot, queue_slots};
use dualframe_core::unit::UnitId;
use dualframe_core::wait::Spin;

/// Everything is near everything; counts interactions.
#[derive(Default)]
struct Crowd {
    interactions: AtomicU32,
}

impl Environment for Crowd {
    type Object = u32;
    type Interaction = ();
    type Contact = ();
    type Message = ();
    type Renderer = ();
    type Error = TableFull;

    fn broad_phase(&self, _: &u32, _: &u32) -> bool {
        true
    }

    fn interact(
        &self,
        _: Pair,
        _: &u32,
        _: &u32,
        (): &mut (),
        _: &mut Contacts<'_, '_, ()>,
    ) -> Result<(), TableFull> {
        self.interactions.fetch_add(1, SeqCst);
        Ok(())
    }

    fn update(
        &self,
        _: UnitId,
        _: Frame,
        updates: &mut u32,
        _: &mut Inputs<'_, '_, Self>,
    ) -> Result<(), TableFull> {
        *updates += 1;
        Ok(())
    }

    fn render(&self, _: UnitId, _: Frame, _: &u32, (): &mut ()) -> Result<(), TableFull> {
        Ok(())
    }

    fn swap(&self, _: Frame, (): &mut ()) -> Result<(), TableFull> {
        Ok(())
    }
}

const UNITS: usize = 3;
const INTERACTIONS: usize = 6;

struct Owned {
    units: Vec<UnitSlot<u32>>,
    interactions: Vec<InteractionSlot<()>>,
    contacts: [ContactSlot<()>; 0],
    segments: [SegmentSlot; 0],
    letters: [LetterSlot<()>; 1],
    queues: Vec<QueueSlot>,
}

impl Owned {
    /// Runs `frames` frames, twice, and says how many interactions there were.
    fn run(&mut self, broad_phase: BroadPhase, modelled: usize, frames: u32) -> u32 {
        let interactions = match broad_phase {
            BroadPhase::Pairwise => &mut self.interactions[..modelled],
            BroadPhase::Spatial => &mut self.interactions[..],
        };
        let memory = Memory {
            units: &mut self.units,
            interactions,
            contacts: &mut self.contacts,
            segments: &mut self.segments,
            letters: &mut self.letters,
            queues: &mut self.queues,
        };
        let crowd = Crowd::default();
        let config = Config { broad_phase, ..Config::default() };
        let mut pipeline = Pipeline::new(memory, config, Spin).expect("the tables fit");
        for _ in 0..2 {
            pipeline.run(frames).expect("it is at rest");
            let mut worker = pipeline.worker();
            let token = pipeline.token(()).expect("there is a token");
            assert!(worker.hold(token).is_ok());
            let mut steps = 0;
            while !pipeline.finished() {
                worker.step(&crowd).expect("no callback fails");
                steps += 1;
                assert!(steps < 100_000, "no progress");
            }
        }
        crowd.interactions.load(SeqCst)
    }
}

#[test]
fn pairwise_then_spatial_then_pairwise() {
    let between = |a, b| InteractionSlot::between(UnitId(a), UnitId(b), ());
    let mut owned = Owned {
        units: (0..UNITS).map(|_| UnitSlot::new(0)).collect(),
        // One modelled interaction; unit 2 has none, and bypasses the first stages there only.
        interactions: std::iter::once(between(0, 1))
            .chain((1..INTERACTIONS).map(|_| InteractionSlot::spare(())))
            .collect(),
        contacts: [],
        segments: [],
        letters: [LetterSlot::new()],
        queues: (0..queue_slots(UNITS, INTERACTIONS, 1, 1)).map(|_| QueueSlot::new()).collect(),
    };
    assert_eq!(owned.run(BroadPhase::Pairwise, 1, 5), 2 * 5);
    assert_eq!(owned.run(BroadPhase::Spatial, 0, 5), 2 * 5 * 3, "all three meet");
    owned.interactions[0] = between(1, 2);
    assert_eq!(owned.run(BroadPhase::Pairwise, 1, 5), 2 * 5);
    let updates: Vec<u32> = owned.units.iter_mut().map(|unit| *unit.object_mut()).collect();
    assert_eq!(updates, [30; UNITS]);
}
