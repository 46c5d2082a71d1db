//! What reaches an environment from outside, and taking it from one executor to the next.

mod common;

use std::sync::{Arc, Mutex};

use common::{Acting, EXECUTORS, executor, executors, no_rules, particles, point, run, serial};
use dualframe_sim::behavior::Input;
use dualframe_sim::blocking::Grain;
use dualframe_sim::executor::{
    Entry, Executor, ExecutorKind, FrameRecord, SerialExecutor, state_hash,
};
use dualframe_sim::geometry::Geometry;
use dualframe_sim::interaction::Rules;
use dualframe_sim::mailbox::Mailbox;
use dualframe_sim::manager::{Settings, VeManager};
use dualframe_sim::message::{Custom, Message};
use dualframe_sim::object::{Object, ObjectId};
use dualframe_sim::render::{NullRenderer, Renderer};
use dualframe_sim::scene::Scene;

const PARTICLES: u32 = 12;
/// Two regroupings and a bit.
const FRAMES: u64 = 70;
const GRAINS: [Grain; 2] = [Grain::Spatial, Grain::Pairwise];

fn push(node: u64, strength: f32) -> Message {
    let impulse = [strength, 0.5 * strength, -strength];
    Message::Impulse { node: (node % 42) as u32, impulse }
}

/// Particles, and points that push them every frame.
fn pushed() -> Scene {
    let mut scene = particles(PARTICLES as usize, true, true);
    let first = scene.objects.len() as u32;
    for id in first..first + 5 {
        let act = move |_: &mut Geometry, input: &mut Input<'_>| {
            let to = (u64::from(id) * 7 + input.frame) % u64::from(PARTICLES);
            input.post(ObjectId(to as u32), push(input.frame, 1e-3 * id as f32));
            input.post(ObjectId(1_000), Message::Remove);
        };
        scene.objects.push(point(id, Acting(act)).solitary());
    }
    scene
}

#[test]
fn what_is_for_nobody_keeps_its_place() {
    let hash = |is_taken_out: bool| {
        let mut executor = serial(particles(3, true, true));
        let mailbox = executor.mailbox().clone();
        // The last one is due in the second frame of the next run: what is posted between the runs is not before it.
        let post = &mut |_: &FrameRecord| mailbox.post(ObjectId(99), Message::Release);
        executor.advance(10, &mut NullRenderer::new(), post).expect("it goes on");
        if is_taken_out {
            executor = serial(Box::new(executor).into_scene());
        }
        mailbox.post(ObjectId(0), Message::Weightless(true));
        run(&mut executor, 10);
        state_hash(&executor)
    };
    assert_eq!(hash(true), hash(false));
}

/// Somebody who pushes what he sees: from the renderer's swap and when told of the frame.
struct Player {
    mailbox: Mailbox,
    drawn: u64,
}

impl Player {
    fn new(mailbox: &Mailbox) -> Self {
        Self { mailbox: mailbox.clone(), drawn: 0 }
    }

    fn post_to(&self, number: u64, strength: f32) {
        let to = ObjectId((number % u64::from(PARTICLES)) as u32);
        self.mailbox.post(to, push(number, strength));
    }
}

impl Renderer for Player {
    fn draw(&mut self, object: &Object) {
        // The same for any order.
        self.drawn = self.drawn.wrapping_add(u64::from(object.center().x.to_bits()));
    }

    fn swap(&mut self, frame: u64) {
        self.post_to(frame, (self.drawn % 100) as f32 * 1e-4);
        self.drawn = 0;
    }
}

fn watch(mailbox: &Mailbox) -> impl FnMut(&FrameRecord) {
    let player = Player::new(mailbox);
    move |record| {
        for number in 0..3 {
            player.post_to(record.frame * 5 + number, 1e-3 * record.pairs.collisions as f32);
        }
        player.post_to(record.frame, 2e-3);
    }
}

