//! What workers do first, what they carry and share, and whom they wake: seen step by step, on one
//! thread (others only sleep), since none of it changes what comes out.
#![forbid(unsafe_code)]

use std::sync::{Barrier, Mutex};

use dualframe_core::contacts::{ContactSlot, Contacts, SegmentSlot};
use dualframe_core::environment::{Environment, Pair};
use dualframe_core::error::TableFull;
use dualframe_core::frame::Frame;
use dualframe_core::inbox::{From, LetterSlot};
use dualframe_core::inputs::Inputs;
use dualframe_core::pipeline::{Config, Pipeline};
use dualframe_core::probe::Probe;
use dualframe_core::ring::QueueSlot;
use dualframe_core::stage::Stage;
use dualframe_core::storage::{InteractionSlot, Memory, UnitSlot, queue_slots};
use dualframe_core::unit::{InteractionId, UnitId, Work};
use dualframe_core::wait::{Bell, Epoch, Waiting};
use dualframe_core::worker::{Step, Worker};
use dualframe_tests::watchdog;

/// Every two units meet, or none do. Interactions push two records.
struct Crowd {
    near: bool,
    /// Whether each unit writes itself two letters in each frame; otherwise letters are left unread.
    writes: bool,
}

/// What a unit found in its last update: whom it met, and its letters.
#[derive(Default)]
struct Found {
    met: Vec<u32>,
    read: Vec<(From, &'static str)>,
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
        if self.writes {
            found.read = std::iter::from_fn(|| inputs.next_letter()).collect();
            for message in ["first", "second"] {
                inputs.post(unit, unit.0, message).map_err(|rejected| rejected.full)?;
            }
        }
        Ok(())
    }

    fn render(&self, _: UnitId, _: Frame, _: &Found, (): &mut ()) -> Result<(), TableFull> {
        Ok(())
    }

    fn swap(&self, _: Frame, (): &mut ()) -> Result<(), TableFull> {
        Ok(())
    }
}

const NEAR: Crowd = Crowd { near: true, writes: false };
const FAR: Crowd = Crowd { near: false, writes: false };

/// Notes on whose bell somebody was to sleep, and how many were to be woken; `true` is the holders'.
#[derive(Default)]
struct Notes {
    slept: Mutex<Vec<bool>>,
    woken: Mutex<Vec<(bool, u32)>>,
    /// Passed by all when the sleepers sleep, and again when they may wake. Nobody sleeps without it.
    night: Option<Barrier>,
}

impl Notes {
    fn slept(&self) -> Vec<bool> {
        std::mem::take(&mut *self.slept.lock().expect("no poison"))
    }

    fn woken(&self) -> Vec<(bool, u32)> {
        std::mem::take(&mut *self.woken.lock().expect("no poison"))
    }

