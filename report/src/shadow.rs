//! What a shadow would have done otherwise: its samples against those of the process it shadows.

use anyhow::{Result, bail};
use bus::plan::Plan;
use recorder::node::SHADOW_PREFIX;
use recorder::reader::Recording;
use serde::Serialize;
use std::collections::BTreeMap;
use std::fmt;

use runtime::replacement::Report;

/// The difference between a field of a shadow topic and the same field of the topic itself, over all ticks
/// that have both.
#[derive(Clone, Debug, Serialize)]
pub struct Difference {
    /// The topic.
    pub topic: String,
    /// The field.
    pub field: String,
    /// Its unit.
    pub unit: String,
    /// Ticks that have both.
    pub samples: usize,
    /// Mean of shadow minus active.
    pub mean: f64,
    /// Root of the mean square of shadow minus active.
    pub rms: f64,
    /// The greatest difference, without its sign.
    pub max: f64,
    /// The tick of the greatest difference.
    pub max_tick: u32,
    /// Root mean square of the active process's values about their mean: what the difference is to be
    /// measured by.
    pub active_deviation: f64,
}

/// How an output went on at a take-over.
#[derive(Clone, Debug, Serialize)]
pub struct Step {
    /// The topic.
    pub topic: String,
    /// The field with the greatest step.
    pub field: String,
    /// Its unit.
    pub unit: String,
    /// The backup's first value minus its predecessor's last, without its sign.
    pub step: f64,
    /// The same one sample earlier, between two samples of the predecessor.
    pub step_before: f64,
    /// What the backup asked for otherwise than its predecessor in its last shadow sample.
    pub law_difference: Option<f64>,
}

/// Numbers by topic, field and tick.
type Values = BTreeMap<(String, String), (String, BTreeMap<u32, f64>)>;

/// The differences of all shadow topics of `recording`.
///
/// # Errors
/// If the recording is damaged.
pub fn differences(recording: &Recording) -> Result<Vec<Difference>> {
    let shadowed = recording.topics().keys().filter_map(|topic| topic.strip_prefix(SHADOW_PREFIX));
    let shadowed: Vec<String> = shadowed.map(str::to_owned).collect();
    let values = values(recording, &shadowed)?;
    let shadows = values.iter().filter_map(|((topic, field), (unit, shadow))| {
        let topic = topic.strip_prefix(SHADOW_PREFIX)?;
        let (_, active) = values.get(&(topic.to_owned(), field.clone()))?;
        difference(topic, field, unit, shadow, active)
    });
    Ok(shadows.collect())
}

/// The differences of all shadow topics of `recording`, in words.
///
/// # Errors
/// If the recording is damaged, or has no shadow.
pub fn report(recording: &Recording) -> Result<String> {
    let differences = differences(recording)?;
    if differences.is_empty() {
        let path = recording.path().display();
        bail!(
            "{path} has no shadow: its run had no [[shadow]], [[swap]] or standby, or did not record their topics"
        );
    }
    Ok(differences.iter().map(|difference| format!("{difference}\n")).collect())
}

fn difference(
    topic: &str,
    field: &str,
    unit: &str,
    shadow: &BTreeMap<u32, f64>,
    active: &BTreeMap<u32, f64>,
) -> Option<Difference> {
    let both: Vec<(u32, f64, f64)> =
        shadow.iter().filter_map(|(tick, shadow)| Some((*tick, *shadow, *active.get(tick)?))).collect();
    let count = both.len() as f64;
    let mean = |value: &dyn Fn(&(u32, f64, f64)) -> f64| both.iter().map(value).sum::<f64>() / count;
    let active_mean = mean(&|(_, _, active)| *active);
    let (max_tick, max) = both
        .iter()
        .map(|(tick, shadow, active)| (*tick, (shadow - active).abs()))
        .max_by(|a, b| a.1.total_cmp(&b.1).then(b.0.cmp(&a.0)))?;
    Some(Difference {
        topic: topic.to_owned(),
        field: field.to_owned(),
        unit: unit.to_owned(),
        samples: both.len(),
        mean: mean(&|(_, shadow, active)| shadow - active),
        rms: mean(&|(_, shadow, active)| (shadow - active).powi(2)).sqrt(),
        max,
        max_tick,
        active_deviation: mean(&|(_, _, active)| (active - active_mean).powi(2)).sqrt(),
    })
}

