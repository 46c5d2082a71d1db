//! Files that cannot be written, and what becomes of the others.
#![cfg(target_os = "linux")]

use std::fs::{self, File};
use std::io::Read;
use std::os::unix::fs::symlink;
use std::path::Path;
use std::process::{Command, Output};
use std::thread;

use crate::command::{command, read_json, run, told};
use dualframe_sim::image::{Image, save};
use dualframe_sim::scene::head::synthetic_ct;
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
    let [json, after, record] =
        ["report.json", "after.nii", "session"].map(|name| folder.file(name));
    let operate = |args: &[&str]| {
        run(&[&["craniotomy", "--step", "incision", "--frames", "3", "--headless"], args].concat())
    };
    let output =
        operate(&["--trace", FULL, "--save", &after, "--json", &json, "--record", &record]);
    failed(&output, &["cannot write /dev/full: "]);
    assert_eq!(read_json(json.as_ref())["frames"], 3);
    Image::open(after.as_ref()).expect("it was written");
    assert!(run(&["replay", &record]).status.success());

    fs::remove_file(&json).expect("it was there");
    failed(&operate(&["--save", FULL, "--json", &json]), &[FULL]);
    assert_eq!(read_json(json.as_ref())["frames"], 3);

    let output = operate(&["--save", FULL, "--trace", FULL, "--json", FULL]);
    failed(&output, &["cannot write /dev/full: ", FULL, "cannot write /dev/full: "]);
    let output = run(&["replay", &record, "--json", FULL]);
    failed(&output, &["cannot write /dev/full: "]);
}

#[test]
#[ignore = "needs a graphics adapter; .ci/run has one"]
fn pictures_that_fail_cost_no_other_output() {
    let folder = Folder::new();
    let [json, frames] = ["report.json", "frames"].map(|name| folder.file(name));
    let few = ["--objects", "5", "--frames", "9", "--size", "32x32", "--json", &json];
    let output = run(&[&few[..], &["--picture", FULL]].concat());
    failed(&output, &["cannot write /dev/full: "]);
    assert_eq!(read_json(json.as_ref())["frames"], 9);

    fs::remove_file(&json).expect("it was there");
    let picture = |frame: usize| Path::new(&frames).join(format!("frame-{frame:06}.png"));
    fs::create_dir_all(picture(2)).expect("it can be made");
    let output = run(&[&few[..], &["--frames-out", &frames]].concat());
    failed(&output, &["frame-000002.png: "]);
    assert_eq!(read_json(json.as_ref())["frames"], 9);
    assert!(picture(1).is_file() && !picture(3).exists());
}

#[test]
fn a_report_that_cannot_be_printed_costs_no_other_output() {
    let folder = Folder::new();
    let [json, record] = ["report.json", "session"].map(|name| folder.file(name));
    let unprinted = |args: &[&str]| {
        let full = File::options().write(true).open(FULL).expect("it is always there");
        let output = command(args).stdout(full).output().expect("the program starts");
        told(&output, 1, "the report cannot be printed: ");
    };
    let few = ["--headless", "--objects", "5", "--frames", "5", "--json", &json];
    unprinted(&[&few[..], &["--record", &record]].concat());
    assert_eq!(read_json(json.as_ref())["frames"], 5);
    unprinted(&["replay", &record, "--json", &json]);
    assert_eq!(read_json(json.as_ref())["agrees"], true);
}

#[test]
fn a_file_that_the_report_is_printed_to_is_no_other_output() {
    let folder = Folder::new();
    let [printed, record] = ["printed", "session"].map(|name| folder.file(name));
    let few = ["--headless", "--objects", "5", "--frames", "5"];
    assert!(run(&[&few[..], &["--record", &record]].concat()).status.success());
    let refused = |args: &[&str]| {
        let file = File::create(&printed).expect("it can be made");
        let output = command(args).stdout(file).output().expect("the program starts");
        told(&output, 2, "is where the report is printed");
    };
    for file in ["/dev/stdout", &printed] {
        refused(&[&few[..], &["--trace", file]].concat());
        refused(&["replay", &record, "--json", file]);
    }
}

