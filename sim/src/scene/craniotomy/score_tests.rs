use std::f32::consts::FRAC_PI_2;

use super::*;
use crate::behavior::Workpieces;
use crate::device::DeviceSample;
use crate::executor::ExecutorKind;
use crate::geometry::Geometry;
use crate::interaction::Rules;
use crate::manager::{Settings, VeManager};
use crate::message::Message;
use crate::object::{Group, ObjectId};
use crate::render::NullRenderer;
use crate::scene::Scene;
use crate::simd::Simd;
use crate::stages::Stages;

/// The score of an instrument that is so many millimetres past the inner table from frame to frame, turning or not.
fn moved(instrument: Instrument, path: &[(f32, bool)]) -> Score {
    let at = |past: f32| DeviceSample::at(Vec3::X * (past * 1e-3));
    let (rigid, tool) = Tool::new(instrument, at(path[0].0), Workpieces::default());
    let tool = Object::new(ObjectId(0), Group(0), Geometry::Rigid(rigid), tool);
    let (rules, time_step, gravity) = (Rules::new(), 1.0 / 60.0, Vec3::ZERO);
    let simd = Simd::detect();
    let stages = Stages { rules, time_step, gravity, callback_budget: None, simd };
    let settings = Settings { executor: ExecutorKind::Serial, threads: 1, ..Settings::default() };
    let mut manager = VeManager::new(Scene::new(vec![tool], stages), settings).expect("one object");
    let mut score = Score::new(time_step);
    for &(past, turns) in path {
        let sample = DeviceSample { buttons: turns.into(), ..at(past) };
        manager.mailbox().post(ObjectId(0), Message::Device(sample));
        manager.run(1, &mut NullRenderer::new(), &mut |_| ()).expect("no table is full");
        manager.visit(&mut |tool| score.note(0, tool, |tip| tip.x));
        score.frame();
    }
    score
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
