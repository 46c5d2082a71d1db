//! Boxes and spheres of a block's objects, side by side, and the searches among them.

use glam::Vec3;

use crate::geometry::{Bounds, Extent, LANES, Lanes, ROUNDING_MARGIN};
use crate::simd::{Isa, Kernel, LaneSet, first_lanes, lanes};

/// Extents in whole lanes, padded with what is none.
#[derive(Default)]
pub(super) struct Extents {
    chunks: Vec<ExtentLanes>,
    len: usize,
}

/// Boxes and spheres of as many objects as there are lanes.
#[derive(Clone, Copy)]
#[repr(align(64))]
struct ExtentLanes {
    min: [Lanes; 3],
    max: [Lanes; 3],
    center: [Lanes; 3],
    radius: Lanes,
}

impl ExtentLanes {
    /// As [`Extent::NONE`], in all lanes.
    const NONE: Self = {
        let none = [f32::NAN; LANES];
        Self { min: [none; 3], max: [none; 3], center: [none; 3], radius: none }
    };

    /// Which extents overlap this one; as [`Extent::overlaps`].
    #[inline(always)]
    fn hits<I: Isa>(&self, isa: I, one: &Extent) -> LaneSet {
        let mut hits = LaneSet::MAX;
        for axis in 0..3 {
            hits &= isa.at_most(isa.load(&self.min[axis]), isa.splat(one.bounds.max[axis]));
            hits &= isa.at_most(isa.splat(one.bounds.min[axis]), isa.load(&self.max[axis]));
        }
        if hits == 0 {
            return hits;
        }
        // Most boxes that overlap do so at a corner, where the spheres in them do not.
        let mut square = isa.splat(0.0);
        for axis in 0..3 {
            let way = isa.sub(isa.load(&self.center[axis]), isa.splat(one.center[axis]));
            square = isa.add(square, isa.mul(way, way));
        }
        let radii = isa.add(isa.load(&self.radius), isa.splat(one.radius));
        let reach = isa.mul(radii, isa.splat(ROUNDING_MARGIN));
        hits & isa.at_most(square, isa.mul(reach, reach))
    }
}

impl Extents {
    /// Makes room for so many extents; if there were as many before, they stay.
    pub(super) fn resize(&mut self, len: usize) {
        if self.len != len {
            self.chunks.clear();
            self.chunks.resize(len.div_ceil(LANES), ExtentLanes::NONE);
            self.len = len;
        }
    }

    /// None, with room for so many.
    pub(super) fn with_capacity(len: usize) -> Self {
        Self { chunks: Vec::with_capacity(len.div_ceil(LANES)), len: 0 }
    }

    pub(super) fn push(&mut self, extent: &Extent) {
        if self.len == self.chunks.len() * LANES {
            self.chunks.push(ExtentLanes::NONE);
        }
        self.len += 1;
        self.set(self.len - 1, extent);
    }

    /// Puts the last one to `place`, whose own is gone then.
    pub(super) fn swap_remove(&mut self, place: usize) {
        let last = self.len - 1;
        self.set(place, &self.at(last));
        self.set(last, &Extent::NONE);
        self.len = last;
        self.chunks.truncate(last.div_ceil(LANES));
    }

    pub(super) fn set(&mut self, place: usize, extent: &Extent) {
        let (chunk, lane) = (&mut self.chunks[place / LANES], place % LANES);
        for axis in 0..3 {
            chunk.min[axis][lane] = extent.bounds.min[axis];
            chunk.max[axis][lane] = extent.bounds.max[axis];
            chunk.center[axis][lane] = extent.center[axis];
        }
        chunk.radius[lane] = extent.radius;
    }

    /// The middle of what is at `place`.
    pub(super) fn center(&self, place: usize) -> Vec3 {
        let (chunk, lane) = (&self.chunks[place / LANES], place % LANES);
        Vec3::from_array([0, 1, 2].map(|axis| chunk.center[axis][lane]))
    }

    /// The extent at `place`.
    #[inline(always)]
    pub(super) fn at(&self, place: usize) -> Extent {
        let (chunk, lane) = (&self.chunks[place / LANES], place % LANES);
        let vector = |lanes: &[Lanes; 3]| Vec3::new(lanes[0][lane], lanes[1][lane], lanes[2][lane]);
        Extent {
            center: vector(&chunk.center),
            radius: chunk.radius[lane],
            ..Extent::of_box(Bounds { min: vector(&chunk.min), max: vector(&chunk.max) })
        }
    }

    /// Adds `place` with the places of all that overlap the extent `one`.
    #[inline(always)]
    fn overlaps<I: Isa>(&self, isa: I, place: usize, one: &Extent, found: &mut Vec<[usize; 2]>) {
        for (index, chunk) in self.chunks.iter().enumerate() {
            let others = lanes(chunk.hits(isa, one));
            found.extend(others.map(|lane| [place, index * LANES + lane]));
        }
    }
}

/// The test whether any extent overlaps one.
pub(super) struct Reaches<'a> {
    pub(super) extents: &'a Extents,
    pub(super) extent: &'a Extent,
}

impl Kernel for Reaches<'_> {
    type Output = bool;

    #[inline(always)]
    fn run<I: Isa>(self, isa: I) -> bool {
        self.extents.chunks.iter().any(|chunk| chunk.hits(isa, self.extent) != 0)
    }
}

/// The search for overlaps of the extents of two blocks.
pub(super) struct Overlaps<'a> {
    pub(super) few: &'a Extents,
    pub(super) many: &'a Extents,
    /// The box around those of `many`, or the only one.
    pub(super) around: &'a Extent,
    pub(super) found: &'a mut Vec<[usize; 2]>,
}

impl Kernel for Overlaps<'_> {
    type Output = ();

    #[inline(always)]
    fn run<I: Isa>(self, isa: I) {
        let Self { few, many, around, found } = self;
        if few.len == 1 {
            many.overlaps(isa, 0, &few.at(0), found);
            return;
        }
        for (index, chunk) in few.chunks.iter().enumerate() {
            for place in lanes(chunk.hits(isa, around)).map(|lane| index * LANES + lane) {
                many.overlaps(isa, place, &few.at(place), found);
            }
        }
    }
}

/// The search for overlaps of the extents of one block.
pub(super) struct OverlapsWithin<'a> {
    pub(super) extents: &'a Extents,
    pub(super) found: &'a mut Vec<[usize; 2]>,
}

impl Kernel for OverlapsWithin<'_> {
    type Output = ();

    #[inline(always)]
    fn run<I: Isa>(self, isa: I) {
        let Self { extents, found } = self;
        for place in 0..extents.len {
            let one = extents.at(place);
            // Each pair once: with those after it.
            let first = place + 1;
            for (index, chunk) in extents.chunks.iter().enumerate().skip(first / LANES) {
                let start = index * LANES;
                let later = !first_lanes(first.saturating_sub(start));
                let others = lanes(chunk.hits(isa, &one) & later);
                found.extend(others.map(|lane| [place, start + lane]));
            }
        }
    }
}
