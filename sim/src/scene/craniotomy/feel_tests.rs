use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::{scope, sleep};
use std::time::Duration;

use parry3d::math::Pose;
use parry3d::shape::SharedShape;

use super::super::{FIRST_GROUP, PIECES, SKULL_GROUP, TIME_STEP, TOOL_GROUP, TOOLS};
use super::*;
use crate::behavior::piece::Piece;
use crate::behavior::{Bone, Fixed, Instrument, Workpieces};
use crate::blocking::Grain;
use crate::device::law::ForceSettings;
use crate::device::link::HapticLink;
use crate::device::motion::{Keyframe, Motion, ScriptedDevice};
use crate::device::operator::SimulatedDevice;
use crate::device::proxy::Surface;
use crate::device::thread::{HapticLoop, HapticThread, RATE};
use crate::device::{DeviceDescription, DeviceError, HapticDevice, Wrench};
use crate::executor::{Executor, SerialExecutor};
use crate::geometry::{Geometry, Rigid, Volume};
use crate::interaction::{BurrForce, BurrInBone, InteractionPair, Rules};
use crate::message::Message;
use crate::object::Group;
use crate::render::NullRenderer;
use crate::scene::Scene;
use crate::simd::Simd;
use crate::stages::Stages;

const TOOL: ObjectId = TOOLS[0];
const PIECE: ObjectId = ObjectId(SKULL.0 + 1);
/// What is drawn, in two orders.
const ORDERS: [[ObjectId; 3]; 2] = [[TOOL, SKULL, PIECE], [PIECE, SKULL, TOOL]];
/// The middle of the upper side of the piece; that of the skull is the origin.
const LID: Vec3 = Vec3::new(0.0, 0.0, 0.05);

/// Bone below y = 0.
struct Flat;

impl Surface for Flat {
    fn distance(&self, point: Vec3) -> (f32, Vec3) {
        (point.y, Vec3::Y)
    }
}

/// A device that goes its way whatever it is told to exert, which it may refuse.
struct Led(Motion, Result<(), DeviceError>);

impl HapticDevice for Led {
    fn description(&self) -> DeviceDescription {
        SimulatedDevice::DESCRIPTION
    }

    fn read(&mut self, time: f64) -> Result<DeviceSample, DeviceError> {
        Ok(self.0.at(time))
    }

    fn write(&mut self, _wrench: Wrench) -> Result<(), DeviceError> {
        self.1
    }
}

/// Places, from frame to frame, with and without the button.
fn way(places: &[(u32, Vec3, bool)]) -> Motion {
    let keyframe = |&(frame, position, pressed): &(u32, Vec3, bool)| Keyframe {
        time: f64::from(frame) * f64::from(TIME_STEP),
        sample: DeviceSample { buttons: pressed.into(), ..DeviceSample::at(position) },
    };
    Motion::new(places.iter().map(keyframe)).expect("in order")
}

/// A hand that goes its way, and what it feels.
struct Hand<'c> {
    ticking: HapticLoop<'c, Led>,
    feel: Feel<'c>,
}

impl<'c> Hand<'c> {
    fn new(link: &'c mut HapticLink, motion: &Motion) -> Self {
        Self::with(Led(motion.clone(), Ok(())), link)
    }

    fn with(device: Led, link: &'c mut HapticLink) -> Self {
        let (end, simulation) = link.split();
        let ticking = HapticLoop::new(device, end, ForceSettings::default());
        Self { ticking, feel: Feel::new(simulation) }
    }

    /// A frame is drawn and swapped: what the hand is made to feel, and where its tool is to go.
    fn frame(&mut self, executor: &SerialExecutor, drawn: &[ObjectId]) -> (Wrench, DeviceSample) {
        let time = (executor.frame() + 1) as f64 * f64::from(TIME_STEP);
        let wrench = self.ticking.tick(time);
        for &id in drawn {
            executor.visit(&mut |object| match object.id() {
                TOOL if id == TOOL => self.feel.tool(object),
                other if id == other => self.feel.bone(object),
                _ => {}
            });
        }
        self.feel.deliver();
        (wrench, self.feel.sample().expect("the device has told"))
    }
}

