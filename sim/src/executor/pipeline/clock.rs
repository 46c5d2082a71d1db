//! Stage times of one worker, by the core's probe.

use std::time::{Duration, Instant};

use dualframe_core::frame::Frame;
use dualframe_core::probe::Probe;
use dualframe_core::stage::Stage;
use dualframe_core::unit::Work;

use crate::executor::StageSeconds;

/// Counts the time from one change of stage to the next: acquiring work and doing it, as the paper
/// measures (§7.2.2). The system's clock is read when the stage changes only.
pub(super) struct StageClock {
    last: Instant,
    /// What the time is counted towards; `None` while there is nothing to do.
    stage: Option<Stage>,
    stages: [Duration; 4],
    idle: Duration,
}

impl StageClock {
    pub(super) fn start() -> Self {
        let last = Instant::now();
        Self { last, stage: None, stages: Default::default(), idle: Duration::ZERO }
    }

    /// The worker turns to a stage, or to none.
    #[inline]
    fn turn_to(&mut self, stage: Option<Stage>) {
        if self.stage == stage {
            return;
        }
        let now = Instant::now();
        let time = now - std::mem::replace(&mut self.last, now);
        match std::mem::replace(&mut self.stage, stage) {
            Some(stage) => self.stages[stage as usize] += time,
            None => self.idle += time,
        }
    }

    /// The worker found no work, or leaves.
    pub(super) fn stop(&mut self) {
        self.turn_to(None);
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
    #[inline]
    fn begin(&mut self, work: Work, _: Frame) {
        self.turn_to(Some(Stage::of(work)));
    }
}
