//! From the middle of the head outwards: where the layers are.

use glam::{DVec3, Vec3};

use super::frame::{FRONT, Field, Frame, RIGHT, UP};
use super::radial::{RadialMap, tangents};
use crate::image::Grid;

/// The distance of samples along a ray, in metres; usually 0.5 mm.
const STEP: f32 = 0.000_5;
/// The density of bone's surface, of 255.
const SURFACE: f32 = 127.5;
/// The widest gap of soft tissue within the skull, in metres; usually 6 mm: marrow is that thick, and
/// the muscle under the cheek's arch is thicker.
const MARROW: f32 = 0.006;
/// The thickest skull with a sinus in it, in metres; usually 25 mm.
const THICKEST: f32 = 0.025;
/// How much air ends the head, in metres; usually 1.5 mm.
const AIR: f32 = 0.001_5;
/// The farthest from the skull that skin is sought, in metres; usually 80 mm.
const SOFT: f32 = 0.08;
/// Where the middle of the head is, below the inside of the vertex, as a part of the cranium's length;
/// usually 0.45: some 75 mm, the level of the frontal sinus.
const DEPTH: f64 = 0.45;

/// The fields that rays are cast through.
pub(super) struct Rays<'a> {
    pub(super) bone: Field<'a, u8>,
    pub(super) hounsfield: Field<'a, i16>,
    /// The Hounsfield number of the skin's surface, in HU.
    pub(super) air: f32,
    /// Where rays begin, in metres from the middle.
    pub(super) start: f32,
    /// Where the inner table is at the farthest, in metres from the middle.
    pub(super) end: f32,
}

/// Three surfaces around the middle of the head.
#[derive(Clone, Debug)]
pub(super) struct Layers {
    /// The skull's inner table.
    pub(super) inner: RadialMap,
    /// Its outer table.
    pub(super) outer: RadialMap,
    /// The skin.
    pub(super) skin: RadialMap,
}

impl Rays<'_> {
    /// The radii of inner table, outer table and skin along a unit vector; what is not found is not a
    /// number.
    fn cast(&self, direction: Vec3) -> [f32; 3] {
        let Some(inner) = self.inner(direction) else { return [f32::NAN; 3] };
        let outer = self.outer(direction, inner);
        [inner, outer, self.skin(direction, outer)]
    }

    /// Where bone begins.
    pub(super) fn inner(&self, direction: Vec3) -> Option<f32> {
        let mut before = 0.0;
        for radius in steps(self.start, self.end) {
            let density = self.bone.at(direction * radius);
            if density >= SURFACE {
                return Some(radius - STEP * (density - SURFACE) / (density - before).max(1.0));
            }
            before = density;
        }
        None
    }

    /// Where bone ends for the last time, across marrow and sinuses.
    fn outer(&self, direction: Vec3, inner: f32) -> f32 {
        let (mut outer, mut gap, mut before) = (inner, 0.0, SURFACE);
        for radius in steps(inner + STEP, inner + THICKEST) {
            let density = self.bone.at(direction * radius);
            if density >= SURFACE {
                (outer, gap) = (radius, 0.0);
            } else {
                if before >= SURFACE {
                    outer = radius - STEP * (SURFACE - density) / (before - density).max(1.0);
                }
                let is_air = self.hounsfield.at(direction * radius) < self.air;
                gap += if is_air { 0.0 } else { STEP };
                if gap > MARROW {
                    break;
                }
            }
            before = density;
        }
        outer
    }

    /// Where air begins that is no bubble.
    fn skin(&self, direction: Vec3, outer: f32) -> f32 {
        let mut skin = None;
        let mut before = self.air;
        for radius in steps(outer, outer + SOFT) {
            let number = self.hounsfield.at(direction * radius);
            match skin {
                None if number < self.air => {
                    skin = Some(radius - STEP * (self.air - number) / (before - number).max(1.0));
                }
                Some(_) if number >= self.air => skin = None,
                Some(found) if radius - found >= AIR => return found,
                _ => {}
            }
            before = number;
        }
        skin.unwrap_or(f32::NAN)
    }

    /// The share of the directions upwards in which there is bone.
    pub(super) fn enclosed(&self) -> f32 {
        let (mut all, mut found) = (0.0, 0.0);
        let side = 16;
        for cell in 0..side * side {
            let coordinate = |index: i32| (2 * index + 1) as f32 / side as f32 - 1.0;
            let sideways = RIGHT * coordinate(cell % side) + FRONT * coordinate(cell / side);
            all += 1.0;
            found += f32::from(u8::from(self.inner((sideways + UP).normalize()).is_some()));
        }
        found / all
    }

    /// The layers in all directions, without leaks: where a ray meets no bone the layers go on as they
    /// are around, and what is less than about 6° wide, a hole or a spike, goes. So they do not follow
    /// holes of more than that, orbits and what is below the skull base.
    pub(super) fn layers(&self) -> Layers {
        let [inner, outer, skin] = RadialMap::several(|direction| self.cast(direction));
        let smooth = |map: RadialMap| map.filled().median(2).mean(1);
        // Thicknesses are smoother than radii: one layer's bump is also the next one's.
        let bone = outer.with(&inner, |outer, inner| outer - inner);
        let soft = skin.with(&inner, |skin, inner| skin - inner).with(&bone, |a, b| a - b);
        let inner = smooth(inner);
        let outer = smooth(bone).with(&inner, |bone, inner| inner + bone.max(MIN_THICKNESS));
        let skin = smooth(soft).with(&outer, |soft, outer| outer + soft.max(MIN_THICKNESS));
        Layers { inner, outer, skin }
    }

    /// The middle of the cranium, seen from a place within: half way between its sides and between its
    /// front and its back, and [`DEPTH`] below its top; metres.
    pub(super) fn middle(&self) -> Vec3 {
        let across = |axis: Vec3| Some((self.wall(axis)?, self.wall(-axis)?));
        let half_way = |axis: Vec3| across(axis).map_or(0.0, |(to, from)| 0.5 * (to - from));
        let length = across(FRONT).map(|(to, from)| to + from);
        let up = self.wall(UP).zip(length);
        let up = up.map_or(0.0, |(top, length)| top - (DEPTH * f64::from(length)) as f32);
        RIGHT * half_way(RIGHT) + FRONT * half_way(FRONT) + UP * up
    }

    /// The median of the inner table's radii around a unit vector.
    fn wall(&self, direction: Vec3) -> Option<f32> {
        let [x, y] = tangents(direction).map(|tangent| tangent * 0.06);
        let around = [Vec3::ZERO, x, -x, y, -y].map(|aside| (direction + aside).normalize());
        let mut radii: Vec<f32> = around.into_iter().filter_map(|ray| self.inner(ray)).collect();
        radii.sort_unstable_by(f32::total_cmp);
        radii.get(radii.len() / 2).copied()
    }
}

