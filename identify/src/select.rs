//! Attribution: which candidates the flights ask for, one after the other.
//!
//! In each round every candidate is fitted, together with what was accepted before, on the estimation data, and judged
//! on the validation data. It is accepted only if four things hold:
//!
//! 1. The gain on the validation data is beyond chance: the mean of the blocks' gains is above zero at 5 % over all
//!    candidates of the round together (Bonferroni; one-sided percentile bootstrap over blocks, Efron 1979).
//! 2. One of its parameters differs from its baseline beyond chance on the estimation data, at the same level.
//! 3. The gain matters: it is at least [`LEAST_GAIN`] of the squared error.
//! 4. It is not for an effect of which more is asked than it can be: not all parameters that moved stopped at a bound.
//!
//! Of the accepted the one with the greatest gain is taken, but one with fewer parameters where the difference is not
//! beyond chance. Then those taken before have to pass the first test again, as a later effect may explain what an
//! earlier one stood in for.
//!
//! Where a round accepts nothing although much is left that candidates together would take away, two are looked for that
//! only gain together, under the same tests; the chance of a false acceptance in that search is [`FALSE_RATE`] once more.
//! The rounds end when nothing changes any more.

use crate::candidate::{Candidate, free_parameters};
use crate::fit::{FitResult, Problem};
use crate::logging;
use crate::normal::{self, Block};
use crate::sensor_effects::POSE_DELAY;
use plant::effects::EffectKind;
use rand_core::{Rng, SeedableRng};
use rayon::prelude::*;

/// A smaller part of the squared error does not matter, however certain it is: what the comparison itself leaves at
/// its joints is of the order of a tenth of it.
const LEAST_GAIN: f64 = 0.002;
/// A smaller part of a plausible value is none worth naming.
const LEAST_PART: f64 = 0.01;
/// Chance of a false acceptance in a round.
const FALSE_RATE: f64 = 0.05;
/// Two candidates whose difference is within this one-sided level cannot be told apart.
const CONFOUNDED_LEVEL: f64 = 0.05;
/// Resamples of a bootstrap: enough for the level of one among thirty candidates, tried beside four others.
const RESAMPLES: usize = 20_000;
/// After so many that lose, a chance is known well enough.
const LOSSES_ENOUGH: usize = 500;
/// So many candidates of a round are fitted in earnest.
const CONFIRMED: usize = 4;
/// A confounded effect has at least this part of the gain.
const NEAR: f64 = 0.5;
/// More rounds than there are effects worth naming.
const ROUNDS_MAX: usize = 12;
/// Two that mask each other are looked for where this many times the cost is left that all candidates together
/// would leave on the estimation data.
const MUCH_LEFT: f64 = 1.5;
/// So many candidates are tried as the first of two.
const FIRSTS: usize = 4;

/// A candidate that was fitted and judged.
#[derive(Debug, Clone)]
pub struct Judged {
    /// The candidate.
    pub candidate: Candidate,
    /// The fit of it and of what was accepted before.
    pub fitted: FitResult,
    /// Gain on the validation data as a part of their squared error.
    pub gain: f64,
    /// Chance of as much without the effect.
    pub p_value: f64,
    /// Whether it was accepted.
    pub is_accepted: bool,
    /// Whether `fitted` is no fit but what the linearised equations promise.
    pub is_promise: bool,
}

/// One round.
#[derive(Debug, Clone)]
pub struct Round {
    /// Everything judged in it.
    pub judged: Vec<Judged>,
    /// Which of it was taken.
    pub taken: Option<usize>,
}

impl Round {
    /// What was taken.
    pub fn taken(&self) -> Option<&Judged> {
        self.taken.map(|at| &self.judged[at])
    }
}

/// What a selection came to.
#[derive(Debug, Clone)]
pub struct Selection {
    /// What was accepted, in order.
    pub accepted: Vec<Candidate>,
    /// The declared model.
    pub before: FitResult,
    /// The model with all that was accepted.
    pub after: FitResult,
    /// The rounds.
    pub rounds: Vec<Round>,
}

