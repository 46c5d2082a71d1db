//! Whatever ran when a session was recorded, and whatever runs when it is replayed.

use std::panic::{AssertUnwindSafe, catch_unwind};

use dualframe_sim::blocking::Grain;
use dualframe_sim::executor::{Entry, ExecutorError, ExecutorKind, FrameRecord, OnFrame};
use dualframe_sim::manager::{Settings, VeManager};
use dualframe_sim::message::{Custom, Message};
use dualframe_sim::object::{Object, ObjectId};
use dualframe_sim::record::wire::{Decoder, Encoder, Malformed};
use dualframe_sim::record::{Flaw, Header, RecordError, Recorder, ReplayError, SceneSpec};
use dualframe_sim::render::{NullRenderer, Renderer};
use dualframe_sim::scene::ParticleScene;

use crate::session::{PARTICLES, add, moved, read, replay, session, spec};

const FRAMES: u64 = 200;

/// Every executor with 1, 2 and 4 threads, one frame in flight and two.
fn all_ways() -> Vec<Settings> {
    let mut ways = Vec::new();
    for &executor in ExecutorKind::ALL {
        for threads in [1, 2, 4] {
            for entry in [Entry::AfterUpdate, Entry::AfterSwap] {
                let grain = if ways.len() % 3 == 2 { Grain::Pairwise } else { Grain::Spatial };
                ways.push(Settings { executor, threads, entry, grain, ..Settings::default() });
            }
        }
    }
    ways
}

fn serial() -> Settings {
    Settings { executor: ExecutorKind::Serial, threads: 1, ..Settings::default() }
}

#[test]
fn a_session_replays_in_every_way() {
    let ways = all_ways();
    for seed in 1..=3 {
        // Recorded in other ways each time, one after the other.
        let mut recorded = ways.clone();
        recorded.rotate_left(5 * seed as usize);
        let session = session(seed, FRAMES, &recorded);
        let totals = session.totals;
        assert!(totals.letters > 50 && totals.controls > 0, "{totals:?}");
        // Before frames 0, 60, 120 and 180, and at the end.
        assert_eq!((totals.frames, totals.additions, totals.checkpoints), (FRAMES, 1, 5));
        for (&way, most) in ways.iter().zip([1, 13, u64::MAX, 60].into_iter().cycle()) {
            let played = replay(&session.file, way, most).expect("a header");
            assert!(played.error.is_none(), "{seed}, {way:?}: {:?}", played.error);
            assert_eq!((played.frames, played.checkpoints), (FRAMES, 5), "{seed}, {way:?}");
            assert_eq!(played.hash, session.last(), "{seed}, {way:?}, by {most}");
        }
    }
}

/// A replay posts messages two frames ahead, before there is the object that this one is to.
#[test]
fn a_message_to_an_object_that_was_just_added_reaches_it_again() {
    let mut manager =
        VeManager::new(spec(5).build().expect("a valid scene"), serial()).expect("valid settings");
    let header = Header::of(&spec(5));
    let mut recorder = Recorder::begin(Vec::new(), &header, &manager).expect("a start");
    let run = |manager: &mut VeManager, recorder: &mut Recorder<Vec<u8>>| {
        recorder.run(manager, 10, &mut NullRenderer::new(), &mut |_| {}).expect("it runs");
    };
    run(&mut manager, &mut recorder);
    let still = [0; 12];
    recorder.objects(&manager, &still).expect("it is recorded");
    manager = moved(manager, serial(), |scene| add(scene, &still));
    let push = Message::Impulse { node: 0, impulse: [3e-3, 0.0, 0.0] };
    // After particles and walls.
    manager.mailbox().post(ObjectId(PARTICLES as u32 + 6), push);
    run(&mut manager, &mut recorder);
    let expected = manager.state_hash();
    let (file, _) = recorder.finish(&manager).expect("it is written");
    for way in all_ways() {
        let played = replay(&file, way, u64::MAX).expect("a header");
        assert!(played.error.is_none(), "{way:?}: {:?}", played.error);
        assert_eq!((played.frames, played.letters, played.hash), (20, 1, expected), "{way:?}");
    }
}

#[test]
fn a_session_is_recorded_the_same_in_every_way() {
    let expected = session(9, FRAMES, &[serial()]);
    for way in all_ways() {
        let session = session(9, FRAMES, &[way]);
        assert_eq!(session.hashes, expected.hashes, "{way:?}");
        // Chunks end where time says.
        let events = read(&session.file).0;
        assert!(events == read(&expected.file).0, "{way:?}");
    }
}

