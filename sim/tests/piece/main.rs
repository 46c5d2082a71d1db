//! A free piece of bone: how it falls, rests, is lifted and put back.

#[path = "../common/mod.rs"]
mod common;
mod drilled;

use std::any::Any;

use common::{no_rules, run, serial};
use dualframe_sim::behavior::piece::{BONE_DENSITY, Piece};
use dualframe_sim::behavior::{Bone, Fixed, Grasp, Hold, LetGo};
use dualframe_sim::executor::{Executor, SerialExecutor};
use dualframe_sim::geometry::{Geometry, Volume};
use dualframe_sim::interaction::{InteractionPair, PieceInBone, PieceOnBone};
use dualframe_sim::message::Message;
use dualframe_sim::object::{Group, Object, ObjectId};
use dualframe_sim::scene::Scene;
use dualframe_sim::stages::Stages;
use dualframe_sim::state::object_hash;
use glam::{DMat3, DVec3, Quat, Vec3};
use parry3d::math::Pose;

const TIME: f32 = 1.0 / 60.0;
const SPACING: f32 = 5e-4;
const TOOL: ObjectId = ObjectId(9);

/// A box of full bone, of so many voxels, within its grid.
fn plate(voxels: [u32; 3], pose: Pose) -> Volume {
    let inside = |voxel: [u32; 3]| (0..3).all(|axis| (1..=voxels[axis]).contains(&voxel[axis]));
    let dims = voxels.map(|side| side + 2);
    Volume::from_fn(dims, Vec3::splat(SPACING), pose, |voxel| if inside(voxel) { 255 } else { 0 })
        .expect("it is small")
}

/// A flat floor of bone whose surface is at z = 0.
fn floor() -> Object {
    let at = Pose::from_translation(Vec3::new(-0.05, -0.05, -0.010_5));
    let volume = plate([200, 200, 20], at);
    Object::new(ObjectId(1), Group(1), Geometry::Volume(volume), Bone::new())
}

fn stages(gravity: f32) -> Stages {
    let mut stages = Stages { time_step: TIME, gravity: Vec3::NEG_Z * gravity, ..no_rules() };
    let pair = InteractionPair {
        detection: Box::new(PieceInBone { time_step: TIME }),
        response: Box::new(PieceOnBone { friction: 0.4 }),
    };
    stages.rules.model(Group(0), Group(1), pair).expect("its first rule");
    stages
}

/// A plate of 20 × 15 × 4 mm.
fn flap(pose: Pose) -> Volume {
    plate([40, 30, 8], pose)
}

fn scene(volume: Volume, loose: bool, others: Vec<Object>, gravity: f32) -> SerialExecutor {
    let piece = Piece::new(&volume);
    let piece = if loose { piece.loose() } else { piece };
    let mut objects = vec![Object::new(ObjectId(0), Group(0), Geometry::Volume(volume), piece)];
    objects.extend(others);
    serial(Scene::new(objects, stages(gravity)))
}

fn look<T>(executor: &SerialExecutor, look: impl Fn(&Piece, &Volume) -> T) -> T {
    let mut seen = None;
    executor.visit(&mut |object| {
        let behavior: &dyn Any = &*object.behavior;
        if let (Some(piece), Some(volume)) = (behavior.downcast_ref(), object.geometry.as_volume())
        {
            seen = Some(look(piece, volume));
        }
    });
    seen.expect("one piece")
}

fn center(executor: &SerialExecutor) -> Vec3 {
    look(executor, |piece, volume| piece.body().center(volume))
}

/// The lowest point of the piece, in metres.
fn lowest(executor: &SerialExecutor) -> f32 {
    look(executor, |piece, volume| {
        let heights = piece.samples().iter().map(|&sample| volume.to_world(sample).z);
        heights.fold(f32::MAX, f32::min) - 0.5 * SPACING
    })
}

fn post(executor: &SerialExecutor, message: impl dualframe_sim::message::Custom + 'static) {
    executor.mailbox().post(ObjectId(0), Message::Custom(Box::new(message)));
}

fn turned() -> Quat {
    Quat::from_rotation_x(0.5) * Quat::from_rotation_y(0.3)
}

