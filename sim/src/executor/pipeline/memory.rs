//! The pipeline's tables on the heap.

use dualframe_core::contacts::{ContactSlot, SegmentSlot};
use dualframe_core::environment::Environment;
use dualframe_core::inbox::LetterSlot;
use dualframe_core::ring::QueueSlot;
use dualframe_core::storage::{InteractionSlot, Memory, UnitSlot, queue_slots};
use dualframe_core::unit::UnitId;

use super::host::{Parcel, Unit};
use crate::behavior::CONTACTS_PER_OBJECT;
use crate::block::Block;
use crate::interaction::ContactRecord;
use crate::object::Object;
use crate::stages::{PairCount, Stages};

/// Contact records a frame that there is room for at least, however few the objects.
const FEWEST_CONTACTS: usize = 4_096;
/// Contact records a frame for each node of deformable bodies, where those come to more: bodies that have
/// grown onto several others are touched at many nodes from the first frame on.
const CONTACTS_PER_NODE: usize = 2;
/// Letters that may be under way at once: for each object, and at least.
const LETTERS_PER_OBJECT: usize = 4;
const FEWEST_LETTERS: usize = 1_024;
/// Blocks up to which there is room for every pair of them to be candidates at once.
const ALL_PAIRS_BLOCKS: usize = 512;
/// Candidates a frame for each block beyond that; a block has some 26 neighbours.
const CANDIDATES_PER_BLOCK: usize = 128;

/// All tables, sized for an environment, kept from run to run.
pub(super) struct Tables {
    units: Vec<UnitSlot<Unit>>,
    interactions: Vec<InteractionSlot<PairCount>>,
    contacts: Vec<ContactSlot<ContactRecord>>,
    segments: Vec<SegmentSlot>,
    letters: Vec<LetterSlot<Parcel>>,
    queues: Vec<QueueSlot>,
    homes: usize,
}

impl Tables {
    /// Tables for these blocks and modelled or possible interactions between them, with room for the
    /// letters under way and as many again that updates may post.
    pub(super) fn new(
        blocks: &[Block],
        interactions: Vec<InteractionSlot<PairCount>>,
        under_way: usize,
        homes: usize,
    ) -> Self {
        let objects: usize = blocks.iter().map(|block| block.objects().len()).sum();
        let nodes = blocks.iter().flat_map(Block::objects).filter_map(|o| o.geometry.as_mesh());
        let nodes: usize = nodes.map(|mesh| mesh.positions.len()).sum();
        let touched = (objects * CONTACTS_PER_OBJECT).max(nodes * CONTACTS_PER_NODE);
        let contacts = 2 * (touched + FEWEST_CONTACTS);
        let letters = (objects * LETTERS_PER_OBJECT + FEWEST_LETTERS).max(2 * under_way);
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
                Interaction = PairCount,
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

    /// Replaces the interactions.
    pub(super) fn model(&mut self, interactions: Vec<InteractionSlot<PairCount>>, blocks: usize) {
        self.interactions = interactions;
        let letters = self.letters.len();
        let queues = queue_slots(blocks, self.interactions.len(), letters, self.homes);
        self.queues.resize_with(queues, QueueSlot::new);
    }

    /// Doubles the room for contacts.
    pub(super) fn double_contacts(&mut self) {
        let size = 2 * self.contacts.len();
        self.contacts.resize_with(size, ContactSlot::new);
        self.segments.resize_with(size, SegmentSlot::new);
    }
}

fn filled<T>(count: usize, slot: impl Fn() -> T) -> Vec<T> {
    std::iter::repeat_with(slot).take(count).collect()
}

/// Room for the pairs of blocks that a frame may find near each other.
pub(super) fn spare_interactions(blocks: usize) -> Vec<InteractionSlot<PairCount>> {
    let candidates = if blocks <= ALL_PAIRS_BLOCKS {
        blocks * (blocks + 1) / 2
    } else {
        blocks * CANDIDATES_PER_BLOCK
    };
    filled(2 * candidates, || InteractionSlot::spare(PairCount::default()))
}

/// Every pair of blocks that an interaction is modelled for.
pub(super) fn modelled_interactions(
    stages: &Stages,
    blocks: &[Block],
) -> Vec<InteractionSlot<PairCount>> {
    let mut interactions = Vec::new();
    for (first, a) in blocks.iter().enumerate() {
        for (second, b) in blocks.iter().enumerate().skip(first + 1) {
            if stages.rules.apply(a.groups(), b.groups()) {
                let ends = [first, second].map(|index| UnitId(index as u32));
                interactions.push(InteractionSlot::between(ends[0], ends[1], PairCount::default()));
            }
        }
    }
    interactions
}
