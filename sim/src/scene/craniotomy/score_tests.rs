use std::f32::consts::FRAC_PI_2;

use parry3d::math::Pose;

use super::*;
use crate::behavior::{Bone, Workpieces};
use crate::device::DeviceSample;
use crate::executor::ExecutorKind;
use crate::geometry::{Geometry, Volume};
use crate::interaction::{BurrForce, BurrInBone, InteractionPair, Rules};
use crate::manager::{Settings, VeManager};
use crate::message::Message;
use crate::object::{Group, ObjectId};
use crate::render::NullRenderer;
use crate::scene::Scene;
use crate::simd::Simd;
use crate::stages::Stages;

/// The height of the slab's upper side, in metres.
const TOP: f32 = -0.02;

/// A slab of full bone of 40 × 20 × 8 mm.
fn slab() -> Object {
    let voxels = |[x, y, z]: [u32; 3]| {
        let inside = |index, count| (1..=count).contains(&index);
        if inside(x, 80) && inside(y, 40) && inside(z, 16) { 255 } else { 0 }
    };
    let corner = Pose::from_translation(Vec3::new(-0.010_5, -0.010_5, TOP - 0.008_5));
    let volume = Volume::from_fn([82, 42, 18], Vec3::splat(5e-4), corner, voxels);
    let volume = Geometry::Volume(volume.expect("it is small"));
    Object::new(ObjectId(1), Group(1), volume, Bone::new())
}

/// The score of an instrument over a slab that its device leads from frame to frame.
fn scored(instrument: Instrument, path: impl IntoIterator<Item = DeviceSample>) -> Score {
    let mut path = path.into_iter().peekable();
    let first = *path.peek().expect("it goes somewhere");
    let workpieces = Workpieces { bone: vec![ObjectId(1)], ..Workpieces::default() };
    let (rigid, tool) = Tool::new(instrument, first, workpieces);
    let tool = Object::new(ObjectId(0), Group(0), Geometry::Rigid(rigid), tool);
    let (mut rules, time_step, gravity) = (Rules::new(), 1.0 / 60.0, Vec3::ZERO);
    let pair = InteractionPair { detection: Box::new(BurrInBone), response: Box::new(BurrForce) };
    rules.model(Group(0), Group(1), pair).expect("its first rule");
    let simd = Simd::detect();
    let stages = Stages { rules, time_step, gravity, callback_budget: None, simd };
    let settings = Settings { executor: ExecutorKind::Serial, threads: 1, ..Settings::default() };
    let scene = Scene::new(vec![tool, slab()], stages);
    let mut manager = VeManager::new(scene, settings).expect("two objects");
    let mut score = Score::new(time_step);
    for sample in path {
        manager.mailbox().post(ObjectId(0), Message::Device(sample));
        manager.run(1, &mut NullRenderer::new(), &mut |_| ()).expect("no table is full");
        manager.visit(&mut |object| score.note(0, object, |tip| tip.x));
        score.frame();
    }
    score
}

/// The score of an instrument that is so many millimetres past the inner table from frame to frame, turning or not.
fn moved(instrument: Instrument, path: &[(f32, bool)]) -> Score {
    let at = |&(past, turns): &(f32, bool)| DeviceSample {
        buttons: turns.into(),
        ..DeviceSample::at(Vec3::X * (past * 1e-3))
    };
    scored(instrument, path.iter().map(at))
}

/// A perforator that is led over the slab for so many frames each, so many metres along it and above it, turning or
/// not.
fn perforated(path: &[(usize, [f32; 2], bool)]) -> Score {
    let at = |&(frames, [x, above], turns): &(usize, [f32; 2], bool)| {
        let place = Vec3::new(x, 0.0, TOP + above);
        let sample = DeviceSample { buttons: turns.into(), ..DeviceSample::at(place) };
        std::iter::repeat_n(sample, frames)
    };
    scored(Instrument::Perforator, path.iter().flat_map(at))
}

/// A hole that is bored on is not begun anew, one beside it is, and so is one where bone was only scratched before.
#[test]
fn a_hole_is_begun_once() {
    let (above, down) = (0.01, -0.01);
    let to = |x: f32, frames: usize| {
        [(60, [x, above], false), (frames, [x, down], true), (10, [x, down], false)]
    };
    let (scratched, aside) = (to(0.0, 18), to(0.003, 90));
    let (bored, on, beside) = (to(0.0, 120), to(0.001, 90), to(0.02, 90));
    let begun = |parts: &[[(usize, [f32; 2], bool); 3]]| {
        let score = perforated(&parts.concat());
        assert_eq!((score.in_air, score.peak > 30.0), (0, true));
        score.hole.expect("it drills").0
    };
    for (parts, x) in [
        (vec![scratched], 0.0),
        (vec![bored], 0.0),
        (vec![bored, on], 0.0),
        (vec![bored, on, beside], 0.02),
        (vec![scratched, aside], 0.003),
    ] {
        let tip = begun(&parts);
        assert!((tip.x - x).abs() < 1e-3 && tip.z > TOP - 8e-4, "{tip}, not at {x}: {parts:?}");
    }
}

/// A hole on a skull, which is round, may begin lower than the last one.
#[test]
fn a_hole_is_as_wide_as_its_bit() {
    let hole = (Vec3::X, Vec3::Y);
    for (aside, depth, expected) in
        [(5.4, 2.0, true), (5.6, 2.0, false), (0.0, 0.9, false), (0.0, -2.0, false)]
    {
        let tip = Vec3::new(1.0, -1e-3 * depth, 1e-3 * aside);
        assert_eq!(is_in(hole, tip), expected, "{tip}");
    }
}

#[test]
fn a_bit_tears_the_dura_each_time_it_comes_in() {
    let mut path = [0.0, 0.5, 1.5, 2.5, 1.5, 0.5, 1.5, 1.5, 1.5, 1.5].map(|past| (past, true));
    // It turns from the frame after the button on: not in the first, and not in the last but one.
    path[7].1 = false;
    let score = moved(Instrument::Burr, &path);
    assert_eq!((score.tears, score.drilling, score.in_air), (3, 8, 8));
    assert!((score.tear - 2e-3).abs() < 1e-6, "{} m", score.tear);
    assert!((score.plunge - 2.5e-3).abs() < 1e-6, "{} m", score.plunge);
    // Its foot is meant to go there.
    let score = moved(Instrument::Craniotome, &path);
    assert_eq!((score.tears, score.tear, score.plunge), (0, 0.0, 0.0));
    assert_eq!(score.drilling, 8);
}

/// What is told is the upper end of the step that the force is in.
#[test]
fn one_frame_in_twenty_may_be_harder() {
    for (soft, hard, expected) in [(95, 5, 1.0), (94, 6, 10.0), (0, 1, 10.0), (0, 0, 0.0)] {
        let mut score = Score::new(0.01);
        // From 0.75 N on, and from 9.75 N on.
        (score.forces[3], score.forces[39]) = (soft, hard);
        assert_eq!(score.percentile(0.95), expected, "{soft}, {hard}");
    }
}

#[test]
fn a_hole_along_the_outer_table() {
    let planned = Entry { point: Vec3::ZERO, inward: Vec3::NEG_Y, thickness: 0.005 };
    for (tip, error) in [(Vec3::Z * 0.003, 0.003), (Vec3::new(0.0, 0.003, 0.004), 0.005)] {
        let placement = placement((tip, Vec3::X), &planned);
        assert!((placement.error - error).abs() < 1e-6, "{placement:?}");
        assert!((placement.angle - FRAC_PI_2).abs() < 1e-6, "{placement:?}");
    }
}
