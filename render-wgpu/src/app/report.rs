//! What a run comes to: a table for people, JSON for programs.

use std::io::Write;

use dualframe_sim::executor::StageSeconds;
use dualframe_sim::manager::{Settings, VeManager};
use dualframe_sim::object::{Drawing, Fault, FaultKind, ObjectId};
use dualframe_sim::scene::craniotomy;
use dualframe_sim::simd::Simd;
use serde::{Serialize, Serializer};

use super::args::frames_in_flight;
use super::error::RunError;
use super::haptics::HapticsReport;
use super::manage::Spent;
use super::measure::Measure;
use super::outputs::{self, Output};

/// A run's report. The JSON keys stay as they are; more may come.
#[derive(Serialize)]
pub(super) struct Report {
    pub(super) scene: &'static str,
    pub(super) executor: &'static str,
    pub(super) threads: usize,
    pub(super) simd: &'static str,
    pub(super) objects: usize,
    pub(super) nodes: usize,
    pub(super) springs: usize,
    pub(super) frames: u64,
    pub(super) seed: u64,
    pub(super) gravity: bool,
    pub(super) frames_in_flight: u8,
    pub(super) seconds: f64,
    pub(super) fps: f64,
    /// Over the serial executor, on the same first frames; not where frames are drawn.
    pub(super) speed_up: Option<f64>,
    /// The first ones, of which the report has times, candidates and collisions: of a window's not always all.
    pub(super) frames_measured: usize,
    pub(super) frame_ms: FrameMilliseconds,
    pub(super) candidates: Vec<u32>,
    pub(super) collisions: Vec<u32>,
    pub(super) state_hash: String,
    pub(super) allocations: usize,
    pub(super) stage_seconds: Vec<WorkerSeconds>,
    pub(super) quarantined: Vec<Quarantined>,
    pub(super) non_finite: usize,
    /// Of a craniotomy.
    #[serde(flatten)]
    pub(super) operation: Option<OperationReport>,
}

/// What came of an operation.
#[derive(Serialize)]
pub(super) struct OperationReport {
    pub(super) step: &'static str,
    /// Pieces of bone that came free.
    pub(super) pieces: usize,
    /// Bone that was drilled away, of the skull and of pieces, in cubic millimetres of full bone.
    pub(super) bone_removed_mm3: f64,
    pub(super) score: ScoreReport,
    /// Of the hands' haptic loops, where there were some.
    pub(super) haptics: Vec<HapticsReport>,
}

/// What educators measure.
#[derive(Serialize)]
pub(super) struct ScoreReport {
    seconds: f64,
    drilling_seconds: f64,
    air_seconds: f64,
    peak_force_n: f32,
    force_p95_n: f32,
    peak_tissue_force_n: f32,
    peak_dural_force_n: f32,
    plunge_mm: f32,
    dural_tears: u32,
    dural_tear_mm: f32,
    /// Null without a burr hole.
    burr_hole_error_mm: Option<f32>,
    burr_hole_angle_deg: Option<f32>,
    /// Null without a cut.
    margin_error_mean_mm: Option<f32>,
    margin_error_max_mm: Option<f32>,
    /// The share of the outline that is cut.
    outline_cut: f32,
    bone_outside_plan_mm3: f64,
}

impl From<craniotomy::Report> for ScoreReport {
    fn from(report: craniotomy::Report) -> Self {
        let craniotomy::Report { burr_hole, margin, .. } = report;
        Self {
            seconds: report.seconds,
            drilling_seconds: report.drilling_seconds,
            air_seconds: report.air_seconds,
            peak_force_n: report.peak_force,
            force_p95_n: report.force_p95,
            peak_tissue_force_n: report.peak_tissue_force,
            peak_dural_force_n: report.peak_dural_force,
            plunge_mm: report.plunge * 1e3,
            dural_tears: report.dural_tears,
            dural_tear_mm: report.dural_tear_length * 1e3,
            burr_hole_error_mm: burr_hole.map(|hole| hole.error * 1e3),
            burr_hole_angle_deg: burr_hole.map(|hole| hole.angle.to_degrees()),
            margin_error_mean_mm: margin.map(|margin| margin.mean * 1e3),
            margin_error_max_mm: margin.map(|margin| margin.greatest * 1e3),
            outline_cut: margin.map_or(0.0, |margin| margin.cut),
            bone_outside_plan_mm3: report.bone_outside_plan * 1e9,
        }
    }
}