impl Selection {
    /// Chance of as much gain without the accepted `effect`, in the round that took the best part of it.
    pub fn p_value(&self, effect: &str) -> f64 {
        let taken = self.rounds.iter().filter_map(Round::taken);
        taken
            .filter(|judged| judged.candidate.kind.name == effect)
            .map(|judged| judged.p_value)
            .fold(1.0, f64::min)
    }
}

/// Selects among `candidates`, telling `progress` of each step.
///
/// Where flights have trims of their own, these are left out at first; in the end a shift of the centre of mass, which
/// is what most trims are, is tried with them.
pub fn select(problem: &mut Problem, candidates: &[Candidate], progress: &mut dyn FnMut(&str)) -> Selection {
    let declared = problem.model.parameters.baseline();
    let base = problem.fitted(&declared, &[]);
    let mut search = StepwiseSearch { accepted: Vec::new(), rounds: Vec::new(), base };
    search.run(problem, candidates, progress);
    if problem.has_own_trims {
        let (base, of_trim) = (search.base.clone(), Candidate::is_trim);
        problem.has_own_trims = false;
        let shifts: Vec<Candidate> =
            candidates.iter().filter(|candidate| of_trim(candidate)).cloned().collect();
        search.run(problem, &shifts, progress);
        if !search.accepted.iter().any(of_trim) {
            problem.has_own_trims = true;
            search.base = base;
        }
    }
    let StepwiseSearch { accepted, rounds, base } = search;
    problem.weigh(&base, candidates);
    let after = problem.fitted(&base.values, &free_parameters(&accepted));
    let before = problem.fitted(&declared, &[]);
    Selection { accepted, before, after, rounds }
}

/// How far a selection has come.
struct StepwiseSearch {
    accepted: Vec<Candidate>,
    rounds: Vec<Round>,
    base: FitResult,
}

impl StepwiseSearch {
    /// Rounds among `candidates` until none changes anything.
    fn run(&mut self, problem: &mut Problem, candidates: &[Candidate], progress: &mut dyn FnMut(&str)) {
        for _ in 0..ROUNDS_MAX {
            let open = candidates.iter().filter(|candidate| !self.accepted.contains(candidate)).count();
            if open == 0 {
                break;
            }
            progress(&format!("round {}: {open} candidates", self.rounds.len() + 1));
            problem.weigh(&self.base, candidates);
            self.base = problem.fitted(&self.base.values, &free_parameters(&self.accepted));
            self.rounds.push(round(problem, &self.base, &self.accepted, candidates, FALSE_RATE));
            if !(self.take(problem) || self.take_two(problem, candidates)) {
                break;
            }
        }
    }

    /// Accepts what the last round took.
    fn take(&mut self, problem: &Problem) -> bool {
        let Some(taken) = self.rounds.last().and_then(Round::taken).cloned() else { return false };
        self.accepted.push(taken.candidate);
        self.base = without_idle(problem, taken.fitted, &mut self.accepted);
        true
    }

    /// Accepts two that only gain together: of two strong effects each can make the blocks worse in which the other
    /// acts. The firsts that are tried are chosen on the estimation data, the second in a round with the first, and then
    /// the first has to pass a round with the second.
    fn take_two(&mut self, problem: &Problem, candidates: &[Candidate]) -> bool {
        let Some(last) = self.rounds.last() else { return false };
        if problem.left(&self.base) < MUCH_LEFT {
            return false;
        }
        let mut firsts = last.judged.clone();
        firsts.sort_by(|a, b| a.fitted.estimation_cost().total_cmp(&b.fitted.estimation_cost()));
        firsts.truncate(FIRSTS);
        let rate = FALSE_RATE / FIRSTS as f64;
        let with = |accepted: &[Candidate], one: &Candidate| [accepted, std::slice::from_ref(one)].concat();
        for Judged { candidate: first, .. } in firsts {
            let alone = fitted(problem, &self.base, &self.accepted, &first);
            let with_first = with(&self.accepted, &first);
            let second_round = round(problem, &alone, &with_first, candidates, rate);
            let Some(second) = second_round.taken().cloned() else { continue };
            let with_second = with(&self.accepted, &second.candidate);
            let both = with(&with_first, &second.candidate);
            let without_first = without(problem, &second.fitted, &both, self.accepted.len());
            let mut first_round = round(problem, &without_first, &with_second, candidates, rate);
            first_round.taken =
                first_round.judged.iter().position(|judged| judged.candidate == first && judged.is_accepted);
            let is_gain = p_value(&self.base.validation_costs, &second.fitted.validation_costs) < rate;
            if is_gain && first_round.taken.is_some() {
                self.rounds.extend([first_round, second_round]);
                self.accepted = both;
                self.base = without_idle(problem, second.fitted, &mut self.accepted);
                return true;
            }
        }
        false
    }
}

