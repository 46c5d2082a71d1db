//! Invariant 8 in `sim`: a flood is a typed error that names the capacity needed, or the tables
//! grow between frames; nothing is dropped silently.
#![forbid(unsafe_code)]

use std::hash::Hasher;
use std::panic::{AssertUnwindSafe, catch_unwind};

use dualframe_core::error::{Table, TableFull};
use dualframe_sim::behavior::{Behavior, Input};
use dualframe_sim::blocking::Grain;
use dualframe_sim::executor::{ExecutorError, ExecutorKind};
use dualframe_sim::geometry::Geometry;
use dualframe_sim::manager::{Settings, VeManager};
use dualframe_sim::message::Message;
use dualframe_sim::object::{Object, ObjectId};
use dualframe_sim::render::NullRenderer;
use dualframe_sim::scene::{ParticleScene, Scene};

fn scene(objects: usize) -> Scene {
    ParticleScene::new(objects).build().expect("a valid scene")
}

fn run(scene: Scene, settings: Settings, frames: u64) -> (VeManager, Result<(), ExecutorError>) {
    let mut manager = VeManager::new(scene, settings).expect("valid settings");
    let outcome = manager.run(frames, &mut NullRenderer::new(), &mut |_| ());
    (manager, outcome)
}

fn table_of(outcome: Result<(), ExecutorError>) -> TableFull {
    match outcome {
        Err(ExecutorError::Table(full)) => full,
        other => panic!("a full table was expected, not {other:?}"),
    }
}

/// Stays where it is and counts what it is told.
struct Counting(u64);

impl Behavior for Counting {
    fn update(&mut self, _: &mut Geometry, input: &mut Input<'_>) {
        self.0 += input.contacts().count() as u64;
    }

    fn hash_state(&self, hasher: &mut dyn Hasher) {
        hasher.write_u64(self.0);
    }
}

/// 60 objects that stay where they are, `stacked` of them in one place: every node of each of these
/// touches all others.
fn stack(stacked: usize) -> Scene {
    let mut scene = scene(60);
    let first = scene.objects[0].geometry.as_mesh().expect("a particle").positions.clone();
    for object in scene.objects.iter_mut().take(stacked) {
        object.geometry.as_mesh_mut().expect("a particle").positions = first.clone();
    }
    let count = |object: Object| match object.is_fixed() {
        true => object,
        false => Object::new(object.id(), object.group(), object.geometry, Counting(0)),
    };
    Scene { objects: scene.objects.into_iter().map(count).collect(), ..scene }
}

#[test]
fn contacts_of_objects_all_in_one_place() {
    let (mut manager, outcome) = run(stack(60), Settings::default(), 4);
    let full = table_of(outcome);
    assert_eq!(full.table, Table::Contacts);
    assert!(full.needed > full.capacity, "{full}");
    // The environment cannot go on, and says so again.
    let again = manager.run(1, &mut NullRenderer::new(), &mut |_| panic!("no frame is swapped"));
    assert_eq!(table_of(again), full);
}

#[test]
fn room_for_contacts_grows_between_frames() {
    // 14 in one place are 91 pairs of 84 records a frame: more than half the room for 66 objects.
    let serial = Settings { executor: ExecutorKind::Serial, ..Settings::default() };
    let expected = run(stack(14), serial, 60).0.state_hash();
    let (manager, outcome) = run(stack(14), Settings::default(), 60);
    outcome.expect("the tables grow in time");
    assert_eq!(manager.state_hash(), expected, "no contact is dropped");
}

/// Posts more letters in one update than there is room for.
struct Chatterbox(usize);

impl Behavior for Chatterbox {
    fn update(&mut self, _: &mut Geometry, input: &mut Input<'_>) {
        for _ in 0..self.0 {
            input.post(ObjectId(0), Message::Weightless(true));
        }
    }
}

fn with_chatterbox(letters: usize) -> Scene {
    let mut scene = scene(3);
    scene.objects[2].behavior = Box::new(Chatterbox(letters));
    scene
}

#[test]
fn letters_of_one_update() {
    let full = table_of(run(with_chatterbox(100_000), Settings::default(), 4).1);
    assert_eq!(full.table, Table::Letters);
    assert!(full.needed > full.capacity && full.capacity >= 1_000, "{full}");
    run(with_chatterbox(500), Settings::default(), 40).1.expect("there is room for these");
}

#[test]
fn letters_from_outside_make_room_for_themselves() {
    let hash = |executor, grain| {
        let settings = Settings { executor, grain, ..Settings::default() };
        let mut manager = VeManager::new(scene(5), settings).expect("valid settings");
        for node in 0..30_000 {
            let impulse = [1e-6, 2e-6, -1e-6];
            manager
                .mailbox()
                .post(ObjectId(node % 5), Message::Impulse { node: node % 42, impulse });
        }
        let outcome = manager.run(20, &mut NullRenderer::new(), &mut |_| ());
        outcome.expect("the letters fit");
        manager.state_hash()
    };
    let all = hash(ExecutorKind::Serial, Grain::Spatial);
    assert_eq!(hash(ExecutorKind::Pipeline, Grain::Spatial), all);
    assert_eq!(hash(ExecutorKind::Pipeline, Grain::Pairwise), all);
    let (quiet, _) = run(scene(5), Settings::default(), 20);
    assert_ne!(quiet.state_hash(), all, "the letters do something");
}

#[test]
fn too_many_objects_or_threads() {
    let limit = dualframe_sim::blocking::Blocking::MAX_PAIRWISE_OBJECTS;
    let settings = Settings { grain: Grain::Pairwise, ..Settings::default() };
    let refused = VeManager::new(scene(limit), settings).err().expect("more than the limit");
    assert!(refused.to_string().contains(&limit.to_string()), "{refused}");
    for threads in [0, dualframe_sim::executor::MAX_THREADS + 1] {
        let settings = Settings { threads, ..Settings::default() };
        let refused = VeManager::new(scene(1), settings).err().expect("beyond the limit");
        assert!(matches!(refused, ExecutorError::Threads { threads: t } if t == threads));
    }
}

#[test]
fn nothing_at_all() {
    for &executor in ExecutorKind::ALL {
        for grain in [Grain::Spatial, Grain::Pairwise] {
            let mut empty = scene(1);
            empty.objects.clear();
            let (settings, mut swapped) = (Settings { executor, grain, ..Settings::default() }, 0);
            let mut manager = VeManager::new(empty, settings).expect("valid settings");
            let outcome = manager.run(3, &mut NullRenderer::new(), &mut |_| swapped += 1);
            assert!(outcome.is_ok(), "{executor:?}, {grain:?}: {outcome:?}");
            assert_eq!((manager.frame(), swapped), (3, 3), "{executor:?}, {grain:?}");
        }
    }
}

#[test]
fn a_renderer_that_panics_takes_no_object_along() {
    for &executor in ExecutorKind::ALL {
        let settings = Settings { executor, threads: 2, ..Settings::default() };
        let mut manager = VeManager::new(scene(100), settings).expect("valid settings");
        let objects = |manager: &VeManager| {
            let mut count = 0;
            manager.visit(&mut |_| count += 1);
            count
        };
        let all = objects(&manager);
        let ended = catch_unwind(AssertUnwindSafe(|| {
            manager.run(3, &mut NullRenderer::new(), &mut |record| assert_eq!(record.frame, 0))
        }));
        assert!(ended.is_err(), "{executor:?}");
        assert_eq!(objects(&manager), all, "{executor:?}");
    }
}