/// Percentiles of the times from swap to swap, in milliseconds.
#[derive(Serialize)]
pub(super) struct FrameMilliseconds {
    p50: f64,
    p99: f64,
    p999: f64,
    max: f64,
}

impl FrameMilliseconds {
    /// Of times in nanoseconds; zeros if there are none.
    pub(super) fn of(nanoseconds: &[u64]) -> Self {
        let mut sorted = nanoseconds.to_vec();
        sorted.sort_unstable();
        // The nearest rank: the smallest time that at least this share of the frames kept to.
        let at = |share: f64| {
            let rank = (share * sorted.len() as f64).ceil() as usize;
            let time = sorted.get(rank.saturating_sub(1)).copied().unwrap_or(0);
            time as f64 * 1e-6
        };
        Self { p50: at(0.5), p99: at(0.99), p999: at(0.999), max: at(1.0) }
    }
}

/// Seconds of one worker.
#[derive(Serialize)]
pub(super) struct WorkerSeconds {
    broad_phase: f64,
    interaction: f64,
    update: f64,
    render: f64,
    idle: f64,
}

impl From<&StageSeconds> for WorkerSeconds {
    fn from(seconds: &StageSeconds) -> Self {
        let StageSeconds { broad_phase, interaction, update, render, idle } = *seconds;
        Self { broad_phase, interaction, update, render, idle }
    }
}

/// An object that was taken out.
#[derive(Serialize)]
pub(super) struct Quarantined {
    object: u32,
    #[serde(serialize_with = "as_text")]
    fault: FaultKind,
    frame: u64,
}

fn as_text<S: Serializer>(fault: &FaultKind, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.collect_str(fault)
}

impl From<&(ObjectId, Fault)> for Quarantined {
    fn from(&(object, Fault { kind, frame }): &(ObjectId, Fault)) -> Self {
        Self { object: object.0, fault: kind, frame }
    }
}

impl Report {
    /// Of a run in a scene of this kind that has ended, as far as all scenes have it. `spent` is what workers did
    /// under earlier managers.
    pub(super) fn of(
        scene: &'static str,
        simd: Simd,
        manager: &VeManager,
        spent: Spent,
        measure: &Measure<'_>,
    ) -> Self {
        let (mut objects, mut nodes, mut springs) = (0, 0, 0);
        manager.visit(&mut |object| {
            // Walls are no objects to whoever counts them.
            objects += usize::from(object.drawing != Drawing::Hidden);
            if let Some(mesh) = object.geometry.as_mesh() {
                nodes += mesh.positions.len();
                springs += mesh.topology().spring_count();
            }
        });
        let seconds = measure.seconds();
        // A window may have changed them.
        let Settings { executor, threads, .. } = manager.settings();
        let quarantined = manager.quarantined();
        let non_finite =
            quarantined.iter().filter(|(_, fault)| fault.kind == FaultKind::NonFinite).count();
        Self {
            scene,
            executor: executor.name(),
            threads,
            simd: simd.instructions().name(),
            objects,
            nodes,
            springs,
            frames: measure.frames,
            seed: 0,
            gravity: true,
            frames_in_flight: frames_in_flight(&manager.settings()),
            seconds,
            fps: measure.frames as f64 / seconds.max(f64::MIN_POSITIVE),
            speed_up: None,
            frames_measured: measure.frame_times.len(),
            frame_ms: FrameMilliseconds::of(&measure.frame_times),
            candidates: measure.candidates.clone(),
            collisions: measure.collisions.clone(),
            state_hash: format!("{:016x}", manager.state_hash()),
            allocations: measure.allocations(),
            stage_seconds: spent.with(manager).iter().map(Into::into).collect(),
            quarantined: quarantined.iter().map(Into::into).collect(),
            non_finite,
            operation: None,
        }
    }

