//! Why a head cannot be built.

use thiserror::Error;

use super::Head;
use crate::geometry::VolumeError;
use crate::image::ImageError;

/// Why a head cannot be built from an image.
#[derive(Debug, Error)]
pub enum HeadError {
    /// There is no bone in the image, or the image is of no use.
    #[error(transparent)]
    Image(#[from] ImageError),
    /// No room in the image is as large as the inside of a skull.
    #[error(
        "no head: the largest ball of soft tissue clear of bone and air has a radius of {radius} m; in a \
         skull it is {} to {} m",
        Head::ROOM.start(), Head::ROOM.end()
    )]
    NoRoom {
        /// The ball's radius, in metres.
        radius: f32,
    },
    /// The largest room in the image has no bone around it.
    #[error(
        "no head: in {:.0} % of the directions upwards there is bone around the largest room of soft \
         tissue; at least {:.0} % are needed", 100.0 * share, 100.0 * Head::ENCLOSED
    )]
    Open {
        /// The share of the directions in which there is bone.
        share: f32,
    },
    /// Bone is in more separate places than in any head.
    #[error(
        "no head: its bone is in more than {} rows of voxels side by side; a head's is in a few millions",
        HeadError::MAX_RUNS
    )]
    Runs,
    /// The image is of more than a person.
    #[error(
        "no head: the image is of {volume} m³; it may be of {} m³, twice a whole person's",
        HeadError::MAX_VOLUME
    )]
    Size {
        /// What the image covers, in cubic metres.
        volume: f64,
    },
    /// The volume of bone cannot be built.
    #[error(transparent)]
    Volume(#[from] VolumeError),
    /// A volume is not the head's skull.
    #[error("a volume of {given:?} voxels is not this head's skull of {skull:?}")]
    NotTheSkull {
        /// Its voxels along each axis.
        given: [u32; 3],
        /// Those of the skull.
        skull: [u32; 3],
    },
    /// A structure that the operation needs is not there.
    #[error("the {name} cannot be found: nothing is left of its surface")]
    Structure {
        /// Its name.
        name: &'static str,
    },
}

impl HeadError {
    /// The most rows of bone voxels side by side that an image is searched for a skull in: 2²⁴. A head of
    /// 512 × 512 × 1,000 voxels has some 3 million; noise has more.
    pub const MAX_RUNS: usize = 1 << 24;
    /// The most that an image may cover, in cubic metres.
    pub const MAX_VOLUME: f64 = 1.0;
}
