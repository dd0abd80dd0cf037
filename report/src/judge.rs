//! The judgement of a run: pass conditions, measures and comparisons, evaluated as samples pass.
//!
//! - `signals`: newest values of the fields that conditions need
//! - `statistic`, `condition`, `windows`: the values of one condition or comparison
//! - `evaluator`: all conditions of a run; the same for a recording and in flight
//! - [`node`]: the component that evaluates a run without a recording in flight
//! - `figures`: the values without limits, as that component hands them over
//! - `verdict`: the values against their limits

mod condition;
mod evaluator;
mod figures;
pub mod node;
mod signals;
mod statistic;
mod verdict;
mod windows;

pub use evaluator::Evaluator;
pub use figures::{Figures, Found, WindowFigures};
pub use verdict::{Verdict, WindowErrors};

use anyhow::Result;
use recorder::reader::Recording;
use runtime::manifest::Conditions;

/// The figures of `conditions` in `recording`, which is read once.
///
/// # Errors
/// If a topic or field is not in the recording, a unit does not fit, or the file is damaged.
pub(crate) fn figures(conditions: &Conditions, recording: &Recording) -> Result<Figures> {
    let mut evaluator = Evaluator::new(conditions, |topic| recording.fields_of(topic))?;
    if conditions.topics().is_empty() {
        return Ok(evaluator.finish());
    }
    let mut under_way = None;
    recording.visit::<anyhow::Error>(|message| {
        let time_ns = *under_way.get_or_insert(message.time_ns);
        if message.time_ns != time_ns {
            evaluator.end_tick(time_ns)?;
            under_way = Some(message.time_ns);
        }
        match evaluator.topic(message.topic) {
            Some(topic) => Ok(evaluator.take(topic, message.cdr)?),
            None => Ok(()),
        }
    })?;
    under_way.map_or(Ok(()), |time_ns| evaluator.end_tick(time_ns))?;
    Ok(evaluator.finish())
}
