//! Spoilt files: an error, and never another session.

use dualframe_sim::executor::ExecutorKind;
use dualframe_sim::manager::Settings;
use dualframe_sim::record::{Flaw, Reader, ReplayError};

use crate::session::{Session, read, replay, session};

fn serial() -> Settings {
    Settings { executor: ExecutorKind::Serial, threads: 1, ..Settings::default() }
}

fn small() -> Session {
    session(4, 130, &[serial()])
}

/// What is played of a spoilt file is a part of the session, and its end is told.
fn plays_in_part(session: &Session, file: &[u8], whole: u64) {
    let error = match replay(file, serial(), u64::MAX) {
        Ok(played) => {
            assert_eq!(played.frames, whole);
            let known = session.hashes.iter().find(|&&(frame, _)| frame == whole);
            assert_eq!(known.map(|&(_, hash)| hash), Some(played.hash), "after {whole} frames");
            played.error.expect("it does not end well")
        }
        Err(error) => error,
    };
    assert!(matches!(error, ReplayError::Recording(_)), "{error}");
}

#[test]
fn a_flipped_bit_anywhere_is_found() {
    let session = small();
    let (whole, error) = read(&session.file);
    assert!(error.is_none() && whole.len() > 50);
    for place in 0..session.file.len() {
        for bit in 0..8 {
            let mut file = session.file.clone();
            file[place] ^= 1 << bit;
            let (events, error) = read(&file);
            let error = error.unwrap_or_else(|| panic!("bit {bit} of byte {place} is not missed"));
            assert!(whole.starts_with(&events), "{place}, {bit}");
            // The chunk that it is in.
            assert!(error.place.offset <= place as u64, "{place}: {error}");
            if bit == 3 && place.is_multiple_of(29) {
                plays_in_part(&session, &file, error.place.frames);
            }
        }
    }
}

#[test]
fn a_file_cut_anywhere_plays_as_far_as_it_goes() {
    let session = small();
    let (whole, _) = read(&session.file);
    let mut ends = Vec::new();
    for length in 0..session.file.len() {
        let file = &session.file[..length];
        let (events, error) = read(file);
        let error = error.expect("it is cut");
        match length {
            0 => assert!(matches!(error.flaw, Flaw::Magic), "{error}"),
            _ => assert!(matches!(error.flaw, Flaw::CutOff), "{length}: {error}"),
        }
        assert!(whole.starts_with(&events), "{length}");
        if ends.last() != Some(&error.place.frames) {
            ends.push(error.place.frames);
            plays_in_part(&session, file, error.place.frames);
        }
    }
    assert!(ends.is_sorted() && ends.last() == Some(&130) && ends.len() > 5, "{ends:?}");
}

#[test]
fn chunks_cannot_change_places() {
    let session = small();
    let (whole, _) = read(&session.file);
    // Where chunks begin: 12 bytes, then each with 14 before its content.
    let mut chunks = Vec::new();
    let mut place = 12;
    while place < session.file.len() {
        let length: [u8; 4] = session.file[place + 2..place + 6].try_into().expect("four bytes");
        let end = place + 14 + u32::from_le_bytes(length) as usize;
        chunks.push(&session.file[place..end]);
        place = end;
    }
    let start = &session.file[..12];
    for index in 1..chunks.len() - 2 {
        let (mut missing, mut twice, mut changed) =
            (chunks.clone(), chunks.clone(), chunks.clone());
        missing.remove(index);
        twice.insert(index, chunks[index]);
        changed.swap(index, index + 1);
        for (name, chunks) in [("missing", missing), ("twice", twice), ("changed", changed)] {
            let (events, error) = read(&[start, &chunks.concat()].concat());
            let error = error.unwrap_or_else(|| panic!("{name} {index} is not missed"));
            assert!(matches!(error.flaw, Flaw::Checksum { .. }), "{name}: {error}");
            assert!(whole.starts_with(&events));
        }
    }
}

#[test]
fn what_is_no_recording() {
    let of = |file: &[u8]| Reader::new(file).err().map(|error| error.to_string());
    let place = "; in chunk 0 at byte 0, after 0 whole frames";
    for file in [&b""[..], b"\x89PNG\r\n\x1a\n", b"text", &[0; 4_096]] {
        assert_eq!(of(file), Some(format!("it is no recording{place}")));
    }
    let mut file = small().file;
    file[8] = 2;
    assert_eq!(of(&file), Some(format!("it is of version 2, and only version 1 is read{place}")));
    assert_eq!(of(&file[..11]), Some(format!("it is cut off{place}")));
    let mut file = small().file;
    file.push(0);
    let (_, error) = read(&file);
    let error = error.expect("a byte too many").to_string();
    assert!(error.starts_with("it goes on after its end; in chunk "), "{error}");
}

#[test]
fn files_that_another_program_has_written() {
    // The fuzzer's seeds, made from the description of the format alone.
    let seed = |name: &str| {
        let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/fuzz/seeds/recording/");
        let file = std::fs::read(folder.to_owned() + name).expect("a seed");
        read(&file)
    };
    let (events, error) = seed("all.rec");
    assert!(error.is_none(), "{error:?}");
    assert_eq!(events.len(), 9 + 3 + 2 + 1);
    assert_eq!(
        events[5],
        "Letter { due: 2, to: ObjectId(0), message: Stiffness { between_nodes: 60.0, to_center: 300.0 } }"
    );
    assert_eq!(events[13], "Stop { frame: 27, stop: Objects([115, 112, 101, 99]) }");
    let (events, error) = seed("packed.rec");
    assert!(error.is_none(), "{error:?}");
    assert_eq!(events.len(), 90 + 2);
    let (events, error) = seed("cut.rec");
    assert_eq!(events.len(), 2);
    let error = error.expect("it is cut").to_string();
    assert!(error.starts_with("it is cut off; in chunk 3 at byte 168, after 60 "), "{error}");
}
