//! Files that commands read and write.

use anyhow::Result;
use recorder::reader::Recording;
use runtime::output_file::{Kind, Mark};
use std::path::Path;

/// A page, whatever it shows.
pub const PAGE: Kind = Kind { name: "page", mark: Mark::Within(report::page::MARK.as_bytes()) };

/// Opens a recording, or what is whole of one that was cut off, and then says so.
pub fn open_recording(path: &Path) -> Result<Recording> {
    let recording = Recording::salvage(path)?;
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
