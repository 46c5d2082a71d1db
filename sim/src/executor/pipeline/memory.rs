//! The pipeline's tables on the heap.

use dualframe_core::contacts::{ContactSlot, SegmentSlot};
use dualframe_core::environment::Environment;
use dualframe_core::error::Table;
use dualframe_core::inbox::LetterSlot;
use dualframe_core::ring::QueueSlot;
use dualframe_core::storage::{InteractionSlot, Memory, UnitSlot, queue_slots};
use dualframe_core::unit::UnitId;

use super::host::{Found, Parcel, Unit};
use crate::behavior::CONTACTS_PER_OBJECT;
use crate::block::Block;
use crate::interaction::ContactRecord;
use crate::object::Object;
use crate::stages::Stages;

/// Contact records a frame that there is room for at least, however few the objects.
const FEWEST_CONTACTS: usize = 4_096;
/// Contact records a frame for each node of deformable bodies, where those come to more: bodies that have
/// grown onto several others are touched at many nodes from the first frame on.
const CONTACTS_PER_NODE: usize = 2;
/// Letters that may be under way at once before room has to grow: for each object, and at least.
const LETTERS_PER_OBJECT: usize = 4;
const FEWEST_LETTERS: usize = 1_024;
/// Blocks up to which there is room for every pair of them to be candidates at once.
const ALL_PAIRS_BLOCKS: usize = 512;
/// Candidates a frame for each block beyond that; a block has some 26 neighbours.
const CANDIDATES_PER_BLOCK: usize = 128;

/// All tables, sized for an environment, kept from run to run.
pub(super) struct Tables {
    units: Vec<UnitSlot<Unit>>,
    interactions: Vec<InteractionSlot<Found>>,
    contacts: Vec<ContactSlot<ContactRecord>>,
    segments: Vec<SegmentSlot>,
    letters: Vec<LetterSlot<Parcel>>,
    queues: Vec<QueueSlot>,
    homes: usize,
}

impl Tables {
    /// Tables for these blocks and modelled or possible interactions between them.
    pub(super) fn new(
        blocks: &[Block],
        interactions: Vec<InteractionSlot<Found>>,
        homes: usize,
    ) -> Self {
        let objects: usize = blocks.iter().map(|block| block.objects().len()).sum();
        let nodes = blocks.iter().flat_map(Block::objects).filter_map(|o| o.geometry.as_mesh());
        let nodes: usize = nodes.map(|mesh| mesh.positions.len()).sum();
        let touched = (objects * CONTACTS_PER_OBJECT).max(nodes * CONTACTS_PER_NODE);
        let contacts = 2 * (touched + FEWEST_CONTACTS);
        let letters = objects * LETTERS_PER_OBJECT + FEWEST_LETTERS;
        let queues = queue_slots(blocks.len(), interactions.len(), letters, homes);
        Self {
            units: Vec::with_capacity(blocks.len()),
            interactions,
            contacts: filled(contacts, ContactSlot::new),
            segments: filled(contacts, SegmentSlot::new),
            letters: filled(letters, LetterSlot::new),
            queues: filled(queues, QueueSlot::new),
            homes,
        }
    }

    /// Moves the blocks into the units' slots.
    pub(super) fn load(&mut self, blocks: &mut Vec<Block>) {
        self.units.extend(blocks.drain(..).map(|block| {
            let solitary = block.objects().iter().all(Object::is_solitary);
            let unit = Unit::from(block);
            if solitary { UnitSlot::solitary(unit) } else { UnitSlot::new(unit) }
        }));
    }

    /// Moves the blocks back.
    pub(super) fn unload(&mut self, blocks: &mut Vec<Block>) {
        blocks.extend(self.units.drain(..).map(|slot| slot.into_object().block));
    }

    pub(super) fn lend<E>(&mut self) -> Memory<'_, E>
    where
        E: Environment<
                Object = Unit,
                Interaction = Found,
                Contact = ContactRecord,
                Message = Parcel,
            >,
    {
        Memory {
            units: &mut self.units,
            interactions: &mut self.interactions,
            contacts: &mut self.contacts,
            segments: &mut self.segments,
            letters: &mut self.letters,
            queues: &mut self.queues,
        }
    }

    /// Contact records that one frame may have.
    pub(super) fn contact_capacity(&self) -> usize {
        self.contacts.len() / 2
    }