fn play(executor: &mut dyn Executor, frames: u64) {
    let mailbox = executor.mailbox().clone();
    let (mut player, mut watch) = (Player::new(&mailbox), watch(&mailbox));
    executor.advance(frames, &mut player, &mut watch).expect("no table is full");
}

/// The lengths of runs that make up `FRAMES` frames, `length` or what is left.
fn pieces(length: u64) -> impl Iterator<Item = u64> {
    (0..FRAMES).step_by(length as usize).map(move |done| length.min(FRAMES - done))
}

#[test]
fn what_is_posted_in_every_frame_has_one_effect() {
    let mut whole = serial(pushed());
    play(&mut whole, FRAMES);
    let expected = state_hash(&whole);
    let mut alone = serial(pushed());
    run(&mut alone, FRAMES);
    assert_ne!(state_hash(&alone), expected, "nothing came from outside");
    for grain in GRAINS {
        for threads in 1..=4 {
            for length in [1, 7, 32, 33, FRAMES] {
                for (name, mut executor) in executors(pushed, grain, threads) {
                    pieces(length).for_each(|frames| play(&mut *executor, frames));
                    let hash = state_hash(&*executor);
                    assert_eq!(hash, expected, "{name}, {threads}, {grain:?}, by {length}");
                }
            }
        }
    }
}

/// What an object was told, and its updates, in order.
#[derive(Clone, Debug, PartialEq)]
enum Event {
    Updated(u64),
    /// By an object, in a frame.
    Posted(u64),
    /// From outside.
    Told(u64),
}

type Log = Arc<Mutex<Vec<Event>>>;

#[derive(Debug)]
struct Note(Log, Event);

impl Custom for Note {
    fn process(&self, _: &mut Object) {
        self.0.lock().expect("nobody panics").push(self.1.clone());
    }
}

fn note(log: &Log, event: Event) -> Message {
    Message::Custom(Box::new(Note(Arc::clone(log), event)))
}

/// Objects of which the second tells the first in every frame; the first logs its updates.
fn diary(log: &Log) -> Scene {
    let own = Arc::clone(log);
    let first = move |_: &mut Geometry, input: &mut Input<'_>| {
        own.lock().expect("nobody panics").push(Event::Updated(input.frame));
    };
    let own = Arc::clone(log);
    let second = move |_: &mut Geometry, input: &mut Input<'_>| {
        input.post(ObjectId(0), note(&own, Event::Posted(input.frame)));
    };
    Scene::new(vec![point(0, Acting(first)), point(1, Acting(second))], no_rules())
}

/// What the first of them is to experience: what was said while frame f was swapped comes in frame
/// f + 2; what was said before the first run in its first frame, and before a later one in its second,
/// since what was said before is still to come then; all after the other object's letters.
fn days(frames: u64, runs: &[u64]) -> Vec<Event> {
    let mut expected = Vec::new();
    for frame in 0..frames {
        expected.extend(frame.checked_sub(1).map(Event::Posted));
        expected.extend(frame.checked_sub(2).map(Event::Told));
        let began = if frame == 0 { Some(0) } else { Some(frame - 1).filter(|&first| first > 0) };
        if let Some(first) = began.filter(|first| runs.contains(first)) {
            expected.extend([1_000, 1_001].map(|number| Event::Told(number + first)));
        }
        expected.push(Event::Updated(frame));
    }
    expected
}

