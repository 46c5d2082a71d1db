//! The skull's vault as voxel bone, and back into the image.

use glam::Vec3;
use parry3d::math::Pose;

use super::error::HeadError;
use super::frame::{Field, UP, parts};
use super::layers::Layers;
use crate::geometry::{BRICK_SIDE, Bounds, Volume};
use crate::image::{AIR, ImageError, room};

/// The distance between voxels, in metres; usually 0.5 mm, at which a burr's force is smooth.
pub(super) const SPACING: f32 = 0.000_5;
/// How far below the middle of the head the vault goes, in metres; usually 40 mm: the temporal bone's
/// squama is in it, the skull base for the most part is not.
const BELOW: f32 = 0.04;
/// The room around the bone, in metres; usually 3 mm.
const MARGIN: f32 = 0.003;

/// Where the voxels of a skull are.
#[derive(Clone, Copy, Debug)]
pub(super) struct Lattice {
    pub(super) dims: [u32; 3],
    corner: Vec3,
}

impl Lattice {
    /// The box around the bone above the skull base.
    pub(super) fn around(layers: &Layers) -> Self {
        let floor = -BELOW;
        let mut bounds = Bounds::EMPTY;
        for (direction, radius) in layers.outer.nodes() {
            let point = direction * radius;
            if parts(point)[2] >= floor {
                bounds = bounds.union(&Bounds { min: point, max: point });
            }
        }
        let mut bounds = bounds.inflated(MARGIN);
        bounds.min += UP * (floor - parts(bounds.min)[2]);
        let dims = ((bounds.max - bounds.min) / SPACING).ceil().to_array().map(|side| side as u32);
        Self { dims, corner: bounds.min }
    }

    /// The middle of a voxel, in the world.
    fn place(&self, voxel: [u32; 3]) -> Vec3 {
        let [x, y, z] = voxel.map(|index| (index as f32 + 0.5) * SPACING);
        self.corner + Vec3::new(x, y, z)
    }

    /// The voxel that a place in the world is in.
    fn voxel(&self, place: Vec3) -> Option<[u32; 3]> {
        let voxel = ((place - self.corner) / SPACING).floor().to_array();
        let inside = (0..3).all(|axis| voxel[axis] >= 0.0 && voxel[axis] < self.dims[axis] as f32);
        inside.then(|| voxel.map(|index| index as u32))
    }

    fn number(&self, [x, y, z]: [u32; 3]) -> usize {
        let [wide, high, _] = self.dims;
        (z as usize * high as usize + y as usize) * wide as usize + x as usize
    }
}

/// The bone of an image at a lattice's voxels.
pub(super) struct Bone<'a> {
    pub(super) lattice: Lattice,
    pub(super) field: Field<'a, u8>,
    occupied: Vec<bool>,
    blocks: [usize; 3],
}

/// The side of a block of an image's voxels, of which it is known whether any holds bone.
const BLOCK: usize = 2;

impl<'a> Bone<'a> {
    pub(super) fn new(lattice: Lattice, field: Field<'a, u8>) -> Result<Self, ImageError> {
        let dims = field.dims.map(|side| side as usize);
        let blocks = dims.map(|side| side.div_ceil(BLOCK));
        let count = blocks.iter().product();
        let mut occupied = room(count)?;
        occupied.resize(count, false);
        for (row, densities) in field.voxels.chunks_exact(dims[0]).enumerate() {
            let (y, z) = (row % dims[1] / BLOCK, row / dims[1] / BLOCK);
            let first = (z * blocks[1] + y) * blocks[0];
            for (block, densities) in densities.chunks(BLOCK).enumerate() {
                occupied[first + block] |= densities.iter().any(|&density| density > 0);
            }
        }
        Ok(Self { lattice, field, occupied, blocks })
    }

    /// The density of a voxel, of 255.
    fn density(&self, voxel: [u32; 3]) -> u8 {
        self.density_at(self.lattice.place(voxel))
    }

    /// The density at a place in the world, of 255.
    fn density_at(&self, place: Vec3) -> u8 {
        (self.field.at(place) + 0.5) as u8
    }

    /// Whether the voxels from `first` on, so many along each axis, may hold bone; `false` only if they hold
    /// none.
    fn may_hold(&self, first: [u32; 3], side: u32) -> bool {
        let corners = (0..8).map(|corner| {
            let at = [0, 1, 2].map(|axis| first[axis] + (corner >> axis & 1) * side);
            self.field.frame.voxel(self.lattice.place(at))
        });
        let (low, high) = corners.fold(([f32::MAX; 3], [f32::MIN; 3]), |(low, high), at| {
            let axes = [0, 1, 2];
            (axes.map(|axis| low[axis].min(at[axis])), axes.map(|axis| high[axis].max(at[axis])))
        });
        // A voxel's density reaches one voxel far.
        let block = |at: f32, axis: usize| (at.max(0.0) as usize / BLOCK).min(self.blocks[axis]);
        let [xs, ys, zs] = [0, 1, 2].map(|axis| {
            block(low[axis] - 1.0, axis)..(block(high[axis] + 2.0, axis) + 1).min(self.blocks[axis])
        });
        zs.into_iter().any(|z| {
            ys.clone().any(|y| {
                let row = (z * self.blocks[1] + y) * self.blocks[0];
                self.occupied[row + xs.start.min(xs.end)..row + xs.end].contains(&true)
            })
        })
    }

