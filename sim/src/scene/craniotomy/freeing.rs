//! Bone that a closed cut has freed becomes an object of its own.

use std::ops::Range;

use glam::Vec3;

use super::{PIECES, TOOLS};
use crate::behavior::Tool;
use crate::behavior::piece::Piece;
use crate::geometry::{Bounds, Geometry, Part, Volume};
use crate::object::{Object, ObjectId};
use crate::scene::Scene;

/// The least volume that is taken for a piece and not for a chip, in cubic metres; usually 1 cm³.
const LEAST: f32 = 1e-6;

/// Takes every part out of the skull that is free within `region` (metres) and larger than a cubic
/// centimetre, and adds it to the environment; the tools can work on it. Says how many there were.
///
/// What of it a renderer has on its device is the skull's, less the part, and a new volume.
pub(super) fn free(scene: &mut Scene, skull: ObjectId, region: &Bounds) -> usize {
    let mut freed = Vec::new();
    if let Some(object) = scene.objects.get_mut(skull.0 as usize)
        && let Some(volume) = object.geometry.as_volume_mut()
    {
        let parts = free_parts(volume, region);
        // A part that cannot be taken out stays where it is.
        freed.extend(parts.iter().filter_map(|part| volume.split_off(part).ok()));
    }
    let color = scene.objects.get(skull.0 as usize).map(|skull| skull.visual);
    let count = freed.len();
    for volume in freed {
        let id = ObjectId(scene.objects.len() as u32);
        let piece = Piece::new(&volume);
        let mut object = Object::new(id, PIECES, Geometry::Volume(volume), piece);
        object.visual = color.unwrap_or_default();
        scene.objects.push(object);
        for tool in TOOLS {
            let tool = scene.objects.get_mut(tool.0 as usize).and_then(Tool::of_mut);
            tool.into_iter().for_each(|tool| tool.workpieces_mut().pieces.push(id));
        }
    }
    count
}

/// The parts of bone that are free within `region` (metres) and large enough.
pub(super) fn free_parts(volume: &Volume, region: &Bounds) -> Vec<Part> {
    let least = (LEAST / volume.voxel_volume()) as u64;
    let mut parts = volume.parts(voxels(volume, region));
    parts.retain(|part| !part.touches_border() && part.voxels() >= least);
    parts
}

/// The voxels of a box in the world.
pub(super) fn voxels(volume: &Volume, region: &Bounds) -> [Range<u32>; 3] {
    let corners = (0..8).map(|corner| {
        let side = |axis: usize| {
            if corner >> axis & 1 == 1 { region.max[axis] } else { region.min[axis] }
        };
        volume.to_local(Vec3::new(side(0), side(1), side(2))) / volume.spacing()
    });
    let (low, high) = corners.fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(low, high), corner| {
        (low.min(corner), high.max(corner))
    });
    let dims = volume.dims();
    // As integers, negative numbers become 0.
    std::array::from_fn(|axis| {
        (low[axis].floor() as u32).min(dims[axis])..(high[axis].ceil() as u32).min(dims[axis])
    })
}
