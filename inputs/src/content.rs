//! Bytes with their SHA-256.

use sha2::{Digest as _, Sha256};
use std::fmt::Write as _;
use std::sync::{Arc, OnceLock};

/// The bytes of a file, shared by all who read it.
#[derive(Clone, Debug)]
pub struct Content(Arc<Inner>);

#[derive(Debug)]
struct Inner {
    bytes: Arc<[u8]>,
    sha256: OnceLock<String>,
}

impl Content {
    pub fn new(bytes: Vec<u8>) -> Self {
        Self(Arc::new(Inner { bytes: bytes.into(), sha256: OnceLock::new() }))
    }

    pub fn bytes(&self) -> Arc<[u8]> {
        self.0.bytes.clone()
    }

    /// The SHA-256 in hexadecimal, computed at the first call.
    pub fn sha256(&self) -> &str {
        self.0.sha256.get_or_init(|| sha256(&self.0.bytes))
    }
}

/// Returns the SHA-256 of all that `from` reads, in hexadecimal; a large file is never whole in memory.
///
/// ```
/// let bytes = b"abc".as_slice();
/// assert_eq!(inputs::sha256_of(bytes)?, inputs::sha256(bytes));
/// # Ok::<(), std::io::Error>(())
/// ```
///
/// # Errors
/// If `from` cannot be read.
pub fn sha256_of(mut from: impl std::io::Read) -> std::io::Result<String> {
    let (mut digest, mut part) = (Sha256::new(), vec![0; 1 << 16]);
    loop {
        match from.read(&mut part) {
            Ok(0) => return Ok(hexadecimal(&digest.finalize())),
            Ok(count) => digest.update(&part[..count]),
            Err(error) if error.kind() == std::io::ErrorKind::Interrupted => {}
            Err(error) => return Err(error),
        }
    }
}

/// Returns the SHA-256 of `bytes` in hexadecimal.
///
/// ```
/// assert!(inputs::sha256(b"abc").starts_with("ba7816bf8f01cfea"));
/// ```
#[must_use]
pub fn sha256(bytes: &[u8]) -> String {
    hexadecimal(&Sha256::digest(bytes))
}

fn hexadecimal(bytes: &[u8]) -> String {
    bytes.iter().fold(String::with_capacity(64), |mut text, byte| {
        // Writing to a string cannot fail.
        let _ = write!(text, "{byte:02x}");
        text
    })
}