#[test]
fn two_frames_after_the_swap_and_at_the_beginning_of_a_run() {
    for grain in GRAINS {
        for threads in 1..=3 {
            for length in [1, 2, 7, 40] {
                let runs: Vec<u64> = (0..40).step_by(length).collect();
                for index in 0..EXECUTORS {
                    let log = Log::default();
                    let (name, mut executor) = executor(index, diary(&log), grain, threads);
                    let mailbox = executor.mailbox().clone();
                    let tell = |number| mailbox.post(ObjectId(0), note(&log, Event::Told(number)));
                    for &first in &runs {
                        tell(1_000 + first);
                        tell(1_001 + first);
                        mailbox.post(ObjectId(2), Message::Remove);
                        let mut renderer = dualframe_sim::render::NullRenderer::new();
                        let frames = (length as u64).min(40 - first);
                        let told = executor.advance(frames, &mut renderer, &mut |record| {
                            tell(record.frame);
                        });
                        told.expect("no table is full");
                    }
                    let log = log.lock().expect("nobody panics");
                    assert_eq!(*log, days(40, &runs), "{name}, {threads}, {grain:?}, by {length}");
                }
            }
        }
    }
}

#[test]
fn nothing_from_another_thread_is_lost() {
    const NOTES: u64 = 20_000;
    for index in 0..EXECUTORS {
        let log = Log::default();
        let (name, mut executor) = executor(index, diary(&log), Grain::Spatial, 2);
        let mailbox = executor.mailbox().clone();
        std::thread::scope(|scope| {
            let teller = scope.spawn(|| {
                for number in 0..NOTES {
                    mailbox.post(ObjectId(0), note(&log, Event::Told(number)));
                }
            });
            while !teller.is_finished() {
                run(&mut *executor, 3);
            }
        });
        // What was taken by the last swap comes in the second frame.
        run(&mut *executor, 2);
        let told = log.lock().expect("nobody panics").clone().into_iter();
        let told = told.filter(|event| matches!(event, Event::Told(_)));
        assert!(told.eq((0..NOTES).map(Event::Told)), "{name}: each once, in order");
    }
}

#[test]
fn a_message_to_everybody() {
    let everybody = 0..300;
    let scene = || particles(300, false, true);
    let hash = |executor: &mut dyn Executor, back: bool| {
        for round in 0..4 {
            let to: Vec<u32> = everybody.clone().collect();
            let forth = to.iter().copied();
            let to: Vec<u32> = if back { forth.rev().collect() } else { forth.collect() };
            for id in to {
                executor.mailbox().post(ObjectId(id), push(u64::from(id + round), 1e-3));
            }
        }
        run(executor, 3).1
    };
    let expected = hash(&mut serial(scene()), false);
    assert_ne!(run(&mut serial(scene()), 3).1, expected, "nobody heard of it");
    assert_eq!(hash(&mut serial(scene()), true), expected, "only a receiver's order counts");
    for grain in GRAINS {
        for (name, mut executor) in executors(scene, grain, 2) {
            assert_eq!(hash(&mut *executor, false), expected, "{name}, {grain:?}");
        }
    }
}

/// Ways of running, each different from the one before.
fn relay() -> Vec<Settings> {
    let mut relay = Vec::new();
    for (place, &executor) in ExecutorKind::ALL.iter().enumerate() {
        for (entry, grain) in
            [(Entry::AfterUpdate, GRAINS[place % 2]), (Entry::AfterSwap, GRAINS[(place + 1) % 2])]
        {
            let threads = relay.len() % 4 + 1;
            relay.push(Settings { executor, threads, entry, grain, ..Settings::default() });
        }
    }
    relay
}

