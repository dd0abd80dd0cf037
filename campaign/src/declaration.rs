//! The campaign file.

use crate::distribution::Distribution;
use crate::list::List;
use crate::measures::Measures;
use diagnostics::parameter::require;
use diagnostics::{Diagnostic, Faults, ParameterError, Place, read_toml};
use serde::Deserialize;
use serde::de::IgnoredAny;
use std::ops::Range;
use std::path::{Path, PathBuf};
use toml::Spanned;

/// Key of the duration of a run. Where it is varied, a measure may see some flights only.
pub(crate) const DURATION: &str = "run.duration_s";
/// Most flights of a campaign.
pub const FLIGHTS_MAX: u64 = 1_000_000;

/// A campaign, as its file declares it.
///
/// ```
/// use campaign::declaration::{Campaign, Start};
/// let text = "manifest = \"hover.toml\"\nflights = 100\n\
///             [[vary]]\nkey = \"process.plant.vehicle.body.mass\"\nas = \"factor\"\nuniform = [0.9, 1.1]";
/// let campaign = Campaign::parse("campaigns/mass.toml".as_ref(), text)?;
/// assert_eq!(campaign.start, Start::Manifest("campaigns/hover.toml".into()));
/// assert_eq!(campaign.vary[0].name, "mass");
/// # Ok::<(), diagnostics::Diagnostic>(())
/// ```
#[derive(Clone, Debug)]
pub struct Campaign {
    /// The campaign file.
    pub path: PathBuf,
    /// Start of all flights.
    pub start: Start,
    /// Number of flights.
    pub flights: u64,
    /// Seed of the drawn values; each flight has a seed of its own, `run.seed`, unless that is varied.
    pub seed: u64,
    /// Method by which values are drawn.
    pub sampling: Sampling,
    /// Overrides of all flights, as `--set` takes them.
    pub set: Vec<String>,
    /// Keys that the file sets or varies, and the places of their values.
    pub set_places: Vec<(String, Place)>,
    /// Measures beside those of the manifest.
    pub measures: Measures,
    /// Names of the figures that table and report keep, with their places; all where absent.
    pub figures: Option<Vec<(String, Place)>>,
    /// Varied values.
    pub vary: Vec<Varied>,
    /// Host time after which a flight is given up, in seconds.
    pub timeout_s_host: f64,
}

/// Start of all flights of a campaign.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Start {
    /// The first tick of this manifest.
    Manifest(PathBuf),
    /// The tick of this checkpoint: what was flown before is flown once.
    Checkpoint(PathBuf),
}

/// Method by which the values of the flights are drawn.
#[derive(Clone, Copy, Debug, Default, Deserialize, PartialEq, Eq)]
#[serde(rename_all = "kebab-case")]
pub enum Sampling {
    /// Each value's distribution is cut into as many equal parts as there are flights. Each part is drawn
    /// from once (McKay, Beckman and Conover, Technometrics 21(2), 1979).
    #[default]
    LatinHypercube,
    /// A Sobol sequence (directions of Joe and Kuo, SIAM J. Sci. Comput. 30(5), 2008) with a random digital shift: values fill
    /// the space of all varied values evenly, best in 2^n flights.
    Sobol,
    /// Independent values.
    Random,
    /// Every combination of `values` and `integers`.
    Grid,
}

/// Meaning of a drawn number.
#[derive(Clone, Copy, Debug, Default, Deserialize, PartialEq, Eq)]
#[serde(rename_all = "kebab-case")]
pub enum Meaning {
    /// The value itself.
    #[default]
    Value,
    /// A factor of the declared value.
    Factor,
    /// A number added to the declared value.
    Offset,
}

