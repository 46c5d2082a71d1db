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
    pub(super) fn voxel(&self, point: Vec3) -> [f32; 3] {
        self.rows.map(|[x, y, z, origin]| x * point.x + y * point.y + z * point.z + origin)
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
    pub(super) fn at(&self, point: Vec3) -> f32 {
        let at = self.frame.voxel(point);
        let low = at.map(f32::floor);
        let share = [0, 1, 2].map(|axis| at[axis] - low[axis]);
        let [x, y, z] = low.map(|value| value as i32);
        let row = |dy, dz| {
            let [from, to] = [0, 1].map(|dx| self.get([x + dx, y + dy, z + dz]));
            between(from, to, share[0])
        };
        let slice = |dz| between(row(0, dz), row(1, dz), share[1]);
        between(slice(0), slice(1), share[2])
    }

    fn get(&self, voxel: [i32; 3]) -> f32 {
        let inside = (0..3).all(|axis| (voxel[axis] as u32) < self.dims[axis]);
        if !inside {
            return self.outside.into();
        }
        let [x, y, z] = voxel.map(|index| index as usize);
        let [wide, high, _] = self.dims.map(|side| side as usize);
        self.voxels[(z * high + y) * wide + x].into()
    }
}

fn between(from: f32, to: f32, share: f32) -> f32 {
    from + (to - from) * share
}
