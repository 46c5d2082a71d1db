//! A hand that operates through a haptic device: the closed loop in the craniotomy, in simulated time.
#![cfg(feature = "image")]
#![forbid(unsafe_code)]

mod session;

use dualframe_sim::behavior::Instrument;
use dualframe_sim::device::DeviceSample;
use dualframe_sim::device::motion::Keyframe;
use dualframe_sim::device::operator::Hand;
use dualframe_sim::executor::ExecutorKind;
use dualframe_sim::record::wire::{Decoder, Encoder, Malformed};
use dualframe_sim::record::{Header, Recorder, Replay, SceneSpec, Step};
use dualframe_sim::render::NullRenderer;
use dualframe_sim::scene::craniotomy::{SKULL, Step as Stage};
use dualframe_sim::scene::head::Entry;
use glam::{Quat, Vec3};

use self::session::{Session, head, manager, scene};

/// A tool over an entry, upright on it, so many metres in.
fn over(entry: &Entry, time: f64, depth: f32, pressed: bool) -> Keyframe {
    let orientation = Quat::from_rotation_arc(Vec3::Z, -entry.inward);
    let position = entry.point + entry.inward * depth;
    Keyframe { time, sample: DeviceSample { position, orientation, buttons: pressed.into() } }
}

/// A hand of 500 N/m that wants to be so deep that it presses with so many newtons on bone of 2,000 N/m.
fn pressing(newtons: f32) -> Vec<Keyframe> {
    let entry = head().plan.burr_hole;
    let depth = newtons / 500.0 + newtons / 2_000.0;
    vec![over(&entry, 0.3, -0.02, false), over(&entry, 0.8, depth, false)]
}

/// How deep a place is below the entry of the burr hole, in metres.
fn depth(place: Vec3) -> f32 {
    let entry = head().plan.burr_hole;
    (place - entry.point).dot(entry.inward)
}

/// Pressed on the skull with 2 N, an elevator comes to rest on it: the hand is 1 mm in, the force times the
/// stiffness of bone, and the tool that is seen is on the surface.
#[test]
fn an_elevator_rests_on_the_skull() {
    let seen = Session::new(Instrument::Elevator, Hand::FIRM, &pressing(2.0), 3.0).alone();
    let force = seen.force(2.5, 3.0);
    assert!((force.length() - 2.0).abs() < 0.2, "{force}");
    let out = -head().plan.burr_hole.inward;
    assert!(force.normalize().dot(out) > 0.99, "{force}");
    for &(time, tip) in &seen.tips {
        assert!(depth(tip) < 5e-4, "the tool is {} m deep at {time} s", depth(tip));
    }
    let deepest = seen.ticks.iter().map(|tick| depth(tick.place)).fold(f32::MIN, f32::max);
    assert!(deepest < 2.5e-3, "the hand was {deepest} m deep");
    let at_rest = seen.ticks.last().expect("there are ticks").place;
    for tick in seen.during(2.5, 3.0) {
        let off = tick.place.distance(at_rest);
        assert!(off < 3e-5, "it moves by {off} m at {} s", tick.time);
    }
    // A model is a frame old before the next one comes.
    assert!(seen.last.forces.greatest_age < 0.018, "{:?}", seen.last.forces);
}

/// Strokes of 20 mm at 40 mm/s over the skull, in a light and in a firm grip: sound, and smooth in force.
#[test]
fn strokes_over_the_skull_are_sound() {
    let entry = head().plan.burr_hole;
    let aside = entry.inward.any_orthonormal_vector() * 0.01;
    for (hand, depth) in [(Hand::LIGHT, 0.02), (Hand::FIRM, 0.008)] {
        let stroke = |number: u32| {
            let side = if number.is_multiple_of(2) { 1.0 } else { -1.0 };
            let mut keyframe = over(&entry, 1.0 + 0.5 * f64::from(number), depth, false);
            keyframe.sample.position += aside * side;
            keyframe
        };
        let mut keyframes = vec![over(&entry, 0.3, -0.02, false)];
        keyframes.extend((0..8).map(stroke));
        let seen = Session::new(Instrument::Elevator, hand, &keyframes, 5.0).alone();
        let error = seen.last.forces.error_rms();
        let force = seen.force(1.0, 5.0).length();
        println!("{hand:?}: {force} N, interpolation error {error} N rms");
        // Mostly of the friction, which within a frame is a spring.
        assert!(error < 0.25 * f64::from(force), "{hand:?}: {error} N of {force} N");
    }
}

