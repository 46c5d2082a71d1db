//! Timelines as files of the Trace Event Format, which Perfetto and Chrome's own viewer show.
//! <https://docs.google.com/document/d/1CvAClvFfyA5R-PhYUmn5OOQtYMH4h6I0nSsKchNAySU>

use std::fmt;
use std::io::{self, Write};
use std::time::Duration;

use super::{Span, Timeline};
use crate::executor::Stage;

impl Timeline {
    /// Writes all spans there are as a JSON object of the Trace Event Format: a complete event for each,
    /// by the name of its stage, in the category `even` or `odd` as its frame is, on a thread for each
    /// worker; `ts` and `dur` are in microseconds.
    ///
    /// It may be called while workers record, and takes memory for the spans of one worker.
    ///
    /// # Errors
    /// Those of `out`, which is written to in small pieces and is best buffered.
    pub fn write_chrome_trace(&self, mut out: impl Write) -> io::Result<()> {
        write!(out, r#"{{"displayTimeUnit":"ns","traceEvents":["#)?;
        let mut spans = Vec::new();
        let mut separator = "\n";
        for worker in 0..self.workers() {
            spans.clear();
            self.copy_since(worker, Duration::ZERO, &mut spans);
            if spans.is_empty() {
                continue;
            }
            write!(out, r#"{separator}{{"ph":"M","pid":1,"tid":{worker},"name":"thread_name","#)?;
            write!(out, r#""args":{{"name":"worker {worker}"}}}}"#)?;
            separator = ",\n";
            for span in &spans {
                write!(out, "{separator}{}", Event { worker, span })?;
            }
        }
        writeln!(out, "\n]}}")?;
        out.flush()
    }
}

struct Event<'a> {
    worker: usize,
    span: &'a Span,
}

impl fmt::Display for Event<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let &Self { worker, span: &Span { begin, length, frame, stage } } = self;
        let name = match stage {
            Stage::BroadPhase => "broad phase",
            Stage::Interaction => "interaction",
            Stage::Update => "update",
            Stage::Render => "render",
        };
        let category = if frame.is_multiple_of(2) { "even" } else { "odd" };
        let (begin, length) = (Microseconds(begin), Microseconds(length));
        write!(f, r#"{{"ph":"X","pid":1,"tid":{worker},"name":"{name}","cat":"{category}","#)?;
        write!(f, r#""ts":{begin},"dur":{length},"args":{{"frame":{frame}}}}}"#)
    }
}

/// Nanoseconds, shown as microseconds without rounding.
struct Microseconds(u64);

impl fmt::Display for Microseconds {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}.{:03}", self.0 / 1_000, self.0 % 1_000)
    }
}
