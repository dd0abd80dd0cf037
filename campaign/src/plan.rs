//! The plan of a campaign: the drawn values of every flight, a CSV file that may be read and edited before it is flown.

use crate::base::Base;
use crate::declaration::{Campaign, FLIGHTS_MAX, Varied};
use crate::draw::draw;
use crate::list::shown;
use anyhow::{Context, Result, bail};
use std::path::Path;

/// Name of the column with the number of the flight.
const FLIGHT: &str = "flight";
/// Seeds are whole numbers of TOML.
const SEEDS: u64 = 1 << 62;
/// The override of the seed of a run.
const SEED: &str = "run.seed";

/// Values of every flight.
#[derive(Clone, Debug, PartialEq)]
pub struct Plan {
    /// Names of the varied values.
    pub names: Vec<String>,
    /// Drawn numbers by flight, in the order of the names.
    pub flights: Vec<Vec<f64>>,
}

impl Plan {
    /// The plan that `campaign` draws.
    #[must_use]
    pub fn of(campaign: &Campaign) -> Self {
        let names = campaign.vary.iter().map(|varied| varied.name.clone()).collect();
        Self { names, flights: draw(campaign) }
    }

    /// The plan as CSV.
    ///
    /// # Errors
    /// If there is no memory for it.
    pub fn to_csv(&self, campaign: &Campaign) -> Result<Vec<u8>> {
        let mut writer = csv::Writer::from_writer(Vec::new());
        writer.write_record(std::iter::once(FLIGHT).chain(self.names.iter().map(String::as_str)))?;
        for (number, values) in self.flights.iter().enumerate() {
            let values = campaign.vary.iter().zip(values).map(|(varied, drawn)| cell(varied, *drawn));
            writer.write_record(std::iter::once(number.to_string()).chain(values))?;
        }
        Ok(writer.into_inner()?)
    }

    /// The plan in the CSV `text` of the file `path`, for the varied values of `campaign`.
    ///
    /// # Errors
    /// If the columns are not those of the campaign, a cell is not a number, or not one of the texts that are chosen from.
    pub fn parse(path: &Path, text: &str, campaign: &Campaign) -> Result<Self> {
        let names: Vec<String> = campaign.vary.iter().map(|varied| varied.name.clone()).collect();
        let expected: Vec<&str> = std::iter::once(FLIGHT).chain(names.iter().map(String::as_str)).collect();
        let mut reader = csv::Reader::from_reader(text.as_bytes());
        let found: Vec<String> = reader.headers()?.iter().map(str::to_owned).collect();
        if found != expected {
            bail!(
                "{}: expected the columns {}, found {}; the campaign file has changed since: choose another --out",
                path.display(),
                expected.join(","),
                found.join(",")
            );
        }
        let mut flights = Vec::new();
        for record in reader.records() {
            let record = record.with_context(|| format!("{}: not a CSV file", path.display()))?;
            let line = record.position().map_or(0, csv::Position::line);
            let at = || format!("{}:{line}", path.display());
            let number = |(index, (column, cell)): (usize, (&String, &str))| {
                if let Some(choices) =
                    index.checked_sub(1).and_then(|index| campaign.vary[index].distribution.choices())
                {
                    let place = choices.iter().position(|choice| shown(choice) == cell);
                    let known = || choices.iter().map(shown).collect::<Vec<_>>().join(", ");
                    let problem = || {
                        format!("{}: column `{column}`: expected one of {}, found `{cell}`", at(), known())
                    };
                    return place.map(|place| place as f64).with_context(problem);
                }
                let number = cell.trim().parse::<f64>().ok().filter(|number| number.is_finite());
                let problem =
                    || format!("{}: column `{column}`: expected a finite number, found `{cell}`", at());
                number.with_context(problem)
            };
            let numbers = found.iter().zip(&record).enumerate().map(number).collect::<Result<Vec<f64>>>()?;
            #[allow(clippy::float_cmp, reason = "whole numbers")]
            if numbers[0] != flights.len() as f64 {
                bail!("{}: expected flight {}, found {}", at(), flights.len(), numbers[0]);
            }
            flights.push(numbers[1..].to_vec());
        }
        if flights.is_empty() {
            bail!("{}: there is no flight in it; remove the file to have it drawn again", path.display());
        }
        Ok(Self { names, flights })
    }

