//! `dualframe particles`.

use dualframe_render_wgpu::camera::Camera;
use dualframe_render_wgpu::look::Look;
use dualframe_sim::blocking::Grain;
use dualframe_sim::executor::ExecutorKind;
use dualframe_sim::geometry::Bounds;
use dualframe_sim::manager::{Settings, VeManager};
use dualframe_sim::render::{NullRenderer, Renderer};
use dualframe_sim::scene::{ParticleScene, Scene, SceneError};

use super::AllocationCounter;
use super::args::Particles;
use super::error::RunError;
use super::manage::{Spent, manage, timeline_of};
use super::measure::Measure;
use super::outputs::Outputs;
use super::pictures::Pictures;
use super::progress::Progress;
use super::recording::Recording;
use super::report::Report;
use super::told::Told;
use super::window::{ParticlesAtHand, Session};

/// Frames that are run serially too, to say what the speed-up is.
const REFERENCE_FRAMES: u64 = 48;

/// The environment that `args` describe, with another number of particles.
pub(super) fn scene_of(args: &Particles, objects: usize) -> ParticleScene {
    ParticleScene { seed: args.seed, gravity: args.gravity, ..ParticleScene::new(objects) }
}

fn build(args: &Particles) -> Result<Scene, SceneError> {
    let mut scene = scene_of(args, args.objects).build()?;
    scene.stages.simd = args.way.simd();
    Ok(scene)
}

/// Runs the environment as `args` say.
pub(super) fn run(
    args: &Particles,
    outputs: &Outputs,
    count: AllocationCounter<'_>,
    told: &Told,
) -> Result<Report, RunError> {
    let settings = args.way.settings(Grain::Spatial);
    let how = (&args.way, &args.products);
    let time_step = ParticleScene::TIME_STEP;
    let at_hand = || Ok(ParticlesAtHand::begin(args));
    let spent = Spent::default();
    let window = Session::open(at_hand, how, time_step, &spent, told)?;
    let traced = || outputs.trace.as_ref().map(|_| timeline_of(&args.products, args.way.threads));
    let timeline = window.as_ref().map(Session::timeline).or_else(traced);
    let manager = manage(build(args)?, settings, timeline.as_ref())?;
    let report = match window {
        Some(window) => {
            let recording = begin_recording(args, outputs, &manager, told);
            let mut measure = Measure::new(args.frames, count);
            measure.start();
            let picture = outputs.picture.as_ref();
            let (manager, _) =
                window.run(manager, recording, args.frames, picture, &mut measure)?;
            report(args, &manager, spent, &measure, None)
        }
        None => run_unwatched(args, outputs, manager, count, told)?,
    };
    told.attempt(outputs.write_trace(timeline.as_deref()));
    Ok(report)
}

fn begin_recording<'a>(
    args: &Particles,
    outputs: &'a Outputs,
    manager: &VeManager,
    told: &'a Told,
) -> Recording<'a> {
    let spec = scene_of(args, args.objects);
    Recording::begin(outputs.record.as_deref(), &spec, manager, told)
}

/// What a room of particles looks like.
pub(super) fn look(room: Bounds) -> (Look, Camera) {
    (Look::room(room), Camera::around(&room))
}

/// Runs without a window.
fn run_unwatched(
    args: &Particles,
    outputs: &Outputs,
    mut manager: VeManager,
    count: AllocationCounter<'_>,
    told: &Told,
) -> Result<Report, RunError> {
    let frames = args.frames();
    let look = look(scene_of(args, args.objects).room());
    let mut pictures = Pictures::new(&args.products, frames, look, told)?;
    let mut recording = begin_recording(args, outputs, &manager, told);
    let mut progress = Progress::begin(frames, count);
    let mut unwatched = NullRenderer::new();
    let renderer: &mut dyn Renderer = match &mut pictures {
        Some(pictures) => pictures,
        None => &mut unwatched,
    };
    let run = recording.run(&mut manager, frames, renderer, &mut |record| progress.frame(record));
    let is_run = told.attempt(run.map_err(RunError::from)).is_some();
    recording.end(&manager);
    let measure = progress.end();
    let is_drawn = pictures.is_some();
    if let Some(pictures) = pictures {
        pictures.finish(outputs.picture.as_ref());
    }
    let settings = manager.settings();
    let speed_up = match settings.executor {
        // Drawing is no part of the serial run.
        _ if is_drawn || !is_run => None,
        ExecutorKind::Serial => Some(1.0),
        _ => {
            let serial = told.attempt(serial_seconds(args, settings, frames));
            serial.map(|seconds| seconds / measure.seconds_of_first(REFERENCE_FRAMES))
        }
    };
    Ok(report(args, &manager, Spent::default(), &measure, speed_up))
}

/// Seconds that the serial executor takes for the first frames of the same environment.
fn serial_seconds(args: &Particles, settings: Settings, frames: u64) -> Result<f64, RunError> {
    let settings = Settings { executor: ExecutorKind::Serial, threads: 1, ..settings };
    let mut manager = manage(build(args)?, settings, None)?;
    let frames = frames.min(REFERENCE_FRAMES);
    let mut measure = Measure::new(Some(frames), &|| 0);
    measure.start();
    manager.run(frames, &mut NullRenderer::new(), &mut |record| measure.frame(record))?;
    Ok(measure.seconds())
}

fn report(
    args: &Particles,
    manager: &VeManager,
    spent: Spent,
    measure: &Measure<'_>,
    speed_up: Option<f64>,
) -> Report {
    let report = Report::of("particles", args.way.simd(), manager, spent, measure);
    Report { seed: args.seed, gravity: args.gravity, speed_up, ..report }
}
