//! NRRD with its header attached, raw or packed by gzip: <https://teem.sourceforge.net/nrrd/format.html>.

mod fields;
mod header;

use std::io::BufRead;

use super::Image;
use super::error::ImageError;
use super::stream::Stream;
use fields::Fields;
use header::Header;

/// Reads a file of `length` bytes.
pub(super) fn read(mut source: impl BufRead, length: u64) -> Result<Image, ImageError> {
    let (fields, bytes) = Fields::read(&mut source)?;
    let header = Header::new(&fields)?;
    let left = length.saturating_sub(bytes);
    let mut stream =
        if header.gzip { Stream::gzip(source, left) } else { Stream::plain(source, left) };
    Image::decode(header.grid, &header.samples, &mut stream)
}
