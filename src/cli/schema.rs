//! The command `schema`.

use super::output::{print_json, print_text};
use super::schema_code::{self, Language};
use anyhow::{Result, bail};
use bus::Registration;
use bus::announcement::Announcement;
use bus::component::Transfer;
use bus::schema::Schema;
use clap::Args;
use diagnostics::did_you_mean;
use hummingbus::COMPONENTS;
use serde_json::Value;
use std::fmt::Write as _;

/// Arguments of `schema`.
#[derive(Args)]
pub struct SchemaArguments {
    /// Only this message or state, such as PlantState or ControllerState.
    message: Option<String>,
    /// Print JSON, with the ROS 2 definitions. Hashes of layouts are strings of hexadecimal digits.
    #[arg(long)]
    json: bool,
    /// Print structs for C, and the tables by which a program declares them.
    #[arg(long, conflicts_with = "json")]
    c: bool,
    /// The same for C++.
    #[arg(long, conflicts_with_all = ["json", "c"])]
    cpp: bool,
}

/// Prints the messages that components' ports carry and the states that components hand over: all, or the one that is named.
///
/// # Errors
/// If there is no such message, or it cannot be printed.
pub fn schema(arguments: &SchemaArguments) -> Result<bool> {
    let schemas = chosen(arguments.message.as_deref())?;
    if let Some(language) = arguments.language() {
        print_text(&schema_code::header(&schemas, language))?;
    } else if arguments.json {
        print_json(&schemas.into_iter().map(announced).collect::<Result<Vec<_>>>()?)?;
    } else {
        print_text(&text(&schemas))?;
    }
    Ok(true)
}

impl SchemaArguments {
    fn language(&self) -> Option<Language> {
        let languages = [(self.c, Language::C), (self.cpp, Language::Cpp)];
        languages.into_iter().find(|(is_asked, _)| *is_asked).map(|(_, language)| language)
    }
}

/// The messages and states whose name, with or without its package, is `name`. Messages come first.
fn chosen(name: Option<&str>) -> Result<Vec<&'static Schema>> {
    let mut schemas = COMPONENTS.messages();
    let is_new = |state: &&'static Schema| schemas.iter().all(|schema| schema.type_name != state.type_name);
    let states: Vec<_> = COMPONENTS.states().into_iter().filter(is_new).collect();
    schemas.extend(states);
    let Some(name) = name else { return Ok(schemas) };
    let names = distinct_names(&schemas);
    schemas.retain(|schema| schema.type_name == name || short(schema) == name);
    if schemas.is_empty() {
        let written = name.rsplit('/').next().unwrap_or(name);
        let help = did_you_mean(written, names.iter().copied(), "there are:");
        bail!("no component has a port or a state of type {name}; {help}");
    }
    Ok(schemas)
}

/// The names of messages: without their packages, but for those that only their packages distinguish.
fn distinct_names(schemas: &[&'static Schema]) -> Vec<&'static str> {
    let is_alone = |name: &str| schemas.iter().filter(|other| short(other) == name).count() == 1;
    let name = |schema: &&'static Schema| {
        let name = short(schema);
        if is_alone(name) { name } else { schema.type_name }
    };
    schemas.iter().map(name).collect()
}

/// A message's name without its package.
fn short(schema: &Schema) -> &'static str {
    schema.type_name.rsplit('/').next().unwrap_or(schema.type_name)
}

/// Names of the components whose state `schema` is.
fn components_with_state(schema: &Schema) -> Vec<&'static str> {
    let components = COMPONENTS.iter().filter(|component| hands_over(component, schema));
    components.map(|component| component.name).collect()
}

/// True if the state of `component` is `schema`.
fn hands_over(component: &Registration, schema: &Schema) -> bool {
    matches!(component.transfer, Transfer::Message(state) if state.type_name == schema.type_name)
}

/// A message as JSON. Many readers of JSON round integers beyond 53 bits, so that the hash is a string.
fn announced(schema: &Schema) -> Result<Value> {
    let mut value = serde_json::to_value(Announcement::of(schema))?;
    value["layout_hash"] = format!("{:016x}", schema.layout_hash()).into();
    value["state_of"] = components_with_state(schema).into();
    Ok(value)
}

/// The messages and states with their fields, units, frames and layout hashes.
fn text(schemas: &[&Schema]) -> String {
    schemas.iter().fold(String::new(), |mut text, schema| {
        let _ = write!(text, "{}  layout {:016x}\n  {}\n", schema.layout(), schema.layout_hash(), schema.doc);
        let components = components_with_state(schema);
        if !components.is_empty() {
            let _ = writeln!(text, "  Handed over at a swap by {}.", components.join(", "));
        }
        text.push('\n');
        text
    })
}