/// The fit of `accepted` but that at `at`, from `base` on.
fn without(problem: &Problem, base: &FitResult, accepted: &[Candidate], at: usize) -> FitResult {
    let mut others = accepted.to_vec();
    let dropped = others.remove(at);
    let mut start = base.values.clone();
    dropped.free.iter().for_each(|at| start[*at] = problem.model.parameters.all[*at].baseline);
    problem.fitted(&start, &free_parameters(&others))
}

/// Judges all of `candidates` that are not in `accepted`; `rate` is the chance of a false acceptance among them.
fn round(
    problem: &Problem,
    base: &FitResult,
    accepted: &[Candidate],
    candidates: &[Candidate],
    rate: f64,
) -> Round {
    let open: Vec<&Candidate> = candidates.iter().filter(|candidate| !accepted.contains(candidate)).collect();
    let level = rate / open.len().max(1) as f64;
    let screen = Screen::of(problem, base, accepted, &open);
    let judge = |candidate: &&Candidate| {
        let is_promise = candidate.kind.guesses.is_empty();
        let fitted = if is_promise {
            screen.promised(problem, base, candidate)
        } else {
            fitted(problem, base, accepted, candidate)
        };
        Judged { is_promise, ..judged(problem, base, candidate, fitted, level) }
    };
    let mut all: Vec<Judged> = open.par_iter().map(judge).collect();
    confirm(problem, base, accepted, &mut all, level);
    let taken = best(&all);
    Round { judged: all, taken }
}

/// Has those of whom the linearised equations promise most fitted in earnest; a promise alone is not accepted.
fn confirm(problem: &Problem, base: &FitResult, accepted: &[Candidate], all: &mut [Judged], level: f64) {
    let mut promises: Vec<&mut Judged> =
        all.iter_mut().filter(|judged| judged.is_accepted && judged.is_promise).collect();
    promises.sort_by(|a, b| b.gain.total_cmp(&a.gain));
    promises.into_par_iter().enumerate().for_each(|(place, promise)| {
        if place < CONFIRMED {
            let fitted = fitted(problem, base, accepted, &promise.candidate);
            *promise = judged(problem, base, &promise.candidate, fitted, level);
        } else {
            promise.is_accepted = false;
        }
    });
}

fn judged(
    problem: &Problem,
    base: &FitResult,
    candidate: &Candidate,
    fitted: FitResult,
    level: f64,
) -> Judged {
    let gain = base.validation_cost() - fitted.validation_cost();
    let p_value = p_value(&base.validation_costs, &fitted.validation_costs);
    let t_value = t_value(problem, &fitted, candidate);
    let is_accepted = p_value < level
        && t_value > fitted.t_quantile(1.0 - level / 2.0)
        && gain > LEAST_GAIN * base.validation_cost()
        && is_seen(problem, candidate, &fitted)
        && !logging::explains(problem, candidate.kind, &candidate.free, &fitted)
        && !is_beyond_bounds(problem, candidate, &fitted);
    let (candidate, gain) = (candidate.clone(), gain / base.validation_cost());
    Judged { candidate, fitted, gain, p_value, is_accepted, is_promise: false }
}

/// Whether one of its parameters is large enough to be more than an artefact of the grid: a delay of more than half a
/// step, anything else at least [`LEAST_PART`] of what is plausible.
fn is_seen(problem: &Problem, candidate: &Candidate, fitted: &FitResult) -> bool {
    candidate.free.iter().any(|at| {
        let entry = &problem.model.parameters.all[*at];
        let least = if entry.kind.is_delay { problem.least_delay_s() } else { LEAST_PART * entry.scale };
        (fitted.values[*at] - entry.baseline).abs() > least
    })
}

