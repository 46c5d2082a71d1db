//! What workers spend their time on (Table 1).

use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, OnceLock};
use std::time::{Duration, Instant};

pub use dualframe_core::stage::Stage;

use crate::timeline::Timeline;

/// Of so many frames one is timed; usually 31. Reading the system's clock takes some 50 ns, and with one object a unit
/// every work unit is a change of stage: timing every frame would cost more than synchronising it, and so it would with
/// executors that time each block. A number without common divisors with the frames of a batch, so that its first ones
/// are timed no more often than others; an environment's first one, whose memory nobody has touched yet, is not.
const FRAMES_PER_SAMPLE: u64 = 31;
/// The first of them; usually 2, so that short runs have one, too.
const FIRST_SAMPLE: u64 = 2;

/// Whether a frame is timed that is not recorded on a timeline.
pub(super) fn is_sampled(frame: u64) -> bool {
    frame % FRAMES_PER_SAMPLE == FIRST_SAMPLE
}

/// Seconds that one worker spent in each stage, shared out as in the frames that were timed: one of 31, or all that a
/// timeline records.
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

/// How long frames took, from swap to swap, and how long those of them did that were timed.
#[derive(Debug)]
pub(super) struct Running {
    last: Instant,
    all: Duration,
    timed: Duration,
}

impl Running {
    pub(super) fn new() -> Self {
        Self { last: Instant::now(), all: Duration::ZERO, timed: Duration::ZERO }
    }

    /// The next frame begins now.
    pub(super) fn begin(&mut self) {
        self.last = Instant::now();
    }

    /// The frame `frame`, which this clock as all others may have timed, is swapped, at the time that this says, when
    /// the next one begins.
    pub(super) fn swapped(&mut self, frame: u64, clock: &Clock) -> Instant {
        let now = Instant::now();
        let took = now - std::mem::replace(&mut self.last, now);
        self.all += took;
        if clock.times(frame) {
            self.timed += took;
        }
        now
    }
}

/// A worker's clock, which counts in frames that are sampled, or in all if they are recorded on a timeline. Others may
/// read it at any time.
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

    fn times(&self, frame: u64) -> bool {
        is_sampled(frame) || self.track.get().is_some()
    }

    /// Counts the time until the guard is dropped towards a stage, which works on `frame`, if that is timed.
    pub(super) fn time(&self, stage: Stage, frame: u64) -> Timer<'_> {
        Timer { clock: self, stage, frame, began: self.times(frame).then(Instant::now) }
    }

    /// What was counted, as if all frames had been like those that were timed; all is idle before the first of them.
    pub(super) fn seconds(&self, running: &Running) -> StageSeconds {
        let (all, timed) = (running.all.as_secs_f64(), running.timed.as_secs_f64());
        let frames_for_one = if timed > 0.0 { all / timed } else { 0.0 };
        let seconds = |stage: Stage| {
            self.nanoseconds[stage as usize].load(Ordering::Relaxed) as f64 * 1e-9 * frames_for_one
        };
        let mut result = StageSeconds {
            broad_phase: seconds(Stage::BroadPhase),
            interaction: seconds(Stage::Interaction),
            update: seconds(Stage::Update),
            render: seconds(Stage::Render),
            idle: 0.0,
        };
        let busy = result.broad_phase + result.interaction + result.update + result.render;
        result.idle = (all - busy).max(0.0);
        result
    }
}

/// Counts time until it is dropped.
pub(super) struct Timer<'a> {
    clock: &'a Clock,
    stage: Stage,
    frame: u64,
    /// Nothing where the frame is not timed.
    began: Option<Instant>,
}

impl Drop for Timer<'_> {
    fn drop(&mut self) {
        let Some(began) = self.began else { return };
        let ended = Instant::now();
        let Clock { nanoseconds, track } = self.clock;
        let took = ended - began;
        // Relaxed: a count of its own, which nothing else depends on.
        nanoseconds[self.stage as usize].fetch_add(took.as_nanos() as u64, Ordering::Relaxed);
        if let Some((timeline, worker)) = track.get() {
            timeline.record(*worker, self.stage, self.frame, began, ended);
        }
    }
}

#[cfg(test)]
mod tests {
    use std::thread;

    use super::*;

    #[test]
    fn frames_that_are_not_timed_count_as_those_that_are() {
        let (clock, mut running) = (Clock::default(), Running::new());
        assert_eq!(clock.seconds(&running), StageSeconds::default());
        clock.nanoseconds[Stage::Update as usize].store(500_000_000, Ordering::Relaxed);
        drop(clock.time(Stage::Render, FRAMES_PER_SAMPLE + 1));
        (running.all, running.timed) = (Duration::from_secs(20), Duration::from_secs(2));
        let expected = StageSeconds { update: 5.0, idle: 15.0, ..StageSeconds::default() };
        assert_eq!(clock.seconds(&running), expected);
    }

    #[test]
    fn the_time_of_sampled_frames_is_known_apart() {
        let (clock, mut running) = (Clock::default(), Running::new());
        let frame = |running: &mut Running, frame| {
            thread::sleep(Duration::from_micros(1));
            running.swapped(frame, &clock);
        };
        running.begin();
        (0..FRAMES_PER_SAMPLE).for_each(|number| frame(&mut running, number));
        assert!(running.timed < running.all);
        assert!(!is_sampled(0) && (0..3).any(is_sampled), "short runs have one, but not the first");
        let all = running.all;
        clock.watch(Arc::new(Timeline::new(1, 1)), 0);
        frame(&mut running, 1);
        assert!(running.all > all && running.timed > running.all - all);
    }
}
