//! Open questions of an identification: rivals of named effects, and parameters that the flights do not determine.

use crate::data::log_rates::LogRates;
use crate::data::prepared::{Equation, Prepared, Propulsion, block_s};
use crate::data::sensing::SensorErrors;
use crate::model::parameter::Parameters;
use crate::model::physics::Model;
use crate::model::problem::Problem;
use crate::numbers::digits::printed_quantity;
use crate::numbers::normal::{self, Block};
use crate::search::candidate::{Candidate, free_parameters};
use crate::search::confounded::Rival;
use crate::search::fit_result::FitResult;
use crate::search::select::Selection;
use plant::effects::Effect;
use serde::Serialize;

/// Rivals of one effect that count, those that fit best first: beyond them a report is no longer read.
const RIVALS_MAX: usize = 4;

/// A parameter is weak within so many standard errors of its baseline.
const WEAK: f64 = 2.0;

/// A question that the flights leave open.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(tag = "kind", rename_all = "kebab-case")]
pub enum Question {
    /// The true one of two effects.
    Names {
        /// The effect of the verdict, or a rival of it.
        effect: &'static str,
        /// The other.
        rival: &'static str,
    },
    /// The value of a parameter.
    Parameter {
        /// The effect.
        effect: &'static str,
        /// Its parameter.
        parameter: &'static str,
        /// A plausible change of its value, which a flight should show.
        plausible: f64,
        /// Its unit.
        unit: &'static str,
    },
}

impl std::fmt::Display for Question {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Names { effect, rival } => write!(f, "{effect} or {rival}"),
            Self::Parameter { effect, parameter, plausible, unit } => {
                write!(f, "{parameter} of {effect} to within {}", printed_quantity(*plausible, unit))
            }
        }
    }
}

/// A model that explains the flights: the verdict, or the verdict with one effect replaced by a rival.
#[derive(Debug)]
pub(crate) struct Hypothesis {
    /// The effect that stands in it for the one in question.
    pub(crate) effect: &'static str,
    /// Its fit to the flights.
    pub(crate) values: Vec<f64>,
    /// The plainest values that explain the flights as well: the truth of a simulation.
    pub(crate) plain: Vec<f64>,
    pub(crate) free: Vec<usize>,
    /// Information of the flights about the free parameters.
    pub(crate) known: Block,
}

/// A question as the criterion sees it.
#[derive(Debug)]
pub(crate) enum Asked {
    /// Two hypotheses.
    Pair(usize, usize),
    /// A parameter of the first hypothesis.
    Parameter(usize),
}

/// The open questions, with what it takes to judge a simulated flight by them.
#[derive(Debug)]
pub struct OpenQuestions {
    /// The model and the noises of the identification, without flights.
    pub(crate) problem: Problem<'static>,
    /// The verdict's model first.
    pub(crate) hypotheses: Vec<Hypothesis>,
    pub(crate) asked: Vec<(Question, Asked)>,
    pub(crate) propulsion: Propulsion,
    /// Length of the compared parts of the measured flights, s.
    known_s: f64,
    /// Number of blocks of time that they have beside a further flight.
    pub(crate) blocks: usize,
    rates: LogRates,
}

impl OpenQuestions {
    /// The questions that `selection` leaves open, where `rivals` are those of each accepted candidate; `None` if there is none,
    /// or if the flights have no position and attitude, as on a rig: no flight in the open is proposed on these.
    pub(crate) fn of(problem: &Problem, selection: &Selection, rivals: &[Vec<Rival>]) -> Option<Self> {
        let is_free =
            |flight: &Prepared| flight.offset_of(Equation::Acceleration).is_some() && !flight.is_assumed();
        if !problem.estimation.iter().all(is_free) {
            return None;
        }
        // Parameters that were held at their baselines are open, too.
        let free = free_parameters(&selection.accepted);
        let mut hypotheses = vec![hypothesis(problem, "", &selection.after, &free)];
        let mut asked = Vec::new();
        for (candidate, rivals) in selection.accepted.iter().zip(rivals) {
            let mut group = vec![(0, candidate.kind.name)];
            for rival in strongest(rivals) {
                group.push((hypotheses.len(), rival.candidate.kind.name));
                let Rival { candidate, fitted } = rival;
                hypotheses.push(hypothesis(problem, candidate.kind.name, fitted, &fitted.free));
            }
            asked.extend(pairs(&group));
        }
        asked.extend(parameters(problem, selection));
        let Model { vehicle, parameters } = &problem.model;
        let empty = Problem {
            model: Model { vehicle: vehicle.clone(), parameters: parameters.clone() },
            estimation: Vec::new(),
            validation: Vec::new(),
            test: Vec::new(),
            noises: problem.noises.clone(),
            block_s: problem.block_s,
            shared_late_s: problem.shared_late_s,
        };
        (!asked.is_empty()).then(|| Self {
            propulsion: Propulsion::of(&empty.model.vehicle),
            problem: empty,
            hypotheses,
            asked,
            known_s: problem.estimation.iter().map(Prepared::compared_s).sum(),
            blocks: selection.after.estimation_costs.len(),
            rates: LogRates::of(&problem.estimation),
        })
    }

