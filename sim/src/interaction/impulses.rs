//! What a response found for one object of a pair, summed up node by node.

use super::contact::Contact;
use crate::object::ObjectId;

/// The impulses on one object of a pair: one sum per touched node.
#[derive(Debug, Default)]
pub struct Impulses {
    records: Vec<Contact>,
    /// For each node one more than its place among the records, or 0.
    places: Vec<u32>,
}

impl Impulses {
    /// Adds an impulse, in newton seconds, to a node's sum, or for [`Contact::BODY`] to the whole
    /// body's.
    pub fn add(&mut self, node: u32, impulse: [f32; 3]) {
        if let Some(sum) = self.find(node) {
            for (sum, part) in sum.iter_mut().zip(impulse) {
                *sum += part;
            }
            return;
        }
        // The ids are filled in when the pair is done; every record of a side has the same.
        let nobody = ObjectId::HOST;
        self.records.push(Contact { object: nobody, other: nobody, node, impulse });
        if let Some(place) = self.places.get_mut(node as usize) {
            *place = self.records.len() as u32;
        }
    }

    /// The sum of a node that has one already.
    fn find(&mut self, node: u32) -> Option<&mut [f32; 3]> {
        let index = match self.places.get(node as usize) {
            Some(0) => return None,
            Some(&place) => place as usize - 1,
            None => self.records.iter().position(|record| record.node == node)?,
        };
        self.records.get_mut(index).map(|record| &mut record.impulse)
    }

    /// Forgets everything and makes ready for an object with so many nodes.
    pub(super) fn reset(&mut self, nodes: usize) {
        for record in &self.records {
            if let Some(place) = self.places.get_mut(record.node as usize) {
                *place = 0;
            }
        }
        self.records.clear();
        if self.places.len() < nodes {
            self.places.resize(nodes, 0);
            self.records.reserve(nodes + 1);
        }
    }

    /// The sums as one segment.
    pub(super) fn segment(&mut self, object: ObjectId, other: ObjectId) -> &[Contact] {
        for record in &mut self.records {
            record.object = object;
            record.other = other;
        }
        &self.records
    }
}
