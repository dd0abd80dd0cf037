//! Files that are opened by name where others may write: only plain files and folders of this user.
//!
//! Any user can put a pipe, a device or a link of any name into /dev/shm. So the owner of a name is checked before it
//! is opened. The open neither follows a link nor waits, and the opened file is checked once more.

use crate::process::user_id;
use std::fs::{File, Metadata, OpenOptions};
use std::io::{Error, ErrorKind, Read as _, Result};
use std::os::unix::fs::{MetadataExt, OpenOptionsExt};
use std::path::Path;

/// The longest text that a run writes about itself; a longer one is from another writer.
const TEXT_BYTES_MAX: u64 = 64 << 20;

/// Flags for opening: not through a link, and without waiting for the other end of a pipe.
pub(crate) const FLAGS: i32 = libc::O_NOFOLLOW | libc::O_NONBLOCK | libc::O_NOCTTY;

/// Opens the plain file of this user at `path`, to read it, and to write into it where `writes` is set.
///
/// # Errors
/// If there is none, or it is not a plain file of this user.
pub fn open(path: &Path, writes: bool) -> Result<File> {
    require_file(&path.symlink_metadata()?)?;
    let file = OpenOptions::new().read(true).write(writes).custom_flags(FLAGS).open(path)?;
    require_file(&file.metadata()?)?;
    Ok(file)
}

/// Opens the folder of this user at `path`.
///
/// # Errors
/// If there is none, or it is not a folder of this user.
pub fn open_folder(path: &Path) -> Result<File> {
    require_folder(&path.symlink_metadata()?)?;
    let folder = OpenOptions::new().read(true).custom_flags(FLAGS | libc::O_DIRECTORY).open(path)?;
    require_folder(&folder.metadata()?)?;
    Ok(folder)
}

/// The text of the plain file of this user at `path`.
///
/// # Errors
/// As [`open`]; if it is not UTF-8, or longer than anything that a run writes.
pub fn read_text(path: &Path) -> Result<String> {
    let file = open(path, false)?;
    let length = file.metadata()?.len();
    if length > TEXT_BYTES_MAX {
        return Err(Error::new(ErrorKind::InvalidData, format!("{length} bytes are no text of a run")));
    }
    let mut text = String::new();
    file.take(TEXT_BYTES_MAX).read_to_string(&mut text)?;
    Ok(text)
}

fn require_file(found: &Metadata) -> Result<()> {
    require(found.is_file(), "it is not a regular file")?;
    require_own(found)
}

fn require_folder(found: &Metadata) -> Result<()> {
    require(found.is_dir(), "it is not a folder")?;
    require_own(found)
}

fn require_own(found: &Metadata) -> Result<()> {
    require(found.uid() == user_id(), "it belongs to another user")
}

fn require(holds: bool, otherwise: &str) -> Result<()> {
    if holds { Ok(()) } else { Err(Error::new(ErrorKind::PermissionDenied, otherwise)) }
}

#[cfg(test)]
mod tests {
    use super::{TEXT_BYTES_MAX, open, open_folder, read_text};
    use std::os::unix::fs::symlink;
    use std::os::unix::net::UnixListener;
    use std::path::Path;

    /// A name of every kind of file that is not a plain file.
    fn strange_names(folder: &Path) -> Vec<std::path::PathBuf> {
        let names = ["pipe", "socket", "link", "folder", "loop"].map(|name| folder.join(name));
        let [pipe, socket, link, inner, around] = &names;
        rustix::fs::mknodat(rustix::fs::CWD, pipe, rustix::fs::FileType::Fifo, 0o666.into(), 0).unwrap();
        drop(UnixListener::bind(socket).unwrap());
        std::fs::write(folder.join("target"), "text").unwrap();
        symlink(folder.join("target"), link).unwrap();
        symlink(around, around).unwrap();
        std::fs::create_dir(inner).unwrap();
        names.into()
    }

    #[test]
    fn nothing_but_a_plain_file_is_opened_and_nothing_is_waited_for() {
        let folder = tempfile::tempdir().unwrap();
        let mut names = strange_names(folder.path());
        names.extend(["/dev/null", "/dev/tty"].map(Into::into));
        for name in names {
            for writes in [false, true] {
                let error = open(&name, writes).unwrap_err();
                assert!(error.to_string().contains("regular file") || !name.exists(), "{name:?}: {error}");
            }
        }
        assert_eq!(read_text(&folder.path().join("target")).unwrap(), "text");
    }

    #[test]
    fn nothing_but_a_folder_is_opened_as_one() {
        let folder = tempfile::tempdir().unwrap();
        for name in strange_names(folder.path()).into_iter().filter(|name| !name.ends_with("folder")) {
            assert!(open_folder(&name).is_err(), "{name:?}");
        }
        open_folder(&folder.path().join("folder")).unwrap();
    }

    #[test]
    fn a_file_of_any_length_is_a_refusal_and_not_an_allocation() {
        let file = tempfile::NamedTempFile::new().unwrap();
        file.as_file().set_len(1 << 40).unwrap();
        let error = read_text(file.path()).unwrap_err().to_string();
        assert!(error.contains("1099511627776 bytes"), "{error}");
        file.as_file().set_len(TEXT_BYTES_MAX / 1024).unwrap();
        assert_eq!(read_text(file.path()).unwrap().len() as u64, TEXT_BYTES_MAX / 1024);
    }
}