/// A varied value.
#[derive(Clone, Debug)]
pub struct Varied {
    /// Column of the plan and of the rows.
    pub name: String,
    /// Keys that all get the value, as `--set` takes them.
    pub keys: Vec<String>,
    /// Meaning of the drawn number.
    pub meaning: Meaning,
    /// Distribution of the drawn number.
    pub distribution: Distribution,
    /// Place in the file.
    place: Place,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    manifest: Option<Spanned<String>>,
    from: Option<Spanned<String>>,
    flights: Option<Spanned<u64>>,
    #[serde(default = "first")]
    seed: u64,
    #[serde(default)]
    sampling: Sampling,
    #[serde(default)]
    set: Vec<Spanned<String>>,
    #[serde(default)]
    measure: Vec<Spanned<toml::Table>>,
    figures: Option<Vec<Spanned<String>>>,
    #[serde(default)]
    vary: Vec<Spanned<Vary>>,
    timeout_s_host: Option<Spanned<f64>>,
    /// Read by [`crate::tuning`].
    #[serde(default, rename = "tune")]
    _tune: IgnoredAny,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Vary {
    name: Option<String>,
    key: Option<Spanned<String>>,
    #[serde(default)]
    keys: Vec<Spanned<String>>,
    #[serde(default, rename = "as")]
    meaning: Meaning,
    values: Option<Spanned<List>>,
    uniform: Option<Spanned<[f64; 2]>>,
    log_uniform: Option<Spanned<[f64; 2]>>,
    normal: Option<Spanned<[f64; 2]>>,
    integers: Option<Spanned<[i64; 2]>>,
}

fn first() -> u64 {
    1
}

/// Most varied values of a Sobol sequence.
pub const SOBOL_MAX: usize = 100;
/// Longest host time of a flight that may be stated, s.
const TIMEOUT_S_HOST_MAX: f64 = 1e6;
/// Host time of a flight where the file does not say, s.
const TIMEOUT_S_HOST: f64 = 60.0;

impl Campaign {
    /// The campaign in `text`, which stands at `path`.
    ///
    /// # Errors
    /// All faults, each with its place.
    pub fn parse(path: &Path, text: &str) -> Result<Self, Diagnostic> {
        let (campaign, faults) = Self::parse_partly(path, text)?;
        faults.finish(campaign)
    }

    /// The campaign in `text` without its faulty parts, and their faults. `None` if its manifest cannot be read beside these faults.
    ///
    /// # Errors
    /// If the text is no campaign file at all.
    pub(crate) fn parse_partly(path: &Path, text: &str) -> Result<(Option<Self>, Faults), Diagnostic> {
        let name = path.display().to_string();
        let file: File = read_toml(&name, text)?;
        let at = |span: &Range<usize>, error: ParameterError, help: &str| {
            Diagnostic::at(Place::of(name.clone(), text, span), error).help(help)
        };
        let mut faults = Faults::default();
        let vary = file.varied(&name, text);
        let flights = match &vary {
            // A grid counts its values.
            Err(_) if file.sampling == Sampling::Grid => Ok(0),
            vary => flights(&file, vary.as_deref().unwrap_or_default()),
        };
        let flights = faults.keep(flights.map_err(|error| {
            let span = file.flights.as_ref().map_or(0..0, Spanned::span);
            at(&span, error, "docs/campaigns.md lists the keys of a campaign")
        }));
        faults.keep(file.check_values(&at));
        let start = faults.keep(start(&file, path).map_err(|(span, error)| {
            at(&span, error, "name a manifest, or a checkpoint that all flights go on from")
        }));
        let has_measures = faults.keep(file.check_measures(&at)).is_some();
        let vary = faults.keep(vary);
        // A measure sees samples or none by the duration.
        let has_duration = vary.is_some() || !file.keys().any(|key| key.get_ref() == DURATION);
        let is_readable = has_measures && has_duration;
        let Some(start) = start.filter(|_| is_readable) else { return Ok((None, faults)) };
        let measures = Measures::of(&name, text, &file.measure);
        let placed = |figure: &Spanned<String>| {
            (figure.get_ref().clone(), Place::of(name.clone(), text, &figure.span()))
        };
        let figures = file.figures.as_ref().map(|figures| figures.iter().map(placed).collect());
        let place = |span| Place::of(name.clone(), text, &span);
        let varied = file.keys().map(|key| (key.get_ref().clone(), place(key.span())));
        let set_places = file
            .set
            .iter()
            .map(|set| (key_of(set.get_ref()).to_owned(), place(set.span())))
            .chain(varied)
            .collect();
        let timeout_s_host = file.timeout_s_host();
        let campaign = Self {
            path: path.to_owned(),
            start,
            flights: flights.unwrap_or_default(),
            seed: file.seed,
            sampling: file.sampling,
            set: file.set.into_iter().map(Spanned::into_inner).collect(),
            set_places,
            measures,
            figures,
            vary: vary.unwrap_or_default(),
            timeout_s_host,
        };
        Ok((Some(campaign), faults))
    }