#[test]
fn recording_changes_nothing() {
    let run = |is_recorded: bool| {
        let scene = spec(5).build().expect("a valid scene");
        let mut manager = VeManager::new(scene, serial()).expect("valid settings");
        let mut renderer = NullRenderer::new();
        if is_recorded {
            let mut recorder =
                Recorder::begin(Vec::new(), &Header::of(&spec(5)), &manager).expect("a start");
            recorder.run(&mut manager, 100, &mut renderer, &mut |_| {}).expect("it runs");
        } else {
            manager.run(100, &mut renderer, &mut |_| {}).expect("it runs");
        }
        (manager.state_hash(), renderer.checksum())
    };
    assert_eq!(run(true), run(false));
}

#[test]
fn a_session_that_did_not_begin() {
    let spec = ParticleScene::new(1);
    let scene = spec.build().expect("a valid scene");
    let mut manager = VeManager::new(scene, serial()).expect("valid settings");
    let recorder = Recorder::begin(Vec::new(), &Header::of(&spec), &manager).expect("a start");
    // Without a frame.
    let (file, totals) = recorder.finish(&manager).expect("it is written");
    assert_eq!((totals.frames, totals.checkpoints), (0, 1));
    let played = replay(&file, serial(), 10).expect("a header");
    assert_eq!((played.frames, played.error.is_none()), (0, true));
    manager.run(1, &mut NullRenderer::new(), &mut |_| {}).expect("it runs");
    let begun = Recorder::begin(Vec::new(), &Header::of(&spec), &manager);
    assert!(matches!(begun, Err(RecordError::Begun { frame: 1 })));
}

/// What a panic leaves are objects of different frames.
#[test]
fn what_was_broken_off_is_recorded_no_more() {
    struct Breaking;
    impl Renderer for Breaking {
        fn draw(&mut self, _: &Object) {}

        fn swap(&mut self, frame: u64) {
            assert_ne!(frame, 7);
        }
    }
    for is_seen in [true, false] {
        let scene = spec(5).build().expect("a valid scene");
        let mut manager = VeManager::new(scene, serial()).expect("valid settings");
        let header = Header::of(&spec(5));
        let mut recorder = Recorder::begin(Vec::new(), &header, &manager).expect("a start");
        let run = || match is_seen {
            true => recorder.run(&mut manager, 20, &mut Breaking, &mut |_| {}).is_ok(),
            false => manager.run(20, &mut Breaking, &mut |_| {}).is_ok(),
        };
        assert!(catch_unwind(AssertUnwindSafe(run)).is_err());
        if !is_seen {
            let run = recorder.run(&mut manager, 1, &mut NullRenderer::new(), &mut |_| {});
            assert!(matches!(run, Err(RecordError::Executor(ExecutorError::BrokenOff))));
        }
        assert!(matches!(recorder.finish(&manager), Err(RecordError::Over)));
    }
}

/// A scene that takes so many bytes.
struct Large(usize);

impl SceneSpec for Large {
    const KIND: &'static str = "large";

    fn encode(&self, to: &mut Encoder<'_>) {
        to.bytes(&vec![0; self.0]);
    }

    fn decode(_: &mut Decoder<'_>) -> Result<Self, Malformed> {
        Err(Malformed::Ended)
    }
}

#[test]
fn a_scene_that_a_chunk_cannot_hold_is_refused_at_once() {
    let scene = spec(5).build().expect("a valid scene");
    let manager = VeManager::new(scene, serial()).expect("valid settings");
    let mut file = Vec::new();
    let begun = Recorder::begin(&mut file, &Header::of(&Large(1 << 24)), &manager).map(drop);
    assert!(matches!(begun, Err(RecordError::Full { frame: 0 })), "{begun:?}");
    assert!(file.is_empty());
    let begun = Recorder::begin(&mut file, &Header::of(&Large(1 << 23)), &manager).map(drop);
    assert!(begun.is_ok(), "{begun:?}");
}

/// A run of no frames takes no message that the recorder does not see.
#[test]
fn what_was_posted_before_the_recorder_began() {
    for &executor in ExecutorKind::ALL {
        let way = Settings { executor, threads: 2, ..Settings::default() };
        let scene = spec(4).build().expect("a valid scene");
        let mut manager = VeManager::new(scene, way).expect("valid settings");
        let mut renderer = NullRenderer::new();
        manager.mailbox().post(ObjectId(3), Message::Impulse { node: 0, impulse: [1e-3; 3] });
        manager.run(0, &mut renderer, &mut |_| {}).expect("it runs");
        let mut recorder =
            Recorder::begin(Vec::new(), &Header::of(&spec(4)), &manager).expect("a start");
        recorder.run(&mut manager, 3, &mut renderer, &mut |_| {}).expect("it runs");
        let (file, totals) = recorder.finish(&manager).expect("it is written");
        assert_eq!(totals.letters, 1, "{executor:?}");
        let played = replay(&file, way, 10).expect("a header");
        assert!(played.error.is_none(), "{executor:?}: {:?}", played.error);
        assert_eq!((played.hash, played.letters), (manager.state_hash(), 1), "{executor:?}");
    }
}

