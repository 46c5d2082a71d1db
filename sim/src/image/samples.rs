//! How a file stores a voxel's value.

use super::hounsfield::AIR;

/// The types of numbers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Number {
    U8,
    I8,
    U16,
    I16,
    U32,
    I32,
    U64,
    I64,
    F32,
    F64,
}

/// The order of a number's bytes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Endian {
    Little,
    Big,
}

impl Endian {
    /// The bytes with the lowest first.
    pub(super) fn little<const N: usize>(self, mut bytes: [u8; N]) -> [u8; N] {
        if self == Self::Big {
            bytes.reverse();
        }
        bytes
    }
}

/// How stored numbers become Hounsfield numbers: `slope` times the number, plus `intercept`.
#[derive(Clone, Copy, Debug)]
pub(super) struct Samples {
    pub(super) number: Number,
    pub(super) endian: Endian,
    pub(super) slope: f64,
    pub(super) intercept: f64,
}

impl Samples {
    /// The bytes of a number.
    pub(super) fn bytes(&self) -> usize {
        match self.number {
            Number::U8 | Number::I8 => 1,
            Number::U16 | Number::I16 => 2,
            Number::U32 | Number::I32 | Number::F32 => 4,
            Number::U64 | Number::I64 | Number::F64 => 8,
        }
    }

    /// Hands over the Hounsfield number of each stored number, in order: rounded, and the nearest that
    /// 16 bits hold. What is not a number is air: some programs store it outside the scanner's circle.
    pub(super) fn decode(&self, stored: &[u8], mut put: impl FnMut(i16)) {
        let put = |value: f64| {
            let hounsfield = value * self.slope + self.intercept;
            // The conversion takes the nearest that there is.
            put(if hounsfield.is_nan() { AIR } else { hounsfield.round() as i16 });
        };
        match self.number {
            Number::U8 => self.each(stored, |bytes| u8::from_le_bytes(bytes).into(), put),
            Number::I8 => self.each(stored, |bytes| i8::from_le_bytes(bytes).into(), put),
            Number::U16 => self.each(stored, |bytes| u16::from_le_bytes(bytes).into(), put),
            Number::I16 => self.each(stored, |bytes| i16::from_le_bytes(bytes).into(), put),
            Number::U32 => self.each(stored, |bytes| u32::from_le_bytes(bytes).into(), put),
            Number::I32 => self.each(stored, |bytes| i32::from_le_bytes(bytes).into(), put),
            Number::U64 => self.each(stored, |bytes| u64::from_le_bytes(bytes) as f64, put),
            Number::I64 => self.each(stored, |bytes| i64::from_le_bytes(bytes) as f64, put),
            Number::F32 => self.each(stored, |bytes| f32::from_le_bytes(bytes).into(), put),
            Number::F64 => self.each(stored, f64::from_le_bytes, put),
        }
    }

    fn each<const N: usize>(
        &self,
        stored: &[u8],
        value: impl Fn([u8; N]) -> f64,
        put: impl FnMut(f64),
    ) {
        let (numbers, _) = stored.as_chunks::<N>();
        numbers.iter().map(|&bytes| value(self.endian.little(bytes))).for_each(put);
    }
}
