//! Volumes out.

use std::fs::{self, File};
use std::io::{self, BufWriter, ErrorKind, Write};
use std::path::{Path, PathBuf};
use std::process;

use flate2::Compression;
use flate2::write::GzEncoder;
use glam::DVec3;

use super::header::{Header, MAGIC, MILLIMETRES, SIZEOF_HDR, VOX_OFFSET, at};
use crate::image::error::{FileError, ImageError};
use crate::image::grid::Grid;

/// A value that a voxel can have in a written volume.
pub trait Voxel: Copy + private::Bytes {}

mod private {
    pub trait Bytes {
        const DATATYPE: i16;
        const COUNT: usize;
        fn put(self, row: &mut Vec<u8>);
    }
}

macro_rules! voxel {
    ($number:ty, $datatype:literal) => {
        impl Voxel for $number {}
        impl private::Bytes for $number {
            const DATATYPE: i16 = $datatype;
            const COUNT: usize = size_of::<Self>();
            fn put(self, row: &mut Vec<u8>) {
                row.extend_from_slice(&self.to_le_bytes());
            }
        }
    };
}

voxel!(u8, 2);
voxel!(i16, 4);
voxel!(u16, 512);

/// Writes a volume to a file, packed by gzip if its name ends in `.gz`; as [`write()`].
///
/// It is written beside the file and takes its place when it is whole, so that a full disk leaves what was there; if it
/// cannot (the disk lets nobody give it the file's permissions, the file is mounted alone), it is copied there. Where
/// nothing can be put beside it (the folder is another's, the name is too long for more), and where it is a device, a
/// pipe or a link to a file that is not there yet, it is written as it is. A file that may not be written stays as it is.
///
/// # Errors
/// As [`write()`], or the file can be neither written nor created. [`ImageError::Beside`] says where the
/// whole volume is if it can neither take the file's place nor be copied there.
pub fn save<V: Voxel>(path: &Path, grid: &Grid, voxels: &[V]) -> Result<(), FileError> {
    let packs = path.extension().is_some_and(|extension| extension == "gz");
    let save = || {
        grid.check_length(voxels.len())?;
        let metadata = fs::metadata(path);
        // Where such a link leads to, only the system knows.
        let leads_nowhere = metadata.is_err() && path.is_symlink();
        if leads_nowhere || metadata.as_ref().is_ok_and(|metadata| !metadata.is_file()) {
            return fill(&File::create(path)?, packs, grid, voxels);
        }
        // A link stays one.
        let place = fs::canonicalize(path).unwrap_or_else(|_| path.to_owned());
        // What takes a file's place is asked for the folder's permission only.
        let there = match File::options().write(true).open(&place) {
            Err(error) if error.kind() == ErrorKind::NotFound => None,
            there => Some(there?),
        };
        let (file, beside) = match create_beside(&place) {
            Err(error) if !is_full(&error) => {
                return fill(&File::create(place)?, packs, grid, voxels);
            }
            created => created?,
        };
        // Before anything is in it: nobody is to read that who could not read what was there.
        let guarded = metadata.map_or(Ok(()), |there| file.set_permissions(there.permissions()));
        let written = fill(&file, packs, grid, voxels).and_then(|()| Ok(file.sync_all()?));
        if written.is_err() {
            // What the disk had no room for; why is told already.
            let _ = fs::remove_file(&beside);
            return written;
        }
        let moved =
            guarded.and_then(|()| fs::rename(&beside, &place)).or_else(|error| match there {
                Some(there) => move_into(there, &beside),
                None => Err(error),
            });
        moved.map_err(|source| ImageError::Beside { beside, source })
    };
    save().map_err(|source| FileError { path: path.to_owned(), source })
}

/// A new file beside one, and where it is.
fn create_beside(place: &Path) -> io::Result<(File, PathBuf)> {
    for number in 0_u64.. {
        let mut beside = place.as_os_str().to_owned();
        beside.push(format!(".{}.{number}.part", process::id()));
        match File::create_new(&beside) {
            // Another thread's, or left there by a process of the same number that was killed.
            Err(error) if error.kind() == ErrorKind::AlreadyExists => {}
            created => return Ok((created?, beside.into())),
        }
    }
    Err(ErrorKind::AlreadyExists.into())
}

