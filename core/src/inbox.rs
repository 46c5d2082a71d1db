//! Inboxes (§6.2): bounded, many senders, read by the receiving unit's update.
//!
//! What is posted in frame f is processed in frame f + 1's update, ordered by (sender, sequence),
//! whoever posted first. All inboxes draw letters from one pool: a free slot is popped from a
//! ring, filled, and pushed onto the receiver's list; the receiver takes the whole list at once.

use ::core::fmt;

use crate::error::{Table, TableFull};
use crate::frame::Frame;
use crate::list;
use crate::ring::{IndexRing, QueueSlot};
use crate::sync::{Atomic, Cell, const_fn, seeded, site};
use crate::unit::NONE;

/// Memory of one letter.
#[derive(Debug)]
pub struct LetterSlot<M> {
    message: Cell<Option<M>>,
    next: Atomic,
    /// The frame in which it was posted.
    stamp: Atomic,
    sender: Atomic,
    sequence: Atomic,
}

impl<M> LetterSlot<M> {
    const_fn! {
        /// An empty letter.
        pub const fn new() -> Self {
            Self {
                message: Cell::new(None),
                next: Atomic::new(NONE),
                stamp: Atomic::new(0),
                sender: Atomic::new(0),
                sequence: Atomic::new(0),
            }
        }
    }

    fn from(&self) -> From {
        From {
            sender: self.sender.load(site::SLOT_FIELD),
            sequence: self.sequence.load(site::SLOT_FIELD),
        }
    }
}

impl<M> Default for LetterSlot<M> {
    fn default() -> Self {
        Self::new()
    }
}

/// Whose letter it is, and which of theirs: the order in which a receiver processes letters, by senders and then as
/// [`From::is_before`] has them.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct From {
    /// The sender's number, chosen by the host.
    pub sender: u32,
    /// Counts the sender's letters of a frame; one from outside, who cannot know the frame, counts all of its letters.
    /// It may wrap: of two letters at a distance below 2^31 the earlier is the first.
    pub sequence: u32,
}

impl From {
    /// Whether a receiver of both processes this letter before `other`. The derived order is another one where a
    /// sender's count wraps between them.
    pub fn is_before(self, other: Self) -> bool {
        if self.sender == other.sender {
            Frame(self.sequence).is_before(Frame(other.sequence))
        } else {
            self.sender < other.sender
        }
    }
}

/// A letter that did not fit, back as it was.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Rejected<M> {
    /// Whose it is, and its place among theirs.
    pub from: From,
    /// What was to be posted.
    pub message: M,
    /// Why it was not.
    pub full: TableFull,
}

impl<M> fmt::Display for Rejected<M> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { from: From { sender, sequence }, full, .. } = self;
        write!(f, "letter {sequence} of sender {sender} was not posted: {full}")
    }
}

impl<M: fmt::Debug> ::core::error::Error for Rejected<M> {}

/// One unit's inbox: the newest letter, each leading to the one before.
#[derive(Debug)]
pub struct Inbox(Atomic);

impl Inbox {
    const_fn! {
        /// An empty inbox.
        ///
        /// # Safety
        /// It stays with one [`Post`]: another pool's letters have the same numbers, and would be taken for
        /// those that are in it.
        pub const unsafe fn new() -> Self {
            Self(Atomic::new(NONE))
        }
    }
}

/// The pool of letters that a pipeline's inboxes share.
#[derive(Debug)]
pub struct Post<'m, M> {
    slots: &'m [LetterSlot<M>],
    free: IndexRing<'m>,
}

impl<'m, M: Send + Sync> Post<'m, M> {
    /// A pool of as many letters as there are `slots`; `queue` holds the free ones and must have
    /// [`crate::ring::slots_for`] of them. Letters that are left in `slots` from before are dropped when
    /// their slots are used again.
    ///
    /// # Errors
    /// [`TableFull`] if `queue` is too short.
    pub fn new(
        slots: &'m mut [LetterSlot<M>],
        queue: &'m mut [QueueSlot],
    ) -> Result<Self, TableFull> {
        let free = IndexRing::holding(slots.len(), queue)?;
        Ok(Self { slots, free })
    }

