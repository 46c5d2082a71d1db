//! Progress on standard error, if somebody looks at it.

use indicatif::{ProgressBar, ProgressStyle};

/// Of so many frames.
pub(super) fn of_frames(frames: u64) -> ProgressBar {
    bar(frames, "{bar:40} {pos}/{len} frames, {per_sec}, {eta} left")
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