#[test]
fn mass_and_inertia_of_a_plate() {
    let volume = flap(Pose::from_parts(Vec3::ONE, turned()));
    let mut piece = Piece::new(&volume).loose();
    let body = *piece.body();
    let sides = Vec3::new(20e-3, 15e-3, 4e-3);
    let mass = sides.element_product() * BONE_DENSITY as f32;
    assert!((body.mass / mass - 1.0).abs() < 1e-4, "{} kg", body.mass);
    assert!((body.center(&volume) - volume.center()).length() < 1e-6);
    let squares = sides * sides;
    let inertia = (Vec3::splat(squares.element_sum()) - squares) * (mass / 12.0);
    // From a momentum about each of the plate's own axes.
    for axis in [Vec3::X, Vec3::Y, Vec3::Z] {
        piece = piece.spinning(volume.turned(axis));
        let spin = piece.body().angular_velocity(&volume);
        let expected = volume.turned(axis / inertia);
        assert!((spin - expected).length() < 1e-3 * expected.length(), "{spin}, not {expected}");
    }
    assert!((100..=300).contains(&piece.samples().len()), "{}", piece.samples().len());
}

/// An angle without a plane of symmetry: its products of inertia are not zero.
#[test]
fn inertia_of_an_angle() {
    let inside = |[x, y, z]: [u32; 3]| x < 4 || y < 3 && z < 5;
    let dims = [12, 10, 8];
    let pose = Pose::from_parts(Vec3::ONE, turned());
    let full = |voxel: [u32; 3]| if inside(voxel) { 255 } else { 0 };
    let volume = Volume::from_fn(dims, Vec3::splat(SPACING), pose, full).expect("it is small");
    // The sum over the voxels, each a cube of its own.
    let side = f64::from(SPACING);
    let rows = (0..dims[2]).flat_map(|z| (0..dims[1]).map(move |y| [y, z]));
    let voxels = rows.flat_map(|[y, z]| (0..dims[0]).map(move |x| [x, y, z]));
    let middle = |[x, y, z]: [u32; 3]| (DVec3::new(x.into(), y.into(), z.into()) + 0.5) * side;
    let places: Vec<DVec3> = voxels.filter(|&voxel| inside(voxel)).map(middle).collect();
    let center = places.iter().sum::<DVec3>() / places.len() as f64;
    let mass = BONE_DENSITY * side.powi(3);
    let inertia: DMat3 = places.iter().fold(DMat3::ZERO, |sum, place| {
        let way = *place - center;
        let square = DVec3::splat(way.length_squared() + side * side / 6.0);
        let outer = DMat3::from_cols(way * way.x, way * way.y, way * way.z);
        sum + (DMat3::from_diagonal(square) - outer) * mass
    });
    for axis in [Vec3::X, Vec3::Y, Vec3::Z] {
        let piece = Piece::new(&volume).loose().spinning(volume.turned(axis));
        let spin = volume.turned_back(piece.body().angular_velocity(&volume));
        let momentum = inertia * spin.as_dvec3();
        assert!((momentum - axis.as_dvec3()).length() < 1e-3, "{momentum} for {axis}");
    }
}

#[test]
fn falls_freely() {
    let mut executor = scene(flap(Pose::from_translation(Vec3::Z)), true, vec![], 9.81);
    let start = center(&executor);
    run(&mut executor, 60);
    let fallen = start - center(&executor);
    // Half of g·t², and what the air takes.
    assert!((fallen.z / 4.905 - 1.0).abs() < 0.04, "{fallen}");
    assert!(fallen.truncate().length() < 1e-6);
}

#[test]
fn keeps_its_momentum() {
    let volume = flap(Pose::from_parts(Vec3::Z, turned()));
    let piece = Piece::new(&volume).loose().spinning(Vec3::new(2e-6, 3e-6, -4e-6));
    let object = Object::new(ObjectId(0), Group(0), Geometry::Volume(volume), piece);
    let mut executor = serial(Scene::new(vec![object], stages(0.0)));
    let momentum =
        |executor: &SerialExecutor| look(executor, |piece, _| piece.body().angular_momentum);
    let (at, before) = (center(&executor), momentum(&executor));
    run(&mut executor, 30);
    let after = momentum(&executor);
    assert!((after.normalize() - before.normalize()).length() < 1e-6, "{before}, {after}");
    let kept = after.length() / before.length();
    assert!((0.55..0.65).contains(&kept), "damped by 1/s: {kept}");
    assert!((center(&executor) - at).length() < 1e-6, "its middle stays");
    let pose = look(&executor, |_, volume| volume.pose);
    let length: f32 = pose.rotation.to_array().iter().map(|part| part * part).sum();
    assert!((length - 1.0).abs() < 1e-5);
    assert!(pose.rotation.angle_between(turned()) > 0.1, "it turned");
}

