//! What workers do first, what they carry and share, and whom they wake: seen step by step, on one
//! thread (others only sleep), since none of it changes what comes out.
#![forbid(unsafe_code)]

mod calls;
mod crowd;
mod letters;

use std::panic::{AssertUnwindSafe, catch_unwind};

use dualframe_core::frame::Frame;
use dualframe_core::probe::NoProbe;
use dualframe_core::unit::{InteractionId, UnitId, Work};
use dualframe_core::worker::Step;

use crowd::{
    BREAKS, Crowd, ENTERED, FAR, IDLE, INTERACTED, Log, NEAR, RENDERED, UPDATED, alone,
    come_for_all, error, finish, hold, next, units, with,
};

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

/// Its data are in that worker's cache; but one that does not come holds nobody up for long.
#[test]
fn an_update_is_left_to_its_home_for_some_steps() {
    for comes in [true, false] {
        with(2, 2, 1, |mut pipeline, _| {
            pipeline.run(1).expect("at rest");
            let mut first = pipeline.worker_at(0);
            let done = [ENTERED, ENTERED, UPDATED, IDLE];
            assert_eq!(done.map(|_| first.step(&FAR)), done, "whatever else there is at once");
            assert!(first.has_cause_to_wake());
            if comes {
                assert_eq!(pipeline.worker_at(1).step(&FAR), UPDATED);
                assert!(!first.has_cause_to_wake());
            } else {
                let left = (0..1000).take_while(|_| first.step(&FAR) == IDLE).count();
                assert!((8..100).contains(&left), "{left} steps");
            }
            assert_eq!(first.step(&FAR), IDLE);
            drop(first);
            finish(&pipeline, &FAR);
        });
    }
}

/// A unit that nobody has come for yet is not lost, and none is come for twice.
#[test]
fn homes_change_within_an_open_frame() {
    for (env, steps) in [(&FAR, 6), (&FAR, 7), (&FAR, 9), (&NEAR, 6 + 15), (&NEAR, 6 + 15 + 1)] {
        with(6, 3, 1, |mut pipeline, _| {
            pipeline.run(2).expect("at rest");
            let mut log = Log::default();
            let mut worker = pipeline.worker().probed(&mut log);
            (0..steps).for_each(|_| assert_ne!(next(&mut worker, env), None));
            drop(worker);
            pipeline.set_homes(|unit| 7 - unit.0);
            let mut worker = pipeline.worker();
            hold(&pipeline, &mut worker);
            let mut worker = worker.probed(&mut log);
            while !pipeline.finished() {
                assert_ne!(next(&mut worker, env), None, "after {steps} steps");
            }
            drop(worker);
            for frame in [0, 1].map(Frame) {
                let of_frame = log.begun.iter().filter(|(_, of)| *of == frame);
                let [_, mut updated] = units(&Vec::from_iter(of_frame.map(|&(work, _)| work)));
                updated.sort_unstable();
                assert_eq!(updated, [0, 1, 2, 3, 4, 5], "{frame:?}, after {steps} steps");
            }
        });
    }
}

#[test]
fn a_probe_sees_every_work_unit() {
    with(2, 1, 1, |mut pipeline, _| {
        let [a, b] = [0, 1].map(UnitId);
        let met = Work::Interact(InteractionId(0));
        let expected = [Work::Enter(a), Work::Enter(b), met, Work::Update(b), Work::Update(a)];
        assert_eq!(
            alone(&mut pipeline, 0, &NEAR),
            expected,
            "updates that are carried, newest first"
        );
    });
}

#[test]
fn interactions_of_the_next_frame_are_kept_while_there_are_updates() {
    with(8, 1, 1, |mut pipeline, _| {
        pipeline.run(2).expect("at rest");
        let mut log = Log::default();
        let mut worker = pipeline.worker().probed(&mut log);
        for met in 0..8 {
            assert_eq!(worker.step(&NEAR), ENTERED);
            // Nothing else is to be done yet; and then updates wait for them.
            (0..met).for_each(|_| assert_eq!(worker.step(&NEAR), INTERACTED));
        }
        // Of the 6 that four units have, and then of more, 4 are kept.
        for done in [0, 0, 0, 2, 4, 5, 6] {
            assert_eq!([worker.step(&NEAR), worker.step(&NEAR)], [UPDATED, ENTERED]);
            (0..done).for_each(|_| assert_eq!(worker.step(&NEAR), INTERACTED));
        }
        assert_eq!([worker.step(&NEAR), worker.step(&NEAR)], [UPDATED, ENTERED]);
        (0..4 + 7).for_each(|_| assert_eq!(worker.step(&NEAR), INTERACTED));
        assert_eq!(worker.step(&NEAR), IDLE, "the next updates wait for renderings");
        drop(worker);
        let next = log.begun.iter().filter(|(_, frame)| *frame == Frame(1));
        let met = next
            .filter_map(|(work, _)| if let Work::Interact(id) = work { Some(id.0) } else { None });
        let met = Vec::from_iter(met);
        let oldest = *met.iter().min().expect("there are 28");
        assert_eq!([met[0], met[1]].map(|id| id - oldest), [5, 4], "the newest while nobody waits");
        assert_eq!([met[17], met[18]].map(|id| id - oldest), [0, 1], "the oldest once updates do");
    });
}

