//! What workers spend their time on (Table 1).

use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};

/// A stage of a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stage {
    /// Finding the pairs that may touch.
    BroadPhase,
    /// Detection and response.
    Interaction,
    /// Updates of objects.
    Update,
    /// Drawing and swapping.
    Render,
}

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
    /// In none of them while frames were being computed: synchronising, waiting, regrouping.
    pub idle: f64,
}

/// A worker's clock. Others may read it at any time.
#[derive(Debug, Default)]
pub(super) struct Clock([AtomicU64; 4]);

impl Clock {
    /// Counts the time until the guard is dropped towards a stage.
    pub(super) fn time(&self, stage: Stage) -> Timer<'_> {
        Timer { clock: self, stage, began: Instant::now() }
    }

    /// Counts some time towards a stage.
    pub(super) fn add(&self, stage: Stage, time: Duration) {
        self.0[stage as usize].fetch_add(time.as_nanos() as u64, Ordering::Relaxed);
    }

    /// What was counted, within so much time of running.
    pub(super) fn seconds(&self, running: Duration) -> StageSeconds {
        let seconds = |stage: Stage| self.0[stage as usize].load(Ordering::Relaxed) as f64 * 1e-9;
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
    began: Instant,
}

impl Drop for Timer<'_> {
    fn drop(&mut self) {
        self.clock.add(self.stage, self.began.elapsed());
    }
}
