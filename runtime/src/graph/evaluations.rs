//! Conditions, measures and comparisons: their topics are recorded or judged in flight, and their fields and units exist.

use super::parameters::Notes;
use crate::manifest::{Comparison, Manifest, PassCondition, Statistic};
use crate::program::Program;
use bus::plan::{NodePlan, Plan};
use bus::sample_ticks::SampleTicks;
use diagnostics::{Diagnostic, NotOneLine, did_you_mean, nine_decimals, printable_line, require_line};
use recorder::RecordingError;
use std::ops::Range;
use toml::Spanned;

/// Checks that all topics of the conditions reach the recorder or the judge, and that fields and units exist: of each condition up to
/// its first fault. In a run with `is_whole` false, some nodes are unchecked: they may be the recorder.
pub fn check(
    manifest: &Manifest,
    plan: &Plan,
    programs: &[Program],
    notes: &mut Notes,
    is_whole: bool,
) -> Result<(), Diagnostic> {
    let content = &manifest.content;
    let has_times = !manifest.repairs.is_timeless;
    let taken = if is_whole { taken(plan, programs) } else { (0..plan.topics.len()).collect() };
    let compares = content.compare.iter().map(|compare| {
        let Comparison { simulated, measured, .. } = compare.get_ref();
        for (key, topic) in [("simulated", simulated), ("measured", measured)] {
            check_taken(manifest, plan, &taken, &compare.span(), ["", key], topic)?;
        }
        if has_times { check_window(manifest, plan, compare) } else { Ok(()) }
    });
    let compares = Diagnostic::gather(compares).map(drop);
    let conditions = content.pass.iter().map(|pass| (pass, true));
    let conditions = conditions.chain(content.measure.iter().map(|measure| (measure, false)));
    let conditions = conditions.map(|(condition, is_pass)| {
        check_name(manifest, condition)?;
        for (table, topic) in condition.get_ref().placed_topics() {
            check_taken(manifest, plan, &taken, &condition.span(), [table, "topic"], topic)?;
        }
        if is_pass {
            check_limits(manifest, condition)?
        } else {
            check_no_limits(manifest, condition)?
        }
        check_field(manifest, plan, condition)?;
        if has_times { check_span(manifest, plan, condition, notes) } else { Ok(()) }
    });
    let conditions = Diagnostic::gather(conditions).map(drop);
    Diagnostic::gather([conditions, compares]).map(drop)
}

/// The topics that the recorder or the judge takes.
fn taken(plan: &Plan, programs: &[Program]) -> Vec<usize> {
    let takes_samples = |(_, program): &(_, &Program)| program.is_recorder() || program.is_judge();
    let takers = plan.nodes.iter().zip(programs).filter(takes_samples);
    takers.flat_map(|(node, _)| &node.inputs).map(|input| input.topic).collect()
}

fn kind(condition: &PassCondition) -> &'static str {
    if condition.min.is_none() && condition.max.is_none() { "measure" } else { "pass condition" }
}

/// Refuses a name that would be more than a part of one line of the summary.
fn check_name(manifest: &Manifest, condition: &Spanned<PassCondition>) -> Result<(), Diagnostic> {
    let Err(NotOneLine { expected, found }) = require_line(&condition.get_ref().name) else { return Ok(()) };
    let message = format!("{}: `name`: expected {expected}, found `{found}`", kind(condition.get_ref()));
    let at = key_of(manifest, &condition.span(), "", "name");
    Err(manifest.problem(&at, message, "write the name in one line, without tabs"))
}

fn check_no_limits(manifest: &Manifest, measure: &Spanned<PassCondition>) -> Result<(), Diagnostic> {
    let PassCondition { name, min, max, .. } = measure.get_ref();
    let key = match (min, max) {
        (None, None) => return Ok(()),
        (Some(_), _) => "min",
        (None, Some(_)) => "max",
    };
    let message = format!("measure `{name}`: it has a limit, and a measure is reported, not judged");
    let at = key_of(manifest, &measure.span(), "", key);
    Err(manifest.problem(&at, message, "leave `min` and `max` out, or write [[pass]]"))
}

