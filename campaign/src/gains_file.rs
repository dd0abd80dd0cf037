//! The gains file that a tuning writes: the declared one with other numbers, each with its origin.

use crate::report::with_unit;
use crate::search::{Change, FigureChange, Outcome, TunedGain};
use anyhow::{Context, Result};
use std::fmt::Write as _;
use std::path::Path;
use toml_edit::{DocumentMut, Item, Value};

/// Start of every gains file that a tuning writes.
pub const START: &str = "# Written by hummingbus tune.";

/// Text of the new gains file: `declared`, the text of the file `name`, with the gains of `outcome`, which `tuning` found by
/// hummingbus `build`.
///
/// # Errors
/// If the declared file is not TOML, or has no place for a gain.
pub fn text(
    declared: &str,
    name: &Path,
    tuning: &Path,
    seed: u64,
    build: &str,
    outcome: &Outcome,
) -> Result<String> {
    let file = |path: &Path| path.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let (name, tuning) = (file(name), file(tuning));
    let mut document: DocumentMut = declared.parse().with_context(|| format!("{name}: not a TOML file"))?;
    for gain in &outcome.gains {
        for key in &gain.keys {
            put(&mut document, key, gain, &tuning).with_context(|| format!("{name}: no place `{key}`"))?;
        }
    }
    Ok(format!("{}#\n{document}", header(&name, &tuning, seed, build, outcome)?))
}

/// First lines of the file: the tuned file, the flights, and the figures before and after.
fn header(name: &str, tuning: &str, seed: u64, build: &str, outcome: &Outcome) -> Result<String> {
    let Outcome { generations, candidates, tuned_on, held_out, .. } = outcome;
    let mut text = format!("{START}\n");
    writeln!(
        text,
        "# {name}, tuned by {tuning}: hummingbus {build}, CMA-ES with seed {seed}, {generations} generations, {candidates}"
    )?;
    writeln!(text, "# candidates, {} flights each (plan of seed {}).", tuned_on.flights, tuned_on.seed)?;
    let percent = 100.0 * held_out.costs.relative();
    let error = 100.0 * held_out.standard_error / held_out.costs.before;
    writeln!(
        text,
        "# On {} other flights (plan of seed {}), before and after:",
        held_out.flights, held_out.seed
    )?;
    let line = |change: Change| format!("{:.6} {:.6}", change.before, change.after);
    writeln!(text, "#   costs: {} ({percent:+.1} %, standard error {error:.1} %)", line(held_out.costs))?;
    let Change { before, after } = held_out.failed;
    writeln!(text, "#   flights with a condition that does not hold: {before} {after}")?;
    for (figure, FigureChange { change, unit }) in &held_out.figures {
        // A name is one line of a comment.
        let unit = with_unit(unit);
        writeln!(text, "#   {}: {}{}", figure.escape_debug(), line(*change), unit.escape_debug())?;
    }
    Ok(text)
}

/// Puts a gain at the dotted `key`, a quantity or a number; `None` if there is no such place.
fn put(document: &mut DocumentMut, key: &str, gain: &TunedGain, tuning: &str) -> Option<()> {
    let item = key.split('.').try_fold(document.as_item_mut(), |item, key| item.get_mut(key))?;
    if let Some(quantity) = item.as_table_like_mut().filter(|table| table.contains_key("value")) {
        let source = format!("hummingbus tune {tuning}; before: {}", gain.before);
        replace(quantity.get_mut("value")?, gain.after.into())?;
        match quantity.get_mut("source") {
            Some(item) => replace(item, source.into())?,
            None => drop(quantity.insert("source", toml_edit::value(source))),
        }
        return Some(());
    }
    item.is_value().then_some(())?;
    replace(item, gain.after.into())
}

/// Replaces a value, and leaves spaces and comments around it.
fn replace(item: &mut Item, new: Value) -> Option<()> {
    let value = item.as_value_mut()?;
    let decor = value.decor().clone();
    *value = new;
    *value.decor_mut() = decor;
    Some(())
}

#[cfg(test)]
mod tests {
    use super::{START, text};
    use crate::search::{Change, Comparison, FigureChange, Outcome, TunedGain};

    #[test]
    fn a_gain_keeps_its_unit_and_gets_its_origin() {
        let gain = |key: &str, before, after| TunedGain {
            name: "g".to_owned(),
            keys: vec![key.to_owned()],
            before,
            after,
            unit: "1".to_owned(),
        };
        let comparison = Comparison {
            flights: 8,
            seed: 2,
            costs: Change { before: 2.0, after: 1.0 },
            standard_error: 0.1,
            failed: Change { before: 1.0, after: 0.0 },
            figures: vec![(
                "height".to_owned(),
                FigureChange { change: Change { before: 0.5, after: 0.25 }, unit: "m".to_owned() },
            )],
        };
        let outcome = |gains| Outcome {
            gains,
            generations: 3,
            candidates: 30,
            tuned_on: comparison.clone(),
            held_out: comparison.clone(),
        };
        let declared = "# Ours.\n[roll]\np = { value = 16, unit = \"1/s^2\", source = \"tuned\" } # much\nd = 6.0 # plain\n";
        let write = |gains| {
            text(declared, "a/pid.toml".as_ref(), "b/hover.toml".as_ref(), 1, "0.1.0", &outcome(gains))
        };
        let found = write(vec![gain("roll.p", 16.0, 12.5), gain("roll.d", 6.0, 7.0)]).unwrap();
        assert!(found.starts_with(START), "{found}");
        let body = "# Ours.\n[roll]\np = { value = 12.5, unit = \"1/s^2\", source = \"hummingbus tune hover.toml; before: 16\" } # much\nd = 7.0 # plain\n";
        assert!(found.ends_with(body), "{found}");
        for line in [
            "pid.toml, tuned by hover.toml: hummingbus 0.1.0, CMA-ES with seed 1",
            "(-50.0 %, standard error 5.0 %)",
            "#   height: 0.500000 0.250000 m\n",
        ] {
            assert!(found.contains(line), "{found}");
        }
        let error = format!("{:#}", write(vec![gain("roll.q", 1.0, 2.0)]).unwrap_err());
        assert_eq!(error, "pid.toml: no place `roll.q`");
    }
}
