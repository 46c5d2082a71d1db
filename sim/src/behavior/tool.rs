//! A tool in somebody's hand: which instrument it is, where it goes, and what it does to what it touches.

use std::any::Any;
use std::hash::Hasher;

use glam::{Quat, Vec3};
use parry3d::math::Pose;
use parry3d::shape::SharedShape;

use super::drill::{Approach, Bit, Burr, Coupling, Erode, Feed, Perforator, Reaction};
use super::instrument::EDGE;
use super::{Behavior, Felt, Grasp, Hold, Input, Instrument, LetGo, tissue};
use crate::device::DeviceSample;
use crate::geometry::{Blade, Geometry, Rigid};
use crate::interaction::Contact;
use crate::message::{Custom, Message};
use crate::object::{Object, ObjectId};

/// How far from an elevator's tip it scrapes, in metres; usually 0.006.
const SCRAPED: f32 = 0.006;
/// How far from the tip forceps and hooks take hold, in metres; usually 0.008.
const REACH: f32 = 0.008;
/// The stiffness with which a node of tissue is held, in newtons per metre; usually 500.
const HOLD: f32 = 500.0;
/// The greatest force on a node that forceps hold, in newtons; usually 2.
const FORCEPS_STRENGTH: f32 = 2.0;
/// The greatest force on a node that a hook holds, in newtons; usually 10: it does not slip.
const HOOK_STRENGTH: f32 = 10.0;
/// The stiffness and the strength with which forceps hold a piece of bone, in newtons per metre and
/// newtons; usually 1,000 and 20.
const BONE_HOLD: [f32; 2] = [1_000.0, 20.0];
/// How fast a burr turns, in radians per second; usually 3,140: 30,000 rpm.
const BURR_SPIN: f32 = 3_140.0;
/// How fast a craniotome turns, in radians per second; usually 6,280: 60,000 rpm.
const CRANIOTOME_SPIN: f32 = 6_280.0;
/// How strongly a hand pushes a burr or a craniotome, in newtons; usually 10.
const PUSH: f32 = 10.0;
/// What slows a hand on a perforator, in newton seconds per metre; usually 3,000: its wide bit is stiff.
const LEANING_RESISTANCE: f32 = 3_000.0;
/// How far a drill goes in bone in a frame at most, in metres; usually half a voxel of 0.5 mm.
const BONE_STEP: f32 = 2.5e-4;
/// How far a drill goes outside bone in a frame at most, in metres; usually 1.2 mm, the least radius of a
/// bit, so that none is beyond the bone before it is felt.
const FREE_STEP: f32 = 1.2e-3;

/// What a tool can work on.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Workpieces {
    /// Soft tissue: cut, scraped off, held.
    pub tissue: Vec<ObjectId>,
    /// Dura, whose force is told by itself.
    pub dura: Vec<ObjectId>,
    /// Bone that is drilled.
    pub bone: Vec<ObjectId>,
    /// Free pieces of bone: held, and drilled too.
    pub pieces: Vec<ObjectId>,
}

/// What a tool felt and did in the last frame.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Work {
    /// The force of bone on it, in newtons.
    pub bone: Vec3,
    /// The force of soft tissue on it, in newtons.
    pub tissue: Vec3,
    /// What of it is the dura's.
    pub dura: Vec3,
    /// The force of what it holds on it, in newtons.
    pub held: Vec3,
    /// Whether its edge was in tissue.
    pub cuts: bool,
    /// Whether its bit turned.
    pub turns: bool,
}

impl Work {
    /// All that pushes and pulls it, in newtons.
    #[must_use]
    pub fn force(&self) -> Vec3 {
        self.bone + self.tissue + self.held
    }
}

