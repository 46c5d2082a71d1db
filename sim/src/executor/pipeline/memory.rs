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
use crate::geometry::Bounds;
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
/// Candidates a frame for each block beyond that, at least; a block has some 26 neighbours.
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
            most_candidates: (candidates < pairs(blocks)).then_some(candidates / 2),
            most_contacts: self.contact_capacity() / 2,
        }
    }

    /// Replaces the interactions, of so many blocks in so many homes.
    pub(super) fn model(
        &mut self,
        interactions: Vec<InteractionSlot<Found>>,
        blocks: usize,
        homes: usize,
    ) {
        (self.interactions, self.homes) = (interactions, homes);
        self.fit_queues(blocks);
    }

    /// Doubles the room in a table at least, for so many blocks: half of it is then enough for `needed` contacts or
    /// candidates of each of two frames, or for as many letters more.
    pub(super) fn grow(&mut self, table: Table, needed: usize, blocks: usize) {
        let from = |before: usize| (2 * before).max(4 * needed);
        match table {
            Table::Contacts => {
                let size = from(self.contacts.len());
                self.contacts.resize_with(size, ContactSlot::new);
                self.segments.resize_with(size, SegmentSlot::new);
            }
            Table::Letters => self.letters.resize_with(from(self.letters.len()), LetterSlot::new),
            _ => self.interactions.resize_with(from(self.interactions.len()), spare),
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
    /// None if there is room for every pair of blocks.
    most_candidates: Option<usize>,
    pub(super) most_contacts: usize,
}

impl Limits {
    /// Whether there is room for all pairs of blocks with these boxes that may meet.
    ///
    /// # Errors
    /// How many may, if there is not.
    pub(super) fn check_pairs(&self, boxes: impl Iterator<Item = Bounds>) -> Result<(), usize> {
        let Some(most) = self.most_candidates else { return Ok(()) };
        let pairs = overlapping(boxes);
        if pairs > most { Err(pairs) } else { Ok(()) }
    }
}

fn filled<T>(count: usize, slot: impl Fn() -> T) -> Vec<T> {
    std::iter::repeat_with(slot).take(count).collect()
}

/// Room for the pairs of blocks that a frame may find near each other: for twice as many as there are now, where
/// every pair would be too many.
pub(super) fn spare_interactions(blocks: &[Block]) -> Vec<InteractionSlot<Found>> {
    let all = pairs(blocks.len());
    let candidates = if blocks.len() <= ALL_PAIRS_BLOCKS {
        all
    } else {
        let now = overlapping(blocks.iter().map(Block::bounds));
        (2 * now).max(blocks.len() * CANDIDATES_PER_BLOCK).min(all)
    };
    filled(2 * candidates, spare)
}

/// How many pairs of these boxes overlap, each with itself too.
fn overlapping(boxes: impl Iterator<Item = Bounds>) -> usize {
    let boxes: Vec<Bounds> = boxes.collect();
    let after = |place: usize| boxes[place..].iter();
    let with_later = boxes.iter().enumerate();
    with_later.map(|(place, own)| after(place).filter(|other| own.overlaps(other)).count()).sum()
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
    use glam::Vec3;

    use super::*;
    use crate::behavior::Fixed;
    use crate::geometry::{Geometry, Rigid};
    use crate::object::{Group, ObjectId};

    /// So many blocks of one object each, of which the first `crowded` overlap.
    fn blocks(count: usize, crowded: usize) -> Vec<Block> {
        let wall = |index: usize| {
            let mut wall = Rigid::wall(Vec3::ZERO, Vec3::Y);
            if index >= crowded {
                wall.shape = parry3d::shape::SharedShape::ball(0.1);
                wall.pose.translation = Vec3::new(0.0, 1.0, index as f32);
            }
            Object::new(ObjectId(index as u32), Group(0), Geometry::Rigid(wall), Fixed)
        };
        (0..count).map(|index| Block::new(vec![wall(index)])).collect()
    }

    #[test]
    fn room_for_candidates_is_for_those_that_may_meet() {
        // All pairs of 512; 128 for each of 600; twice the pairs of the 400 that overlap, or all.
        for (count, crowded, room) in
            [(3, 0, 6), (512, 9, 512 * 513 / 2), (600, 9, 600 * 128), (600, 400, 400 * 401 + 400)]
        {
            let all = blocks(count, crowded);
            let mut tables = Tables::new(&all, spare_interactions(&all), 2);
            assert_eq!(tables.interactions.len() / 2, room, "{count}, {crowded}");
            let boxes = |all: &[Block]| all.iter().map(Block::bounds).collect::<Vec<_>>();
            let check = |tables: &Tables, all: &[Block]| {
                tables.limits(count).check_pairs(boxes(all).into_iter())
            };
            assert_eq!(check(&tables, &all), Ok(()));
            let worst = blocks(count, count);
            if let Err(pairs) = check(&tables, &worst) {
                assert_eq!((count, pairs), (600, 600 * 601 / 2));
                tables.grow(Table::Interactions, pairs, count);
                assert_eq!(check(&tables, &worst), Ok(()));
            } else {
                assert!(count <= ALL_PAIRS_BLOCKS, "{count}, {crowded}");
            }
        }
    }

    #[test]
    fn tables_that_grow_fit_together() {
        let all = blocks(3, 0);
        let mut tables = Tables::new(&all, spare_interactions(&all), 2);
        let sizes = |tables: &Tables| {
            [tables.interactions.len(), tables.contacts.len(), tables.letters.len()]
        };
        for (grown, table) in
            [Table::Interactions, Table::Contacts, Table::Letters].into_iter().enumerate()
        {
            for needed in [1, 100_000] {
                let mut expected = sizes(&tables);
                expected[grown] = (2 * expected[grown]).max(4 * needed);
                tables.grow(table, needed, 3);
                assert_eq!(sizes(&tables), expected);
                let [interactions, contacts, letters] = expected;
                assert_eq!(tables.queues.len(), queue_slots(3, interactions, letters, 2));
                assert_eq!(tables.segments.len(), contacts);
            }
        }
    }
}
