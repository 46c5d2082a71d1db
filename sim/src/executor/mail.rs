//! Letters in the order in which they are processed.

use crate::message::{Letter, Message};
use crate::object::ObjectId;

/// The letters of one frame, once they are [`sorted`](Self::sort) for each object by sender and then by
/// order of posting.
#[derive(Debug, Default)]
pub(super) struct Letters(Vec<Placed>);

/// A letter and its place in the order of posting.
#[derive(Debug)]
struct Placed {
    to: ObjectId,
    from: ObjectId,
    sequence: u32,
    message: Message,
}

impl Letters {
    /// Adds a letter after those that are there.
    pub(super) fn push(&mut self, from: ObjectId, to: ObjectId, message: Message) {
        let sequence = self.0.len() as u32;
        self.0.push(Placed { to, from, sequence, message });
    }

    pub(super) fn sort(&mut self) {
        self.0.sort_unstable_by_key(|letter| (letter.to, letter.from, letter.sequence));
    }

    pub(super) fn clear(&mut self) {
        self.0.clear();
    }

    pub(super) fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// The messages to an object.
    pub(super) fn to(&self, object: ObjectId) -> impl Iterator<Item = &Message> {
        let first = self.0.partition_point(|letter| letter.to < object);
        let letters = self.0[first..].iter().take_while(move |letter| letter.to == object);
        letters.map(|letter| &letter.message)
    }

    /// All of them as letters of a frame.
    pub(super) fn into_letters(self, due: u64) -> impl Iterator<Item = Letter> {
        let letter = move |Placed { to, from, message, .. }| Letter { due, to, from, message };
        self.0.into_iter().map(letter)
    }
}

/// The letters between objects: those of one frame, and those collected for the next.
#[derive(Debug, Default)]
pub(super) struct Mail {
    delivered: Letters,
    collected: Letters,
}

impl Mail {
    /// Collects a message for the next frame. Messages of one sender must come in the order in which
    /// they were posted; senders may come in any order.
    pub(super) fn collect(&mut self, from: ObjectId, to: ObjectId, message: Message) {
        self.collected.push(from, to, message);
    }

    /// Ends a frame: what was delivered is dropped, what was collected is delivered.
    pub(super) fn turn(&mut self) {
        self.delivered.clear();
        std::mem::swap(&mut self.delivered, &mut self.collected);
        self.delivered.sort();
    }

    /// This frame's messages to an object, by sender and then by order of posting.
    pub(super) fn to(&self, object: ObjectId) -> impl Iterator<Item = &Message> {
        self.delivered.to(object)
    }

    /// What was collected for a frame that has not begun.
    pub(super) fn into_letters(mut self, due: u64) -> impl Iterator<Item = Letter> {
        self.collected.sort();
        self.collected.into_letters(due)
    }
}
