use super::*;
use crate::contacts::{ContactSlot, Contacts, SegmentSlot};
use crate::environment::Pair;
use crate::error::TableFull;
use crate::frame::Frame;
use crate::inbox::LetterSlot;
use crate::inputs::Inputs;
use crate::pipeline::Config;
use crate::ring::QueueSlot;
use crate::storage::{InteractionSlot, Memory, UnitSlot, queue_slots};
use crate::wait::{Bell, Epoch};
use crate::worker::Step;
use std::sync::atomic::{AtomicU32, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};

/// Nothing happens in it. Notes how many calls there had been when a unit entered.
struct Void<'c> {
    calls: &'c Calls,
    before_entry: AtomicU32,
}

impl Environment for Void<'_> {
    type Object = ();
    type Interaction = ();
    type Contact = ();
    type Message = ();
    type Renderer = ();
    type Error = TableFull;

    fn broad_phase(&self, (): &(), (): &()) -> bool {
        false
    }

    fn interacts_within(&self, (): &()) -> bool {
        self.before_entry.store(*self.calls.count(), Ordering::Relaxed);
        false
    }

    fn interact(
        &self,
        _: Pair,
        (): &(),
        (): &(),
        (): &mut (),
        _: &mut Contacts<'_, '_, ()>,
    ) -> Result<(), TableFull> {
        Ok(())
    }

    fn update(
        &self,
        _: UnitId,
        _: Frame,
        (): &mut (),
        _: &mut Inputs<'_, '_, Self>,
    ) -> Result<(), TableFull> {
        Ok(())
    }

    fn render(&self, _: UnitId, _: Frame, (): &(), (): &mut ()) -> Result<(), TableFull> {
        Ok(())
    }

    fn swap(&self, _: Frame, (): &mut ()) -> Result<(), TableFull> {
        Ok(())
    }
}

/// Counts calls of holders.
#[derive(Default)]
struct Calls(Mutex<u32>);

impl Calls {
    fn count(&self) -> MutexGuard<'_, u32> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Waiting for Calls {
    fn sleep(&self, _: &Bell, _: Epoch) {}

    fn wake(&self, bell: &Bell, count: u32) {
        *self.count() += if bell.is_for_holders() { count } else { 0 };
    }
}

/// What `use_it` makes of a pipeline of two units that has run no frame.
fn with_pipeline<'c, R>(
    calls: &'c Calls,
    tokens: u32,
    use_it: impl FnOnce(Pipeline<'_, Void<'c>, &'c Calls>) -> R,
) -> R {
    with_units(&mut [(); 2].map(UnitSlot::new), calls, tokens, use_it)
}

/// The same of these units, three at most.
fn with_units<'c, R>(
    units: &mut [UnitSlot<()>],
    calls: &'c Calls,
    tokens: u32,
    use_it: impl FnOnce(Pipeline<'_, Void<'c>, &'c Calls>) -> R,
) -> R {
    let memory = Memory {
        units,
        interactions: &mut [const { InteractionSlot::spare(()) }; 2],
        contacts: &mut [const { ContactSlot::new() }; 2],
        segments: &mut [const { SegmentSlot::new() }; 2],
        letters: &mut [const { LetterSlot::new() }],
        queues: &mut [const { QueueSlot::new() }; queue_slots(3, 2, 1, 1)],
    };
    let config = Config { tokens, ..Config::default() };
    use_it(Pipeline::new(memory, config, calls).unwrap_or_else(|error| panic!("{error}")))
}

#[test]
fn a_run_begins_with_nobody_hungry() {
    let calls = Calls::default();
    let void = Void { calls: &calls, before_entry: AtomicU32::new(0) };
    with_pipeline(&calls, 1, |mut pipeline| {
        let mut worker = pipeline.worker();
        assert_eq!(worker.step(&void), Ok(Step::Idle));
        ::core::mem::forget(worker);
        assert!(pipeline.bells.somebody_is_hungry());
        assert_eq!(pipeline.run(1), Ok(()));
        assert!(!pipeline.bells.somebody_is_hungry());
    });
}

#[test]
fn a_run_begins_with_nobody_who_has_the_shared_renderer() {
    let calls = Calls::default();
    let void = Void { calls: &calls, before_entry: AtomicU32::new(0) };
    with_pipeline(&calls, 1, |mut pipeline| {
        assert!(pipeline.share(()).is_ok());
        for _ in 0..2 {
            assert_eq!(pipeline.run(1), Ok(()));
            let mut worker = pipeline.worker();
            let mut steps = 0..100;
            while !pipeline.finished() && steps.next().is_some() {
                assert!(worker.step(&void).is_ok());
            }
            assert!(pipeline.finished());
            // It would put the renderer back at its next step.
            ::core::mem::forget(worker);
        }
    });
}