    /// Posts `message` to `inbox` in frame `stamp`.
    ///
    /// # Errors
    /// [`Rejected`] with the message if all letters are under way.
    pub fn post(
        &self,
        inbox: &Inbox,
        stamp: Frame,
        from: From,
        message: M,
    ) -> Result<(), Rejected<M>> {
        let free = self.free.pop();
        let Some((index, slot)) = free.and_then(|index| Some((index, self.slot(index)?))) else {
            let capacity = self.slots.len();
            let full = TableFull { table: Table::Letters, capacity, needed: capacity + 1 };
            return Err(Rejected { from, message, full });
        };
        // SAFETY: the index came from the free ring, so the slot is this caller's alone until
        // `put` publishes it.
        unsafe { slot.message.with_mut(|place| *place = Some(message)) };
        slot.stamp.store(stamp.0, site::SLOT_FIELD);
        slot.sender.store(from.sender, site::SLOT_FIELD);
        slot.sequence.store(from.sequence, site::SLOT_FIELD);
        Self::put(inbox, index, slot);
        Ok(())
    }

    /// The letter of this index; `None` past the end of a list.
    fn slot(&self, index: u32) -> Option<&'m LetterSlot<M>> {
        self.slots.get(index as usize)
    }

    fn put(inbox: &Inbox, index: u32, slot: &LetterSlot<M>) {
        let mut newest = inbox.0.load(site::MAIL_LOOK);
        loop {
            slot.next.store(newest, site::LIST_LINK);
            match inbox.0.exchange(newest, index, site::MAIL_PUSH) {
                Ok(_) => return,
                Err(_) if seeded!(LetterNotRetried) => return,
                Err(found) => newest = found,
            }
        }
    }

    /// The letters to process in `frame`: those posted before it, in order. One reader an inbox.
    pub fn collect(&self, inbox: &Inbox, frame: Frame) -> Mail<'_, 'm, M> {
        // An empty inbox stays untouched: most are, in most frames.
        if inbox.0.load(site::MAIL_LOOK) == NONE {
            return Mail { post: self, next: NONE };
        }
        let mut rest = inbox.0.swap(NONE, site::MAIL_TAKE);
        let mut due = NONE;
        while let Some(slot) = self.slot(rest) {
            let index = rest;
            rest = slot.next.load(site::LIST_FOLLOW);
            let due_now = Frame(slot.stamp.load(site::SLOT_FIELD)).is_before(frame);
            if due_now || seeded!(LetterEarly) {
                slot.next.store(due, site::LIST_LINK);
                due = index;
            } else {
                Self::put(inbox, index, slot);
            }
        }
        let next = list::sort(
            due,
            |index| self.slot(index).map_or(NONE, |slot| slot.next.load(site::LIST_FOLLOW)),
            |index, to| {
                if let Some(slot) = self.slot(index) {
                    slot.next.store(to, site::LIST_LINK);
                }
            },
            |a, b| {
                self.slot(a).zip(self.slot(b)).is_some_and(|(a, b)| a.from().is_before(b.from()))
            },
        );
        Mail { post: self, next }
    }
}

/// Letters in order. Those that are not taken are dropped with it.
#[derive(Debug)]
pub struct Mail<'p, 'm, M: Send + Sync> {
    post: &'p Post<'m, M>,
    next: u32,
}

impl<M: Send + Sync> Iterator for Mail<'_, '_, M> {
    type Item = (From, M);

