//! The bytes of a recording: in memory, or in a file that is read piece by piece. No file is mapped: one that another
//! program cuts meanwhile is an error in words, and not the end of this process.

use std::borrow::Cow;
use std::fs::File;
use std::io::{self, ErrorKind};
use std::os::unix::fs::FileExt as _;

/// Bytes that are compared at once.
const BLOCK_BYTES: usize = 1 << 20;

/// The bytes of a recording.
#[derive(Clone, Copy)]
pub enum Source<'a> {
    /// The bytes themselves.
    Memory(&'a [u8]),
    /// The first `length` bytes of a file.
    File {
        /// The file.
        file: &'a File,
        /// Its length when it was opened.
        length: usize,
    },
}

impl<'a> Source<'a> {
    /// Number of bytes.
    pub fn len(&self) -> usize {
        match self {
            Self::Memory(bytes) => bytes.len(),
            Self::File { length, .. } => *length,
        }
    }

    /// The first `length` bytes alone.
    pub fn up_to(self, length: usize) -> Self {
        match self {
            Self::Memory(bytes) => Self::Memory(&bytes[..length.min(bytes.len())]),
            Self::File { file, length: whole } => Self::File { file, length: length.min(whole) },
        }
    }

    /// At most `length` bytes from `at` on: fewer where the recording ends.
    ///
    /// # Errors
    /// If the file cannot be read, or is shorter by now.
    pub fn read(&self, at: usize, length: usize) -> io::Result<Cow<'a, [u8]>> {
        let length = length.min(self.len().saturating_sub(at));
        match self {
            Self::Memory(bytes) => Ok(bytes.get(at..at + length).unwrap_or_default().into()),
            Self::File { file, .. } => {
                let mut bytes = vec![0; length];
                file.read_exact_at(&mut bytes, at as u64).map_err(|error| match error.kind() {
                    ErrorKind::UnexpectedEof => {
                        io::Error::other("another program has cut the file while it was read; read it again")
                    }
                    _ => error,
                })?;
                Ok(bytes.into())
            }
        }
    }

    /// True if two recordings are the same bytes.
    ///
    /// # Errors
    /// As [`Source::read`].
    pub fn is_same(&self, other: &Self) -> io::Result<bool> {
        if self.len() != other.len() {
            return Ok(false);
        }
        for at in (0..self.len()).step_by(BLOCK_BYTES) {
            if self.read(at, BLOCK_BYTES)? != other.read(at, BLOCK_BYTES)? {
                return Ok(false);
            }
        }
        Ok(true)
    }
}
