//! Messages, and objects without interactions.

mod common;

use std::sync::{Arc, Mutex};

use common::{
    Acting, EXECUTORS, executor, executors, no_rules, particles, point, run, serial, springs,
};
use dualframe_sim::behavior::{Fixed, Input, Keyframe, Scripted};
use dualframe_sim::blocking::Grain;
use dualframe_sim::executor::{Entry, Executor, PipelineExecutor};
use dualframe_sim::geometry::{Geometry, Rigid};
use dualframe_sim::message::{Custom, Message};
use dualframe_sim::object::{Drawing, Group, Object, ObjectId};
use dualframe_sim::pool::Pool;
use dualframe_sim::render::Renderer;
use dualframe_sim::scene::Scene;
use glam::{Quat, Vec3};
use parry3d::math::Pose;
use parry3d::shape::SharedShape;

/// Who was told what in which frame: the receiver, the frame it was posted in, the sender, a number.
type Log = Arc<Mutex<Vec<(ObjectId, u64, u32, u32)>>>;

#[derive(Debug)]
struct Note {
    log: Log,
    posted: u64,
    from: u32,
    number: u32,
}

impl Custom for Note {
    fn process(&self, object: &mut Object) {
        let entry = (object.id(), self.posted, self.from, self.number);
        self.log.lock().expect("nobody panics").push(entry);
    }
}

const RECEIVER: u32 = 3;
const SENDERS: u32 = 8;

/// Objects that each send three notes to one of them in frame 1, which logs its own update too.
fn gossip(log: &Log) -> Scene {
    let talker = |id: u32| {
        let log = Arc::clone(log);
        let act = move |_: &mut Geometry, input: &mut Input<'_>| {
            let id = input.object().0;
            if id == RECEIVER {
                let entry = (ObjectId(RECEIVER), input.frame, u32::MAX, 0);
                log.lock().expect("nobody panics").push(entry);
            }
            for number in 0..if input.frame == 1 { 3 } else { 0 } {
                let note = Note { log: Arc::clone(&log), posted: input.frame, from: id, number };
                input.post(ObjectId(RECEIVER), Message::Custom(Box::new(note)));
                input.post(ObjectId(1_000), Message::Remove);
            }
        };
        let mut object = point(id, Acting(act));
        // Higher numbers come first in space, so that blocks do not come in the order of numbers.
        let mesh = object.geometry.as_mesh_mut().expect("a point is a mesh");
        mesh.positions.set(0, Vec3::NEG_X * id as f32);
        object.refit();
        object
    };
    Scene::new((0..SENDERS).map(talker).collect(), no_rules())
}

#[test]
fn next_frame_by_sender_and_sequence_before_the_update() {
    let mut expected: Vec<_> =
        (0..2).map(|frame| (ObjectId(RECEIVER), frame, u32::MAX, 0)).collect();
    for from in 0..SENDERS {
        expected.extend((0..3).map(|number| (ObjectId(RECEIVER), 1, from, number)));
    }
    // From outside, posted after frame 1: after all others.
    expected.push((ObjectId(RECEIVER), 99, 99, 99));
    expected.extend((2..4).map(|frame| (ObjectId(RECEIVER), frame, u32::MAX, 0)));
    for grain in [Grain::Spatial, Grain::Pairwise] {
        for threads in 1..=3 {
            for index in 0..EXECUTORS {
                let log = Log::default();
                let (name, mut executor) = executor(index, gossip(&log), grain, threads);
                run(&mut *executor, 2);
                let note = Note { log: Arc::clone(&log), posted: 99, from: 99, number: 99 };
                executor.mailbox().post(ObjectId(RECEIVER), Message::Custom(Box::new(note)));
                run(&mut *executor, 2);
                assert_eq!(*log.lock().expect("nobody panics"), expected, "{name}, {threads}");
            }
        }
    }
}

/// The velocity of the only node of an object, in metres per second.
fn velocity(executor: &dyn Executor, id: u32) -> Vec3 {
    let mut velocity = Vec3::NAN;
    executor.visit(&mut |object| {
        if object.id() == ObjectId(id) {
            let mesh = object.geometry.as_mesh().expect("a point is a mesh");
            velocity = mesh.velocities.get(0).expect("a node");
        }
    });
    velocity
}

