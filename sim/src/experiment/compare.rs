//! The comparative study (§7.2.3): Figs. 16 and 17.

use super::error::ExperimentError;
use super::figure::{Chart, Figure, Line};
use super::load::{RenderLoad, StandIn};
use super::outcome::{Outcome, marked};
use super::race::{Race, Runner, WARM_UP};
use super::{Laboratory, Report};
use crate::executor::ExecutorKind;
use crate::scene::ParticleScene;

/// The figures' names, for the light and the heavy load: without and with rendering.
const NAMES: [[&str; 2]; 2] = [
    ["fig16-light-load", "fig16-light-load-rendering"],
    ["fig17-heavy-load", "fig17-heavy-load-rendering"],
];

pub(super) fn run(laboratory: &mut Laboratory<'_>) -> Result<Report, ExperimentError> {
    let plan = laboratory.plan;
    let sweep = &plan.compare;
    let parallel = plan.threads.iter().copied().flat_map(Runner::parallel);
    let runners: Vec<Runner> = std::iter::once(Runner::SERIAL).chain(parallel).collect();
    let mut rounds = Outcome::rounds_table("compare-rounds");
    let mut summary = Outcome::summary_table("compare");
    let mut figures = Vec::new();
    for (&objects, names) in sweep.objects.iter().zip(NAMES) {
        let scene = ParticleScene { seed: plan.seed, ..ParticleScene::new(objects) };
        let loads = [RenderLoad::Null, RenderLoad::StandIn(StandIn::calibrated(scene)?)];
        for (load, name) in loads.into_iter().zip(names) {
            let frames = sweep.frames;
            let race = Race { scene, load, warm_up: WARM_UP, frames, rounds: sweep.rounds };
            let outcome = laboratory.race(race, &runners)?;
            outcome.add_rounds(&mut rounds);
            outcome.add_summary(&mut summary);
            figures.push(figure(name, &outcome, &plan.threads)?);
        }
    }
    Ok(Report { tables: vec![summary, rounds], figures, shown: None })
}

fn figure(
    name: &'static str,
    outcome: &Outcome,
    threads: &[usize],
) -> Result<Figure, ExperimentError> {
    let kinds = Runner::parallel(1).map(|runner| runner.executor);
    let lines = kinds.enumerate().map(|(color, executor)| Line {
        label: executor.name().to_owned(),
        points: points(outcome, executor, threads),
        dashed: false,
        color,
    });
    let objects = outcome.race.scene.objects;
    let rendering = match outcome.race.load {
        RenderLoad::Null => "",
        RenderLoad::StandIn(_) => ", rendering 15 % of the work",
    };
    Chart {
        name,
        title: format!("Speed-up over serial, {objects} objects{rendering}"),
        x_label: "threads",
        y_label: "speed-up S_s = T_s / T_p",
        x_counts: true,
        finding: finding(outcome, threads) + &marked([outcome]),
        paper: "The pipeline is the fastest, 8 to 28 % ahead of OpenMP and TBB with 2 to 6 threads \
                (§8.3).",
    }
    .lines(lines.collect())
}

fn points(outcome: &Outcome, executor: ExecutorKind, threads: &[usize]) -> Vec<(f64, f64)> {
    let point = |&threads: &usize| {
        let runner = Runner { executor, threads };
        Some((threads as f64, outcome.median_speed_up(runner, Runner::SERIAL)?))
    };
    threads.iter().filter_map(point).collect()
}

/// How the pipeline does against the fastest of the others, with the most threads.
fn finding(outcome: &Outcome, threads: &[usize]) -> String {
    let threads = threads.iter().copied().max().unwrap_or(1);
    let pipeline = Runner::pipeline(threads);
    let others = Runner::parallel(threads).filter(|&runner| runner != pipeline);
    let ratio = |other: Runner| Some((other, outcome.median_speed_up(pipeline, other)?));
    let closest = others.filter_map(ratio).min_by(|(_, a), (_, b)| a.total_cmp(b));
    let (Some((other, ratio)), Some(speed_up)) =
        (closest, outcome.median_speed_up(pipeline, Runner::SERIAL))
    else {
        return String::new();
    };
    format!(
        "{} reaches {speed_up:.2}, {ratio:.3} times the fastest other, {}. ",
        pipeline.label(),
        other.label()
    )
}
