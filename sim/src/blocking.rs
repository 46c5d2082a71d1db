//! How objects are grouped into blocks: by recursive median splits of their positions.

use std::cmp::Reverse;

use thiserror::Error;

use crate::block::Block;
use crate::object::Object;
use crate::simd::HALF;

/// How objects are grouped.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Grain {
    /// Blocks of spatially close objects: right for many light objects.
    #[default]
    Spatial,
    /// One object a block, every modelled pair tested by itself, as in the paper: right for few, heavy
    /// or uneven objects.
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

/// The frames between two regroupings: in so many a particle moves by a fraction of a block.
pub const FRAMES_PER_BLOCKING: u64 = 32;

/// Objects up to which each is a block of its own: few objects are heavy or uneven ones, and blocks of them
/// would be too.
const SINGLE_OBJECTS: usize = 64;
/// Blocks for each object to the power of 2/3; usually 0.1. The tests between blocks grow as the square of their
/// number, those within blocks as the square of the objects of each: with that power both stay in balance.
const BLOCKS: f64 = 0.1;
/// The fewest blocks for each worker: with one none could help out another.
const FEWEST_PER_WORKER: usize = 2;
/// So many share out better, if each has [`FILLING`] objects.
const USUAL_PER_WORKER: usize = 4;
/// Objects of a block that leave few of its lanes empty, however uneven they are; usually 60, twice as many as
/// are advanced side by side.
const FILLING: usize = 60;

/// Groups objects into a number of blocks that stays the same; which objects are together changes.
///
/// Scenery and solitary objects have blocks of their own: the boxes of walls would make any block
/// overlap every other. To regroup, every block is drained, the positions are split, and every block
/// is filled again.
pub struct Blocking {
    objects: Vec<Option<Object>>,
    /// The numbers of those that move, as they were when they were taken over.
    moving: Vec<u32>,
    members: Vec<Members>,
    keys: Vec<Key>,
    moving_blocks: usize,
    /// Moving objects are shared out so many at a time: as many as are advanced side by side, or one by one.
    share: usize,
    /// Room for objects in every block of moving ones: which of them has a share more changes.
    room: usize,
}

/// Who is in a block.
#[derive(Default)]
struct Members {
    ids: Vec<u32>,
    /// What their updates take, in seconds, as far as it is known.
    cost: f32,
    home: u32,
    /// The place among the blocks as they were split: close in space are close in number.
    place: usize,
}

impl Members {
    /// By home; there by the power of two of their cost, the dearest first; there by place, for neighbours
    /// that come one after the other meet in the cache.
    fn order(&self) -> (u32, Reverse<i32>, usize) {
        (self.home, Reverse(self.cost.log2() as i32), self.place)
    }
}

/// Where an object is, and what its update takes.
#[derive(Clone, Copy)]
struct Key {
    center: [f32; 3],
    id: u32,
    cost: f32,
}

impl Blocking {
    /// The most objects of an environment.
    pub const MAX_OBJECTS: usize = 100_000;
    /// The most objects with [`Grain::Pairwise`], whose memory grows with the square of their number.
    pub const MAX_PAIRWISE_OBJECTS: usize = 4_096;

    /// Groups the objects for so many workers.
    ///
    /// # Errors
    /// Object numbers that are not 0, 1, 2 …, or more objects than the grain allows.
    pub fn new(
        objects: Vec<Object>,
        grain: Grain,
        workers: usize,
    ) -> Result<(Self, Vec<Block>), BlockingError> {
        let limit = match grain {
            Grain::Spatial => Self::MAX_OBJECTS,
            Grain::Pairwise => Self::MAX_PAIRWISE_OBJECTS,
        };
        let count = objects.len();
        if count > limit {
            return Err(BlockingError::TooManyObjects { objects: count, limit });
        }
        let mut slots: Vec<Option<Object>> = Vec::new();
        slots.resize_with(count, || None);
        for mut object in objects {
            object.refit();
            let id = object.id().0;
            match slots.get_mut(id as usize) {
                Some(slot @ None) => *slot = Some(object),
                _ => return Err(BlockingError::Number { id, objects: count }),
            }
        }
        Ok(Self::group(slots, grain, workers))
    }