    /// True if a varied value sets `key`.
    #[must_use]
    pub fn varies(&self, key: &str) -> bool {
        self.vary.iter().flat_map(|varied| &varied.keys).any(|varied| varied.trim() == key)
    }
}

impl File {
    /// The varied values of the file called `name`, whose text is `text`.
    fn varied(&self, name: &str, text: &str) -> Result<Vec<Varied>, Diagnostic> {
        let vary = Diagnostic::gather(self.vary.iter().map(|vary| {
            let place = Place::of(name, text, &vary.span());
            Varied::of(vary.get_ref(), &place).map_err(|error| {
                let help = "docs/campaigns.md lists the keys of [[vary]]";
                let value = vary.get_ref().span_of(error.key());
                let place = value.map_or(place, |span| Place::of(name, text, &span));
                Diagnostic::at(place, error).help(help)
            })
        }))?;
        Diagnostic::gather([require_names(&vary), require_keys(&vary)])?;
        Ok(vary)
    }

    /// All keys that the file varies.
    fn keys(&self) -> impl Iterator<Item = &Spanned<String>> {
        self.vary.iter().map(Spanned::get_ref).flat_map(|vary| vary.key.iter().chain(&vary.keys))
    }

    fn timeout_s_host(&self) -> f64 {
        self.timeout_s_host.as_ref().map_or(TIMEOUT_S_HOST, |it| *it.get_ref())
    }

    /// Refuses too many varied values, a host time out of range, and a seed for all flights.
    fn check_values(&self, at: &At<'_>) -> Result<(), Diagnostic> {
        let dimensions = require_dimensions(self).map_err(|error| {
            let span = self.vary.get(SOBOL_MAX).map_or(0..0, Spanned::span);
            at(&span, error, "choose another `sampling`")
        });
        let timeout_s_host = self.timeout_s_host();
        let is_timeout = timeout_s_host > 0.0 && timeout_s_host <= TIMEOUT_S_HOST_MAX;
        let expected = "seconds above 0, at most a million";
        let timeout = require("timeout_s_host", timeout_s_host, is_timeout, expected).map_err(|error| {
            let span = self.timeout_s_host.as_ref().map_or(0..0, Spanned::span);
            at(&span, error, "leave it out for 60 s")
        });
        let seeds = self.set.iter().filter(|set| key_of(set.get_ref()) == "run.seed").map(|set| {
            let message = format!("`{}` in `set`: each flight has a seed of its own", set.get_ref());
            let error = ParameterError::conflict("set", message);
            Err(at(&set.span(), error, "change `seed` of the campaign, or vary run.seed"))
        });
        Diagnostic::gather([dimensions, timeout].into_iter().chain(seeds)).map(drop)
    }

