//! How objects are grouped into blocks, and blocks shared out to homes: by recursive splits of their positions.

mod split;

use glam::Vec3;
use thiserror::Error;

use self::split::{Division, Key, Members, Parts};
use crate::behavior::batch;
use crate::block::Block;
use crate::cost::FRAMES_PER_NOTE;
use crate::object::{Object, ObjectId};
use crate::simd::HALF;

/// How objects are grouped.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Grain {
    /// Blocks of spatially close objects: right for light objects. Up to 64 are blocks of their own, unless all but rigid
    /// ones are mass–spring bodies of one topology, which take less time side by side, and ten or more for each worker.
    #[default]
    Spatial,
    /// One object a block, every modelled pair tested by itself, as in the paper: right for few and heavy
    /// objects.
    Pairwise,
}

/// Why objects cannot be grouped.
#[derive(Clone, Copy, Debug, Error, PartialEq, Eq)]
pub enum BlockingError {
    /// Object numbers must be 0, 1, 2 … without gaps, in any order.
    #[error("object number {id} is given twice or is not below the number of objects, {objects}")]
    Number {
        /// The number.
        id: u32,
        /// The number of objects.
        objects: usize,
    },
    /// Too many objects.
    #[error("{objects} objects are more than the {limit} that this broad phase allows")]
    TooManyObjects {
        /// The number of objects.
        objects: usize,
        /// The greatest number allowed.
        limit: usize,
    },
}

/// The frames between two regroupings, usually 64: in so many a particle moves by a fraction of a block. All workers but
/// one wait meanwhile, so that the more there are the more each costs; two are as fast with 32, within a hundredth.
pub const FRAMES_PER_BLOCKING: u64 = 2 * FRAMES_PER_NOTE;

/// Objects up to which each is a block of its own, unless they are [alike](batch::alike): few objects are usually heavy
/// ones, and blocks of them would be too.
const SINGLE_OBJECTS: usize = 64;
/// The fewest of a worker's that are in a block then; usually 10: being advanced side by side gains fewer less than is lost
/// where they cannot be shared out one by one.
const FEWEST_TOGETHER: usize = 10;
/// The most objects of a block for which few are dealt by what they weigh, and not by place; usually 24. Lanes in which
/// several would follow each other are full however they are dealt.
const MOST_BY_WEIGHT: usize = 24;
/// Blocks for each object to the power of 2/3; usually 0.06. Were all tested with all, that power would keep the tests
/// between blocks and those within in balance; as most are passed over, half as many blocks take as long, and twice as many
/// some hundredths longer.
const BLOCKS: f64 = 0.06;
/// The fewest blocks for each worker, so that whoever is done can help out another, if each has [`FULL`] objects: with
/// emptier lanes more is lost than that gains, and one for each worker is better.
const FEWEST_PER_WORKER: usize = 2;
/// So many share out better still, if each has [`FILLING`] objects.
const USUAL_PER_WORKER: usize = 4;
/// Objects of a block whose lanes are full for most substeps; usually 45.
const FULL: usize = 45;
/// Objects of a block that leave few of its lanes empty, however uneven they are; usually 70, a few more than twice as
/// many as are advanced side by side.
const FILLING: usize = 70;
/// Objects that are shared out at a time where blocks have fewer than [`FULL`], so that some lanes are empty anyhow, but
/// still enough for all lanes; usually 4. Of single ones more would come and go as costs change by little.
const FEW: usize = 4;
/// The share of scenery's whole extent from which on a part of it reaches far; a quarter.
const FAR: f32 = 0.25;
/// How much larger than others the blocks of a home may usually be that is to have more objects; twice.
const UNEVENNESS: usize = 2;

/// Groups objects into a number of blocks that stays the same; which objects are together changes.
///
/// Scenery and solitary objects have blocks of their own, and of scenery what reaches far: the boxes of walls would make
/// any block overlap every other. To regroup, the positions are split anew; as most objects stay with those that they
/// were with, only those that do not are moved.
pub struct Blocking {
    members: Vec<Members>,
    /// How the blocks of moving objects were last divided, by block.
    of_blocks: Vec<Division>,
    /// The same by home.
    of_homes: Vec<Division>,
    keys: Vec<Key>,
    /// The number of the block that each object is, or is to be, in, by the objects' numbers.
    block_of: Vec<u32>,
    /// Objects on their way from block to block.
    leaving: Vec<Object>,
    /// For each block of moving objects the part of space that it has, and is to have, by the parts' numbers.
    parts: Vec<usize>,
    /// For each part the block that is to have it.
    ranks: Vec<usize>,
    moving_blocks: usize,
    /// The last of all.
    solitary_blocks: usize,
    /// Moving objects are shared out so many at a time.
    share: usize,
}

