//! Files that cannot be written, and what becomes of the others.
#![cfg(target_os = "linux")]

use std::fs::{self, File};
use std::io::Read;
use std::path::Path;
use std::process::{Command, Output};
use std::thread;

use crate::command::{read_json, run, told};
use dualframe_sim::image::Image;
use tempfile::TempDir;

/// Nothing can be written there.
const FULL: &str = "/dev/full";

/// A folder, and the paths of files in it.
struct Folder(TempDir);

impl Folder {
    fn new() -> Self {
        Self(tempfile::tempdir().expect("a temporary folder"))
    }

    fn file(&self, name: &str) -> String {
        self.0.path().join(name).to_str().expect("a plain path").to_owned()
    }
}

/// Sees that a run was done and reported, with status 1 and these lines on standard error.
fn failed(output: &Output, parts: &[&str]) {
    let told = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{told}");
    assert_eq!(told.lines().count(), parts.len(), "{told}");
    for (line, part) in told.lines().zip(parts) {
        assert!(line.contains(part), "no {part:?} in {line}");
    }
    assert!(String::from_utf8_lossy(&output.stdout).contains("state hash"));
}

#[test]
fn what_fails_costs_no_other_output() {
    let folder = Folder::new();
    let [json, save, record] =
        ["report.json", "after.nii", "session"].map(|name| folder.file(name));
    let operate = |args: &[&str]| {
        run(&[&["craniotomy", "--step", "incision", "--frames", "3", "--headless"], args].concat())
    };
    let output = operate(&["--trace", FULL, "--save", &save, "--json", &json, "--record", &record]);
    failed(&output, &["the trace cannot be written: "]);
    assert_eq!(read_json(json.as_ref())["frames"], 3);
    Image::open(save.as_ref()).expect("it was written");
    assert!(run(&["replay", &record]).status.success());

    fs::remove_file(&json).expect("it was there");
    failed(&operate(&["--save", FULL, "--json", &json]), &[FULL]);
    assert_eq!(read_json(json.as_ref())["frames"], 3);

    let output = operate(&["--save", FULL, "--trace", FULL, "--json", FULL]);
    failed(&output, &["the trace cannot be written: ", FULL, "cannot write the JSON: "]);
    let output = run(&["replay", &record, "--json", FULL]);
    failed(&output, &["cannot write the JSON: "]);
}

#[test]
#[ignore = "needs a graphics adapter; .ci/run has one"]
fn pictures_that_fail_cost_no_other_output() {
    let folder = Folder::new();
    let [json, frames] = ["report.json", "frames"].map(|name| folder.file(name));
    let few = ["--objects", "5", "--frames", "9", "--size", "32x32", "--json", &json];
    let output = run(&[&few[..], &["--picture", FULL]].concat());
    failed(&output, &["a picture cannot be written: "]);
    assert_eq!(read_json(json.as_ref())["frames"], 9);

    fs::remove_file(&json).expect("it was there");
    let picture = |frame: usize| Path::new(&frames).join(format!("frame-{frame:06}.png"));
    fs::create_dir_all(picture(2)).expect("it can be made");
    let output = run(&[&few[..], &["--frames-out", &frames]].concat());
    failed(&output, &["a picture cannot be written: "]);
    assert_eq!(read_json(json.as_ref())["frames"], 9);
    assert!(picture(1).is_file() && !picture(3).exists());
}

/// Reads the beginning of a recording up to the end of its first chunk of events, and hears no more.
fn read_beginning(file: &str) {
    let mut recording = File::open(file).expect("it can be read");
    let mut take = |bytes: usize| {
        let mut taken = vec![0; bytes];
        recording.read_exact(&mut taken).expect("it is written");
        taken
    };
    take(12);
    for _ in ["header", "events"] {
        let head = take(14);
        let length =
            head[2..6].iter().rev().fold(0, |length, &byte| 256 * length + usize::from(byte));
        take(length);
    }
}

#[test]
fn a_recording_that_fails_ends_and_the_session_goes_on() {
    let folder = Folder::new();
    let [pipe, json] = ["pipe", "report.json"].map(|name| folder.file(name));
    let made = Command::new("mkfifo").arg(&pipe).status().expect("there is mkfifo");
    assert!(made.success());
    let reader = thread::spawn({
        let pipe = pipe.clone();
        move || read_beginning(&pipe)
    });
    let args = ["--headless", "--objects", "40", "--frames", "150", "--json", &json];
    let output = run(&[&args[..], &["--record", &pipe]].concat());
    reader.join().expect("it was written");
    failed(&output, &["the recording ends before frame "]);
    assert_eq!(read_json(json.as_ref())["frames"], 150);
}

/// Nothing may be lost for a run that does not come to be.
#[test]
fn a_refused_run_keeps_a_recording() {
    let folder = Folder::new();
    let [record, picture] = ["session", "picture.png"].map(|name| folder.file(name));
    fs::write(&record, "precious").expect("it can be written");
    let draw = ["--record", &record, "--picture", &picture, "--adapter", "nonsense"];
    told(&run(&draw), 3, "no graphics adapter");
    told(&run(&[&["craniotomy"], &draw[..]].concat()), 3, "no graphics adapter");
    let hands = ["craniotomy", "--simulated-devices", "--haptic-rate", "100", "--record", &record];
    told(&run(&hands), 2, "500 to 4000 Hz");
    assert_eq!(fs::read_to_string(&record).ok().as_deref(), Some("precious"));
}