    /// Refuses measures of flights that go on from a checkpoint.
    fn check_measures(&self, at: &At<'_>) -> Result<(), Diagnostic> {
        let (Some(_), Some(measure)) = (&self.from, self.measure.first()) else { return Ok(()) };
        let name = measure.get_ref().get("name").map_or(String::new(), |name| format!(" {name}"));
        let message = format!("[[measure]]{name} would see the flight from the checkpoint on only");
        let error = ParameterError::conflict("measure", message);
        Err(at(&(0..0), error, "write it into the manifest, and write the checkpoint anew"))
    }
}

/// The fault at a span of the file, with advice.
type At<'a> = dyn Fn(&Range<usize>, ParameterError, &str) -> Diagnostic + 'a;

/// Key of an override.
fn key_of(set: &str) -> &str {
    set.split('=').next().unwrap_or_default().trim()
}

/// The manifest or the checkpoint that the campaign `file` at `path` names; an error has its span.
fn start(file: &File, path: &Path) -> Result<Start, (Range<usize>, ParameterError)> {
    let resolve = |written: &str| inputs::tidy(&path.parent().unwrap_or(Path::new("")).join(written));
    match (&file.manifest, &file.from) {
        (Some(manifest), None) => Ok(Start::Manifest(resolve(manifest.get_ref()))),
        (None, Some(from)) => Ok(Start::Checkpoint(resolve(from.get_ref()))),
        (None, None) => {
            Err((0..0, ParameterError::missing("manifest", "a manifest, or a checkpoint as `from`")))
        }
        (Some(_), Some(from)) => {
            let message = "`manifest` and `from`: the manifest is that of the checkpoint";
            Err((from.span(), ParameterError::conflict("from", message)))
        }
    }
}

/// Number of flights: as stated, or the combinations of a grid.
fn flights(file: &File, vary: &[Varied]) -> Result<u64, ParameterError> {
    let stated = file.flights.as_ref().map(|flights| *flights.get_ref());
    let expected = format!("1 to {FLIGHTS_MAX} flights");
    let flights = if file.sampling == Sampling::Grid {
        let counts = vary.iter().map(|varied| varied.distribution.count());
        let combinations = counts.collect::<Result<Vec<_>, _>>()?;
        let combinations = combinations.iter().try_fold(1_u64, |all, count| all.checked_mul(*count));
        let combinations = combinations.unwrap_or(u64::MAX);
        if stated.is_some_and(|stated| stated != combinations) {
            let message =
                format!("a grid has as many flights as combinations: {combinations}; leave `flights` out");
            return Err(ParameterError::conflict("flights", message));
        }
        combinations
    } else {
        stated.ok_or_else(|| ParameterError::missing("flights", expected.clone()))?
    };
    if (1..=FLIGHTS_MAX).contains(&flights) {
        Ok(flights)
    } else {
        Err(ParameterError::value("flights", expected, flights))
    }
}

/// Refuses more varied values than a Sobol sequence has directions for.
fn require_dimensions(file: &File) -> Result<(), ParameterError> {
    if file.sampling == Sampling::Sobol && file.vary.len() > SOBOL_MAX {
        let expected = format!("at most {SOBOL_MAX} varied values for `sampling = \"sobol\"`");
        return Err(ParameterError::value("vary", expected, file.vary.len()));
    }
    Ok(())
}

/// Refuses a name that would be more than a part of one line of a report.
///
/// # Errors
/// If it has control characters.
pub fn require_line(name: &str) -> Result<(), ParameterError> {
    diagnostics::require_line(name)
        .map_err(|refused| ParameterError::value("name", refused.expected, refused.found))
}

fn require_names(vary: &[Varied]) -> Result<(), Diagnostic> {
    for (index, varied) in vary.iter().enumerate() {
        if vary[..index].iter().any(|other| other.name == varied.name) {
            let message = format!("two varied values are called `{}`", varied.name);
            return Err(
                varied.problem(ParameterError::conflict("name", message), "give each a `name` of its own")
            );
        }
    }
    Ok(())
}

/// Refuses a key that two varied values set, or one value twice: the last one would win.
fn require_keys(vary: &[Varied]) -> Result<(), Diagnostic> {
    let keys = vary.iter().flat_map(|varied| varied.keys.iter().map(move |key| (varied, key.trim())));
    let keys: Vec<(&Varied, &str)> = keys.collect();
    for (index, (varied, key)) in keys.iter().enumerate() {
        if keys[..index].iter().any(|(_, other)| other == key) {
            let error = ParameterError::conflict("key", format!("`{key}` is varied twice"));
            return Err(varied.problem(error, "leave one of them out, or vary another key"));
        }
    }
    Ok(())
}

/// Columns of the results of every campaign.
pub const COLUMNS: [&str; 7] = ["flight", "run.seed", "passed", "failed", "failed_at_s", "error", "version"];

/// Name of the value at `key`: its last part, with the one before it where that is a column of every campaign, such as the
/// `error` of the effect `mass-error`.
fn default_name(key: &str) -> String {
    let mut parts = key.rsplit('.');
    match (parts.next().unwrap_or(key), parts.next()) {
        (last, Some(before)) if COLUMNS.contains(&last) => format!("{before}.{last}"),
        (last, _) => last.to_owned(),
    }
}

impl Varied {
    fn of(vary: &Vary, place: &Place) -> Result<Self, ParameterError> {
        let keys: Vec<String> = vary.key.iter().chain(&vary.keys).map(|key| key.get_ref().clone()).collect();
        let first =
            keys.first().ok_or_else(|| ParameterError::missing("key", "a key, as `--set` takes it"))?;
        let name = vary.name.clone().unwrap_or_else(|| default_name(first));
        require_line(&name)?;
        let distribution = vary.distribution()?;
        distribution.check()?;
        if distribution.choices().is_some() && vary.meaning != Meaning::Value {
            let message = "a factor and an offset act on numbers, and `values` lists others";
            return Err(ParameterError::conflict("values", message));
        }
        Ok(Self { name, keys, meaning: vary.meaning, distribution, place: place.clone() })
    }

