//! Values as bytes: little-endian, numbers that are mostly small in as few bytes as they need.

use glam::Vec3;
use thiserror::Error;

/// Bytes are not what they should be.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
pub enum Malformed {
    /// They end too early.
    #[error("it ends too early")]
    Ended,
    /// They go on after the last value.
    #[error("{left} bytes are left over")]
    Left {
        /// How many.
        left: usize,
    },
    /// A value is none of those that it may be.
    #[error("{what} cannot be {value}")]
    Value {
        /// What the value is of.
        what: &'static str,
        /// The value.
        value: u64,
    },
    /// A text is not in UTF-8.
    #[error("a text is not in UTF-8")]
    Text,
    /// It is of another kind than the one asked for.
    #[error("a scene of the kind {found:?} is not one of the kind {wanted:?}")]
    Kind {
        /// The kind it is of.
        found: String,
        /// The kind asked for.
        wanted: &'static str,
    },
}

/// Writes values.
#[derive(Debug)]
pub struct Encoder<'a>(pub &'a mut Vec<u8>);

impl Encoder<'_> {
    /// One byte.
    pub fn byte(&mut self, value: u8) {
        self.0.push(value);
    }

    /// Yes or no, in one byte.
    pub fn flag(&mut self, value: bool) {
        self.byte(value.into());
    }

    /// A number that is mostly small, in one to ten bytes: seven bits each, the lowest first (LEB128).
    pub fn number(&mut self, mut value: u64) {
        while value > 0x7f {
            self.byte(value as u8 | 0x80);
            value >>= 7;
        }
        self.byte(value as u8);
    }

    /// A number in eight bytes.
    pub fn wide(&mut self, value: u64) {
        self.0.extend_from_slice(&value.to_le_bytes());
    }

    /// Numbers in eight bytes each, after how many they are.
    pub fn wides(&mut self, values: &[u64]) {
        self.number(values.len() as u64);
        values.iter().for_each(|&value| self.wide(value));
    }

    /// A number bit by bit, in four bytes.
    pub fn float(&mut self, value: f32) {
        self.0.extend_from_slice(&value.to_bits().to_le_bytes());
    }

    /// Numbers bit by bit.
    pub fn floats<const N: usize>(&mut self, values: [f32; N]) {
        values.into_iter().for_each(|value| self.float(value));
    }

    /// Bytes, after their number.
    pub fn bytes(&mut self, value: &[u8]) {
        self.number(value.len() as u64);
        self.0.extend_from_slice(value);
    }

    /// A text, after its length.
    pub fn text(&mut self, value: &str) {
        self.bytes(value.as_bytes());
    }
}

/// Reads what an [`Encoder`] has written, in the same order.
#[derive(Clone, Debug)]
pub struct Decoder<'a>(pub &'a [u8]);

