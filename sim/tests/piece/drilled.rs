//! What bits do to a piece: they take bone away, and push it if it is free.

use dualframe_sim::behavior::drill::{Bit, Burr, Erode};
use dualframe_sim::behavior::piece::Piece;
use dualframe_sim::behavior::{Grasp, Hold, Instrument, Tool, Workpieces};
use dualframe_sim::device::DeviceSample;
use dualframe_sim::executor::{Executor, SerialExecutor};
use dualframe_sim::geometry::{Geometry, Volume};
use dualframe_sim::interaction::{BurrForce, BurrInBone, InteractionPair};
use dualframe_sim::message::Message;
use dualframe_sim::object::{Group, Object, ObjectId};
use dualframe_sim::scene::Scene;
use glam::Vec3;
use parry3d::math::Pose;

use crate::common::{point, run, serial, springs};
use crate::{
    SPACING, TIME, TOOL, center, flap, floor, look, lowest, post, scene, scenery, stages,
    states_of_others, turned,
};

/// A burr in a hand that presses it from above on the middle of the piece.
fn pressed_by_a_burr(volume: Volume, loose: bool, others: Vec<Object>) -> SerialExecutor {
    let place = volume.center() + Vec3::Z * 2.5e-3;
    let piece = Piece::new(&volume);
    let piece = if loose { piece.loose() } else { piece };
    let piece = Object::new(ObjectId(0), Group(0), Geometry::Volume(volume), piece);
    let sample = DeviceSample { buttons: 1, ..DeviceSample::at(place) };
    let workpieces = Workpieces { pieces: vec![ObjectId(0)], ..Workpieces::default() };
    let (rigid, tool) = Tool::new(Instrument::Burr, sample, workpieces);
    let id = ObjectId(1 + others.len() as u32);
    let mut objects = vec![piece, Object::new(id, Group(2), Geometry::Rigid(rigid), tool)];
    objects.extend(others);
    let mut stages = stages(9.81);
    let pair = InteractionPair { detection: Box::new(BurrInBone), response: Box::new(BurrForce) };
    stages.rules.model(Group(2), Group(0), pair).expect("its first rule");
    let executor = serial(Scene::new(objects, stages));
    let deeper = DeviceSample { buttons: 1, ..DeviceSample::at(place - Vec3::Z * 6e-3) };
    executor.mailbox().post(id, Message::Device(deeper));
    executor
}

/// A hand of 10 N presses a bit on a piece of 2 g that nothing holds.
#[test]
fn yields_to_a_bit_and_is_not_shot_away() {
    let pose = Pose::from_translation(Vec3::new(0.0, 0.0, 0.5));
    let mut executor = pressed_by_a_burr(flap(pose), true, vec![]);
    let mut fastest = 0.0_f32;
    for frame in 0..30 {
        run(&mut executor, 1);
        let fallen = 9.81 * TIME * (frame + 1) as f32;
        let speed = look(&executor, |piece, _| piece.body().velocity.length());
        fastest = fastest.max(speed - fallen);
    }
    assert!((0.01..0.2).contains(&fastest), "{fastest} m/s");
}

/// While it lay in its place it bore the whole of the hand. What pulls at it could not hold that.
#[test]
fn is_not_shot_away_when_it_is_pulled_from_its_place() {
    let pose = Pose::from_translation(Vec3::new(0.0, 0.0, 0.5));
    let mut executor = pressed_by_a_burr(flap(pose), false, vec![]);
    run(&mut executor, 30);
    let point = center(&executor);
    assert!(look(&executor, |piece, _| piece.is_seated() && piece.removed() > 0));
    post(&executor, Grasp { by: TOOL, point, radius: 3e-3, stiffness: 1e3, strength: 4.0 });
    post(&executor, Hold { by: TOOL, position: point + Vec3::X * 4e-3 });
    for _ in 0..10 {
        run(&mut executor, 1);
        let speed = look(&executor, |piece, _| piece.body().velocity.length());
        assert!(speed < 0.5, "{speed} m/s");
    }
    assert!(look(&executor, |piece, _| !piece.is_seated()));
}

#[test]
fn is_not_pressed_into_bone_by_a_bit_that_drills_it() {
    let pose = Pose::from_translation(Vec3::new(0.0, 0.0, -SPACING));
    let mut executor = pressed_by_a_burr(flap(pose), true, vec![floor()]);
    for frame in 0..60 {
        run(&mut executor, 1);
        assert!(lowest(&executor) > -5e-4, "{} m in frame {frame}", lowest(&executor));
    }
    let removed = look(&executor, |piece, _| piece.removed());
    assert!(removed > 10_000, "{removed}");
}

