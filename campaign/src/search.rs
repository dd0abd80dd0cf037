//! The search for gains: candidates of an optimiser (CMA-ES, the crate `cmaes`), flown by workers.
//!
//! Costs of a candidate are the mean over the flights of the tuning's plan. All candidates fly the same flights, so that
//! noise does not choose between them. The result is judged by flights that no candidate has flown.

#![allow(clippy::disallowed_types, reason = "vectors of the optimiser, whose limits docs/tuning.md states")]

use crate::base::Base;
use crate::declaration::Campaign;
use crate::flying::Flying;
use crate::plan::Plan;
use crate::row::Row;
use crate::tuning::{Term, Tuning};
use anyhow::{Context, Result, bail};
use cmaes::{CMAESOptions, DVector};
use serde::Serialize;
use std::sync::Mutex;

/// Costs of a flight without figures, in multiples of today's costs: it is worse than any flight.
const BROKEN: f64 = 1e3;
/// Costs of a candidate beyond a range, for the square of the distance in ranges, in multiples of today's costs.
const BEYOND: f64 = 10.0;

/// Result of a tuning.
#[derive(Clone, Debug, Serialize)]
pub struct Outcome {
    /// Tuned gains.
    pub gains: Vec<TunedGain>,
    /// Generations of the optimiser.
    pub generations: usize,
    /// Candidates that were flown.
    pub candidates: usize,
    /// Flights that the candidates were tuned by.
    pub tuned_on: Comparison,
    /// Other flights, by which the result is judged.
    pub held_out: Comparison,
}

/// A tuned gain.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct TunedGain {
    /// Name in the tuning file.
    pub name: String,
    /// Keys in the gains file.
    pub keys: Vec<String>,
    /// Declared value.
    pub before: f64,
    /// Tuned value.
    pub after: f64,
    /// Unit of both.
    pub unit: String,
}

/// Flights with the declared and the tuned gains, side by side.
#[derive(Clone, Debug, Serialize)]
pub struct Comparison {
    /// Number of flights.
    pub flights: usize,
    /// Seed of their plan.
    pub seed: u64,
    /// Costs: mean of a flight.
    pub costs: Change,
    /// Standard error of the difference of the costs, flight by flight.
    pub standard_error: f64,
    /// Flights in which a condition of the manifest does not hold.
    pub failed: Change,
    /// Terms of the costs: mean of each figure, by its name.
    pub figures: Vec<(String, FigureChange)>,
}

/// Mean of a figure before and after.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct FigureChange {
    /// Both means.
    #[serde(flatten)]
    pub change: Change,
    /// Their unit.
    pub unit: String,
}

/// State of a search after a generation.
#[derive(Clone, Debug, Serialize)]
pub struct Progress {
    /// Generations so far.
    pub generation: usize,
    /// Candidates that were flown.
    pub candidates: usize,
    /// Costs of the declared gains and of the best candidate, on the flights that it was tuned by.
    pub costs: Change,
    /// Gains of the best candidate.
    pub gains: Vec<TunedGain>,
}

/// A number before and after.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Change {
    /// With the declared gains.
    pub before: f64,
    /// With the tuned gains.
    pub after: f64,
}

impl Change {
    /// Change as a part of the number before.
    #[must_use]
    pub fn relative(self) -> f64 {
        (self.after - self.before) / self.before
    }
}

/// Flights of a plan, flown with one candidate's gains after the other's.
struct Course<'a> {
    tuning: &'a Tuning,
    flying: &'a Flying<'a>,
    /// Overrides of each flight.
    sets: Vec<Vec<String>>,
    /// Column of each term's figure.
    columns: Vec<usize>,
    /// Unit of each term's figure.
    units: Vec<String>,
    seed: u64,
}

