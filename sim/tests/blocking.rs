//! How objects come into blocks.

mod common;

use common::{particles, point};
use dualframe_sim::behavior::Fixed;
use dualframe_sim::block::Block;
use dualframe_sim::blocking::{Blocking, BlockingError, Grain};
use dualframe_sim::object::Object;

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
        (10, 1, 10),
        (100, 1, 7),
        (300, 1, 19),
        (300, 8, 32),
        (1_000, 2, 63),
        (4_000, 2, 100),
    ] {
        let blocks = blocks(particles(objects, false, true).objects, Grain::Spatial, workers);
        assert_eq!(blocks.len(), expected + 1, "{objects} particles, {workers} workers");
        let sizes = blocks[..expected].iter().map(|block| block.objects().len());
        let (least, most) = sizes.fold((usize::MAX, 0), |(l, m), size| (l.min(size), m.max(size)));
        assert!(most - least <= 1, "{least} to {most} in a block");
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
        blocks.iter_mut().for_each(|block| blocking.drain(block));
        assert!(blocks.iter().all(|block| block.objects().is_empty()));
        blocking.split();
        blocks.iter_mut().enumerate().for_each(|(index, block)| blocking.fill(index, block));
    }
}

#[test]
fn blocks_of_particles_are_compact() {
    let blocks = blocks(particles(1_000, false, true).objects, Grain::Spatial, 1);
    let side = |block: &Block| (block.bounds().max - block.bounds().min).max_element();
    // Sixteen particles in a cube of the lattice need 0.7 m.
    let widest = blocks[..63].iter().map(side).fold(0.0, f32::max);
    assert!(widest < 1.2, "{widest} m");
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
