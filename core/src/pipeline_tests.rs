use super::*;
use crate::contacts::{ContactSlot, Contacts, SegmentSlot};
use crate::environment::Pair;
use crate::inbox::LetterSlot;
use crate::inputs::Inputs;
use crate::ring::QueueSlot;
use crate::storage::{InteractionSlot, Memory, UnitSlot, queue_slots};
use crate::worker::Step;

/// Two units that meet in every frame and write to each other; every callback checks what frame it is of.
struct Calendar {
    first: Frame,
}

/// The frame of its next update.
struct Body(Frame);

impl Environment for Calendar {
    type Object = Body;
    type Interaction = Option<Frame>;
    type Contact = Frame;
    type Message = Frame;
    /// The next frame to swap.
    type Renderer = Frame;
    type Error = TableFull;

    fn broad_phase(&self, a: &Body, b: &Body) -> bool {
        assert_eq!(a.0, b.0);
        true
    }

    fn interact(
        &self,
        pair: Pair,
        a: &Body,
        b: &Body,
        state: &mut Option<Frame>,
        contacts: &mut Contacts<'_, '_, Frame>,
    ) -> Result<(), TableFull> {
        assert_eq!([a.0, b.0], [pair.frame; 2]);
        *state = Some(pair.frame);
        contacts.push(&[pair.frame])
    }

    fn update(
        &self,
        unit: UnitId,
        frame: Frame,
        body: &mut Body,
        inputs: &mut Inputs<'_, '_, Self>,
    ) -> Result<(), TableFull> {
        assert_eq!(body.0, frame);
        body.0 = frame.next();
        let mut interactions = inputs.interactions();
        let met = interactions.next();
        assert!(met.is_some_and(|met| {
            *met.state == Some(frame) && met.contacts.flatten().eq(&[frame])
        }));
        assert!(interactions.next().is_none());
        let letters = ::core::iter::from_fn(|| inputs.next_letter().map(|(_, message)| message));
        let posted = (frame != self.first).then_some(frame.previous());
        assert!(letters.eq(posted), "what the other posted in the frame before {frame:?}");
        inputs.post(UnitId(1 - unit.0), unit.0, frame).map_err(|rejected| rejected.full)
    }

    fn render(
        &self,
        _: UnitId,
        frame: Frame,
        body: &Body,
        next: &mut Frame,
    ) -> Result<(), TableFull> {
        assert_eq!((frame, frame.next()), (*next, body.0));
        Ok(())
    }

    fn swap(&self, frame: Frame, next: &mut Frame) -> Result<(), TableFull> {
        assert_eq!(frame, *next);
        *next = frame.next();
        Ok(())
    }
}

/// Runs `frames` frames from `first` on, which is even, by two workers in turn; the run then ends or does not.
fn run_from(first: Frame, frames: u32, ends: bool, config: Config) {
    let mut modelled = [InteractionSlot::between(UnitId(0), UnitId(1), None)];
    let mut spare = [const { InteractionSlot::spare(None) }; 2];
    let memory = Memory {
        units: &mut [(); 2].map(|()| UnitSlot::new(Body(first))),
        interactions: match config.broad_phase {
            BroadPhase::Spatial => &mut spare[..],
            BroadPhase::Pairwise => &mut modelled[..],
        },
        contacts: &mut [const { ContactSlot::new() }; 2],
        segments: &mut [const { SegmentSlot::new() }; 2],
        letters: &mut [const { LetterSlot::new() }; 4],
        queues: &mut [const { QueueSlot::new() }; queue_slots(2, 2, 4, 1)],
    };
    let mut pipeline =
        Pipeline::new(memory, config, Spin).unwrap_or_else(|error| panic!("{error}"));
    pipeline.window = Window::new(2, first);
    pipeline.tables.units.iter().for_each(|unit| unit.frame.store(first.0, site::EXCLUSIVE));
    let runs = if ends { pipeline.run(frames) } else { pipeline.run_without_end() };
    assert_eq!(runs, Ok(()));
    assert_eq!(pipeline.window.limit.is_some(), ends);
    let end = Frame(first.0.wrapping_add(frames));
    let calendar = Calendar { first };
    let mut workers = [pipeline.worker(), pipeline.worker()];
    assert!(pipeline.token(first).is_ok_and(|token| workers[0].hold(token).is_ok()));
    let mut idle = 0;
    while pipeline.frame() != end {
        for worker in &mut workers {
            let did = worker.step(&calendar).unwrap_or_else(|full| panic!("{full}"));
            idle = if did == Step::Idle { idle + 1 } else { 0 };
        }
        assert!(idle < 4, "unfinished at {:?}, and no work to be seen", pipeline.frame());
    }
    assert_eq!(workers[0].renderer().map(|next| *next), Some(end));
    assert_eq!(pipeline.finished(), ends);
    drop(workers);
    assert_eq!(pipeline.run(0), if ends { Ok(()) } else { Err(StillRunning) });
}

#[test]
fn frames_wrap() {
    for broad_phase in [BroadPhase::Spatial, BroadPhase::Pairwise] {
        for entry in [Entry::AfterUpdate, Entry::AfterRender, Entry::AfterSwap] {
            let config = Config { broad_phase, entry, ..Config::default() };
            for ends in [true, false] {
                run_from(Frame(u32::MAX - 3), 8, ends, config);
            }
        }
    }
}

/// Of the memory of one in which a worker was lost after so many steps, with what it carried.
#[test]
fn another_pipeline_may_have_the_memory_of_one_that_never_ends() {
    for broad_phase in [BroadPhase::Spatial, BroadPhase::Pairwise] {
        let config = Config { broad_phase, ..Config::default() };
        let mut units = [(); 2].map(|()| UnitSlot::new(Body(Frame(0))));
        let mut modelled = [InteractionSlot::between(UnitId(0), UnitId(1), None)];
        let mut spare = [const { InteractionSlot::spare(None) }; 2];
        let mut contacts = [const { ContactSlot::new() }; 2];
        let mut segments = [const { SegmentSlot::new() }; 2];
        let mut letters = [const { LetterSlot::new() }; 4];
        let mut queues = [const { QueueSlot::new() }; queue_slots(2, 2, 4, 1)];
        let mut ended = 0;
        for lost_after in (0..30).chain([1_000]) {
            let memory = Memory {
                units: &mut units,
                interactions: match broad_phase {
                    BroadPhase::Spatial => &mut spare[..],
                    BroadPhase::Pairwise => &mut modelled[..],
                },
                contacts: &mut contacts,
                segments: &mut segments,
                letters: &mut letters,
                queues: &mut queues,
            };
            let mut pipeline =
                Pipeline::new(memory, config, Spin).unwrap_or_else(|error| panic!("{error}"));
            pipeline.objects_mut().for_each(|body| *body = Body(Frame(0)));
            assert_eq!(pipeline.run(4), Ok(()));
            let calendar = Calendar { first: Frame(0) };
            let mut worker = pipeline.worker();
            assert!(pipeline.token(Frame(0)).is_ok_and(|token| worker.hold(token).is_ok()));
            for _ in 0..lost_after {
                let _did = worker.step(&calendar).unwrap_or_else(|full| panic!("{full}"));
            }
            ended += u32::from(pipeline.finished());
            ::core::mem::forget(worker);
        }
        assert!((1..30).contains(&ended), "{ended}: the last one ends, and not all do");
    }
}
