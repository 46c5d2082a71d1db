//! The header: what its entries mean.

use glam::{DAffine3, DMat3, DQuat, DVec3};

use crate::image::error::ImageError;
use crate::image::grid::Grid;
use crate::image::samples::{Endian, Number, Samples};

/// Where entries are, in bytes.
pub(super) mod at {
    pub(crate) const SIZEOF_HDR: usize = 0;
    pub(crate) const DIM: usize = 40;
    pub(crate) const DATATYPE: usize = 70;
    pub(crate) const BITPIX: usize = 72;
    pub(crate) const PIXDIM: usize = 76;
    pub(crate) const VOX_OFFSET: usize = 108;
    pub(crate) const SCL_SLOPE: usize = 112;
    pub(crate) const SCL_INTER: usize = 116;
    pub(crate) const XYZT_UNITS: usize = 123;
    pub(crate) const QFORM_CODE: usize = 252;
    pub(crate) const SFORM_CODE: usize = 254;
    pub(crate) const QUATERN_B: usize = 256;
    pub(crate) const QOFFSET_X: usize = 268;
    pub(crate) const SROW_X: usize = 280;
    pub(crate) const MAGIC: usize = 344;
}

pub(super) const SIZEOF_HDR: i32 = 348;
pub(super) const MAGIC: [u8; 4] = *b"n+1\0";
/// Where voxels begin if the header is not extended: it, and four bytes that say so.
pub(super) const VOX_OFFSET: u16 = 352;
pub(super) const MILLIMETRES: u8 = 2;

/// The most bytes that a header is extended by.
const MOST_EXTENSION: f32 = 16_777_216.0;
const NIFTI_2: i32 = 540;

/// What a header says.
#[derive(Debug)]
pub(super) struct Header {
    pub(super) grid: Grid,
    pub(super) samples: Samples,
    /// The bytes between it and the voxels.
    pub(super) gap: u64,
}

impl Header {
    /// The length of what is read as one.
    pub(super) const BYTES: usize = SIZEOF_HDR as usize;

    pub(super) fn new(bytes: &[u8; Self::BYTES]) -> Result<Self, ImageError> {
        let entries = Entries::new(bytes)?;
        let (slope, intercept) = entries.scale()?;
        let samples =
            Samples { number: entries.number()?, endian: entries.endian, slope, intercept };
        let grid = Grid::new(entries.dims()?, entries.affine()?)?;
        Ok(Self { grid, samples, gap: entries.gap()? })
    }
}

/// Whether a file that begins so may be NIfTI: its first entry is the header's length, in either order of bytes.
pub(super) fn begins(start: &[u8]) -> bool {
    let lengths = [SIZEOF_HDR, NIFTI_2];
    lengths.iter().any(|length| start == length.to_le_bytes() || start == length.to_be_bytes())
}

struct Entries<'a> {
    bytes: &'a [u8; Header::BYTES],
    endian: Endian,
}

impl<'a> Entries<'a> {
    fn new(bytes: &'a [u8; Header::BYTES]) -> Result<Self, ImageError> {
        let orders = [Endian::Little, Endian::Big].map(|endian| Self { bytes, endian });
        for entries in orders {
            match (entries.int(at::SIZEOF_HDR), entries.raw::<4>(at::MAGIC)) {
                (SIZEOF_HDR, MAGIC) => return Ok(entries),
                (SIZEOF_HDR, [b'n', b'i', b'1', 0]) => {
                    return Err(ImageError::Kind { kind: "NIfTI-1 in two files" });
                }
                (NIFTI_2, _) => return Err(ImageError::Kind { kind: "NIfTI-2" }),
                _ => {}
            }
        }
        Err(ImageError::Magic)
    }

    fn raw<const N: usize>(&self, at: usize) -> [u8; N] {
        std::array::from_fn(|byte| self.bytes[at + byte])
    }

    fn short(&self, at: usize) -> i16 {
        i16::from_le_bytes(self.endian.little(self.raw(at)))
    }

    fn int(&self, at: usize) -> i32 {
        i32::from_le_bytes(self.endian.little(self.raw(at)))
    }

    fn float(&self, at: usize) -> f32 {
        f32::from_le_bytes(self.endian.little(self.raw(at)))
    }

    fn floats<const N: usize>(&self, at: usize) -> [f64; N] {
        std::array::from_fn(|number| self.float(at + 4 * number).into())
    }

    fn dims(&self) -> Result<[u32; 3], ImageError> {
        let dim: [i16; 8] = std::array::from_fn(|number| self.short(at::DIM + 2 * number));
        let axes = match usize::try_from(dim[0]) {
            Ok(axes @ 3..=7) => axes,
            _ => return Err(ImageError::field("dim[0]", dim[0].to_string(), "3 to 7")),
        };
        if let Some(&length) = dim[4..=axes].iter().find(|&&length| length > 1) {
            return Err(ImageError::Series { count: length as u64 });
        }
        let [x, y, z] = [dim[1], dim[2], dim[3]];
        let side = |length: i16| {
            u32::try_from(length)
                .map_err(|_| ImageError::field("dim", length.to_string(), "positive"))
        };
        Ok([side(x)?, side(y)?, side(z)?])
    }

