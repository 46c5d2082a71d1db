//! Forces that fade when the pipeline stalls.

/// Says how much of a model's force to show, by how long ago a new one came.
#[derive(Clone, Copy, Debug)]
pub(super) struct Watchdog {
    /// In seconds.
    timeout: f64,
    /// In seconds.
    fade: f64,
    /// When a model last came.
    fed: f64,
}

impl Watchdog {
    pub(super) fn new(timeout: f64, fade: f64) -> Self {
        Self { timeout, fade, fed: f64::NEG_INFINITY }
    }

    pub(super) fn feed(&mut self, time: f64) {
        self.fed = time;
    }

    /// 1 while models come; from `timeout` seconds after the last one it falls evenly, and is 0 `fade`
    /// seconds later.
    pub(super) fn share(&self, time: f64) -> f32 {
        let silent = time - self.fed - self.timeout;
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
}
