//! Boxes and spheres of a block's objects, side by side: as many as there are lanes of those that are close in space, and
//! a box around them, so that most of a block is passed over at once by who looks for overlaps.

use glam::Vec3;

use crate::geometry::{Bounds, Extent, LANES, Lanes, ROUNDING_MARGIN};
use crate::simd::{Isa, LaneSet, fold_by};

/// Extents in whole lanes, padded with what is none.
#[derive(Default)]
pub(super) struct Extents {
    chunks: Vec<ExtentLanes>,
    /// The boxes around the chunks, themselves in lanes.
    around: Vec<BoxLanes>,
    /// In which lane of all each object is, by its place in the block.
    lane_of: Vec<u32>,
    /// The place of the object in each lane.
    place_of: Vec<u32>,
    /// Whether those of a chunk were close in space when that was last looked at.
    arranged: bool,
}

/// Boxes of as many objects, or chunks, as there are lanes.
#[derive(Clone, Copy)]
#[repr(align(64))]
pub(super) struct BoxLanes {
    min: [Lanes; 3],
    max: [Lanes; 3],
}

impl BoxLanes {
    /// As [`Extent::NONE`], in all lanes.
    const NONE: Self = Self { min: [NONE; 3], max: [NONE; 3] };

    /// Which boxes overlap this one; as [`Bounds::overlaps`].
    #[inline(always)]
    pub(super) fn hits<I: Isa>(&self, isa: I, one: &Bounds) -> LaneSet {
        let mut hits = LaneSet::MAX;
        for axis in 0..3 {
            hits &= isa.at_most(isa.load(&self.min[axis]), isa.splat(one.max[axis]));
            hits &= isa.at_most(isa.splat(one.min[axis]), isa.load(&self.max[axis]));
        }
        hits
    }

    fn set(&mut self, lane: usize, bounds: &Bounds) {
        for axis in 0..3 {
            self.min[axis][lane] = bounds.min[axis];
            self.max[axis][lane] = bounds.max[axis];
        }
    }

    #[inline(always)]
    fn at(&self, lane: usize) -> Bounds {
        let vector = |lanes: &[Lanes; 3]| Vec3::new(lanes[0][lane], lanes[1][lane], lanes[2][lane]);
        Bounds { min: vector(&self.min), max: vector(&self.max) }
    }

    /// The box around all of them.
    fn whole(&self) -> Bounds {
        // These pass over NaNs, which padding is made of.
        let [least, greatest] = [f32::min, f32::max];
        Bounds {
            min: Vec3::from_array(self.min.map(|lanes| fold_by(lanes, least))),
            max: Vec3::from_array(self.max.map(|lanes| fold_by(lanes, greatest))),
        }
    }
}

/// Boxes and spheres of as many objects as there are lanes.
#[derive(Clone, Copy)]
#[repr(align(64))]
pub(super) struct ExtentLanes {
    boxes: BoxLanes,
    center: [Lanes; 3],
    radius: Lanes,
}

/// In all lanes, what no comparison is true of.
const NONE: Lanes = [f32::NAN; LANES];

impl ExtentLanes {
    const NONE: Self = Self { boxes: BoxLanes::NONE, center: [NONE; 3], radius: NONE };

    /// Which extents overlap this one; as [`Extent::overlaps`].
    #[inline(always)]
    pub(super) fn hits<I: Isa>(&self, isa: I, one: &Extent) -> LaneSet {
        let hits = self.boxes.hits(isa, &one.bounds);
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

    fn set(&mut self, lane: usize, extent: &Extent) {
        self.boxes.set(lane, &extent.bounds);
        for axis in 0..3 {
            self.center[axis][lane] = extent.center[axis];
        }
        self.radius[lane] = extent.radius;
    }

    #[inline(always)]
    fn center(&self, lane: usize) -> Vec3 {
        Vec3::from_array([0, 1, 2].map(|axis| self.center[axis][lane]))
    }

    #[inline(always)]
    pub(super) fn at(&self, lane: usize) -> Extent {
        Extent {
            center: self.center(lane),
            radius: self.radius[lane],
            ..Extent::of_box(self.boxes.at(lane))
        }
    }
}

impl Extents {
    /// None, with room for so many.
    pub(super) fn with_capacity(len: usize) -> Self {
        let chunks = len.div_ceil(LANES);
        Self {
            chunks: Vec::with_capacity(chunks),
            around: Vec::with_capacity(chunks.div_ceil(LANES)),
            lane_of: Vec::with_capacity(len),
            place_of: Vec::with_capacity(len),
            arranged: false,
        }
    }

