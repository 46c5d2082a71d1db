//! What a hand feels: a haptic loop's device moves a tool, and what the tool meets comes back as forces.

use std::collections::VecDeque;

use glam::{Mat3, Vec3};

use super::SKULL;
use crate::behavior::drill::Coupling;
use crate::behavior::{Tool, Work};
use crate::device::DeviceSample;
use crate::device::link::{SimulationEnd, ToolState};
use crate::device::model::LocalModel;
use crate::device::proxy::{ContactStiffness, Proxy};
use crate::object::{Object, ObjectId};

/// Swaps after that of a frame's own until a tool has gone where a device was then: none for the swap
/// before, which is what bone is felt by.
const MOVED: usize = 1;
/// Until contacts find it there.
const TOUCHED: usize = 2;
/// Until what it holds has been drawn there and has told.
const HELD: usize = 3;
/// The stiffness with which the dura is felt, in newtons per metre; usually 200, that of its contact.
const DURA: f32 = 200.0;
/// The greatest stiffness with which what is held is felt, in newtons per metre; usually 1,000.
const HOLD: f32 = 1_000.0;
/// How far what is held must be drawn to tell its stiffness, in metres; usually 2 mm.
const DRAWN: f32 = 0.002;
/// The force that it takes to cut scalp, in newtons; usually 1.
const CUTTING: f32 = 1.0;
/// How far a blade goes until it cuts on, in metres; usually 3 mm: that much skin gives way.
const GIVES: f32 = 0.003;

