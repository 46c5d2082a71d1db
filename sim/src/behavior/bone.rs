//! Bone that stands still and is drilled.

use std::hash::Hasher;

use super::drill::Erosions;
use super::{Behavior, Input};
use crate::geometry::{Geometry, Volume};

/// The behaviour of a volume that nothing moves, and that bits take away from: the skull.
#[derive(Clone, Debug, Default)]
pub struct Bone {
    erosions: Erosions,
}

impl Bone {
    /// Bone that was not drilled yet.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// What was taken away so far; 255 are a full voxel.
    #[must_use]
    pub fn removed(&self) -> u64 {
        self.erosions.removed()
    }

    /// The same in cubic metres of full bone, for the volume whose behaviour this is.
    #[must_use]
    pub fn removed_volume(&self, volume: &Volume) -> f64 {
        self.removed() as f64 / 255.0 * f64::from(volume.voxel_volume())
    }
}

impl Behavior for Bone {
    fn update(&mut self, geometry: &mut Geometry, input: &mut Input<'_>) {
        if let Some(volume) = geometry.as_volume_mut() {
            self.erosions.apply(volume, input.frame, input.time_step);
        }
    }

    fn erosions(&mut self) -> Option<&mut Erosions> {
        Some(&mut self.erosions)
    }

    fn hash_state(&self, hasher: &mut dyn Hasher) {
        self.erosions.hash_state(hasher);
    }
}
