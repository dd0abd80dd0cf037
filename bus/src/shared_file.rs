//! Files in shared memory that this crate maps itself.

use crate::error::BusError;
use crate::{reserve, user_file};
use memmap2::MmapRaw;
use std::path::Path;

/// Creates and maps the file `path` of `bytes` bytes.
pub(crate) fn create(path: &Path, bytes: usize) -> Result<MmapRaw, BusError> {
    let file = reserve::create(path, bytes as u64)?;
    MmapRaw::map_raw(&file).map_err(|source| BusError::File { action: "map", path: path.to_owned(), source })
}

/// Maps the file `path`, which must have `bytes` bytes; `expected` describes it.
pub(crate) fn open(path: &Path, bytes: usize, expected: &'static str) -> Result<MmapRaw, BusError> {
    let map = user_file::open(path, true).and_then(|file| MmapRaw::map_raw(&file));
    let map = map.map_err(|source| BusError::File { action: "open", path: path.to_owned(), source })?;
    if map.len() == bytes {
        return Ok(map);
    }
    let found = format!("{} bytes instead of {bytes}", map.len());
    Err(BusError::Content { path: path.to_owned(), expected, found })
}
