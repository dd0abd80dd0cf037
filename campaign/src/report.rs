//! The report of a campaign: pass rate, failures, distributions, influences, worst flights; as text and as JSON.

use crate::base::Base;
use crate::declaration::{Campaign, Start, Varied};
use crate::list::shown;
use crate::pass_rates::PassRates;
use crate::plan::Plan;
use crate::row::{Row, count};
use crate::statistics::{clopper_pearson, quantiles, rank_correlation};
use anyhow::{Context as _, Result};
use runtime::manifest::PassCondition;
use serde::Serialize;
use std::collections::BTreeMap;
use std::fmt;
use std::path::Path;

/// Confidence of the interval of the pass rate.
const CONFIDENCE: f64 = 0.95;
/// Flights that are listed with their commands.
const WORST: usize = 10;
/// Reasons of flights without figures that the text lists.
const REASONS: usize = 5;
/// Quantiles of a figure.
const QUANTILES: [f64; 5] = [0.0, 0.05, 0.5, 0.95, 1.0];
/// Chance below which a rank correlation is shown: one in a thousand, since many pairs are looked at.
const CHANCE_MAX: f64 = 1e-3;
/// Name of the outcome among the figures.
const PASSED: &str = "passed";

/// The report of a campaign.
#[derive(Debug, Serialize)]
pub struct Report {
    /// The campaign file.
    pub campaign: String,
    /// Build of hummingbus that flew the flights.
    pub version: String,
    /// The manifest that was flown.
    pub manifest: String,
    /// The checkpoint that all flights went on from.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub from: Option<String>,
    /// Flights in the plan.
    pub planned: u64,
    /// Flights with a row.
    pub flights: u64,
    /// Flights whose conditions all held.
    pub passed: u64,
    /// Flights without figures.
    pub broken: u64,
    /// Those of them that the host ended: the next call flies them again.
    pub lost: u64,
    /// Part of the flights that passed.
    pub pass_rate: f64,
    /// Its interval at 95 % (Clopper and Pearson).
    pub interval: [f64; 2],
    /// Conditions that failed first, most frequent first.
    pub failures: Vec<Failure>,
    /// Reasons of flights without figures, most frequent first.
    pub errors: Vec<Reason>,
    /// Distribution of each figure.
    pub figures: Vec<Spread>,
    /// Flights by each text or truth value that a varied value is chosen from.
    pub choices: Vec<Choice>,
    /// Pass rates by each varied number.
    pub pass_rates: Vec<PassRates>,
    /// Rank correlations that chance does not explain, strongest first; behind them, pass rates that chance does not explain.
    pub influences: Vec<Influence>,
    /// Command that flies a flight again, recorded; `FLIGHT` stands for its number.
    pub again: String,
    /// Worst flights, worst first.
    pub worst: Vec<Worst>,
}

/// A condition that failed first in some flights.
#[derive(Debug, Serialize)]
pub struct Failure {
    /// Name of the condition.
    pub condition: String,
    /// Flights in which it failed first.
    pub flights: u64,
    /// Median simulation time of the failure, s.
    pub median_s: Option<f64>,
}

/// Reason of flights without figures: their errors differ in numbers alone.
#[derive(Debug, PartialEq, Serialize)]
pub struct Reason {
    /// Number of flights.
    pub flights: u64,
    /// Number of the first one.
    pub flight: u64,
    /// Error of the first one.
    pub error: String,
}

/// Distribution of a figure over the flights.
#[derive(Debug, Serialize)]
pub struct Spread {
    /// Name of the figure.
    pub figure: String,
    /// Unit of the values.
    pub unit: String,
    /// Flights with a value.
    pub flights: u64,
    /// Least value, 5 %, median, 95 %, greatest value.
    pub quantiles: Vec<f64>,
}

/// Flights with one of the texts or truth values of a varied value.
#[derive(Debug, Serialize)]
pub struct Choice {
    /// Name of the varied value.
    pub varied: String,
    /// Its text.
    pub choice: String,
    /// Flights with it.
    pub flights: u64,
    /// Those whose conditions all held.
    pub passed: u64,
    /// Part of them that passed.
    pub pass_rate: f64,
    /// Its interval at 95 % (Clopper and Pearson).
    pub interval: [f64; 2],
    /// Median of each figure of the report.
    pub medians: Vec<Option<f64>>,
}

