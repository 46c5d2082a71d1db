//! The results of interactions: what updates are given.

use super::Member;
use crate::object::ObjectId;

/// What one object did to one node of another in one frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Contact {
    /// The object that did it.
    pub other: ObjectId,
    /// The node, or [`Contact::BODY`], or [`Contact::FAULT`].
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

/// Contacts as they lie in memory, four to a cache line: what those of a pair have in common is in a
/// record of its own before them.
///
/// ```text
/// how many follow | object | its place | other      the head of a segment
/// node            | impulse (x, y, z)               a contact
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ContactRecord([u32; 4]);

impl ContactRecord {
    pub(super) fn head(contacts: usize, [to, from]: [Member<'_>; 2]) -> Self {
        Self([contacts as u32, to.object.id().0, to.place as u32, from.object.id().0])
    }

    pub(super) fn contact(node: u32, impulse: [f32; 3]) -> Self {
        let [x, y, z] = impulse.map(f32::to_bits);
        Self([node, x, y, z])
    }

    pub(super) fn node(self) -> u32 {
        self.0[0]
    }

    /// Adds to a contact's impulse.
    pub(super) fn add(&mut self, impulse: [f32; 3]) {
        for (sum, part) in self.0[1..].iter_mut().zip(impulse) {
            *sum = (f32::from_bits(*sum) + part).to_bits();
        }
    }
}

/// What one object did to another in one frame: records of at least one contact behind their head.
#[derive(Clone, Copy, Debug)]
pub struct Segment<'r>(&'r [ContactRecord]);

impl<'r> Segment<'r> {
    /// The segment that these records are.
    pub(super) fn new(records: &'r [ContactRecord]) -> Self {
        Self(records)
    }

    /// The segments that were stored one after the other.
    pub fn all(mut records: &'r [ContactRecord]) -> impl Iterator<Item = Self> {
        std::iter::from_fn(move || {
            let contacts = records.first()?.0[0] as usize;
            let (segment, rest) = records.split_at_checked(1 + contacts)?;
            records = rest;
            Some(Self(segment))
        })
    }

    /// The records, to be stored.
    #[must_use]
    pub fn records(self) -> &'r [ContactRecord] {
        self.0
    }

    /// The object it was done to.
    #[must_use]
    pub fn object(self) -> ObjectId {
        self.0.first().map_or(ObjectId::HOST, |head| ObjectId(head.0[1]))
    }

    /// That object's place in its block.
    pub(crate) fn place(self) -> usize {
        self.0.first().map_or(0, |head| head.0[2] as usize)
    }

    /// The object that did it.
    #[must_use]
    pub fn other(self) -> ObjectId {
        self.0.first().map_or(ObjectId::HOST, |head| ObjectId(head.0[3]))
    }

    /// Its contacts, one at most for each node.
    pub fn contacts(self) -> impl Iterator<Item = Contact> + use<'r> {
        let other = self.other();
        let contacts = self.0.iter().skip(1);
        contacts.map(move |&ContactRecord([node, x, y, z])| Contact {
            other,
            node,
            impulse: [x, y, z].map(f32::from_bits),
        })
    }

    /// Whether the interaction panicked.
    pub(crate) fn is_fault(self) -> bool {
        self.contacts().next().is_some_and(|contact| contact.node == Contact::FAULT)
    }
}

/// Contacts in memory that grows as needed and is used again.
#[derive(Clone, Debug, Default)]
pub struct ContactBuffer(Vec<ContactRecord>);

impl ContactBuffer {
    /// A buffer that need not grow up to so many records.
    #[must_use]
    pub fn with_capacity(records: usize) -> Self {
        Self(Vec::with_capacity(records))
    }

    /// Stores a segment. There is at most one for an ordered pair of objects in a frame.
    pub(crate) fn push(&mut self, segment: Segment<'_>) {
        self.0.extend_from_slice(segment.records());
    }

    /// Forgets the contents, keeps the memory.
    pub fn clear(&mut self) {
        self.0.clear();
    }

    /// The records of all segments in the order in which they were stored.
    #[must_use]
    pub fn records(&self) -> &[ContactRecord] {
        &self.0
    }
}
