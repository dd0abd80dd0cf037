//! Files that commands read and write.

use anyhow::{Result, anyhow};
use recorder::reader::Recording;
use runtime::checkpoint::Checkpoint;
use runtime::output_file::{Kind, Mark};
use runtime::rewind::MARK;
use std::path::Path;

/// A page of any kind.
pub const PAGE: Kind = Kind { name: "page", mark: Mark::Within(report::page::MARK.as_bytes()) };

/// Opens a recording, or the whole part of one that was cut off, and then reports that.
pub fn open_recording(path: &Path) -> Result<Recording> {
    let recording = Recording::salvage(path).map_err(|error| {
        let is_toml = path.is_file() && path.extension().is_some_and(|extension| extension == "toml");
        match Checkpoint::read(path) {
            Ok(checkpoint) => not_recorded_but(path, &checkpoint),
            Err(_) if is_toml => not_recorded(path),
            Err(_) => error.into(),
        }
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
    // A recording without readable attachments has no mark.
    let attachments = recording.attachments().unwrap_or_default();
    if let Some((_, mark)) = attachments.iter().find(|(name, _)| name == MARK) {
        super::output::say(&format!("{}: {}", path.display(), rewound(&String::from_utf8_lossy(mark))));
    }
    Ok(recording)
}

/// Text about the last rewind of a run, from the `mark` of its recording.
fn rewound(mark: &str) -> String {
    let table: toml::Table = mark.parse().unwrap_or_default();
    let last = table.get("rewind").and_then(|all| all.as_array()?.last());
    let tick = |key: &str| last.and_then(|last| last.get(key)?.as_integer()).unwrap_or_default();
    let recording = last.and_then(|last| last.get("recording")?.as_str());
    let before = recording.map_or(String::new(), |name| format!("; what was flown up to there is in {name}"));
    format!("its run went back in flight from tick {} to tick {}{before}", tick("from_tick"), tick("to_tick"))
}

/// The reason why a checkpoint is not read as a recording.
fn not_recorded_but(path: &Path, checkpoint: &Checkpoint) -> anyhow::Error {
    let (path, tick, time_s) = (path.display(), checkpoint.tick(), checkpoint.time_s());
    let manifest = checkpoint.manifest_path().display();
    anyhow!(
        "{path} is a checkpoint of {manifest} at tick {tick} ({time_s:.3} s), not a recording: `hummingbus run --from {path}` \
         goes on from it"
    )
}

/// The reason why a TOML file is not read as a recording.
fn not_recorded(path: &Path) -> anyhow::Error {
    let path = path.display();
    anyhow!(
        "{path} is a TOML file, not a recording: if it is a manifest, `hummingbus run {path}` records its flight (.mcap)"
    )
}