/// Influence of a varied value on the outcome or a figure.
#[derive(Debug, Serialize)]
pub struct Influence {
    /// Name of the varied value.
    pub varied: String,
    /// Name of the figure, or `passed`.
    pub figure: String,
    /// Spearman's rank correlation.
    pub rank_correlation: f64,
    /// Chance of one as large, or of pass rates as different, without any relation.
    pub chance: f64,
    /// Test that has found it.
    pub test: Test,
}

/// Test of an influence.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Test {
    /// Spearman's rank correlation.
    RankCorrelation,
    /// Chi-square test of the pass rates by the value.
    PassRates,
}

/// A flight near the end of the list.
#[derive(Debug, Serialize)]
pub struct Worst {
    /// Number of the flight.
    pub flight: u64,
    /// Reason: the failed condition, the error, or the smallest margin.
    pub reason: String,
    /// Command that flies it again, recorded, to the same figures.
    pub command: String,
    /// Command that flies it without the campaign's folder and measures.
    pub run: String,
}

impl Report {
    /// The report of the `rows` that hummingbus `build` has flown so far; `folder` holds the plan.
    ///
    /// # Errors
    /// If the values of a flight cannot be written as overrides, or the working directory is gone.
    pub fn of(
        campaign: &Campaign,
        base: &Base,
        plan: &Plan,
        rows: &[Row],
        folder: &Path,
        build: &str,
    ) -> Result<Self> {
        let flights = rows.len() as u64;
        let passed = rows.iter().filter(|row| row.passed).count() as u64;
        let pass_rates = pass_rates(campaign, rows);
        Ok(Self {
            campaign: campaign.path.display().to_string(),
            version: build.to_owned(),
            manifest: base.manifest.path.display().to_string(),
            from: match &campaign.start {
                Start::Manifest(_) => None,
                Start::Checkpoint(path) => Some(path.display().to_string()),
            },
            planned: plan.flights.len() as u64,
            flights,
            passed,
            broken: rows.iter().filter(|row| row.error.is_some()).count() as u64,
            lost: rows.iter().filter(|row| row.is_of_host).count() as u64,
            pass_rate: passed as f64 / flights.max(1) as f64,
            interval: clopper_pearson(passed, flights.max(1), CONFIDENCE),
            failures: failures(rows),
            errors: errors(rows),
            figures: spreads(base, rows),
            choices: choices(campaign, base, rows),
            influences: influences(campaign, base, rows, &pass_rates),
            pass_rates,
            again: again(campaign, folder, "FLIGHT")?,
            worst: worst(campaign, base, plan, rows, folder)?,
        })
    }
}

fn failures(rows: &[Row]) -> Vec<Failure> {
    let mut by_condition: BTreeMap<&str, Vec<Option<f64>>> = BTreeMap::new();
    for row in rows {
        if let Some(failed) = &row.failed {
            by_condition.entry(failed).or_default().push(row.failed_at_s);
        }
    }
    let failure = |(condition, times): (&str, Vec<Option<f64>>)| {
        let known: Vec<f64> = times.iter().flatten().copied().collect();
        let median_s = quantiles(&known, &[0.5]).first().copied();
        Failure { condition: condition.to_owned(), flights: times.len() as u64, median_s }
    };
    let mut failures: Vec<Failure> = by_condition.into_iter().map(failure).collect();
    failures.sort_by_key(|failure| std::cmp::Reverse(failure.flights));
    failures
}

fn errors(rows: &[Row]) -> Vec<Reason> {
    let mut reasons: BTreeMap<String, Reason> = BTreeMap::new();
    for row in rows {
        let Some(error) = &row.error else { continue };
        let first = || Reason { flights: 0, flight: row.flight, error: error.clone() };
        reasons.entry(masked(error)).or_insert_with(first).flights += 1;
    }
    let mut reasons: Vec<Reason> = reasons.into_values().collect();
    reasons.sort_by_key(|reason| (std::cmp::Reverse(reason.flights), reason.flight));
    reasons
}

