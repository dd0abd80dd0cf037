//! Plain reading from the disk: regular files only, and texts up to a limit.

use std::fs::File;
use std::io::{Error, ErrorKind, Read as _, Result};
use std::path::Path;

/// The longest text that is read. People write a thousandth of it.
pub const TEXT_BYTES_MAX: u64 = 16 << 20;

/// Reads the file at `path`, of any length, from the disk. Every call reads anew: files of a run or a fit are read with
/// [`InputFiles`](crate::InputFiles).
///
/// ```
/// let refused = inputs::read_bytes("/dev/zero".as_ref()).unwrap_err();
/// assert_eq!(refused.to_string(), "it is not a regular file");
/// ```
///
/// # Errors
/// If the file cannot be read, or is a device or a pipe, which have no end that could be read to.
pub fn read_bytes(path: &Path) -> Result<Vec<u8>> {
    let mut bytes = Vec::new();
    open(path)?.read_to_end(&mut bytes)?;
    Ok(bytes)
}

/// Reads the file at `path` if it is short enough for a text.
pub(crate) fn read_text_bytes(path: &Path) -> Result<Vec<u8>> {
    let mut bytes = Vec::new();
    open(path)?.take(TEXT_BYTES_MAX + 1).read_to_end(&mut bytes)?;
    require_text_length(&bytes)?;
    Ok(bytes)
}

/// Refuses bytes that are too long for a text.
pub(crate) fn require_text_length(bytes: &[u8]) -> Result<()> {
    if bytes.len() as u64 <= TEXT_BYTES_MAX {
        return Ok(());
    }
    let limit = TEXT_BYTES_MAX >> 20;
    Err(Error::new(ErrorKind::FileTooLarge, format!("it is longer than {limit} MiB, and no such text")))
}

/// Opens a regular file: to open a pipe waits for whoever writes to it.
fn open(path: &Path) -> Result<File> {
    if path.metadata()?.is_file() { File::open(path) } else { Err(Error::other("it is not a regular file")) }
}

#[cfg(test)]
mod tests {
    use super::{TEXT_BYTES_MAX, read_bytes, read_text_bytes};

    #[test]
    fn a_file_that_does_not_end_is_refused_in_words() {
        for error in [read_text_bytes("/dev/zero".as_ref()), read_bytes("/dev/zero".as_ref())] {
            assert_eq!(error.unwrap_err().to_string(), "it is not a regular file");
        }
        let long = tempfile::NamedTempFile::new().unwrap();
        long.as_file().set_len(TEXT_BYTES_MAX + 1).unwrap();
        let error = read_text_bytes(long.path()).unwrap_err();
        assert_eq!(error.to_string(), "it is longer than 16 MiB, and no such text");
    }

    #[test]
    fn a_file_is_read_to_its_end() {
        let file = tempfile::NamedTempFile::new().unwrap();
        std::fs::write(file.path(), "end").unwrap();
        assert_eq!(read_bytes(file.path()).unwrap(), b"end");
        assert_eq!(read_text_bytes(file.path()).unwrap(), b"end");
    }
}
