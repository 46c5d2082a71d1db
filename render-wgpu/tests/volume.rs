//! Volumes in pictures: where they are, what they hide, and that sending changes is enough.

use std::f32::consts::FRAC_PI_2;

use dualframe_render_wgpu::camera::Camera;
use dualframe_render_wgpu::gpu::Gpu;
use dualframe_render_wgpu::look::{Look, Quality};
use dualframe_render_wgpu::picture::Picture;
use dualframe_render_wgpu::renderer::Offscreen;
use dualframe_sim::behavior::Fixed;
use dualframe_sim::geometry::{Bounds, Geometry, Rigid, Volume};
use dualframe_sim::object::{Group, Object, ObjectId};
use dualframe_sim::render::Renderer;
use dualframe_sim::scene::{bone_piece, drill_burr_hole};
use glam::{Quat, Vec3};
use parry3d::math::Pose;
use parry3d::shape::SharedShape;

const SIZE: (u32, u32) = (320, 240);
const BONE: [f32; 4] = [0.85, 0.8, 0.7, 1.0];
const RED: [f32; 4] = [1.0, 0.0, 0.0, 1.0];

fn object(id: u32, geometry: Geometry, color: [f32; 4]) -> Object {
    let mut object = Object::new(ObjectId(id), Group(0), geometry, Fixed);
    object.visual.color = color;
    object
}

fn ball(id: u32, place: Vec3, radius: f32) -> Object {
    let shape = SharedShape::ball(radius);
    object(id, Geometry::Rigid(Rigid::new(shape, Pose::from_translation(place))), RED)
}

/// Sees a cube of 60 mm around the origin.
fn offscreen() -> Offscreen {
    let focus = Bounds { min: Vec3::splat(-0.03), max: Vec3::splat(0.03) };
    let gpu = Gpu::new(None).expect("these tests need a graphics adapter; one in software will do");
    let look = Look { room: false, ..Look::room(focus) };
    let mut offscreen = Offscreen::new(gpu, look, Quality::Fast, SIZE).expect("a small picture");
    offscreen.painter.camera.pitch = 0.9;
    offscreen
}

fn draw(offscreen: &mut Offscreen, objects: &[Object]) -> Picture {
    objects.iter().for_each(|object| offscreen.draw(object));
    offscreen.swap(0);
    offscreen.picture().expect("the device works")
}

/// A volume of these voxels, turned and around the origin.
fn around_origin(dims: [u32; 3], spacing: Vec3, density: impl FnMut([u32; 3]) -> u8) -> Volume {
    let rotation = Quat::from_rotation_y(0.6) * Quat::from_rotation_x(0.4);
    let pose = Pose::from_rotation(rotation);
    let mut volume = Volume::from_fn(dims, spacing, pose, density).expect("a small volume");
    volume.pose.translation = -volume.center();
    volume
}

fn pixels(picture: &Picture) -> impl Iterator<Item = [u8; 4]> {
    picture.pixels.as_chunks::<4>().0.iter().copied()
}

/// The number of pixels of which a channel differs by more than `by`.
fn differing(a: &Picture, b: &Picture, by: u8) -> usize {
    let far = |(a, b): ([u8; 4], [u8; 4])| a.iter().zip(b).any(|(a, b)| a.abs_diff(b) > by);
    pixels(a).zip(pixels(b)).filter(|&pair| far(pair)).count()
}

fn reds(picture: &Picture) -> usize {
    let is_red = |&[r, g, b, _]: &[u8; 4]| r > 60 && r / 3 > g.max(b);
    pixels(picture).filter(is_red).count()
}

#[test]
#[ignore = "needs a graphics adapter; .ci/run has one"]
fn a_full_grid_is_a_cuboid() {
    let spacing = Vec3::new(1e-3, 2e-3, 1.5e-3);
    let volume = around_origin([40, 10, 17], spacing, |_| 255);
    let shape = SharedShape::cuboid(0.02, 0.01, 0.012_75);
    let rigid = Rigid::new(shape, Pose::from_rotation(volume.pose.rotation));
    let expected = draw(&mut offscreen(), &[object(0, Geometry::Rigid(rigid), BONE)]);
    let picture = draw(&mut offscreen(), &[object(0, Geometry::Volume(volume), BONE)]);
    let empty = draw(&mut offscreen(), &[]);
    assert!(differing(&expected, &empty, 8) > 3_000, "nothing was tested");
    let wrong = differing(&picture, &expected, 8);
    assert!(wrong < 200, "{wrong} pixels differ");
}

#[test]
#[ignore = "needs a graphics adapter; .ci/run has one"]
fn a_ball_of_voxels_is_a_ball() {
    let spacing = Vec3::new(1e-3, 0.75e-3, 0.5e-3);
    let middle = Vec3::splat(0.024);
    let volume = around_origin([48, 64, 96], spacing, |[x, y, z]| {
        let place = (Vec3::new(x as f32, y as f32, z as f32) + 0.5) * spacing;
        // Falls from full to empty over 2 mm.
        let inside = 0.02 - place.distance(middle);
        (255.0 * (0.5 + inside / 2e-3).clamp(0.0, 1.0)).round() as u8
    });
    let rigid = Rigid::new(SharedShape::ball(0.02), Pose::IDENTITY);
    let expected = draw(&mut offscreen(), &[object(0, Geometry::Rigid(rigid), BONE)]);
    let picture = draw(&mut offscreen(), &[object(0, Geometry::Volume(volume), BONE)]);
    let wrong = differing(&picture, &expected, 12);
    assert!(wrong < 500, "{wrong} pixels differ");
}