/// Refuses a condition that cannot fail, or cannot hold.
fn check_limits(manifest: &Manifest, pass: &Spanned<PassCondition>) -> Result<(), Diagnostic> {
    let condition = pass.get_ref();
    let at = |span: &Range<usize>, message: String, help: &str| {
        manifest.problem(span, format!("pass condition `{}`: {message}", condition.name), help)
    };
    if condition.min.is_none() && condition.max.is_none() {
        let help = "add `min`, `max`, or both; what is only to be reported is a [[measure]]";
        return Err(at(&pass.span(), "it has no limit, so it cannot fail".into(), help));
    }
    let least = match condition.statistic {
        Statistic::Rms => Some((0.0, "the root of a mean square")),
        Statistic::Span => Some((0.0, "the largest sample less the smallest")),
        _ => None,
    };
    match impossible(condition.min, condition.max, least) {
        Some((keys, message, help)) => Err(at(&blamed(manifest, &pass.span(), "", keys), message, &help)),
        None => Ok(()),
    }
}

/// Refuses a span in which nothing can be judged, and warns of one that contains the end of the run. If another file
/// than the condition's own cut the run short, the span is not refused.
fn check_span(
    manifest: &Manifest,
    plan: &Plan,
    pass: &Spanned<PassCondition>,
    notes: &mut Notes,
) -> Result<(), Diagnostic> {
    let PassCondition { name, topic, from_s, to_s, .. } = pass.get_ref();
    let at = |keys: &[&str], message: String, help: &str| {
        let span = blamed(manifest, &pass.span(), "", keys);
        manifest.problem(&span, format!("{} `{name}`: {message}", kind(pass.get_ref())), help)
    };
    if *from_s < 0.0 {
        return Err(at(&["from_s"], format!("`from_s` is {from_s} s"), "a run begins at 0 s"));
    }
    if let Some(to_s) = to_s.filter(|to_s| to_s < from_s) {
        let message = format!("`from_s` is {from_s} s and `to_s` is {to_s} s");
        return Err(at(&["to_s", "from_s"], message, "a span ends where it begins, or later"));
    }
    let (first_s, period_s) = first_sample_s(*from_s, sample_ticks(plan, topic), plan.tick_ns);
    let end_s = f64::from(plan.duration_ticks) * plan.tick_s();
    if let Some(to_s) = to_s.filter(|to_s| first_s > to_s + HALF_NS_S) {
        let message = format!(
            "no sample of {topic} lies from {from_s} s to {to_s} s: it comes every {} s, the next at {} s",
            nine_decimals(period_s),
            nine_decimals(first_s)
        );
        let help = "widen the span: a span without samples does not pass";
        return Err(at(&["from_s", "to_s"], message, help));
    }
    if let Some(fault) = behind_end(manifest, plan, pass) {
        return if notes.is_cut(manifest, &pass.span()) { Ok(()) } else { Err(fault) };
    }
    if let Some(to_s) = to_s.filter(|to_s| *to_s > end_s + HALF_NS_S)
        && !notes.is_cut(manifest, &pass.span())
    {
        let message = format!("`to_s` is {to_s} s, and the run ends at {} s", nine_decimals(end_s));
        let help = "only what is flown is judged; leave `to_s` out for the whole rest of the run";
        notes.warnings.push(at(&["to_s"], message, help));
    }
    Ok(())
}

/// Fault of a span that begins where the run has ended; `None` if it begins earlier.
fn behind_end(manifest: &Manifest, plan: &Plan, pass: &Spanned<PassCondition>) -> Option<Diagnostic> {
    let PassCondition { name, topic, from_s, .. } = pass.get_ref();
    let (first_s, _) = first_sample_s(*from_s, sample_ticks(plan, topic), plan.tick_ns);
    let end_s = f64::from(plan.duration_ticks) * plan.tick_s();
    if first_s < end_s - HALF_NS_S {
        return None;
    }
    let message = format!(
        "{} `{name}`: `from_s` is {from_s} s, and the run ends at {} s: no sample of {topic} is judged",
        kind(pass.get_ref()),
        nine_decimals(end_s)
    );
    let help = "begin earlier, or raise run.duration_s: a span without samples does not pass";
    let span = blamed(manifest, &pass.span(), "", &["from_s"]);
    Some(manifest.problem(&span, message, help))
}

