//! What is judged after the run: it will be recorded, and its fields and units exist.

use crate::judge;
use crate::manifest::{Comparison, Manifest, PassCondition};
use crate::problem::{Problem, nearest};
use crate::program::Program;
use bus::plan::{NodePlan, Plan};
use toml::Spanned;

/// Checks that what is evaluated after the run will be recorded, and that its fields and units exist.
pub fn check(manifest: &Manifest, plan: &Plan, programs: &[Program]) -> Result<(), Problem> {
    check_recorded(manifest, plan, programs)?;
    manifest.content.compare.iter().try_for_each(|compare| check_window(manifest, plan, compare))?;
    manifest.content.pass.iter().try_for_each(|pass| check_field(manifest, plan, pass))
}

/// How often the publisher of `topic` is set to a measured state, if it is a plant that is.
fn reset_window_s(plan: &Plan, topic: &str) -> Option<f64> {
    let publishes =
        |node: &&NodePlan| node.outputs.iter().any(|output| plan.topics[output.topic].name == topic);
    plan.nodes.iter().find(publishes)?.parameters.get("window_s")?.as_f64()
}

fn check_window(manifest: &Manifest, plan: &Plan, compare: &Spanned<Comparison>) -> Result<(), Problem> {
    let window_s = compare.get_ref().window_s;
    let duration_s = f64::from(plan.duration_ticks) * plan.tick_s();
    let limits = compare.get_ref();
    if [limits.max_position_m, limits.max_velocity_m_s, limits.max_attitude_deg] == [None; 3] {
        return Err(manifest.problem(
            &compare.span(),
            "the comparison has no limit, so it cannot fail",
            "add max_position_m, max_velocity_m_s or max_attitude_deg",
        ));
    }
    if let Some(set_s) = reset_window_s(plan, &limits.simulated).filter(|set_s| *set_s != window_s) {
        return Err(manifest.problem(
            &compare.span(),
            format!(
                "`window_s` is {window_s} s, but the plant behind {} is set every {set_s} s",
                limits.simulated
            ),
            "give both the same length",
        ));
    }
    // The last tick lies one tick before the end.
    if window_s > 0.0 && window_s <= duration_s - plan.tick_s() + 1e-9 {
        return Ok(());
    }
    Err(manifest.problem(
        &compare.span(),
        format!("`window_s` is {window_s} s: no window of that length ends within the run of {duration_s} s"),
        "choose a window shorter than run.duration_s",
    ))
}

fn check_field(manifest: &Manifest, plan: &Plan, pass: &Spanned<PassCondition>) -> Result<(), Problem> {
    let condition = pass.get_ref();
    let at = |message: String, help: &str| {
        manifest.problem(&pass.span(), format!("pass condition `{}`: {message}", condition.name), help)
    };
    if condition.min.is_none() && condition.max.is_none() {
        return Err(at("it has no limit, so it cannot fail".into(), "add `min`, `max`, or both"));
    }
    let unit = |topic: &str, field: &str| {
        unit_of(plan, topic, field).map_err(|error| at(error, "name one of these fields"))
    };
    let Some(own) = unit(&condition.topic, &condition.field)? else { return Ok(()) };
    judge::conversion(&own, &condition.unit)
        .map_err(|reason| at(reason, "state the limits in a unit of the field's quantity"))?;
    if let Some(minus) = &condition.minus
        && let Some(other) = unit(&minus.topic, &minus.field)?
        && other != own
    {
        return Err(at(format!("`minus` takes `{other}` off `{own}`"), "compare fields of one unit"));
    }
    if let Some(gate) = &condition.gate {
        unit(&gate.topic, &gate.field)?;
        if gate.min.is_none() && gate.max.is_none() {
            return Err(at("`while` has no limit".into(), "add `min`, `max`, or both to it"));
        }
    }
    Ok(())
}

/// The unit of a field; `None` for a user's own type, which only its publisher knows: it is checked when the run is
/// judged.
fn unit_of(plan: &Plan, topic: &str, field: &str) -> Result<Option<String>, String> {
    let type_name = plan.topics.iter().find(|known| known.name == topic).map(|topic| &topic.type_name);
    let known = bus::messages::all();
    let schema = known.into_iter().find(|schema| Some(schema.type_name) == type_name.map(String::as_str));
    let Some(schema) = schema else { return Ok(None) };
    recorder::series::unit_of(schema, topic, field).map_err(|error| error.to_string())
}

/// The topics that a condition reads.
fn judged_topics(pass: &PassCondition) -> Vec<&String> {
    let others = [pass.minus.as_ref().map(|minus| &minus.topic), pass.gate.as_ref().map(|gate| &gate.topic)];
    std::iter::once(&pass.topic).chain(others.into_iter().flatten()).collect()
}

fn check_recorded(manifest: &Manifest, plan: &Plan, programs: &[Program]) -> Result<(), Problem> {
    let content = &manifest.content;
    let passes = content.pass.iter().map(|pass| (pass.span(), judged_topics(pass.get_ref())));
    let compares = content
        .compare
        .iter()
        .map(|compare| (compare.span(), vec![&compare.get_ref().simulated, &compare.get_ref().measured]));
    for (span, topics) in passes.chain(compares) {
        for topic in topics {
            if !plan.topics.iter().any(|known| known.name == *topic) {
                let known: Vec<&str> = plan.topics.iter().map(|topic| topic.name.as_str()).collect();
                let list = format!("the topics are {}", known.join(", "));
                let help = nearest(topic, known).map_or(list, |near| format!("did you mean {near}?"));
                return Err(manifest.problem(&span, format!("nobody publishes {topic}"), help));
            }
            let recorders = plan.nodes.iter().zip(programs).filter(|(_, program)| program.is_recorder());
            let is_recorded = recorders
                .flat_map(|(node, _)| &node.inputs)
                .any(|input| plan.topics[input.topic].name == *topic);
            if !is_recorded {
                let help = "add a process with kind = \"recorder\" that takes it";
                return Err(manifest.problem(&span, format!("{topic} is judged but not recorded"), help));
            }
        }
    }
    Ok(())
}
