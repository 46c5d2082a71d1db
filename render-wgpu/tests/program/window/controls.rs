//! What the overlay can change of how frames are run.

use crate::command::{read_json, run};
use serde_json::Value;

use super::desktop::{Desktop, Session};
use super::untouched;

/// One particle, and room for all of the overlay.
const ONE: [&str; 6] = ["--objects", "1", "--threads", "2", "--size", "640x640"];
/// The height of the overlay's rows, in pixels.
const ROW: i16 = 23;
/// Where the overlay's second column begins, and a little more.
const COLUMN: i16 = 124;
/// Less memory than a thread's stack has, in bytes.
const LITTLE: u64 = 1 << 20;

/// The program with the overlay standing still, and how high the slider of workers is.
fn paused(desktop: &Desktop) -> (Session<'_>, i16) {
    let mut session = desktop.open(&ONE);
    session.strike(' ');
    let paused = session.wait_until_still();
    let (_, workers) = *paused.sliders().last().expect("the overlay is shown");
    (session, workers)
}

/// Lets a few frames pass, closes the window, and makes sure that the state is that of so many frames run
/// in the usual way.
fn end(mut session: Session<'_>) -> Value {
    session.strike('n');
    session.wait_until_still();
    let report = session.close();
    assert_eq!(report["state_hash"], untouched(&ONE, &report["frames"]));
    report
}

#[test]
#[ignore = "needs Xvfb and a graphics adapter; .ci/run has them"]
fn workers_join_and_leave() {
    let desktop = Desktop::start();
    let (mut session, workers) = paused(&desktop);
    // The left end of the slider.
    session.click(COLUMN - 5, workers);
    assert_eq!(end(session)["threads"], 1);
}

#[test]
#[ignore = "needs Xvfb and a graphics adapter; .ci/run has them"]
fn workers_that_cannot_be_had_are_told_and_the_run_goes_on() {
    let desktop = Desktop::start();
    let (mut session, workers) = paused(&desktop);
    let paused = session.wait_until_still();
    let (right, _) = *paused.sliders().last().expect("the overlay is shown");
    session.click(right, workers);
    session.leave_room(Some(LITTLE));
    session.strike('n');
    session.wait_until_still();
    session.leave_room(None);
    session.strike('n');
    session.wait_until_still();
    let report = session.close_after("the thread pool could not be started");
    assert_eq!(report["threads"], 2);
    assert_eq!(report["state_hash"], untouched(&ONE, &report["frames"]));
}

#[test]
#[ignore = "needs Xvfb and a graphics adapter; .ci/run has them"]
fn one_frame_in_flight() {
    let desktop = Desktop::start();
    let (mut session, workers) = paused(&desktop);
    session.click(COLUMN, workers + ROW);
    assert_eq!(end(session)["frames_in_flight"], 1);
}

#[test]
#[ignore = "needs Xvfb and a graphics adapter; .ci/run has them"]
fn another_executor() {
    let desktop = Desktop::start();
    let (mut session, workers) = paused(&desktop);
    let list = workers - ROW;
    session.click(COLUMN, list);
    // The list covers what is below.
    session.click(COLUMN, list + 2 * ROW);
    assert_ne!(end(session)["executor"], "pipeline");
}

#[test]
#[ignore = "needs Xvfb and a graphics adapter; .ci/run has them"]
fn a_new_start() {
    let desktop = Desktop::start();
    let (mut session, workers) = paused(&desktop);
    // Beside the number of particles; a separator is between.
    session.click(COLUMN + 30, workers - 2 * ROW - 9);
    session.strike('n');
    session.wait_until_still();
    let report = session.close();
    assert!(report["frames"].as_u64() > Some(1), "frames before it count: {}", report["frames"]);
    assert_eq!(report["state_hash"], untouched(&ONE, &Value::from(1)));
}

#[test]
#[ignore = "needs Xvfb and a graphics adapter; .ci/run has them"]
fn what_is_set_while_time_stands_still_is_told_once() {
    let desktop = Desktop::start();
    let folder = tempfile::tempdir().expect("a temporary folder");
    let file = |name| folder.path().join(name).to_str().expect("a plain path").to_owned();
    let (recording, json) = (file("session"), file("replay.json"));
    let mut session = desktop.open(&[&ONE[..], &["--record", &recording]].concat());
    session.strike(' ');
    let paused = session.wait_until_still();
    // Below that of gravity, which is no object's.
    let (_, stiffness) = paused.sliders()[1];
    for right in [10, 20, 30] {
        session.click(COLUMN + right, stiffness);
        session.wait_until_still();
    }
    session.strike('n');
    session.wait_until_still();
    let report = session.close();
    let output = run(&["replay", &recording, "--json", &json]);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let replayed = read_json(json.as_ref());
    assert_eq!(
        (&replayed["messages"], &replayed["state_hash"]),
        (&Value::from(1), &report["state_hash"])
    );
}
