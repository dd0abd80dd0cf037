//! The command `components`.

use super::component_kind::{Kind, all, type_name};
use super::components_page::page;
use super::output::{print_file, print_json, print_text};
use anyhow::{Result, anyhow};
use bus::component::Transfer;
use bus::parameters::{DefaultValue, Parameter, dotted};
use bus::ports::{Inputs, PortSpec};
use clap::Args;
use diagnostics::did_you_mean;
use serde_json::{Value, json};

/// Arguments of `components`.
#[derive(Args)]
pub struct ComponentsArguments {
    /// Only this component, such as pid.
    component: Option<String>,
    /// Print JSON.
    #[arg(long)]
    json: bool,
}

/// Prints components with their ports, their parameters and the state that they hand over: all, or the one that is named.
///
/// # Errors
/// If there is no such component, or it cannot be printed.
pub fn components(arguments: &ComponentsArguments) -> Result<bool> {
    let chosen = arguments.component.as_deref().map(find).transpose()?;
    match (chosen, arguments.json) {
        (None, true) => print_json(&all().map(json).collect::<Vec<_>>())?,
        (Some(kind), true) => print_json(&[json(kind)])?,
        (None, false) => print_file(&page(all()))?,
        (Some(kind), false) => print_text(&plain(kind))?,
    }
    Ok(true)
}

fn find(name: &str) -> Result<Kind> {
    let unknown = || {
        anyhow!("there is no component {name}; {}", did_you_mean(name, all().map(Kind::name), "there are:"))
    };
    all().find(|kind| kind.name() == name).ok_or_else(unknown)
}

fn json(kind: Kind) -> Value {
    let ports = |ports: &[PortSpec]| -> Value { ports.iter().map(port_json).collect() };
    let (inputs, outputs) = match kind {
        Kind::Component(component) => {
            let inputs = match component.inputs {
                Inputs::Ports(declared) => ports(declared),
                Inputs::Many(schema) => json!({ "any_number_of": schema.type_name }),
                Inputs::Any => json!("any"),
                Inputs::Forwarded { bytes_max } => json!({ "forwarded_bytes_max": bytes_max }),
            };
            (inputs, ports(component.outputs))
        }
        Kind::Program(_) => (json!("of the manifest"), json!("of the manifest")),
    };
    json!({
        "name": kind.name(),
        "summary": kind.summary(),
        "inputs": inputs,
        "outputs": outputs,
        "parameters": dotted(kind.parameters()).into_iter().map(parameter_json).collect::<Value>(),
        "state": state_json(kind),
    })
}

fn state_json(kind: Kind) -> Value {
    let Kind::Component(component) = kind else { return json!("what it can save") };
    match component.transfer {
        Transfer::Message(schema) => json!(schema.type_name),
        Transfer::Bytes(type_name) => json!(type_name),
        Transfer::Nothing => json!("none"),
        Transfer::File => json!("file"),
        Transfer::External(program) => json!({ "external": program }),
        Transfer::Growing(type_name) => json!({ "growing": type_name }),
    }
}

fn port_json(port: &PortSpec) -> Value {
    json!({ "name": port.name, "message": port.schema.type_name, "required": port.required, "doc": port.doc })
}

fn parameter_json((key, parameter): (String, &Parameter)) -> Value {
    let default = match parameter.default {
        DefaultValue::Required => Value::Null,
        default => json!(default.text()),
    };
    json!({
        "name": key,
        "doc": parameter.doc,
        "unit": parameter.unit,
        "required": default.is_null(),
        "default": default,
        "range": (parameter.range)(),
    })
}

/// All about a kind, as plain text for a terminal.
fn plain(kind: Kind) -> String {
    let ports = |ports: &[PortSpec], others: &str| {
        let others = Some(others).filter(|text| !text.is_empty()).map(str::to_owned);
        indented(ports.iter().map(port).chain(others))
    };
    let parameters = dotted(kind.parameters()).into_iter().flat_map(plain_parameter);
    format!(
        "{}: {}\n\nreads\n{}\n\nsends\n{}\n\nparameters\n{}\n\nhands over\n  {}",
        kind.name(),
        kind.summary(),
        ports(kind.inputs(), &kind.other_inputs()),
        ports(kind.outputs(), kind.other_outputs()),
        indented(parameters),
        kind.state()
    )
    .replace('`', "")
}

/// A parameter with its unit, default and range, and its meaning below.
fn plain_parameter((key, parameter): (String, &Parameter)) -> [String; 2] {
    let unit = Some(parameter.unit).filter(|unit| !unit.is_empty()).map(|unit| format!("[{unit}]"));
    let default = match parameter.default {
        DefaultValue::Required => "required".to_owned(),
        default => format!("default {}", default.text()),
    };
    let range = Some((parameter.range)()).filter(|range| !range.is_empty());
    let facts: Vec<String> = unit.into_iter().chain([default]).collect();
    let range = range.map_or(String::new(), |range| format!("; {range}"));
    [format!("{key}  {}{range}", facts.join(" ")), format!("    {}", parameter.doc)]
}

/// Lines beneath a title; a dash for none.
fn indented(lines: impl Iterator<Item = String>) -> String {
    let lines: Vec<String> = lines.map(|line| format!("  {line}")).collect();
    if lines.is_empty() { "  –".to_owned() } else { lines.join("\n") }
}

fn port(port: &PortSpec) -> String {
    let text = format!("{}: {}", port.name, type_name(port.schema));
    if port.required { text } else { format!("({text})") }
}
