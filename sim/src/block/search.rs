//! The searches for overlaps among the extents of blocks.

use super::extents::Extents;
use crate::geometry::{Extent, LANES};
use crate::simd::{Isa, Kernel, LaneSet, first_lanes, lanes};

/// The test whether any extent overlaps one.
pub(super) struct Reaches<'a> {
    pub(super) extents: &'a Extents,
    pub(super) extent: &'a Extent,
}

impl Kernel for Reaches<'_> {
    type Output = bool;

    #[inline(always)]
    fn run<I: Isa>(self, isa: I) -> bool {
        let Self { extents, extent } = self;
        for (group, around) in extents.around().iter().enumerate() {
            for chunk in lanes(around.hits(isa, &extent.bounds)) {
                if extents.chunks()[group * LANES + chunk].hits(isa, extent) != 0 {
                    return true;
                }
            }
        }
        false
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
        if few.len() == 1 {
            overlaps(isa, many, 0, 0, &few.at(0), found);
            return;
        }
        for (chunk, places) in few.chunks().iter().zip(few.places().chunks(LANES)) {
            for lane in lanes(chunk.hits(isa, around)) {
                overlaps(isa, many, 0, places[lane], &chunk.at(lane), found);
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
        for (lane, &place) in extents.places().iter().enumerate() {
            let one = extents.chunks()[lane / LANES].at(lane % LANES);
            // Each pair once: with those after it.
            overlaps(isa, extents, lane + 1, place, &one, found);
        }
    }
}

/// Adds `place` with the places of all in lanes from `first` on that overlap the extent `one`.
#[inline(always)]
fn overlaps<I: Isa>(
    isa: I,
    extents: &Extents,
    first: usize,
    place: u32,
    one: &Extent,
    found: &mut Vec<[usize; 2]>,
) {
    let first_chunk = first / LANES;
    for (group, around) in extents.around().iter().enumerate().skip(first_chunk / LANES) {
        let near = around.hits(isa, &one.bounds) & at_least(first_chunk, group * LANES);
        for chunk in lanes(near).map(|chunk| group * LANES + chunk) {
            let start = chunk * LANES;
            let others = lanes(extents.chunks()[chunk].hits(isa, one) & at_least(first, start));
            let place_of = |lane: usize| extents.places()[start + lane] as usize;
            found.extend(others.map(|lane| [place as usize, place_of(lane)]));
        }
    }
}

/// Of the lanes from number `start` on those whose number is `first` or greater.
#[inline(always)]
fn at_least(first: usize, start: usize) -> LaneSet {
    !first_lanes(first.saturating_sub(start))
}
