//! Little-endian bytes, read with bounds: shared by the readers of binary logs.

use std::ops::Range;

/// A place in the bytes of a log.
pub struct Cursor<'a> {
    /// Bytes of the log.
    pub bytes: &'a [u8],
    /// The next byte.
    pub at: usize,
}

impl<'a> Cursor<'a> {
    /// The next `length` bytes; `None` where the log ends before.
    pub fn take(&mut self, length: usize) -> Option<&'a [u8]> {
        let taken = self.bytes.get(self.at..self.at.checked_add(length)?)?;
        self.at += length;
        Some(taken)
    }

    /// The same as a place.
    pub fn skip(&mut self, length: usize) -> Option<Range<usize>> {
        let from = self.at;
        self.take(length).map(|_| from..self.at)
    }

    fn array<const N: usize>(&mut self) -> Option<[u8; N]> {
        self.take(N)?.try_into().ok()
    }

    /// A byte.
    pub fn u8(&mut self) -> Option<u8> {
        self.array().map(|[byte]| byte)
    }

    /// Two bytes.
    pub fn u16(&mut self) -> Option<u16> {
        self.array().map(u16::from_le_bytes)
    }

    /// Eight bytes.
    pub fn u64(&mut self) -> Option<u64> {
        self.array().map(u64::from_le_bytes)
    }

    /// A text up to its NUL.
    pub fn text(&mut self) -> Option<String> {
        let length = self.bytes.get(self.at..)?.iter().position(|byte| *byte == 0)?;
        let text = String::from_utf8_lossy(self.take(length)?).into_owned();
        self.at += 1;
        Some(text)
    }
}

/// The type of a number.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Number {
    /// Signed, of this many bytes.
    Signed(usize),
    /// Unsigned, of this many bytes.
    Unsigned(usize),
    /// IEEE 754 single precision.
    Float,
    /// IEEE 754 double precision.
    Double,
}

/// The types of numbers: as ULog names them, by the characters of Python's `struct` that mean them.
const NUMBERS: [(&str, &str, Number); 10] = [
    ("int8_t", "b", Number::Signed(1)),
    ("uint8_t bool char", "B ?", Number::Unsigned(1)),
    ("int16_t", "h", Number::Signed(2)),
    ("uint16_t", "H", Number::Unsigned(2)),
    ("int32_t", "i l", Number::Signed(4)),
    ("uint32_t", "I L", Number::Unsigned(4)),
    ("int64_t", "q", Number::Signed(8)),
    ("uint64_t", "Q", Number::Unsigned(8)),
    ("float", "f", Number::Float),
    ("double", "d", Number::Double),
];

impl Number {
    /// The type that a ULog calls `name`.
    pub fn of_ulog(name: &str) -> Option<Self> {
        NUMBERS.iter().find(|known| known.0.split(' ').any(|known| known == name)).map(|known| known.2)
    }

    /// The type that a character of Python's `struct` means.
    pub fn of_struct(character: &str) -> Option<Self> {
        NUMBERS.iter().find(|known| known.1.split(' ').any(|known| known == character)).map(|known| known.2)
    }

    /// Returns the number of bytes that it takes.
    pub fn size(self) -> usize {
        match self {
            Self::Signed(size) | Self::Unsigned(size) => size,
            Self::Float => 4,
            Self::Double => 8,
        }
    }

    /// The number at the start of `bytes`; NaN where they are too few.
    pub fn read(self, bytes: &[u8]) -> f64 {
        let Some(bytes) = bytes.get(..self.size()) else { return f64::NAN };
        let mut wide = [0; 8];
        wide[..bytes.len()].copy_from_slice(bytes);
        let bits = u64::from_le_bytes(wide);
        match self {
            Self::Unsigned(_) => bits as f64,
            Self::Signed(size) => {
                let unused = 64 - 8 * size;
                ((bits << unused).cast_signed() >> unused) as f64
            }
            Self::Float => f64::from(f32::from_bits((bits & 0xFFFF_FFFF) as u32)),
            Self::Double => f64::from_bits(bits),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::Number;

    #[test]
    fn numbers_are_read_with_their_sign() {
        assert_eq!(Number::Signed(2).read(&[0xFE, 0xFF]), -2.0);
        assert_eq!(Number::Unsigned(2).read(&[0xFE, 0xFF]), 65534.0);
        assert_eq!(Number::Signed(8).read(&[0xFF; 8]), -1.0);
        assert_eq!(Number::Float.read(&1.5_f32.to_le_bytes()), 1.5);
        assert_eq!(Number::Double.read(&1.5_f64.to_le_bytes()), 1.5);
        assert!(Number::Double.read(&[0; 7]).is_nan());
    }
}
