//! Makes files as the formats' descriptions have them, valid unless a test wants otherwise.

// Every test binary compiles all of it and uses some.
#![allow(dead_code, unreachable_pub)]

use std::io::Write;

use flate2::Compression;
use flate2::write::GzEncoder;
use glam::{DAffine3, DMat3, DQuat, DVec3};

/// A type of numbers: NIfTI's code, NRRD's name, its bits, and the greatest value that tests store in it.
pub struct Number {
    pub datatype: i16,
    pub name: &'static str,
    pub bits: i16,
    pub signed: bool,
}

pub const NUMBERS: [Number; 10] = [
    Number { datatype: 2, name: "uint8", bits: 8, signed: false },
    Number { datatype: 256, name: "signed char", bits: 8, signed: true },
    Number { datatype: 512, name: "ushort", bits: 16, signed: false },
    Number { datatype: 4, name: "short", bits: 16, signed: true },
    Number { datatype: 768, name: "unsigned int", bits: 32, signed: false },
    Number { datatype: 8, name: "int", bits: 32, signed: true },
    Number { datatype: 1280, name: "uint64", bits: 64, signed: false },
    Number { datatype: 1024, name: "longlong", bits: 64, signed: true },
    Number { datatype: 16, name: "float", bits: 32, signed: true },
    Number { datatype: 64, name: "double", bits: 64, signed: true },
];

impl Number {
    /// Values that the type holds, and 16 bits do, one for each voxel.
    pub fn values(&self, voxels: usize, seed: u64) -> Vec<i16> {
        let range = if self.bits == 8 { 128 } else { 3_000 };
        let value = |voxel: u64| {
            let mixed = (seed ^ voxel).wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 33;
            let value = (mixed % range) as i16;
            if self.signed && mixed % 7 < 3 { -value } else { value }
        };
        (0..voxels as u64).map(value).collect()
    }

    pub fn encode(&self, values: &[i16], big: bool) -> Vec<u8> {
        values.iter().flat_map(|&value| self.bytes(value, big)).collect()
    }

    fn bytes(&self, value: i16, big: bool) -> Vec<u8> {
        let wide = i64::from(value);
        let mut bytes = match self.name {
            "float" => f32::from(value).to_le_bytes().to_vec(),
            "double" => f64::from(value).to_le_bytes().to_vec(),
            _ => wide.to_le_bytes()[..self.bits as usize / 8].to_vec(),
        };
        if big {
            bytes.reverse();
        }
        bytes
    }
}

/// A file of NIfTI-1, by its entries.
#[derive(Clone)]
pub struct Nifti {
    pub big: bool,
    pub sizeof_hdr: i32,
    pub dim: [i16; 8],
    pub datatype: i16,
    pub bitpix: i16,
    pub pixdim: [f32; 8],
    pub vox_offset: f32,
    pub scl: [f32; 2],
    pub xyzt_units: u8,
    pub qform_code: i16,
    pub sform_code: i16,
    pub quatern: [f32; 3],
    pub qoffset: [f32; 3],
    pub srow: [[f32; 4]; 3],
    pub magic: [u8; 4],
    pub extension: Vec<u8>,
    pub data: Vec<u8>,
}

