//! What educators measure of an operation.

use glam::Vec3;

use crate::behavior::{Instrument, Tool};
use crate::object::Object;

/// The steps in which forces are counted, in newtons; usually 0.25.
const FORCE_STEP: f32 = 0.25;
/// The steps counted; the last one takes all that is more. 400 are 100 N.
const FORCE_STEPS: usize = 400;
/// How far below the inner table the dura lies, and gives way to a bit without harm, in metres; usually
/// 1 mm: half a millimetre of dura, and what it yields.
const DURA_GIVES: f32 = 0.001;

/// What is counted while an operation goes on; see [`Score::report`].
#[derive(Clone, Debug)]
pub struct Score {
    time_step: f32,
    frames: u64,
    drilling: u64,
    in_air: u64,
    /// Frames by the force of bone on a turning bit.
    forces: Vec<u32>,
    peak: f32,
    tissue_peak: f32,
    plunge: f32,
    tears: u32,
    tear: f32,
    /// Where each tool's bit is in the dura, if it is.
    inside: [Option<Vec3>; 2],
}

/// What educators measure, so far (NeuroTouch; the CNS craniotomy simulator).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Report {
    /// Of the operation, in seconds.
    pub seconds: f64,
    /// In which a bit turned, in seconds.
    pub drilling_seconds: f64,
    /// In which it turned and touched no bone, in seconds.
    pub air_seconds: f64,
    /// The greatest force of bone on a turning bit, in newtons.
    pub peak_force: f32,
    /// The force that 95 % of the drilling stayed below, in newtons, in steps of 0.25.
    pub force_p95: f32,
    /// The greatest force of soft tissue on a tool, in newtons.
    pub peak_tissue_force: f32,
    /// How far past the inner table a bit came, in metres.
    pub plunge: f32,
    /// How often a turning bit came into the dura.
    pub dural_tears: u32,
    /// How far bits went in it, in metres.
    pub dural_tear_length: f32,
}

impl Score {
    /// Of an operation that begins; `time_step` is a frame's, in seconds.
    #[must_use]
    pub fn new(time_step: f32) -> Self {
        Self {
            time_step,
            frames: 0,
            drilling: 0,
            in_air: 0,
            forces: vec![0; FORCE_STEPS],
            peak: 0.0,
            tissue_peak: 0.0,
            plunge: 0.0,
            tears: 0,
            tear: 0.0,
            inside: [None; 2],
        }
    }

    /// A frame is over.
    pub fn frame(&mut self) {
        self.frames += 1;
    }

    /// Notes what tool number `hand` (0 or 1) did in this frame. `past_inner_table` says how far a place is
    /// past the skull's inner table, in metres, negative before it.
    pub fn note(&mut self, hand: usize, tool: &Object, past_inner_table: impl Fn(Vec3) -> f32) {
        let (Some(tool), Some(rigid)) = (Tool::of(tool), tool.geometry.as_rigid()) else { return };
        let work = tool.work();
        self.tissue_peak = self.tissue_peak.max(work.tissue.length());
        let tip = rigid.pose.translation;
        if !work.turns {
            self.inside[hand] = None;
            return;
        }
        let force = work.bone.length();
        self.drilling += 1;
        self.in_air += u64::from(force == 0.0);
        // As an integer, what is not a number becomes 0.
        let step = (force / FORCE_STEP) as usize;
        self.forces[step.min(FORCE_STEPS - 1)] += 1;
        self.peak = self.peak.max(force);
        let past = past_inner_table(tip);
        self.plunge = self.plunge.max(past);
        // A craniotome's foot lifts the dura off its bit.
        let tears = past > DURA_GIVES && tool.instrument() != Instrument::Craniotome;
        match (self.inside[hand], tears) {
            (None, true) => self.tears += 1,
            (Some(before), true) => self.tear += before.distance(tip),
            _ => {}
        }
        self.inside[hand] = tears.then_some(tip);
    }

    /// What was measured so far.
    #[must_use]
    pub fn report(&self) -> Report {
        let seconds = |frames: u64| frames as f64 * f64::from(self.time_step);
        Report {
            seconds: seconds(self.frames),
            drilling_seconds: seconds(self.drilling),
            air_seconds: seconds(self.in_air),
            peak_force: self.peak,
            force_p95: self.percentile(0.95),
            peak_tissue_force: self.tissue_peak,
            plunge: self.plunge,
            dural_tears: self.tears,
            dural_tear_length: self.tear,
        }
    }

    /// The force that this share of the drilling stayed below.
    fn percentile(&self, share: f64) -> f32 {
        let all = (self.drilling as f64 * share).ceil() as u64;
        let mut below = 0;
        let step = self.forces.iter().position(|&frames| {
            below += u64::from(frames);
            below >= all
        });
        if self.drilling == 0 { 0.0 } else { (step.unwrap_or(0) + 1) as f32 * FORCE_STEP }
    }
}
