//! The integrals over the bone that a ball overlaps.

use std::f64::consts::FRAC_PI_4;

use glam::{DVec3, Vec3};

use super::Burr;
use crate::geometry::Volume;

/// The least depth of a bit that has touched, in metres; usually 1 µm: 0.7 mN on a ball of 3 mm. So a
/// tool knows that it still touches, and from which side, where nothing pushes it.
const LEAST_DEPTH: f32 = 1e-6;

/// What one of a bit's balls overlaps of a volume, by integrals of the density ρ (0 to 1) over the ball.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Overlap {
    /// M0 = ∫ ρ dV, in cubic metres of full bone.
    pub volume: f32,
    /// M1 = ∫ ρ r dV, for r from the ball's middle, in metres to the fourth, in the world's axes.
    pub moment: Vec3,
    /// How deep the ball would be in a flat half-space of full bone that gave the same |M1|, corrected for
    /// the voxels' size, in metres.
    pub depth: f32,
    /// The same for what of M1 is along the axis and within the tip's radius of it, without correction.
    pub tip_depth: f32,
    /// Where the bone pushes to: −M1/|M1|, of unit length; none where nothing touches.
    ///
    /// Never to the side opposite to the bit's [`Burr::side`]: then to that side as before. |M1| goes through
    /// 0 in the middle of a thin wall, so there the force has no step but a soft spot.
    pub normal: Option<Vec3>,
}

impl Overlap {
    /// Of the ball of a bit around a point, in metres.
    #[must_use]
    pub fn new(volume: &Volume, burr: &Burr, center: Vec3) -> Self {
        let (axis, tip) =
            (volume.turned_back(burr.axis).as_dvec3(), f64::from(burr.bit.tip_radius));
        let (mut mass, mut moment, mut tip_moment) = (0.0, DVec3::ZERO, 0.0);
        volume.visit(center, burr.bit.radius, |voxel| {
            if voxel.density > 0 {
                let part = f64::from(voxel.density) * f64::from(voxel.overlap);
                let offset = voxel.offset.as_dvec3();
                mass += part;
                moment += offset * part;
                if tip > 0.0 && offset.cross(axis).length_squared() < tip * tip {
                    tip_moment -= offset.dot(axis) * part;
                }
            }
        });
        if mass == 0.0 {
            return Self::default();
        }
        let unit = f64::from(volume.voxel_volume()) / 255.0;
        let towards = (-moment).try_normalize();
        let blur = blur(volume, towards.unwrap_or_default());
        let depth_of = |moment: f64| half_space_depth((moment * unit).max(0.0), burr.bit.radius);
        let depth = depth_of(moment.length());
        let depth = (depth * depth - blur).max(0.0).sqrt();
        let towards = towards.filter(|_| depth > 0.0).map(|out| volume.turned(out.as_vec3()));
        let against = |side: &Vec3| towards.is_none_or(|towards| towards.dot(*side) < 0.0);
        let normal = burr.side.filter(against).or(towards);
        Self {
            volume: (mass * unit) as f32,
            moment: volume.turned((moment * unit).as_vec3()),
            depth: if normal.is_some() { depth.max(LEAST_DEPTH) } else { 0.0 },
            tip_depth: depth_of(tip_moment),
            normal,
        }
    }
}

/// By how much voxels make the square of a depth too great, in square metres.
///
/// An edge blurred by a voxel has the variance Σ sᵢ² nᵢ² / 12 along a direction n, and |M1| goes with the
/// square of the depth, whose mean is too great by that much (Sheppard's correction for grouped data).
/// The ball's edge and the bone's are blurred both, but the bone's is not where it is a side of voxels: one
/// of the two is the mean of what there is, and leaves the least error.
fn blur(volume: &Volume, along: DVec3) -> f32 {
    let width = along.as_vec3() * volume.spacing();
    width.length_squared() / 12.0
}

/// How deep a ball of so many metres is in a flat half-space if |M1| is as given, in metres to the fourth:
/// |M1| = π/4·(2Rh − h²)² solved for h, from 0 to the radius. A half-space that holds more than half of
/// the ball gives the |M1| of its mirror image again, which is why a tool must feel its way in.
#[must_use]
pub fn half_space_depth(moment: f64, radius: f32) -> f32 {
    let radius = f64::from(radius);
    let square = (moment / FRAC_PI_4).sqrt().min(radius * radius);
    // R − √(R² − s), without the difference of two numbers that are nearly the same.
    (square / (radius + (radius * radius - square).sqrt())) as f32
}

#[cfg(test)]
#[path = "overlap_tests.rs"]
mod tests;
