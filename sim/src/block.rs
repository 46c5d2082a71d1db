//! Blocks of spatially close objects: the units that executors schedule.

use crate::geometry::{Bounds, LANES, Lanes};
use crate::interaction::group_set;
use crate::object::{Object, ObjectId};
use crate::simd::{Isa, Kernel, LaneSet, Simd, first_lanes, lanes};

/// One or more objects that go through the stages together, in ascending order of their numbers.
#[derive(Default)]
pub struct Block {
    pub(crate) objects: Vec<Object>,
    pub(crate) boxes: Boxes,
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

    /// Brings boxes and groups up to date with the objects.
    pub(crate) fn refresh(&mut self) {
        self.boxes.clear();
        self.groups = 0;
        let mut bounds = Bounds::EMPTY;
        for object in &self.objects {
            let own = object.interaction_bounds();
            self.boxes.push(&own);
            bounds = bounds.union(&own);
            if own != Bounds::EMPTY {
                self.groups |= group_set(object.group());
            }
        }
        self.bounds = Some(bounds);
    }

    /// Whether an object is among [`Block::objects`].
    pub(crate) fn has(&self, id: ObjectId) -> bool {
        self.objects.binary_search_by_key(&id, Object::id).is_ok()
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
    fn clear(&mut self) {
        for component in self.min.iter_mut().chain(&mut self.max) {
            component.clear();
        }
        self.len = 0;
    }

    fn push(&mut self, bounds: &Bounds) {
        let (chunk, lane) = (self.len / LANES, self.len % LANES);
        for axis in 0..3 {
            if lane == 0 {
                self.min[axis].push([f32::INFINITY; LANES]);
                self.max[axis].push([f32::NEG_INFINITY; LANES]);
            }
            self.min[axis][chunk][lane] = bounds.min[axis];
            self.max[axis][chunk][lane] = bounds.max[axis];
        }
        self.len += 1;
    }

    /// The places, from `first` on, of the boxes that overlap `bounds`, in ascending order.
    pub(crate) fn overlapping(
        &self,
        simd: Simd,
        bounds: Bounds,
        first: usize,
    ) -> impl Iterator<Item = usize> + use<'_> {
        (first / LANES..self.min[0].len()).flat_map(move |chunk| {
            let hits = simd.run(Overlaps { boxes: self, chunk, bounds: &bounds });
            let start = chunk * LANES;
            let places = lanes(hits & !first_lanes(first.saturating_sub(start)));
            places.map(move |lane| start + lane)
        })
    }
}

/// The test of a chunk of boxes against one.
struct Overlaps<'a> {
    boxes: &'a Boxes,
    chunk: usize,
    bounds: &'a Bounds,
}

impl Kernel for Overlaps<'_> {
    type Output = LaneSet;

    #[inline(always)]
    fn run<I: Isa>(self, isa: I) -> LaneSet {
        let Self { boxes: Boxes { min, max, .. }, chunk, bounds } = self;
        let mut hits = LaneSet::MAX;
        for axis in 0..3 {
            let (low, high) = (isa.load(&min[axis][chunk]), isa.load(&max[axis][chunk]));
            hits &= isa.at_most(low, isa.splat(bounds.max[axis]));
            hits &= isa.at_most(isa.splat(bounds.min[axis]), high);
        }
        hits
    }
}
