//! Stage times of one worker, by the core's probe.

use std::time::{Duration, Instant};

use dualframe_core::frame::Frame;
use dualframe_core::probe::Probe;
use dualframe_core::stage::Stage;
use dualframe_core::unit::Work;

use crate::executor::StageSeconds;

/// Of so many frames one is timed; usually 7. Reading the system's clock takes some 50 ns, and with one
/// object a unit every work unit is a change of stage: timing every frame would cost more than
/// synchronising it. A number without common divisors with the frames of a batch, so that its first
/// ones are timed no more often than others.
const FRAMES_PER_SAMPLE: u32 = 7;

/// What a worker is doing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Doing {
    Nothing,
    /// A work unit of a frame that is timed.
    Timed(Stage),
    /// A work unit of another frame.
    Untimed,
}

/// Counts the time from one change of stage to the next: acquiring work and doing it, as the paper
/// measures (§7.2.2). Idle and busy time are measured, and how the busy time is shared out among the
/// stages in one frame of [`FRAMES_PER_SAMPLE`].
pub(super) struct StageClock {
    last: Instant,
    doing: Doing,
    stages: [Duration; 4],
    untimed: Duration,
    idle: Duration,
}

impl StageClock {
    pub(super) fn start() -> Self {
        Self {
            last: Instant::now(),
            doing: Doing::Nothing,
            stages: Default::default(),
            untimed: Duration::ZERO,
            idle: Duration::ZERO,
        }
    }

    #[inline]
    fn turn_to(&mut self, doing: Doing) {
        if self.doing == doing {
            return;
        }
        let now = Instant::now();
        let time = now - std::mem::replace(&mut self.last, now);
        *match std::mem::replace(&mut self.doing, doing) {
            Doing::Nothing => &mut self.idle,
            Doing::Timed(stage) => &mut self.stages[stage as usize],
            Doing::Untimed => &mut self.untimed,
        } += time;
    }

    /// The worker found no work, or leaves.
    pub(super) fn stop(&mut self) {
        self.turn_to(Doing::Nothing);
    }

    /// Adds up the times of a worker that has stopped.
    pub(super) fn add_to(&self, sum: &mut StageSeconds) {
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
        sum.broad_phase += seconds(Stage::BroadPhase);
        sum.interaction += seconds(Stage::Interaction);
        sum.update += seconds(Stage::Update);
        sum.render += seconds(Stage::Render);
        sum.idle += self.idle.as_secs_f64();
    }
}

impl Probe for StageClock {
    #[inline]
    fn begin(&mut self, work: Work, frame: Frame) {
        let timed = frame.0.is_multiple_of(FRAMES_PER_SAMPLE);
        self.turn_to(if timed { Doing::Timed(Stage::of(work)) } else { Doing::Untimed });
    }
}
