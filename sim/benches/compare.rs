//! The pipeline against every other executor, without and with rendering.
#![forbid(unsafe_code)]

mod common;

use std::process::ExitCode;

use dualframe_sim::experiment::calibrator::Calibrator;
use dualframe_sim::experiment::error::ExperimentError;
use dualframe_sim::experiment::load::{RenderLoad, StandIn};
use dualframe_sim::experiment::race::{Race, Runner, WARM_UP};
use dualframe_sim::experiment::speedup::efficiency;
use dualframe_sim::experiment::statistics::Quartiles;
use dualframe_sim::experiment::subject::Subject;
use dualframe_sim::experiment::timing::Rounds;
use dualframe_sim::scene::ParticleScene;

/// Measurements of what threads without anything in common gain.
const GAIN_ROUNDS: usize = 5;

fn main() -> ExitCode {
    common::main(compare)
}

fn compare(arguments: &common::Arguments) -> Result<(), ExperimentError> {
    let calibrator = Calibrator::default();
    let hundreds: Vec<usize> = (100..=1_000).step_by(100).collect();
    let (one, pipeline) = (Runner::pipeline(1), Runner::pipeline(arguments.threads));
    let mut runners: Vec<Runner> = Runner::parallel(arguments.threads).collect();
    let others: Vec<Runner> =
        runners.iter().copied().filter(|&runner| runner != pipeline).collect();
    runners.push(Runner::SERIAL);
    if one != pipeline {
        runners.push(one);
    }
    let mut lines = Vec::new();
    for objects in arguments.objects_or(&hundreds) {
        let subject = Subject::Particles(ParticleScene::new(objects));
        let frames = arguments.frames_for(objects, 60_000);
        let mut phase = || calibrator.phase();
        let stand_in =
            StandIn::calibrated(&subject, frames, arguments.rounds(), &mut phase, &mut || ())?;
        for load in [RenderLoad::Null, RenderLoad::StandIn(stand_in)] {
            let (subject, rounds) = (subject.clone(), arguments.rounds());
            let race = Race { subject, load, warm_up: WARM_UP, frames, rounds };
            let outcome = race.run(&runners, &mut phase, &mut || ())?;
            common::print(&race.to_string(), &outcome.series, race.frames as f64);
            let share = 100.0 * outcome.render_share(Rounds::Good).unwrap_or(f64::NAN);
            let over = |other| outcome.median_speed_up(pipeline, other).unwrap_or(f64::NAN);
            let (s_s, s_p) = (over(Runner::SERIAL), over(one));
            // The lowest of the medians: a minimum within each round would favour whichever
            // executor happened to be undisturbed.
            let least = others.iter().map(|&other| over(other)).fold(f64::INFINITY, f64::min);
            let gains: Result<Vec<f64>, _> =
                (0..GAIN_ROUNDS).map(|_| race.independent_gain(arguments.threads)).collect();
            let ceiling = Quartiles::of(gains?).map_or(f64::NAN, |gains| gains.median);
            let mut line = format!(
                "{objects:7}  {share:6.1} %  {ceiling:7.3}  {s_s:5.3}  {:5.3}  {least:5.3}",
                efficiency(s_p, arguments.threads)
            );
            for &other in &others {
                line += &format!("  {:>16.3}", over(other));
            }
            lines.push(line);
        }
    }
    let names: String =
        others.iter().map(|other| format!("  {:>16}", other.executor.name())).collect();
    println!(
        "\n{}: medians over good rounds (all if none is good); ceiling: what {} independent environments gain, \
         the median of {GAIN_ROUNDS} measurements after the race, disturbed ones too; least: over the one that it is \
         least ahead of",
        pipeline.label(),
        arguments.threads
    );
    println!("objects  render    ceiling    S_s    E_p  least{names}");
    lines.iter().for_each(|line| println!("{line}"));
    Ok(())
}
