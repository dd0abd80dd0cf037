//! Thrift's compact protocol, as far as the sizes in a Parquet file have to be known before anything is reserved for them.

/// Structures within structures at most.
const DEPTH_MAX: u8 = 32;

/// Kinds of values.
const BOOLS: [u8; 2] = [1, 2];
const BYTE: u8 = 3;
const INTEGERS: [u8; 3] = [4, 5, 6];
const DOUBLE: u8 = 7;
const BINARY: u8 = 8;
const LISTS: [u8; 2] = [9, 10];
const MAP: u8 = 11;
/// A structure, whose fields follow.
pub const STRUCT: u8 = 12;

/// A field's number and kind.
pub type Field = (i16, u8);

/// A place in bytes, from which values are read.
pub struct Cursor<'a> {
    bytes: &'a [u8],
    /// Bytes that were read.
    pub at: usize,
    /// Structures that were passed over in lists.
    pub listed: usize,
}

impl<'a> Cursor<'a> {
    /// The begin of `bytes`.
    pub fn new(bytes: &'a [u8]) -> Self {
        Self { bytes, at: 0, listed: 0 }
    }

    fn byte(&mut self) -> Option<u8> {
        let byte = self.bytes.get(self.at).copied()?;
        self.at += 1;
        Some(byte)
    }

    /// A number without a sign.
    pub fn varint(&mut self) -> Option<u64> {
        let mut value = 0;
        for shift in (0..64).step_by(7) {
            let byte = self.byte()?;
            value |= u64::from(byte & 0x7f) << shift;
            if byte < 0x80 {
                return Some(value);
            }
        }
        None
    }

    /// A whole number.
    pub fn integer(&mut self) -> Option<i64> {
        let value = self.varint()?;
        Some((value >> 1).cast_signed() ^ -(value & 1).cast_signed())
    }

    /// The next field of a structure whose last one was `last`; 0 as kind at its end.
    pub fn field(&mut self, last: &mut i16) -> Option<Field> {
        let head = self.byte()?;
        let (step, kind) = (head >> 4, head & 0x0f);
        if head == 0 {
            return Some((0, 0));
        }
        *last =
            if step == 0 { i16::try_from(self.integer()?).ok()? } else { last.checked_add(i16::from(step))? };
        Some((*last, kind))
    }

    /// The kind of a list's elements, and their number, for each of which a byte is left at least.
    pub fn list(&mut self) -> Option<(u8, usize)> {
        let head = self.byte()?;
        let size =
            if head >> 4 == 15 { usize::try_from(self.varint()?).ok()? } else { usize::from(head >> 4) };
        (size <= self.bytes.len() - self.at).then_some((head & 0x0f, size))
    }

    /// The bytes that were not read.
    pub fn rest(&self) -> &'a [u8] {
        &self.bytes[self.at..]
    }

    /// The next `count` bytes.
    pub fn take(&mut self, count: usize) -> Option<&'a [u8]> {
        let taken = self.rest().get(..count)?;
        self.at += count;
        Some(taken)
    }

    /// Passes over a field of this kind.
    pub fn skip(&mut self, kind: u8) -> Option<()> {
        // Of a field, the kind is the value.
        if BOOLS.contains(&kind) { Some(()) } else { self.skip_within(kind, DEPTH_MAX) }
    }

    fn skip_within(&mut self, kind: u8, depth: u8) -> Option<()> {
        let depth = depth.checked_sub(1)?;
        match kind {
            kind if BOOLS.contains(&kind) || kind == BYTE => self.take(1).map(drop),
            kind if INTEGERS.contains(&kind) => self.varint().map(drop),
            DOUBLE => self.take(8).map(drop),
            BINARY => {
                let length = usize::try_from(self.varint()?).ok()?;
                self.take(length).map(drop)
            }
            kind if LISTS.contains(&kind) => {
                let (kind, size) = self.list()?;
                self.listed += if kind == STRUCT { size } else { 0 };
                (0..size).try_for_each(|_| self.skip_within(kind, depth))
            }
            MAP => {
                let size = self.varint()?;
                let kinds = if size == 0 { 0 } else { self.byte()? };
                (0..size).try_for_each(|_| {
                    self.skip_within(kinds >> 4, depth)?;
                    self.skip_within(kinds & 0x0f, depth)
                })
            }
            STRUCT => self.each_field(|cursor, (_, kind)| {
                if BOOLS.contains(&kind) { Some(()) } else { cursor.skip_within(kind, depth) }
            }),
            _ => None,
        }
    }

    /// Hands each field of a structure to `read`, which has to pass over it.
    pub fn each_field(&mut self, mut read: impl FnMut(&mut Self, Field) -> Option<()>) -> Option<()> {
        let mut last = 0;
        loop {
            match self.field(&mut last)? {
                (_, 0) => return Some(()),
                field => read(self, field)?,
            }
        }
    }
}
