//! The command `check`.

use super::files::require_kind;
use super::kind::Kind;
use super::output::{print_json, print_text, print_warnings};
use anyhow::Result;
use clap::Args;
use std::path::PathBuf;

/// Arguments of `check`.
#[derive(Args)]
pub struct CheckArguments {
    /// The manifest.
    manifest: PathBuf,
    /// Override a key of the manifest.
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<String>,
    /// Nodes that share a process: none, all, vehicles, or groups such as plant+imu,ekf+controller.
    #[arg(long, value_name = "GROUPS")]
    compose: Option<String>,
    /// Start no program that the manifest names as a `command`: their ports are not compared.
    #[arg(long)]
    no_programs: bool,
    /// Print the graph as JSON.
    #[arg(long)]
    json: bool,
}

/// Checks a manifest and prints its graph.
///
/// # Errors
/// The faults of the manifest.
pub fn check(arguments: &CheckArguments) -> Result<bool> {
    let CheckArguments { manifest, compose, .. } = arguments;
    let compose = compose.iter().map(|groups| format!("run.compose={groups}"));
    let set: Vec<String> = arguments.set.iter().cloned().chain(compose).collect();
    require_kind(manifest, &[Kind::Manifest], "")?;
    let checked = if arguments.no_programs {
        hummingbus::check(manifest, &set)?
    } else {
        hummingbus::check_with_programs(manifest, &set)?
    };
    print_warnings(&checked.warnings);
    if arguments.json {
        print_json(&checked.json())?;
    } else {
        let graph = checked.to_string().trim_end().to_owned();
        let lines: Vec<String> = std::iter::once(graph)
            .chain(hummingbus::meshes(&checked))
            .chain(hummingbus::drives(&checked))
            .collect();
        print_text(&lines.join("\n"))?;
    }
    Ok(true)
}