    /// Whether every object came through.
    pub(super) fn is_sound(&self) -> bool {
        self.quarantined.is_empty()
    }

    /// Writes the report as one JSON object.
    pub(super) fn write(&self, file: &Output) -> Result<(), RunError> {
        file.write_json(self)
    }

    /// Prints the closing table.
    pub(super) fn print(&self) -> Result<(), RunError> {
        outputs::print(|out| self.table(out))
    }

    fn table(&self, out: &mut impl Write) -> std::io::Result<()> {
        let Self { executor, threads, simd, objects, frames, seconds, fps, frame_ms, .. } = self;
        writeln!(
            out,
            "{}: {objects} objects, {} nodes, {} springs; {frames} frames, seed {}",
            self.scene, self.nodes, self.springs, self.seed
        )?;
        writeln!(out, "{executor} on {threads} threads ({simd}): {fps:.1} fps, {seconds:.3} s")?;
        if let Some(speed_up) = self.speed_up {
            writeln!(out, "speed-up over the serial run: {speed_up:.2} (first frames of both)")?;
        }
        let FrameMilliseconds { p50, p99, p999, max } = frame_ms;
        let measured = self.frames_measured;
        if (measured as u64) < *frames {
            writeln!(out, "of the first {measured} frames:")?;
        }
        writeln!(
            out,
            "frame time, ms: median {p50:.3}, 99 % {p99:.3}, 99.9 % {p999:.3}, longest {max:.3}"
        )?;
        let collisions: u64 = self.collisions.iter().map(|&count| u64::from(count)).sum();
        let mean = collisions as f64 / self.collisions.len().max(1) as f64;
        writeln!(out, "collisions a frame: {mean:.1}; allocations: {}", self.allocations)?;
        writeln!(out, "state hash: {}", self.state_hash)?;
        if let Some(operation) = &self.operation {
            operation.lines(out)?;
        }
        writeln!(out, "\nseconds  broad phase  interaction   update   render     idle")?;
        for (index, worker) in self.stage_seconds.iter().enumerate() {
            let WorkerSeconds { broad_phase, interaction, update, render, idle } = worker;
            writeln!(
                out,
                "{index:7}  {broad_phase:11.3}  {interaction:11.3}  {update:7.3}  {render:7.3}  {idle:7.3}"
            )?;
        }
        for Quarantined { object, fault, frame } in &self.quarantined {
            writeln!(out, "quarantined: object {object}, {fault} in frame {frame}")?;
        }
        Ok(())
    }
}

impl OperationReport {
    fn lines(&self, out: &mut impl Write) -> std::io::Result<()> {
        let Self { step, pieces, bone_removed_mm3, score, haptics } = self;
        writeln!(out, "{step}: {bone_removed_mm3:.1} mm³ of bone removed, {pieces} pieces free")?;
        writeln!(
            out,
            "drilled for {:.1} s of {:.1} s, {:.1} s of it in air; force {:.1} N, 95 % below {:.2} N",
            score.drilling_seconds,
            score.seconds,
            score.air_seconds,
            score.peak_force_n,
            score.force_p95_n
        )?;
        writeln!(
            out,
            "past the inner table by {:.2} mm; {} dural tears, {:.1} mm; soft tissue {:.2} N, dura {:.2} N",
            score.plunge_mm,
            score.dural_tears,
            score.dural_tear_mm,
            score.peak_tissue_force_n,
            score.peak_dural_force_n
        )?;
        let outside = score.bone_outside_plan_mm3;
        writeln!(out, "{outside:.1} mm³ of bone removed outside the plan")?;
        if let (Some(error), Some(angle)) = (score.burr_hole_error_mm, score.burr_hole_angle_deg) {
            writeln!(out, "burr hole {error:.2} mm and {angle:.1}° from the plan")?;
        }
        if let (Some(mean), Some(max)) = (score.margin_error_mean_mm, score.margin_error_max_mm) {
            let cut = 100.0 * score.outline_cut;
            writeln!(
                out,
                "{cut:.0} % of the outline cut, {mean:.2} mm from the plan, {max:.2} mm at most"
            )?;
        }
        haptics.iter().try_for_each(|hand| writeln!(out, "{hand}"))
    }
}
