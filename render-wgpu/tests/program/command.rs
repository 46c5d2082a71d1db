//! The `dualframe` program from outside.

use std::path::Path;
use std::process::{Command, Output};

use serde_json::Value;

/// The program with arguments, where there is no display that the environment names.
pub(super) fn command(args: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_dualframe"));
    command.args(args);
    for display in ["DISPLAY", "WAYLAND_DISPLAY", "WAYLAND_SOCKET"] {
        command.env_remove(display);
    }
    // Without it drivers complain, beside what the program says.
    command.env("XDG_RUNTIME_DIR", std::env::temp_dir());
    command
}

/// Environments in which there is no graphics adapter: no driver, or only those of another system are asked.
pub(super) const NO_ADAPTERS: [&[(&str, &str)]; 2] = [
    &[
        ("VK_DRIVER_FILES", "/nonexistent"),
        ("VK_ICD_FILENAMES", "/nonexistent"),
        ("__EGL_VENDOR_LIBRARY_FILENAMES", "/nonexistent"),
    ],
    &[("WGPU_BACKEND", "dx12")],
];

/// What the program says to arguments.
pub(super) fn run(args: &[&str]) -> Output {
    command(args).output().expect("the program starts")
}

/// The JSON report of a run without a window.
pub(super) fn report(args: &[&str]) -> Value {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let file = folder.path().join("report.json");
    let json = file.to_str().expect("a plain path");
    let output = run(&[args, &["--headless", "--json", json]].concat());
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    read_json(&file)
}

/// A JSON file that the program wrote.
pub(super) fn read_json(file: &Path) -> Value {
    let text = std::fs::read_to_string(file).expect("the file was written");
    serde_json::from_str(&text).expect("it is JSON")
}

/// Sees that the program ended with this status and said one line on standard error that holds `part`.
pub(super) fn told(output: &Output, status: i32, part: &str) {
    let told = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(status), "{told}");
    assert_eq!(told.lines().count(), 1, "{told}");
    assert!(told.contains(part), "no {part:?} in {told}");
}
