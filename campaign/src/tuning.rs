//! The `[tune]` table of a campaign file: the gains that are tuned, and the cost that is minimised.

use crate::declaration::{Campaign, Sampling, require_line};
use crate::draw::rounded_to;
use diagnostics::parameter::{refuse, require};
use diagnostics::{Diagnostic, ParameterError, Place, did_you_mean, nearest, read_toml};
use serde::Deserialize;
use std::ops::Range;
use std::path::Path;
use toml::Spanned;
use toml_edit::{DocumentMut, Item};

/// Significant digits of a tuned gain: what is flown is what the gains file says.
const DIGITS: usize = 4;
/// First standard deviation of a candidate where the file does not say: a part of each range.
const STEP: f64 = 0.15;
/// Seed of the optimiser where the file does not say.
const SEED: u64 = 1;
const HELP: &str = "docs/tuning.md lists the keys of [tune]";

/// A tuning, as its file declares it.
///
/// ```
/// use campaign::tuning::Tuning;
/// let text = "manifest = \"hover.toml\"\nflights = 4\n[tune]\ngains = \"process.controller.gains\"\nheld_out = 8\n\
///             generations = 20\n[[tune.gain]]\nkey = \"roll.proportional\"\nfactor = [0.5, 2.0]\n\
///             [[tune.minimise]]\nfigure = \"roll error, RMS\"\nweight = 1.0";
/// let tuning = Tuning::parse("tune/hover.toml".as_ref(), text)?;
/// assert_eq!(tuning.process, "controller");
/// assert_eq!(tuning.held_out.flights, 8);
/// assert_eq!(tuning.gains[0].value(16.0, 0.5), 16.0);
/// # Ok::<(), diagnostics::Diagnostic>(())
/// ```
#[derive(Clone, Debug)]
pub struct Tuning {
    /// Flights by which candidates are judged while they are tuned.
    pub campaign: Campaign,
    /// Flights by which the result is judged: other drawn values and other seeds.
    pub held_out: Campaign,
    /// Process whose gains file is tuned.
    pub process: String,
    /// Tuned gains.
    pub gains: Vec<Tuned>,
    /// Terms of the cost of a flight.
    pub terms: Vec<Term>,
    /// Costs of a flight in which a condition of the manifest does not hold.
    pub failed_costs: f64,
    /// Most generations of the optimiser.
    pub generations: usize,
    /// Candidates of a generation; the optimiser's own number where absent.
    pub population: Option<usize>,
    /// First standard deviation of a candidate, as a part of each range.
    pub step: f64,
    /// Seed of the optimiser.
    pub seed: u64,
}

/// A tuned gain.
#[derive(Clone, Debug)]
pub struct Tuned {
    /// Name in reports.
    pub name: String,
    /// Keys in the gains file that all get the value.
    pub keys: Vec<String>,
    /// Limits of the value.
    pub limits: Limits,
    place: Place,
    /// Places of the keys in the tuning file.
    key_places: Vec<Place>,
}

/// Limits of a tuned gain.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Limits {
    /// Least and greatest factor of the declared value.
    Factor([f64; 2]),
    /// Least and greatest value.
    Value([f64; 2]),
}

/// A term of the cost of a flight: weight times figure.
#[derive(Clone, Debug)]
pub struct Term {
    /// Name of the figure.
    pub figure: String,
    /// Weight, in costs for each unit of the figure.
    pub weight: f64,
    /// Place of the name in the file.
    place: Place,
}

