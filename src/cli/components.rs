//! The command `components`.

use super::output::{print_file, print_json, print_text};
use super::parameter_text::parameter_lines;
use anyhow::{Result, anyhow};
use bus::Registration;
use bus::component::{Role, Transfer};
use bus::ports::{Inputs, PortSpec};
use bus::schema::Schema;
use clap::Args;
use diagnostics::did_you_mean;
use hummingbus::COMPONENTS;
use runtime::registry::NodeProgram;
use serde_json::{Value, json};

/// Text above the table.
const HEAD: &str = "# Components
What a node can be, as the components declare it themselves: `hummingbus components >docs/components.md` writes this page.
What the parameters mean is in [manifest.md](manifest.md#built-in-kinds); their names end with their units. What the messages
hold, `hummingbus schema` prints. A port in brackets may be left out. What a component hands over is its state, with which
another instance goes on ([hot-swap.md](hot-swap.md)).
";

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
    if let Some(program) = arguments.component.as_deref().and_then(|name| COMPONENTS.program(name)) {
        if arguments.json {
            print_json(&[program_json(program)])
        } else {
            print_text(&plain_program(program))
        }?;
        return Ok(true);
    }
    let chosen = arguments.component.as_deref().map(find).transpose()?;
    match (chosen, arguments.json) {
        (None, true) => print_json(&all_json())?,
        (Some(component), true) => print_json(&[json(component)])?,
        (None, false) => print_file(&format!("{HEAD}\n{}{}", table(COMPONENTS.iter()), programs()))?,
        (Some(component), false) => print_text(&plain(component))?,
    }
    Ok(true)
}

/// The kinds that are programs, as rows of the table.
fn programs() -> String {
    COMPONENTS.programs().iter().map(program_row).collect()
}

fn program_row(program: &NodeProgram) -> String {
    let NodeProgram { name, summary, parameters, .. } = program;
    let parameters = listed(parameters.iter().map(|name| format!("`{name}`")));
    let ports = "those of the manifest";
    format!(
        "| **`{name}`**: {summary}; a process of its own | {ports} | {ports} | {parameters} | what it can save |\n"
    )
}

/// All about a component, as plain text for a terminal.
fn plain(component: &Registration) -> String {
    let (reads, sends) = (inputs(component), outputs(component));
    let parts = [("reads", reads), ("sends", sends)];
    let parts = parts.map(|(title, ports)| format!("{title}\n{}", indented(&ports)));
    let parameters = indented(&parameter_lines(component.name, parameters(component)));
    let Registration { name, summary, .. } = component;
    let state = state(component);
    format!(
        "{name}: {summary}\n\n{}\n\nparameters\n{parameters}\n\nhands over\n  {state}",
        parts.join("\n\n")
    )
    .replace('`', "")
}

fn plain_program(program: &NodeProgram) -> String {
    let NodeProgram { name, summary, parameters, .. } = program;
    let parameters = indented(&parameter_lines(name, parameters));
    format!(
        "{name}: {summary}; a process of its own\n\nreads and sends\n  the ports that the manifest names\n\nparameters\n{parameters}"
    )
}

/// Lines beneath a title; a dash for none.
fn indented(lines: &[String]) -> String {
    match lines {
        [] => "  –".to_owned(),
        lines => lines.iter().map(|line| format!("  {line}")).collect::<Vec<_>>().join("\n"),
    }
}

/// Every kind, as JSON.
fn all_json() -> Vec<Value> {
    COMPONENTS.iter().map(json).chain(COMPONENTS.programs().iter().map(program_json)).collect()
}

fn program_json(program: &NodeProgram) -> Value {
    json!({
        "name": program.name,
        "summary": program.summary,
        "inputs": "of the manifest",
        "outputs": "of the manifest",
        "parameters": program.parameters,
        "state": "what it can save",
    })
}

fn find(name: &str) -> Result<&'static Registration> {
    COMPONENTS.find(name).ok_or_else(|| {
        anyhow!("there is no component {name}; {}", did_you_mean(name, COMPONENTS.kinds(), "there are:"))
    })
}

