//! `dualframe craniotomy`.

use std::cell::Cell;
use std::path::Path;
use std::sync::Arc;
use std::thread;

use dualframe_render_wgpu::camera::Camera;
use dualframe_render_wgpu::look::Look;
use dualframe_sim::blocking::Grain;
use dualframe_sim::device::link::{HapticLink, SimulationEnd, ToolState};
use dualframe_sim::device::motion::Motion;
use dualframe_sim::executor::{ExecutorError, FrameRecord, OnFrame};
use dualframe_sim::geometry::{Bounds, Volume};
use dualframe_sim::image;
use dualframe_sim::manager::VeManager;
use dualframe_sim::render::{NullRenderer, Renderer};
use dualframe_sim::scene::Scene;
use dualframe_sim::scene::craniotomy::{
    self, LOOK_FRAMES, Operation, SKULL, Step, TIME_STEP, TOOLS,
};
use glam::Vec3;

use super::AllocationCounter;
use super::args::CraniotomyArgs;
use super::error::RunError;
use super::haptics::{Cells, Each, Loops};
use super::manage::{Manage, Spent, go_on, manage, timeline_of};
use super::measure::Measure;
use super::operator::Operator;
use super::outputs::Outputs;
use super::pictures::Pictures;
use super::progress::Progress;
use super::recording::Recording;
use super::report::{OperationReport, Report};
use super::scenes::Patient;
use super::told::Told;
use super::window::{CraniotomyAtHand, Session};

/// From how far the place of the operation is seen, over the size of its box.
const DISTANCE: f32 = 1.4;

/// Operates as `args` say.
pub(super) fn run(
    args: &CraniotomyArgs,
    patient: &Patient,
    outputs: &Outputs,
    count: AllocationCounter<'_>,
    told: &Told,
) -> Result<Report, RunError> {
    let scene = patient.build(args.way.simd())?;
    let places = TOOLS.map(|tool| scene.objects[tool.0 as usize].center());
    let (cells, links) = (&mut Cells::new(places), &mut Each::<HapticLink>::default());
    // Haptic loops end with it.
    thread::scope(|scope| {
        let what = (args, patient, outputs);
        run_beside(|| Ok(cells.start(scope, args.haptic_rate)?), links, scene, what, count, told)
    })
}

/// Operates on a scene beside haptic loops: a person beside those that `start` starts, a script over `links`.
fn run_beside<'c>(
    start: impl FnOnce() -> Result<Loops<'c, 'c>, RunError>,
    links: &'c mut Each<HapticLink>,
    scene: Scene,
    (args, patient, outputs): (&CraniotomyArgs, &Patient, &Outputs),
    count: AllocationCounter<'_>,
    told: &Told,
) -> Result<Report, RunError> {
    let settings = args.way.settings(Grain::Pairwise);
    let at_hand = || Ok(CraniotomyAtHand::begin(args, patient, start()?));
    let how = (&args.way, &args.products);
    let spent = Spent::default();
    let window = match args.simulated_devices {
        true => None,
        false => Session::open(at_hand, how, TIME_STEP, &spent, told)?,
    };
    let traced = || outputs.trace.as_ref().map(|_| timeline_of(&args.products, settings.threads));
    let timeline = window.as_ref().map(Session::timeline).or_else(traced);
    let manager = manage(scene, settings, timeline.as_ref())?;
    let begin = |manager: &VeManager| {
        Recording::begin(outputs.record.as_deref(), patient.spec(), manager, told)
    };
    let (manager, surgery, measure) = match window {
        Some(window) => {
            let recording = begin(&manager);
            let mut measure = Measure::new(args.frames, count);
            measure.start();
            let picture = outputs.picture.as_ref();
            let (manager, at_hand) =
                window.run(manager, recording, args.frames, picture, &mut measure)?;
            (manager, at_hand.surgery, measure)
        }
        None => {
            let make = |scene| go_on(scene, settings, timeline.as_ref(), told);
            let how = (manager, Manage { make: &make, spent: &spent });
            run_unwatched((args, patient, outputs), links, how, begin, count, told)?
        }
    };
    told.attempt(outputs.write_trace(timeline.as_deref()));
    if let Some(output) = &outputs.save {
        told.attempt(save(patient, &manager, output.path()));
    }
    let report = Report::of("craniotomy", args.way.simd(), &manager, spent, &measure);
    Ok(Report { operation: Some(surgery.report(&manager)), ..report })
}

