use glam::Quat;
use parry3d::math::Pose;

use super::super::{Bit, Burr};
use super::*;

const SPACING: f32 = 5e-4;

fn elastic_force(radius: f32, depth: f32) -> f32 {
    Bit { radius, ..Bit::BURR }.elastic_force(depth)
}

/// Full bone below a plane through the middle of a turned and shifted grid, filled to the parts that the
/// plane leaves of each voxel, and the plane's outward normal.
fn half_space(normal: Vec3, offset: f32) -> Volume {
    let side = 40;
    let middle = Vec3::splat(side as f32 * 0.5 * SPACING);
    let rotation = Quat::from_rotation_x(0.3) * Quat::from_rotation_z(0.8);
    let pose = Pose::from_parts(Vec3::new(0.1, -0.2, 0.3), rotation);
    Volume::from_fn([side; 3], Vec3::splat(SPACING), pose, |voxel| {
        // Filled as far as 8³ points of it are below.
        let below = (0..512).filter(|number| {
            let at = |axis: usize| {
                let inside = (number >> (3 * axis) & 7) as f32 / 8.0 + 1.0 / 16.0;
                (voxel[axis] as f32 + inside) * SPACING
            };
            (Vec3::new(at(0), at(1), at(2)) - middle).dot(normal) < offset
        });
        (below.count() as f32 * (255.0 / 512.0)).round() as u8
    })
    .expect("it is small")
}

fn directions() -> [Vec3; 5] {
    [
        Vec3::Z,
        Vec3::NEG_X,
        Vec3::new(1.0, 1.0, 0.0),
        Vec3::new(1.0, 2.0, -0.7),
        Vec3::new(-1.0, 1.0, 1.0),
    ]
    .map(Vec3::normalize)
}

/// The ball's middle so deep below the plane's surface, moved sideways by a share of a voxel.
fn center(volume: &Volume, normal: Vec3, offset: f32, radius: f32, depth: f32, shift: f32) -> Vec3 {
    let aside = normal.any_orthonormal_vector() * (shift * SPACING);
    let local = volume.extent() * 0.5 + normal * (offset + radius - depth) + aside;
    volume.to_world(local)
}

fn burr(center: Vec3, radius: f32, side: Option<Side>) -> Burr {
    let bit = Bit { radius, tip_radius: 0.5 * radius, ..Bit::BURR };
    Burr { bit, center, axis: Vec3::Z, spin: 0.0, side }
}

fn force(volume: &Volume, center: Vec3, radius: f32) -> Vec3 {
    let overlap = Overlap::new(volume, &burr(center, radius, None), center);
    overlap.normal.map_or(Vec3::ZERO, |normal| normal * elastic_force(radius, overlap.depth))
}

/// Bar: within 10 % of the analytic overlap integral from a voxel's depth on, up to where the ball is half
/// inside.
#[test]
fn the_force_is_that_of_the_analytic_integral() {
    for radius in [3e-3_f32, 1.2e-3, 1.5e-3, 2e-3, 5.5e-3] {
        let mut worst = (0.0_f32, 0.0_f32);
        for (number, normal) in directions().into_iter().enumerate() {
            let offset = [0.0, 0.13, 0.25, 0.4, -0.3][number] * SPACING;
            let volume = half_space(normal, offset);
            let depths = [0.5e-3_f32, 0.62e-3, 0.75e-3, 1e-3, 1.2e-3, 1.27e-3, 1.4e-3];
            for depth in depths.into_iter().filter(|&depth| depth <= radius) {
                for shift in [0.0, 0.3, 0.5, 0.8] {
                    let at = center(&volume, normal, offset, radius, depth, shift);
                    let expected = volume.turned(normal) * elastic_force(radius, depth);
                    let found = force(&volume, at, radius);
                    worst.0 = worst.0.max((found.length() / expected.length() - 1.0).abs());
                    worst.1 = worst.1.max((found - expected).length() / expected.length());
                }
            }
        }
        println!("{worst:?} at {radius} m");
        assert!(worst.1 < 0.1, "{worst:?} at {radius} m");
    }
}

#[test]
fn the_height_of_a_cap() {
    let volume = |height: f64| PI * height * height * (3e-3 - height / 3.0);
    for height in [1.5e-3, 2.2e-3, 2.9e-3, 3e-3] {
        let found = cap_height(volume(height), 3e-3);
        assert!((found - height).abs() < 3e-7, "{found} of {height}");
    }
    // More than half a ball.
    assert!((cap_height(volume(4e-3), 3e-3) - 3e-3).abs() < 1e-12);
}

