//! Blocks of spatially close objects: the units that executors schedule.

use crate::geometry::{Bounds, LANES, Lanes};
use crate::interaction::group_set;
use crate::object::{Object, ObjectId};
use crate::simd::{Isa, Kernel, LaneSet, Simd, first_lanes, lanes};

/// One or more objects that go through the stages together, in ascending order of their numbers.
#[derive(Default)]
pub struct Block {
    pub(crate) objects: Vec<Object>,
    /// The objects' numbers: all in one or two cache lines, which the objects are not.
    ids: Vec<ObjectId>,
    boxes: Boxes,
    bounds: Option<Bounds>,
    groups: u32,
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
    pub fn bounds(&self) -> Bounds {
        self.bounds.unwrap_or(Bounds::EMPTY)
    }

    /// The groups of its objects that may interact, a bit each.
    pub(crate) fn groups(&self) -> u32 {
        self.groups
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
        self.bounds = Some(bounds);
    }

    /// Whether an object is among [`Block::objects`].
    pub(crate) fn has(&self, id: ObjectId) -> bool {
        self.ids.binary_search(&id).is_ok()
    }

    /// Whether the box of any of its objects overlaps `bounds`.
    pub(crate) fn reaches(&self, simd: Simd, bounds: &Bounds) -> bool {
        simd.run(Reaches { boxes: &self.boxes, bounds })
    }

    /// Adds the places of each of its objects and one of `other`'s whose boxes overlap.
    pub(crate) fn overlaps(&self, simd: Simd, other: &Self, found: &mut Vec<[usize; 2]>) {
        simd.run(Overlaps { few: &self.boxes, around: &other.bounds(), many: &other.boxes, found });
    }

    /// Adds the places of every two of its objects whose boxes overlap.
    pub(crate) fn overlaps_within(&self, simd: Simd, found: &mut Vec<[usize; 2]>) {
        simd.run(OverlapsWithin { boxes: &self.boxes, found });
    }
}

/// Bounding boxes in whole lanes, padded with empty ones.
#[derive(Default)]
pub(crate) struct Boxes {
    min: [Vec<Lanes>; 3],
    max: [Vec<Lanes>; 3],
    len: usize,
}

impl Boxes {
    /// Makes room for so many boxes; if there were as many before, they stay.
    fn resize(&mut self, len: usize) {
        if self.len == len {
            return;
        }
        let empty = [(&mut self.min, f32::INFINITY), (&mut self.max, f32::NEG_INFINITY)];
        for (components, nothing) in empty {
            for component in components {
                component.clear();
                component.resize(len.div_ceil(LANES), [nothing; LANES]);
            }
        }
        self.len = len;
    }

    fn set(&mut self, place: usize, bounds: &Bounds) {
        let (chunk, lane) = (place / LANES, place % LANES);
        for axis in 0..3 {
            self.min[axis][chunk][lane] = bounds.min[axis];
            self.max[axis][chunk][lane] = bounds.max[axis];
        }
    }

    /// The chunks of boxes.
    fn chunks(&self) -> usize {
        self.min[0].len()
    }

    /// The box at `place`.
    #[inline(always)]
    fn at(&self, place: usize) -> [[f32; 3]; 2] {
        let (chunk, lane) = (place / LANES, place % LANES);
        [&self.min, &self.max].map(|bounds| bounds.each_ref().map(|lanes| lanes[chunk][lane]))
    }

    /// Which boxes of a chunk overlap the one from `min` to `max`.
    #[inline(always)]
    fn hits<I: Isa>(&self, isa: I, chunk: usize, [min, max]: [[f32; 3]; 2]) -> LaneSet {
        let mut hits = LaneSet::MAX;
        for axis in 0..3 {
            let (low, high) = (isa.load(&self.min[axis][chunk]), isa.load(&self.max[axis][chunk]));
            hits &= isa.at_most(low, isa.splat(max[axis]));
            hits &= isa.at_most(isa.splat(min[axis]), high);
        }
        hits
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
        let bounds = [self.bounds.min.to_array(), self.bounds.max.to_array()];
        (0..self.boxes.chunks()).any(|chunk| self.boxes.hits(isa, chunk, bounds) != 0)
    }
}

/// The search for overlaps of the boxes of two blocks.
struct Overlaps<'a> {
    few: &'a Boxes,
    /// Around the boxes of the other block.
    around: &'a Bounds,
    many: &'a Boxes,
    found: &'a mut Vec<[usize; 2]>,
}

impl Kernel for Overlaps<'_> {
    type Output = ();

    #[inline(always)]
    fn run<I: Isa>(self, isa: I) {
        let Self { few, around, many, found } = self;
        let around = [around.min.to_array(), around.max.to_array()];
        for chunk in 0..few.chunks() {
            for lane in lanes(few.hits(isa, chunk, around)) {
                let place = chunk * LANES + lane;
                let one = few.at(place);
                for chunk in 0..many.chunks() {
                    let others = lanes(many.hits(isa, chunk, one));
                    found.extend(others.map(|lane| [place, chunk * LANES + lane]));
                }
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
            for chunk in first / LANES..boxes.chunks() {
                let start = chunk * LANES;
                let later = !first_lanes(first.saturating_sub(start));
                let others = lanes(boxes.hits(isa, chunk, one) & later);
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

    /// A box somewhere, or that of a solitary object, or a wall's.
    fn any_box() -> impl Strategy<Value = Bounds> {
        let place = || [-1.0_f32..1.0, -1.0..1.0, -1.0..1.0].prop_map(Vec3::from_array);
        prop_oneof![
            8 => (place(), place())
                .prop_map(|(min, size)| Bounds { min, max: min + 0.5 * size.abs() }),
            1 => Just(Bounds::EMPTY),
            1 => Just(Bounds::ALL),
        ]
    }

    /// A block of which only the boxes are looked at.
    fn block(all: &[Bounds]) -> Block {
        let mut block = Block::default();
        block.boxes.resize(all.len());
        all.iter().enumerate().for_each(|(place, own)| block.boxes.set(place, own));
        block.bounds = Some(all.iter().fold(Bounds::EMPTY, |whole, own| whole.union(own)));
        block
    }

    proptest! {
        #[test]
        fn every_overlap_is_found_once(few in vec(any_box(), 0..20), many in vec(any_box(), 0..40)) {
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
