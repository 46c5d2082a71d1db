//! Progress on standard error, if somebody looks at it.

use dualframe_sim::executor::FrameRecord;
use indicatif::{ProgressBar, ProgressStyle};

use super::AllocationCounter;
use super::measure::Measure;

/// Frames that run without a window: how far they are, and what is measured of them.
pub(super) struct Progress<'a> {
    bar: ProgressBar,
    measure: Measure<'a>,
}

impl<'a> Progress<'a> {
    /// Of so many frames, the first of which begins now.
    pub(super) fn begin(frames: u64, count: AllocationCounter<'a>) -> Self {
        let bar = bar(frames, "{bar:40} {pos}/{len} frames, {per_sec}, {eta} left");
        let mut measure = Measure::new(Some(frames), count);
        measure.start();
        Self { bar, measure }
    }

    /// A frame was swapped.
    pub(super) fn frame(&mut self, record: &FrameRecord) {
        self.measure.frame(record);
        if !self.bar.is_hidden() {
            self.measure.beside(|| self.bar.inc(1));
        }
    }

    /// No more come; gives back what was measured.
    pub(super) fn end(self) -> Measure<'a> {
        self.bar.finish_and_clear();
        self.measure
    }
}

/// Of so much work, of which messages say what it is.
pub(super) fn of_work(work: u64) -> ProgressBar {
    bar(work, "{bar:40} {percent} % {msg}, {eta} left")
}

fn bar(length: u64, template: &str) -> ProgressBar {
    let bar = ProgressBar::new(length);
    match ProgressStyle::with_template(template) {
        Ok(style) => bar.with_style(style),
        Err(_) => bar,
    }
}
