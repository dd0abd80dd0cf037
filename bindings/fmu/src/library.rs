//! The shared library of an FMU for this machine.

use crate::archive::Archive;
use crate::description::{Description, Variable, Version};
use crate::instance::Instance;
use crate::values::Values;
use crate::{fmi2, fmi3};
use std::path::{Path, PathBuf};

/// A new instance of the FMU in `archive`.
///
/// # Errors
/// There is no library for this machine, it lacks a function, or refuses to be instantiated.
pub fn instantiate(
    archive: &Archive,
    description: &Description,
    name: &str,
) -> Result<Box<dyn Instance>, String> {
    let path = library(archive.folder(), description)?;
    let resources = archive.folder().join("resources");
    Ok(match description.version {
        Version::Two => Box::new(fmi2::Fmi2::instantiate(&path, &resources, description, name)?),
        Version::Three => Box::new(fmi3::Fmi3::instantiate(&path, &resources, description, name)?),
    })
}

/// Values for a `variable` of `version`, zeros.
///
/// # Errors
/// It is a string, or an array whose size is not fixed.
pub fn values_of(variable: &Variable, version: Version) -> Result<Values, String> {
    let elements = variable.elements.ok_or("its size is not fixed")?;
    Values::zeros(variable.value_type, elements, version == Version::Two)
        .ok_or_else(|| "it is a string".to_owned())
}

/// Folders of the libraries for this machine, the standard's first.
fn platforms(version: Version) -> &'static [&'static str] {
    match (version, cfg!(target_arch = "aarch64")) {
        (Version::Two, false) => &["linux64"],
        // FMI 2.0 has no name for it; exporters use these.
        (Version::Two, true) => &["aarch64-linux", "linux64"],
        (Version::Three, false) => &["x86_64-linux"],
        (Version::Three, true) => &["aarch64-linux"],
    }
}

fn library(folder: &Path, description: &Description) -> Result<PathBuf, String> {
    let binaries = folder.join("binaries");
    let file = format!("{}.so", description.model_identifier);
    let wanted = platforms(description.version);
    let found = wanted.iter().map(|platform| binaries.join(platform).join(&file)).find(|path| path.is_file());
    found.ok_or_else(|| {
        let entries = std::fs::read_dir(&binaries).into_iter().flatten().flatten();
        let mut names: Vec<_> =
            entries.map(|entry| entry.file_name().to_string_lossy().into_owned()).collect();
        names.sort_unstable();
        let holds = if names.is_empty() {
            "no libraries".to_owned()
        } else {
            format!("those of {}", names.join(", "))
        };
        format!("the FMU has no library binaries/{}/{file}; it holds {holds}: export it for Linux", wanted[0])
    })
}
