//! Evidence that a simulated flight would give on the open questions of an identification.
//!
//! **Names.** A flight is simulated under one hypothesis and fitted under a rival, by the weighted least squares and the noises of the
//! identification. The fit includes the information of the measured flights on the rival's parameters. The criterion is that of
//! T-optimality (Atkinson and Fedorov, Biometrika 62, 1975): the weighted squares that the best fit of the rival leaves beyond those of
//! the truth. The simulated channels have no noise, so that the excess is an expected value. The verdict compares the squares block by
//! block: an excess g of a block has the variance 4 g by the noise, and the blocks differ. So the separation is the mean excess in units
//! of its standard error, as Vuong's test (Econometrica 57, 1989) has it. Both directions are computed, and the smaller counts. What the
//! true hypothesis leaves on channels without noise is the error of the comparison: a rival is fitted to the rest, and as the noise of
//! the next identification includes it, the excess is divided by as much.
//!
//! **Parameters.** The separation is a plausible change in units of the expected standard error, by the information of all
//! flights together.
#![allow(
    clippy::disallowed_types,
    reason = "as many parameters as a hypothesis has; the products are written out, and depend on no kernel"
)]

use crate::data::prepared::{Prepared, box_s};
use crate::data::unusable::Unusable;
use crate::model::problem::Problem;
use crate::numbers::normal::{self, Block};
use crate::search::questions::{Asked, Hypothesis, OpenQuestions};
use flights::Flight;
use nalgebra::{DMatrix, DVector};

/// Steps of a fit to a whole flight.
const STEPS: usize = 8;
/// A fit is done when a step takes away less than this part of the squares.
const DONE: f64 = 1e-6;
/// A smaller part of a parameter's information is rounding.
const LEAST_INFORMATION: f64 = 1e-9;

/// Evidence of one flight under each hypothesis: the normal equations by pair of the true and the fitted hypothesis.
#[derive(Debug, Clone)]
pub struct Evidence {
    /// By the true hypothesis, then by the fitted one; `None` where no question asks for the pair.
    blocks: Vec<Vec<Option<Vec<Block>>>>,
    /// Errors of the comparison, by the true hypothesis.
    noise: Vec<OwnNoise>,
}

/// Squares that the true hypothesis leaves on channels without noise.
#[derive(Debug, Clone, Copy)]
struct OwnNoise {
    squares: f64,
    rows: f64,
}

impl OpenQuestions {
    /// The evidence of one course, of which `flights` holds the simulated flight under each hypothesis.
    ///
    /// # Errors
    /// If a flight cannot be compared with a model.
    pub fn evidence(&self, flights: &[Flight]) -> Result<Evidence, Unusable> {
        let (mut blocks, mut noise) = (Vec::with_capacity(flights.len()), Vec::with_capacity(flights.len()));
        for (truth, flight) in flights.iter().enumerate() {
            let flight = self.sensor_errors(truth).put_on(flight);
            let prepared = self.prepared(&flight)?;
            let of_truth = self.own_rows(truth, &prepared);
            let of = |(at, Hypothesis { values, plain, free, .. }): (usize, &Hypothesis)| {
                let start = if at == truth { plain } else { values };
                self.is_asked(truth, at)
                    .then(|| self.problem.blocks_beyond(&prepared, start, free, &of_truth))
            };
            blocks.push(self.hypotheses.iter().enumerate().map(of).collect());
            noise.push(self.own_noise(truth, &prepared));
        }
        Ok(Evidence { blocks, noise })
    }

    /// The residual of a flight under its own hypothesis: errors of the comparison. Rivals are compared beyond these.
    fn own_rows(&self, truth: usize, flight: &Prepared) -> Vec<f64> {
        self.problem.model.residual_under(flight, &self.hypotheses[truth].plain)
    }

    /// Squares of that residual, and the number of rows.
    fn own_noise(&self, truth: usize, flight: &Prepared) -> OwnNoise {
        let blocks = self.problem.blocks_of(flight, &self.hypotheses[truth].plain, &[]);
        let squares = blocks.iter().map(|block| block.cost).sum();
        OwnNoise { squares, rows: self.problem.rows(std::slice::from_ref(flight)) as f64 }
    }