    /// A problem with this value, at its place in the file.
    pub(crate) fn problem(&self, error: ParameterError, help: &str) -> Diagnostic {
        Diagnostic::at(self.place.clone(), error).help(help)
    }
}

impl Vary {
    /// Place of the value of the distribution's `key`, if it is stated.
    fn span_of(&self, key: &str) -> Option<std::ops::Range<usize>> {
        match key {
            "values" => self.values.as_ref().map(Spanned::span),
            "uniform" => self.uniform.as_ref().map(Spanned::span),
            "log_uniform" => self.log_uniform.as_ref().map(Spanned::span),
            "normal" => self.normal.as_ref().map(Spanned::span),
            "integers" => self.integers.as_ref().map(Spanned::span),
            _ => None,
        }
    }

    fn distribution(&self) -> Result<Distribution, ParameterError> {
        let two = |numbers: &Option<Spanned<[f64; 2]>>| numbers.as_ref().map(|numbers| *numbers.get_ref());
        let stated: Vec<Distribution> = [
            self.values.as_ref().map(|values| Distribution::Values(values.get_ref().clone())),
            two(&self.uniform).map(Distribution::Uniform),
            two(&self.log_uniform).map(Distribution::LogUniform),
            two(&self.normal).map(Distribution::Normal),
            self.integers.as_ref().map(|limits| Distribution::Integers(*limits.get_ref())),
        ]
        .into_iter()
        .flatten()
        .collect();
        match stated.as_slice() {
            [one] => Ok(one.clone()),
            _ => {
                let expected = "one of `values`, `uniform`, `log_uniform`, `normal`, `integers`";
                Err(ParameterError::value("vary", expected, format!("{} of them", stated.len())))
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::{Campaign, Sampling};

    fn parse(text: &str) -> Result<Campaign, String> {
        let text = format!("manifest = \"a.toml\"\n{text}");
        Campaign::parse("c.toml".as_ref(), &text).map_err(|error| error.to_string())
    }

    #[test]
    fn a_value_is_called_by_the_end_of_its_key() {
        for (key, name) in
            [("run.seed", "seed"), ("process.plant.vehicle.effects.mass-error.error", "mass-error.error")]
        {
            let campaign =
                parse(&format!("flights = 2\n[[vary]]\nkey = \"{key}\"\nuniform = [0, 1]")).unwrap();
            assert_eq!(campaign.vary[0].name, name);
        }
    }

    #[test]
    fn texts_and_truth_values_are_chosen_from_and_numbers_stand_alone() {
        let text = |values: &str| format!("sampling = \"grid\"\n[[vary]]\nkey = \"a\"\nvalues = {values}");
        let campaign = parse(&text("[\"pid\", \"lqr\"]")).unwrap();
        let distribution = &campaign.vary[0].distribution;
        assert_eq!((campaign.flights, distribution.choice(1.0)), (2, Some(&"lqr".into())));
        assert_eq!(
            parse(&text("[true, false]")).unwrap().vary[0].distribution.choice(0.0),
            Some(&true.into())
        );
        assert_eq!(parse(&text("[1, 2.5]")).unwrap().vary[0].distribution.choice(0.0), None);
        let refused = parse(&text("[\"pid\", 2]")).unwrap_err();
        assert!(
            refused.contains("c.toml:5:10") && refused.contains("a list of numbers, or one of"),
            "{refused}"
        );
        let refused = parse(&text("[\"pid\"]\nas = \"factor\"")).unwrap_err();
        assert!(refused.contains("c.toml:5:10") && refused.contains("act on numbers"), "{refused}");
    }

    #[test]
    fn a_grid_has_all_combinations() {
        let text = "sampling = \"grid\"\n[[vary]]\nkey = \"a\"\nvalues = [1, 2]\n[[vary]]\nkey = \"b\"\nintegers = [1, 3]";
        let campaign = parse(text).unwrap();
        assert_eq!((campaign.flights, campaign.sampling), (6, Sampling::Grid));
    }

    #[test]
    fn all_faults_are_told_at_once() {
        let text = "flights = 0\ntimeout_s_host = -1\nset = [\"run.seed=1\", \"run.seed=2\"]\n\
                    [[vary]]\nkey = \"a\"\n[[vary]]\nkey = \"b\"\nuniform = [2, 1]";
        let refused = parse(text).unwrap_err();
        for place in ["c.toml:2:11", "c.toml:3:18", "c.toml:4:8", "c.toml:4:22", "c.toml:5:1", "c.toml:9:11"]
        {
            assert!(refused.contains(&format!("{place}: ")), "{place} in {refused}");
        }
        let vary = "[[vary]]\nkey = \"a.x\"\nvalues = [1]\n";
        let refused = parse(&format!("{vary}{vary}")).unwrap_err();
        for expected in ["missing key `flights`", "two varied values are called `x`", "`a.x` is varied twice"]
        {
            assert!(refused.contains(expected), "{expected} in {refused}");
        }
    }

    #[test]
    fn what_is_refused_has_its_line() {
        for (text, expected) in [
            (
                "flights = 0\n[[vary]]\nkey = \"a\"\nvalues = [1]",
                "c.toml:2:11: `flights` must be 1 to 1000000 flights",
            ),
            ("flights = 2\n[[vary]]\nkey = \"a\"", "c.toml:3:1: `vary` must be one of `values`"),
            ("flights = 2\n[[vary]]\nvalues = [1]", "c.toml:3:1: missing key `key`"),
            (
                "flights = 2\n[[vary]]\nkey = \"a\"\nuniform = [2, 1]",
                "c.toml:5:11: `uniform` must be a lower limit",
            ),
            (
                "flights = 2\n[[vary]]\nkey = \"a\"\nvalues = []",
                "c.toml:5:10: `values` must be at least one value",
            ),
            ("flights = 2\n[[vary]]\nkey = \"a\"\nintegers = [3, 1]", "c.toml:5:12: `integers` must be"),
            ("flights = 2\nvary = []\nflight = 3", "c.toml:4:1: unknown"),
            (
                "sampling = \"grid\"\n[[vary]]\nkey = \"a\"\nuniform = [1, 2]",
                "a grid takes `values` or `integers`",
            ),
            (
                "flights = 2\n[[vary]]\nkey = \"a.x\"\nvalues = [1]\n[[vary]]\nkey = \"b.x\"\nvalues = [1]",
                "c.toml:6:1: two varied values are called `x`",
            ),
            (
                "flights = 2\n[[vary]]\nname = \"one\"\nkey = \"a.x\"\nvalues = [1]\n[[vary]]\nname = \"two\"\nkeys = [\"b.x\", \"a.x\"]\nvalues = [1]",
                "c.toml:7:1: `a.x` is varied twice",
            ),
            (
                "flights = 2\n[[vary]]\nkeys = [\"a.x\", \"a.x\"]\nvalues = [1]",
                "c.toml:3:1: `a.x` is varied twice",
            ),
        ] {
            let found = parse(text).unwrap_err();
            assert!(found.contains(expected), "{found}\nexpected {expected}");
        }
    }
}
