//! The command `export`.

use super::files::open_recording;
use super::output::print_text;
use anyhow::{Result, bail};
use clap::Args;
use diagnostics::Error;
use report::columns::PARQUET_START;
use report::export::{COLUMNS_START, CSV_START, table};
use runtime::output_file::{self, Kind, Mark};
use std::fs::File;
use std::io::BufWriter;
use std::path::{Path, PathBuf};

/// Examples that `--help` shows.
pub const HELP: &str = "Examples:
  hummingbus export hover.mcap                                  writes hover/plant.state.parquet and a file for each other topic
  hummingbus export hover.mcap --topic /plant/state --csv     writes hover/plant.state.csv, and plant.state.columns.csv with units and frames
  hummingbus export hover.mcap --out tables";

const PARQUET: Kind = Kind { name: "Parquet file", mark: Mark::Start(PARQUET_START) };
const CSV: Kind = Kind { name: "CSV file", mark: Mark::Start(CSV_START.as_bytes()) };
const COLUMNS: Kind = Kind { name: "file of columns", mark: Mark::Start(COLUMNS_START.as_bytes()) };

/// Arguments of `export`.
#[derive(Args)]
pub struct ExportArguments {
    /// The recording.
    recording: PathBuf,
    /// Only this topic; repeatable.
    #[arg(long)]
    topic: Vec<String>,
    /// Write Parquet, as without an option.
    #[arg(long, conflicts_with = "csv")]
    parquet: bool,
    /// Write CSV instead of Parquet, and beside each file another one with the unit, frame and meaning of its columns.
    #[arg(long)]
    csv: bool,
    /// Folder of the files; the recording's path without its ending if left out.
    #[arg(long, value_name = "FOLDER")]
    out: Option<PathBuf>,
}

/// Writes the messages of a recording as tables, a file for each topic; false if the recording was cut off.
///
/// # Errors
/// If the recording cannot be read or has no such topic, or a file cannot be written.
pub fn export(arguments: &ExportArguments) -> Result<bool> {
    let recording = open_recording(&arguments.recording)?;
    for topic in &arguments.topic {
        recording.topic(topic)?;
    }
    let folder = arguments.out.clone().unwrap_or_else(|| arguments.recording.with_extension(""));
    if folder == arguments.recording {
        bail!("{} has no ending to leave out: name a folder with --out", folder.display());
    }
    let is_csv = arguments.csv && !arguments.parquet;
    let (ending, kind) = if is_csv { ("csv", &CSV) } else { ("parquet", &PARQUET) };
    let is_wanted = |topic: &&String| arguments.topic.is_empty() || arguments.topic.contains(topic);
    let topics = recording.topics().keys().filter(is_wanted);
    let files: Vec<Files<'_>> =
        topics.map(|topic| Files::of(topic, folder.join(file_name(topic, ending)))).collect();
    let paths: Vec<&PathBuf> = files.iter().flat_map(|files| files.paths(is_csv)).collect();
    if let Some(path) = paths.iter().find(|path| paths.iter().filter(|other| other == path).count() > 1) {
        bail!("two topics would be written to {}: name one with --topic", path.display());
    }
    output_file::make_folder(&folder)?;
    // Before the first is written.
    for Files { path, columns, .. } in &files {
        output_file::check(path, kind)?;
        if is_csv {
            output_file::check(columns, &COLUMNS)?;
        }
    }
    // One after another: a table is whole in memory.
    for Files { topic, path, columns } in &files {
        let table = table(&recording, topic)?;
        let messages = format!("{}: {} messages", path.display(), table.rows());
        if is_csv {
            write(path, kind, |out| table.write_csv(out))?;
            write(columns, &COLUMNS, |out| table.write_columns(out))?;
            print_text(&format!("{messages}; units and frames: {}", columns.display()))?;
        } else {
            write(path, kind, |out| table.write_parquet(out))?;
            print_text(&messages)?;
        }
    }
    Ok(recording.cut().is_none())
}

/// Files of a topic.
struct Files<'a> {
    topic: &'a String,
    path: PathBuf,
    /// Explains the columns of a CSV file.
    columns: PathBuf,
}

impl<'a> Files<'a> {
    fn of(topic: &'a String, path: PathBuf) -> Self {
        let columns = path.with_extension("columns.csv");
        Self { topic, path, columns }
    }

    /// The paths that are written.
    fn paths(&self, is_csv: bool) -> impl Iterator<Item = &PathBuf> {
        std::iter::once(&self.path).chain(is_csv.then_some(&self.columns))
    }
}

fn write(
    path: &Path,
    kind: &Kind,
    write: impl FnOnce(&mut BufWriter<&mut File>) -> Result<(), Error>,
) -> Result<()> {
    Ok(output_file::write(path, kind, |out| {
        write(out).map_err(|error| std::io::Error::other(error.with_causes()))
    })?)
}

/// Name of the file of `topic`: `plant.state.parquet` of `/plant/state`.
fn file_name(topic: &str, ending: &str) -> String {
    let safe = |c: char| if c.is_alphanumeric() || "-_".contains(c) { c } else { '.' };
    let name: String = topic.trim_start_matches('/').chars().map(safe).collect();
    // A name of dots alone would be a folder.
    let name = if name.trim_matches('.').is_empty() { "topic".to_owned() } else { name };
    format!("{name}.{ending}")
}

#[cfg(test)]
mod tests {
    use super::file_name;

    #[test]
    fn a_file_is_called_after_its_topic_and_stays_in_its_folder() {
        assert_eq!(file_name("/plant/state", "csv"), "plant.state.csv");
        assert_eq!(file_name("/../../etc/passwd", "csv"), "......etc.passwd.csv");
        assert_eq!(file_name("/..", "parquet"), "topic.parquet");
    }
}
