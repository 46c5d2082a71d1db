//! Blocks of spatially close objects: the units that executors schedule.

use crate::behavior::{Segment, Workspace};
use crate::geometry::{Bounds, LANES, Lanes};
use crate::interaction::{Contact, group_set};
use crate::object::{Object, ObjectId};
use crate::simd::{Isa, Kernel, LaneSet, Simd, first_lanes, lanes};

/// One or more objects that go through the stages together, in ascending order of their numbers.
#[derive(Default)]
pub struct Block {
    pub(crate) objects: Vec<Object>,
    pub(crate) boxes: Boxes,
    pub(crate) gathered: Gathered,
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

    /// Takes over a segment of this frame's interaction results. Before a block is updated it must be
    /// given all that concern its objects, in any order; others are ignored.
    pub fn receive(&mut self, segment: &[Contact]) {
        if segment.first().is_some_and(|record| self.find(record.object).is_some()) {
            self.gathered.push(segment);
        }
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

    /// The place of an object among [`Block::objects`].
    fn find(&self, id: ObjectId) -> Option<usize> {
        self.objects.binary_search_by_key(&id, Object::id).ok()
    }
}

/// Contact records of one object in one frame for which a block has room from the start; usually 96,
/// twice what the densest pile has, so that a frame need not allocate.
pub(crate) const CONTACTS_PER_OBJECT: usize = 96;
/// Other objects that one object touches at once, likewise; usually 24, twice the densest packing's.
const TOUCHED_PER_OBJECT: usize = 24;

/// Contacts of this frame's updates, collected from wherever interactions left them.
#[derive(Default)]
pub(crate) struct Gathered {
    pub(crate) records: Vec<Contact>,
    pub(crate) segments: Vec<Segment>,
    pub(crate) workspace: Workspace,
}

impl Gathered {
    /// Makes room for what so many objects like these usually have.
    pub(crate) fn reserve(&mut self, objects: &[Object], room: usize) {
        self.records.reserve(room * CONTACTS_PER_OBJECT);
        self.segments.reserve(room * TOUCHED_PER_OBJECT);
        self.workspace.reserve(objects, room);
    }

    pub(crate) fn clear(&mut self) {
        self.records.clear();
        self.segments.clear();
    }

    pub(crate) fn push(&mut self, segment: &[Contact]) {
        let Some(Contact { object, other, .. }) = segment.first().copied() else { return };
        let start = self.records.len();
        self.records.extend_from_slice(segment);
        self.segments.push(Segment { object, other, start, end: self.records.len() });
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
