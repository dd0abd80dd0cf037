//! Frames of MAVLink 2 (its guide, "Packet Serialization"): a start byte, a header, a payload without its zeros at the end, and a
//! checksum.

/// First byte of a frame.
const START: u8 = 0xFD;
/// Bytes before the payload: the start, the payload's length, two flags, a sequence number, system, component, and the message's
/// number in three bytes.
const HEAD: usize = 10;
/// Bytes of the checksum.
const CHECKSUM: usize = 2;
/// Flag of a frame with a signature, and the bytes of that behind the checksum.
const SIGNED: u8 = 1;
const SIGNATURE: usize = 13;
/// System and component that a simulator has.
const SENDER: [u8; 2] = [1, 200];

/// A message of the dialect `common`: its number, the byte that its definition adds to the checksum, and the length of its payload.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Kind {
    /// Number.
    pub id: u8,
    /// Byte at the end of the checksum, which is made of the names and types of its fields.
    pub extra: u8,
    /// Bytes of the payload.
    pub length: usize,
}

/// Checksum of `bytes`: CRC-16/MCRF4XX.
fn checksum(bytes: impl IntoIterator<Item = u8>) -> u16 {
    /// Its polynomial, reflected.
    const POLYNOMIAL: u16 = 0x8408;
    bytes.into_iter().fold(0xFFFF, |sum, byte| {
        (0..8).fold(
            sum ^ u16::from(byte),
            |sum, _| if sum & 1 == 0 { sum >> 1 } else { (sum >> 1) ^ POLYNOMIAL },
        )
    })
}

/// Adds the frame of a payload to `bytes`.
#[allow(clippy::cast_possible_truncation, reason = "no payload is longer than 255 bytes")]
pub fn add_frame(bytes: &mut Vec<u8>, kind: Kind, sequence: u8, payload: &[u8]) {
    debug_assert_eq!(payload.len(), kind.length);
    let length = payload.iter().rposition(|byte| *byte != 0).map_or(1, |last| last + 1);
    let from = bytes.len();
    let [system, component] = SENDER;
    bytes.extend([START, length as u8, 0, 0, sequence, system, component, kind.id, 0, 0]);
    bytes.extend(&payload[..length]);
    let sum = checksum(bytes[from + 1..].iter().copied().chain([kind.extra]));
    bytes.extend(sum.to_le_bytes());
}

/// Reader of the frames of one kind in a stream of bytes. Other frames, and bytes that are none, are skipped.
#[derive(Clone, Copy, Debug)]
pub struct Reader {
    kind: Kind,
    /// Frames of this kind with a wrong checksum.
    pub wrong: u64,
}

impl Reader {
    /// Reads frames of `kind`.
    #[must_use]
    pub fn new(kind: Kind) -> Self {
        Self { kind, wrong: 0 }
    }

    /// Payload of the next frame in `bytes`, with its zeros, and removes it and all before it; `None` if it is not there yet.
    pub fn next(&mut self, bytes: &mut Vec<u8>) -> Option<Vec<u8>> {
        let mut at = 0;
        let mut found = None;
        while found.is_none() && at < bytes.len() {
            match self.look(&bytes[at..]) {
                Look::Other => at += 1,
                Look::Wrong => (at, self.wrong) = (at + 1, self.wrong + 1),
                Look::Part => break,
                Look::Frame(length, payload) => (at, found) = (at + length, Some(payload)),
            }
        }
        bytes.drain(..at);
        found
    }

