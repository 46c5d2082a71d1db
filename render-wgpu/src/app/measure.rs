//! What is measured while frames run, in memory taken beforehand.

use std::time::{Duration, Instant};

use dualframe_sim::executor::FrameRecord;

use super::AllocationCounter;

/// Frames after which allocations are counted, if there are twice as many; else after half of them,
/// but at least one.
const WARM_UP: u64 = 32;

/// A run's frames.
pub(super) struct Measure<'a> {
    began: Instant,
    last: Instant,
    frames: u64,
    /// Nanoseconds from swap to swap.
    pub(super) frame_times: Vec<u64>,
    pub(super) candidates: Vec<u32>,
    pub(super) collisions: Vec<u32>,
    count: AllocationCounter<'a>,
    at_warm_up: usize,
    pub(super) allocations: usize,
}

impl<'a> Measure<'a> {
    pub(super) fn new(frames: u64, count: AllocationCounter<'a>) -> Self {
        let room = frames as usize;
        let now = Instant::now();
        Self {
            began: now,
            last: now,
            frames,
            frame_times: Vec::with_capacity(room),
            candidates: Vec::with_capacity(room),
            collisions: Vec::with_capacity(room),
            count,
            at_warm_up: 0,
            allocations: 0,
        }
    }

    /// The clock starts now.
    pub(super) fn start(&mut self) {
        self.began = Instant::now();
        self.last = self.began;
    }

    /// A frame was swapped.
    pub(super) fn frame(&mut self, record: &FrameRecord) {
        self.frame_times.push((record.swapped - self.last).as_nanos() as u64);
        self.candidates.push(u32::try_from(record.pairs.candidates).unwrap_or(u32::MAX));
        self.collisions.push(u32::try_from(record.pairs.collisions).unwrap_or(u32::MAX));
        self.last = record.swapped;
        if record.frame + 1 == WARM_UP.min(self.frames / 2).max(1) {
            self.at_warm_up = (self.count)();
        }
        if record.frame + 1 == self.frames {
            self.allocations += (self.count)() - self.at_warm_up;
        }
    }

    /// Does what belongs to the program, not to the simulation: its allocations do not count.
    pub(super) fn beside(&mut self, work: impl FnOnce()) {
        let before = (self.count)();
        work();
        self.at_warm_up += (self.count)() - before;
    }

    /// Seconds from the start to the last swap.
    pub(super) fn seconds(&self) -> f64 {
        (self.last - self.began).as_secs_f64()
    }

    /// Seconds that the first `frames` frames took.
    pub(super) fn seconds_of_first(&self, frames: u64) -> f64 {
        let times = self.frame_times.iter().take(frames as usize);
        Duration::from_nanos(times.sum()).as_secs_f64()
    }
}
