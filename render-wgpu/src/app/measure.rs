//! What is measured while frames run, in memory taken beforehand.

use std::time::{Duration, Instant};

use dualframe_sim::executor::FrameRecord;

use super::AllocationCounter;

/// Frames after which allocations are counted, if there are twice as many; else after half of them,
/// but at least one.
const WARM_UP: u64 = 32;
/// Frames that are kept of a run whose length nobody knows: those of a window's first hour or so.
const MOST_KEPT: u64 = 1 << 20;

/// A run's frames.
pub(super) struct Measure<'a> {
    began: Instant,
    last: Instant,
    warm_up: u64,
    /// Frames done.
    pub(super) frames: u64,
    /// Nanoseconds from swap to swap; of a window's frames the first ones'.
    pub(super) frame_times: Vec<u64>,
    pub(super) candidates: Vec<u32>,
    pub(super) collisions: Vec<u32>,
    count: AllocationCounter<'a>,
    /// Allocations that do not count.
    beside: usize,
    at_warm_up: usize,
    at_last: usize,
}

impl<'a> Measure<'a> {
    /// Of so many frames, if that is known.
    pub(super) fn new(frames: Option<u64>, count: AllocationCounter<'a>) -> Self {
        let room = frames.unwrap_or(MOST_KEPT) as usize;
        let now = Instant::now();
        Self {
            began: now,
            last: now,
            warm_up: frames.map_or(WARM_UP, |frames| WARM_UP.min(frames / 2).max(1)),
            frames: 0,
            frame_times: Vec::with_capacity(room),
            candidates: Vec::with_capacity(room),
            collisions: Vec::with_capacity(room),
            count,
            beside: 0,
            at_warm_up: 0,
            at_last: 0,
        }
    }

    /// The clock starts now.
    pub(super) fn start(&mut self) {
        self.began = Instant::now();
        self.last = self.began;
    }

    /// A frame was swapped.
    pub(super) fn frame(&mut self, record: &FrameRecord) {
        self.frames += 1;
        if self.frame_times.len() < self.frame_times.capacity() {
            self.frame_times.push((record.swapped - self.last).as_nanos() as u64);
            self.candidates.push(u32::try_from(record.pairs.candidates).unwrap_or(u32::MAX));
            self.collisions.push(u32::try_from(record.pairs.collisions).unwrap_or(u32::MAX));
        }
        self.last = record.swapped;
        self.at_last = (self.count)() - self.beside;
        if self.frames == self.warm_up {
            self.at_warm_up = self.at_last;
        }
    }

    /// All since the last frame was a pause: its time does not count.
    pub(super) fn interrupt(&mut self) {
        let now = Instant::now();
        self.began += now - self.last;
        self.last = now;
    }

    /// Does what belongs to the program, not to the simulation: its allocations do not count.
    pub(super) fn beside(&mut self, work: impl FnOnce()) {
        let before = (self.count)();
        work();
        self.beside += (self.count)() - before;
    }

    /// Heap allocations from the warm-up's end to the last frame; none of a run that ended before.
    pub(super) fn allocations(&self) -> usize {
        if self.frames < self.warm_up { 0 } else { self.at_last - self.at_warm_up }
    }

    /// Seconds from the start to the last swap, without pauses.
    pub(super) fn seconds(&self) -> f64 {
        (self.last - self.began).as_secs_f64()
    }

    /// Seconds that the first `frames` frames took.
    pub(super) fn seconds_of_first(&self, frames: u64) -> f64 {
        let times = self.frame_times.iter().take(frames as usize);
        Duration::from_nanos(times.sum()).as_secs_f64()
    }
}

#[cfg(test)]
mod tests {
    use std::thread::sleep;

    use dualframe_sim::stages::PairCount;

    use super::*;

    const PAUSE: Duration = Duration::from_millis(200);

    fn record(frame: u64) -> FrameRecord {
        FrameRecord { frame, swapped: Instant::now(), pairs: PairCount::default() }
    }

    #[test]
    fn a_pause_is_no_frame() {
        let mut measure = Measure::new(None, &|| 0);
        let began = Instant::now();
        measure.start();
        measure.frame(&record(0));
        sleep(PAUSE);
        measure.interrupt();
        measure.frame(&record(1));
        let most = (began.elapsed() - PAUSE).as_secs_f64();
        for seconds in [measure.seconds(), measure.seconds_of_first(2)] {
            assert!(seconds <= most, "{seconds} s of {most}");
        }
    }

    #[test]
    fn of_a_long_session_the_first_frames_are_kept() {
        let mut measure = Measure::new(None, &|| 0);
        let first = measure.frame_times.as_ptr();
        (0..MOST_KEPT + 5).for_each(|frame| measure.frame(&record(frame)));
        assert_eq!(measure.frames, MOST_KEPT + 5);
        let Measure { frame_times, candidates, collisions, .. } = measure;
        assert_eq!(
            [frame_times.len(), candidates.len(), collisions.len()],
            [MOST_KEPT as usize; 3]
        );
        assert_eq!(frame_times.as_ptr(), first, "in memory taken beforehand");
    }

    #[test]
    fn allocations_count_after_warm_up() {
        let made = std::sync::atomic::AtomicUsize::new(1_000);
        let count = || made.fetch_add(1, std::sync::atomic::Ordering::Relaxed);
        let mut measure = Measure::new(None, &count);
        for frame in 0..WARM_UP {
            assert_eq!(measure.allocations(), 0, "before frame {frame}");
            measure.frame(&record(frame));
        }
        measure.frame(&record(WARM_UP));
        assert_eq!(measure.allocations(), 1);
    }
}
