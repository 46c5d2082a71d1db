use std::time::Instant;

use glam::{Quat, Vec3};
use parry3d::math::Pose;

use super::super::VolumeError;
use super::super::bricks::boxed;
use super::*;
use crate::mix::mix;

fn whole(volume: &Volume) -> [Range<u32>; 3] {
    volume.dims().map(|dim| 0..dim)
}

fn mass(volume: &Volume) -> u64 {
    volume.densities().map(u64::from).sum()
}

/// Turned, moved, and of three different spacings.
fn build(dims: [u32; 3], density: impl FnMut([u32; 3]) -> u8) -> Volume {
    let rotation = Quat::from_rotation_y(0.4) * Quat::from_rotation_x(-1.1);
    let pose = Pose::from_parts(Vec3::new(0.1, -0.2, 0.3), rotation);
    Volume::from_fn(dims, Vec3::new(5e-4, 4e-4, 6e-4), pose, density).expect("it is small")
}

/// A plate of 60 × 60 × 10 voxels with a round cut of three voxels, 20 in radius, as wide in angle as given;
/// its edges are filled to parts.
fn plate(open: bool) -> Volume {
    build([60, 60, 14], |[x, y, z]| {
        if !(2..12).contains(&z) {
            return 0;
        }
        let (x, y) = (x as f32 - 29.5, y as f32 - 29.5);
        let from_cut = ((x * x + y * y).sqrt() - 20.0).abs();
        let bridge = open && y.abs() < 2.0 && x > 0.0;
        if bridge { 255 } else { (255.0 * (from_cut - 1.5 + 0.5).clamp(0.0, 1.0)) as u8 }
    })
}

#[test]
fn a_closed_cut_frees_one_disc() {
    let mut volume = plate(false);
    let (before, original) = (mass(&volume), volume.clone());
    let parts = volume.parts(whole(&volume));
    let free: Vec<&Part> = parts.iter().filter(|part| !part.touches_border()).collect();
    assert_eq!((parts.len(), free.len()), (2, 1), "the plate and the disc");
    let disc = free[0].clone();
    let area = disc.voxels() as f32 / 10.0;
    let expected = std::f32::consts::PI * 18.5 * 18.5;
    assert!((area / expected - 1.0).abs() < 0.02, "{area} voxels, {expected} expected");
    assert_eq!(disc.bounds()[2], 2..12);
    volume.velocity = Vec3::X;
    let piece = volume.split_off(&disc).expect("its own part");
    assert_eq!(piece.velocity, volume.velocity, "it moves on as it did");
    assert_eq!(mass(&volume) + mass(&piece), before, "nothing is lost or doubled");
    assert!(mass(&piece) as f32 > disc.voxels() as f32 * 240.0);
    // What is there is where it was, in the one or the other.
    for number in 0..3_000_u64 {
        let at = |shift: u32| (mix(number) >> shift & 0xffff) as f32 / 65_536.0;
        let point = volume.to_world(volume.extent() * Vec3::new(at(0), at(16), at(32)));
        let (both, one) =
            (volume.density_at(point) + piece.density_at(point), original.density_at(point));
        assert!((both - one).abs() < 1e-3, "{both} of {one} at {point}");
    }
    assert_eq!(volume.parts(whole(&volume)).len(), 1);
    let again = piece.parts(whole(&piece));
    assert_eq!((again.len(), again[0].voxels()), (1, disc.voxels()));
    assert!(!again[0].touches_border(), "its surface is within its grid");
    let digest = Volume::new(
        piece.dims(),
        piece.spacing(),
        piece.pose,
        &piece.densities().collect::<Vec<u8>>(),
    );
    assert_eq!(digest.expect("as before").digest(), piece.digest());
}

#[test]
fn a_cut_that_is_not_closed_frees_nothing() {
    let volume = plate(true);
    let parts = volume.parts(whole(&volume));
    assert_eq!(parts.len(), 1);
    assert!(parts[0].touches_border());
    let mut smaller = build([59, 60, 14], |_| 255);
    let error = smaller.split_off(&parts[0]).expect_err("a part of another volume");
    assert_eq!(error, VolumeError::NoSuchPart { ends: [60, 60, 12], dims: [59, 60, 14] });
}

#[test]
fn what_is_outside_the_box_does_not_count() {
    let volume = plate(true);
    // The bridge is outside of it.
    let parts = volume.parts([0..40, 0..60, 0..14]);
    assert_eq!(parts.len(), 2);
    assert!(parts.iter().all(Part::touches_border));
    assert_eq!(parts[1].bounds()[0].end, 40);
    assert!(volume.parts([5..5, 0..60, 0..14]).is_empty());
    assert!(volume.parts([70..90, 0..60, 0..14]).is_empty());
    assert_eq!(volume.parts([0..u32::MAX, 0..99, 0..99]).len(), 1);
}

