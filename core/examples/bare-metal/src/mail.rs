//! The letters: who sends what to whom, and when the frames must wait for them.

use core::sync::atomic::{AtomicU32, Ordering};

use dualframe_core::inbox::From;
use dualframe_core::pipeline::Pipeline;
use dualframe_core::unit::UnitId;
use dualframe_core::wait::Waiting;

use crate::ve::{DISCS, FRAMES, Room};

/// Interrupt handlers that send: one for each core, where there are as many.
pub(crate) const SENDERS: usize = 4;
/// Letters of each sender: as many to each disc.
const EACH: u32 = 4 * DISCS as u32;
/// All letters.
pub(crate) const LETTERS: usize = SENDERS * EACH as usize;
/// A sender's next letter is due this many frames after the one before.
const PACE: u32 = 3;

/// To whom a sender's letter of this sequence number goes, and what it says.
pub(crate) fn letter(sender: u32, sequence: u32) -> (UnitId, u32) {
    let to = UnitId(sequence % DISCS as u32);
    (to, (sequence * 4 + sender).wrapping_mul(0x9e37_79b9))
}

/// What the senders have posted.
pub(crate) struct Outbox([AtomicU32; SENDERS]);

impl Outbox {
    pub(crate) const fn new() -> Self {
        Self([const { AtomicU32::new(0) }; SENDERS])
    }

    /// Posts those of `sender`'s letters that are due: what an interrupt handler does. Nobody else
    /// posts for this sender meanwhile. What the pool has no room for is posted the next time.
    pub(crate) fn post_due<W: Waiting>(&self, sender: usize, pipeline: &Pipeline<'_, Room, W>) {
        let posted = &self.0[sender];
        loop {
            let from = From { sender: sender as u32, sequence: posted.load(Ordering::Relaxed) };
            if from.sequence == EACH || pipeline.frame().0 < PACE * from.sequence {
                return;
            }
            let (to, reading) = letter(from.sender, from.sequence);
            if pipeline.post(to, from, reading).is_err() {
                return;
            }
            // Release: whoever sees the letter counted finds it in its inbox.
            posted.store(from.sequence + 1, Ordering::Release);
        }
    }

    /// Whether all letters have been posted.
    pub(crate) fn is_done(&self) -> bool {
        // Acquire: pairs with the Release in `post_due`.
        self.0.iter().all(|posted| posted.load(Ordering::Acquire) == EACH)
    }

    /// Whether the token's holder, who alone lets frames pass, has to wait for letters before its
    /// next step, so that the last frame reads the last of them.
    ///
    /// While the holder waits with the third frame from the end on display, the last cannot be
    /// opened: all units would have been updated in the last but one, for which all must be
    /// rendered in the third from the end, and that would not be on display any more. So a letter
    /// posted meanwhile is stamped with the last frame but one at the latest, and read in the last.
    pub(crate) fn holds_back<W: Waiting>(&self, pipeline: &Pipeline<'_, Room, W>) -> bool {
        pipeline.frame().0 + 3 >= FRAMES && !self.is_done()
    }
}