#[test]
fn impulse_and_weightlessness() {
    let mut stages = no_rules();
    stages.gravity = Vec3::NEG_Y * 24.0;
    let objects = (0..2).map(|id| point(id, common::springs(1.0))).collect();
    let mut executor = serial(Scene::new(objects, stages));
    executor.mailbox().post(ObjectId(0), Message::Weightless(true));
    // The node weighs 1 kg.
    executor.mailbox().post(ObjectId(0), Message::Impulse { node: 0, impulse: [3.0, 0.0, 0.0] });
    executor.mailbox().post(ObjectId(0), Message::Impulse { node: 1, impulse: [9.0, 0.0, 0.0] });
    run(&mut executor, 10);
    assert_eq!(velocity(&executor, 0), Vec3::X * 3.0);
    assert!((velocity(&executor, 1) - Vec3::NEG_Y).length() < 1e-6, "24 m/s² over 10/240 s");
}

#[test]
fn stiffness() {
    let energy_after = |message: Option<Message>| {
        let mut executor = serial(particles(2, false, true));
        run(&mut executor, 1);
        message.into_iter().for_each(|message| executor.mailbox().post(ObjectId(0), message));
        run(&mut executor, 20).1
    };
    let set = |between_nodes, to_center| Some(Message::Stiffness { between_nodes, to_center });
    assert_ne!(energy_after(None), energy_after(set(10.0, 20.0)));
    assert_eq!(energy_after(None), energy_after(set(f32::NAN, -1.0)));
}

/// A ball on a path through a crowd.
fn scripted(id: u32) -> Object {
    let key = |frame, x| Keyframe { frame, position: Vec3::X * x, rotation: Quat::IDENTITY };
    let path = Scripted::new(vec![key(10, -1.0), key(30, 1.0)]).expect("ascending keyframes");
    let ball = Rigid::new(SharedShape::ball(0.2), Pose::identity());
    Object::new(ObjectId(id), Group(0), Geometry::Rigid(ball), path)
}

#[test]
fn a_scripted_object_needs_no_interactions() {
    let expected = run(&mut serial(particles(20, false, true)), 40).0;
    for grain in [Grain::Spatial, Grain::Pairwise] {
        let scene = || {
            let mut scene = particles(20, false, true);
            scene.objects.push(scripted(26).solitary());
            scene
        };
        for (name, mut executor) in executors(scene, grain, 2) {
            let mut places = Vec::new();
            for _ in 0..40 {
                let (counts, ..) = run(&mut *executor, 1);
                assert_eq!(counts[0], expected[places.len()], "{name}");
                executor.visit(&mut |object| {
                    if object.id() == ObjectId(26) {
                        places.push(object.center().x);
                    }
                });
            }
            let at = |frame: usize| (frame.clamp(10, 30) as f32 - 20.0) / 10.0;
            let error = |(frame, x): (usize, &f32)| (x - at(frame)).abs();
            assert!(places.iter().enumerate().map(error).all(|error| error < 1e-6), "{name}");
        }
    }
}

#[test]
fn hidden_objects_are_not_drawn() {
    let mut objects = vec![point(0, Fixed), point(1, Fixed)];
    objects[1].drawing = Drawing::Hidden;
    let (_, _, renderer) = run(&mut serial(Scene::new(objects, no_rules())), 5);
    assert_eq!(renderer.draws(), 5);
}

/// Puts another object, of another number, group and kind, in the place of the receiver.
#[derive(Debug)]
struct Replace {
    panics: bool,
}

impl Custom for Replace {
    fn process(&self, object: &mut Object) {
        let Geometry::Mesh(mesh) = object.geometry.clone() else { return };
        let (id, group) = (ObjectId(object.id().0 + 1), Group(9));
        *object = Object::new(id, group, Geometry::Mesh(mesh), Fixed).solitary();
        assert!(!self.panics, "on purpose");
    }
}

/// Until blocks have been formed anew twice.
const REGROUPED: u64 = 70;

#[test]
fn an_object_that_is_replaced_keeps_number_and_group() {
    const REPLACED: [ObjectId; 2] = [ObjectId(3), ObjectId(64)];
    let mut states = Vec::new();
    for (name, mut executor) in executors(|| particles(100, true, true), Grain::Spatial, 2) {
        for (replaced, panics) in REPLACED.into_iter().zip([false, true]) {
            executor.mailbox().post(replaced, Message::Custom(Box::new(Replace { panics })));
        }
        let (_, state, _) = run(&mut *executor, REGROUPED);
        let mut ids = Vec::new();
        executor.visit(&mut |object| {
            if REPLACED.contains(&object.id()) {
                assert_eq!((object.group(), object.is_solitary()), (Group(0), false), "{name}");
                assert_eq!(object.quarantined().is_some(), object.id() == REPLACED[1], "{name}");
            }
            ids.push(object.id());
        });
        ids.sort_unstable();
        assert!(ids.into_iter().eq((0..106).map(ObjectId)), "{name}: nobody is lost");
        states.push(state);
    }
    assert!(states.iter().all(|state| *state == states[0]), "{states:x?}");
}

