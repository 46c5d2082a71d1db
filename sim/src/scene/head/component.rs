//! The largest connected part of the bone in an image.

use std::ops::Range;

use super::HeadError;
use crate::geometry::union::Union;

/// The density from which on a voxel is bone, of 255.
const BONE: u8 = 128;

/// Voxels of bone next to each other along x, row after row.
struct Runs {
    xs: Vec<Range<u32>>,
    /// The number of each row's first one, and that of all.
    first: Vec<usize>,
}

/// Empties all voxels but those of the largest part of bone, connected by faces, and the voxels around
/// it, whose density is part of its surface. So the holder of the head, the table, clips and noise go.
pub(super) fn keep_largest(densities: &mut [u8], dims: [u32; 3]) -> Result<(), HeadError> {
    let [wide, high, _] = dims.map(|side| side as usize);
    let runs = runs(densities, wide)?;
    let mut union = joined(&runs, high);
    let Some(largest) = largest(&runs, &mut union) else { return Ok(()) };
    let mut kept = vec![false; wide];
    for (row, densities) in densities.chunks_exact_mut(wide).enumerate() {
        kept.fill(false);
        for run in around(row, high, runs.first.len() - 1).flat_map(|row| runs.of(row)) {
            if union.root(run as u32) == largest {
                let Range { start, end } = runs.xs[run].clone();
                kept[(start as usize).saturating_sub(1)..wide.min(end as usize + 1)].fill(true);
            }
        }
        for (density, &kept) in densities.iter_mut().zip(&kept) {
            *density *= u8::from(kept);
        }
    }
    Ok(())
}

/// A row and those next to it, in its slice and in those before and behind.
fn around(row: usize, high: usize, rows: usize) -> impl Iterator<Item = usize> {
    let (y, z) = (row % high, row / high);
    let slices = z.saturating_sub(1)..(z + 2).min(rows / high);
    slices.flat_map(move |z| (y.saturating_sub(1)..(y + 2).min(high)).map(move |y| z * high + y))
}

impl Runs {
    fn of(&self, row: usize) -> Range<usize> {
        self.first[row]..self.first[row + 1]
    }
}

fn runs(densities: &[u8], wide: usize) -> Result<Runs, HeadError> {
    let mut runs = Runs { xs: Vec::new(), first: Vec::new() };
    for row in densities.chunks_exact(wide) {
        runs.first.push(runs.xs.len());
        let mut x = 0;
        while let Some(gap) = row[x..].iter().position(|&density| density >= BONE) {
            let start = x + gap;
            let length = row[start..].iter().position(|&density| density < BONE);
            x = length.map_or(wide, |length| start + length);
            if runs.xs.len() == HeadError::MAX_RUNS {
                return Err(HeadError::Runs);
            }
            runs.xs.push(start as u32..x as u32);
        }
    }
    runs.first.push(runs.xs.len());
    Ok(runs)
}

/// Joins runs that touch: those of rows next to each other in a slice, and in neighbouring slices.
fn joined(runs: &Runs, high: usize) -> Union {
    let mut union = Union::default();
    union.grow(runs.xs.len());
    for row in 0..runs.first.len() - 1 {
        let before = (row % high > 0).then(|| row - 1);
        for other in before.into_iter().chain(row.checked_sub(high)) {
            union.join_rows(|run| runs.xs[run].clone(), runs.of(row), runs.of(other));
        }
    }
    union
}

/// The run that stands for the part with the most voxels, the first of equals.
fn largest(runs: &Runs, union: &mut Union) -> Option<u32> {
    // An image has fewer voxels than 32 bits count.
    let mut sizes = vec![0_u32; runs.xs.len()];
    for (number, xs) in runs.xs.iter().enumerate() {
        sizes[union.root(number as u32) as usize] += xs.len() as u32;
    }
    let most = sizes.iter().copied().max()?;
    sizes.iter().position(|&size| size == most).map(|number| number as u32)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_largest_part_and_what_is_around_it() {
        // A U whose arms meet only in the last row, a dot beside it, and a haze of 9.
        let picture = [
            "#.#...#", //
            "#.#....", "#.#....", "###....", ".......", ".......",
        ];
        let value = |byte: &u8| if *byte == b'#' { 200 } else { 9 };
        let mut densities: Vec<u8> =
            picture.iter().flat_map(|row| row.as_bytes().iter().map(value)).collect();
        keep_largest(&mut densities, [7, 6, 1]).expect("few runs");
        let rows: Vec<&[u8]> = densities.chunks(7).collect();
        assert_eq!(rows[0], [200, 9, 200, 9, 0, 0, 0]);
        assert_eq!(rows[3], [200, 200, 200, 9, 0, 0, 0]);
        assert_eq!(rows[4], [9, 9, 9, 9, 0, 0, 0]);
        assert_eq!(rows[5], [0; 7]);
    }

    #[test]
    fn parts_across_slices() {
        // Two dots that touch by an edge only, and a pair that touches by a face.
        let mut densities = vec![0; 4 * 2 * 2];
        for voxel in [0, 9, 3, 11] {
            densities[voxel] = 255;
        }
        keep_largest(&mut densities, [4, 2, 2]).expect("few runs");
        let left: Vec<usize> = (0..16).filter(|&voxel| densities[voxel] > 0).collect();
        assert_eq!(left, [3, 11]);
        let mut none = vec![127; 8];
        keep_largest(&mut none, [2, 2, 2]).expect("few runs");
        assert_eq!(none, [127; 8], "without bone there is nothing to choose");
    }

    /// Bone in every other voxel, which gzip packs a thousandfold.
    #[test]
    fn more_runs_than_a_head_has_are_refused() {
        let dims = [512, 256, 257];
        let row = [255, 0].repeat(256);
        let mut densities = row.repeat(256 * 257);
        let before = densities.clone();
        let error = keep_largest(&mut densities, dims).expect_err("there are 65,536 too many");
        assert!(matches!(error, HeadError::Runs), "{error}");
        assert!(densities == before);
    }
}
