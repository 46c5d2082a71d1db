//! The connected parts of a volume: what a closed cut has freed.
//!
//! Two passes over runs of solid voxels with [union–find](Union), in three dimensions.

use std::cmp::Reverse;
use std::ops::Range;

use super::Volume;
use crate::geometry::union::Union;

/// A voxel is solid from this density on, of 255; usually 128: one half, as for the surface.
const SOLID: u8 = 128;
/// The range of nothing, to be widened.
pub(super) const NOWHERE: Range<u32> = Range { start: u32::MAX, end: 0 };

/// Solid voxels that hang together by their faces.
#[derive(Clone, Debug)]
pub struct Part {
    voxels: u64,
    bounds: [Range<u32>; 3],
    touches_border: bool,
    runs: Vec<Run>,
}

/// Solid voxels side by side along x.
#[derive(Clone, Debug)]
pub(super) struct Run {
    pub(super) xs: Range<u32>,
    pub(super) y: u32,
    pub(super) z: u32,
}

impl Part {
    /// How many voxels it has that are at least half full.
    #[must_use]
    pub fn voxels(&self) -> u64 {
        self.voxels
    }

    /// The box around these, along x, y and z.
    #[must_use]
    pub fn bounds(&self) -> [Range<u32>; 3] {
        self.bounds.clone()
    }

    /// Whether it reaches to a side of the box that was searched, so that it may go on beyond; a side of
    /// the grid is one, where the box went on outside of it. A part that does not is free.
    #[must_use]
    pub fn touches_border(&self) -> bool {
        self.touches_border
    }

    pub(super) fn runs(&self) -> &[Run] {
        &self.runs
    }

    /// A part of nothing yet.
    fn new() -> Self {
        Self { voxels: 0, bounds: [NOWHERE; 3], touches_border: false, runs: Vec::new() }
    }

    fn push(&mut self, run: Run, within: &[Range<u32>; 3]) {
        self.voxels += run.xs.len() as u64;
        let own = [run.xs.clone(), run.y..run.y + 1, run.z..run.z + 1];
        for axis in 0..3 {
            let bounds = &mut self.bounds[axis];
            *bounds = bounds.start.min(own[axis].start)..bounds.end.max(own[axis].end);
            self.touches_border |= own[axis].start == within[axis].start;
            self.touches_border |= own[axis].end == within[axis].end;
        }
        self.runs.push(run);
    }
}

impl Volume {
    /// The connected parts of the solid voxels in a box of the grid, the largest first; among equals the
    /// one with the first voxel, x fastest. What of the box is outside the grid does not count.
    ///
    /// A voxel is solid if it is at least half full; two hang together if they share a face.
    #[must_use]
    pub fn parts(&self, within: [Range<u32>; 3]) -> Vec<Part> {
        let dims = self.dims();
        let within: [Range<u32>; 3] =
            std::array::from_fn(|axis| within[axis].start..within[axis].end.min(dims[axis]));
        if within.iter().any(Range::is_empty) {
            return Vec::new();
        }
        let (runs, mut union) = self.joined_runs(&within);
        let mut parts: Vec<Part> = Vec::new();
        let mut numbers = vec![u32::MAX; runs.len()];
        for (index, run) in runs.into_iter().enumerate() {
            let root = union.root(index as u32) as usize;
            if numbers[root] == u32::MAX {
                numbers[root] = parts.len() as u32;
                parts.push(Part::new());
            }
            parts[numbers[root] as usize].push(run, &within);
        }
        parts.sort_by_key(|part| Reverse(part.voxels));
        parts
    }

    /// The runs of solid voxels in a box, x fastest, and which of them hang together.
    fn joined_runs(&self, within: &[Range<u32>; 3]) -> (Vec<Run>, Union) {
        let (mut runs, mut union) = (Vec::new(), Union::default());
        // Where the rows of the slice before, and of this one, begin among the runs.
        let mut below: Vec<Range<usize>> = vec![0..0; within[1].len()];
        for z in within[2].clone() {
            let mut behind = 0..0;
            for (row, y) in within[1].clone().enumerate() {
                let first = runs.len();
                self.push_runs(within[0].clone(), y, z, &mut runs);
                let own = first..runs.len();
                union.grow(runs.len());
                for other in [behind, below[row].clone()] {
                    union.join_rows(|run| runs[run].xs.clone(), own.clone(), other);
                }
                below[row] = own.clone();
                behind = own;
            }
        }
        (runs, union)
    }

    /// Adds a row's runs of solid voxels.
    fn push_runs(&self, xs: Range<u32>, y: u32, z: u32, runs: &mut Vec<Run>) {
        let first = runs.len();
        for (start, densities) in self.bricks.row(xs, y, z) {
            for (x, _) in (start..).zip(densities).filter(|(_, density)| **density >= SOLID) {
                match runs[first..].last_mut() {
                    Some(run) if run.xs.end == x => run.xs.end += 1,
                    _ => runs.push(Run { xs: x..x + 1, y, z }),
                }
            }
        }
    }
}

#[cfg(test)]
#[path = "parts_tests.rs"]
mod tests;
