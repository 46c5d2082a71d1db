//! Recordings that somebody has made by hand, with the right checksums.

use super::chunk::{ChunkReader, ChunkWriter, Kind};
use super::journal::FRAMES;
use super::wire::{Decoder, Encoder, Malformed};
use super::*;
use crate::executor::ExecutorKind;
use crate::manager::{Settings, VeManager};
use crate::message::Message;
use crate::object::ObjectId;
use crate::render::NullRenderer;
use crate::scene::ParticleScene;

const PUSHED: ObjectId = ObjectId(2);
const STRENGTH: f32 = 0.001_25;

fn manager(scene: crate::scene::Scene) -> VeManager {
    let settings = Settings { executor: ExecutorKind::Serial, threads: 1, ..Settings::default() };
    VeManager::new(scene, settings).expect("valid settings")
}

fn scene() -> ParticleScene {
    ParticleScene::new(4)
}

/// A session of 70 frames in which an object is pushed in frame 59.
fn session() -> Vec<u8> {
    let mut manager = manager(scene().build().expect("a valid scene"));
    let mut recorder =
        Recorder::begin(Vec::new(), &Header::of(&scene()), &manager).expect("it can be recorded");
    let mailbox = manager.mailbox();
    let mut on_frame = |record: &crate::executor::FrameRecord| {
        if record.frame == 57 {
            mailbox.post(PUSHED, Message::Impulse { node: 3, impulse: [STRENGTH; 3] });
        }
    };
    recorder.run(&mut manager, 70, &mut NullRenderer::new(), &mut on_frame).expect("it runs");
    recorder.finish(&manager).expect("it is written").0
}

/// The same file with chunks as `change` makes them, and right checksums.
fn rewritten(file: &[u8], mut change: impl FnMut(u64, &mut Vec<u8>)) -> Vec<u8> {
    let mut reader = ChunkReader::new(file);
    reader.start().expect("it begins as it should");
    let mut writer = ChunkWriter::new(Vec::new()).expect("memory can be written");
    let mut payload = Vec::new();
    loop {
        let kind = reader.next(&mut payload).expect("a whole file");
        change(reader.chunk, &mut payload);
        reader.accept();
        let kinds = [Kind::Header, Kind::Events, Kind::End];
        let kind = kinds.into_iter().find(|&known| known as u8 == kind).expect("a known kind");
        writer.write(kind, &payload).expect("memory can be written");
        if kind == Kind::End {
            return writer.into_inner();
        }
    }
}

fn replay(file: &[u8]) -> Result<u64, ReplayError> {
    let mut replay = Replay::new(file)?;
    let mut scene =
        replay.header().scene::<ParticleScene>().expect("particles").build().expect("valid");
    replay.begin(&mut scene);
    let mut manager = manager(scene);
    while replay.advance(&mut manager, 1_000, &mut NullRenderer::new(), &mut |_| {})? != Step::Over
    {
    }
    Ok(manager.frame())
}

fn find(payload: &[u8], bytes: &[u8]) -> Option<usize> {
    payload.windows(bytes.len()).position(|window| window == bytes)
}

#[test]
fn a_changed_message_is_named_by_its_object() {
    let file = session();
    assert_eq!(replay(&file).expect("it agrees"), 70);
    assert_eq!(rewritten(&file, |_, _| {}), file);
    let mut changes = 0;
    let changed = rewritten(&file, |_, payload| {
        if let Some(place) = find(payload, &STRENGTH.to_le_bytes()) {
            // The lowest bit of the impulse.
            payload[place] ^= 1;
            changes += 1;
        }
    });
    assert_eq!(changes, 1);
    let difference = match replay(&changed).expect_err("the push is another") {
        ReplayError::Differs(difference) => difference,
        other => panic!("{other}"),
    };
    // A frame later nobody else knows yet.
    assert_eq!(difference.frame, 60);
    let objects: Vec<_> = difference.objects.iter().map(|differs| differs.object).collect();
    assert_eq!(objects, [PUSHED]);
    let [differs] = difference.objects[..] else { unreachable!() };
    let told = difference.to_string();
    let hash = |hash: Option<u64>| format!("{:016x}", hash.expect("it is there"));
    for part in [
        "after 60 frames",
        "object 2 is",
        &hash(differs.expected),
        &hash(differs.found),
        &format!("{:016x}", difference.expected),
        &format!("{:016x}", difference.found),
    ] {
        assert!(told.contains(part), "no {part} in {told}");
    }
}

