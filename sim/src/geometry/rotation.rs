//! Rotations to the same bits on every machine: component by component, for the quaternion type's own sums differ
//! between vector units.

use glam::Quat;

/// The rotation whose components, in the order of [`Quat::to_array`], have these proportions. It has no unit length
/// where they are no numbers, or their squares are too great or too small for one.
pub(crate) fn unit(components: [f32; 4]) -> Quat {
    let length = components.iter().map(|component| component * component).sum::<f32>().sqrt();
    Quat::from_array(components.map(|component| component / length))
}

/// Normalised linear interpolation along the shorter arc.
pub(crate) fn between(from: Quat, to: Quat, share: f32) -> Quat {
    if from == to {
        return from;
    }
    let (a, mut b) = (from.to_array(), to.to_array());
    if (0..4).map(|i| a[i] * b[i]).sum::<f32>() < 0.0 {
        b = b.map(|component| -component);
    }
    unit(std::array::from_fn(|i| a[i] + (b[i] - a[i]) * share))
}
