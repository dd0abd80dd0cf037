//! The file of an FMU: a ZIP archive, which is unpacked into a folder.

use anyhow::{Context, Result, bail};
use std::io::{Cursor, Read};
use std::path::Path;
use tempfile::TempDir;
use zip::ZipArchive;

/// Bytes of everything in an FMU, unpacked. Those of large tools have some hundred megabytes.
const UNPACKED_BYTES_MAX: u64 = 2 << 30;
/// Bytes of its description.
const DESCRIPTION_BYTES_MAX: u64 = 256 << 20;
const DESCRIPTION: &str = "modelDescription.xml";

/// An FMU, unpacked; its folder goes with it.
#[derive(Debug)]
pub struct Archive {
    folder: TempDir,
    /// Text of its `modelDescription.xml`.
    pub description: String,
}

impl Archive {
    /// Unpacks `bytes`, an FMU's file, into a new folder in `parent`.
    ///
    /// # Errors
    /// It is no ZIP archive, holds no description or more than is unpacked, or cannot be written.
    pub fn unpack(bytes: &[u8], parent: &Path) -> Result<Self> {
        let archive = ZipArchive::new(Cursor::new(bytes));
        let mut archive =
            archive.context("this is no FMU: an FMU is a ZIP archive with a modelDescription.xml")?;
        let unpacked = archive.decompressed_size().unwrap_or(0);
        if unpacked > UNPACKED_BYTES_MAX.into() {
            bail!("the FMU holds {unpacked} bytes; at most {UNPACKED_BYTES_MAX} are unpacked");
        }
        let description = description(&mut archive)?;
        let folder = tempfile::Builder::new().prefix("fmu-").tempdir_in(parent);
        let folder = folder.with_context(|| format!("cannot make a folder in {}", parent.display()))?;
        let extracted = archive.extract(folder.path());
        extracted.with_context(|| format!("cannot unpack the FMU into {}", folder.path().display()))?;
        Ok(Self { folder, description })
    }

    /// The folder that it is unpacked into.
    pub fn folder(&self) -> &Path {
        self.folder.path()
    }
}

fn description(archive: &mut ZipArchive<Cursor<&[u8]>>) -> Result<String> {
    let file = archive.by_name(DESCRIPTION);
    let file = file.with_context(|| format!("this is no FMU: the archive holds no {DESCRIPTION}"))?;
    let mut bytes = Vec::new();
    file.take(DESCRIPTION_BYTES_MAX)
        .read_to_end(&mut bytes)
        .with_context(|| format!("cannot read {DESCRIPTION}"))?;
    String::from_utf8(bytes).with_context(|| format!("{DESCRIPTION} is not UTF-8"))
}

#[cfg(test)]
mod tests {
    use super::Archive;

    #[test]
    fn what_is_no_fmu_is_refused_in_words() {
        let folder = tempfile::tempdir().unwrap();
        let refused = |bytes: &[u8]| Archive::unpack(bytes, folder.path()).unwrap_err().to_string();
        assert!(refused(b"MAT-file").contains("a ZIP archive with a modelDescription.xml"));
        let mut empty = zip::ZipWriter::new(std::io::Cursor::new(Vec::new()));
        empty.add_directory("binaries", zip::write::SimpleFileOptions::default()).unwrap();
        assert!(refused(empty.finish().unwrap().get_ref()).contains("holds no modelDescription.xml"));
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0, "nothing is left");
    }
}
