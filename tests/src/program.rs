//! The `dualframe` program from outside.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::sync::OnceLock;

use serde_json::Value;

/// The program. Cargo builds binaries only for the tests of their own package, so this builds it
/// once, by the cargo that runs the tests.
///
/// # Panics
/// It cannot be built.
pub fn program() -> &'static Path {
    static PROGRAM: OnceLock<PathBuf> = OnceLock::new();
    PROGRAM.get_or_init(|| {
        let built = Command::new(env!("CARGO"))
            .args(["build", "--quiet", "--bin", "dualframe", "-p", "dualframe-render-wgpu"])
            // With the features that the tests ask of libraries: nothing is built twice.
            .args(["-p", "dualframe-tests"])
            .args(["--message-format", "json-render-diagnostics"])
            .current_dir(concat!(env!("CARGO_MANIFEST_DIR"), "/.."))
            .output()
            .expect("cargo runs");
        assert!(built.status.success(), "{}", String::from_utf8_lossy(&built.stderr));
        let messages = String::from_utf8(built.stdout).expect("cargo speaks UTF-8");
        let parsed = messages.lines().filter_map(|line| serde_json::from_str::<Value>(line).ok());
        let mut executables =
            parsed.filter_map(|message| message["executable"].as_str().map(Into::into));
        executables.next_back().expect("cargo names the executable")
    })
}

/// The program with arguments, where there is no display that the environment names.
#[must_use]
pub fn command(args: &[&str]) -> Command {
    let mut command = Command::new(program());
    command.args(args);
    for display in ["DISPLAY", "WAYLAND_DISPLAY", "WAYLAND_SOCKET"] {
        command.env_remove(display);
    }
    command
}

/// Environments in which there is no graphics adapter: no driver, or only those of another system are asked.
pub const NO_ADAPTERS: [&[(&str, &str)]; 2] = [
    &[
        ("VK_DRIVER_FILES", "/nonexistent"),
        ("VK_ICD_FILENAMES", "/nonexistent"),
        ("__EGL_VENDOR_LIBRARY_FILENAMES", "/nonexistent"),
    ],
    &[("WGPU_BACKEND", "dx12")],
];

/// What the program says to arguments.
///
/// # Panics
/// It cannot be started.
#[must_use]
pub fn run(args: &[&str]) -> Output {
    command(args).output().expect("the program starts")
}

/// The JSON report of a run without a window.
///
/// # Panics
/// The run is not sound, or there is no report.
#[must_use]
pub fn report(args: &[&str]) -> Value {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let file = folder.path().join("report.json");
    let json = file.to_str().expect("a plain path");
    let output = run(&[args, &["--headless", "--json", json]].concat());
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    read_json(&file)
}

/// A JSON file that the program wrote.
///
/// # Panics
/// There is none.
#[must_use]
pub fn read_json(file: &Path) -> Value {
    let text = std::fs::read_to_string(file).expect("the file was written");
    serde_json::from_str(&text).expect("it is JSON")
}

/// Sees that the program ended with this status and said one line on standard error that holds `part`.
///
/// # Panics
/// It did not.
pub fn told(output: &Output, status: i32, part: &str) {
    let told = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(status), "{told}");
    assert_eq!(told.lines().count(), 1, "{told}");
    assert!(told.contains(part), "no {part:?} in {told}");
}
