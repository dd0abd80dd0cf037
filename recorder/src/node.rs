//! The recorder: takes every sample of its inputs and writes their bytes to the file.

use crate::error::RecordingError;
use crate::watched::Watched;
use crate::writer::{ChannelId, RecordingWriter};
use bus::announcement::Announcement;
use bus::component::{Component, Info, State, StateError, StepError, Transfer};
use bus::context::{NodeContext, StepContext};
use bus::ports::AnyInputs;
use bus::watch::WatchFiles;
use diagnostics::ParameterError;
use inputs::InputFiles;
use serde::Deserialize;
use std::path::PathBuf;

/// Simulated time between two forced chunk ends: the longest part that a killed recorder can lose.
const FLUSH_PERIOD_S: f64 = 1.0;

/// Parameters of the recorder.
///
/// ```
/// let parameters = serde_json::json!({ "path": "hover.mcap" });
/// let parameters: recorder::node::Parameters = diagnostics::read(&parameters)?;
/// assert!(parameters.attachments.is_empty());
/// # Ok::<(), diagnostics::ParameterError>(())
/// ```
#[derive(Debug, bus::Parameters)]
pub struct Parameters {
    /// The file to write.
    pub path: PathBuf,
    /// Files to attach.
    #[parameter(default = Vec::new())]
    pub attachments: Vec<AttachedFile>,
    /// Files by which others watch the run; absent where nobody can.
    pub watch: Option<WatchFiles>,
}

/// A file to attach.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct AttachedFile {
    /// Name in the recording.
    pub name: String,
    /// Path of the file among those of the run.
    pub path: PathBuf,
}

/// Prefix of a topic's name under which the samples of a process are recorded that shadows its publisher.
pub const SHADOW_PREFIX: &str = "/shadow";

/// The recorder of a run.
pub struct Recorder {
    parameters: Parameters,
    files: InputFiles,
    flush_ticks: u32,
}

/// State of a recorder: the file that it writes, once it is connected.
pub struct RecorderState(Option<Recording>);

impl State for RecorderState {
    const TRANSFER: Transfer = Transfer::File;

    fn size(&self) -> usize {
        0
    }

    fn save(&self, _: &mut [u8]) {}

    fn load(&mut self, _: &[u8]) -> Result<(), StateError> {
        Err(StateError::File)
    }
}

/// The file under way.
struct Recording {
    writer: RecordingWriter,
    topics: Vec<Topic>,
    watched: Watched,
}

/// A topic that is recorded.
#[derive(Debug)]
struct Topic {
    name: String,
    channel: ChannelId,
    /// Channel of the process that shadows the publisher: added with its first sample, whose tick is a function of
    /// the run.
    shadow_channel: Option<ChannelId>,
    shadow_name: String,
    announcement: Announcement,
}

impl Component for Recorder {
    const INFO: Info = Info::new(
        "recorder",
        "writes every sample of its inputs (all topics where none is named) to an MCAP file",
    )
    .recorder();
    type Parameters = Parameters;
    type Inputs<'a> = AnyInputs<'a>;
    type Outputs = ();
    type State = RecorderState;

    fn new(parameters: Parameters, context: &NodeContext<'_>) -> Result<Self, ParameterError> {
        let (files, flush_ticks) = (context.files.clone(), flush_period_ticks(context.tick_s()));
        Ok(Self { parameters, files, flush_ticks })
    }

    fn initial(&self) -> RecorderState {
        RecorderState(None)
    }

    fn connected(
        &self,
        topics: &[(&str, &Announcement)],
        RecorderState(recording): &mut RecorderState,
    ) -> Result<(), StepError> {
        *recording = Some(Recording::begin(&self.parameters, &self.files, topics)?);
        Ok(())
    }

    fn step(
        &self,
        context: &StepContext<'_>,
        inputs: AnyInputs<'_>,
        RecorderState(recording): &mut RecorderState,
    ) -> Result<(), StepError> {
        let Some(recording) = recording else { return Ok(()) };
        recording.record(context, inputs)?;
        let is_last_of_chunk = context.tick() % self.flush_ticks == self.flush_ticks - 1;
        let writer = &mut recording.writer;
        Ok(if is_last_of_chunk { writer.flush() } else { writer.end_tick() }?)
    }

    /// A run that failed leaves a complete file of its samples, too.
    fn finish(&self, RecorderState(recording): &mut RecorderState) -> Result<(), StepError> {
        Ok(recording.take().map_or(Ok(()), |recording| recording.writer.finish())?)
    }
}

#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a small positive number")]
fn flush_period_ticks(tick_s: f64) -> u32 {
    ((FLUSH_PERIOD_S / tick_s).round() as u32).max(1)
}

impl Recording {
    fn begin(
        parameters: &Parameters,
        files: &InputFiles,
        topics: &[(&str, &Announcement)],
    ) -> Result<Self, RecordingError> {
        let mut writer = RecordingWriter::create(&parameters.path)?;
        for file in &parameters.attachments {
            let bytes = files.bytes(&file.path).map_err(RecordingError::file("attach", &file.path))?;
            writer.attach(&file.name, &bytes)?;
        }
        let topic = |&(name, announcement): &(&str, &Announcement)| {
            let shadow_name = format!("{SHADOW_PREFIX}{name}");
            let channel = writer.add_channel(name, announcement)?;
            let (name, announcement) = (name.to_owned(), announcement.clone());
            Ok(Topic { name, channel, shadow_channel: None, shadow_name, announcement })
        };
        let topics = topics.iter().map(topic).collect::<Result<_, RecordingError>>()?;
        Ok(Self { writer, topics, watched: Watched::by(parameters.watch.as_ref()) })
    }

    /// Writes the samples that were sent at this tick: first those that count, then those of shadows.
    fn record(&mut self, context: &StepContext<'_>, inputs: AnyInputs<'_>) -> Result<(), RecordingError> {
        let (tick, time_ns) = (context.tick(), context.time_ns());
        self.watched.look(self.topics.iter().map(|topic| (topic.name.as_str(), &topic.announcement)));
        for (input, topic) in self.topics.iter().enumerate() {
            if let Some(cdr) = inputs.fresh(input) {
                self.writer.write(topic.channel, tick, time_ns, cdr)?;
                if self.watched.is_open() {
                    self.watched.write(tick, time_ns, &topic.name, self.writer.counting(topic.channel, cdr));
                }
            }
        }
        for (input, topic) in self.topics.iter_mut().enumerate() {
            let Some(cdr) = inputs.fresh_shadow(input) else { continue };
            let channel = match topic.shadow_channel {
                Some(channel) => channel,
                None => *topic
                    .shadow_channel
                    .insert(self.writer.add_channel(&topic.shadow_name, &topic.announcement)?),
            };
            self.writer.write(channel, tick, time_ns, cdr)?;
            if self.watched.is_open() {
                self.watched.write(tick, time_ns, &topic.shadow_name, self.writer.counting(channel, cdr));
            }
        }
        Ok(())
    }
}
