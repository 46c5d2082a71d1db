//! Two drills work on one piece of bone and cut a disc out of it, which comes free and is lifted: the same
//! bits for every executor and number of threads.

mod common;

use std::any::Any;

use common::no_rules;
use dualframe_sim::behavior::drill::{Approach, Bit, Burr, Erode, Feed, Reaction};
use dualframe_sim::behavior::piece::Piece;
use dualframe_sim::behavior::{Behavior, Bone, Grasp, Hold, Input};
use dualframe_sim::executor::ExecutorKind;
use dualframe_sim::geometry::{Geometry, Rigid, Volume};
use dualframe_sim::interaction::{
    BurrForce, BurrInBone, InteractionPair, PieceInBone, PieceOnBone,
};
use dualframe_sim::manager::{Settings, VeManager};
use dualframe_sim::message::Message;
use dualframe_sim::object::{Group, Object, ObjectId};
use dualframe_sim::render::NullRenderer;
use dualframe_sim::scene::{Scene, bone_piece};
use dualframe_sim::stages::Stages;
use glam::Vec3;
use parry3d::math::Pose;
use parry3d::shape::SharedShape;

const TIME: f32 = 1.0 / 60.0;
const TOOLS: Group = Group(0);
const SKULL: Group = Group(1);
const PIECES: Group = Group(2);
const BONE: ObjectId = ObjectId(2);
const PIECE: ObjectId = ObjectId(3);
/// Of the circle that is cut, in metres.
const CUT: f32 = 8e-3;
/// The highest point of the bone.
const TOP: Vec3 = Vec3::new(0.032, 0.032, 0.044);
/// Frames of drilling: half a circle each, all through the bone.
const FRAMES: u64 = 280;

/// A drill on half a circle, by a hand that pushes.
struct Drill {
    feed: Feed,
    bit: Bit,
    approach: Approach,
    /// The direction in which it begins, and round which side it goes.
    first: f32,
    forces: f32,
}

impl Drill {
    fn new(first: f32) -> Self {
        let bit = Bit { length: 12e-3, radius: 1.5e-3, specific_energy: 2e7, ..Bit::BURR };
        let feed = Feed::new(20.0, 1_000.0, 5e-4, 4e-4).expect("a hand");
        Self { feed, bit, approach: Approach::default(), first, forces: 0.0 }
    }

    /// Where the hand wants it: down through the bone, and round.
    fn intended(&self, frame: u64) -> Vec3 {
        let down = (frame as f32 / 80.0).min(1.0);
        // Half a circle as a rational curve.
        let share = (frame.saturating_sub(80) as f32 / 180.0).min(1.0);
        let along = 2.1 * share - 1.05;
        let (cosine, sine) =
            ((1.0 - along * along) / (1.0 + along * along), 2.0 * along / (1.0 + along * along));
        let aside = Vec3::new(self.first * cosine, self.first * sine, 0.0) * CUT;
        TOP + aside + Vec3::Z * (5e-3 - 15e-3 * down)
    }

    fn at(&self, center: Vec3) -> Burr {
        let side = self.approach.side(center);
        Burr { bit: self.bit, center, axis: Vec3::Z, spin: 4e3, side }
    }
}

impl Behavior for Drill {
    fn update(&mut self, geometry: &mut Geometry, input: &mut Input<'_>) {
        let Geometry::Rigid(rigid) = geometry else { return };
        let reaction = Reaction::new(input.contacts(), input.time_step);
        self.forces += reaction.force.length();
        let place = rigid.pose.translation;
        self.approach.follow(&self.at(place), reaction.normal());
        let load = self.feed.load(&reaction);
        if load > 0.0 {
            let erode = Erode { burr: self.at(place), load };
            input.post(BONE, Message::Custom(Box::new(erode)));
        }
        let intended = self.intended(input.frame);
        rigid.pose.translation = self.feed.next(place, intended, &reaction, input.time_step);
    }

    fn burr(&self, geometry: &Geometry) -> Option<Burr> {
        Some(self.at(geometry.as_rigid()?.pose.translation))
    }

    fn hash_state(&self, hasher: &mut dyn std::hash::Hasher) {
        hasher.write(&self.forces.to_le_bytes());
    }
}

fn drill(id: u32, first: f32) -> Object {
    let behavior = Drill::new(first);
    let ball = Rigid::new(SharedShape::ball(1e-3), Pose::from_translation(behavior.intended(0)));
    Object::new(ObjectId(id), TOOLS, Geometry::Rigid(ball), behavior)
}