    fn pass(&self) {
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

type Machine<'m, 'n> = Pipeline<'m, Crowd, &'n Notes>;

/// Hands on a pipeline of `units`, which has room for two letters.
fn with<R>(
    units: usize,
    homes: u32,
    tokens: u32,
    then: impl FnOnce(Machine<'_, '_>, &Notes) -> R,
) -> R {
    with_notes(units, homes, tokens, &Notes::default(), then)
}

fn with_notes<R>(
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

fn hold<'p>(pipeline: &'p Machine<'_, '_>, worker: &mut Worker<'p, '_, Crowd, &Notes>) {
    let token = pipeline.token(()).map_err(drop).expect("a token");
    worker.hold(token).map_err(drop).expect("this pipeline's");
}

fn finish(pipeline: &Machine<'_, '_>, env: &Crowd) {
    let mut worker = pipeline.worker();
    hold(pipeline, &mut worker);
    for _ in 0..1000 {
        worker.step(env).expect("no callback fails");
    }
    assert!(pipeline.finished());
}

const fn worked(stage: Stage) -> Result<Step, TableFull> {
    Ok(Step::Worked(stage))
}

const ENTERED: Result<Step, TableFull> = worked(Stage::BroadPhase);
const INTERACTED: Result<Step, TableFull> = worked(Stage::Interaction);
const UPDATED: Result<Step, TableFull> = worked(Stage::Update);
const RENDERED: Result<Step, TableFull> = worked(Stage::Render);
const IDLE: Result<Step, TableFull> = Ok(Step::Idle);

/// Writes down what a worker begins; what it ends must be the same.
#[derive(Default)]
struct Log {
    begun: Vec<(Work, Frame)>,
    ended: Vec<(Work, Frame)>,
}

impl Probe for Log {
    fn begin(&mut self, work: Work, frame: Frame) {
        self.begun.push((work, frame));
    }

    fn end(&mut self, work: Work, frame: Frame) {
        self.ended.push((work, frame));
    }
}

/// What a worker of `home` does, alone and without a token, until it finds nothing more.
fn alone(pipeline: &mut Machine<'_, '_>, home: u32, env: &Crowd) -> Vec<Work> {
    pipeline.run(1).expect("at rest");
    let frame = pipeline.frame();
    let mut log = Log::default();
    let mut worker = pipeline.worker_at(home).probed(&mut log);
    while worker.step(env).expect("no callback fails") != Step::Idle {}
    drop(worker);
    assert_eq!(log.begun, log.ended);
    assert!(log.begun.iter().all(|&(_, of)| of == frame));
    finish(pipeline, env);
    log.begun.into_iter().map(|(work, _)| work).collect()
}

/// The units that `works` enter and update, in this order.
fn units(works: &[Work]) -> [Vec<u32>; 2] {
    let entered = |work: &Work| if let Work::Enter(unit) = work { Some(unit.0) } else { None };
    let updated = |work: &Work| if let Work::Update(unit) = work { Some(unit.0) } else { None };
    [works.iter().filter_map(entered).collect(), works.iter().filter_map(updated).collect()]
}

#[test]
fn a_worker_does_the_units_of_its_home_first_and_then_helps() {
    with(6, 3, 1, |mut pipeline, _| {
        // As many to each home, in the order of their numbers; homes are counted round.
        for (home, own) in [(0, [0, 1]), (1, [2, 3]), (7, [2, 3]), (2, [4, 5])] {
            for all in units(&alone(&mut pipeline, home, &FAR)) {
                assert_eq!((all.len(), &all[..2]), (6, &own[..]), "home {home}");
            }
        }
        pipeline.set_homes(|unit| unit.0 + 1);
        for (home, own) in [(0, [2, 5]), (1, [0, 3]), (2, [1, 4])] {
            for all in units(&alone(&mut pipeline, home, &FAR)) {
                assert_eq!((all.len(), &all[..2]), (6, &own[..]), "home {home}");
            }
        }
    });
}

#[test]
fn a_probe_sees_every_work_unit() {
    with(2, 1, 1, |mut pipeline, _| {
        let [a, b] = [0, 1].map(UnitId);
        let met = Work::Interact(InteractionId(0));
        let expected = [Work::Enter(a), Work::Enter(b), met, Work::Update(b), Work::Update(a)];
        assert_eq!(alone(&mut pipeline, 0, &NEAR), expected, "what is carried, newest first");
    });
}

#[test]
fn what_is_carried_is_shared_with_the_hungry() {
    with(2, 1, 1, |mut pipeline, _| {
        for hungry in [false, true, false] {
            pipeline.run(1).expect("at rest");
            let (mut a, mut b) = (pipeline.worker(), pipeline.worker());
            if hungry {
                // Both carry off what there is to be had before anyone comes.
                assert_eq!((a.step(&NEAR), a.step(&NEAR)), (ENTERED, ENTERED));
                assert_eq!((b.step(&NEAR), b.step(&NEAR)), (IDLE, IDLE));
                assert_eq!(a.step(&NEAR), INTERACTED);
                assert_eq!(b.step(&NEAR), UPDATED, "the second is for whoever is hungry");
                assert_eq!(b.step(&NEAR), IDLE, "and the first is not");
                assert_eq!(a.step(&NEAR), UPDATED);
            } else {
                let steps = [a.step(&NEAR), a.step(&NEAR), a.step(&NEAR)];
                assert_eq!(steps, [ENTERED, ENTERED, INTERACTED]);
                assert_eq!(b.step(&NEAR), IDLE, "both updates are carried");
                assert_eq!(a.step(&NEAR), UPDATED);
                assert_eq!(b.step(&NEAR), UPDATED, "what was carried is shared at the next step");
            }
            // One of them leaves hungry; nobody is then.
            assert_eq!(b.step(&NEAR), IDLE);
            drop((a, b));
            finish(&pipeline, &NEAR);
        }
    });
}

#[test]
fn what_is_carried_stays_while_nobody_is_hungry() {
    with(3, 1, 1, |mut pipeline, _| {
        pipeline.run(1).expect("at rest");
        let (mut a, mut b) = (pipeline.worker(), pipeline.worker());
        let steps = [(); 5].map(|()| a.step(&NEAR));
        assert_eq!(steps, [ENTERED, ENTERED, INTERACTED, ENTERED, INTERACTED]);
        assert_eq!(b.step(&NEAR), IDLE, "an interaction and an update are carried");
    });
}

#[test]
fn updates_of_another_home_are_not_carried() {
    with(2, 2, 1, |mut pipeline, _| {
        pipeline.run(1).expect("at rest");
        let [mut a, mut b] = [0, 1].map(|home| pipeline.worker_at(home));
        let steps = [a.step(&NEAR), a.step(&NEAR), a.step(&NEAR)];
        assert_eq!(steps, [ENTERED, ENTERED, INTERACTED]);
        assert_eq!(b.step(&NEAR), UPDATED, "its own");
        assert_eq!(b.step(&NEAR), IDLE, "the other is carried");
        assert_eq!(a.step(&NEAR), UPDATED);
    });
}

#[test]
fn a_worker_leaves_what_it_carries() {
    with(2, 1, 1, |mut pipeline, _| {
        pipeline.run(1).expect("at rest");
        let mut a = pipeline.worker();
        assert_eq!([a.step(&NEAR), a.step(&NEAR)], [ENTERED, ENTERED]);
        let mut b = pipeline.worker();
        assert!(!b.has_cause_to_wake());
        drop(a);
        assert!(b.has_cause_to_wake());
        assert_eq!(b.step(&NEAR), INTERACTED);
    });
}

#[test]
fn a_holder_renders_what_waits_first_and_carries_its_own() {
    with(2, 1, 2, |mut pipeline, _| {
        pipeline.run(2).expect("at rest");
        let (mut a, mut b) = (pipeline.worker(), pipeline.worker());
        let steps = [a.step(&NEAR), a.step(&NEAR), a.step(&NEAR), a.step(&NEAR)];
        assert_eq!(steps, [ENTERED, ENTERED, INTERACTED, UPDATED]);
        // It carries the other update, and the updated unit's entry into the next frame.
        hold(&pipeline, &mut a);
        assert_eq!(a.step(&NEAR), RENDERED, "before what it carries");
        assert_eq!(a.step(&NEAR), ENTERED);
        assert_eq!(a.step(&NEAR), UPDATED);
        hold(&pipeline, &mut b);
        assert_eq!(b.step(&NEAR), IDLE, "the rendering of what it updated is carried");
        assert_eq!(a.step(&NEAR), RENDERED);
        assert_eq!(pipeline.frame(), Frame(1), "and swapped");
    });
}

#[test]
fn a_token_goes_from_hand_to_hand() {
    with(1, 1, 1, |mut pipeline, _| {
        pipeline.run(1).expect("at rest");
        let (mut a, mut b) = (pipeline.worker(), pipeline.worker());
        hold(&pipeline, &mut a);
        assert_eq!([a.step(&FAR), a.step(&FAR)], [ENTERED, UPDATED]);
        assert!(a.token().is_some() && b.token().is_none());
        let token = a.release().expect("it has one");
        assert!(a.token().is_none() && b.hold(token).is_ok());
        assert_eq!(a.step(&FAR), IDLE);
        assert_eq!(b.step(&FAR), RENDERED, "what the other one carried");
    });
}

#[test]
fn nobody_wakes_without_cause() {
    with(1, 1, 1, |mut pipeline, notes| {
        let worker = pipeline.worker();
        assert!(worker.has_cause_to_wake(), "it is at rest");
        worker.wait();
        assert!(notes.slept().is_empty(), "and nobody would call");
        drop(worker);
        pipeline.run(1).expect("at rest");
        let (mut a, b) = (pipeline.worker(), pipeline.worker());
        assert!(b.has_cause_to_wake(), "the unit is to enter");
        assert_eq!([a.step(&FAR), a.step(&FAR)], [ENTERED, UPDATED]);
        assert_eq!(a.step(&FAR), IDLE, "it cannot render");
        assert!(!b.has_cause_to_wake());
        b.wait();
        assert_eq!(notes.slept(), [false]);
        hold(&pipeline, &mut a);
        assert!(a.has_cause_to_wake() && !b.has_cause_to_wake());
        assert_eq!(a.step(&FAR), RENDERED);
        assert!(b.has_cause_to_wake(), "it is at rest again");
    });
    with(2, 1, 1, |mut pipeline, notes| {
        pipeline.run(1).expect("at rest");
        let (mut a, mut b) = (pipeline.worker(), pipeline.worker());
        assert_eq!([a.step(&NEAR), a.step(&NEAR)], [ENTERED, ENTERED]);
        hold(&pipeline, &mut b);
        assert!(a.has_cause_to_wake(), "it carries the interaction");
        assert!(!b.has_cause_to_wake());
        a.wait();
        b.wait();
        assert_eq!(notes.slept(), [true], "the holder slept, on the holders' bell");
    });
}

/// Who is called by each of so many steps of a worker that carries the interaction of two units, and
/// then by its leaving, while two others sleep that found nothing to do.
fn called(they_hold: bool, it_holds: bool, frames: u32, steps: usize) -> Vec<Vec<(bool, u32)>> {
    let _watch = watchdog::watch(format!("{they_hold} {it_holds} {frames} {steps}"));
    let notes = Notes { night: Some(Barrier::new(3)), ..Notes::default() };
    with_notes(2, 1, 3, &notes, |mut pipeline, notes| {
        pipeline.run(frames).expect("at rest");
        let pipeline = &pipeline;
        let mut worker = pipeline.worker();
        assert_eq!([worker.step(&NEAR), worker.step(&NEAR)], [ENTERED, ENTERED]);
        if it_holds {
            hold(pipeline, &mut worker);
        }
        std::thread::scope(|scope| {
            for _ in 0..2 {
                scope.spawn(|| {
                    let mut sleeper = pipeline.worker();
                    if they_hold {
                        hold(pipeline, &mut sleeper);
                    }
                    assert_eq!(sleeper.step(&NEAR), IDLE);
                    sleeper.wait();
                });
            }
            notes.pass();
            let mut called = vec![notes.woken()];
            for _ in 0..steps {
                worker.step(&NEAR).expect("no callback fails");
                called.push(notes.woken());
            }
            drop(worker);
            called.push(notes.woken());
            notes.pass();
            called
        })
    })
}

#[test]
fn whoever_queues_work_calls_those_who_can_do_it() {
    let (one, all) = ([(false, 1)], [(false, 2)]);
    let (holder, all_holders) = ([(true, 1)], [(true, 2)]);
    let nobody = &[][..];
    // It interacts and queues one of two updates, which the sleepers can do; then it updates twice,
    // and only holders can do what is rendered and what it leaves behind.
    assert_eq!(called(false, false, 1, 3), [nobody, &one, nobody, nobody, nobody]);
    assert_eq!(called(true, false, 1, 3), [nobody, &holder, &holder, &holder, &holder]);
    // Leaving after the interaction, it queues the other update too, and passes its call on.
    assert_eq!(called(false, false, 1, 1), [nobody, &one, &all]);
    // A holder carries its renderings. All see that the pipeline is at rest, or, if another frame
    // follows, all holders that there may be more to render.
    assert_eq!(called(false, true, 1, 5), [nobody, &one, nobody, nobody, nobody, &all, nobody]);
    // Interaction, update, rendering, entry, update, rendering: each update lets a unit enter.
    let steps = called(true, true, 2, 6);
    assert_eq!(steps[..7], [nobody, &holder, &holder, nobody, nobody, &holder, &all_holders]);
}

#[test]
fn high_water_is_what_one_frame_used() {
    with(4, 1, 1, |mut pipeline, _| {
        assert_eq!(pipeline.high_water(), (0, 0));
        pipeline.run(3).expect("at rest");
        finish(&pipeline, &NEAR);
        assert_eq!(pipeline.high_water(), (6, 12));
        pipeline.run(2).expect("at rest");
        finish(&pipeline, &FAR);
        assert_eq!(pipeline.high_water(), (0, 0), "of the last two frames");
    });
}

#[test]
fn waiting_letters_are_taken() {
    with(3, 1, 1, |mut pipeline, _| {
        let from = From { sender: 7, sequence: 3 };
        for (round, message) in ["before the first frame", "after it"].into_iter().enumerate() {
            let to = UnitId(round as u32 + 1);
            assert_eq!(pipeline.post(to, from, message), Ok(()));
            let mut taken = vec![];
            pipeline.take_letters(|to, from, message| taken.push((to, from, message)));
            assert_eq!(taken, [(to, from, message)]);
            pipeline.take_letters(|_, _, _| unreachable!("they were taken"));
            pipeline.run(1).expect("at rest");
            finish(&pipeline, &FAR);
        }
    });
}

#[test]
fn a_letter_that_is_not_read_leaves_room_for_another() {
    with(1, 1, 1, |mut pipeline, _| {
        for sequence in 0..3 {
            let from = From { sender: 0, sequence };
            for _ in 0..2 {
                assert_eq!(pipeline.post(UnitId(0), from, "nothing"), Ok(()));
            }
            assert!(pipeline.post(UnitId(0), from, "too much").is_err());
            pipeline.run(1).expect("at rest");
            finish(&pipeline, &FAR);
        }
    });
}

#[test]
fn interactions_come_in_pair_order() {
    with(5, 1, 1, |mut pipeline, _| {
        pipeline.run(2).expect("at rest");
        finish(&pipeline, &NEAR);
        for (unit, found) in (0..).zip(pipeline.objects_mut()) {
            assert!(found.met.iter().copied().eq((0..5).filter(|&other| other != unit)));
        }
    });
}

#[test]
fn letters_of_one_update_keep_their_order() {
    with(1, 1, 1, |mut pipeline, _| {
        pipeline.run(3).expect("at rest");
        finish(&pipeline, &Crowd { near: false, writes: true });
        let from = |sequence| From { sender: 0, sequence };
        let found = pipeline.objects_mut().next().map(|found| found.read.as_slice());
        assert_eq!(found, Some(&[(from(0), "first"), (from(1), "second")][..]));
    });
}
