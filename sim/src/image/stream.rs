//! Bytes from a file that may end, or go on, where its header does not say.

use std::io::{self, BufRead, BufReader, Read};

use flate2::bufread::MultiGzDecoder;

use super::error::ImageError;
use crate::fill::fill;

/// The bytes of a file, unpacked.
pub(super) struct Stream<'a> {
    source: Box<dyn Read + 'a>,
    /// The most bytes that can still come.
    left: u64,
    packed: bool,
}

/// The most bytes that one of gzip's can hold: the longest repetition, of 258 bytes, takes two bits
/// (RFC 1951, section 3.2.5).
const MOST_PER_BYTE: u64 = 1032;

impl<'a> Stream<'a> {
    /// The next `length` bytes of a file.
    pub(super) fn plain(source: impl BufRead + 'a, length: u64) -> Self {
        Self { source: Box::new(source), left: length, packed: false }
    }

    /// What the next `length` bytes of a file unpack to.
    pub(super) fn gzip(source: impl BufRead + 'a, length: u64) -> Self {
        let source = Box::new(BufReader::new(MultiGzDecoder::new(source)));
        Self { source, left: length.saturating_mul(MOST_PER_BYTE), packed: true }
    }

    /// Checks that `bytes` of voxels can be all that is left.
    pub(super) fn promise(&self, bytes: u64) -> Result<(), ImageError> {
        match (self.packed, bytes <= self.left) {
            (true, false) => Err(ImageError::Promise { promised: bytes, most: self.left }),
            (false, false) => Err(ImageError::Truncated { part: "voxels", needed: bytes }),
            (false, true) if bytes < self.left => Err(ImageError::Trailing),
            _ => Ok(()),
        }
    }

    /// Fills `bytes`, or says that `part` is cut off.
    pub(super) fn read(&mut self, bytes: &mut [u8], part: &'static str) -> Result<(), ImageError> {
        let found = fill(&mut self.source, bytes).map_err(|error| self.fault(error))?;
        self.left = self.left.saturating_sub(found as u64);
        if found < bytes.len() {
            return Err(ImageError::Truncated { part, needed: bytes.len() as u64 });
        }
        Ok(())
    }

    /// Passes over `count` bytes of `part`.
    pub(super) fn skip(&mut self, count: u64, part: &'static str) -> Result<(), ImageError> {
        let skipped = io::copy(&mut self.source.by_ref().take(count), &mut io::sink());
        let skipped = skipped.map_err(|error| self.fault(error))?;
        self.left = self.left.saturating_sub(skipped);
        if skipped < count {
            return Err(ImageError::Truncated { part, needed: count });
        }
        Ok(())
    }

    /// Checks that nothing is left, and with it gzip's checksum.
    pub(super) fn finish(&mut self) -> Result<(), ImageError> {
        let found = fill(&mut self.source, &mut [0]).map_err(|error| self.fault(error))?;
        if found > 0 { Err(ImageError::Trailing) } else { Ok(()) }
    }

    fn fault(&self, source: io::Error) -> ImageError {
        use io::ErrorKind::{InvalidData, InvalidInput, UnexpectedEof};
        match source.kind() {
            InvalidData | InvalidInput | UnexpectedEof if self.packed => {
                ImageError::Damaged { source }
            }
            _ => ImageError::Io(source),
        }
    }
}
