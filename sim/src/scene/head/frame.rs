//! The patient in the world.

use glam::{DVec3, Vec3};

use crate::image::Grid;

/// The patient's right, in the world.
pub(super) const RIGHT: Vec3 = Vec3::Y;
/// The patient's front.
pub(super) const FRONT: Vec3 = Vec3::NEG_X;
/// Towards the top of the patient's head.
pub(super) const UP: Vec3 = Vec3::Z;

/// A place in the world by how far it is to the patient's right, to the front and up.
pub(super) fn place(right: f32, front: f32, up: f32) -> Vec3 {
    RIGHT * right + FRONT * front + UP * up
}

/// How far a place is to the patient's right, to the front and up: what [`place`] takes.
pub(super) fn parts(point: Vec3) -> [f32; 3] {
    [point.dot(RIGHT), point.dot(FRONT), point.dot(UP)]
}

/// Where the world is in an image.
#[derive(Clone, Copy, Debug)]
pub(super) struct Frame {
    /// What gives a voxel's number from a place in the world: a row for each axis of the image.
    rows: [[f32; 4]; 3],
}

impl Frame {
    /// A world whose origin is at `center`, in metres along the patient's axes.
    pub(super) fn new(grid: &Grid, center: DVec3) -> Self {
        let to_voxel = grid.affine().inverse();
        let turned = |axis: DVec3| to_voxel.transform_vector3(axis);
        let columns = [turned(DVec3::NEG_Y), turned(DVec3::X), turned(DVec3::Z)];
        let origin = to_voxel.transform_point3(center);
        let rows = [0, 1, 2].map(|axis| {
            let [x, y, z] = columns.map(|column| column[axis] as f32);
            [x, y, z, origin[axis] as f32]
        });
        Self { rows }
    }

    /// The voxel, with fractions, whose middle is at a place.
    #[inline]
    pub(super) fn voxel(&self, point: Vec3) -> [f32; 3] {
        let along = |[x, y, z, origin]: [f32; 4]| x * point.x + y * point.y + z * point.z + origin;
        [along(self.rows[0]), along(self.rows[1]), along(self.rows[2])]
    }

    /// A place in the world along the patient's axes.
    pub(super) fn in_patient(center: DVec3, point: Vec3) -> DVec3 {
        let point = point.as_dvec3();
        center + DVec3::new(point.y, -point.x, point.z)
    }

    /// A place along the patient's axes, in the world.
    pub(super) fn in_world(center: DVec3, point: DVec3) -> Vec3 {
        let from_center = point - center;
        DVec3::new(-from_center.y, from_center.x, from_center.z).as_vec3()
    }
}

/// Numbers at an image's voxels, looked up in the world.
pub(super) struct Field<'a, T> {
    pub(super) voxels: &'a [T],
    pub(super) dims: [u32; 3],
    pub(super) frame: Frame,
    /// What is outside the image.
    pub(super) outside: T,
}

impl<T: Copy + Into<f32>> Field<'_, T> {
    /// The number at a place, trilinear between the voxels' middles.
    ///
    /// Written out: closures over arrays took three quarters of a head's time in builds of tests.
    pub(super) fn at(&self, point: Vec3) -> f32 {
        let [x, y, z] = self.frame.voxel(point);
        let (i, j, k) = (floor(x), floor(y), floor(z));
        let share = [x - i as f32, y - j as f32, z - k as f32];
        let near = between(self.row(i, j, k, share[0]), self.row(i, j + 1, k, share[0]), share[1]);
        let k = k + 1;
        let far = between(self.row(i, j, k, share[0]), self.row(i, j + 1, k, share[0]), share[1]);
        between(near, far, share[2])
    }

    /// The number between two voxels of a row.
    #[inline]
    fn row(&self, i: i32, j: i32, k: i32, share: f32) -> f32 {
        let [wide, high, deep] = self.dims;
        // As unsigned numbers, negative ones are too great.
        if j as u32 >= high || k as u32 >= deep {
            return self.outside.into();
        }
        let row = (k as usize * high as usize + j as usize) * wide as usize;
        if (i as u32) < wide - 1 {
            let ends = &self.voxels[row + i as usize..][..2];
            return between(ends[0].into(), ends[1].into(), share);
        }
        let get = |i: i32| {
            let inside = (i as u32) < wide;
            if inside { self.voxels[row + i as usize] } else { self.outside }
        };
        between(get(i).into(), get(i.wrapping_add(1)).into(), share)
    }
}

/// The greatest whole number that is not above: without a call, which it takes where processors need have no
/// instruction for it.
#[inline]
fn floor(value: f32) -> i32 {
    let whole = value as i32;
    whole - i32::from(whole as f32 > value)
}

#[inline]
fn between(from: f32, to: f32, share: f32) -> f32 {
    from + (to - from) * share
}
