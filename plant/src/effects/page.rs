//! The catalogue as the page `docs/effects.md`; a test compares the two.

use super::catalogue::CATALOGUE;
use super::kind::{EffectKind, FitAs, ParameterSpec, Randomness};
use std::fmt::Write;

const HEAD: &str = "# Effects
<!-- Written by `hummingbus effects --markdown >docs/effects.md` from plant/src/effects. -->

An effect adds one piece of physics to the declared vehicle, such as drag, wind or a late command. List the effects of the
vehicle in its vehicle file, and those of the surroundings in the scene file. `hummingbus effects NAME` prints the section of
one effect.

```toml
[[effects]]
name = \"rotor-drag\"
coefficient = { value = 8.06428e-5, unit = \"N*s^2/(m*rad)\", source = \"RotorS\", uncertainty = \"not stated\" }
```

A parameter that is absent has its neutral value, with which it does nothing. A parameter without a neutral value is
required. Controllers read the same vehicle file and ignore its effects. A vehicle file may add effects to another file: it
then has `base = \"hummingbird.toml\"`, a path relative to itself, `name`, `notes` and `[[effects]]`. It may also replace
numbers of its base ([plant.md](plant.md#plant)).

**Order.** The plant applies the effects of the vehicle first, then those of the scene, each in the order of its file, and
each effect once. Forces, torques and changes of thrust add up.

**Time.** Drag, inflow and all else that depends on the motion is evaluated at every stage of the integration. The motion of
the air, delays and the battery are computed at the begin of a tick, and stay constant over it.

**Random numbers.** Each random effect has a stream of its own, from the run's seed, the plant's name and the effect's name.
A new effect does not change the noise of another.

**Symbols.** Thrusts T_i, speeds w_i, axes a_i, hub velocities v_i and heights z_i are those of rotor i. `up` is the vertical,
in the body. T_i is c_T w_i |w_i|: effects do not act on each other's changes of thrust.

Delay and bias of a sensor are parameters of the sensors and not effects ([sensors.md](sensors.md)).

Each effect is one file in `plant/src/effects/catalogue` and a row in `catalogue.rs`. Manifests, this page, the tests of all
effects and `hummingbus identify` use nothing else.

| effect | physics |
|---|---|
";

/// The whole page, in Markdown.
#[must_use]
pub fn markdown() -> String {
    let mut page = HEAD.to_owned();
    for kind in CATALOGUE {
        let _ = writeln!(page, "| [`{0}`](#{0}) | {1} |", kind.name, kind.summary);
    }
    for kind in CATALOGUE {
        page.push('\n');
        page.push_str(&of(kind));
    }
    page
}

/// The section of one effect, in Markdown.
#[must_use]
pub fn of(kind: &EffectKind) -> String {
    let mut section = String::new();
    let page = &mut section;
    let _ = writeln!(page, "## {}", kind.name);
    let _ = writeln!(page, "{}.\n", capitalised(kind.summary));
    let _ = writeln!(page, "- **Equation:** `{}`", kind.equation);
    let _ = writeln!(page, "- **Source:** {}.", kind.source);
    let _ = writeln!(page, "- **Holds for:** {}.", kind.validity);
    let _ = writeln!(page, "- **Fitted:** {}.", fitted(kind));
    for other in CATALOGUE {
        if let Some(experiment) = kind.experiment_against(other) {
            let _ = writeln!(page, "- **To tell from [`{0}`](#{0}):** {experiment}.", other.name);
        }
    }
    page.push('\n');
    page.push_str(
        "| parameter | meaning | units | min | max | neutral | nominal | source of the nominal value |\n",
    );
    page.push_str("|---|---|---|---|---|---|---|---|\n");
    kind.parameters.iter().for_each(|spec| row(page, spec));
    section
}

/// All about one effect, as plain text for a terminal.
#[must_use]
pub fn plain(kind: &EffectKind) -> String {
    let mut text = format!("{}: {}\n\n", kind.name, kind.summary);
    let mut facts = vec![
        ("equation".to_owned(), kind.equation.to_owned()),
        ("source".to_owned(), kind.source.to_owned()),
        ("holds for".to_owned(), kind.validity.to_owned()),
        ("fitted".to_owned(), fitted(kind)),
    ];
    for other in CATALOGUE {
        if let Some(experiment) = kind.experiment_against(other) {
            facts.push((format!("to tell from {}", other.name), experiment.to_owned()));
        }
    }
    let width = facts.iter().map(|(title, _)| title.len()).max().unwrap_or_default();
    for (title, fact) in &facts {
        let _ = writeln!(text, "{title:width$}  {}", fact.replace('`', ""));
    }
    text.push_str("\nparameters\n");
    let width = kind.parameters.iter().map(|spec| spec.name.len()).max().unwrap_or_default();
    for spec in kind.parameters {
        let units: Vec<_> = spec.dimension.units.iter().map(|(unit, _)| *unit).collect();
        let neutral = spec.neutral.map_or("must be given".to_owned(), |value| format!("neutral {value}"));
        let _ = writeln!(text, "  {:width$}  {}", spec.name, spec.meaning.replace('`', ""));
        let _ = writeln!(
            text,
            "  {:width$}  {} to {}, {neutral}, nominal {} ({}); units: {}",
            "",
            spec.min,
            spec.max,
            spec.nominal,
            spec.nominal_source,
            units.join(", ")
        );
    }
    text.push_str("\nin a vehicle or scene file\n");
    for line in example(kind).lines() {
        let _ = writeln!(text, "  {line}");
    }
    text
}

/// An entry of a vehicle or scene file with nominal values: those that have to be given, and the first of the others.
fn example(kind: &EffectKind) -> String {
    /// An effect with a value for each rotor has more of them than most vehicles have rotors.
    const OTHERS: usize = 3;
    let mut text = format!("[[effects]]\nname = \"{}\"\n", kind.name);
    for (index, spec) in kind.parameters.iter().enumerate() {
        if spec.neutral.is_none() || index < OTHERS {
            let (name, value, unit) = (spec.name, spec.nominal, spec.unit());
            let _ = writeln!(text, "{name} = {{ value = {value}, unit = \"{unit}\", source = \"none\" }}");
        }
    }
    text
}

/// Describes how an identification fits it.
fn fitted(kind: &EffectKind) -> String {
    if kind.randomness == Randomness::Stochastic {
        return "not at all: no fit can follow random numbers. What remains counts as unexplained".to_owned();
    }
    let part = match kind.fit_as {
        FitAs::Whole => "as a whole",
        FitAs::EachParameter => "each parameter by itself",
    };
    let needs: Vec<_> = kind.needs.iter().filter_map(|need| need.describe().split(':').next()).collect();
    if needs.is_empty() { part.to_owned() } else { format!("{part}; needs {}", needs.join("; ")) }
}

fn row(page: &mut String, spec: &ParameterSpec) {
    let units: Vec<_> = spec.dimension.units.iter().map(|(unit, _)| format!("`{unit}`")).collect();
    let neutral = spec.neutral.map_or("–".to_owned(), |value| value.to_string());
    let _ = writeln!(
        page,
        "| `{}` | {} | {} | {} | {} | {neutral} | {} | {} |",
        spec.name,
        spec.meaning,
        units.join(", "),
        spec.min,
        spec.max,
        spec.nominal,
        spec.nominal_source,
    );
}

fn capitalised(text: &str) -> String {
    let mut letters = text.chars();
    letters.next().map_or(String::new(), |first| first.to_uppercase().chain(letters).collect())
}

#[cfg(test)]
mod tests {
    use super::{CATALOGUE, example};
    use crate::effects::entry::resolve;

    #[test]
    fn the_example_of_each_effect_can_be_pasted() {
        for kind in CATALOGUE {
            let entries = vehicles::effects::entries(&example(kind), "example.toml");
            let effects = resolve(&entries).unwrap_or_else(|error| panic!("{}: {error}", kind.name));
            assert_eq!(effects.len(), 1, "{}", example(kind));
            assert_eq!(effects[0].kind.name, kind.name);
            assert!(effects[0].values.iter().any(|value| *value != 0.0), "{} does something", kind.name);
        }
    }
}
