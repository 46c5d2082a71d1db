//! A part of a volume becomes a volume of its own.

use std::ops::Range;

use glam::Vec3;
use parry3d::math::Pose;

use super::bricks::{Bricks, Layout};
use super::parts::{NOWHERE, Part};
use super::{Volume, VolumeError, check_dims};

/// How far around a part's box, in voxels, its rim and what else claims it are looked for; usually 16: more
/// than twice the width of a surface, and of a pore of the diploe at 0.5 mm.
const MARGIN: u32 = 16;
/// A part of fewer voxels is a chip: it has no rim of its own but belongs to that of what it hangs on by
/// voxels less than half full. Usually 512: 64 mm³ at 0.5 mm.
const CHIP: u64 = 512;

/// Whose a voxel is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Owner {
    Nobody,
    Part,
    Rest,
}

impl Volume {
    /// Takes a part out: its voxels become a volume of their own at the same place, and are empty here.
    ///
    /// With them goes the rim of voxels less than half full, and the chips in it, as far as they hang
    /// on this part and are no closer to what else is solid, counted in steps from voxel to voxel by their
    /// faces. Every density goes whole to the one or stays whole in the other, so their sum is the
    /// same as before.
    ///
    /// The part must have been found in this volume. What was drilled of it since is missing.
    ///
    /// Until it is taken out that takes, beside the new volume, 2 bytes of memory for each voxel of the part's
    /// box and of 16 around it on each side, and 4 to 8 for each of these that is not empty.
    ///
    /// # Errors
    /// [`VolumeError::NoSuchPart`] for a part of another volume that reaches beyond this one's grid.
    pub fn split_off(&mut self, part: &Part) -> Result<Self, VolumeError> {
        let (ends, dims) = (part.bounds().map(|range| range.end), self.dims());
        if (0..3).any(|axis| ends[axis] > dims[axis]) {
            return Err(VolumeError::NoSuchPart { ends, dims });
        }
        let claim = Claim::new(self, part);
        let owned = |voxel: [u32; 3]| claim.owner(voxel) == Owner::Part;
        let bounds = claim.bounds();
        let margin = margin(bounds.each_ref().map(|range| range.len() as u32));
        let dims = bounds.clone().map(|range| range.len() as u32 + 2 * margin);
        let first = bounds.clone().map(|range| range.start as i32 - margin as i32);
        let bricks = Bricks::from_fn(Layout { dims }, |voxel| {
            let from: [i32; 3] = std::array::from_fn(|axis| voxel[axis] as i32 + first[axis]);
            let voxel = from.map(|index| u32::try_from(index).unwrap_or(u32::MAX));
            let inside = (0..3).all(|axis| bounds[axis].contains(&voxel[axis]));
            if inside && owned(voxel) { self.bricks.get(from) } else { 0 }
        });
        let corner = Vec3::from_array(first.map(|index| index as f32)) * self.spacing;
        let pose = Pose::from_parts(self.to_world(corner), self.pose.rotation);
        self.bricks.lower(&bounds, |voxel, density| if owned(voxel) { density } else { 0 });
        Ok(Self { bricks, spacing: self.spacing, pose, velocity: self.velocity, margin: 0.0 })
    }
}

/// The empty voxels to leave around a piece of such sides, so that its surface lies within its grid: none where that
/// would be more than a volume may have.
fn margin(sides: [u32; 3]) -> u32 {
    u32::from(check_dims(sides.map(|side| side + 2)).is_ok())
}

/// Whose the voxels around a part are. Around the region there is a layer of empty voxels, so that every
/// voxel in it has neighbours.
struct Claim {
    region: [Range<u32>; 3],
    densities: Vec<u8>,
    owners: Vec<Owner>,
    /// The voxels that somebody owns, in the order in which they were claimed.
    owned: Vec<u32>,
}

