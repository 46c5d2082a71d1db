//! A piece of skull without a CT: for pictures and tests.

use glam::Vec3;
use parry3d::math::Pose;

use super::random::SplitMix64;
use crate::geometry::{Volume, VolumeError};

/// The side of the cube that the piece lies in; usually 64 mm.
const SIDE: f32 = 0.064;
/// The radius of the round piece; usually 29 mm.
const RADIUS: f32 = 0.029;
/// The radius of the skull's outer surface; usually 85 mm.
const CURVATURE: f32 = 0.085;
/// How high over the cube's floor the piece is highest; usually 44 mm.
const TOP: f32 = 0.044;
/// The thickness of the skull; usually 7 mm.
const THICKNESS: f32 = 0.007;
/// The thickness of its dense outer layer; usually 1.9 mm.
const OUTER_TABLE: f32 = 0.001_9;
/// The thickness of its dense inner layer; usually 1.3 mm.
const INNER_TABLE: f32 = 0.001_3;
/// The width over which a table turns into the spongy layer; usually 0.6 mm.
const TRANSITION: f32 = 0.000_6;
/// The distance between the spongy layer's walls; usually about 2 mm.
const PORES: f32 = 0.002;

/// A round, curved piece of skull: two dense tables, and spongy diploe between them. It lies in a cube of
/// 64 mm and `side` voxels a side, its outer surface towards the cube's far z; `pose` is the volume's.
///
/// Built by sums, products, divisions and square roots only, so that it has the same bits on every
/// machine.
///
/// # Errors
/// No voxels, or too many.
pub fn bone_piece(side: u32, pose: Pose) -> Result<Volume, VolumeError> {
    let spacing = SIDE / side.max(1) as f32;
    let middle = Vec3::new(0.5 * SIDE, 0.5 * SIDE, TOP - CURVATURE);
    Volume::from_fn([side; 3], Vec3::splat(spacing), pose, |voxel| {
        let [x, y, z] = voxel.map(|index| (index as f32 + 0.5) * spacing);
        let from_middle = Vec3::new(x, y, z) - middle;
        let depth = CURVATURE - from_middle.length();
        let from_axis = (from_middle.x * from_middle.x + from_middle.y * from_middle.y).sqrt();
        let inside = depth.min(THICKNESS - depth).min(RADIUS - from_axis);
        let filled = ramp(inside, spacing);
        if filled > 0.0 {
            (255.0 * filled * hardness(Vec3::new(x, y, z), depth)).round() as u8
        } else {
            0
        }
    })
}

/// Drills a hole from `entry` (metres) along `direction`, `depth` metres deep at the tip, by a ball of
/// `radius` metres that is moved on by half a voxel at a time. Returns what was removed; 255 are a full
/// voxel. Without a direction or a depth there is no hole.
pub fn drill_burr_hole(
    volume: &mut Volume,
    entry: Vec3,
    direction: Vec3,
    radius: f32,
    depth: f32,
) -> u64 {
    let direction = direction.normalize_or_zero();
    if direction == Vec3::ZERO || depth.is_nan() || depth <= 0.0 {
        return 0;
    }
    let step = 0.5 * volume.spacing().min_element();
    // No hole is deeper than the volume.
    let steps = (depth.min(volume.extent().length()) / step) as u32;
    let tips = (0..=steps).map(|number| number as f32 * step);
    tips.map(|tip| {
        let center = entry + direction * (tip - radius);
        volume.remove(center, radius, |voxel| voxel.share(1.0))
    })
    .sum()
}

/// The density of the bone at a point so far below the outer surface, from 0 to 1.
fn hardness(point: Vec3, depth: f32) -> f32 {
    let into_diploe = (depth - OUTER_TABLE).min(THICKNESS - INNER_TABLE - depth);
    let spongy = ramp(into_diploe, TRANSITION);
    if spongy == 0.0 {
        return 1.0;
    }
    // The walls between pores are where the noise crosses its mean.
    let wall = ramp(0.12 - (noise(point / PORES) - 0.5).abs(), 0.12);
    1.0 - spongy * (1.0 - (0.1 + 0.8 * wall))
}

/// From 0 to 1 as `value` goes from −`width`/2 to `width`/2.
fn ramp(value: f32, width: f32) -> f32 {
    (0.5 + value / width).clamp(0.0, 1.0)
}

