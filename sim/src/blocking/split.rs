//! Which objects are close enough to be one block's, and which blocks one home's: parts of space, split along their
//! longest sides.

use std::cmp::{Ordering, Reverse};
use std::ops::Range;

use glam::Vec3;

use crate::object::{Object, ObjectId};

/// Who is in a block.
pub(super) struct Members {
    pub(super) ids: Vec<u32>,
    /// What their updates take, in nanoseconds, as far as it is known.
    cost: u64,
    pub(super) home: u32,
    /// The number of their part of space, as it was split: close in space are close in number.
    pub(super) part: usize,
}

impl Members {
    /// These, at home 0, whose updates take nobody knows how long.
    pub(super) fn of(ids: Vec<u32>) -> Self {
        Self { ids, cost: 0, home: 0, part: 0 }
    }

    /// By home; there by the power of two of their cost, the dearest first; there by part, for neighbours
    /// that come one after the other meet in the cache.
    pub(super) fn order(&self) -> (u32, Reverse<Option<u32>>, usize) {
        (self.home, Reverse(self.cost.checked_ilog2()), self.part)
    }
}

/// Where an object is, and what its update takes.
#[derive(Clone, Copy)]
pub(super) struct Key {
    center: [f32; 3],
    pub(super) id: u32,
    /// In nanoseconds: whole numbers are added up several at a time.
    cost: u32,
}

impl Key {
    pub(super) fn of(object: &Object) -> Self {
        Self::new((object.id(), object.center(), object.cost()))
    }

    /// Of an object with this number, place and cost, in seconds.
    pub(super) fn new((id, center, cost): (ObjectId, Vec3, f32)) -> Self {
        Self { center: center.to_array(), id: id.0, cost: (cost * 1e9) as u32 }
    }
}

/// How a part of space was last divided in two. It is again, as long as that is nearly best: what is divided another way
/// goes from one core's caches to another's.
#[derive(Clone, Copy, Default)]
pub(super) struct Division {
    axis: usize,
    /// Blocks of the first of the two.
    blocks: usize,
}

impl Division {
    /// Along the same side as last time, or the first that is notably longer, or one notably longer than that: of sides
    /// that are nearly equal always the same.
    pub(super) fn find_axis(&mut self, keys: &[Key]) -> usize {
        let sides = sides(keys);
        for axis in 0..3 {
            if sides[axis] > NOTABLY * sides[self.axis] {
                self.axis = axis;
            }
        }
        self.axis
    }

    /// Of so many blocks a share of so many, as nearly as there are whole ones, or as many as last time while that is not
    /// farther off than by [`STAY`].
    pub(super) fn find_blocks(&mut self, of: usize, share: f32) -> usize {
        let wanted = share * of as f32;
        if (wanted - self.blocks as f32).abs() > STAY {
            self.blocks = wanted.round() as usize;
        }
        self.blocks = self.blocks.clamp(1, of - 1);
        self.blocks
    }
}

/// Blocks, and how they were last divided.
pub(super) struct Parts<'p> {
    pub(super) members: &'p mut [Members],
    /// For each block but the first, how those from it on were divided from those before.
    pub(super) of_blocks: &'p mut [Division],
    /// The same for homes.
    pub(super) of_homes: &'p mut [Division],
}

impl<'p> Parts<'p> {
    fn divide(self, blocks: usize, homes: usize) -> [Self; 2] {
        let (low, high) = self.members.split_at_mut(blocks);
        let (low_blocks, high_blocks) = self.of_blocks.split_at_mut(blocks);
        let (low_homes, high_homes) = self.of_homes.split_at_mut(homes);
        [
            Self { members: low, of_blocks: low_blocks, of_homes: low_homes },
            Self { members: high, of_blocks: high_blocks, of_homes: high_homes },
        ]
    }
}

/// Shares objects and blocks out to homes that are to take equally long: parts along the longest side until each is
/// one home's, which has blocks in proportion to its objects. Who works at the first of all homes does something else
/// for `besides` seconds a frame. While no costs are known, each gets as many. However uneven homes are, no block has
/// more than `most` shares, which is enough for all.
pub(super) fn among_homes(
    keys: &mut [Key],
    parts: Parts<'_>,
    homes: Range<u32>,
    share: usize,
    most: usize,
    besides: f32,
) {
    let (shares, all) = (keys.len().div_ceil(share), parts.members.len());
    if homes.len() < 2 || all < 2 || shares < 2 {
        return evenly(keys, parts, homes.start, share);
    }
    let first_homes = homes.len() / 2;
    let half = homes.start + first_homes as u32;
    let part = first_homes as f32 / homes.len() as f32;
    let division = &mut parts.of_homes[first_homes];
    let (total, axis) = (cost(keys), division.find_axis(keys));
    let parted = (total > 0).then(|| {
        let wanted = part * (total as f32 * 1e-9 + besides) - besides;
        part_by_cost(keys, axis, share, total, (wanted * 1e9) as u64)
    });
    let wanted = parted.unwrap_or((part * shares as f32).round() as usize);
    // Nor is any to become very small.
    let least = (0.5 * shares as f32 / all as f32).round() as usize;
    let low_shares = wanted.max(least).min(shares.saturating_sub(least)).clamp(1, shares - 1);
    let blocks = division.find_blocks(all, low_shares as f32 / shares as f32);
    let low_shares = low_shares.clamp(shares.saturating_sub(most * (all - blocks)), most * blocks);
    let (low, high) = if parted == Some(low_shares) {
        keys.split_at_mut(low_shares * share)
    } else {
        part_at(keys, low_shares * share, axis)
    };
    let [low_parts, high_parts] = parts.divide(blocks, first_homes);
    among_homes(low, low_parts, homes.start..half, share, most, besides);
    among_homes(high, high_parts, half..homes.end, share, most, 0.0);
}

