//! Axis-aligned bounding boxes.

use glam::{Vec3, Vec3A};

/// An axis-aligned bounding box, in metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bounds {
    /// The least coordinates, in metres.
    pub min: Vec3,
    /// The greatest coordinates, in metres.
    pub max: Vec3,
}

impl Default for Bounds {
    fn default() -> Self {
        Self::EMPTY
    }
}

impl Bounds {
    /// The box of nothing: it overlaps no box, and is the neutral element of [`Bounds::union`].
    pub const EMPTY: Self = Self { min: Vec3::INFINITY, max: Vec3::NEG_INFINITY };

    /// The box of all space. Its bounds are the greatest finite numbers: infinite ones would overlap
    /// the empty box's.
    pub const ALL: Self = Self { min: Vec3::MIN, max: Vec3::MAX };

    /// Whether the two boxes share a point. Never so for an empty box or one with a NaN.
    #[must_use]
    #[inline]
    pub fn overlaps(&self, other: &Self) -> bool {
        // One branch: in which direction boxes are apart cannot be foretold. Of a comparison of `Vec3`s the compiler
        // makes three.
        let [a, b] = [self, other].map(|bounds| [bounds.min, bounds.max].map(Vec3A::from));
        (a[0].cmple(b[1]) & b[0].cmple(a[1])).all()
    }

    /// The smallest box that holds all of these points, in metres.
    #[must_use]
    pub fn around(points: impl IntoIterator<Item = Vec3>) -> Self {
        let point = |point| Self { min: point, max: point };
        points.into_iter().map(point).fold(Self::EMPTY, |whole, point| whole.union(&point))
    }

    /// The smallest box that holds both.
    #[must_use]
    pub fn union(&self, other: &Self) -> Self {
        Self { min: self.min.min(other.min), max: self.max.max(other.max) }
    }

    /// This box grown by `margin` metres on every side.
    #[must_use]
    pub fn inflated(&self, margin: f32) -> Self {
        Self { min: self.min - Vec3::splat(margin), max: self.max + Vec3::splat(margin) }
    }

    /// The box's middle, in metres. Not finite for an empty box.
    #[must_use]
    pub fn center(&self) -> Vec3 {
        (self.min + self.max) * 0.5
    }

    /// Whether every bound is a finite number.
    #[must_use]
    pub fn is_finite(&self) -> bool {
        self.min.is_finite() && self.max.is_finite()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nothing_overlaps_the_empty_box() {
        for bounds in [Bounds::ALL, Bounds::EMPTY, Bounds { min: Vec3::ZERO, max: Vec3::ONE }] {
            assert!(!bounds.overlaps(&Bounds::EMPTY) && !Bounds::EMPTY.overlaps(&bounds));
            assert_eq!(bounds.union(&Bounds::EMPTY), bounds);
        }
    }

    #[test]
    fn touching_boxes_overlap() {
        let unit = Bounds { min: Vec3::ZERO, max: Vec3::ONE };
        let moved = |by: f32| Bounds { min: Vec3::X * by, max: Vec3::ONE + Vec3::X * by };
        assert!(unit.overlaps(&moved(1.0)) && unit.overlaps(&unit) && unit.overlaps(&Bounds::ALL));
        assert!(!unit.overlaps(&moved(1.001)) && !moved(1.001).overlaps(&unit));
    }
}
