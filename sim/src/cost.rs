//! What something takes in a frame, as it is timed now and then: for who balances it.

use std::time::Duration;

/// Of so many frames one is timed; usually 4.
const FRAMES_PER_TIMING: u64 = 4;
/// What was timed in so many frames is noted as one; usually 32: blocks are formed anew half as often.
pub(crate) const FRAMES_PER_NOTE: u64 = 32;
/// The frames of these that are timed: all but the first, for which little is in the caches.
const TIMINGS: usize = (FRAMES_PER_NOTE / FRAMES_PER_TIMING) as usize - 1;

/// Whether updates and renderings are timed in a frame.
pub(crate) fn is_timed(frame: u64) -> bool {
    frame.is_multiple_of(FRAMES_PER_TIMING) && !frame.is_multiple_of(FRAMES_PER_NOTE)
}

/// Whether what was timed is noted in a frame, the last of so many that is timed.
fn is_noted(frame: u64) -> bool {
    frame % FRAMES_PER_NOTE == FRAMES_PER_NOTE - FRAMES_PER_TIMING
}

/// What something took in each frame that was timed since it was last noted.
#[derive(Debug, Default)]
pub(crate) struct Timings {
    took: [Duration; TIMINGS],
    count: usize,
}

impl Timings {
    /// Adds what it took in `frame`, and says what is to be noted in that: the median, which a core that does something
    /// else now and then, or is lent to somebody else, changes little.
    pub(crate) fn add(&mut self, frame: u64, took: Duration) -> Option<Duration> {
        if let Some(free) = self.took.get_mut(self.count) {
            *free = took;
            self.count += 1;
        }
        if !is_noted(frame) {
            return None;
        }
        let known = &mut self.took[..std::mem::take(&mut self.count)];
        known.sort_unstable();
        known.get(known.len() / 2).copied()
    }
}

/// The mean of what was noted, of which the last counts half, the one before a quarter and so on.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Cost {
    /// 0 before the first.
    seconds: f32,
}

impl Cost {
    /// Notes what it took this time.
    pub(crate) fn note(&mut self, took: Duration) {
        let (took, mean) = (took.as_secs_f32(), self.seconds);
        // What was interrupted is not to count for many times what it is.
        self.seconds = if mean > 0.0 { 0.5 * (mean + took.min(2.0 * mean)) } else { took };
    }

    /// In seconds; 0 if nothing has been noted.
    pub(crate) fn seconds(self) -> f32 {
        self.seconds
    }
}

/// A cost that is noted as what it is of is timed.
#[derive(Debug, Default)]
pub(crate) struct TimedCost {
    timings: Timings,
    cost: Cost,
}

impl TimedCost {
    /// Adds what it took in a frame that is timed.
    pub(crate) fn add(&mut self, frame: u64, took: Duration) {
        if let Some(took) = self.timings.add(frame, took) {
            self.cost.note(took);
        }
    }

    /// In seconds; 0 if nothing has been noted.
    pub(crate) fn seconds(&self) -> f32 {
        self.cost.seconds()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_frame_of_a_blocking_is_not_timed() {
        let timed: Vec<u64> = (32..64).filter(|&frame| is_timed(frame)).collect();
        assert_eq!(timed, [36, 40, 44, 48, 52, 56, 60]);
        assert_eq!(timed.len(), TIMINGS);
    }

    #[test]
    fn what_is_noted_is_the_median_of_what_was_timed() {
        let timed = (0..3 * FRAMES_PER_NOTE).filter(|&frame| is_timed(frame));
        let (mut timings, mut noted) = (Timings::default(), Vec::new());
        for frame in timed {
            let took = match frame % FRAMES_PER_NOTE {
                8 => 1,
                // What is interrupted.
                12 | 24 => 1_000,
                _ => 10 + frame / FRAMES_PER_NOTE,
            };
            noted.extend(timings.add(frame, Duration::from_micros(took)).map(|took| (frame, took)));
        }
        let micros = |(frame, took)| (frame, Duration::from_micros(took));
        assert_eq!(noted, [(28, 10), (60, 11), (92, 12)].map(micros));
    }

    #[test]
    fn what_was_interrupted_counts_at_most_double() {
        let mut cost = Cost::default();
        for (took, expected) in [(4, 4.0), (4_000, 6.0), (2, 4.0)] {
            cost.note(Duration::from_micros(took));
            assert!((cost.seconds() * 1e6 - expected).abs() < 1e-3, "{cost:?}");
        }
    }
}
