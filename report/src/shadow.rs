//! Effects of backups: the steps of outputs at a take-over, and the differences between the samples of a shadow and
//! those of the process that it shadows.

use anyhow::anyhow;
use bus::plan::Plan;
use diagnostics::Error;
use diagnostics::unit::behind_number;
use recorder::RecordingError;
use recorder::node::SHADOW_PREFIX;
use recorder::reader::Recording;
use runtime::launcher::{Purpose, Report};
use serde::Serialize;
use std::collections::{BTreeMap, BTreeSet};
use std::fmt;

/// The difference between a field of a shadow topic and the same field of the topic itself. It covers the
/// ticks of one shadow that have both. Its text is a line of the summary.
///
/// ```
/// use report::shadow::Difference;
/// let [topic, field, unit] = ["/pid/command", "command[0]", "1"].map(str::to_owned);
/// let (mean, rms, max, max_tick, primary_deviation) = (-0.5, 1.0, 3.0, 17, 10.0);
/// let (from_tick, samples) = (0, 100);
/// let difference =
///     Difference { topic, field, unit, from_tick, samples, mean, rms, max, max_tick, primary_deviation };
/// assert!(difference.to_string().contains("rms 1.0000, mean -0.5000, max 3.0000 at tick 17"));
/// ```
#[derive(Clone, Debug, Serialize)]
pub struct Difference {
    /// The topic.
    pub topic: String,
    /// The field.
    pub field: String,
    /// Its unit.
    pub unit: String,
    /// The first tick that has both.
    pub from_tick: u32,
    /// Ticks that have both.
    pub samples: usize,
    /// Mean of shadow minus primary.
    pub mean: f64,
    /// Root of the mean square of shadow minus primary.
    pub rms: f64,
    /// The greatest difference, without its sign.
    pub max: f64,
    /// The tick of the greatest difference.
    pub max_tick: u32,
    /// Root mean square of the primary's values about their mean: the scale for the difference.
    #[serde(rename = "active_deviation")]
    pub primary_deviation: f64,
}

/// Report about a backup.
///
/// ```
/// use report::shadow::Replacement;
/// use runtime::launcher::{Purpose, Report};
/// let report = Report {
///     process: "controller".to_owned(),
///     generation: 1,
///     purpose: Purpose::Swap,
///     is_planned: true,
///     request: None,
///     join_tick: Some(41),
///     take_over_tick: Some(50),
///     hand_over: Some("state"),
///     start_ms: 12.0,
///     hold_ms: 0.4,
///     refused: None,
///     inputs: Vec::new(),
/// };
/// let text = Replacement { report, steps: Vec::new() }.to_string();
/// assert!(text.starts_with("  swap of `controller`: shadowed from tick 41, flew from 50, handed over: state"));
/// ```
#[derive(Debug, Serialize)]
pub struct Replacement {
    /// Its report from the run.
    #[serde(flatten)]
    pub report: Report,
    /// Steps of the outputs at its take-over.
    pub steps: Vec<Step>,
}

impl Replacement {
    /// True if it was planned and did not take part, which fails the run.
    pub(crate) fn has_failed(&self) -> bool {
        self.report.is_planned && self.report.refused.is_some()
    }
}

/// Step of an output at a take-over.
///
/// ```
/// use report::shadow::Step;
/// let [topic, field, unit] = ["/pid/command", "command[0]", "1"].map(str::to_owned);
/// let step = Step { topic, field, unit, step: 0.25, step_before: 0.125, law_difference: None };
/// let text = "    /pid/command command[0]: step 0.2500 at the take-over, 0.1250 one sample earlier";
/// assert_eq!(step.to_string(), text);
/// ```
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
    /// The step one sample earlier, between two samples of the predecessor.
    pub step_before: f64,
    /// Difference between the backup's last shadow sample and its predecessor's sample of that tick, without its
    /// sign.
    pub law_difference: Option<f64>,
}

/// Numbers by tick.
type Series = BTreeMap<u32, f64>;
/// The series of topics and fields, with their units.
type Values = BTreeMap<(String, String), (String, Series)>;

/// The ticks at which shadows joined, by topic.
pub(crate) type Joins<'a> = BTreeMap<&'a str, Vec<u32>>;

/// Ticks at which the shadows of a run joined, by topic.
pub(crate) fn joins<'a>(plan: &'a Plan, replacements: &[Replacement]) -> Joins<'a> {
    let mut joins = Joins::new();
    for report in replacements.iter().map(|replacement| &replacement.report) {
        for topic in outputs(plan, report) {
            joins.entry(topic).or_default().extend(report.join_tick);
        }
    }
    joins.values_mut().for_each(|ticks| ticks.sort_unstable());
    joins
}

