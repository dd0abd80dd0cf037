//! Pages of a column: their headers, checked against the rows that they can hold, and their bytes unpacked within that.

use std::borrow::Cow;
use std::io::Read as _;

use parquet::basic::{Compression, Encoding};

use super::thrift::{Cursor, STRUCT};

/// Bytes of a page, unpacked: for each value as many as a number of usual length takes, or those of a longer one, and as
/// many as its levels take; and these besides.
const BYTES_PER_NUMBER: usize = 12;
const BYTES_OF_LEVELS: usize = 4;
const BYTES_FREE: usize = 4096;

/// Words for the fault of a column.
pub type Fault = String;

/// A page of a column.
pub enum Page<'a> {
    /// Values that pages of data name by number.
    Dictionary {
        /// Number of values.
        values: usize,
        /// The values.
        content: Cow<'a, [u8]>,
    },
    /// Rows.
    Data {
        /// Number of rows, empty ones included.
        values: usize,
        /// Encoding of the values.
        encoding: Encoding,
        /// The levels, where they have a length of their own, and the values.
        content: Cow<'a, [u8]>,
        /// Length of the levels; `None` if it stands in front of them.
        levels: Option<usize>,
    },
}

/// Pages of one column in one group of rows.
pub struct Pages<'a> {
    /// The bytes that were not read yet.
    rest: &'a [u8],
    compression: Compression,
    /// Most bytes of a page for each value.
    bytes_per_value: usize,
    /// Rows of the group that no page had yet.
    rows_left: usize,
    rows: usize,
}

/// A page's header.
#[derive(Default)]
struct Header {
    kind: Option<i64>,
    unpacked: Option<i64>,
    packed: Option<i64>,
    /// Fields of the header of its kind, by their number.
    fields: [Option<i64>; 7],
    is_packed: Option<bool>,
}

impl<'a> Pages<'a> {
    /// The pages in `bytes`, which hold `rows` rows of numbers of `width` bytes.
    pub fn new(bytes: &'a [u8], compression: Compression, rows: usize, width: usize) -> Self {
        let bytes_per_value = width.max(BYTES_PER_NUMBER) + BYTES_OF_LEVELS;
        Self { rest: bytes, compression, bytes_per_value, rows_left: rows, rows }
    }

