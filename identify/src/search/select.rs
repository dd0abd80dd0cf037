//! Attribution: selection of the candidates that the flights support, one after the other.
//!
//! In each round every candidate is fitted on the estimation data, together with the effects accepted before. It is judged on the validation
//! data, or without these by cross-validation over blocks of the estimation data. It is accepted only if five things hold:
//!
//! 1. The gain on the validation data is beyond chance: the mean of the blocks' gains is above zero at 1 % over all
//!    candidates of the round together (Bonferroni; one-sided percentile bootstrap over blocks, Efron 1979).
//! 2. Its parameters together differ from their baselines beyond chance on the estimation data, at the same level.
//! 3. The gain matters: it is at least 0.2 % of the squared error.
//! 4. The effect is not asked for more than it can be: not all parameters that moved stopped at a bound beyond which the equations ask by
//!    more than chance.
//! 5. No effect that was taken before stops at its bound only beside this one.
//!
//! The accepted candidate with the greatest gain is taken, or one with fewer parameters if the difference is not
//! beyond chance. Then those taken before have to pass the first test again. A later effect may explain the
//! residual that an earlier one explained by mistake.
//!
//! In the end effects are withdrawn or added by predictions, and the search goes on (`revision`).
//!
//! If a round accepts nothing although all candidates together would reduce the cost much, pairs are tried that
//! gain only together. They face the same tests; the chance of a false acceptance in that search is
//! [`FALSE_RATE`] once more. So are pairs of a drag and one wind for each flight (`flight_wind`), whatever is left. The rounds end when nothing changes
//! any more. If flights show several winds, the search begins with these and all effects by which they act (`wind_search`).

use crate::model::flight_wind::{FLIGHT_WIND, is_drag};
use crate::model::problem::Problem;
use crate::numbers::normal::{self, Block};
use crate::search::candidate::{Candidate, free_parameters, with};
use crate::search::fit::{Equations, unbounded};
use crate::search::fit_result::FitResult;
use crate::search::judgement::{
    FALSE_RATE, Judged, Way, fitted, fitted_from, held_at_limits, is_clearly_worse, is_worse, judged,
    p_value, start, start_from, without,
};
use crate::search::logging;
use crate::search::revision::{End, Revision, Revisions, Withdrawn, without_effects};
use crate::search::wind_search::several_winds;
use crate::search::worth::Worth;
use rayon::prelude::*;
use std::cmp::Reverse;
use std::collections::BTreeMap;

/// Steps of a promise from a guess: nothing but the candidate's own derivatives is computed again.
const PROMISE_STEPS: usize = 3;
/// Number of candidates of a round that are fitted.
const CONFIRMED: usize = 4;
/// Derivatives of another point serve where steps with them take off at least this part of what was promised.
const AS_PROMISED: f64 = 0.5;
/// More rounds than there are effects worth naming.
const ROUNDS_MAX: usize = 12;
/// Pairs that mask each other are tried if the cost that is left is large. It is so if it is this many times
/// the cost that all candidates together would leave on the estimation data.
const MUCH_LEFT: f64 = 1.5;
/// Number of candidates that are tried as the first of two.
const FIRSTS: usize = 4;

/// One round.
#[derive(Debug, Clone)]
pub struct Round {
    /// Everything judged in it.
    pub judged: Vec<Judged>,
    /// Index of the one that was taken.
    pub taken: Option<usize>,
}

impl Round {
    /// Returns the candidate that was taken.
    pub fn taken(&self) -> Option<&Judged> {
        self.taken.map(|at| &self.judged[at])
    }
}

/// Result of a selection.
#[derive(Debug, Clone)]
pub struct Selection {
    /// Accepted candidates, in order.
    pub accepted: Vec<Candidate>,
    /// The declared model.
    pub before: FitResult,
    /// The model with all accepted effects.
    pub after: FitResult,
    /// The same, refined by prediction errors; `None` where that does not predict better.
    pub refined: Option<FitResult>,
    /// The rounds.
    pub rounds: Vec<Round>,
    /// Effects that were accepted and taken back.
    pub withdrawn: Vec<Withdrawn>,
    /// Prediction errors of the judged flights with and without each accepted effect.
    pub worths: BTreeMap<&'static str, Vec<Worth>>,
    /// Accepted errors of sensors that change no prediction noticeably, each with the reason.
    pub without_worth: BTreeMap<&'static str, String>,
    /// Accepted candidates that predictions asked for: the equations alone may hardly show them.
    pub asked: Vec<Candidate>,
    /// True if the search was stopped before its end.
    pub is_stopped: bool,
}

