//! A campaign file in the place of arguments: flights that go on from a checkpoint.

use crate::declaration::Meaning;
use crate::distribution::Distribution;
use diagnostics::ParameterError;
use std::path::{Component, Path, PathBuf};
use std::str::FromStr;

/// Expected text of an argument.
const EXPECTED: &str = "KEY=DISTRIBUTION:VALUES, such as process.plant.vehicle.body.mass=uniform:0.4,0.6";

/// A varied value as an argument: `KEY=DISTRIBUTION:VALUES`, with `factor:` or `offset:` in front of the distribution where
/// the numbers act on the declared one.
///
/// ```
/// use campaign::fork::Vary;
/// let vary: Vary = "process.plant.vehicle.body.mass=factor:uniform:0.9,1.1".parse()?;
/// assert_eq!(vary.key, "process.plant.vehicle.body.mass");
/// assert_eq!(vary.distribution.at(0.5), 1.0);
/// let kinds: Vary = "process.controller.kind=values:pid,lqr".parse()?;
/// assert_eq!(kinds.distribution.choice(1.0), Some(&"lqr".into()));
/// let refused = "run.seed=uniform:2,1".parse::<Vary>().unwrap_err();
/// assert!(refused.to_string().contains("a lower limit below the upper one"), "{refused}");
/// # Ok::<(), diagnostics::ParameterError>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Vary {
    /// Key, as `--set` takes it.
    pub key: String,
    /// Meaning of the drawn number.
    pub meaning: Meaning,
    /// Distribution of the drawn number.
    pub distribution: Distribution,
}

impl FromStr for Vary {
    type Err = ParameterError;

    fn from_str(text: &str) -> Result<Self, ParameterError> {
        let refused = || ParameterError::value("vary", EXPECTED, text);
        let (key, drawn) = text.split_once('=').ok_or_else(refused)?;
        let (meaning, drawn) = match drawn.trim().split_once(':') {
            Some(("factor", rest)) => (Meaning::Factor, rest),
            Some(("offset", rest)) => (Meaning::Offset, rest),
            _ => (Meaning::Value, drawn.trim()),
        };
        let (name, numbers) = drawn.split_once(':').ok_or_else(refused)?;
        // As in a campaign file, so that both take the same distributions.
        let values: Vec<String> = numbers.split(',').map(|value| literal(value.trim())).collect();
        let list = format!("{name} = [{}]", values.join(", "));
        let distribution: Distribution = toml::from_str(&list).map_err(|_| refused())?;
        distribution.check()?;
        let key = key.trim().to_owned();
        if key.is_empty() { Err(refused()) } else { Ok(Self { key, meaning, distribution }) }
    }
}

/// A value as TOML. A text that is not TOML is taken as a text without quotes.
fn literal(value: &str) -> String {
    let is_toml = value.parse::<toml::Value>().is_ok();
    if is_toml || value.is_empty() { value.to_owned() } else { toml::Value::from(value).to_string() }
}

/// Text of the campaign file whose `flights` go on from the checkpoint `from`, with the overrides `set` of all flights.
///
/// ```
/// use campaign::declaration::{Campaign, Start};
/// let vary = ["run.seed=integers:1,9".parse()?];
/// let text = campaign::fork::text("/a/hover.6000.ckpt".as_ref(), 9, &["run.duration_s=9".to_owned()], &vary)?;
/// let campaign = Campaign::parse("/b/campaign.toml".as_ref(), &text)?;
/// assert_eq!(campaign.start, Start::Checkpoint("/a/hover.6000.ckpt".into()));
/// assert_eq!((campaign.flights, campaign.vary[0].name.as_str()), (9, "seed"));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// If the path of the checkpoint is not UTF-8.
pub fn text(from: &Path, flights: u64, set: &[String], vary: &[Vary]) -> Result<String, ParameterError> {
    let path = from.to_str();
    let path = path.ok_or_else(|| ParameterError::value("from", "a path in UTF-8", from.display()))?;
    let quoted = |text: &str| toml::Value::from(text).to_string();
    let set: Vec<String> = set.iter().map(|set| quoted(set)).collect();
    let mut text = format!("from = {}\nflights = {flights}\nset = [{}]\n", quoted(path), set.join(", "));
    if vary.is_empty() {
        text += "vary = []\n";
    }
    for Vary { key, meaning, distribution } in vary {
        let last = |key: &str| key.rsplit('.').next().unwrap_or_default().to_owned();
        let is_alone = vary.iter().filter(|other| last(&other.key) == last(key)).count() == 1;
        let name = if is_alone { last(key) } else { key.clone() };
        let meaning = match meaning {
            Meaning::Value => "value",
            Meaning::Factor => "factor",
            Meaning::Offset => "offset",
        };
        let distribution = toml::to_string(distribution)
            .unwrap_or_else(|error| unreachable!("numbers are written as TOML: {error}"));
        let (name, key) = (quoted(&name), quoted(key));
        text += &format!("\n[[vary]]\nname = {name}\nkey = {key}\nas = \"{meaning}\"\n{distribution}");
    }
    Ok(text)
}

