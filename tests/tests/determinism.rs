//! Invariant 9: the same bits for every executor, number of threads, frames in flight and broad
//! phase.
#![forbid(unsafe_code)]

use dualframe_sim::blocking::Grain;
use dualframe_sim::executor::{Entry, ExecutorKind};
use dualframe_sim::manager::{Settings, VeManager};
use dualframe_sim::render::NullRenderer;
use dualframe_sim::scene::ParticleScene;

const FRAMES: u64 = 120;
const THREADS: [usize; 5] = [1, 2, 3, 4, 8];
const GRAINS: [Grain; 2] = [Grain::Spatial, Grain::Pairwise];
/// Two frames in flight in both orders, and one.
const ENTRIES: [Entry; 3] = [Entry::AfterUpdate, Entry::AfterRender, Entry::AfterSwap];
const PEERS: [ExecutorKind; 3] =
    [ExecutorKind::Static, ExecutorKind::Rayon, ExecutorKind::RayonOverlapped];

/// Hash of the state, and of all that was drawn and counted on the way there.
fn outcome(scene: ParticleScene, settings: Settings) -> (u64, u64, u64, u64) {
    let mut manager =
        VeManager::new(scene.build().expect("a valid scene"), settings).expect("valid settings");
    let mut renderer = NullRenderer::new();
    let (mut candidates, mut collisions) = (0, 0);
    let mut next = 0;
    manager
        .run(FRAMES, &mut renderer, &mut |record| {
            assert_eq!(record.frame, next, "frames are swapped in order, each once");
            next += 1;
            candidates += record.pairs.candidates;
            collisions += record.pairs.collisions;
        })
        .expect("tables are large enough");
    assert_eq!((next, renderer.swaps()), (FRAMES, FRAMES));
    (manager.state_hash(), renderer.checksum(), candidates, collisions)
}

/// Every way of running that there is.
fn all_settings() -> Vec<Settings> {
    let mut all = Vec::new();
    for grain in GRAINS {
        all.push(Settings { executor: ExecutorKind::Serial, threads: 1, grain, ..default() });
        for threads in THREADS {
            for entry in ENTRIES {
                all.push(Settings { threads, grain, entry, ..default() });
            }
            for executor in PEERS {
                all.push(Settings { executor, threads, grain, ..default() });
            }
        }
    }
    all
}

fn default() -> Settings {
    Settings::default()
}

/// `seeds` are fewer where there is more in each frame.
fn one_hash_for(objects: usize, seeds: u64) {
    let mut hashes = Vec::new();
    for gravity in [false, true] {
        for seed in 1..=seeds {
            let scene = ParticleScene { seed, gravity, ..ParticleScene::new(objects) };
            let mut all = all_settings().into_iter();
            let first = outcome(scene, all.next().expect("there are settings"));
            for settings in all {
                assert_eq!(outcome(scene, settings), first, "{scene:?} {settings:?}");
            }
            hashes.push(first.0);
        }
    }
    hashes.sort_unstable();
    hashes.dedup();
    assert_eq!(hashes.len() as u64, 2 * seeds, "other seeds and other forces are other states");
}

#[test]
fn one_particle() {
    one_hash_for(1, 3);
}

#[test]
fn two_particles() {
    one_hash_for(2, 3);
}

#[test]
fn seven_particles() {
    one_hash_for(7, 3);
}

#[test]
fn a_hundred_particles() {
    one_hash_for(100, 3);
}

#[test]
fn three_hundred_particles() {
    one_hash_for(300, 1);
}

#[test]
fn the_same_in_pieces() {
    let scene = ParticleScene { seed: 5, gravity: true, ..ParticleScene::new(60) };
    let whole = outcome(scene, default()).0;
    let mut manager =
        VeManager::new(scene.build().expect("a valid scene"), default()).expect("valid settings");
    let mut left = FRAMES;
    for piece in [1, 2, 16, 17, 31].into_iter().cycle() {
        let piece = piece.min(left);
        // Threads come and go between and within the pieces.
        let pool = manager.pool().clone();
        pool.resize(1 + (left % 5) as usize);
        let mut resize = |record: &dualframe_sim::executor::FrameRecord| {
            pool.resize(1 + (record.frame % 4) as usize);
        };
        manager.run(piece, &mut NullRenderer::new(), &mut resize).expect("tables are large enough");
        left -= piece;
        if left == 0 {
            break;
        }
    }
    assert_eq!(manager.state_hash(), whole);
}
