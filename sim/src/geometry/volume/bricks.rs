//! The voxels' memory: cubes of voxels, each of which knows when it last changed.

use std::ops::Range;
use std::sync::atomic::{AtomicU64, Ordering};

use rayon::prelude::*;

use crate::mix::mix;
use crate::parallel::on_all_cores;

/// The side of a brick, in voxels: a brick is a page of 4 KiB, small enough that a drill changes few
/// of its neighbours, and large enough that its header of 16 bytes and its upload's call weigh little.
pub const BRICK_SIDE: u32 = 16;

/// The voxels of a brick.
pub const BRICK_VOXELS: usize = (BRICK_SIDE * BRICK_SIDE * BRICK_SIDE) as usize;

/// The side of a cell, in voxels: what is left out together where there is nothing.
const CELL_SIDE: u32 = BRICK_SIDE / 2;

/// A brick of a volume, as a renderer sees it.
#[derive(Clone, Copy, Debug)]
pub struct Brick<'a> {
    layout: Layout,
    number: usize,
    /// That of its last change. No two changes of a process share one, so that of two bricks of the same
    /// revision at the same place, be it of one volume at two times or of two copies that went different ways, the
    /// densities are the same. It is never 0.
    pub revision: u64,
    /// The greatest density in it, of 255.
    pub peak: u8,
    /// The densities, of 255: [`BRICK_SIDE`] slices of as many rows of as many voxels whatever the
    /// brick's size, x fastest; 0 past the size.
    pub densities: &'a [u8; BRICK_VOXELS],
}

impl Brick<'_> {
    /// Its place among the bricks.
    #[must_use]
    pub fn place(&self) -> [u32; 3] {
        self.layout.place(self.number)
    }

    /// The volume's voxel that is the brick's first.
    #[must_use]
    pub fn first(&self) -> [u32; 3] {
        self.place().map(|place| place * BRICK_SIDE)
    }

    /// Its voxels along each axis: [`BRICK_SIDE`], or fewer at the volume's far sides.
    #[must_use]
    pub fn size(&self) -> [u32; 3] {
        let place = self.place();
        std::array::from_fn(|axis| self.layout.span(place[axis], axis).len() as u32)
    }

    /// Whether all its voxels are empty.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.peak == 0
    }
}

/// What is known of a brick; see [`Brick`].
#[derive(Clone, Copy, Debug)]
struct Header {
    revision: u64,
    peak: u8,
}

/// Where the voxels of a grid lie in bricks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Layout {
    pub(super) dims: [u32; 3],
}

impl Layout {
    /// The bricks along each axis.
    pub(super) fn counts(self) -> [u32; 3] {
        self.dims.map(|dim| dim.div_ceil(BRICK_SIDE))
    }

    /// A brick's number.
    fn brick(self, [x, y, z]: [u32; 3]) -> usize {
        let [wide, high, _] = self.counts().map(|count| count as usize);
        (z as usize * high + y as usize) * wide + x as usize
    }

    /// A brick's place.
    fn place(self, brick: usize) -> [u32; 3] {
        let [wide, high, _] = self.counts().map(|count| count as usize);
        [brick % wide, brick / wide % high, brick / (wide * high)].map(|place| place as u32)
    }

    /// The voxels of a brick along one axis.
    fn span(self, place: u32, axis: usize) -> Range<u32> {
        let first = place * BRICK_SIDE;
        first..(first + BRICK_SIDE).min(self.dims[axis])
    }

    /// The voxels of a box, brick by brick: each brick's number and its part of the box.
    pub(super) fn bricks_in(
        self,
        range: &[Range<u32>; 3],
    ) -> impl Iterator<Item = (usize, [Range<u32>; 3])> + use<'_> {
        let touched =
            |axis: usize| range[axis].start / BRICK_SIDE..range[axis].end.div_ceil(BRICK_SIDE);
        let places = touched(2)
            .flat_map(move |z| touched(1).flat_map(move |y| touched(0).map(move |x| [x, y, z])));
        places.map(move |place| {
            let part = std::array::from_fn(|axis| {
                let own = self.span(place[axis], axis);
                own.start.max(range[axis].start)..own.end.min(range[axis].end)
            });
            (self.brick(place), part)
        })
    }
}

