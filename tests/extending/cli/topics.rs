//! The command `topics`.

use super::files::open_recording;
use super::output::print_text;
use anyhow::Result;
use clap::Args;
use std::path::PathBuf;

/// Arguments of `topics`.
#[derive(Args)]
pub struct TopicsArguments {
    /// The recording.
    recording: PathBuf,
}

/// Prints the topics of a recording with their types and the number of their messages.
///
/// # Errors
/// If the recording cannot be read.
pub fn topics(arguments: &TopicsArguments) -> Result<bool> {
    let recording = open_recording(&arguments.recording)?;
    let lines = recording
        .topics()
        .iter()
        .map(|(name, topic)| format!("{name} [{}] {}", topic.type_name, topic.message_count));
    print_text(&lines.collect::<Vec<_>>().join("\n")).map(|()| true)
}