/// Of the same session, and of one that differs at its first checkpoint.
#[test]
fn messages_are_counted_when_they_were_played() {
    let spec = ParticleScene::new(5);
    let recorded = |named: ParticleScene| {
        let scene = spec.build().expect("a valid scene");
        let mut manager = VeManager::new(scene, serial()).expect("valid settings");
        let mut recorder =
            Recorder::begin(Vec::new(), &Header::of(&named), &manager).expect("a start");
        let mailbox = manager.mailbox();
        let post = |count| (0..count).for_each(|_| mailbox.post(ObjectId(0), Message::Release));
        post(1);
        let mut on_frame = |record: &FrameRecord| {
            // Processed two frames later.
            let count = [(0, 10), (57, 100), (58, 1_000), (59, 10_000), (69, 100_000)];
            let count = count.into_iter().find(|&(frame, _)| frame == record.frame);
            post(count.map_or(0, |(_, count)| count));
        };
        let mut renderer = NullRenderer::new();
        recorder.run(&mut manager, 70, &mut renderer, &mut on_frame).expect("it runs");
        recorder.finish(&manager).expect("it is written").0
    };
    let (same, other) = (recorded(spec), recorded(ParticleScene { gravity: true, ..spec }));
    for most in [1, 13, u64::MAX] {
        let played = replay(&same, serial(), most).expect("a header");
        assert!(played.error.is_none(), "{:?}", played.error);
        assert_eq!((played.frames, played.letters), (70, 11_111), "by {most}");
        let played = replay(&other, serial(), most).expect("a header");
        assert!(matches!(played.error, Some(ReplayError::Differs(_))), "{:?}", played.error);
        assert_eq!((played.frames, played.letters), (60, 111), "by {most}");
    }
}

#[test]
fn objects_that_were_added_last_are_checked() {
    let spec = ParticleScene::new(1);
    let scene = spec.build().expect("a valid scene");
    let manager = VeManager::new(scene, serial()).expect("valid settings");
    let mut recorder = Recorder::begin(Vec::new(), &Header::of(&spec), &manager).expect("a start");
    recorder.checkpoint(&manager).expect("it is recorded");
    let velocity = [0; 12];
    recorder.objects(&manager, &velocity).expect("it is recorded");
    let mut scene = manager.into_scene();
    add(&mut scene, &velocity);
    let manager = VeManager::new(scene, serial()).expect("valid settings");
    let (file, totals) = recorder.finish(&manager).expect("it is written");
    assert_eq!((totals.additions, totals.checkpoints), (1, 2));
    let played = replay(&file, serial(), 10).expect("a header");
    assert!(played.error.is_none());
}

#[derive(Debug)]
struct OfMyOwn;

impl Custom for OfMyOwn {
    fn process(&self, _: &mut Object) {}
}

#[test]
fn a_message_of_the_applications_own_is_named() {
    let spec = spec(1);
    let scene = spec.build().expect("a valid scene");
    let mut manager = VeManager::new(scene, serial()).expect("valid settings");
    let mut file = Vec::new();
    let mut recorder = Recorder::begin(&mut file, &Header::of(&spec), &manager).expect("a start");
    let mailbox = manager.mailbox();
    let mut renderer = NullRenderer::new();
    let mut run = |frames, on_frame: &mut OnFrame<'_>| {
        let run = recorder.run(&mut manager, frames, &mut renderer, on_frame);
        let written = recorder.write(&manager);
        (run, written)
    };
    assert!(run(70, &mut |_| {}).0.is_ok());
    let (failed, written) = run(30, &mut |record| {
        if record.frame == 80 {
            mailbox.post(ObjectId(PARTICLES as u32 - 1), Message::Custom(Box::new(OfMyOwn)));
        }
    });
    let error = failed.expect_err("it cannot be recorded").to_string();
    let expected =
        "a message from outside to object 11, due in frame 82, cannot be recorded: OfMyOwn";
    assert_eq!(error, expected);
    assert!(matches!(written, Err(RecordError::Over)));
    assert_eq!(manager.frame(), 100, "the session goes on");
    drop(recorder);
    // What was written before plays.
    let played = replay(&file, serial(), 1_000).expect("a header");
    assert_eq!(played.frames, 70);
    let Some(ReplayError::Recording(error)) = played.error else { panic!("{:?}", played.error) };
    assert!(matches!(error.flaw, Flaw::CutOff));
}
