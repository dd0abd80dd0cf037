//! Files that people write, and logs, read with an end to it.

use std::fs::File;
use std::io::{Error, ErrorKind, Read as _, Result};
use std::path::Path;

/// What people write is a thousandth of it; without a limit, the name of a device such as `/dev/zero` would fill the
/// memory.
pub const BYTES_MAX: u64 = 16 << 20;

/// The text of the file at `path`.
///
/// ```
/// let refused = vehicles::text::read("/dev/zero".as_ref()).unwrap_err();
/// assert_eq!(refused.to_string(), "it is not a regular file");
/// ```
///
/// # Errors
/// If the file cannot be read, is not UTF-8, or is longer than [`BYTES_MAX`].
pub fn read(path: &Path) -> Result<String> {
    let mut text = String::new();
    open(path)?.take(BYTES_MAX + 1).read_to_string(&mut text)?;
    if text.len() as u64 > BYTES_MAX {
        let limit = BYTES_MAX >> 20;
        return Err(Error::new(
            ErrorKind::FileTooLarge,
            format!("it is longer than {limit} MiB, and no such text"),
        ));
    }
    Ok(text)
}

/// The bytes of the log at `path`, of any length.
///
/// # Errors
/// If the file cannot be read, or is a device or a pipe, which have no end that could be read to.
pub fn read_log(path: &Path) -> Result<Vec<u8>> {
    let mut bytes = Vec::new();
    open(path)?.read_to_end(&mut bytes)?;
    Ok(bytes)
}

/// Opens a regular file: to open a pipe waits for whoever writes to it.
fn open(path: &Path) -> Result<File> {
    if path.metadata()?.is_file() { File::open(path) } else { Err(Error::other("it is not a regular file")) }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    #[test]
    fn a_file_that_does_not_end_is_refused_in_words() {
        let error = super::read(Path::new("/dev/zero")).unwrap_err();
        assert_eq!(error.to_string(), "it is not a regular file");
        let error = super::read_log(Path::new("/dev/zero")).unwrap_err();
        assert_eq!(error.to_string(), "it is not a regular file");
        let long = tempfile::NamedTempFile::new().unwrap();
        long.as_file().set_len(super::BYTES_MAX + 1).unwrap();
        let error = super::read(long.path()).unwrap_err();
        assert_eq!(error.to_string(), "it is longer than 16 MiB, and no such text");
    }

    #[test]
    fn a_file_is_read_to_its_end() {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("hummingbird.toml");
        assert_eq!(super::read(&path).unwrap(), crate::reference::HUMMINGBIRD);
    }
}
