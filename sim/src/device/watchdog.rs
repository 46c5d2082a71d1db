//! Forces that fade when the pipeline stalls.

/// After how many times the last interval between two models the next one is late; usually 3, so that a frame
/// may take twice as long as the one before.
const INTERVALS: f64 = 3.0;
/// The longest interval that is taken for a slow pipeline's rate, and not for a stall, and the longest time for
/// which a model is shown in full, in seconds; usually 0.25: about as long as a hand takes to react.
const LONGEST: f64 = 0.25;

/// Says how much of a model's force to show, by how long ago a new one came.
#[derive(Clone, Copy, Debug)]
pub(super) struct Watchdog {
    /// In seconds.
    timeout: f64,
    /// In seconds.
    fade: f64,
    /// When a model last came.
    fed: f64,
    /// How long after it the next one may come, in seconds.
    patience: f64,
}

impl Watchdog {
    pub(super) fn new(timeout: f64, fade: f64) -> Self {
        Self { timeout, fade, fed: f64::NEG_INFINITY, patience: timeout }
    }

    /// A model comes. A pipeline that is slow, but comes, must not be shown as one stall after the other: a hand
    /// at rest would feel forces swing at its rate.
    pub(super) fn feed(&mut self, time: f64) {
        let interval = time - self.fed;
        let usual = if interval <= LONGEST { (INTERVALS * interval).min(LONGEST) } else { 0.0 };
        (self.fed, self.patience) = (time, usual.max(self.timeout));
    }

    /// 1 while models come; from `timeout` seconds after the last one, or as much later as models usually come, it
    /// falls evenly, and is 0 `fade` seconds later.
    pub(super) fn share(&self, time: f64) -> f32 {
        let silent = time - self.fed - self.patience;
        if silent <= 0.0 { 1.0 } else { (1.0 - silent / self.fade).max(0.0) as f32 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fades_over_the_stated_time() {
        let mut watchdog = Watchdog::new(0.05, 0.1);
        assert_eq!(watchdog.share(0.0), 0.0, "no model ever came");
        watchdog.feed(1.0);
        assert_eq!(watchdog.share(1.05), 1.0);
        assert!((watchdog.share(1.1) - 0.5).abs() < 1e-6);
        assert_eq!(watchdog.share(1.2), 0.0);
        watchdog.feed(1.3);
        assert_eq!(watchdog.share(1.3), 1.0);
    }

    #[test]
    fn waits_for_a_slow_pipeline_but_not_for_a_stall() {
        let mut watchdog = Watchdog::new(0.05, 0.1);
        for (fed, patience) in [(1.0, 0.05), (1.02, 0.06), (1.12, 0.25), (1.36, 0.25), (1.7, 0.05)]
        {
            watchdog.feed(fed);
            assert_eq!(watchdog.share(fed + patience - 1e-9), 1.0, "fed at {fed} s");
            let half = watchdog.share(fed + patience + 0.05);
            assert!((half - 0.5).abs() < 1e-6, "{half}, fed at {fed} s");
        }
    }
}
