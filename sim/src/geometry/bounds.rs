//! Axis-aligned bounding boxes.

use glam::Vec3;

/// An axis-aligned bounding box, in metres. The bounds may be infinite (a half-space's box is).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bounds {
    /// The least coordinates, in metres.
    pub min: Vec3,
    /// The greatest coordinates, in metres.
    pub max: Vec3,
}

impl Bounds {
    /// The box of nothing: it overlaps no box, and is the neutral element of [`Bounds::union`].
    pub const EMPTY: Self = Self { min: Vec3::INFINITY, max: Vec3::NEG_INFINITY };

    /// The box of all space.
    pub const ALL: Self = Self { min: Vec3::NEG_INFINITY, max: Vec3::INFINITY };

    /// Whether the two boxes share a point. Never so for an empty box or one with a NaN.
    #[must_use]
    pub fn overlaps(&self, other: &Self) -> bool {
        // Without the first test an empty box would overlap the box of all space.
        !self.is_empty()
            && !other.is_empty()
            && self.min.cmple(other.max).all()
            && other.min.cmple(self.max).all()
    }

    /// Whether the box holds no point.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        !self.min.cmple(self.max).all()
    }

    /// The smallest box that holds both.
    #[must_use]
    pub fn union(&self, other: &Self) -> Self {
        Self { min: self.min.min(other.min), max: self.max.max(other.max) }
    }

    /// The points that both boxes share; empty where they share none.
    #[must_use]
    pub fn intersection(&self, other: &Self) -> Self {
        Self { min: self.min.max(other.min), max: self.max.min(other.max) }
    }

    /// This box grown by `margin` metres on every side.
    #[must_use]
    pub fn inflated(&self, margin: f32) -> Self {
        Self { min: self.min - Vec3::splat(margin), max: self.max + Vec3::splat(margin) }
    }

    /// The box's middle, in metres. Not finite for an empty or an unbounded box.
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