#[test]
fn a_checkpoint_of_other_objects() {
    let file = session();
    let mut expected = Vec::new();
    let mut reader = Reader::new(&file[..]).expect("a recording");
    let first = reader.next().expect("an event").expect("a whole one");
    let Event::Stop { stop: Stop::Checkpoint(hashes), .. } = first else { panic!("{first:?}") };
    let changed = rewritten(&file, |chunk, payload| {
        if chunk == 1 {
            payload.truncate(FRAMES);
            let fewer = Stop::Checkpoint(hashes[..hashes.len() - 2].to_vec());
            fewer.encode(0, &mut Encoder(payload));
            expected = payload.clone();
        }
    });
    let difference = match replay(&changed).expect_err("two are missing") {
        ReplayError::Differs(difference) => difference,
        other => panic!("{other}"),
    };
    assert_eq!((difference.frame, difference.objects.len()), (0, 2));
    assert_eq!(difference.objects[0].expected, None);
    assert!(difference.to_string().ends_with("and was not there, and 1 more differ"));
}

/// What is said of a file whose chunk of the first frames is `events`, of `frames` frames.
fn read(frames: u64, events: &[(u8, u64, &[u8])]) -> Result<(), Flaw> {
    let file = rewritten(&session(), |chunk, payload| {
        if chunk == 1 {
            payload.clear();
            payload.extend_from_slice(&frames.to_le_bytes());
            for &(kind, later, rest) in events {
                Encoder(payload).byte(kind);
                Encoder(payload).number(later);
                payload.extend_from_slice(rest);
            }
        }
    });
    let mut reader = Reader::new(&file[..]).expect("a header");
    reader.find_map(|event| event.err()).map_or(Ok(()), |error| Err(error.flaw))
}

/// To object 1: release.
const RELEASE: &[u8] = &[1, 4];
const LETTER: u8 = 0;
const TIME_STEP: u8 = 2;
const OBJECTS: u8 = 3;
const CHECKPOINT: u8 = 4;

#[test]
fn what_is_not_in_order() {
    let at_once: &[(u8, u64, &[u8])] = &[(TIME_STEP, 0, &[0; 4]), (LETTER, 1, RELEASE)];
    // In order, but the end tells of others.
    assert!(matches!(read(0, at_once), Err(Flaw::Totals { .. })));
    let disorder = |frames, events: &[(u8, u64, &[u8])]| match read(frames, events) {
        Err(Flaw::Disorder(disorder)) => disorder,
        other => panic!("{other:?}"),
    };
    assert_eq!(
        disorder(9, &[(TIME_STEP, 3, &[0; 4]), (LETTER, 2, RELEASE)]),
        Disorder::Letter { due: 2, after: 3 }
    );
    assert_eq!(
        disorder(9, &[(LETTER, 5, RELEASE), (TIME_STEP, 3, &[0; 4])]),
        Disorder::Stop { frame: 3, after: 0, due: 5 }
    );
    assert_eq!(disorder(3, &[(LETTER, 5, RELEASE)]), Disorder::Frames { frames: 3, least: 4 });
    // The next chunk's events come later by so much, but it ends when it did.
    let checked = (CHECKPOINT, 1, &[0][..]);
    assert_eq!(disorder(1, &[checked]), Disorder::Frames { frames: 70, least: 1 + 70 });
    let twice: &[(u8, u64, &[u8])] = &[(LETTER, 1, RELEASE), (LETTER, u64::MAX, RELEASE)];
    let overflow = read(9, twice);
    assert!(matches!(overflow, Err(Flaw::Malformed(Malformed::Value { what: "a frame", .. }))));
    let kind = read(9, &[(9, 0, &[])]);
    assert!(matches!(kind, Err(Flaw::Malformed(Malformed::Value { .. }))));
    let ended = read(9, &[(OBJECTS, 0, &[0xff, 0xff, 3, 0])]);
    assert!(matches!(ended, Err(Flaw::Malformed(Malformed::Ended))));
}

#[test]
fn frames_that_nothing_checks() {
    let file = session();
    let unchecked = |file: &[u8]| {
        let mut reader = Reader::new(file).expect("a header");
        match reader.find_map(Result::err).map(|error| error.flaw) {
            Some(Flaw::Disorder(Disorder::Unchecked { frames, checked })) => {
                Some((frames, checked))
            }
            _ => None,
        }
    };
    // Up to this frame there is the checkpoint of the first chunk, or none.
    let promising = |frames: u64, is_checked: bool| {
        let chunks = rewritten(&file, |chunk, payload| match chunk {
            1 if !is_checked => payload.truncate(FRAMES),
            2 => *payload = frames.to_le_bytes().to_vec(),
            3 => {
                payload.clear();
                let checkpoints = u64::from(is_checked);
                Totals { frames, checkpoints, ..Totals::default() }.encode(&mut Encoder(payload));
            }
            _ => {}
        });
        unchecked(&chunks)
    };
    for frames in [1, CHECKPOINT_FRAMES, CHECKPOINT_FRAMES + 1, 1 << 63, u64::MAX] {
        assert_eq!(promising(frames, true), Some((frames, Some(0))));
        assert_eq!(promising(frames, false), Some((frames, None)));
    }
    assert_eq!(promising(0, false), Some((0, None)));
    assert_eq!(promising(0, true), None);
}

