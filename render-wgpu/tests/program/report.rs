//! The program from outside: its report, and what it says to bad input.

use std::path::Path;

use crate::command::{command, report, run, told};

/// Exit status 2, one line on standard error that holds `part`, nothing on standard output.
fn refused(args: &[&str], part: &str) {
    let output = run(args);
    told(&output, 2, part);
    assert!(output.stdout.is_empty(), "{args:?} did some work");
}

#[test]
fn report_has_every_key() {
    let report = report(&["particles", "--objects", "40", "--frames", "50", "--threads", "2"]);
    let keys = [
        "scene",
        "executor",
        "threads",
        "simd",
        "objects",
        "nodes",
        "springs",
        "frames",
        "seed",
        "seconds",
        "fps",
        "frames_measured",
        "frame_ms",
        "candidates",
        "collisions",
        "state_hash",
        "allocations",
        "stage_seconds",
        "quarantined",
        "non_finite",
    ];
    for key in keys {
        assert!(!report[key].is_null(), "{key}");
    }
    for key in ["p50", "p99", "p999", "max"] {
        assert!(report["frame_ms"][key].as_f64().is_some_and(|time| time > 0.0), "{key}");
    }
    let workers = report["stage_seconds"].as_array().expect("one for each worker");
    assert_eq!(workers.len(), 2);
    for key in ["broad_phase", "interaction", "update", "render", "idle"] {
        assert!(workers[0][key].is_number(), "{key}");
    }
    assert_eq!((&report["nodes"], &report["springs"]), (&(40 * 42).into(), &(40 * 162).into()));
    assert_eq!(report["collisions"].as_array().map(Vec::len), Some(50));
    assert_eq!(report["state_hash"].as_str().map(str::len), Some(16));
}

#[test]
fn no_allocation_once_warm() {
    // With 300 particles blocks have as many as they ever have.
    for (objects, extra) in [
        ("120", ["--threads", "1"]),
        ("120", ["--threads", "3"]),
        ("300", ["--threads", "4"]),
        ("120", ["--broad-phase", "pairwise"]),
    ] {
        let args = [&["--objects", objects, "--frames", "300", "--gravity"][..], &extra].concat();
        assert_eq!(report(&args)["allocations"], 0, "{objects} {extra:?}");
    }
}

#[test]
fn every_executor_says_the_same() {
    let hash = |executor: &str| {
        let args = ["--objects", "30", "--frames", "40", "--threads", "2", "--executor", executor];
        let report = report(&args);
        assert_eq!(report["executor"], executor);
        let overlaps = ["pipeline", "rayon-overlapped"].contains(&executor);
        assert_eq!(report["frames_in_flight"], if overlaps { 2 } else { 1 }, "{executor}");
        report["state_hash"].as_str().map(str::to_owned)
    };
    let first = hash("pipeline");
    for executor in ["serial", "static", "rayon", "rayon-overlapped"] {
        assert_eq!(hash(executor), first, "{executor}");
    }
}

#[test]
fn vector_instructions_change_no_result() {
    let mut hashes = Vec::new();
    for name in ["scalar", "avx2", "avx512"] {
        let args = ["--objects", "30", "--frames", "40", "--gravity", "--simd", name];
        match dualframe_sim::simd::Instructions::ALL.into_iter().find(|all| all.name() == name) {
            Some(there) if dualframe_sim::simd::Simd::new(there).is_ok() => {
                let report = report(&args);
                assert_eq!(report["simd"], name);
                hashes.push(report["state_hash"].clone());
            }
            _ => refused(&args, name),
        }
    }
    assert!(hashes.iter().all(|hash| *hash == hashes[0]), "{hashes:?}");
}

