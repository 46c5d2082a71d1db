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

/// A part of a file, which may be read in pieces.
#[derive(Clone, Copy)]
pub(super) struct Part {
    pub(super) name: &'static str,
    /// Its length, in bytes.
    pub(super) bytes: u64,
}

impl Part {
    fn cut_off(self) -> ImageError {
        ImageError::Truncated { part: self.name, needed: self.bytes }
    }
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

    /// Checks that a part can be all that is left.
    pub(super) fn promise(&self, part: Part) -> Result<(), ImageError> {
        match (self.packed, part.bytes <= self.left) {
            (true, false) => Err(ImageError::Promise { promised: part.bytes, most: self.left }),
            (false, false) => Err(part.cut_off()),
            (false, true) if part.bytes < self.left => Err(ImageError::Trailing),
            _ => Ok(()),
        }
    }

    /// Fills `bytes`, or says that the part they belong to is cut off.
    pub(super) fn read(&mut self, bytes: &mut [u8], part: Part) -> Result<(), ImageError> {
        let found = fill(&mut self.source, bytes).map_err(|error| self.fault(error))?;
        self.left = self.left.saturating_sub(found as u64);
        if found < bytes.len() {
            return Err(part.cut_off());
        }
        Ok(())
    }

    /// Passes over `count` bytes of a part.
    pub(super) fn skip(&mut self, count: u64, part: Part) -> Result<(), ImageError> {
        let skipped = io::copy(&mut self.source.by_ref().take(count), &mut io::sink());
        let skipped = skipped.map_err(|error| self.fault(error))?;
        self.left = self.left.saturating_sub(skipped);
        if skipped < count {
            return Err(part.cut_off());
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
