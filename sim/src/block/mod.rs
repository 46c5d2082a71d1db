//! Blocks of spatially close objects: the units that executors schedule.

mod extents;
mod search;

use std::time::Duration;

use glam::Vec3;

use self::extents::Extents;
use self::search::{Overlaps, OverlapsWithin, Reaches};
use crate::behavior::batch::{self, Order};
use crate::cost::Timings;
use crate::geometry::{Bounds, Extent};
use crate::interaction::{Member, group_set};
use crate::object::{Object, ObjectId};
use crate::simd::{Simd, prefetch};

/// How many objects before its own update an object's parts are asked for, and the object itself as many before that;
/// usually 8.
const AHEAD: usize = 8;

/// How many objects before it is drawn what renderers read of an object is asked for, and the object itself as many before
/// that; usually 4: with 2 drawing takes a tenth longer.
const AHEAD_OF_DRAWING: usize = 4;

/// A place of a block that is brought into its order: which object is to have it, and where that was before.
#[derive(Debug)]
pub(crate) struct Seat {
    order: Order,
    pub(crate) before: usize,
    is_taken: bool,
}

/// One or more objects that go through the stages together: those that are advanced side by side one after the other.
///
/// What every other block asks first, in every frame, is in its first cache line; what is asked of its objects where
/// blocks are formed anew is in few.
#[derive(Default)]
#[repr(C, align(64))]
pub struct Block {
    /// Around all its objects that may interact; without a sphere if they are several.
    extent: Extent,
    groups: u32,
    /// The objects' numbers: all in few cache lines, which the objects are not.
    ids: Vec<ObjectId>,
    pub(crate) objects: Vec<Object>,
    extents: Extents,
    /// What the objects' updates take, in seconds.
    costs: Vec<f32>,
    /// What its last updates took.
    timings: Timings,
    /// Whether its objects may be in another order than theirs.
    disordered: bool,
}

impl Block {
    /// A block of these objects.
    #[must_use]
    pub fn new(mut objects: Vec<Object>) -> Self {
        objects.sort_by_cached_key(Order::of);
        let room = objects.capacity();
        let mut block = Self {
            objects,
            ids: Vec::with_capacity(room),
            extents: Extents::with_capacity(room),
            costs: Vec::with_capacity(room),
            ..Self::default()
        };
        block.refresh();
        block.list_costs();
        block
    }

    /// The objects.
    #[must_use]
    pub fn objects(&self) -> &[Object] {
        &self.objects
    }

    /// Their numbers.
    pub(crate) fn ids(&self) -> &[ObjectId] {
        &self.ids
    }

    /// The box around all its objects that may interact.
    #[must_use]
    #[inline]
    pub fn bounds(&self) -> Bounds {
        self.extent.bounds
    }

    /// The extent of its one object, or the box around all of several that may interact.
    #[inline]
    pub(crate) fn extent(&self) -> &Extent {
        &self.extent
    }

    /// The groups of its objects that may interact, a bit each; until the next update also of who has left.
    pub(crate) fn groups(&self) -> u32 {
        self.groups
    }

    /// Where each of its objects is, and what its update takes, in seconds.
    pub(crate) fn places(&self) -> impl Iterator<Item = (ObjectId, Vec3, f32)> {
        let known = self.ids.iter().zip(&self.costs).enumerate();
        known.map(|(place, (&id, &cost))| (id, self.extents.center(place), cost))
    }

    /// Moves the objects that are to leave to the end of `gone`.
    pub(crate) fn part_with(&mut self, leaves: impl Fn(ObjectId) -> bool, gone: &mut Vec<Object>) {
        for place in (0..self.ids.len()).rev() {
            if leaves(self.ids[place]) {
                gone.push(self.objects.swap_remove(place));
                self.ids.swap_remove(place);
                self.costs.swap_remove(place);
                self.extents.swap_remove(place);
                self.disordered = true;
            }
        }
    }

    /// Takes in one object more.
    pub(crate) fn take_in(&mut self, object: Object) {
        self.ids.push(object.id());
        self.costs.push(object.cost());
        self.extents.push(&object.interaction_extent());
        self.groups |= group_set(object.group());
        self.objects.push(object);
        self.disordered = true;
    }

    /// Brings its own extent up to date after objects may have come and gone; and has them, for all move, arranged anew by
    /// the next update.
    pub(crate) fn fit(&mut self) {
        self.extents.disarrange();
        if self.disordered {
            self.enclose();
        }
    }

    /// Adds what its update took in a frame that is timed.
    pub(crate) fn add_timing(&mut self, frame: u64, took: Duration) {
        if let Some(took) = self.timings.add(frame, took) {
            self.note_cost(took);
        }
    }

