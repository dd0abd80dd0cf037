//! Recordings that a command reads.

use anyhow::Result;
use recorder::reader::Recording;
use std::path::Path;

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