    /// Makes room for so many extents; if there were as many before, they stay.
    pub(super) fn resize(&mut self, len: usize) {
        if self.lane_of.len() != len {
            self.chunks.clear();
            self.chunks.resize(len.div_ceil(LANES), ExtentLanes::NONE);
            for list in [&mut self.lane_of, &mut self.place_of] {
                list.clear();
                list.extend(0..len as u32);
            }
            self.disarrange();
        }
    }

    pub(super) fn push(&mut self, extent: &Extent) {
        let len = self.lane_of.len();
        if len == self.chunks.len() * LANES {
            self.chunks.push(ExtentLanes::NONE);
        }
        self.lane_of.push(len as u32);
        self.place_of.push(len as u32);
        self.set(len, extent);
    }

    /// Puts the last one to `place`, whose own is gone then.
    pub(super) fn swap_remove(&mut self, place: usize) {
        let last = self.lane_of.len() - 1;
        // The object in the last lane comes to the free one, and the one at the last place to the free place.
        let free = self.lane_of[place] as usize;
        let moved = self.place_of[last] as usize;
        self.place_of.swap_remove(free);
        let extent = self.chunks[last / LANES].at(last % LANES);
        self.chunks[free / LANES].set(free % LANES, &extent);
        self.lane_of[moved] = free as u32;
        self.lane_of.swap_remove(place);
        if place < last {
            self.place_of[self.lane_of[place] as usize] = place as u32;
        }
        self.chunks[last / LANES].set(last % LANES, &Extent::NONE);
        self.chunks.truncate(last.div_ceil(LANES));
    }

    pub(super) fn set(&mut self, place: usize, extent: &Extent) {
        let lane = self.lane_of[place] as usize;
        self.chunks[lane / LANES].set(lane % LANES, extent);
    }

    /// The middle of what is at `place`.
    pub(super) fn center(&self, place: usize) -> Vec3 {
        let lane = self.lane_of[place] as usize;
        self.chunks[lane / LANES].center(lane % LANES)
    }

    /// The extent at `place`.
    #[inline(always)]
    pub(super) fn at(&self, place: usize) -> Extent {
        let lane = self.lane_of[place] as usize;
        self.chunks[lane / LANES].at(lane % LANES)
    }

    /// Brings the boxes around the chunks up to date with them. Returns the box around all.
    pub(super) fn enclose(&mut self) -> Bounds {
        self.around.clear();
        self.around.resize(self.chunks.len().div_ceil(LANES), BoxLanes::NONE);
        let mut all = Bounds::EMPTY;
        for (index, chunk) in self.chunks.iter().enumerate() {
            let whole = chunk.boxes.whole();
            self.around[index / LANES].set(index % LANES, &whole);
            all = all.union(&whole);
        }
        all
    }

    /// Notes that those of a chunk may be close in space no more: others have come, or all have moved.
    pub(super) fn disarrange(&mut self) {
        self.arranged = false;
    }

    /// Brings those that are close in space, by the middles of what is at each place, into one chunk, if that is to be done.
    /// The extents are to be set anew then.
    pub(super) fn arrange(&mut self, center: impl Fn(usize) -> Vec3) {
        if std::mem::replace(&mut self.arranged, true) {
            return;
        }
        gather(&mut self.place_of, &|place| center(place as usize));
        for (lane, &place) in self.place_of.iter().enumerate() {
            self.lane_of[place as usize] = lane as u32;
        }
    }

    /// How many there are.
    #[inline(always)]
    pub(super) fn len(&self) -> usize {
        self.lane_of.len()
    }

    /// Side by side.
    #[inline(always)]
    pub(super) fn chunks(&self) -> &[ExtentLanes] {
        &self.chunks
    }

    /// The boxes around the chunks, themselves in lanes.
    #[inline(always)]
    pub(super) fn around(&self) -> &[BoxLanes] {
        &self.around
    }