/// Joins a haptic loop with a tool.
///
/// The tool goes where the device is. What stands against it there is told to the loop as one local model a
/// frame: bone by a proxy on its surface; bone that a drill touches by the spring that pushes the drill on;
/// what the tool holds, by its pull; the dura, and scalp that is cut, by their forces.
#[derive(Debug)]
pub(super) struct Feel<'c> {
    end: SimulationEnd<'c>,
    /// The device at the last swaps, the last one last.
    past: VecDeque<ToolState>,
    /// The tool as it was drawn last.
    tool: Option<Seen>,
    /// For each volume of bone.
    proxies: Vec<(ObjectId, Proxy)>,
    /// Where the tool was when it took hold.
    grasp: Vec3,
    /// Where the tissue is that a blade draws along.
    edge: Option<Vec3>,
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
        let (tool, proxies, edge) = (None, Vec::new(), None);
        Self { end, past, tool, proxies, grasp: Vec3::ZERO, edge }
    }

    pub(super) fn into_end(self) -> SimulationEnd<'c> {
        self.end
    }

    /// The device at the last swap; none as long as its loop said nothing.
    pub(super) fn device(&self) -> Option<&ToolState> {
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
        let coupling = tool.coupling(tip);
        self.tool = Some(Seen { tip, work, coupling, push: tool.coupling_stiffness() });
    }

    /// The bone, or a piece of it, is this in the frame that is being drawn.
    pub(super) fn bone(&mut self, object: &Object) {
        let (Some(volume), Some(&device)) = (object.geometry.as_volume(), self.device()) else {
            return;
        };
        let Some(Seen { tip, work, coupling, .. }) = self.tool else { return };
        let id = object.id();
        let known = self.proxies.iter().position(|&(other, _)| other == id);
        let place = known.unwrap_or_else(|| {
            self.proxies.push((id, Proxy::new(tip)));
            self.proxies.len() - 1
        });
        let (_, proxy) = &mut self.proxies[place];
        let holds_it = id != SKULL && work.held != Vec3::ZERO;
        if coupling.is_some() || holds_it {
            *proxy = Proxy::new(tip);
        } else {
            proxy.follow(device.sample.position, volume);
        }
    }

    /// A frame is drawn: tells the loop what to exert.
    pub(super) fn deliver(&mut self) {
        self.cut();
        if let Some(model) = self.model() {
            // A model that is no number is left out, and forces fade if none comes.
            let _ = self.end.deliver(model);
        }
    }

    /// The frame was swapped: where the device is that the tool follows, from now on.
    pub(super) fn sample(&mut self) -> Option<DeviceSample> {
        let now = self.end.tool();
        let said = now.time > 0.0 && now.fault.is_none();
        self.past.extend(if said { Some(now) } else { self.device().copied() });
        if self.past.len() > HELD + 1 {
            self.past.pop_front();
        }
        let mut sample = self.device()?.sample;
        if self.tool.is_none_or(|tool| tool.push.is_none()) {
            // What is blunt stays outside; a drill finds its own way.
            for (_, proxy) in &self.proxies {
                sample.position = proxy.held_out(sample.position);
            }
        }
        Some(sample)
    }

    /// The device so many swaps before the last one.
    fn at(&self, swaps: usize) -> Option<&ToolState> {
        self.past.iter().rev().nth(swaps).or(self.past.front())
    }

    /// All that pushes or pulls, or else the nearest bone; none as long as nothing is known.
    fn model(&self) -> Option<LocalModel> {
        let (seen, device) = (self.tool?, self.device()?);
        let position = device.sample.position;
        let bone = self.bone_model(&seen)?;
        let parts = [self.held(&seen), self.cut_model(), Some(bone), self.dura(&seen)];
        let acts = |part: &LocalModel| part.force_at(position) != Vec3::ZERO;
        let all = parts.into_iter().flatten().filter(acts).reduce(sum);
        Some(all.unwrap_or(bone))
    }

    /// Of the bone that is nearest, or that the drill is in.
    fn bone_model(&self, seen: &Seen) -> Option<LocalModel> {
        if let Some(Coupling { force, stiffness, normal }) = seen.coupling {
            return Some(spring(force, stiffness, Some(normal), self.at(MOVED)?));
        }
        let device = self.device()?;
        let stiffness = seen.push.map_or(ContactStiffness::BONE, ContactStiffness::new);
        let height = |model: &LocalModel| {
            model.normal.map_or(f32::INFINITY, |normal| -model.force.dot(normal))
        };
        let models = self.proxies.iter().map(|(_, proxy)| proxy.model(device, stiffness));
        let nearest = models.min_by(|a, b| height(a).total_cmp(&height(b)));
        let (position, time) = (device.sample.position, device.time);
        Some(nearest.unwrap_or(LocalModel { position, time, ..LocalModel::FREE }))
    }

    /// Of what is held: a spring from where it was taken hold of.
    fn held(&self, seen: &Seen) -> Option<LocalModel> {
        let force = seen.work.held;
        let is_closed = self.device()?.sample.buttons & 1 == 1;
        let then = self.at(HELD)?;
        let drawn = then.sample.position.distance(self.grasp).max(DRAWN);
        let stiffness = (force.length() / drawn).min(HOLD);
        (is_closed && force != Vec3::ZERO).then(|| spring(force, stiffness, None, then))
    }

    /// Of the dura.
    fn dura(&self, seen: &Seen) -> Option<LocalModel> {
        let force = seen.work.tissue;
        let normal = force.try_normalize()?;
        let along = normal * -DURA;
        let gradient = Mat3::from_cols(along * normal.x, along * normal.y, along * normal.z);
        Some(LocalModel { gradient, ..spring(force, 0.0, Some(normal), self.at(TOUCHED)?) })
    }

    /// A blade draws tissue along until that is cut.
    fn cut(&mut self) {
        let cuts = self.tool.is_some_and(|tool| tool.work.cuts);
        self.edge = self.device().filter(|_| cuts).map(|device| {
            let place = device.sample.position;
            place + (self.edge.unwrap_or(place) - place).clamp_length_max(GIVES)
        });
    }

    /// Of tissue that is cut.
    fn cut_model(&self) -> Option<LocalModel> {
        let (edge, device) = (self.edge?, self.device()?);
        let stiffness = CUTTING / GIVES;
        Some(spring((edge - device.sample.position) * stiffness, stiffness, None, device))
    }
}

/// A spring that exerts `force` on a tool where the device was `then`.
fn spring(force: Vec3, stiffness: f32, normal: Option<Vec3>, then: &ToolState) -> LocalModel {
    let (position, time) = (then.sample.position, then.time);
    let gradient = Mat3::from_diagonal(Vec3::splat(-stiffness));
    LocalModel { force, torque: Vec3::ZERO, gradient, position, time, normal }
}

/// Both together, where the first one holds.
fn sum(first: LocalModel, other: LocalModel) -> LocalModel {
    let there = other.force + other.gradient * (first.position - other.position);
    let (force, gradient) = (first.force + there, first.gradient + other.gradient);
    LocalModel { force, gradient, ..first }
}