/// Costs of a candidate.
#[derive(Debug)]
struct Flown {
    /// Costs by flight; none where it has no figures.
    costs: Vec<Option<f64>>,
    failed: usize,
    /// Mean of each term's figure over the flights that have figures.
    figures: Vec<f64>,
    /// Reason of the first flight without figures.
    error: Option<String>,
}

/// Tunes the gains of `tuning`; `tell` hears of each generation.
///
/// # Errors
/// If a gain or a figure does not exist, today's gains do not fly, or the flights are stopped.
pub fn search(
    tuning: &Tuning,
    base: &Base,
    flying: &Flying<'_>,
    tell: &(dyn Fn(Progress) + Sync),
) -> Result<Outcome> {
    let declared = declared(tuning, base)?;
    let start = tuning.gains.iter().zip(&declared).map(|(gain, declared)| gain.start(*declared));
    let start: Vec<f64> = start.collect::<Result<_, _>>()?;
    let course = Course::new(tuning, &tuning.campaign, base, flying)?;
    let today = course.fly(&declared)?;
    let costs_today = today.mean().with_context(|| today.no_figures())?;
    if costs_today <= 0.0 {
        bail!("the costs with today's gains are {costs_today}: expected a figure above 0 to be minimised");
    }
    let values = |point: &DVector<f64>| -> Vec<f64> {
        let gains = tuning.gains.iter().zip(&declared).zip(point.iter());
        gains.map(|((gain, declared), x)| gain.value(*declared, *x)).collect()
    };
    let gains_file = gains_text(tuning, base);
    let tuned = |after: &[f64]| -> Vec<TunedGain> {
        let gains = tuning.gains.iter().zip(declared.iter().zip(after));
        let tuned = gains.map(|(gain, (before, after))| TunedGain {
            unit: gain.unit(&gains_file),
            name: gain.name.clone(),
            keys: gain.keys.clone(),
            before: *before,
            after: *after,
        });
        tuned.collect()
    };
    let failure = Mutex::new(None);
    let costs = |point: &DVector<f64>| match course.fly(&values(point)) {
        Ok(flown) => flown.relative_costs(costs_today) + beyond(point),
        Err(error) => {
            failure.lock().unwrap_or_else(std::sync::PoisonError::into_inner).get_or_insert(error);
            // Ends the search.
            f64::NAN
        }
    };
    let mut options =
        CMAESOptions::new(start, tuning.step).seed(tuning.seed).max_generations(tuning.generations);
    if let Some(population) = tuning.population {
        options = options.population_size(population);
    }
    let search = options.build(costs);
    let mut search =
        search.map_err(|error| anyhow::anyhow!("the optimiser refuses its options: {error:?}"))?;
    loop {
        let end = search.next_parallel();
        if let Some(error) = failure.lock().unwrap_or_else(std::sync::PoisonError::into_inner).take() {
            return Err(error);
        }
        if let Some(best) = search.overall_best_individual() {
            tell(Progress {
                generation: search.generation(),
                candidates: search.function_evals(),
                costs: Change { before: costs_today, after: best.value * costs_today },
                gains: tuned(&values(&best.point)),
            });
        }
        if end.is_some() {
            break;
        }
    }
    let best = search.overall_best_individual().context("the optimiser has flown nothing")?;
    // The mean of the last generation may be better than each candidate.
    let mean = values(search.mean());
    let mean_costs = course.fly(&mean)?.relative_costs(costs_today) + beyond(search.mean());
    let (least, after) =
        if mean_costs < best.value { (mean_costs, mean) } else { (best.value, values(&best.point)) };
    let after = if least < 1.0 { after } else { declared.clone() };
    let held_out = Course::new(tuning, &tuning.held_out, base, flying)?;
    Ok(Outcome {
        gains: tuned(&after),
        generations: search.generation(),
        candidates: search.function_evals(),
        tuned_on: course.compare(&declared, &after)?,
        held_out: held_out.compare(&declared, &after)?,
    })
}

