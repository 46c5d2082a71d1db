//! Who sleeps, who is called, and by what.

use std::sync::Barrier;

use dualframe_tests::watchdog;

use crate::crowd::{
    ENTERED, FAR, IDLE, NEAR, Notes, RENDERED, UPDATED, come_for_all, hold, with, with_notes,
};

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
        assert!(b.has_cause_to_wake(), "units are to be come for");
        come_for_all(&pipeline);
        assert!(!b.has_cause_to_wake(), "they wait for the interaction");
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
fn whoever_opens_a_frame_calls_for_its_units() {
    let _watch = watchdog::watch("opening".to_owned());
    let notes = Notes { night: Some(Barrier::new(2)), ..Notes::default() };
    with_notes(1, 1, 1, &notes, |mut pipeline, notes| {
        pipeline.run(2).expect("at rest");
        let pipeline = &pipeline;
        let mut worker = pipeline.worker();
        assert_eq!([worker.step(&FAR), worker.step(&FAR)], [ENTERED, UPDATED]);
        let (opens, called) = std::thread::scope(|scope| {
            scope.spawn(|| {
                let mut sleeper = pipeline.worker();
                assert_eq!(sleeper.step(&FAR), IDLE, "the other one carries the entry");
                sleeper.wait();
            });
            notes.pass();
            let opened = (worker.step(&FAR), notes.woken());
            notes.pass();
            opened
        });
        assert_eq!((opens, &called[..]), (ENTERED, &[(false, 1)][..]));
    });
}
