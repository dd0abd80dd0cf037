//! The file of an FMU: a ZIP archive, which is unpacked into a folder.

use anyhow::{Context, Result, bail};
use std::fs::{File, create_dir_all};
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
        let description = description(&mut archive)?;
        let folder = tempfile::Builder::new().prefix("fmu-").tempdir_in(parent);
        let folder = folder.with_context(|| format!("cannot make a folder in {}", parent.display()))?;
        let extracted = extract(&mut archive, folder.path(), UNPACKED_BYTES_MAX);
        extracted.with_context(|| format!("cannot unpack the FMU into {}", folder.path().display()))?;
        Ok(Self { folder, description })
    }

    /// The folder that it is unpacked into.
    pub fn folder(&self) -> &Path {
        self.folder.path()
    }
}

/// Writes the files of `archive` into `folder`, no more than `room` bytes.
fn extract(archive: &mut ZipArchive<Cursor<&[u8]>>, folder: &Path, mut room: u64) -> Result<()> {
    for index in 0..archive.len() {
        let mut entry = archive.by_index(index)?;
        let name = entry.name()?.into_owned();
        let path =
            entry.enclosed_name().with_context(|| format!("its entry `{name}` leads out of the archive"))?;
        let path = folder.join(path);
        if entry.is_dir() {
            create_dir_all(&path)?;
            continue;
        }
        if entry.is_symlink() {
            bail!("its entry `{name}` is a link");
        }
        path.parent().map(create_dir_all).transpose()?;
        // What an entry says of its size is not believed.
        let written = std::io::copy(&mut (&mut entry).take(room + 1), &mut File::create(&path)?);
        let written = written.with_context(|| format!("its entry `{name}`"))?;
        room = room
            .checked_sub(written)
            .with_context(|| format!("it holds more than {UNPACKED_BYTES_MAX} bytes"))?;
    }
    Ok(())
}

fn description(archive: &mut ZipArchive<Cursor<&[u8]>>) -> Result<String> {
    let file = archive.by_name(DESCRIPTION);
    let file = file.with_context(|| format!("this is no FMU: the archive holds no {DESCRIPTION}"))?;
    let mut bytes = Vec::new();
    let read = file.take(DESCRIPTION_BYTES_MAX + 1).read_to_end(&mut bytes);
    read.with_context(|| format!("cannot read {DESCRIPTION}"))?;
    if bytes.len() as u64 > DESCRIPTION_BYTES_MAX {
        bail!("{DESCRIPTION} has more than {DESCRIPTION_BYTES_MAX} bytes");
    }
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

    #[test]
    fn an_archive_that_is_larger_than_its_room_or_leads_out_of_it_is_refused() {
        use std::io::Write as _;
        let folder = tempfile::tempdir().unwrap();
        let refused = |name: &str, size: usize| {
            let mut archive = zip::ZipWriter::new(std::io::Cursor::new(Vec::new()));
            archive.start_file(name, zip::write::SimpleFileOptions::default()).unwrap();
            archive.write_all(&vec![0; size]).unwrap();
            let bytes = archive.finish().unwrap().into_inner();
            let mut archive = zip::ZipArchive::new(std::io::Cursor::new(bytes.as_slice())).unwrap();
            super::extract(&mut archive, folder.path(), 1000).map_err(|error| format!("{error:#}"))
        };
        assert_eq!(refused("resources/a", 1000), Ok(()));
        assert!(refused("resources/a", 1001).unwrap_err().contains("it holds more than"));
        assert!(refused("../a", 1).unwrap_err().contains("leads out of the archive"));
    }
}
