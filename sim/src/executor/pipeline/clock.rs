//! Stage times of one worker, by the core's probe.

use std::time::{Duration, Instant};

use dualframe_core::frame::Frame;
use dualframe_core::probe::Probe;
use dualframe_core::stage::Stage;
use dualframe_core::unit::Work;

use crate::executor::StageSeconds;

/// Counts the time from the end of one work unit to the end of the next towards the latter's
/// stage: acquiring work and doing it, as the paper measures (§7.2.2). One reading of the system's
/// clock a work unit.
pub(super) struct StageClock {
    last: Instant,
    stages: [Duration; 4],
    idle: Duration,
}

impl StageClock {
    pub(super) fn start() -> Self {
        Self { last: Instant::now(), stages: Default::default(), idle: Duration::ZERO }
    }

    fn lap(&mut self) -> Duration {
        let now = Instant::now();
        now - std::mem::replace(&mut self.last, now)
    }

    /// The worker found no work since the last work unit ended.
    pub(super) fn idled(&mut self) {
        let time = self.lap();
        self.idle += time;
    }

    pub(super) fn add_to(&self, sum: &mut StageSeconds) {
        let [broad_phase, interaction, update, render] = self.stages.map(|time| time.as_secs_f64());
        sum.broad_phase += broad_phase;
        sum.interaction += interaction;
        sum.update += update;
        sum.render += render;
        sum.idle += self.idle.as_secs_f64();
    }
}

impl Probe for StageClock {
    fn end(&mut self, work: Work, _: Frame) {
        let time = self.lap();
        self.stages[Stage::of(work) as usize] += time;
    }
}
