//! Chunks: bytes with a kind, a length and a checksum, packed where that makes them shorter.

use std::io::{self, Read, Write};

use crc32fast::Hasher;
use flate2::{Compress, Compression, Decompress, FlushCompress, FlushDecompress, Status};

use super::flaw::Flaw;
use super::{MAGIC, MAX_PAYLOAD, VERSION};
use crate::fill::fill;

/// Bytes before a chunk's content: kind, packing, length as stored, length as unpacked, checksum.
const HEAD: usize = 14;
/// The most bytes that one packed byte can hold (RFC 1951, section 3.2.5).
const MOST_PER_BYTE: u64 = 1032;
/// What is written before the first chunk.
pub(super) const START: usize = MAGIC.len() + 4;

/// What a chunk is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub(super) enum Kind {
    Header = b'H',
    Events = b'E',
    End = b'Z',
}

/// The checksum of a chunk: it goes on from that of the chunk before, so that none can be missing, come
/// twice or change its place.
fn checksum(before: u32, head: &[u8], stored: &[u8]) -> u32 {
    let mut hasher = Hasher::new_with_initial(before);
    hasher.update(head);
    hasher.update(stored);
    hasher.finalize()
}

/// Writes chunks.
pub(super) struct ChunkWriter<W> {
    write: W,
    compress: Compress,
    chunk: Vec<u8>,
    checksum: u32,
}

impl<W: Write> ChunkWriter<W> {
    pub(super) fn new(mut write: W) -> io::Result<Self> {
        write.write_all(&MAGIC)?;
        write.write_all(&VERSION.to_le_bytes())?;
        let compress = Compress::new(Compression::default(), false);
        Ok(Self { write, compress, chunk: Vec::new(), checksum: 0 })
    }

    /// Writes a chunk, of at most [`MAX_PAYLOAD`] bytes, and hands it to the system.
    pub(super) fn write(&mut self, kind: Kind, payload: &[u8]) -> io::Result<()> {
        self.chunk.clear();
        // No more room than it takes unpacked: what does not fit is not worth it.
        self.chunk.reserve_exact(HEAD + payload.len());
        self.chunk.resize(HEAD, 0);
        self.compress.reset();
        let packed = self.compress.compress_vec(payload, &mut self.chunk, FlushCompress::Finish);
        let is_packed =
            matches!(packed, Ok(Status::StreamEnd)) && self.chunk.len() < HEAD + payload.len();
        if !is_packed {
            self.chunk.truncate(HEAD);
            self.chunk.extend_from_slice(payload);
        }
        let (head, stored) = self.chunk.split_at_mut(HEAD);
        (head[0], head[1]) = (kind as u8, is_packed.into());
        head[2..6].copy_from_slice(&(stored.len() as u32).to_le_bytes());
        head[6..10].copy_from_slice(&(payload.len() as u32).to_le_bytes());
        self.checksum = checksum(self.checksum, &head[..10], stored);
        head[10..].copy_from_slice(&self.checksum.to_le_bytes());
        self.write.write_all(&self.chunk)?;
        self.write.flush()
    }

    pub(super) fn into_inner(self) -> W {
        self.write
    }
}

/// Reads chunks.
pub(super) struct ChunkReader<R> {
    read: R,
    decompress: Decompress,
    stored: Vec<u8>,
    checksum: u32,
    /// The chunk that is read now or next.
    pub(super) chunk: u64,
    /// Where it begins.
    pub(super) offset: u64,
}

impl<R: Read> ChunkReader<R> {
    /// Reads what is before the first chunk.
    pub(super) fn new(read: R) -> Self {
        Self {
            read,
            decompress: Decompress::new(false),
            stored: Vec::new(),
            checksum: 0,
            chunk: 0,
            offset: 0,
        }
    }

    pub(super) fn start(&mut self) -> Result<(), Flaw> {
        let mut start = [0; START];
        let found = fill(&mut self.read, &mut start).map_err(Flaw::Read)?;
        let (magic, version) = start.split_at(MAGIC.len());
        let known = found.min(MAGIC.len());
        if found == 0 || magic[..known] != MAGIC[..known] {
            return Err(Flaw::Magic);
        }
        if found < START {
            return Err(Flaw::CutOff);
        }
        let found = version.iter().rev().fold(0, |sum, &byte| sum << 8 | u32::from(byte));
        if found != VERSION {
            return Err(Flaw::Version { found });
        }
        self.offset = START as u64;
        Ok(())
    }

    /// Reads the next chunk's content into `payload`.
    pub(super) fn next(&mut self, payload: &mut Vec<u8>) -> Result<u8, Flaw> {
        let mut head = [0; HEAD];
        if fill(&mut self.read, &mut head).map_err(Flaw::Read)? < HEAD {
            return Err(Flaw::CutOff);
        }
        let number = |place: usize| {
            let bytes = [head[place], head[place + 1], head[place + 2], head[place + 3]];
            u32::from_le_bytes(bytes)
        };
        let (stored, length, expected) = (number(2), number(6), number(10));
        let is_packed = head[1] == 1;
        let most = if is_packed { u64::from(stored) * MOST_PER_BYTE } else { stored.into() };
        for length in [u64::from(stored), length.into()] {
            if length > (MAX_PAYLOAD as u64).min(most) {
                return Err(Flaw::Length { length });
            }
        }
        self.stored.clear();
        // Takes memory only for what is there.
        let mut source = self.read.by_ref().take(stored.into());
        source.read_to_end(&mut self.stored).map_err(Flaw::Read)?;
        if self.stored.len() < stored as usize {
            return Err(Flaw::CutOff);
        }
        let found = checksum(self.checksum, &head[..10], &self.stored);
        if found != expected {
            return Err(Flaw::Checksum { expected, found });
        }
        self.unpack(head[1], length as usize, payload)?;
        self.checksum = found;
        Ok(head[0])
    }

    /// The chunk was what it should be.
    pub(super) fn accept(&mut self) {
        self.chunk += 1;
        self.offset += (HEAD + self.stored.len()) as u64;
    }

    /// Sees that nothing comes after the last chunk.
    pub(super) fn finish(&mut self) -> Result<(), Flaw> {
        match fill(&mut self.read, &mut [0]).map_err(Flaw::Read)? {
            0 => Ok(()),
            _ => Err(Flaw::Trailing),
        }
    }

    fn unpack(&mut self, packing: u8, length: usize, payload: &mut Vec<u8>) -> Result<(), Flaw> {
        payload.clear();
        match packing {
            0 => payload.extend_from_slice(&self.stored),
            1 => {
                // A byte more, so that the end is seen.
                payload.reserve_exact(length + 1);
                self.decompress.reset(false);
                let (stored, finish) = (&self.stored, FlushDecompress::Finish);
                let status = self.decompress.decompress_vec(stored, payload, finish);
                let is_all = self.decompress.total_in() == stored.len() as u64;
                if !(matches!(status, Ok(Status::StreamEnd)) && is_all) {
                    return Err(Flaw::Packing);
                }
            }
            _ => return Err(Flaw::Packing),
        }
        if payload.len() == length { Ok(()) } else { Err(Flaw::Packing) }
    }
}
