//! Objects that follow a path laid down beforehand.

use glam::{Quat, Vec3};
use parry3d::math::Pose;
use thiserror::Error;

use super::{Behavior, Input};
use crate::geometry::Geometry;
use crate::geometry::rotation::between;

/// A place on a scripted path.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Keyframe {
    /// The frame in which the object is there.
    pub frame: u64,
    /// Where it is, in metres.
    pub position: Vec3,
    /// How it is turned, a unit quaternion. Surfaces are not turned.
    pub rotation: Quat,
}

/// Why a script cannot be followed.
#[derive(Clone, Copy, Debug, Error, PartialEq, Eq)]
pub enum ScriptError {
    /// There is no keyframe.
    #[error("a script needs at least one keyframe")]
    Empty,
    /// The keyframes' frames do not ascend.
    #[error("keyframe {index} is not later than the one before it")]
    Order {
        /// The position of the keyframe in the list.
        index: usize,
    },
    /// A keyframe is nowhere, or turned in no way.
    #[error("the position of keyframe {index} is not finite, or its rotation no unit quaternion")]
    Pose {
        /// The position of the keyframe in the list.
        index: usize,
    },
}

/// A path as a function of the frame: straight lines between keyframes, at rest before the first and
/// after the last. It needs no interactions (§9), but may have them: a rigid shape is given its path's
/// velocity.
#[derive(Clone, Debug, PartialEq)]
pub struct Scripted {
    keyframes: Vec<Keyframe>,
}

impl Scripted {
    /// A path through the keyframes.
    ///
    /// # Errors
    /// No keyframe at all, keyframes whose frames do not ascend, a position that is not finite, or a rotation that is
    /// no unit quaternion.
    pub fn new(keyframes: Vec<Keyframe>) -> Result<Self, ScriptError> {
        if keyframes.is_empty() {
            return Err(ScriptError::Empty);
        }
        let is_pose = |key: &Keyframe| key.position.is_finite() && key.rotation.is_normalized();
        if let Some(index) = keyframes.iter().position(|key| !is_pose(key)) {
            return Err(ScriptError::Pose { index });
        }
        let late = keyframes.windows(2).position(|pair| pair[0].frame >= pair[1].frame);
        match late {
            Some(index) => Err(ScriptError::Order { index: index + 1 }),
            None => Ok(Self { keyframes }),
        }
    }

    /// Where the path is in a frame.
    #[must_use]
    pub fn at(&self, frame: u64) -> Pose {
        let after = self.keyframes.partition_point(|key| key.frame <= frame);
        let last = self.keyframes.len() - 1;
        let (from, to) = (self.keyframes[after.saturating_sub(1)], self.keyframes[after.min(last)]);
        let span = to.frame.saturating_sub(from.frame).max(1) as f32;
        let share = frame.saturating_sub(from.frame).min(to.frame - from.frame) as f32 / span;
        let position = from.position + (to.position - from.position) * share;
        Pose::from_parts(position, between(from.rotation, to.rotation, share))
    }
}

impl Behavior for Scripted {
    fn update(&mut self, geometry: &mut Geometry, input: &mut Input<'_>) {
        let here = self.at(input.frame);
        let next = self.at(input.frame + 1);
        let velocity = (next.translation - here.translation) / input.time_step;
        match geometry {
            Geometry::Rigid(rigid) => {
                rigid.pose = here;
                rigid.velocity = velocity;
            }
            Geometry::Volume(volume) => {
                volume.pose = here;
                volume.velocity = velocity;
            }
            Geometry::Mesh(mesh) => {
                let nodes = mesh.positions.len();
                let mean = mesh.positions.iter().sum::<Vec3>() / nodes.max(1) as f32;
                for node in 0..nodes {
                    mesh.positions.add(node, here.translation - mean);
                    mesh.velocities.set(node, velocity);
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_no_pose_is_refused() {
        let right = Keyframe { frame: 3, position: Vec3::ONE, rotation: Quat::IDENTITY };
        let nowhere = Keyframe { frame: 4, position: Vec3::X * f32::NAN, ..right };
        let unturned =
            Keyframe { frame: 4, rotation: Quat::from_xyzw(0.0, 0.0, 0.0, 0.0), ..right };
        for wrong in [nowhere, unturned] {
            assert_eq!(Scripted::new(vec![right, wrong]), Err(ScriptError::Pose { index: 1 }));
        }
        assert!(Scripted::new(vec![right]).is_ok());
    }
}
