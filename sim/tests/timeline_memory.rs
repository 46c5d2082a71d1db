//! Recording and copying take no memory. Alone in this file: allocations are counted over all threads.

mod common;

use std::alloc::System;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::{Duration, Instant};

use common::{executors, particles};
use dualframe_sim::blocking::Grain;
use dualframe_sim::executor::Stage;
use dualframe_sim::render::NullRenderer;
use dualframe_sim::timeline::Timeline;
use stats_alloc::{INSTRUMENTED_SYSTEM, StatsAlloc};

#[global_allocator]
static ALLOCATOR: &StatsAlloc<System> = &INSTRUMENTED_SYSTEM;

const WARM: u64 = 50;
const FRAMES: u64 = 200;
const SPANS: usize = 100;

fn allocations() -> usize {
    let stats = ALLOCATOR.stats();
    stats.allocations + stats.reallocations
}

#[test]
fn no_allocation() {
    let timeline = Timeline::new(1, SPANS);
    let mut spans = Vec::with_capacity(SPANS);
    let before = allocations();
    for frame in 0..10 * SPANS as u64 {
        let now = Instant::now();
        timeline.record(0, Stage::Update, frame, now, now);
        spans.clear();
        timeline.copy_since(0, Duration::ZERO, &mut spans);
    }
    assert_eq!(allocations(), before);

    let scene = || particles(60, false, true);
    for (name, mut executor) in executors(scene, Grain::Spatial, 2).take(4) {
        let timeline = Arc::new(Timeline::new(2, SPANS));
        executor.watch(Arc::clone(&timeline));
        let (warm, end) = (AtomicUsize::new(0), AtomicUsize::new(0));
        let done = executor.advance(FRAMES, &mut NullRenderer::new(), &mut |record| {
            let now = if record.frame == WARM { &warm } else { &end };
            now.store(allocations(), Ordering::Relaxed);
            spans.clear();
            timeline.copy_since(0, Duration::ZERO, &mut spans);
        });
        done.expect("no table is full");
        assert_eq!(end.into_inner(), warm.into_inner(), "{name}");
        assert!(!spans.is_empty(), "{name}: nothing was recorded");
    }
}
