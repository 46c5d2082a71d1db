//! The program: arguments in, a run, a report out.

mod args;
mod craniotomy;
mod error;
mod experiment;
mod haptics;
mod manage;
mod measure;
mod operator;
mod outputs;
mod particles;
mod pictures;
mod progress;
mod recording;
mod replay;
mod report;
mod scenes;
mod window;

use std::error::Error;
use std::process::ExitCode;

use dualframe_sim::device::thread::LoopError;

use self::args::{CraniotomyArgs, ExperimentArgs, Outcome, Particles, ReplayArgs};
use self::error::RunError;
use self::outputs::Outputs;
use self::report::Report;
use self::scenes::Patient;

/// Counts the heap allocations made so far.
pub(crate) type AllocationCounter<'a> = &'a dyn Fn() -> usize;

/// Status of a run that was not sound.
const UNSOUND: u8 = 1;
/// Status of a run that could not be drawn as asked for.
const NO_PICTURE: u8 = 3;
/// Status of a bad argument or file.
const BAD_ARGUMENT: u8 = 2;

/// Runs the program; see the README for its exit statuses.
pub(crate) fn main(allocations: AllocationCounter<'_>) -> ExitCode {
    match args::parse() {
        Outcome::Run(particles) => run_particles(&particles, allocations),
        Outcome::Operate(args) => operate(&args, allocations),
        Outcome::Replay(args) => run_replay(&args),
        Outcome::Experiment(args) => run_experiments(&args),
        Outcome::Told => ExitCode::SUCCESS,
        Outcome::Bad(line) => fail(&line, BAD_ARGUMENT),
    }
}

fn run_experiments(args: &ExperimentArgs) -> ExitCode {
    if let Err(line) = experiment::prepare(&args.out) {
        return fail(&line, BAD_ARGUMENT);
    }
    match experiment::run(args) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => fail(&with_causes(&error), UNSOUND),
    }
}

fn run_replay(args: &ReplayArgs) -> ExitCode {
    let json = match args.json.as_deref().map(outputs::open).transpose() {
        Ok(json) => json,
        Err(line) => return fail(&line, BAD_ARGUMENT),
    };
    let told = |error| format!("{}: {}", args.file.display(), with_causes(error));
    let report = match replay::run(args) {
        Ok(report) => report,
        Err(error) => return fail(&told(&error), BAD_ARGUMENT),
    };
    report.print();
    if let Some(json) = &json
        && let Err(line) = report.write(json)
    {
        return fail(&line, UNSOUND);
    }
    match &report.fault {
        Some(fault) => fail(&told(fault), UNSOUND),
        None => ExitCode::SUCCESS,
    }
}

fn run_particles(particles: &Particles, allocations: AllocationCounter<'_>) -> ExitCode {
    let outputs = match Outputs::open(&particles.products) {
        Ok(outputs) => outputs,
        Err(line) => return fail(&line, BAD_ARGUMENT),
    };
    let note = |line: &str| eprintln!("dualframe: {line}");
    let report = match particles::run(particles, &outputs, allocations, &note) {
        Ok(report) => report,
        Err(RunError::Graphics(error)) => return fail(&with_causes(&error), NO_PICTURE),
        Err(error) => return fail(&with_causes(&error), UNSOUND),
    };
    tell(&report, &outputs)
}

fn operate(args: &CraniotomyArgs, allocations: AllocationCounter<'_>) -> ExitCode {
    let outputs = match Outputs::open(&args.products) {
        Ok(outputs) => outputs,
        Err(line) => return fail(&line, BAD_ARGUMENT),
    };
    // It is written anew at the end; that it can be is known now.
    if let Err(line) = args.save.as_deref().map(outputs::open).transpose() {
        return fail(&line, BAD_ARGUMENT);
    }
    let patient = match Patient::new(args.ct.as_deref()) {
        Ok(patient) => patient,
        Err(error) => return fail(&with_causes(&error), BAD_ARGUMENT),
    };
    let note = |line: &str| eprintln!("dualframe: {line}");
    match craniotomy::run(args, &patient, &outputs, allocations, &note) {
        Ok(report) => tell(&report, &outputs),
        Err(RunError::Graphics(error)) => fail(&with_causes(&error), NO_PICTURE),
        Err(RunError::Haptics(error @ LoopError::Rate { .. })) => {
            fail(&with_causes(&error), BAD_ARGUMENT)
        }
        Err(error) => fail(&with_causes(&error), UNSOUND),
    }
}

/// Prints and writes a report.
fn tell(report: &Report, outputs: &Outputs) -> ExitCode {
    report.print();
    if let Some(json) = &outputs.json
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