impl Selection {
    /// The model that is reported: refined, or as it came out of the equations.
    pub fn flown(&self) -> &FitResult {
        self.refined.as_ref().unwrap_or(&self.after)
    }

    /// Chance of as much gain without the accepted `effect`, in the round that took the best part of it.
    pub fn p_value(&self, effect: &str) -> f64 {
        let taken = self.rounds.iter().filter_map(Round::taken);
        taken
            .filter(|judged| judged.candidate.kind.name == effect)
            .map(|judged| judged.p_value)
            .fold(1.0, f64::min)
    }
}

/// Selects among `candidates`, telling `progress` of each step, until it ends or `is_stopped` says so between two rounds.
///
/// In the end effects without which predictions are better are taken back, and the search goes on without them. The problem comes back with the
/// noises by which its last fit was weighed.
pub fn select<'f>(
    mut problem: Problem<'f>,
    candidates: &[Candidate],
    progress: &mut dyn FnMut(&str),
    is_stopped: &dyn Fn() -> bool,
) -> (Problem<'f>, Selection) {
    let declared = problem.model.parameters.baseline();
    let base = problem.fitted(&declared, &[]);
    let mut search = StepwiseSearch { accepted: Vec::new(), rounds: Vec::new(), base };
    search.begin_in_several_winds(&mut problem, candidates, progress);
    let selection = search.finished(&mut problem, candidates, progress, is_stopped);
    (problem, selection)
}

/// State of a selection.
struct StepwiseSearch {
    accepted: Vec<Candidate>,
    rounds: Vec<Round>,
    base: FitResult,
}

impl StepwiseSearch {
    /// Begins with the winds of the flights and all effects by which they act, if the flights show several winds.
    fn begin_in_several_winds(
        &mut self,
        problem: &mut Problem,
        candidates: &[Candidate],
        progress: &mut dyn FnMut(&str),
    ) {
        let noises = problem.noises.clone();
        let Some((mut accepted, fitted)) = several_winds(problem, &self.base, candidates) else {
            // The rounds begin as without this trial.
            problem.noises = noises;
            return;
        };
        progress("several winds: drags, lifts and thrust together");
        let fitted = without_idle(problem, fitted, &mut accepted, &[]);
        let level = FALSE_RATE / accepted.len() as f64;
        let open: Vec<&Candidate> =
            candidates.iter().filter(|candidate| !candidate.is_in(&accepted)).collect();
        for (at, candidate) in accepted.iter().enumerate() {
            let mut others = accepted.clone();
            others.remove(at);
            let without = without(problem, &fitted, &accepted, at);
            let mut judged = vec![judged(problem, &without, candidate, fitted.clone(), level)];
            // Rivals of the effect are chosen among the candidates of its round.
            judged.extend(promised_beside(problem, &without, &others, &open, level));
            self.rounds.push(Round { judged, taken: Some(0) });
        }
        (self.accepted, self.base) = (accepted, fitted);
    }

    /// The selection among `candidates` after rounds and revisions, until neither changes anything. A search that is stopped ends without a revision.
    fn finished(
        mut self,
        problem: &mut Problem,
        candidates: &[Candidate],
        progress: &mut dyn FnMut(&str),
        is_stopped: &dyn Fn() -> bool,
    ) -> Selection {
        let mut open = candidates.to_vec();
        let mut withdrawn = Vec::new();
        let mut revisions = Revisions::default();
        let end = loop {
            self.run(problem, &open, revisions.added(), progress, is_stopped);
            problem.weigh(&self.base, candidates);
            let fitted = problem.fitted(&self.base.values, &free_parameters(&self.accepted));
            self.base = held_at_limits(problem, fitted);
            if is_stopped() {
                progress("stopped: what was found so far is reported");
                break End { is_stopped: true, ..End::default() };
            }
            let given_up = self.given_up(&open);
            let Self { accepted, base, rounds } = &mut self;
            match revisions.next(problem, (accepted, base), (&open, &given_up), progress) {
                Revision::Instead(exchange, old) => {
                    open.retain(|candidate| !exchange.closes(candidate));
                    withdrawn.extend(old);
                    (*accepted, *base) = (exchange.accepted, exchange.fitted);
                }
                Revision::Without(found) => {
                    let effects: Vec<&str> = found.iter().map(|withdrawn| withdrawn.effect).collect();
                    (*accepted, *base) = without_effects(problem, accepted, base, &effects);
                    open.retain(|candidate| !effects.contains(&candidate.kind.name));
                    withdrawn.extend(found);
                }
                Revision::With(found) => {
                    accepted.push(found.candidate.clone());
                    *base = found.fitted.clone();
                    rounds.push(Round { judged: vec![*found], taken: Some(0) });
                }
                Revision::Done(end) => break end,
            }
        };
        let Self { accepted, rounds, base: after } = self;
        let End { refined, worths, without_worth, is_stopped } = end;
        let before = problem.fitted(&problem.model.parameters.baseline(), &[]);
        let asked = revisions.added().to_vec();
        Selection {
            accepted,
            before,
            after,
            refined,
            rounds,
            withdrawn,
            worths,
            without_worth,
            asked,
            is_stopped,
        }
    }