/// Moves what is in the file beside one into that, which stays whose it is.
fn move_into(mut there: File, beside: &Path) -> io::Result<()> {
    let mut whole = File::open(beside)?;
    there.set_len(0)?;
    io::copy(&mut whole, &mut there)?;
    there.sync_all()?;
    fs::remove_file(beside)
}

/// Whether there was no room: then what is there must not be emptied.
fn is_full(error: &io::Error) -> bool {
    matches!(error.kind(), ErrorKind::StorageFull | ErrorKind::QuotaExceeded)
}

fn fill<V: Voxel>(file: &File, packs: bool, grid: &Grid, voxels: &[V]) -> Result<(), ImageError> {
    let mut file = BufWriter::new(file);
    if packs {
        let mut packed = GzEncoder::new(&mut file, Compression::fast());
        write(&mut packed, grid, voxels)?;
        packed.finish()?;
    } else {
        write(&mut file, grid, voxels)?;
    }
    Ok(file.flush()?)
}

/// Writes a volume as NIfTI-1, low bytes first and lengths in millimetres: `voxels` are the image's, x
/// fastest, and come to stand in the order, and with the affine map, of the file that `grid` came from.
///
/// The map is written as the sform, in 32-bit floats: that of a NIfTI file's sform comes back exactly, if it is
/// in millimetres.
///
/// # Errors
/// Another number of values than voxels; the sink's.
pub fn write<V: Voxel>(sink: &mut impl Write, grid: &Grid, voxels: &[V]) -> Result<(), ImageError> {
    grid.check_length(voxels.len())?;
    sink.write_all(&header(grid, V::DATATYPE, V::COUNT))?;
    rows(sink, grid, voxels)?;
    Ok(())
}

fn rows<V: Voxel>(sink: &mut impl Write, grid: &Grid, voxels: &[V]) -> io::Result<()> {
    let mut stored = Vec::new();
    for row in grid.stored_rows() {
        stored.clear();
        row.places().for_each(|place| voxels[place].put(&mut stored));
        sink.write_all(&stored)?;
    }
    Ok(())
}

/// The header, and the four bytes that say that it is not extended.
fn header(grid: &Grid, datatype: i16, bytes: usize) -> [u8; VOX_OFFSET as usize] {
    const SCANNER: i16 = 1;
    const MILLIMETRES_PER_METRE: f64 = 1e3;
    let mut header = [0; VOX_OFFSET as usize];
    let mut put = |at: usize, bytes: &[u8]| header[at..at + bytes.len()].copy_from_slice(bytes);
    put(at::SIZEOF_HDR, &SIZEOF_HDR.to_le_bytes());
    put(at::MAGIC, &MAGIC);
    put(at::DATATYPE, &datatype.to_le_bytes());
    put(at::BITPIX, &(8 * bytes as i16).to_le_bytes());
    put(at::VOX_OFFSET, &f32::from(VOX_OFFSET).to_le_bytes());
    put(at::XYZT_UNITS, &[MILLIMETRES]);
    put(at::SFORM_CODE, &SCANNER.to_le_bytes());
    let sides = grid.stored_dims().map(|side| side as i16);
    let dim = [3, sides[0], sides[1], sides[2], 1, 1, 1, 1];
    for (number, length) in dim.into_iter().enumerate() {
        put(at::DIM + 2 * number, &length.to_le_bytes());
    }
    let columns = grid.stored_affine().to_cols_array_2d();
    let millimetres =
        columns.map(|column| column.map(|metres| (metres * MILLIMETRES_PER_METRE) as f32));
    for (axis, column) in millimetres.iter().enumerate() {
        for (row, &length) in column.iter().enumerate() {
            put(at::SROW_X + 16 * row + 4 * axis, &length.to_le_bytes());
        }
    }
    put(at::PIXDIM, &1.0_f32.to_le_bytes());
    for (axis, column) in millimetres[..3].iter().enumerate() {
        let distance = DVec3::from(column.map(f64::from)).length();
        put(at::PIXDIM + 4 * (axis + 1), &(distance as f32).to_le_bytes());
    }
    header
}

const _: () = assert!(Header::BYTES + 4 == VOX_OFFSET as usize);
const _: () = assert!(Grid::MAX_SIDE <= i16::MAX as u32);