/// Path of the checkpoint `from` as a campaign file in `folder` names it, so that both can be moved together. It is absolute if the
/// two have no folder in common but the root.
#[must_use]
pub fn from_folder(from: &Path, folder: &Path) -> PathBuf {
    let (Some(from_real), Some(folder)) = (real_place(from), real(folder)) else { return from.to_owned() };
    let common = from_real.components().zip(folder.components()).take_while(|(a, b)| a == b).count();
    if common <= 1 {
        return from.to_owned();
    }
    let up = folder.components().skip(common).map(|_| Component::ParentDir);
    up.chain(from_real.components().skip(common)).collect()
}

/// The file at `path` in the folder that links lead to: the file itself may be a link.
fn real_place(path: &Path) -> Option<PathBuf> {
    Some(real(path.parent()?)?.join(path.file_name()?))
}

/// The folder at `path` without links, as far as it exists; `None` if it has steps up where it does not.
fn real(path: &Path) -> Option<PathBuf> {
    let path = std::path::absolute(path).ok()?;
    let (known, rest) = path
        .ancestors()
        .find_map(|folder| Some((folder.canonicalize().ok()?, path.strip_prefix(folder).ok()?)))?;
    let has_steps_up = rest.components().any(|part| part == Component::ParentDir);
    (!has_steps_up).then(|| known.join(rest))
}

#[cfg(test)]
mod tests {
    use super::{Vary, from_folder, text};
    use crate::declaration::{Campaign, Meaning};
    use crate::distribution::Distribution;

    #[test]
    fn arguments_become_the_campaign_that_they_mean() {
        let given = [
            "process.a.gains.roll.proportional=factor:log_uniform:0.5,2",
            "process.a.gains.pitch.proportional=offset:normal:0,0.1",
            "run.seed=values:3,4,5",
        ];
        let vary: Vec<Vary> = given.iter().map(|text| text.parse().unwrap()).collect();
        let text = text("/a b/\"c\".ckpt".as_ref(), 7, &["x=\"y\"".to_owned()], &vary).unwrap();
        let campaign = Campaign::parse("c.toml".as_ref(), &text).unwrap();
        assert_eq!(campaign.set, ["x=\"y\""]);
        let found: Vec<_> = campaign.vary.iter().map(|it| (it.name.as_str(), it.meaning)).collect();
        let expected = [
            ("process.a.gains.roll.proportional", Meaning::Factor),
            ("process.a.gains.pitch.proportional", Meaning::Offset),
            ("seed", Meaning::Value),
        ];
        assert_eq!(found, expected);
        assert_eq!(campaign.vary[0].distribution, Distribution::LogUniform([0.5, 2.0]));
        assert_eq!(campaign.vary[2].distribution, Distribution::Values(vec![3.0, 4.0, 5.0].into()));
    }

    #[test]
    fn a_checkpoint_is_named_from_the_folder_of_the_campaign() {
        let folder = tempfile::tempdir().unwrap();
        let at = |path: &str| folder.path().join(path);
        std::fs::create_dir(at("runs")).unwrap();
        std::os::unix::fs::symlink(at("runs"), at("link")).unwrap();
        // Folders that are there, that are not, and behind a link.
        for (from, out, expected) in [
            ("a.ckpt", "", "a.ckpt"),
            ("a.ckpt", "a.fork", "../a.ckpt"),
            ("runs/a.ckpt", "out/x", "../../runs/a.ckpt"),
            ("link/a.ckpt", "runs/a.fork", "../a.ckpt"),
        ] {
            assert_eq!(from_folder(&at(from), &at(out)).to_str(), Some(expected), "{from} of {out}");
        }
        let elsewhere = from_folder("/none/a.ckpt".as_ref(), &at("out"));
        assert_eq!(elsewhere.to_str(), Some("/none/a.ckpt"));
    }

    #[test]
    fn what_is_no_distribution_is_refused_with_an_example() {
        for wrong in [
            "mass",
            "mass=1",
            "mass=uniform",
            "mass=even:1,2",
            "mass=uniform:1",
            "=uniform:1,2",
            "a=uniform:x",
        ] {
            let error = wrong.parse::<Vary>().unwrap_err().to_string();
            assert!(error.contains("KEY=DISTRIBUTION:VALUES"), "{wrong}: {error}");
        }
    }
}
