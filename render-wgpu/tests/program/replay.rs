//! The program's recordings, and what it says of them.

use std::fs;
use std::path::Path;

use crate::command::{read_json, report, run, told};
use dualframe_sim::executor::FrameRecord;
use dualframe_sim::manager::{Settings, VeManager};
use dualframe_sim::message::Message;
use dualframe_sim::object::ObjectId;
use dualframe_sim::record::wire::{Decoder, Encoder, Malformed};
use dualframe_sim::record::{Header, Recorder, SceneSpec};
use dualframe_sim::render::NullRenderer;
use dualframe_sim::scene::ParticleScene;
use serde_json::Value;
use tempfile::TempDir;

const FRAMES: u64 = 150;

/// A run that is recorded into a file, and its report.
fn recorded() -> (TempDir, String, Value) {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let file = folder.path().join("session").to_str().expect("a plain path").to_owned();
    // What is there is replaced.
    fs::write(&file, [7; 100_000]).expect("it can be written");
    let frames = FRAMES.to_string();
    let args = ["--objects", "40", "--gravity", "--seed", "3", "--threads", "2"];
    let report = report(&[&args[..], &["--frames", &frames, "--record", &file]].concat());
    (folder, file, report)
}

#[test]
fn a_recorded_run_replays_in_every_way() {
    let (folder, file, recorded) = recorded();
    let json = folder.path().join("replay.json");
    let json_file = json.to_str().expect("a plain path");
    let ways: [&[&str]; 6] = [
        &[],
        &["--threads", "1"],
        &["--threads", "4", "--frames-in-flight", "1"],
        &["--executor", "serial", "--simd", "scalar"],
        &["--executor", "static", "--threads", "3"],
        &["--executor", "rayon-overlapped", "--threads", "2", "--broad-phase", "pairwise"],
    ];
    for way in ways {
        let output = run(&[&["replay", &file, "--json", json_file], way].concat());
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        assert!(output.stderr.is_empty());
        let replayed = read_json(&json);
        assert_eq!(replayed["state_hash"], recorded["state_hash"], "{way:?}");
        assert_eq!((&replayed["frames"], &replayed["agrees"]), (&FRAMES.into(), &true.into()));
        // Before frames 0, 60 and 120, and at the end.
        assert_eq!(replayed["checkpoints"], 4);
        assert_eq!(replayed["scene"], "particles");
        if let Some(place) = way.iter().position(|&option| option == "--executor") {
            assert_eq!(replayed["executor"], way[place + 1]);
        }
    }
}

#[test]
fn a_flipped_byte_is_found() {
    let (_folder, file, _) = recorded();
    let whole = fs::read(&file).expect("it was written");
    let (mut nothing, mut part) = (0, 0);
    for place in (0..whole.len()).step_by(whole.len() / 20).chain([whole.len() - 1]) {
        let mut flipped = whole.clone();
        flipped[place] ^= 0x10;
        fs::write(&file, flipped).expect("it can be written");
        let output = run(&["replay", &file]);
        let status = output.status.code();
        match status {
            Some(1) => part += 1,
            Some(2) => nothing += 1,
            _ => panic!("byte {place}: {status:?}"),
        }
        told(&output, status.unwrap_or(0), &file);
        assert_eq!(output.stdout.is_empty(), status == Some(2));
    }
    assert!(nothing > 0 && part > 0, "{nothing}, {part}");
}

#[test]
fn what_is_whole_of_a_cut_file_plays() {
    let (folder, file, recorded) = recorded();
    let whole = fs::read(&file).expect("it was written");
    let json = folder.path().join("replay.json");
    let args = ["replay", &file, "--json", json.to_str().expect("a plain path")];
    fs::write(&file, &whole[..whole.len() - 1]).expect("it can be written");
    told(&run(&args), 1, "it is cut off; in chunk ");
    let replayed = read_json(&json);
    assert_eq!((&replayed["frames"], &replayed["agrees"]), (&FRAMES.into(), &false.into()));
    assert_eq!(replayed["state_hash"], recorded["state_hash"]);
    assert!(replayed["error"].as_str().is_some_and(|error| error.starts_with("it is cut off")));
    for length in [5, 11, 40] {
        fs::write(&file, &whole[..length]).expect("it can be written");
        told(&run(&args), 2, "it is cut off; in chunk ");
    }
    fs::write(&file, "").expect("it can be written");
    told(&run(&args), 2, "it is no recording");
}

/// Records 70 frames of a scene, with a message in frame 61, under the name of another.
fn record_as(file: &Path, scene: ParticleScene, name: &impl SceneSpec) {
    let scene = scene.build().expect("a valid scene");
    let mut manager = VeManager::new(scene, Settings::default()).expect("valid settings");
    let file = fs::File::create(file).expect("it can be written");
    let mut recorder = Recorder::begin(file, &Header::of(name), &manager).expect("it is a start");
    let mailbox = manager.mailbox();
    let mut on_frame = |record: &FrameRecord| {
        if record.frame == 59 {
            mailbox.post(ObjectId(0), Message::Release);
        }
    };
    recorder.run(&mut manager, 70, &mut NullRenderer::new(), &mut on_frame).expect("it runs");
    recorder.finish(&manager).expect("it is written");
}