/// Who is in the way in the next frame is looked for in its box, and a corner of it may go far by turning alone.
#[test]
fn a_turning_piece_is_in_its_box_a_frame_later_too() {
    let volume = flap(Pose::from_translation(Vec3::Z));
    // 50 rad/s about the shortest side.
    let piece = Piece::new(&volume).loose().spinning(Vec3::Z * 6e-6);
    let object = Object::new(ObjectId(0), Group(0), Geometry::Volume(volume), piece);
    let mut executor = serial(Scene::new(vec![object], stages(0.0)));
    run(&mut executor, 1);
    for frame in 1..8 {
        let mut bounds = None;
        executor.visit(&mut |object| bounds = Some(object.bounds()));
        let bounds = bounds.expect("one piece");
        run(&mut executor, 1);
        let places: Vec<Vec3> = look(&executor, |piece, volume| {
            piece.samples().iter().map(|&sample| volume.to_world(sample)).collect()
        });
        let is_inside =
            |place: &&Vec3| place.cmpge(bounds.min).all() && place.cmple(bounds.max).all();
        assert_eq!(places.iter().filter(is_inside).count(), places.len(), "frame {frame}");
    }
}

#[test]
fn rests_on_bone() {
    for rotation in [Quat::IDENTITY, turned()] {
        let pose = Pose::from_parts(Vec3::new(0.0, 0.0, 0.02), rotation);
        let mut executor = scene(flap(pose), true, vec![floor()], 9.81);
        let mut deepest = f32::MAX;
        for _ in 0..300 {
            run(&mut executor, 1);
            deepest = deepest.min(lowest(&executor));
        }
        assert!(deepest > -5e-4, "{deepest} m: it sinks in by a voxel at most");
        let (before, low) = (center(&executor), lowest(&executor));
        assert!(low.abs() < 1.5e-4, "{low} m over the bone");
        run(&mut executor, 120);
        let moved = (center(&executor) - before).length();
        assert!(moved < 1e-4, "{moved} m in two seconds of rest");
        // Flat on its side.
        assert!((before.z - 2e-3).abs() < 3e-4, "{before}");
    }
}

#[test]
fn is_held_by_friction_at_any_time_step() {
    // Steeper than this it slides: 0.4.
    let slope = 0.2_f32.atan();
    for frames in [60_u16, 240, 1_000] {
        let time_step = 1.0 / f32::from(frames);
        let mut stages = Stages { time_step, ..no_rules() };
        stages.gravity = 9.81 * Vec3::new(slope.sin(), 0.0, -slope.cos());
        let pair = InteractionPair {
            detection: Box::new(PieceInBone { time_step }),
            response: Box::new(PieceOnBone { friction: 0.4 }),
        };
        stages.rules.model(Group(0), Group(1), pair).expect("its first rule");
        let volume = flap(Pose::from_translation(Vec3::new(-0.01, -0.0075, -4e-4)));
        let piece = Piece::new(&volume).loose();
        let object = Object::new(ObjectId(0), Group(0), Geometry::Volume(volume), piece);
        let mut executor = serial(Scene::new(vec![object, floor()], stages));
        run(&mut executor, frames.into());
        let before = center(&executor);
        for _ in 0..frames {
            run(&mut executor, 1);
            let low = lowest(&executor);
            assert!(low.abs() < 5e-5, "{low} m over the bone, {frames} frames a second");
        }
        let moved = (center(&executor) - before).length();
        assert!(moved < 2e-5, "{moved} m in a second of rest, {frames} frames a second");
    }
}

#[test]
fn does_not_fall_through() {
    // From half a metre it comes at 3 m/s, 5 cm a frame, on 10 mm of bone.
    let mut executor =
        scene(flap(Pose::from_translation(Vec3::Z * 0.5)), true, vec![floor()], 9.81);
    for _ in 0..240 {
        run(&mut executor, 1);
        assert!(lowest(&executor) > -2.5e-4, "{}", lowest(&executor));
    }
    assert!(center(&executor).z < 3e-3);
}