    /// The frame at the beginning of `bytes`.
    fn look(&self, bytes: &[u8]) -> Look {
        let Kind { id, extra, length: length_max } = self.kind;
        // A frame of another kind, or a start byte by chance, is not waited for to its end.
        let is_possible = |at: usize, fits: &dyn Fn(u8) -> bool| bytes.get(at).is_none_or(|byte| fits(*byte));
        let is_ours = is_possible(0, &|byte| byte == START)
            && is_possible(1, &|length| usize::from(length) <= length_max)
            && is_possible(2, &|flags| flags & !SIGNED == 0)
            && is_possible(7, &|byte| byte == id)
            && is_possible(8, &|byte| byte == 0)
            && is_possible(9, &|byte| byte == 0);
        if !is_ours {
            return Look::Other;
        }
        let [_, length, flags, ..] = bytes else { return Look::Part };
        let end = HEAD + usize::from(*length);
        let signature = if flags & SIGNED == 0 { 0 } else { SIGNATURE };
        if bytes.len() < end + CHECKSUM + signature {
            return Look::Part;
        }
        let sum = checksum(bytes[1..end].iter().copied().chain([extra]));
        if bytes[end..end + CHECKSUM] != sum.to_le_bytes() {
            return Look::Wrong;
        }
        let mut payload = bytes[HEAD..end].to_vec();
        payload.resize(length_max, 0);
        Look::Frame(end + CHECKSUM + signature, payload)
    }
}

/// Beginning of a stream of bytes.
enum Look {
    /// No frame of the kind.
    Other,
    /// A part of a frame of the kind.
    Part,
    /// A frame of the kind with a wrong checksum.
    Wrong,
    /// A frame, with its length and its payload.
    Frame(usize, Vec<u8>),
}

#[cfg(test)]
mod tests {
    use super::*;

    const KIND: Kind = Kind { id: 93, extra: 47, length: 81 };

    fn framed(sequence: u8, payload: &[u8]) -> Vec<u8> {
        let mut bytes = Vec::new();
        add_frame(&mut bytes, KIND, sequence, payload);
        bytes
    }

    /// The check value of CRC-16/MCRF4XX in catalogues of checksums.
    #[test]
    fn the_checksum_has_its_check_value() {
        assert_eq!(checksum(*b"123456789"), 0x6F91);
    }

    #[test]
    fn zeros_at_the_end_of_a_payload_are_not_sent() {
        let mut payload = [0; 81];
        assert_eq!(framed(7, &payload).len(), HEAD + 1 + CHECKSUM, "the first byte is sent always");
        payload[4] = 9;
        let bytes = framed(7, &payload);
        assert_eq!(bytes[..HEAD], [0xFD, 5, 0, 0, 7, 1, 200, 93, 0, 0]);
        assert_eq!(Reader::new(KIND).next(&mut bytes.clone()).unwrap(), payload);
    }

    #[test]
    fn frames_are_found_among_others_and_in_pieces() {
        let payload: Vec<u8> = (1..=81).collect();
        let frame = framed(3, &payload);
        let mut other = Vec::new();
        add_frame(&mut other, Kind { id: 0, extra: 50, length: 9 }, 2, &[1, 2, 3, 4, 5, 6, 7, 8, 9]);
        let mut reader = Reader::new(KIND);
        // The bytes before the frame begin frames that never end.
        for before in [&b""[..], &[0xFD], &[0xFD, 0xFF], &[0xFD, 81, 0, 0], &[0xFE, 0xFD, 80, 1], &other] {
            let mut bytes = [before, &frame].concat();
            for cut in 0..bytes.len() {
                let mut part = bytes[..cut].to_vec();
                assert_eq!(reader.next(&mut part), None, "{before:?}, {cut} bytes");
                part.extend(&bytes[cut..]);
                assert_eq!(reader.next(&mut part).as_ref(), Some(&payload), "{before:?}, {cut} bytes");
            }
            bytes.extend(&frame);
            assert!(reader.next(&mut bytes).is_some() && reader.next(&mut bytes).is_some());
            assert!(bytes.is_empty());
        }
        assert_eq!(reader.wrong, 0);
    }

    #[test]
    fn a_wrong_checksum_is_counted_and_the_next_frame_is_found() {
        let frame = framed(3, &[5; 81]);
        let mut bytes = frame.clone();
        bytes[20] ^= 1;
        bytes.extend(&frame);
        let mut reader = Reader::new(KIND);
        assert!(reader.next(&mut bytes).is_some());
        assert_eq!((reader.wrong, bytes.len()), (1, 0));
    }
}
