//! Stage times of one worker, by the core's probe.

use std::time::{Duration, Instant};

use dualframe_core::frame::Frame;
use dualframe_core::probe::Probe;
use dualframe_core::stage::Stage;
use dualframe_core::unit::Work;

use crate::executor::StageSeconds;
use crate::executor::clock::is_sampled;
use crate::timeline::Timeline;

/// What a worker is doing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Doing {
    Nothing,
    /// A work unit of a frame that is timed, by its number in the environment.
    Timed(Stage, u64),
    /// A work unit of another frame.
    Untimed,
}

/// What a worker spent its time on. Idle and busy time are measured, and how the busy time is shared out among
/// the stages in frames that are sampled; in every frame if all are recorded on a timeline.
#[derive(Clone, Copy, Default)]
pub(super) struct Times {
    stages: [Duration; 4],
    untimed: Duration,
    idle: Duration,
}

impl Times {
    pub(super) fn add(&mut self, more: &Self) {
        for (stage, more) in self.stages.iter_mut().zip(more.stages) {
            *stage += more;
        }
        self.untimed += more.untimed;
        self.idle += more.idle;
    }

    pub(super) fn seconds(&self) -> StageSeconds {
        let timed: Duration = self.stages.iter().sum();
        let untimed = self.untimed.as_secs_f64();
        // Who came for so short a time that it met no timed frame came to help with updates.
        let share = |stage: Stage| match (timed, stage) {
            (Duration::ZERO, Stage::Update) => 1.0,
            (Duration::ZERO, _) => 0.0,
            _ => self.stages[stage as usize].as_secs_f64() / timed.as_secs_f64(),
        };
        let seconds =
            |stage: Stage| self.stages[stage as usize].as_secs_f64() + untimed * share(stage);
        StageSeconds {
            broad_phase: seconds(Stage::BroadPhase),
            interaction: seconds(Stage::Interaction),
            update: seconds(Stage::Update),
            render: seconds(Stage::Render),
            idle: self.idle.as_secs_f64(),
        }
    }
}

/// Counts the time from one change of stage to the next: acquiring work and doing it, as the paper
/// measures (§7.2.2).
pub(super) struct StageClock<'t> {
    timeline: Option<&'t Timeline>,
    /// The worker's number on the timeline.
    worker: usize,
    /// The number of the pipeline's frame 0.
    first_frame: u64,
    last: Instant,
    doing: Doing,
    times: Times,
}

impl<'t> StageClock<'t> {
    pub(super) fn start(timeline: Option<&'t Timeline>, worker: usize, first_frame: u64) -> Self {
        Self {
            timeline,
            worker,
            first_frame,
            last: Instant::now(),
            doing: Doing::Nothing,
            times: Times::default(),
        }
    }

    #[inline]
    fn turn_to(&mut self, doing: Doing) {
        if self.doing != doing {
            self.change_to(doing);
        }
    }

    // Seldom called: most frames are not timed.
    #[cold]
    fn change_to(&mut self, doing: Doing) {
        let now = Instant::now();
        let began = std::mem::replace(&mut self.last, now);
        *match std::mem::replace(&mut self.doing, doing) {
            Doing::Nothing => &mut self.times.idle,
            Doing::Timed(stage, frame) => {
                if let Some(timeline) = self.timeline {
                    timeline.record(self.worker, stage, frame, began, now);
                }
                &mut self.times.stages[stage as usize]
            }
            Doing::Untimed => &mut self.times.untimed,
        } += now - began;
    }

    /// The worker found no work, or leaves.
    pub(super) fn stop(&mut self) {
        self.turn_to(Doing::Nothing);
    }

    /// What a worker that has stopped spent its time on.
    pub(super) fn times(&self) -> &Times {
        &self.times
    }
}

impl Probe for StageClock<'_> {
    #[inline]
    fn begin(&mut self, work: Work, frame: Frame) {
        let frame = self.first_frame + u64::from(frame.0);
        let timed = self.timeline.is_some() || is_sampled(frame);
        self.turn_to(if timed { Doing::Timed(Stage::of(work), frame) } else { Doing::Untimed });
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_that_are_not_timed_are_shared_out_as_those_that_are() {
        let [short, long] = [2, 30].map(Duration::from_millis);
        let timed = Times { stages: [short, long, 2 * long, short], ..Times::default() };
        let untimed = Times { untimed: 10 * long, idle: short, ..Times::default() };
        // Two runs, of which the first met no timed frame.
        let mut sum = Times::default();
        sum.add(&untimed);
        assert!((sum.seconds().update - 0.3).abs() < 1e-9, "who only helped helped with updates");
        sum.add(&timed);
        let StageSeconds { broad_phase, interaction, update, render, idle } = sum.seconds();
        let all = 94.0 + 300.0;
        for (seconds, share) in
            [(broad_phase, 2.0), (interaction, 30.0), (update, 60.0), (render, 2.0)]
        {
            assert!((seconds - 1e-3 * share / 94.0 * all).abs() < 1e-9, "{seconds} s");
        }
        assert!((idle - 0.002).abs() < 1e-9);
    }
}