/// `text` with `…` in place of each number: the errors of two flights have the values that were drawn.
fn masked(text: &str) -> String {
    let (mut masked, mut rest, mut is_in_word) = (String::new(), text, false);
    while let Some(first) = rest.chars().next() {
        let number = if is_in_word { 0 } else { number_length(rest) };
        let (shown, length) = if number > 0 { ('…', number) } else { (first, first.len_utf8()) };
        masked.push(shown);
        is_in_word = number > 0 || first.is_alphanumeric() || first == '_';
        rest = &rest[length..];
    }
    masked
}

/// Length of the number at the start of `text` in bytes; 0 if there is none.
fn number_length(text: &str) -> usize {
    let digits = |from: usize| text[from..].bytes().take_while(u8::is_ascii_digit).count();
    let sign = |from: usize| usize::from(text[from..].starts_with(['-', '+']));
    let mut end = sign(0) + digits(sign(0));
    if end == sign(0) {
        return 0;
    }
    if text[end..].starts_with('.') && digits(end + 1) > 0 {
        end += 1 + digits(end + 1);
    }
    if text[end..].starts_with(['e', 'E']) {
        let exponent = end + 1 + sign(end + 1);
        if digits(exponent) > 0 {
            end = exponent + digits(exponent);
        }
    }
    end
}

fn spreads(base: &Base, rows: &[Row]) -> Vec<Spread> {
    let spread = |&index: &usize| {
        let values: Vec<f64> = rows.iter().filter_map(|row| *row.figures.get(index)?).collect();
        Spread {
            figure: base.figures[index].clone(),
            unit: base.units[index].clone(),
            flights: values.len() as u64,
            quantiles: quantiles(&values, &QUANTILES),
        }
    };
    base.kept.iter().map(spread).collect()
}

fn choices(campaign: &Campaign, base: &Base, rows: &[Row]) -> Vec<Choice> {
    let mut choices = Vec::new();
    for (index, varied) in campaign.vary.iter().enumerate() {
        for choice in varied.distribution.choices().unwrap_or_default() {
            let is_it = |row: &&Row| {
                row.drawn.get(index).and_then(|drawn| varied.distribution.choice(*drawn)) == Some(choice)
            };
            let of_choice: Vec<&Row> = rows.iter().filter(is_it).collect();
            let flights = of_choice.len() as u64;
            let passed = of_choice.iter().filter(|row| row.passed).count() as u64;
            let median = |&figure: &usize| {
                let values: Vec<f64> = of_choice.iter().filter_map(|row| *row.figures.get(figure)?).collect();
                quantiles(&values, &[0.5]).first().copied()
            };
            choices.push(Choice {
                varied: varied.name.clone(),
                choice: shown(choice),
                flights,
                passed,
                pass_rate: passed as f64 / flights.max(1) as f64,
                interval: clopper_pearson(passed, flights.max(1), CONFIDENCE),
                medians: base.kept.iter().map(median).collect(),
            });
        }
    }
    choices
}

/// Pass rates by each varied number, of the flights with figures.
fn pass_rates(campaign: &Campaign, rows: &[Row]) -> Vec<PassRates> {
    let mut rates = Vec::new();
    for (varied, Varied { name, distribution, .. }) in campaign.vary.iter().enumerate() {
        if distribution.choices().is_none() {
            let known = rows.iter().filter(|row| row.error.is_none());
            let flights: Vec<(f64, bool)> =
                known.filter_map(|row| Some((*row.drawn.get(varied)?, row.passed))).collect();
            rates.push(PassRates::of(name, &flights));
        }
    }
    rates
}