/// A tool that follows a device: a rigid shape whose origin is its tip, its handle along +z.
///
/// Where the device is comes as [`Message::Device`], a tool switch as [`Message::TakeUp`]; the first
/// button presses a blade or an elevator, closes forceps and starts a drill. A drill does not follow into bone:
/// it goes there as fast as it takes the bone away ([`Feed`]). What it does to others it posts to them, so that
/// it happens in their own next update.
#[derive(Clone)]
pub struct Tool {
    instrument: Instrument,
    device: DeviceSample,
    workpieces: Workpieces,
    /// Where the edge was in the frame before, if it was this instrument's.
    before: Option<Blade>,
    /// Whether the instrument was taken up since the last update.
    is_new: bool,
    holds: bool,
    /// Of the hand on a burr or a craniotome, and on a perforator.
    feeds: [Feed; 2],
    perforator: Perforator,
    /// Of bone, in the frame before.
    reaction: Reaction,
    approach: Approach,
    spin: f32,
    /// By what it works on, for the frame that comes.
    told: Felt,
    work: Work,
    shapes: [SharedShape; Instrument::ALL.len()],
}

impl Tool {
    /// A tool and its shape at a place; it can work on `workpieces`.
    #[must_use]
    pub fn new(
        instrument: Instrument,
        device: DeviceSample,
        workpieces: Workpieces,
    ) -> (Rigid, Self) {
        let shapes = Instrument::ALL.map(Instrument::shape);
        let pose = Pose::from_parts(device.position, device.orientation);
        let rigid = Rigid::new(shapes[instrument as usize].clone(), pose);
        let hands = [(PUSH, Feed::RESISTANCE), (Perforator::PUSH, LEANING_RESISTANCE)];
        let feeds = hands.map(|(strength, resistance)| {
            let feed = Feed::new(strength, resistance, FREE_STEP, BONE_STEP);
            feed.unwrap_or_else(|_| unreachable!("the constants are positive"))
        });
        let tool = Self {
            instrument,
            device,
            workpieces,
            before: None,
            is_new: false,
            holds: false,
            feeds,
            perforator: Perforator::new(),
            reaction: Reaction::default(),
            approach: Approach::default(),
            spin: 0.0,
            told: Felt::default(),
            work: Work::default(),
            shapes,
        };
        (rigid, tool)
    }

    /// The tool that an object is, if it is.
    #[must_use]
    pub fn of(object: &Object) -> Option<&Self> {
        let behavior: &dyn Any = &*object.behavior;
        behavior.downcast_ref()
    }

    /// The tool that an object is, to change it.
    pub fn of_mut(object: &mut Object) -> Option<&mut Self> {
        let behavior: &mut dyn Any = &mut *object.behavior;
        behavior.downcast_mut()
    }

    /// What it is at the moment.
    #[must_use]
    pub fn instrument(&self) -> Instrument {
        self.instrument
    }

    /// Whether its button is pressed.
    #[must_use]
    pub fn is_pressed(&self) -> bool {
        self.device.buttons & 1 == 1
    }

    /// What it felt and did in the last frame.
    #[must_use]
    pub fn work(&self) -> Work {
        self.work
    }

    /// What joins the hand with a drill that bone holds back; none for another instrument, and where no
    /// bone is touched.
    #[must_use]
    pub fn coupling(&self) -> Option<Coupling> {
        self.feed()?.coupling(&self.reaction)
    }

    /// Of a drill, the stiffness of what joins it with the hand, in newtons per metre.
    #[must_use]
    pub fn coupling_stiffness(&self) -> Option<f32> {
        self.feed().map(Feed::stiffness)
    }

    /// Adds what a body tells. One that is not finite tells so before it is excluded.
    pub(super) fn told(&mut self, felt: Felt) {
        if felt.held.is_finite() {
            self.told.held += felt.held;
        }
        self.told.cuts |= felt.cuts;
    }

    /// What it can work on, to add what is new.
    pub fn workpieces_mut(&mut self) -> &mut Workpieces {
        &mut self.workpieces
    }

    fn bit(&self) -> Option<Bit> {
        self.instrument.bit()
    }

    /// Where the tip goes in this frame.
    fn next(&self, tip: Vec3, time: f32) -> Vec3 {
        let wanted = self.device.position;
        self.feed().map_or(wanted, |feed| feed.next(tip, wanted, &self.reaction, time))
    }

    /// How the hand leads an instrument that drills.
    fn feed(&self) -> Option<&Feed> {
        match self.instrument {
            Instrument::Perforator => Some(&self.feeds[1]),
            Instrument::Burr | Instrument::Craniotome => Some(&self.feeds[0]),
            _ => None,
        }
    }

