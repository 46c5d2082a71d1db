//! How the time of a frame grows with the number of objects, at equal density: all environments have
//! filled their rooms before the clock starts.
#![forbid(unsafe_code)]

mod common;

use std::cell::Cell;
use std::process::ExitCode;
use std::time::Instant;

use dualframe_sim::blocking::FRAMES_PER_BLOCKING;
use dualframe_sim::experiment::calibrator::Calibrator;
use dualframe_sim::experiment::error::ExperimentError;
use dualframe_sim::experiment::race::Runner;
use dualframe_sim::experiment::subject::Subject;
use dualframe_sim::experiment::timing::{Contender, Series};
use dualframe_sim::render::NullRenderer;
use dualframe_sim::scene::ParticleScene;

/// Frames until particles that start close together are everywhere, at any of the sizes; usually 6,000, when 1,000 and
/// 10,000 particles collide about equally often (0.09 and 0.08 collisions of an object a frame from then on; from 1,200 on
/// 0.16 and 0.23).
const FILLING: u64 = 6_000;

fn main() -> ExitCode {
    common::main(density)
}

/// Every number of objects is a contender, so that the ratios are of the same round.
fn density(arguments: &common::Arguments) -> Result<(), ExperimentError> {
    let calibrator = Calibrator::default();
    for runner in [Runner::SERIAL, Runner::pipeline(arguments.threads)] {
        let sizes = arguments.objects_or(&[1_000, 2_000, 5_000, 10_000]);
        let counts: Vec<Cell<Count>> = sizes.iter().map(|_| Cell::default()).collect();
        let mut contenders = Vec::new();
        for (&objects, count) in sizes.iter().zip(&counts) {
            // As many regroupings in each run, of however many objects.
            let usual = arguments.frames_for(objects, 40_000).next_multiple_of(FRAMES_PER_BLOCKING);
            let frames = arguments.frames.unwrap_or(usual);
            let filling = if arguments.test { 3 } else { FILLING };
            contenders.push(environment(runner, objects, filling, frames, count)?);
        }
        let mut phase = || calibrator.phase();
        let rounds = arguments.rounds();
        let series = Series::measure(&mut contenders, rounds, &mut phase, &mut || ())?;
        common::print(&format!("{}, by numbers of objects", runner.label()), &series, 1.0);
        for (objects, count) in sizes.iter().zip(&counts) {
            let Count { collisions, frames } = count.get();
            let each = collisions as f64 / frames as f64 / *objects as f64;
            println!("{objects:<24}{each:10.3} collisions of an object a frame");
        }
    }
    Ok(())
}

/// What was counted while the clock ran.
#[derive(Clone, Copy, Default)]
struct Count {
    collisions: u64,
    frames: u64,
}

/// An environment that has filled its room, to be run on for so many frames each round.
fn environment(
    runner: Runner,
    objects: usize,
    filling: u64,
    frames: u64,
    count: &Cell<Count>,
) -> Result<Contender<'_>, ExperimentError> {
    let mut session = Subject::Particles(ParticleScene::new(objects)).start(runner)?;
    session.run(filling, &mut NullRenderer::default(), &mut |_| ())?;
    let run = move || {
        let began = Instant::now();
        let mut run = Count::default();
        session.run(frames, &mut NullRenderer::default(), &mut |record| {
            run.collisions += record.pairs.collisions;
            run.frames += 1;
        })?;
        let took = began.elapsed().as_secs_f64() / frames as f64;
        // Frames without them would be shorter.
        let quarantined = session.manager.quarantined().len();
        if quarantined > 0 {
            return Err(ExperimentError::Quarantined { run: runner.label(), objects: quarantined });
        }
        let Count { collisions, frames } = count.get();
        count.set(Count { collisions: collisions + run.collisions, frames: frames + run.frames });
        Ok(took)
    };
    Ok(Contender { label: objects.to_string(), spins: false, run: Box::new(run) })
}
