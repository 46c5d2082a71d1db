use glam::Quat;
use proptest::prelude::*;

use super::*;
use crate::mix::mix;

/// A volume of arbitrary densities, turned and moved.
fn arbitrary() -> impl Strategy<Value = Volume> {
    let dims = [1_u32..40, 1_u32..40, 1_u32..20];
    let spacing = [1_u32..5, 1_u32..5, 1_u32..5];
    (dims, spacing, any::<u64>(), any::<i8>()).prop_map(|(dims, spacing, seed, turned)| {
        let rotation = Quat::from_rotation_y(f32::from(turned) * 0.02);
        let pose = Pose::from_parts(Vec3::new(0.1, -0.2, 0.3), rotation);
        let [x, y, z] = spacing.map(|step| step as f32 * 5e-4);
        let density = |[x, y, z]: [u32; 3]| {
            mix(seed ^ (u64::from(z) << 40 | u64::from(y) << 20 | u64::from(x))) as u8
        };
        Volume::from_fn(dims, Vec3::new(x, y, z), pose, density).expect("it is small")
    })
}

/// A ball's middle, as shares of the volume's sides, its radius in metres, and what it removes.
type Cut = ([f32; 3], f32, f32);

fn cuts() -> impl Strategy<Value = Vec<Cut>> {
    let at = [-0.2_f32..1.2, -0.2_f32..1.2, -0.2_f32..1.2];
    prop::collection::vec((at, 1e-4_f32..8e-3, 0.0_f32..1.0), 1..6)
}

fn cut(volume: &mut Volume, (at, radius, share): Cut) -> u64 {
    let center = volume.to_world(volume.extent() * Vec3::from_array(at));
    volume.remove(center, radius, |voxel| voxel.share(share))
}

fn mass(volume: &Volume) -> u64 {
    volume.densities().map(u64::from).sum()
}

/// The same densities, built anew.
fn rebuilt(volume: &Volume) -> Volume {
    let densities: Vec<u8> = volume.densities().collect();
    Volume::new(volume.dims(), volume.spacing(), volume.pose, &densities).expect("as before")
}

/// Where a brick begins, its size, its greatest density, all densities.
type BrickState = ([u32; 3], [u32; 3], u8, Vec<u8>);

fn bricks(volume: &Volume) -> Vec<BrickState> {
    let brick =
        |brick: Brick<'_>| (brick.first(), brick.size(), brick.peak, brick.densities.to_vec());
    volume.bricks().map(brick).collect()
}

