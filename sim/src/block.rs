//! Blocks of spatially close objects: the units that executors schedule.

use crate::geometry::{Bounds, LANES, Lanes};
use crate::interaction::{Member, group_set};
use crate::object::{Object, ObjectId};
use crate::simd::{Isa, Kernel, LaneSet, Simd, first_lanes, lanes};

/// One or more objects that go through the stages together, in ascending order of their numbers.
///
/// What every other block asks of it in every frame is in its first cache line.
#[derive(Default)]
#[repr(C, align(64))]
pub struct Block {
    bounds: Bounds,
    groups: u32,
    /// The objects' numbers: all in few cache lines, which the objects are not.
    ids: Vec<ObjectId>,
    pub(crate) objects: Vec<Object>,
    boxes: Boxes,
}

impl Block {
    /// A block of these objects.
    #[must_use]
    pub fn new(mut objects: Vec<Object>) -> Self {
        objects.sort_unstable_by_key(Object::id);
        let mut block = Self { objects, ..Self::default() };
        block.refresh();
        block
    }

    /// The objects.
    #[must_use]
    pub fn objects(&self) -> &[Object] {
        &self.objects
    }

    /// The box around all its objects that may interact.
    #[must_use]
    #[inline]
    pub fn bounds(&self) -> Bounds {
        self.bounds
    }

    /// The groups of its objects that may interact, a bit each.
    pub(crate) fn groups(&self) -> u32 {
        self.groups
    }

    /// Makes room for so many objects in an empty block.
    pub(crate) fn reserve(&mut self, objects: usize) {
        self.objects.reserve(objects);
        self.ids.clear();
        self.ids.reserve(objects);
        self.boxes.reserve(objects);
    }

    /// Brings numbers, boxes and groups up to date with the objects.
    pub(crate) fn refresh(&mut self) {
        self.ids.clear();
        self.ids.extend(self.objects.iter().map(Object::id));
        self.boxes.resize(self.objects.len());
        self.groups = 0;
        let mut bounds = Bounds::EMPTY;
        for (place, object) in self.objects.iter().enumerate() {
            let own = object.interaction_bounds();
            self.boxes.set(place, &own);
            bounds = bounds.union(&own);
            if own != Bounds::EMPTY {
                self.groups |= group_set(object.group());
            }
        }
        self.bounds = bounds;
    }

    /// Whether an object is among [`Block::objects`] at `place`.
    pub(crate) fn has_at(&self, place: usize, id: ObjectId) -> bool {
        self.ids.get(place) == Some(&id)
    }

    /// The object at `place`.
    pub(crate) fn member(&self, place: usize) -> Member<'_> {
        Member { object: &self.objects[place], place }
    }

    /// Whether it is one object, whose box the block's is: there is no need to look further.
    fn is_single(&self) -> bool {
        self.ids.len() == 1
    }

    /// Whether the box of any of its objects overlaps `bounds`.
    pub(crate) fn reaches(&self, simd: Simd, bounds: &Bounds) -> bool {
        if self.is_single() {
            return self.bounds.overlaps(bounds);
        }
        simd.run(Reaches { boxes: &self.boxes, bounds })
    }

    /// Adds the places of each of its objects and one of `other`'s whose boxes overlap.
    pub(crate) fn overlaps(&self, simd: Simd, other: &Self, found: &mut Vec<[usize; 2]>) {
        if self.is_single() && other.is_single() {
            found.extend(self.bounds.overlaps(&other.bounds).then_some([0, 0]));
        } else {
            simd.run(Overlaps { few: self, many: other, found });
        }
    }

    /// Adds the places of every two of its objects whose boxes overlap.
    pub(crate) fn overlaps_within(&self, simd: Simd, found: &mut Vec<[usize; 2]>) {
        simd.run(OverlapsWithin { boxes: &self.boxes, found });
    }
}

/// Bounding boxes in whole lanes, padded with what is no box.
#[derive(Default)]
pub(crate) struct Boxes {
    chunks: Vec<BoxLanes>,
    len: usize,
}

/// The least and the greatest coordinates of as many boxes as there are lanes.
#[derive(Clone, Copy)]
#[repr(align(64))]
struct BoxLanes {
    min: [Lanes; 3],
    max: [Lanes; 3],
}

impl BoxLanes {
    /// NaNs, which no box overlaps: one without end would overlap the empty one.
    const NONE: Self = Self { min: [[f32::NAN; LANES]; 3], max: [[f32::NAN; LANES]; 3] };

    /// Which boxes overlap the one from `min` to `max`.
    #[inline(always)]
    fn hits<I: Isa>(&self, isa: I, [min, max]: [[f32; 3]; 2]) -> LaneSet {
        let mut hits = LaneSet::MAX;
        for axis in 0..3 {
            hits &= isa.at_most(isa.load(&self.min[axis]), isa.splat(max[axis]));
            hits &= isa.at_most(isa.splat(min[axis]), isa.load(&self.max[axis]));
        }
        hits
    }
}

impl Boxes {
    /// Makes room for so many boxes; if there were as many before, they stay.
    fn resize(&mut self, len: usize) {
        if self.len != len {
            self.chunks.clear();
            self.chunks.resize(len.div_ceil(LANES), BoxLanes::NONE);
            self.len = len;
        }
    }

    /// Makes room for so many boxes in all.
    fn reserve(&mut self, len: usize) {
        self.chunks.reserve(len.div_ceil(LANES).saturating_sub(self.chunks.len()));
    }