    fn group(objects: Vec<Option<Object>>, grain: Grain, workers: usize) -> (Self, Vec<Block>) {
        let mut kinds: [Vec<u32>; 3] = Default::default();
        for object in objects.iter().flatten() {
            kinds[kind(object)].push(object.id().0);
        }
        let [moving, scenery, solitary] = kinds;
        let (moving_blocks, scenery_blocks, solitary_blocks) = match grain {
            Grain::Pairwise => (moving.len(), scenery.len(), solitary.len()),
            Grain::Spatial => (
                block_count(moving.len(), workers),
                scenery.len().min(1),
                block_count(solitary.len(), workers),
            ),
        };
        let share = if moving_blocks == moving.len() { 1 } else { HALF };
        let room = moving.len().div_ceil(share).div_ceil(moving_blocks.max(1)) * share;
        let empty = || Members { ids: Vec::with_capacity(room), ..Members::default() };
        let mut members = Vec::new();
        members.resize_with(moving_blocks, empty);
        for (ids, blocks) in [(scenery, scenery_blocks), (solitary, solitary_blocks)] {
            let size = ids.len().div_ceil(blocks.max(1)).max(1);
            let chunks = ids.chunks(size);
            members.extend(chunks.map(|ids| Members { ids: ids.to_vec(), ..Members::default() }));
        }
        let mut blocks = Vec::new();
        blocks.resize_with(members.len(), Block::default);
        let keys = Vec::with_capacity(moving.len());
        let mut blocking = Self { objects, moving, members, keys, moving_blocks, share, room };
        blocking.split();
        for (index, block) in blocks.iter_mut().enumerate() {
            blocking.fill(index, block);
        }
        (blocking, blocks)
    }

    /// Takes all objects out of a block.
    pub fn drain(&mut self, block: &mut Block) {
        for object in block.objects.drain(..) {
            if let Some(slot) = self.objects.get_mut(object.id().0 as usize) {
                *slot = Some(object);
            }
        }
    }

    /// Decides, when all blocks are drained, which objects go where.
    pub fn split(&mut self) {
        self.keys.clear();
        let object = |&id: &u32| self.objects.get(id as usize)?.as_ref();
        self.keys.extend(self.moving.iter().filter_map(object).map(Key::new));
        split(&mut self.keys, &mut self.members[..self.moving_blocks], self.share);
    }

    /// Shares the moving objects' blocks out to so many homes, for a [`split`](Self::split) that is to be
    /// worked on from there: blocks of one home are close in space, homes take equally long as far as
    /// that is known, and each has its longest blocks first, so that none of its last is long.
    pub fn deal(&mut self, homes: u32) {
        let moving = &mut self.members[..self.moving_blocks];
        let total: f32 = moving.iter().map(|members| members.cost).sum();
        let mut before = 0.0;
        for (index, members) in moving.iter_mut().enumerate() {
            let middle = if total > 0.0 {
                (before + 0.5 * members.cost) / total
            } else {
                (index as f32 + 0.5) / self.moving_blocks as f32
            };
            members.home = ((middle * homes as f32) as u32).min(homes.saturating_sub(1));
            before += members.cost;
            members.place = index;
        }
        moving.sort_unstable_by_key(Members::order);
    }

    /// The home of the block number `index`; 0 without such a block, and for those that never move.
    #[must_use]
    pub fn home(&self, index: usize) -> u32 {
        self.members.get(index).map_or(0, |members| members.home)
    }

