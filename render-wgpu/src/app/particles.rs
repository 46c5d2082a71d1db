//! `dualframe particles`.

use std::fs::File;
use std::io::BufWriter;
use std::sync::Arc;

use dualframe_render_wgpu::camera::Camera;
use dualframe_render_wgpu::look::Look;
use dualframe_sim::blocking::Grain;
use dualframe_sim::executor::{ExecutorKind, FrameRecord};
use dualframe_sim::geometry::Bounds;
use dualframe_sim::manager::{Settings, VeManager};
use dualframe_sim::record::RecordError;
use dualframe_sim::render::{NullRenderer, Renderer};
use dualframe_sim::scene::{ParticleScene, Scene, SceneError};
use dualframe_sim::timeline::Timeline;

use super::AllocationCounter;
use super::args::Particles;
use super::error::RunError;
use super::manage::Spent;
use super::measure::Measure;
use super::outputs::{self, Outputs};
use super::pictures::Pictures;
use super::progress;
use super::recording::Recording;
use super::report::Report;
use super::told::Told;
use super::window::{ParticlesAtHand, Session, most_threads};

/// Frames that are run serially too, to say what the speed-up is.
const REFERENCE_FRAMES: u64 = 48;
/// Spans of a worker that its timeline keeps for a trace; usually 65,536, some seconds of work.
pub(super) const TRACED_SPANS: usize = 1 << 16;
/// Spans of a worker that its timeline keeps for a window; usually 4,096, more than is shown.
pub(super) const SHOWN_SPANS: usize = 1 << 12;

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
    let spans = if args.products.trace.is_some() { TRACED_SPANS } else { SHOWN_SPANS };
    // One more for whoever renders beside rayon's workers.
    let workers = most_threads(args.way.threads) + 1;
    let timeline = Arc::new(Timeline::new(workers, spans));
    let how = (&args.way, &args.products);
    let time_step = ParticleScene::TIME_STEP;
    let at_hand = || Ok(ParticlesAtHand::begin(args));
    let spent = Spent::default();
    let window = Session::open(at_hand, how, time_step, (&timeline, &spent), told)?;
    let mut manager = VeManager::new(build(args)?, settings)?;
    if window.is_some() || outputs.trace.is_some() {
        manager.watch(Arc::clone(&timeline));
    }
    let report = match window {
        Some(window) => {
            let recording = begin_recording(args, outputs, &manager, told)?;
            let mut measure = Measure::new(args.frames, count);
            measure.start();
            let picture = outputs.picture.as_deref();
            let (manager, _) =
                window.run(manager, recording, args.frames, picture, &mut measure)?;
            report(args, &manager, spent, &measure, None)
        }
        None => run_unwatched(args, outputs, manager, count, told)?,
    };
    if let Some(file) = &outputs.trace {
        let write = |writer: &mut BufWriter<&File>| timeline.write_chrome_trace(writer);
        told.attempt(outputs::replace(file, write).map_err(RunError::Trace));
    }
    Ok(report)
}

fn begin_recording<'a>(
    args: &Particles,
    outputs: &'a Outputs,
    manager: &VeManager,
    told: &'a Told,
) -> Result<Recording<'a>, RecordError> {
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
    let mut recording = begin_recording(args, outputs, &manager, told)?;
    let mut measure = Measure::new(Some(frames), count);
    let bar = progress::of_frames(frames);
    measure.start();
    let mut on_frame = |record: &FrameRecord| {
        measure.frame(record);
        if !bar.is_hidden() {
            measure.beside(|| bar.inc(1));
        }
    };
    let mut unwatched = NullRenderer::new();
    let renderer: &mut dyn Renderer = match &mut pictures {
        Some(pictures) => pictures,
        None => &mut unwatched,
    };
    recording.run(&mut manager, frames, renderer, &mut on_frame)?;
    recording.end(&manager);
    bar.finish_and_clear();
    let is_drawn = pictures.is_some();
    if let Some(pictures) = pictures {
        pictures.finish(outputs.picture.as_deref());
    }
    let settings = manager.settings();
    let speed_up = match settings.executor {
        // Drawing is no part of the serial run.
        _ if is_drawn => None,
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
    let mut manager = VeManager::new(build(args)?, settings)?;
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
