//! What the pipeline with one worker costs over the serial executor.
#![forbid(unsafe_code)]

mod common;

use std::process::ExitCode;

use dualframe_sim::experiment::calibrator::Calibrator;
use dualframe_sim::experiment::error::ExperimentError;
use dualframe_sim::experiment::load::RenderLoad;
use dualframe_sim::experiment::race::{Race, Runner, WARM_UP};
use dualframe_sim::experiment::subject::Subject;
use dualframe_sim::scene::ParticleScene;

fn main() -> ExitCode {
    common::main(overhead)
}

fn overhead(arguments: &common::Arguments) -> Result<(), ExperimentError> {
    let calibrator = Calibrator::default();
    let hundreds: Vec<usize> = (100..=1_000).step_by(100).collect();
    let mut lines = Vec::new();
    for objects in arguments.objects_or(&hundreds) {
        let race = Race {
            subject: Subject::Particles(ParticleScene::new(objects)),
            load: RenderLoad::Null,
            warm_up: WARM_UP,
            frames: arguments.frames_for(objects, 60_000),
            rounds: arguments.rounds(),
        };
        let outcome = race.run(
            &[Runner::SERIAL, Runner::pipeline(1)],
            &mut || calibrator.phase(),
            &mut || (),
        )?;
        common::print(&race.to_string(), &outcome.series, race.frames as f64);
        let which = outcome.series.best_rounds();
        let ratio = outcome.speed_up(which, Runner::SERIAL, Runner::pipeline(1));
        lines.push(format!("{objects:6}  {}", common::range(ratio, 4)));
    }
    println!("\nobjects  pipeline × 1 over serial, good rounds (all if none is good)");
    lines.iter().for_each(|line| println!("{line}"));
    Ok(())
}
