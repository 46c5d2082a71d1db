//! A swap may take long, for it may wait for a display. Meanwhile others do all of the next frame that does not
//! depend on it: also what the worker that swaps has carried, or queued and not called for.
#![forbid(unsafe_code)]

use std::sync::{Condvar, Mutex, MutexGuard};
use std::time::Duration;

use dualframe_core::contacts::Contacts;
use dualframe_core::environment::{Environment, Pair};
use dualframe_core::error::TableFull;
use dualframe_core::frame::{Entry, Frame};
use dualframe_core::inputs::Inputs;
use dualframe_core::pipeline::{Config, Pipeline};
use dualframe_core::ring::QueueSlot;
use dualframe_core::storage::{Memory, UnitSlot, queue_slots};
use dualframe_core::unit::UnitId;
use dualframe_core::wait::{Bell, Epoch, Waiting};
use dualframe_core::worker::Step;

/// How far things are, and who waits for that.
#[derive(Default)]
struct Clock {
    state: Mutex<State>,
    changed: Condvar,
}

#[derive(Default)]
struct State {
    asleep: bool,
    updated: Option<Frame>,
}

impl Clock {
    fn change(&self, change: impl FnOnce(&mut State)) {
        change(&mut self.state.lock().expect("no poison"));
        self.changed.notify_all();
    }

    /// Waits, but not for ever; `false` if it was in vain.
    fn wait(&self, until: impl Fn(&State) -> bool) -> bool {
        let state = self.state.lock().expect("no poison");
        let patience = Duration::from_secs(10);
        let waits = |state: &mut State| !until(state);
        let (state, _): (MutexGuard<'_, State>, _) =
            self.changed.wait_timeout_while(state, patience, waits).expect("no poison");
        until(&state)
    }
}

impl Waiting for &Clock {
    fn sleep(&self, bell: &Bell, seen: Epoch) {
        self.change(|state| state.asleep = true);
        self.wait(|_| bell.rung_since(seen));
    }

    fn wake(&self, _: &Bell, _: u32) {
        self.change(|state| state.asleep = false);
    }
}

/// What a swap waited for in vain, or a full table.
#[derive(Debug)]
struct Failure;

impl From<TableFull> for Failure {
    fn from(_: TableFull) -> Self {
        Self
    }
}

/// One unit; a frame stays on display until the next one is as far as it may be.
struct Display<'c>(&'c Clock);

impl Environment for Display<'_> {
    type Object = ();
    type Interaction = ();
    type Contact = ();
    type Message = ();
    type Renderer = ();
    type Error = Failure;

    fn broad_phase(&self, (): &(), (): &()) -> bool {
        false
    }

    fn interact(
        &self,
        _: Pair,
        (): &(),
        (): &(),
        (): &mut (),
        _: &mut Contacts<'_, '_, ()>,
    ) -> Result<(), Failure> {
        Ok(())
    }

    fn update(
        &self,
        _: UnitId,
        frame: Frame,
        (): &mut (),
        _: &mut Inputs<'_, '_, Self>,
    ) -> Result<(), Failure> {
        self.0.change(|state| state.updated = Some(frame));
        Ok(())
    }

    fn render(&self, _: UnitId, _: Frame, (): &(), (): &mut ()) -> Result<(), Failure> {
        Ok(())
    }

    fn swap(&self, frame: Frame, (): &mut ()) -> Result<(), Failure> {
        let is_last = frame == Frame(1);
        let goes_on = is_last || self.0.wait(|state| state.updated == Some(frame.next()));
        if goes_on { Ok(()) } else { Err(Failure) }
    }
}

/// A worker of `home` swaps frame 0 while another one, of home 0, which is the unit's, sleeps.
fn swaps_while_another_sleeps(entry: Entry, home: u32) {
    let clock = Clock::default();
    let display = Display(&clock);
    let memory = Memory {
        units: &mut [UnitSlot::new(())],
        interactions: &mut [],
        contacts: &mut [],
        segments: &mut [],
        letters: &mut [],
        queues: &mut [const { QueueSlot::new() }; queue_slots(1, 0, 0, 2)],
    };
    let config = Config { entry, homes: 2, ..Config::default() };
    let mut pipeline = Pipeline::new(memory, config, &clock).expect("tables that fit");
    pipeline.run(2).expect("at rest");
    let mut swaps = pipeline.worker_at(home);
    while swaps.step(&display).expect("no swap yet") != Step::Idle {}
    swaps.hold(pipeline.token(()).map_err(drop).expect("a token")).map_err(drop).expect("its own");
    std::thread::scope(|scope| {
        scope.spawn(|| {
            let mut other = pipeline.worker();
            while !pipeline.finished() {
                if other.step(&display).expect("it does not swap") == Step::Idle {
                    other.wait();
                }
            }
        });
        assert!(clock.wait(|state| state.asleep), "there is nothing to do");
        let swapped = swaps.step(&display);
        while !pipeline.finished() {
            swaps.step(&display).expect("nothing is waited for");
        }
        assert!(swapped.is_ok(), "{entry:?}, home {home}: the next frame waits for the swap");
    });
}

#[test]
fn the_next_frame_waits_for_no_swap() {
    for entry in [Entry::AfterUpdate, Entry::AfterRender] {
        for home in 0..2 {
            swaps_while_another_sleeps(entry, home);
        }
    }
}