/// A voxel's number in its brick.
fn slot(voxel: [u32; 3]) -> usize {
    let [x, y, z] = voxel.map(|index| (index % BRICK_SIDE) as usize);
    let side = BRICK_SIDE as usize;
    (z * side + y) * side + x
}

/// The densities of a grid of voxels, in bricks.
#[derive(Clone, Debug)]
pub(super) struct Bricks {
    layout: Layout,
    voxels: Vec<[u8; BRICK_VOXELS]>,
    headers: Vec<Header>,
    /// That of the last change.
    revision: u64,
    digest: u64,
}

impl Bricks {
    /// A grid of at least one voxel along each axis, with the densities that `density` says.
    pub(super) fn from_fn(layout: Layout, mut density: impl FnMut([u32; 3]) -> u8) -> Self {
        let bricks: usize = layout.counts().iter().map(|&count| count as usize).product();
        let revision = new_revision();
        let mut voxels = vec![[0; BRICK_VOXELS]; bricks];
        let mut digest = 0_u64;
        for (brick, densities) in voxels.iter_mut().enumerate() {
            let place = layout.place(brick);
            let spans = std::array::from_fn(|axis| layout.span(place[axis], axis));
            boxed(spans).for_each(|voxel| {
                let (slot, density) = (slot(voxel), density(voxel));
                densities[slot] = density;
                digest = digest.wrapping_add(part_of_digest(brick, slot, density));
            });
        }
        let header = |densities| Header { revision, peak: peak(densities) };
        let headers = voxels.iter().map(header).collect();
        Self { layout, voxels, headers, revision, digest }
    }

    /// As [`Bricks::from_fn`], several bricks at once; what `density` says counts in cells where `may_hold`, given
    /// their first voxel and their side, says so, and all others are empty.
    pub(super) fn sparse(
        layout: Layout,
        may_hold: impl Fn([u32; 3], u32) -> bool + Sync,
        density: impl Fn([u32; 3]) -> u8 + Sync,
    ) -> Self {
        let bricks: usize = layout.counts().iter().map(|&count| count as usize).product();
        let revision = new_revision();
        let mut voxels = vec![[0; BRICK_VOXELS]; bricks];
        let fill = |(brick, densities): (usize, &mut [u8; BRICK_VOXELS])| {
            let mut digest = 0_u64;
            for cell in boxed(layout.place(brick).map(|place| 2 * place..2 * place + 2)) {
                let first = cell.map(|index| index * CELL_SIDE);
                if !may_hold(first, CELL_SIDE) {
                    continue;
                }
                let end = |axis: usize| (first[axis] + CELL_SIDE).min(layout.dims[axis]);
                boxed(std::array::from_fn(|axis| first[axis]..end(axis))).for_each(|voxel| {
                    let (slot, density) = (slot(voxel), density(voxel));
                    densities[slot] = density;
                    digest = digest.wrapping_add(part_of_digest(brick, slot, density));
                });
            }
            (Header { revision, peak: peak(densities) }, digest)
        };
        let (headers, digests): (Vec<Header>, Vec<u64>) =
            on_all_cores(|| voxels.par_iter_mut().enumerate().map(fill).unzip());
        let digest = digests.into_iter().fold(0, u64::wrapping_add);
        Self { layout, voxels, headers, revision, digest }
    }

    pub(super) fn layout(&self) -> Layout {
        self.layout
    }

    pub(super) fn revision(&self) -> u64 {
        self.revision
    }

    /// A hash over all densities, kept up to date with every change: the sum of each voxel's density
    /// times an odd number of its own (multilinear hashing: Carter and Wegman 1979). Odd, so that the
    /// change of one voxel always shows.
    pub(super) fn digest(&self) -> u64 {
        self.digest
    }

    /// The density of a voxel; 0 outside.
    pub(super) fn get(&self, voxel: [i32; 3]) -> u8 {
        let voxel = voxel.map(|index| u32::try_from(index).unwrap_or(u32::MAX));
        if (0..3).any(|axis| voxel[axis] >= self.layout.dims[axis]) {
            return 0;
        }
        let brick = self.layout.brick(voxel.map(|index| index / BRICK_SIDE));
        self.voxels[brick][slot(voxel)]
    }

