//! Bone that is drilled while frames run: the same bits however it is run, and a renderer that takes
//! only the bricks that changed has the whole of it.

mod common;

use std::collections::HashMap;

use common::{Acting, executors, no_rules, run, serial};
use dualframe_sim::blocking::Grain;
use dualframe_sim::executor::state_hash;
use dualframe_sim::geometry::{BRICK_SIDE, BRICK_VOXELS, Geometry, Volume};
use dualframe_sim::object::{Group, Object, ObjectId};
use dualframe_sim::render::Renderer;
use dualframe_sim::scene::{Scene, bone_piece};
use glam::Vec3;
use parry3d::math::Pose;

const FRAMES: u64 = 24;

/// A piece of skull that moves, and that a burr eats a winding trench into from `top` mm on.
fn drilled(id: u32, top: f32) -> Object {
    let volume = bone_piece(48, Pose::from_translation(Vec3::X * id as f32)).expect("48 voxels");
    let drill = move |geometry: &mut Geometry, input: &mut dualframe_sim::behavior::Input<'_>| {
        let volume = geometry.as_volume_mut().expect("a volume");
        volume.pose.translation.y += 1e-3;
        let along = input.frame as f32;
        let tip = Vec3::new(12.0 + 2.0 * along, 30.0 + along, top - 0.4 * along) * 1e-3;
        volume.remove(volume.to_world(tip), 3e-3, |voxel| voxel.share(0.4));
    };
    Object::new(ObjectId(id), Group(0), Geometry::Volume(volume), Acting(drill))
}

fn two_pieces() -> Scene {
    Scene::new(vec![drilled(0, 44.0), drilled(1, 40.0)], no_rules())
}

/// What a graphics device would hold of each volume, each brick with its revision.
#[derive(Default)]
struct Mirror {
    held: HashMap<ObjectId, Vec<(u64, [u8; BRICK_VOXELS])>>,
    taken: usize,
    swaps: u64,
}

impl Mirror {
    fn take(&mut self, id: ObjectId, volume: &Volume) {
        let counts = volume.brick_counts().map(|count| count as usize);
        let empty = || vec![(0, [0; BRICK_VOXELS]); counts.iter().product()];
        let bricks = self.held.entry(id).or_insert_with(empty);
        let number =
            |[x, y, z]: [u32; 3]| (z as usize * counts[1] + y as usize) * counts[0] + x as usize;
        for (brick, held) in volume.bricks().zip(bricks.iter_mut()) {
            if held.0 != brick.revision {
                *held = (brick.revision, *brick.densities);
                self.taken += 1;
            }
        }
        let held = |voxel: [u32; 3]| {
            let slot = voxel.map(|index| (index % BRICK_SIDE) as usize);
            bricks[number(voxel.map(|index| index / BRICK_SIDE))].1
                [(slot[2] * 16 + slot[1]) * 16 + slot[0]]
        };
        let whole = Volume::from_fn(volume.dims(), volume.spacing(), volume.pose, held);
        let digest = whole.expect("as before").digest();
        assert_eq!(digest, volume.digest(), "{id} in frame {}: a brick was not told", self.swaps);
    }
}

impl Renderer for Mirror {
    fn draw(&mut self, object: &Object) {
        self.take(object.id(), object.geometry.as_volume().expect("a volume"));
    }

    fn swap(&mut self, _frame: u64) {
        self.swaps += 1;
    }
}

#[test]
fn one_state_and_one_picture_for_every_executor() {
    let mut reference = serial(two_pieces());
    let start = state_hash(&reference);
    let expected = run(&mut reference, FRAMES);
    assert_ne!(expected.1, start);
    for grain in [Grain::Spatial, Grain::Pairwise] {
        for threads in [1, 3] {
            for (name, mut executor) in executors(two_pieces, grain, threads) {
                let result = run(&mut *executor, FRAMES);
                assert_eq!(result, expected, "{name}, {threads} threads, {grain:?}");
            }
        }
    }
}

#[test]
fn changed_bricks_are_enough_for_a_renderer() {
    for (name, mut executor) in executors(two_pieces, Grain::Spatial, 2) {
        let mut mirror = Mirror::default();
        executor.advance(FRAMES, &mut mirror, &mut |_| {}).expect("no table is full");
        let all = 2 * 3_usize.pow(3);
        let later = mirror.taken - all;
        assert!(later > 0 && later < all * FRAMES as usize / 4, "{name}: {later} bricks");
    }
}
