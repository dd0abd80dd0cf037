//! Marks on the axis of time: swaps, faults and pass conditions of the manifest that a recording has attached.

use report::attached::Attached;
use serde_json::{Value, json};
use toml::Table;

/// Repetitions of one swap that are marked: more would hide the curves.
const REPEATS_MAX: i64 = 200;

/// Spans and places on the axis of time, in seconds of simulated time, with their texts.
pub fn marks(attached: &Attached, tick_s: Option<f64>) -> Vec<Value> {
    let swaps = attached.list("swap").into_iter().flat_map(|swap| swaps(swap, tick_s)).collect::<Vec<_>>();
    let conditions = attached.list("pass").into_iter().map(condition);
    let processes = attached.processes();
    let faults = processes.iter().flat_map(|(name, process)| faults(name, process));
    swaps.into_iter().chain(conditions).chain(faults).collect()
}

/// Faults that a process declares. They hold for the whole flight.
fn faults(name: &str, process: &Table) -> Vec<Value> {
    let number = |key: &str| {
        let value = process.get("parameters")?.get(key)?;
        value.as_float().or_else(|| Some(value.as_integer()? as f64)).filter(|number| *number > 0.0)
    };
    let percent = |part: f64| format!("{} %", (part * 1e4).round() / 1e2);
    let mean = number("dropout_mean_s").map_or_else(String::new, |mean_s| format!(", {mean_s} s at a time"));
    let texts = [
        number("dropout").map(|part| format!("loses {} of its measurements{mean}", percent(part))),
        number("loss").map(|part| format!("loses {} of its messages", percent(part))),
        number("stuck_rotor").map(|rotor| format!("rotor {rotor} reads its first speed for ever")),
        number("half_reading_rotor").map(|rotor| format!("rotor {rotor} reads half of its speed")),
    ];
    let mark =
        |text: String| json!({ "kind": "fault", "from_s": 0.0, "text": format!("fault of {name}: {text}") });
    texts.into_iter().flatten().map(mark).collect()
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

#[cfg(test)]
mod tests {
    use super::faults;

    #[test]
    fn faults_of_a_process_have_a_text_each() {
        let process = |text: &str| text.parse::<toml::Table>().unwrap();
        let texts = |text: &str| {
            let marks = faults("h1/sensor", &process(text));
            marks.iter().map(|mark| mark["text"].as_str().unwrap().to_owned()).collect::<Vec<_>>()
        };
        assert_eq!(
            texts("kind = 'mocap'\nparameters = { dropout = 0.05, dropout_mean_s = 0.1, noise = 1 }"),
            ["fault of h1/sensor: loses 5 % of its measurements, 0.1 s at a time"]
        );
        assert_eq!(
            texts(
                "parameters.dropout = 0.125\nparameters.stuck_rotor = 3\nparameters.half_reading_rotor = 1"
            ),
            [
                "fault of h1/sensor: loses 12.5 % of its measurements",
                "fault of h1/sensor: rotor 3 reads its first speed for ever",
                "fault of h1/sensor: rotor 1 reads half of its speed",
            ]
        );
        assert_eq!(texts("parameters.loss = 0.2"), ["fault of h1/sensor: loses 20 % of its messages"]);
        assert!(texts("kind = 'rpm'\nparameters = { dropout = 0.0, stuck_rotor = 0 }").is_empty());
        assert!(texts("kind = 'plant'").is_empty());
    }
}
