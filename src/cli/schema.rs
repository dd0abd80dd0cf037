//! The command `schema`.

use super::output::{print_json, print_text};
use anyhow::Result;
use bus::announcement::Announcement;
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
    if arguments.json {
        print_json(&COMPONENTS.messages().into_iter().map(Announcement::of).collect::<Vec<_>>())?;
    } else {
        print_text(&schemas())?;
    }
    Ok(true)
}

/// Every message with its fields, units, frames and layout hash.
fn schemas() -> String {
    COMPONENTS.messages().into_iter().fold(String::new(), |mut text, schema| {
        let _ = write!(text, "{}  layout {:016x}\n  {}\n", schema.layout(), schema.layout_hash(), schema.doc);
        text.push('\n');
        text
    })
}
