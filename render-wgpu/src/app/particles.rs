//! `dualframe particles`.

use dualframe_sim::executor::{ExecutorError, ExecutorKind};
use dualframe_sim::manager::{Settings, VeManager};
use dualframe_sim::object::FaultKind;
use dualframe_sim::render::NullRenderer;
use dualframe_sim::scene::{ParticleScene, Scene, SceneError};
use indicatif::{ProgressBar, ProgressStyle};
use thiserror::Error;

use super::AllocationCounter;
use super::args::Particles;
use super::measure::Measure;
use super::report::{FrameMilliseconds, Report};

/// Frames that are run serially too, to say what the speed-up is.
const REFERENCE_FRAMES: u64 = 48;

/// Why a run failed.
#[derive(Debug, Error)]
pub(super) enum RunError {
    #[error(transparent)]
    Scene(#[from] SceneError),
    #[error(transparent)]
    Executor(#[from] ExecutorError),
}

/// Runs the environment as `args` say.
pub(super) fn run(args: &Particles, count: AllocationCounter<'_>) -> Result<Report, RunError> {
    let scene = ParticleScene {
        seed: args.seed,
        gravity: args.gravity,
        ..ParticleScene::new(args.objects)
    };
    let build = || {
        let mut scene = scene.build()?;
        scene.stages.simd = args.simd();
        Ok::<_, SceneError>(scene)
    };
    let settings = Settings {
        executor: args.executor,
        threads: args.threads,
        pinned: false,
        grain: args.grain(),
        entry: args.entry(),
    };
    let mut manager = VeManager::new(build()?, settings)?;
    let mut measure = Measure::new(args.frames, count);
    let bar = progress_bar(args.frames);
    measure.start();
    manager.run(args.frames, &mut NullRenderer::new(), &mut |record| {
        measure.frame(record);
        if !bar.is_hidden() {
            measure.beside(|| bar.inc(1));
        }
    })?;
    bar.finish_and_clear();
    let speed_up = match settings.executor {
        ExecutorKind::Serial => 1.0,
        _ => {
            serial_seconds(build()?, settings, args.frames)?
                / measure.seconds_of_first(REFERENCE_FRAMES)
        }
    };
    Ok(report(args, &manager, &measure, speed_up))
}

/// Progress on standard error, if somebody looks at it.
fn progress_bar(frames: u64) -> ProgressBar {
    let style = ProgressStyle::with_template("{bar:40} {pos}/{len} frames, {per_sec}, {eta} left");
    let bar = ProgressBar::new(frames);
    match style {
        Ok(style) => bar.with_style(style),
        Err(_) => bar,
    }
}

/// Seconds that the serial executor takes for the first frames of the same environment.
fn serial_seconds(scene: Scene, settings: Settings, frames: u64) -> Result<f64, RunError> {
    let settings = Settings { executor: ExecutorKind::Serial, threads: 1, ..settings };
    let mut manager = VeManager::new(scene, settings)?;
    let frames = frames.min(REFERENCE_FRAMES);
    let mut measure = Measure::new(frames, &|| 0);
    measure.start();
    manager.run(frames, &mut NullRenderer::new(), &mut |record| measure.frame(record))?;
    Ok(measure.seconds())
}

fn report(args: &Particles, manager: &VeManager, measure: &Measure<'_>, speed_up: f64) -> Report {
    let (mut nodes, mut springs) = (0, 0);
    manager.visit(&mut |object| {
        if let Some(mesh) = object.geometry.as_mesh() {
            nodes += mesh.positions.len();
            springs += mesh.topology().spring_count();
        }
    });
    let seconds = measure.seconds();
    let quarantined = manager.quarantined();
    let non_finite =
        quarantined.iter().filter(|(_, fault)| fault.kind == FaultKind::NonFinite).count();
    Report {
        scene: "particles",
        executor: args.executor.name(),
        threads: args.threads,
        simd: args.simd().instructions().name(),
        objects: args.objects,
        nodes,
        springs,
        frames: args.frames,
        seed: args.seed,
        gravity: args.gravity,
        frames_in_flight: args.frames_in_flight,
        seconds,
        fps: args.frames as f64 / seconds,
        speed_up,
        frame_ms: FrameMilliseconds::of(&measure.frame_times),
        candidates: measure.candidates.clone(),
        collisions: measure.collisions.clone(),
        state_hash: format!("{:016x}", manager.state_hash()),
        allocations: measure.allocations,
        stage_seconds: manager.stage_seconds().iter().map(Into::into).collect(),
        quarantined: quarantined.iter().map(Into::into).collect(),
        non_finite,
    }
}