    /// The densities of a row of voxels, as far as they lie in bricks that are not empty: each part's first
    /// voxel along x, and its densities.
    pub(super) fn row(
        &self,
        xs: Range<u32>,
        y: u32,
        z: u32,
    ) -> impl Iterator<Item = (u32, &[u8])> + use<'_> {
        let bricks = xs.start / BRICK_SIDE..xs.end.div_ceil(BRICK_SIDE);
        bricks.filter_map(move |along| {
            let first = xs.start.max(along * BRICK_SIDE);
            let end = xs.end.min((along + 1) * BRICK_SIDE);
            let brick = self.layout.brick([first, y, z].map(|index| index / BRICK_SIDE));
            let start = slot([first, y, z]);
            let there = self.headers[brick].peak > 0;
            there.then(|| (first, &self.voxels[brick][start..start + (end - first) as usize]))
        })
    }

    pub(super) fn iter(&self) -> impl Iterator<Item = Brick<'_>> {
        let bricks = self.headers.iter().zip(&self.voxels).enumerate();
        // Whoever looks for those that changed asks where few of many are: that is found out then.
        bricks.map(|(number, (&Header { revision, peak }, densities))| Brick {
            layout: self.layout,
            number,
            revision,
            peak,
            densities,
        })
    }

    /// Lowers the densities of the voxels in a box, by what `amount` says of a voxel and its density,
    /// and to 0 at most; says by how much in all.
    pub(super) fn lower(
        &mut self,
        range: &[Range<u32>; 3],
        mut amount: impl FnMut([u32; 3], u8) -> u8,
    ) -> u64 {
        let mut total = 0;
        let mut revision = None;
        for (brick, part) in self.layout.bricks_in(range) {
            let densities = &mut self.voxels[brick];
            let before = total;
            boxed(part).for_each(|voxel| {
                let density = &mut densities[slot(voxel)];
                let removed = amount(voxel, *density).min(*density);
                *density -= removed;
                let part = part_of_digest(brick, slot(voxel), removed);
                self.digest = self.digest.wrapping_sub(part);
                total += u64::from(removed);
            });
            if total > before {
                let revision = *revision.get_or_insert_with(new_revision);
                self.headers[brick] = Header { revision, peak: peak(densities) };
                self.revision = revision;
            }
        }
        total
    }

    /// Becomes a copy of another grid: of its bricks that differ, where their sizes are the same.
    pub(super) fn copy_from(&mut self, other: &Self) {
        if self.layout != other.layout {
            self.clone_from(other);
            return;
        }
        let from = other.headers.iter().zip(&other.voxels);
        for ((to_header, to), (header, densities)) in
            self.headers.iter_mut().zip(&mut self.voxels).zip(from)
        {
            if to_header.revision != header.revision {
                *to = *densities;
                *to_header = *header;
            }
        }
        self.revision = other.revision;
        self.digest = other.digest;
    }
}

/// The voxels of a box, x fastest.
pub(super) fn boxed([xs, ys, zs]: [Range<u32>; 3]) -> impl Iterator<Item = [u32; 3]> {
    zs.flat_map(move |z| {
        let xs = xs.clone();
        ys.clone().flat_map(move |y| xs.clone().map(move |x| [x, y, z]))
    })
}

fn peak(densities: &[u8; BRICK_VOXELS]) -> u8 {
    densities.iter().fold(0, |peak, &density| peak.max(density))
}

fn part_of_digest(brick: usize, slot: usize, density: u8) -> u64 {
    if density == 0 {
        return 0;
    }
    let number = (brick * BRICK_VOXELS + slot) as u64;
    (mix(number) | 1).wrapping_mul(u64::from(density))
}

/// A number that no other call gives, and never 0. It is of the whole process and not of a volume, so that a
/// volume which takes the place of another is seen as changed all over, and copies that go different ways are
/// told apart.
fn new_revision() -> u64 {
    static LAST: AtomicU64 = AtomicU64::new(0);
    // Relaxed: no two may be equal, which the one variable's modification order gives. Nothing else is
    // published by it.
    LAST.fetch_add(1, Ordering::Relaxed) + 1
}
