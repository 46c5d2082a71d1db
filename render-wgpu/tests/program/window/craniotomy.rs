//! A person operates: the mouse is the tool.

use crate::command::{read_json, run};
use serde_json::Value;

use super::desktop::{Desktop, Session};

const CRANIOTOMY: [&str; 5] = ["craniotomy", "--threads", "2", "--size", "480x360"];
/// The middle of the picture, where the skin is.
const MIDDLE: (i16, i16) = (240, 180);

/// Opens the window without the overlay.
fn open<'a>(desktop: &'a Desktop, args: &[&str]) -> Session<'a> {
    let mut session = desktop.open(&[&CRANIOTOMY, args].concat());
    let before = session.wait_for("a picture", |_| true);
    session.strike('h');
    session.wait_for("the overlay to go", |now| now.difference(&before) > 10_000);
    session
}

/// Waits for so many pictures that differ.
fn watch(session: &mut Session<'_>, pictures: usize) {
    for _ in 0..pictures {
        let before = session.wait_for("a picture", |_| true);
        session.wait_for("another picture", |now| now.difference(&before) > 0);
    }
}

/// What a file replays to, by another executor.
fn replayed(file: &str, json: &str) -> Value {
    let output = run(&["replay", file, "--executor", "serial", "--json", json]);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    read_json(json.as_ref())
}

#[test]
#[ignore = "needs Xvfb and a graphics adapter; .ci/run has them"]
fn a_hand_cuts_and_drills() {
    let desktop = Desktop::start();
    let folder = tempfile::tempdir().expect("a temporary folder");
    let file = |name| folder.path().join(name).to_str().expect("a plain path").to_owned();
    let (recording, json) = (file("session"), file("replay.json"));
    let untouched = run(&["craniotomy", "--headless", "--frames", "1", "--json", &json]);
    assert!(untouched.status.success());
    let untouched = read_json(json.as_ref());
    let mut session = open(&desktop, &["--record", &recording]);
    session.move_to(MIDDLE.0, MIDDLE.1);
    session.strike('1');
    watch(&mut session, 3);
    session.press(true);
    for step in 1..=5 {
        session.move_to(MIDDLE.0 + 12 * step, MIDDLE.1 + 8 * step);
        watch(&mut session, 1);
    }
    session.press(false);
    // The other hand drills beside.
    session.strike('x');
    session.strike('5');
    session.move_to(MIDDLE.0 + 10, MIDDLE.1 - 40);
    watch(&mut session, 8);
    session.press(true);
    watch(&mut session, 8);
    session.press(false);
    let report = session.close();
    assert!(report["nodes"].as_u64() > untouched["nodes"].as_u64(), "scalp is cut");
    assert_eq!(untouched["bone_removed_mm3"], 0.0);
    assert!(report["bone_removed_mm3"].as_f64() > Some(1.0), "{}", report["bone_removed_mm3"]);
    assert!(report["score"]["drilling_seconds"].as_f64() > Some(0.1), "{}", report["score"]);
    for hand in report["haptics"].as_array().expect("a list") {
        assert!(hand["ticks"].as_u64() > Some(1_000), "{hand}");
        assert!(hand["models"].as_u64() > Some(10), "{hand}");
    }
    assert!(report["haptics"][1]["largest_step_n"].as_f64() > Some(0.0), "the drill is felt");
    let replayed = replayed(&recording, &json);
    for key in ["frames", "state_hash"] {
        assert_eq!(replayed[key], report[key], "{key}");
    }
}

#[test]
#[ignore = "needs Xvfb and a graphics adapter; .ci/run has them"]
fn a_script_is_watched() {
    let desktop = Desktop::start();
    let args = ["--step", "incision", "--frames", "40"];
    let report = desktop.watch(&[&CRANIOTOMY[..], &args].concat());
    let folder = tempfile::tempdir().expect("a temporary folder");
    let json = folder.path().join("report.json");
    let json = json.to_str().expect("a plain path");
    let unwatched = run(&[&["craniotomy", "--headless", "--json", json], &args[..]].concat());
    assert!(unwatched.status.success());
    assert_eq!(read_json(json.as_ref())["state_hash"], report["state_hash"]);
}
