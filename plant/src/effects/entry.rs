//! The effects that files list, checked against the catalogue.

use super::catalogue::{CATALOGUE, find};
use super::kind::{Effect, EffectKind, ParameterSpec, Values};
use vehicles::{EffectEntry, Stated, Vehicle, VehicleError};

/// The effects of `entries`, in their order.
///
/// # Errors
/// An effect or parameter that the catalogue does not have, a unit of another dimension, a value out of bounds, a
/// parameter that is missing, or an effect that stands twice.
pub fn resolve<'e>(entries: impl IntoIterator<Item = &'e EffectEntry>) -> Result<Vec<Effect>, VehicleError> {
    let mut effects: Vec<Effect> = Vec::new();
    for entry in entries {
        let kind = kind(entry)?;
        if effects.iter().any(|effect| effect.kind == kind) {
            return Err(bad_name(
                entry,
                "each effect once, vehicle and scene file together",
                "it a second time",
            ));
        }
        effects.push(Effect { kind, values: values(kind, entry)? });
    }
    Ok(effects)
}

fn kind(entry: &EffectEntry) -> Result<&'static EffectKind, VehicleError> {
    find(&entry.name).ok_or_else(|| {
        let names = CATALOGUE.iter().map(|kind| kind.name).collect::<Vec<_>>().join(", ");
        bad_name(entry, &format!("one of {names}"), "no such effect")
    })
}

fn bad_name(entry: &EffectEntry, expected: &str, found: &str) -> VehicleError {
    VehicleError::BadValue {
        place: entry.name_place.clone(),
        key: format!("{}.name", entry.key),
        expected: expected.to_owned(),
        found: format!("\"{}\", {found}", entry.name),
    }
}

fn values(kind: &'static EffectKind, entry: &EffectEntry) -> Result<Values, VehicleError> {
    refuse_unknown(kind, entry)?;
    let mut values = Values::default();
    for (value, spec) in values.iter_mut().zip(kind.parameters) {
        *value = match entry.parameters.iter().find(|stated| stated.name == spec.name) {
            Some(stated) => within_bounds(spec, stated, entry)?,
            None => spec.neutral.ok_or_else(|| missing(spec, entry))?,
        };
    }
    Ok(values)
}

fn refuse_unknown(kind: &'static EffectKind, entry: &EffectEntry) -> Result<(), VehicleError> {
    let is_known = |stated: &&Stated| kind.parameters.iter().any(|spec| spec.name == stated.name);
    let Some(unknown) = entry.parameters.iter().find(|stated| !is_known(stated)) else { return Ok(()) };
    let names: Vec<_> = kind.parameters.iter().map(|spec| spec.name).collect();
    Err(VehicleError::UnknownKey {
        place: unknown.place.clone(),
        key: format!("{}.{}", entry.key, unknown.name),
        expected: names.join(", "),
    })
}

fn missing(spec: &ParameterSpec, entry: &EffectEntry) -> VehicleError {
    VehicleError::MissingKey {
        place: entry.place.clone(),
        key: format!("{}.{}", entry.key, spec.name),
        expected: format!(
            "{} as a table with value, unit, source and uncertainty",
            spec.dimension.describe()
        ),
    }
}

/// The value in SI.
fn within_bounds(spec: &ParameterSpec, stated: &Stated, entry: &EffectEntry) -> Result<f64, VehicleError> {
    let key = format!("{}.{}", entry.key, spec.name);
    let Some(factor) = spec.dimension.factor(&stated.unit) else {
        return Err(VehicleError::BadValue {
            place: stated.unit_place.clone(),
            key: format!("{key}.unit"),
            expected: spec.dimension.describe(),
            found: format!("\"{}\"", stated.unit),
        });
    };
    let si = stated.value * factor;
    // A pure number's unit would read as another number.
    let unit = if spec.unit() == "1" { String::new() } else { format!(" {}", spec.unit()) };
    if (spec.min..=spec.max).contains(&si) {
        return Ok(si);
    }
    Err(VehicleError::BadValue {
        place: stated.place.clone(),
        key,
        expected: format!("{} to {}{unit}", spec.min, spec.max),
        found: format!("{} {}", stated.value, stated.unit),
    })
}

/// Refuses `vehicle`, which has these effects, if one of them must not have made it what it is.
pub(crate) fn require(
    vehicle: &Vehicle,
    effects: &[Effect],
    entries: &[EffectEntry],
) -> Result<(), VehicleError> {
    for (effect, entry) in effects.iter().zip(entries) {
        if let Some(Err(expected)) = effect.kind.require.map(|require| require(vehicle)) {
            return Err(bad_name(entry, expected, "which does not"));
        }
    }
    Ok(())
}
