//! Voxel bone: a grid of partial densities with a pose.

mod ball;
mod bricks;
mod parts;
mod split;
#[cfg(test)]
mod tests;

use glam::Vec3;
use parry3d::math::Pose;
use thiserror::Error;

use self::ball::Ball;
use self::bricks::{Bricks, Layout, boxed};
use super::bounds::Bounds;

pub use self::ball::Voxel;
pub use self::bricks::{BRICK_SIDE, BRICK_VOXELS, Brick};
pub use self::parts::Part;

/// Why a volume cannot be built.
#[derive(Clone, Copy, Debug, Error, PartialEq)]
pub enum VolumeError {
    /// There are no voxels along an axis, or too many.
    #[error("a volume of {dims:?} voxels: each side must have 1 to {}", Volume::MAX_SIDE)]
    Side {
        /// The voxels along each axis.
        dims: [u32; 3],
    },
    /// There are too many voxels in all.
    #[error("a volume of {dims:?} voxels: there may be {} in all", Volume::MAX_VOXELS)]
    Voxels {
        /// The voxels along each axis.
        dims: [u32; 3],
    },
    /// The number of densities is not that of the voxels.
    #[error("{given} densities were given for {voxels} voxels")]
    Length {
        /// How many were given.
        given: usize,
        /// The number of voxels.
        voxels: usize,
    },
    /// A spacing is not a positive, finite number.
    #[error("a spacing of {spacing:?} m: it must be finite and positive along each axis")]
    Spacing {
        /// The distance between voxels along each axis, in metres.
        spacing: [f32; 3],
    },
    /// A part does not lie in the volume that it is to be taken out of.
    #[error("a part that ends at voxel {ends:?} of a volume of {dims:?} voxels")]
    NoSuchPart {
        /// Where it ends along each axis.
        ends: [u32; 3],
        /// The voxels along each axis.
        dims: [u32; 3],
    },
}

/// A grid of voxels, each filled to some part, with a pose.
///
/// Voxel (i, j, k) is the box from (i, j, k) to (i + 1, j + 1, k + 1) times the spacing, in the volume's
/// own axes; the pose says where their origin is. Densities are linear, from 0 (empty) to 255 (full), and
/// outside the grid they are 0. The volume's surface is where the density, interpolated between the
/// voxels' middles, is one half.
///
/// It takes about a byte a voxel, sides rounded up to whole bricks.
#[derive(Clone, Debug)]
pub struct Volume {
    bricks: Bricks,
    spacing: Vec3,
    /// Where its corner is, in metres, and how it is turned.
    pub pose: Pose,
    /// How fast it moves, in metres per second.
    pub velocity: Vec3,
    /// How far beyond its grid interactions are to look for it, in metres: the way that it is about to go,
    /// for what stops it beforehand. Usually 0.
    pub margin: f32,
}

impl Volume {
    /// The most voxels along an axis: what every graphics device of the usual limits can hold.
    pub const MAX_SIDE: u32 = 2048;
    /// The most voxels in all, so that no file's header can ask for much more than 1 GiB: 1.07 where sides
    /// are rounded up to whole bricks.
    pub const MAX_VOXELS: u64 = 1 << 30;

    /// A volume that does not move.
    ///
    /// `dims` are the voxels along x, y and z, `spacing` the distances between them in metres, and
    /// `densities` one number per voxel, x fastest.
    ///
    /// # Errors
    /// No voxels, too many along an axis or in all, another number of densities, or a spacing that is not
    /// positive and finite.
    pub fn new(
        dims: [u32; 3],
        spacing: Vec3,
        pose: Pose,
        densities: &[u8],
    ) -> Result<Self, VolumeError> {
        check(dims, spacing)?;
        let [wide, high, deep] = dims.map(|dim| dim as usize);
        let (given, voxels) = (densities.len(), wide * high * deep);
        if given != voxels {
            return Err(VolumeError::Length { given, voxels });
        }
        let number = |[x, y, z]: [u32; 3]| (z as usize * high + y as usize) * wide + x as usize;
        Self::from_fn(dims, spacing, pose, |voxel| densities[number(voxel)])
    }

    /// As [`Volume::new`], with the densities that `density` says of each voxel's place, in no
    /// particular order.
    ///
    /// # Errors
    /// As [`Volume::new`].
    pub fn from_fn(
        dims: [u32; 3],
        spacing: Vec3,
        pose: Pose,
        density: impl FnMut([u32; 3]) -> u8,
    ) -> Result<Self, VolumeError> {
        check(dims, spacing)?;
        let bricks = Bricks::from_fn(Layout { dims }, density);
        Ok(Self { bricks, spacing, pose, velocity: Vec3::ZERO, margin: 0.0 })
    }