/// The steps of all outputs at the take-overs of `reports`, by report.
///
/// # Errors
/// If the recording is damaged.
pub fn steps(recording: &Recording, plan: &Plan, reports: &[Report]) -> Result<Vec<Vec<Step>>> {
    let outputs = |report: &Report| {
        let node = plan.nodes.iter().find(|node| node.name == report.process);
        let topics = node.into_iter().flat_map(|node| &node.outputs);
        topics.map(|output| plan.topics[output.topic].name.clone()).collect::<Vec<_>>()
    };
    let taken_over = reports.iter().filter(|report| report.take_over_tick.is_some());
    let topics: Vec<String> = taken_over.flat_map(outputs).collect();
    let values = values(recording, &topics)?;
    let step = |report: &Report| match report.take_over_tick {
        Some(tick) => outputs(report).iter().filter_map(|topic| step_at(&values, topic, tick)).collect(),
        None => Vec::new(),
    };
    Ok(reports.iter().map(step).collect())
}

/// The field of `topic` with the greatest step at `tick`.
fn step_at(values: &Values, topic: &str, tick: u32) -> Option<Step> {
    let fields = values.iter().filter(|((name, _), _)| name == topic);
    let steps = fields.filter_map(|((_, field), (unit, values_of_field))| {
        let first = *values_of_field.get(&tick)?;
        let mut earlier = values_of_field.range(..tick).rev();
        let (&last_tick, &last) = earlier.next()?;
        let before = earlier.next().map_or(last, |(_, &value)| value);
        let shadow = values.get(&(format!("{SHADOW_PREFIX}{topic}"), field.clone()));
        let law_difference =
            shadow.and_then(|(_, shadow)| shadow.get(&last_tick)).map(|shadow| (shadow - last).abs());
        Some(Step {
            topic: topic.to_owned(),
            field: field.clone(),
            unit: unit.clone(),
            step: (first - last).abs(),
            step_before: (last - before).abs(),
            law_difference,
        })
    });
    steps.max_by(|a, b| a.step.total_cmp(&b.step))
}

/// The numbers of `topics` and of their shadows.
fn values(recording: &Recording, topics: &[String]) -> Result<Values> {
    let mut values = Values::new();
    for record in recording.messages() {
        let record = record?;
        let active = record.topic.strip_prefix(SHADOW_PREFIX).unwrap_or(&record.topic);
        if !topics.iter().any(|topic| topic == active) {
            continue;
        }
        for leaf in recording.decode(&record)? {
            // Time stamps differ only if ticks do.
            let is_stamp = leaf.path.rsplit('.').nth(1) == Some("stamp");
            if let Some(number) = leaf.value.as_f64().filter(|_| !is_stamp) {
                let entry = values.entry((record.topic.clone(), leaf.path)).or_default();
                entry.0 = leaf.unit;
                entry.1.insert(record.tick, number);
            }
        }
    }
    Ok(values)
}

impl fmt::Display for Difference {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { topic, field, unit, samples, mean, rms, max, max_tick, active_deviation } = self;
        write!(
            f,
            "  {topic} {field}: shadow − active: rms {rms:.4} {unit}, mean {mean:+.4}, max {max:.4} at tick {max_tick} \
             ({samples} samples; the active deviates by {active_deviation:.4})"
        )
    }
}

impl fmt::Display for Step {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { topic, field, unit, step, step_before, .. } = self;
        write!(
            f,
            "    {topic} {field}: step {step:.4} {unit} at the take-over, {step_before:.4} one sample earlier"
        )?;
        match self.law_difference {
            Some(difference) => write!(f, "; the new law asked for {difference:.4} otherwise there"),
            None => Ok(()),
        }
    }
}