    /// The `open` candidates that rounds took and that are no longer accepted.
    fn given_up(&self, open: &[Candidate]) -> Vec<Candidate> {
        let mut given_up: Vec<Candidate> = Vec::new();
        for Judged { candidate, .. } in self.rounds.iter().filter_map(Round::taken) {
            if candidate.is_in(open) && !candidate.is_in(&self.accepted) && !candidate.is_in(&given_up) {
                given_up.push(candidate.clone());
            }
        }
        given_up
    }

    /// Rounds among `candidates` until none changes anything or the search is stopped; those `kept` are not given up for others.
    fn run(
        &mut self,
        problem: &mut Problem,
        candidates: &[Candidate],
        kept: &[Candidate],
        progress: &mut dyn FnMut(&str),
        is_stopped: &dyn Fn() -> bool,
    ) {
        for _ in 0..ROUNDS_MAX {
            if is_stopped() {
                break;
            }
            let open = candidates.iter().filter(|candidate| !candidate.is_in(&self.accepted)).count();
            if open == 0 {
                break;
            }
            let number = self.rounds.len() + 1;
            progress(&format!("round {number} (ends when nothing changes): {open} candidates"));
            problem.weigh(&self.base, candidates);
            self.base = problem.fitted(&self.base.values, &free_parameters(&self.accepted));
            self.rounds.push(round(problem, &self.base, &self.accepted, candidates, FALSE_RATE));
            let is_changed = self.take(problem, kept)
                || self.take_two(problem, candidates, kept)
                || self.take_winds(problem, candidates, kept);
            if !is_changed {
                break;
            }
        }
    }

    /// Accepts the candidate that the last round took.
    fn take(&mut self, problem: &Problem, kept: &[Candidate]) -> bool {
        let Some(taken) = self.rounds.last().and_then(Round::taken).cloned() else { return false };
        self.accepted = with(&self.accepted, &taken.candidate);
        self.base = without_idle(problem, taken.fitted, &mut self.accepted, kept);
        true
    }

    /// Accepts two that only gain together: of two strong effects each can make the blocks worse in which the other
    /// acts. The firsts that are tried are chosen on the estimation data, the second in a round with the first. Then
    /// the first has to pass a round with the second.
    fn take_two(&mut self, problem: &Problem, candidates: &[Candidate], kept: &[Candidate]) -> bool {
        let Some(last) = self.rounds.last() else { return false };
        if problem.left(&self.base) < MUCH_LEFT {
            return false;
        }
        let mut firsts = last.judged.clone();
        firsts.sort_by(|a, b| a.fitted.estimation_cost().total_cmp(&b.fitted.estimation_cost()));
        firsts.truncate(FIRSTS);
        let rate = FALSE_RATE / FIRSTS as f64;
        firsts
            .iter()
            .any(|first| self.take_pair(problem, (&first.candidate, candidates), candidates, rate, kept))
    }

    /// Accepts a drag and the winds of the flights. A wind acts by a drag, and one drag for flights in several winds shows in these alone. That this is
    /// missing does not show in what is left: winds of flights do not count among what all candidates together would leave.
    fn take_winds(&mut self, problem: &Problem, candidates: &[Candidate], kept: &[Candidate]) -> bool {
        let open = candidates.iter().filter(|candidate| !candidate.is_in(&self.accepted)).cloned();
        let (winds, others): (Vec<Candidate>, Vec<Candidate>) =
            open.partition(|candidate| *candidate.kind == FLIGHT_WIND);
        if winds.is_empty() {
            return false;
        }
        let drags: Vec<Candidate> = others.into_iter().filter(|candidate| is_drag(candidate.kind)).collect();
        let rate = FALSE_RATE / drags.len().max(1) as f64;
        drags.iter().any(|drag| self.take_pair(problem, (drag, &winds), candidates, rate, kept))
    }

