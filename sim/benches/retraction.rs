//! Automated retraction in the craniotomy: few heavy objects of very different cost, each a unit.
#![forbid(unsafe_code)]

mod common;

use std::process::ExitCode;

use dualframe_sim::executor::StageSeconds;
use dualframe_sim::experiment::calibrator::Calibrator;
use dualframe_sim::experiment::error::ExperimentError;
use dualframe_sim::experiment::load::{RenderLoad, StandIn};
use dualframe_sim::experiment::race::{Race, Runner, WARM_UP};
use dualframe_sim::experiment::subject::Subject;
use dualframe_sim::experiment::timing::Rounds;
use dualframe_sim::render::NullRenderer;

/// Objects updated in a run: 240 frames, 4 s of the operation.
const UPDATES: usize = 7_200;
/// The dearest objects that are listed.
const DEAREST: usize = 8;

fn main() -> ExitCode {
    common::main(retraction)
}

fn retraction(arguments: &common::Arguments) -> Result<(), ExperimentError> {
    let calibrator = Calibrator::default();
    let subject = Subject::retraction()?;
    let frames = arguments.frames_for(subject.objects(), UPDATES);
    let pipeline = Runner::pipeline(arguments.threads);
    let mut runners: Vec<Runner> = Runner::parallel(arguments.threads).collect();
    runners.push(Runner::SERIAL);
    let mut phase = || calibrator.phase();
    let stand_in =
        StandIn::calibrated(&subject, frames, arguments.rounds(), &mut phase, &mut || ())?;
    for load in [RenderLoad::Null, RenderLoad::StandIn(stand_in)] {
        let (subject, rounds) = (subject.clone(), arguments.rounds());
        let race = Race { subject, load, warm_up: WARM_UP, frames, rounds };
        let outcome = race.run(&runners, &mut phase, &mut || ())?;
        common::print(&race.to_string(), &outcome.series, race.frames as f64);
        let share = outcome.render_share(Rounds::Good);
        println!("rendering: {:.1} % of the serial work", 100.0 * share.unwrap_or(f64::NAN));
        println!("speed-up of {} over", pipeline.label());
        for &other in runners.iter().filter(|&&other| other != pipeline) {
            let ratio = outcome.speed_up(outcome.series.best_rounds(), pipeline, other);
            println!("{:24}{:>28}", other.label(), common::range(ratio, 3));
        }
    }
    costs(&subject, frames)?;
    println!("\nseconds in the first {frames} frames, each worker");
    for &runner in &runners {
        for (worker, seconds) in stage_seconds(&subject, runner, frames)?.iter().enumerate() {
            let StageSeconds { broad_phase, interaction, update, render, idle } = seconds;
            println!(
                "{:24}{worker:3}  broad phase {broad_phase:.3}  interaction {interaction:.3}  update \
                 {update:.3}  render {render:.3}  idle {idle:.3}",
                runner.label()
            );
        }
    }
    Ok(())
}

/// Prints what the dearest objects' updates take in the last frames, none of which can be shorter than the dearest of
/// them.
fn costs(subject: &Subject, frames: u64) -> Result<(), ExperimentError> {
    let mut session = subject.start(Runner::SERIAL)?;
    session.run(WARM_UP + frames, &mut NullRenderer::new(), &mut |_| ())?;
    let mut costs = Vec::new();
    session.manager.visit(&mut |object| costs.push((object.cost(), object.id())));
    costs.sort_unstable_by(|a, b| b.0.total_cmp(&a.0));
    let all: f32 = costs.iter().map(|(cost, _)| cost).sum();
    let (objects, all_us) = (costs.len(), all * 1e6);
    println!("\nupdates of {objects} objects take {all_us:.0} µs a frame at the end; the dearest");
    for (cost, id) in costs.iter().take(DEAREST) {
        println!("{id:>8}{:8.0} µs{:7.1} %", cost * 1e6, 100.0 * cost / all);
    }
    Ok(())
}

fn stage_seconds(
    subject: &Subject,
    runner: Runner,
    frames: u64,
) -> Result<Vec<StageSeconds>, ExperimentError> {
    let mut session = subject.start(runner)?;
    session.run(frames, &mut NullRenderer::new(), &mut |_| ())?;
    Ok(session.manager.stage_seconds())
}
