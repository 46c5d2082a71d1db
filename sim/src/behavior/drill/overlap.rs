//! The integrals over the bone that a ball overlaps.

use std::f64::consts::FRAC_PI_4;

use glam::{DVec3, Vec3};

use super::STIFFNESS;
use crate::geometry::Volume;

/// What a ball overlaps of a volume: integrals of the density ρ (0 to 1) over the ball.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Overlap {
    /// M0 = ∫ ρ dV, in cubic metres of full bone.
    pub volume: f32,
    /// M1 = ∫ ρ r dV, for r from the ball's middle, in metres to the fourth, in the world's axes.
    pub moment: Vec3,
    /// The part of M1 that is within the tip's radius of the axis.
    pub tip_moment: Vec3,
}

impl Overlap {
    /// Of a ball around a point; both in metres. The tip is what lies within `tip_radius` of an axis
    /// through the middle; 0 for none.
    #[must_use]
    pub fn new(volume: &Volume, center: Vec3, radius: f32, axis: Vec3, tip_radius: f32) -> Self {
        let (axis, tip) = (volume.turned_back(axis).as_dvec3(), f64::from(tip_radius));
        let (mut mass, mut moment, mut tip_moment) = (0.0, DVec3::ZERO, DVec3::ZERO);
        volume.visit(center, radius, |voxel| {
            if voxel.density > 0 {
                let part = f64::from(voxel.density) * f64::from(voxel.overlap);
                let offset = voxel.offset.as_dvec3();
                mass += part;
                moment += offset * part;
                if tip > 0.0 && offset.cross(axis).length_squared() < tip * tip {
                    tip_moment += offset * part;
                }
            }
        });
        let unit = f64::from(volume.voxel_volume()) / 255.0;
        let in_world = |vector: DVec3| volume.turned((vector * unit).as_vec3());
        let (moment, tip_moment) = (in_world(moment), in_world(tip_moment));
        Self { volume: (mass * unit) as f32, moment, tip_moment }
    }

    /// Where the bone pushes to: −M1/|M1|, of unit length. None where nothing is overlapped, or what is
    /// overlapped pushes to no side.
    ///
    /// With a `side`, the normal of the frame before, never to the side opposite to that: then to that side
    /// as before. |M1| goes through 0 in the middle of a thin wall, so there the force has no step but a
    /// soft spot.
    #[must_use]
    pub fn normal(&self, side: Option<Vec3>) -> Option<Vec3> {
        let normal = (-self.moment.as_dvec3()).try_normalize()?.as_vec3();
        Some(side.filter(|side| side.dot(normal) < 0.0).unwrap_or(normal))
    }

    /// How deep the ball would be in a flat half-space of full bone that gave the same |M1|, in metres.
    #[must_use]
    pub fn depth(&self, radius: f32) -> f32 {
        half_space_depth(self.moment.as_dvec3().length(), radius)
    }
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

/// The elastic force of bone on a ball so deep in it, in newtons: C1·R²·(h/R)^1.5. Radius and depth in
/// metres.
#[must_use]
pub fn elastic_force(radius: f32, depth: f32) -> f32 {
    let share = (depth / radius).max(0.0);
    STIFFNESS * radius * radius * share * share.sqrt()
}

#[cfg(test)]
#[path = "overlap_tests.rs"]
mod tests;
