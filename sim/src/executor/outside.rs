//! What comes from outside while frames run, and in which frame it is processed.

use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{PoisonError, RwLock, RwLockReadGuard, RwLockWriteGuard};

use super::mail::Letters;
use crate::mailbox::Mailbox;
use crate::message::{Letter, Message};
use crate::object::ObjectId;

/// Frames from a swap to the one in which what was posted until then is processed. When a frame is
/// swapped, objects may have been updated for the next already, for the one after it none.
const FRAMES_AHEAD: u64 = 2;

/// The mailbox, and what was taken out of it for each of the two frames to come.
#[derive(Debug)]
pub(super) struct Outside {
    mailbox: Mailbox,
    /// By parity of their frames.
    due: [Due; FRAMES_AHEAD as usize],
}

#[derive(Debug)]
struct Due {
    /// The frame that the letters are for; [`Due::NONE`] without any.
    ///
    /// Relaxed everywhere: it is written by a frame's swap and read by updates of the frame two later,
    /// and every executor lets these happen after that swap, and before the next write.
    frame: AtomicU64,
    letters: RwLock<Letters>,
}

impl Due {
    const NONE: u64 = u64::MAX;

    fn write(&self) -> RwLockWriteGuard<'_, Letters> {
        self.letters.write().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Default for Due {
    fn default() -> Self {
        Self { frame: AtomicU64::new(Self::NONE), letters: RwLock::default() }
    }
}

impl Outside {
    /// What a scene has under way before the frame `next`. Messages of objects go to `collect`, as (from,
    /// to, message).
    pub(super) fn new(
        mailbox: Mailbox,
        mail: Vec<Letter>,
        next: u64,
        mut collect: impl FnMut(ObjectId, ObjectId, Message),
    ) -> Self {
        let outside = Self { mailbox, due: Default::default() };
        for Letter { due, to, from, message } in mail {
            if from != ObjectId::HOST {
                collect(from, to, message);
            } else if (next..next + FRAMES_AHEAD).contains(&due) {
                let slot = outside.slot(due);
                slot.write().push(from, to, message);
                slot.frame.store(due, Ordering::Relaxed);
            }
        }
        outside.due.iter().for_each(|slot| slot.write().sort());
        outside
    }

    pub(super) fn mailbox(&self) -> &Mailbox {
        &self.mailbox
    }

    /// A run begins: what was posted since the last one comes into its first frame, or into its second
    /// if what was posted before still waits for that: nothing is overtaken.
    pub(super) fn begin(&self, first: u64) {
        let second = first + 1;
        let waits = self.slot(second).frame.load(Ordering::Relaxed) == second;
        self.take(if waits { second } else { first });
    }

    /// A frame is swapped, and everybody told.
    pub(super) fn swapped(&self, frame: u64) {
        self.take(frame + FRAMES_AHEAD);
    }

    /// Takes what is in the mailbox for the frame `due`.
    fn take(&self, due: u64) {
        let slot = self.slot(due);
        let mut letters = slot.write();
        // Letters of the same parity for another frame have been processed.
        if slot.frame.load(Ordering::Relaxed) != due {
            letters.clear();
        }
        self.mailbox.take(due, |to, message| letters.push(ObjectId::HOST, to, message));
        letters.sort();
        let frame = if letters.is_empty() { Due::NONE } else { due };
        slot.frame.store(frame, Ordering::Relaxed);
    }

    fn slot(&self, frame: u64) -> &Due {
        &self.due[(frame % FRAMES_AHEAD) as usize]
    }

    /// What is to be processed in a frame.
    pub(super) fn due(&self, frame: u64) -> Delivered<'_> {
        let Due { frame: due, letters } = self.slot(frame);
        let any = due.load(Ordering::Relaxed) == frame;
        Delivered(any.then(|| letters.read().unwrap_or_else(PoisonError::into_inner)))
    }

    /// Takes out what is due in `next`, the next frame, or in the one after it.
    pub(super) fn take_letters(&self, next: u64) -> impl Iterator<Item = Letter> {
        (next..next + FRAMES_AHEAD).flat_map(|due| {
            let slot = self.slot(due);
            let any = slot.frame.swap(Due::NONE, Ordering::Relaxed) == due;
            any.then(|| std::mem::take(&mut *slot.write()).into_letters(due)).into_iter().flatten()
        })
    }
}

/// What came from outside for one frame.
pub(super) struct Delivered<'a>(Option<RwLockReadGuard<'a, Letters>>);

impl Delivered<'_> {
    /// The messages to an object, in the order of posting.
    pub(super) fn to(&self, object: ObjectId) -> impl Iterator<Item = &Message> {
        self.0.iter().flat_map(move |letters| letters.to(object))
    }
}
