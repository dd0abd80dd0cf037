//! Files in a folder, each under its SHA-256.

use crate::content::sha256;
use crate::read::read_bytes;
use std::fs::{OpenOptions, create_dir, rename};
use std::io::{Error, ErrorKind, Result, Write as _};
use std::os::unix::fs::OpenOptionsExt as _;
use std::path::Path;

/// Writes `bytes` into `folder`, which is made if it is missing. A file of this name is complete: it gets its name last.
pub fn put(folder: &Path, name: &str, bytes: &[u8]) -> Result<()> {
    match create_dir(folder) {
        Err(error) if error.kind() != ErrorKind::AlreadyExists => return Err(error),
        _ => {}
    }
    let path = folder.join(name);
    if path.exists() {
        return Ok(());
    }
    let draft = folder.join(format!("{name}.draft"));
    OpenOptions::new().write(true).create(true).truncate(true).mode(0o600).open(&draft)?.write_all(bytes)?;
    rename(draft, path)
}

/// Reads the file whose SHA-256 is `name` from `folder`.
pub fn get(folder: &Path, name: &str) -> Result<Vec<u8>> {
    let path = folder.join(name);
    let bytes = read_bytes(&path).map_err(|error| {
        Error::new(error.kind(), format!("the run's copy {} cannot be read: {error}", path.display()))
    })?;
    if sha256(&bytes) == name {
        return Ok(bytes);
    }
    let changed = format!("the run's copy {} was changed after the run had begun", path.display());
    Err(Error::new(ErrorKind::InvalidData, changed))
}
