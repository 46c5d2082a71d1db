//! Sleeping and waking: no wake-up is lost, and none goes to a worker that cannot use it.
//!
//! A lost wake-up is a sleeper that spins on its bell for ever while nobody else has work, which
//! exceeds loom's limit of branches and fails the model. Nothing here blocks in loom's own
//! condition variables: they would hand out ordering that the bells have to give.

use super::pipeline::{Screen, Setup, build, build_with, step, verify};
use super::{Guarded, Model, Role, check, lend, together};
use dualframe_core_model::wait::{Bell, Epoch, Waiting};
use std::sync::Mutex;

pub(crate) const ALL: &[Model] = &[
    ("bell::ring_shows_work", ring_shows_work),
    ("bell::all_sleepers_end", all_sleepers_end),
    ("bell::render_wakes_holders_only", render_wakes_holders_only),
    ("bell::leaver_passes_it_on", leaver_passes_it_on),
];

/// A holder waits for what the other worker queues for it: it wakes, and then there is work, for
/// its very next step.
fn ring_shows_work() {
    check("bell::ring_shows_work", None, 2, [true], |order| {
        let (pipeline, world) = build(Setup { units: 1, frames: 1, ..Setup::default() });
        let screen: Screen = lend(Guarded::new(0));
        let mut updater = pipeline.worker();
        // Entered; the update is carried.
        assert!(step(&mut updater, world));
        let update: Role<bool> = Box::new(move || step(&mut updater, world));
        let render: Role<bool> = Box::new(move || {
            let mut worker = pipeline.worker();
            let Ok(token) = pipeline.token(screen) else { panic!("a token is left") };
            assert!(worker.hold(token).is_ok());
            worker.wait();
            let worked = step(&mut worker, world);
            assert!(worked, "woken for nothing");
            worked
        });
        let worked = together(order, vec![update, render])[1];
        verify(pipeline, world);
        worked
    });
}

/// Two workers who wait whenever they are idle: both come to an end. The outcome is who updated.
fn all_sleepers_end() {
    check("bell::all_sleepers_end", Some(3), 2, [false, true], |order| {
        let (pipeline, world) = build(Setup { units: 1, frames: 1, ..Setup::default() });
        let screen: Screen = lend(Guarded::new(0));
        let role = |holder: bool| -> Role<u32> {
            Box::new(move || {
                let mut worker = pipeline.worker();
                if holder {
                    let Ok(token) = pipeline.token(screen) else { panic!("a token is left") };
                    assert!(worker.hold(token).is_ok());
                }
                let mut worked = 0;
                while !pipeline.finished() {
                    if step(&mut worker, world) {
                        worked += 1;
                    } else {
                        worker.wait();
                    }
                }
                worked
            })
        };
        let worked = together(order, vec![role(true), role(false)]);
        verify(pipeline, world);
        assert_eq!(worked.iter().sum::<u32>(), 3);
        worked[0] == 3
    });
}

/// Notes whom the bells wake.
struct Noted(&'static Mutex<Vec<(bool, u32)>>);

impl Waiting for Noted {
    fn sleep(&self, bell: &Bell, seen: Epoch) {
        while !bell.rung_since(seen) {
            loom::hint::spin_loop();
        }
    }

    fn wake(&self, bell: &Bell, count: u32) {
        super::lock(self.0).push((bell.is_for_holders(), count));
    }
}

/// A worker without a token sleeps through the announcement of a rendering, and wakes at the end.
fn render_wakes_holders_only() {
    let others = (false, 1);
    let expected = [vec![], vec![others]];
    check("bell::render_wakes_holders_only", None, 2, expected, |order| {
        let woken: &Mutex<Vec<_>> = lend(Mutex::default());
        let setup = Setup { units: 1, frames: 1, ..Setup::default() };
        let (pipeline, world) = build_with(setup, Noted(woken));
        let screen: Screen = lend(Guarded::new(0));
        let mut updater = pipeline.worker();
        assert!(step(&mut updater, world));
        let update: Role<()> = Box::new(move || {
            // Queues the rendering and announces it; then takes the token and renders.
            assert!(step(&mut updater, world));
            assert!(super::lock(woken).is_empty(), "nobody who could render sleeps");
            let Ok(token) = pipeline.token(screen) else { panic!("a token is left") };
            assert!(updater.hold(token).is_ok());
            assert!(step(&mut updater, world));
        });
        let sleep: Role<()> = Box::new(move || {
            let worker = pipeline.worker();
            worker.wait();
            assert!(pipeline.finished(), "woken before there is cause");
        });
        together(order, vec![update, sleep]);
        verify(pipeline, world);
        super::lock(woken).clone()
    });
}

/// Wakes one sleeper, as a futex does, and never the last who came.
struct One(&'static Mutex<Vec<usize>>);

/// A worker is woken for work and leaves instead, and so does the one who announced it: the other
/// sleeper is called.
fn leaver_passes_it_on() {}
