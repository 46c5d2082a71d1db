//! The paper's experiments (§7–§8): Eqs. 2–4, Figs. 11–18 and Table 1 on this machine.
//!
//! Whatever is compared runs interleaved in one process, in rounds whose order rotates, with a
//! [`calibrator`] beside each round. Rounds in a bad phase of the machine are marked and counted, never
//! dropped: results are given over all rounds and over the good ones. The runs of a race must end in
//! the same state, bit for bit.
//!
//! | paper | module |
//! |---|---|
//! | §7.2, Eqs. 2–4 | [`speedup`] |
//! | §7.2.1, Figs. 11–13 | [`Experiment::Scalability`] |
//! | §7.2.2, Fig. 14, Table 1 | [`Experiment::LoadBalance`] |
//! | §7.2.2, Fig. 15 | [`Experiment::PerFrame`] |
//! | §7.2.3, Figs. 16 and 17 | [`Experiment::Compare`] |
//! | §7.2.3, Fig. 18 | [`Experiment::Retraction`] |

pub mod calibrator;
mod compare;
pub mod error;
pub mod figure;
pub mod folder;
pub mod load;
mod load_balance;
pub mod machine;
pub mod outcome;
mod page;
mod per_frame;
pub mod plan;
pub mod race;
mod scalability;
pub mod speedup;
pub mod statistics;
pub mod subject;
pub mod table;
pub mod timing;
mod work;

use std::path::Path;

use self::calibrator::Calibrator;
use self::error::ExperimentError;
use self::figure::Figure;
use self::load::StandIn;
use self::machine::Machine;
use self::outcome::Outcome;
use self::plan::Plan;
use self::race::{OnFrame, Race, Runner, WARM_UP};
use self::subject::Subject;
use self::table::Table;

/// The name of the page.
pub const PAGE: &str = "index.html";

/// The paper's experiments.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Experiment {
    /// Throughput, speed-up and efficiency by numbers of objects and threads.
    Scalability,
    /// How long each worker works in each stage.
    LoadBalance,
    /// Collisions and speed-up of each frame.
    PerFrame,
    /// The pipeline against every other executor, with particles.
    Compare,
    /// The same with automated retraction in a craniotomy.
    Retraction,
}

impl Experiment {
    /// All of them, in the paper's order.
    pub const ALL: [Self; 5] =
        [Self::Scalability, Self::LoadBalance, Self::PerFrame, Self::Compare, Self::Retraction];

    /// The name by which the program knows it.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Scalability => "scalability",
            Self::LoadBalance => "load-balance",
            Self::PerFrame => "per-frame",
            Self::Compare => "compare",
            Self::Retraction => "retraction",
        }
    }

    /// How much work it is, in particles updated.
    #[must_use]
    pub fn work(self, plan: &Plan) -> u64 {
        let Plan { threads, scalability, load_balance, per_frame, compare, retraction, .. } = plan;
        match self {
            Self::Scalability => {
                scalability.work((1 + threads.len()) * scalability.rounds, WARM_UP)
            }
            Self::LoadBalance => load_balance.work(load_balance.rounds, 0),
            Self::PerFrame => per_frame.work(threads.len() * per_frame.rounds, 0),
            Self::Compare => compare.work(compare::runs(threads, compare.rounds), WARM_UP),
            Self::Retraction => {
                let runs = compare::runs(&retraction.threads, retraction.rounds);
                retraction.work(runs, WARM_UP)
            }
        }
    }

    /// Whether a plan has what it takes.
    fn check(self, plan: &Plan) -> Result<(), ExperimentError> {
        let Plan { threads, scalability, load_balance, per_frame, compare, retraction, .. } = plan;
        let (threads, rounds, frames) = match self {
            Self::Scalability => (threads, scalability.rounds, scalability.frames),
            Self::LoadBalance => (threads, load_balance.rounds, load_balance.frames),
            Self::PerFrame => (threads, per_frame.rounds, per_frame.frames),
            Self::Compare => (threads, compare.rounds, compare.frames),
            Self::Retraction => (&retraction.threads, retraction.rounds, retraction.frames),
        };
        let takes = match self {
            _ if threads.first() != Some(&1) => "numbers of threads, from 1 upwards",
            _ if rounds == 0 => "a round",
            _ if frames == 0 => "a frame",
            Self::Scalability if scalability.objects.is_empty() => "a number of objects",
            Self::LoadBalance if load_balance.objects.is_empty() => "a number of objects",
            Self::PerFrame if per_frame.objects.len() != 1 => "one number of objects",
            Self::Compare if compare.objects.len() != 2 => "two numbers of objects",
            _ => return Ok(()),
        };
        Err(ExperimentError::Plan { experiment: self, takes })
    }

    fn run(self, laboratory: &mut Laboratory<'_>) -> Result<Report, ExperimentError> {
        match self {
            Self::Scalability => scalability::run(laboratory),
            Self::LoadBalance => load_balance::run(laboratory),
            Self::PerFrame => per_frame::run(laboratory),
            Self::Compare => compare::particles(laboratory),
            Self::Retraction => compare::retraction(laboratory),
        }
    }
}

