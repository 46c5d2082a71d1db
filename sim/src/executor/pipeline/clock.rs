//! Stage times of one worker, by the core's probe.

use std::time::{Duration, Instant};

use dualframe_core::frame::Frame;
use dualframe_core::probe::Probe;
use dualframe_core::stage::Stage;
use dualframe_core::unit::Work;

use crate::executor::StageSeconds;
use crate::timeline::Timeline;

/// Of so many frames one is timed; usually 31. Reading the system's clock takes some 50 ns, and with one
/// object a unit every work unit is a change of stage: timing every frame would cost more than
/// synchronising it. A number without common divisors with the frames of a batch, so that its first
/// ones are timed no more often than others.
const FRAMES_PER_SAMPLE: u32 = 31;

/// What a worker is doing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Doing {
    Nothing,
    /// A work unit of a frame that is timed.
    Timed(Stage, Frame),
    /// A work unit of another frame.
    Untimed,
}

/// Counts the time from one change of stage to the next: acquiring work and doing it, as the paper
/// measures (§7.2.2). Idle and busy time are measured, and how the busy time is shared out among the
/// stages in one frame of [`FRAMES_PER_SAMPLE`]; in every frame if all are recorded on a timeline.
pub(super) struct StageClock<'t> {
    timeline: Option<&'t Timeline>,
    /// The worker's number on the timeline.
    worker: usize,
    /// The number of the pipeline's frame 0.
    first_frame: u64,
    last: Instant,
    doing: Doing,
    stages: [Duration; 4],
    untimed: Duration,
    idle: Duration,
}

impl<'t> StageClock<'t> {
    pub(super) fn start(timeline: Option<&'t Timeline>, worker: usize, first_frame: u64) -> Self {
        Self {
            timeline,
            worker,
            first_frame,
            last: Instant::now(),
            doing: Doing::Nothing,
            stages: Default::default(),
            untimed: Duration::ZERO,
            idle: Duration::ZERO,
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
            Doing::Nothing => &mut self.idle,
            Doing::Timed(stage, frame) => {
                if let Some(timeline) = self.timeline {
                    let frame = self.first_frame + u64::from(frame.0);
                    timeline.record(self.worker, stage, frame, began, now);
                }
                &mut self.stages[stage as usize]
            }
            Doing::Untimed => &mut self.untimed,
        } += now - began;
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

impl Probe for StageClock<'_> {
    #[inline]
    fn begin(&mut self, work: Work, frame: Frame) {
        let timed = self.timeline.is_some() || frame.0.is_multiple_of(FRAMES_PER_SAMPLE);
        self.turn_to(if timed { Doing::Timed(Stage::of(work), frame) } else { Doing::Untimed });
    }
}