/// Whether every parameter that moved stopped at a bound: then more is asked for than the effect can be, and so another
/// is at work.
#[allow(clippy::float_cmp, reason = "values that stop at a bound are the bound")]
fn is_beyond_bounds(problem: &Problem, candidate: &Candidate, fitted: &FitResult) -> bool {
    candidate.free.iter().all(|at| {
        let (entry, value) = (&problem.model.parameters.all[*at], fitted.values[*at]);
        value == entry.baseline || value == entry.spec().min || value == entry.spec().max
    })
}

/// The candidate's parameters fitted together with the accepted ones, from the best of its starts.
fn fitted(problem: &Problem, base: &FitResult, accepted: &[Candidate], candidate: &Candidate) -> FitResult {
    let mut all = free_parameters(accepted);
    all.extend(&candidate.free);
    let mut start = base.values.clone();
    let mut least = base.estimation_cost();
    let by_clocks: &[f64] = &[problem.shared_late_s];
    let more = (*candidate.kind == POSE_DELAY).then_some(by_clocks);
    for values in candidate.kind.guesses.iter().copied().chain(more) {
        let mut tried = base.values.clone();
        candidate.free.iter().zip(values).for_each(|(at, value)| tried[*at] = *value);
        let cost = problem.costs(&problem.estimation, &tried).iter().sum::<f64>();
        // The parts of a product have no slope at zero, so some other start is taken in any case.
        if cost < least || (start == base.values && candidate.free.len() > 1) {
            (start, least) = (tried, cost.min(least));
        }
    }
    problem.fitted(&start, &all)
}

fn t_value(problem: &Problem, fitted: &FitResult, candidate: &Candidate) -> f64 {
    let t = |at: &usize| {
        let away = (fitted.values[*at] - problem.model.parameters.all[*at].baseline).abs();
        let deviation = fitted.standard_error(*at).unwrap_or(0.0);
        if deviation > 0.0 { away / deviation } else { 0.0 }
    };
    candidate.free.iter().map(t).fold(0.0, f64::max)
}

/// Chance that the mean gain from `before` to `after` is not above zero, by resampling the blocks: of gains so
/// unequal, since a few blocks of violent flight hold most of them, a mean is far from normal.
fn p_value(before: &[f64], after: &[f64]) -> f64 {
    let gains: Vec<f64> = before.iter().zip(after).map(|(before, after)| before - after).collect();
    let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(gains.len() as u64);
    let count = gains.len() as u64;
    let draw =
        |random: &mut rand_chacha::ChaCha8Rng| gains[(((random.next_u64() >> 32) * count) >> 32) as usize];
    let (mut losses, mut drawn) = (0, 0);
    while drawn < RESAMPLES && losses < LOSSES_ENOUGH {
        losses += usize::from((0..count).map(|_| draw(&mut random)).sum::<f64>() <= 0.0);
        drawn += 1;
    }
    // A few blocks that agree prove no more than a few coins that fall alike.
    ((losses + 1) as f64 / (drawn + 1) as f64).max(0.5_f64.powi(gains.len().min(1000) as i32))
}

/// The accepted one with the greatest gain, or the one with the fewest parameters that is not worse beyond chance.
fn best(judged: &[Judged]) -> Option<usize> {
    let accepted: Vec<usize> = (0..judged.len()).filter(|at| judged[*at].is_accepted).collect();
    let by_gain = |a: &&usize, b: &&usize| judged[**a].gain.total_cmp(&judged[**b].gain);
    let greatest = *accepted.iter().max_by(by_gain)?;
    let is_alike = |at: &&usize| !is_worse(&judged[**at].fitted, &judged[greatest].fitted);
    let size = |at: usize| judged[at].candidate.free.len();
    accepted.iter().filter(is_alike).min_by(|a, b| size(**a).cmp(&size(**b)).then(by_gain(b, a))).copied()
}