/// What an experiment found.
#[derive(Clone, Debug, PartialEq)]
pub struct Report {
    /// What was measured.
    pub tables: Vec<Table>,
    /// What it looks like.
    pub figures: Vec<Figure>,
    /// A table that the page shows, if there is one.
    pub shown: Option<Shown>,
}

/// A table on the page.
#[derive(Clone, Debug, PartialEq)]
pub struct Shown {
    /// What it shows.
    pub title: String,
    /// Its rows.
    pub table: Table,
    /// What the paper says of it, on its machine of six cores.
    pub paper: &'static str,
}

/// What experiments found.
#[derive(Debug)]
pub struct Findings {
    /// One of each experiment that has ended, in their order.
    pub reports: Vec<Report>,
    /// The first file that could not be written, if any could not.
    pub written: Result<(), ExperimentError>,
    /// Why the experiment after these could not be run, or its runs were not sound, if so: there is no further one.
    pub ended: Result<(), ExperimentError>,
}

/// Runs experiments one after the other and writes into the folder `out`, which must be there: of each
/// experiment, as soon as it has ended, its tables (CSV) and figures (SVG, PNG), and the page
/// [`PAGE`] of all that have ended. `progress` is told what is running and how much work was done
/// since it was told last, in the unit of [`Experiment::work`].
///
/// A file of an earlier run is replaced, the page too: it shows nothing of that one.
///
/// # Errors
/// A plan lacks something, or the folder takes no new files. An experiment that fails costs no earlier one, and a file
/// that cannot be written no other: see [`Findings`].
pub fn run(
    experiments: &[Experiment],
    plan: &Plan,
    out: &Path,
    progress: &mut dyn FnMut(Experiment, u64),
) -> Result<Findings, ExperimentError> {
    experiments.iter().try_for_each(|experiment| experiment.check(plan))?;
    folder::check(out)?;
    let machine = Machine::this();
    let calibrator = Calibrator::default();
    let (mut reports, mut written) = (Vec::new(), Ok(()));
    let mut write = |name: &str, extension: &str, bytes: &[u8]| {
        let path = out.join(name).with_extension(extension);
        if let Err(source) = folder::replace(&path, bytes)
            && written.is_ok()
        {
            written = Err(ExperimentError::Write { path, source });
        }
    };
    for &experiment in experiments {
        let mut progress = |work| progress(experiment, work);
        let mut laboratory = Laboratory { plan, calibrator, progress: &mut progress };
        let report = match experiment.run(&mut laboratory) {
            Ok(report) => report,
            Err(error) => return Ok(Findings { reports, written, ended: Err(error) }),
        };
        for table in &report.tables {
            write(table.name, "csv", table.csv().as_bytes());
        }
        for figure in &report.figures {
            write(figure.name, "svg", figure.svg.as_bytes());
            write(figure.name, "png", &figure.png);
        }
        reports.push(report);
        write(PAGE, "html", page::page(&machine, plan, &reports).as_bytes());
    }
    Ok(Findings { reports, written, ended: Ok(()) })
}

/// What experiments are run with.
struct Laboratory<'a> {
    plan: &'a Plan,
    calibrator: Calibrator,
    progress: &'a mut dyn FnMut(u64),
}

impl Laboratory<'_> {
    fn race(&mut self, race: Race, runners: &[Runner]) -> Result<Outcome, ExperimentError> {
        self.race_observed(race, runners, &mut |_, _, _| ())
    }

    fn race_observed(
        &mut self,
        race: Race,
        runners: &[Runner],
        on_frame: &mut OnFrame<'_>,
    ) -> Result<Outcome, ExperimentError> {
        let work = race.subject.work() * (race.warm_up + race.frames);
        let calibrator = self.calibrator;
        let mut phase = || calibrator.phase();
        let mut done = || self.advance(work);
        race.observed(runners, &mut phase, &mut done, on_frame)
    }

    /// What stands in for rendering a subject, calibrated in so many rounds.
    fn stand_in(
        &mut self,
        subject: &Subject,
        frames: u64,
        rounds: usize,
    ) -> Result<StandIn, ExperimentError> {
        let work = subject.work() * (WARM_UP + frames);
        let calibrator = self.calibrator;
        let (mut phase, mut done) = (|| calibrator.phase(), || self.advance(work));
        StandIn::calibrated(subject, frames, rounds..=rounds, &mut phase, &mut done)
    }

    fn advance(&mut self, work: u64) {
        (self.progress)(work);
    }
}