/// Refuses measures that begin where the run has ended, whatever states its duration: those that stand in the manifest's own text
/// from byte `start` on.
pub fn require_samples(manifest: &Manifest, plan: &Plan, start: usize) -> Result<(), Diagnostic> {
    let is_meant = |measure: &&Spanned<PassCondition>| {
        let at = measure.span().start;
        at >= start && manifest.sources.is_one_text(at, start)
    };
    let fault = |measure| behind_end(manifest, plan, measure).map_or(Ok(()), Err);
    Diagnostic::gather(manifest.content.measure.iter().filter(is_meant).map(fault)).map(drop)
}

/// Ticks at which the samples of `topic` are sent.
fn sample_ticks(plan: &Plan, topic: &str) -> SampleTicks {
    let known = plan.topics.iter().find(|known| known.name == topic);
    known.map_or(SampleTicks::every(1), |known| known.ticks)
}

/// Times in seconds are exact to half a nanosecond, as when the run is judged.
const HALF_NS_S: f64 = 5e-10;
/// The largest lag that can be looked for, s: the work grows with it. Own choice.
const LAG_MAX_S: f64 = 60.0;

/// The first sample at `from_s` or later of a topic that is sent at `ticks`, and the mean time between two samples, in seconds.
#[allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "a cast ends at the greatest tick"
)]
fn first_sample_s(from_s: f64, ticks: SampleTicks, tick_ns: u64) -> (f64, f64) {
    let period_s = ticks.mean() * tick_ns as f64 * 1e-9;
    let first = |unit_s: f64| ((from_s - HALF_NS_S) / unit_s).ceil().max(0.0);
    if ticks.period().is_some() {
        return (first(period_s) * period_s, period_s);
    }
    let tick_s = tick_ns as f64 * 1e-9;
    (f64::from(ticks.next(first(tick_s) as u32)) * tick_s, period_s)
}

/// Keys, message and advice of a fault.
type Fault = (&'static [&'static str], String, String);

/// Reason why no value of at least `least` can hold the limits, with their keys, and advice.
fn impossible(min: Option<f64>, max: Option<f64>, least: Option<(f64, &str)>) -> Option<Fault> {
    match (min, max, least) {
        (Some(min), Some(max), _) if min > max => {
            let help = "nothing lies between: lower `min`, or raise `max`".to_owned();
            Some((&["min", "max"], format!("`min` is {min} and `max` is {max}"), help))
        }
        (_, Some(max), Some((least, what))) if max < least => {
            Some((&["max"], format!("`max` is {max}"), format!("{what} is never below {least}")))
        }
        _ => None,
    }
}

/// Interval at which the publisher of `topic` is set to a measured state, if it is a plant that is.
fn reset_window_s(plan: &Plan, topic: &str) -> Option<f64> {
    let publishes =
        |node: &&NodePlan| node.outputs.iter().any(|output| plan.topics[output.topic].name == topic);
    plan.nodes.iter().find(publishes)?.parameters.get("window_s")?.as_f64()
}

fn check_window(manifest: &Manifest, plan: &Plan, compare: &Spanned<Comparison>) -> Result<(), Diagnostic> {
    let span = compare.span();
    let at = |key: &str, message: String, help: &str| {
        let at = if key.is_empty() { span.clone() } else { key_of(manifest, &span, "", key) };
        Err(manifest.problem(&at, message, help))
    };
    let compare = compare.get_ref();
    let (window_s, simulated) = (compare.window_s, &compare.simulated);
    let limits = [
        ("max_position_m", compare.max_position_m),
        ("max_velocity_m_s", compare.max_velocity_m_s),
        ("max_attitude_deg", compare.max_attitude_deg),
    ];
    let mut stated = limits.into_iter().filter_map(|(key, limit)| Some((key, limit?))).peekable();
    if let (false, Some((key, _))) = (compare.judged, stated.peek()) {
        let help = "leave the limit or `judged = false` out";
        return at(key, format!("`{key}` is a limit of a comparison that is not judged"), help);
    }
    if compare.judged && stated.peek().is_none() {
        let help = "add max_position_m, max_velocity_m_s or max_attitude_deg; with judged = false the errors are only reported";
        return at("", "the comparison has no limit, so it cannot fail".to_owned(), help);
    }
    if let Some(set_s) = reset_window_s(plan, simulated).filter(|set_s| *set_s != window_s) {
        let message = format!(
            "`window_s` is {window_s} s, but the plant behind {simulated} is set every {} s",
            nine_decimals(set_s)
        );
        return at("window_s", message, "give both the same length");
    }
    if let Some((key, limit)) = stated.find(|(_, limit)| *limit < 0.0) {
        return at(key, format!("`{key}` is {limit}"), "an RMS error is never below 0");
    }
    let duration_s = f64::from(plan.duration_ticks) * plan.tick_s();
    // The last tick lies one tick before the end.
    if window_s > 0.0 && window_s <= duration_s - plan.tick_s() + 1e-9 {
        return Ok(());
    }
    let duration = nine_decimals(duration_s);
    let message =
        format!("`window_s` is {window_s} s: no window of that length ends within the run of {duration} s");
    at("window_s", message, "choose a window shorter than run.duration_s")
}