/// Random numbers in [0, 1) at whole-numbered, positive points, smoothly interpolated between them.
fn noise(at: Vec3) -> f32 {
    let low = at.floor();
    let share = at - low;
    let share = share * share * (Vec3::splat(3.0) - share * 2.0);
    let [x, y, z] = low.to_array().map(|value| value as u64);
    let value = |dx: u64, dy: u64, dz: u64| {
        let number = ((z + dz) << 42) | ((y + dy) << 21) | (x + dx);
        0.5 + 0.5 * SplitMix64::new(number).symmetric()
    };
    let between = |from: f32, to: f32, share: f32| from + (to - from) * share;
    let row = |dy, dz| between(value(0, dy, dz), value(1, dy, dz), share.x);
    let slice = |dz| between(row(0, dz), row(1, dz), share.y);
    between(slice(0), slice(1), share.z)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The mean density, from 0 to 1, so far below the middle of the outer surface.
    fn mean_at(bone: &Volume, depth: f32) -> f32 {
        let points = (0..400).map(|i| Vec3::new((i % 20) as f32, (i / 20) as f32, 0.0) * 0.001);
        let densities = points.map(|point| {
            let from_axis = point - Vec3::new(0.0095, 0.0095, 0.0);
            let radius = CURVATURE - depth;
            let z = (radius * radius - from_axis.length_squared()).sqrt() - CURVATURE + TOP;
            bone.density_at(Vec3::new(0.032 + from_axis.x, 0.032 + from_axis.y, z))
        });
        densities.sum::<f32>() / 400.0
    }

    #[test]
    fn two_tables_and_diploe() {
        let bone = bone_piece(128, Pose::IDENTITY).expect("128 voxels are allowed");
        for (depth, least, most) in [
            (-0.001, 0.0, 0.0),
            (0.000_9, 0.99, 1.0),
            (0.003_5, 0.3, 0.6),
            (0.006_3, 0.9, 1.0),
            (0.008, 0.0, 0.0),
        ] {
            let mean = mean_at(&bone, depth);
            assert!((least..=most).contains(&mean), "{mean} at {depth} m");
        }
    }

    #[test]
    fn the_same_bits_on_every_machine() {
        let bone = bone_piece(64, Pose::IDENTITY).expect("64 voxels are allowed");
        assert_eq!(bone.digest(), 3_919_982_279_895_259_572);
    }

    #[test]
    fn a_burr_hole_goes_through() {
        let mut bone = bone_piece(128, Pose::IDENTITY).expect("128 voxels are allowed");
        let top = Vec3::new(0.032, 0.032, TOP);
        let hole = |bone: &mut Volume, depth| drill_burr_hole(bone, top, Vec3::NEG_Z, 0.005, depth);
        let half = hole(&mut bone, 0.003_5);
        assert!(bone.density_at(top - Vec3::Z * 0.001) == 0.0);
        assert!(bone.density_at(top - Vec3::Z * 0.006) > 0.5);
        let rest = hole(&mut bone, 0.02);
        assert!((0..70).all(|i| bone.density_at(top - Vec3::Z * (i as f32 * 1e-4)) == 0.0));
        // The wall is where the radius says, to half a voxel.
        let wall = |from_axis: f32| bone.density_at(top + Vec3::new(from_axis, 0.0, -0.001_2));
        assert!(wall(0.004_75) < 0.5 && wall(0.005_5) > 0.5);
        let cut = (half + rest) as f32 / 255.0 * 0.000_5_f32.powi(3);
        let cylinder = std::f32::consts::PI * 0.005 * 0.005 * THICKNESS;
        assert!((0.6..1.1).contains(&(cut / cylinder)), "{cut} m³ of {cylinder}");
    }

    #[test]
    fn a_hole_that_is_none() {
        let mut bone = bone_piece(16, Pose::IDENTITY).expect("16 voxels are allowed");
        let before = bone.digest();
        let top = Vec3::new(0.032, 0.032, TOP);
        for (direction, radius, depth) in [
            (Vec3::NEG_Z, 0.01, f32::NEG_INFINITY),
            (Vec3::NEG_Z, 0.01, 0.0),
            (Vec3::NEG_Z, 0.01, f32::NAN),
            (Vec3::NAN, 0.01, 0.01),
            (Vec3::ZERO, 0.01, 0.01),
            (Vec3::NEG_Z, f32::NAN, 1.0),
        ] {
            assert_eq!(drill_burr_hole(&mut bone, top, direction, radius, depth), 0);
        }
        assert_eq!(bone.digest(), before);
        assert_ne!(drill_burr_hole(&mut bone, top, Vec3::NEG_Z, 0.01, 0.01), 0);
    }
}