/// A holder's step finds a unit in a queue that it may not be rendered from, and another holder looks in vain
/// meanwhile and is about to sleep. What the step did, the calls at the first entry and after the step.
fn put_back(frames: u32) -> (Step, u32, u32) {
    let calls = Calls::default();
    let void = Void { calls: &calls, before_entry: AtomicU32::new(0) };
    let mut did = Step::Idle;
    with_pipeline(&calls, 2, |mut pipeline| {
        assert_eq!(pipeline.run(frames), Ok(()));
        // As after a swap since the frame on display was read: no unit of it is in this queue.
        assert_eq!(pipeline.tables.queues.render[0].push(0), Ok(()));
        let mut worker = pipeline.worker();
        assert!(pipeline.token(()).is_ok_and(|token| worker.hold(token).is_ok()));
        pipeline.bells.holders.sleep_unless(&pipeline.waiting, || {
            did = worker.step(&void).unwrap_or_else(|error| panic!("{error}"));
            false
        });
    });
    (did, void.before_entry.into_inner(), *calls.count())
}

#[test]
fn whoever_looked_in_vain_for_a_rendering_that_is_put_back_is_called() {
    assert_eq!(put_back(0), (Step::Idle, 0, 1));
    let before_its_work = 1;
    assert_eq!(put_back(1), (Step::Worked(Stage::BroadPhase), before_its_work, 1));
}

#[test]
fn who_gives_the_shared_renderer_up_calls_for_what_it_sees() {
    let calls = Calls::default();
    for rendering in [false, true] {
        with_pipeline(&calls, 1, |mut pipeline| {
            assert!(pipeline.share(()).is_ok());
            let mut carry = Carry::new(&pipeline, 0);
            assert!(carry.takes_renderer() && !pipeline.shared.is_free());
            if rendering {
                assert_eq!(pipeline.tables.queues.render[0].push(0), Ok(()));
            }
            carry.gives_renderer_up();
            assert!(!carry.renders_shared && pipeline.shared.is_free());
            assert_eq!((carry.queued, carry.renders), (u32::from(rendering), 0));
        });
    }
}

/// Two units of a frame with a shared renderer: one worker has it, to render the unit that it updated, and another one
/// has updated the other unit.
fn keeping(then: impl FnOnce(&Pipeline<'_, Void<'_>, &Calls>, &mut dyn FnMut(usize) -> Step)) {
    let calls = Calls::default();
    let void = Void { calls: &calls, before_entry: AtomicU32::new(0) };
    with_pipeline(&calls, 1, |mut pipeline| {
        assert!(pipeline.share(()).is_ok());
        assert_eq!(pipeline.run(1), Ok(()));
        let mut workers = [pipeline.worker(), pipeline.worker()];
        let mut step =
            |worker: usize| workers[worker].step(&void).unwrap_or_else(|error| panic!("{error}"));
        for _ in 0..2 {
            assert_eq!(step(0), Step::Worked(Stage::BroadPhase));
        }
        for worker in [0, 1] {
            assert_eq!(step(worker), Step::Worked(Stage::Update));
        }
        assert!(!pipeline.render_visible(), "each is to be rendered by who updated it");
        then(&pipeline, &mut step);
    });
}

#[test]
fn who_finds_the_renderer_taken_renders_its_own_unit_later() {
    keeping(|pipeline, step| {
        assert_eq!(step(0), Step::Worked(Stage::Render));
        assert_eq!(step(0), Step::Idle, "the other unit is not for it");
        assert_eq!(step(1), Step::Worked(Stage::Render));
        assert!(pipeline.finished());
    });
}

#[test]
fn who_finds_nothing_else_to_do_leaves_its_rendering_to_who_has_the_renderer() {
    keeping(|pipeline, step| {
        assert_eq!(step(1), Step::Idle);
        assert!(pipeline.render_visible());
        assert_eq!(step(0), Step::Worked(Stage::Render));
        assert_eq!(step(0), Step::Worked(Stage::Render));
        assert!(pipeline.finished());
    });
}

/// Others are hungry, but cannot render what is kept while its worker does.
#[test]
fn who_has_the_renderer_queues_none_of_what_it_keeps() {
    let calls = Calls::default();
    let void = Void { calls: &calls, before_entry: AtomicU32::new(0) };
    with_units(&mut [(); 3].map(UnitSlot::new), &calls, 1, |mut pipeline| {
        assert!(pipeline.share(()).is_ok());
        assert_eq!(pipeline.run(1), Ok(()));
        let (mut one, mut other) = (pipeline.worker(), pipeline.worker());
        for _ in 0..3 {
            assert_eq!(one.step(&void), Ok(Step::Worked(Stage::BroadPhase)));
        }
        assert_eq!(one.step(&void), Ok(Step::Worked(Stage::Update)));
        for _ in 0..2 {
            assert_eq!(other.step(&void), Ok(Step::Worked(Stage::Update)));
        }
        assert_eq!(one.step(&void), Ok(Step::Worked(Stage::Render)));
        assert_eq!(one.step(&void), Ok(Step::Idle));
        for _ in 0..2 {
            assert_eq!(other.step(&void), Ok(Step::Worked(Stage::Render)));
            assert!(!pipeline.render_visible());
        }
        assert!(pipeline.finished());
    });
}