#[test]
fn bad_arguments() {
    refused(&["--objects", "0"], "--objects");
    refused(&["--objects", "banana"], "banana");
    refused(&["--objects", "-3"], "-3");
    refused(&["--objects", "99999999999999999999999"], "--objects");
    refused(&["--objects", "99995"], "99994");
    refused(&["--objects", "4091", "--broad-phase", "pairwise"], "4090");
    refused(&["--threads", "0"], "--threads");
    refused(&["--threads", "257"], "256");
    refused(&["--frames", "0"], "--frames");
    refused(&["--frames-in-flight", "3"], "--frames-in-flight");
    refused(&["--executor", "magic"], "magic");
    refused(&["--simd", "magic"], "magic");
    refused(&["--executor", "openmp-static"], "native-peers");
    refused(&["--nonsense"], "--nonsense");
    refused(&["nonsense"], "nonsense");
    refused(&["--window", "--headless"], "--window");
    for size in ["0x0", "640x0", "20000x20000", "640", "x", "640x480x3"] {
        refused(&["--offscreen", "--size", size], size);
    }
    refused(&["--json", "/no/such/folder/report.json"], "/no/such/folder/report.json");
}

#[test]
fn bad_files() {
    for option in ["--json", "--picture", "--trace"] {
        refused(&[option, "/no/such/folder/file"], "/no/such/folder/file");
        refused(&[option, "/proc"], "/proc");
    }
    // Nobody can make a folder or a file there.
    refused(&["--frames-out", "/proc/pictures"], "/proc/pictures");
    refused(&["--frames-out", "/proc"], "/proc");
    // A run that cannot be keeps what is in a file.
    let folder = tempfile::tempdir().expect("a temporary folder");
    let file = folder.path().join("file");
    std::fs::write(&file, "precious").expect("it can be written");
    let text = file.to_str().expect("a plain path");
    refused(&["--picture", text, "--trace", "/no/such/folder/trace"], "/no/such/folder/trace");
    refused(&["--frames-out", text], text);
    assert_eq!(std::fs::read_to_string(&file).ok().as_deref(), Some("precious"));
}

#[test]
fn a_pipe_is_a_file_too() {
    let output = run(&["--headless", "--objects", "5", "--frames", "5", "--json", "/dev/stdout"]);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let printed = String::from_utf8(output.stdout).expect("plain text");
    let json = printed.lines().last().map(serde_json::from_str::<serde_json::Value>);
    assert!(json.is_some_and(|json| json.is_ok_and(|json| json["objects"] == 5)), "{printed}");
}

#[test]
fn bad_experiments() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let file = folder.path().join("file");
    std::fs::write(&file, "precious").expect("it can be written");
    let text = file.to_str().expect("a plain path");
    refused(&["experiment", "all", "--quick", "--out", text], text);
    let below = format!("{text}/below");
    refused(&["experiment", "compare", "--out", &below], &below);
    assert_eq!(std::fs::read_to_string(&file).ok().as_deref(), Some("precious"));
    // Nobody can make a folder or a file there.
    refused(&["experiment", "compare", "--out", "/proc/experiments"], "/proc/experiments");
    refused(&["experiment", "compare", "--out", "/proc"], "/proc");

    let out = folder.path().join("out");
    let out = out.to_str().expect("a plain path");
    refused(&["experiment", "nonsense", "--out", out], "nonsense");
    refused(&["experiment", "all", "--nonsense", "--out", out], "--nonsense");
    refused(&["experiment", "all", "more", "--out", out], "more");
    refused(&["experiment", "compare", "--scene", "nonsense", "--out", out], "nonsense");
    refused(&["experiment", "per-frame", "--scene", "craniotomy", "--out", out], "--scene");
    refused(&["experiment", "all"], "--out");
    refused(&["experiment", "--out", out], "WHICH");
    assert!(!Path::new(out).exists());
}

#[test]
fn help_states_the_limits() {
    let output = run(&["--help"]);
    let help = String::from_utf8_lossy(&output.stdout);
    assert!(output.status.success());
    for limit in ["99994", "256", "10000000", "4090"] {
        assert!(help.contains(limit), "{limit} in {help}");
    }
}

#[test]
fn a_closed_pipe_is_no_panic() {
    let mut child = command(&["--headless", "--objects", "5", "--frames", "5"])
        .stdout(std::process::Stdio::piped())
        .spawn()
        .expect("the program starts");
    drop(child.stdout.take());
    assert!(child.wait().expect("it ends").success());
    if let Ok(full) = std::fs::OpenOptions::new().write(true).open("/dev/full") {
        let ended = command(&["--objects", "0"]).stderr(full).status().expect("the program starts");
        assert_eq!(ended.code(), Some(2));
    }
}
