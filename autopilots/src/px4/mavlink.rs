//! Frames of MAVLink 2 (its guide, "Packet Serialization"): a start byte, a header, a payload without its zeros at the end, and a
//! checksum.

/// First byte of a frame.
const START: u8 = 0xFD;
/// Bytes before the payload: the start, the payload's length, two flags, a sequence number, system, component, and the message's
/// number in three bytes.
const HEAD: usize = 10;
/// First byte of a frame of MAVLink 1, and bytes before its payload.
const START_1: u8 = 0xFE;
const HEAD_1: usize = 6;
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

/// Adds a frame to `bytes`; `add_payload` adds its payload.
#[allow(clippy::cast_possible_truncation, reason = "no payload is longer than 255 bytes")]
pub fn add_frame(bytes: &mut Vec<u8>, kind: Kind, sequence: u8, add_payload: impl FnOnce(&mut Vec<u8>)) {
    let from = bytes.len();
    let [system, component] = SENDER;
    bytes.extend([START, 0, 0, 0, sequence, system, component, kind.id, 0, 0]);
    add_payload(bytes);
    let payload = &bytes[from + HEAD..];
    debug_assert_eq!(payload.len(), kind.length);
    let length = payload.iter().rposition(|byte| *byte != 0).map_or(1, |last| last + 1);
    bytes.truncate(from + HEAD + length);
    bytes[from + 1] = length as u8;
    let sum = checksum(bytes[from + 1..].iter().copied().chain([kind.extra]));
    bytes.extend(sum.to_le_bytes());
}

/// Payloads of the frames of `kind` in `bytes`, without their zeros at the end. Frames of other kinds are skipped.
///
/// # Errors
/// The bytes are not frames from one end to the other, or a frame of the kind has a wrong checksum.
pub fn frames(kind: Kind, mut bytes: &[u8]) -> impl Iterator<Item = Result<&[u8], String>> {
    std::iter::from_fn(move || {
        while !bytes.is_empty() {
            let (frame, rest) = match bytes.split_at_checked(frame_length(bytes)) {
                Some(split) if !split.0.is_empty() => split,
                _ => {
                    let found = &bytes[..bytes.len().min(HEAD)];
                    let error = format!("it sends {found:02x?}, expected a frame of MAVLink");
                    bytes = &[];
                    return Some(Err(error));
                }
            };
            bytes = rest;
            if frame[0] == START && frame[7..HEAD] == [kind.id, 0, 0] {
                return Some(payload(kind, frame));
            }
        }
        None
    })
}

/// Length of the frame at the beginning of `bytes`; 0 if there is none.
fn frame_length(bytes: &[u8]) -> usize {
    match *bytes {
        [START, length, flags, ..] => {
            HEAD + usize::from(length) + CHECKSUM + if flags & SIGNED == 0 { 0 } else { SIGNATURE }
        }
        [START_1, length, ..] => HEAD_1 + usize::from(length) + CHECKSUM,
        _ => 0,
    }
}

/// Payload of a frame of `kind`.
fn payload(kind: Kind, frame: &[u8]) -> Result<&[u8], String> {
    let end = HEAD + usize::from(frame[1]);
    let sum = checksum(frame[1..end].iter().copied().chain([kind.extra]));
    if frame[end..end + CHECKSUM] == sum.to_le_bytes() {
        return Ok(&frame[HEAD..end]);
    }
    Err(format!("its message {} has a wrong checksum", kind.id))
}

#[cfg(test)]
mod tests {
    use super::*;

    const KIND: Kind = Kind { id: 93, extra: 47, length: 81 };

    fn framed(kind: Kind, payload: &[u8]) -> Vec<u8> {
        let mut bytes = Vec::new();
        add_frame(&mut bytes, kind, 7, |bytes| bytes.extend(payload));
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
        assert_eq!(framed(KIND, &payload).len(), HEAD + 1 + CHECKSUM, "the first byte is sent always");
        payload[4] = 9;
        let bytes = framed(KIND, &payload);
        assert_eq!(bytes[..HEAD], [0xFD, 5, 0, 0, 7, 1, 200, 93, 0, 0]);
        assert_eq!(frames(KIND, &bytes).next().unwrap().unwrap(), &payload[..5]);
    }

    #[test]
    fn frames_are_found_among_others() {
        // Its payload has the beginning of a frame of the kind.
        let other = framed(Kind { id: 0, extra: 50, length: 9 }, &[0xFD, 81, 0, 0, 1, 1, 1, 93, 2]);
        let old = [&[0xFE, 1, 0, 1, 1, 0, 5][..], &[0, 0]].concat();
        let mut signed = framed(KIND, &[6; 81]);
        signed[2] |= SIGNED;
        let sum = checksum(signed[1..HEAD + 81].iter().copied().chain([KIND.extra]));
        signed.truncate(HEAD + 81);
        signed.extend(sum.to_le_bytes());
        signed.extend([0xFD; SIGNATURE]);
        let bytes = [&other, &old, &framed(KIND, &[5; 81])[..], &signed, &other].concat();
        let found: Result<Vec<_>, _> = frames(KIND, &bytes).collect();
        assert_eq!(found.unwrap(), [&[5; 81][..], &[6; 81]]);
    }

    #[test]
    fn other_bytes_and_wrong_checksums_are_told() {
        let frame = framed(KIND, &[5; 81]);
        let mut wrong = frame.clone();
        wrong[20] ^= 1;
        let told = |bytes: &[u8]| frames(KIND, bytes).find_map(Result::err).unwrap_or_default();
        assert!(told(&wrong).contains("message 93 has a wrong checksum"));
        assert!(told(&[&frame[..], b"px4"].concat()).contains("it sends [70, 78, 34]"));
        for cut in 1..frame.len() {
            assert!(told(&frame[..cut]).contains("expected a frame"), "{cut}");
        }
        assert_eq!(told(&frame), "");
    }
}
