//! What an executor costs for each unit and frame: objects that do nothing and meet nobody, so that
//! everything beyond the serial executor's time is synchronisation.
//!
//! Synchronisation is the time of all threads together, less the serial executor's in the same
//! round, as medians over interleaved rounds. With `--test`, one tiny round.

use std::time::{Duration, Instant};

use dualframe_sim::behavior::{Behavior, Input};
use dualframe_sim::blocking::{Blocking, Grain};
use dualframe_sim::executor::ExecutorKind;
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

/// As many units for either grain that queues and lists are well filled.
const GRAINS: [(Grain, usize); 2] = [(Grain::Pairwise, 512), (Grain::Spatial, 4_096)];
const THREADS: [usize; 2] = [1, 2];
/// Radius of a body, in metres; usually a tenth of the distance to the next.
const RADIUS: f32 = 0.1;
/// Distance to the next body, in metres.
const SPACING: f32 = 1.0;
/// How long everybody rests before a measurement: OpenMP's threads go on spinning after a loop.
const REST: Duration = Duration::from_millis(30);

fn main() {
    let test = std::env::args().any(|argument| argument == "--test");
    let (rounds, frames) = if test { (1, 16) } else { (15, 320) };
    println!("{:<10} {:<18} threads  ns a unit and frame", "grain", "executor");
    println!("{:>42} {:>16}", "elapsed", "synchronisation");
    for (grain, objects) in GRAINS {
        let objects = if test { objects / 16 } else { objects };
        measure(grain, objects, rounds, frames);
    }
}

/// One executor with its times.
struct Subject {
    executor: ExecutorKind,
    threads: usize,
    manager: VeManager,
    elapsed: Vec<f64>,
}

impl Subject {
    fn new(executor: ExecutorKind, threads: usize, grain: Grain, objects: usize) -> Self {
        let settings = Settings { executor, threads, grain, ..Settings::default() };
        let manager = VeManager::new(idle(objects), settings).expect("all of it is allowed");
        Self { executor, threads, manager, elapsed: Vec::new() }
    }

    /// Seconds for so many frames.
    fn run(&mut self, frames: u64) -> f64 {
        std::thread::sleep(REST);
        let began = Instant::now();
        let ran = self.manager.run(frames, &mut NullRenderer::new(), &mut |_| ());
        ran.expect("no table is full");
        began.elapsed().as_secs_f64()
    }
}

fn measure(grain: Grain, objects: usize, rounds: usize, frames: u64) {
    let kinds = ExecutorKind::ALL.iter().copied().filter(|&kind| kind != ExecutorKind::Serial);
    let several = kinds.flat_map(|kind| THREADS.map(|threads| (kind, threads)));
    // The serial one first: the others are compared with it.
    let all = std::iter::once((ExecutorKind::Serial, 1)).chain(several);
    let mut subjects: Vec<_> =
        all.map(|(kind, threads)| Subject::new(kind, threads, grain, objects)).collect();
    for subject in &mut subjects {
        subject.run(frames);
    }
    for _ in 0..rounds {
        for subject in &mut subjects {
            let seconds = subject.run(frames);
            subject.elapsed.push(seconds);
        }
    }
    let serial = subjects[0].elapsed.clone();
    for Subject { executor, threads, elapsed, .. } in subjects {
        let each = 1e9 / (units(grain, objects, threads) as f64 * frames as f64);
        let beyond = elapsed.iter().zip(&serial).map(|(all, one)| all * threads as f64 - one);
        let (beyond, elapsed) = (median(beyond.collect()) * each, median(elapsed) * each);
        let (grain, name) = (format!("{grain:?}"), executor.name());
        println!("{grain:<10} {name:<18} {threads:>4} {elapsed:>8.0} {beyond:>16.0}");
    }
}

/// The number of units of a scene.
fn units(grain: Grain, objects: usize, threads: usize) -> usize {
    let (_, blocks) = Blocking::new(idle(objects).objects, grain, threads).expect("few objects");
    blocks.len()
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
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
