//! The results of interactions: what updates are given.

use thiserror::Error;

use crate::object::ObjectId;

/// What one object did to one node of another in one frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Contact {
    /// The object it was done to.
    pub object: ObjectId,
    /// The object that did it.
    pub other: ObjectId,
    /// The node of `object`, or [`Contact::BODY`], or [`Contact::FAULT`].
    pub node: u32,
    /// The impulse over the whole frame, in newton seconds.
    pub impulse: [f32; 3],
}

impl Contact {
    /// The node number of an impulse on a body as a whole; a deformable one's nodes have equal shares
    /// of it.
    pub const BODY: u32 = u32::MAX - 1;
    /// The node number that marks a fault: the interaction with `other` panicked. The record carries
    /// no impulse; both objects of the pair are given one, and both are quarantined.
    pub const FAULT: u32 = u32::MAX;
}

/// A table of contacts has no room for a segment. Nothing of the segment was stored.
#[derive(Clone, Copy, Debug, Error, PartialEq, Eq)]
#[error("the contact table holds {capacity} records, {needed} are needed")]
pub struct TableFull {
    /// How many records the table holds.
    pub capacity: usize,
    /// How many it would have to hold for this segment, at least.
    pub needed: usize,
}

/// Where interactions put their results.
pub trait ContactSink {
    /// Stores a segment: at least one record, all with the same `object` and `other`. There is at
    /// most one segment for an ordered pair of objects in a frame.
    ///
    /// # Errors
    /// The table is full.
    fn push(&mut self, segment: &[Contact]) -> Result<(), TableFull>;
}

/// Contacts in memory that grows as needed and is used again.
#[derive(Clone, Debug, Default)]
pub struct ContactBuffer {
    records: Vec<Contact>,
    ends: Vec<usize>,
}

impl ContactBuffer {
    /// A buffer that need not grow up to so many records.
    #[must_use]
    pub fn with_capacity(records: usize) -> Self {
        // Few segments have fewer than four records.
        Self { records: Vec::with_capacity(records), ends: Vec::with_capacity(records / 4) }
    }

    /// Forgets the contents, keeps the memory.
    pub fn clear(&mut self) {
        self.records.clear();
        self.ends.clear();
    }

    /// All records, and where among them each segment ends.
    pub(crate) fn parts(&self) -> (&[Contact], &[usize]) {
        (&self.records, &self.ends)
    }

    /// The segments in the order in which they were stored.
    pub fn segments(&self) -> impl Iterator<Item = &[Contact]> + '_ {
        let starts = std::iter::once(0).chain(self.ends.iter().copied());
        starts.zip(&self.ends).map(|(start, &end)| &self.records[start..end])
    }
}

impl ContactSink for ContactBuffer {
    fn push(&mut self, segment: &[Contact]) -> Result<(), TableFull> {
        self.records.extend_from_slice(segment);
        self.ends.push(self.records.len());
        Ok(())
    }
}
