//! What is said on standard error.

use std::io::{self, Write};
use std::process::ExitCode;
use std::sync::atomic::{AtomicU8, Ordering};

use super::error::RunError;
use super::{one_line, with_causes};

/// What is said on standard error, and the status that the program is to end with: the greatest of all that
/// went wrong.
#[derive(Default)]
pub(super) struct Told(AtomicU8);

impl Told {
    /// Says in a line what the person at the terminal should know.
    pub(super) fn note(&self, line: &str) {
        // With nobody to be told the run goes on.
        let _told = writeln!(io::stderr(), "dualframe: {}", one_line(line));
    }

    /// The program is to end with this status, or a greater one.
    pub(super) fn end_with(&self, status: u8) {
        // Relaxed, as is the load: nothing else goes by it.
        self.0.fetch_max(status, Ordering::Relaxed);
    }

    /// Says what went wrong.
    pub(super) fn failure(&self, error: &RunError) {
        self.note(&with_causes(error));
        self.end_with(error.status());
    }

    /// What came of something without which the run goes on; says it if that is an error.
    pub(super) fn attempt<T>(&self, result: Result<T, RunError>) -> Option<T> {
        result.inspect_err(|error| self.failure(error)).ok()
    }

    pub(super) fn status(&self) -> ExitCode {
        ExitCode::from(self.0.load(Ordering::Relaxed))
    }
}