    /// Accepts `first` and one of `seconds` if that passes a round with the first, the first one among `candidates` with it, and both together gain.
    fn take_pair(
        &mut self,
        problem: &Problem,
        (first, seconds): (&Candidate, &[Candidate]),
        candidates: &[Candidate],
        rate: f64,
        kept: &[Candidate],
    ) -> bool {
        let alone = fitted(problem, &self.base, &self.accepted, first);
        let with_first = with(&self.accepted, first);
        let second_round = round(problem, &alone, &with_first, seconds, rate);
        let Some(second) = second_round.taken().cloned() else { return false };
        let with_second = with(&self.accepted, &second.candidate);
        let both = with(&with_first, &second.candidate);
        let Some(place) = both.iter().position(|one| one == first) else { return false };
        let without_first = without(problem, &second.fitted, &both, place);
        let mut first_round = round(problem, &without_first, &with_second, candidates, rate);
        first_round.taken =
            first_round.judged.iter().position(|judged| judged.candidate == *first && judged.is_accepted);
        let is_gain = p_value(&self.base.validation_costs, &second.fitted.validation_costs) < rate;
        if !is_gain || first_round.taken.is_none() {
            return false;
        }
        self.rounds.extend([first_round, second_round]);
        self.accepted = both;
        self.base = without_idle(problem, second.fitted, &mut self.accepted, kept);
        true
    }
}

/// Judges all of `candidates` that are not in `accepted`; `rate` is the chance of a false acceptance among them.
fn round(
    problem: &Problem,
    base: &FitResult,
    accepted: &[Candidate],
    candidates: &[Candidate],
    rate: f64,
) -> Round {
    let open: Vec<&Candidate> = candidates.iter().filter(|candidate| !candidate.is_in(accepted)).collect();
    let level = rate / open.len().max(1) as f64;
    let screen = Screen::of(problem, base, accepted, &open);
    let judge = |candidate: &&Candidate| {
        if candidate.kind.guesses.is_empty() {
            let promised = screen.promised(problem, base, candidate);
            return Judged { way: Way::Promise, ..judged(problem, base, candidate, promised, level) };
        }
        let promised = promised_from_guess(problem, base, accepted, candidate);
        let promise = Judged { way: Way::Promise, ..judged(problem, base, candidate, promised, level) };
        // Each candidate that acts on time is a rival of all others: a promise will not do.
        let is_timing = candidate.kind.is_delay || candidate.kind.changes_drive;
        if is_timing {
            fitted_as_promised(problem, &screen, (base, accepted), &promise, level)
        } else {
            promise
        }
    };
    let mut all: Vec<Judged> = open.par_iter().map(judge).collect();
    confirm(problem, &screen, (base, accepted), &mut all, level);
    // What is taken is fitted in full, and may be another candidate then.
    loop {
        let taken = best(problem, &all);
        match taken {
            Some(at) if all[at].way != Way::Full => {
                let Judged { candidate, fitted, .. } = &all[at];
                let fitted = problem.fitted(&fitted.values, &fitted.free);
                all[at] = judged(problem, base, candidate, fitted, level);
            }
            _ => return Round { judged: all, taken },
        }
    }
}

/// Fits those of whom the linearised equations promise most; a promise alone is not accepted. Those that start at a
/// guess are far from linear, so that their place among promises says little: all of them are fitted that promise enough.
fn confirm(
    problem: &Problem,
    screen: &Screen,
    (base, accepted): (&FitResult, &[Candidate]),
    all: &mut [Judged],
    level: f64,
) {
    let mut promises: Vec<&mut Judged> =
        all.iter_mut().filter(|judged| judged.way == Way::Promise && judged.is_accepted).collect();
    let is_guessed = |judged: &Judged| !judged.candidate.kind.guesses.is_empty();
    promises.sort_by(|a, b| is_guessed(b).cmp(&is_guessed(a)).then(b.gain.total_cmp(&a.gain)));
    let guessed = promises.iter().filter(|judged| is_guessed(judged)).count();
    promises.into_par_iter().enumerate().for_each(|(place, promise)| {
        if place < guessed + CONFIRMED {
            *promise = fitted_as_promised(problem, screen, (base, accepted), promise, level);
        } else {
            promise.is_accepted = false;
        }
    });
}

