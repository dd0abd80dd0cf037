//! Kinds of files that commands read, by content: a file that is given to the wrong command is told with its kind.

use diagnostics::parse_toml;
use toml::de::{DeTable, DeValue};
use vehicles::foreign::{self, Foreign};

/// Kind of a file that this program reads, or the foreign format that it is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// Manifest of a run.
    Manifest,
    /// Flights file: logs of real flights.
    Flights,
    /// Stand file: logs of a thrust stand.
    Stand,
    /// Vehicle file.
    Vehicle,
    /// Scene file.
    Scene,
    /// Gains file of a controller.
    Gains,
    /// Campaign file.
    Campaign,
    /// Recording of a run (MCAP).
    Recording,
    /// Checkpoint of a run.
    Checkpoint,
    /// Table of measurements.
    Csv,
    /// Another format.
    Foreign(Foreign),
}

/// First bytes of a checkpoint of any version.
const CHECKPOINT: &[u8] = b"hummingbus checkpoint ";
/// First bytes of a recording.
const RECORDING: &[u8] = b"\x89MCAP0\r\n";

impl Kind {
    /// Returns the kind of a file with these bytes; `None` if its content fits none or several.
    #[must_use]
    pub fn of(bytes: &[u8]) -> Option<Self> {
        if bytes.starts_with(RECORDING) {
            return Some(Self::Recording);
        }
        if bytes.starts_with(CHECKPOINT) {
            return Some(Self::Checkpoint);
        }
        // A list of TOML tables begins as JSON may do.
        let text = std::str::from_utf8(bytes).ok();
        if let Some(table) = text.and_then(|text| parse_toml(text).ok()) {
            return of_toml(table.get_ref()).or_else(|| foreign::of(bytes).map(Self::Foreign));
        }
        foreign::of(bytes).map(Self::Foreign).or_else(|| text.is_some_and(is_table).then_some(Self::Csv))
    }

    /// Name of the kind, with its article.
    #[must_use]
    pub fn name(&self) -> &'static str {
        match self {
            Self::Manifest => "a manifest",
            Self::Flights => "a flights file",
            Self::Stand => "a stand file",
            Self::Vehicle => "a vehicle file",
            Self::Scene => "a scene file",
            Self::Gains => "a gains file",
            Self::Campaign => "a campaign file",
            Self::Recording => "a recording",
            Self::Checkpoint => "a checkpoint",
            Self::Csv => "a CSV file",
            Self::Foreign(foreign) => foreign.name,
        }
    }

    /// Returns the command or the file that reads a file of this kind at `path`.
    #[must_use]
    pub fn reader(&self, path: &str) -> String {
        match self {
            Self::Manifest => format!("`hummingbus run {path}` flies it"),
            Self::Flights => format!(
                "`hummingbus identify {path} --out FOLDER` and `hummingbus validate VEHICLE {path}` read it"
            ),
            Self::Stand => format!("`hummingbus identify rotor {path} --out FOLDER` reads it"),
            Self::Vehicle => "a manifest or a flights file names it as `vehicle`".to_owned(),
            Self::Scene => "a manifest names it as `scene` of a process".to_owned(),
            Self::Gains => "a manifest names it as `gains` of a controller".to_owned(),
            Self::Campaign => format!("`hummingbus campaign {path}` flies it"),
            Self::Recording => {
                format!(
                    "`hummingbus cat {path}`, `hummingbus plot {path}` and `hummingbus view {path}` read it"
                )
            }
            Self::Checkpoint => format!("go on with --from: `hummingbus run --from {path}`"),
            Self::Csv => {
                "a flights file names it as `file` of a flight, a manifest as `data` of a player".to_owned()
            }
            Self::Foreign(foreign) => foreign.advice.to_owned(),
        }
    }
}

