//! What a hand feels: a haptic loop's device moves a tool, and what the tool meets comes back as forces.

use std::collections::VecDeque;
use std::time::Instant;

use glam::{Mat3, Vec3};

use super::SKULL;
use crate::behavior::drill::Coupling;
use crate::behavior::{Tool, Work};
use crate::device::link::{SimulationEnd, ToolState};
use crate::device::model::{LocalModel, along};
use crate::device::proxy::{ContactStiffness, Proxy};
use crate::device::{DeviceError, DeviceSample};
use crate::object::{Object, ObjectId};

/// How many swaps before the last one the device was where the contacts of the frame that is drawn found the
/// tool: what is posted at a swap moves it in the frame after the next, and contacts find it a frame later.
const TOUCHED: usize = 2;
/// Likewise where the tool was when that which it holds was drawn there, which has told since.
const HELD: usize = 3;
/// How long a device may not be read before its buttons count as let go of, in seconds of its loop's clock, or how
/// long its loop may say nothing, in seconds; usually 0.25: a drill whose device was pulled out is not to go on.
const LETS_GO: f64 = 0.25;
/// How far a drill is led beside the device at most, in metres; usually 1 mm.
const SHIFT: f32 = 0.001;
/// The stiffness with which the dura is felt, in newtons per metre; usually 200, that of its contact.
const DURA: f32 = 200.0;
/// The greatest stiffness with which what is held is felt, in newtons per metre; usually 1,000.
const HOLD: f32 = 1_000.0;
/// How far what is held must be drawn to tell its stiffness, in metres; usually 2 mm.
const DRAWN: f32 = 0.002;
/// The force that it takes to cut scalp, in newtons; usually 1.
const CUTTING: f32 = 1.0;
/// How far scalp gives way before a blade cuts on, in metres; usually 3 mm.
const CUTTING_GIVES: f32 = 0.003;
/// The coefficient of friction of an instrument on bone; usually 0.2.
const FRICTION: f32 = 0.2;
/// How far an instrument gives way on bone before it slides, in metres; usually 0.5 mm. Bone from a CT is
/// uneven, with radii of some 10 mm, on which a hand that presses without friction swings to and fro, for
/// the slope that it feels is a frame old; friction over this is stiffer than the force over such a radius.
const FRICTION_GIVES: f32 = 0.000_5;

/// Joins a haptic loop with a tool.
///
/// The tool goes where the device is. What stands against it there is told to the loop as one local model a
/// frame: bone by a proxy on its surface; bone that a drill touches by the spring that pushes the drill on;
/// what the tool holds, by its pull; the dura, and scalp that is cut, by their forces.
#[derive(Debug)]
pub(super) struct Feel<'c> {
    end: SimulationEnd<'c>,
    /// What the loop said at the last swap.
    told: Option<ToolState>,
    /// From when on swaps found that the device could not be read, in seconds of the loop's clock, if the last one did.
    silent: Option<f64>,
    /// At which swap the loop had last said something new.
    heard: Instant,
    /// The device at the first look in the frame that is being drawn.
    now: Option<ToolState>,
    /// The device at the last swaps, the last one last.
    past: VecDeque<ToolState>,
    /// The tool as it is in the frame that is being drawn, if it was drawn already.
    next: Option<Seen>,
    /// The tool in the last frame that was drawn.
    tool: Option<Seen>,
    /// In the order of their numbers, whichever is drawn first.
    bones: Vec<Near>,
    /// Where the hand felt the surface of bone, if it touches any.
    rest: Option<Vec3>,
    /// By how much a drill in bone is led ahead of the device.
    shift: Option<Vec3>,
    /// Where the tool was when it took hold.
    grasp: Vec3,
    /// Of a blade in what it cuts, and of the tool on bone.
    drags: [Drag; 2],
}

/// The place of the device on a volume of bone.
#[derive(Clone, Copy, Debug)]
struct Near {
    bone: ObjectId,
    proxy: Proxy,
    /// Whether the bone was drawn in the frame that is being drawn.
    is_drawn: bool,
}

