//! The program on a machine without a display, without a graphics adapter, or without both: the default
//! run simulates all the same, and what cannot draw says in one line why.
// Elsewhere the environment hides neither the display nor the adapters.
#![cfg(target_os = "linux")]

use std::process::Output;

use crate::command::{NO_ADAPTERS, command, told};

/// What a run says, of few objects and frames, with more arguments and variables of the environment.
fn run(args: &[&str], environment: &[(&str, &str)]) -> Output {
    let few = ["--objects", "5", "--frames", "5"];
    let mut command = command(&[&few, args].concat());
    command.envs(environment.iter().copied()).output().expect("the program starts")
}

/// It ran and reported, and said in one line why nothing is to be seen.
fn simulated(output: &Output, reason: &str) {
    told(output, 0, reason);
    let report = String::from_utf8_lossy(&output.stdout);
    assert!(report.contains("5 frames") && report.contains("state hash"), "{report}");
    assert!(String::from_utf8_lossy(&output.stderr).contains("--picture"));
}

/// It did nothing but say in one line why.
fn refused(output: &Output, reason: &str) {
    told(output, 3, reason);
    assert!(output.stdout.is_empty(), "{}", String::from_utf8_lossy(&output.stdout));
}

#[test]
fn no_display() {
    simulated(&run(&[], &[]), "no display");
    refused(&run(&["--window"], &[]), "no display");
    // Named, but not there.
    for display in [("DISPLAY", ":987"), ("WAYLAND_DISPLAY", "nobody")] {
        simulated(&run(&[], &[display]), "no display");
        refused(&run(&["--window"], &[display]), "no display");
    }
}

#[test]
fn no_adapter() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = |name| folder.path().join(name).to_str().expect("a plain path").to_owned();
    let (picture, frames) = (path("picture.png"), path("frames"));
    let drawing = [&["--offscreen"][..], &["--picture", &picture], &["--frames-out", &frames]];
    for environment in NO_ADAPTERS {
        for args in drawing {
            refused(&run(args, environment), "mesa-vulkan-drivers");
            refused(
                &run(&[args, &["--adapter", "any"]].concat(), environment),
                "no graphics adapter",
            );
        }
    }
}

#[test]
fn neither_display_nor_adapter() {
    for environment in NO_ADAPTERS {
        simulated(&run(&[], environment), "no display");
        refused(&run(&["--window"], environment), "no display");
    }
}

#[test]
fn an_adapter_of_no_such_name() {
    // Whether there are others or none.
    refused(&run(&["--offscreen", "--adapter", "nonsense"], &[]), "no graphics adapter");
    let from_environment = [("WGPU_ADAPTER_NAME", "nonsense")];
    refused(&run(&["--offscreen"], &from_environment), "no graphics adapter");
    // A run that draws nothing does not look for it.
    simulated(&run(&["--adapter", "nonsense"], &[]), "no display");
}
