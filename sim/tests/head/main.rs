//! Heads: the synthetic one, and images that hold none.
#![cfg(feature = "image")]
#![forbid(unsafe_code)]

mod checks;
#[cfg(target_os = "linux")]
mod memory;

use std::sync::LazyLock;

use dualframe_sim::geometry::Volume;
use dualframe_sim::image::{AIR, Grid, Image, Thresholds};
use dualframe_sim::scene::head::{Head, HeadError, synthetic_ct};
use glam::{DAffine3, DMat3, DQuat, DVec3, Vec3};

static HEAD: LazyLock<Head> =
    LazyLock::new(|| Head::synthetic().expect("the synthetic head is a head"));

#[test]
fn structures_attachments_and_plan() {
    checks::check(&HEAD);
}

/// What the synthetic head is made with: 5 mm of scalp, 5 mm of skull and 8 at the back, a cranium of
/// 136 × 168 mm. Where bone is blurred by voxels of 1.5 mm, it begins half a millimetre early on each side.
#[test]
fn layers_are_where_they_were_put() {
    let head = &*HEAD;
    let close = |value: f32, expected: f32, what: &str| {
        assert!((value - expected).abs() < 0.001_3, "{what}: {value} m, not {expected} m");
    };
    let across = |axis: Vec3| head.inner_at(axis) + head.inner_at(-axis);
    close(across(Vec3::Y), 0.135, "the cranium's width");
    close(across(Vec3::X), 0.167, "the cranium's length");
    for (direction, skull, scalp) in
        [(Vec3::NEG_X, 0.005, 0.005), (Vec3::X, 0.008, 0.005), (Vec3::Z, 0.0065, 0.005)]
    {
        let [inner, outer, skin] =
            [head.inner_at(direction), head.outer_at(direction), head.skin_at(direction)];
        close(outer - inner, skull, "the skull's thickness");
        close(skin - outer, scalp, "the scalp's thickness");
    }
    let temple = Vec3::new(-0.3, 0.93, -0.1);
    let soft = head.skin_at(temple) - head.outer_at(temple);
    assert!((0.009..0.013).contains(&soft), "{soft} m of soft tissue over the temple");
}

#[test]
fn the_skull_is_the_images() {
    let head = &*HEAD;
    let skull = &head.skull;
    assert!(skull.dims().iter().map(|&side| u64::from(side)).product::<u64>() < 40_000_000);
    assert_eq!(skull.spacing(), Vec3::splat(0.000_5));
    for direction in [Vec3::Y, Vec3::NEG_Y, Vec3::X, Vec3::NEG_X, Vec3::Z, Vec3::new(0.3, 0.7, 0.4)]
    {
        let (inner, outer) = (head.inner_at(direction), head.outer_at(direction));
        let at = |radius: f32| skull.density_at(direction.normalize() * radius);
        assert!(at(inner - 0.002) < 0.1 && at(inner + 0.001) > 0.5);
        assert!(at(outer - 0.001) > 0.5 && at(outer + 0.002) < 0.1);
    }
    assert_eq!(skull.density_at(Vec3::ZERO), 0.0);
    assert_eq!(skull.density_at(Vec3::Z * 0.1), 0.0);
}

#[test]
fn a_head_that_nobody_drilled_is_the_image() {
    let same = HEAD.drilled(&HEAD.skull, &[]).expect("it is the head's skull");
    assert_eq!(&same, HEAD.image());
}