/// What was seen of a tool.
#[derive(Clone, Copy, Debug)]
struct Seen {
    tip: Vec3,
    work: Work,
    coupling: Option<Coupling>,
    /// Of a drill, the stiffness with which a hand pushes it on, in newtons per metre.
    push: Option<f32>,
}

impl<'c> Feel<'c> {
    pub(super) fn new(end: SimulationEnd<'c>) -> Self {
        let past = VecDeque::with_capacity(HELD + 2);
        let (now, next, tool, bones, drags) = (None, None, None, Vec::new(), Default::default());
        let (rest, shift, grasp) = (None, None, Vec3::ZERO);
        let (told, silent, heard) = (None, None, Instant::now());
        Self { end, told, silent, heard, now, past, next, tool, bones, rest, shift, grasp, drags }
    }

    pub(super) fn into_end(self) -> SimulationEnd<'c> {
        self.end
    }

    /// What the loop said of its device at the last swap, also that it cannot be read; none as long as it said nothing.
    pub(super) fn told(&self) -> Option<&ToolState> {
        self.told.as_ref()
    }

    /// Where the device was last, at a swap.
    fn device(&self) -> Option<&ToolState> {
        self.past.back()
    }

    /// The tool is this in the frame that is being drawn.
    pub(super) fn tool(&mut self, object: &Object) {
        let (Some(tool), Some(rigid)) = (Tool::of(object), object.geometry.as_rigid()) else {
            return;
        };
        let (tip, work) = (rigid.pose.translation, tool.work());
        if work.held == Vec3::ZERO {
            self.grasp = tip;
        }
        let coupling = tool.coupling();
        self.next = Some(Seen { tip, work, coupling, push: tool.coupling_stiffness() });
    }

    /// The bone, or a piece of it, is this in the frame that is being drawn. The tool, of which it depends whether
    /// bone is felt, may not have been drawn yet.
    pub(super) fn bone(&mut self, object: &Object) {
        let (Some(volume), Some(device)) = (object.geometry.as_volume(), self.look()) else {
            return;
        };
        let (bone, place) = (object.id(), device.sample.position);
        let known = self.bones.binary_search_by_key(&bone, |near| near.bone);
        // A flap that comes free under a hand is bone that the hand rests on already.
        let proxy = Proxy::new(self.rest.unwrap_or(place));
        let index = known.unwrap_or_else(|index| {
            self.bones.insert(index, Near { bone, proxy, is_drawn: true });
            index
        });
        let near = &mut self.bones[index];
        near.proxy.follow(place, volume);
        near.is_drawn = true;
    }

    /// A frame is drawn: tells the loop what to exert.
    pub(super) fn deliver(&mut self) {
        self.tool = self.next.take();
        // What is drawn no more, since it was removed or hidden, is not there to be felt.
        self.bones.retain_mut(|near| std::mem::take(&mut near.is_drawn));
        self.pass_through();
        if let Some(model) = self.model() {
            // A model that is no number is left out, and forces fade if none comes.
            let _ = self.end.deliver(model);
        }
        self.now = None;
    }

    /// Bone does not hold out a drill, which makes its own way, nor what is held the tool that holds it.
    fn pass_through(&mut self) {
        let Some(Seen { tip, work, coupling, .. }) = self.tool else { return };
        let holds = work.held != Vec3::ZERO;
        for Near { bone, proxy, .. } in &mut self.bones {
            if coupling.is_some() || (holds && *bone != SKULL) {
                *proxy = Proxy::new(tip);
            }
        }
    }

    /// The frame was swapped: where the device is that the tool follows, from now on.
    pub(super) fn sample(&mut self) -> Option<DeviceSample> {
        let (told, last) = (self.end.tool(), self.device().copied());
        self.hear(&told);
        self.past.extend(told.is_fresh.then_some(told).or(last));
        if self.past.len() > HELD + 1 {
            self.past.pop_front();
        }
        let mut sample = self.device()?.sample;
        if self.lets_go(&told) {
            sample.buttons = 0;
        }
        match self.tool.map(|tool| tool.push) {
            // A drill finds its own way.
            Some(Some(_)) => sample.position += self.shift.unwrap_or_default(),
            Some(None) => {
                for near in &self.bones {
                    sample.position = near.proxy.held_out(sample.position);
                }
            }
            // Nothing holds out what is not there, or not shown.
            None => {}
        }
        Some(sample)
    }

    /// The loop had said this at a swap.
    fn hear(&mut self, told: &ToolState) {
        if self.told.is_none_or(|before| before.time != told.time) {
            self.heard = Instant::now();
        }
        // Since the first swap at which it was not read: a slow frame is not the device's silence.
        self.silent = if told.is_fresh { None } else { self.silent.or(Some(told.time)) };
        if told.ticks.due > 0 {
            self.told = Some(*told);
        }
    }

    /// Whether it is too long since the device was read for its buttons to count.
    fn lets_go(&self, told: &ToolState) -> bool {
        let is_over = told.fault == Some(DeviceError::Panicked);
        let unread = self.silent.map_or(0.0, |since| told.time - since);
        // The clock of a loop that was stopped, or whose driver hangs, stands still.
        let unheard = self.heard.elapsed().as_secs_f64();
        is_over || unread.max(unheard) > LETS_GO
    }

    /// The device in the frame that is being drawn, as far as its loop has said anything that counts.
    fn look(&mut self) -> Option<ToolState> {
        let said = || Some(self.end.tool()).filter(|tool| tool.is_fresh);
        self.now = self.now.or_else(said).or(self.past.back().copied());
        self.now
    }

    /// The device so many swaps before the last one.
    fn at(&self, swaps: usize) -> Option<&ToolState> {
        self.past.iter().rev().nth(swaps).or(self.past.front())
    }

    /// All that pushes or pulls, or else the nearest bone; none as long as nothing is known.
    fn model(&mut self) -> Option<LocalModel> {
        let (seen, device) = (self.tool?, self.look()?);
        let (bone, normal) = match seen.coupling {
            Some(coupling) => (self.drilled(seen.tip, coupling, &device), None),
            None => self.nearest(&seen, &device),
        };
        let held = self.held(&seen, &device);
        let dura = self.dura(&seen);
        let [blade, tool] = &mut self.drags;
        let cut = blade.follow(&device, seen.work.cuts.then_some([CUTTING, CUTTING_GIVES]), None);
        let press = normal.map(|normal| bone.force_at(device.sample.position).dot(normal));
        let rub = press.map(|press| [FRICTION * press, FRICTION_GIVES]);
        let rub = tool.follow(&device, rub, normal);
        let acts = |part: &LocalModel| part.force_at(device.sample.position) != Vec3::ZERO;
        let together = |parts: [_; 3]| parts.into_iter().flatten().filter(acts).reduce(sum);
        // Bone that is near is told before it is touched, also beside what pulls.
        let contact = together([Some(bone), rub, dura]).unwrap_or(bone);
        // What only pushes has an end where what pulls has none.
        Some(together([held, cut, None]).map_or(contact, |pull| contact.beside(&pull)))
    }

    /// Of bone that a drill is in with its tip.
    ///
    /// A wide bit touches bone elsewhere than its tip does, on which the hand may rest already. A step from
    /// the one to the other would push the hand; so the drill is led by as much beside the device.
    fn drilled(&mut self, tip: Vec3, coupling: Coupling, device: &ToolState) -> LocalModel {
        let Coupling { stiffness, normal, .. } = coupling;
        let place = device.sample.position;
        let shift = *self.shift.get_or_insert_with(|| {
            let step = match self.rest {
                Some(rest) => (tip - rest).dot(normal),
                None => (tip - place).dot(normal).max(0.0),
            };
            normal * step.clamp(-SHIFT, SHIFT)
        });
        let ahead = place + shift - tip;
        // A hand may push with more than the drill is pushed on with; what a device can do holds it back.
        let pull = (ahead - normal * ahead.dot(normal).max(0.0)) * -stiffness;
        spring(pull, stiffness, Some(normal), device)
    }

    /// Of the bone that is nearest, or touched deepest, with its normal if it is touched.
    fn nearest(&mut self, seen: &Seen, device: &ToolState) -> (LocalModel, Option<Vec3>) {
        let stiffness = seen.push.map_or(ContactStiffness::BONE, ContactStiffness::new);
        let models = self.bones.iter().map(|near| near.proxy.model(device, stiffness));
        let press = |model: &LocalModel| model.normal.map(|normal| model.force.dot(normal));
        let (position, time) = (device.sample.position, device.time);
        let far = LocalModel { position, time, ..LocalModel::FREE };
        let nearest = models
            .filter(|model| model.normal.is_some())
            .max_by(|a, b| press(a).unwrap_or(0.0).total_cmp(&press(b).unwrap_or(0.0)))
            .unwrap_or(far);
        let normal = nearest.normal.filter(|_| nearest.force_at(position) != Vec3::ZERO);
        self.shift = None;
        self.rest = normal.map(|_| position + nearest.force / stiffness.newtons_per_metre());
        (nearest, normal)
    }

    /// Of what is held: a spring from where it was taken hold of.
    fn held(&self, seen: &Seen, device: &ToolState) -> Option<LocalModel> {
        let force = seen.work.held;
        let then = self.at(HELD)?;
        let drawn = then.sample.position.distance(self.grasp).max(DRAWN);
        let stiffness = (force.length() / drawn).min(HOLD);
        let holds = device.sample.buttons & 1 == 1 && force != Vec3::ZERO;
        holds.then(|| spring(force, stiffness, None, then))
    }

    /// Of the dura.
    fn dura(&self, seen: &Seen) -> Option<LocalModel> {
        let force = seen.work.tissue;
        let normal = force.try_normalize()?;
        let gradient = along(normal) * -DURA;
        Some(LocalModel { gradient, ..spring(force, 0.0, Some(normal), self.at(TOUCHED)?) })
    }
}

