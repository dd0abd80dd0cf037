//! The file of an FMU that holds a simulation.

use super::{MODEL, Model, description};
use crate::description::Version;
use anyhow::{Context, Result};
use bus::plan::Plan;
use std::io::{Seek, Write};
use std::path::Path;
use zip::ZipWriter;
use zip::write::SimpleFileOptions;

/// Contents of an FMU.
#[derive(Clone, Copy, Debug)]
pub struct Contents<'c> {
    /// Model of the simulation.
    pub model: &'c Model,
    /// Version of the standard.
    pub version: Version,
    /// A folder as a run directory is one: the plan and the input files.
    pub run_dir: &'c Path,
    /// The library of `bindings/fmu-export`.
    pub library: &'c [u8],
}

/// Writes the FMU `contents` to `out`. Two that hold the same are the same bytes.
///
/// # Errors
/// A file cannot be read, or `out` not be written.
pub fn write(contents: Contents<'_>, out: impl Write + Seek) -> Result<()> {
    let Contents { model, version, run_dir, library } = contents;
    let platform = match (version, cfg!(target_arch = "aarch64")) {
        (Version::Two, false) => "linux64",
        (Version::Three, false) => "x86_64-linux",
        (_, true) => "aarch64-linux",
    };
    let mut archive = ZipWriter::new(out);
    let mut add = |name: &str, bytes: &[u8]| -> Result<()> {
        archive
            .start_file(name, SimpleFileOptions::default())
            .with_context(|| format!("cannot add {name}"))?;
        archive.write_all(bytes).with_context(|| format!("cannot add {name}"))
    };
    add("modelDescription.xml", description::text(model, version).as_bytes())?;
    add(&format!("binaries/{platform}/{}.so", model.name), library)?;
    add(&format!("resources/{MODEL}"), &serde_json::to_vec(model).context("cannot write the model")?)?;
    let read = |path: &Path| std::fs::read(path).with_context(|| format!("cannot read {}", path.display()));
    add(&format!("resources/{}", Plan::FILE), &read(&run_dir.join(Plan::FILE))?)?;
    for name in files(&run_dir.join(Plan::INPUTS))? {
        add(&format!("resources/{}/{name}", Plan::INPUTS), &read(&run_dir.join(Plan::INPUTS).join(&name))?)?;
    }
    archive.finish().context("cannot write the FMU")?;
    Ok(())
}

/// Names of the files in a folder, in one order on every machine; none if it is not there.
fn files(folder: &Path) -> Result<Vec<String>> {
    let about = || format!("cannot read {}", folder.display());
    if !folder.exists() {
        return Ok(Vec::new());
    }
    let entries = std::fs::read_dir(folder).with_context(about)?.collect::<std::io::Result<Vec<_>>>();
    let names = entries
        .with_context(about)?
        .into_iter()
        .map(|entry| entry.file_name().to_string_lossy().into_owned());
    let mut names: Vec<String> = names.collect();
    names.sort_unstable();
    Ok(names)
}