    /// As [`Volume::from_fn`], faster where most of a volume is empty, and by several threads: `density` is asked in
    /// cells where `may_hold` says that there may be something. That is given a cell's first voxel and the voxels
    /// along each of its sides, which may reach beyond the volume. The threads are Rayon's: from a callback of an
    /// executor that runs on these, [`Volume::from_fn`] is the one to call.
    ///
    /// # Errors
    /// As [`Volume::new`].
    pub fn sparse(
        dims: [u32; 3],
        spacing: Vec3,
        pose: Pose,
        may_hold: impl Fn([u32; 3], u32) -> bool + Sync,
        density: impl Fn([u32; 3]) -> u8 + Sync,
    ) -> Result<Self, VolumeError> {
        check(dims, spacing)?;
        let bricks = Bricks::sparse(Layout { dims }, may_hold, density);
        Ok(Self { bricks, spacing, pose, velocity: Vec3::ZERO, margin: 0.0 })
    }

    /// The voxels along x, y and z.
    #[must_use]
    pub fn dims(&self) -> [u32; 3] {
        self.bricks.layout().dims
    }

    /// The bricks along x, y and z.
    #[must_use]
    pub fn brick_counts(&self) -> [u32; 3] {
        self.bricks.layout().counts()
    }

    /// The distances between voxels along x, y and z, in metres.
    #[must_use]
    pub fn spacing(&self) -> Vec3 {
        self.spacing
    }

    /// The sides' lengths, in metres.
    #[must_use]
    pub fn extent(&self) -> Vec3 {
        let [x, y, z] = self.dims().map(|dim| dim as f32);
        Vec3::new(x, y, z) * self.spacing
    }

    /// All densities, of 255, x fastest.
    pub fn densities(&self) -> impl Iterator<Item = u8> {
        let voxels = boxed(self.dims().map(|dim| 0..dim));
        voxels.map(|voxel| self.bricks.get(voxel.map(|index| index as i32)))
    }

    /// The revision of the last change to the densities, never 0. No two changes of a process share one: volumes
    /// of the same revision have the same densities. It says nothing else about the state, and differs between
    /// runs.
    #[must_use]
    pub fn revision(&self) -> u64 {
        self.bricks.revision()
    }

