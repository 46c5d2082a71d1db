//! Sleeping and waking: no wake-up is lost, and none goes to a worker that cannot use it.
//!
//! A lost wake-up is a sleeper that spins on its bell for ever while nobody else has work, which
//! exceeds loom's limit of branches and fails the model. Nothing here blocks in loom's own
//! condition variables: they would hand out ordering that the bells have to give.

use super::ve::{Screen, Setup, build, build_with, step, verify};
use super::{Guarded, Model, Role, check, lend, lock, together};
use dualframe_core_model::stage::Stage;
use dualframe_core_model::wait::{Bell, Epoch, Waiting};
use dualframe_core_model::worker::Step;
use loom::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use std::mem::ManuallyDrop;
use std::sync::Mutex;

pub(crate) const ALL: &[Model] = &[
    ("bell::ring_shows_work", ring_shows_work),
    ("bell::all_sleepers_end", all_sleepers_end),
    ("bell::render_wakes_holders_only", render_wakes_holders_only),
    ("bell::leaver_passes_it_on", leaver_passes_it_on),
];

/// A holder waits for what the other worker queues for it, or leaves to it: it wakes whenever there is
/// work that the other does not take, and comes to the end.
fn ring_shows_work() {
    check("bell::ring_shows_work", Some(3), 2, [true], |order| {
        let (pipeline, world) = build(Setup { units: 1, frames: 1, ..Setup::default() });
        let screen: Screen = lend(Guarded::new(0));
        let mut updater = pipeline.worker();
        // Entered; the unit is there to come for.
        assert_ne!(step(&mut updater, world), Step::Idle);
        let update: Role<bool> = Box::new(move || step(&mut updater, world) != Step::Idle);
        let render: Role<bool> = Box::new(move || {
            let mut worker = pipeline.worker();
            let Ok(token) = pipeline.token(screen) else { panic!("a token is left") };
            assert!(worker.hold(token).is_ok());
            let mut worked = false;
            while !pipeline.finished() {
                worker.wait();
                worked |= step(&mut worker, world) != Step::Idle;
            }
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
                    if step(&mut worker, world) != Step::Idle {
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
        lock(self.0).push((bell.is_for_holders(), count));
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
        // Neither worker is asked to leave a model that has failed: what it shared is gone by then.
        let mut updater = ManuallyDrop::new(pipeline.worker());
        assert_ne!(step(&mut updater, world), Step::Idle);
        let update: Role<()> = Box::new(move || {
            // Queues the rendering and announces it; then takes the token and renders.
            assert_ne!(step(&mut updater, world), Step::Idle);
            assert!(lock(woken).is_empty(), "nobody who could render sleeps");
            let Ok(token) = pipeline.token(screen) else { panic!("a token is left") };
            assert!(updater.hold(token).is_ok());
            assert_ne!(step(&mut updater, world), Step::Idle);
            drop(ManuallyDrop::into_inner(updater));
        });
        let sleep: Role<()> = Box::new(move || {
            let worker = ManuallyDrop::new(pipeline.worker());
            // Not while the unit is still there to come for.
            if !worker.has_cause_to_wake() {
                worker.wait();
                assert!(pipeline.finished(), "woken before there is cause");
            }
            drop(ManuallyDrop::into_inner(worker));
        });
        together(order, vec![update, sleep]);
        verify(pipeline, world);
        lock(woken).clone()
    });
}

/// Who sleeps.
struct Asleep {
    for_holders: bool,
    leaves: bool,
    flag: &'static AtomicBool,
}

/// Sleeps and wakes as a futex does: whoever is not asleep when the epoch moves does not fall
/// asleep, and one call wakes one.
struct One {
    /// Puts falling asleep and waking in an order.
    bucket: AtomicU32,
    asleep: Mutex<Vec<Asleep>>,
    flags: Mutex<Vec<&'static AtomicBool>>,
    /// The thread that leaves when it wakes.
    leaver: Mutex<Option<loom::thread::ThreadId>>,
    /// Its sleep returns at once, as every sleep may.
    restless: bool,
    /// Whether the one that leaves, and the one that stays, was woken by a call.
    woken: Mutex<[bool; 2]>,
    /// The model is over for whoever still sleeps. Not loom's: it orders nothing.
    over: Mutex<bool>,
}

impl Waiting for One {
    fn sleep(&self, bell: &Bell, seen: Epoch) {
        let leaves = *lock(&self.leaver) == Some(loom::thread::current().id());
        if leaves && self.restless {
            return;
        }
        // Made before the threads were: loom counts the making of an atomic as an access.
        let Some(flag) = lock(&self.flags).pop() else { panic!("sleeps too often") };
        lock(&self.asleep).push(Asleep { for_holders: bell.is_for_holders(), leaves, flag });
        self.bucket.fetch_add(1, Ordering::AcqRel);
        if bell.rung_since(seen) {
            lock(&self.asleep).retain(|at| !std::ptr::eq(at.flag, flag));
            return;
        }
        while !flag.load(Ordering::Acquire) && !*lock(&self.over) {
            loom::hint::spin_loop();
        }
    }

    fn wake(&self, bell: &Bell, count: u32) {
        self.bucket.fetch_add(1, Ordering::AcqRel);
        for _ in 0..count {
            let chosen = {
                let mut asleep = lock(&self.asleep);
                let at = asleep.iter().position(|at| at.for_holders == bell.is_for_holders());
                at.map(|at| asleep.remove(at))
            };
            let Some(chosen) = chosen else { break };
            lock(&self.woken)[usize::from(!chosen.leaves)] = true;
            chosen.flag.store(true, Ordering::Release);
        }
    }
}

/// A worker announces one update that it queued, and is suspended. Of two that wait, one leaves
/// when it wakes, whatever for: the other does the update. It may hold the token, and wait at
/// another bell; and the one that leaves may have woken by itself. The outcome is which of these cases it
/// was, and which of the two a call woke.
fn leaver_passes_it_on() {
    let woken = [[false, false], [false, true], [true, false], [true, true]];
    let cases = [[false, false], [false, true], [true, true]];
    // Whoever wakes by itself is not woken.
    let all = cases.into_iter().flat_map(|[holder, restless]| {
        let woken = woken.into_iter().filter(move |[leaver, _]| !(restless && *leaver));
        woken.map(move |woken| ([holder, restless], woken))
    });
    check("bell::leaver_passes_it_on", Some(1), 9, all, |order| {
        let [holder, restless] = [order / 3 == 2, order / 3 > 0];
        let setup = Setup { frames: 1, ..Setup::default() };
        let waiting: &One = lend(One {
            bucket: AtomicU32::new(0),
            asleep: Mutex::default(),
            flags: Mutex::new((0..8).map(|_| &*lend(AtomicBool::new(false))).collect()),
            leaver: Mutex::default(),
            restless,
            woken: Mutex::default(),
            over: Mutex::default(),
        });
        let (pipeline, world) = build_with(setup, waiting);
        let screen: Screen = lend(Guarded::new(0));
        // Never dropped: it stays where it is.
        let suspended = &mut **lend(ManuallyDrop::new(pipeline.worker()));
        // Both units enter; their interaction is carried. Somebody comes for them, but they wait for that.
        for _ in 0..2 {
            assert_ne!(step(suspended, world), Step::Idle);
        }
        assert_eq!(step(&mut pipeline.worker(), world), Step::Idle);
        let interact: Role<Step> = Box::new(move || step(suspended, world));
        let leave: Role<Step> = Box::new(move || {
            *lock(&waiting.leaver) = Some(loom::thread::current().id());
            let worker = pipeline.worker();
            worker.wait();
            Step::Idle
        });
        let stay: Role<Step> = Box::new(move || {
            let mut worker = pipeline.worker();
            if holder {
                let Ok(token) = pipeline.token(screen) else { panic!("a token is left") };
                assert!(worker.hold(token).is_ok());
            }
            loop {
                worker.wait();
                let done = step(&mut worker, world);
                if done != Step::Idle {
                    *lock(&waiting.over) = true;
                    return done;
                }
            }
        });
        let done = together(order, vec![interact, leave, stay]);
        assert_eq!(done[2], Step::Worked(Stage::Update), "the update was done");
        ([holder, restless], *lock(&waiting.woken))
    });
}
