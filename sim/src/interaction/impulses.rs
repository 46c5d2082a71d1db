//! What a response found for one object of a pair, summed up node by node.

use super::Member;
use super::contact::{Contact, ContactRecord, Segment};

/// The impulses on one object of a pair: one sum per touched node.
#[derive(Debug)]
pub struct Impulses {
    /// The head of a segment, which is filled in when the pair is done, and the sums.
    records: Vec<ContactRecord>,
    /// For each node its sum's place among the records, or 0.
    places: Vec<u32>,
}

impl Default for Impulses {
    fn default() -> Self {
        Self { records: vec![ContactRecord::default()], places: Vec::new() }
    }
}

impl Impulses {
    /// Adds an impulse, in newton seconds, to a node's sum, or for [`Contact::BODY`] to the whole
    /// body's. Of [`Contact::FAULT`], which is no node, nothing comes.
    #[inline]
    pub fn add(&mut self, node: u32, impulse: [f32; 3]) {
        if let Some(sum) = self.find(node) {
            sum.add(impulse);
            return;
        }
        // Only a panic is to be taken for one.
        if node == Contact::FAULT {
            return;
        }
        let new = self.records.len() as u32;
        self.records.push(ContactRecord::contact(node, impulse));
        if let Some(place) = self.places.get_mut(node as usize) {
            *place = new;
        }
    }

    /// The sum of a node that has one already.
    fn find(&mut self, node: u32) -> Option<&mut ContactRecord> {
        let place = match self.places.get(node as usize) {
            Some(0) => return None,
            Some(&place) => place as usize,
            None => 1 + self.sums().iter().position(|sum| sum.node() == node)?,
        };
        self.records.get_mut(place)
    }

    fn sums(&self) -> &[ContactRecord] {
        self.records.get(1..).unwrap_or_default()
    }

    /// Forgets everything and makes ready for an object with so many nodes.
    pub(super) fn reset(&mut self, nodes: usize) {
        for record in self.records.iter().skip(1) {
            if let Some(place) = self.places.get_mut(record.node() as usize) {
                *place = 0;
            }
        }
        self.records.truncate(1);
        if self.places.len() < nodes {
            self.places.resize(nodes, 0);
            self.records.reserve(nodes + 1);
        }
    }

    /// The sums as one segment, if there are any, for the first from the second.
    pub(super) fn segment(&mut self, ends: [Member<'_>; 2]) -> Option<Segment<'_>> {
        let sums = self.sums().len();
        let head = self.records.first_mut().filter(|_| sums > 0)?;
        *head = ContactRecord::head(sums, ends);
        Some(Segment::new(&self.records))
    }
}
