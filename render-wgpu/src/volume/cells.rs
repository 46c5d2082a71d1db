//! Where a volume is empty, in finer steps than bricks.

use dualframe_sim::geometry::{BRICK_SIDE, Brick};

/// The side of a cell, in voxels: half a brick's. Rays then skip to within a few voxels of a surface,
/// and cells are still few.
pub(super) const CELL: u32 = BRICK_SIDE / 2;

/// For each cell the greatest density that can be interpolated in it.
///
/// A cell goes from the middles of its own first voxels to those of the next cells' first ones, so
/// that whatever is interpolated in it lies between densities of its own block of voxels and of the first
/// layers of the next blocks.
pub(super) struct Cells {
    pub(super) counts: [u32; 3],
    pub(super) peaks: Vec<u8>,
    /// For each block its greatest densities: bit 0 of the index is set for its first layer along x
    /// alone, bits 1 and 2 likewise for y and z.
    blocks: Vec<[u8; 8]>,
    /// The blocks that changed: from, and up to.
    changed: [[u32; 3]; 2],
}

impl Cells {
    /// Those of an empty volume.
    pub(super) fn new(dims: [u32; 3]) -> Self {
        let counts = dims.map(|dim| dim.div_ceil(CELL));
        let all = counts.iter().map(|&count| count as usize).product();
        Self { counts, peaks: vec![0; all], blocks: vec![[0; 8]; all], changed: NONE }
    }

    /// Takes over a brick that changed.
    pub(super) fn take(&mut self, brick: &Brick<'_>) {
        let place = brick.place();
        for part in 0..8_u32 {
            let offset = [part & 1, part >> 1 & 1, part >> 2];
            let block: [u32; 3] = std::array::from_fn(|axis| 2 * place[axis] + offset[axis]);
            let Some(number) = self.number(block) else { continue };
            self.blocks[number] = block_peaks(brick, offset);
            let [from, to] = &mut self.changed;
            for axis in 0..3 {
                from[axis] = from[axis].min(block[axis]);
                to[axis] = to[axis].max(block[axis] + 1);
            }
        }
    }

    /// Brings the cells up to date with the bricks taken over.
    pub(super) fn refresh(&mut self) {
        let [from, to] = std::mem::replace(&mut self.changed, NONE);
        // A block's first layers count for the cells before it.
        let [xs, ys, zs] = [0, 1, 2].map(|axis| from[axis].saturating_sub(1)..to[axis]);
        for z in zs {
            for y in ys.clone() {
                for x in xs.clone() {
                    if let Some(number) = self.number([x, y, z]) {
                        self.peaks[number] = self.peak([x, y, z]);
                    }
                }
            }
        }
    }

    fn peak(&self, [x, y, z]: [u32; 3]) -> u8 {
        let layers = (0..8_u32).map(|part| {
            let block = [x + (part & 1), y + (part >> 1 & 1), z + (part >> 2)];
            self.number(block).map_or(0, |number| self.blocks[number][part as usize])
        });
        layers.fold(0, u8::max)
    }

    fn number(&self, [x, y, z]: [u32; 3]) -> Option<usize> {
        let [wide, high, deep] = self.counts;
        let inside = x < wide && y < high && z < deep;
        inside.then(|| ((z * high + y) * wide + x) as usize)
    }
}

/// No blocks.
const NONE: [[u32; 3]; 2] = [[u32::MAX; 3], [0; 3]];

fn block_peaks(brick: &Brick<'_>, [x, y, z]: [u32; 3]) -> [u8; 8] {
    let (rows, _) = brick.densities.as_chunks::<{ CELL as usize }>();
    let side = CELL as usize;
    let mut peaks = [0; 8];
    for slice in 0..side {
        for row in 0..side {
            // Two rows of a block are a brick's row.
            let [x, y, z] = [x, y, z].map(|offset| offset as usize);
            let number = ((z * side + slice) * BRICK_SIDE as usize + y * side + row) * 2 + x;
            let densities = &rows[number];
            let whole = densities.iter().fold(0, |peak, &density| density.max(peak));
            for (index, peak) in peaks.iter_mut().enumerate() {
                let counts = (index & 2 == 0 || row == 0) && (index & 4 == 0 || slice == 0);
                if counts {
                    *peak = (*peak).max(if index & 1 == 0 { whole } else { densities[0] });
                }
            }
        }
    }
    peaks
}

#[cfg(test)]
mod tests {
    use dualframe_sim::geometry::Volume;
    use glam::Vec3;
    use parry3d::math::Pose;

    use super::*;

    #[test]
    fn a_cell_knows_the_greatest_of_what_it_interpolates() {
        let dims = [37, 20, 33];
        let at = |[x, y, z]: [u32; 3]| {
            let mixed = (x * 31 + y * 57 + z * 91).wrapping_mul(2_654_435_761) >> 16;
            if mixed % 200 == 0 { mixed as u8 } else { 0 }
        };
        let mut volume = Volume::from_fn(dims, Vec3::ONE, Pose::IDENTITY, at).expect("small");
        let densities: Vec<u8> = volume.densities().collect();
        let mut cells = Cells::new(dims);
        let mut before = 0;
        for step in 0..3 {
            let news = volume.bricks().filter(|brick| brick.revision > before);
            news.for_each(|brick| cells.take(&brick));
            cells.refresh();
            let now: Vec<u8> = volume.densities().collect();
            assert_eq!(now == densities, step == 0);
            let [wide, high, deep] = dims;
            for (number, &peak) in cells.peaks.iter().enumerate() {
                let number = number as u32;
                let [counts_x, counts_y, _] = cells.counts;
                let cell = [
                    number % counts_x,
                    number / counts_x % counts_y,
                    number / (counts_x * counts_y),
                ];
                let mut expected = 0;
                for z in cell[2] * CELL..=(cell[2] * CELL + CELL).min(deep - 1) {
                    for y in cell[1] * CELL..=(cell[1] * CELL + CELL).min(high - 1) {
                        for x in cell[0] * CELL..=(cell[0] * CELL + CELL).min(wide - 1) {
                            expected = expected.max(now[((z * high + y) * wide + x) as usize]);
                        }
                    }
                }
                assert_eq!(peak, expected, "cell {cell:?} in step {step}");
            }
            before = volume.revision();
            volume.remove(Vec3::new(16.0 + step as f32, 10.0, 16.0), 5.0, |_| 255);
        }
    }
}