/// A slab of full bone of 10 × 10 × 4 mm, with the middle of its upper side there.
fn slab(top: Vec3) -> Volume {
    let voxels = |[x, y, z]: [u32; 3]| {
        let inside = |index, count| (1..=count).contains(&index);
        if inside(x, 20) && inside(y, 20) && inside(z, 8) { 255 } else { 0 }
    };
    let corner = Pose::from_translation(top - Vec3::new(5.5e-3, 5.5e-3, 4.5e-3));
    Volume::from_fn([22, 22, 10], Vec3::splat(5e-4), corner, voxels).expect("it is small")
}

/// A tool, bone, and a free piece of it that does not fall.
fn scene(instrument: Instrument, at: Vec3) -> SerialExecutor {
    let mut rules = Rules::new();
    let pair = InteractionPair { detection: Box::new(BurrInBone), response: Box::new(BurrForce) };
    rules.model(TOOL_GROUP, SKULL_GROUP, pair).expect("its first rule");
    let (time_step, gravity, simd) = (TIME_STEP, Vec3::ZERO, Simd::detect());
    let stages = Stages { rules, time_step, gravity, callback_budget: None, simd };
    let (bone, pieces) = (vec![SKULL], vec![PIECE]);
    let workpieces = Workpieces { bone, pieces, ..Workpieces::default() };
    let (rigid, tool) = Tool::new(instrument, DeviceSample::at(at), workpieces);
    let (skull, piece) = (slab(Vec3::ZERO), slab(LID));
    let loose = Piece::new(&piece).loose();
    let mut objects = vec![
        Object::new(TOOL, TOOL_GROUP, Geometry::Rigid(rigid), tool),
        Object::new(SKULL, SKULL_GROUP, Geometry::Volume(skull), Bone::new()),
        Object::new(PIECE, PIECES, Geometry::Volume(piece), loose),
    ];
    // Of all numbers below the greatest there must be one.
    let far = Rigid::new(SharedShape::ball(1e-3), Pose::from_translation(Vec3::X));
    objects.extend((TOOL.0 + 1..SKULL.0).map(|number| {
        let (id, group) = (ObjectId(number), Group(FIRST_GROUP));
        Object::new(id, group, Geometry::Rigid(far.clone()), Fixed)
    }));
    SerialExecutor::new(Scene::new(objects, stages), Grain::Spatial).expect("a sound scene")
}

/// Runs a hand, changing instruments in some frames, and compares what it feels if it is drawn in one
/// order and in the other; says in how many frames it felt anything.
fn felt_in_any_order(
    instrument: Instrument,
    motion: &Motion,
    changes: &[(u64, Instrument)],
    frames: u64,
) -> usize {
    let mut executor = scene(instrument, motion.at(0.0).position);
    let mut links = [HapticLink::new(), HapticLink::new()];
    let mut hands = links.each_mut().map(|link| Hand::new(link, motion));
    let mut felt = 0;
    for frame in 0..frames {
        let change = changes.iter().find(|change| change.0 == frame);
        let mailbox = executor.mailbox();
        change.into_iter().for_each(|&(_, to)| mailbox.post(TOOL, Message::TakeUp(to)));
        executor.advance(1, &mut NullRenderer::new(), &mut |_| {}).expect("no table is full");
        let [first, second] = &mut hands;
        let (one, other) =
            (first.frame(&executor, &ORDERS[0]), second.frame(&executor, &ORDERS[1]));
        assert_eq!(one, other, "{instrument:?}, frame {frame}");
        executor.mailbox().post(TOOL, Message::Device(one.1));
        felt += usize::from(one.0 != Wrench::default());
    }
    felt
}

