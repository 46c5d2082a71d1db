//! Units that do next to nothing, and who looks on.

use std::sync::{Barrier, Mutex};

use dualframe_core::contacts::{ContactSlot, Contacts, SegmentSlot};
use dualframe_core::environment::{Environment, Pair};
use dualframe_core::error::{Table, TableFull};
use dualframe_core::frame::Frame;
use dualframe_core::inbox::{From, LetterSlot};
use dualframe_core::inputs::Inputs;
use dualframe_core::pipeline::{Config, Pipeline};
use dualframe_core::probe::Probe;
use dualframe_core::ring::QueueSlot;
use dualframe_core::stage::Stage;
use dualframe_core::storage::{InteractionSlot, Memory, UnitSlot, queue_slots};
use dualframe_core::unit::{UnitId, Work};
use dualframe_core::wait::{Bell, Epoch, Waiting};
use dualframe_core::worker::{Step, Worker};

/// Every two units meet, or none do. Interactions push two records.
pub(crate) struct Crowd {
    pub(crate) near: bool,
    /// Whether letters are read.
    pub(crate) reads: bool,
    /// Whether each unit writes itself two letters in each frame.
    pub(crate) writes: bool,
    /// Whether rendering panics.
    pub(crate) breaks: bool,
    /// What rendering returns.
    pub(crate) rendered: Result<(), TableFull>,
    /// What swapping returns.
    pub(crate) swapped: Result<(), TableFull>,
}

/// What a unit found in its last update: whom it met, and its letters.
#[derive(Default)]
pub(crate) struct Found {
    pub(crate) met: Vec<u32>,
    pub(crate) read: Vec<(From, &'static str)>,
}

impl Environment for Crowd {
    type Object = Found;
    type Interaction = ();
    type Contact = u8;
    type Message = &'static str;
    type Renderer = ();
    type Error = TableFull;

    fn broad_phase(&self, _: &Found, _: &Found) -> bool {
        self.near
    }

    fn interact(
        &self,
        _: Pair,
        _: &Found,
        _: &Found,
        (): &mut (),
        contacts: &mut Contacts<'_, '_, u8>,
    ) -> Result<(), TableFull> {
        contacts.push(&[1, 2])
    }

    fn update(
        &self,
        unit: UnitId,
        _: Frame,
        found: &mut Found,
        inputs: &mut Inputs<'_, '_, Self>,
    ) -> Result<(), TableFull> {
        found.met = inputs.interactions().map(|interaction| interaction.other.0).collect();
        if self.reads {
            found.read = std::iter::from_fn(|| inputs.next_letter()).collect();
        }
        if self.writes {
            for message in ["first", "second"] {
                inputs.post(unit, unit.0, message).map_err(|rejected| rejected.full)?;
            }
        }
        Ok(())
    }

    fn render(&self, _: UnitId, _: Frame, _: &Found, (): &mut ()) -> Result<(), TableFull> {
        assert!(!self.breaks, "on purpose");
        self.rendered
    }

    fn swap(&self, _: Frame, (): &mut ()) -> Result<(), TableFull> {
        self.swapped
    }
}

pub(crate) const NEAR: Crowd = Crowd {
    near: true,
    reads: false,
    writes: false,
    breaks: false,
    rendered: Ok(()),
    swapped: Ok(()),
};
pub(crate) const FAR: Crowd = Crowd { near: false, ..NEAR };
/// Far from each other, and rendering panics.
pub(crate) const BREAKS: Crowd = Crowd { breaks: true, ..FAR };

/// Notes on whose bell somebody was to sleep, and how many were to be woken; `true` is the holders'.
#[derive(Default)]
pub(crate) struct Notes {
    pub(crate) slept: Mutex<Vec<bool>>,
    pub(crate) woken: Mutex<Vec<(bool, u32)>>,
    /// Passed by all when the sleepers sleep, and again when they may wake. Nobody sleeps without it.
    pub(crate) night: Option<Barrier>,
}

impl Notes {
    pub(crate) fn slept(&self) -> Vec<bool> {
        std::mem::take(&mut *self.slept.lock().expect("no poison"))
    }

    pub(crate) fn woken(&self) -> Vec<(bool, u32)> {
        std::mem::take(&mut *self.woken.lock().expect("no poison"))
    }

    pub(crate) fn pass(&self) {
        let _leader = self.night.as_ref().map(Barrier::wait);
    }
}

impl Waiting for Notes {
    fn sleep(&self, bell: &Bell, _: Epoch) {
        self.slept.lock().expect("no poison").push(bell.is_for_holders());
        self.pass();
        self.pass();
    }

