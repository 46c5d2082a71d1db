//! The program's window, by what a person does to it and sees in it.

mod controls;
mod craniotomy;
mod desktop;
mod screenshot;

use std::collections::BTreeMap;
use std::thread::sleep;

use crate::command::{NO_ADAPTERS, read_json, report, run, told};
use serde_json::Value;

use self::desktop::{Desktop, STILL};
use self::screenshot::Screenshot;

/// One particle, in the middle of the picture.
const ONE: [&str; 6] = ["--objects", "1", "--threads", "2", "--size", "640x480"];
/// The middle of that picture.
const MIDDLE: (i16, i16) = (320, 240);

/// How far down the middle of that particle stays only where something pulls it: left alone, it is at 190 to
/// 240, and lower for a moment at most.
const FAR_DOWN: usize = 270;

/// Where the middle of the particle is: the only thing that is rather red than green.
fn middle(picture: &Screenshot) -> (usize, usize) {
    let (mut count, mut x_sum, mut y_sum) = (0, 0, 0);
    for y in 0..picture.height {
        for x in 0..picture.width {
            let [red, green, _] = picture.pixel(x, y);
            if red > green.saturating_add(10) {
                (count, x_sum, y_sum) = (count + 1, x_sum + x, y_sum + y);
            }
        }
    }
    (x_sum / count.max(1), y_sum / count.max(1))
}

/// The state that as many frames come to without a window.
fn untouched(args: &[&str], frames: &Value) -> Value {
    report(&[args, &["--frames", &frames.to_string()]].concat())["state_hash"].take()
}

#[test]
#[ignore = "needs Xvfb and a graphics adapter; .ci/run has them"]
fn watching_changes_nothing() {
    let desktop = Desktop::start();
    let args = ["--objects", "20", "--size", "640x480"];
    let report = desktop.watch(&[&args[..], &["--frames", "60", "--gravity"]].concat());
    assert_eq!(report["frames"], 60);
    let args = [&args[..], &["--gravity"]].concat();
    assert_eq!(report["state_hash"], untouched(&args, &report["frames"]));
}

#[test]
#[ignore = "needs Xvfb and a graphics adapter; .ci/run has them"]
fn a_drag_moves_a_particle() {
    let desktop = Desktop::start();
    for is_dragged in [false, true] {
        let mut session = desktop.open(&ONE);
        session.strike(' ');
        // The overlay would hide half of it.
        session.strike('h');
        let before = session.wait_until_still();
        // On a slow machine it has drifted until it was paused.
        let (x, y) = middle(&before);
        session.move_to(x as i16, y as i16);
        if is_dragged {
            session.press(true);
        }
        session.move_to(MIDDLE.0 + 150, MIDDLE.1 + 110);
        session.strike(' ');
        if is_dragged {
            session.wait_until_lasting("the particle to follow", |now| middle(now).1 > FAR_DOWN);
        } else {
            session.wait_for("another picture", |now| now.difference(&before) > 0);
        }
        session.strike(' ');
        session.wait_until_still();
        session.press(false);
        let report = session.close();
        let is_untouched = report["state_hash"] == untouched(&ONE, &report["frames"]);
        assert_eq!(is_untouched, !is_dragged);
    }
}

#[test]
#[ignore = "needs Xvfb and a graphics adapter; .ci/run has them"]
fn one_looks_round_while_time_stands_still() {
    let desktop = Desktop::start();
    let mut session = desktop.open(&ONE);
    session.strike(' ');
    session.strike('h');
    let before = session.wait_until_still();
    session.move_to(20, 20);
    session.press(true);
    // It takes a picture until it is known that nothing is there to be pulled.
    sleep(STILL);
    session.move_to(120, 20);
    session.wait_for("another view", |now| now.difference(&before) > 1_000);
    session.press(false);
    session.close();
}

