//! What the overlay shows of the last frames.

use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::Instant;

use dualframe_sim::executor::FrameRecord;
use dualframe_sim::stages::PairCount;

/// Frames that are shown.
pub(super) const SHOWN_FRAMES: usize = 240;

/// Times and counts of the last frames.
pub(super) struct Stats {
    /// Milliseconds from swap to swap, in a ring.
    times: [f32; SHOWN_FRAMES],
    next: usize,
    known: usize,
    last: Option<Instant>,
    /// What the last frame's interactions counted.
    pub(super) pairs: PairCount,
    /// The last frame.
    pub(super) frame: u64,
}

/// What the overlay shows and frames are noted in take turns.
pub(super) fn lock(stats: &Mutex<Stats>) -> MutexGuard<'_, Stats> {
    stats.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Stats {
    pub(super) fn new() -> Self {
        Self {
            times: [0.0; SHOWN_FRAMES],
            next: 0,
            known: 0,
            last: None,
            pairs: PairCount::default(),
            frame: 0,
        }
    }

    /// A frame was swapped.
    pub(super) fn note(&mut self, record: &FrameRecord) {
        if let Some(last) = self.last.replace(record.swapped) {
            let time = record.swapped.saturating_duration_since(last);
            self.times[self.next] = time.as_secs_f32() * 1e3;
            self.next = (self.next + 1) % SHOWN_FRAMES;
            self.known = (self.known + 1).min(SHOWN_FRAMES);
        }
        (self.pairs, self.frame) = (record.pairs, record.frame);
    }

    /// Frames stood still: the time until the next one is not a frame's.
    pub(super) fn interrupt(&mut self) {
        self.last = None;
    }

    /// Milliseconds from swap to swap, the oldest first.
    pub(super) fn times(&self) -> impl ExactSizeIterator<Item = f32> + '_ {
        let first = if self.known < SHOWN_FRAMES { 0 } else { self.next };
        (0..self.known).map(move |index| self.times[(first + index) % SHOWN_FRAMES])
    }

    /// Frames per second, of the last quarter of the frames shown; 0 if none is known.
    pub(super) fn rate(&self) -> f32 {
        let recent = self.known.min(SHOWN_FRAMES / 4);
        let sum: f32 = self.times().skip(self.known - recent).sum();
        if sum > 0.0 { 1e3 * recent as f32 / sum } else { 0.0 }
    }

    /// The times, in milliseconds, that half, 99 % and all of the frames shown kept to.
    pub(super) fn percentiles(&self) -> [f32; 3] {
        let mut sorted = [f32::INFINITY; SHOWN_FRAMES];
        for (to, time) in sorted.iter_mut().zip(self.times()) {
            *to = time;
        }
        sorted.sort_unstable_by(f32::total_cmp);
        [0.5, 0.99, 1.0].map(|share| {
            let rank = (share * self.known as f32).ceil() as usize;
            if rank == 0 { 0.0 } else { sorted[rank - 1] }
        })
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::*;

    #[test]
    fn the_last_frames_are_kept() {
        let (mut stats, start) = (Stats::new(), Instant::now());
        assert_eq!((stats.rate(), stats.percentiles()), (0.0, [0.0; 3]));
        let mut swapped = start;
        for frame in 0..1_000 {
            swapped += Duration::from_millis(1 + u64::from(frame == 990));
            stats.note(&FrameRecord { frame, swapped, pairs: PairCount::default() });
        }
        assert_eq!(stats.times().len(), SHOWN_FRAMES);
        let [median, most, longest] = stats.percentiles();
        assert!((median - 1.0).abs() < 1e-3 && (most - 1.0).abs() < 1e-3, "{median} {most}");
        assert!((longest - 2.0).abs() < 1e-3, "{longest}");
        assert!((stats.rate() - 60e3 / 61.0).abs() < 1.0, "{}", stats.rate());
        // A pause is no frame.
        stats.interrupt();
        swapped += Duration::from_secs(10);
        stats.note(&FrameRecord { frame: 1_000, swapped, pairs: PairCount::default() });
        assert!(stats.percentiles()[2] < 3.0);
    }
}