impl Blocking {
    /// The most objects of an environment.
    pub const MAX_OBJECTS: usize = 100_000;
    /// The most objects with [`Grain::Pairwise`], whose memory grows with the square of their number.
    pub const MAX_PAIRWISE_OBJECTS: usize = 4_096;

    /// Groups the objects for so many workers.
    ///
    /// # Errors
    /// Those of [`Self::check`].
    pub fn new(
        objects: Vec<Object>,
        grain: Grain,
        workers: usize,
    ) -> Result<(Self, Vec<Block>), BlockingError> {
        Self::check(&objects, grain)?;
        Ok(Self::group(objects, grain, workers))
    }

    /// Whether the objects can be grouped.
    ///
    /// # Errors
    /// Object numbers that are not 0, 1, 2 …, or more objects than the grain allows.
    pub fn check(objects: &[Object], grain: Grain) -> Result<(), BlockingError> {
        let limit = match grain {
            Grain::Spatial => Self::MAX_OBJECTS,
            Grain::Pairwise => Self::MAX_PAIRWISE_OBJECTS,
        };
        let count = objects.len();
        if count > limit {
            return Err(BlockingError::TooManyObjects { objects: count, limit });
        }
        let mut is_there = vec![false; count];
        for id in objects.iter().map(|object| object.id().0) {
            match is_there.get_mut(id as usize) {
                Some(is_there @ false) => *is_there = true,
                _ => return Err(BlockingError::Number { id, objects: count }),
            }
        }
        Ok(())
    }

    /// Groups objects that [can be](Self::check) for so many workers.
    pub(crate) fn group(
        mut objects: Vec<Object>,
        grain: Grain,
        workers: usize,
    ) -> (Self, Vec<Block>) {
        objects.sort_unstable_by_key(Object::id);
        objects.iter_mut().for_each(Object::refit);
        let mut kinds: [Vec<u32>; 3] = Default::default();
        for object in &objects {
            kinds[kind(object)].push(object.id().0);
        }
        let [moving, scenery, solitary] = kinds;
        let count = |ids: &[u32]| match grain {
            Grain::Spatial if is_grouped(&objects, ids, workers) => block_count(ids.len(), workers),
            Grain::Spatial | Grain::Pairwise => ids.len(),
        };
        let moving_blocks = count(&moving);
        let scenery = match grain {
            Grain::Pairwise => scenery.into_iter().map(|id| Members::of(vec![id])).collect(),
            Grain::Spatial => group_scenery(&objects, scenery, workers),
        };
        let share = share(moving.len(), moving_blocks);
        // How many each block has changes.
        let room = most_shares(moving.len(), share, moving_blocks) * share;
        let mut members = Vec::new();
        members.resize_with(moving_blocks, || Members::of(Vec::with_capacity(room)));
        let mut keys: Vec<Key> = moving.iter().map(|&id| Key::of(&objects[id as usize])).collect();
        let mut of_blocks = vec![Division::default(); moving_blocks];
        let parts = Parts { members: &mut members, of_blocks: &mut of_blocks, of_homes: &mut [] };
        split::evenly(&mut keys, parts, 0, share);
        number(&mut members);
        members.extend(scenery);
        let size = solitary.len().div_ceil(count(&solitary).max(1)).max(1);
        let solitary = solitary.chunks(size).map(|ids| Members::of(ids.to_vec()));
        let solitary_blocks = solitary.len();
        members.extend(solitary);
        let mut block_of = vec![0; objects.len()];
        assign(&mut block_of, &members);
        let room = |(index, members): (usize, &Members)| {
            if index < moving_blocks { room } else { members.ids.len() }
        };
        let mut grouped: Vec<Vec<Object>> =
            members.iter().enumerate().map(room).map(Vec::with_capacity).collect();
        for object in objects {
            grouped[block_of[object.id().0 as usize] as usize].push(object);
        }
        let blocking = Self {
            members,
            of_blocks,
            of_homes: Vec::new(),
            keys,
            block_of,
            leaving: Vec::with_capacity(moving.len()),
            parts: (0..moving_blocks).collect(),
            ranks: vec![0; moving_blocks],
            moving_blocks,
            solitary_blocks,
            share,
        };
        (blocking, grouped.into_iter().map(Block::new).collect())
    }

