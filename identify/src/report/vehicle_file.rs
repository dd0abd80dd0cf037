//! The new vehicle file: the declared one with the effects that were accepted.

use crate::numbers::digits::{quantity, rounded, to_known_digits};
use crate::report::envelope::Reached;
use crate::report::results::{Estimate, Report};
use diagnostics::Diagnostic;
use inputs::InputFiles;
use plant::effects::Effect;
use std::path::Path;
use toml_edit::{ArrayOfTables, DocumentMut, InlineTable, Item, Table, Value, value};
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
    let mut document: DocumentMut = text.parse().map_err(|error| unreadable(std::io::Error::other(error)))?;
    if complete != declared {
        replace_tables(&mut document, &files.text(declared).map_err(unreadable)?);
    }
    document.remove("effects");
    document.remove("envelope");
    document["name"] = value(format!("{}, identified", vehicle.name));
    let mut tables = ArrayOfTables::new();
    effects.iter().for_each(|effect| tables.push(table(effect, &vehicle, report)));
    let mut added = DocumentMut::new();
    if report.has_validated() {
        added["envelope"] = Item::Table(envelope(report));
    }
    added["effects"] = Item::ArrayOfTables(tables);
    // A comment holds no control character.
    let file = diagnostics::printable_line(&file);
    let doubt = if report.stopped {
        "# The search was stopped before its end: effects may be missing or wrong.\n"
    } else if report.losses.is_empty() {
        ""
    } else {
        "# It does not describe these flights: its predictions lose to persistence or to the declared file (`losses` in report.json).\n"
    };
    let kept: String = if report.prediction_only.is_empty() {
        String::new()
    } else {
        format!(
            "# For predictions only, not properties of the vehicle: {}.\n",
            report.prediction_only.join(", ")
        )
    };
    Ok(format!(
        "# Written by hummingbus identify. Up to the effects at its end this is the declared file {file}, with its \
         comments.\n{doubt}{kept}{document}\n{added}"
    ))
}

/// Puts the tables of a file on a base, whose text is `upper`, in place of those of its base.
fn replace_tables(document: &mut DocumentMut, upper: &str) {
    // It has been read as a vehicle file, so it is TOML.
    let Ok(upper) = upper.parse::<DocumentMut>() else { return };
    for (key, item) in upper.iter().filter(|(_, item)| item.is_table() || item.is_array_of_tables()) {
        document[key] = item.clone();
    }
}

/// The ranges of the test flights.
fn envelope(report: &Report) -> Table {
    let tests =
        report.flights.iter().filter(|flight| flight.role == flights::Role::Test && flight.compared_s > 0.0);
    let names = tests.map(|flight| flight.name.as_str()).collect::<Vec<_>>().join(", ");
    let mut table = Table::new();
    for (key, Reached { value, unit }) in &report.envelope {
        let said = if *key == "frequency_max" {
            "one cycle in the widest window of the comparison"
        } else {
            "within it 99 % of the time"
        };
        let value = rounded(*value).parse().unwrap_or(*value);
        table[key] = parameter(value, unit, &format!("test flights {names}"), said.into());
    }
    table
}

/// Source of a value that is nominal for a vehicle of this size, not for the Hummingbird.
const SCALED: &str = "typical of a vehicle of this size (`scale_to` of the effect)";

/// Source of the full voltage where the exponent was fitted to a measured one.
const FULL: &str = "a full battery of as many lithium-polymer cells as the greatest logged voltage takes";

#[allow(clippy::float_cmp, reason = "a value that was not touched is the same")]
fn table(effect: &Effect, vehicle: &Vehicle, report: &Report) -> Table {
    let name = effect.kind.name;
    let mut table = Table::new();
    table["name"] = value(name);
    let fitted = report.effects.get(name).filter(|effect| effect.accepted);
    let stated = vehicle.effects.iter().find(|effect| effect.name == name);
    for (index, spec) in effect.kind.parameters.iter().enumerate() {
        let value = effect.values[index];
        let estimate = fitted.and_then(|effect| effect.parameters.get(spec.name));
        let declared =
            stated.and_then(|effect| effect.parameters.iter().find(|effect| effect.name == spec.name));
        let is_full = effect.kind.voltage_law.is_some_and(|law| {
            let exponent = effect.kind.parameters[law.exponent].name;
            law.nominal == index && fitted.is_some_and(|effect| effect.parameters.contains_key(exponent))
        });
        table[spec.name] = match (estimate, declared) {
            (Some(estimate), _) => of_estimate(estimate, &source(report)),
            (None, Some(declared)) => {
                parameter(declared.value, &declared.unit, &declared.source, said(&declared.uncertainty))
            }
            (None, None) if spec.neutral == Some(value) => continue,
            (None, None) => parameter(
                value,
                spec.unit(),
                if is_full {
                    FULL
                } else if value == spec.nominal {
                    spec.nominal_source
                } else {
                    SCALED
                },
                "not identified: held while the others were fitted".into(),
            ),
        };
    }
    table
}

