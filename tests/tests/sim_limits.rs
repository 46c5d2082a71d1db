//! Invariant 8 in `sim`: a flood is taken in until the tables have grown, between two batches of frames;
//! nothing is dropped.
#![forbid(unsafe_code)]

use std::hash::Hasher;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;

use dualframe_sim::behavior::{Behavior, Input};
use dualframe_sim::blocking::Grain;
use dualframe_sim::executor::{ExecutorError, ExecutorKind};
use dualframe_sim::geometry::Geometry;
use dualframe_sim::interaction::Rules;
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

/// Runs the scene with every executor, and the pipeline in both grains; all come to the same state, which
/// is returned.
fn same_for_all(scene: impl Fn() -> Scene, frames: u64) -> u64 {
    let spatial = ExecutorKind::ALL.iter().map(|&executor| (executor, Grain::Spatial));
    let ways = spatial.chain([(ExecutorKind::Pipeline, Grain::Pairwise)]);
    let state = |(executor, grain)| {
        let settings = Settings { executor, grain, threads: 2, ..Settings::default() };
        let (manager, outcome) = run(scene(), settings, frames);
        outcome.unwrap_or_else(|error| panic!("{executor:?}, {grain:?}: {error}"));
        (executor, grain, manager.state_hash())
    };
    let states: Vec<_> = ways.map(state).collect();
    let (.., expected) = states[0];
    assert!(states.iter().all(|&(.., state)| state == expected), "{states:x?}");
    expected
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
    // 14 in one place are 91 pairs of 84 records a frame: more than half the room for 66 objects. 60 are
    // 1,770 pairs: 16 times the room.
    for stacked in [14, 60] {
        same_for_all(|| stack(stacked), 70);
    }
}

/// Objects that do not meet. Each posts `letters` impulses to the first three in each update, which differ in the
/// last bits for another order.
fn talkative(objects: u32, letters: u32) -> Scene {
    let mut scene = scene(objects as usize);
    scene.stages.rules = Rules::new();
    for object in &mut scene.objects {
        object.behavior = Box::new(Chatterbox { letters, from: object.id().0 });
    }
    scene
}

struct Chatterbox {
    letters: u32,
    from: u32,
}

impl Behavior for Chatterbox {
    fn update(&mut self, _: &mut Geometry, input: &mut Input<'_>) {
        for number in 0..self.letters {
            let node = number / 3 % 42;
            let impulse = [1.0, -0.7, 0.3].map(|part| part * 1e-4 * (self.from + number) as f32);
            input.post(ObjectId(number % 3), Message::Impulse { node, impulse });
        }
    }
}

#[test]
fn letters_of_one_update() {
    // Room for 1,064; in the second case it has grown enough after three batches.
    for (objects, letters) in [(4, 5_000), (10, 700)] {
        let state = same_for_all(|| talkative(objects, letters), 140);
        assert_ne!(state, same_for_all(|| talkative(objects, 0), 140), "they do something");
    }
}

#[test]
fn letters_under_way_go_from_executor_to_executor() {
    let settings = |executor| Settings { executor, threads: 2, ..Settings::default() };
    let run = |scene, executor, frames| {
        let (manager, outcome) = run(scene, settings(executor), frames);
        outcome.expect("no table is full");
        manager
    };
    let mut scene = talkative(4, 3_000);
    for executor in [ExecutorKind::Pipeline, ExecutorKind::Serial, ExecutorKind::Pipeline] {
        scene = run(scene, executor, 7).into_scene();
    }
    let in_turns = run(scene, ExecutorKind::Static, 7);
    let at_once = run(talkative(4, 3_000), ExecutorKind::Serial, 28);
    assert_eq!(in_turns.state_hash(), at_once.state_hash());
}

#[test]
fn letters_from_outside_in_any_number() {
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
        assert!(matches!(refused.error, ExecutorError::Threads { threads: t } if t == threads));
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
fn a_renderer_that_panics_takes_nothing_along() {
    const LAST: u64 = 40;
    for &executor in ExecutorKind::ALL {
        let settings = Settings { executor, threads: 2, ..Settings::default() };
        let mut manager = VeManager::new(talkative(100, 1), settings).expect("valid settings");
        let mut run = |frames, last| {
            catch_unwind(AssertUnwindSafe(|| {
                manager.run(frames, &mut NullRenderer::new(), &mut |record| {
                    assert_ne!(record.frame, last, "on purpose");
                })
            }))
        };
        assert!(matches!(run(1, LAST), Ok(Ok(()))), "{executor:?}");
        assert!(run(100, LAST).is_err(), "{executor:?}");
        assert!(matches!(run(1, u64::MAX), Ok(Err(ExecutorError::BrokenOff))), "{executor:?}");
        assert_eq!(manager.frame(), LAST, "{executor:?}");
        let scene = manager.into_scene();
        assert!(scene.objects.iter().map(Object::id).eq((0..106).map(ObjectId)), "{executor:?}");
        assert!(!scene.mail.is_empty(), "{executor:?}: letters are lost");
    }
}

/// Lives as long as its environment.
struct Alive(#[expect(dead_code)] Arc<()>);

impl Behavior for Alive {
    fn update(&mut self, _: &mut Geometry, _: &mut Input<'_>) {}
}

#[test]
fn an_environment_ends_with_its_executor_also_in_a_panic() {
    for &executor in ExecutorKind::ALL {
        let alive = Arc::new(());
        let ended = catch_unwind(AssertUnwindSafe(|| {
            let mut scene = scene(100);
            scene.objects[7].behavior = Box::new(Alive(Arc::clone(&alive)));
            let settings = Settings { executor, threads: 3, ..Settings::default() };
            let mut manager = VeManager::new(scene, settings).expect("valid settings");
            manager.run(3, &mut NullRenderer::new(), &mut |record| assert_eq!(record.frame, 0))
        }));
        assert!(ended.is_err(), "{executor:?}");
        assert_eq!(Arc::strong_count(&alive), 1, "{executor:?}: nobody has it any more");
    }
}

#[test]
fn frames_without_end() {
    for &executor in ExecutorKind::ALL {
        let settings = Settings { executor, threads: 2, ..Settings::default() };
        let mut scene = scene(3);
        scene.frame = 5;
        let mut manager = VeManager::new(scene, settings).expect("valid settings");
        let ended = catch_unwind(AssertUnwindSafe(|| {
            manager.run(u64::MAX, &mut NullRenderer::new(), &mut |record| assert!(record.frame < 9))
        }));
        assert!(ended.is_err(), "{executor:?}: it went on until it was stopped");
    }
}

#[test]
fn a_manager_may_be_run_on_another_thread() {
    let mut manager = VeManager::new(scene(3), Settings::default()).expect("valid settings");
    let run = move || manager.run(3, &mut NullRenderer::new(), &mut |_| ()).map(|()| manager);
    let manager = std::thread::spawn(run).join().expect("no panic").expect("no table is full");
    assert_eq!(manager.frame(), 3);
}
