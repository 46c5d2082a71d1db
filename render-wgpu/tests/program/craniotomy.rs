//! `dualframe craniotomy`: what it reports, what it refuses, and that what it records comes back.

use std::ffi::OsStr;
use std::fs;

use crate::command::{command, read_json, run, told};
use dualframe_sim::image::{Image, save};
use dualframe_sim::scene::head::synthetic_ct;

#[test]
fn an_operation_is_reported_recorded_and_saved() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let file = |name: &str| folder.path().join(name).to_str().expect("a plain path").to_owned();
    let (json, record, save) = (file("report.json"), file("session"), file("after.nii.gz"));
    let args =
        ["craniotomy", "--step", "incision", "--frames", "130", "--headless", "--threads", "2"];
    let written = ["--json", &json, "--record", &record, "--save", &save];
    let output = run(&[&args[..], &written].concat());
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let report = read_json(json.as_ref());
    assert_eq!((&report["scene"], &report["step"]), (&"craniotomy".into(), &"incision".into()));
    assert_eq!((&report["objects"], &report["frames"]), (&30.into(), &130.into()));
    assert_eq!((&report["pieces"], &report["bone_removed_mm3"]), (&0.into(), &0.0.into()));
    assert!(report["score"]["seconds"].as_f64().is_some_and(|seconds| seconds > 2.0));
    // Nothing was drilled.
    let after = Image::open(save.as_ref()).expect("it was written");
    let before = synthetic_ct().expect("it has no file");
    assert!(after.voxels() == before.voxels());
    for way in [["--threads", "1"], ["--executor", "static"]] {
        let output = run(&[&["replay", &record, "--json", &json], &way[..]].concat());
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        assert_eq!(read_json(json.as_ref())["state_hash"], report["state_hash"], "{way:?}");
    }
}

/// Recorded in the image's folder, by its name there, and replayed in another.
#[test]
fn a_recording_finds_its_image() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let ct = synthetic_ct().expect("it has no file");
    save(&folder.path().join("ct.nii.gz"), ct.grid(), ct.voxels()).expect("it can be written");
    let record = ["craniotomy", "--headless", "--frames", "1", "--record", "session"];
    let recorded = |ct: &OsStr| {
        let mut command = command(&record);
        command.arg("--ct").arg(ct).current_dir(folder.path()).output().expect("it starts")
    };
    let output = recorded("ct.nii.gz".as_ref());
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let session = folder.path().join("session");
    let output = run(&["replay", session.to_str().expect("a plain path")]);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    #[cfg(unix)]
    {
        use std::os::unix::ffi::OsStrExt;

        let before = fs::read(&session).expect("it was written");
        told(&recorded(OsStr::from_bytes(b"ct\xff.nii.gz")), 2, "cannot be recorded");
        assert!(fs::read(&session).expect("it is there") == before, "it was recorded over");
    }
}

/// Simulated hands cut the scalp, which holds them back, to the same bits whoever computes.
#[test]
fn simulated_hands_operate() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let json = folder.path().join("report.json");
    let operate = |way: [&str; 4]| {
        let args = ["craniotomy", "--simulated-devices", "--step", "incision", "--frames", "130"];
        let json = ["--json", json.to_str().expect("a plain path")];
        let output = run(&[&args[..], &way, &json].concat());
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        read_json(json[1].as_ref())
    };
    let report = operate(["--executor", "pipeline", "--threads", "2"]);
    let other = operate(["--executor", "rayon-overlapped", "--threads", "2"]);
    for key in ["state_hash", "haptics"] {
        assert_eq!(report[key], other[key], "{key}");
    }
    let [cutting, other] = [0, 1].map(|hand| &report["haptics"][hand]);
    assert_eq!((&cutting["ticks"], &other["ticks"]), (&2_166.into(), &2_166.into()));
    assert!(cutting["absorbed_j"].as_f64() > Some(0.001), "{cutting}");
    let refused = |args: &[&str], expected: &str| {
        told(&run(&[&["craniotomy", "--simulated-devices"], args].concat()), 2, expected);
    };
    refused(&["--window"], "--window");
    refused(&["--haptic-rate", "99"], "100 to 4000");
    refused(&["--haptic-rate", "100"], "500 to 4000 Hz");
}

#[test]
fn figures_of_haptic_loops_are_printed() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let json = folder.path().join("report.json");
    let args = ["craniotomy", "--simulated-devices", "--step", "incision", "--frames", "10"];
    let output = run(&[&args[..], &["--json", json.to_str().expect("a plain path")]].concat());
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let printed = String::from_utf8_lossy(&output.stdout);
    let report = read_json(&json);
    let hands = report["haptics"].as_array().expect("one for each hand");
    assert!(!hands.is_empty());
    let lines: Vec<_> = printed.lines().filter(|line| line.starts_with("haptic loop: ")).collect();
    assert_eq!(lines.len(), hands.len(), "{printed}");
    for (line, hand) in lines.iter().zip(hands) {
        assert!(line.contains(&format!("{} ticks", hand["ticks"])), "{line}");
    }
}

/// The environment goes on in another executor whenever freed bone was looked for.
#[test]
fn seconds_of_a_drilled_hole_are_those_of_all_frames() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let json = folder.path().join("report.json");
    let args = ["craniotomy", "--step", "burr-hole", "--headless", "--threads", "2", "--json"];
    let output = run(&[&args[..], &[json.to_str().expect("a plain path")]].concat());
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let report = read_json(&json);
    assert!(report["bone_removed_mm3"].as_f64() > Some(100.0));
    let seconds = report["seconds"].as_f64().expect("a number");
    for worker in report["stage_seconds"].as_array().expect("one for each worker") {
        let stages = worker.as_object().expect("seconds by stage").values();
        let sum: f64 = stages.filter_map(serde_json::Value::as_f64).sum();
        assert!(sum > 0.7 * seconds, "{sum} of {seconds} s");
    }
}

#[test]
fn what_is_no_head_is_refused() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let file = folder.path().join("ct.nii");
    let name = file.to_str().expect("a plain path");
    let refused = |args: &[&str], expected: &str| {
        let output = run(&[&["craniotomy"], args].concat());
        told(&output, 2, expected);
        assert!(output.stdout.is_empty());
    };
    refused(&["--ct", name], "No such file");
    fs::write(&file, "no image, however long ".repeat(50)).expect("it can be written");
    refused(&["--ct", name], "neither NIfTI-1 nor NRRD");
    // A cube of water: no bone.
    let mut water = vec![0_u8; 352];
    water[..4].copy_from_slice(&348_i32.to_le_bytes());
    for (place, value) in [(40, 3_i16), (42, 20), (44, 20), (46, 20), (70, 4), (72, 16)] {
        water[place..place + 2].copy_from_slice(&value.to_le_bytes());
    }
    for (place, value) in [(80, 1.0_f32), (84, 1.0), (88, 1.0), (108, 352.0)] {
        water[place..place + 4].copy_from_slice(&value.to_le_bytes());
    }
    water[123] = 2;
    water[344..347].copy_from_slice(b"n+1");
    water.extend([0; 2 * 20 * 20 * 20]);
    fs::write(&file, water).expect("it can be written");
    refused(&["--ct", name], "bone");
    refused(&["--step", "nose"], "incision, retraction, burr-hole, flap, all");
    refused(&["--save", "/no such folder/after.nii"], "cannot write");
    refused(&["--frames", "0"], "0");
}