#[test]
fn a_drilled_ball_becomes_air() {
    let head = &*HEAD;
    let mut skull = head.skull.clone();
    let entry = head.plan.middle;
    let (center, radius) = (entry.point + entry.inward * 0.002, 0.006);
    let removed = skull.remove(center, radius, |voxel| voxel.share(1.0));
    let removed = removed as f64 / 255.0 * 0.000_5_f64.powi(3);
    let image = head.drilled(&skull, &[]).expect("it is the head's skull");
    assert_eq!(image.grid(), head.image().grid());
    let (mut missing, mut touched) = (0.0, 0);
    let thresholds = Thresholds::default();
    let affine = image.grid().affine();
    let [wide, high, _] = image.grid().dims().map(|side| side as usize);
    for (number, (&after, &before)) in image.voxels().iter().zip(head.image().voxels()).enumerate()
    {
        let voxel = [number % wide, number / wide % high, number / (wide * high)];
        let place = affine.transform_point3(DVec3::from(voxel.map(|index| index as f64)));
        let from_center = place - head.center();
        let world = DVec3::new(-from_center.y, from_center.x, from_center.z).as_vec3();
        let distance = world.distance(center);
        if distance > radius + 0.002 {
            assert_eq!(after, before, "a voxel {distance} m away");
        } else if distance < radius - 0.002 && before > 300 {
            assert!(after < AIR + 20, "{after} HU is left of {before}");
        }
        if after != before {
            assert!(after < before);
            touched += 1;
            let left = (f64::from(after) + 1_000.0) / (f64::from(before) + 1_000.0);
            missing +=
                f64::from(thresholds.density(before)) / 255.0 * (1.0 - left) * 0.001_5_f64.powi(3);
        }
    }
    assert!(touched > 100, "{touched} voxels");
    let share = missing / removed;
    assert!((0.95..1.05).contains(&share), "{missing} m³ are missing of {removed} m³ removed");
}

#[test]
fn a_piece_in_its_place_is_not_missing() {
    let head = &*HEAD;
    let mut skull = head.skull.clone();
    skull.remove(head.plan.middle.point, 0.005, |voxel| voxel.share(1.0));
    let mut piece = head.skull.clone();
    let whole = head.drilled(&skull, &[&piece]).expect("it is the head's skull");
    assert_eq!(&whole, head.image());
    piece.pose.translation.y += 0.5;
    let parted = head.drilled(&skull, &[&piece]).expect("it is the head's skull");
    assert_eq!(parted, head.drilled(&skull, &[]).expect("it is the head's skull"));
    assert_ne!(&parted, head.image());
}

#[test]
fn another_skull_is_refused() {
    let other = Volume::new([1; 3], Vec3::ONE, head_pose(), &[0]).expect("one voxel is allowed");
    let error = HEAD.drilled(&other, &[]).expect_err("it is not the skull");
    assert!(error.to_string().starts_with("a volume of [1, 1, 1] voxels is not"), "{error}");
}

fn head_pose() -> parry3d::math::Pose {
    HEAD.skull.pose
}

#[test]
fn the_same_bits_on_every_machine() {
    let head = &*HEAD;
    let bits = head.structures.iter().flat_map(|structure| {
        let places = structure.positions.iter().flat_map(|p| p.to_array().map(f32::to_bits));
        places.chain(structure.triangles.iter().copied().flatten())
    });
    // FNV-1a, over words.
    let hash = bits.fold(0xcbf2_9ce4_8422_2325_u64, |hash, bits| {
        (hash ^ u64::from(bits)).wrapping_mul(0x0100_0000_01b3)
    });
    assert_eq!(
        [head.skull.digest(), hash],
        [15_614_712_393_565_003_574, 18_055_479_851_415_626_080]
    );
}

/// A head that lies askew in the scanner is the same head.
#[test]
fn a_head_askew() {
    let image = synthetic_ct().expect("its sizes are allowed");
    let dims = image.grid().dims();
    let turn = DMat3::from_quat(DQuat::from_axis_angle(DVec3::new(0.2, 0.4, 0.9).normalize(), 0.1));
    let affine = image.grid().affine();
    let affine = DAffine3::from_mat3_translation(
        turn * affine.matrix3,
        turn * affine.translation + DVec3::new(0.1, -0.2, 0.3),
    );
    let grid = Grid::new(dims, affine).expect("its sizes are allowed");
    let turned = Image::new(grid, image.voxels().to_vec()).expect("as many voxels as before");
    let head = Head::from_ct(turned, &Thresholds::default()).expect("it is a head");
    checks::check(&head);
    // What was straight ahead, or halfway to a side, where radii differ most from those beside them, is now
    // turned with the head, but for the middle's own move.
    let [x, y, z] = [DVec3::X, DVec3::Y, DVec3::Z];
    for before in [x, -x, y, z, x + y, x - y, y - x, -x - y] {
        let world = |patient: DVec3| DVec3::new(-patient.y, patient.x, patient.z).as_vec3();
        let (now, then) = (world(turn * before), world(before));
        for (what, of) in
            [("inner", Head::inner_at as fn(&Head, Vec3) -> f32), ("outer", Head::outer_at)]
        {
            let [now, then] = [of(&head, now), of(&HEAD, then)];
            assert!((now - then).abs() < 0.001, "{what}: {now} m, not {then} m, along {before}");
        }
    }
}