proptest! {
    #[test]
    fn what_is_removed_is_missing(mut volume in arbitrary(), cuts in cuts()) {
        let before = mass(&volume);
        let removed: u64 = cuts.into_iter().map(|one| cut(&mut volume, one)).sum();
        prop_assert_eq!(before - mass(&volume), removed);
    }

    #[test]
    fn the_order_of_cuts_does_not_show(volume in arbitrary(), cuts in cuts()) {
        let (mut one, mut other) = (volume.clone(), volume);
        let there: u64 = cuts.iter().map(|&c| cut(&mut one, c)).sum();
        let back: u64 = cuts.iter().rev().map(|&c| cut(&mut other, c)).sum();
        prop_assert_eq!(there, back);
        prop_assert_eq!(one.digest(), other.digest());
        prop_assert!(one.densities().eq(other.densities()));
    }

    #[test]
    fn exactly_the_changed_bricks_are_told(mut volume in arbitrary(), cuts in cuts()) {
        for one in cuts {
            let before = volume.clone();
            let removed = cut(&mut volume, one);
            prop_assert_eq!(volume.revision() != before.revision(), removed > 0);
            for (old, new) in before.bricks().zip(volume.bricks()) {
                prop_assert_eq!(old.revision == new.revision, old.densities == new.densities);
            }
        }
    }

    #[test]
    fn peaks_and_digest_are_those_of_the_densities(mut volume in arbitrary(), cuts in cuts()) {
        for one in cuts {
            cut(&mut volume, one);
        }
        let anew = rebuilt(&volume);
        prop_assert_eq!(volume.digest(), anew.digest());
        prop_assert_eq!(bricks(&volume), bricks(&anew));
    }

    #[test]
    fn a_copy_is_a_clone(volume in arbitrary(), cuts in cuts(), other in arbitrary()) {
        let mut original = volume.clone();
        // One of another size, one that went another way, and one that follows.
        let mut diverged = volume.clone();
        cut(&mut diverged, ([0.5; 3], 4e-3, 1.0));
        let mut copies = [other, diverged, volume];
        for one in cuts {
            cut(&mut original, one);
            original.pose.translation += Vec3::X;
            original.velocity -= Vec3::Y;
            for copy in &mut copies {
                copy.copy_from(&original);
                prop_assert_eq!(bricks(copy), bricks(&original));
                prop_assert_eq!(copy.digest(), original.digest());
                prop_assert_eq!(copy.revision(), original.revision());
                prop_assert_eq!((copy.pose, copy.velocity), (original.pose, original.velocity));
                prop_assert_eq!(copy.spacing(), original.spacing());
            }
        }
    }

    #[test]
    fn every_density_is_found_where_its_voxel_is(volume in arbitrary(), at in any::<[u32; 3]>()) {
        let dims = volume.dims();
        let voxel: [u32; 3] = std::array::from_fn(|axis| at[axis] % dims[axis]);
        let number = (voxel[2] * dims[1] + voxel[1]) * dims[0] + voxel[0];
        let expected = volume.densities().nth(number as usize).map_or(f32::NAN, f32::from) / 255.0;
        let [x, y, z] = voxel.map(|index| index as f32 + 0.5);
        let middle = volume.to_world(Vec3::new(x, y, z) * volume.spacing());
        prop_assert!((volume.density_at(middle) - expected).abs() < 2e-3);
        let point = Bounds { min: middle, max: middle };
        prop_assert!(volume.bounds().inflated(1e-6).overlaps(&point));
    }
}

fn full(dims: [u32; 3], spacing: Vec3) -> Volume {
    Volume::from_fn(dims, spacing, Pose::IDENTITY, |_| 255).expect("it is small")
}

#[test]
fn overlaps_add_up_to_the_ball() {
    let volume = full([40, 60, 30], Vec3::new(1e-3, 7e-4, 1.5e-3));
    for (radius, tolerance) in [(2e-3_f32, 0.03), (3e-3, 0.01), (6e-3, 0.003)] {
        for shift in 0..10 {
            let shift = Vec3::new(0.37, 0.11, 0.23) * (shift as f32 * 1e-3);
            let (mut sum, mut moment) = (0.0, Vec3::ZERO);
            let center = volume.center() + shift;
            volume.visit(center, radius, |voxel| {
                sum += voxel.overlap;
                moment += voxel.offset * voxel.overlap;
                assert_eq!(voxel.density, 255);
            });
            let part = sum * volume.spacing().element_product();
            let whole = 4.0 / 3.0 * std::f32::consts::PI * radius.powi(3);
            assert!((part / whole - 1.0).abs() < tolerance, "{} at {shift}", part / whole);
            assert!((moment / sum).length() < 0.02 * radius, "{moment} at {shift}");
        }
    }
}

#[test]
fn gradient_of_a_ramp() {
    let rotation = Quat::from_rotation_z(0.7);
    let pose = Pose::from_parts(Vec3::new(1.0, 2.0, 3.0), rotation);
    let spacing = Vec3::new(1e-3, 2e-3, 3e-3);
    let density = |[x, y, z]: [u32; 3]| (x * 4 + y * 2 + z) as u8;
    let volume = Volume::from_fn([32, 32, 32], spacing, pose, density).expect("it is small");
    let expected = rotation * (Vec3::new(4.0, 2.0, 1.0) / 255.0 / spacing);
    for share in [0.2, 0.43, 0.77] {
        let point = volume.to_world(volume.extent() * share);
        let found = volume.gradient_at(point);
        assert!((found - expected).length() < 1e-3 * expected.length(), "{found} {expected}");
        let step = expected.normalize() * 1e-3;
        let slope = volume.density_at(point + step) - volume.density_at(point - step);
        assert!((slope / 2e-3 - expected.length()).abs() < 1e-2 * expected.length());
    }
}