/// Declared values of the tuned gains.
fn declared(tuning: &Tuning, base: &Base) -> Result<Vec<f64>> {
    let value = |gain: &crate::tuning::Tuned| {
        let number = |(index, key): (usize, &String)| {
            let whole = format!("process.{}.gains.{key}", tuning.process);
            let number = base.manifest.number(&base.files, &whole)?;
            number.ok_or_else(|| gain.unknown(index, &gains_text(tuning, base)))
        };
        let numbers = gain.keys.iter().enumerate().map(number).collect::<Result<Vec<_>, _>>()?;
        #[allow(clippy::float_cmp, reason = "numbers of a file")]
        if numbers.iter().any(|number| *number != numbers[0]) {
            let message =
                format!("{} differ in the gains file: tune each by itself", gain.keys.join(" and "));
            return Err(gain.problem(message));
        }
        Ok(numbers[0])
    };
    Ok(tuning.gains.iter().map(value).collect::<Result<Vec<_>, diagnostics::Diagnostic>>()?)
}

/// Text of the tuned gains file.
fn gains_text(tuning: &Tuning, base: &Base) -> String {
    let path = base.manifest.file_path(&tuning.process, "gains");
    path.and_then(|path| base.files.text(&path).ok()).unwrap_or_default()
}

/// Costs of coordinates beyond 0 and 1, where the gains are those of the limit.
fn beyond(point: &DVector<f64>) -> f64 {
    let distance = |x: &f64| x - x.clamp(0.0, 1.0);
    BEYOND * point.iter().map(|x| distance(x) * distance(x)).sum::<f64>()
}

impl<'a> Course<'a> {
    fn new(tuning: &'a Tuning, campaign: &Campaign, base: &Base, flying: &'a Flying<'a>) -> Result<Self> {
        let plan = Plan::of(campaign);
        let sets = (0..plan.flights.len()).map(|flight| plan.sets(campaign, base, flight));
        let sets = sets.collect::<Result<Vec<_>>>()?;
        let known = &base.figures;
        let column = |term: &Term| {
            let found = known.iter().position(|column| *column == term.figure);
            found.ok_or_else(|| term.unknown(known))
        };
        let columns: Vec<usize> =
            tuning.terms.iter().map(column).collect::<Result<_, diagnostics::Diagnostic>>()?;
        let units = columns.iter().map(|&column| base.units[column].clone()).collect();
        Ok(Self { tuning, flying, sets, columns, units, seed: campaign.seed })
    }

    /// Flies all flights with these values of the gains.
    fn fly(&self, values: &[f64]) -> Result<Flown> {
        let gains: Vec<String> = self
            .tuning
            .gains
            .iter()
            .zip(values)
            .flat_map(|(gain, value)| {
                gain.keys
                    .iter()
                    .map(move |key| format!("process.{}.gains.{key}={value:?}", self.tuning.process))
            })
            .collect();
        let rows = self.flying.fly(self.sets.iter().map(|sets| [&sets[..], &gains].concat()))?;
        // Another attempt could end otherwise, and the result with it.
        if let Some(row) = rows.iter().find(|row| row.is_of_host) {
            bail!("a flight of a candidate was lost: {}", row.error.as_deref().unwrap_or_default());
        }
        let costs: Vec<Option<f64>> = rows.iter().map(|row| self.costs(row)).collect();
        let whole: Vec<&Row> =
            rows.iter().zip(&costs).filter(|(_, costs)| costs.is_some()).map(|it| it.0).collect();
        let mean = |column: &usize| {
            whole.iter().filter_map(|row| row.figures[*column]).sum::<f64>() / whole.len() as f64
        };
        Ok(Flown {
            failed: rows.iter().filter(|row| !row.passed).count(),
            figures: self.columns.iter().map(mean).collect(),
            error: rows.iter().find_map(|row| row.error.clone()),
            costs,
        })
    }

