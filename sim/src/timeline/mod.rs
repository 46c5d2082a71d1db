//! What each worker did, in which stage of which frame, and when: for a live display, or as a trace.
//!
//! A [`Timeline`] has a track for each worker. All its memory is taken when it is made; a track that is
//! full loses its oldest spans, so that an environment may run for hours. Workers and readers never wait
//! for each other.

mod trace;
mod track;

use std::time::{Duration, Instant};

use crossbeam_utils::CachePadded;

use self::track::Track;
use crate::executor::Stage;

/// What a worker did without a break: work of one stage of one frame. While it is idle there is none.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Span {
    /// Nanoseconds from the start of the timeline.
    begin: u64,
    /// Nanoseconds.
    length: u64,
    frame: u64,
    stage: Stage,
}

impl Span {
    /// What was done.
    #[must_use]
    pub fn stage(&self) -> Stage {
        self.stage
    }

    /// The frame that it was done for, counted from 0.
    #[must_use]
    pub fn frame(&self) -> u64 {
        self.frame
    }

    /// When it began, from the start of the timeline.
    #[must_use]
    pub fn begin(&self) -> Duration {
        Duration::from_nanos(self.begin)
    }

    /// When it ended, from the start of the timeline.
    #[must_use]
    pub fn end(&self) -> Duration {
        Duration::from_nanos(self.begin.saturating_add(self.length))
    }
}

/// A track of spans for each worker.
#[derive(Debug)]
pub struct Timeline {
    start: Instant,
    tracks: Box<[CachePadded<Track>]>,
}

impl Timeline {
    /// A timeline that starts now, with a track of the last `spans_per_worker` spans, 24 bytes each, for
    /// each of so many workers. What workers beyond that number do is not recorded.
    ///
    /// A worker of the pipeline has some tens to hundreds of spans a frame.
    #[must_use]
    pub fn new(workers: usize, spans_per_worker: usize) -> Self {
        let track = |_| CachePadded::new(Track::new(spans_per_worker));
        Self { start: Instant::now(), tracks: (0..workers).map(track).collect() }
    }

    /// The number of tracks.
    #[must_use]
    pub fn workers(&self) -> usize {
        self.tracks.len()
    }

    /// The time since the start.
    #[must_use]
    pub fn now(&self) -> Duration {
        self.start.elapsed()
    }

    /// Records what worker number `worker` did from `begin` to `end`. A worker without a track is
    /// ignored, and a time before the start is taken for the start.
    ///
    /// A number belongs to one thread at a time, which records in the order of time. If two threads
    /// use it at once, some of what they record is lost or mixed up.
    pub fn record(&self, worker: usize, stage: Stage, frame: u64, begin: Instant, end: Instant) {
        let Some(track) = self.tracks.get(worker) else { return };
        let begin = begin.max(self.start);
        let length = nanoseconds(end.saturating_duration_since(begin));
        let begin = nanoseconds(begin.duration_since(self.start));
        track.push(Span { begin, length, frame, stage });
    }

    /// Appends the spans of worker number `worker` that ended at `since` or later and are still there,
    /// the oldest first; none if it has no track. What the worker is in the middle of is not among them.
    ///
    /// Nothing is allocated if there is room for all spans of a track.
    pub fn copy_since(&self, worker: usize, since: Duration, spans: &mut Vec<Span>) {
        if let Some(track) = self.tracks.get(worker) {
            track.copy_since(nanoseconds(since), spans);
        }
    }
}

/// Enough for 584 years.
fn nanoseconds(time: Duration) -> u64 {
    time.as_nanos() as u64
}
