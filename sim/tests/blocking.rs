//! How objects come into blocks.

mod common;

use common::{particles, point};
use dualframe_sim::behavior::Fixed;
use dualframe_sim::block::Block;
use dualframe_sim::blocking::{Blocking, BlockingError, Grain};
use dualframe_sim::geometry::Bounds;
use dualframe_sim::object::Object;
use glam::Vec3;

fn numbers(block: &Block) -> Vec<u32> {
    block.objects().iter().map(|object| object.id().0).collect()
}

fn blocks(objects: Vec<Object>, grain: Grain, workers: usize) -> Vec<Block> {
    Blocking::new(objects, grain, workers).expect("the objects are well formed").1
}

#[test]
fn number_and_size_of_blocks() {
    // Particles, workers, blocks of particles; one block of walls comes on top.
    for (objects, workers, expected) in [
        (1, 4, 1),
        (9, 1, 9),
        (10, 1, 1),
        (30, 2, 2),
        (30, 4, 30),
        (64, 1, 1),
        (65, 1, 1),
        (100, 2, 2),
        (200, 2, 4),
        (300, 4, 4),
        (300, 1, 4),
        (300, 2, 4),
        (400, 2, 4),
        (300, 8, 8),
        (300, 16, 16),
        (300, 64, 38),
        (500, 2, 6),
        (1_000, 2, 8),
        (1_000, 16, 16),
        (4_000, 2, 14),
        (4_000, 16, 64),
        (10_000, 2, 28),
    ] {
        let blocks = blocks(particles(objects, false, true).objects, Grain::Spatial, workers);
        assert_eq!(blocks.len(), expected + 1, "{objects} particles, {workers} workers");
        let sizes: Vec<usize> =
            blocks[..expected].iter().map(|block| block.objects().len()).collect();
        // Eight are advanced side by side; blocks of twice to some five times as many differ by fours, and those of few
        // objects by single ones.
        let share = match objects / expected {
            _ if objects <= 64 => 1,
            16..45 => 4,
            _ => 8,
        };
        let (last, whole) = sizes.split_last().expect("blocks");
        assert!(whole.iter().all(|size| size % share == 0), "{sizes:?}");
        let shares = sizes.iter().map(|size| size.div_ceil(share));
        let (least, most) = (shares.clone().min().expect("blocks"), shares.max().expect("blocks"));
        assert!(*last > 0 && most - least <= 1, "{sizes:?}");
    }
    let pairwise = blocks(particles(30, false, true).objects, Grain::Pairwise, 4);
    assert_eq!(pairwise.len(), 36);
}

#[test]
fn every_object_is_in_one_block_before_and_after_regrouping() {
    let objects = particles(100, false, true).objects;
    let (mut blocking, mut blocks) =
        Blocking::new(objects, Grain::Spatial, 2).expect("particles are well formed");
    for _ in 0..2 {
        let mut all: Vec<u32> = blocks.iter().flat_map(numbers).collect();
        all.sort_unstable();
        assert_eq!(all, (0..106).collect::<Vec<_>>());
        blocking.split(&mut blocks);
    }
}

#[test]
fn fewer_blocks_than_there_are_stay_as_they_are() {
    let objects = particles(300, false, true).objects;
    let (mut blocking, mut blocks) =
        Blocking::new(objects, Grain::Spatial, 2).expect("particles are well formed");
    let before: Vec<_> = blocks.iter().map(numbers).collect();
    blocking.split(&mut blocks[..3]);
    blocking.deal(&mut [], 2, 0.0);
    assert_eq!(blocks.iter().map(numbers).collect::<Vec<_>>(), before);
}

#[test]
fn blocks_of_particles_are_compact() {
    let blocks = blocks(particles(4_000, false, true).objects, Grain::Spatial, 4);
    let particles = &blocks[..16];
    let side = |bounds: Bounds| (bounds.max - bounds.min).max_element();
    let widest = particles.iter().map(|block| side(block.bounds())).fold(0.0, f32::max);
    let all = particles.iter().fold(Bounds::EMPTY, |all, block| all.union(&block.bounds()));
    // By their numbers they would be in layers as wide as all of them.
    assert!(widest < 0.7 * side(all), "{widest} m of {} m", side(all));
}

#[test]
fn a_room_that_is_nearly_a_cube_is_split_the_same_way_each_time() {
    let grouped = |stretch: Vec3| -> Vec<Vec<u32>> {
        let mut objects = particles(300, false, true).objects;
        for object in &mut objects {
            let Some(mesh) = object.geometry.as_mesh_mut() else { continue };
            for node in 0..mesh.positions.len() {
                let position = mesh.positions.get(node).expect("a node");
                mesh.positions.set(node, position * stretch);
            }
            object.refit();
        }
        blocks(objects, Grain::Spatial, 2).iter().map(numbers).collect()
    };
    let as_it_is = grouped(Vec3::ONE);
    for axis in Vec3::AXES {
        assert_eq!(grouped(Vec3::ONE + 0.1 * axis), as_it_is, "{axis}");
    }
    assert_ne!(grouped(Vec3::new(1.0, 1.0, 2.0)), as_it_is);
}

#[test]
fn objects_in_one_place_are_split_by_number() {
    let objects = (0..4).rev().map(|id| point(id, common::springs(1.0))).collect();
    let blocks = blocks(objects, Grain::Spatial, 1);
    assert_eq!(blocks.iter().map(numbers).collect::<Vec<_>>(), [[0], [1], [2], [3]]);
}

#[test]
fn wrong_numbers_and_too_many_objects() {
    let error = |objects: Vec<Object>, grain| match Blocking::new(objects, grain, 1) {
        Ok(_) => panic!("refused"),
        Err(error) => error,
    };
    let twice = vec![point(0, Fixed), point(0, Fixed)];
    assert_eq!(error(twice, Grain::Spatial), BlockingError::Number { id: 0, objects: 2 });
    let gap = vec![point(0, Fixed), point(2, Fixed)];
    assert_eq!(error(gap, Grain::Spatial), BlockingError::Number { id: 2, objects: 2 });
    let limit = Blocking::MAX_PAIRWISE_OBJECTS;
    let many = (0..=limit as u32).map(|id| point(id, Fixed)).collect();
    let expected = BlockingError::TooManyObjects { objects: limit + 1, limit };
    assert_eq!(error(many, Grain::Pairwise), expected);
}

#[test]
fn every_home_has_its_share_of_solitary_objects() {
    let solitary = particles(300, false, true).objects.into_iter().map(Object::solitary).collect();
    let (mut blocking, mut blocks) =
        Blocking::new(solitary, Grain::Spatial, 4).expect("particles are well formed");
    blocking.deal(&mut blocks, 2, 0.0);
    let mut of_home = [0, 0];
    for (index, block) in blocks.iter().enumerate() {
        of_home[blocking.home(index) as usize] += block.objects().len();
    }
    assert!(of_home.iter().all(|&objects| objects >= 140), "{of_home:?}");
}