    /// The separation that each question has after flights with this evidence, in standard errors.
    #[must_use]
    pub fn separations(&self, evidence: &[&Evidence]) -> Vec<f64> {
        let between = |truth: usize, rival: usize| {
            let noise: Vec<OwnNoise> = evidence.iter().map(|one| one.noise[truth]).collect();
            self.separation(&self.linear_fit(rival, evidence, truth), &noise)
        };
        self.asked
            .iter()
            .map(|(_, asked)| match asked {
                Asked::Pair(first, second) => between(*first, *second).min(between(*second, *first)),
                Asked::Parameter(parameter) => self.parameter_separation(*parameter, evidence),
            })
            .collect()
    }

    /// The same for one whole flight, fitted anew under each rival instead of by the equations about the first fit.
    ///
    /// # Errors
    /// If a flight cannot be compared with a model.
    pub fn fitted_separations(&self, flights: &[Flight]) -> Result<Vec<f64>, Unusable> {
        let mut found = self.separations(&[&self.evidence(flights)?]);
        let seen: Vec<Flight> =
            flights.iter().enumerate().map(|(at, flight)| self.sensor_errors(at).put_on(flight)).collect();
        let prepared = seen.iter().map(|flight| self.prepared(flight)).collect::<Result<Vec<_>, _>>()?;
        let between = |truth: usize, rival: usize| {
            let noise = [self.own_noise(truth, &prepared[truth])];
            self.separation(&self.full_fit(rival, truth, &prepared[truth]), &noise)
        };
        for (separation, (_, asked)) in found.iter_mut().zip(&self.asked) {
            if let Asked::Pair(first, second) = asked {
                *separation = between(*first, *second).min(between(*second, *first));
            }
        }
        Ok(found)
    }

