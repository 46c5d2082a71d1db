//! Medical images: computed tomography in, volumes out.
//!
//! [`Image::open`] reads NIfTI-1 (`.nii`, `.nii.gz`) and NRRD (raw or gzip, header attached), told apart
//! by their content. Whatever order and directions a file's axes have, an image's first axis runs most
//! nearly to the patient's right, its second to the front and its third to the head: voxels are put
//! in their places while they are read, so that an image takes two bytes a voxel and a few rows more.
//! Directions that are not quite along the patient's axes stay as they are, in the
//! [grid's affine map](Grid::affine).
//!
//! [`save`] writes a volume in the order, and with the affine map, of the file that its grid came from.
//!
//! A file is not trusted: what its header promises is held against its length before memory is taken,
//! and every fault is an [`ImageError`].

mod error;
mod grid;
mod hounsfield;
mod nifti;
mod nrrd;
mod samples;
mod stream;

use std::fs::{self, File, Metadata};
use std::io::{BufReader, Read};
use std::path::Path;

pub use error::{FileError, ImageError};
pub use grid::Grid;
pub use hounsfield::{AIR, ThresholdError, Thresholds};
pub use nifti::{Voxel, save, write};

use samples::Samples;
use stream::{Part, Stream};

use crate::fill::fill;

/// An image of computed tomography.
#[derive(Clone, Debug, PartialEq)]
pub struct Image {
    grid: Grid,
    voxels: Vec<i16>,
}

impl Image {
    /// An image of the given Hounsfield numbers, one a voxel, x fastest.
    ///
    /// # Errors
    /// Another number of them than the grid has voxels.
    pub fn new(grid: Grid, voxels: Vec<i16>) -> Result<Self, ImageError> {
        grid.check_length(voxels.len())?;
        Ok(Self { grid, voxels })
    }

    /// Reads a file.
    ///
    /// # Errors
    /// It cannot be read, is not a file, or is one of the faults that [`ImageError`] lists.
    pub fn open(path: &Path) -> Result<Self, FileError> {
        let read = || {
            // To open a pipe is to wait for who writes to it.
            check_is_file(&fs::metadata(path)?)?;
            let file = File::open(path)?;
            // Another may stand there by now.
            let metadata = file.metadata()?;
            check_is_file(&metadata)?;
            Self::read(file, metadata.len())
        };
        read().map_err(|source| FileError { path: path.to_owned(), source })
    }

    /// Reads a file's content of `length` bytes.
    ///
    /// # Errors
    /// As [`Image::open`].
    pub fn read(source: impl Read, length: u64) -> Result<Self, ImageError> {
        let mut source = BufReader::new(source);
        let mut start = [0; 4];
        let found = fill(&mut source, &mut start)?;
        let start = &start[..found];
        let source = start.chain(source);
        match start {
            [] => Err(ImageError::Empty),
            b"NRRD" => nrrd::read(source, length),
            [0x1f, 0x8b, ..] => nifti::read(Stream::gzip(source, length)),
            _ => nifti::read(Stream::plain(source, length)),
        }
    }

    /// Reads all voxels, which must be all that is left of `stream`.
    fn decode(grid: Grid, samples: &Samples, stream: &mut Stream<'_>) -> Result<Self, ImageError> {
        let bytes = samples.bytes();
        let count = grid.voxels();
        let part = Part { name: "voxels", bytes: count as u64 * bytes as u64 };
        stream.promise(part)?;
        let mut voxels = room(count)?;
        voxels.resize(count, AIR);
        let mut stored = vec![0; grid.stored_dims()[0] as usize * bytes];
        for row in grid.stored_rows() {
            stream.read(&mut stored, part)?;
            let mut places = row.places();
            samples.decode(&stored, |hounsfield| {
                if let Some(place) = places.next() {
                    voxels[place] = hounsfield;
                }
            });
        }
        stream.finish()?;
        Ok(Self { grid, voxels })
    }

    /// Where the voxels are.
    #[must_use]
    pub fn grid(&self) -> &Grid {
        &self.grid
    }

    /// The voxels' Hounsfield numbers, x fastest.
    #[must_use]
    pub fn voxels(&self) -> &[i16] {
        &self.voxels
    }

    /// How much of each voxel is bone, of 255, x fastest: what a
    /// `Volume` of voxel bone is made of.
    ///
    /// # Errors
    /// No voxel reaches the threshold of trabecular bone; no memory.
    pub fn bone(&self, thresholds: &Thresholds) -> Result<Vec<u8>, ImageError> {
        let most = self.voxels.iter().copied().max().unwrap_or(AIR);
        let least = thresholds.trabecular();
        if most < least {
            return Err(ImageError::NoBone { most, least });
        }
        let mut densities = room(self.voxels.len())?;
        densities.extend(self.voxels.iter().map(|&hounsfield| thresholds.density(hounsfield)));
        Ok(densities)
    }
}

/// Room for so many values: a file says how many, and there may be no memory for them.
pub(crate) fn room<T>(count: usize) -> Result<Vec<T>, ImageError> {
    let mut room = Vec::new();
    let memory = |_| ImageError::Memory { bytes: count as u64 * size_of::<T>() as u64 };
    room.try_reserve_exact(count).map_err(memory)?;
    Ok(room)
}

fn check_is_file(metadata: &Metadata) -> Result<(), ImageError> {
    if metadata.is_file() { Ok(()) } else { Err(ImageError::NotAFile) }
}
