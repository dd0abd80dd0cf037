//! Plain reading from the disk: regular files only, and texts up to a limit.

use crate::near;
use std::fs::{File, Metadata};
use std::io::{Error, ErrorKind, Read as _, Result};
use std::os::unix::fs::MetadataExt as _;
use std::path::Path;

/// The longest text that is read. People write a thousandth of it.
pub const TEXT_BYTES_MAX: u64 = 16 << 20;
/// Readings of a file that is written to meanwhile, before it is refused.
const READINGS_MAX: u32 = 5;

/// Reads the file at `path`, of any length, from the disk. Every call reads anew: files of a run or a fit are read with
/// [`InputFiles`](crate::InputFiles).
///
/// ```
/// let refused = inputs::read_bytes("/dev/zero".as_ref()).unwrap_err();
/// assert_eq!(refused.to_string(), "it is not a regular file");
/// ```
///
/// # Errors
/// If the file cannot be read or is written to meanwhile. If it is a device or a pipe, which has no end to
/// read to.
pub fn read_bytes(path: &Path) -> Result<Vec<u8>> {
    read_up_to(u64::MAX, path)
}

/// Reads the file at `path` if it is short enough for a text.
pub(crate) fn read_text_bytes(path: &Path) -> Result<Vec<u8>> {
    let bytes = read_up_to(TEXT_BYTES_MAX + 1, path)?;
    require_text_length(&bytes)?;
    Ok(bytes)
}

fn read_up_to(length_max: u64, path: &Path) -> Result<Vec<u8>> {
    unchanged(path, |file| {
        let mut bytes = Vec::new();
        file.take(length_max).read_to_end(&mut bytes)?;
        Ok(bytes)
    })
}

/// The result of `read` for a file that does not change meanwhile: one that is written in place would be half of one version
/// and half of another.
fn unchanged(path: &Path, mut read: impl FnMut(&mut File) -> Result<Vec<u8>>) -> Result<Vec<u8>> {
    for _ in 0..READINGS_MAX {
        let mut file = open(path)?;
        let before = version(&file.metadata()?);
        let bytes = read(&mut file)?;
        if before == version(&file.metadata()?) {
            return Ok(bytes);
        }
    }
    Err(Error::other("it is written to while it is read; wait until it is complete"))
}

/// Length of a file, and when it was written to last.
fn version(of: &Metadata) -> (u64, i64, i64) {
    (of.len(), of.mtime(), of.mtime_nsec())
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
///
/// ```
/// let folder = tempfile::tempdir()?;
/// std::fs::write(folder.path().join("hover.toml"), "")?;
/// let error = inputs::open(&folder.path().join("hovr.toml")).unwrap_err().to_string();
/// assert!(error.contains("did you mean") && error.ends_with("hover.toml`?)"));
/// # Ok::<(), std::io::Error>(())
/// ```
///
/// # Errors
/// If it cannot be opened, or is no regular file. If there is no such file, the files that were probably meant.
pub fn open(path: &Path) -> Result<File> {
    let found = path.metadata().map_err(|error| near::with_advice(path, error))?;
    match (found.is_file(), found.is_dir()) {
        (true, _) => File::open(path),
        (_, true) => Err(Error::other("it is a folder; give the name of one file in it")),
        _ => Err(Error::other("it is not a regular file")),
    }
}

#[cfg(test)]
mod tests {
    use super::{TEXT_BYTES_MAX, read_bytes, read_text_bytes};
    use std::fs::File;
    use std::io::{Read as _, Write as _};

    #[test]
    fn a_file_that_does_not_end_is_refused_in_words() {
        for error in [read_text_bytes("/dev/zero".as_ref()), read_bytes("/dev/zero".as_ref())] {
            assert_eq!(error.unwrap_err().to_string(), "it is not a regular file");
        }
        let folder = tempfile::tempdir().unwrap();
        let of_folder = read_bytes(folder.path()).unwrap_err().to_string();
        assert_eq!(of_folder, "it is a folder; give the name of one file in it");
        let long = tempfile::NamedTempFile::new().unwrap();
        long.as_file().set_len(TEXT_BYTES_MAX + 1).unwrap();
        let error = read_text_bytes(long.path()).unwrap_err();
        assert_eq!(error.to_string(), "it is longer than 16 MiB, and no such text");
    }

    #[test]
    fn a_file_that_is_written_to_meanwhile_is_read_anew_or_refused() {
        let path = tempfile::NamedTempFile::new().unwrap().into_temp_path();
        let reading = |writes: u32| {
            std::fs::write(&path, "start").unwrap();
            let mut readings = 0;
            super::unchanged(&path, |file| {
                let mut bytes = Vec::new();
                file.read_to_end(&mut bytes)?;
                readings += 1;
                if readings <= writes {
                    File::options().append(true).open(&path)?.write_all(b"+")?;
                }
                Ok(bytes)
            })
        };
        assert_eq!(reading(0).unwrap(), b"start");
        assert_eq!(reading(2).unwrap(), b"start++");
        let refused = reading(u32::MAX).unwrap_err().to_string();
        assert!(refused.contains("wait until it is complete"), "{refused}");
    }

    #[test]
    fn a_file_is_read_to_its_end() {
        let file = tempfile::NamedTempFile::new().unwrap();
        std::fs::write(file.path(), "end").unwrap();
        assert_eq!(read_bytes(file.path()).unwrap(), b"end");
        assert_eq!(read_text_bytes(file.path()).unwrap(), b"end");
    }
}
