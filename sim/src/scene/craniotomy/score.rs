//! What educators measure of an operation.

use glam::Vec3;

use super::opening::{Margin, Opening};
use crate::behavior::drill::Bit;
use crate::behavior::{Instrument, Tool};
use crate::object::Object;
use crate::scene::head::Entry;

/// The steps in which forces are counted, in newtons; usually 0.25.
const FORCE_STEP: f32 = 0.25;
/// The steps counted; the last one takes all that is more. 400 are 100 N.
const FORCE_STEPS: usize = 400;
/// How far below the inner table the dura lies, and gives way to a bit without harm, in metres; usually
/// 1 mm: half a millimetre of dura, and what it yields.
const DURA_GIVES: f32 = 0.001;
/// How deep a perforator must be in a hole to bore it on, and not to begin another one, in metres; usually 1 mm: what
/// is less deep is a scratch.
const BORED: f32 = 0.001;

/// What is counted while an operation goes on; see [`Operation::report`](super::Operation::report).
#[derive(Clone, Debug)]
pub(super) struct Score {
    time_step: f32,
    frames: u64,
    drilling: u64,
    in_air: u64,
    /// Whether a bit turned in the frame that is not over yet, and whether one touched no bone.
    now: [bool; 2],
    /// Frames of each tool by the force of bone on its turning bit.
    forces: Vec<u32>,
    peak: f32,
    tissue_peak: f32,
    dura_peak: f32,
    plunge: f32,
    tears: u32,
    tear: f32,
    /// Where each tool's bit is in the dura, if it is.
    inside: [Option<Vec3>; 2],
    /// Whether each tool is a perforator that drills.
    perforates: [bool; 2],
    /// Where the last burr hole was begun, and the direction from there to the hand.
    hole: Option<(Vec3, Vec3)>,
}

/// How a burr hole was drilled, beside the plan.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Placement {
    /// How far from the planned entry the bit's axis goes through the outer table, in metres; where it runs along
    /// that, how far the tip is.
    pub error: f32,
    /// The angle between that axis and the planned direction, in radians.
    pub angle: f32,
}

/// What educators measure, so far (NeuroTouch; the CNS craniotomy simulator).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Report {
    /// Of the operation, in seconds.
    pub seconds: f64,
    /// In which a bit turned, in seconds; of both hands at once only once.
    pub drilling_seconds: f64,
    /// In which one turned and touched no bone, in seconds.
    pub air_seconds: f64,
    /// The greatest force of bone on a turning bit, in newtons.
    pub peak_force: f32,
    /// The force that 95 % of the drilling stayed below, in newtons, in steps of 0.25.
    pub force_p95: f32,
    /// The greatest force of soft tissue that tools press on, in newtons; of what is there only the dura presses back.
    pub peak_tissue_force: f32,
    /// The greatest force of the dura on a tool, in newtons.
    pub peak_dural_force: f32,
    /// How far past the inner table a turning bit without a foot came, in metres.
    pub plunge: f32,
    /// How often such a bit came into the dura: more than a millimetre past the inner table. The dura itself
    /// gives way to bits and is never torn.
    pub dural_tears: u32,
    /// How far they went in it, in metres.
    pub dural_tear_length: f32,
    /// How the last burr hole was begun; none without one. A perforator that goes back into it, or turns on in it,
    /// begins no other.
    pub burr_hole: Option<Placement>,
    /// The opening's edge; none before there is one.
    pub margin: Option<Margin>,
    /// The bone that was drilled away, of the skull and of pieces that came free, in cubic metres of full bone.
    pub bone_removed: f64,
    /// What of it was more than a millimetre beside the planned cut and burr hole, in cubic metres of full bone.
    pub bone_outside_plan: f64,
}

impl Score {
    /// Of an operation that begins; `time_step` is a frame's, in seconds.
    pub(super) fn new(time_step: f32) -> Self {
        Self {
            time_step,
            frames: 0,
            drilling: 0,
            in_air: 0,
            now: [false; 2],
            forces: vec![0; FORCE_STEPS],
            peak: 0.0,
            tissue_peak: 0.0,
            dura_peak: 0.0,
            plunge: 0.0,
            tears: 0,
            tear: 0.0,
            inside: [None; 2],
            perforates: [false; 2],
            hole: None,
        }
    }

    /// A frame is over.
    pub(super) fn frame(&mut self) {
        self.frames += 1;
        let [turned, in_air] = std::mem::take(&mut self.now).map(u64::from);
        self.drilling += turned;
        self.in_air += in_air;
    }