/// The topics that the process of `report` publishes.
fn outputs<'a>(plan: &'a Plan, report: &Report) -> impl Iterator<Item = &'a str> + use<'a> {
    let node = plan.nodes.iter().find(|node| node.name == report.process);
    let topics = node.into_iter().flat_map(|node| &node.outputs);
    topics.map(|output| plan.topics[output.topic].name.as_str())
}

/// The differences of all shadow topics of `recording`, of each shadow for itself.
///
/// # Errors
/// If the recording is damaged.
pub(crate) fn differences(recording: &Recording, joins: &Joins<'_>) -> anyhow::Result<Vec<Difference>> {
    let shadowed = recording.topics().keys().filter_map(|topic| topic.strip_prefix(SHADOW_PREFIX));
    let values = values(recording, &shadowed.collect::<Vec<_>>())?;
    let mut all = Vec::new();
    for ((topic, field), (unit, shadow)) in &values {
        let Some(topic) = topic.strip_prefix(SHADOW_PREFIX) else { continue };
        let Some((_, primary)) = values.get(&(topic.to_owned(), field.clone())) else { continue };
        let joined = joins.get(topic).map_or(&[][..], Vec::as_slice);
        let of_each = by_shadow(shadow, joined);
        all.extend(of_each.iter().filter_map(|shadow| difference([topic, field, unit], shadow, primary)));
    }
    Ok(all)
}

/// The samples of each of the shadows that joined at these ticks: those before the second joined are the first one's.
fn by_shadow(samples: &Series, joined: &[u32]) -> Vec<Series> {
    let ends: Vec<u32> = joined.iter().skip(1).copied().chain([u32::MAX]).collect();
    let starts = std::iter::once(0).chain(ends.iter().copied());
    let of_one =
        |(start, &end): (u32, &u32)| samples.range(start..end).map(|(&tick, &value)| (tick, value)).collect();
    starts.zip(&ends).map(of_one).collect()
}

/// The differences of all shadow topics of `recording`, as text.
///
/// ```
/// # use bus::{Message, announcement::Announcement, messages::PlantState};
/// # let folder = tempfile::tempdir()?;
/// # let path = folder.path().join("plain.mcap");
/// # let mut writer = recorder::writer::RecordingWriter::create(&path)?;
/// # writer.add_channel("/plant/state", &Announcement::of(PlantState::SCHEMA))?;
/// # writer.finish()?;
/// let recording = recorder::reader::Recording::open(&path)?;
/// assert!(report::shadow::report(&recording).unwrap_err().to_string().contains("has no shadow"));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// If the recording is damaged, or has no shadow.
pub fn report(recording: &Recording) -> Result<String, Error> {
    let differences = differences(recording, &Joins::new())?;
    if differences.is_empty() {
        let path = recording.path().display();
        let none =
            "has no shadow: its run had no [[shadow]], [[swap]] or standby, or did not record their topics";
        return Err(anyhow!("{path} {none}").into());
    }
    Ok(lines(&differences))
}

/// A line for each difference, and one line for all fields that are equal.
pub(crate) fn lines(differences: &[Difference]) -> String {
    let unequal: Vec<_> = differences.iter().filter(|difference| difference.max != 0.0).collect();
    let mut text: String = unequal.iter().map(|difference| format!("{difference}\n")).collect();
    // A field may have had several shadows, one after the other.
    let field = |difference: &Difference| (difference.topic.clone(), difference.field.clone());
    let mut equal: BTreeSet<(String, String)> = differences.iter().map(field).collect();
    unequal.iter().for_each(|difference| {
        equal.remove(&field(difference));
    });
    if !equal.is_empty() {
        let mut counts: BTreeMap<&str, usize> = BTreeMap::new();
        equal.iter().for_each(|(topic, _)| *counts.entry(topic).or_default() += 1);
        let topics: Vec<String> = counts.iter().map(|(topic, count)| format!("{topic} {count}")).collect();
        let fields =
            if equal.len() == 1 { "1 field is".to_owned() } else { format!("{} fields are", equal.len()) };
        text += &format!("  shadow − primary: {fields} equal in every sample: {}\n", topics.join(", "));
    }
    text
}