#[test]
fn what_comes_after_frames_that_nothing_checks() {
    let file = session();
    let late = |kind: u8, rest: &[u8], frame: u64| {
        rewritten(&file, |chunk, payload| {
            if chunk == 2 {
                payload.truncate(FRAMES);
                Encoder(payload).byte(kind);
                Encoder(payload).number(frame);
                payload.extend_from_slice(rest);
            }
        })
    };
    let events: [(u8, &[u8], u64); 3] =
        [(LETTER, RELEASE, 61), (TIME_STEP, &[0; 4], 60), (CHECKPOINT, &[0], 60)];
    for (kind, rest, last) in events {
        for frame in [last, last + 1, 1 << 62] {
            // A replay that believes it does not end.
            let told =
                replay(&late(kind, rest, frame)).expect_err("it is not as it was").to_string();
            let refused =
                told.contains(&format!("of {frame} frames the last checkpoint is after 0"));
            assert_eq!(refused, frame > last, "kind {kind}, frame {frame}: {told}");
        }
    }
}

#[test]
fn too_much_for_one_frame() {
    let letters = vec![(LETTER, 0, RELEASE); MAX_LETTERS + 1];
    assert!(matches!(read(0, &letters), Err(Flaw::Disorder(Disorder::Letters { due: 0 }))));
    let letters = &letters[..MAX_LETTERS];
    assert!(matches!(read(0, letters), Err(Flaw::Totals { .. })));

    let mut spec = Vec::new();
    Encoder(&mut spec).bytes(&vec![7; MAX_PAYLOAD - 100]);
    assert!(matches!(read(0, &[(OBJECTS, 0, &spec)]), Err(Flaw::Totals { .. })));
    let file = rewritten(&session(), |chunk, payload| {
        if chunk > 0 && payload.len() > 2 * FRAMES {
            payload.truncate(FRAMES);
            payload.splice(.., [0; FRAMES]);
            payload.extend_from_slice(&[OBJECTS, 0]);
            payload.extend_from_slice(&spec);
        }
    });
    let mut reader = Reader::new(&file[..]).expect("a header");
    let error = reader.find_map(Result::err).expect("twice too much");
    assert!(matches!(error.flaw, Flaw::Disorder(Disorder::Stops { frame: 0 })), "{error}");
}

#[test]
fn what_a_recorder_cannot_hold() {
    let manager = manager(scene().build().expect("a valid scene"));
    let begin = || Recorder::begin(Vec::new(), &Header::of(&scene()), &manager);
    let mut recorder = begin().expect("it can be recorded");
    let mut written = Vec::new();
    let refused = Recorder::begin(&mut written, &Header::of(&scene()), &manager);
    assert!(matches!(refused, Err(RecordError::Recorded)));
    assert!(written.is_empty(), "it may be the other's file");
    let spec = vec![1; MAX_PAYLOAD];
    let refused = recorder.objects(&manager, &spec);
    assert!(matches!(refused, Err(RecordError::Disorder(Disorder::Stops { frame: 0 }))));
    assert!(matches!(recorder.finish(&manager), Err(RecordError::Over)));
    // It has let go.
    assert!(begin().is_ok());
}

#[test]
fn lengths_that_no_chunk_has() {
    let file = session();
    let first = chunk::START;
    for (place, bytes) in [(2, [0xff; 4]), (6, [0xff; 4]), (2, [1, 0, 0, 1]), (6, [1, 0, 0, 1])] {
        let mut file = file.clone();
        file[first + place..first + place + 4].copy_from_slice(&bytes);
        let error = Reader::new(&file[..]).err().expect("it is too long");
        assert!(matches!(error.flaw, Flaw::Length { .. }), "{error}");
    }
}

/// No packed byte holds more than so many; what a chunk says beyond that need not be unpacked to be wrong.
#[test]
fn a_packed_chunk_is_no_longer_than_packing_allows() {
    let file = session();
    let first = chunk::START;
    for (length, is_too_long) in [(10 * 1032_u32, false), (10 * 1032 + 1, true)] {
        let mut file = file.clone();
        file[first + 1] = 1;
        file[first + 2..first + 6].copy_from_slice(&10_u32.to_le_bytes());
        file[first + 6..first + 10].copy_from_slice(&length.to_le_bytes());
        let error = Reader::new(&file[..]).err().expect("it is another length");
        assert_eq!(matches!(error.flaw, Flaw::Length { .. }), is_too_long, "{error}");
    }
}

#[test]
fn totals_come_back() {
    let totals =
        Totals { frames: 1, letters: 200, controls: 3, additions: u64::MAX, checkpoints: 5 };
    let mut bytes = Vec::new();
    totals.encode(&mut Encoder(&mut bytes));
    assert_eq!(Totals::decode(Decoder(&bytes)), Ok(totals));
}