/// Rank correlations of the varied numbers: texts have no order. Behind them are the pass rates that differ, of numbers whose rank
/// correlation does not show it.
fn influences(campaign: &Campaign, base: &Base, rows: &[Row], rates: &[PassRates]) -> Vec<Influence> {
    let mut influences = Vec::new();
    for (varied, Varied { name, distribution, .. }) in campaign.vary.iter().enumerate() {
        if distribution.choices().is_some() {
            continue;
        }
        let mut add = |figure: &str, value: &dyn Fn(&Row) -> Option<f64>| {
            let pairs: Vec<(f64, f64)> =
                rows.iter().filter_map(|row| Some((*row.drawn.get(varied)?, value(row)?))).collect();
            if let Some((rank_correlation, chance)) =
                rank_correlation(&pairs).filter(|(_, chance)| *chance < CHANCE_MAX)
            {
                let (varied, figure) = (name.clone(), figure.to_owned());
                let test = Test::RankCorrelation;
                influences.push(Influence { varied, figure, rank_correlation, chance, test });
            }
        };
        add(PASSED, &|row| row.error.is_none().then_some(if row.passed { 1.0 } else { 0.0 }));
        for &index in &base.kept {
            add(&base.figures[index], &|row| row.figures.get(index).copied().flatten());
        }
    }
    influences.sort_by(|a, b| b.rank_correlation.abs().total_cmp(&a.rank_correlation.abs()));
    let chance_max = CHANCE_MAX / rates.len().max(1) as f64;
    for PassRates { varied, rank_correlation, chance, .. } in rates {
        let is_listed = influences.iter().any(|it| it.varied == *varied && it.figure == PASSED);
        if let Some(chance) = chance.filter(|chance| *chance < chance_max && !is_listed) {
            let (varied, figure) = (varied.clone(), PASSED.to_owned());
            let rank_correlation = rank_correlation.unwrap_or_default();
            influences.push(Influence { varied, figure, rank_correlation, chance, test: Test::PassRates });
        }
    }
    influences
}

/// The worst flights: those without figures, then those that failed, then those with the smallest margin to a limit.
fn worst(campaign: &Campaign, base: &Base, plan: &Plan, rows: &[Row], folder: &Path) -> Result<Vec<Worst>> {
    let mut ranked: Vec<(f64, String, &Row)> = rows.iter().map(|row| rank(base, row)).collect();
    let order = |ranked: &(f64, String, &Row)| (ranked.2.error.is_none(), ranked.2.passed);
    ranked
        .sort_by(|a, b| order(a).cmp(&order(b)).then(a.0.total_cmp(&b.0)).then(a.2.flight.cmp(&b.2.flight)));
    ranked.truncate(WORST);
    let listed = |(_, reason, row): (f64, String, &Row)| {
        let sets = plan.sets(campaign, base, row.flight as usize)?;
        let command = again(campaign, folder, &row.flight.to_string())?;
        let run = run(campaign, row.flight, &sets)?;
        Ok(Worst { flight: row.flight, reason, command, run })
    };
    ranked.into_iter().map(listed).collect()
}

/// Margin of a flight, and the reason why it is so small.
fn rank<'r>(base: &Base, row: &'r Row) -> (f64, String, &'r Row) {
    if let Some(error) = &row.error {
        return (f64::NEG_INFINITY, error.clone(), row);
    }
    let mut values = row.figures.iter();
    let margins = base.manifest.content.pass.iter().map(|pass| {
        let pass = pass.get_ref();
        let values = values.by_ref().take(count(pass.statistic));
        let margins = values.map(|value| value.map_or(f64::NEG_INFINITY, |value| margin(pass, value)));
        (margins.fold(f64::INFINITY, f64::min), &pass.name)
    });
    let least = margins.min_by(|a, b| a.0.total_cmp(&b.0));
    let (margin, name) = least.map_or((f64::INFINITY, ""), |(margin, name)| (margin, name));
    let reason = match (&row.failed, row.failed_at_s) {
        (Some(failed), Some(at_s)) => format!("failed first at {at_s:.3} s: {failed}"),
        (Some(failed), None) => format!("failed: {failed}"),
        (None, _) if margin.is_infinite() => "passed; no condition has a limit".to_owned(),
        (None, _) => format!("passed with a margin of {:.1} %: {name}", 100.0 * margin),
    };
    (margin, reason, row)
}

/// Distance of `value` to the nearest limit, as a part of the width between the limits, or of the only limit.
fn margin(pass: &PassCondition, value: f64) -> f64 {
    let scale = match (pass.min, pass.max) {
        (Some(min), Some(max)) => max - min,
        (Some(limit), None) | (None, Some(limit)) => limit.abs(),
        (None, None) => return f64::INFINITY,
    };
    let below = pass.max.map_or(f64::INFINITY, |max| max - value);
    let above = pass.min.map_or(f64::INFINITY, |min| value - min);
    below.min(above) / if scale > 0.0 { scale } else { 1.0 }
}

