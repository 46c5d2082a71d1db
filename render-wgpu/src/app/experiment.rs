//! `dualframe experiment`.

use std::io::{self, Write};
use std::path::Path;

use dualframe_sim::experiment::error::ExperimentError;
use dualframe_sim::experiment::machine::Machine;
use dualframe_sim::experiment::{self, Findings, PAGE, Report, folder};

use super::args::ExperimentArgs;
use super::error::RunError;
use super::outputs::{self, make_folder};
use super::{progress, with_causes};

/// Makes the folder and sees that it takes files: an hour's run must not end in "no such folder".
pub(super) fn prepare(out: &Path) -> Result<(), String> {
    make_folder(out)?;
    folder::check(out).map_err(|error| with_causes(&error))
}

/// Runs the experiments that `args` ask for.
pub(super) fn run(args: &ExperimentArgs) -> Result<Findings, ExperimentError> {
    let (experiments, plan) = (args.experiments(), args.plan());
    let work = experiments.iter().map(|experiment| experiment.work(&plan)).sum();
    let bar = progress::of_work(work);
    let findings = experiment::run(&experiments, &plan, &args.out, &mut |experiment, done| {
        bar.set_message(experiment.name());
        bar.inc(done);
    });
    bar.finish_and_clear();
    findings
}

/// Prints what was found, and where the page is if it was written.
pub(super) fn print(
    reports: &[Report],
    written: bool,
    args: &ExperimentArgs,
) -> Result<(), RunError> {
    outputs::print(|out| lines(out, reports, written, args))
}

fn lines(
    out: &mut impl Write,
    reports: &[Report],
    written: bool,
    args: &ExperimentArgs,
) -> io::Result<()> {
    writeln!(out, "{}; seed {}", Machine::this(), args.plan().seed)?;
    for figure in reports.iter().flat_map(|report| &report.figures) {
        writeln!(out, "{}: {}", figure.title, figure.finding)?;
    }
    if written {
        writeln!(out, "see {}", args.out.join(PAGE).display())?;
    }
    Ok(())
}
