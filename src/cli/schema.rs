//! The command `schema`.

use super::output::print_text;
use anyhow::Result;
use clap::Args;
use hummingbus::COMPONENTS;
use std::fmt::Write as _;

/// What `schema` takes.
#[derive(Args)]
pub struct SchemaArguments {
    /// Print JSON, with the ROS 2 definitions.
    #[arg(long)]
    json: bool,
}

/// Prints every message that a component's port carries.
///
/// # Errors
/// If it cannot be printed.
pub fn schema(arguments: &SchemaArguments) -> Result<bool> {
    print_text(&if arguments.json { schemas_json() } else { schemas() }).map(|()| true)
}

/// Every message with its fields, units, frames and layout hash.
fn schemas() -> String {
    COMPONENTS.messages().into_iter().fold(String::new(), |mut text, schema| {
        let _ = write!(text, "{}  layout {:016x}\n  {}\n", schema.layout(), schema.layout_hash(), schema.doc);
        text.push('\n');
        text
    })
}

/// The same as JSON, with the ROS 2 definitions.
fn schemas_json() -> String {
    let schemas: Vec<_> =
        COMPONENTS.messages().into_iter().map(bus::announcement::Announcement::of).collect();
    serde_json::to_string_pretty(&schemas).unwrap_or_default()
}