/// The difference of two series of the same topic, field and unit, given by their ticks.
fn difference(names: [&str; 3], shadow: &Series, primary: &Series) -> Option<Difference> {
    let both =
        |(tick, shadow): (&u32, &f64)| primary.get(tick).map(|primary| (*tick, shadow - primary, *primary));
    let both: Vec<(u32, f64, f64)> = shadow.iter().filter_map(both).collect();
    let mean = |value: &dyn Fn(f64, f64) -> f64| {
        both.iter().map(|(_, difference, primary)| value(*difference, *primary)).sum::<f64>()
            / both.len() as f64
    };
    let primary_mean = mean(&|_, primary| primary);
    let sizes = both.iter().map(|(tick, difference, _)| (*tick, difference.abs()));
    let (max_tick, max) = sizes.max_by(|a, b| a.1.total_cmp(&b.1).then(b.0.cmp(&a.0)))?;
    let [topic, field, unit] = names.map(str::to_owned);
    Some(Difference {
        topic,
        field,
        unit,
        from_tick: both.first()?.0,
        samples: both.len(),
        mean: mean(&|difference, _| difference),
        rms: mean(&|difference, _| difference.powi(2)).sqrt(),
        max,
        max_tick,
        primary_deviation: mean(&|_, primary| (primary - primary_mean).powi(2)).sqrt(),
    })
}

/// Adds the steps of all outputs at the take-overs.
///
/// # Errors
/// If the recording is damaged.
pub(crate) fn add_steps(
    recording: &Recording,
    plan: &Plan,
    replacements: &mut [Replacement],
) -> anyhow::Result<()> {
    let flown = replacements.iter().map(|replacement| &replacement.report);
    let topics =
        flown.filter(|report| report.take_over_tick.is_some()).flat_map(|report| outputs(plan, report));
    let values = values(recording, &topics.collect::<Vec<_>>())?;
    for Replacement { report, steps } in replacements {
        let Some(tick) = report.take_over_tick else { continue };
        *steps = outputs(plan, report).filter_map(|topic| step_at(&values, topic, tick)).collect();
    }
    Ok(())
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
        let shadow = shadow.and_then(|(_, shadow)| shadow.get(&last_tick));
        let law_difference = shadow.map(|shadow| (shadow - last).abs());
        let (step, step_before) = ((first - last).abs(), (last - before).abs());
        let (topic, field, unit) = (topic.to_owned(), field.clone(), unit.clone());
        Some(Step { topic, field, unit, step, step_before, law_difference })
    });
    steps.max_by(|a, b| a.step.total_cmp(&b.step))
}

/// The numbers of `topics` and of their shadows.
fn values(recording: &Recording, topics: &[&str]) -> anyhow::Result<Values> {
    let mut values = Values::new();
    if topics.is_empty() {
        return Ok(values);
    }
    recording.visit::<RecordingError>(|message| {
        let primary = message.topic.strip_prefix(SHADOW_PREFIX).unwrap_or(message.topic);
        if !topics.contains(&primary) {
            return Ok(());
        }
        for leaf in recording.decode_on(message.topic, message.cdr)? {
            // Time stamps differ only if ticks do.
            let is_stamp = leaf.path.rsplit('.').nth(1) == Some("stamp");
            if let Some(number) = leaf.value.as_f64().filter(|_| !is_stamp) {
                let entry = values.entry((message.topic.to_owned(), leaf.path)).or_default();
                entry.0 = leaf.unit;
                entry.1.insert(message.tick, number);
            }
        }
        Ok(())
    })?;
    Ok(values)
}

impl fmt::Display for Difference {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { topic, field, unit, mean, rms, max, max_tick, primary_deviation, .. } = self;
        let (samples, from_tick, unit) = (self.samples, self.from_tick, behind_number(unit));
        write!(
            f,
            "  {topic} {field}: shadow − primary: rms {rms:.4}{unit}, mean {mean:+.4}, max {max:.4} at tick {max_tick} \
             ({samples} samples from tick {from_tick} on; standard deviation of the primary {primary_deviation:.4})"
        )
    }
}

impl fmt::Display for Step {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { topic, field, unit, step, step_before, .. } = self;
        let unit = behind_number(unit);
        write!(
            f,
            "    {topic} {field}: step {step:.4}{unit} at the take-over, {step_before:.4} one sample earlier"
        )
    }
}

