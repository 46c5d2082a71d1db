//! A rigid shape with a pose: scenery and tools.

use glam::Vec3;
use parry3d::math::Pose;
use parry3d::shape::{HalfSpace, SharedShape};

use super::bounds::Bounds;

/// A rigid shape with a pose.
#[derive(Clone)]
pub struct Rigid {
    /// The shape; queries against it are parry's, exact.
    pub shape: SharedShape,
    /// Where it is, in metres, and how it is turned.
    pub pose: Pose,
    /// How fast it moves, in metres per second.
    pub velocity: Vec3,
}

impl Rigid {
    /// A shape that does not move.
    #[must_use]
    pub fn new(shape: SharedShape, pose: Pose) -> Self {
        Self { shape, pose, velocity: Vec3::ZERO }
    }

    /// A wall: everything behind the plane through `point` (metres) whose normal, of unit length,
    /// points into the free room. With a normal of another length it is somewhere else, with none it is nowhere.
    #[must_use]
    pub fn wall(point: Vec3, normal: Vec3) -> Self {
        let shape = SharedShape::new(HalfSpace::new(normal));
        Self::new(shape, Pose::from_translation(point))
    }

    /// The plane's point and unit normal, where the shape is a half-space.
    #[must_use]
    pub fn plane(&self) -> Option<(Vec3, Vec3)> {
        let half_space = self.shape.as_halfspace()?;
        Some((self.pose.translation, self.pose.transform_vector(half_space.normal)))
    }

    /// The box around the shape; unbounded on the far side of a wall.
    #[must_use]
    pub fn bounds(&self) -> Bounds {
        if let Some((point, normal)) = self.plane() {
            return behind(point, normal);
        }
        let aabb = self.shape.compute_aabb(&self.pose);
        Bounds { min: aabb.mins, max: aabb.maxs }
    }

    /// Whether pose and velocity are finite.
    #[must_use]
    pub fn is_finite(&self) -> bool {
        self.pose.is_finite() && self.velocity.is_finite()
    }
}

/// The box of a half-space: tight where its plane is square to an axis, else all space.
fn behind(point: Vec3, normal: Vec3) -> Bounds {
    let mut bounds = Bounds::ALL;
    for axis in 0..3 {
        let mut square = Vec3::ZERO;
        square[axis] = normal[axis];
        if normal == square && normal[axis] > 0.0 {
            bounds.max[axis] = point[axis];
        } else if normal == square && normal[axis] < 0.0 {
            bounds.min[axis] = point[axis];
        }
    }
    bounds
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_wall_along_an_axis_is_a_bounded_half() {
        let point = Vec3::new(1.0, 2.0, 3.0);
        for axis in 0..3 {
            let up = Rigid::wall(point, Vec3::AXES[axis]).bounds();
            let down = Rigid::wall(point, -Vec3::AXES[axis]).bounds();
            let (mut below, mut above) = (Bounds::ALL, Bounds::ALL);
            (below.max[axis], above.min[axis]) = (point[axis], point[axis]);
            assert_eq!((up, down), (below, above));
        }
        assert_eq!(Rigid::wall(point, Vec3::new(0.6, 0.8, 0.0)).bounds(), Bounds::ALL);
    }
}
