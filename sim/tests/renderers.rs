//! What every executor does with a renderer: who draws, and panics on their way to the caller, some through C++.

mod common;

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::{Arc, Condvar, Mutex};
use std::thread::{self, ThreadId};
use std::time::Duration;

use common::{no_rules, particles};
use dualframe_sim::behavior::{Behavior, Input};
use dualframe_sim::blocking::Grain;
use dualframe_sim::executor::ExecutorKind;
use dualframe_sim::geometry::{Geometry, Rigid};
use dualframe_sim::manager::{Settings, VeManager};
use dualframe_sim::object::{Group, Object, ObjectId};
use dualframe_sim::render::Renderer;
use dualframe_sim::scene::Scene;
use glam::Vec3;

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

/// Panics when it is given one object, and is not to be given anything more.
struct Failing {
    object: ObjectId,
    draws_since: Option<u32>,
    is_bound: bool,
}

impl Renderer for Failing {
    fn draw(&mut self, object: &Object) {
        if let Some(draws) = &mut self.draws_since {
            *draws += 1;
        } else if object.id() == self.object {
            self.draws_since = Some(0);
            panic!("the device is lost");
        }
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
            let mut renderer = Failing { object: ObjectId(object), draws_since: None, is_bound };
            let run = AssertUnwindSafe(|| manager.run(1, &mut renderer, &mut |_| ()));
            let panic = catch_unwind(run).expect_err("it panics");
            assert_eq!(panic.downcast_ref(), Some(&"the device is lost"), "{executor:?}");
            assert_eq!(renderer.draws_since, Some(0), "{executor:?}");
        }
    }
}

/// Whether something was drawn elsewhere than on the calling thread.
#[derive(Default)]
struct Elsewhere {
    drawn: Mutex<bool>,
    news: Condvar,
}

/// How long the calling thread waits for it; usually a minute, more than a slow machine needs.
const PATIENCE: Duration = Duration::from_secs(60);

/// Its update takes the calling thread until something was drawn elsewhere.
struct Waits(ThreadId, Arc<Elsewhere>);

impl Behavior for Waits {
    fn update(&mut self, _: &mut Geometry, _: &mut Input<'_>) {
        let Self(caller, elsewhere) = self;
        if thread::current().id() == *caller {
            let drawn = elsewhere.drawn.lock().expect("no poison");
            let waited = elsewhere.news.wait_timeout_while(drawn, PATIENCE, |drawn| !*drawn);
            drop(waited.expect("no poison"));
        }
    }
}

/// Says that something was drawn elsewhere, and may panic then.
struct Tells {
    caller: ThreadId,
    elsewhere: Arc<Elsewhere>,
    fails: bool,
}

impl Renderer for Tells {
    fn draw(&mut self, _: &Object) {
        if thread::current().id() != self.caller {
            *self.elsewhere.drawn.lock().expect("no poison") = true;
            self.elsewhere.news.notify_all();
            assert!(!self.fails, "the device is lost");
        }
    }

    fn swap(&mut self, _: u64) {}
}

#[test]
fn the_pipeline_renders_on_another_thread_while_the_callers_is_busy() {
    for (grain, fails) in
        [(Grain::Spatial, false), (Grain::Spatial, true), (Grain::Pairwise, false)]
    {
        let (caller, elsewhere) = (thread::current().id(), Arc::new(Elsewhere::default()));
        let object = |id| {
            let wall = Geometry::Rigid(Rigid::wall(Vec3::ZERO, Vec3::Y));
            Object::new(ObjectId(id), Group(0), wall, Waits(caller, Arc::clone(&elsewhere)))
        };
        let scene = Scene::new((0..8).map(object).collect(), no_rules());
        let executor = ExecutorKind::Pipeline;
        let settings = Settings { executor, threads: 2, grain, ..Settings::default() };
        let mut manager = VeManager::new(scene, settings).expect("all of it is allowed");
        let mut renderer = Tells { caller, elsewhere: Arc::clone(&elsewhere), fails };
        let run = AssertUnwindSafe(|| manager.run(4, &mut renderer, &mut |_| ()));
        match catch_unwind(run) {
            Ok(outcome) => assert!(outcome.is_ok() && !fails, "{outcome:?}"),
            Err(panic) => {
                let text = panic.downcast_ref::<&str>().expect("a message");
                assert!(fails && text.contains("the device is lost"), "{text}");
            }
        }
        assert!(*elsewhere.drawn.lock().expect("no poison"));
    }
}