/// The command that flies a flight again, recorded, to the same figures; it works from any folder.
fn again(campaign: &Campaign, folder: &Path, flight: &str) -> Result<String> {
    let (file, folder) = (absolute(&campaign.path)?, absolute(folder)?);
    Ok(format!("hummingbus campaign {file} --out {folder} --fly {flight}"))
}

/// The `run` command of a flight: without the measures of the campaign file, and in no need of the folder.
fn run(campaign: &Campaign, flight: u64, sets: &[String]) -> Result<String> {
    let start = match &campaign.start {
        Start::Manifest(path) => absolute(path)?,
        Start::Checkpoint(path) => format!("--from {}", absolute(path)?),
    };
    let sets = campaign.set.iter().chain(sets).map(|set| format!(" --set {}", word(set)));
    Ok(format!("hummingbus run {start} --record flight-{flight}.mcap{}", sets.collect::<String>()))
}

/// `path` from the root on, as one word of a shell.
fn absolute(path: &Path) -> Result<String> {
    let path = std::path::absolute(path).context("the working directory is gone")?;
    Ok(word(&inputs::tidy(&path).display().to_string()))
}

/// `text` as one word of a shell.
fn word(text: &str) -> String {
    let is_plain = |c: char| c.is_alphanumeric() || "/._-+=:,@".contains(c);
    if text.chars().all(is_plain) { text.to_owned() } else { format!("'{}'", text.replace('\'', "'\\''")) }
}

/// Text of a number of flights.
///
/// ```
/// use campaign::report::flights;
/// assert_eq!([flights(1), flights(2)], ["1 flight", "2 flights"]);
/// ```
#[must_use]
pub fn flights(count: u64) -> String {
    if count == 1 { "1 flight".to_owned() } else { format!("{count} flights") }
}

/// Text of a unit behind a number; empty for a pure number.
///
/// ```
/// use campaign::report::with_unit;
/// assert_eq!(["m", "1"].map(with_unit), [" m", ""]);
/// ```
#[must_use]
pub fn with_unit(unit: &str) -> String {
    if unit == "1" { String::new() } else { format!(" {unit}") }
}

impl Report {
    /// Flights without figures: their number, then the most frequent reasons, each with the error of a flight.
    fn write_errors(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.broken > 0 {
            writeln!(f, "  {} without figures:", flights(self.broken))?;
        }
        let (shown, others) = self.errors.split_at(self.errors.len().min(REASONS));
        for Reason { flights: count, flight, error } in shown {
            let such_as = if *count > 1 {
                format!("{count} such as flight {flight}")
            } else {
                format!("flight {flight}")
            };
            writeln!(f, "    {such_as}: {}", error.lines().next().unwrap_or_default())?;
        }
        match others.iter().map(|reason| reason.flights).sum() {
            0 => Ok(()),
            more => writeln!(f, "    and {} more; report.json has all reasons", flights(more)),
        }
    }
}

impl Report {
    /// Warnings of the figures that no flight has, if there are flights with figures.
    fn write_missing(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.flights == self.broken {
            return Ok(());
        }
        self.figures.iter().filter(|spread| spread.flights == 0).try_for_each(|spread| {
            let figure = &spread.figure;
            writeln!(
                f,
                "  warning: no flight has a value of `{figure}`; look at its span, and at run.duration_s"
            )
        })
    }
}