#[test]
fn nothing_outside() {
    let mut volume = full([17, 3, 3], Vec3::splat(1e-3));
    for point in [Vec3::splat(-1e-3), Vec3::MAX, Vec3::NAN, Vec3::INFINITY, Vec3::NEG_INFINITY] {
        assert_eq!(volume.density_at(point), 0.0);
        assert_eq!(volume.remove(point, 1e-4, |_| 255), 0);
    }
    for radius in [0.0, -1.0, f32::NAN, f32::INFINITY] {
        assert_eq!(volume.remove(volume.center(), radius, |_| 255), 0);
    }
    assert_eq!(volume.remove(volume.center(), f32::MAX, |_| 255), 17 * 3 * 3 * 255);
    assert!(volume.bricks().all(|brick| brick.is_empty()));
    // On a side of the grid, half of what counts is outside.
    let volume = full([4, 4, 4], Vec3::splat(1e-3));
    assert_eq!(volume.density_at(Vec3::new(0.0, 2e-3, 2e-3)), 0.5);
    assert!(volume.gradient_at(Vec3::new(0.0, 2e-3, 2e-3)).x > 0.0);
}

#[test]
fn what_cannot_be_built() {
    let build = |dims, spacing| Volume::new(dims, spacing, Pose::IDENTITY, &[0; 8]).map(|_| ());
    let unit = Vec3::ONE;
    assert_eq!(build([2, 2, 2], unit), Ok(()));
    for dims in [[0, 2, 2], [2, 2, 2049], [u32::MAX; 3]] {
        assert_eq!(build(dims, unit), Err(VolumeError::Side { dims }));
    }
    let dims = [2048, 2048, 257];
    assert_eq!(build(dims, unit), Err(VolumeError::Voxels { dims }));
    assert_eq!(build([2, 2, 3], unit), Err(VolumeError::Length { given: 8, voxels: 12 }));
    for wrong in [0.0, -1.0, f32::NAN, f32::INFINITY] {
        let error = build([2, 2, 2], Vec3::new(1.0, wrong, 1.0)).expect_err("a wrong spacing");
        assert!(matches!(error, VolumeError::Spacing { .. }), "{error}");
    }
    assert!(VolumeError::Side { dims: [0, 1, 1] }.to_string().contains("2048"));
}

#[test]
fn not_finite_is_seen() {
    let mut volume = full([2, 2, 2], Vec3::ONE);
    assert!(volume.is_finite());
    volume.velocity.x = f32::NAN;
    assert!(!volume.is_finite());
}

#[test]
fn a_sparse_volume_is_the_same_as_a_whole_one() {
    let (dims, spacing) = ([37, 20, 45], Vec3::splat(5e-4));
    // A ball, and noise in it.
    let density = |voxel: [u32; 3]| {
        let [x, y, z] = voxel.map(|index| f64::from(index) - 18.0);
        let number = u64::from(voxel[0]) << 40 | u64::from(voxel[1]) << 20 | u64::from(voxel[2]);
        if x * x + y * y + z * z < 120.0 { mix(number) as u8 } else { 0 }
    };
    let near = |first: u32, side: u32| first < 18 + 11 && first + side > 18 - 11;
    let may_hold = |first: [u32; 3], side| first.into_iter().all(|first| near(first, side));
    let whole = Volume::from_fn(dims, spacing, Pose::IDENTITY, density).expect("it is small");
    let sparse = Volume::sparse(dims, spacing, Pose::IDENTITY, may_hold, density);
    let sparse = sparse.expect("it is small");
    assert!(sparse.densities().eq(whole.densities()));
    assert_eq!(sparse.digest(), whole.digest());
    let bricks = |volume: &Volume| -> Vec<([u32; 3], u8)> {
        volume.bricks().map(|brick| (brick.place(), brick.peak)).collect()
    };
    assert_eq!(bricks(&sparse), bricks(&whole));
    let nothing = Volume::sparse([0, 1, 1], spacing, Pose::IDENTITY, may_hold, density);
    assert!(nothing.is_err());
}
