//! NIfTI-1 in one file (`.nii`), packed by gzip or not (`.nii.gz`): <https://nifti.nimh.nih.gov/nifti-1>.
//!
//! The reader is our own: the `nifti` crate allocates what a header promises before it looks at the data,
//! passes over where the data begin, panics where type and width of a voxel contradict each other,
//! and does not notice a wrong checksum.

mod header;
mod write;

use super::Image;
use super::error::ImageError;
use super::stream::{Part, Stream};
use header::Header;

pub use write::{Voxel, save, write};

/// Reads what begins with a header.
pub(super) fn read(mut stream: Stream<'_>) -> Result<Image, ImageError> {
    let mut bytes = [0; Header::BYTES];
    let part = Part { name: "header", bytes: Header::BYTES as u64 };
    let (start, rest) = bytes.split_at_mut(size_of::<i32>());
    stream.read(start, part)?;
    // What is short need not be cut off.
    if !header::begins(start) {
        return Err(ImageError::Magic);
    }
    stream.read(rest, part)?;
    let header = Header::new(&bytes)?;
    stream.skip(header.gap, Part { bytes: part.bytes + header.gap, ..part })?;
    Image::decode(header.grid, &header.samples, &mut stream)
}