    fn prepared<'f>(&self, flight: &'f Flight) -> Result<Prepared<'f>, Unusable> {
        Prepared::new(flight, box_s(flight), &self.propulsion)
    }

    /// True if a question needs the fit of hypothesis `at` to a flight under `truth`.
    fn is_asked(&self, truth: usize, at: usize) -> bool {
        truth == at
            || self.asked.iter().any(|(_, asked)| {
                matches!(asked, Asked::Pair(a, b) if [*a, *b] == [truth, at] || [*b, *a] == [truth, at])
            })
    }

    /// The costs of the fit of hypothesis `at`, by the equations about its fit to the measured flights.
    fn linear_fit(&self, at: usize, evidence: &[&Evidence], truth: usize) -> Costs {
        let hypothesis = &self.hypotheses[at];
        let blocks: Vec<&Block> =
            evidence.iter().filter_map(|one| one.blocks[truth][at].as_ref()).flatten().collect();
        let total = total(&hypothesis.known, blocks.iter().copied());
        let step = self.problem.step(&[total], &hypothesis.values, &hypothesis.free);
        Costs {
            known: hypothesis.known.cost_after(&step),
            blocks: blocks.iter().map(|block| block.cost_after(&step)).collect(),
        }
    }

    /// The costs of the fit of hypothesis `at` to a flight under `truth`: the best of those from its own values and from its plainest.
    fn full_fit(&self, at: usize, truth: usize, flight: &Prepared) -> Costs {
        let Hypothesis { values, plain, .. } = &self.hypotheses[at];
        let of_truth = self.own_rows(truth, flight);
        let [one, other] = [values, plain].map(|start| self.descended(at, start, flight, &of_truth));
        let (known, blocks) = if sum(&other) < sum(&one) { other } else { one };
        Costs { known: known.cost, blocks: blocks.iter().map(|block| block.cost).collect() }
    }

    /// The normal equations at the end of a descent of hypothesis `at` from `start`, beyond the rows `of_truth`.
    fn descended(
        &self,
        at: usize,
        start: &[f64],
        flight: &Prepared,
        of_truth: &[f64],
    ) -> (Block, Vec<Block>) {
        let Hypothesis { values: centre, free, known, .. } = &self.hypotheses[at];
        let problem: &Problem = &self.problem;
        let equations = |values: &[f64]| {
            let away = DVector::from_iterator(free.len(), free.iter().map(|at| values[*at] - centre[*at]));
            (known.after(&away), problem.blocks_beyond(flight, values, free, of_truth))
        };
        let (mut values, mut now) = (start.to_vec(), equations(start));
        for _ in 0..STEPS {
            let step = problem.step(&[total(&now.0, now.1.iter())], &values, free);
            // A part of the step, where the whole of it leads upwards.
            let tried =
                [1.0, 0.25, 0.06].into_iter().map(|part| problem.moved(&values, free, &(&step * part)));
            let better = tried.map(|next| (equations(&next), next)).find(|(after, _)| sum(after) < sum(&now));
            let Some((after, next)) = better else { break };
            let is_done = sum(&now) - sum(&after) < DONE * sum(&now);
            (values, now) = (next, after);
            if is_done {
                break;
            }
        }
        now
    }

    /// The mean excess of the rival's squares over its standard error; blocks of the measured flights count among the others.
    fn separation(&self, rival: &Costs, of_truth: &[OwnNoise]) -> f64 {
        let sum = |of: fn(&OwnNoise) -> f64| of_truth.iter().map(of).sum::<f64>();
        let noise = 1.0 + sum(|of_truth| of_truth.squares) / sum(|of_truth| of_truth.rows).max(1.0);
        let excess = rival.blocks.iter().map(|cost| cost / noise);
        let of_known = rival.known / self.blocks as f64;
        let gains: Vec<f64> = excess.chain(std::iter::repeat_n(of_known, self.blocks)).collect();
        let total: f64 = gains.iter().sum();
        let mean = total / gains.len().max(1) as f64;
        let variance: f64 =
            gains.iter().map(|gain| 4.0 * gain.max(0.0) + (gain - mean) * (gain - mean)).sum();
        if total > 0.0 && variance > 0.0 { total / variance.sqrt() } else { 0.0 }
    }

    /// A plausible change of a parameter over its expected standard error.
    fn parameter_separation(&self, parameter: usize, evidence: &[&Evidence]) -> f64 {
        let verdict = &self.hypotheses[0];
        let blocks = evidence.iter().filter_map(|one| one.blocks[0][0].as_ref()).flatten();
        let gram = total(&verdict.known, blocks).gram;
        let at = verdict.free.iter().position(|free| *free == parameter);
        let information = at.map_or(0.0, |at| information(&gram, at));
        self.parameters().all[parameter].scale * information.sqrt()
    }
}

/// Weighted squares that a fit leaves.
struct Costs {
    /// Beyond the best fit to the measured flights, on these.
    known: f64,
    /// On each block of the simulated flights.
    blocks: Vec<f64>,
}

/// The squares that equations leave.
fn sum((known, blocks): &(Block, Vec<Block>)) -> f64 {
    known.cost + blocks.iter().map(|block| block.cost).sum::<f64>()
}

fn total<'b>(known: &Block, blocks: impl Iterator<Item = &'b Block>) -> Block {
    blocks.fold(known.clone(), |mut sum, block| {
        sum.gram += &block.gram;
        sum.gradient += &block.gradient;
        sum.cost += block.cost;
        sum
    })
}

/// Information about one parameter with the others unknown: Schur's complement.
fn information(gram: &DMatrix<f64>, at: usize) -> f64 {
    let alone = gram[(at, at)];
    let others: Vec<usize> = (0..gram.nrows()).filter(|other| *other != at).collect();
    let inverse =
        normal::inverse(&DMatrix::from_fn(others.len(), others.len(), |i, j| gram[(others[i], others[j])]));
    let shared: f64 = (0..others.len())
        .flat_map(|i| (0..others.len()).map(move |j| (i, j)))
        .map(|(i, j)| gram[(at, others[i])] * inverse[(i, j)] * gram[(others[j], at)])
        .sum();
    let left = alone - shared;
    if left > LEAST_INFORMATION * alone { left } else { 0.0 }
}