/// A hand of 500 N/m that leans on a burr, first stopped, then turning, gets no deeper than its spring,
/// which is at 10 N from 2 mm on, ahead of the burr, and less than a millimetre that hand and burr were apart.
#[test]
fn a_burr_leads_the_hand() {
    let entry = head().plan.burr_hole;
    let keyframes = [
        // The drill comes after, by 70 mm/s.
        over(&entry, 1.2, -0.01, false),
        over(&entry, 1.7, 0.016, false),
        over(&entry, 2.5, 0.016, true),
        over(&entry, 5.0, 0.016, true),
    ];
    let seen = Session::new(Instrument::Burr, Hand::FIRM, &keyframes, 5.0).alone();
    for &(time, tip) in &seen.tips {
        let tick = seen.ticks.iter().rfind(|tick| tick.time <= time).expect("it ticked");
        let (hand, bit) = (depth(tick.place), depth(tip));
        assert!(time < 1.2 || hand - bit < 3e-3, "{hand} m with the bit at {bit} m, {time} s");
        assert!(time > 2.5 || hand < 3e-3, "the hand is {hand} m deep at {time} s");
    }
    let at = |time: f64| {
        let tick = seen.ticks.iter().rfind(|tick| tick.time <= time).expect("it ticked");
        depth(tick.place)
    };
    let drilled = at(4.9) - at(2.5);
    assert!((2e-3..8e-3).contains(&drilled), "the hand went {drilled} m in 2.4 s");
}

/// Forceps that hold scalp and lift it: the farther, the stronger is the pull, towards where it was; let
/// go, nothing pulls.
#[test]
fn held_scalp_pulls() {
    let pull = head().plan.margin[0];
    let outward = pull.from.normalize();
    let at = |time: f64, height: f32, pressed: bool| {
        let orientation = Quat::from_rotation_arc(Vec3::Z, outward);
        let position = pull.from + outward * height;
        Keyframe { time, sample: DeviceSample { position, orientation, buttons: pressed.into() } }
    };
    let keyframes = [
        at(0.1, 0.02, false),
        at(0.4, 0.0, false),
        at(0.6, 0.0, true),
        at(0.9, 0.005, true),
        at(1.5, 0.005, true),
        at(1.8, 0.010, true),
        at(2.4, 0.010, false),
        at(3.0, 0.010, false),
    ];
    let seen = Session::new(Instrument::Forceps, Hand::FIRM, &keyframes, 3.0).alone();
    let inward = |from: f64, to: f64| -seen.force(from, to).dot(outward);
    let (near, far) = (inward(1.3, 1.5), inward(2.2, 2.39));
    assert!(inward(0.2, 0.4).abs() < 1e-3, "nothing is held yet");
    assert!(near > 0.05 && far > 1.5 * near, "{near} N at 5 mm, {far} N at 10 mm");
    let after = seen.during(2.5, 3.0).map(|tick| tick.force.length()).fold(0.0, f32::max);
    assert!(after == 0.0, "{after} N after it has let go");
}

/// The script's incision through a device: while it is cut, scalp holds the scalpel back with about 1 N on its
/// way of 90 mm, and the hand does that work; in the air nothing holds it.
#[test]
fn scalp_resists_the_scalpel() {
    let seen = Session::scripted(Stage::Incision, Hand::FIRM).alone();
    let cutting = seen.ticks.iter().filter(|tick| tick.force.length() > 0.5).count();
    assert!((2_500..4_000).contains(&cutting), "{cutting} ms for 90 mm at 30 mm/s");
    let strongest = seen.ticks.iter().map(|tick| tick.force.length()).fold(0.0, f32::max);
    assert!(strongest < 1.5, "{strongest} N");
    let work = seen.last.forces.absorbed;
    assert!((0.08..0.14).contains(&work), "{work} J");
    let in_air = seen.ticks.iter().take_while(|tick| tick.force == Vec3::ZERO).count();
    let after = seen.ticks.iter().rev().take_while(|tick| tick.force == Vec3::ZERO).count();
    assert!(in_air > 300 && after > 500, "{in_air} ms before, {after} ms after");
}

