//! Which objects are close enough to be one block's, and which blocks one home's: parts of space, split along their
//! longest sides.

use std::cmp::{Ordering, Reverse};
use std::ops::Range;

use glam::Vec3;

use crate::object::{Object, ObjectId};

/// Who is in a block.
pub(super) struct Members {
    pub(super) ids: Vec<u32>,
    /// What their updates take, in seconds, as far as it is known.
    cost: f32,
    pub(super) home: u32,
    /// The number of their part of space, as it was split: close in space are close in number.
    pub(super) part: usize,
}

impl Members {
    /// These, at home 0, whose updates take nobody knows how long.
    pub(super) fn of(ids: Vec<u32>) -> Self {
        Self { ids, cost: 0.0, home: 0, part: 0 }
    }

    /// By home; there by the power of two of their cost, the dearest first; there by part, for neighbours
    /// that come one after the other meet in the cache.
    pub(super) fn order(&self) -> (u32, Reverse<i32>, usize) {
        (self.home, Reverse(self.cost.log2() as i32), self.part)
    }
}

/// Where an object is, and what its update takes.
#[derive(Clone, Copy)]
pub(super) struct Key {
    center: [f32; 3],
    pub(super) id: u32,
    cost: f32,
}

impl Key {
    pub(super) fn of(object: &Object) -> Self {
        Self::new((object.id(), object.center(), object.cost()))
    }

    /// Of an object with this number, place and cost.
    pub(super) fn new((id, center, cost): (ObjectId, Vec3, f32)) -> Self {
        Self { center: center.to_array(), id: id.0, cost }
    }
}

/// Shares objects and blocks out to homes that are to take equally long: parts along the longest side until each is
/// one home's, which has blocks in proportion to its objects. Who works at the first of all homes does something else
/// for `besides` seconds a frame. While no costs are known, each gets as many. However uneven homes are, no block has
/// more than `most` shares, which is enough for all.
pub(super) fn among_homes(
    keys: &mut [Key],
    members: &mut [Members],
    homes: Range<u32>,
    share: usize,
    most: usize,
    besides: f32,
) {
    let shares = keys.len().div_ceil(share);
    if homes.len() < 2 || members.len() < 2 || shares < 2 {
        return evenly(keys, members, homes.start, share);
    }
    let half = homes.start + homes.len() as u32 / 2;
    let part = (half - homes.start) as f32 / homes.len() as f32;
    let total = cost(keys);
    let axis = longest_side(keys);
    let wanted = if total > 0.0 {
        let objects = costing(keys, axis, part * (total + besides) - besides);
        objects as f32 / share as f32
    } else {
        part * shares as f32
    };
    // Nor is any to become very small.
    let least = 0.5 * shares as f32 / members.len() as f32;
    let wanted = wanted.clamp(least, shares as f32 - least).round() as usize;
    let low_shares = wanted.clamp(1, shares - 1);
    let blocks = (members.len() * low_shares + shares / 2) / shares;
    let blocks = blocks.clamp(1, members.len() - 1);
    let high_most = most * (members.len() - blocks);
    let low_shares = low_shares.clamp(shares.saturating_sub(high_most), most * blocks);
    let (low, high) = part_at(keys, low_shares * share, axis);
    let (low_members, high_members) = members.split_at_mut(blocks);
    among_homes(low, low_members, homes.start..half, share, most, besides);
    among_homes(high, high_members, half..homes.end, share, most, 0.0);
}

/// How many objects come first along an axis, and as keys then, before they cost so much.
fn costing(keys: &mut [Key], axis: usize, most: f32) -> usize {
    let (mut low, mut high, mut before) = (0, keys.len(), 0.0);
    while high - low > 1 {
        let middle = (high - low) / 2;
        let (first, _) = part_at(&mut keys[low..high], middle, axis);
        let with_first = before + cost(first);
        if with_first <= most {
            (low, before) = (low + middle, with_first);
        } else {
            high = low + middle;
        }
    }
    low
}

fn cost(keys: &[Key]) -> f32 {
    keys.iter().map(|key| key.cost).sum()
}

/// Shares the objects out evenly to blocks of one home, `share` at a time: halves along the longest side until each
/// part is one block. Every block gets a share; the last may be short of objects.
pub(super) fn evenly(keys: &mut [Key], members: &mut [Members], home: u32, share: usize) {
    match members {
        [] => {}
        [only] => {
            only.ids.clear();
            only.ids.extend(keys.iter().map(|key| key.id));
            only.cost = cost(keys);
            only.home = home;
        }
        _ => {
            let half = members.len() / 2;
            let middle = keys.len().div_ceil(share) * half / members.len() * share;
            let axis = longest_side(keys);
            let (low, high) = part_at(keys, middle, axis);
            let (low_members, high_members) = members.split_at_mut(half);
            evenly(low, low_members, home, share);
            evenly(high, high_members, home, share);
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

/// How much longer than the sides before it a side must be to be the longest; a quarter. Objects that fill a cube would
/// else be split another way each time, and go from one core's caches to another's.
const NOTABLY: f32 = 1.25;

/// How far they extend along each axis.
fn sides(keys: &[Key]) -> [f32; 3] {
    [0, 1, 2].map(|axis: usize| {
        let values = keys.iter().map(|key| key.center[axis]);
        let (low, high) = values
            .fold((f32::INFINITY, f32::NEG_INFINITY), |(l, h), value| (l.min(value), h.max(value)));
        high - low
    })
}

/// How far they extend along the longest side; 0 for none.
pub(super) fn span(keys: &[Key]) -> f32 {
    sides(keys).into_iter().fold(0.0, f32::max)
}

/// The axis along which they extend notably farther than along those before it.
fn longest_side(keys: &[Key]) -> usize {
    let sides = sides(keys);
    let longer =
        |longest, axis| if sides[axis] > NOTABLY * sides[longest] { axis } else { longest };
    (1..3).fold(0, longer)
}
