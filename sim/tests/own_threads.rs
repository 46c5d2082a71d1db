//! Callbacks that have threads of their own help them, as `Behavior` says that they may.
#![forbid(unsafe_code)]

mod common;

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::thread;

use common::{Acting, executors, no_rules, point, run};
use dualframe_sim::behavior::Input;
use dualframe_sim::blocking::Grain;
use dualframe_sim::geometry::Geometry;
use dualframe_sim::scene::Scene;
use rayon::{ThreadPool, ThreadPoolBuilder};

const OBJECTS: u32 = 24;
const FRAMES: u64 = 20;

/// Objects that all do this in every update.
fn scene(act: impl Fn() + Clone + Send + Sync + 'static) -> Scene {
    let object = |id| {
        let act = act.clone();
        point(id, Acting(move |_: &mut Geometry, _: &mut Input<'_>| act()))
    };
    Scene::new((0..OBJECTS).map(object).collect(), no_rules())
}

#[test]
fn scoped_threads_do_with_any_executor() {
    let done = Arc::new(AtomicU64::new(0));
    let counted = Arc::clone(&done);
    let act = move || {
        thread::scope(|scope| {
            for _ in 0..2 {
                scope.spawn(|| counted.fetch_add(1, Ordering::Relaxed));
            }
        });
    };
    for (name, mut executor) in executors(|| scene(act.clone()), Grain::Pairwise, 3) {
        done.store(0, Ordering::Relaxed);
        run(&mut *executor, FRAMES);
        assert_eq!(done.load(Ordering::Relaxed), 2 * u64::from(OBJECTS) * FRAMES, "{name}");
    }
}

/// Rayon's executors cannot: they begin the next callback while they wait.
#[test]
fn a_rayon_pool_of_ones_own_does_with_the_pipeline() {
    let pool: Arc<ThreadPool> =
        Arc::new(ThreadPoolBuilder::new().num_threads(2).build().expect("there are threads"));
    let done = Arc::new(AtomicU64::new(0));
    let counted = Arc::clone(&done);
    let act = move || {
        let count = || {
            assert!(pool.current_thread_index().is_some(), "another pool's thread does it");
            counted.fetch_add(1, Ordering::Relaxed);
        };
        pool.install(|| rayon::join(count, count));
    };
    let others = executors(|| scene(act.clone()), Grain::Pairwise, 3)
        .filter(|(name, _)| !["rayon", "overlapped"].contains(name));
    for (name, mut executor) in others {
        done.store(0, Ordering::Relaxed);
        run(&mut *executor, FRAMES);
        assert_eq!(done.load(Ordering::Relaxed), 2 * u64::from(OBJECTS) * FRAMES, "{name}");
    }
}