fn table(components: impl Iterator<Item = &'static Registration>) -> String {
    let rows: String = components.map(row).collect();
    format!("| component | reads | sends | parameters | hands over |\n|---|---|---|---|---|\n{rows}")
}

fn row(component: &Registration) -> String {
    let Registration { name, summary, .. } = component;
    let (inputs, outputs) = (listed(inputs(component).into_iter()), listed(outputs(component).into_iter()));
    let parameters = listed(parameters(component).iter().map(|name| format!("`{name}`")));
    let state = state(component);
    format!("| **`{name}`**: {summary} | {inputs} | {outputs} | {parameters} | {state} |\n")
}

/// The inputs, each in words.
fn inputs(component: &Registration) -> Vec<String> {
    match component.inputs {
        Inputs::Ports(ports) => ports.iter().map(port).collect(),
        Inputs::Many(schema) => vec![format!("any number of {}", type_name(schema))],
        Inputs::Any => vec!["any topics".to_owned()],
        Inputs::Forwarded { bytes_max } => vec![format!("any topics of at most {bytes_max} bytes")],
    }
}

/// The outputs, each in words.
fn outputs(component: &Registration) -> Vec<String> {
    let forwarded = matches!(component.inputs, Inputs::Forwarded { .. });
    let forwarded = forwarded.then(|| "each input's topic".to_owned());
    component.outputs.iter().map(port).chain(forwarded).collect()
}

/// The state that it hands over, in words.
fn state(component: &Registration) -> &'static str {
    match component.transfer {
        Transfer::Message(schema) => type_name(schema),
        Transfer::Bytes(type_name) => short(type_name),
        Transfer::Nothing => "–",
        Transfer::File | Transfer::Growing(_) => "cannot be replaced",
        Transfer::External(_) => "cannot be saved",
    }
}

fn json(component: &Registration) -> Value {
    let ports = |ports: &[PortSpec]| -> Vec<Value> { ports.iter().map(port_json).collect() };
    let inputs = match component.inputs {
        Inputs::Ports(declared) => json!(ports(declared)),
        Inputs::Many(schema) => json!({ "any_number_of": schema.type_name }),
        Inputs::Any => json!("any"),
        Inputs::Forwarded { bytes_max } => json!({ "forwarded_bytes_max": bytes_max }),
    };
    let state = match component.transfer {
        Transfer::Message(schema) => json!(schema.type_name),
        Transfer::Bytes(type_name) => json!(type_name),
        Transfer::Nothing => json!("none"),
        Transfer::File => json!("file"),
        Transfer::External(program) => json!({ "external": program }),
        Transfer::Growing(type_name) => json!({ "growing": type_name }),
    };
    json!({
        "name": component.name,
        "summary": component.summary,
        "inputs": inputs,
        "outputs": ports(component.outputs),
        "parameters": parameters(component),
        "state": state,
    })
}

/// Parameters in a manifest: recorders and judges are given theirs by the launcher.
fn parameters(component: &Registration) -> &'static [&'static str] {
    match component.role {
        Role::Compute => component.parameters(),
        Role::Record | Role::Judge => &[],
    }
}

fn port_json(port: &PortSpec) -> Value {
    json!({ "name": port.name, "message": port.schema.type_name, "required": port.required, "doc": port.doc })
}

fn port(port: &PortSpec) -> String {
    let text = format!("`{}`: {}", port.name, type_name(port.schema));
    if port.required { text } else { format!("({text})") }
}

/// A message's name without its package.
fn type_name(schema: &Schema) -> &'static str {
    short(schema.type_name)
}

/// The name of a type without its package.
fn short(type_name: &'static str) -> &'static str {
    type_name.rsplit('/').next().unwrap_or(type_name)
}

fn listed(items: impl Iterator<Item = String>) -> String {
    let text = items.collect::<Vec<_>>().join("<br>");
    if text.is_empty() { "–".to_owned() } else { text }
}