    /// All bricks, those along x fastest. Whoever keeps a copy keeps each brick's [`Brick::revision`] with it, and
    /// takes over those that have another one.
    pub fn bricks(&self) -> impl Iterator<Item = Brick<'_>> {
        self.bricks.iter()
    }

    /// A hash over the densities. It takes no time: it is kept up to date.
    #[must_use]
    pub fn digest(&self) -> u64 {
        self.bricks.digest()
    }

    /// The density at a point (metres), from 0 to 1, trilinear between the voxels' middles; 0 at a point
    /// that is not finite.
    #[must_use]
    pub fn density_at(&self, point: Vec3) -> f32 {
        self.interpolated(self.in_voxels(point))
    }

    /// How the density changes around a point (metres), per metre.
    ///
    /// These are differences between the densities a voxel further and a voxel back along each of the
    /// volume's axes. Unlike the exact derivative of [`Volume::density_at`], which jumps from cell to
    /// cell, they have no steps that a hand would feel or an eye would see.
    #[must_use]
    pub fn gradient_at(&self, point: Vec3) -> Vec3 {
        let at = self.in_voxels(point);
        let along = |axis: Vec3| self.interpolated(at + axis) - self.interpolated(at - axis);
        let difference = Vec3::new(along(Vec3::X), along(Vec3::Y), along(Vec3::Z));
        self.turned(difference / (self.spacing * 2.0))
    }

    /// Shows every voxel that overlaps a ball around a point, in a fixed order. Point and radius are in
    /// metres; a ball that is not finite overlaps nothing. For balls smaller than a voxel overlaps are rough.
    pub fn visit(&self, center: Vec3, radius: f32, mut visit: impl FnMut(&Voxel)) {
        let ball = self.ball(center, radius);
        let range = ball.range(self.dims());
        let voxels = self.bricks.layout().bricks_in(&range).flat_map(|(_, part)| boxed(part));
        voxels.for_each(|index| {
            let (offset, overlap) = ball.overlap(index);
            if overlap > 0.0 {
                let density = self.bricks.get(index.map(|index| index as i32));
                visit(&Voxel { index, offset, overlap, density });
            }
        });
    }

    /// Lowers the density of every voxel that [`Volume::visit`] would show, by what `amount` says of it,
    /// of 255, but to 0 at most. Returns by how much in all; 255 are a full voxel.
    ///
    /// Amounts that do not follow the voxel's density, like [`Voxel::share`], may be removed in any
    /// order: the result is the same.
    pub fn remove(
        &mut self,
        center: Vec3,
        radius: f32,
        mut amount: impl FnMut(&Voxel) -> u8,
    ) -> u64 {
        let ball = self.ball(center, radius);
        let range = ball.range(self.dims());
        self.bricks.lower(&range, |index, density| {
            let (offset, overlap) = ball.overlap(index);
            if overlap > 0.0 { amount(&Voxel { index, offset, overlap, density }) } else { 0 }
        })
    }

    /// The grid's middle, in metres.
    #[must_use]
    pub fn center(&self) -> Vec3 {
        self.to_world(self.extent() * 0.5)
    }

    /// The box around the whole grid.
    #[must_use]
    pub fn bounds(&self) -> Bounds {
        let extent = self.extent();
        Bounds::around((0..8).map(|corner| {
            let side = |axis: usize| (corner >> axis & 1) as f32 * extent[axis];
            self.to_world(Vec3::new(side(0), side(1), side(2)))
        }))
    }

    /// Whether pose, velocity and margin are finite.
    #[must_use]
    pub fn is_finite(&self) -> bool {
        self.pose.is_finite() && self.velocity.is_finite() && self.margin.is_finite()
    }

    /// A point (metres) in the volume's own axes.
    #[must_use]
    pub fn to_local(&self, point: Vec3) -> Vec3 {
        self.turned_back(point - self.pose.translation)
    }

    /// Where a point in the volume's own axes is, in metres.
    #[must_use]
    pub fn to_world(&self, local: Vec3) -> Vec3 {
        self.turned(local) + self.pose.translation
    }

    /// A direction along the volume's own axes, in the world's.
    #[must_use]
    pub fn turned(&self, local: Vec3) -> Vec3 {
        turn(&self.pose, local, 1.0)
    }

    /// A direction of the world's, in the volume's own axes.
    #[must_use]
    pub fn turned_back(&self, direction: Vec3) -> Vec3 {
        turn(&self.pose, direction, -1.0)
    }

    /// A direction as a volume of some pose would turn it.
    pub(crate) fn turned_by(pose: &Pose, local: Vec3) -> Vec3 {
        turn(pose, local, 1.0)
    }

    /// The density of a voxel, of 255; 0 outside the grid.
    #[must_use]
    pub fn density(&self, voxel: [i32; 3]) -> u8 {
        self.bricks.get(voxel)
    }

    /// The volume of a voxel, in cubic metres.
    #[must_use]
    pub fn voxel_volume(&self) -> f32 {
        self.spacing.element_product()
    }

    /// The densities of a row of voxels, where there are any: each part's first voxel along x, and its
    /// densities.
    pub(crate) fn row(&self, y: u32, z: u32) -> impl Iterator<Item = (u32, &[u8])> + use<'_> {
        self.bricks.row(0..self.dims()[0], y, z)
    }

    /// Becomes a copy of another volume, by the bricks that differ; gives up no memory unless sizes do.
    pub(crate) fn copy_from(&mut self, other: &Self) {
        self.bricks.copy_from(&other.bricks);
        self.spacing = other.spacing;
        self.pose = other.pose;
        self.velocity = other.velocity;
        self.margin = other.margin;
    }

    fn ball(&self, center: Vec3, radius: f32) -> Ball {
        Ball { center: self.to_local(center), radius, spacing: self.spacing }
    }

    /// A point in voxels from the middle of the first one.
    fn in_voxels(&self, point: Vec3) -> Vec3 {
        self.to_local(point) / self.spacing - Vec3::splat(0.5)
    }

    fn interpolated(&self, at: Vec3) -> f32 {
        let [x, y, z] = self.dims().map(|dim| dim as f32);
        // Also false for a NaN.
        let near = at.cmpgt(Vec3::splat(-1.0)).all() && at.cmplt(Vec3::new(x, y, z)).all();
        if !near {
            return 0.0;
        }
        let (low, share) = (at.floor(), at - at.floor());
        let [x, y, z] = low.to_array().map(|index| index as i32);
        let density = |dx, dy, dz| f32::from(self.bricks.get([x + dx, y + dy, z + dz]));
        let row = |dy, dz| between(density(0, dy, dz), density(1, dy, dz), share.x);
        let slice = |dz| between(row(0, dz), row(1, dz), share.y);
        between(slice(0), slice(1), share.z) / 255.0
    }
}

fn between(from: f32, to: f32, share: f32) -> f32 {
    from + (to - from) * share
}

/// A vector turned as a pose says (`sense` 1) or back (−1). The quaternion type's own product differs
/// between vector units.
fn turn(pose: &Pose, vector: Vec3, sense: f32) -> Vec3 {
    let [x, y, z, w] = pose.rotation.to_array();
    let axis = Vec3::new(x, y, z) * sense;
    let twice = axis.cross(vector) * 2.0;
    vector + twice * w + axis.cross(twice)
}

fn check(dims: [u32; 3], spacing: Vec3) -> Result<(), VolumeError> {
    check_dims(dims)?;
    if !(spacing.is_finite() && spacing.cmpgt(Vec3::ZERO).all()) {
        return Err(VolumeError::Spacing { spacing: spacing.to_array() });
    }
    Ok(())
}

fn check_dims(dims: [u32; 3]) -> Result<(), VolumeError> {
    if dims.iter().any(|dim| !(1..=Volume::MAX_SIDE).contains(dim)) {
        return Err(VolumeError::Side { dims });
    }
    if dims.iter().map(|&dim| u64::from(dim)).product::<u64>() > Volume::MAX_VOXELS {
        return Err(VolumeError::Voxels { dims });
    }
    Ok(())
}