/// Forceps that let go of a piece while they lift it: it flies on, over the hand, which stops.
#[test]
fn letting_go_feels_the_same_in_any_order_of_drawing() {
    let (above, inside) = (LID + Vec3::Z * 0.005, LID - Vec3::Z * 1e-3);
    for step in [3e-4, 5e-4, 8e-4] {
        let up = inside + Vec3::Z * (20.0 * step);
        let taking = [(0, above, false), (10, inside, false), (15, inside, true)];
        let motion = way(&[taking.as_slice(), &[(35, up, false)]].concat());
        let felt = felt_in_any_order(Instrument::Forceps, &motion, &[], 60);
        assert!(felt > 20, "something was felt in {felt} frames");
    }
}

/// A burr that leans on bone becomes an elevator and a burr again, with the hand in the bone.
#[test]
fn a_burr_feels_the_same_in_any_order_of_drawing() {
    let inside = Vec3::Z * -1e-3;
    let motion = way(&[(0, Vec3::Z * 0.005, false), (20, inside, false)]);
    let changes = [(40, Instrument::Elevator), (60, Instrument::Burr)];
    let felt = felt_in_any_order(Instrument::Burr, &motion, &changes, 80);
    assert!(felt > 30, "something was felt in {felt} frames");
}

/// A device whose amplifier has tripped can be read: its tool follows the hand, which feels nothing.
#[test]
fn a_device_that_cannot_be_written_leads_its_tool() {
    let (from, to) = (LID + Vec3::Z * 0.02, LID + Vec3::Z * 0.03);
    let motion = way(&[(0, from, false), (10, to, false)]);
    let mut link = HapticLink::new();
    let mut hand = Hand::with(Led(motion, Err(DeviceError::Driver { code: 7 })), &mut link);
    let mut executor = scene(Instrument::Elevator, from);
    let mut place = from;
    for _ in 0..12 {
        executor.advance(1, &mut NullRenderer::new(), &mut |_| {}).expect("no table is full");
        place = hand.frame(&executor, &ORDERS[0]).1.position;
    }
    assert!(place.distance(to) < 1e-6, "{place}");
}

/// A device at rest that may be pulled out.
struct Plugged<'a>(DeviceSample, &'a AtomicBool);

impl HapticDevice for Plugged<'_> {
    fn description(&self) -> DeviceDescription {
        SimulatedDevice::DESCRIPTION
    }

    fn read(&mut self, _time: f64) -> Result<DeviceSample, DeviceError> {
        if self.1.load(Ordering::Relaxed) { Err(DeviceError::Disconnected) } else { Ok(self.0) }
    }

    fn write(&mut self, _wrench: Wrench) -> Result<(), DeviceError> {
        Ok(())
    }
}

/// A device that is pulled out with its button down: the simulation knows, and after a while its tool lets go.
#[test]
fn a_device_that_is_gone_is_told_of_and_lets_go() {
    let place = LID + Vec3::Z * 0.02;
    let mut link = HapticLink::new();
    let (end, simulation) = link.split();
    let is_gone = AtomicBool::new(false);
    let device = Plugged(DeviceSample { buttons: 1, ..DeviceSample::at(place) }, &is_gone);
    let mut feel = Feel::new(simulation);
    let mut ticking = HapticLoop::new(device, end, ForceSettings::default());
    assert_eq!(feel.sample(), None, "nothing was said");
    assert_eq!(feel.told(), None);
    ticking.tick(0.1);
    let pressed = feel.sample().expect("it was said where the device is");
    assert_eq!((pressed.buttons, feel.told().and_then(|told| told.fault)), (1, None));
    is_gone.store(true, Ordering::Relaxed);
    ticking.tick(0.2);
    assert_eq!(feel.sample(), Some(pressed), "for a tick that is missed nobody lets go");
    assert_eq!(feel.told().and_then(|told| told.fault), Some(DeviceError::Disconnected));
    ticking.tick(0.2 + 0.9 * LETS_GO);
    assert_eq!(feel.sample(), Some(pressed), "nor for some");
    ticking.tick(0.2 + 1.1 * LETS_GO);
    assert_eq!(feel.sample(), Some(DeviceSample { buttons: 0, ..pressed }));
    is_gone.store(false, Ordering::Relaxed);
    ticking.tick(0.6);
    assert_eq!(feel.sample(), Some(pressed), "it is there again");
}