#[derive(Deserialize)]
struct File {
    tune: Option<Spanned<Tune>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Tune {
    gains: String,
    held_out: u64,
    generations: usize,
    population: Option<usize>,
    step: Option<f64>,
    seed: Option<u64>,
    #[serde(default)]
    failed_costs: f64,
    gain: Vec<Spanned<Gain>>,
    minimise: Vec<Minimised>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Minimised {
    figure: Spanned<String>,
    weight: f64,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Gain {
    name: Option<String>,
    key: Option<Spanned<String>>,
    #[serde(default)]
    keys: Vec<Spanned<String>>,
    factor: Option<[f64; 2]>,
    value: Option<[f64; 2]>,
}

impl Tuning {
    /// The tuning in `text`, which stands at `path`.
    ///
    /// # Errors
    /// All faults, each with its place.
    pub fn parse(path: &Path, text: &str) -> Result<Self, Diagnostic> {
        let (campaign, mut faults) = Campaign::parse_partly(path, text)?;
        let Some(campaign) = campaign else { return faults.finish(None) };
        let name = path.display().to_string();
        let file: File = read_toml(&name, text)?;
        let at = |span: &Range<usize>, error: ParameterError| {
            Diagnostic::at(Place::of(name.clone(), text, span), error).help(HELP)
        };
        let Some(tune) = &file.tune else {
            let message = "there is no [tune] table: hummingbus tune needs it";
            faults.keep::<()>(Err(Diagnostic::in_file(name, message).help(HELP)));
            return faults.finish(None);
        };
        let (span, tune) = (tune.span(), tune.get_ref());
        if let Some((_, place)) = campaign.figures.iter().flatten().next() {
            let message = "the figures of a tuning are those of [[tune.minimise]]";
            let error = ParameterError::conflict("figures", message).advised("leave `figures` out");
            faults.keep::<()>(Err(Diagnostic::at(place.clone(), error)));
        }
        let (process, errors) = tune.check(&campaign);
        for error in errors {
            faults.keep::<()>(Err(at(&span, error)));
        }
        let place = |span: &Range<usize>| Place::of(name.clone(), text, span);
        let gains = Diagnostic::gather(tune.gain.iter().map(|gain| {
            Tuned::of(gain, &place).map_err(|error| Diagnostic::at(place(&gain.span()), error).help(HELP))
        }));
        let gains = faults.keep(gains);
        let (process, gains) = faults.finish(process.zip(gains))?;
        let terms = tune.minimise.iter().map(|term| Term {
            figure: term.figure.get_ref().clone(),
            weight: term.weight,
            place: Place::of(name.clone(), text, &term.figure.span()),
        });
        let terms = terms.collect();
        let held_out =
            Campaign { flights: tune.held_out, seed: campaign.seed.wrapping_add(1), ..campaign.clone() };
        Ok(Self {
            campaign,
            held_out,
            process,
            gains,
            terms,
            failed_costs: tune.failed_costs,
            generations: tune.generations,
            population: tune.population,
            step: tune.step.unwrap_or(STEP),
            seed: tune.seed.unwrap_or(SEED),
        })
    }
}

impl Tune {
    /// The process whose gains are tuned, and the errors of the table.
    fn check(&self, campaign: &Campaign) -> (Option<String>, Vec<ParameterError>) {
        let process = self.gains.strip_prefix("process.").and_then(|rest| rest.strip_suffix(".gains"));
        let process = process.filter(|process| !process.is_empty()).map(str::to_owned);
        let varies_seed = campaign.varies("run.seed");
        let held_out = (1..=crate::declaration::FLIGHTS_MAX).contains(&self.held_out);
        let costs = self.failed_costs >= 0.0 && self.failed_costs.is_finite();
        let population = self
            .population
            .map(|it| require("population", it, (4..=10_000).contains(&it), "4 to 10000 candidates"));
        let step =
            self.step.map(|step| require("step", step, step > 0.0 && step <= 1.0, "above 0 and at most 1"));
        let weights = self.minimise.iter().map(|term| {
            require("weight", term.weight, term.weight > 0.0 && term.weight.is_finite(), "above 0")
        });
        let checks = [
            require("gains", &self.gains, process.is_some(), "process.NAME.gains"),
            refuse(
                campaign.sampling == Sampling::Grid,
                "sampling",
                || "a grid has no other flights to judge by; choose another `sampling`",
            ),
            refuse(
                varies_seed,
                "vary",
                || "run.seed is varied: a tuning judges by other seeds than it tunes by; leave it out",
            ),
            require("held_out", self.held_out, held_out, "at least 1 flight"),
            require("generations", self.generations, self.generations > 0, "at least 1"),
            require("failed_costs", self.failed_costs, costs, "0 or more"),
            at_least_one("gain", self.gain.len(), "at least one [[tune.gain]]"),
            at_least_one("minimise", self.minimise.len(), "at least one [[tune.minimise]]"),
        ];
        let all = checks.into_iter().chain(population).chain(step).chain(weights);
        (process, all.filter_map(Result::err).collect())
    }
}

fn at_least_one(key: &str, count: usize, expected: &str) -> Result<(), ParameterError> {
    if count > 0 { Ok(()) } else { Err(ParameterError::missing(key, expected)) }
}

impl Tuned {
    fn of(gain: &Spanned<Gain>, place: &dyn Fn(&Range<usize>) -> Place) -> Result<Self, ParameterError> {
        let (span, gain) = (gain.span(), gain.get_ref());
        let stated: Vec<&Spanned<String>> = gain.key.iter().chain(&gain.keys).collect();
        let keys: Vec<String> = stated.iter().map(|key| key.get_ref().clone()).collect();
        let key_places = stated.iter().map(|key| place(&key.span())).collect();
        let first =
            keys.first().ok_or_else(|| ParameterError::missing("key", "a key of the gains file"))?.clone();
        let limits = match (gain.factor, gain.value) {
            (Some(factor), None) => Limits::Factor(factor),
            (None, Some(value)) => Limits::Value(value),
            _ => {
                let expected = "either `factor` or `value`, two limits";
                return Err(ParameterError::missing("factor", expected));
            }
        };
        let (key, [low, high]) = limits.key();
        let least = if key == "factor" { f64::MIN_POSITIVE } else { f64::MIN };
        if !(low >= least && low < high && high.is_finite()) {
            let expected = "a lower limit below the upper one, factors above 0";
            return Err(ParameterError::value(key, expected, format!("[{low}, {high}]")));
        }
        let name = gain.name.clone().unwrap_or(first);
        require_line(&name)?;
        Ok(Self { name, keys, limits, place: place(&span), key_places })
    }

    /// Value at the coordinate `x` of the range, 0 to 1, of a gain that is `declared`; four significant digits.
    #[must_use]
    pub fn value(&self, declared: f64, x: f64) -> f64 {
        let between = |[low, high]: [f64; 2]| low + x.clamp(0.0, 1.0) * (high - low);
        let value = match self.limits {
            Limits::Factor(limits) => declared * libm::exp(between(limits.map(libm::log))),
            Limits::Value(limits) => between(limits),
        };
        rounded_to(value, DIGITS)
    }

    /// Unit of the value in the gains file with this `text`; 1 for a number without a unit.
    #[must_use]
    pub fn unit(&self, text: &str) -> String {
        let document = text.parse::<DocumentMut>().unwrap_or_default();
        let quantity = self.keys[0].split('.').try_fold(document.as_item(), |item, key| item.get(key));
        let unit = quantity.and_then(|quantity| quantity.get("unit")?.as_str());
        unit.unwrap_or("1").to_owned()
    }

    /// Coordinate of the `declared` value in the range.
    ///
    /// # Errors
    /// If it is outside, or a factor acts on 0.
    pub fn start(&self, declared: f64) -> Result<f64, Diagnostic> {
        let (key, [low, high]) = self.limits.key();
        let (x, shown) = match self.limits {
            Limits::Factor(limits) => {
                let [low, high] = limits.map(libm::log);
                (-low / (high - low), 1.0)
            }
            Limits::Value(_) => ((declared - low) / (high - low), declared),
        };
        let message = if declared == 0.0 && key == "factor" {
            format!("`{}` is 0, which no factor changes; give the limits of its `value`", self.keys[0])
        } else if (0.0..=1.0).contains(&x) {
            return Ok(x);
        } else {
            format!(
                "the search begins at {shown} for `{}`, which is outside of {low} to {high}",
                self.keys[0]
            )
        };
        Err(self.problem(message))
    }

    /// The problem of key number `index`, which is not among the numbers of the gains file with this `text`.
    pub(crate) fn unknown(&self, index: usize, text: &str) -> Diagnostic {
        let key = &self.keys[index];
        let document = text.parse::<DocumentMut>().unwrap_or_default();
        let known = number_keys(document.as_item(), "");
        let message = format!("the gains file has no number `{key}`");
        let help = did_you_mean(key, known.iter().map(String::as_str), "its numbers are");
        Diagnostic::at(self.key_places[index].clone(), ParameterError::conflict("key", message)).help(help)
    }

    /// A problem with this gain, at its place in the file.
    pub(crate) fn problem(&self, message: impl Into<String>) -> Diagnostic {
        let (key, _) = self.limits.key();
        Diagnostic::at(self.place.clone(), ParameterError::conflict(key, message.into())).help(HELP)
    }
}

/// Dotted keys of the numbers in the table `item`, with `before` in front. A quantity is a number.
fn number_keys(item: &Item, before: &str) -> Vec<String> {
    let Some(table) = item.as_table_like() else { return Vec::new() };
    let keys = table.iter().flat_map(|(key, item)| {
        let key = if before.is_empty() { key.to_owned() } else { format!("{before}.{key}") };
        let number = item.get("value").unwrap_or(item);
        if number.is_float() || number.is_integer() { vec![key] } else { number_keys(item, &key) }
    });
    keys.collect()
}

impl Term {
    /// A problem with the figure, which is not among the `known` ones.
    pub(crate) fn unknown(&self, known: &[String]) -> Diagnostic {
        let message = format!(
            "there is no figure `{}` to minimise; the figures are: {}",
            self.figure,
            known.join("; ")
        );
        let help = match nearest(&self.figure, known.iter().map(String::as_str)) {
            Some(near) => format!("did you mean `{near}`?"),
            None => HELP.to_owned(),
        };
        Diagnostic::at(self.place.clone(), ParameterError::conflict("figure", message)).help(help)
    }
}

impl Limits {
    fn key(self) -> (&'static str, [f64; 2]) {
        match self {
            Self::Factor(limits) => ("factor", limits),
            Self::Value(limits) => ("value", limits),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::Tuning;

    const HEAD: &str = "manifest = \"a.toml\"\nflights = 2\n[tune]\ngenerations = 3\n";
    const GAIN: &str = "[[tune.gain]]\nkey = \"roll.proportional\"\nfactor = [0.5, 2]\n";
    const TERM: &str = "[[tune.minimise]]\nfigure = \"f\"\nweight = 2\n";

    fn parse(text: &str) -> Result<Tuning, String> {
        Tuning::parse("t.toml".as_ref(), text).map_err(|error| error.to_string())
    }

    #[test]
    fn a_gain_goes_through_its_range_and_begins_at_its_declared_value() {
        let text = format!("{HEAD}gains = \"process.c.gains\"\nheld_out = 2\n{GAIN}{TERM}");
        let tuning = parse(&text).unwrap();
        let gain = &tuning.gains[0];
        assert_eq!(gain.start(16.0).unwrap(), 0.5);
        assert_eq!([0.0, 0.5, 1.0, 7.0].map(|x| gain.value(16.0, x)), [8.0, 16.0, 32.0, 32.0]);
        let file = "[roll]\nproportional = { value = 16, unit = \"1/s^2\" }\n";
        assert_eq!([file, "[roll]\nproportional = 16\n"].map(|file| gain.unit(file)), ["1/s^2", "1"]);
        assert!(gain.start(0.0).unwrap_err().to_string().contains("which no factor changes"));
        let unknown = gain.unknown(0, "pole = 4.0\n[roll]\nproportinal = { value = 16, unit = \"1/s^2\" }\n");
        let place = "t.toml:8:7: ";
        let said = unknown.to_string();
        assert!(said.starts_with(place) && said.ends_with("did you mean `roll.proportinal`?"), "{said}");
        // Flights that judge share no seed with those that tune.
        assert_ne!(tuning.held_out.seed, tuning.campaign.seed);
        let tuning = parse(&text.replace("factor = [0.5, 2]", "value = [0, 4]")).unwrap();
        assert_eq!(tuning.gains[0].start(1.0).unwrap(), 0.25);
        assert!(tuning.gains[0].start(5.0).unwrap_err().to_string().contains("outside of 0 to 4"));
    }

    #[test]
    fn what_is_refused_has_its_line() {
        let whole = format!("{HEAD}gains = \"process.c.gains\"\nheld_out = 2\n{GAIN}{TERM}");
        for (from, to, expected) in [
            ("[tune]", "[[measure]]\nname = \"a\"\n[tool]", "unknown"),
            ("flights = 2", "flights = 2\nfigures = [\"f\"]", "the figures of a tuning are those of"),
            ("process.c.gains", "c.gains", "t.toml:3:1: `gains` must be process.NAME.gains"),
            ("held_out = 2", "held_out = 0", "`held_out` must be at least 1 flight"),
            ("generations = 3", "generations = 0", "`generations` must be at least 1"),
            ("generations = 3", "generations = 3\npopulation = 3", "`population` must be 4 to 10000"),
            ("generations = 3", "generations = 3\nstep = 0", "`step` must be above 0"),
            ("weight = 2", "weight = -1", "`weight` must be above 0"),
            ("factor = [0.5, 2]", "factor = [2, 0.5]", "t.toml:7:1: `factor` must be a lower limit"),
            ("factor = [0.5, 2]", "factor = [0, 2]", "factors above 0"),
            ("factor = [0.5, 2]", "", "missing key `factor`"),
            (
                "flights = 2",
                "flights = 2\nsampling = \"random\"\n[[vary]]\nkey = \"run.seed\"\nintegers = [1, 9]",
                "run.seed is varied",
            ),
        ] {
            let found = parse(&whole.replace(from, to)).unwrap_err();
            assert!(found.contains(expected), "{found}\nexpected {expected}");
        }
        // All at once, also those of the campaign.
        let text = whole.replace("held_out = 2", "held_out = 0").replace("weight = 2", "weight = -1");
        let found =
            parse(&text.replace("flights = 2", "flights = 0").replace("[0.5, 2]", "[2, 0.5]")).unwrap_err();
        for key in ["flights", "held_out", "weight", "factor"] {
            assert!(found.contains(&format!("`{key}` must be")), "{key} in {found}");
        }
        let found = parse("manifest = \"a.toml\"\nflights = 2").unwrap_err();
        assert!(found.contains("there is no [tune] table"), "{found}");
    }
}
