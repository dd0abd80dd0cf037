//! Files that commands read and write.

use anyhow::{Result, anyhow};
use recorder::reader::Recording;
use runtime::output_file::{Kind, Mark};
use std::path::Path;

/// A page, whatever it shows.
pub const PAGE: Kind = Kind { name: "page", mark: Mark::Within(report::page::MARK.as_bytes()) };

/// Opens a recording, or what is whole of one that was cut off, and then says so.
pub fn open_recording(path: &Path) -> Result<Recording> {
    let recording = Recording::salvage(path).map_err(|error| {
        let is_toml = path.is_file() && path.extension().is_some_and(|extension| extension == "toml");
        if is_toml { not_recorded(path) } else { error.into() }
    })?;
    if let Some(cut) = recording.cut() {
        let end = cut.last_tick.map_or("nothing of it is whole".to_owned(), |tick| {
            format!("what is whole of it ends after tick {tick}")
        });
        super::output::say(&format!(
            "warning: {} was cut off, its writer did not finish it: {end}",
            path.display()
        ));
    }
    Ok(recording)
}

/// The reason why a TOML file is not read as a recording.
fn not_recorded(path: &Path) -> anyhow::Error {
    let path = path.display();
    anyhow!(
        "{path} is a TOML file, not a recording: if it is a manifest, `hummingbus run {path}` records its flight (.mcap)"
    )
}