/// The kind of TOML file that has these keys.
fn of_toml(table: &DeTable<'_>) -> Option<Kind> {
    let has = |key: &str| table.get(key).is_some();
    let is_text = |key: &str| table.get(key).is_some_and(|value| value.get_ref().is_str());
    let count = |keys: &[&str]| keys.iter().filter(|key| has(key)).count();
    // A campaign has a list of that name.
    let has_sets = table.get("set").is_some_and(|value| value.get_ref().as_table().is_some());
    let is_of_manifest = count(&["process", "run", "include"]) > 0 || has_sets;
    let kinds = [
        (Kind::Campaign, (is_text("manifest") || is_text("from")) && count(&["vary", "tune", "flights"]) > 0),
        (Kind::Flights, is_text("vehicle") && has("flight")),
        (Kind::Stand, is_text("name") && count(&["static", "dynamic"]) > 0),
        (Kind::Manifest, is_of_manifest && !is_text("manifest") && count(&["vary", "tune"]) == 0),
        (Kind::Vehicle, count(&["body", "rotor", "motor", "command", "rotors"]) > 1 || is_text("base")),
        (Kind::Scene, is_text("name") && count(&["boxes", "meshes", "balls", "joints", "rig"]) > 0),
    ];
    let mut found = kinds.into_iter().filter(|(_, is_it)| *is_it).map(|(kind, _)| kind);
    match (found.next(), found.next()) {
        (Some(kind), None) => Some(kind),
        (None, _) if is_of_gains(table) => Some(Kind::Gains),
        _ => None,
    }
}

/// True for tables, one or more, whose values are all numbers with a unit and a source.
fn is_of_gains(table: &DeTable<'_>) -> bool {
    fn is_gain(value: &DeValue<'_>) -> bool {
        let Some(table) = value.as_table() else { return false };
        let is_quantity = table.get("value").is_some() && table.get("unit").is_some();
        is_quantity || is_of_gains(table)
    }
    !table.is_empty() && table.iter().all(|(_, value)| is_gain(value.get_ref()))
}

/// True for a text whose first line with content has several cells, and is none of TOML.
fn is_table(text: &str) -> bool {
    let is_content = |line: &&str| !line.trim().is_empty() && !line.starts_with('#');
    let cells = |line: &str| line.split([',', ';', '\t']).filter(|cell| !cell.trim().is_empty()).count();
    let is_toml = |line: &str| line.contains('=') || line.trim_start().starts_with('[');
    text.lines().find(is_content).is_some_and(|line| cells(line) > 1 && !is_toml(line))
}

#[cfg(test)]
mod tests {
    use super::Kind;

    #[test]
    fn every_kind_is_told_by_its_content() {
        let cases = [
            ("[run]\nduration_s = 1\n[process.plant]\nkind = 'plant'", Kind::Manifest),
            ("include = ['a.toml']", Kind::Manifest),
            ("vehicle = 'v.toml'\n[[flight]]\nfile = 'a.csv'\nrole = 'fit'", Kind::Flights),
            ("name = 'f40'\n[[static]]\nfile = 'a.csv'", Kind::Stand),
            ("name = 'v'\nbase = 'w.toml'", Kind::Vehicle),
            ("name = 'v'\n[boddy]\n[rotor]\n[motor]", Kind::Vehicle),
            ("name = 'hall'\n[[boxes]]\nname = 'wall'", Kind::Scene),
            ("[roll]\nproportional = { value = 1, unit = '1/s^2', source = 'tuned' }", Kind::Gains),
            ("manifest = 'm.toml'\nflights = 3\n[[vary]]\nkey = 'run.seed'", Kind::Campaign),
            ("manifest = 'm.toml'\nflights = 3\n[tune]\nprocess = 'controller'", Kind::Campaign),
            ("time;x\n0;1", Kind::Csv),
        ];
        for (text, kind) in cases {
            assert_eq!(Kind::of(text.as_bytes()), Some(kind), "{text}");
        }
        assert_eq!(Kind::of(b"\x89MCAP0\r\n\x01"), Some(Kind::Recording));
        assert_eq!(Kind::of(b"hummingbus checkpoint 2\n\0"), Some(Kind::Checkpoint));
        assert_eq!(Kind::of(b"\x1f\x8b\x08\0").unwrap().name(), "compressed (gzip)");
        for text in [
            "include = ['a.toml', 'b.toml']\n[run",
            "manifst = 'm.toml'\nset = ['run.seed=1']\n[[vary]]",
            "x = 1",
            "not a table",
            "[run",
            "a = 1\nbase = 3",
        ] {
            assert_eq!(Kind::of(text.as_bytes()), None, "{text}");
        }
    }
}