/// Through a hole in the skull an instrument feels the dura, which gives way.
#[test]
fn the_dura_is_soft() {
    let entry = head().plan.burr_hole;
    let mut scene = scene();
    let skull = scene.objects[SKULL.0 as usize].geometry.as_volume_mut().expect("bone");
    for step in 0..=20 {
        let middle = entry.point + entry.inward * (step as f32 * 0.5e-3);
        skull.remove(middle, 0.006, |_| 255);
    }
    let past = entry.thickness + 0.003;
    let keyframes = [
        over(&entry, 0.3, -0.02, false),
        over(&entry, 1.0, past, false),
        over(&entry, 2.0, past, false),
    ];
    let session = Session::new(Instrument::Elevator, Hand::FIRM, &keyframes, 2.0);
    let seen = session.run(&mut manager(scene, ExecutorKind::Serial, 1), None);
    seen.is_sound(true);
    let strongest = |from: f64, to: f64| {
        seen.during(from, to).map(|tick| tick.force.length()).fold(0.0, f32::max)
    };
    assert!(strongest(0.0, 0.8) == 0.0, "{} N in the hole", strongest(0.0, 0.8));
    let dura = strongest(0.8, 2.0);
    assert!((0.01..1.0).contains(&dura), "{dura} N of the dura");
}

/// Pressing goes on while the pipeline is held up for 200 ms: the force fades to nothing and comes back
/// without a kick.
#[test]
fn fades_when_the_pipeline_is_held_up() {
    let session = Session::new(Instrument::Elevator, Hand::FIRM, &pressing(2.0), 4.0);
    let seen = Session { held_up: [2.0, 2.2], ..session }.alone();
    let force = |from, to| seen.force(from, to).length();
    assert!(force(1.8, 2.0) > 1.8);
    assert!(force(2.19, 2.2) == 0.0, "{} N", force(2.19, 2.2));
    assert!((force(3.8, 4.0) - 2.0).abs() < 0.2, "{} N", force(3.8, 4.0));
    let speed = seen.during(2.2, 4.0).map(|tick| tick.speed).fold(0.0, f32::max);
    assert!(speed < 0.25, "thrown out at {speed} m/s");
}

/// The synthetic head, for the record.
struct Synthetic;

impl SceneSpec for Synthetic {
    const KIND: &'static str = "synthetic head";

    fn encode(&self, _to: &mut Encoder<'_>) {}

    fn decode(_from: &mut Decoder<'_>) -> Result<Self, Malformed> {
        Ok(Self)
    }
}

/// A session that a device led in the pipeline is replayed to the same bits in other executors, where there
/// is no device; and the same session in one thread, or where copies are drawn beside the next frame, is the
/// same to the last tick.
#[test]
fn a_session_is_replayed() {
    let entry = head().plan.burr_hole;
    let keyframes = [
        over(&entry, 0.1, -0.01, false),
        over(&entry, 0.4, 0.01, true),
        over(&entry, 2.0, 0.01, true),
    ];
    let session = Session::new(Instrument::Burr, Hand::LIGHT, &keyframes, 2.0);
    let mut bytes = Vec::new();
    let mut recorded = manager(scene(), ExecutorKind::Pipeline, 2);
    let header = Header::of(&Synthetic);
    let mut recorder = Recorder::begin(&mut bytes, &header, &recorded).expect("it begins");
    let seen = session.run(&mut recorded, Some(&mut recorder));
    recorder.finish(&recorded).expect("it is written");
    let beside = manager(scene(), ExecutorKind::RayonOverlapped, 2);
    for again in [session.alone(), session.run(&mut { beside }, None)] {
        assert!(seen.hash == again.hash && seen.ticks == again.ticks);
    }
    for (executor, threads) in [(ExecutorKind::Serial, 1), (ExecutorKind::Static, 2)] {
        let mut replay = Replay::new(&bytes[..]).expect("a recording");
        let mut scene = scene();
        replay.begin(&mut scene);
        let mut replayed = manager(scene, executor, threads);
        let mut renderer = NullRenderer::new();
        let mut next = || replay.advance(&mut replayed, 1_000, &mut renderer, &mut |_| {});
        while next().expect("the same bits") != Step::Over {}
        assert_eq!((replayed.frame(), replayed.state_hash()), (recorded.frame(), seen.hash));
    }
}