/// How many shares come first along an axis, and as keys then, that cost nearly `wanted`, in nanoseconds, of what all do.
pub(super) fn part_by_cost(
    keys: &mut [Key],
    axis: usize,
    share: usize,
    total: u64,
    wanted: u64,
) -> usize {
    let (mut low, mut high) = (0, keys.len().div_ceil(share));
    let (mut below, mut above) = (0, total);
    let mut guesses = 0;
    while high - low > 1 {
        let between = high - low;
        let middle = if guesses < GUESSES {
            // As if all cost the same, and rather too far: then little is left between this one and the next.
            let far = (between as f32).sqrt() as usize * usize::from(guesses > 0);
            let part = wanted.saturating_sub(below) as f32 / (above - below).max(1) as f32;
            let guess = low + (part * between as f32) as usize;
            if part < 0.5 { guess + far } else { guess.saturating_sub(far) }
        } else {
            low + between / 2
        };
        guesses += 1;
        let middle = middle.clamp(low + 1, high - 1);
        let end = keys.len().min(high * share);
        let (first, _) = part_at(&mut keys[low * share..end], (middle - low) * share, axis);
        let with_first = below + cost(first);
        if with_first <= wanted {
            (low, below) = (middle, with_first);
        } else {
            (high, above) = (middle, with_first);
        }
    }
    if wanted.saturating_sub(below) <= above.saturating_sub(wanted) { low } else { high }
}

fn cost(keys: &[Key]) -> u64 {
    keys.iter().map(|key| u64::from(key.cost)).sum()
}

/// Shares the objects out evenly to blocks of one home, `share` at a time: halves along the longest side until each
/// part is one block. Every block gets a share; the last may be short of objects.
pub(super) fn evenly(keys: &mut [Key], parts: Parts<'_>, home: u32, share: usize) {
    match parts.members {
        [] => {}
        [only] => {
            only.ids.clear();
            only.ids.extend(keys.iter().map(|key| key.id));
            only.cost = cost(keys);
            only.home = home;
        }
        members => {
            let half = members.len() / 2;
            let middle = keys.len().div_ceil(share) * half / members.len() * share;
            let axis = parts.of_blocks[half].find_axis(keys);
            let (low, high) = part_at(keys, middle, axis);
            let [low_parts, high_parts] = Parts { members, ..parts }.divide(half, 0);
            evenly(low, low_parts, home, share);
            evenly(high, high_parts, home, share);
        }
    }
}

/// Those that come first along an axis, so many, and the others.
fn part_at(keys: &mut [Key], count: usize, axis: usize) -> (&mut [Key], &mut [Key]) {
    let along = |a: &Key, b: &Key| -> Ordering {
        a.center[axis].total_cmp(&b.center[axis]).then(a.id.cmp(&b.id))
    };
    // There may be none at all.
    if count < keys.len() {
        keys.select_nth_unstable_by(count, along);
    }
    keys.split_at_mut(count.min(keys.len()))
}

/// How often it is guessed where a part ends, before what is left is halved each time: with costs that are nothing alike
/// guesses come no nearer. Usually 4; three do where they are alike.
const GUESSES: usize = 4;

/// How much longer than the side that was last divided another must be to be divided in its place; a quarter.
const NOTABLY: f32 = 1.25;

/// How far the number of blocks that a part has may be from what it should be, for it to stay; usually 0.75, where whole
/// numbers are 0.5 off at most.
const STAY: f32 = 0.75;

/// How far they extend along each axis.
fn sides(keys: &[Key]) -> [f32; 3] {
    let (mut low, mut high) = ([f32::INFINITY; 3], [f32::NEG_INFINITY; 3]);
    for key in keys {
        for axis in 0..3 {
            low[axis] = low[axis].min(key.center[axis]);
            high[axis] = high[axis].max(key.center[axis]);
        }
    }
    [0, 1, 2].map(|axis: usize| high[axis] - low[axis])
}

/// How far they extend along the longest side; 0 for none.
pub(super) fn span(keys: &[Key]) -> f32 {
    sides(keys).into_iter().fold(0.0, f32::max)
}