    /// Costs of a flight; none if a figure is missing.
    fn costs(&self, row: &Row) -> Option<f64> {
        let terms = self.columns.iter().zip(&self.tuning.terms);
        let terms = terms.map(|(column, term)| Some(term.weight * (*row.figures.get(*column)?)?));
        let failed = if row.passed { 0.0 } else { self.tuning.failed_costs };
        Some(failed + terms.sum::<Option<f64>>()?)
    }

    fn compare(&self, before: &[f64], after: &[f64]) -> Result<Comparison> {
        let (before, after) = (self.fly(before)?, self.fly(after)?);
        let mean = |flown: &Flown| flown.mean().with_context(|| flown.no_figures());
        let costs = Change { before: mean(&before)?, after: mean(&after)? };
        let pairs = before.costs.iter().flatten().zip(after.costs.iter().flatten());
        let differences: Vec<f64> = pairs.map(|(before, after)| after - before).collect();
        let terms = self.tuning.terms.iter().zip(&self.units);
        let figures = terms.zip(before.figures.iter().zip(&after.figures));
        let figures = figures.map(|((term, unit), (before, after))| {
            let change = Change { before: *before, after: *after };
            (term.figure.clone(), FigureChange { change, unit: unit.clone() })
        });
        Ok(Comparison {
            flights: differences.len(),
            seed: self.seed,
            costs,
            standard_error: standard_error(&differences),
            failed: Change { before: before.failed as f64, after: after.failed as f64 },
            figures: figures.collect(),
        })
    }
}

impl Flown {
    /// Mean costs of a flight; none if a flight has no figures.
    fn mean(&self) -> Option<f64> {
        let sum = self.costs.iter().copied().sum::<Option<f64>>()?;
        Some(sum / self.costs.len() as f64)
    }

    /// Costs relative to today's; finite, so that the optimiser can go on.
    fn relative_costs(&self, today: f64) -> f64 {
        let costs = self.costs.iter().map(|costs| costs.map_or(BROKEN, |costs| (costs / today).min(BROKEN)));
        costs.sum::<f64>() / self.costs.len() as f64
    }

    fn no_figures(&self) -> String {
        let why = self.error.as_deref().unwrap_or("a figure has no value");
        format!("a flight has no figures: {why}")
    }
}

/// Standard error of the mean of `values`; 0 for a single one.
fn standard_error(values: &[f64]) -> f64 {
    let count = values.len() as f64;
    if values.len() < 2 {
        return 0.0;
    }
    let mean = values.iter().sum::<f64>() / count;
    let variance = values.iter().map(|value| (value - mean) * (value - mean)).sum::<f64>() / (count - 1.0);
    (variance / count).sqrt()
}

#[cfg(test)]
mod tests {
    use super::{Flown, beyond, standard_error};
    use cmaes::DVector;

    #[test]
    fn a_broken_flight_costs_more_than_any_other_and_leaves_the_costs_finite() {
        let flown =
            |costs: &[Option<f64>]| Flown { costs: costs.to_vec(), failed: 0, figures: vec![], error: None };
        assert_eq!(flown(&[Some(1.0), Some(3.0)]).relative_costs(2.0), 1.0);
        assert_eq!(flown(&[Some(2.0), None]).relative_costs(2.0), 500.5);
        assert_eq!(flown(&[Some(f64::INFINITY)]).relative_costs(2.0), 1e3);
        assert_eq!(flown(&[Some(2.0), None]).mean(), None);
    }

    #[test]
    fn a_candidate_beyond_its_range_costs_more_the_farther_it_is() {
        let at = |x: f64| beyond(&DVector::from(vec![0.5, x]));
        assert_eq!([at(0.0), at(1.0)], [0.0, 0.0]);
        assert!(at(-0.1) > 0.0 && at(1.2) > at(1.1));
    }

    #[test]
    fn the_standard_error_is_that_of_the_mean() {
        assert_eq!(standard_error(&[1.0]), 0.0);
        assert_eq!(standard_error(&[1.0, 3.0]), 1.0);
    }
}