/// Runs without a window: a script operates. `begin` begins the recording.
fn run_unwatched<'a, 'c, 'h>(
    (args, patient, outputs): (&CraniotomyArgs, &Patient, &Outputs),
    links: &'h mut Each<HapticLink>,
    (mut manager, manage): (VeManager, Manage<'_>),
    begin: impl FnOnce(&VeManager) -> Recording<'a>,
    count: AllocationCounter<'c>,
    told: &Told,
) -> Result<(VeManager, Surgery<'h>, Measure<'c>), RunError> {
    let mut surgery = Surgery::new(patient, Some(args.step.unwrap_or(Step::All)));
    if args.simulated_devices {
        surgery.operator = Some(Operator::new(links, &mut surgery, args.haptic_rate)?);
    }
    let frames = args.frames.unwrap_or_else(|| surgery.frames());
    let mut pictures = Pictures::new(&args.products, frames, look(surgery.region()), told)?;
    let mut recording = begin(&manager);
    let mut unwatched = NullRenderer::new();
    let mut progress = Progress::begin(frames, count);
    while manager.frame() < frames {
        let renderer: &mut dyn Renderer = match &mut pictures {
            Some(pictures) => pictures,
            None => &mut unwatched,
        };
        let left = frames - manager.frame();
        let on_frame = &mut |record: &FrameRecord| progress.frame(record);
        let advanced = surgery.advance(&mut manager, &mut recording, left, renderer, on_frame);
        if told.attempt(advanced.map_err(RunError::from)).is_none() {
            break;
        }
        manager = surgery.look(manager, &mut recording, manage)?;
    }
    recording.end(&manager);
    let measure = progress.end();
    if let Some(pictures) = pictures {
        pictures.finish(outputs.picture.as_ref());
    }
    Ok((manager, surgery, measure))
}

/// An operation under way.
pub(super) struct Surgery<'c> {
    operation: Operation<'c>,
    /// How far a script operates.
    step: Option<Step>,
    /// Pieces of bone that came free.
    pieces: usize,
    /// Who moves devices as the script says, if they are simulated.
    operator: Option<Operator<'c>>,
    /// What the hands' haptic loops last said, where some are linked.
    pub(super) devices: Each<Option<ToolState>>,
}

impl<'c> Surgery<'c> {
    pub(super) fn new(patient: &Patient, step: Option<Step>) -> Self {
        let operation = Operation::new(Arc::clone(&patient.head), step);
        Self { operation, step, pieces: 0, operator: None, devices: Default::default() }
    }

    /// From now on a hand is where its device is.
    pub(super) fn link(&mut self, hand: usize, end: SimulationEnd<'c>) {
        self.operation.link(hand, end);
    }

    /// What a hand does by the script; none for one that does nothing.
    pub(super) fn motion(&self, hand: usize) -> Option<Motion> {
        self.operation.motion(hand)
    }

    /// The ends of the loops that the hands were linked with.
    pub(super) fn unlink(&mut self) -> Each<Option<SimulationEnd<'c>>> {
        self.operation.unlink()
    }

    /// The frames that the script takes; none without a script.
    pub(super) fn frames(&self) -> u64 {
        self.operation.frames()
    }

    /// The place of the operation.
    pub(super) fn region(&self) -> Bounds {
        self.operation.region()
    }

    /// What was measured so far.
    pub(super) fn score(&self, manager: &VeManager) -> craniotomy::Report {
        self.operation.report(|see| manager.visit(see))
    }

    /// Advances by so many frames, or until freed bone is to be looked for.
    pub(super) fn advance(
        &mut self,
        manager: &mut VeManager,
        recording: &mut Recording<'_>,
        frames: u64,
        renderer: &mut dyn Renderer,
        on_frame: &mut OnFrame<'_>,
    ) -> Result<(), ExecutorError> {
        let until_look = LOOK_FRAMES - manager.frame() % LOOK_FRAMES;
        let (hands, mut watch) = self.operation.parts(renderer);
        let mailbox = manager.mailbox();
        let mut on_frame = |record: &FrameRecord| {
            self.operator.iter_mut().for_each(|operator| operator.follow(record.frame));
            hands.swapped(record.frame, &mailbox);
            on_frame(record);
        };
        let run = recording.run(manager, frames.min(until_look), &mut watch, &mut on_frame);
        self.devices = [0, 1].map(|hand| hands.device(hand));
        run
    }

    /// Makes objects of bone that came free, if it is time to look for it.
    pub(super) fn look(
        &mut self,
        manager: VeManager,
        recording: &mut Recording<'_>,
        manage: Manage<'_>,
    ) -> Result<VeManager, RunError> {
        let (seconds, is_another) = (manager.stage_seconds(), Cell::new(false));
        let (manager, freed) = self.operation.look(manager, |scene| {
            is_another.set(true);
            (manage.make)(scene)
        })?;
        if is_another.get() {
            manage.spent.add(&seconds);
        }
        if freed > 0 {
            recording.objects(&manager);
            self.pieces += freed;
        }
        Ok(manager)
    }

    fn report(&self, manager: &VeManager) -> OperationReport {
        let score = self.score(manager);
        OperationReport {
            step: self.step.map_or("by hand", Step::name),
            pieces: self.pieces,
            bone_removed_mm3: score.bone_removed * 1e9,
            score: score.into(),
            haptics: self.devices.iter().flatten().map(Into::into).collect(),
        }
    }
}

/// What the place of the operation looks like: from above and from the side of the surgeon, who stands at
/// the patient's head.
pub(super) fn look(region: Bounds) -> (Look, Camera) {
    let around = Camera::around(&region);
    let camera = Camera { pitch: 0.75, yaw: 0.15, distance: DISTANCE * around.distance, ..around };
    let light = Vec3::new(-0.35, 1.0, 0.6);
    // The whole head, for its shadows.
    let focus = Bounds { min: Vec3::splat(-0.11), max: Vec3::splat(0.11) };
    (Look { light, room: false, ..Look::room(focus) }, camera)
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
