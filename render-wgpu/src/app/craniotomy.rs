//! `dualframe craniotomy`.

use std::fs::File;
use std::io::BufWriter;
use std::path::Path;
use std::sync::Arc;

use dualframe_render_wgpu::camera::Camera;
use dualframe_render_wgpu::look::{Look, Quality};
use dualframe_sim::behavior::Bone;
use dualframe_sim::blocking::Grain;
use dualframe_sim::executor::{ExecutorError, FrameRecord};
use dualframe_sim::geometry::{Bounds, Volume};
use dualframe_sim::image;
use dualframe_sim::manager::VeManager;
use dualframe_sim::render::{NullRenderer, Renderer};
use dualframe_sim::scene::craniotomy::{LOOK_FRAMES, Operation, SKULL};
use dualframe_sim::timeline::Timeline;
use glam::Vec3;

use super::AllocationCounter;
use super::args::CraniotomyArgs;
use super::measure::Measure;
use super::outputs::{self, Outputs};
use super::particles::{RunError, TRACED_SPANS, progress_bar};
use super::pictures::Pictures;
use super::recording::Recording;
use super::report::{OperationReport, Report};
use super::scenes::Patient;

/// From how far the place of the operation is seen, over the size of its box.
const DISTANCE: f32 = 1.4;

/// Operates as `args` say.
pub(super) fn run(
    args: &CraniotomyArgs,
    patient: &Patient,
    outputs: &Outputs,
    count: AllocationCounter<'_>,
) -> Result<Report, RunError> {
    let settings = args.way.settings(Grain::Pairwise);
    let mut operation = Operation::new(Arc::clone(&patient.head), Some(args.step));
    let frames = args.frames.unwrap_or_else(|| operation.frames());
    // One more for whoever renders beside rayon's workers.
    let timeline = Arc::new(Timeline::new(settings.threads + 1, TRACED_SPANS));
    let manage = |scene| {
        let mut manager = VeManager::new(scene, settings)?;
        if outputs.trace.is_some() {
            manager.watch(Arc::clone(&timeline));
        }
        Ok::<_, ExecutorError>(manager)
    };
    let mut manager = manage(patient.build(args.way.simd())?)?;
    let mut recording = Recording::begin(outputs.record.as_ref(), patient.spec(), &manager)?;
    let mut pictures = Pictures::new(&args.products, frames, look(operation.region()))?;
    let mut measure = Measure::new(Some(frames), count);
    let bar = progress_bar(frames);
    let mut unwatched = NullRenderer::new();
    let mut pieces = 0;
    measure.start();
    while manager.frame() < frames {
        let until_look = LOOK_FRAMES - manager.frame() % LOOK_FRAMES;
        let batch = until_look.min(frames - manager.frame());
        let renderer: &mut dyn Renderer = match &mut pictures {
            Some(pictures) => pictures,
            None => &mut unwatched,
        };
        let (hands, mut watch) = operation.parts(renderer);
        let mailbox = manager.mailbox();
        let mut on_frame = |record: &FrameRecord| {
            hands.swapped(record.frame, &mailbox);
            measure.frame(record);
            if !bar.is_hidden() {
                measure.beside(|| bar.inc(1));
            }
        };
        recording.run(&mut manager, batch, &mut watch, &mut on_frame)?;
        let freed;
        (manager, freed) = operation.look(manager, manage)?;
        if freed > 0 {
            recording.objects(&manager)?;
            pieces += freed;
        }
    }
    recording.end(&manager)?;
    bar.finish_and_clear();
    if let Some(pictures) = pictures {
        pictures.finish(outputs.picture.as_ref())?;
    }
    if let Some(file) = &outputs.trace {
        let write = |writer: &mut BufWriter<&File>| timeline.write_chrome_trace(writer);
        outputs::replace(file, write).map_err(RunError::Trace)?;
    }
    if let Some(path) = &args.save {
        save(patient, &manager, path)?;
    }
    let score = operation.report(|see| manager.visit(see)).into();
    let bone_removed_mm3 = removed(&manager) * 1e9;
    let step = args.step.name();
    let operation = Some(OperationReport { step, pieces, bone_removed_mm3, score });
    let report = Report::of("craniotomy", args.way.simd(), &manager, &measure);
    Ok(Report { operation, ..report })
}

/// What the place of the operation looks like: from above and from the side of the surgeon, who stands at
/// the patient's head.
fn look(region: Bounds) -> impl FnOnce(Quality) -> (Look, Camera) {
    move |quality| {
        let around = Camera::around(&region);
        let camera =
            Camera { pitch: 0.75, yaw: 0.15, distance: DISTANCE * around.distance, ..around };
        let light = Vec3::new(-0.35, 1.0, 0.6);
        // The whole head, for its shadows.
        let focus = Bounds { min: Vec3::splat(-0.11), max: Vec3::splat(0.11) };
        (Look { light, room: false, ..Look::room(focus, quality) }, camera)
    }
}

/// The bone that was drilled away, in cubic metres of full bone.
fn removed(manager: &VeManager) -> f64 {
    let mut removed = 0.0;
    manager.visit(&mut |object| {
        let behavior: &dyn std::any::Any = &*object.behavior;
        let bone = behavior.downcast_ref::<Bone>().zip(object.geometry.as_volume());
        removed += bone.map_or(0.0, |(bone, volume)| bone.removed_volume(volume));
    });
    removed
}

/// Writes the computed tomography as it is after the operation; bone that lies elsewhere is gone.
fn save(patient: &Patient, manager: &VeManager, path: &Path) -> Result<(), RunError> {
    let (mut skull, mut pieces) = (None, Vec::<Volume>::new());
    manager.visit(&mut |object| match object.geometry.as_volume() {
        Some(volume) if object.id() == SKULL => skull = Some(volume.clone()),
        Some(volume) => pieces.push(volume.clone()),
        None => {}
    });
    let Some(skull) = skull else { return Ok(()) };
    let pieces: Vec<&Volume> = pieces.iter().collect();
    let after = patient.head.drilled(&skull, &pieces)?;
    image::save(path, after.grid(), after.voxels()).map_err(RunError::Image)
}