impl Report {
    /// The strongest rank correlations, and the pass rates that chance does not explain.
    fn write_influences(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let of = |test: Test| self.influences.iter().filter(move |it| it.test == test);
        for Influence { varied, figure, rank_correlation, .. } in of(Test::RankCorrelation).take(WORST) {
            writeln!(f, "    {rank_correlation:+.2} of `{varied}` with: {figure}")?;
        }
        if of(Test::RankCorrelation).next().is_none() {
            writeln!(f, "    none that chance does not explain")?;
        }
        for Influence { varied, .. } in of(Test::PassRates) {
            let mut rates = self.pass_rates.iter().filter(|rates| rates.varied == *varied);
            rates.try_for_each(|rates| writeln!(f, "  {rates}"))?;
        }
        Ok(())
    }
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [low, high] = self.interval.map(|limit| 100.0 * limit);
        let (campaign, passed, flights, rate) =
            (&self.campaign, self.passed, self.flights, 100.0 * self.pass_rate);
        writeln!(
            f,
            "{campaign}: {passed} of {flights} flights passed: {rate:.2} % ({low:.2} … {high:.2} % at 95 %)"
        )?;
        if flights < self.planned {
            writeln!(f, "  {} of {} planned flights were not flown", self.planned - flights, self.planned)?;
        }
        self.failures.iter().try_for_each(|failure| writeln!(f, "  {failure}"))?;
        self.write_errors(f)?;
        self.write_missing(f)?;
        writeln!(f, "  minimum, 5th percentile, median, 95th percentile, maximum:")?;
        self.figures.iter().try_for_each(|spread| writeln!(f, "    {spread}"))?;
        self.choices.iter().try_for_each(|choice| writeln!(f, "  {choice}"))?;
        writeln!(f, "  rank correlations (Spearman), strongest first:")?;
        self.write_influences(f)?;
        writeln!(f, "  worst flights; each is flown again, recorded, by: {}", self.again)?;
        let mut worst = self.worst.iter();
        worst.try_for_each(|Worst { flight, reason, .. }| {
            writeln!(f, "    {flight}: {}", reason.lines().next().unwrap_or_default())
        })
    }
}

impl fmt::Display for Failure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let at = self.median_s.map_or(String::new(), |at_s| format!(", at {at_s:.2} s in the median"));
        write!(f, "failed first in {}{at}: {}", flights(self.flights), self.condition)
    }
}

impl fmt::Display for Choice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { varied, choice, passed, flights, pass_rate, interval, .. } = self;
        let [low, high] = interval.map(|limit| 100.0 * limit);
        let rate = 100.0 * pass_rate;
        write!(
            f,
            "`{varied}` = {choice}: {passed} of {flights} passed: {rate:.2} % ({low:.2} … {high:.2} % at 95 %)"
        )
    }
}

impl fmt::Display for Spread {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let values: Vec<String> = self.quantiles.iter().map(|value| format!("{value:.4}")).collect();
        let values = if values.is_empty() {
            "no value".to_owned()
        } else {
            values.join(", ") + &with_unit(&self.unit)
        };
        write!(f, "{}: {values}", self.figure)
    }
}

#[cfg(test)]
mod tests {
    use super::{Reason, Spread, errors, masked};
    use crate::row::Row;

    #[test]
    fn errors_that_differ_in_drawn_values_are_one_reason() {
        let broken = |flight, error: &str| Row::broken(flight, error.to_owned());
        let rows = [
            broken(0, "h1/plant: mass=-1e-5: found -0.5 kg"),
            broken(1, "h1/plant: mass=2: found -3.25E+2 kg"),
            broken(2, "h2/plant: mass=-7.5: found 3 kg"),
            Row { flight: 3, ..Row::default() },
            broken(4, "h1/plant: mass=9.: found 10 kg"),
        ];
        let reason = |flights, flight, error: &str| Reason { flights, flight, error: error.to_owned() };
        let expected = [
            reason(2, 0, "h1/plant: mass=-1e-5: found -0.5 kg"),
            reason(1, 2, "h2/plant: mass=-7.5: found 3 kg"),
            reason(1, 4, "h1/plant: mass=9.: found 10 kg"),
        ];
        assert_eq!(errors(&rows), expected);
        assert_eq!(masked("c.toml:6:7: m^2 x_1 -5"), "c.toml:…:…: m^… x_1 …");
    }

    #[test]
    fn a_distribution_has_its_unit() {
        let spread = |unit: &str, quantiles: &[f64]| {
            let (figure, unit) = ("height".to_owned(), unit.to_owned());
            Spread { figure, unit, flights: 1, quantiles: quantiles.to_vec() }.to_string()
        };
        assert_eq!(spread("m", &[1.0, 2.5]), "height: 1.0000, 2.5000 m");
        assert_eq!(spread("1", &[1.0]), "height: 1.0000");
        assert_eq!(spread("m", &[]), "height: no value");
    }
}
