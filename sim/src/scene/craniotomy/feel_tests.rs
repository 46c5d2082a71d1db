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
use crate::device::thread::HapticLoop;
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

/// A hand that has felt nothing yet, with its device at rest at the origin.
fn untouched(link: &mut HapticLink) -> (Feel<'_>, ToolState) {
    let (_, simulation) = link.split();
    let mut feel = Feel::new(simulation);
    let device = feel.end.tool();
    (feel, device)
}

const COUPLING: Coupling = Coupling { stiffness: 5_000.0, strength: 10.0, normal: Vec3::Z };

/// What is drilled, and what is held but the skull, is where the tool is.
#[test]
fn a_tool_passes_through_what_it_drills_or_holds() {
    let tip = Vec3::X * 0.1;
    let cases = [
        (None, Vec3::ZERO, [false, false]),
        (None, Vec3::Z, [false, true]),
        (Some(COUPLING), Vec3::ZERO, [true, true]),
    ];
    for (coupling, held, expected) in cases {
        let mut link = HapticLink::new();
        let (mut feel, _) = untouched(&mut link);
        let near = |bone| Near { bone, proxy: Proxy::new(Vec3::Y), is_drawn: true };
        feel.bones = vec![near(SKULL), near(PIECE)];
        let work = Work { held, ..Work::default() };
        feel.tool = Some(Seen { tip, work, coupling, push: None });
        feel.pass_through();
        let passed: Vec<bool> =
            feel.bones.iter().map(|near| near.proxy == Proxy::new(tip)).collect();
        assert_eq!(passed, expected, "{coupling:?}, {held}");
    }
}

/// A drill is led beside the device by as much as its tip is from where the hand rested, a millimetre at most, until it
/// is out of bone.
#[test]
fn a_drill_is_led_as_long_as_it_is_in_bone() {
    for (step, expected) in [(0.5e-3, 0.5e-3), (5e-3, SHIFT), (-5e-3, -SHIFT)] {
        let mut link = HapticLink::new();
        let (mut feel, device) = untouched(&mut link);
        feel.rest = Some(Vec3::ZERO);
        feel.drilled(Vec3::Z * step, COUPLING, &device);
        let shift = feel.shift.expect("it is led");
        assert!(shift.distance(Vec3::Z * expected) < 1e-9, "{shift} for {step} m");
        let seen =
            Seen { tip: Vec3::ZERO, work: Work::default(), coupling: None, push: Some(5_000.0) };
        feel.nearest(&seen, &device);
        assert_eq!(feel.shift, None);
    }
}

/// What was felt of tissue is of a tool that a device led there some frames before.
#[test]
fn tissue_is_felt_where_the_device_was() {
    let mut link = HapticLink::new();
    let (mut feel, device) = untouched(&mut link);
    let at = |swap: u8| {
        let sample = DeviceSample { buttons: 1, ..DeviceSample::at(Vec3::X * f32::from(swap)) };
        ToolState { sample, time: f64::from(swap), ..device }
    };
    feel.past.extend((0..=4).map(at));
    let work = Work { held: Vec3::X, tissue: Vec3::Z, ..Work::default() };
    let seen = Seen { tip: Vec3::ZERO, work, coupling: None, push: None };
    let (held, dura) = (feel.held(&seen, &at(4)), feel.dura(&seen));
    let of = |model: Option<LocalModel>| model.map(|model| (model.time, model.position.x));
    assert_eq!((of(held), of(dura)), (Some((1.0, 1.0)), Some((2.0, 2.0))));
}