/// A driver that hangs, or a loop that was stopped, with the button down: after 0.25 s of frames the tool lets go.
#[test]
fn a_loop_that_says_nothing_lets_go() {
    let mut link = HapticLink::new();
    let (end, simulation) = link.split();
    let is_gone = AtomicBool::new(false);
    let device = Plugged(DeviceSample { buttons: 1, ..DeviceSample::at(LID) }, &is_gone);
    let mut feel = Feel::new(simulation);
    let mut ticking = HapticLoop::new(device, end, ForceSettings::default());
    for tick in 1..=2 {
        ticking.tick(f64::from(tick));
        let buttons: Vec<u32> =
            (0..20).map(|_| feel.sample().expect("it was said").buttons).collect();
        assert_eq!(buttons[..15], [1; 15], "for a slow tick nobody lets go");
        assert_eq!(buttons[16..], [0; 4]);
    }
}

/// A loop that was stopped with the button down is told of.
#[test]
fn a_loop_that_was_stopped_is_told_of() {
    let mut link = HapticLink::new();
    let (end, simulation) = link.split();
    let is_gone = AtomicBool::new(false);
    let device = Plugged(DeviceSample { buttons: 1, ..DeviceSample::at(LID) }, &is_gone);
    let mut feel = Feel::new(simulation);
    scope(|scope| {
        let settings = ForceSettings::default();
        let haptics = HapticThread::spawn(scope, device, end, settings, RATE).expect("it starts");
        while feel.sample().is_none_or(|sample| sample.buttons == 0) {
            sleep(Duration::from_millis(1));
        }
        assert!(feel.told().is_some_and(|told| told.is_fresh));
        drop(haptics);
        let last = (0..20).map(|_| feel.sample()).last().flatten();
        assert_eq!(last, Some(DeviceSample::at(LID)), "its tool has let go");
    });
    assert!(feel.told().is_some_and(|told| !told.is_fresh && told.ticks.due > 0));
}

/// Bone that is drawn no more, since it was removed or hidden, neither pushes a hand nor holds its tool out.
#[test]
fn what_is_not_drawn_is_not_felt() {
    let inside = LID - Vec3::Z * 1e-3;
    let motion = way(&[(0, LID + Vec3::Z * 0.005, false), (10, inside, false)]);
    let mut link = HapticLink::new();
    let mut hand = Hand::new(&mut link, &motion);
    let mut executor = scene(Instrument::Elevator, LID + Vec3::Z * 0.005);
    let mut after = |frames: u64, drawn: &[ObjectId]| {
        let mut seen = None;
        for _ in 0..frames {
            executor.advance(1, &mut NullRenderer::new(), &mut |_| {}).expect("no table is full");
            seen = Some(hand.frame(&executor, drawn));
        }
        seen.expect("a frame")
    };
    let (wrench, sample) = after(40, &ORDERS[0]);
    assert!((wrench.force.z - 2.0).abs() < 0.3, "{wrench:?}");
    assert!((sample.position.z - LID.z).abs() < 2e-4, "{sample:?} is held out");
    let bones: Vec<_> = ORDERS[0].into_iter().filter(|&id| id != TOOL).collect();
    let (_, sample) = after(1, &bones);
    assert_eq!(sample.position, inside, "a tool that is hidden");
    let (_, sample) = after(1, &ORDERS[0]);
    assert!((sample.position.z - LID.z).abs() < 2e-4, "{sample:?} is held out again");
    let (_, sample) = after(1, &[TOOL, SKULL]);
    assert_eq!(sample.position, inside);
    let (wrench, _) = after(20, &[TOOL, SKULL]);
    assert_eq!(wrench, Wrench::default());
}