    /// How fast the bit turns in this frame, in radians per second.
    fn turn(&mut self) -> f32 {
        let pressed = self.is_pressed();
        if !pressed {
            // Its clutch lets go.
            self.perforator = Perforator::new();
        }
        match self.instrument {
            Instrument::Perforator if pressed => self.perforator.turn(self.reaction.tip),
            Instrument::Burr if pressed => BURR_SPIN,
            Instrument::Craniotome if pressed => CRANIOTOME_SPIN,
            _ => 0.0,
        }
    }

    /// Does what the instrument does, from `now` on.
    fn act(&mut self, rigid: &Rigid, now: Blade, is_new: bool, input: &mut Input<'_>) {
        let by = input.object;
        let pressed = self.is_pressed();
        let holds = matches!(self.instrument, Instrument::Forceps | Instrument::Hook) && !is_new;
        if self.holds && !holds {
            self.let_go(input);
            self.holds = false;
        }
        match self.instrument {
            Instrument::Scalpel if pressed => {
                let before = self.before.unwrap_or(now);
                tell(input, &self.workpieces.tissue, || tissue::Cut { by, before, now });
            }
            Instrument::Elevator if pressed => {
                let center = rigid.pose.translation;
                let scrape = || tissue::Scrape { center, radius: SCRAPED };
                tell(input, &self.workpieces.tissue, scrape);
            }
            Instrument::Forceps | Instrument::Hook => self.hold(rigid.pose.translation, input),
            _ => {}
        }
    }

    /// Takes hold, holds on or lets go.
    fn hold(&mut self, at: Vec3, input: &mut Input<'_>) {
        let by = input.object;
        let Workpieces { tissue, pieces, .. } = &self.workpieces;
        match (self.holds, self.is_pressed()) {
            (false, true) => {
                let hook = self.instrument == Instrument::Hook;
                let strength = if hook { HOOK_STRENGTH } else { FORCEPS_STRENGTH };
                let grasp = Grasp { by, point: at, radius: REACH, stiffness: HOLD, strength };
                tell(input, tissue, || grasp);
                let [stiffness, strength] = BONE_HOLD;
                tell(input, pieces, || Grasp { stiffness, strength, ..grasp });
            }
            (true, true) => {
                tell(input, tissue.iter().chain(pieces), || Hold { by, position: at });
            }
            (true, false) => self.let_go(input),
            (false, false) => {}
        }
        self.holds = self.is_pressed();
    }

    fn let_go(&self, input: &mut Input<'_>) {
        let by = input.object;
        let Workpieces { tissue, pieces, .. } = &self.workpieces;
        tell(input, tissue.iter().chain(pieces), || LetGo { by });
    }

    /// Notes what this frame's contacts did, and lets a turning bit take bone away.
    fn feel(&mut self, geometry: &Geometry, is_new: bool, input: &mut Input<'_>) {
        let Workpieces { bone, pieces, .. } = &self.workpieces;
        let is_bone = |other: ObjectId| bone.contains(&other) || pieces.contains(&other);
        // What the instrument before it felt is not a new one's.
        let felt = |contact: &Contact| !is_new && is_bone(contact.other);
        let reaction = Reaction::new(input.contacts().filter(felt), input.time_step);
        let [tissue, dura] = [None, Some(&self.workpieces.dura)].map(|only| {
            let counts = |other| !is_bone(other) && only.is_none_or(|only| only.contains(&other));
            let contacts = input.contacts().filter(|contact| !is_new && counts(contact.other));
            Reaction::new(contacts, input.time_step).force
        });
        if let Some(burr) = self.burr(geometry).filter(|burr| burr.spin != 0.0) {
            for &bone in bone.iter().chain(pieces) {
                let touches = |contact: &Contact| !is_new && contact.other == bone;
                if input.contacts().any(|contact| touches(&contact)) {
                    // As hard as it is pressed on this one.
                    let own = Reaction::new(input.contacts().filter(touches), input.time_step);
                    let load = self.feed().map_or(0.0, |feed| feed.load(&own));
                    input.post(bone, Message::Custom(Box::new(Erode { burr, load })));
                }
            }
        }
        self.reaction = reaction;
        match self.burr(geometry) {
            Some(burr) => self.approach.follow(&burr, reaction.normal()),
            None => self.approach = Approach::default(),
        }
        let Felt { held, cuts } = std::mem::take(&mut self.told);
        // What was let go of tells of it once more.
        let held = if self.holds && !is_new { held } else { Vec3::ZERO };
        let cuts = cuts && self.instrument == Instrument::Scalpel && self.is_pressed();
        let turns = self.spin != 0.0;
        self.work = Work { bone: reaction.force, tissue, dura, held, cuts, turns };
    }
}