    fn wake(&self, bell: &Bell, count: u32) {
        self.woken.lock().expect("no poison").push((bell.is_for_holders(), count));
    }
}

pub(crate) type Machine<'m, 'n> = Pipeline<'m, Crowd, &'n Notes>;

/// Hands on a pipeline of `units`, which has room for two letters.
pub(crate) fn with<R>(
    units: usize,
    homes: u32,
    tokens: u32,
    then: impl FnOnce(Machine<'_, '_>, &Notes) -> R,
) -> R {
    with_notes(units, homes, tokens, &Notes::default(), then)
}

pub(crate) fn with_notes<R>(
    units: usize,
    homes: u32,
    tokens: u32,
    notes: &Notes,
    then: impl FnOnce(Machine<'_, '_>, &Notes) -> R,
) -> R {
    let pairs = units * (units - 1);
    let queues = queue_slots(units, pairs, 2, homes as usize);
    let memory = Memory {
        units: &mut Vec::from_iter((0..units).map(|_| UnitSlot::new(Found::default()))),
        interactions: &mut Vec::from_iter((0..pairs).map(|_| InteractionSlot::spare(()))),
        contacts: &mut Vec::from_iter((0..2 * pairs).map(|_| ContactSlot::new())),
        segments: &mut Vec::from_iter((0..2 * pairs).map(|_| SegmentSlot::new())),
        letters: &mut [const { LetterSlot::new() }; 2],
        queues: &mut Vec::from_iter((0..queues).map(|_| QueueSlot::new())),
    };
    let config = Config { homes, tokens, ..Config::default() };
    then(Pipeline::new(memory, config, notes).expect("tables that fit"), notes)
}

pub(crate) fn hold<'p>(pipeline: &'p Machine<'_, '_>, worker: &mut Worker<'p, '_, Crowd, &Notes>) {
    let token = pipeline.token(()).map_err(drop).expect("a token");
    worker.hold(token).map_err(drop).expect("this pipeline's");
}

/// Somebody comes for all units of the open frame, which all wait for something else, and leaves.
pub(crate) fn come_for_all(pipeline: &Machine<'_, '_>) {
    assert_eq!(pipeline.worker().step(&NEAR), IDLE);
}

pub(crate) fn finish(pipeline: &Machine<'_, '_>, env: &Crowd) {
    let mut worker = pipeline.worker();
    hold(pipeline, &mut worker);
    for _ in 0..1000 {
        worker.step(env).expect("no callback fails");
    }
    assert!(pipeline.finished());
}

pub(crate) const fn worked(stage: Stage) -> Result<Step, TableFull> {
    Ok(Step::Worked(stage))
}

pub(crate) const ENTERED: Result<Step, TableFull> = worked(Stage::BroadPhase);
pub(crate) const INTERACTED: Result<Step, TableFull> = worked(Stage::Interaction);
pub(crate) const UPDATED: Result<Step, TableFull> = worked(Stage::Update);
pub(crate) const RENDERED: Result<Step, TableFull> = worked(Stage::Render);
pub(crate) const IDLE: Result<Step, TableFull> = Ok(Step::Idle);

/// One of several errors that can be told apart.
pub(crate) const fn error(needed: usize) -> TableFull {
    TableFull { table: Table::Contacts, capacity: 0, needed }
}

/// Writes down what a worker begins; what it ends must be the same.
#[derive(Default)]
pub(crate) struct Log {
    pub(crate) begun: Vec<(Work, Frame)>,
    pub(crate) ended: Vec<(Work, Frame)>,
}

impl Probe for Log {
    fn begin(&mut self, work: Work, frame: Frame) {
        self.begun.push((work, frame));
    }

    fn end(&mut self, work: Work, frame: Frame) {
        self.ended.push((work, frame));
    }
}

/// Steps until something is done, be it what was left to the workers of other homes for some steps, or until there is no
/// cause to step.
pub(crate) fn next<P: Probe>(
    worker: &mut Worker<'_, '_, Crowd, &Notes, P>,
    env: &Crowd,
) -> Option<Stage> {
    loop {
        match worker.step(env).expect("no callback fails") {
            Step::Worked(stage) => return Some(stage),
            Step::Idle if worker.has_cause_to_wake() => {}
            Step::Idle => return None,
        }
    }
}

/// What a worker of `home` does, alone and without a token, until it finds nothing more.
pub(crate) fn alone(pipeline: &mut Machine<'_, '_>, home: u32, env: &Crowd) -> Vec<Work> {
    pipeline.run(1).expect("at rest");
    let frame = pipeline.frame();
    let mut log = Log::default();
    let mut worker = pipeline.worker_at(home).probed(&mut log);
    while next(&mut worker, env).is_some() {}
    drop(worker);
    assert_eq!(log.begun, log.ended);
    assert!(log.begun.iter().all(|&(_, of)| of == frame));
    finish(pipeline, env);
    log.begun.into_iter().map(|(work, _)| work).collect()
}

/// The units that `works` enter and update, in this order.
pub(crate) fn units(works: &[Work]) -> [Vec<u32>; 2] {
    let entered = |work: &Work| if let Work::Enter(unit) = work { Some(unit.0) } else { None };
    let updated = |work: &Work| if let Work::Update(unit) = work { Some(unit.0) } else { None };
    [works.iter().filter_map(entered).collect(), works.iter().filter_map(updated).collect()]
}