    /// Overrides of flight `flight` beyond those of all flights, as `--set` takes them.
    ///
    /// # Errors
    /// If a factor or an offset has no declared number to act on.
    pub fn sets(&self, campaign: &Campaign, base: &Base, flight: usize) -> Result<Vec<String>> {
        let mut sets = Vec::new();
        if !campaign.vary.iter().any(|varied| varied.keys.iter().any(|key| key == SEED)) {
            // Campaigns with other seeds share no noise.
            let seed =
                campaign.seed.wrapping_sub(1).wrapping_mul(FLIGHTS_MAX).wrapping_add(flight as u64 + 1);
            sets.push(format!("{SEED}={}", seed % SEEDS));
        }
        for (varied, drawn) in campaign.vary.iter().zip(&self.flights[flight]) {
            let values = base.values(varied, *drawn)?;
            sets.extend(values.into_iter().map(|(key, value)| format!("{key}={}", written(varied, value))));
        }
        Ok(sets)
    }

    /// Seed of the run of flight `flight`; none where the drawn one is no seed.
    ///
    /// # Errors
    /// As of [`Self::sets`].
    pub fn seed(&self, campaign: &Campaign, base: &Base, flight: usize) -> Result<Option<i64>> {
        let sets = self.sets(campaign, base, flight)?;
        let seed = sets.iter().rev().find_map(|set| set.strip_prefix(SEED)?.strip_prefix('='));
        Ok(seed.and_then(|seed| seed.parse().ok()))
    }
}

/// The value of a flight in the plan: the number, or the text that it stands for.
fn cell(varied: &Varied, drawn: f64) -> String {
    varied.distribution.choice(drawn).map_or_else(|| drawn.to_string(), shown)
}

/// The drawn value as TOML: a number is whole where its distribution is, since `seed = 3.0` is no seed.
fn written(varied: &Varied, value: f64) -> String {
    if let Some(choice) = varied.distribution.choice(value) {
        return choice.to_string();
    }
    let is_whole = varied.distribution.is_whole() && value.fract() == 0.0;
    if is_whole { format!("{value:.0}") } else { format!("{value:?}") }
}

#[cfg(test)]
mod tests {
    use super::Plan;
    use crate::declaration::Campaign;

    #[test]
    fn a_plan_has_the_texts_that_are_chosen_from() {
        let text = "manifest = \"a.toml\"\nsampling = \"grid\"\n[[vary]]\nkey = \"x.kind\"\nvalues = [\"pid\", \"lqr\"]";
        let campaign = Campaign::parse("c.toml".as_ref(), text).unwrap();
        let plan = Plan::of(&campaign);
        let csv = String::from_utf8(plan.to_csv(&campaign).unwrap()).unwrap();
        assert_eq!(csv, "flight,kind\n0,pid\n1,lqr\n");
        assert_eq!(Plan::parse("plan.csv".as_ref(), &csv, &campaign).unwrap(), plan);
        let edited = Plan::parse("plan.csv".as_ref(), "flight,kind\n0,lqg\n", &campaign).unwrap_err();
        assert_eq!(edited.to_string(), "plan.csv:2: column `kind`: expected one of pid, lqr, found `lqg`");
    }

    #[test]
    fn a_plan_is_read_as_it_was_written_and_an_edited_one_checked() {
        let text = "manifest = \"a.toml\"\nflights = 3\n[[vary]]\nkey = \"x\"\nnormal = [1e-9, 1e-3]";
        let campaign = Campaign::parse("c.toml".as_ref(), text).unwrap();
        let plan = Plan::of(&campaign);
        let csv = String::from_utf8(plan.to_csv(&campaign).unwrap()).unwrap();
        let read = |text: &str| {
            Plan::parse("plan.csv".as_ref(), text, &campaign).map_err(|error| format!("{error:#}"))
        };
        assert_eq!(read(&csv).unwrap(), plan);
        assert_eq!(read("flight,x\n0,7\n").unwrap().flights, [[7.0]]);
        for (text, expected) in [
            ("flight,y\n0,7\n", "expected the columns flight,x, found flight,y"),
            ("flight,x\n0,7\n0,8\n", "plan.csv:3: expected flight 1, found 0"),
            ("flight,x\n0,inf\n", "plan.csv:2: column `x`: expected a finite number, found `inf`"),
            ("flight,x\n0,7\nb,7\n", "plan.csv:3: column `flight`: expected a finite number, found `b`"),
            ("flight,x\n0\n", "not a CSV file"),
            ("flight,x\n", "there is no flight in it"),
        ] {
            let found = read(text).unwrap_err();
            assert!(found.contains(expected), "{found}");
        }
    }
}