#[test]
#[ignore = "needs a graphics adapter; .ci/run has one"]
fn pictures_of_an_earlier_run_are_told() {
    let folder = Folder::new();
    let frames = folder.file("frames");
    let draw = |count: &str| {
        let few = ["--objects", "5", "--size", "32x32", "--headless"];
        run(&[&few[..], &["--frames", count, "--frames-out", &frames]].concat())
    };
    for _ in 0..2 {
        let output = draw("3");
        assert!(output.status.success() && output.stderr.is_empty());
    }
    told(&draw("2"), 0, "frames: pictures from frame 2 on are of an earlier run");
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
    failed(&output, &["the recording failed before frame "]);
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

#[test]
fn a_file_is_not_two() {
    let folder = Folder::new();
    let [recording, other, link, image] =
        ["session", "other", "link", "ct.nii"].map(|name| folder.file(name));
    let few = ["--headless", "--objects", "5", "--frames", "5"];
    assert!(run(&[&few[..], &["--record", &recording]].concat()).status.success());
    let before = fs::read(&recording).expect("it was written");
    symlink(&recording, &link).expect("it can be made");
    for json in [&recording, &link] {
        told(&run(&["replay", &recording, "--json", json]), 2, "are the same file");
        let both = ["--record", &recording, "--json", json];
        told(&run(&[&few[..], &both].concat()), 2, "are the same file");
    }
    assert!(fs::read(&recording).is_ok_and(|now| now == before));
    // One that is not there yet.
    told(&run(&["--json", &other, "--trace", &other]), 2, "are the same file");
    assert!(!Path::new(&other).exists());
    // One of the pictures of all frames.
    let [pictures, frame] = ["pictures", "pictures/frame-000007.png"].map(|name| folder.file(name));
    let both = ["--frames-out", &pictures, "--picture", &frame];
    told(&run(&both), 2, "is where a frame's picture goes");
    // An image, of a recording too.
    let image_of = synthetic_ct().expect("it has no file");
    save(image.as_ref(), image_of.grid(), image_of.voxels()).expect("it can be written");
    let before = fs::read(&image).expect("it was written");
    told(&run(&["craniotomy", "--ct", &image, "--save", &image]), 2, "are the same file");
    let few = ["craniotomy", "--headless", "--frames", "2", "--ct", &image];
    assert!(run(&[&few[..], &["--record", &recording]].concat()).status.success());
    told(&run(&["replay", &recording, "--json", &image]), 2, "are the same file");
    assert!(fs::read(&image).is_ok_and(|now| now == before));
    // More than one may write to a device.
    let output =
        run(&["--headless", "--frames", "5", "--json", "/dev/null", "--trace", "/dev/null"]);
    assert!(output.status.success());
}

#[test]
fn nothing_is_left_of_a_refused_run() {
    let folder = Folder::new();
    let [json, trace, picture, recording, image, pictures] =
        ["json", "trace", "picture", "session", "after.nii", "frames"]
            .map(|name| folder.file(name));
    let files = ["--json", &json, "--trace", &trace, "--picture", &picture];
    let recorded = [&files[..], &["--record", &recording]].concat();
    let nowhere = ["--record", "/no/such/folder/session"];
    let frames = ["--frames-out", &pictures, "--adapter", "nonsense"];
    let save = ["--save", &image, "--ct", "/no/such/image"];
    let refused: [(&[&str], i32); 5] = [
        (&[&files[..], &nowhere].concat(), 2),
        (&[&recorded[..], &["--adapter", "nonsense"]].concat(), 3),
        (&[&recorded[..], &frames].concat(), 3),
        (&[&["craniotomy"], &recorded[..], &save].concat(), 2),
        (&["replay", "/no/such/recording", "--json", &json], 2),
    ];
    for (args, status) in refused {
        assert_eq!(run(args).status.code(), Some(status), "{args:?}");
        let left = fs::read_dir(folder.0.path()).expect("it is there").flatten();
        let left: Vec<_> =
            left.map(|entry| entry.file_name()).filter(|name| name != "frames").collect();
        assert!(left.is_empty(), "{args:?} leaves {left:?}");
    }
    let mut left = fs::read_dir(&pictures).expect("it was made");
    assert!(left.next().is_none());
    // What was there stays, be it empty.
    fs::write(&json, "").expect("it can be written");
    run(&["replay", "/no/such/recording", "--json", &json]);
    assert!(Path::new(&json).exists());
}