/// Bar: no step above 2 % of the force at 1 mm in 5 µm of travel.
#[test]
fn the_force_has_no_steps() {
    const TRAVEL: f32 = 5e-6;
    for radius in [3e-3_f32, 1.2e-3, 1.5e-3] {
        let mut worst = 0.0_f32;
        let whole = elastic_force(radius, 1e-3);
        for (number, normal) in directions().into_iter().enumerate() {
            let offset = [0.0, 0.13, 0.25, 0.4, -0.3][number] * SPACING;
            let volume = half_space(normal, offset);
            for shift in [0.0, 0.45] {
                let at = |depth| {
                    force(&volume, center(&volume, normal, offset, radius, depth, shift), radius)
                };
                let mut before = at(-0.5e-3);
                for step in 1..=340 {
                    let now = at(-0.5e-3 + step as f32 * TRAVEL);
                    worst = worst.max((now - before).length() / whole);
                    before = now;
                }
                // Along the surface.
                let aside = normal.any_orthonormal_vector();
                let start = center(&volume, normal, offset, radius, 1e-3, shift);
                let mut before = force(&volume, start, radius);
                for step in 1..=200 {
                    let along = volume.turned(aside) * (step as f32 * TRAVEL);
                    let now = force(&volume, start + along, radius);
                    worst = worst.max((now - before).length() / whole);
                    before = now;
                }
            }
        }
        println!("{worst} at {radius} m");
        assert!(worst < 0.02, "{worst} at {radius} m");
    }
}

/// |M1| of a part of a ball by summing slices of it.
#[test]
fn depth_of_a_half_space() {
    let radius = 3e-3_f64;
    for depth in [1e-5_f64, 1e-3, 2.9e-3, 3e-3] {
        let steps = 100_000;
        let slice = depth / f64::from(steps);
        let moment: f64 = (0..steps)
            .map(|step| {
                let from_middle = radius - depth + (f64::from(step) + 0.5) * slice;
                PI * (radius * radius - from_middle * from_middle) * from_middle * slice
            })
            .sum();
        let found = f64::from(half_space_depth(moment, radius as f32));
        assert!((found - depth).abs() < 1e-3 * depth + 1e-7, "{found} of {depth}");
    }
    assert_eq!(half_space_depth(1.0, 3e-3), 3e-3);
    assert_eq!(half_space_depth(0.0, 3e-3), 0.0);
    let ten = elastic_force(Bit::BURR.radius, 0.57e-3);
    let twenty = elastic_force(Bit::BURR.radius, 0.91e-3);
    assert!((ten - 10.0).abs() < 0.2 && (twenty - 20.0).abs() < 0.2, "{ten} N, {twenty} N");
}

/// A wall of 2 mm that a ball of 3 mm is pushed through, with and without the side it came from.
#[test]
fn a_thin_wall_pushes_back_to_the_side_that_the_bit_came_from() {
    let wall = |voxel: [u32; 3]| if (18..22).contains(&voxel[2]) { 255 } else { 0 };
    let volume =
        Volume::from_fn([40; 3], Vec3::splat(SPACING), Pose::IDENTITY, wall).expect("small");
    let (mut side, mut before) = (None, None);
    for step in 0..400 {
        let height = 3e-3 - step as f32 * 15e-6;
        let at = volume.center() + Vec3::Z * height;
        let overlap = Overlap::new(&volume, &burr(at, 3e-3, side), at);
        let normal = overlap.normal.expect("it overlaps");
        assert!(normal.z > 0.99, "{normal} at {height} m");
        if height < -3e-4 {
            let alone = Overlap::new(&volume, &burr(at, 3e-3, None), at);
            assert!(alone.normal.expect("likewise").z < -0.99);
        }
        side = Some(Side { normal, is_inside: true });
        let push = elastic_force(3e-3, overlap.depth) * normal.z;
        assert!(push > 0.0, "it still touches at {height} m");
        let step = before.map_or(0.0, |before: f32| (push - before).abs());
        assert!(step < 0.1 * elastic_force(3e-3, 1e-3), "a step of {step} N at {height} m");
        before = Some(push);
    }
}

#[test]
fn nothing_where_there_is_no_bone() {
    let volume = half_space(Vec3::Z, 0.0);
    let far = volume.to_world(volume.extent() * Vec3::new(0.5, 0.5, 0.9));
    let side = Some(Side { normal: Vec3::X, is_inside: true });
    for center in [far, Vec3::NAN, Vec3::splat(9.0)] {
        let overlap = Overlap::new(&volume, &burr(center, 3e-3, side), center);
        assert_eq!(overlap, Overlap::default());
    }
}