/// Voxels that share no face do not hang together, and of equals the first one comes first.
#[test]
fn neighbours_by_edges_are_apart() {
    let volume = build([40, 5, 5], |[x, y, z]| {
        if matches!([x, y, z], [1, 1, 1] | [2, 2, 1] | [20, 3, 3] | [20, 3, 4]) { 128 } else { 127 }
    });
    let parts = volume.parts(whole(&volume));
    let found: Vec<_> = parts.iter().map(|part| (part.voxels(), part.bounds()[0].start)).collect();
    assert_eq!(found, [(2, 20), (1, 1), (1, 2)]);
    assert_eq!(parts.iter().filter(|part| part.touches_border()).count(), 1);
}

/// A grain of less than half density between two parts goes to the nearer one, and a chip that hangs on
/// grains goes with them.
#[test]
fn the_rim_goes_to_the_nearer_part() {
    let mut volume = build([60, 20, 20], |[x, y, z]| {
        let inside = (4..16).contains(&y) && (4..16).contains(&z);
        match x {
            2..20 | 32..50 if inside => 255,
            20..31 if (y, z) == (9, 9) => 40,
            31 if (y, z) == (9, 9) => 40,
            23 | 24 if (y, z) == (10, 9) => 200,
            _ => 0,
        }
    });
    let before = mass(&volume);
    let parts = volume.parts(whole(&volume));
    assert_eq!(parts.iter().map(Part::voxels).collect::<Vec<_>>(), [2_592, 2_592, 2]);
    let piece = volume.split_off(&parts[0]).expect("its own part");
    assert_eq!(mass(&piece) + mass(&volume), before);
    // Six grains of twelve, and the chip.
    assert_eq!(mass(&piece), 2_592 * 255 + 6 * 40 + 2 * 200);
}

/// The border of the box that was searched is where a part ends, though its bone goes on.
#[test]
fn a_part_that_a_search_cut_off() {
    for xs in [5..15, 0..10] {
        let mut volume = build([64; 3], |_| 255);
        let before = mass(&volume);
        let parts = volume.parts([xs, 0..64, 0..64]);
        let piece = volume.split_off(&parts[0]).expect("its own part");
        assert_eq!(mass(&piece), 10 * 64 * 64 * 255);
        assert_eq!(mass(&piece) + mass(&volume), before);
    }
}

/// Two passes over the runs find what a flood finds.
#[test]
fn the_same_parts_as_a_flood() {
    for seed in 0..30_u64 {
        let volume = build([23, 18, 19], |[x, y, z]| {
            let coarse = [x / 2, y / 2, z / 3].map(u64::from);
            mix(seed << 40 ^ coarse[0] << 20 ^ coarse[1] << 10 ^ coarse[2]) as u8 / 2 + 62
        });
        let mut left: std::collections::BTreeSet<[i32; 3]> = boxed(whole(&volume))
            .map(|voxel| voxel.map(|index| index as i32))
            .filter(|&voxel| volume.density(voxel) >= SOLID)
            .collect();
        let mut sizes = Vec::new();
        while let Some(first) = left.pop_first() {
            let (mut front, mut size) = (vec![first], 0);
            while let Some([x, y, z]) = front.pop() {
                size += 1;
                for step in [-1, 1] {
                    for next in [[x + step, y, z], [x, y + step, z], [x, y, z + step]] {
                        if left.remove(&next) {
                            front.push(next);
                        }
                    }
                }
            }
            sizes.push(size);
        }
        sizes.sort_by_key(|&size| Reverse(size));
        let parts = volume.parts(whole(&volume));
        assert_eq!(parts.iter().map(Part::voxels).collect::<Vec<_>>(), sizes, "seed {seed}");
        for part in &parts {
            let mut volume = volume.clone();
            let before = mass(&volume);
            let piece = volume.split_off(part).expect("its own part");
            assert_eq!(mass(&piece) + mass(&volume), before, "seed {seed}");
            // Chips may have gone with it.
            let solid = piece.densities().filter(|&density| density >= SOLID).count() as u64;
            assert!(solid >= part.voxels(), "seed {seed}: {solid} of {}", part.voxels());
        }
    }
}

/// The time is told, not tested.
#[test]
fn a_large_box() {
    let volume = build([200, 200, 100], |[x, y, z]| {
        let aside = (i64::from(x) - 100).pow(2) + (i64::from(y) - 100).pow(2);
        let cell = mix(u64::from(x / 4) << 40 | u64::from(y / 4) << 20 | u64::from(z / 4));
        let pore = cell.is_multiple_of(3);
        match (aside - 60 * 60).abs() < 200 || !(20..70).contains(&z) {
            true => 0,
            false if pore && (30..60).contains(&z) => 60,
            false => 255,
        }
    });
    let began = Instant::now();
    let parts = volume.parts(whole(&volume));
    let found = began.elapsed();
    let (mut left, part) = (volume, parts[1].clone());
    assert!(parts[0].touches_border() && !part.touches_border());
    let began = Instant::now();
    let piece = left.split_off(&part).expect("its own part");
    println!(
        "{} parts in {found:?}; {} voxels split off in {:?}",
        parts.len(),
        part.voxels(),
        began.elapsed()
    );
    assert!(parts.len() > 1 && mass(&piece) > 0);
}
