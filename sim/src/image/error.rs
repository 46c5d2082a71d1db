//! What can be wrong with an image or its file.

use std::io;
use std::path::PathBuf;

use thiserror::Error;

use super::grid::Grid;

/// Why a file cannot be read or written.
#[derive(Debug, Error)]
#[error("{}: {source}", path.display())]
pub struct FileError {
    /// The file.
    pub path: PathBuf,
    /// What is wrong with it.
    pub source: ImageError,
}

/// What is wrong with an image or its file.
#[derive(Debug, Error)]
pub enum ImageError {
    /// The system does not read or write it.
    #[error(transparent)]
    Io(#[from] io::Error),
    /// What was to take its place, and is whole, cannot be moved there.
    #[error("{source}; what was to be there is in {}", beside.display())]
    Beside {
        /// Where it is.
        beside: PathBuf,
        /// Why it cannot be moved.
        source: io::Error,
    },
    /// It is a folder, a device or a pipe.
    #[error("not a file")]
    NotAFile,
    /// It has no bytes.
    #[error("the file is empty")]
    Empty,
    /// It is neither NIfTI-1 nor NRRD.
    #[error("neither NIfTI-1 nor NRRD")]
    Magic,
    /// It is of a kind akin to those that are read.
    #[error("{kind} is not read: only NIfTI-1 in one file, and NRRD with its header attached, are")]
    Kind {
        /// What it is.
        kind: &'static str,
    },
    /// It ends too early.
    #[error("cut off: it ends before the {needed} bytes of its {part}")]
    Truncated {
        /// What it ends in.
        part: &'static str,
        /// The part's length, in bytes; the least that it can be where nothing says how long it is.
        needed: u64,
    },
    /// It goes on after the last voxel.
    #[error("there is more data after the last voxel")]
    Trailing,
    /// Its header promises more than gzip can have packed into it.
    #[error("its header promises {promised} bytes; a gzip file of its length holds at most {most}")]
    Promise {
        /// What the header promises, in bytes.
        promised: u64,
        /// What may be in it, in bytes.
        most: u64,
    },
    /// Its compressed data are not as they were written.
    #[error("damaged gzip data: {source}")]
    Damaged {
        /// What the decoder says.
        source: io::Error,
    },
    /// An entry of the header is of no use.
    #[error("{name} is {value:?}: it must be {allowed}")]
    Field {
        /// The entry's name, in the words of the format.
        name: &'static str,
        /// What stands there; cut off if it is long.
        value: String,
        /// What may stand there.
        allowed: &'static str,
    },
    /// An entry of the header is not there.
    #[error("its header has no {name:?}")]
    Missing {
        /// The entry's name, in the words of the format.
        name: &'static str,
    },
    /// The header is longer than any that makes sense.
    #[error("its header does not end within {most} bytes")]
    Header {
        /// The most that is read of one, in bytes.
        most: u64,
    },
    /// It holds more than one volume.
    #[error("{count} values a voxel (time, colour, ...): only one volume is read")]
    Series {
        /// The length of an axis that is not in space.
        count: u64,
    },
    /// There are no voxels along an axis, or too many.
    #[error("{dims:?} voxels: each side must have 1 to {}", Grid::MAX_SIDE)]
    Side {
        /// The voxels along each axis of the file.
        dims: [u32; 3],
    },
    /// There are too many voxels in all.
    #[error("{dims:?} voxels: there may be {} in all", Grid::MAX_VOXELS)]
    Voxels {
        /// The voxels along each axis of the file.
        dims: [u32; 3],
    },
    /// The system has not enough memory.
    #[error("{bytes} bytes of memory are not to be had")]
    Memory {
        /// What was asked for, in bytes.
        bytes: u64,
    },
    /// A number of the affine map is not finite, or its origin is too far away.
    #[error(
        "its affine map has the origin {origin:?} m: all its numbers must be finite, and the origin \
         within {} m",
        Grid::MAX_ORIGIN
    )]
    Affine {
        /// The middle of the first voxel, in metres.
        origin: [f64; 3],
    },
    /// Voxels are too near each other or too far apart.
    #[error("voxels {spacing:?} m apart: the distances must be {} to {} m",
        Grid::SPACINGS.start(), Grid::SPACINGS.end())]
    Spacing {
        /// The distance between voxels along each axis of the file, in metres.
        spacing: [f64; 3],
    },
    /// The axes are too nearly in one plane.
    #[error(
        "its axes span {volume} of a cube of their lengths: it must be at least {}",
        Grid::MIN_VOLUME
    )]
    Skewed {
        /// The volume that unit vectors along the axes span; below 0 if they are left-handed.
        volume: f64,
    },
    /// The number of values is not that of the voxels.
    #[error("{given} values were given for {voxels} voxels")]
    Length {
        /// How many were given.
        given: usize,
        /// The number of voxels.
        voxels: usize,
    },
    /// There is no bone in the image.
    #[error("no bone: no voxel is above {most} HU, and trabecular bone begins at {least} HU")]
    NoBone {
        /// The greatest of the image's Hounsfield numbers.
        most: i16,
        /// The threshold.
        least: i16,
    },
}

impl ImageError {
    pub(super) fn field(
        name: &'static str,
        value: impl Into<String>,
        allowed: &'static str,
    ) -> Self {
        const LONGEST: usize = 40;
        let value: String = value.into();
        let value = match value.char_indices().nth(LONGEST) {
            Some((end, _)) => format!("{}...", &value[..end]),
            None => value,
        };
        Self::Field { name, value, allowed }
    }
}
