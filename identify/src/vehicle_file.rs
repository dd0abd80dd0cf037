//! The new vehicle file: the declared one with the effects that were accepted.

use crate::report::{Estimate, Report};
use diagnostics::Diagnostic;
use inputs::InputFiles;
use plant::effects::Effect;
use std::fmt::Write;
use std::path::Path;
use vehicles::{Uncertainty, Vehicle};

/// The text of the new vehicle file: the declared file at `declared` among `files`, complete, with `effects` in place of
/// its own. Parameters that were fitted carry their estimate, its interval and the flights that it comes from.
///
/// # Errors
/// If the declared file is not among `files` and cannot be read.
pub fn text(
    files: &InputFiles,
    declared: &Path,
    effects: &[Effect],
    report: &Report,
) -> Result<String, Diagnostic> {
    let vehicle = Vehicle::load_from(files, declared)?;
    let complete = Vehicle::base(files, declared).unwrap_or_else(|| declared.to_owned());
    let file = complete.display().to_string();
    let unreadable = |cause| Diagnostic::unreadable(&file, &cause);
    let text = files.text(&complete).map_err(unreadable)?;
    let mut document: toml_edit::DocumentMut =
        text.parse().map_err(|error| unreadable(std::io::Error::other(error)))?;
    if complete != declared {
        replace_tables(&mut document, &files.text(declared).map_err(unreadable)?);
    }
    document.remove("effects");
    document["name"] = toml_edit::value(format!("{}, identified", vehicle.name));
    let mut text = format!(
        "# Written by hummingbus identify. Up to the effects at its end this is the declared file {file}, with its comments.\n{document}"
    );
    for effect in effects {
        text += &entry(effect, &vehicle, report);
    }
    Ok(text)
}

/// Puts the tables of a file on a base, whose text is `upper`, in place of those of its base.
fn replace_tables(document: &mut toml_edit::DocumentMut, upper: &str) {
    // It has been read as a vehicle file, so it is TOML.
    let Ok(upper) = upper.parse::<toml_edit::DocumentMut>() else { return };
    for (key, item) in upper.iter().filter(|(_, item)| item.is_table() || item.is_array_of_tables()) {
        document[key] = item.clone();
    }
}

/// Where a value comes from that is nominal for a vehicle of this size, and not of the Hummingbird.
const SCALED: &str = "typical of a vehicle of this size (`scale_to` of the effect)";

#[allow(clippy::float_cmp, reason = "a value that was not touched is the same")]
fn entry(effect: &Effect, vehicle: &Vehicle, report: &Report) -> String {
    let name = effect.kind.name;
    let mut text = format!("\n[[effects]]\nname = {name:?}\n");
    let fitted = report.effects.get(name).filter(|effect| effect.accepted);
    let stated = vehicle.effects.iter().find(|effect| effect.name == name);
    for (index, spec) in effect.kind.parameters.iter().enumerate() {
        let value = effect.values[index];
        let estimate = fitted.and_then(|effect| effect.parameters.get(spec.name));
        let declared =
            stated.and_then(|effect| effect.parameters.iter().find(|effect| effect.name == spec.name));
        let line = match (estimate, declared) {
            (Some(estimate), _) => of_estimate(estimate, &source(report)),
            (None, Some(declared)) => {
                number(declared.value, &declared.unit, &declared.source, &said(&declared.uncertainty))
            }
            (None, None) if spec.neutral == Some(value) => continue,
            (None, None) => number(
                value,
                spec.unit(),
                if value == spec.nominal { spec.nominal_source } else { SCALED },
                "\"not identified: held while the others were fitted\"",
            ),
        };
        // Writing to a string cannot fail.
        let _ = writeln!(text, "{} = {line}", spec.name);
    }
    text
}

fn source(report: &Report) -> String {
    let of_role = |role| {
        let flights =
            report.flights.iter().filter(move |flight| flight.role == role && flight.compared_s > 0.0);
        flights.map(|flight| flight.name.as_str()).collect::<Vec<_>>().join(", ")
    };
    format!(
        "hummingbus identify: fitted on {}; accepted for its gain on {}",
        of_role(flights::Role::Fit),
        of_role(flights::Role::Test)
    )
}

fn of_estimate(estimate: &Estimate, source: &str) -> String {
    let doubt = match estimate {
        Estimate { determined: false, .. } => "not determined by these flights: ",
        Estimate { at_bound: true, .. } => "at its bound: ",
        _ => "",
    };
    let interval =
        format!("\"{doubt}95 % interval {:e} to {:e} {}\"", estimate.low, estimate.high, estimate.unit);
    number(estimate.value, estimate.unit, source, &interval)
}

fn number(value: f64, unit: &str, source: &str, uncertainty: &str) -> String {
    let source = toml_edit::value(source).to_string();
    format!(
        "{{ value = {value:?}, unit = {unit:?}, source = {}, uncertainty = {uncertainty} }}",
        source.trim()
    )
}

fn said(uncertainty: &Uncertainty) -> String {
    match uncertainty {
        Uncertainty::OneSigma(value) => format!("{value:?}"),
        Uncertainty::Said(text) => format!("{text:?}"),
    }
}
