//! Load balancing (§7.2.2): Fig. 14 and Table 1.

use std::time::Instant;

use super::error::ExperimentError;
use super::figure::{Chart, Figure};
use super::race::Runner;
use super::scalability::range;
use super::statistics::rounded_up;
use super::subject::Subject;
use super::table::Table;
use super::timing::{Contender, Rounds, Series};
use super::{Laboratory, Report, Shown};
use crate::executor::StageSeconds;
use crate::render::NullRenderer;
use crate::scene::ParticleScene;

/// The number of objects of Table 1.
const TABLE_OBJECTS: usize = 500;

/// Which run a figure shows.
const USUAL: &str = "the one in the middle by how much the workers differ, of those that are not marked if there are any";

/// The columns of both tables: of all runs, and of the one of each size that the figure shows.
const COLUMNS: [&str; 12] = [
    "objects",
    "round",
    "worker",
    "broad_phase_seconds",
    "interaction_seconds",
    "update_seconds",
    "render_seconds",
    "total_seconds",
    "idle_seconds",
    "gain",
    "ping_pong_ns",
    "marked",
];

/// What each worker did in each run of so many objects.
struct Balance {
    objects: usize,
    runs: Vec<Vec<StageSeconds>>,
    series: Series,
}

impl Balance {
    fn measure(laboratory: &mut Laboratory<'_>, objects: usize) -> Result<Self, ExperimentError> {
        let plan = laboratory.plan;
        let sweep = &plan.load_balance;
        let scene = ParticleScene { seed: plan.seed, ..ParticleScene::new(objects) };
        let subject = Subject::Particles(scene);
        let runner = Runner::pipeline(plan.most_threads());
        let mut runs = Vec::with_capacity(sweep.rounds);
        let run = || {
            let began = Instant::now();
            runs.push(stage_seconds(&subject, runner, sweep.frames)?);
            Ok(began.elapsed().as_secs_f64())
        };
        let mut contenders: [Contender<'_>; 1] =
            [Contender { label: runner.label(), spins: false, run: Box::new(run) }];
        let calibrator = laboratory.calibrator;
        let mut done = || laboratory.advance(sweep.frames * objects as u64);
        let mut phase = || calibrator.phase();
        let rounds = sweep.rounds..=sweep.rounds;
        let series = Series::measure(&mut contenders, rounds, &mut phase, &mut done)?;
        drop(contenders);
        Ok(Self { objects, runs, series })
    }

    /// The run whose spread is in the middle, of the good ones if there are any. Medians of each worker's times would
    /// hide that now one works more, now the other.
    fn usual(&self) -> usize {
        let counts = |bad: bool| self.series.best_rounds() == Rounds::All || !bad;
        let marks = self.series.marks().into_iter().enumerate();
        let mut rounds: Vec<_> = marks.filter(|&(_, bad)| counts(bad)).map(|(it, _)| it).collect();
        let spread = |round: usize| spread(&self.runs[round]);
        rounds.sort_unstable_by(|&a, &b| spread(a).total_cmp(&spread(b)));
        rounds.get(rounds.len() / 2).copied().unwrap_or_default()
    }

    fn add_round(&self, round: usize, table: &mut Table) {
        let phase = self.series.rounds()[round].phase;
        let marked = u8::from(self.series.marks()[round]);
        for (index, worker) in self.runs[round].iter().enumerate() {
            let StageSeconds { broad_phase, interaction, update, render, idle } = worker;
            let cells = [*broad_phase, *interaction, *update, *render, total(worker), *idle];
            let cells = cells.map(|seconds| format!("{seconds:.4}"));
            let [broad_phase, interaction, update, render, total, idle] = &cells;
            let gain = format_args!("{:.3}", phase.gain);
            let ping_pong = format_args!("{:.1}", phase.ping_pong);
            table.push(&[
                &self.objects,
                &round,
                &(index + 1),
                broad_phase,
                interaction,
                update,
                render,
                total,
                idle,
                &gain,
                &ping_pong,
                &marked,
            ]);
        }
    }
}

pub(super) fn run(laboratory: &mut Laboratory<'_>) -> Result<Report, ExperimentError> {
    let sweep = &laboratory.plan.load_balance;
    let sizes = sweep.objects.iter();
    let balances: Result<Vec<Balance>, _> =
        sizes.map(|&objects| Balance::measure(laboratory, objects)).collect();
    let balances = balances?;
    let mut table = Table::new("load-balance", &COLUMNS);
    let mut rounds = Table::new("load-balance-rounds", &COLUMNS);
    for balance in &balances {
        balance.add_round(balance.usual(), &mut table);
        (0..sweep.rounds).for_each(|round| balance.add_round(round, &mut rounds));
    }
    let figure = figure(&balances, sweep.frames)?;
    let mut shown = table.clone();
    let wanted = TABLE_OBJECTS.to_string();
    shown.rows.retain(|row| row[0] == wanted);
    let shown = Shown {
        title: format!(
            "Table 1: seconds that each worker worked per stage over {} frames ({TABLE_OBJECTS} objects), in one run, \
             {USUAL}",
            sweep.frames
        ),
        table: shown,
        paper: "12.15 to 12.20 s in all over 800 frames; the first of six threads, which also draws, spends \
                2.1 s in the broad phase, 1.5 in interaction, 6.2 in update and 2.4 in render, the others 3.6 \
                to 3.7, 1.6 to 1.7 and 6.8.",
    };
    Ok(Report { tables: vec![table, rounds], figures: vec![figure], shown: Some(shown) })
}

/// What each worker of a run spent its time on.
fn stage_seconds(
    subject: &Subject,
    runner: Runner,
    frames: u64,
) -> Result<Vec<StageSeconds>, ExperimentError> {
    let mut session = subject.start(runner)?;
    session.run(frames, &mut NullRenderer::new(), &mut |_| ())?;
    let objects = session.manager.quarantined().len();
    if objects > 0 {
        return Err(ExperimentError::Quarantined { run: runner.label(), objects });
    }
    Ok(session.manager.stage_seconds())
}

fn total(worker: &StageSeconds) -> f64 {
    worker.broad_phase + worker.interaction + worker.update + worker.render
}

/// How much more the busiest worker worked than the idlest, as a share of the busiest's time.
fn spread(workers: &[StageSeconds]) -> f64 {
    let (least, greatest) = range(workers.iter().map(total));
    (greatest - least) / greatest
}

/// How many runs were marked, and whether any of them is shown.
fn marked(balances: &[Balance]) -> String {
    let all: usize = balances.iter().map(|balance| balance.series.rounds().len()).sum();
    let bad: usize = balances.iter().map(|balance| balance.series.marked()).sum();
    let shown =
        balances.iter().filter(|balance| balance.series.best_rounds() == Rounds::All).count();
    format!("{bad} of {all} runs were marked; {shown} of the {} shown are.", balances.len())
}

fn figure(balances: &[Balance], frames: u64) -> Result<Figure, ExperimentError> {
    let usual = |balance: &Balance| balance.runs[balance.usual()].clone();
    let shown: Vec<_> = balances.iter().map(|balance| (balance.objects, usual(balance))).collect();
    let workers = shown.iter().map(|(_, workers)| workers.len()).max().unwrap_or(0);
    let names: Vec<String> = (1..=workers).map(|worker| format!("worker {worker}")).collect();
    let (_, greatest) = range(shown.iter().map(|(_, workers)| spread(workers)));
    let groups = shown
        .iter()
        .map(|(objects, workers)| (objects.to_string(), workers.iter().map(total).collect()));
    Chart {
        name: "fig14-load-balance",
        title: format!("Seconds that each worker worked in {frames} frames"),
        x_label: "objects",
        y_label: "seconds",
        finding: format!(
            "In the runs shown, the busiest and the idlest worker differ by at most {:.1} %. Of each size one run is \
             shown, {USUAL}, the workers from left to right; stages have the shares that they have in one frame of 31. {}",
            rounded_up(100.0 * greatest, 1),
            marked(balances)
        ),
        paper: "Very balanced in all cases: within 0.4 % for 500 objects (Table 1: 12.15 to 12.20 s).",
        ..Chart::default()
    }
    .bars(&names, groups.collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::experiment::calibrator::Phase;

    /// Runs whose two workers differ by these shares, in these phases.
    fn balance(spreads: &[f64], gains: &[f64]) -> Balance {
        let worker = |update| StageSeconds { update, ..StageSeconds::default() };
        let runs = spreads.iter().map(|spread| vec![worker(1.0), worker(1.0 - spread)]).collect();
        let run = || Ok::<_, ExperimentError>(1.0);
        let mut contenders = [Contender { label: String::new(), spins: false, run: Box::new(run) }];
        let mut gains = gains.iter();
        // The first one is before the first round.
        let mut phase = || Phase { gain: gains.next().copied().unwrap_or(2.0), ping_pong: 100.0 };
        let rounds = spreads.len()..=spreads.len();
        let series = Series::measure(&mut contenders, rounds, &mut phase, &mut || ());
        Balance { objects: 5, runs, series: series.expect("nothing fails") }
    }

    #[test]
    fn the_middle_one_of_the_good_runs_is_shown() {
        assert_eq!(balance(&[0.3, 0.1, 0.2], &[]).usual(), 2);
        // The first two are marked, for a phase counts on both of its sides.
        let disturbed = balance(&[0.3, 0.1, 0.2, 0.25, 0.15], &[2.0, 1.0]);
        assert_eq!(disturbed.usual(), 2);
        assert_eq!(marked(&[disturbed]), "2 of 5 runs were marked; 0 of the 1 shown are.");
        let lost = balance(&[0.3, 0.1, 0.2], &[1.0; 4]);
        assert_eq!(lost.usual(), 2);
        assert_eq!(marked(&[lost]), "3 of 3 runs were marked; 1 of the 1 shown are.");
    }

    #[test]
    fn a_figure_says_how_far_workers_differ_at_most() {
        let balances = [balance(&[0.3, 0.0001, 0.00141], &[]), balance(&[0.0005], &[])];
        let finding = figure(&balances, 40).expect("it is drawn").finding;
        let expected =
            "In the runs shown, the busiest and the idlest worker differ by at most 0.2 %. ";
        assert!(finding.starts_with(expected), "{finding}");
        assert!(finding.ends_with(&marked(&balances)), "{finding}");
    }
}