impl fmt::Display for Replacement {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let report = &self.report;
        let purpose = match report.purpose {
            Purpose::Swap => "swap",
            Purpose::Standby => "standby",
            Purpose::Shadow => "shadow",
            Purpose::Restart => "restart",
        };
        write!(f, "  {purpose} of `{}`", report.process)?;
        match (report.join_tick, report.take_over_tick) {
            (_, Some(tick)) if report.purpose == Purpose::Restart => write!(f, " at tick {tick}")?,
            (Some(join), Some(tick)) => write!(f, ": shadowed from tick {join}, flew from {tick}")?,
            (Some(join), None) => write!(f, ": shadowed from tick {join}")?,
            (None, _) => {}
        }
        if let (Some(_), Some(hand_over)) = (report.take_over_tick, report.hand_over) {
            write!(f, ", handed over: {hand_over}")?;
        }
        if report.join_tick.is_some() {
            let (start_ms, hold_ms) = (report.start_ms, report.hold_ms);
            write!(f, " (started in {start_ms:.1} ms, held the clock for {hold_ms:.1} ms)")?;
        }
        if let Some(reason) = &report.refused {
            // Its last words stand below how it ended.
            let lines: Vec<&str> = reason.lines().map(str::trim).take(3).collect();
            write!(f, ": REFUSED: {}", lines.join("; "))?;
        }
        self.steps.iter().try_for_each(|step| {
            write!(f, "\n{step}")?;
            step.law_difference.map_or(Ok(()), |difference| {
                let name = &report.process;
                write!(f, "; the output of the new `{name}` differs by {difference:.4} in that sample")
            })
        })
    }
}

#[cfg(test)]
mod tests {
    use super::{Replacement, Series, Step, by_shadow, difference, lines};
    use runtime::launcher::{Purpose, Report};

    #[test]
    fn the_summary_of_a_swap_names_the_process() {
        let report = Report {
            process: "plant".to_owned(),
            generation: 1,
            purpose: Purpose::Swap,
            is_planned: true,
            request: None,
            join_tick: Some(41),
            take_over_tick: Some(50),
            hand_over: Some("state"),
            start_ms: 12.0,
            hold_ms: 0.4,
            refused: None,
            inputs: Vec::new(),
        };
        let [topic, field, unit] = ["/plant/state", "position.z", "m"].map(str::to_owned);
        let step = Step { topic, field, unit, step: 0.25, step_before: 0.125, law_difference: Some(0.5) };
        let text = Replacement { report, steps: vec![step] }.to_string();
        let end = "step 0.2500 m at the take-over, 0.1250 one sample earlier; \
                   the output of the new `plant` differs by 0.5000 in that sample";
        assert!(text.ends_with(end), "{text}");
    }

    #[test]
    fn each_shadow_is_held_against_the_primary_of_its_own_time() {
        // The first shadow is off by 100 up to tick 5 and takes over; its successor is off by 1 from tick 7 on.
        let primary: Series = (0..10).map(|tick| (tick, f64::from(tick))).collect();
        let off = |tick: u32| if tick < 5 { 100.0 } else { 1.0 };
        let shadow = primary.iter().map(|(&tick, &value)| (tick, value + off(tick)));
        let shadow: Series = shadow.filter(|(tick, _)| *tick != 5 && *tick != 6).collect();
        let found = by_shadow(&shadow, &[0, 7]);
        let told: Vec<_> = found
            .iter()
            .filter_map(|shadow| difference(["/pid/command", "command[0]", "1"], shadow, &primary))
            .map(|found| (found.from_tick, found.samples, found.max))
            .collect();
        assert_eq!(told, [(0, 5, 100.0), (7, 3, 1.0)]);
        assert_eq!(by_shadow(&shadow, &[]), [shadow]);
    }

    #[test]
    fn fields_that_are_equal_share_a_line() {
        let primary: Series = (0..4).map(|tick| (tick, f64::from(tick))).collect();
        let other: Series = (0..4).map(|tick| (tick, f64::from(tick) + 0.5)).collect();
        let of = |topic, field, shadow| difference([topic, field, "m"], shadow, &primary).unwrap();
        let mut all =
            vec![of("/plant/state", "position.z", &other), of("/plant/state", "position.x", &primary)];
        let text = lines(&all);
        assert!(text.starts_with("  /plant/state position.z: shadow − primary: rms 0.5000 m, "), "{text}");
        let end = "\n  shadow − primary: 1 field is equal in every sample: /plant/state 1\n";
        assert!(text.ends_with(end) && text.lines().count() == 2, "{text}");
        all.push(of("/plant/pose", "position.x", &primary));
        // Later shadows: fields are counted once, and one that differed before is not equal.
        all.push(of("/plant/pose", "position.x", &primary));
        all.push(of("/plant/state", "position.z", &primary));
        let text = lines(&all);
        let end = "2 fields are equal in every sample: /plant/pose 1, /plant/state 1\n";
        assert!(text.ends_with(end) && text.lines().count() == 2, "{text}");
    }
}
