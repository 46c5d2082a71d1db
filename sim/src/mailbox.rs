//! Messages from outside the environment: from whoever watches it, or from a device.

use std::fmt;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use crate::message::Message;
use crate::object::ObjectId;

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
pub struct Mailbox(Arc<Mutex<Vec<(ObjectId, Message)>>>);

impl Mailbox {
    /// An empty one.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// Sends a message to an object. One to an object that does not exist, or that is quarantined by
    /// then, is lost. Waits for nothing but another post or the moment in which the messages are taken.
    pub fn post(&self, to: ObjectId, message: Message) {
        self.lock().push((to, message));
    }

    /// Takes out everything, in the order of posting.
    pub(crate) fn take(&self, mut take: impl FnMut(ObjectId, Message)) {
        self.lock().drain(..).for_each(|(to, message)| take(to, message));
    }

    fn lock(&self) -> MutexGuard<'_, Vec<(ObjectId, Message)>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl fmt::Debug for Mailbox {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Mailbox").finish_non_exhaustive()
    }
}