#[test]
fn lies_in_its_place_until_it_is_pulled() {
    let pose = Pose::from_translation(Vec3::new(0.0, 0.0, 0.1));
    let mut executor = scene(flap(pose), false, vec![], 9.81);
    let start = center(&executor);
    run(&mut executor, 60);
    assert_eq!(center(&executor), start, "nothing moves it");
    let grasp = Grasp { by: TOOL, point: start, radius: 3e-3, stiffness: 1e3, strength: 20.0 };
    let miss = Grasp { point: start + Vec3::Z * 0.05, by: ObjectId(8), ..grasp };
    let invalid = Grasp { stiffness: f32::NAN, by: ObjectId(7), ..grasp };
    [grasp, miss, invalid].into_iter().for_each(|grasp| post(&executor, grasp));
    let hold = |executor: &SerialExecutor, up: f32| {
        post(executor, Hold { by: TOOL, position: start + Vec3::Z * up });
    };
    hold(&executor, 2e-3);
    run(&mut executor, 30);
    assert_eq!(look(&executor, |piece, _| piece.holders().collect::<Vec<_>>()), [TOOL]);
    assert_eq!(center(&executor), start, "2 N are too little");
    hold(&executor, 0.03);
    run(&mut executor, 120);
    // It hangs by its weight over the stiffness.
    let mass = look(&executor, |piece, _| piece.body().mass);
    let off = start.z + 0.03 - center(&executor).z;
    assert!((off - mass * 9.81 / 1e3).abs() < 2e-5, "{off} m off, {mass} kg");
    assert!(look(&executor, |piece, _| !piece.is_seated()));
    // Brought back near its place and let go of, it lies there as before.
    hold(&executor, 1.5e-3);
    run(&mut executor, 120);
    assert!(look(&executor, |piece, _| !piece.is_seated()), "still held");
    post(&executor, LetGo { by: TOOL });
    run(&mut executor, 2);
    assert_eq!(center(&executor), start);
    assert!(look(&executor, |piece, _| piece.is_seated()));
}

/// A hand however stiff pulls with its strength, and so lifts a piece from its place.
#[test]
fn is_lifted_by_any_stiffness() {
    for stiffness in [1e5, 1e22, f32::MAX] {
        let pose = Pose::from_translation(Vec3::new(0.0, 0.0, 0.1));
        let mut executor = scene(flap(pose), false, vec![], 9.81);
        let start = center(&executor);
        post(&executor, Grasp { by: TOOL, point: start, radius: 3e-3, stiffness, strength: 20.0 });
        post(&executor, Hold { by: TOOL, position: start + Vec3::Z * 0.03 });
        run(&mut executor, 60);
        let off = (center(&executor) - start - Vec3::Z * 0.03).length();
        assert!(off < 1e-4, "{off} m off with {stiffness} N/m");
    }
}

/// A rotation and its negative are one, as after a whole turn; and what lies in its place does not turn on.
#[test]
fn a_piece_that_is_put_back_lies_still() {
    let seat = Pose::from_parts(Vec3::Z * 0.1, turned());
    let mut volume = flap(seat);
    let piece = Piece::new(&volume).spinning(Vec3::Z * 2e-8);
    volume.pose.rotation = -seat.rotation;
    let object = Object::new(ObjectId(0), Group(0), Geometry::Volume(volume), piece);
    let mut executor = serial(Scene::new(vec![object], stages(0.0)));
    let start = center(&executor);
    post(&executor, Grasp { by: TOOL, point: start, radius: 3e-3, stiffness: 1e3, strength: 20.0 });
    post(&executor, Hold { by: TOOL, position: start + Vec3::Z * 5e-3 });
    run(&mut executor, 1);
    post(&executor, Hold { by: TOOL, position: start });
    run(&mut executor, 3);
    let momentum = look(&executor, |piece, _| piece.body().angular_momentum.length());
    assert!(momentum > 1e-8, "it turns while it is held: {momentum} kg·m²/s");
    assert!(look(&executor, |piece, _| !piece.is_seated()));
    post(&executor, LetGo { by: TOOL });
    run(&mut executor, 1);
    look(&executor, |piece, volume| {
        assert!(piece.is_seated());
        assert_eq!(volume.pose, seat);
        let motion = [piece.body().velocity, piece.body().angular_momentum, volume.velocity];
        assert_eq!(motion, [Vec3::ZERO; 3]);
    });
}

/// The spring of a hand is critically damped.
#[test]
fn what_a_hand_brings_somewhere_does_not_swing() {
    let mut executor = scene(flap(Pose::from_translation(Vec3::Z)), true, vec![], 0.0);
    let start = center(&executor);
    post(&executor, Grasp { by: TOOL, point: start, radius: 3e-3, stiffness: 1.0, strength: 20.0 });
    post(&executor, Hold { by: TOOL, position: start + Vec3::X * 0.02 });
    let mut farthest = 0.0_f32;
    for _ in 0..120 {
        run(&mut executor, 1);
        farthest = farthest.max(center(&executor).x - start.x);
    }
    let left = start.x + 0.02 - center(&executor).x;
    assert!(left.abs() < 1e-4, "{left} m from its place after two seconds");
    assert!(farthest < 0.02 + 1e-6, "{farthest} m, which is too far");
}

