//! Vessels.

use glam::Vec3;

use super::make::{ARTERY, Tissue, VEIN};
use super::{Hold, Structure};
use crate::scene::head::frame::place;
use crate::scene::head::layers::Layers;
use crate::scene::head::surface::tube;

/// The distance between the rings of a tube, in metres; usually 4 mm.
const STEP: f32 = 0.004;

pub(super) fn make(layers: &Layers) -> impl Iterator<Item = Structure> {
    let below_bone = |depth: f32| move |d: Vec3| layers.inner.at(d) - depth;
    let below_skin = |depth: f32| move |d: Vec3| layers.skin.at(d) - depth;
    [
        vessel(
            &VEIN,
            "superior sagittal sinus",
            0.003_5,
            &[[0.0, 0.94, 0.34], [0.0, 0.0, 1.0], [0.0, -0.97, -0.24]],
            below_bone(0.004_5),
        ),
        vessel(
            &ARTERY,
            "right middle meningeal artery",
            0.001,
            &[[0.95, 0.22, -0.2], [0.9, 0.2, 0.38], [0.62, -0.05, 0.78]],
            below_bone(0.001_2),
        ),
        vessel(
            &VEIN,
            "right bridging vein",
            0.001_2,
            &[[0.42, 0.12, 0.9], [0.2, 0.15, 0.97], [0.07, 0.2, 0.97]],
            below_bone(0.003_2),
        ),
        vessel(
            &ARTERY,
            "right superficial temporal artery",
            0.001_2,
            &[[0.98, 0.05, -0.18], [0.96, 0.15, 0.25], [0.75, 0.42, 0.5]],
            below_skin(0.003),
        ),
    ]
    .into_iter()
}

/// A vessel along directions (right, front, up) whose radii `radius` says; held at both ends.
fn vessel(
    tissue: &Tissue,
    name: &'static str,
    width: f32,
    way: &[[f32; 3]],
    radius: impl Fn(Vec3) -> f32,
) -> Structure {
    let on_sphere = |[right, front, up]: [f32; 3]| place(right, front, up).normalize();
    let ways: Vec<Vec3> = way.iter().copied().map(on_sphere).collect();
    let path: Vec<Vec3> = curve(&ways)
        .map(|direction| direction.normalize())
        .map(|direction| direction * radius(direction))
        .collect();
    let path = resampled(&path, STEP);
    let nodes = 6 * path.len() as u32;
    tissue.structure(name, tube(&path, width), |node, _, _| {
        let at_end = node < 6 || node + 6 >= nodes;
        at_end.then_some(Hold::Firm)
    })
}

/// Points on straight lines from one to the next.
fn curve(ways: &[Vec3]) -> impl Iterator<Item = Vec3> {
    const PARTS: usize = 64;
    let line = |pair: &[Vec3]| {
        let (from, to) = (pair[0], pair[1]);
        (0..PARTS).map(move |part| from + (to - from) * (part as f32 / PARTS as f32))
    };
    ways.windows(2).flat_map(line).chain(ways.last().copied())
}

/// The same way with its points as far apart as `step` metres, or a little less: all the same.
pub(in crate::scene::head) fn resampled(path: &[Vec3], step: f32) -> Vec<Vec3> {
    let length: f32 = path.windows(2).map(|pair| pair[0].distance(pair[1])).sum();
    let count = (length / step).ceil().max(1.0);
    let (Some(&first), Some(&last)) = (path.first(), path.last()) else { return Vec::new() };
    let (mut points, mut gone) = (vec![first], 0.0);
    for pair in path.windows(2) {
        let long = pair[0].distance(pair[1]);
        while (points.len() as f32) < count {
            let due = points.len() as f32 * length / count;
            if due > gone + long {
                break;
            }
            points.push(pair[0] + (pair[1] - pair[0]) * ((due - gone) / long));
        }
        gone += long;
    }
    points.push(last);
    points
}