fn source(report: &Report) -> String {
    let of_role = |role| {
        let flights =
            report.flights.iter().filter(move |flight| flight.role == role && flight.compared_s > 0.0);
        flights.map(|flight| flight.name.as_str()).collect::<Vec<_>>().join(", ")
    };
    let (fit, select) = (of_role(flights::Role::Fit), of_role(flights::Role::Select));
    let chosen = if select.is_empty() {
        "cross-validated on blocks of it".to_owned()
    } else {
        format!("accepted for its gain on {select}")
    };
    format!("hummingbus identify: fitted on {fit}; {chosen}")
}

/// Length of an interval of 95 %, in standard errors.
const INTERVAL_SIGMAS: f64 = 3.92;

fn of_estimate(estimate: &Estimate, source: &str) -> Item {
    let doubt = match estimate {
        Estimate { determined: false, .. } => "not determined by these flights: ",
        Estimate { at_bound: true, .. } => "at its bound: ",
        _ => "",
    };
    let (low, high) = (rounded(estimate.low), quantity(estimate.high, estimate.unit));
    let interval = format!("{doubt}95 % interval {low} to {high}");
    // At a bound the digits that are left out could lead beyond it.
    let known = to_known_digits(estimate.value, (estimate.high - estimate.low).abs() / INTERVAL_SIGMAS);
    let value = if estimate.at_bound { estimate.value } else { known };
    parameter(value, estimate.unit, source, interval.into())
}

fn parameter(value: f64, unit: &str, source: &str, uncertainty: Value) -> Item {
    let pairs = [
        ("value", number(value)),
        ("unit", unit.into()),
        ("source", source.into()),
        ("uncertainty", uncertainty),
    ];
    Item::Value(InlineTable::from_iter(pairs).into())
}

/// A number, with an exponent where it is small.
fn number(value: f64) -> Value {
    format!("{value:?}").parse().unwrap_or_else(|_| value.into())
}

fn said(uncertainty: &Uncertainty) -> Value {
    match uncertainty {
        Uncertainty::OneSigma(sigma) => number(*sigma),
        Uncertainty::Said(text) => text.as_str().into(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::results::BeforeAfter;
    use std::collections::BTreeMap;

    fn empty_report() -> Report {
        Report {
            vehicle: String::new(),
            flights: Vec::new(),
            verdict: Vec::new(),
            prediction_only: Vec::new(),
            without_worth: BTreeMap::new(),
            at_limit: BTreeMap::new(),
            stopped: false,
            losses: Vec::new(),
            bearing: None,
            withdrawn: Vec::new(),
            refined: false,
            effects: BTreeMap::new(),
            whiteness: BeforeAfter { before: BTreeMap::new(), after: BTreeMap::new() },
            time_offsets_s: BTreeMap::new(),
            faults: Vec::new(),
            trims: Vec::new(),
            winds: Vec::new(),
            held_out: BTreeMap::new(),
            limits: BTreeMap::new(),
            selected: BTreeMap::new(),
            fitted: BTreeMap::new(),
            envelope: BTreeMap::new(),
            noise_floor: BTreeMap::new(),
            unexplained: BTreeMap::new(),
            ratios: None,
            not_identifiable: Vec::new(),
            next_flight: None,
            block_s: 0.0,
            validation_blocks: 0,
        }
    }

    /// Characters that Rust escapes and TOML does not, and the reverse; the folder's name is in the comment.
    #[test]
    fn any_text_of_a_declared_effect_is_written_as_toml() {
        let said = "\u{200d}\u{a0}\u{7f}\u{85}\u{202e}\t\n\u{1b} \"'\\ é\u{301}";
        let folder = tempfile::Builder::new().prefix("a\nb\u{1b}").tempdir().unwrap();
        let path = folder.path().join("declared.toml");
        let mut declared: DocumentMut = vehicles::reference::HUMMINGBIRD.parse().unwrap();
        declared.remove("effects");
        let mut effect = Table::new();
        effect["name"] = value("mass-error");
        effect["error"] = parameter(1e-7, "1", said, said.into());
        let mut effects = ArrayOfTables::new();
        effects.push(effect);
        declared["effects"] = Item::ArrayOfTables(effects);
        std::fs::write(&path, declared.to_string()).unwrap();
        let effects = plant::effects::entry::resolve(&Vehicle::load(&path).unwrap().effects).unwrap();

        let text = text(&InputFiles::default(), &path, &effects, &empty_report()).unwrap();

        let read = Vehicle::parse(&text, "identified.toml").unwrap();
        let parameter = &read.effects[0].parameters[0];
        assert_eq!((parameter.value, parameter.source.as_str()), (1e-7, said), "{text}");
        assert_eq!(parameter.uncertainty, Uncertainty::Said(said.to_owned()));
        assert!(text.contains("value = 1e-7"), "{text}");
    }
}