    /// What of them may be used before they are to grow, for so many blocks.
    pub(super) fn limits(&self, blocks: usize) -> Limits {
        let candidates = self.interactions.len() / 2;
        Limits {
            // There is always room for all that were modelled, and for all pairs that there are.
            most_candidates: if candidates < pairs(blocks) { candidates / 2 } else { candidates },
            most_contacts: self.contact_capacity() / 2,
        }
    }

    /// Replaces the interactions.
    pub(super) fn model(&mut self, interactions: Vec<InteractionSlot<Found>>, blocks: usize) {
        self.interactions = interactions;
        self.fit_queues(blocks);
    }

    /// Doubles the room in a table, for so many blocks.
    pub(super) fn double(&mut self, table: Table, blocks: usize) {
        match table {
            Table::Contacts => {
                let size = 2 * self.contacts.len();
                self.contacts.resize_with(size, ContactSlot::new);
                self.segments.resize_with(size, SegmentSlot::new);
            }
            Table::Letters => self.letters.resize_with(2 * self.letters.len(), LetterSlot::new),
            _ => self.interactions.resize_with(2 * self.interactions.len(), spare),
        }
        self.fit_queues(blocks);
    }

    fn fit_queues(&mut self, blocks: usize) {
        let (interactions, letters) = (self.interactions.len(), self.letters.len());
        let queues = queue_slots(blocks, interactions, letters, self.homes);
        self.queues.resize_with(queues, QueueSlot::new);
    }
}

/// What of the tables may be used in a frame before they are to grow.
#[derive(Clone, Copy)]
pub(super) struct Limits {
    pub(super) most_candidates: usize,
    pub(super) most_contacts: usize,
}

fn filled<T>(count: usize, slot: impl Fn() -> T) -> Vec<T> {
    std::iter::repeat_with(slot).take(count).collect()
}

/// Room for the pairs of blocks that a frame may find near each other.
pub(super) fn spare_interactions(blocks: usize) -> Vec<InteractionSlot<Found>> {
    let candidates =
        if blocks <= ALL_PAIRS_BLOCKS { pairs(blocks) } else { blocks * CANDIDATES_PER_BLOCK };
    filled(2 * candidates, spare)
}

/// Every two blocks, and each with itself.
fn pairs(blocks: usize) -> usize {
    blocks * (blocks + 1) / 2
}

fn spare() -> InteractionSlot<Found> {
    InteractionSlot::spare(Found::default())
}

/// Every pair of blocks that an interaction is modelled for.
pub(super) fn modelled_interactions(
    stages: &Stages,
    blocks: &[Block],
) -> Vec<InteractionSlot<Found>> {
    let mut interactions = Vec::new();
    for (first, a) in blocks.iter().enumerate() {
        for (second, b) in blocks.iter().enumerate().skip(first + 1) {
            // Whatever their boxes: an empty one may be filled.
            let interact = |[a, b]: [&Object; 2]| stages.rules.interact(a, b);
            let mut ends = a.objects().iter().flat_map(|a| b.objects().iter().map(move |b| [a, b]));
            if ends.any(interact) {
                let ends = [first, second].map(|index| UnitId(index as u32));
                interactions.push(InteractionSlot::between(ends[0], ends[1], Found::default()));
            }
        }
    }
    interactions
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn room_for_candidates_grows_until_it_is_for_every_pair() {
        // 128 for each of 600, of which half may be used.
        for (blocks, most) in [(3, 6), (512, 512 * 513 / 2), (600, 600 * 64)] {
            let all: Vec<Block> = (0..blocks).map(|_| Block::default()).collect();
            let mut tables = Tables::new(&all, spare_interactions(blocks), 2);
            assert_eq!(tables.limits(blocks).most_candidates, most);
            for (grown, table) in [Table::Interactions, Table::Letters].into_iter().enumerate() {
                let before = [tables.interactions.len(), tables.letters.len()];
                tables.double(table, blocks);
                let after = [tables.interactions.len(), tables.letters.len()];
                assert_eq!(after[grown], 2 * before[grown]);
                assert_eq!(after[1 - grown], before[1 - grown]);
                let [interactions, letters] = after;
                assert_eq!(tables.queues.len(), queue_slots(blocks, interactions, letters, 2));
            }
        }
    }
}