/// The candidate of a promise, fitted with the derivatives at hand; in full where they do not lead as far as promised.
fn fitted_as_promised(
    problem: &Problem,
    screen: &Screen,
    (base, accepted): (&FitResult, &[Candidate]),
    promise: &Judged,
    level: f64,
) -> Judged {
    let candidate = &promise.candidate;
    let others = candidate.beside(accepted);
    let near = if candidate.kind.guesses.is_empty() {
        let all = [others.as_slice(), &candidate.free].concat();
        problem.fitted_near(&screen.equations.of(&all), &base.values)
    } else {
        let start = start_from(problem, base, candidate, &promise.fitted.values);
        let known = (base.values.as_slice(), others.as_slice());
        problem.fitted_near(&problem.equations_near(known, &start, &candidate.free), &start)
    };
    let promised = base.estimation_cost() - promise.fitted.estimation_cost();
    if base.estimation_cost() - near.estimation_cost() > AS_PROMISED * promised {
        return Judged { way: Way::Near, ..judged(problem, base, candidate, near, level) };
    }
    let fitted = fitted_from(problem, base, accepted, candidate, &promise.fitted.values);
    judged(problem, base, candidate, fitted, level)
}

/// The fit that a few steps from the best start promise, with the derivatives by the accepted parameters as they are at `base`.
fn promised_from_guess(
    problem: &Problem,
    base: &FitResult,
    accepted: &[Candidate],
    candidate: &Candidate,
) -> FitResult {
    let accepted = candidate.beside(accepted);
    let all = [accepted.clone(), candidate.free.clone()].concat();
    let blocks = |flights, values: &[f64]| {
        problem.blocks_near(flights, (&base.values, &accepted), values, &candidate.free)
    };
    let mut values = start(problem, base, candidate).0;
    let mut estimation = blocks(&problem.estimation, &values);
    for _ in 0..PROMISE_STEPS {
        let next = problem.moved(&values, &all, &problem.step(&estimation, &values, &all));
        let after = blocks(&problem.estimation, &next);
        if normal::sum(&after).cost >= normal::sum(&estimation).cost {
            break;
        }
        (values, estimation) = (next, after);
    }
    let validation = blocks(&problem.validation, &values);
    promise(problem, &values, all, &estimation, &validation)
}

/// The accepted one with the greatest gain, or the one with the fewest parameters that is not worse beyond chance.
fn best(problem: &Problem, judged: &[Judged]) -> Option<usize> {
    // What the logging of the commands explains as well is no effect; sensors that lead for it are named nowhere.
    let is_logged = |at: usize| {
        let Judged { candidate, fitted, .. } = &judged[at];
        if logging::explained_lead_s(problem, candidate, fitted).is_some() {
            return false;
        }
        let rivals = judged.iter().filter(|rival| rival.is_logging);
        rivals.into_iter().any(|rival| !is_worse(&rival.fitted, &judged[at].fitted))
    };
    let accepted: Vec<usize> =
        (0..judged.len()).filter(|at| judged[*at].is_accepted && !is_logged(*at)).collect();
    let by_gain = |a: &&usize, b: &&usize| judged[**a].gain.total_cmp(&judged[**b].gain);
    let greatest = *accepted.iter().max_by(by_gain)?;
    let is_alike = |at: &&usize| !is_worse(&judged[**at].fitted, &judged[greatest].fitted);
    let size = |at: usize| judged[at].candidate.free.len();
    accepted.iter().filter(is_alike).min_by(|a, b| size(**a).cmp(&size(**b)).then(by_gain(b, a))).copied()
}

/// Takes back effects that no longer gain anything; of several, first the one with the most parameters. Else two with
/// many parameters can stand for one with few: less thrust in hover and a steeper command map equal more mass.
fn without_idle(
    problem: &Problem,
    mut base: FitResult,
    accepted: &mut Vec<Candidate>,
    kept: &[Candidate],
) -> FitResult {
    while let Some((at, fitted)) = idle(problem, &base, accepted, kept) {
        accepted.remove(at);
        base = fitted;
    }
    base
}