#[test]
fn another_session_is_told_by_its_objects() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let (file, json) = (folder.path().join("session"), folder.path().join("replay.json"));
    let text = file.to_str().expect("a plain path");
    // Falling makes a difference only after the first checkpoint.
    let scene = ParticleScene::new(5);
    record_as(&file, scene, &ParticleScene { gravity: true, ..scene });
    let output = run(&["replay", text, "--json", json.to_str().expect("a plain path")]);
    told(&output, 1, "after 60 frames the state is ");
    told(&output, 1, ": object 0 is ");
    told(&output, 1, ", and 4 more differ");
    let replayed = read_json(&json);
    assert_eq!((&replayed["frames"], &replayed["messages"]), (&60.into(), &0.into()));
    let difference = &replayed["difference"];
    assert_eq!(difference["frame"], 60);
    assert_eq!(difference["objects"].as_array().map(Vec::len), Some(5));
    assert_ne!(difference["expected"], difference["found"]);
}

#[test]
fn what_comes_before_objects_that_cannot_be_added_is_played() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let (file, json) = (folder.path().join("session"), folder.path().join("replay.json"));
    let [text, json_text] = [&file, &json].map(|path| path.to_str().expect("a plain path"));
    let replay = ["replay", text, "--json", json_text];
    let spec = ParticleScene::new(5);
    let record = |frames| {
        let scene = spec.build().expect("a valid scene");
        let mut manager = VeManager::new(scene, Settings::default()).expect("valid settings");
        let file = fs::File::create(&file).expect("it can be written");
        let mut recorder = Recorder::begin(file, &Header::of(&spec), &manager).expect("a start");
        let renderer = &mut NullRenderer::new();
        recorder.run(&mut manager, frames, renderer, &mut |_| {}).expect("it runs");
        // Particles are never added to.
        recorder.objects(&manager, &[]).expect("it is recorded");
        recorder.run(&mut manager, 5, renderer, &mut |_| {}).expect("it runs");
        recorder.finish(&manager).expect("it is written");
    };
    record(70);
    let output = run(&replay);
    told(&output, 1, "particles");
    assert!(String::from_utf8_lossy(&output.stdout).contains("70 frames replayed"));
    let replayed = read_json(&json);
    assert_eq!((&replayed["frames"], &replayed["agrees"]), (&70.into(), &false.into()));
    record(0);
    let output = run(&replay);
    told(&output, 2, "particles");
    assert!(output.stdout.is_empty());
}

struct Unknown;

impl SceneSpec for Unknown {
    const KIND: &'static str = "orrery";

    fn encode(&self, _: &mut Encoder<'_>) {}

    fn decode(_: &mut Decoder<'_>) -> Result<Self, Malformed> {
        Ok(Self)
    }
}

#[test]
fn what_cannot_be_played() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let file = folder.path().join("session");
    let text = file.to_str().expect("a plain path");
    told(&run(&["replay", text]), 2, text);
    told(&run(&["replay", folder.path().to_str().expect("a plain path")]), 2, "cannot be read");
    record_as(&file, ParticleScene::new(1), &Unknown);
    told(&run(&["replay", text]), 2, "\"orrery\"");
    record_as(&file, ParticleScene::new(1), &ParticleScene::new(0));
    told(&run(&["replay", text]), 2, "its scene cannot be built: 0 particles were asked for");
    record_as(&file, ParticleScene::new(1), &ParticleScene::new(1));
    let output = run(&["replay", text]);
    assert!(
        output.status.success() && String::from_utf8_lossy(&output.stdout).contains("1 messages")
    );
    told(&run(&["replay", text, "--json", "/no/such/folder/replay.json"]), 2, "/no/such/folder");
    told(&run(&["replay", text, "--threads", "0"]), 2, "--threads");
    told(&run(&["replay"]), 2, "<FILE>");
    // A name of two lines that clears the terminal is told in one that does not.
    told(&run(&["replay", "no\nsuch\u{1b}[2J"]), 2, "no\\nsuch\\u{1b}[2J");
    told(&run(&["--headless", "--record", "/no/such/folder/session"]), 2, "/no/such/folder");
    // Nothing can be written there.
    if Path::new("/dev/full").exists() {
        let output = run(&["--headless", "--objects", "5", "--record", "/dev/full"]);
        told(&output, 1, "the recording cannot be written: ");
        let printed = String::from_utf8_lossy(&output.stdout);
        assert!(printed.contains("state hash"), "the run goes on without: {printed}");
    }
}