impl Nifti {
    /// 2 × 3 × 2 voxels of 16 bits, numbered from −100 in steps of 50, 1 mm apart.
    pub fn small() -> Self {
        let values: Vec<i16> = (0..12).map(|voxel| 50 * voxel - 100).collect();
        Self {
            big: false,
            sizeof_hdr: 348,
            dim: [3, 2, 3, 2, 1, 1, 1, 1],
            datatype: 4,
            bitpix: 16,
            pixdim: [1.0; 8],
            vox_offset: 352.0,
            scl: [0.0; 2],
            xyzt_units: 2,
            qform_code: 0,
            sform_code: 1,
            quatern: [0.0; 3],
            qoffset: [0.0; 3],
            srow: [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]],
            magic: *b"n+1\0",
            extension: vec![0; 4],
            data: NUMBERS[3].encode(&values, false),
        }
    }

    pub fn bytes(&self) -> Vec<u8> {
        let mut file = vec![0; 348];
        let mut put = |at: usize, mut bytes: Vec<u8>| {
            if self.big {
                bytes.reverse();
            }
            file[at..at + bytes.len()].copy_from_slice(&bytes);
        };
        put(0, self.sizeof_hdr.to_le_bytes().to_vec());
        (0..8).for_each(|n| put(40 + 2 * n, self.dim[n].to_le_bytes().to_vec()));
        put(70, self.datatype.to_le_bytes().to_vec());
        put(72, self.bitpix.to_le_bytes().to_vec());
        (0..8).for_each(|n| put(76 + 4 * n, self.pixdim[n].to_le_bytes().to_vec()));
        put(108, self.vox_offset.to_le_bytes().to_vec());
        (0..2).for_each(|n| put(112 + 4 * n, self.scl[n].to_le_bytes().to_vec()));
        put(123, vec![self.xyzt_units]);
        put(252, self.qform_code.to_le_bytes().to_vec());
        put(254, self.sform_code.to_le_bytes().to_vec());
        (0..3).for_each(|n| put(256 + 4 * n, self.quatern[n].to_le_bytes().to_vec()));
        (0..3).for_each(|n| put(268 + 4 * n, self.qoffset[n].to_le_bytes().to_vec()));
        let srow = self.srow.as_flattened();
        (0..12).for_each(|n| put(280 + 4 * n, srow[n].to_le_bytes().to_vec()));
        file[344..].copy_from_slice(&self.magic);
        file.extend_from_slice(&self.extension);
        file.extend_from_slice(&self.data);
        file
    }

    /// Sets the sform to a map into metres.
    pub fn set_sform(&mut self, affine: DAffine3) {
        let columns = affine.to_cols_array_2d();
        self.sform_code = 2;
        for (row, entries) in self.srow.iter_mut().enumerate() {
            *entries = columns.map(|column| (1e3 * column[row]) as f32);
        }
    }

    /// Sets the qform to a map into metres, without shear.
    pub fn set_qform(&mut self, affine: DAffine3) {
        let (mut matrix, mirrored) = (affine.matrix3, affine.matrix3.determinant() < 0.0);
        let lengths = [matrix.x_axis, matrix.y_axis, matrix.z_axis].map(DVec3::length);
        if mirrored {
            matrix.z_axis = -matrix.z_axis;
        }
        let turn = matrix * DMat3::from_diagonal(DVec3::from(lengths).recip());
        let turn = DQuat::from_mat3(&turn);
        let turn = if turn.w < 0.0 { -turn } else { turn };
        self.qform_code = 1;
        self.sform_code = 0;
        self.pixdim[0] = if mirrored { -1.0 } else { 1.0 };
        for (pixdim, length) in self.pixdim[1..].iter_mut().zip(lengths) {
            *pixdim = (1e3 * length) as f32;
        }
        self.quatern = turn.xyz().as_vec3().into();
        self.qoffset = (1e3 * affine.translation).as_vec3().into();
    }
}

pub fn gzip(bytes: &[u8]) -> Vec<u8> {
    let mut encoder = GzEncoder::new(Vec::new(), Compression::default());
    encoder.write_all(bytes).expect("memory takes all");
    encoder.finish().expect("memory takes all")
}

/// The lines of a header of NRRD: 2 × 3 × 2 voxels as in [`Nifti::small`], as they stand in `data`.
pub fn nrrd(encoding: &str) -> Vec<String> {
    [
        "NRRD0004",
        "# a comment",
        "type: short",
        "dimension: 3",
        "space: left-posterior-superior",
        "sizes: 2 3 2",
        "space directions: (1,0,0) (0,1,0) (0,0,1)",
        "kinds: domain domain domain",
        "endian: little",
        &format!("encoding: {encoding}"),
        "space origin: (0,0,0)",
        "modality:=CT",
    ]
    .map(str::to_owned)
    .to_vec()
}

pub fn nrrd_bytes(lines: &[String], data: &[u8]) -> Vec<u8> {
    let mut file = Vec::new();
    for line in lines {
        file.extend_from_slice(line.as_bytes());
        file.push(b'\n');
    }
    file.push(b'\n');
    file.extend_from_slice(data);
    file
}