/// The place of the effect with the most parameters among those that no longer gain anything, and the fit without it.
fn idle(
    problem: &Problem,
    base: &FitResult,
    accepted: &[Candidate],
    kept: &[Candidate],
) -> Option<(usize, FitResult)> {
    // The newest has just passed.
    let older = accepted.len().saturating_sub(1);
    let mut places: Vec<usize> = (0..older).filter(|at| !kept.contains(&accepted[*at])).collect();
    places.sort_by_key(|at| Reverse(accepted[*at].free.len()));
    places.into_iter().find_map(|at| {
        let promised = problem.promised_without(base, &accepted[at].free);
        if is_clearly_worse(&promised, base) {
            return None;
        }
        let fitted = without(problem, base, accepted, at);
        (!is_worse(&fitted, base)).then_some((at, fitted))
    })
}

/// The `open` candidates beside `accepted` as the linearised equations promise them, without those that start at a guess.
fn promised_beside(
    problem: &Problem,
    base: &FitResult,
    accepted: &[Candidate],
    open: &[&Candidate],
    level: f64,
) -> Vec<Judged> {
    let linear: Vec<&Candidate> =
        open.iter().copied().filter(|candidate| candidate.kind.guesses.is_empty()).collect();
    let screen = Screen::of(problem, base, accepted, &linear);
    let judge = |candidate: &&Candidate| {
        let promised = screen.promised(problem, base, candidate);
        let judged = judged(problem, base, candidate, promised, level);
        Judged { way: Way::Promise, is_accepted: false, ..judged }
    };
    linear.par_iter().map(judge).collect()
}

/// Linearised equations from which the fit of each candidate is predicted.
struct Screen {
    equations: Equations,
    estimation: Vec<normal::Block>,
    validation: Vec<normal::Block>,
    accepted: Vec<usize>,
}

impl Screen {
    fn of(problem: &Problem, base: &FitResult, accepted: &[Candidate], open: &[&Candidate]) -> Self {
        let linear = open.iter().filter(|candidate| candidate.kind.guesses.is_empty());
        let mut columns = free_parameters(accepted);
        columns.extend(linear.flat_map(|candidate| candidate.free.clone()));
        let equations = problem.equations(&base.values, &columns);
        let validation = problem.blocks(&problem.validation, &base.values, &columns);
        Self { estimation: equations.all(), equations, validation, accepted: free_parameters(accepted) }
    }

    /// The fit that the linearised equations promise.
    fn promised(&self, problem: &Problem, base: &FitResult, candidate: &Candidate) -> FitResult {
        let wanted: Vec<usize> = self.accepted.iter().chain(&candidate.free).copied().collect();
        let columns = &self.equations.free;
        let at: Vec<usize> =
            wanted.iter().filter_map(|p| columns.iter().position(|column| column == p)).collect();
        let of = |blocks: &[Block]| -> Vec<Block> { blocks.iter().map(|block| block.of(&at)).collect() };
        let (fit, test) = (of(&self.estimation), of(&self.validation));
        promise(problem, &base.values, wanted, &fit, &test)
    }
}