fn check_field(manifest: &Manifest, plan: &Plan, pass: &Spanned<PassCondition>) -> Result<(), Diagnostic> {
    let condition = pass.get_ref();
    let at = |table: &str, keys: &[&str], message: String, help: &str| {
        let span = blamed(manifest, &pass.span(), table, keys);
        manifest.problem(&span, format!("{} `{}`: {message}", kind(condition), condition.name), help)
    };
    if let Some((keys, message, help)) =
        condition.gate.as_ref().and_then(|gate| impossible(gate.min, gate.max, None))
    {
        return Err(at("while", keys, format!("`while`: {message}"), &help));
    }
    if let Some(([table, key], message, help)) = unfit_reference(condition) {
        return Err(at(table, &[key], message, help));
    }
    if condition.gate.as_ref().is_some_and(|gate| gate.min.is_none() && gate.max.is_none()) {
        return Err(at("", &["while"], "`while` has no limit".into(), "add `min`, `max`, or both to it"));
    }
    check_units(manifest, plan, pass)
}

/// Refuses fields that are not there, and units that do not fit each other.
fn check_units(manifest: &Manifest, plan: &Plan, pass: &Spanned<PassCondition>) -> Result<(), Diagnostic> {
    let condition = pass.get_ref();
    let at = |table: &str, key: &str, message: String, help: &str| {
        let span = key_of(manifest, &pass.span(), table, key);
        manifest.problem(&span, format!("{} `{}`: {message}", kind(condition), condition.name), help)
    };
    let unit = |table: &str, topic: &str, field: &str| {
        unit_of(manifest, plan, topic, field).map_err(|error| {
            let message = format!("{} `{}`: {error}", kind(condition), condition.name);
            let at = key_of(manifest, &pass.span(), table, "field");
            manifest.problem(&at, message, "name one of these fields")
        })
    };
    let Some(unit_here) = unit("", &condition.topic, &condition.field)? else { return Ok(()) };
    diagnostics::convert(condition.statistic.unit(&unit_here), &condition.unit).map_err(|error| {
        at("", "unit", error.to_string(), "state the limits in a unit of the field's quantity")
    })?;
    if let Some(minus) = &condition.minus
        && let Some(other) = unit("minus", &minus.topic, &minus.field)?
        && other != unit_here
    {
        let message = format!("`minus` takes `{other}` off `{unit_here}`");
        return Err(at("minus", "field", message, "compare fields of one unit"));
    }
    if let Some(reference) = &condition.reference
        && let Some(other) = unit("reference", &reference.topic, &reference.field)?
        && other != unit_here
    {
        let message = format!("the field is in `{unit_here}`, its `reference` in `{other}`");
        let help = "compare fields of one unit, as an angle with the one asked for";
        return Err(at("reference", "field", message, help));
    }
    if let Some(gate) = &condition.gate {
        unit("while", &gate.topic, &gate.field)?;
    }
    Ok(())
}