/// Gives the receiver a behaviour that moves it.
#[derive(Debug)]
struct Loosen;

impl Custom for Loosen {
    fn process(&self, object: &mut Object) {
        object.behavior = Box::new(common::springs(1.0));
    }
}

#[test]
fn scenery_that_is_given_a_behavior_moves() {
    // The first before there is an executor, the second by a message; the third stays.
    let scene = || {
        let mut stages = no_rules();
        stages.gravity = Vec3::NEG_Y * 24.0;
        let mut objects: Vec<_> = (0..3).map(|id| point(id, Fixed)).collect();
        objects[0].behavior = Box::new(common::springs(1.0));
        Scene::new(objects, stages)
    };
    for (name, mut executor) in executors(scene, Grain::Spatial, 2) {
        executor.mailbox().post(ObjectId(1), Message::Custom(Box::new(Loosen)));
        run(&mut *executor, REGROUPED);
        let falls = [0, 1, 2].map(|id| velocity(&*executor, id).y < -1.0);
        assert_eq!(falls, [true, true, false], "{name}");
    }
}

/// Puts the receiver elsewhere.
#[derive(Debug)]
struct MoveTo(Vec3);

impl Custom for MoveTo {
    fn process(&self, object: &mut Object) {
        let mesh = object.geometry.as_mesh_mut().expect("a point is a mesh");
        mesh.positions.set(0, self.0);
    }
}

#[test]
fn scenery_is_where_a_message_puts_it_and_out_if_that_is_nowhere() {
    let scene = || Scene::new((0..3).map(|id| point(id, Fixed)).collect(), no_rules());
    for (name, mut executor) in executors(scene, Grain::Spatial, 2) {
        for (to, place) in [(0, Vec3::X), (1, Vec3::NAN)] {
            let message = Message::Custom(Box::new(MoveTo(place)));
            executor.mailbox().post(ObjectId(to), message);
        }
        run(&mut *executor, 5);
        let mut places = [(Vec3::NAN, false); 3];
        executor.visit(&mut |object| {
            let place = (object.center(), object.quarantined().is_some());
            places[object.id().0 as usize] = place;
        });
        assert_eq!([places[0], places[2]], [(Vec3::X, false), (Vec3::ZERO, false)], "{name}");
        assert!(places[1].1, "{name}");
    }
}

/// What a renderer may ask of objects.
#[derive(Clone, Debug, Default, PartialEq)]
struct Seen(Vec<(ObjectId, Group, [bool; 2])>);

impl Renderer for Seen {
    fn draw(&mut self, object: &Object) {
        let kind = [object.is_solitary(), object.is_fixed()];
        self.0.push((object.id(), object.group(), kind));
    }

    fn swap(&mut self, _: u64) {
        self.0.sort_unstable();
    }
}

#[test]
fn renderers_see_the_same_objects() {
    let mut expected = None;
    for (name, mut executor) in executors(|| particles(100, true, true), Grain::Spatial, 2) {
        let replace = Message::Custom(Box::new(Replace { panics: false }));
        executor.mailbox().post(ObjectId(3), replace);
        let mut seen = Seen::default();
        executor.advance(2, &mut seen, &mut |_| ()).expect("no table is full");
        assert_eq!(expected.get_or_insert_with(|| seen.clone()), &seen, "{name}");
    }
}

/// Letters find their objects also in the blocks that are formed for more threads.
#[test]
fn letters_arrive_when_threads_are_added() {
    const OBJECTS: u32 = 100;
    let scene = || {
        let push = |_: &mut Geometry, input: &mut Input<'_>| {
            for to in 1..OBJECTS {
                let impulse = [1e-3 * to as f32, 0.0, 0.0];
                input.post(ObjectId(to), Message::Impulse { node: 0, impulse });
            }
        };
        let mut objects = vec![point(0, Acting(push))];
        objects.extend((1..OBJECTS).map(|id| point(id, springs(0.0))));
        for (place, object) in objects.iter_mut().enumerate() {
            let mesh = object.geometry.as_mesh_mut().expect("a point is a mesh");
            mesh.positions.set(0, Vec3::X * (place * 37 % OBJECTS as usize) as f32);
            object.refit();
        }
        Scene::new(objects, no_rules())
    };
    let pool = Arc::new(Pool::new(1, false));
    let pipeline =
        PipelineExecutor::new(scene(), Grain::Spatial, Entry::default(), Arc::clone(&pool));
    let mut grown = pipeline.expect("a valid scene");
    run(&mut grown, 5);
    pool.resize(4);
    let (_, hash, _) = run(&mut grown, 5);
    assert_eq!(hash, run(&mut serial(scene()), 10).1);
}