/// The fit that the equations about `values` promise.
fn promise(
    problem: &Problem,
    values: &[f64],
    free: Vec<usize>,
    estimation: &[Block],
    validation: &[Block],
) -> FitResult {
    let step = problem.step(estimation, values, &free);
    let after =
        |blocks: &[Block]| -> Vec<f64> { blocks.iter().map(|block| block.cost_after(&step)).collect() };
    let moved: Vec<Block> = estimation.iter().map(|block| block.after(&step)).collect();
    FitResult {
        values: problem.moved(values, &free, &step),
        unbounded: unbounded(&normal::sum(estimation), values, &free),
        covariance: normal::covariance(&moved),
        validation_costs: if problem.validation.is_empty() {
            problem.cross_validated(estimation, values, &free)
        } else {
            after(validation)
        },
        estimation_costs: after(estimation),
        free,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::run::problem;
    use crate::simulated::effect;
    use crate::test_flights::{candidate, simulated, with_light_rotors};
    use plant::effects::Effect;
    use std::cell::Cell;

    /// The end of a search among mass, thrust and inertia, in which the mass was taken and then given up for the other two.
    fn found(truth: &[Effect]) -> Selection {
        let vehicle = with_light_rotors();
        let set = simulated(&vehicle, truth);
        let (mut problem, _) = problem(&vehicle, &[], &set).expect("usable flights");
        let [mass, thrust, inertia] =
            ["mass-error", "thrust-scale", "inertia-error"].map(|name| candidate(&problem, name));
        let candidates = [mass.clone(), thrust.clone(), inertia.clone()];
        let declared = problem.fitted(&problem.model.parameters.baseline(), &[]);
        problem.weigh(&declared, &candidates);
        let declared = problem.fitted(&declared.values, &[]);
        let alone = fitted(&problem, &declared, &[], &mass);
        let taken = judged(&problem, &declared, &mass, alone, FALSE_RATE);
        let accepted = vec![thrust, inertia];
        let base = problem.fitted(&declared.values, &free_parameters(&accepted));
        let rounds = vec![Round { judged: vec![taken], taken: Some(0) }];
        let search = StepwiseSearch { accepted, rounds, base };
        search.finished(&mut problem, &candidates, &mut |_| (), &|| false)
    }

    #[test]
    fn candidates_beside_those_that_are_taken_together_are_promises() {
        let vehicle = with_light_rotors();
        let set = simulated(&vehicle, &[effect("mass-error", &[("error", 0.2)])]);
        let (mut problem, _) = problem(&vehicle, &[], &set).expect("usable flights");
        let all = ["mass-error", "thrust-scale"].map(|name| candidate(&problem, name));
        let declared = problem.fitted(&problem.model.parameters.baseline(), &[]);
        problem.weigh(&declared, &all);
        let declared = problem.fitted(&declared.values, &[]);
        let open: Vec<&Candidate> = all.iter().collect();
        let found = promised_beside(&problem, &declared, &[], &open, FALSE_RATE);
        let candidates: Vec<&Candidate> = found.iter().map(|judged| &judged.candidate).collect();
        assert_eq!(candidates, open);
        let is_promise = |judged: &Judged| judged.way == Way::Promise && !judged.is_accepted;
        assert!(found.iter().all(|judged| is_promise(judged) && judged.gain > 0.0), "{found:?}");
    }

    /// The search among mass, thrust and inertia of a heavier vehicle, stopped before the round of this number.
    fn stopped_before(round: usize) -> Selection {
        let vehicle = with_light_rotors();
        let set = simulated(&vehicle, &[effect("mass-error", &[("error", 0.2)])]);
        let (problem, _) = problem(&vehicle, &[], &set).expect("usable flights");
        let candidates =
            ["mass-error", "thrust-scale", "inertia-error"].map(|name| candidate(&problem, name));
        let asked = Cell::new(0);
        let is_stopped = || {
            asked.set(asked.get() + 1);
            asked.get() >= round
        };
        select(problem, &candidates, &mut |_| (), &is_stopped).1
    }

    #[test]
    fn a_search_that_is_stopped_keeps_the_effects_of_its_rounds() {
        let stopped = stopped_before(2);
        assert!(stopped.is_stopped && stopped.refined.is_none() && stopped.worths.is_empty(), "{stopped:?}");
        assert_eq!((stopped.rounds.len(), stopped.accepted.len()), (1, 1), "{stopped:?}");
        assert!(stopped.after.estimation_cost() < stopped.before.estimation_cost(), "{stopped:?}");
        let at_once = stopped_before(1);
        assert!(at_once.is_stopped && at_once.rounds.is_empty() && at_once.accepted.is_empty());
    }

    /// More mass turns as the declared vehicle does, and this one turns by a quarter slower.
    #[test]
    fn thrust_and_inertia_stay_where_a_mass_is_far_from_both() {
        let inertia = effect("inertia-error", &[("error_xx", 0.2), ("error_yy", 0.2)]);
        let selection = found(&[effect("thrust-scale", &[("error", -0.1)]), inertia]);
        let names: Vec<_> = selection.accepted.iter().map(|candidate| candidate.kind.name).collect();
        assert_eq!(names, ["thrust-scale", "inertia-error"], "{:?}", selection.withdrawn);
        assert!(selection.withdrawn.is_empty(), "{:?}", selection.withdrawn);
    }

    /// More mass alone: the search does not end with the two that stand for it.
    #[test]
    fn a_mass_is_named_again_after_it_was_given_up_for_two() {
        let selection = found(&[effect("mass-error", &[("error", 0.2)])]);
        let names: Vec<_> = selection.accepted.iter().map(|candidate| candidate.kind.name).collect();
        assert_eq!(names, ["mass-error"], "{:?}", selection.withdrawn);
    }
}
