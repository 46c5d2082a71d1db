//! The voxels that a ball overlaps, and how far: what burrs and contacts are made of.

use std::ops::Range;

use glam::Vec3;

/// A voxel that a ball overlaps.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Voxel {
    /// Its place in the grid.
    pub index: [u32; 3],
    /// Where its middle is, seen from the ball's, in metres along the volume's own axes.
    pub offset: Vec3,
    /// The share of it that lies within the ball, from 0, exclusive, to 1.
    pub overlap: f32,
    /// Its density, of 255.
    pub density: u8,
}

impl Voxel {
    /// A share of a full voxel, from 0 to 1, of as much of this voxel as lies within the ball: to the
    /// nearest 255th.
    #[must_use]
    pub fn share(&self, share: f32) -> u8 {
        (share * self.overlap * 255.0).round() as u8
    }
}

/// A ball in a grid's own space, in metres.
pub(super) struct Ball {
    pub(super) center: Vec3,
    pub(super) radius: f32,
    pub(super) spacing: Vec3,
}

impl Ball {
    /// The voxels that it may overlap; none for a ball that is not finite.
    pub(super) fn range(&self, dims: [u32; 3]) -> [Range<u32>; 3] {
        if !(self.center.is_finite() && self.radius.is_finite() && self.radius > 0.0) {
            return std::array::from_fn(|_| 0..0);
        }
        std::array::from_fn(|axis| {
            let at = |side: f32| (self.center[axis] + side * self.radius) / self.spacing[axis];
            // As integers, negative numbers become 0.
            (at(-1.0).floor() as u32).min(dims[axis])..(at(1.0).ceil() as u32).min(dims[axis])
        })
    }

    /// The voxel's offset and overlap.
    ///
    /// The overlap is the share of a uniform distribution that has the mean and the variance which the
    /// distances of the voxel's points from the ball's middle have, up to the second order in spacing over
    /// radius: along the offset a cell of sides sᵢ has the variance Σ sᵢ² nᵢ² / 12, and across it the rest
    /// of Σ sᵢ² / 12, half of which, over the radius, is added to the mean. So overlaps change smoothly
    /// with the ball's place and add up to its volume.
    pub(super) fn overlap(&self, index: [u32; 3]) -> (Vec3, f32) {
        let middle = |axis: usize| (index[axis] as f32 + 0.5) * self.spacing[axis];
        let offset = Vec3::new(middle(0), middle(1), middle(2)) - self.center;
        let distance = offset.length();
        // At the very middle every direction is as good.
        let width = if distance > 0.0 {
            (offset * self.spacing).length() / distance
        } else {
            self.spacing.min_element()
        };
        let across = self.spacing.length_squared() - width * width;
        let mean = distance + across / (24.0 * self.radius);
        (offset, (0.5 + (self.radius - mean) / width).clamp(0.0, 1.0))
    }
}