#[test]
fn a_hand_pulls_with_its_strength_and_no_more() {
    let mut executor = scene(flap(Pose::from_translation(Vec3::Z)), true, vec![], 0.0);
    let (start, strength) = (center(&executor), 0.02);
    post(&executor, Grasp { by: TOOL, point: start, radius: 3e-3, stiffness: 1e3, strength });
    post(&executor, Hold { by: TOOL, position: start + Vec3::X * 10.0 });
    run(&mut executor, 6);
    let (mass, speed) = look(&executor, |piece, _| (piece.body().mass, piece.body().velocity.x));
    let expected = strength * 6.0 * TIME / mass;
    assert!((speed / expected - 1.0).abs() < 0.01, "{speed} m/s, not {expected}");
}

#[test]
fn a_piece_let_go_elsewhere_falls() {
    let pose = Pose::from_translation(Vec3::new(0.0, 0.0, 0.1));
    let mut executor = scene(flap(pose), false, vec![], 9.81);
    let start = center(&executor);
    post(&executor, Grasp { by: TOOL, point: start, radius: 3e-3, stiffness: 1e3, strength: 20.0 });
    post(&executor, Hold { by: TOOL, position: start + Vec3::X * 0.02 });
    run(&mut executor, 60);
    post(&executor, LetGo { by: TOOL });
    run(&mut executor, 60);
    assert!(center(&executor).z < start.z - 1.0);
}

/// A hand of 20 N presses a piece of 2 g on bone.
#[test]
fn is_not_pressed_into_bone() {
    let pose = Pose::from_translation(Vec3::new(0.0, 0.0, 0.003));
    let mut executor = scene(flap(pose), true, vec![floor()], 9.81);
    let grip = center(&executor) + Vec3::new(7e-3, 4e-3, 0.0);
    post(&executor, Grasp { by: TOOL, point: grip, radius: 3e-3, stiffness: 2e3, strength: 20.0 });
    post(&executor, Hold { by: TOOL, position: grip - Vec3::Z * 0.02 });
    for _ in 0..200 {
        run(&mut executor, 1);
        assert!(lowest(&executor) > -5e-4, "{} m", lowest(&executor));
    }
    let lifted = grip + Vec3::Z * 0.03;
    post(&executor, Hold { by: TOOL, position: lifted });
    run(&mut executor, 120);
    assert!(lowest(&executor) > 5e-3, "{}", lowest(&executor));
}

/// Scenery with the shape of a plate.
fn scenery(id: u32, pose: Pose) -> Object {
    Object::new(ObjectId(id), Group(2), Geometry::Volume(flap(pose)), Fixed)
}

/// The states of all but the piece, none of which may be quarantined.
fn states_of_others(executor: &SerialExecutor) -> Vec<(ObjectId, u64)> {
    let mut states = Vec::new();
    executor.visit(&mut |object| {
        assert_eq!(object.quarantined(), None, "{:?}", object.id());
        if object.id() != ObjectId(0) {
            states.push((object.id(), object_hash(object)));
        }
    });
    states.sort_unstable();
    states
}

#[test]
fn scenery_and_bone_ignore_hands() {
    let others = vec![floor(), scenery(2, Pose::IDENTITY)];
    let mut executor = scene(flap(Pose::from_translation(Vec3::Z)), false, others, 9.81);
    let before = states_of_others(&executor);
    for id in [1, 2] {
        let post = |message| executor.mailbox().post(ObjectId(id), Message::Custom(message));
        post(Box::new(LetGo { by: TOOL }));
        let (point, radius, stiffness, strength) = (Vec3::ZERO, 1.0, 1.0, 1.0);
        post(Box::new(Grasp { by: TOOL, point, radius, stiffness, strength }));
        post(Box::new(Hold { by: TOOL, position: Vec3::Y }));
    }
    run(&mut executor, 3);
    assert_eq!(states_of_others(&executor), before);
    assert!(look(&executor, |piece, _| piece.holders().next().is_none()));
}

#[test]
fn a_grasp_beside_it_lets_go() {
    let mut executor = scene(flap(Pose::from_translation(Vec3::Z)), true, vec![], 0.0);
    let point = center(&executor);
    let grasp = Grasp { by: TOOL, point, radius: 3e-3, stiffness: 1e3, strength: 20.0 };
    let holders = |executor: &SerialExecutor| look(executor, |piece, _| piece.holders().count());
    post(&executor, grasp);
    post(&executor, Grasp { radius: f32::NAN, ..grasp });
    run(&mut executor, 1);
    assert_eq!(holders(&executor), 1, "what is no number is ignored");
    post(&executor, Grasp { point: point + Vec3::Z * 0.05, ..grasp });
    run(&mut executor, 1);
    assert_eq!(holders(&executor), 0);
}