    fn set(&mut self, place: usize, bounds: &Bounds) {
        let (BoxLanes { min, max }, lane) = (&mut self.chunks[place / LANES], place % LANES);
        for axis in 0..3 {
            min[axis][lane] = bounds.min[axis];
            max[axis][lane] = bounds.max[axis];
        }
    }

    /// The box at `place`.
    #[inline(always)]
    fn at(&self, place: usize) -> [[f32; 3]; 2] {
        let (BoxLanes { min, max }, lane) = (&self.chunks[place / LANES], place % LANES);
        [min, max].map(|bounds| bounds.each_ref().map(|lanes| lanes[lane]))
    }

    /// Adds `place` with the places of all that overlap the box `one`.
    #[inline(always)]
    fn overlaps<I: Isa>(
        &self,
        isa: I,
        place: usize,
        one: [[f32; 3]; 2],
        found: &mut Vec<[usize; 2]>,
    ) {
        for (index, chunk) in self.chunks.iter().enumerate() {
            let others = lanes(chunk.hits(isa, one));
            found.extend(others.map(|lane| [place, index * LANES + lane]));
        }
    }
}

/// The test whether any box overlaps one.
struct Reaches<'a> {
    boxes: &'a Boxes,
    bounds: &'a Bounds,
}

impl Kernel for Reaches<'_> {
    type Output = bool;

    #[inline(always)]
    fn run<I: Isa>(self, isa: I) -> bool {
        let bounds = self.bounds.corners();
        self.boxes.chunks.iter().any(|chunk| chunk.hits(isa, bounds) != 0)
    }
}

/// The search for overlaps of the boxes of two blocks.
struct Overlaps<'a> {
    few: &'a Block,
    many: &'a Block,
    found: &'a mut Vec<[usize; 2]>,
}

impl Kernel for Overlaps<'_> {
    type Output = ();

    #[inline(always)]
    fn run<I: Isa>(self, isa: I) {
        let Self { few, many, found } = self;
        if few.is_single() {
            many.boxes.overlaps(isa, 0, few.bounds.corners(), found);
            return;
        }
        let around = many.bounds.corners();
        for (index, chunk) in few.boxes.chunks.iter().enumerate() {
            for place in lanes(chunk.hits(isa, around)).map(|lane| index * LANES + lane) {
                many.boxes.overlaps(isa, place, few.boxes.at(place), found);
            }
        }
    }
}

/// The search for overlaps of the boxes of one block.
struct OverlapsWithin<'a> {
    boxes: &'a Boxes,
    found: &'a mut Vec<[usize; 2]>,
}

impl Kernel for OverlapsWithin<'_> {
    type Output = ();

    #[inline(always)]
    fn run<I: Isa>(self, isa: I) {
        let Self { boxes, found } = self;
        for place in 0..boxes.len {
            let one = boxes.at(place);
            // Each pair once: with those after it.
            let first = place + 1;
            for (index, chunk) in boxes.chunks.iter().enumerate().skip(first / LANES) {
                let start = index * LANES;
                let later = !first_lanes(first.saturating_sub(start));
                let others = lanes(chunk.hits(isa, one) & later);
                found.extend(others.map(|lane| [place, start + lane]));
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec3;
    use proptest::collection::vec;
    use proptest::prelude::*;

    use super::*;

    /// A box somewhere, or that of a solitary object, or a wall's, or one without end.
    fn any_box() -> impl Strategy<Value = Bounds> {
        let place = || [-1.0_f32..1.0, -1.0..1.0, -1.0..1.0].prop_map(Vec3::from_array);
        prop_oneof![
            8 => (place(), place())
                .prop_map(|(min, size)| Bounds { min, max: min + 0.5 * size.abs() }),
            1 => Just(Bounds::EMPTY),
            1 => Just(Bounds::ALL),
            1 => Just(Bounds { min: Vec3::NEG_INFINITY, max: Vec3::INFINITY }),
        ]
    }

    /// One box, which is treated for itself, or fewer than `end`.
    fn boxes(end: usize) -> impl Strategy<Value = Vec<Bounds>> {
        prop_oneof![vec(any_box(), 1), vec(any_box(), 0..end)]
    }

    /// A block of which only the boxes are looked at.
    fn block(all: &[Bounds]) -> Block {
        let mut block = Block::default();
        block.ids.extend((0..all.len() as u32).map(ObjectId));
        block.boxes.resize(all.len());
        all.iter().enumerate().for_each(|(place, own)| block.boxes.set(place, own));
        block.bounds = all.iter().fold(Bounds::EMPTY, |whole, own| whole.union(own));
        block
    }

    proptest! {
        #[test]
        fn every_overlap_is_found_once(few in boxes(20), many in boxes(40)) {
            let pairs = |one: usize, others: std::ops::Range<usize>| others.map(move |other| [one, other]);
            let between: Vec<[usize; 2]> = (0..few.len())
                .flat_map(|one| pairs(one, 0..many.len()))
                .filter(|&[one, other]| few[one].overlaps(&many[other]))
                .collect();
            let within: Vec<[usize; 2]> = (0..many.len())
                .flat_map(|one| pairs(one, one + 1..many.len()))
                .filter(|&[one, other]| many[one].overlaps(&many[other]))
                .collect();
            let around = block(&many).bounds();
            let reaches = few.iter().any(|own| own.overlaps(&around));
            for simd in Simd::available() {
                let (mut found, mut found_within) = (Vec::new(), Vec::new());
                block(&few).overlaps(simd, &block(&many), &mut found);
                block(&many).overlaps_within(simd, &mut found_within);
                prop_assert_eq!(&found, &between);
                prop_assert_eq!(&found_within, &within);
                prop_assert_eq!(block(&few).reaches(simd, &around), reaches);
            }
        }
    }
}
