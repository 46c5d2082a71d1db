//! The largest connected part of the bone in an image.

/// The density from which on a voxel is bone, of 255.
const BONE: u8 = 128;

/// Voxels of bone next to each other along x.
struct Run {
    start: u32,
    end: u32,
    /// A run of the same part; itself if it stands for the part.
    parent: u32,
}

/// Empties all voxels but those of the largest part of bone, connected by faces, and the voxels around
/// it, whose density is part of its surface. So the holder of the head, the table, clips and noise go.
pub(super) fn keep_largest(densities: &mut [u8], dims: [u32; 3]) {
    let [wide, high, deep] = dims.map(|side| side as usize);
    let (mut runs, first) = runs(densities, wide);
    join(&mut runs, &first, high);
    let Some(largest) = largest(&runs) else { return };
    let mut kept = vec![false; densities.len()];
    for row in 0..high * deep {
        let (y, z) = (row % high, row / high);
        for run in first[row]..first[row + 1] {
            if root(&runs, run as u32) != largest {
                continue;
            }
            let Run { start, end, .. } = runs[run];
            let columns = (start as usize).saturating_sub(1)..(end as usize + 1).min(wide);
            for z in z.saturating_sub(1)..(z + 2).min(deep) {
                for y in y.saturating_sub(1)..(y + 2).min(high) {
                    let row = (z * high + y) * wide;
                    kept[row + columns.start..row + columns.end].fill(true);
                }
            }
        }
    }
    for (density, kept) in densities.iter_mut().zip(kept) {
        *density *= u8::from(kept);
    }
}

/// All runs, and the number of each row's first one.
fn runs(densities: &[u8], wide: usize) -> (Vec<Run>, Vec<usize>) {
    let (mut runs, mut first) = (Vec::new(), Vec::new());
    for row in densities.chunks_exact(wide) {
        first.push(runs.len());
        let mut x = 0;
        while let Some(gap) = row[x..].iter().position(|&density| density >= BONE) {
            let start = x + gap;
            let length = row[start..].iter().position(|&density| density < BONE);
            x = length.map_or(wide, |length| start + length);
            let parent = runs.len() as u32;
            runs.push(Run { start: start as u32, end: x as u32, parent });
        }
    }
    first.push(runs.len());
    (runs, first)
}

/// Joins runs that touch: those of rows next to each other in a slice, and in neighbouring slices.
fn join(runs: &mut [Run], first: &[usize], high: usize) {
    for row in 0..first.len() - 1 {
        let before = (row % high > 0).then(|| row - 1);
        for other in before.into_iter().chain(row.checked_sub(high)) {
            let (mut a, mut b) = (first[row], first[other]);
            while a < first[row + 1] && b < first[other + 1] {
                if runs[a].start < runs[b].end && runs[b].start < runs[a].end {
                    let [one, two] = [root(runs, a as u32), root(runs, b as u32)];
                    runs[one.max(two) as usize].parent = one.min(two);
                    runs[a].parent = one.min(two);
                }
                if runs[a].end < runs[b].end { a += 1 } else { b += 1 }
            }
        }
    }
}

fn root(runs: &[Run], mut run: u32) -> u32 {
    while runs[run as usize].parent != run {
        run = runs[run as usize].parent;
    }
    run
}

/// The run that stands for the part with the most voxels, the first of equals.
fn largest(runs: &[Run]) -> Option<u32> {
    let mut sizes = vec![0_u64; runs.len()];
    for (number, run) in runs.iter().enumerate() {
        sizes[root(runs, number as u32) as usize] += u64::from(run.end - run.start);
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
        keep_largest(&mut densities, [7, 6, 1]);
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
        keep_largest(&mut densities, [4, 2, 2]);
        let left: Vec<usize> = (0..16).filter(|&voxel| densities[voxel] > 0).collect();
        assert_eq!(left, [3, 11]);
        let mut none = vec![127; 8];
        keep_largest(&mut none, [2, 2, 2]);
        assert_eq!(none, [127; 8], "without bone there is nothing to choose");
    }
}
