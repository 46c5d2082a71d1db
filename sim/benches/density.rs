//! How the time of a frame grows with the number of objects, at equal density.
#![forbid(unsafe_code)]

mod common;

use std::process::ExitCode;

use dualframe_sim::experiment::calibrator::Calibrator;
use dualframe_sim::experiment::error::ExperimentError;
use dualframe_sim::experiment::load::RenderLoad;
use dualframe_sim::experiment::race::{Race, Runner, WARM_UP};
use dualframe_sim::experiment::subject::Subject;
use dualframe_sim::experiment::timing::{Contender, Series};
use dualframe_sim::scene::ParticleScene;

fn main() -> ExitCode {
    common::main(density)
}

/// Every number of objects is a contender, so that the ratios are of the same round.
fn density(arguments: &common::Arguments) -> Result<(), ExperimentError> {
    let calibrator = Calibrator::default();
    for runner in [Runner::SERIAL, Runner::pipeline(arguments.threads)] {
        let sizes = arguments.objects_or(&[1_000, 2_000, 5_000, 10_000]);
        let contender = |&objects: &usize| {
            let frames = arguments.frames_for(objects, 40_000);
            let (scene, load) = (ParticleScene::new(objects), RenderLoad::Null);
            let subject = Subject::Particles(scene);
            let race = Race { subject, load, warm_up: WARM_UP, frames, rounds: 1 };
            let run = move || Ok(race.seconds(runner)? / frames as f64);
            Contender { label: objects.to_string(), spins: false, run: Box::new(run) }
        };
        let mut contenders: Vec<Contender<'_>> = sizes.iter().map(contender).collect();
        let mut phase = || calibrator.phase();
        let series = Series::measure(&mut contenders, arguments.rounds, &mut phase, &mut || ())?;
        common::print(&format!("{}, by numbers of objects", runner.label()), &series, 1.0);
    }
    Ok(())
}