/// A blade that cuts 0.5 mm above bone: the loop knows where that begins.
#[test]
fn bone_that_is_near_is_told_beside_what_is_cut() {
    let mut link = HapticLink::new();
    let model = cutting(&mut link, Vec3::Y * 0.5e-3);
    let cut = |way: f32| CUTTING / CUTTING_GIVES * way;
    let above = model.force_at(Vec3::Y * 0.5e-3);
    assert!(above.y.abs() < 1e-3 && above.x > 0.3, "{above}");
    let inside = model.force_at(Vec3::Y * -1e-3);
    assert!((inside.y - 2.0 - cut(1.5e-3)).abs() < 1e-3, "{inside}");
}

/// What is told of a tool there that cuts in a plane of bone, and is held back by 1 mm.
fn cutting(link: &mut HapticLink, place: Vec3) -> LocalModel {
    let (end, simulation) = link.split();
    let mut feel = Feel::new(simulation);
    let device = ScriptedDevice::new(Motion::at_rest(place).expect("finite"));
    HapticLoop::new(device, end, ForceSettings::default()).tick(0.1);
    let mut proxy = Proxy::new(Vec3::Y);
    proxy.follow(place, &Flat);
    feel.bones.push(Near { bone: SKULL, proxy, is_drawn: true });
    let work = Work { cuts: true, ..Work::default() };
    feel.tool = Some(Seen { tip: place, work, coupling: None, push: None });
    // It takes a first look for the blade to be held somewhere.
    feel.model().expect("a device and a tool");
    let [blade, _] = &mut feel.drags;
    blade.anchor = Some(place + Vec3::X * 1e-3);
    feel.model().expect("a device and a tool")
}

/// A tool that cuts, 1 mm deep in bone: what it cuts holds it back, but bone does not when it goes out.
#[test]
fn bone_only_pushes_also_beside_what_is_cut() {
    let mut link = HapticLink::new();
    let place = Vec3::Y * -1e-3;
    let model = cutting(&mut link, place);
    let inside = model.force_at(place);
    assert!((inside.y - 2.0).abs() < 1e-3 && inside.x > 0.3, "{inside}");
    let outside = model.force_at(Vec3::Y * 1e-3);
    let cut = CUTTING / CUTTING_GIVES * 2e-3;
    assert!((outside.y + cut).abs() < 1e-3 && outside.x > 0.3, "{outside}");
}

/// An object of bone of 10 × 10 × 4 mm around the origin, from the upper side on down.
fn bone(id: ObjectId) -> Object {
    Object::new(id, SKULL_GROUP, Geometry::Volume(slab(Vec3::ZERO)), Bone::new())
}

/// An elevator that presses on a flap as it comes free: it is pushed as before, not let through.
#[test]
fn a_flap_that_comes_free_under_a_hand_is_felt() {
    let deep = Vec3::Z * -2e-3;
    let mut link = HapticLink::new();
    let motion = way(&[(0, Vec3::Z * 0.005, false), (10, deep, false)]);
    let mut hand = Hand::new(&mut link, &motion);
    let (rigid, tool) =
        Tool::new(Instrument::Elevator, DeviceSample::at(deep), Workpieces::default());
    let tool = Object::new(TOOL, TOOL_GROUP, Geometry::Rigid(rigid), tool);
    for frame in 0..40 {
        hand.ticking.tick(f64::from(frame) * f64::from(TIME_STEP));
        hand.feel.tool(&tool);
        hand.feel.bone(&bone(if frame < 20 { SKULL } else { PIECE }));
        hand.feel.deliver();
        let place = hand.feel.sample().expect("the device has told").position;
        assert!(frame < 10 || place.z.abs() < 2e-4, "{place}, frame {frame}");
    }
}

/// Of what pulls together, each as old as its frame, the whole is as old as the oldest.
#[test]
fn a_sum_is_as_old_as_its_oldest_part() {
    let [new, old] = [2.0, 1.0].map(|time| LocalModel { time, ..LocalModel::FREE });
    assert_eq!((sum(new, old).time, sum(old, new).time), (1.0, 1.0));
}