    /// The skull, at rest in the world.
    pub(super) fn volume(&self) -> Result<Volume, HeadError> {
        let Lattice { dims, corner } = self.lattice;
        let pose = Pose::from_translation(corner);
        let may_hold = |first, side| self.may_hold(first, side);
        let density = |voxel| self.density(voxel);
        Ok(Volume::sparse(dims, Vec3::splat(SPACING), pose, may_hold, density)?)
    }

    /// What is gone of each voxel's density: what is left of it is in `skull`, and in `also` where they
    /// are now.
    fn gone(&self, skull: &Volume, also: &[&Volume]) -> Result<Vec<u8>, ImageError> {
        let count = self.lattice.dims.iter().map(|&side| side as usize).product();
        let mut gone = room(count)?;
        gone.resize(count, 0);
        for brick in skull.bricks() {
            if !self.may_hold(brick.first(), BRICK_SIDE) {
                continue;
            }
            let (first, size) = (brick.first(), brick.size());
            for (slot, &left) in brick.densities.iter().enumerate() {
                let side = BRICK_SIDE as usize;
                let within = [slot % side, slot / side % side, slot / (side * side)];
                let within = within.map(|index| index as u32);
                if (0..3).any(|axis| within[axis] >= size[axis]) {
                    continue;
                }
                let voxel = [0, 1, 2].map(|axis| first[axis] + within[axis]);
                let missing = self.density(voxel).saturating_sub(left);
                if missing > 0 {
                    let place = self.lattice.place(voxel);
                    let elsewhere: f32 = also.iter().map(|piece| piece.density_at(place)).sum();
                    let elsewhere = (255.0 * elsewhere + 0.5) as u8;
                    gone[self.lattice.number(voxel)] = missing.saturating_sub(elsewhere);
                }
            }
        }
        Ok(gone)
    }

    /// Lowers an image's numbers where bone is gone, by the share of each voxel's bone that is: towards
    /// air. `to_world` says where a voxel is, and `samples` how finely it is looked at along each axis.
    pub(super) fn carve(
        &self,
        hounsfield: &mut [i16],
        skull: &Volume,
        also: &[&Volume],
        to_world: impl Fn([f64; 3]) -> Vec3,
        samples: [u32; 3],
    ) -> Result<(), ImageError> {
        let gone = self.gone(skull, also)?;
        let [wide, high, _] = self.field.dims.map(|side| side as usize);
        for (number, hounsfield) in hounsfield.iter_mut().enumerate() {
            if self.field.voxels[number] == 0 {
                continue;
            }
            let voxel = [number % wide, number / wide % high, number / (wide * high)];
            let place = |sample: u32| {
                let [x, y, _] = samples;
                let part = [sample % x, sample / x % y, sample / (x * y)];
                let at = [0, 1, 2].map(|axis| {
                    let share = (f64::from(part[axis]) + 0.5) / f64::from(samples[axis]);
                    voxel[axis] as f64 - 0.5 + share
                });
                to_world(at)
            };
            let places = || (0..samples.iter().product()).map(place);
            let within = places().filter_map(|place| self.lattice.voxel(place));
            let missing: u32 = within.map(|at| u32::from(gone[self.lattice.number(at)])).sum();
            if missing > 0 {
                // A voxel may hold bone outside of the lattice, too, which stays.
                let density = |place| match self.lattice.voxel(place) {
                    Some(voxel) => self.density(voxel),
                    None => self.density_at(place),
                };
                let all: u32 = places().map(|place| u32::from(density(place))).sum();
                let left = f64::from(all.saturating_sub(missing)) / f64::from(all.max(1));
                let above_air = f64::from(*hounsfield) - f64::from(AIR);
                *hounsfield = (f64::from(AIR) + above_air.max(0.0) * left).round() as i16;
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use glam::{DAffine3, DVec3};

    use super::*;
    use crate::image::Grid;
    use crate::scene::head::frame::Frame;

    /// Slices of 5 mm, all bone, and a lattice that begins half a millimetre below the second one's top.
    #[test]
    fn bone_below_the_lattice_stays() {
        const SLICE: f64 = 0.005;
        let dims = [3, 3, 4];
        let affine = DAffine3::from_scale(DVec3::splat(SLICE));
        let frame = Frame::new(&Grid::new(dims, affine).expect("allowed"), DVec3::ZERO);
        let field = Field { voxels: &[255; 36], dims, frame, outside: 0 };
        // From the patient's left, back and foot; the middle of the first voxel is the origin.
        let corner = Vec3::new(-0.0125, -0.0025, 0.007);
        let bone = Bone::new(Lattice { dims: [30, 30, 21], corner }, field).expect("few voxels");
        let mut skull = bone.volume().expect("few voxels");
        skull.remove(Vec3::ZERO, 1.0, |_| 255);
        let to_world = |at| Frame::in_world(DVec3::ZERO, DVec3::from(at) * SLICE);
        let mut hounsfield = [1_000; 36];
        bone.carve(&mut hounsfield, &skull, &[], to_world, [10; 3]).expect("few voxels");
        let middle: Vec<i16> = (0..4).map(|slice| hounsfield[9 * slice + 4]).collect();
        assert_eq!(middle[..3], [1_000, 800, AIR]);
    }
}