    /// Puts the objects of the block number `index` into it.
    pub fn fill(&mut self, index: usize, block: &mut Block) {
        let Some(Members { ids, .. }) = self.members.get(index) else { return };
        block.reserve(ids.len().max(self.room));
        for &id in ids {
            block.objects.extend(self.objects.get_mut(id as usize).and_then(Option::take));
        }
        block.refresh();
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

/// The number of blocks for so many objects. None is for fewer of them than are advanced side by side, which
/// would take as long.
fn block_count(objects: usize, workers: usize) -> usize {
    if objects <= SINGLE_OBJECTS {
        return objects;
    }
    let workers = workers.max(1);
    let fewest_tests = (BLOCKS * (objects as f64).cbrt().powi(2)).round() as usize;
    let [fewest, usual] = [FEWEST_PER_WORKER, USUAL_PER_WORKER].map(|blocks| blocks * workers);
    let shared_out = (objects / FILLING).clamp(fewest, usual);
    // No worker is to have one more than another.
    let wanted = fewest_tests.max(shared_out).next_multiple_of(workers);
    wanted.min(objects.div_ceil(HALF))
}

impl Key {
    fn new(object: &Object) -> Self {
        Self { center: object.center().to_array(), id: object.id().0, cost: object.cost() }
    }
}

/// Shares the objects out evenly, `share` at a time: halves along the longest side until each part is one block.
/// Every block gets a share; the last may be short of objects.
fn split(keys: &mut [Key], members: &mut [Members], share: usize) {
    match members {
        [] => {}
        [only] => {
            only.ids.clear();
            only.ids.extend(keys.iter().map(|key| key.id));
            only.ids.sort_unstable();
            only.cost = keys.iter().map(|key| key.cost).sum();
        }
        _ => {
            let half = members.len() / 2;
            let middle = keys.len().div_ceil(share) * half / members.len() * share;
            // Blocks that were not drained leave fewer objects than there is room for.
            if middle < keys.len() {
                let axis = longest_side(keys);
                keys.select_nth_unstable_by(middle, |a, b| {
                    a.center[axis].total_cmp(&b.center[axis]).then(a.id.cmp(&b.id))
                });
            }
            let (low, high) = keys.split_at_mut(middle);
            let (low_members, high_members) = members.split_at_mut(half);
            split(low, low_members, share);
            split(high, high_members, share);
        }
    }
}

fn longest_side(keys: &[Key]) -> usize {
    let side = |axis: usize| {
        let values = keys.iter().map(|key| key.center[axis]);
        let (low, high) = values
            .fold((f32::INFINITY, f32::NEG_INFINITY), |(l, h), value| (l.min(value), h.max(value)));
        high - low
    };
    let sides = [side(0), side(1), side(2)];
    (1..3).fold(0, |longest, axis| if sides[axis] > sides[longest] { axis } else { longest })
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::*;
    use crate::scene::ParticleScene;

    /// Deals particles whose updates take so many microseconds; what each home is given, block by block.
    fn dealt(micros: &[u64], homes: u32) -> Vec<Vec<u64>> {
        let scene = ParticleScene::new(micros.len()).build().expect("a valid scene");
        let mut objects = scene.objects;
        for (object, &micros) in objects.iter_mut().zip(micros) {
            object.note_cost(Duration::from_micros(micros));
        }
        let (mut blocking, mut blocks) =
            Blocking::new(objects, Grain::Spatial, 2).expect("a valid environment");
        blocks.iter_mut().for_each(|block| blocking.drain(block));
        blocking.split();
        blocking.deal(homes);
        let mut given = vec![Vec::new(); homes as usize];
        for (index, block) in blocks.iter_mut().enumerate() {
            blocking.fill(index, block);
            let cost = |object: &Object| (object.cost() * 1e6).round() as u64;
            let moving = block.objects().iter().filter(|object| kind(object) == 0);
            let cost: u64 = moving.map(cost).sum();
            if cost > 0 {
                given[blocking.home(index) as usize].push(cost);
            }
        }
        given
    }

    #[test]
    fn homes_take_equally_long_and_begin_with_the_longest() {
        let micros: Vec<u64> = (1..=30).map(|object| object * object % 97 + 1).collect();
        let longest = 97;
        for homes in 1..=4 {
            let given = dealt(&micros, homes);
            let share = micros.iter().sum::<u64>() / u64::from(homes);
            for home in &given {
                let cost: u64 = home.iter().sum();
                assert!(cost.abs_diff(share) <= longest, "{cost} of {share} µs, {homes} homes");
                let halves = home.windows(2).filter(|pair| pair[1] >= 2 * pair[0]);
                assert_eq!(halves.count(), 0, "a long one after a short one: {home:?}");
            }
            assert_eq!(given.iter().map(Vec::len).sum::<usize>(), micros.len());
        }
    }

    #[test]
    fn an_interrupted_update_counts_at_most_double() {
        let scene = ParticleScene::new(1).build().expect("a valid scene");
        let mut object = scene.objects.into_iter().next().expect("a particle");
        for (took, expected) in [(4, 4.0), (4_000, 6.0), (2, 4.0)] {
            object.note_cost(Duration::from_micros(took));
            assert!((object.cost() * 1e6 - expected).abs() < 1e-3, "{} s", object.cost());
        }
    }
}
