//! The program: arguments in, a run, a report out.

mod args;
mod measure;
mod particles;
mod report;

use std::error::Error;
use std::process::ExitCode;

use self::args::Outcome;

/// Counts the heap allocations made so far.
pub(crate) type AllocationCounter<'a> = &'a dyn Fn() -> usize;

/// Status of a run that was not sound.
const UNSOUND: u8 = 1;
/// Status of a bad argument or file.
const BAD_ARGUMENT: u8 = 2;

/// Runs the program; see the README for its exit statuses.
pub(crate) fn main(allocations: AllocationCounter<'_>) -> ExitCode {
    let particles = match args::parse() {
        Outcome::Run(particles) => particles,
        Outcome::Told => return ExitCode::SUCCESS,
        Outcome::Bad(line) => return fail(&line, BAD_ARGUMENT),
    };
    // Opened before any work is done: an hour's run must not end in "no such folder".
    let json = match particles.json.as_deref().map(report::open).transpose() {
        Ok(json) => json,
        Err(line) => return fail(&line, BAD_ARGUMENT),
    };
    let report = match particles::run(&particles, allocations) {
        Ok(report) => report,
        Err(error) => return fail(&with_causes(&error), UNSOUND),
    };
    report.print();
    if let Some(json) = json
        && let Err(line) = report.write(json)
    {
        return fail(&line, UNSOUND);
    }
    if report.is_sound() { ExitCode::SUCCESS } else { ExitCode::from(UNSOUND) }
}

/// An error and what it came from, in one line.
fn with_causes(error: &dyn Error) -> String {
    match error.source() {
        Some(cause) => format!("{error}: {}", with_causes(cause)),
        None => error.to_string(),
    }
}

fn fail(line: &str, status: u8) -> ExitCode {
    eprintln!("dualframe: {line}");
    ExitCode::from(status)
}