    /// Forms anew the blocks that it gave, which hold the same objects: as many to each, and those that are close in
    /// space come one after the other. Does nothing with fewer of them.
    pub fn split(&mut self, blocks: &mut [Block]) {
        let Some(blocks) = blocks.get_mut(..self.moving_blocks) else { return };
        self.list(blocks.iter().flat_map(Block::places));
        let Self { members, of_blocks, of_homes, .. } = self;
        let members = &mut members[..self.moving_blocks];
        let parts = Parts { members, of_blocks, of_homes };
        split::evenly(&mut self.keys, parts, 0, self.share);
        number(&mut self.members[..self.moving_blocks]);
        self.regroup(blocks);
    }

    /// The same for so many homes, which get as much of the work as makes them take equally long, as far as that is
    /// known. Who works at home 0 does something else too, for `besides` seconds a frame. Blocks of one home are close
    /// in space, or, of few bodies that are advanced side by side, in substeps, and each has its longest blocks first, so
    /// that none of its last is long. Of solitary objects each home has as many blocks.
    pub fn deal(&mut self, blocks: &mut [Block], homes: u32, besides: f32) {
        let Some(blocks) = blocks.get_mut(..self.moving_blocks) else { return };
        let homes = homes.max(1);
        if homes == 1 || !self.list_by_weight(blocks) {
            self.list(blocks.iter().flat_map(Block::places));
        }
        let first_solitary = self.members.len() - self.solitary_blocks;
        for (place, members) in self.members[first_solitary..].iter_mut().enumerate() {
            members.home = place as u32 % homes;
        }
        let most = most_shares(self.keys.len(), self.share, self.moving_blocks);
        self.of_homes.resize(homes as usize, Division::default());
        let Self { members, of_blocks, of_homes, .. } = self;
        let members = &mut members[..self.moving_blocks];
        let parts = Parts { members, of_blocks, of_homes };
        split::among_homes(&mut self.keys, parts, 0..homes, self.share, most, besides);
        let members = &mut self.members[..self.moving_blocks];
        number(members);
        members.sort_unstable_by_key(Members::order);
        self.regroup(blocks);
    }

    /// Lists what few objects that are in blocks weigh, in the place of where they are: each lane takes as long as the longest
    /// beside it. Says whether that is better: with short registers lanes are few, and full however objects are dealt.
    fn list_by_weight(&mut self, blocks: &[Block]) -> bool {
        let objects: usize = blocks.iter().map(|block| block.ids().len()).sum();
        let most = SINGLE_OBJECTS.min(MOST_BY_WEIGHT * blocks.len());
        if objects <= blocks.len() || objects > most || !batch::has_long_registers() {
            return false;
        }
        self.list(blocks.iter().flat_map(Block::objects).map(|object| {
            let weight = batch::weight(object).unwrap_or(0.0);
            // While none is known, any that are to each other as the weights are.
            let cost = if object.cost() > 0.0 { object.cost() } else { weight * 1e-6 };
            (object.id(), Vec3::X * weight, cost)
        }));
        split::span(&self.keys) > 0.0
    }

    /// Lists these numbers, places and costs of objects.
    fn list(&mut self, objects: impl Iterator<Item = (ObjectId, Vec3, f32)>) {
        self.keys.clear();
        // A block may be another that was put in its place, with an object that is not known here.
        let is_known = |key: &Key| (key.id as usize) < self.block_of.len();
        self.keys.extend(objects.map(Key::new).filter(is_known));
    }

    /// The home of the block number `index`; 0 without such a block, and for those that never move.
    #[must_use]
    pub fn home(&self, index: usize) -> u32 {
        self.members.get(index).map_or(0, |members| members.home)
    }

    /// Brings the objects to the blocks that they are to be in.
    fn regroup(&mut self, blocks: &mut [Block]) {
        assign(&mut self.block_of, &self.members[..blocks.len()]);
        self.carry_on(blocks);
        let Self { block_of, leaving, .. } = self;
        let block_of = |id: ObjectId| block_of.get(id.0 as usize).map(|&block| block as usize);
        for (index, block) in blocks.iter_mut().enumerate() {
            block.part_with(|id| block_of(id).is_some_and(|to| to != index), leaving);
        }
        for object in leaving.drain(..) {
            if let Some(block) = block_of(object.id()) {
                blocks[block].take_in(object);
            }
        }
        blocks.iter_mut().for_each(Block::fit);
    }