impl<'a> Decoder<'a> {
    /// Whether nothing is left.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    fn array<const N: usize>(&mut self) -> Result<[u8; N], Malformed> {
        let (first, rest) = self.0.split_first_chunk().ok_or(Malformed::Ended)?;
        self.0 = rest;
        Ok(*first)
    }

    /// One byte.
    ///
    /// # Errors
    /// There is none.
    pub fn byte(&mut self) -> Result<u8, Malformed> {
        self.array::<1>().map(|[byte]| byte)
    }

    /// Yes or no.
    ///
    /// # Errors
    /// There is no byte, or it is neither.
    pub fn flag(&mut self, what: &'static str) -> Result<bool, Malformed> {
        match self.byte()? {
            0 => Ok(false),
            1 => Ok(true),
            value => Err(Malformed::Value { what, value: value.into() }),
        }
    }

    /// A number of one to ten bytes, in as few as it needs.
    ///
    /// # Errors
    /// The bytes end in it, or it is written otherwise.
    pub fn number(&mut self) -> Result<u64, Malformed> {
        let mut value = 0;
        for shift in (0..).step_by(7) {
            let byte = self.byte()?;
            let bits = u64::from(byte & 0x7f);
            let fits = shift < 63 || (shift == 63 && bits <= 1);
            let is_short = shift == 0 || byte != 0;
            if !(fits && is_short) {
                return Err(Malformed::Value { what: "a number's last byte", value: byte.into() });
            }
            value |= bits << shift;
            if byte < 0x80 {
                break;
            }
        }
        Ok(value)
    }

    /// A number of one to ten bytes that must fit into a smaller type.
    ///
    /// # Errors
    /// As [`Decoder::number`], or it is too large.
    pub fn small<T: TryFrom<u64>>(&mut self, what: &'static str) -> Result<T, Malformed> {
        let value = self.number()?;
        T::try_from(value).map_err(|_| Malformed::Value { what, value })
    }

    /// A number of eight bytes.
    ///
    /// # Errors
    /// There are fewer.
    pub fn wide(&mut self) -> Result<u64, Malformed> {
        self.array().map(u64::from_le_bytes)
    }

    /// A number bit by bit.
    ///
    /// # Errors
    /// There are not four bytes.
    pub fn float(&mut self) -> Result<f32, Malformed> {
        self.array().map(|bytes| f32::from_bits(u32::from_le_bytes(bytes)))
    }

    /// Numbers bit by bit.
    ///
    /// # Errors
    /// There are not four bytes for each.
    pub fn floats<const N: usize>(&mut self) -> Result<[f32; N], Malformed> {
        let mut values = [0.0; N];
        for value in &mut values {
            *value = self.float()?;
        }
        Ok(values)
    }

    /// Three numbers bit by bit.
    ///
    /// # Errors
    /// There are not twelve bytes.
    pub fn vector(&mut self) -> Result<Vec3, Malformed> {
        self.floats().map(Vec3::from_array)
    }

    /// Bytes, after their number.
    ///
    /// # Errors
    /// There are fewer.
    pub fn bytes(&mut self) -> Result<&'a [u8], Malformed> {
        let length = self.small("a length")?;
        let (first, rest) = self.0.split_at_checked(length).ok_or(Malformed::Ended)?;
        self.0 = rest;
        Ok(first)
    }

    /// Numbers of eight bytes, after how many they are.
    ///
    /// # Errors
    /// There are fewer.
    pub fn wides(&mut self) -> Result<Vec<u64>, Malformed> {
        let count: usize = self.small("a length")?;
        let length = count.checked_mul(8).ok_or(Malformed::Ended)?;
        let (first, rest) = self.0.split_at_checked(length).ok_or(Malformed::Ended)?;
        self.0 = rest;
        let (wides, _) = first.as_chunks();
        Ok(wides.iter().map(|&bytes| u64::from_le_bytes(bytes)).collect())
    }

    /// A text, after its length.
    ///
    /// # Errors
    /// As [`Decoder::bytes`], or it is not in UTF-8.
    pub fn text(&mut self) -> Result<&'a str, Malformed> {
        std::str::from_utf8(self.bytes()?).map_err(|_| Malformed::Text)
    }

    /// A text of at most so many bytes, as one that is shown to people should be; `what` is what its length is of.
    ///
    /// # Errors
    /// As [`Decoder::text`], or it is longer.
    pub fn text_within(&mut self, most: usize, what: &'static str) -> Result<&'a str, Malformed> {
        let text = self.text()?;
        match text.len() {
            length if length <= most => Ok(text),
            length => Err(Malformed::Value { what, value: length as u64 }),
        }
    }

    /// Sees that nothing is left.
    ///
    /// # Errors
    /// Something is.
    pub fn finish(self) -> Result<(), Malformed> {
        match self.0.len() {
            0 => Ok(()),
            left => Err(Malformed::Left { left }),
        }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn numbers(value: u64, shift in 0..64_u32) {
            let value = value >> shift;
            let mut bytes = Vec::new();
            Encoder(&mut bytes).number(value);
            let mut decoder = Decoder(&bytes);
            prop_assert_eq!(decoder.number(), Ok(value));
            prop_assert!(decoder.is_empty());
            prop_assert_eq!(Decoder(&bytes[..bytes.len() - 1]).number(), Err(Malformed::Ended));
        }
    }

    #[test]
    fn a_number_has_one_way_of_being_written() {
        for bytes in [&[0x80, 0][..], &[0xff; 10], &[0x81, 0x80, 0], &[0xff; 11]] {
            assert!(Decoder(bytes).number().is_err(), "{bytes:?}");
        }
        let greatest = [0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 1];
        assert_eq!(Decoder(&greatest).number(), Ok(u64::MAX));
    }

    #[test]
    fn lengths_that_are_not_there() {
        let mut bytes = Vec::new();
        Encoder(&mut bytes).number(u64::MAX);
        assert_eq!(Decoder(&bytes).bytes(), Err(Malformed::Ended));
    }
}