#[test]
#[ignore = "needs Xvfb and a graphics adapter; .ci/run has them"]
fn the_slider_of_gravity_lets_a_particle_fall() {
    let desktop = Desktop::start();
    let mut session = desktop.open(&ONE);
    // The overlay grows and shrinks with the number of workers at work.
    session.strike(' ');
    let paused = session.wait_until_still();
    let (right, y) = paused.sliders()[0];
    session.click(right, y);
    session.strike('h');
    session.strike(' ');
    session.wait_until_lasting("the particle to lie on the floor", |now| middle(now).1 > FAR_DOWN);
    let report = session.close();
    assert_ne!(report["state_hash"], untouched(&ONE, &report["frames"]));
}

#[test]
#[ignore = "needs Xvfb and a graphics adapter; .ci/run has them"]
fn what_a_person_does_replays() {
    let desktop = Desktop::start();
    let folder = tempfile::tempdir().expect("a temporary folder");
    let (file, json) = (folder.path().join("session"), folder.path().join("replay.json"));
    let file = file.to_str().expect("a plain path");
    let mut session = desktop.open(&[&ONE[..], &["--record", file]].concat());
    session.strike(' ');
    let paused = session.wait_until_still();
    let (right, y) = paused.sliders()[0];
    session.click(right, y);
    session.strike('h');
    let (x, y) = middle(&session.wait_until_still());
    session.move_to(x as i16, y as i16);
    session.press(true);
    session.move_to(MIDDLE.0 + 150, MIDDLE.1 + 110);
    session.strike(' ');
    session.wait_until_lasting("the particle to fall or follow", |now| middle(now).1 > FAR_DOWN);
    session.press(false);
    sleep(STILL);
    let report = session.close();
    assert_ne!(report["state_hash"], untouched(&ONE, &report["frames"]));
    let way = ["--executor", "serial", "--json", json.to_str().expect("a plain path")];
    let output = run(&[&["replay", file], &way[..]].concat());
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let replayed = read_json(&json);
    for key in ["frames", "state_hash"] {
        assert_eq!(replayed[key], report[key], "{key}");
    }
    // Pulled, and let go.
    assert!(replayed["messages"].as_u64() > Some(1), "{replayed}");
}

#[test]
#[ignore = "needs Xvfb and a graphics adapter; .ci/run has them"]
fn space_pauses_and_n_computes_single_frames() {
    const STEPS: usize = 3;
    let desktop = Desktop::start();
    let folder = tempfile::tempdir().expect("a temporary folder");
    let trace = folder.path().join("trace.json");
    let file = trace.to_str().expect("a plain path");
    let mut session = desktop.open(&[&ONE[..], &["--trace", file]].concat());
    session.strike(' ');
    let mut before = session.wait_until_still();
    for _ in 0..STEPS {
        session.strike('n');
        session.wait_for("the next frame", |now| now.difference(&before) > 0);
        before = session.wait_until_still();
    }
    // It closes while it is paused, too.
    let frames = session.close()["frames"].as_u64().expect("a number") as usize;
    let begins = begins_of_frames(&read_json(&trace));
    let pauses = begins.windows(2).rev().map(|pair| pair[1] - pair[0]);
    assert_eq!(begins.len(), frames);
    let short = pauses.take(STEPS).find(|&seconds| seconds < STILL.as_secs_f64());
    assert_eq!(short, None, "each of the last frames was computed alone");
}

#[test]
#[ignore = "needs Xvfb and a graphics adapter; .ci/run has them"]
fn a_key_that_was_down_before_is_not_struck() {
    let desktop = Desktop::start();
    let mut session = desktop.open(&ONE);
    session.strike(' ');
    session.wait_until_still();
    session.come_back_with(' ');
    // Seen when what came before it is, too.
    session.strike('h');
    session.wait_until_still();
    session.close();
}

/// When the first work of each frame was begun, in seconds.
fn begins_of_frames(trace: &Value) -> Vec<f64> {
    let mut begins = BTreeMap::new();
    for event in trace["traceEvents"].as_array().expect("a list of events") {
        if let (Some(frame), Some(begin)) = (event["args"]["frame"].as_u64(), event["ts"].as_f64())
        {
            let first = begins.entry(frame).or_insert(begin);
            *first = begin.min(*first);
        }
    }
    begins.into_values().map(|microseconds| microseconds * 1e-6).collect()
}