    /// Gives each part of space the block that had it before, whatever its number is now: most objects stay then.
    fn carry_on(&mut self, blocks: &mut [Block]) {
        let Self { members, parts, ranks, .. } = self;
        for (index, members) in members[..blocks.len()].iter().enumerate() {
            ranks[members.part] = index;
        }
        for part in &mut *parts {
            *part = ranks[*part];
        }
        for index in 0..blocks.len() {
            while parts[index] != index {
                let to = parts[index];
                blocks.swap(index, to);
                parts.swap(index, to);
            }
        }
        for (part, members) in parts.iter_mut().zip(members) {
            *part = members.part;
        }
    }
}

/// How many objects are shared out to blocks at a time: as many as are advanced side by side, or fewer, or one by one where
/// each is a block, or they are few: of those each counts.
fn share(objects: usize, blocks: usize) -> usize {
    if objects <= blocks.max(SINGLE_OBJECTS) {
        return 1;
    }
    let each = objects / blocks.max(1);
    if (2 * HALF..FULL).contains(&each) { FEW } else { HALF }
}

/// How many shares one of so many blocks may come to have.
fn most_shares(objects: usize, share: usize, blocks: usize) -> usize {
    UNEVENNESS * objects.div_ceil(share).div_ceil(blocks.max(1))
}

/// Numbers the parts of space that blocks were given.
fn number(members: &mut [Members]) {
    members.iter_mut().enumerate().for_each(|(part, members)| members.part = part);
}

/// Notes which block each object is to be in, by the objects' numbers.
fn assign(block_of: &mut [u32], members: &[Members]) {
    for (index, members) in members.iter().enumerate() {
        for &id in &members.ids {
            block_of[id as usize] = index as u32;
        }
    }
}

/// 0 for what moves, 1 for scenery, 2 for what is solitary.
fn kind(object: &Object) -> usize {
    match (object.is_solitary(), object.is_fixed()) {
        (false, false) => 0,
        (false, true) => 1,
        (true, _) => 2,
    }
}

/// Who of the scenery is together: what reaches far, as walls do, and, where it is much, what of the rest is close.
fn group_scenery(objects: &[Object], ids: Vec<u32>, workers: usize) -> Vec<Members> {
    let object = |id: u32| objects.get(id as usize);
    let keys = |ids: &[u32]| -> Vec<Key> {
        ids.iter().filter_map(|&id| object(id)).map(Key::of).collect()
    };
    let far = FAR * split::span(&keys(&ids));
    let reaches_far = |&id: &u32| {
        let sides = object(id).map(|object| object.bounds().max - object.bounds().min);
        // Compared so that a side of no meaning is long, too.
        !sides.is_some_and(|sides| sides.max_element() <= far)
    };
    let (walls, rest): (Vec<u32>, Vec<u32>) = ids.into_iter().partition(reaches_far);
    let mut members = Vec::new();
    let blocks = if rest.len() <= SINGLE_OBJECTS { 1 } else { block_count(rest.len(), workers) };
    members.resize_with(blocks, || Members::of(Vec::new()));
    let mut of_blocks = vec![Division::default(); blocks];
    let parts = Parts { members: &mut members, of_blocks: &mut of_blocks, of_homes: &mut [] };
    split::evenly(&mut keys(&rest), parts, 0, HALF);
    members.push(Members::of(walls));
    members.retain(|members| !members.ids.is_empty());
    members
}

/// Whether the objects with these numbers are in blocks of several: many are, and few that are alike, if there are enough
/// to be advanced side by side for each worker.
fn is_grouped(objects: &[Object], ids: &[u32], workers: usize) -> bool {
    let few = || ids.iter().filter_map(|&id| objects.get(id as usize));
    ids.len() > SINGLE_OBJECTS || batch::alike(few()) >= FEWEST_TOGETHER * workers.max(1)
}

/// The number of blocks for so many objects. None is for fewer of them than are advanced side by side, which
/// would take as long.
fn block_count(objects: usize, workers: usize) -> usize {
    let workers = workers.max(1);
    let fewest_tests = (BLOCKS * (objects as f64).cbrt().powi(2)).round() as usize;
    let [fewest, usual] = [FEWEST_PER_WORKER, USUAL_PER_WORKER].map(|blocks| blocks * workers);
    let shared_out = (objects / FILLING).clamp((objects / FULL).clamp(workers, fewest), usual);
    // No worker is to have one more than another; rather fewer and fuller ones.
    let wanted = (fewest_tests.max(shared_out) + (workers - 1) / 2) / workers * workers;
    wanted.min(objects.div_ceil(HALF))
}

#[cfg(test)]
mod tests;
