//! A part of a volume becomes a volume of its own.

use std::collections::VecDeque;
use std::ops::Range;

use glam::Vec3;
use parry3d::math::Pose;

use super::Volume;
use super::bricks::{Bricks, Layout, boxed};
use super::parts::Part;

/// How far around a part, in voxels, its rim and what else claims it are looked for; usually 8, which is
/// more than a surface is wide and than a pore of the diploe at 0.5 mm.
const MARGIN: u32 = 8;
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
    /// on this part and are closer to it than to what else is solid, counted in steps from voxel to voxel by
    /// their faces. Every density goes whole to the one or stays whole in the other, so their sum is the
    /// same as before.
    ///
    /// The part must have been found in this volume as it is now; of one that was drilled since, what
    /// is left goes.
    pub fn split_off(&mut self, part: &Part) -> Self {
        let claim = Claim::new(self, part);
        let owned = |voxel: [u32; 3]| claim.owner(voxel) == Owner::Part;
        let bounds = claim.bounds();
        // An empty voxel around it, so that its surface lies within its grid.
        let margin = u32::from(bounds.iter().all(|range| range.len() as u32 + 2 <= Self::MAX_SIDE));
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
        Self { bricks, spacing: self.spacing, pose, velocity: self.velocity }
    }
}

/// Whose the voxels around a part are.
struct Claim {
    region: [Range<u32>; 3],
    owners: Vec<Owner>,
    bounds: [Range<u32>; 3],
}

impl Claim {
    fn new(volume: &Volume, part: &Part) -> Self {
        let (dims, around) = (volume.dims(), part.bounds());
        let region = std::array::from_fn(|axis| {
            let Range { start, end } = around[axis];
            start.saturating_sub(MARGIN)..(end + MARGIN).min(dims[axis])
        });
        let cells = region.iter().map(Range::len).product();
        let bounds = part.bounds();
        let mut claim = Self { region, owners: vec![Owner::Nobody; cells], bounds };
        claim.mark(part, Owner::Part);
        for other in volume.parts(claim.region.clone()) {
            let run = &other.runs()[0];
            let same = claim.owner([run.xs.start, run.y, run.z]) == Owner::Part;
            if !same && (other.touches_border() || other.voxels() >= CHIP) {
                claim.mark(&other, Owner::Rest);
            }
        }
        claim.spread(volume);
        claim
    }

    /// The box around what is the part's.
    fn bounds(&self) -> [Range<u32>; 3] {
        self.bounds.clone()
    }

    fn cell(&self, voxel: [u32; 3]) -> Option<usize> {
        let inside = (0..3).all(|axis| self.region[axis].contains(&voxel[axis]));
        let [x, y, z]: [usize; 3] =
            std::array::from_fn(|axis| voxel[axis].wrapping_sub(self.region[axis].start) as usize);
        let [wide, high, _] = self.region.each_ref().map(Range::len);
        inside.then(|| (z * high + y) * wide + x)
    }

    fn owner(&self, voxel: [u32; 3]) -> Owner {
        self.cell(voxel).map_or(Owner::Nobody, |cell| self.owners[cell])
    }

    fn mark(&mut self, part: &Part, owner: Owner) {
        for run in part.runs() {
            for x in run.xs.clone() {
                if let Some(cell) = self.cell([x, run.y, run.z]) {
                    self.owners[cell] = owner;
                }
            }
        }
    }

    /// Gives every voxel that is not empty to whom it can be reached from in the fewest steps; at equal
    /// distance to whom the search comes from first, in the order of the voxels.
    fn spread(&mut self, volume: &Volume) {
        let owned = |voxel: &[u32; 3]| self.owner(*voxel) != Owner::Nobody;
        let mut front: VecDeque<[u32; 3]> = boxed(self.region.clone()).filter(owned).collect();
        while let Some(voxel) = front.pop_front() {
            let owner = self.owner(voxel);
            for (axis, step) in [(0, -1), (0, 1), (1, -1), (1, 1), (2, -1), (2, 1)] {
                let mut next = voxel;
                next[axis] = next[axis].wrapping_add_signed(step);
                let Some(cell) = self.cell(next) else { continue };
                let density = volume.bricks.get(next.map(|index| index as i32));
                if self.owners[cell] == Owner::Nobody && density > 0 {
                    self.owners[cell] = owner;
                    self.widen(next, owner);
                    front.push_back(next);
                }
            }
        }
    }

    fn widen(&mut self, voxel: [u32; 3], owner: Owner) {
        if owner == Owner::Part {
            for (bounds, index) in self.bounds.iter_mut().zip(voxel) {
                *bounds = bounds.start.min(index)..bounds.end.max(index + 1);
            }
        }
    }
}
