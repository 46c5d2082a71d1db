//! Messages on their way from one frame's updates to the next's.

use crate::message::Message;
use crate::object::ObjectId;

/// A message on its way.
#[derive(Debug)]
pub struct Letter {
    /// Whom it is for.
    pub to: ObjectId,
    /// Who sent it.
    pub from: ObjectId,
    /// What it says.
    pub message: Message,
    sequence: u32,
}

/// The letters of one frame, and those collected for the next.
#[derive(Debug, Default)]
pub struct Mail {
    delivered: Vec<Letter>,
    collected: Vec<Letter>,
}

impl Mail {
    /// No letters.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// Collects a message for the next frame. Messages of one sender must come in the order in which
    /// they were posted; senders may come in any order.
    pub fn collect(&mut self, from: ObjectId, to: ObjectId, message: Message) {
        let sequence = self.collected.len() as u32;
        self.collected.push(Letter { to, from, message, sequence });
    }

    /// Ends a frame: what was delivered is dropped, what was collected is delivered.
    pub fn turn(&mut self) {
        self.delivered.clear();
        std::mem::swap(&mut self.delivered, &mut self.collected);
        self.delivered.sort_unstable_by_key(|letter| (letter.from, letter.sequence));
    }

    /// This frame's messages as (to, from, message), by sender and then by order of posting.
    pub fn letters(&self) -> impl Iterator<Item = (ObjectId, ObjectId, &Message)> + Clone {
        self.delivered.iter().map(|letter| (letter.to, letter.from, &letter.message))
    }
}
