//! What an executor costs for each unit and frame: objects that do nothing and meet nobody, so that
//! everything beyond the serial executor's time is synchronisation.
//!
//! Synchronisation is the time of all threads together, less the serial executor's in the same round.
#![forbid(unsafe_code)]

mod common;

use std::process::ExitCode;
use std::time::Instant;

use dualframe_sim::behavior::{Behavior, Input};
use dualframe_sim::blocking::{Blocking, FRAMES_PER_BLOCKING, Grain};
use dualframe_sim::executor::ExecutorError;
use dualframe_sim::experiment::calibrator::Calibrator;
use dualframe_sim::experiment::error::ExperimentError;
use dualframe_sim::experiment::race::Runner;
use dualframe_sim::experiment::timing::{Contender, Rounds, Series};
use dualframe_sim::geometry::{Geometry, Rigid};
use dualframe_sim::interaction::Rules;
use dualframe_sim::manager::{Settings, VeManager};
use dualframe_sim::object::{Group, Object, ObjectId};
use dualframe_sim::render::NullRenderer;
use dualframe_sim::scene::Scene;
use dualframe_sim::simd::Simd;
use dualframe_sim::stages::Stages;
use glam::{Quat, Vec3};
use parry3d::math::Pose;
use parry3d::shape::SharedShape;

/// As many objects for either grain that queues and lists are well filled.
const GRAINS: [(Grain, usize); 2] = [(Grain::Pairwise, 512), (Grain::Spatial, 4_096)];
/// Radius of a body, in metres; usually a tenth of the distance to the next.
const RADIUS: f32 = 0.1;
/// Distance to the next body, in metres.
const SPACING: f32 = 1.0;

fn main() -> ExitCode {
    common::main(units)
}

fn units(arguments: &common::Arguments) -> Result<(), ExperimentError> {
    let calibrator = Calibrator::default();
    let mut threads = vec![1, arguments.threads];
    threads.dedup();
    // The serial one first: the others are compared with it.
    let mut runners = vec![Runner::SERIAL];
    runners.extend(threads.into_iter().flat_map(Runner::parallel));
    for (grain, objects) in GRAINS {
        let objects = if arguments.test { objects / 16 } else { objects };
        // As many regroupings in each run.
        let usual = arguments.frames_for(objects, 80_000).next_multiple_of(FRAMES_PER_BLOCKING);
        let frames = arguments.frames.unwrap_or(usual);
        let contenders = runners.iter().map(|&runner| contender(runner, grain, objects, frames));
        let mut contenders = contenders.collect::<Result<Vec<_>, _>>()?;
        let mut phase = || calibrator.phase();
        let rounds = arguments.rounds();
        let series = Series::measure(&mut contenders, rounds, &mut phase, &mut || ())?;
        print(grain, objects, frames, &runners, &series);
    }
    Ok(())
}

/// An environment that stays, to be run on for so many frames each round.
fn contender(
    runner: Runner,
    grain: Grain,
    objects: usize,
    frames: u64,
) -> Result<Contender<'static>, ExperimentError> {
    let Runner { executor, threads } = runner;
    let settings = Settings { executor, threads, grain, ..Settings::default() };
    let mut manager = VeManager::new(idle(objects), settings).map_err(ExecutorError::from)?;
    let mut run = move || {
        let began = Instant::now();
        manager.run(frames, &mut NullRenderer::new(), &mut |_| ())?;
        Ok(began.elapsed().as_secs_f64())
    };
    // Threads are hired, and memory is there, before the first round.
    run()?;
    Ok(Contender { label: runner.label(), spins: runner.spins(), run: Box::new(run) })
}

fn print(grain: Grain, objects: usize, frames: u64, runners: &[Runner], series: &Series) {
    println!("\n{grain:?}, {objects} objects, {frames} frames; ns a unit and frame");
    common::print_phases(series);
    println!(
        "{:24}{:>26}{:>26}{:>26}",
        "", "elapsed, all rounds", "synchronisation, all", "synchronisation, good"
    );
    for (index, runner) in runners.iter().enumerate() {
        let (units, threads) = (units_of(grain, objects, runner.threads), runner.threads as f64);
        let each = 1e9 / (units as f64 * frames as f64);
        let elapsed = series.quartiles(Rounds::All, |seconds| seconds[index] * each);
        let [all, good] = [Rounds::All, Rounds::Good].map(|which| {
            series.quartiles(which, |seconds| (seconds[index] * threads - seconds[0]) * each)
        });
        let [elapsed, all, good] = [elapsed, all, good].map(|values| common::range(values, 0));
        println!("{:24}{elapsed:>26}{all:>26}{good:>26}", runner.label());
    }
}

/// The number of units of a scene.
fn units_of(grain: Grain, objects: usize, threads: usize) -> usize {
    let (_, blocks) = Blocking::new(idle(objects).objects, grain, threads).expect("few objects");
    blocks.len()
}

/// Bodies on a grid that do nothing. No interaction is modelled.
fn idle(objects: usize) -> Scene {
    let side = (objects as f32).cbrt().ceil() as usize;
    let body = |id: usize| {
        let cell = [id % side, id / side % side, id / (side * side)];
        let place = Vec3::from_array(cell.map(|coordinate| coordinate as f32 * SPACING));
        let pose = Pose::from_parts(place, Quat::IDENTITY);
        let geometry = Geometry::Rigid(Rigid::new(SharedShape::ball(RADIUS), pose));
        Object::new(ObjectId(id as u32), Group(0), geometry, Idle)
    };
    let stages = Stages {
        rules: Rules::new(),
        time_step: 1.0 / 240.0,
        gravity: Vec3::ZERO,
        callback_budget: None,
        simd: Simd::detect(),
    };
    Scene::new((0..objects).map(body).collect(), stages)
}

/// Does nothing, in every frame; unlike scenery it is asked to.
struct Idle;

impl Behavior for Idle {
    fn update(&mut self, _geometry: &mut Geometry, _input: &mut Input<'_>) {}
}