    fn next(&mut self) -> Option<Self::Item> {
        while let Some(slot) = self.post.slot(self.next) {
            let index = self.next;
            let from = slot.from();
            self.next = slot.next.load(site::LIST_FOLLOW);
            // SAFETY: `collect` took the letter out of the inbox, so this reader has it alone
            // until the push below gives the slot back.
            let message = unsafe { slot.message.with_mut(Option::take) };
            // Refused only if it were no letter of this pool's.
            let _ours = self.post.free.push(index);
            if let Some(message) = message {
                return Some((from, message));
            }
        }
        None
    }
}

impl<M: Send + Sync> Drop for Mail<'_, '_, M> {
    fn drop(&mut self) {
        self.for_each(drop);
    }
}

#[cfg(all(test, not(loom)))]
mod tests {
    use super::*;

    #[test]
    fn letters_come_in_order_whoever_posted_first() {
        let mut slots = [const { LetterSlot::new() }; 6];
        let mut queue = [const { QueueSlot::new() }; 8];
        let post = Post::new(&mut slots, &mut queue).unwrap_or_else(|full| panic!("{full}"));
        // SAFETY: there is one pool.
        let inbox = unsafe { Inbox::new() };
        let from = |sender, sequence| From { sender, sequence };
        let ranks = [from(2, 0), from(0, 1), from(1, 1), from(1, 0), from(0, 2)];
        // Twice: those that are not read leave room for others.
        for frame in [Frame(0), Frame(1)] {
            for (number, from) in ranks.into_iter().enumerate() {
                assert_eq!(post.post(&inbox, frame, from, number), Ok(()));
            }
            assert_eq!(post.post(&inbox, frame.next(), from(0, 0), 9), Ok(()));
            let due = post.collect(&inbox, frame.next()).take(4);
            assert!(due.eq([(ranks[1], 1), (ranks[4], 4), (ranks[3], 3), (ranks[2], 2)]));
            let next = post.collect(&inbox, frame.next().next());
            assert!(next.eq([(from(0, 0), 9)]), "what was posted in a frame stays for the next");
        }
    }

    #[test]
    fn a_rejected_letter_is_an_error_that_says_whose_it_is_and_why() {
        let mut slots = [const { LetterSlot::new() }; 1];
        let mut queue = [const { QueueSlot::new() }; 1];
        let post = Post::new(&mut slots, &mut queue).unwrap_or_else(|full| panic!("{full}"));
        // SAFETY: there is one pool.
        let inbox = unsafe { Inbox::new() };
        let send = |sequence| -> Result<(), std::boxed::Box<dyn std::error::Error>> {
            post.post(&inbox, Frame(0), From { sender: 7, sequence }, ())?;
            Ok(())
        };
        assert!(send(3).is_ok());
        let told = send(4).map_err(|rejected| std::format!("{rejected}"));
        let expected = "letter 4 of sender 7 was not posted: table of letters under way is full: \
                        1 fit, 2 needed";
        assert_eq!(told, Err(expected.into()));
    }

    #[test]
    fn letters_of_one_sender_stay_in_order_when_its_count_wraps() {
        let mut slots = [const { LetterSlot::new() }; 6];
        let mut queue = [const { QueueSlot::new() }; 8];
        let post = Post::new(&mut slots, &mut queue).unwrap_or_else(|full| panic!("{full}"));
        // SAFETY: there is one pool.
        let inbox = unsafe { Inbox::new() };
        let posted = [u32::MAX - 1, u32::MAX, 0, 1];
        for sequence in posted {
            for sender in [7, 3] {
                let from = From { sender, sequence };
                let _full_at_last = post.post(&inbox, Frame(0), from, ());
            }
        }
        let collected =
            post.collect(&inbox, Frame(1)).map(|(from, ())| (from.sender, from.sequence));
        let of_3 = posted[..3].iter().map(|&sequence| (3, sequence));
        let of_7 = posted[..3].iter().map(|&sequence| (7, sequence));
        assert!(collected.eq(of_3.chain(of_7)));
    }
}
