//! Voxel bone as a surface for the proxy.

use std::f32::consts::PI;

use glam::{DVec3, Vec3};

use super::proxy::{REACH, Surface};
use crate::geometry::Volume;

/// The radius of the ball by which bone is felt, in voxels; usually 3: a normal is then true to a degree
/// or so, which differences from voxel to voxel are not.
const BALL: f32 = 3.0;
/// The share of the ball that must be bone, and must be none, to tell how far the surface is; usually
/// 0.001.
const LEAST_SHARE: f32 = 0.001;
/// Newton steps; usually 12.
const STEPS: usize = 12;

/// Voxel bone, whose surface is where half of a ball around a point is bone.
///
/// As long as the ball meets the surface, how much of it is bone says how far that is, and the centre of
/// mass where. Farther out it is looked for along the axes and the diagonals: the plane through the
/// nearest place where one of them meets bone stands for it. Where none does, and deep inside, nothing is
/// known but the side: the distance is infinite, and has no gradient.
impl Surface for Volume {
    fn distance(&self, point: Vec3) -> (f32, Vec3) {
        let Felt { radius, share, normal } = Felt::new(self, point);
        let seen = if share < LEAST_SHARE {
            nearest(self, point)
        } else if share > 1.0 - LEAST_SHARE {
            None
        } else {
            normal.map(|normal| (radius * half_space(share), normal))
        };
        seen.unwrap_or(((0.5 - share).signum() * f32::INFINITY, Vec3::ZERO))
    }
}

/// What a ball feels.
struct Felt {
    /// The ball's, in metres.
    radius: f32,
    /// How much of it is bone.
    share: f32,
    /// Away from the bone's centre of mass, of unit length.
    normal: Option<Vec3>,
}

impl Felt {
    fn new(bone: &Volume, point: Vec3) -> Self {
        let radius = BALL * bone.spacing().max_element();
        let (mut mass, mut moment) = (0.0, DVec3::ZERO);
        bone.visit(point, radius, |voxel| {
            let part = f64::from(voxel.density) * f64::from(voxel.overlap);
            mass += part;
            moment += voxel.offset.as_dvec3() * part;
        });
        let ball = f64::from(255.0 * 4.0 / 3.0 * PI * radius * radius * radius);
        let share = (mass * f64::from(bone.voxel_volume()) / ball) as f32;
        let normal = (-moment).try_normalize().map(|normal| bone.turned(normal.as_vec3()));
        Self { radius, share, normal }
    }
}

/// How far a ball's middle is outside a half-space that fills so much of the ball, as a share of its
/// radius: x³ − 3x + 2 = 4·share, solved by Newton's method.
fn half_space(share: f32) -> f32 {
    let mut x = 0.0_f32;
    for _ in 0..STEPS {
        let value = x * x * x - 3.0 * x + 2.0 - 4.0 * share;
        x = (x - value / (3.0 * x * x - 3.0)).clamp(-0.99, 0.99);
    }
    x
}

/// The plane of the surface that is nearest to a point outside: the distance to it, and its normal.
fn nearest(bone: &Volume, point: Vec3) -> Option<(f32, Vec3)> {
    let directions = (0..27).filter(|&number| number != 13).map(|number: i32| {
        let along = [number % 3 - 1, number / 3 % 3 - 1, number / 9 - 1];
        Vec3::from_array(along.map(|component| component as f32)).normalize()
    });
    let hit = |direction: Vec3| Some((bone.cast(point, direction, REACH)?, direction));
    let (way, direction) = directions.filter_map(hit).min_by(|a, b| a.0.total_cmp(&b.0))?;
    let place = point + direction * way;
    let normal = Felt::new(bone, place).normal.unwrap_or(-direction);
    Some(((point - place).dot(normal), normal))
}

#[cfg(test)]
mod tests {
    use glam::Quat;
    use parry3d::math::Pose;

    use super::*;

    /// A slab of bone up to y = 10 mm.
    fn slab() -> Volume {
        let filled = |[_, y, _]: [u32; 3]| if y < 10 { 255 } else { 0 };
        Volume::from_fn([40; 3], Vec3::splat(0.001), Pose::IDENTITY, filled).expect("small")
    }

    #[test]
    fn near_and_far_agree() {
        let slab = slab();
        for height in [-0.002, 0.000_1, 0.000_4, 0.002, 0.010, 0.0199] {
            for x in [0.0151, 0.02, 0.0234] {
                let (distance, normal) = slab.distance(Vec3::new(x, 0.01 + height, 0.02));
                assert!((distance - height).abs() < 2e-4, "{distance} at {height}");
                // Where the ball is all but full, voxels at its rim are much of what is not.
                let tolerance = if height < -0.001 { 0.1 } else { 0.015 };
                assert!(normal.distance(Vec3::Y) < tolerance, "{normal} at {height}");
            }
        }
    }

    #[test]
    fn a_turned_volume_is_felt_as_it_lies() {
        let mut slab = slab();
        let rotation = Quat::from_rotation_x(0.5) * Quat::from_rotation_z(0.3);
        slab.pose = Pose::from_parts(Vec3::new(0.3, -0.2, 0.1), rotation);
        let up = slab.turned(Vec3::Y);
        // Felt by a ball, and met by a ray.
        for height in [0.000_4, 0.010] {
            let place = slab.to_world(Vec3::new(0.02, 0.01 + height, 0.02));
            let (distance, normal) = slab.distance(place);
            assert!((distance - height).abs() < 5e-4, "{distance} at {height}");
            assert!(normal.distance(up) < 0.05, "{normal}, not {up} at {height}");
        }
    }

    #[test]
    fn out_of_reach_and_deep_inside_only_the_side_is_known() {
        let slab = slab();
        let out = slab.distance(Vec3::new(0.02, 0.035, 0.02));
        assert_eq!(out, (f32::INFINITY, Vec3::ZERO));
        let inside = slab.distance(Vec3::new(0.02, 0.004, 0.02));
        assert_eq!(inside, (f32::NEG_INFINITY, Vec3::ZERO));
    }
}
