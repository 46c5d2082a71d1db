//! What every executor does with a renderer: who draws, and panics on their way to the caller, some through C++.

mod common;

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::thread::{self, ThreadId};

use common::particles;
use dualframe_sim::blocking::Grain;
use dualframe_sim::executor::ExecutorKind;
use dualframe_sim::manager::{Settings, VeManager};
use dualframe_sim::object::{Object, ObjectId};
use dualframe_sim::render::Renderer;

/// More than have a block each.
const PARTICLES: usize = 100;

fn manager(executor: ExecutorKind, threads: usize) -> VeManager {
    let settings = Settings { executor, threads, grain: Grain::Spatial, ..Settings::default() };
    VeManager::new(particles(PARTICLES, true, true), settings).expect("all of it is allowed")
}

/// Notes what it is given, and by whom.
#[derive(Default)]
struct Notes {
    is_bound: bool,
    drawn: Vec<ObjectId>,
    frames: Vec<(u64, Vec<ObjectId>)>,
    threads: Vec<ThreadId>,
}

impl Renderer for Notes {
    fn draw(&mut self, object: &Object) {
        self.drawn.push(object.id());
        self.threads.push(thread::current().id());
    }

    fn swap(&mut self, frame: u64) {
        self.drawn.sort_unstable();
        self.frames.push((frame, std::mem::take(&mut self.drawn)));
        self.threads.push(thread::current().id());
    }

    fn is_bound(&self) -> bool {
        self.is_bound
    }
}

#[test]
fn every_object_is_drawn_once_a_frame() {
    let everything: Vec<_> = (0..PARTICLES as u32).map(ObjectId).collect();
    for &executor in ExecutorKind::ALL {
        for is_bound in [false, true] {
            let mut notes = Notes { is_bound, ..Notes::default() };
            manager(executor, 3).run(40, &mut notes, &mut |_| ()).expect("no table is full");
            assert!(notes.frames.iter().map(|(frame, _)| *frame).eq(0..40), "{executor:?}");
            assert!(notes.frames.iter().all(|(_, drawn)| *drawn == everything), "{executor:?}");
            let caller = thread::current().id();
            let stays = notes.threads.iter().all(|&thread| thread == caller);
            assert!(stays || !is_bound, "{executor:?}");
        }
    }
}

/// Panics when it is given one object.
struct Failing {
    object: ObjectId,
    is_bound: bool,
}

impl Renderer for Failing {
    fn draw(&mut self, object: &Object) {
        assert_ne!(object.id(), self.object, "the device is lost");
    }

    fn swap(&mut self, _frame: u64) {}

    fn is_bound(&self) -> bool {
        self.is_bound
    }
}

#[test]
fn a_renderers_panic_comes_back_to_the_caller() {
    for &executor in ExecutorKind::ALL {
        for (object, is_bound) in [(7, true), (7, false), (93, false)] {
            let mut manager = manager(executor, 2);
            let mut renderer = Failing { object: ObjectId(object), is_bound };
            let run = AssertUnwindSafe(|| manager.run(1, &mut renderer, &mut |_| ()));
            let panic = catch_unwind(run).expect_err("it panics");
            let text = panic.downcast_ref::<String>().expect("a message");
            assert!(text.contains("the device is lost"), "{executor:?}: {text}");
        }
    }
}