    /// Notes what its updates take. Now and then is also when their order is looked at anew: messages may have changed
    /// by what it is.
    pub(crate) fn note_cost(&mut self, took: Duration) {
        // Bodies that are advanced together have no time of their own.
        let share = took / self.objects.len().max(1) as u32;
        let weights = self.objects.iter().filter_map(batch::weight);
        let (bodies, total) = weights.fold((0.0, 0.0), |(n, sum), weight| (n + 1.0, sum + weight));
        for object in &mut self.objects {
            let part = batch::weight(object).map_or(1.0, |weight| weight * bodies / total);
            object.note_cost(share.mul_f32(part));
        }
        self.list_costs();
        self.disordered = true;
    }

    /// Brings the list of costs up to date with the objects.
    pub(crate) fn list_costs(&mut self) {
        self.costs.clear();
        self.costs.extend(self.objects.iter().map(Object::cost));
    }

    /// Brings its objects into their order, if they may be in another, and says then where each was before.
    pub(crate) fn put_in_order(&mut self, order: &mut Vec<Seat>) {
        order.clear();
        if !std::mem::take(&mut self.disordered) {
            return;
        }
        let seat = |(before, object)| Seat { order: Order::of(object), before, is_taken: false };
        order.extend(self.objects.iter().enumerate().map(seat));
        order.sort_unstable_by_key(|seat| seat.order);
        for first in 0..order.len() {
            // Round a cycle of those that take each other's seats; who had the first comes to the last.
            let mut place = first;
            while !std::mem::replace(&mut order[place].is_taken, true) {
                let from = order[place].before;
                if from != first {
                    self.objects.swap(place, from);
                }
                place = from;
            }
        }
        self.list_costs();
    }

    /// Asks for what the updates of the first objects change.
    pub(crate) fn prefetch_first(&self, simd: Simd) {
        self.objects.iter().take(AHEAD).for_each(|first| first.prefetch_parts(simd));
    }

    /// Asks for what the updates soon after that of the object at `place` change: with many objects that is in no near
    /// cache, and with several cores in another one's, too, where it interacted.
    pub(crate) fn prefetch_after(&self, place: usize, simd: Simd) {
        if let Some(later) = self.objects.get(place + 2 * AHEAD) {
            prefetch(later);
        }
        if let Some(later) = self.objects.get(place + AHEAD) {
            later.prefetch_parts(simd);
        }
    }

    /// Asks for what renderers read of the objects soon after the one at `place`: where all are updated before one is drawn, or
    /// are drawn by another core, that is in no near cache.
    pub(crate) fn prefetch_drawn_after(&self, place: usize) {
        if let Some(later) = self.objects.get(place + 2 * AHEAD_OF_DRAWING) {
            prefetch(later);
        }
        let later = self.objects.get(place + AHEAD_OF_DRAWING);
        if let Some(mesh) = later.and_then(|later| later.geometry.as_mesh()) {
            let [positions, _] = mesh.lines();
            prefetch(positions);
        }
    }

    /// Brings numbers, extents and groups up to date with the objects.
    pub(crate) fn refresh(&mut self) {
        self.ids.clear();
        self.ids.extend(self.objects.iter().map(Object::id));
        self.extents.resize(self.objects.len());
        self.extents.arrange(|place| self.objects[place].center());
        self.groups = 0;
        for (place, object) in self.objects.iter().enumerate() {
            let own = object.interaction_extent();
            self.extents.set(place, &own);
            if own.bounds != Bounds::EMPTY {
                self.groups |= group_set(object.group());
            }
        }
        self.enclose();
    }

    /// Sets its own extent by those of its objects.
    fn enclose(&mut self) {
        let bounds = self.extents.enclose();
        self.extent = if self.is_single() { self.extents.at(0) } else { Extent::of_box(bounds) };
    }

    /// Whether an object is among [`Block::objects`] at `place`.
    pub(crate) fn has_at(&self, place: usize, id: ObjectId) -> bool {
        self.ids.get(place) == Some(&id)
    }

    /// The object at `place`.
    pub(crate) fn member(&self, place: usize) -> Member<'_> {
        Member { object: &self.objects[place], place }
    }

    /// Whether it is one object, whose extent the block's is: there is no need to look further.
    fn is_single(&self) -> bool {
        self.ids.len() == 1
    }

    /// Whether the extent of any of its objects overlaps this one.
    pub(crate) fn reaches(&self, simd: Simd, extent: &Extent) -> bool {
        if self.is_single() {
            return self.extent.overlaps(extent);
        }
        simd.run(Reaches { extents: &self.extents, extent })
    }

    /// Adds the places of each of its objects and one of `other`'s whose extents overlap.
    pub(crate) fn overlaps(&self, simd: Simd, other: &Self, found: &mut Vec<[usize; 2]>) {
        if self.is_single() && other.is_single() {
            found.extend(self.extent.overlaps(&other.extent).then_some([0, 0]));
        } else {
            let (few, many, around) = (&self.extents, &other.extents, &other.extent);
            simd.run(Overlaps { few, many, around, found });
        }
    }

    /// Adds the places of every two of its objects whose extents overlap.
    pub(crate) fn overlaps_within(&self, simd: Simd, found: &mut Vec<[usize; 2]>) {
        simd.run(OverlapsWithin { extents: &self.extents, found });
    }
}

#[cfg(test)]
mod tests;