/// What holds the head in the scanner is no part of it.
#[test]
fn a_holder_is_left_out() {
    let image = synthetic_ct().expect("its sizes are allowed");
    let [wide, high, _] = image.grid().dims().map(|side| side as usize);
    let mut voxels = image.voxels().to_vec();
    for (number, voxel) in voxels.iter_mut().enumerate() {
        let (x, y) = (number % wide, number / wide % high);
        if (11..14).contains(&x) && (13..16).contains(&y) {
            assert!(*voxel < -900, "it is in the head");
            *voxel = 1_500;
        }
    }
    let image = Image::new(image.grid().clone(), voxels).expect("as many voxels as before");
    let head = Head::from_ct(image, &Thresholds::default()).expect("it is a head");
    assert_eq!(head.skull.dims(), HEAD.skull.dims());
    assert_eq!(head.skull.digest(), HEAD.skull.digest());
}

/// An image of 4 mm voxels, of what `number` says of each voxel's place in millimetres from the middle.
fn image(number: impl Fn(Vec3) -> i16) -> Image {
    let affine = DAffine3::from_scale(DVec3::splat(0.004));
    let grid = Grid::new([64; 3], affine).expect("its sizes are allowed");
    let voxels = (0..64 * 64 * 64).map(|voxel| {
        let voxel = [voxel % 64, voxel / 64 % 64, voxel / 4_096].map(|index| index as f32);
        number((Vec3::from(voxel) - Vec3::splat(31.5)) * 4.0)
    });
    Image::new(grid, voxels.collect()).expect("as many voxels as the grid has")
}

fn refused(number: impl Fn(Vec3) -> i16) -> HeadError {
    Head::from_ct(image(number), &Thresholds::default()).expect_err("it is not a head")
}

#[test]
fn what_is_not_a_head() {
    let air = refused(|_| AIR);
    assert!(matches!(air, HeadError::Image(_)), "{air}");
    assert!(air.to_string().starts_with("no bone"), "{air}");
    // A thigh: bone in the middle of flesh.
    let thigh = refused(|p| match p.truncate().length() {
        bone if bone < 15.0 => 900,
        flesh if flesh < 80.0 => 40,
        _ => AIR,
    });
    assert!(matches!(thigh, HeadError::NoRoom { .. } | HeadError::Open { .. }), "{thigh}");
    // A bowl of water, with a rim of bone.
    let bowl = refused(|p| match p.length() {
        inside if inside < 80.0 => 0,
        wall if wall < 92.0 && p.z < -20.0 => 1_000,
        _ => AIR,
    });
    assert!(matches!(bowl, HeadError::Open { .. }), "{bowl}");
    let solid = refused(|p| if p.length() < 80.0 { 1_000 } else { AIR });
    assert!(matches!(solid, HeadError::NoRoom { radius } if radius < 0.03), "{solid}");
    let pipe = refused(|_| 1_000);
    assert!(matches!(pipe, HeadError::NoRoom { .. }), "{pipe}");
    let grid =
        Grid::new([1_024, 2, 1_024], DAffine3::from_scale(DVec3::splat(0.1))).expect("allowed");
    let image = Image::new(grid.clone(), vec![0; grid.voxels()]).expect("as many as it has voxels");
    let house = Head::from_ct(image, &Thresholds::default()).expect_err("too large for a person");
    assert!(matches!(house, HeadError::Size { volume } if volume > 2_000.0), "{house}");
}