#[test]
fn updates_at_home_come_before_interactions_of_the_next_frame() {
    with(4, 2, 1, |mut pipeline, _| {
        pipeline.run(2).expect("at rest");
        let [mut a, mut b] = [0, 1].map(|home| pipeline.worker_at(home));
        let mut steps = [0; 4];
        while steps[2] == 0 {
            let Ok(Step::Worked(stage)) = a.step(&NEAR) else { panic!("there is work") };
            steps[stage as usize] += 1;
        }
        assert_eq!(steps, [4, 6, 1, 0], "both updates of the other home are queued there");
        assert_eq!(a.step(&NEAR), ENTERED);
        assert_eq!([b.step(&NEAR), b.step(&NEAR)], [UPDATED, ENTERED]);
        assert_eq!(b.step(&NEAR), UPDATED, "though two of its units have met");
        assert_eq!([b.step(&NEAR), b.step(&NEAR)], [ENTERED, INTERACTED]);
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
        come_for_all(&pipeline);
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
fn an_error_of_the_swap_comes_out_unless_its_rendering_has_one() {
    with(1, 1, 1, |mut pipeline, _| {
        let (drawing, swapping) = (Err(error(1)), Err(error(2)));
        let ways = [(Ok(()), swapping), (drawing, Ok(())), (drawing, swapping)];
        for ((rendered, swapped), reported) in ways.into_iter().zip([2, 1, 1].map(error)) {
            pipeline.run(1).expect("at rest");
            let mut worker = pipeline.worker();
            hold(&pipeline, &mut worker);
            let fails = Crowd { rendered, swapped, ..FAR };
            assert_eq!([worker.step(&fails), worker.step(&fails)], [ENTERED, UPDATED]);
            assert_eq!(worker.step(&fails), Err(reported));
            assert!(pipeline.finished());
        }
    });
}

#[test]
fn a_token_goes_from_hand_to_hand() {
    with(1, 1, 1, |mut pipeline, _| {
        pipeline.run(1).expect("at rest");
        let (mut a, mut b) = (pipeline.worker(), pipeline.worker());
        hold(&pipeline, &mut a);
        assert_eq!([a.step(&FAR), a.step(&FAR)], [ENTERED, UPDATED]);
        assert!(a.renderer().is_some() && b.renderer().is_none());
        let token = a.release().expect("it has one");
        assert!(a.renderer().is_none() && b.hold(token).is_ok());
        assert_eq!(a.step(&FAR), IDLE);
        let mut b = b.probed(NoProbe);
        assert!(b.renderer().is_some(), "who is watched keeps the token");
        assert_eq!(b.step(&FAR), RENDERED, "what the other one carried");
    });
}

#[test]
fn whoever_updates_renders_if_the_shared_renderer_is_free() {
    for is_free in [false, true] {
        with(2, 2, 1, |mut pipeline, _| {
            pipeline.run(1).expect("at rest");
            pipeline.share(()).expect("no token is out");
            let (mut a, mut b) = (pipeline.worker_at(0), pipeline.worker_at(1));
            assert_eq!([a.step(&FAR), b.step(&FAR)], [ENTERED, ENTERED]);
            assert_eq!([a.step(&FAR), a.step(&FAR)], [UPDATED, RENDERED]);
            if is_free {
                assert!(a.release().is_none(), "it has no token, and puts the renderer back");
                assert_eq!([b.step(&FAR), a.step(&FAR)], [UPDATED, IDLE]);
                assert!(!a.has_cause_to_wake(), "the other one is about to render");
                assert_eq!(b.step(&FAR), RENDERED);
            } else {
                assert!(a.has_cause_to_wake(), "it has the renderer");
                assert_eq!([b.step(&FAR), b.step(&FAR)], [UPDATED, IDLE]);
                assert!(!b.has_cause_to_wake());
                assert_eq!(a.step(&FAR), RENDERED);
            }
            assert!(pipeline.finished());
        });
    }
}

#[test]
fn nobody_is_given_a_renderer_whose_rendering_panicked() {
    with(2, 2, 1, |mut pipeline, _| {
        pipeline.run(1).expect("at rest");
        pipeline.share(()).expect("no token is out");
        let (mut a, mut b) = (pipeline.worker_at(0), pipeline.worker_at(1));
        assert_eq!([a.step(&FAR), b.step(&FAR)], [ENTERED, ENTERED]);
        assert_eq!(a.step(&FAR), UPDATED);
        assert!(catch_unwind(AssertUnwindSafe(|| a.step(&BREAKS))).is_err());
        assert_eq!([b.step(&FAR), b.step(&FAR)], [UPDATED, IDLE], "its rendering is queued");
        drop(a);
        assert_eq!(b.step(&FAR), IDLE, "though nobody has the renderer");
        assert!(!b.has_cause_to_wake());
        drop(b);
        assert_eq!(pipeline.take_back(), Some(()), "it is its owner's again");
    });
}

#[test]
fn high_water_is_what_one_frame_used() {
    with(4, 1, 1, |mut pipeline, _| {
        assert_eq!(pipeline.high_water(), (0, 0));
        pipeline.run(3).expect("at rest");
        finish(&pipeline, &NEAR);
        assert_eq!(pipeline.high_water(), (6, 12));
        pipeline.run(1).expect("at rest");
        finish(&pipeline, &FAR);
        assert_eq!(pipeline.high_water(), (0, 0), "of the last frame");
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
