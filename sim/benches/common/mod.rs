//! What the benches that time whole frames share: arguments and tables.

use std::ops::RangeInclusive;
use std::process::ExitCode;

use clap::Parser;
use clap::builder::RangedU64ValueParser;
use dualframe_sim::executor::MAX_THREADS;
use dualframe_sim::experiment::error::ExperimentError;
use dualframe_sim::experiment::machine::Machine;
use dualframe_sim::experiment::statistics::Quartiles;
use dualframe_sim::experiment::timing::{self, Rounds, Series};
use dualframe_sim::scene::ParticleScene;

/// The arguments of a bench.
#[derive(Parser)]
pub(crate) struct Arguments {
    /// Good rounds of each race; where the machine is disturbed, up to four times as many rounds are run.
    #[arg(long, value_name = "N", default_value_t = 15, value_parser = at_least_one(u64::MAX))]
    rounds: usize,
    /// Frames of each run; by default about as many as take some tenths of a second on one thread, or a second or so
    /// where objects are many or heavy.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    pub(crate) frames: Option<u64>,
    /// Numbers of particles; of no effect where there are none.
    #[arg(
        long,
        value_name = "N,N,...",
        value_delimiter = ',',
        value_parser = at_least_one(ParticleScene::MAX_OBJECTS as u64),
    )]
    pub(crate) objects: Vec<usize>,
    /// Threads of the parallel executors; of no effect where there are none.
    #[arg(long, value_name = "N", default_value_t = 2, value_parser = at_least_one(MAX_THREADS as u64))]
    pub(crate) threads: usize,
    /// See only whether it runs.
    #[arg(long)]
    pub(crate) test: bool,
    /// What cargo adds.
    #[arg(long, hide = true)]
    bench: bool,
}

fn at_least_one(most: u64) -> RangedU64ValueParser<usize> {
    RangedU64ValueParser::new().range(1..=most)
}

impl Arguments {
    /// How many rounds a race has: see [`Race::rounds`](dualframe_sim::experiment::race::Race::rounds).
    pub(crate) fn rounds(&self) -> RangeInclusive<usize> {
        if self.test { 1..=1 } else { timing::until_good(self.rounds, &Machine::this()) }
    }

    /// Numbers of particles: those asked for, or else `usual`.
    #[allow(dead_code, reason = "not every bench is of particles")]
    pub(crate) fn objects_or(&self, usual: &[usize]) -> Vec<usize> {
        if self.test {
            vec![8]
        } else if self.objects.is_empty() {
            usual.to_vec()
        } else {
            self.objects.clone()
        }
    }

    /// Frames of a run: those asked for, or else about as many as update `updates` particles.
    pub(crate) fn frames_for(&self, objects: usize, updates: usize) -> u64 {
        let usual = (updates / objects.max(1)).max(20) as u64;
        if self.test { 3 } else { self.frames.unwrap_or(usual) }
    }
}

/// Runs a bench: reads its arguments, says what it runs on, and reports its failure.
pub(crate) fn main(bench: fn(&Arguments) -> Result<(), ExperimentError>) -> ExitCode {
    let arguments = Arguments::parse();
    let (name, rounds) = (env!("CARGO_CRATE_NAME"), arguments.rounds());
    let (good, most) = (rounds.start(), rounds.end());
    println!("{name}: {}; good rounds wanted: {good}, of {most} at most", Machine::this());
    match bench(&arguments) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("{name}: {error}");
            ExitCode::FAILURE
        }
    }
}

/// Prints what was run, what the calibrator saw, and for each contender the time of a frame and how
/// many times the first contender's it is, over all rounds and over the good ones. A run has so many
/// frames.
#[allow(dead_code, reason = "not every bench compares frames")]
pub(crate) fn print(title: &str, series: &Series, frames: f64) {
    println!("\n{title}");
    print_phases(series);
    println!(
        "{:24}{:>28}{:>26}{:>26}",
        "", "µs a frame, all rounds", "times the first, all", "times the first, good"
    );
    for (index, label) in series.labels().iter().enumerate() {
        let time = series.quartiles(Rounds::All, |seconds| seconds[index] * 1e6 / frames);
        let [all, good] = [Rounds::All, Rounds::Good].map(|which| series.ratio(which, index, 0));
        println!("{label:24}{:>28}{:>26}{:>26}", range(time, 1), range(all, 3), range(good, 3));
    }
}

/// Prints what the calibrator saw.
pub(crate) fn print_phases(series: &Series) {
    let phases = series.rounds().iter().map(|round| round.phase);
    let gain = Quartiles::of(phases.clone().map(|phase| phase.gain));
    let ping_pong = Quartiles::of(phases.map(|phase| phase.ping_pong));
    println!(
        "calibrator: gain {}, ping-pong {} ns, {} of {} rounds marked",
        range(gain, 3),
        range(ping_pong, 0),
        series.marked(),
        series.rounds().len(),
    );
}

/// Quartiles as "median [lower upper]".
pub(crate) fn range(quartiles: Option<Quartiles>, digits: usize) -> String {
    quartiles.map_or("none".to_owned(), |Quartiles { lower, median, upper }| {
        format!("{median:.digits$} [{lower:.digits$} {upper:.digits$}]")
    })
}