    /// The next page; `None` behind that with the last row.
    pub fn next(&mut self) -> Result<Option<Page<'a>>, Fault> {
        const DATA: i64 = 0;
        const INDEX: i64 = 1;
        const DICTIONARY: i64 = 2;
        const DATA_V2: i64 = 3;
        while self.rows_left > 0 && !self.rest.is_empty() {
            let mut cursor = Cursor::new(self.rest);
            let header = Header::read(&mut cursor).ok_or("a page's header is damaged")?;
            let (begin, packed) = (cursor.at, size(header.packed)?);
            let end = begin.checked_add(packed).filter(|end| *end <= self.rest.len());
            let end = end.ok_or_else(|| format!("a page of {packed} bytes reaches beyond its column"))?;
            let (page, rest) = self.rest.split_at(end);
            self.rest = rest;
            let content = &page[begin..];
            match header.kind {
                Some(DATA) => return self.data(&header, content).map(Some),
                Some(DATA_V2) => return self.data_v2(&header, content).map(Some),
                Some(DICTIONARY) => return self.dictionary(&header, content).map(Some),
                Some(INDEX) => {}
                kind => return Err(format!("a page is of the unknown kind {}", kind.unwrap_or(-1))),
            }
        }
        Ok(None)
    }

    fn data(&mut self, header: &Header, content: &'a [u8]) -> Result<Page<'a>, Fault> {
        let values = self.values(header)?;
        let encoding = encoding(header.fields[2])?;
        let content = self.unpacked(content, header, values, 0)?;
        Ok(Page::Data { values, encoding, content, levels: None })
    }

    fn data_v2(&mut self, header: &Header, content: &'a [u8]) -> Result<Page<'a>, Fault> {
        let values = self.values(header)?;
        let (levels, repetition) = (size(header.fields[5])?, size(header.fields[6])?);
        if levels > content.len() || repetition > 0 {
            return Err("the marks of empty cells reach beyond their page".to_owned());
        }
        let encoding = encoding(header.fields[4])?;
        let content = match header.is_packed {
            Some(false) => Cow::Borrowed(content),
            _ => self.unpacked(content, header, values, levels)?,
        };
        Ok(Page::Data { values, encoding, content, levels: Some(levels) })
    }

    fn dictionary(&self, header: &Header, content: &'a [u8]) -> Result<Page<'a>, Fault> {
        let values = size(header.fields[1])?;
        if values > self.rows {
            return Err(format!("a dictionary has {values} values for {} rows", self.rows));
        }
        match encoding(header.fields[2])? {
            Encoding::PLAIN | Encoding::PLAIN_DICTIONARY => {
                Ok(Page::Dictionary { values, content: self.unpacked(content, header, values, 0)? })
            }
            other => Err(format!("a dictionary is encoded as {other}")),
        }
    }

    /// Number of values of a page of data: rows, as no cell holds several.
    fn values(&mut self, header: &Header) -> Result<usize, Fault> {
        let (values, left) = (size(header.fields[1])?, self.rows_left);
        self.rows_left = left.checked_sub(values).ok_or_else(|| {
            format!("a page has {values} values for the {left} rows that are left of {}", self.rows)
        })?;
        Ok(values)
    }

    /// The content of a page of `values` values behind `levels` bytes that are not packed.
    fn unpacked(
        &self,
        content: &'a [u8],
        header: &Header,
        values: usize,
        levels: usize,
    ) -> Result<Cow<'a, [u8]>, Fault> {
        let (length, most) = (size(header.unpacked)?, BYTES_FREE + self.bytes_per_value * values);
        let other = |found: usize| Err(format!("a page unpacks to {found} bytes, expected {length}"));
        let Some(wanted) = length.checked_sub(levels).filter(|_| length <= most) else {
            return Err(format!("a page claims {length} bytes for {values} values, expected at most {most}"));
        };
        if self.compression == Compression::UNCOMPRESSED {
            return if content.len() == length { Ok(content.into()) } else { other(content.len()) };
        }
        let (plain, packed) = content.split_at(levels.min(content.len()));
        let mut unpacked = Vec::with_capacity(length);
        unpacked.extend_from_slice(plain);
        // A page of empty cells alone has no values.
        if wanted > 0 {
            unpack(self.compression, packed, wanted, &mut unpacked)?;
        }
        if unpacked.len() == length { Ok(unpacked.into()) } else { other(unpacked.len()) }
    }
}

/// True for a way of packing that is unpacked here.
pub fn is_unpacked(compression: Compression) -> bool {
    matches!(
        compression,
        Compression::UNCOMPRESSED
            | Compression::SNAPPY
            | Compression::GZIP(_)
            | Compression::ZSTD(_)
            | Compression::LZ4_RAW
    )
}

/// Appends the unpacked bytes of `packed`; no more than a byte beyond `length`.
fn unpack(compression: Compression, packed: &[u8], length: usize, to: &mut Vec<u8>) -> Result<(), Fault> {
    let from = to.len();
    if let Compression::GZIP(_) = compression {
        let mut reader = flate2::read::MultiGzDecoder::new(packed).take(length as u64 + 1);
        return reader.read_to_end(to).map(drop).map_err(|error| error.to_string());
    }
    to.resize(from + length, 0);
    let written = match compression {
        Compression::SNAPPY => {
            snap::raw::Decoder::new().decompress(packed, &mut to[from..]).map_err(|error| error.to_string())
        }
        Compression::ZSTD(_) => {
            zstd::bulk::decompress_to_buffer(packed, &mut to[from..]).map_err(|error| error.to_string())
        }
        Compression::LZ4_RAW => {
            lz4_flex::block::decompress_into(packed, &mut to[from..]).map_err(|error| error.to_string())
        }
        other => Err(format!("it is packed by {other}, expected none, snappy, gzip, zstd or lz4_raw")),
    }?;
    to.truncate(from + written);
    Ok(())
}

impl Header {
    fn read(cursor: &mut Cursor<'_>) -> Option<Self> {
        let mut header = Self::default();
        cursor.each_field(|cursor, (number, kind)| match number {
            1 => cursor.integer().map(|value| header.kind = Some(value)),
            2 => cursor.integer().map(|value| header.unpacked = Some(value)),
            3 => cursor.integer().map(|value| header.packed = Some(value)),
            5 | 7 | 8 if kind == STRUCT => cursor.each_field(|cursor, (number, kind)| match (number, kind) {
                // Of a truth value, the kind is the value.
                (7, 1 | 2) => {
                    header.is_packed = Some(kind == 1);
                    Some(())
                }
                (1..=6, 4..=6) => {
                    let field = header.fields.get_mut(usize::try_from(number).ok()?)?;
                    *field = Some(cursor.integer()?);
                    Some(())
                }
                _ => cursor.skip(kind),
            }),
            _ => cursor.skip(kind),
        })?;
        Some(header)
    }
}

/// The encodings that numbers and truth values have.
fn encoding(number: Option<i64>) -> Result<Encoding, Fault> {
    match number {
        Some(0) => Ok(Encoding::PLAIN),
        Some(2) => Ok(Encoding::PLAIN_DICTIONARY),
        Some(3) => Ok(Encoding::RLE),
        Some(5) => Ok(Encoding::DELTA_BINARY_PACKED),
        Some(8) => Ok(Encoding::RLE_DICTIONARY),
        Some(9) => Ok(Encoding::BYTE_STREAM_SPLIT),
        other => Err(format!("a page has the encoding {}, which is not read", other.unwrap_or(-1))),
    }
}

/// A size from a header.
fn size(number: Option<i64>) -> Result<usize, Fault> {
    let size =
        number.and_then(|number| i32::try_from(number).ok()).and_then(|number| usize::try_from(number).ok());
    size.ok_or_else(|| "a page's header lacks a size, or has an impossible one".to_owned())
}