/// Whether `fitted` is worse on the validation data than `other`, beyond chance.
fn is_worse(fitted: &FitResult, other: &FitResult) -> bool {
    p_value(&fitted.validation_costs, &other.validation_costs) < CONFOUNDED_LEVEL
}

/// Takes back what no longer gains anything.
fn without_idle(problem: &Problem, mut base: FitResult, accepted: &mut Vec<Candidate>) -> FitResult {
    let mut at = 0;
    // The newest has just passed.
    while at + 1 < accepted.len() {
        let fitted = without(problem, &base, accepted, at);
        if is_worse(&fitted, &base) {
            at += 1;
        } else {
            accepted.remove(at);
            base = fitted;
        }
    }
    base
}

/// What the linearised equations promise of each candidate.
struct Screen {
    columns: Vec<usize>,
    estimation: Vec<normal::Block>,
    validation: Vec<normal::Block>,
    accepted: Vec<usize>,
}

impl Screen {
    fn of(problem: &Problem, base: &FitResult, accepted: &[Candidate], open: &[&Candidate]) -> Self {
        let linear = open.iter().filter(|candidate| candidate.kind.guesses.is_empty());
        let mut columns = free_parameters(accepted);
        columns.extend(linear.flat_map(|candidate| candidate.free.clone()));
        let blocks = |flights| problem.blocks(flights, &base.values, &columns);
        let (estimation, validation) = (blocks(&problem.estimation), blocks(&problem.validation));
        Self { columns, estimation, validation, accepted: free_parameters(accepted) }
    }

    /// The fit that the linearised equations promise.
    fn promised(&self, problem: &Problem, base: &FitResult, candidate: &Candidate) -> FitResult {
        let wanted: Vec<usize> = self.accepted.iter().chain(&candidate.free).copied().collect();
        let at: Vec<usize> =
            wanted.iter().filter_map(|p| self.columns.iter().position(|column| column == p)).collect();
        let of = |blocks: &[Block]| -> Vec<Block> { blocks.iter().map(|block| block.of(&at)).collect() };
        let (fit, test) = (of(&self.estimation), of(&self.validation));
        let step = problem.step(&fit, &base.values, &wanted);
        let after =
            |blocks: &[Block]| -> Vec<f64> { blocks.iter().map(|block| block.cost_after(&step)).collect() };
        let moved: Vec<Block> = fit.iter().map(|block| block.after(&step)).collect();
        FitResult {
            values: problem.moved(&base.values, &wanted, &step),
            covariance: normal::covariance(&moved),
            validation_costs: after(&test),
            estimation_costs: after(&fit),
            free: wanted,
        }
    }
}

/// For an accepted candidate: the effects that would do as well in its place, of those that were anywhere near it when
/// it was taken.
pub fn confounded(problem: &Problem, selection: &Selection, at: usize) -> Vec<&'static EffectKind> {
    let candidate = &selection.accepted[at];
    let mut others = selection.accepted.clone();
    others.remove(at);
    let base = without(problem, &selection.after, &selection.accepted, at);
    let is_alike =
        |candidate: &&Candidate| !is_worse(&fitted(problem, &base, &others, candidate), &selection.after);
    let near = near(selection, candidate);
    near.par_iter().filter(|candidate| is_alike(candidate)).map(|candidate| candidate.kind).collect()
}

/// The candidates of other effects that gained at least [`NEAR`] of what `candidate` did in the round that took it.
fn near<'s>(selection: &'s Selection, candidate: &Candidate) -> Vec<&'s Candidate> {
    let took = |round: &&Round| round.taken().is_some_and(|taken| taken.candidate == *candidate);
    let Some(round) = selection.rounds.iter().find(took) else { return Vec::new() };
    let gain = round.taken().map_or(0.0, |taken| taken.gain);
    let is_near = |judged: &&Judged| {
        judged.gain > NEAR * gain
            && judged.candidate.kind.name != candidate.kind.name
            && !selection.accepted.contains(&judged.candidate)
    };
    round.judged.iter().filter(is_near).map(|judged| &judged.candidate).collect()
}
