//! A head without a patient.

use glam::{DAffine3, DMat3, DVec3, Vec3};
use rayon::prelude::*;

use crate::image::{AIR, Grid, Image, ImageError};
use crate::mix::mix;
use crate::parallel::on_all_cores;

/// The distance between voxels, in millimetres; usually 1.5.
const VOXEL: f32 = 1.5;
/// The voxels from left to right, from the back to the front and from the base to the vertex.
const DIMS: [u32; 3] = [124, 142, 112];
/// The voxel in the middle of the cranium.
const MIDDLE: [f32; 3] = [61.5, 70.5, 53.5];
/// Half the cranium's width, length and height above and below its middle, in millimetres; usually
/// 68, 84, 70 and 66.
const HALF: [f32; 4] = [68.0, 84.0, 70.0, 66.0];
/// The thickness of the skull, in millimetres; usually 5, and 8 at the back.
const SKULL: [f32; 2] = [5.0, 8.0];
/// The thickness of the dense tables of the skull, in millimetres; usually 1.6.
const TABLE: f32 = 1.6;
/// The thickness of the scalp, in millimetres; usually 5.
const SCALP: f32 = 5.0;
/// How thick the temporal muscle is at most, in millimetres; usually 7.
const MUSCLE: f32 = 7.0;
/// The thickness of the fluid around the brain, in millimetres; usually 3.
const FLUID: f32 = 3.0;

/// Computed tomography of a head that is made of ellipsoids: a brain in its fluid, a skull of two tables
/// with diploe between them, thicker at the back, and a scalp, thicker over the temples' muscles.
///
/// 1.5 mm voxels, in the order and directions of the patient's axes. It takes sums, products,
/// quotients and square roots only, and so has the same bits on every machine.
///
/// # Errors
/// None that is known.
pub fn synthetic_ct() -> Result<Image, ImageError> {
    let spacing = f64::from(VOXEL) * 1e-3;
    let origin = DVec3::from(MIDDLE.map(|index| -f64::from(index) * spacing));
    let affine =
        DAffine3::from_mat3_translation(DMat3::from_diagonal(DVec3::splat(spacing)), origin);
    let grid = Grid::new(DIMS, affine)?;
    let [wide, high, _] = DIMS.map(|side| side as usize);
    let voxel = |number: usize| {
        let [x, y, z] = [number % wide, number / wide % high, number / (wide * high)];
        let noise = (mix(number as u64) >> 60) as f32 - 7.5;
        let index = Vec3::new(x as f32, y as f32, z as f32);
        (hounsfield((index - Vec3::from(MIDDLE)) * VOXEL) + 0.7 * noise) as i16
    };
    let voxels = on_all_cores(|| (0..grid.voxels()).into_par_iter().map(voxel).collect());
    Image::new(grid, voxels)
}

/// The Hounsfield number at a place seen from the cranium's middle, in millimetres.
fn hounsfield(place: Vec3) -> f32 {
    const BRAIN: f32 = 35.0;
    const WATER: f32 = 8.0;
    const COMPACT: f32 = 1_300.0;
    const DIPLOE: f32 = 480.0;
    const FAT_AND_SKIN: f32 = 15.0;
    let [width, length, above, below] = HALF;
    let half = Vec3::new(width, length, if place.z < 0.0 { below } else { above });
    let in_half = place / half;
    let reach = in_half.length();
    if reach < 0.9 {
        return BRAIN;
    }
    if reach > 1.45 {
        return f32::from(AIR);
    }
    // The distance from an ellipsoid, to the first order.
    let height = reach * (reach - 1.0) / (in_half / half).length();
    let direction = place / place.length();
    let back = (0.5 - 0.8 * direction.y).clamp(0.0, 1.0);
    let skull = SKULL[0] + (SKULL[1] - SKULL[0]) * back * back * (3.0 - 2.0 * back);
    let temple = Vec3::new(direction.x.abs() - 0.93, direction.y - 0.3, direction.z + 0.1);
    let muscle = (1.0 - temple.length_squared() / 0.2).max(0.0);
    let scalp = SCALP + MUSCLE * muscle * muscle;
    let mut number = BRAIN;
    // From the inside out: each layer covers those below it from its depth on.
    for (depth, layer) in [
        (-FLUID, WATER),
        (0.0, COMPACT),
        (TABLE, DIPLOE),
        (skull - TABLE, COMPACT),
        (skull, FAT_AND_SKIN),
        (skull + scalp, f32::from(AIR)),
    ] {
        let share = (0.5 + (height - depth) / VOXEL).clamp(0.0, 1.0);
        number += (layer - number) * share;
    }
    number
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn layers() {
        let at = |height: f32| hounsfield(Vec3::new(0.0, 0.0, HALF[2] + height));
        let cases = [(-10.0, 35.0), (-1.5, 8.0), (2.9, 480.0), (7.8, 15.0), (15.0, -1_000.0)];
        for (height, expected) in cases {
            assert!((at(height) - expected).abs() < 1.0, "{} HU at {height} mm", at(height));
        }
        assert!(at(0.8) > 1_200.0 && at(-4.0) < 36.0);
    }

    #[test]
    fn the_same_bits_on_every_machine() {
        let image = synthetic_ct().expect("its sizes are allowed");
        let digest = image.voxels().iter().enumerate().fold(0_u64, |sum, (number, &voxel)| {
            sum.wrapping_add((mix(number as u64) | 1).wrapping_mul(voxel as u64))
        });
        assert_eq!(digest, 15_109_032_177_943_110_270);
        // All of the head is in it.
        let [wide, high, _] = DIMS;
        let inside = |number: usize, side: u32| number > 0 && number + 1 < side as usize;
        for (number, &voxel) in image.voxels().iter().enumerate() {
            let (x, y) = (number % wide as usize, number / wide as usize % high as usize);
            assert!(voxel < -900 || inside(x, wide) && inside(y, high));
        }
    }
}
