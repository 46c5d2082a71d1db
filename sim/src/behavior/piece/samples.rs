//! Points on a piece's surface that stand for it in contacts.

use std::collections::BTreeMap;

use glam::Vec3;

use crate::geometry::Volume;

/// The most points of a piece; usually 300: on a bone flap of 5 cm they are 4 mm apart.
pub(crate) const MOST_SAMPLES: usize = 300;

/// Points on the surface of a volume, in its own axes, in metres, at most [`MOST_SAMPLES`]: of the solid
/// voxels with an empty neighbour, in each cube of some side, the middle of the one that is the farthest
/// from the centre of mass, so that edges are among them.
pub(super) fn samples(volume: &Volume, middle: Vec3) -> Vec<Vec3> {
    let surface = surface(volume);
    let place =
        |[x, y, z]: [u32; 3]| (Vec3::new(x as f32, y as f32, z as f32) + 0.5) * volume.spacing();
    let mut side = 1;
    loop {
        let mut cells: BTreeMap<[u32; 3], (f32, [u32; 3])> = BTreeMap::new();
        for &voxel in &surface {
            let far = place(voxel).distance_squared(middle);
            let cell = cells.entry(voxel.map(|index| index / side)).or_insert((far, voxel));
            if far > cell.0 {
                *cell = (far, voxel);
            }
        }
        if cells.len() <= MOST_SAMPLES {
            return cells.into_values().map(|(_, voxel)| place(voxel)).collect();
        }
        side += 1;
    }
}

/// The voxels that are at least half full and have a neighbour that is not, x fastest.
fn surface(volume: &Volume) -> Vec<[u32; 3]> {
    let [_, high, deep] = volume.dims();
    let solid = |voxel: [i32; 3]| volume.density(voxel) >= 128;
    let mut surface = Vec::new();
    for (z, y) in (0..deep).flat_map(|z| (0..high).map(move |y| (z, y))) {
        for (first, densities) in volume.row(y, z) {
            for (x, _) in (first..).zip(densities).filter(|(_, density)| **density >= 128) {
                let [i, j, k] = [x, y, z].map(|index| index as i32);
                let around = [[-1, 0, 0], [1, 0, 0], [0, -1, 0], [0, 1, 0], [0, 0, -1], [0, 0, 1]];
                if around.iter().any(|[dx, dy, dz]| !solid([i + dx, j + dy, k + dz])) {
                    surface.push([x, y, z]);
                }
            }
        }
    }
    surface
}
