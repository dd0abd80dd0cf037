//! Encodings of texts: UTF-8, and UTF-16 as programs on Windows write it.

use std::borrow::Cow;

/// Number of bytes that are looked at for the encoding.
const LOOKED_AT: usize = 4096;

/// Order of the two bytes of a character.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Utf16 {
    /// The low byte first.
    Little,
    /// The high byte first.
    Big,
}

/// Returns the order of bytes of a text in UTF-16: by its mark, else by the zeros of its ASCII characters.
#[must_use]
pub fn utf16(bytes: &[u8]) -> Option<Utf16> {
    const PAIRS_MIN: usize = 2;
    match bytes {
        [0xFF, 0xFE, ..] => return Some(Utf16::Little),
        [0xFE, 0xFF, ..] => return Some(Utf16::Big),
        _ => {}
    }
    let pairs = || bytes[..bytes.len().min(LOOKED_AT)].chunks_exact(2);
    let is_text = |byte: u8| matches!(byte, b'\t' | b'\n' | b'\r' | b' '..=b'~');
    let all = |holds: &dyn Fn(&[u8]) -> bool| pairs().count() >= PAIRS_MIN && pairs().all(holds);
    if all(&|pair| pair[1] == 0 && is_text(pair[0])) {
        return Some(Utf16::Little);
    }
    all(&|pair| pair[0] == 0 && is_text(pair[1])).then_some(Utf16::Big)
}

/// Returns the text, without a byte order mark; a character that cannot be read is U+FFFD.
///
/// ```
/// assert_eq!(vehicles::encoding::decode(b"\xff\xfet\0,\0"), "t,");
/// assert_eq!(vehicles::encoding::decode(b"\xef\xbb\xbft,\xb0C"), "t,\u{fffd}C");
/// ```
#[must_use]
pub fn decode(bytes: &[u8]) -> Cow<'_, str> {
    const MARK: char = '\u{feff}';
    let Some(order) = utf16(bytes) else {
        let bytes = bytes.strip_prefix("\u{feff}".as_bytes()).unwrap_or(bytes);
        return String::from_utf8_lossy(bytes);
    };
    let pairs = bytes.chunks_exact(2).map(|pair| match order {
        Utf16::Little => u16::from_le_bytes([pair[0], pair[1]]),
        Utf16::Big => u16::from_be_bytes([pair[0], pair[1]]),
    });
    let characters = char::decode_utf16(pairs).map(|read| read.unwrap_or(char::REPLACEMENT_CHARACTER));
    Cow::Owned(characters.skip_while(|character| *character == MARK).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn in_utf16(text: &str, order: Utf16) -> Vec<u8> {
        let bytes = |unit: u16| if order == Utf16::Big { unit.to_be_bytes() } else { unit.to_le_bytes() };
        text.encode_utf16().flat_map(bytes).collect()
    }

    #[test]
    fn utf16_is_read_with_and_without_a_mark() {
        for (text, mark, read) in [
            ("\u{feff}t,x\r\n0,1\r\n", true, "t,x\r\n0,1\r\n"),
            ("t,x\n", false, "t,x\n"),
            ("\u{feff}°,😀", true, "°,😀"),
        ] {
            for order in [Utf16::Little, Utf16::Big] {
                let bytes = in_utf16(text, order);
                assert_eq!(utf16(&bytes), Some(order), "{text:?}, mark: {mark}");
                assert_eq!(decode(&bytes), read);
            }
        }
        assert_eq!(decode(b"\xff\xfe\x00\xd8t\0"), "\u{fffd}t", "half of a pair");
        assert_eq!(decode(b"\xff\xfet\0,"), "t", "an odd byte");
    }

    #[test]
    fn other_texts_are_not_utf16() {
        for bytes in [&b""[..], b"t,x\n", b"t\0", b"\0\0\0\0", b"t\0\xb0\0\x01\0"] {
            assert_eq!(utf16(bytes), None, "{bytes:?}");
        }
    }
}
