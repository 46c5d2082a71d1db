//! Where things are in every head, by direction from its middle and by planes in proportion to it.

use glam::Vec3;

use super::frame::{FRONT, parts, place};
use super::layers::Layers;
use crate::geometry::Bounds;

/// The middle of the operation: the patient's right temple, above the muscle, where frontal, temporal
/// and parietal bone are near each other.
pub(super) fn site() -> Vec3 {
    place(0.78, 0.28, 0.56).normalize()
}

/// The patch of the scalp that a direction is in: the right frontotemporoparietal one, within 50° of the
/// operation's middle, the frontal, the left, the occipital and the right mastoid one; none for the face
/// and the neck.
pub(super) fn scalp_at(direction: Vec3) -> Option<usize> {
    let [right, front, up] = parts(direction);
    if up < -0.32 + 0.45 * front.max(0.0) {
        return None;
    }
    Some(if direction.dot(site()) > 0.643 {
        0
    } else if right < -0.35 {
        2
    } else if front > 0.1 && up > 0.2 || front > 0.4 {
        1
    } else if right > 0.3 {
        4
    } else {
        3
    })
}

/// Whether a direction is over the temporal muscle of the right (`side` 1) or the left (−1).
pub(super) fn temple(direction: Vec3, side: f32) -> bool {
    let [right, front, up] = parts(direction);
    let [across, high] = [(front - 0.28) / 0.36, (up + 0.02) / 0.36];
    side * right > 0.0 && across * across + high * high < 1.0
}

/// A head's length, as a multiple of a cranium of 168 mm.
#[derive(Clone, Copy, Debug)]
pub(super) struct Scale(pub(super) f32);

impl Scale {
    pub(super) fn of(layers: &Layers) -> Self {
        Self((layers.inner.at(FRONT) + layers.inner.at(-FRONT)) / 0.168)
    }

    /// The box around the inside of the skull, down to the brainstem's end.
    pub(super) fn inside(self, layers: &Layers) -> Bounds {
        let points = layers.inner.nodes().map(|(direction, radius)| direction * radius);
        let floor = -0.06 * self.0;
        let points = points.map(|point| {
            let [right, front, up] = parts(point);
            place(right, front, up.max(floor))
        });
        Bounds::around(points)
    }
}

/// How high the tentorium is, in metres above the head's middle, at a place so far to the right and to
/// the front of it: highest at its notch, lower to the back and the sides; in front of the brainstem,
/// where there is none, it falls below the skull base.
pub(super) fn tentorium(scale: Scale, right: f32, front: f32) -> f32 {
    let slope = if front < 0.0 { 0.35 } else { -3.0 };
    -0.012 * scale.0 + slope * front - 0.12 * right.abs()
}
