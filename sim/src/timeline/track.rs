//! One worker's spans.

use std::sync::atomic::{AtomicU64, Ordering, fence};

use super::Span;
use crate::executor::Stage;

/// A span in words: begin, length, and four times the frame plus the stage.
type Words = [u64; 3];

fn to_words(span: Span) -> Words {
    [span.begin, span.length, span.frame << 2 | span.stage as u64]
}

fn from_words([begin, length, what]: Words) -> Span {
    Span { begin, length, frame: what >> 2, stage: Stage::ALL[(what & 3) as usize] }
}

/// A ring of spans: one thread writes, any number read at any time. What a reader finds overwritten
/// when it has read it is dropped, so nobody waits.
#[derive(Debug)]
pub(super) struct Track {
    /// The number of spans ever written.
    written: AtomicU64,
    /// One more than are kept: the one that is perhaps being written.
    slots: Box<[[AtomicU64; 3]]>,
}

impl Track {
    pub(super) fn new(capacity: usize) -> Self {
        let slots = (0..=capacity).map(|_| Default::default()).collect();
        Self { written: AtomicU64::new(0), slots }
    }

    fn slot(&self, index: u64) -> &[AtomicU64; 3] {
        &self.slots[(index % self.slots.len() as u64) as usize]
    }

    /// Appends a span; the oldest goes if there is no room.
    pub(super) fn push(&self, span: Span) {
        // Relaxed: only this thread writes it.
        let index = self.written.load(Ordering::Relaxed);
        // Release, with the fence in `copy_since`: whoever reads a word of this span knows from then on
        // that all before it were written.
        fence(Ordering::Release);
        for (word, value) in self.slot(index).iter().zip(to_words(span)) {
            // Relaxed: ordered by the fence before and the store behind.
            word.store(value, Ordering::Relaxed);
        }
        // Release, with the load in `copy_since`: whoever counts this span finds it whole.
        self.written.store(index + 1, Ordering::Release);
    }

    /// Appends the spans kept that ended at `since`, in nanoseconds, or later.
    pub(super) fn copy_since(&self, since: u64, spans: &mut Vec<Span>) {
        let first = spans.len();
        let kept = self.slots.len() as u64 - 1;
        // Acquire: the spans counted are whole.
        let written = self.written.load(Ordering::Acquire);
        for index in (written.saturating_sub(kept)..written).rev() {
            // Relaxed: ordered by the load before and the fence behind.
            let span =
                from_words(self.slot(index).each_ref().map(|word| word.load(Ordering::Relaxed)));
            if span.begin.saturating_add(span.length) < since {
                break;
            }
            spans.push(span);
        }
        // Acquire: if a word read was a newer span's, what was written before that one is counted now.
        fence(Ordering::Acquire);
        // Less, round about, where two threads record on one number: then nothing is known to be whole.
        let newer = self.written.load(Ordering::Relaxed).wrapping_sub(written);
        // Each took the place of the oldest, and the one after them may have been under way.
        spans.truncate(first + kept.saturating_sub(newer) as usize);
        spans[first..].reverse();
    }
}
