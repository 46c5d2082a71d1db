//! Where voxels are: in the file, in the image and in the patient.

use std::array;
use std::ops::RangeInclusive;

use glam::{DAffine3, DMat3, DVec3};

use super::error::ImageError;
use crate::geometry::Volume;

/// The places of an image's voxels.
///
/// The patient's axes are those of NIfTI: x to the right, y to the front (anterior), z to the head
/// (superior), in metres. Voxel (i, j, k) of the image has its middle where [`Grid::affine`] maps
/// (i, j, k), and i, j and k grow most nearly along x, y and z.
///
/// A file may store its voxels in another order; that order is kept here for writing.
#[derive(Clone, Debug, PartialEq)]
pub struct Grid {
    stored_dims: [u32; 3],
    stored_affine: DAffine3,
    /// For each axis of the image, that of the file.
    axes: [Axis; 3],
}

/// An axis of the file.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Axis {
    number: usize,
    /// It runs against the image's.
    reversed: bool,
}

const ORDERS: [[usize; 3]; 6] = [[0, 1, 2], [0, 2, 1], [1, 0, 2], [1, 2, 0], [2, 0, 1], [2, 1, 0]];

impl Grid {
    /// The most voxels along an axis: as of a [`Volume`], which an image's bone can be.
    pub const MAX_SIDE: u32 = Volume::MAX_SIDE;
    /// The most voxels in all; as of a [`Volume`].
    pub const MAX_VOXELS: u64 = Volume::MAX_VOXELS;
    /// The distances between voxels that can be, in metres.
    pub const SPACINGS: RangeInclusive<f64> = 1e-6..=0.1;
    /// How far the origin may be away, in metres along each axis.
    pub const MAX_ORIGIN: f64 = 100.0;
    /// The least volume that unit vectors along the axes span: 1 where they are perpendicular, the
    /// cosine of its tilt where a gantry was tilted.
    pub const MIN_VOLUME: f64 = 0.5;

    /// The grid of a file whose voxel (i, j, k) has its middle where `affine` maps (i, j, k), in metres.
    /// Any order and directions of the axes will do.
    ///
    /// # Errors
    /// No voxels, too many along an axis or in all, or an affine map that is not finite, too far from
    /// the origin, too fine, too coarse or too nearly singular.
    pub fn new(dims: [u32; 3], affine: DAffine3) -> Result<Self, ImageError> {
        if dims.iter().any(|side| !(1..=Self::MAX_SIDE).contains(side)) {
            return Err(ImageError::Side { dims });
        }
        if dims.iter().map(|&side| u64::from(side)).product::<u64>() > Self::MAX_VOXELS {
            return Err(ImageError::Voxels { dims });
        }
        let origin = affine.translation;
        if !affine.is_finite() || origin.abs().max_element() > Self::MAX_ORIGIN {
            return Err(ImageError::Affine { origin: origin.into() });
        }
        let columns = columns(affine.matrix3);
        let spacing = columns.map(DVec3::length);
        if spacing.iter().any(|length| !Self::SPACINGS.contains(length)) {
            return Err(ImageError::Spacing { spacing });
        }
        let directions = columns.map(DVec3::normalize);
        let grid = Self { stored_dims: dims, stored_affine: affine, axes: nearest(directions) };
        let [x, y, z] = grid.axes.map(|axis| axis.along(directions));
        let volume = x.cross(y).dot(z);
        if volume < Self::MIN_VOLUME {
            return Err(ImageError::Skewed { volume });
        }
        Ok(grid)
    }

    /// The image's voxels along x, y and z.
    #[must_use]
    pub fn dims(&self) -> [u32; 3] {
        self.axes.map(|axis| self.stored_dims[axis.number])
    }

    /// The number of voxels.
    #[must_use]
    pub fn voxels(&self) -> usize {
        self.stored_dims.iter().map(|&side| side as usize).product()
    }

    /// Where the image's voxels have their middles, in metres.
    #[must_use]
    pub fn affine(&self) -> DAffine3 {
        let columns = columns(self.stored_affine.matrix3);
        let [x, y, z] = self.axes.map(|axis| axis.along(columns));
        let mut first = DVec3::ZERO;
        for axis in self.axes.iter().filter(|axis| axis.reversed) {
            first[axis.number] = f64::from(self.stored_dims[axis.number] - 1);
        }
        let origin = self.stored_affine.transform_point3(first);
        DAffine3::from_mat3_translation(DMat3::from_cols(x, y, z), origin)
    }

    /// The distances between the image's voxels along its axes, in metres.
    #[must_use]
    pub fn spacing(&self) -> DVec3 {
        columns(self.affine().matrix3).map(DVec3::length).into()
    }

    /// The file's voxels along its own axes.
    #[must_use]
    pub fn stored_dims(&self) -> [u32; 3] {
        self.stored_dims
    }

    /// Where the file's voxels have their middles, in metres.
    #[must_use]
    pub fn stored_affine(&self) -> DAffine3 {
        self.stored_affine
    }

    /// The file's rows of voxels, in its order.
    pub(super) fn stored_rows(&self) -> impl Iterator<Item = Row> {
        let [count, rows, slices] = self.stored_dims.map(|side| side as usize);
        let [wide, high, _] = self.dims().map(|side| side as isize);
        let mut steps = [0; 3];
        let mut start = 0;
        for (axis, step) in self.axes.iter().zip([1, wide, wide * high]) {
            let last = self.stored_dims[axis.number] as isize - 1;
            start += if axis.reversed { last * step } else { 0 };
            steps[axis.number] = if axis.reversed { -step } else { step };
        }
        (0..slices).flat_map(move |slice| {
            (0..rows).map(move |row| {
                let first = start + row as isize * steps[1] + slice as isize * steps[2];
                Row { first, step: steps[0], count }
            })
        })
    }

    pub(super) fn check_length(&self, given: usize) -> Result<(), ImageError> {
        let voxels = self.voxels();
        if given == voxels { Ok(()) } else { Err(ImageError::Length { given, voxels }) }
    }
}

/// A row of the file's voxels.
#[derive(Clone, Copy, Debug)]
pub(super) struct Row {
    first: isize,
    step: isize,
    count: usize,
}

impl Row {
    /// The voxels' numbers in the image, in the file's order.
    pub(super) fn places(self) -> impl Iterator<Item = usize> {
        (0..self.count).map(move |number| (self.first + number as isize * self.step) as usize)
    }
}

impl Axis {
    /// The image's vector of the file's three.
    fn along(self, stored: [DVec3; 3]) -> DVec3 {
        if self.reversed { -stored[self.number] } else { stored[self.number] }
    }
}

/// The axes of the file that are most nearly along the patient's: the order in which the sum of their
/// cosines is greatest, the first of equals.
fn nearest(directions: [DVec3; 3]) -> [Axis; 3] {
    let cosines =
        |order: [usize; 3]| -> f64 { (0..3).map(|axis| directions[order[axis]][axis].abs()).sum() };
    let mut best = ORDERS[0];
    for order in ORDERS {
        if cosines(order) > cosines(best) {
            best = order;
        }
    }
    array::from_fn(|axis| {
        let number = best[axis];
        Axis { number, reversed: directions[number][axis] < 0.0 }
    })
}

fn columns(matrix: DMat3) -> [DVec3; 3] {
    [matrix.x_axis, matrix.y_axis, matrix.z_axis]
}
