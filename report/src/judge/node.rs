//! The judge: a component that passes the samples of a run without a recording through the evaluator.

use super::evaluator::{self, Evaluator};
use bus::announcement::Announcement;
use bus::component::{Component, Info, State, StateError, StepError, Transfer};
use bus::context::{NodeContext, StepContext};
use bus::ports::AnyInputs;
use diagnostics::ParameterError;
use recorder::fields::TopicFields;
use runtime::manifest::Conditions;
use std::path::PathBuf;

/// Parameters of the judge, which the launcher gives.
///
/// ```
/// let conditions = serde_json::json!({ "pass": [], "measure": [], "compare": [] });
/// let parameters = serde_json::json!({ "path": "figures", "conditions": conditions });
/// let parameters: report::judge::node::Parameters = diagnostics::read(&parameters)?;
/// assert!(parameters.conditions.topics().is_empty());
/// # Ok::<(), diagnostics::ParameterError>(())
/// ```
#[derive(Debug, bus::Parameters)]
pub struct Parameters {
    /// The file to which the figures are written.
    pub path: PathBuf,
    /// Conditions, measures and comparisons.
    pub conditions: Conditions,
}

/// The judge of a run without a recording.
#[derive(Debug)]
pub struct Judge {
    parameters: Parameters,
    tick_ns: u64,
    duration_ticks: u32,
}

/// State of a judge: its evaluator, once it is connected.
#[derive(Debug)]
pub struct JudgeState(Option<Judging>);

/// Type of the state.
const NAME: &str = "Judge";

#[derive(Debug)]
struct Judging {
    evaluator: Evaluator,
    /// Number of its topic in the evaluator, by input.
    topics: Vec<Option<usize>>,
    /// True before the first step after a checkpoint, whose samples are still to be read.
    is_restored: bool,
}

impl State for JudgeState {
    const TRANSFER: Transfer = Transfer::Growing(NAME);

    fn size(&self) -> usize {
        self.0.as_ref().map_or(0, |judging| judging.evaluator.save().len())
    }

    fn save(&self, bytes: &mut [u8]) {
        if let Self(Some(judging)) = self {
            bytes.copy_from_slice(&judging.evaluator.save());
        }
    }

    fn load(&mut self, bytes: &[u8]) -> Result<(), StateError> {
        let Self(Some(judging)) = self else { return StateError::check_size(NAME, 0, bytes) };
        let loaded = judging.evaluator.load(bytes);
        judging.is_restored = true;
        loaded.map_err(|error| StateError::Contents { type_name: NAME, reason: error.to_string() })
    }
}

impl Component for Judge {
    const INFO: Info = Info::new(
        "judge",
        "evaluates the conditions of a run without a recording; the launcher adds it, a manifest cannot",
    )
    .judge(evaluator::first_failure);
    type Parameters = Parameters;
    type Inputs<'a> = AnyInputs<'a>;
    type Outputs = ();
    type State = JudgeState;

    fn new(parameters: Parameters, context: &NodeContext<'_>) -> Result<Self, ParameterError> {
        Ok(Self { parameters, tick_ns: context.tick_ns, duration_ticks: context.duration_ticks })
    }

    fn initial(&self) -> JudgeState {
        JudgeState(None)
    }

    fn connected(
        &self,
        announced: &[(&str, &Announcement)],
        JudgeState(judging): &mut JudgeState,
    ) -> Result<(), StepError> {
        let open = |topic: &str| {
            let (_, announcement) = announced.iter().find(|(name, _)| *name == topic).ok_or_else(|| {
                let known = announced.iter().map(|(name, _)| *name).collect::<Vec<_>>().join(", ");
                recorder::RecordingError::UnknownTopic { topic: topic.to_owned(), known }
            })?;
            TopicFields::announced(topic, announcement)
        };
        let mut evaluator = Evaluator::new(&self.parameters.conditions, open)?;
        evaluator.reserve(u64::from(self.duration_ticks) * self.tick_ns, self.tick_ns);
        let topics = announced.iter().map(|(name, _)| evaluator.topic(name)).collect();
        *judging = Some(Judging { evaluator, topics, is_restored: false });
        Ok(())
    }

    fn step(
        &self,
        context: &StepContext<'_>,
        inputs: AnyInputs<'_>,
        JudgeState(judging): &mut JudgeState,
    ) -> Result<(), StepError> {
        let Some(Judging { evaluator, topics, is_restored }) = judging else { return Ok(()) };
        if std::mem::take(is_restored) {
            for (input, topic) in topics.iter().enumerate() {
                if let Some((topic, cdr)) = topic.zip(inputs.restored(input)) {
                    evaluator.hold(topic, cdr)?;
                }
            }
        }
        for (input, topic) in topics.iter().enumerate() {
            if let Some((topic, cdr)) = topic.zip(inputs.fresh(input)) {
                evaluator.take(topic, cdr)?;
            }
        }
        Ok(evaluator.end_tick(context.time_ns())?)
    }

    fn finish(&self, JudgeState(judging): &mut JudgeState) -> Result<(), StepError> {
        let Some(Judging { evaluator, .. }) = judging.take() else { return Ok(()) };
        let path = &self.parameters.path;
        let written = std::fs::write(path, evaluator.finish().to_bytes()?);
        Ok(written.map_err(|error| format!("cannot write the figures {}: {error}", path.display()))?)
    }
}