fn scene() -> Scene {
    let bone = bone_piece(80, Pose::IDENTITY).expect("80 voxels");
    let bone = Object::new(BONE, SKULL, Geometry::Volume(bone), Bone::new());
    let mut stages = Stages { time_step: TIME, gravity: Vec3::NEG_Z * 9.81, ..no_rules() };
    for group in [SKULL, PIECES] {
        let pair =
            InteractionPair { detection: Box::new(BurrInBone), response: Box::new(BurrForce) };
        stages.rules.model(TOOLS, group, pair).expect("its first rule");
    }
    let pair = InteractionPair {
        detection: Box::new(PieceInBone { time_step: TIME }),
        response: Box::new(PieceOnBone { friction: 0.4 }),
    };
    stages.rules.model(PIECES, SKULL, pair).expect("its first rule");
    Scene::new(vec![drill(0, 1.0), drill(1, -1.0), bone], stages)
}

fn mass(volume: &Volume) -> u64 {
    volume.densities().map(u64::from).sum()
}

fn advance(manager: &mut VeManager, frames: u64) {
    manager.run(frames, &mut NullRenderer::new(), &mut |_| {}).expect("no table is full");
}

/// Makes the freed disc an object of its own; says how many voxels it has.
fn free(scene: &mut Scene) -> u64 {
    let bone = &mut scene.objects[BONE.0 as usize];
    let volume = bone.geometry.as_volume_mut().expect("a volume");
    let before = mass(volume);
    let parts = volume.parts(volume.dims().map(|dim| 0..dim));
    // Nothing touches the border of this grid: the largest is the bone, and the next one the disc.
    let large = parts.iter().filter(|part| part.voxels() > 512).count();
    assert_eq!(large, 2, "{:?}", parts.iter().map(|part| part.voxels()).collect::<Vec<_>>());
    let disc = volume.split_off(&parts[1]).expect("its own part");
    assert_eq!(mass(volume) + mass(&disc), before);
    let behavior = Piece::new(&disc);
    scene.objects.push(Object::new(PIECE, PIECES, Geometry::Volume(disc), behavior));
    parts[1].voxels()
}

/// Drills, frees, lifts: the hashes on the way, and where the piece is in the end.
fn session(settings: Settings) -> ([u64; 3], Vec3) {
    let start = scene();
    let whole = mass(start.objects[2].geometry.as_volume().expect("a volume"));
    let mut manager = VeManager::new(start, settings).expect("the settings are allowed");
    advance(&mut manager, FRAMES);
    let drilled = manager.state_hash();
    let mut scene = manager.into_scene();
    let bone = &scene.objects[2];
    let behavior: &dyn Any = &*bone.behavior;
    let removed = behavior.downcast_ref::<Bone>().expect("bone").removed();
    let left = mass(bone.geometry.as_volume().expect("a volume"));
    assert_eq!(removed + left, whole, "what was removed is missing");
    let voxels = free(&mut scene);
    assert!((500..4_000).contains(&voxels), "{voxels} voxels came free");
    let center = scene.objects[3].center();
    // The tools go away, and a hand lifts the disc.
    let post = |message| scene.mailbox.post(PIECE, message);
    let point = TOP - Vec3::Z * 1e-3;
    let by = ObjectId(0);
    post(Message::Custom(Box::new(Grasp {
        by,
        point,
        radius: 2e-3,
        stiffness: 1e3,
        strength: 20.0,
    })));
    scene.mailbox.post(by, Message::Remove);
    scene.mailbox.post(ObjectId(1), Message::Remove);
    let mailbox = scene.mailbox.clone();
    let mut manager = VeManager::new(scene, settings).expect("the settings are allowed");
    let freed = manager.state_hash();
    for step in 1..=60_u32 {
        let position = point + Vec3::Z * 5e-4 * step as f32;
        mailbox.post(PIECE, Message::Custom(Box::new(Hold { by, position })));
        advance(&mut manager, 1);
    }
    advance(&mut manager, 30);
    let mut lifted = Vec3::ZERO;
    manager.visit(&mut |object| {
        if object.id() == PIECE {
            assert_eq!(object.quarantined(), None);
            lifted = object.center() - center;
        }
    });
    ([drilled, freed, manager.state_hash()], lifted)
}

#[test]
fn two_drills_free_a_disc_with_the_same_bits_however_it_is_run() {
    let settings = |executor, threads| Settings { executor, threads, ..Settings::default() };
    let expected = session(settings(ExecutorKind::Serial, 1));
    assert!((0.02..0.035).contains(&expected.1.z), "lifted by {}", expected.1);
    for &executor in ExecutorKind::ALL {
        for threads in [1, 2, 3] {
            let result = session(settings(executor, threads));
            assert_eq!(result, expected, "{executor:?}, {threads} threads");
        }
    }
}