/// Posts a message to each of some objects.
fn tell<'a, C: Custom + 'static>(
    input: &mut Input<'_>,
    to: impl IntoIterator<Item = &'a ObjectId>,
    message: impl Fn() -> C,
) {
    to.into_iter().for_each(|&to| input.post(to, Message::Custom(Box::new(message()))));
}

impl Behavior for Tool {
    fn update(&mut self, geometry: &mut Geometry, input: &mut Input<'_>) {
        let is_new = std::mem::take(&mut self.is_new);
        self.feel(geometry, is_new, input);
        let Some(rigid) = geometry.as_rigid_mut() else { return };
        self.spin = self.turn();
        let tip = rigid.pose.translation;
        let next = self.next(tip, input.time_step);
        rigid.velocity = (next - tip) / input.time_step;
        rigid.pose = Pose::from_parts(next, self.device.orientation);
        let blade = Blade { tip: next, heel: next + axis(self.device.orientation) * EDGE };
        self.act(rigid, blade, is_new, input);
        self.before = Some(blade);
        rigid.shape = self.shapes[self.instrument as usize].clone();
    }

    fn process(&mut self, message: &Message) {
        match *message {
            Message::Device(sample) if sample.is_valid() => self.device = sample,
            Message::TakeUp(instrument) if instrument != self.instrument => {
                self.instrument = instrument;
                self.before = None;
                self.perforator = Perforator::new();
                self.is_new = true;
                self.spin = 0.0;
            }
            _ => {}
        }
    }

    fn burr(&self, geometry: &Geometry) -> Option<Burr> {
        let pose = geometry.as_rigid()?.pose;
        let bit = self.bit()?;
        let axis = axis(pose.rotation);
        let center = pose.translation + axis * bit.radius;
        Some(Burr { bit, center, axis, spin: self.spin, side: self.approach.side(center) })
    }

    fn show_in(&self, snapshot: &mut Box<dyn Behavior>) {
        let shown: &mut dyn Any = &mut **snapshot;
        match shown.downcast_mut::<Self>() {
            Some(shown) => shown.clone_from(self),
            None => *snapshot = Box::new(self.clone()),
        }
    }

    fn hash_state(&self, hasher: &mut dyn Hasher) {
        hasher.write_u8(self.instrument as u8);
        hasher.write(&self.device.buttons.to_le_bytes());
        let orientation = self.device.orientation.to_array();
        for value in self.device.position.to_array().into_iter().chain(orientation) {
            hasher.write(&value.to_le_bytes());
        }
        hasher.write_u8(u8::from(self.holds));
        let Reaction { force, elastic, tip, stiffness } = self.reaction;
        let edge = self.before.into_iter().flat_map(|blade| [blade.tip, blade.heel]);
        let felt = [force, elastic, stiffness].into_iter().chain(edge).chain(self.approach.state());
        for value in felt.flat_map(|vector| vector.to_array()) {
            hasher.write(&value.to_le_bytes());
        }
        hasher.write(&tip.to_le_bytes());
        hasher.write(&self.spin.to_le_bytes());
        self.perforator.hash_state(hasher);
    }
}

/// The direction of the handle.
fn axis(orientation: Quat) -> Vec3 {
    // The quaternion type's own product differs between vector units.
    let [x, y, z, w] = orientation.to_array();
    Vec3::new(2.0 * (x * z + w * y), 2.0 * (y * z - w * x), 1.0 - 2.0 * (x * x + y * y))
}
