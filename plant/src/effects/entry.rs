//! The effects that files list, checked against the catalogue.

use super::catalogue::{CATALOGUE, find};
use super::kind::{Effect, EffectKind, ParameterSpec, Values};
use diagnostics::{Diagnostic, Faults, ParameterError, nearest};
use vehicles::{EffectEntry, Stated, Vehicle};

/// The effects of `entries`, in their order.
///
/// # Errors
/// An effect or parameter that the catalogue does not have. A unit of another dimension, a value out of
/// bounds, a missing parameter, or an effect that stands twice. The error has all of these faults.
pub fn resolve<'e>(entries: impl IntoIterator<Item = &'e EffectEntry>) -> Result<Vec<Effect>, Diagnostic> {
    let (mut faults, mut kinds) = (Faults::default(), Vec::new());
    let mut effects: Vec<Effect> = Vec::new();
    for entry in entries {
        let Some(kind) = faults.keep(kind(entry)) else { continue };
        if kinds.contains(&kind) {
            let expected = "each effect once, vehicle and scene file together";
            faults.keep(Err::<(), _>(bad_name(entry, expected, "it a second time")));
            continue;
        }
        kinds.push(kind);
        effects.extend(faults.keep(values(kind, entry)).map(|values| Effect { kind, values }));
    }
    faults.finish(Some(effects))
}

fn kind(entry: &EffectEntry) -> Result<&'static EffectKind, Diagnostic> {
    find(&entry.name).ok_or_else(|| {
        let names = || CATALOGUE.iter().map(|kind| kind.name);
        let all = names().collect::<Vec<_>>().join(", ");
        let near = nearest(&entry.name, names());
        let help = near.map_or("`hummingbus effects` lists all effects".to_owned(), |near| {
            format!("did you mean \"{near}\"?")
        });
        bad_name(entry, &format!("one of {all}"), "no such effect").help(help)
    })
}

fn bad_name(entry: &EffectEntry, expected: &str, found: &str) -> Diagnostic {
    let found = format!("\"{}\", {found}", entry.name);
    let error = ParameterError::value(format!("{}.name", entry.key), expected, found);
    Diagnostic::at(entry.name_place.clone(), error)
}

fn values(kind: &'static EffectKind, entry: &EffectEntry) -> Result<Values, Diagnostic> {
    let (mut faults, mut values) = (Faults::default(), Values::default());
    faults.keep(refuse_unknown(kind, entry));
    for (value, spec) in values.iter_mut().zip(kind.parameters) {
        let read = match entry.parameters.iter().find(|stated| stated.name == spec.name) {
            Some(stated) => within_bounds(spec, stated, entry),
            None => spec.neutral.ok_or_else(|| missing(spec, entry)),
        };
        if let Some(number) = faults.keep(read) {
            *value = number;
        }
    }
    faults.finish(Some(values))
}

fn refuse_unknown(kind: &'static EffectKind, entry: &EffectEntry) -> Result<(), Diagnostic> {
    let is_known = |stated: &&Stated| kind.parameters.iter().any(|spec| spec.name == stated.name);
    let unknown = entry.parameters.iter().filter(|stated| !is_known(stated)).map(|unknown| {
        let key = format!("{}.{}", entry.key, unknown.name);
        let error = ParameterError::unknown(key, kind.parameters.iter().map(|spec| spec.name));
        Err::<(), _>(Diagnostic::at(unknown.key_place.clone(), error))
    });
    Diagnostic::gather(unknown).map(drop)
}

fn missing(spec: &ParameterSpec, entry: &EffectEntry) -> Diagnostic {
    let expected =
        format!("{} as a table with value, unit, source and uncertainty", spec.dimension.describe());
    let key = format!("{}.{}", entry.key, spec.name);
    Diagnostic::at(entry.place.clone(), ParameterError::missing(key, expected))
}

/// The value in SI.
fn within_bounds(spec: &ParameterSpec, stated: &Stated, entry: &EffectEntry) -> Result<f64, Diagnostic> {
    let key = format!("{}.{}", entry.key, spec.name);
    let Some(factor) = spec.dimension.factor(&stated.unit) else {
        let found = format!("\"{}\"", stated.unit);
        let error = ParameterError::value(format!("{key}.unit"), spec.dimension.describe(), found);
        return Err(Diagnostic::at(stated.unit_place.clone(), error));
    };
    let si = stated.value * factor;
    if (spec.min..=spec.max).contains(&si) {
        return Ok(si);
    }
    // A pure number's unit would read as another number.
    let unit = if stated.unit == "1" { String::new() } else { format!(" {}", stated.unit) };
    // In the unit of the file, without the noise of the division.
    let [min, max] = [spec.min, spec.max].map(|si| format!("{:.9e}", si / factor));
    let expected = format!("{} to {}{unit}", plain(&min), plain(&max));
    let error = ParameterError::value(key, expected, format!("{} {}", stated.value, stated.unit));
    Err(Diagnostic::at(stated.place.clone(), error))
}

/// The number that `text` is, as short as it can be written.
fn plain(text: &str) -> String {
    text.parse::<f64>().map_or_else(|_| text.to_owned(), |number| number.to_string())
}

/// Refuses `vehicle`, which has these effects, if it does not meet the requirements of one of them.
pub(crate) fn require(
    vehicle: &Vehicle,
    effects: &[Effect],
    entries: &[EffectEntry],
) -> Result<(), Diagnostic> {
    let checked = effects.iter().zip(entries).map(|(effect, entry)| {
        if let Some(Err(expected)) = effect.kind.require.map(|require| require(vehicle)) {
            return Err(bad_name(entry, expected, "which does not"));
        }
        refuse_absent_rotors(vehicle, effect, entry)
    });
    Diagnostic::gather(checked).map(drop)
}

/// Refuses a value for a rotor that the vehicle does not have.
fn refuse_absent_rotors(vehicle: &Vehicle, effect: &Effect, entry: &EffectEntry) -> Result<(), Diagnostic> {
    let known = effect.kind.parameters_for(vehicle);
    let is_absent = |stated: &&Stated| known.iter().all(|spec| spec.name != stated.name);
    let absent = entry.parameters.iter().filter(is_absent).map(|absent| {
        let expected = format!("a rotor of the vehicle, which has {}", vehicle.rotors.len());
        let key = format!("{}.{}", entry.key, absent.name);
        let error = ParameterError::value(key, expected, "one behind the last");
        Err::<(), _>(Diagnostic::at(absent.place.clone(), error))
    });
    Diagnostic::gather(absent).map(drop)
}
