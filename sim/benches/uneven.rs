//! Few objects of very different cost: substeps from 1 to 100.
#![forbid(unsafe_code)]

mod common;

use std::process::ExitCode;

use dualframe_sim::experiment::calibrator::Calibrator;
use dualframe_sim::experiment::error::ExperimentError;
use dualframe_sim::experiment::load::RenderLoad;
use dualframe_sim::experiment::race::{Race, Runner, WARM_UP};
use dualframe_sim::experiment::statistics::Quartiles;
use dualframe_sim::experiment::subject::Subject;
use dualframe_sim::scene::ParticleScene;

/// The most substeps of an object.
const MOST_SUBSTEPS: u32 = 100;
/// The number of seeds.
const SEEDS: u64 = 20;

fn main() -> ExitCode {
    common::main(uneven)
}

fn uneven(arguments: &common::Arguments) -> Result<(), ExperimentError> {
    let calibrator = Calibrator::default();
    let pipeline = Runner::pipeline(arguments.threads);
    let runners: Vec<Runner> = Runner::parallel(arguments.threads).collect();
    let others: Vec<Runner> =
        runners.iter().copied().filter(|&runner| runner != pipeline).collect();
    for objects in arguments.objects_or(&[30]) {
        let mut ratios = vec![Vec::new(); others.len()];
        for seed in 1..=if arguments.test { 1 } else { SEEDS } {
            let scene =
                ParticleScene { seed, most_substeps: MOST_SUBSTEPS, ..ParticleScene::new(objects) };
            let frames = arguments.frames_for(objects, 15_000);
            let (load, rounds) = (RenderLoad::Null, arguments.rounds());
            let subject = Subject::Particles(scene);
            let race = Race { subject, load, warm_up: WARM_UP, frames, rounds };
            let outcome = race.run(&runners, &mut || calibrator.phase(), &mut || ())?;
            common::print(&race.to_string(), &outcome.series, race.frames as f64);
            for (ratios, &other) in ratios.iter_mut().zip(&others) {
                ratios.extend(outcome.median_speed_up(pipeline, other));
            }
        }
        println!("\n{objects} objects, {}: speed-up over seeds", pipeline.label());
        println!("{:24}{:>26}{:>10}", "over", "median [quartiles]", "least");
        for (ratios, other) in ratios.iter().zip(&others) {
            let least = ratios.iter().copied().fold(f64::INFINITY, f64::min);
            let quartiles = common::range(Quartiles::of(ratios.iter().copied()), 3);
            println!("{:24}{quartiles:>26}{least:>10.3}", other.label());
        }
    }
    Ok(())
}