/// Bone that a bit takes away takes its momentum with it.
#[test]
fn what_is_left_turns_on_as_fast() {
    let volume = flap(Pose::from_parts(Vec3::Z, turned()));
    let center = volume.center();
    let piece = Piece::new(&volume).loose().spinning(turned() * Vec3::Z * 4e-7);
    let before = piece.body().angular_velocity(&volume).length();
    let object = Object::new(ObjectId(0), Group(0), Geometry::Volume(volume), piece);
    let mut executor = serial(Scene::new(vec![object], stages(0.0)));
    let aside = center + turned() * Vec3::X * 8e-3;
    let burr = Burr { bit: Bit::BURR, center: aside, axis: Vec3::Z, spin: 3e3, side: None };
    for _ in 0..30 {
        post(&executor, Erode { burr, load: 100.0 });
        run(&mut executor, 1);
    }
    let kept = look(&executor, |piece, volume| {
        let share = piece.body().mass / Piece::new(&flap(Pose::IDENTITY)).body().mass;
        assert!(share < 0.95, "{share} of it is left");
        piece.body().angular_velocity(volume).length() / before
    });
    // The air slows it by 1/s.
    let expected = (1.0 + TIME).powi(-30);
    assert!((kept / expected - 1.0).abs() < 0.01, "{kept}, not {expected}");
}

/// Its new middle goes on as that place of it did.
#[test]
fn what_is_left_goes_on_as_fast() {
    let volume = flap(Pose::from_parts(Vec3::Z, turned()));
    let piece = Piece::new(&volume).loose().spinning(turned() * Vec3::Z * 4e-7);
    let (before, spin) = (volume.center(), piece.body().angular_velocity(&volume));
    let object = Object::new(ObjectId(0), Group(0), Geometry::Volume(volume), piece);
    let mut executor = serial(Scene::new(vec![object], stages(0.0)));
    let aside = before + turned() * Vec3::X * 8e-3;
    let burr = Burr { bit: Bit::BURR, center: aside, axis: Vec3::Z, spin: 3e3, side: None };
    post(&executor, Erode { burr, load: 1e3 });
    run(&mut executor, 1);
    let velocity = look(&executor, |piece, _| piece.body().velocity);
    let shift = center(&executor) - before - velocity * TIME;
    assert!(shift.length() > 1e-4, "{shift}");
    let expected = spin.cross(shift);
    assert!(
        (velocity - expected).length() < 0.01 * expected.length(),
        "{velocity}, not {expected}"
    );
}

#[test]
fn is_drilled_like_any_bone() {
    let pose = Pose::from_parts(Vec3::new(0.1, 0.2, 0.3), turned());
    let others = vec![scenery(1, pose), point(2, springs(1.0))];
    let mut executor = scene(flap(pose), false, others, 0.0);
    let untouched = states_of_others(&executor);
    let weight = |executor: &SerialExecutor| {
        look(executor, |piece, volume| {
            let densities: u64 = volume.densities().map(u64::from).sum();
            (piece.removed(), densities, piece.body().mass)
        })
    };
    let (center, (_, whole, mass)) = (center(&executor), weight(&executor));
    let burr = Burr { bit: Bit::BURR, center, axis: Vec3::Z, spin: 3e3, side: None };
    for _ in 0..20 {
        // What is scenery, or no bone at all, ignores it.
        for id in 0..3 {
            let erode = Erode { burr, load: 10.0 };
            executor.mailbox().post(ObjectId(id), Message::Custom(Box::new(erode)));
        }
        run(&mut executor, 1);
    }
    assert_eq!(states_of_others(&executor), untouched);
    let (removed, left, lighter) = weight(&executor);
    assert!(removed > 10_000 && removed + left == whole, "{removed} of {whole}");
    let expected = mass * left as f32 / whole as f32;
    assert!((lighter / expected - 1.0).abs() < 1e-4, "{lighter} kg, not {expected}");
}

#[test]
fn what_is_drilled_away_is_held_by_nobody() {
    let mut executor = scene(flap(Pose::IDENTITY), false, vec![], 0.0);
    let center = center(&executor);
    post(
        &executor,
        Grasp { by: TOOL, point: center, radius: 3e-3, stiffness: 1e3, strength: 20.0 },
    );
    run(&mut executor, 1);
    assert_eq!(look(&executor, |piece, _| piece.holders().count()), 1);
    let burr = Burr {
        bit: Bit { radius: 0.1, ..Bit::BURR },
        center,
        axis: Vec3::Z,
        spin: 3e3,
        side: None,
    };
    let mut frames = 0;
    while look(&executor, |piece, _| piece.body().mass) > 0.0 {
        post(&executor, Erode { burr, load: 1e6 });
        run(&mut executor, 1);
        frames += 1;
        assert!(frames < 1_000, "it is still there");
    }
    assert_eq!(look(&executor, |piece, _| piece.holders().count()), 0);
}