    fn number(&self) -> Result<Number, ImageError> {
        let (datatype, bitpix) = (self.short(at::DATATYPE), self.short(at::BITPIX));
        let (number, bits) = match datatype {
            2 => (Number::U8, 8),
            4 => (Number::I16, 16),
            8 => (Number::I32, 32),
            16 => (Number::F32, 32),
            64 => (Number::F64, 64),
            256 => (Number::I8, 8),
            512 => (Number::U16, 16),
            768 => (Number::U32, 32),
            1024 => (Number::I64, 64),
            1280 => (Number::U64, 64),
            _ => {
                let allowed = "an integer or a float of 8 to 64 bits (2, 4, 8, 16, 64, 256, 512, \
                               768, 1024, 1280)";
                return Err(ImageError::field("datatype", datatype.to_string(), allowed));
            }
        };
        if bitpix != bits {
            let allowed = "the number of bits of the datatype";
            return Err(ImageError::field("bitpix", bitpix.to_string(), allowed));
        }
        Ok(number)
    }

    /// Slope and intercept; a slope of 0 means that numbers are what they are, and so does, to other readers
    /// (nifticlib, nibabel), one that is not finite.
    fn scale(&self) -> Result<(f64, f64), ImageError> {
        let (slope, intercept) = (self.float(at::SCL_SLOPE), self.float(at::SCL_INTER));
        if slope == 0.0 || !slope.is_finite() {
            return Ok((1.0, 0.0));
        }
        if !intercept.is_finite() {
            return Err(ImageError::field("scl_inter", intercept.to_string(), "finite"));
        }
        Ok((slope.into(), intercept.into()))
    }

    fn gap(&self) -> Result<u64, ImageError> {
        let offset = self.float(at::VOX_OFFSET);
        let least = f32::from(VOX_OFFSET);
        // Some programs leave it out.
        let offset = if offset == 0.0 { least } else { offset };
        if !(least..=MOST_EXTENSION).contains(&offset) || offset.fract() != 0.0 {
            let allowed = "a whole number from 352 to 16777216";
            return Err(ImageError::field("vox_offset", offset.to_string(), allowed));
        }
        Ok(offset as u64 - Header::BYTES as u64)
    }

    /// The middle of voxel (i, j, k) in metres: by the sform if there is one, else by the qform, else
    /// by the distances alone (methods 3, 2 and 1 of the standard).
    fn affine(&self) -> Result<DAffine3, ImageError> {
        let affine = if self.short(at::SFORM_CODE) > 0 {
            self.sform()
        } else if self.short(at::QFORM_CODE) > 0 {
            self.qform()?
        } else {
            DAffine3::from_scale(self.distances()?)
        };
        let unit = self.metres_per_unit()?;
        Ok(DAffine3::from_mat3_translation(affine.matrix3 * unit, affine.translation * unit))
    }

    fn sform(&self) -> DAffine3 {
        let [x, y, z] = [0, 1, 2].map(|row| self.floats::<4>(at::SROW_X + 16 * row));
        let column = |number: usize| DVec3::new(x[number], y[number], z[number]);
        let matrix = DMat3::from_cols(column(0), column(1), column(2));
        DAffine3::from_mat3_translation(matrix, column(3))
    }

    fn qform(&self) -> Result<DAffine3, ImageError> {
        /// How much of the quaternion's length rounding may add.
        const ROUNDING: f64 = 1e-4;
        let imaginary = DVec3::from(self.floats::<3>(at::QUATERN_B));
        let square = imaginary.length_squared();
        if square.is_nan() || square > 1.0 + ROUNDING {
            let allowed = "of a length of 1 at most";
            return Err(ImageError::field("quatern_b, c, d", imaginary.to_string(), allowed));
        }
        let real = (1.0 - square).max(0.0).sqrt();
        let turn = DQuat::from_vec4(imaginary.extend(real)).normalize();
        let mut distances = self.distances()?;
        if self.float(at::PIXDIM) < 0.0 {
            distances.z = -distances.z;
        }
        let matrix = DMat3::from_quat(turn) * DMat3::from_diagonal(distances);
        let origin = DVec3::from(self.floats::<3>(at::QOFFSET_X));
        Ok(DAffine3::from_mat3_translation(matrix, origin))
    }

    fn distances(&self) -> Result<DVec3, ImageError> {
        let pixdim = DVec3::from(self.floats::<3>(at::PIXDIM + 4));
        if pixdim.is_finite() && pixdim.min_element() > 0.0 {
            return Ok(pixdim);
        }
        Err(ImageError::field("pixdim[1..=3]", pixdim.to_string(), "positive and finite"))
    }

    fn metres_per_unit(&self) -> Result<f64, ImageError> {
        // The lowest three bits are those of space. Without any, everyone means millimetres.
        match self.bytes[at::XYZT_UNITS] & 7 {
            1 => Ok(1.0),
            0 | MILLIMETRES => Ok(1e-3),
            3 => Ok(1e-6),
            code => {
                let allowed = "0 (unknown), 1 (m), 2 (mm) or 3 (µm) in its lowest three bits";
                Err(ImageError::field("xyzt_units", code.to_string(), allowed))
            }
        }
    }
}
