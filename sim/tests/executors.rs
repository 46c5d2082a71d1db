//! The same bits for any executor, any number of threads and any blocking.

mod common;

use common::{Reference, executors, particles, run, serial};
use dualframe_sim::blocking::Grain;
use dualframe_sim::executor::state_hash;
use dualframe_sim::scene::ParticleScene;

/// Regroupings and a bit.
const FRAMES: u64 = 70;
/// More than have a block each.
const OBJECTS: usize = 100;

#[test]
fn executors_threads_and_grain() {
    let scene = || particles(OBJECTS, true, true);
    let expected = run(&mut serial(scene()), FRAMES);
    assert!(expected.0.iter().any(|count| count.collisions > 0), "nothing was tested");
    for grain in [Grain::Spatial, Grain::Pairwise] {
        for threads in 1..=4 {
            for (name, mut executor) in executors(scene, grain, threads) {
                let result = run(&mut *executor, FRAMES);
                assert_eq!(result, expected, "{name}, {threads} threads, {grain:?}");
            }
        }
    }
}

#[test]
fn blocking_and_order_of_calls() {
    let scene = || particles(OBJECTS, true, true);
    let (counts, hash, _) = run(&mut serial(scene()), FRAMES);
    for size in [1, 16, 100] {
        let mut reference = Reference::new(scene(), size);
        for &count in &counts {
            assert_eq!(reference.step(), count, "{size} objects a block");
        }
        assert_eq!(reference.hash(), hash, "{size} objects a block");
    }
}

#[test]
fn advancing_in_pieces() {
    let mut whole = serial(particles(OBJECTS, true, true));
    run(&mut whole, FRAMES);
    for (name, mut pieces) in executors(|| particles(OBJECTS, true, true), Grain::Spatial, 2) {
        for _ in 0..FRAMES / 5 {
            run(&mut *pieces, 5);
        }
        assert_eq!(pieces.frame(), FRAMES);
        assert_eq!(state_hash(&*pieces), state_hash(&whole), "{name}");
    }
}

#[test]
fn seeds_differ_and_repeat() {
    let hash = |seed| {
        let scene = ParticleScene { seed, ..ParticleScene::new(10) };
        let mut executor = serial(scene.build().expect("ten particles are allowed"));
        run(&mut executor, 5).1
    };
    assert_eq!(hash(1), hash(1));
    assert_ne!(hash(1), hash(2));
}

#[test]
fn one_particle() {
    for grain in [Grain::Spatial, Grain::Pairwise] {
        for (name, mut executor) in executors(|| particles(1, false, true), grain, 3) {
            let (counts, _, renderer) = run(&mut *executor, 200);
            assert!(counts.iter().any(|count| count.collisions > 0), "{name}: it hits a wall");
            assert_eq!((renderer.draws(), renderer.swaps()), (200, 200));
        }
    }
}
