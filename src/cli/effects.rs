//! The command `effects`.

use super::output::{print_file, print_json, print_text};
use anyhow::{Result, anyhow};
use clap::Args;
use diagnostics::did_you_mean;
use plant::effects::{CATALOGUE, EffectKind, ParameterSpec, find, page};
use serde_json::{Value, json};

/// Arguments of `effects`.
#[derive(Args)]
pub struct EffectsArguments {
    /// Only this effect, such as rotor-drag: its equation, source, range of validity and parameters.
    effect: Option<String>,
    /// Print JSON.
    #[arg(long)]
    json: bool,
    /// Print the page of all effects, docs/effects.md.
    #[arg(long, conflicts_with_all = ["json", "effect"])]
    markdown: bool,
}

/// Prints the effects that vehicle and scene files may list: their names, or all about one.
///
/// # Errors
/// If there is no such effect, or it cannot be printed.
pub fn effects(arguments: &EffectsArguments) -> Result<bool> {
    let chosen = arguments.effect.as_deref().map(named).transpose()?;
    match chosen {
        _ if arguments.markdown => print_file(&page::markdown())?,
        Some(kind) if arguments.json => print_json(&[json(kind)])?,
        Some(kind) => print_text(page::plain(kind).trim_end())?,
        None if arguments.json => print_json(&CATALOGUE.iter().map(|kind| json(kind)).collect::<Vec<_>>())?,
        None => print_text(&list())?,
    }
    Ok(true)
}

fn named(name: &str) -> Result<&'static EffectKind> {
    let names = CATALOGUE.iter().map(|kind| kind.name);
    find(name)
        .ok_or_else(|| anyhow!("unknown effect `{name}`; {}", did_you_mean(name, names, "the effects are")))
}

/// A line for each effect.
fn list() -> String {
    let width = CATALOGUE.iter().map(|kind| kind.name.len()).max().unwrap_or_default();
    let lines = CATALOGUE.iter().map(|kind| format!("{:width$}  {}\n", kind.name, kind.summary));
    lines.chain(["`hummingbus effects NAME` prints one effect in full.".to_owned()]).collect()
}

fn json(kind: &EffectKind) -> Value {
    json!({
        "name": kind.name,
        "summary": kind.summary,
        "equation": kind.equation,
        "source": kind.source,
        "validity": kind.validity,
        "needs": kind.needs.iter().map(|need| need.describe()).collect::<Vec<_>>(),
        "parameters": kind.parameters.iter().map(parameter_json).collect::<Vec<_>>(),
    })
}

fn parameter_json(spec: &ParameterSpec) -> Value {
    let units: Vec<_> = spec.dimension.units.iter().map(|(unit, _)| unit).collect();
    json!({
        "name": spec.name,
        "meaning": spec.meaning,
        "units": units,
        "min": spec.min,
        "max": spec.max,
        "neutral": spec.neutral,
        "nominal": spec.nominal,
        "nominal_source": spec.nominal_source,
    })
}