#[test]
#[ignore = "needs Xvfb and a graphics adapter; .ci/run has them"]
fn a_window_of_any_size_shown_or_not() {
    let desktop = Desktop::start();
    let mut session = desktop.open(&["--objects", "20", "--size", "640x480"]);
    for (width, height) in [(900, 700), (300, 40), (1, 1), (640, 900)] {
        session.resize(width, height);
        let size = (width as usize, height as usize);
        let fits = |now: &Screenshot| (now.width, now.height) == size && now.is_drawn();
        session.wait_for("a picture of the new size", fits);
    }
    for _ in 0..3 {
        session.show(false);
        session.show(true);
    }
    session.show(false);
    sleep(STILL);
    session.show(true);
    let shown = session.wait_for("a picture", Screenshot::is_drawn);
    session.wait_for("another picture", |now| now.is_drawn() && now.difference(&shown) > 0);
    session.close();
}

#[test]
#[ignore = "needs Xvfb and a graphics adapter; .ci/run has them"]
fn a_minimized_window_draws_nothing_and_needs_no_more_memory() {
    let desktop = Desktop::start();
    let mut session = desktop.open(&["--objects", "300", "--size", "640x480"]);
    session.minimize(true);
    let hidden = session.wait_until_still();
    let before = session.memory();
    sleep(2 * STILL);
    let more = session.memory().saturating_sub(before);
    assert!(more < 10_000_000, "{more} bytes");
    session.minimize(false);
    session.wait_for("another picture", |now| now.difference(&hidden) > 0);
    session.close();
}

#[test]
#[ignore = "needs Xvfb and a graphics adapter; .ci/run has them"]
fn a_window_that_is_destroyed_leaves_its_run_the_rest() {
    let desktop = Desktop::start();
    let folder = tempfile::tempdir().expect("a temporary folder");
    let picture = folder.path().join("picture.png");
    let picture = picture.to_str().expect("a plain path");
    let asked = ["--objects", "20", "--frames", "2000", "--window", "--size", "320x240"];
    let session = desktop.open(&[&asked[..], &["--picture", picture]].concat());
    assert_eq!(session.destroy()["frames"], 2_000);
}

#[test]
#[ignore = "needs Xvfb and a graphics adapter; .ci/run has them"]
fn odd_sizes() {
    let desktop = Desktop::start();
    for size in ["1x1", "16384x1", "1x4000"] {
        let session = desktop.open(&["--objects", "5", "--size", size]);
        session.close();
    }
}

#[test]
#[ignore = "needs Xvfb; .ci/run has it"]
fn a_display_without_adapter() {
    let desktop = Desktop::start();
    let few = ["--objects", "5", "--frames", "5"];
    let lacking =
        [(NO_ADAPTERS[0], &[][..]), (NO_ADAPTERS[1], &[]), (&[], &["--adapter", "nonsense"])];
    for (environment, args) in lacking {
        let run = |more: &[&str]| {
            let mut command = desktop.command(&[&few[..], args, more].concat());
            command.envs(environment.iter().copied()).output().expect("the program starts")
        };
        let simulated = run(&[]);
        told(&simulated, 0, "no graphics adapter");
        assert!(String::from_utf8_lossy(&simulated.stdout).contains("state hash"));
        told(&run(&["--window"]), 3, "no graphics adapter");
    }
}

#[test]
#[ignore = "needs Xvfb; .ci/run has it"]
fn a_display_without_libraries() {
    let desktop = Desktop::start();
    for name in ["libxcb", "libxkbcommon-x11"] {
        // What is here is loaded before any other of the name.
        let folder = tempfile::tempdir().expect("a temporary folder");
        for end in [".so", ".so.0", ".so.1"] {
            let file = folder.path().join(name.to_owned() + end);
            std::fs::write(file, "no library").expect("it can be written");
        }
        let run = |args: &[&str]| {
            let few = ["--objects", "5", "--frames", "5"];
            let mut command = desktop.command(&[&few, args].concat());
            command.env("LD_LIBRARY_PATH", folder.path()).output().expect("the program starts")
        };
        told(&run(&[]), 0, "running without a window");
        told(&run(&["--window"]), 3, "");
    }
}