/// Reason why a condition's `reference` does not fit its statistic, with its table and key, and advice.
fn unfit_reference(condition: &PassCondition) -> Option<([&'static str; 2], String, &'static str)> {
    let name = match condition.statistic {
        Statistic::Gain => "gain",
        _ => "lag",
    };
    let Some(reference) = &condition.reference else {
        let help =
            "add what it is measured against: reference = { topic = \"/pilot/set_point\", field = \"roll\" }";
        let is_of_response = condition.statistic.is_of_response();
        let message = || format!("the statistic `{name}` has no `reference`");
        return is_of_response.then(|| (["", "statistic"], message(), help));
    };
    let beside = [("minus", condition.minus.is_some()), ("while", condition.gate.is_some())];
    if !condition.statistic.is_of_response() {
        return Some((
            ["", "reference"],
            "`reference` is there".to_owned(),
            "only the statistics `lag` and `gain` have one: leave it out",
        ));
    }
    if let Some((key, _)) = beside.into_iter().find(|(_, is_there)| *is_there) {
        let help = "a lag is looked for in two whole signals: leave the key out, and narrow the span with from_s and to_s";
        return Some((["", key], format!("the statistic `{name}` cannot have `{key}`"), help));
    }
    let within_s = reference.within_s;
    let is_possible = within_s > 0.0 && within_s <= LAG_MAX_S;
    (!is_possible).then(|| {
        (
            ["reference", "within_s"],
            format!("`within_s` of `reference` is {within_s} s"),
            "it is the largest lag that is looked for: some time above 0, at most 60 s",
        )
    })
}

/// The unit of a field; `None` for a user's own type, which only its publisher knows: it is checked when the run is
/// judged.
fn unit_of(
    manifest: &Manifest,
    plan: &Plan,
    topic: &str,
    field: &str,
) -> Result<Option<String>, RecordingError> {
    let topic_plan = plan.topics.iter().find(|known| known.name == topic);
    let schema = topic_plan.and_then(|topic| manifest.registry().message(&topic.type_name));
    let Some(schema) = schema else { return Ok(None) };
    recorder::series::unit_of(schema, topic, field)
}

/// Refuses the `topic` of the condition or comparison at `span` if it has no publisher, or is none of those `taken`.
fn check_taken(
    manifest: &Manifest,
    plan: &Plan,
    taken: &[usize],
    span: &Range<usize>,
    [table, key]: [&str; 2],
    topic: &str,
) -> Result<(), Diagnostic> {
    let at = || key_of(manifest, span, table, key);
    let Some(index) = plan.topics.iter().position(|known| known.name == topic) else {
        // A process with a gap may send it.
        if !manifest.repairs.processes.is_empty() {
            return Ok(());
        }
        let known = plan.topics.iter().map(|topic| topic.name.as_str());
        let help = did_you_mean(topic, known, "the topics are");
        return Err(manifest.problem(&at(), format!("nobody publishes {}", printable_line(topic)), help));
    };
    if taken.contains(&index) {
        return Ok(());
    }
    let help = "add a process with kind = \"recorder\" that takes it";
    Err(manifest.problem(&at(), format!("{topic} is judged but not recorded"), help))
}

/// Place of the value of `key` in the condition or comparison at `span`, or in its `table` of that name; the `--set` that
/// states it, if one does.
fn key_of(manifest: &Manifest, span: &Range<usize>, table: &str, key: &str) -> Range<usize> {
    let path: Vec<&str> = [table, key].into_iter().filter(|name| !name.is_empty()).collect();
    set_of(manifest, span, &path).unwrap_or_else(|| {
        let [_, at] = manifest.sources.inside(span, &path);
        at
    })
}

/// Place of one of several keys that do not go together: the one that a `--set` states, or the first.
fn blamed(manifest: &Manifest, span: &Range<usize>, table: &str, keys: &[&str]) -> Range<usize> {
    let path = |key| [table, key].into_iter().filter(|name| !name.is_empty()).collect::<Vec<_>>();
    let set = keys.iter().find_map(|key| set_of(manifest, span, &path(key)));
    set.or_else(|| keys.first().map(|key| key_of(manifest, span, table, key))).unwrap_or_else(|| span.clone())
}

/// Place of the `--set` that states the value at `path` in the condition or comparison at `span`.
fn set_of(manifest: &Manifest, span: &Range<usize>, path: &[&str]) -> Option<Range<usize>> {
    let content = &manifest.content;
    let index = |list: &[Spanned<PassCondition>]| list.iter().position(|one| one.span() == *span);
    let compared = content.compare.iter().position(|one| one.span() == *span);
    let lists = [("pass", index(&content.pass)), ("measure", index(&content.measure)), ("compare", compared)];
    let (list, index) = lists.into_iter().find_map(|(list, index)| Some((list, index?)))?;
    manifest.sources.set_at(&format!("{list}.{index}.{}", path.join(".")))
}
