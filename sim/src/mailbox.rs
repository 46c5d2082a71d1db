//! Messages from outside the environment: from whoever watches it, or from a device.

use std::fmt;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, Weak};

use crate::message::Message;
use crate::object::ObjectId;
use crate::record::Journal;

/// Where messages to the objects of an environment are posted from outside it, by any thread at any
/// time, also while frames run. Copies are the same mailbox; it goes with the environment from one
/// executor to the next.
///
/// What is posted until frame f has been swapped — until the renderer's swap and the `on_frame` of that
/// frame have returned — is processed in the updates of frame f + 2, none of which can have
/// begun: two frames are in flight. What is posted between two runs is processed in the first frame of
/// the next or, if something posted until the last swap is still to come, with that in the second: no
/// message overtakes another. An object processes messages from outside after those of other objects, in
/// the order in which they were posted. So a message posted by the renderer's swap, by `on_frame` or between runs has
/// the same effect every time, bit by bit, whatever the executor; one posted by another thread while
/// frames run comes into whichever frame is due by then. Objects send each other messages by
/// [`Input::post`](crate::behavior::Input::post), not from here.
#[derive(Clone, Default)]
pub struct Mailbox(Arc<Mutex<Posted>>);

/// What was posted, and who takes it down, if anybody does.
#[derive(Default)]
struct Posted {
    letters: Vec<(ObjectId, Message)>,
    journal: Option<Weak<Mutex<Journal>>>,
}

impl Mailbox {
    /// An empty one.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// Sends a message to an object. One to an object that does not exist, or that is quarantined by
    /// then, is lost. Waits for nothing but another post or the moment in which the messages are taken.
    pub fn post(&self, to: ObjectId, message: Message) {
        self.lock().letters.push((to, message));
    }

    /// Lets everything be taken down that is taken out from now on, as long as the journal is there.
    /// Whether nobody did so already.
    pub(crate) fn record(&self, journal: &Arc<Mutex<Journal>>) -> bool {
        let mut posted = self.lock();
        let is_free = posted.journal.as_ref().is_none_or(|other| other.strong_count() == 0);
        if is_free {
            posted.journal = Some(Arc::downgrade(journal));
        }
        is_free
    }

    /// Takes out everything, in the order of posting, to be processed in the frame `due`.
    pub(crate) fn take(&self, due: u64, mut take: impl FnMut(ObjectId, Message)) {
        let mut posted = self.lock();
        if let Some(journal) = posted.journal.as_ref().and_then(Weak::upgrade) {
            journal.lock().unwrap_or_else(PoisonError::into_inner).taken(due, &posted.letters);
        }
        posted.letters.drain(..).for_each(|(to, message)| take(to, message));
    }

    fn lock(&self) -> MutexGuard<'_, Posted> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl fmt::Debug for Mailbox {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Mailbox").finish_non_exhaustive()
    }
}
