//! Evidence that a simulated flight would give on the open questions of an identification.
//!
//! **Names.** A flight is simulated under one hypothesis and fitted under a rival, by the weighted least squares and the
//! noises of the identification, with what the measured flights say about the rival's parameters. The criterion is that of
//! T-optimality (Atkinson and Fedorov, Biometrika 62, 1975): the weighted squares that the best fit of the rival leaves beyond
//! those of the truth. The simulated channels have no noise, so that the excess is an expected value. The verdict
//! compares the squares block by block: an excess g of a block has the variance 4 g by the noise, and the blocks
//! differ. So the separation is the mean excess in units of its standard error, as Vuong's test (Econometrica 57, 1989) has it.
//! Both directions are computed, and the smaller counts. Squares that the true hypothesis leaves on channels without noise are errors
//! of the comparison, which the noise of an identification with this flight will include: the excess is divided by as much.
//!
//! **Parameters.** The separation is a plausible change in units of the expected standard error, by the information of all
//! flights together.
#![allow(
    clippy::disallowed_types,
    reason = "as many parameters as a hypothesis has; the products are written out, and depend on no kernel"
)]

use crate::fit::Problem;
use crate::normal::{self, Block};
use crate::prepared::{Prepared, box_s};
use crate::questions::{Asked, Hypothesis, OpenQuestions};
use crate::unusable::Unusable;
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
    /// Number of compared rows of a flight, by the true hypothesis.
    rows: Vec<f64>,
}

impl OpenQuestions {
    /// The evidence of one course, of which `flights` holds the simulated flight under each hypothesis.
    ///
    /// # Errors
    /// If a flight cannot be compared with a model.
    pub fn evidence(&self, flights: &[Flight]) -> Result<Evidence, Unusable> {
        let (mut blocks, mut rows) = (Vec::with_capacity(flights.len()), Vec::with_capacity(flights.len()));
        for (truth, flight) in flights.iter().enumerate() {
            let flight = self.sensor_errors(truth).put_on(flight);
            let prepared = self.prepared(&flight)?;
            let of = |(at, hypothesis): (usize, &Hypothesis)| {
                let values = hypothesis.start(truth == at);
                self.is_asked(truth, at).then(|| self.problem.blocks_of(&prepared, values, &hypothesis.free))
            };
            blocks.push(self.hypotheses.iter().enumerate().map(of).collect());
            rows.push(self.problem.rows(&[prepared]) as f64);
        }
        Ok(Evidence { blocks, rows })
    }

    /// The separation that each question has after flights with this evidence, in standard errors.
    #[must_use]
    pub fn separations(&self, evidence: &[&Evidence]) -> Vec<f64> {
        let between = |truth: usize, rival: usize| {
            let of = |at: usize| self.linear_fit(at, evidence, truth);
            self.separation(&of(rival), &of(truth))
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
            let of = |at: usize| self.full_fit(at, truth, &prepared[truth]);
            self.separation(&of(rival), &of(truth))
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
        let step = self.problem.step(&[total], hypothesis.start(truth == at), &hypothesis.free);
        Costs {
            known: hypothesis.known.cost_after(&step),
            blocks: blocks.iter().map(|block| block.cost_after(&step)).collect(),
            rows: evidence.iter().map(|one| one.rows[truth]).sum(),
        }
    }

    /// The costs of the fit of hypothesis `at` to a flight under `truth`: the best of those from its own values and from its plainest.
    fn full_fit(&self, at: usize, truth: usize, flight: &Prepared) -> Costs {
        let hypothesis = &self.hypotheses[at];
        let centre = hypothesis.start(truth == at);
        let fits = [centre, &hypothesis.plain].map(|start| self.descended(hypothesis, centre, start, flight));
        let [one, other] = fits;
        let (known, blocks) = if sum(&other) < sum(&one) { other } else { one };
        let rows = self.problem.rows(std::slice::from_ref(flight)) as f64;
        Costs { known: known.cost, blocks: blocks.iter().map(|block| block.cost).collect(), rows }
    }

    /// The normal equations at the end of a descent from `start`, where the measured flights prefer `centre`.
    fn descended(
        &self,
        hypothesis: &Hypothesis,
        centre: &[f64],
        start: &[f64],
        flight: &Prepared,
    ) -> (Block, Vec<Block>) {
        let Hypothesis { free, known, .. } = hypothesis;
        let problem: &Problem = &self.problem;
        let equations = |values: &[f64]| {
            let away = DVector::from_iterator(free.len(), free.iter().map(|at| values[*at] - centre[*at]));
            (known.after(&away), problem.blocks_of(flight, values, free))
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
    fn separation(&self, rival: &Costs, truth: &Costs) -> f64 {
        let noise = 1.0 + truth.blocks.iter().sum::<f64>() / truth.rows.max(1.0);
        let excess = rival.blocks.iter().zip(&truth.blocks).map(|(rival, truth)| (rival - truth) / noise);
        let of_known = (rival.known - truth.known) / self.blocks as f64;
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
    /// Number of rows of these.
    rows: f64,
}

/// The squares that equations leave.
fn sum((known, blocks): &(Block, Vec<Block>)) -> f64 {
    known.cost + blocks.iter().map(|block| block.cost).sum::<f64>()
}

impl Hypothesis {
    /// The values about which it is fitted: to its own simulated flights about those that they were simulated with.
    fn start(&self, is_true: bool) -> &[f64] {
        if is_true { &self.plain } else { &self.values }
    }
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