    /// The same questions before a further flight of `duration_s`: the blocks of time are those of an identification with it.
    #[must_use]
    pub fn expecting(mut self, duration_s: f64) -> Self {
        let block_s = block_s(self.known_s + duration_s);
        self.problem.block_s = block_s;
        self.blocks = ((self.known_s / block_s).round() as usize).max(1);
        self
    }

    /// Iterates over the questions.
    pub fn questions(&self) -> impl Iterator<Item = &Question> {
        self.asked.iter().map(|(question, _)| question)
    }

    /// Number of hypotheses: the verdict, and one for each rival.
    #[must_use]
    pub fn hypotheses(&self) -> usize {
        self.hypotheses.len()
    }

    /// Name of the effect that hypothesis number `at` has in place of one of the verdict's; empty for the verdict, number 0.
    #[must_use]
    pub fn name(&self, at: usize) -> &'static str {
        self.hypotheses[at].effect
    }

    /// The plant's effects under hypothesis number `at`.
    #[must_use]
    pub fn effects(&self, at: usize) -> Vec<Effect> {
        self.parameters().effects_under(&self.hypotheses[at].plain)
    }

    /// Errors of the sensors under hypothesis number `at`.
    #[must_use]
    pub fn sensor_errors(&self, at: usize) -> SensorErrors {
        SensorErrors::of(self.parameters(), &self.hypotheses[at].plain)
    }

    /// The rates at which the flights were logged.
    #[must_use]
    pub fn rates(&self) -> LogRates {
        self.rates
    }

    pub(crate) fn parameters(&self) -> &Parameters {
        &self.problem.model.parameters
    }
}

fn hypothesis(problem: &Problem, effect: &'static str, fitted: &FitResult, free: &[usize]) -> Hypothesis {
    let values = &fitted.values;
    let mut known = normal::sum(&problem.blocks(&problem.estimation, values, free));
    if known.gradient.len() != free.len() {
        known = Block::zero(free.len());
    }
    // The fit is at its minimum, and only what a further flight adds counts.
    known.gradient.fill(0.0);
    known.cost = 0.0;
    Hypothesis {
        effect,
        values: values.clone(),
        plain: plainest(problem, fitted),
        free: free.to_vec(),
        known,
    }
}

/// The values of `fitted` with each weak parameter at its baseline, if the others then explain the flights as well: a value that is
/// only noise would promise a difference that the vehicle does not have.
fn plainest(problem: &Problem, fitted: &FitResult) -> Vec<f64> {
    let all = &problem.model.parameters.all;
    let most = fitted.estimation_cost() + WEAK * WEAK;
    let size = |at: &usize| {
        let error = fitted.standard_error(*at).unwrap_or(f64::INFINITY);
        (fitted.values[*at] - all[*at].baseline).abs() / error
    };
    let mut weak: Vec<(f64, usize)> = fitted.free.iter().map(|at| (size(at), *at)).collect();
    weak.retain(|(size, _)| size.is_nan() || *size < WEAK);
    weak.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut now = fitted.clone();
    for (_, at) in weak {
        let mut start = now.values.clone();
        start[at] = all[at].baseline;
        let others: Vec<usize> = now.free.iter().copied().filter(|free| *free != at).collect();
        let without = problem.fitted(&start, &others);
        if without.estimation_cost() < most {
            now = without;
        }
    }
    now.values
}

/// The best fit of each rival effect, the best of all first.
fn strongest(rivals: &[Rival]) -> Vec<&Rival> {
    let mut sorted: Vec<&Rival> = rivals.iter().collect();
    sorted.sort_by(|a, b| a.fitted.validation_cost().total_cmp(&b.fitted.validation_cost()));
    let mut found: Vec<&Rival> = Vec::new();
    for rival in sorted {
        if found.iter().all(|other| other.candidate.kind.name != rival.candidate.kind.name) {
            found.push(rival);
        }
    }
    found.truncate(RIVALS_MAX);
    found
}

/// All pairs of a group of hypotheses that differ in one effect: whichever is true, the others have to go.
fn pairs(group: &[(usize, &'static str)]) -> Vec<(Question, Asked)> {
    let mut found = Vec::new();
    for (place, (first, effect)) in group.iter().enumerate() {
        for (second, rival) in &group[place + 1..] {
            found.push((Question::Names { effect, rival }, Asked::Pair(*first, *second)));
        }
    }
    found
}

/// The parameters of the accepted candidates whose interval covers all values that they may have.
fn parameters(problem: &Problem, selection: &Selection) -> Vec<(Question, Asked)> {
    let fitted = &selection.after;
    let half = |at: usize| fitted.t_quantile(0.975) * fitted.standard_error(at).unwrap_or(f64::INFINITY);
    let of = |at: &usize| {
        let entry = &problem.model.parameters.all[*at];
        let (value, half, spec) = (fitted.values[*at], half(*at), entry.spec());
        let is_open = value - half <= spec.min && value + half >= entry.max;
        let (effect, parameter, unit) = (entry.kind.name, spec.name, spec.unit());
        let question = Question::Parameter { effect, parameter, plausible: entry.scale, unit };
        is_open.then_some((question, Asked::Parameter(*at)))
    };
    let free = selection.accepted.iter().flat_map(|candidate: &Candidate| &candidate.free);
    free.filter_map(of).collect()
}