/// The least thickness of a layer, in metres.
const MIN_THICKNESS: f32 = 0.001;

fn steps(from: f32, to: f32) -> impl Iterator<Item = f32> {
    let count = ((to - from) / STEP).max(0.0) as u32;
    (0..=count).map(move |step| from + step as f32 * STEP)
}

/// The largest ball of an image that holds neither bone nor air: its middle, in metres along the
/// patient's axes, and its radius.
///
/// Distances are those of a chamfer over cells of about 4 mm (Borgefors 1986), which makes them a few
/// per cent long.
pub(super) fn largest_room(
    grid: &Grid,
    densities: &[u8],
    hounsfield: &[i16],
    air: i16,
) -> (DVec3, f32) {
    const CELL: f64 = 0.004;
    let dims = grid.dims().map(|side| side as usize);
    let spacing = grid.spacing().to_array();
    let step = spacing.map(|spacing| ((CELL / spacing).round() as usize).max(1));
    let cells = [0, 1, 2].map(|axis| dims[axis].div_ceil(step[axis]));
    let mut clear = vec![f32::MAX; cells.iter().product()];
    let rows = densities.chunks_exact(dims[0]).zip(hounsfield.chunks_exact(dims[0]));
    for (row, (densities, hounsfield)) in rows.enumerate() {
        let (y, z) = (row % dims[1] / step[1], row / dims[1] / step[2]);
        let first = (z * cells[1] + y) * cells[0];
        for (x, (&density, &number)) in densities.iter().zip(hounsfield).enumerate() {
            if f32::from(density) >= SURFACE || number < air {
                clear[first + x / step[0]] = 0.0;
            }
        }
    }
    let size = [0, 1, 2].map(|axis| (step[axis] as f64 * spacing[axis]) as f32);
    chamfer(&mut clear, cells, size);
    let mut best = 0;
    for (cell, &radius) in clear.iter().enumerate() {
        if radius > clear[best] {
            best = cell;
        }
    }
    let place = [best % cells[0], best / cells[0] % cells[1], best / (cells[0] * cells[1])];
    let voxel = [0, 1, 2].map(|axis| (place[axis] as f64 + 0.5) * step[axis] as f64 - 0.5);
    (grid.affine().transform_point3(voxel.into()), clear[best])
}

/// Lowers each cell's number to its distance from the nearest cell of 0; what is outside is 0.
fn chamfer(cells: &mut [f32], dims: [usize; 3], size: [f32; 3]) {
    let [wide, high, deep] = dims.map(|side| side as isize);
    let half: Vec<[isize; 3]> = (-1..=0)
        .flat_map(|z| (-1..=1).flat_map(move |y| (-1..=1).map(move |x| [x, y, z])))
        .filter(|&[x, y, z]| (z, y, x) < (0, 0, 0))
        .collect();
    let length = |step: &[isize; 3]| {
        let [x, y, z] = [0, 1, 2].map(|axis| step[axis] as f32 * size[axis]);
        (x * x + y * y + z * z).sqrt()
    };
    let lengths: Vec<f32> = half.iter().map(length).collect();
    let mut pass = |cell: isize, sense: isize| {
        let place = [cell % wide, cell / wide % high, cell / (wide * high)];
        let mut least = cells[cell as usize];
        for (step, length) in half.iter().zip(&lengths) {
            let [x, y, z] = [0, 1, 2].map(|axis| place[axis] + sense * step[axis]);
            let inside = (0..wide).contains(&x) && (0..high).contains(&y) && (0..deep).contains(&z);
            let near = if inside { cells[((z * high + y) * wide + x) as usize] } else { 0.0 };
            least = least.min(near + length);
        }
        cells[cell as usize] = least;
    };
    let count = wide * high * deep;
    (0..count).for_each(|cell| pass(cell, 1));
    (0..count).rev().for_each(|cell| pass(cell, -1));
}

/// The head's middle, as [`Rays::middle`] finds it from a place within, from where the world is then
/// seen; and the frame of that world.
pub(super) fn centered<'a>(
    grid: &Grid,
    mut center: DVec3,
    rays: impl Fn(Frame) -> Rays<'a>,
) -> (DVec3, Frame) {
    for _ in 0..3 {
        let frame = Frame::new(grid, center);
        center = Frame::in_patient(center, rays(frame).middle());
    }
    (center, Frame::new(grid, center))
}
