//! The recorder node: takes every sample of its inputs and writes their bytes to the file.

use crate::error::RecordingError;
use crate::writer::{ChannelId, RecordingWriter};
use bus::announcement::Announcement;
use bus::kind::{Inputs, NodeKind, read_parameters};
use bus::{BusError, ConnectedNode, Node, RawInput, Tick};
use serde::Deserialize;
use std::path::PathBuf;

/// Simulated time between two forced chunk ends: what a killed recorder can lose at most.
const FLUSH_PERIOD_S: f64 = 1.0;

/// Parameters of the recorder.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Parameters {
    /// The file to write.
    pub path: PathBuf,
    /// Files to attach.
    #[serde(default)]
    pub attachments: Vec<AttachedFile>,
}

/// A file to attach.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct AttachedFile {
    /// Name in the recording.
    pub name: String,
    /// Where its content is.
    pub path: PathBuf,
}

/// What stands in front of a topic's name where the samples of a process are recorded that shadows its
/// publisher.
pub const SHADOW_PREFIX: &str = "/shadow";

/// The recorder, for manifests.
pub const KIND: NodeKind = NodeKind {
    name: "recorder",
    summary: "writes every sample of its inputs (all topics where none is named) to an MCAP file",
    inputs: Inputs::Any,
    outputs: &[],
    check: |parameters, _| read_parameters::<Parameters>(parameters).map(|_| ()),
    run,
};

/// Runs the recorder of this process's run.
///
/// # Errors
/// If the run or the file fails.
pub fn run() -> Result<(), BusError> {
    let mut node = Node::join()?;
    let name = node.name().to_owned();
    let parameters: Parameters = node.parameters()?;
    let inputs = node.raw_inputs();
    let flush_ticks = flush_period_ticks(node.tick_s());
    let node = node.connect()?;
    let failed =
        |error: RecordingError| BusError::Parameters { node: name.clone(), reason: error.to_string() };
    let (mut writer, channels) = open(&parameters, &node, &inputs).map_err(failed)?;
    // A shadow's channel is added with its first sample, whose tick is a function of the run.
    let types: Vec<(String, Announcement)> = inputs
        .iter()
        .map(|&input| {
            let (topic, announcement) = node.announcement(input);
            (format!("{SHADOW_PREFIX}{topic}"), announcement.clone())
        })
        .collect();
    let mut shadows: Vec<Option<ChannelId>> = vec![None; inputs.len()];
    let end = node.run(|tick| {
        record(&mut writer, &inputs, &channels, tick)?;
        record_shadows(&mut writer, &inputs, &types, &mut shadows, tick)?;
        if tick.number() % flush_ticks == flush_ticks - 1 { writer.flush() } else { writer.end_tick() }
    });
    // Also a run that failed leaves a whole file of what was recorded.
    let finished = writer.finish().map_err(failed);
    match end {
        Ok(()) | Err(BusError::Aborted) => finished.and(end),
        // A disk that was full for a message is full for the end of the file too: the first error counts.
        Err(error) => Err(error),
    }
}

#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a small positive number")]
fn flush_period_ticks(tick_s: f64) -> u32 {
    ((FLUSH_PERIOD_S / tick_s).round() as u32).max(1)
}

fn open(
    parameters: &Parameters,
    node: &ConnectedNode,
    inputs: &[RawInput],
) -> Result<(RecordingWriter, Vec<ChannelId>), RecordingError> {
    let mut writer = RecordingWriter::create(&parameters.path)?;
    for file in &parameters.attachments {
        let text = std::fs::read(&file.path).map_err(|source| RecordingError::File {
            action: "attach to",
            path: file.path.clone(),
            source,
        })?;
        writer.attach(&file.name, &text)?;
    }
    let channels = inputs
        .iter()
        .map(|&input| {
            let (topic, announcement) = node.announcement(input);
            writer.add_channel(topic, announcement)
        })
        .collect::<Result<_, _>>()?;
    Ok((writer, channels))
}

fn record(
    writer: &mut RecordingWriter,
    inputs: &[RawInput],
    channels: &[ChannelId],
    tick: &Tick<'_>,
) -> Result<(), RecordingError> {
    for (&input, &channel) in inputs.iter().zip(channels) {
        if let Some((cdr, _)) = tick.fresh(input) {
            writer.write(channel, tick.number(), tick.time_ns(), cdr)?;
        }
    }
    Ok(())
}

/// Writes what a process sends that shadows the publisher of an input.
fn record_shadows(
    writer: &mut RecordingWriter,
    inputs: &[RawInput],
    types: &[(String, Announcement)],
    channels: &mut [Option<ChannelId>],
    tick: &Tick<'_>,
) -> Result<(), RecordingError> {
    for ((&input, (topic, announcement)), channel) in inputs.iter().zip(types).zip(channels) {
        let Some((cdr, _)) = tick.fresh_shadow(input) else { continue };
        let id = match *channel {
            Some(id) => id,
            None => *channel.insert(writer.add_channel(topic, announcement)?),
        };
        writer.write(id, tick.number(), tick.time_ns(), cdr)?;
    }
    Ok(())
}
