//! What something takes in a frame, as it is timed now and then: for who balances it.

use std::time::Duration;

/// Of so many frames one is timed; usually 16.
const FRAMES_PER_TIMING: u64 = 16;

/// Whether updates and renderings are timed in a frame: never in the first ones after blocks were formed anew, for
/// which little is in the caches.
pub(crate) fn is_timed(frame: u64) -> bool {
    frame % FRAMES_PER_TIMING == FRAMES_PER_TIMING / 2
}

/// The mean of what was timed, of which the last counts half, the one before a quarter and so on.
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_was_interrupted_counts_at_most_double() {
        let mut cost = Cost::default();
        for (took, expected) in [(4, 4.0), (4_000, 6.0), (2, 4.0)] {
            cost.note(Duration::from_micros(took));
            assert!((cost.seconds() * 1e6 - expected).abs() < 1e-3, "{cost:?}");
        }
    }
}