impl Claim {
    fn new(volume: &Volume, part: &Part) -> Self {
        let (dims, around) = (volume.dims(), part.bounds());
        let region: [Range<u32>; 3] = std::array::from_fn(|axis| {
            let Range { start, end } = around[axis];
            start.saturating_sub(MARGIN)..(end + MARGIN).min(dims[axis])
        });
        let cells = region.iter().map(|range| range.len() + 2).product();
        let (densities, owners) = (vec![0; cells], vec![Owner::Nobody; cells]);
        let mut claim = Self { region, densities, owners, owned: Vec::new() };
        claim.copy(volume);
        claim.mark(part, Owner::Part);
        for other in volume.parts(claim.region.clone()) {
            // The part itself, or what it was cut off from by the border of the box that was searched.
            if other.touches_border() || other.voxels() >= CHIP {
                claim.mark(&other, Owner::Rest);
            }
        }
        claim.spread();
        claim
    }

    /// From a voxel to the next along each axis.
    fn strides(&self) -> [usize; 3] {
        let [wide, high, _] = self.region.each_ref().map(|range| range.len() + 2);
        [1, wide, wide * high]
    }

    fn cell(&self, voxel: [u32; 3]) -> usize {
        let strides = self.strides();
        let along = |axis: usize| (voxel[axis] - self.region[axis].start + 1) as usize;
        (0..3).map(|axis| along(axis) * strides[axis]).sum()
    }

    fn owner(&self, voxel: [u32; 3]) -> Owner {
        let inside = (0..3).all(|axis| self.region[axis].contains(&voxel[axis]));
        if inside { self.owners[self.cell(voxel)] } else { Owner::Nobody }
    }

    /// Takes over the densities.
    fn copy(&mut self, volume: &Volume) {
        let [xs, ys, zs] = self.region.clone();
        for (z, y) in zs.flat_map(|z| ys.clone().map(move |y| (z, y))) {
            for (x, row) in volume.bricks.row(xs.clone(), y, z) {
                let first = self.cell([x, y, z]);
                self.densities[first..first + row.len()].copy_from_slice(row);
            }
        }
    }

    /// Gives it what of a part nobody owns yet.
    fn mark(&mut self, part: &Part, owner: Owner) {
        for run in part.runs() {
            let first = self.cell([run.xs.start, run.y, run.z]);
            for cell in first..first + run.xs.len() {
                if self.owners[cell] == Owner::Nobody {
                    self.owners[cell] = owner;
                    self.owned.push(cell as u32);
                }
            }
        }
    }

    /// Gives every voxel that is not empty to whom it can be reached from in the fewest steps; at equal
    /// distance to the part.
    fn spread(&mut self) {
        let strides = self.strides();
        let mut next = 0;
        while let Some(&cell) = self.owned.get(next) {
            next += 1;
            let cell = cell as usize;
            for stride in strides {
                for neighbour in [cell - stride, cell + stride] {
                    let free = self.owners[neighbour] == Owner::Nobody;
                    if free && self.densities[neighbour] > 0 {
                        self.owners[neighbour] = self.owners[cell];
                        self.owned.push(neighbour as u32);
                    }
                }
            }
        }
    }

    /// The box around what is the part's.
    fn bounds(&self) -> [Range<u32>; 3] {
        let [_, wide, flat] = self.strides();
        let mut bounds = [NOWHERE; 3];
        let cells = self.owned.iter().map(|&cell| cell as usize);
        for cell in cells.filter(|&cell| self.owners[cell] == Owner::Part) {
            let place = [cell % wide, cell % flat / wide, cell / flat];
            for (axis, range) in bounds.iter_mut().enumerate() {
                let index = place[axis] as u32 + self.region[axis].start - 1;
                *range = index.min(range.start)..range.end.max(index + 1);
            }
        }
        bounds
    }
}

#[cfg(test)]
mod tests {
    use super::margin;

    #[test]
    fn a_piece_with_its_margin_is_a_volume() {
        for (sides, expected) in [
            ([1; 3], 1),
            ([2046, 1, 1], 1),
            ([2047, 1, 1], 0),
            ([1022; 3], 1),
            ([1023; 3], 0),
            ([1024; 3], 0),
        ] {
            assert_eq!(margin(sides), expected, "{sides:?}");
        }
    }
}
