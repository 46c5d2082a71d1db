//! The integrals over the bone that a ball overlaps.

use std::f64::consts::{FRAC_PI_4, PI};

use glam::{DVec3, Vec3};

use super::{Burr, Side};
use crate::geometry::Volume;

/// The least depth of a bit that has touched, in metres; usually 1 µm: 0.7 mN on a ball of 3 mm. So a
/// tool knows that it still touches, and from which side, where nothing pushes it.
const LEAST_DEPTH: f32 = 1e-6;

/// The shares of the greatest |M1| that a half-space can give between which the volume takes over from |M1|;
/// usually 0.8 to 0.95, depths of 0.67 to 0.84 radii.
const NEARLY_HALF: [f64; 2] = [0.8, 0.95];

/// What one of a bit's balls overlaps of a volume, by integrals of the density ρ (0 to 1) over the ball.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Overlap {
    /// M0 = ∫ ρ dV, in cubic metres of full bone.
    pub volume: f32,
    /// M1 = ∫ ρ r dV, for r from the ball's middle, in metres to the fourth, in the world's axes.
    pub moment: Vec3,
    /// How deep the ball would be in a flat half-space of full bone that gave the same |M1|, corrected for
    /// the voxels' size, in metres. Where |M1| is nearly the greatest that there is and says little about
    /// depths, M0 says how deep.
    pub depth: f32,
    /// The same for what of M1 is along the axis and within the tip's radius of it, without correction.
    pub tip_depth: f32,
    /// Where the bone pushes to: −M1/|M1|, of unit length; none where nothing touches.
    ///
    /// From inside never to the side opposite to the bit's [`Burr::side`]: then to that side as before. |M1| goes
    /// through 0 in the middle of a thin wall, so there the force has no step but a soft spot.
    pub normal: Option<Vec3>,
}

impl Overlap {
    /// Of the ball of a bit around a point, in metres.
    #[must_use]
    pub fn new(volume: &Volume, burr: &Burr, center: Vec3) -> Self {
        let (axis, tip) =
            (volume.turned_back(burr.axis).as_dvec3(), f64::from(burr.bit.tip_radius));
        let (mut mass, mut edge, mut moment, mut tip_moment) = (0.0, 0.0, DVec3::ZERO, 0.0);
        volume.visit(center, burr.bit.radius, |voxel| {
            if voxel.density > 0 {
                let part = f64::from(voxel.density) * f64::from(voxel.overlap);
                let offset = voxel.offset.as_dvec3();
                mass += part;
                edge += part * f64::from(255 - voxel.density);
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
        let width = towards.unwrap_or_default().as_vec3() * volume.spacing();
        let sums = Sums {
            mass: mass * unit,
            edge: edge * unit / 255.0,
            moment: moment.length() * unit,
            width: f64::from(width.length()),
        };
        let depth = sums.depth(burr.bit.radius);
        let towards = towards.filter(|_| depth > 0.0).map(|out| volume.turned(out.as_vec3()));
        let against = |side: &Side| {
            towards.is_none_or(|towards| side.is_inside && towards.dot(side.normal) < 0.0)
        };
        let normal = burr.side.filter(against).map(|side| side.normal).or(towards);
        Self {
            volume: (mass * unit) as f32,
            moment: volume.turned((moment * unit).as_vec3()),
            depth: if normal.is_some() { depth.max(LEAST_DEPTH) } else { 0.0 },
            tip_depth: half_space_depth((tip_moment * unit).max(0.0), burr.bit.radius),
            normal,
        }
    }
}

/// What there is of bone in a ball.
struct Sums {
    /// M0, in cubic metres.
    mass: f64,
    /// ∫ ρ(1 − ρ) dV, in cubic metres: how much of it is edge.
    edge: f64,
    /// |M1|, in metres to the fourth.
    moment: f64,
    /// A voxel's width along M1, in metres.
    width: f64,
}

impl Sums {
    /// How deep a ball of so many metres would be in a flat half-space that gave them, in metres.
    fn depth(&self, radius: f32) -> f32 {
        let raw = f64::from(half_space_depth(self.moment, radius));
        let radius = f64::from(radius);
        let by_moment = (raw * raw - self.blur(PI * raw * (2.0 * radius - raw))).max(0.0).sqrt();
        // |M1| has its maximum where the ball is half inside.
        let [begins, ends] = NEARLY_HALF;
        let share = self.moment / (FRAC_PI_4 * radius * radius * radius * radius);
        let share = ((share - begins) / (ends - begins)).clamp(0.0, 1.0);
        if share == 0.0 {
            return by_moment as f32;
        }
        (by_moment + (cap_height(self.mass, radius) - by_moment) * share) as f32
    }

    /// By how much voxels make the square of a depth too great, in square metres, if the bone's surface
    /// within the ball has so many square metres.
    ///
    /// An edge blurred by a voxel of the width w has the variance w²/12 across, and |M1| goes with the square of
    /// the depth, whose mean is too great by that much (Sheppard's correction for grouped data). The ball's
    /// edge is blurred, and so is the bone's, but not where it is a side of voxels: of an edge that is blurred
    /// by all of a voxel, ∫ ρ(1 − ρ) dV is w/6 times its area.
    fn blur(&self, area: f64) -> f64 {
        // Without any area it is not a number, which gives way to the other.
        let bone = (6.0 * self.edge / (area * self.width)).min(1.0);
        self.width * self.width / 12.0 * (1.0 + bone)
    }
}

/// How high a cap of so many cubic metres of a ball of so many metres is, up to the ball's middle:
/// πh²(R − h/3) solved for h by Newton's method from there, for caps of more than half the radius to
/// within 10⁻⁴ of it.
fn cap_height(volume: f64, radius: f64) -> f64 {
    let wanted = (volume / PI).min(radius * radius * radius * (2.0 / 3.0));
    let step = |height: f64| {
        let excess = height * height * (radius - height / 3.0) - wanted;
        height - excess / (height * (2.0 * radius - height))
    };
    step(step(step(radius)))
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
