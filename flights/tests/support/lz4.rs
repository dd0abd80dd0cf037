//! MCAP files whose chunks are compressed by lz4, which the writer of the crate `mcap` does not do here.

use mcap::records::op;
use std::io::Write as _;

/// The chunks of an uncompressed MCAP file, each with its records changed by `change` and compressed by lz4, without a summary.
pub fn chunks(plain: &[u8], change: impl Fn(Vec<u8>) -> Vec<u8>) -> Vec<u8> {
    let mut packed = mcap::MAGIC.to_vec();
    let mut at = mcap::MAGIC.len();
    loop {
        let opcode = plain[at];
        let length = u64::from_le_bytes(plain[at + 1..at + 9].try_into().unwrap());
        let body = &plain[at + 9..at + 9 + usize::try_from(length).unwrap()];
        at += 9 + body.len();
        let body = match opcode {
            op::CHUNK => {
                // Times, size and checksum take 28 bytes, the empty name of the compression 4, and the length 8.
                let mut encoder = lz4_flex::frame::FrameEncoder::new(Vec::new());
                encoder.write_all(&change(body[40..].to_vec())).unwrap();
                let records = encoder.finish().unwrap();
                let length = (records.len() as u64).to_le_bytes();
                [&body[..28], &3_u32.to_le_bytes(), b"lz4", &length, &records].concat()
            }
            op::FOOTER => vec![0; 20],
            op::HEADER | op::DATA_END => body.to_vec(),
            _ => continue,
        };
        packed.push(opcode);
        packed.extend((body.len() as u64).to_le_bytes());
        packed.extend(body);
        if opcode == op::FOOTER {
            packed.extend(mcap::MAGIC);
            return packed;
        }
    }
}