/// Dry friction: a spring that gives way up to a distance, and from there on slides along (P. R. Dahl, "A
/// solid friction model", 1968, in its simplest form).
#[derive(Clone, Copy, Debug, Default)]
struct Drag {
    /// Where the spring's other end is, if there is any friction.
    anchor: Option<Vec3>,
}

impl Drag {
    /// A device moves on, against at most so many newtons, with so many metres to give way. Friction on a
    /// surface is along it.
    fn follow(
        &mut self,
        device: &ToolState,
        friction: Option<[f32; 2]>,
        normal: Option<Vec3>,
    ) -> Option<LocalModel> {
        let place = device.sample.position;
        let anchor = std::mem::take(&mut self.anchor);
        let [strength, gives] = friction?;
        let across = Mat3::IDENTITY - normal.map_or(Mat3::ZERO, along);
        let way = (across * (anchor.unwrap_or(place) - place)).clamp_length_max(gives);
        self.anchor = Some(place + way);
        let stiffness = strength / gives;
        // Also while it slides: a force that stays the same where a hand turns back would push it.
        let gradient = across * -stiffness;
        Some(LocalModel { gradient, ..spring(way * stiffness, 0.0, None, device) })
    }
}

/// A spring that exerts `force` on a tool where the device was `then`.
fn spring(force: Vec3, stiffness: f32, normal: Option<Vec3>, then: &ToolState) -> LocalModel {
    let (position, time) = (then.sample.position, then.time);
    let gradient = Mat3::from_diagonal(Vec3::splat(-stiffness));
    LocalModel { force, gradient, position, time, normal, ..LocalModel::FREE }
}

/// Both together, where the first one holds; as old as the older one.
fn sum(first: LocalModel, other: LocalModel) -> LocalModel {
    let there = other.force + other.gradient * (first.position - other.position);
    let (force, gradient) = (first.force + there, first.gradient + other.gradient);
    LocalModel { force, gradient, time: first.time.min(other.time), ..first }
}

#[cfg(test)]
#[path = "feel_tests.rs"]
mod tests;

#[cfg(test)]
#[path = "feel_silence_tests.rs"]
mod silence_tests;
