//! The smallest host: four bodies on a line push their neighbours apart.
//!
//! The core needs no heap: its tables are arrays on the stack, its workers two scoped threads. Only what shows the places
//! collects them in a list.

use dualframe_core::contacts::{ContactSlot, Contacts, SegmentSlot};
use dualframe_core::environment::{Environment, Pair};
use dualframe_core::error::TableFull;
use dualframe_core::frame::Frame;
use dualframe_core::inbox::LetterSlot;
use dualframe_core::inputs::Inputs;
use dualframe_core::pipeline::{Config, Pipeline};
use dualframe_core::ring::QueueSlot;
use dualframe_core::storage::{InteractionSlot, Memory, UnitSlot, queue_slots};
use dualframe_core::unit::UnitId;
use dualframe_core::wait::Spin;
use dualframe_core::worker::Step;

/// Bodies closer than this push each other, in metres.
const REACH: f32 = 1.0;

struct Line;

impl Environment for Line {
    type Object = f32;
    type Interaction = ();
    type Contact = f32;
    type Message = ();
    type Renderer = Vec<f32>;
    type Error = TableFull;

    fn broad_phase(&self, a: &f32, b: &f32) -> bool {
        (a - b).abs() < REACH
    }

    fn interact(
        &self,
        _: Pair,
        a: &f32,
        b: &f32,
        (): &mut (),
        contacts: &mut Contacts<'_, '_, f32>,
    ) -> Result<(), TableFull> {
        contacts.push(&[0.1 * (REACH - (a - b).abs())])
    }

    fn update(
        &self,
        unit: UnitId,
        _: Frame,
        place: &mut f32,
        inputs: &mut Inputs<'_, '_, Self>,
    ) -> Result<(), TableFull> {
        for interaction in inputs.interactions() {
            let push: f32 = interaction.contacts.flatten().sum();
            *place += if interaction.other < unit { push } else { -push };
        }
        Ok(())
    }

    fn render(
        &self,
        _: UnitId,
        _: Frame,
        place: &f32,
        picture: &mut Vec<f32>,
    ) -> Result<(), TableFull> {
        picture.push(*place);
        Ok(())
    }

    fn swap(&self, frame: Frame, picture: &mut Vec<f32>) -> Result<(), TableFull> {
        if frame.0 % 20 == 19 {
            picture.sort_by(f32::total_cmp);
            println!("frame {:3}: {picture:.3?}", frame.0);
        }
        picture.clear();
        Ok(())
    }
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    const UNITS: usize = 4;
    const CANDIDATES: usize = 2 * UNITS * (UNITS - 1) / 2;
    const QUEUES: usize = queue_slots(UNITS, CANDIDATES, 1, 1);
    let memory = Memory {
        units: &mut [0.0, 0.25, 0.5, 0.75].map(UnitSlot::new),
        interactions: &mut [const { InteractionSlot::spare(()) }; CANDIDATES],
        contacts: &mut [const { ContactSlot::new() }; CANDIDATES],
        segments: &mut [const { SegmentSlot::new() }; CANDIDATES],
        letters: &mut [LetterSlot::new()],
        queues: &mut [const { QueueSlot::new() }; QUEUES],
    };
    let mut pipeline = Pipeline::new(memory, Config::default(), Spin)?;
    pipeline.run(100)?;
    let pipeline = &pipeline;
    let work = |token| {
        let mut worker = pipeline.worker();
        if let Some(token) = token {
            worker.hold(token).map_err(drop).expect("this pipeline's token");
        }
        while !pipeline.finished() {
            match worker.step(&Line) {
                Ok(Step::Worked(_)) => {}
                Ok(Step::Idle) => worker.wait(),
                // The frame goes on without what did not fit: nobody waits for it.
                Err(full) => eprintln!("{full}"),
            }
        }
    };
    let token = pipeline.token(Vec::new()).map_err(|(_, full)| full)?;
    std::thread::scope(|scope| {
        scope.spawn(|| work(None));
        work(Some(token));
    });
    Ok(())
}
