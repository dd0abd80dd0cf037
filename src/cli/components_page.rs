//! The page docs/components.md: the reference of every kind, from what the components declare.

use super::component_kind::{Kind, type_name};
use bus::parameters::{DefaultValue, Parameter, dotted};
use bus::ports::PortSpec;
use std::fmt::Write as _;

/// Text above the sections.
const HEAD: &str = "# Components
This page is the reference of the kinds that a process of a manifest can have (`kind = \"imu\"`): inputs, outputs, parameters and an example of each. The
components declare it themselves: `hummingbus components >docs/components.md` writes the page, `hummingbus components imu` prints a part of it in the
terminal, and `hummingbus schema` prints the fields of the messages and of the states.

- An input or output in brackets may be left out. The topics in the examples are those of processes that are named like their kinds.
- A parameter whose default is *required* has to be given. Lists of numbers are along x, y, z of the axes that the meaning names.
- *State* is what another instance goes on with, in a [swap](hot-swap.md) and from a [checkpoint](checkpoints.md).
- Numbers beyond the range of the unit at the end of the key are refused for all kinds:
  [limits](manifest-reference.md#what-cannot-fly-and-what-is-odd).
";

/// Pages that explain kinds, by the kinds.
const EXPLAINED: [(&str, &[&str]); 4] = [
    (
        "sensors.md",
        &[
            "imu",
            "gps",
            "barometer",
            "magnetometer",
            "mocap",
            "range",
            "battery",
            "rpm",
            "attitude",
            "ideal",
            "ekf",
            "range-inertial",
        ],
    ),
    (
        "laws.md",
        &[
            "pid",
            "cascade",
            "velocity",
            "wall-stop",
            "wall-stop-thesis",
            "wall-follow",
            "wall-follow-thesis",
            "position-hold",
            "lqr",
            "geometric",
        ],
    ),
    ("set-points.md", &["pilot", "operator", "trajectory", "rc", "remote-control"]),
    ("plant.md", &["plant", "clearance", "player", "propeller-stand", "traffic", "link"]),
];

/// Inputs in examples, by message.
const TOPICS: [(&str, &str); 13] = [
    ("PlantState", "\"/plant/state\""),
    (
        "MotorCommand",
        "{ topic = \"/pid/command\", delay_ticks = 1, initial = { command = [76.5, 76.5, 76.5, 76.5] } }",
    ),
    ("Imu", "\"/imu/imu\""),
    ("StateEstimate", "\"/ekf/estimate\""),
    ("AttitudeEstimate", "\"/attitude/estimate\""),
    ("SetPoint", "\"/pilot/set_point\""),
    ("Reference", "\"/trajectory/reference\""),
    ("WallEstimate", "\"/range-inertial/walls\""),
    ("Ranges", "\"/range/ranges\""),
    ("Battery", "\"/plant/battery\""),
    ("RcChannels", "\"/remote-control/rc\""),
    ("Gps", "\"/gps/gps\""),
    ("Mocap", "\"/mocap/mocap\""),
];

/// Files in examples, by parameter.
const FILES: [(&str, &str); 5] = [
    ("vehicle", "\"../vehicles/hummingbird.toml\""),
    ("scene", "\"../scenes/room.toml\""),
    ("data", "\"flight.csv\""),
    ("firmware", "\"${FIRMWARE}\""),
    ("fmu", "\"controller.fmu\""),
];

/// Names of kinds whose example says more than a declaration knows.
const EXAMPLES: [(&str, &str); 4] = [
    ("ekf", "inputs.mocap = \"/mocap/mocap\"\n"),
    ("traffic", "inputs = { h1 = \"/h1/plant/state\", h2 = \"/h2/plant/state\" }\n"),
    (
        "link",
        "inputs.set_point = { topic = \"/pilot/set_point\", delay_ticks = 1, initial = { altitude = 1.0 } }\n",
    ),
    ("velocity", "parameters.altitude_m = 1.0\n"),
];

/// The page.
pub(crate) fn page(kinds: impl Iterator<Item = Kind>) -> String {
    let kinds: Vec<Kind> = kinds.collect();
    let rows: String = kinds.iter().map(|kind| index_row(*kind)).collect();
    let sections: String = kinds.iter().map(|kind| section(*kind)).collect();
    format!("{HEAD}\n| kind | purpose |\n|---|---|\n{rows}{sections}")
}

fn index_row(kind: Kind) -> String {
    let name = kind.name();
    format!("| [`{name}`](#{name}) | {} |\n", kind.summary())
}

fn section(kind: Kind) -> String {
    let name = kind.name();
    let mut text = format!("\n## `{name}`\n{}.", capitalized(&kind.summary()));
    if let Some((page, _)) = EXPLAINED.iter().find(|(_, kinds)| kinds.contains(&name)) {
        let _ = write!(text, " [Explanation]({page}#{name}).");
    } else if ["ardupilot", "betaflight", "px4"].contains(&name) {
        text += " [Explanation](firmware.md).";
    } else if name == "fmu" {
        text += " [Explanation](fmu.md).";
    }
    text += "\n";
    if name != "judge" {
        let _ = write!(text, "\n```toml\n{}```\n", example(kind));
    }
    text += "\n| | port | message | meaning |\n|---|---|---|---|\n";
    text += &ports("input", kind.inputs(), &kind.other_inputs());
    text += &ports("output", kind.outputs(), kind.other_outputs());
    let parameters = dotted(kind.parameters());
    if !parameters.is_empty() {
        text += "\n| parameter | meaning | unit | default | values |\n|---|---|---|---|---|\n";
        parameters.iter().for_each(|(key, parameter)| text += &parameter_row(key, parameter));
    }
    let _ = write!(text, "\nState: {}\n", state(kind));
    text
}

fn state(kind: Kind) -> String {
    match kind.state() {
        "–" => "none.".to_owned(),
        words if words.contains(' ') => format!("{words}."),
        name => format!("`{name}`."),
    }
}

/// A process of the kind, as a manifest may have it.
fn example(kind: Kind) -> String {
    let name = kind.name();
    let mut text = format!("[process.{name}]\nkind = \"{name}\"\n");
    for port in kind.inputs().iter().filter(|port| port.required) {
        let message = type_name(port.schema);
        let topic = TOPICS.iter().find(|(of, _)| *of == message).map_or("\"/…\"", |(_, topic)| topic);
        let _ = writeln!(text, "inputs.{} = {topic}", port.name);
    }
    for parameter in kind.parameters() {
        let file = FILES.iter().find(|(of, _)| *of == parameter.name && is_needed(parameter));
        if let Some((key, file)) = file {
            let _ = writeln!(text, "{key} = {file}");
        } else if !parameter.example.is_empty() {
            let _ = writeln!(text, "parameters.{} = {}", parameter.name, parameter.example);
        }
    }
    if let Some((_, more)) = EXAMPLES.iter().find(|(of, _)| *of == name) {
        text += more;
    }
    text
}

/// True if a manifest has to give the parameter.
fn is_needed(parameter: &Parameter) -> bool {
    matches!(parameter.default, DefaultValue::Required | DefaultValue::Text("required"))
}

fn ports(side: &str, ports: &[PortSpec], others: &str) -> String {
    let mut rows = String::new();
    for port in ports {
        let name = if port.required { format!("`{}`", port.name) } else { format!("(`{}`)", port.name) };
        let _ = writeln!(rows, "| {side} | {name} | {} | {} |", type_name(port.schema), cell(port.doc));
    }
    if !others.is_empty() {
        let _ = writeln!(rows, "| {side} | {others} | | |");
    }
    rows
}

fn parameter_row(key: &str, parameter: &Parameter) -> String {
    let default = match parameter.default {
        DefaultValue::Required => "required".to_owned(),
        DefaultValue::Text(text) => text.to_owned(),
        DefaultValue::Value(text) => format!("`{}`", text()),
    };
    let (doc, range) = (cell(parameter.doc), cell(&(parameter.range)()));
    format!("| `{key}` | {doc} | {} | {} | {range} |\n", parameter.unit, cell(&default))
}

/// Text of a table's cell, without the full stop at its end.
fn cell(text: &str) -> String {
    text.strip_suffix('.').unwrap_or(text).replace('|', "\\|")
}

fn capitalized(text: &str) -> String {
    let mut letters = text.chars();
    letters.next().map_or(String::new(), |first| first.to_uppercase().chain(letters).collect())
}

#[cfg(test)]
mod tests {
    use super::{EXPLAINED, example, is_needed};
    use crate::cli::component_kind::all;
    use bus::parameters::{Parameter, dotted};

    #[test]
    fn every_parameter_is_documented() {
        for kind in all() {
            for (key, parameter) in dotted(kind.parameters()) {
                assert!(parameter.doc.ends_with('.'), "{}: {key}", kind.name());
            }
        }
    }

    #[test]
    fn every_kind_that_needs_it_is_explained_somewhere() {
        let explained: Vec<&str> = EXPLAINED.iter().flat_map(|(_, kinds)| *kinds).copied().collect();
        let elsewhere = ["ardupilot", "betaflight", "px4", "fmu", "judge", "recorder"];
        for kind in all() {
            let count = explained.iter().chain(&elsewhere).filter(|name| **name == kind.name()).count();
            assert_eq!(count, 1, "{}", kind.name());
        }
    }

    #[test]
    fn examples_have_every_input_and_parameter_that_is_needed() {
        for kind in all().filter(|kind| kind.name() != "judge") {
            let text = example(kind);
            assert!(!text.contains('…'), "{text}");
            let table: toml::Table = toml::from_str(&text).unwrap_or_else(|error| panic!("{error}\n{text}"));
            let process = &table["process"][kind.name()];
            let is_given = |parameter: &Parameter| {
                process
                    .get(parameter.name)
                    .or(process.get("parameters").and_then(|all| all.get(parameter.name)))
            };
            for parameter in kind.parameters().iter().filter(|parameter| is_needed(parameter)) {
                assert!(is_given(parameter).is_some(), "{text} lacks {}", parameter.name);
            }
        }
    }
}
