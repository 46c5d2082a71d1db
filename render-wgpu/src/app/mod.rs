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
mod told;
mod window;

use std::error::Error;
use std::process::ExitCode;

use dualframe_sim::experiment::Findings;

use self::args::{CraniotomyArgs, ExperimentArgs, Outcome, Particles, ReplayArgs};
use self::error::RunError;
use self::outputs::{Output, Outputs};
use self::report::Report;
use self::scenes::Patient;
use self::told::Told;

/// Counts the heap allocations made so far.
pub(crate) type AllocationCounter<'a> = &'a (dyn Fn() -> usize + Sync);

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
    let told = Told::default();
    match experiment::run(args) {
        Ok(Findings { reports, written, ended }) => {
            if !reports.is_empty() {
                told.attempt(experiment::print(&reports, written.is_ok(), args));
            }
            for error in [written, ended].into_iter().filter_map(Result::err) {
                told.note(&with_causes(&error));
                told.end_with(UNSOUND);
            }
        }
        Err(error) => return fail(&with_causes(&error), UNSOUND),
    }
    told.status()
}

fn run_replay(args: &ReplayArgs) -> ExitCode {
    let json = match args.json.as_deref().map(Output::open).transpose() {
        Ok(json) => json,
        Err(line) => return fail(&line, BAD_ARGUMENT),
    };
    let line = |error| format!("{}: {}", args.file.display(), with_causes(error));
    let report = match replay::run(args, json.as_ref()) {
        Ok(report) => report,
        Err(error) => return fail(&line(&error), error.status()),
    };
    let told = Told::default();
    told.attempt(report.print());
    if let Some(json) = &json {
        told.attempt(report.write(json));
    }
    if let Some(fault) = &report.fault {
        told.note(&line(fault));
        told.end_with(UNSOUND);
    }
    told.status()
}

fn run_particles(particles: &Particles, allocations: AllocationCounter<'_>) -> ExitCode {
    let outputs = match Outputs::open(&particles.products, None, None) {
        Ok(outputs) => outputs,
        Err(line) => return fail(&line, BAD_ARGUMENT),
    };
    let told = Told::default();
    let report = particles::run(particles, &outputs, allocations, &told);
    end(report, &outputs, &told)
}

fn operate(args: &CraniotomyArgs, allocations: AllocationCounter<'_>) -> ExitCode {
    let (save, input) = (args.save.as_deref(), args.ct.as_deref());
    let outputs = match Outputs::open(&args.products, save, input) {
        Ok(outputs) => outputs,
        Err(line) => return fail(&line, BAD_ARGUMENT),
    };
    let patient = match Patient::new(input, outputs.record.is_some()) {
        Ok(patient) => patient,
        Err(error) => return fail(&with_causes(&error), BAD_ARGUMENT),
    };
    let told = Told::default();
    let report = craniotomy::run(args, &patient, &outputs, allocations, &told);
    end(report, &outputs, &told)
}

/// Prints and writes what came of a run.
fn end(report: Result<Report, RunError>, outputs: &Outputs, told: &Told) -> ExitCode {
    if let Some(report) = told.attempt(report) {
        told.attempt(report.print());
        if let Some(json) = &outputs.json {
            told.attempt(report.write(json));
        }
        if !report.is_sound() {
            told.end_with(UNSOUND);
        }
    }
    told.status()
}

/// An error and what it came from, in one line. What an error says of its cause is said once.
fn with_causes(error: &dyn Error) -> String {
    let said = error.to_string();
    match error.source().map(with_causes) {
        Some(cause) if !said.ends_with(&cause) => format!("{said}: {cause}"),
        _ => said,
    }
}

fn fail(line: &str, status: u8) -> ExitCode {
    let told = Told::default();
    told.note(line);
    told.end_with(status);
    told.status()
}

/// Text, which may be a file's or its name, as it can stand in one line: without line breaks and escape codes.
fn one_line(text: &str) -> String {
    let shown = |letter: char| match letter.is_control() {
        true => letter.escape_default().collect(),
        false => String::from(letter),
    };
    text.chars().map(shown).collect()
}