/// A block of 40 mm with a hole of 12 mm towards the viewer, and what a ball looks like with it.
#[test]
#[ignore = "needs a graphics adapter; .ci/run has one"]
fn surfaces_before_behind_and_inside() {
    let mut offscreen = offscreen();
    let toward = (offscreen.painter.camera.eye() - Vec3::ZERO).normalize();
    let mut block = around_origin([80; 3], Vec3::splat(5e-4), |_| 255);
    drill_burr_hole(&mut block, toward * 0.05, -toward, 0.006, 0.05);
    let mut red = |place: Vec3, radius| {
        let objects = [object(0, Geometry::Volume(block.clone()), BONE), ball(1, place, radius)];
        reds(&draw(&mut offscreen, &objects))
    };
    let before = red(toward * 0.05, 0.004);
    assert!(before > 100, "{before}");
    let in_hole = red(toward * 0.012, 0.004);
    assert!(in_hole > 100, "{in_hole}");
    assert_eq!(red(toward * -0.012, 0.004), 0, "beneath the hole, in the block");
    assert_eq!(red(toward * -0.06, 0.004), 0, "behind the block");
    // Half out of the block's hole wall: the part in the hole shows, the part in the wall does not.
    let right = offscreen_right(toward);
    let half = red(toward * 0.012 + right * 0.006, 0.004);
    assert!(half > in_hole / 6 && half < in_hole * 4 / 5, "{half} of {in_hole}");
}

fn offscreen_right(toward: Vec3) -> Vec3 {
    Vec3::Y.cross(toward).normalize()
}

#[test]
#[ignore = "needs a graphics adapter; .ci/run has one"]
fn from_inside_there_is_wall_all_around() {
    let hollow = around_origin([64; 3], Vec3::splat(1e-3), |voxel| {
        if voxel.iter().all(|index| (12..52).contains(index)) { 0 } else { 255 }
    });
    let mut offscreen = offscreen();
    let background = pixels(&draw(&mut offscreen, &[])).next();
    for yaw in 0..6 {
        offscreen.painter.camera =
            Camera { target: Vec3::ZERO, distance: 0.01, yaw: yaw as f32, pitch: 0.3 };
        let picture = draw(&mut offscreen, &[object(0, Geometry::Volume(hollow.clone()), BONE)]);
        let holes = pixels(&picture).filter(|&pixel| Some(pixel) == background).count();
        assert_eq!(holes, 0, "at {yaw}");
    }
}

#[test]
#[ignore = "needs a graphics adapter; .ci/run has one"]
fn sending_what_changed_is_enough() {
    let pose =
        Pose::from_parts(Vec3::new(-0.032, -0.038, 0.032), Quat::from_rotation_x(-FRAC_PI_2));
    let mut object = object(0, Geometry::Volume(bone_piece(64, pose).expect("64 voxels")), BONE);
    let mut offscreen = offscreen();
    let first = draw(&mut offscreen, std::slice::from_ref(&object));
    let camera = offscreen.painter.camera;
    let mut last = first.clone();
    for step in 0..4 {
        let bone = object.geometry.as_volume_mut().expect("a volume");
        let entry = Vec3::new(0.008 * step as f32 - 0.012, 0.02, 0.004);
        drill_burr_hole(bone, entry, Vec3::NEG_Y, 0.004, 0.03);
        if step == 1 {
            // Changed twice while it is out of sight.
            offscreen.painter.camera =
                Camera { target: Vec3::X, distance: 0.1, yaw: 1.6, pitch: 0.0 };
            draw(&mut offscreen, std::slice::from_ref(&object));
            offscreen.painter.camera = camera;
            continue;
        }
        let picture = draw(&mut offscreen, std::slice::from_ref(&object));
        assert!(differing(&picture, &last, 8) > 40, "hole {step} is not seen");
        let anew = draw(&mut self::offscreen(), std::slice::from_ref(&object));
        assert_eq!(differing(&picture, &anew, 0), 0, "hole {step}");
        last = picture;
    }
    // Another volume of the same size takes its place.
    object.geometry = Geometry::Volume(bone_piece(64, pose).expect("64 voxels"));
    let replaced = draw(&mut offscreen, std::slice::from_ref(&object));
    assert_eq!(differing(&replaced, &first, 0), 0);
}

#[test]
#[ignore = "needs a graphics adapter; .ci/run has one"]
fn a_copy_that_went_another_way_is_drawn_whole() {
    let pose =
        Pose::from_parts(Vec3::new(-0.032, -0.038, 0.032), Quat::from_rotation_x(-FRAC_PI_2));
    let pristine = bone_piece(64, pose).expect("64 voxels");
    let drilled = |x: f32| {
        let mut bone = pristine.clone();
        drill_burr_hole(&mut bone, Vec3::new(x, 0.02, 0.004), Vec3::NEG_Y, 0.004, 0.03);
        [object(0, Geometry::Volume(bone), BONE)]
    };
    let (one, other) = (drilled(-0.012), drilled(0.012));
    let mut offscreen = offscreen();
    let before = draw(&mut offscreen, &one);
    let picture = draw(&mut offscreen, &other);
    assert!(differing(&picture, &before, 8) > 80, "the holes are not seen");
    let anew = draw(&mut self::offscreen(), &other);
    assert_eq!(differing(&picture, &anew, 0), 0);
}
