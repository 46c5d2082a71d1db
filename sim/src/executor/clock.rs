//! What workers spend their time on (Table 1).

use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, OnceLock};
use std::time::{Duration, Instant};

pub use dualframe_core::stage::Stage;

use crate::timeline::Timeline;

/// Seconds that one worker spent in each stage.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct StageSeconds {
    /// In the broad phase.
    pub broad_phase: f64,
    /// In detection and response.
    pub interaction: f64,
    /// In updates.
    pub update: f64,
    /// In drawing and swapping.
    pub render: f64,
    /// In none of them while frames were being computed: synchronising, waiting, regrouping. The pipeline's workers
    /// count what they wait for each other, not what they wait for blocks to be formed anew.
    pub idle: f64,
}

/// A worker's clock. Others may read it at any time.
#[derive(Debug, Default)]
pub(super) struct Clock {
    nanoseconds: [AtomicU64; 4],
    /// Where the worker's spans are recorded, and its number there.
    track: OnceLock<(Arc<Timeline>, usize)>,
}

impl Clock {
    /// Records on a timeline, as worker number `worker`, what is timed from now on.
    pub(super) fn watch(&self, timeline: Arc<Timeline>, worker: usize) {
        self.track.get_or_init(|| (timeline, worker));
    }

    /// Counts the time until the guard is dropped towards a stage, which works on `frame`.
    pub(super) fn time(&self, stage: Stage, frame: u64) -> Timer<'_> {
        Timer { clock: self, stage, frame, began: Instant::now() }
    }

    /// What was counted, within so much time of running.
    pub(super) fn seconds(&self, running: Duration) -> StageSeconds {
        let seconds =
            |stage: Stage| self.nanoseconds[stage as usize].load(Ordering::Relaxed) as f64 * 1e-9;
        let mut result = StageSeconds {
            broad_phase: seconds(Stage::BroadPhase),
            interaction: seconds(Stage::Interaction),
            update: seconds(Stage::Update),
            render: seconds(Stage::Render),
            idle: 0.0,
        };
        let busy = result.broad_phase + result.interaction + result.update + result.render;
        result.idle = (running.as_secs_f64() - busy).max(0.0);
        result
    }
}

/// Counts time until it is dropped.
pub(super) struct Timer<'a> {
    clock: &'a Clock,
    stage: Stage,
    frame: u64,
    began: Instant,
}

impl Drop for Timer<'_> {
    fn drop(&mut self) {
        let ended = Instant::now();
        let Clock { nanoseconds, track } = self.clock;
        let took = ended - self.began;
        // Relaxed: a count of its own, which nothing else depends on.
        nanoseconds[self.stage as usize].fetch_add(took.as_nanos() as u64, Ordering::Relaxed);
        if let Some((timeline, worker)) = track.get() {
            timeline.record(*worker, self.stage, self.frame, self.began, ended);
        }
    }
}