#[test]
fn an_environment_goes_from_one_executor_to_the_next() {
    for length in [1, 7, 33] {
        let mut whole = serial(pushed());
        let mut scene = pushed();
        // One mailbox for all.
        let mailbox = scene.mailbox.clone();
        for (piece, settings) in pieces(length).zip(relay().into_iter().cycle()) {
            whole.mailbox().post(ObjectId(3), push(piece, 3e-3));
            play(&mut whole, piece);
            let mut manager = VeManager::new(scene, settings).expect("valid settings");
            mailbox.post(ObjectId(3), push(piece, 3e-3));
            let (mut player, mut watch) = (Player::new(&mailbox), watch(&mailbox));
            manager.run(piece, &mut player, &mut watch).expect("no table is full");
            assert_eq!(manager.state_hash(), state_hash(&whole), "by {length}, {settings:?}");
            scene = manager.into_scene();
            assert_eq!(scene.frame, whole.frame());
            assert!(scene.objects.iter().map(|object| object.id().0).eq(0..23));
            // Five points' letters, the player's five of each of two frames, and what was posted before a
            // run of a single frame, unless it was the first.
            let outside = scene.mail.iter().filter(|letter| letter.from == ObjectId::HOST).count();
            let frames = if scene.frame < 2 { 1 } else { 2 };
            let waiting = usize::from(piece == 1 && scene.frame > 1);
            assert_eq!((scene.mail.len(), outside), (5 + outside, 5 * frames + waiting));
        }
        assert_eq!(scene.frame, FRAMES);
    }
}

#[test]
fn an_object_is_added_to_a_running_environment() {
    let mut executor: Box<dyn Executor> = Box::new(serial(particles(5, false, true)));
    run(&mut *executor, 3);
    let mut scene = executor.into_scene();
    let mut extra = particles(1, false, true).objects.remove(0);
    let geometry = extra.geometry.as_mesh_mut().expect("a particle").clone();
    let id = ObjectId(scene.objects.len() as u32);
    let group = extra.group();
    scene.objects.push(Object::new(id, group, Geometry::Mesh(geometry), common::springs(60.0)));
    let mut executor = SerialExecutor::new(scene, Grain::Spatial).expect("a valid scene");
    let (counts, ..) = run(&mut executor, 3);
    assert_eq!(executor.frame(), 6);
    assert!(counts[0].candidates > 0, "it is in the midst of the others");
}

#[test]
fn numbers_and_rules_change_between_runs() {
    let scene = || particles(20, true, true);
    let hashes = |executor: &mut dyn Executor| {
        let mut hashes = vec![run(executor, 5).1];
        executor.change(&mut |stages| {
            stages.gravity = -stages.gravity;
            stages.time_step *= 0.5;
        });
        hashes.push(run(executor, 20).1);
        let mut rules = Rules::new();
        executor.change(&mut |stages| std::mem::swap(&mut stages.rules, &mut rules));
        let (counts, hash, _) = run(executor, 20);
        assert!(counts.iter().all(|count| count.candidates == 0), "nothing interacts");
        hashes.push(hash);
        executor.change(&mut |stages| std::mem::swap(&mut stages.rules, &mut rules));
        let (counts, hash, _) = run(executor, 20);
        assert!(counts.iter().any(|count| count.candidates > 0), "they interact again");
        hashes.push(hash);
        hashes
    };
    let expected = hashes(&mut serial(scene()));
    let mut unchanged = serial(scene());
    assert_eq!(run(&mut unchanged, 5).1, expected[0]);
    assert_ne!(run(&mut unchanged, 20).1, expected[1]);
    for grain in GRAINS {
        for threads in 1..=3 {
            for (name, mut executor) in executors(scene, grain, threads) {
                assert_eq!(hashes(&mut *executor), expected, "{name}, {threads}, {grain:?}");
            }
        }
    }
}

#[test]
fn rules_that_come_later_count() {
    let scene = || {
        let mut scene = particles(20, true, true);
        scene.stages.rules = Rules::new();
        scene
    };
    let hash = |executor: &mut dyn Executor| {
        run(executor, 3);
        let mut rules = particles(20, true, true).stages.rules;
        executor.change(&mut |stages| std::mem::swap(&mut stages.rules, &mut rules));
        let (counts, hash, _) = run(executor, 20);
        assert!(counts.iter().any(|count| count.candidates > 0), "nothing interacts");
        hash
    };
    let expected = hash(&mut serial(scene()));
    for grain in GRAINS {
        for (name, mut executor) in executors(scene, grain, 2) {
            assert_eq!(hash(&mut *executor), expected, "{name}, {grain:?}");
        }
    }
}