    /// The place of the object in each lane.
    #[inline(always)]
    pub(super) fn places(&self) -> &[u32] {
        &self.place_of
    }
}

/// Brings places that are close in space together: halves along the longest side, until each is a chunk.
fn gather(places: &mut [u32], center: &impl Fn(u32) -> Vec3) {
    if places.len() <= LANES {
        return;
    }
    let around = Bounds::around(places.iter().map(|&place| center(place)));
    let axis = (around.max - around.min).max_position();
    let middle = places.len().div_ceil(LANES) / 2 * LANES;
    let along = |place: &u32| center(*place)[axis];
    places.select_nth_unstable_by(middle, |a, b| along(a).total_cmp(&along(b)));
    let (low, high) = places.split_at_mut(middle);
    gather(low, center);
    gather(high, center);
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn ball(middle: Vec3) -> Extent {
        let bounds = Bounds { min: middle - 0.5, max: middle + 0.5 };
        Extent { center: middle, radius: 0.5, ..Extent::of_box(bounds) }
    }

    fn arranged(middles: &[Vec3]) -> Extents {
        let mut extents = Extents::with_capacity(middles.len());
        extents.resize(middles.len());
        extents.arrange(|place| middles[place]);
        for (place, &middle) in middles.iter().enumerate() {
            extents.set(place, &ball(middle));
        }
        extents
    }

    #[test]
    fn each_chunk_is_of_what_is_close() {
        // In a row, but anywhere in it: 37 and 100 have no common divisor.
        let middles: Vec<Vec3> =
            (0..100).map(|place| Vec3::Y * (place * 37 % 100) as f32).collect();
        let mut extents = arranged(&middles);
        let whole = extents.enclose();
        assert_eq!(whole, Bounds::around([Vec3::splat(-0.5), Vec3::new(0.5, 99.5, 0.5)]));
        let rows = extents.chunks().iter().map(|chunk| {
            let Bounds { min, max } = chunk.boxes.whole();
            max.y - min.y
        });
        assert_eq!(rows.collect::<Vec<_>>(), [16.0, 16.0, 16.0, 16.0, 16.0, 16.0, 4.0]);
    }

    #[test]
    fn an_order_stays_until_it_may_be_none() {
        let middle = |place: usize| Vec3::X * place as f32;
        let mut extents = arranged(&(0..32).map(middle).collect::<Vec<_>>());
        let is_in_low_half =
            |extents: &Extents| extents.places()[..LANES].iter().all(|&place| place < 16);
        for changed in [false, true] {
            extents.arrange(|place| middle(31 - place));
            assert_eq!(is_in_low_half(&extents), !changed);
            extents.disarrange();
        }
    }

    proptest! {
        #[test]
        fn whoever_comes_and_goes_is_found_at_its_place(
            places in prop::collection::vec(0..1_000_u16, 0..60),
            changes in prop::collection::vec(prop::option::of(0..1_000_usize), 0..80),
        ) {
            let middle = |x: u16| Vec3::new(f32::from(x), f32::from(x % 7), 0.0);
            let mut middles: Vec<Vec3> = places.into_iter().map(middle).collect();
            let mut extents = arranged(&middles);
            for change in changes {
                match change {
                    Some(place) if !middles.is_empty() => {
                        let place = place % middles.len();
                        middles.swap_remove(place);
                        extents.swap_remove(place);
                    }
                    _ => {
                        middles.push(middle(middles.len() as u16));
                        extents.push(&ball(middle(middles.len() as u16 - 1)));
                    }
                }
                prop_assert_eq!(extents.len(), middles.len());
                for (place, &middle) in middles.iter().enumerate() {
                    prop_assert_eq!(extents.at(place), ball(middle));
                    prop_assert_eq!(extents.center(place), middle);
                }
                let lanes = extents.chunks().iter().flat_map(|chunk| (0..LANES).map(|lane| chunk.at(lane)));
                let there = extents.places().iter().map(|&place| ball(middles[place as usize]));
                let (lanes, there): (Vec<Extent>, Vec<Extent>) = (lanes.collect(), there.collect());
                prop_assert_eq!(&lanes[..there.len()], &there[..]);
                prop_assert!(lanes[there.len()..].iter().all(|lane| lane.radius.is_nan()));
                let whole = Bounds::around(middles.iter().flat_map(|&middle| [middle - 0.5, middle + 0.5]));
                prop_assert_eq!(extents.enclose(), whole);
            }
        }
    }
}