    /// Notes what tool number `hand` (0 or 1) did in this frame. `past_inner_table` says how far a place is
    /// past the skull's inner table, in metres, negative before it.
    pub(super) fn note(
        &mut self,
        hand: usize,
        tool: &Object,
        past_inner_table: impl Fn(Vec3) -> f32,
    ) {
        let (Some(tool), Some(rigid)) = (Tool::of(tool), tool.geometry.as_rigid()) else { return };
        let work = tool.work();
        self.tissue_peak = self.tissue_peak.max(work.tissue.length());
        self.dura_peak = self.dura_peak.max(work.dura.length());
        let tip = rigid.pose.translation;
        if !work.turns {
            (self.inside[hand], self.perforates[hand]) = (None, false);
            return;
        }
        let force = work.bone.length();
        let perforates = tool.instrument() == Instrument::Perforator && force > 0.0;
        // One that stopped in its hole, or was lifted out of it, bores on.
        let bores_on = self.perforates[hand] || self.hole.is_some_and(|hole| is_in(hole, tip));
        if perforates && !bores_on {
            self.hole = Some((tip, rigid.pose.rotation * Vec3::Z));
        }
        self.perforates[hand] = perforates;
        let [_, in_air] = self.now;
        self.now = [true, in_air | (force == 0.0)];
        // As an integer, what is not a number becomes 0.
        let step = (force / FORCE_STEP) as usize;
        self.forces[step.min(FORCE_STEPS - 1)] += 1;
        self.peak = self.peak.max(force);
        // A craniotome's foot is meant to go there, and lifts the dura off its bit.
        let has_foot = tool.instrument() == Instrument::Craniotome;
        let past = if has_foot { 0.0 } else { past_inner_table(tip) };
        self.plunge = self.plunge.max(past);
        let tears = past > DURA_GIVES;
        match (self.inside[hand], tears) {
            (None, true) => self.tears += 1,
            (Some(before), true) => self.tear += before.distance(tip),
            _ => {}
        }
        self.inside[hand] = tears.then_some(tip);
    }

    /// What was measured so far; `planned` is the burr hole.
    pub(super) fn report(&self, planned: &Entry, opening: &Opening<'_>) -> Report {
        let seconds = |frames: u64| frames as f64 * f64::from(self.time_step);
        Report {
            seconds: seconds(self.frames),
            drilling_seconds: seconds(self.drilling),
            air_seconds: seconds(self.in_air),
            peak_force: self.peak,
            force_p95: self.percentile(0.95),
            peak_tissue_force: self.tissue_peak,
            plunge: self.plunge,
            peak_dural_force: self.dura_peak,
            dural_tears: self.tears,
            dural_tear_length: self.tear,
            burr_hole: self.hole.map(|hole| placement(hole, planned)),
            margin: opening.margin(),
            bone_removed: opening.removed(),
            bone_outside_plan: opening.outside(),
        }
    }

    /// The force that this share of the drilling stayed below.
    fn percentile(&self, share: f64) -> f32 {
        let drilling: u64 = self.forces.iter().copied().map(u64::from).sum();
        let all = (drilling as f64 * share).ceil() as u64;
        let mut below = 0;
        let step = self.forces.iter().position(|&frames| {
            below += u64::from(frames);
            below >= all
        });
        if drilling == 0 { 0.0 } else { (step.unwrap_or(0) + 1) as f32 * FORCE_STEP }
    }
}

/// Whether a tip is in a hole that was begun with the tip at a place and the handle in a direction.
fn is_in((begun, axis): (Vec3, Vec3), tip: Vec3) -> bool {
    let depth = (begun - tip).dot(axis);
    depth > BORED && tip.distance(begun - axis * depth) < Bit::PERFORATOR.radius
}

/// Beside the plan, a hole that was begun with the tip at a place and the handle in a direction.
fn placement((tip, axis): (Vec3, Vec3), planned: &Entry) -> Placement {
    let Entry { point, inward, .. } = *planned;
    // Along the axis to the plane that touches the outer table at the planned entry.
    let way = (tip - point).dot(inward) / axis.dot(inward);
    let entry = if way.is_finite() { tip - axis * way } else { tip };
    Placement { error: entry.distance(point), angle: axis.angle_between(-inward) }
}

#[cfg(test)]
#[path = "score_tests.rs"]
mod tests;
