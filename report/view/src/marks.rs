//! Marks on the axis of time: swaps and pass conditions of the manifest that a recording has attached.

use report::attached::Attached;
use serde_json::{Value, json};
use toml::Table;

/// Repetitions of one swap that are marked: more would hide the curves.
const REPEATS_MAX: i64 = 200;

/// Spans and places on the axis of time, in seconds of simulated time, with their texts.
pub fn marks(attached: &Attached, tick_s: Option<f64>) -> Vec<Value> {
    let swaps = attached.list("swap").into_iter().flat_map(|swap| swaps(swap, tick_s)).collect::<Vec<_>>();
    swaps.into_iter().chain(attached.list("pass").into_iter().map(condition)).collect()
}

fn swaps(swap: &Table, tick_s: Option<f64>) -> Vec<Value> {
    let number = |key: &str| swap.get(key).and_then(toml::Value::as_integer);
    let stated_s = swap.get("at_s").and_then(|at| at.as_float().or_else(|| Some(at.as_integer()? as f64)));
    let Some(tick_s) = tick_s else { return Vec::new() };
    let Some(first_s) = stated_s.or_else(|| Some(number("at_tick")? as f64 * tick_s)) else {
        return Vec::new();
    };
    let process = swap.get("process").and_then(toml::Value::as_str).unwrap_or_default();
    let times = number("repeat").unwrap_or(1).clamp(1, REPEATS_MAX);
    let every = number("every_ticks").unwrap_or(0);
    let at = |repeat: i64| first_s + every as f64 * repeat as f64 * tick_s;
    let mark =
        |repeat: i64| json!({ "kind": "swap", "from_s": at(repeat), "text": format!("swap of {process}") });
    (0..times).map(mark).collect()
}

/// A pass condition: its limits belong to the curve of its field.
fn condition(pass: &Table) -> Value {
    let text = |key: &str| pass.get(key).and_then(toml::Value::as_str).unwrap_or_default();
    let number = |key: &str| {
        let value = pass.get(key)?;
        value.as_float().or_else(|| Some(value.as_integer()? as f64)).filter(|number| number.is_finite())
    };
    json!({
        "kind": "pass",
        "text": text("name"),
        "topic": text("topic"),
        "field": text("field"),
        "unit": text("unit"),
        "statistic": text("statistic"),
        "from_s": number("from_s").unwrap_or(0.0),
        "to_s": number("to_s"),
        "min": number("min"),
        "max": number("max"),
    })
}
