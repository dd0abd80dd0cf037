//! Files that commands read and write.

use super::kind::Kind;
use anyhow::{Result, anyhow};
use recorder::reader::Recording;
use runtime::checkpoint::Checkpoint;
use runtime::output_file::{self, Mark};
use runtime::rewind::MARK;
use std::fs::File;
use std::io::Read as _;
use std::path::Path;

/// A page of any kind.
pub const PAGE: output_file::Kind =
    output_file::Kind { name: "page", mark: Mark::Within(report::page::MARK.as_bytes()) };

/// Opens a recording, or the whole part of one that was cut off, and then reports that.
pub fn open_recording(path: &Path) -> Result<Recording> {
    let recording = Recording::salvage(path).map_err(|error| match Checkpoint::read(path) {
        Ok(checkpoint) => not_recorded_but(path, &checkpoint),
        Err(_) => require_kind(path, &[Kind::Recording], "").err().unwrap_or_else(|| error.into()),
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

/// Refuses the file at `path` if its content shows a kind that is none of `expected`, with the command that reads it and with
/// `advice`. The reader of the file reports a file that cannot be read, or whose kind is not known.
///
/// # Errors
/// The kind that was found, and those that were expected.
pub fn require_kind(path: &Path, expected: &[Kind], advice: &str) -> Result<()> {
    let Some(found) = start(path).and_then(|start| Kind::of(&start)).filter(|kind| !expected.contains(kind))
    else {
        return Ok(());
    };
    let shown = path.display().to_string();
    let names: Vec<&str> = expected.iter().map(Kind::name).collect();
    let advice = if advice.is_empty() { String::new() } else { format!("; {advice}") };
    Err(anyhow!("{shown} is {}, not {}: {}{advice}", found.name(), names.join(" or "), found.reader(&shown)))
}

/// The first bytes of a file, enough for its kind; the whole of a text.
fn start(path: &Path) -> Option<Vec<u8>> {
    let file = path.is_file().then(|| File::open(path).ok()).flatten()?;
    let mut bytes = Vec::new();
    file.take(inputs::TEXT_BYTES_MAX).read_to_end(&mut bytes).ok()?;
    Some(bytes)
}
