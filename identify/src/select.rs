//! Attribution: which candidates the flights ask for, one after the other.
//!
//! In each round every candidate is fitted, together with what was accepted before, on the fit flights, and judged
//! on the test flights. It is accepted only if four things hold:
//!
//! 1. The gain on the test flights is beyond chance: the mean of the blocks' gains is above zero at 5 % over all
//!    candidates of the round together (Bonferroni; one-sided percentile bootstrap over blocks, Efron 1979).
//! 2. One of its parameters differs from the declared value beyond chance on the fit flights, at the same level.
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

use crate::candidate::Candidate;
use crate::fit::{Bench, Fitted};
use crate::normal::{self, Block};
use rand_core::{Rng, SeedableRng};
use rayon::prelude::*;
use statrs::distribution::{ContinuousCDF, StudentsT};

/// A smaller part of the squared error does not matter, however certain it is: what the comparison itself leaves at
/// its joints is of the order of a tenth of it.
pub const LEAST_GAIN: f64 = 0.002;
/// A smaller part of a plausible value is none worth naming.
const LEAST_PART: f64 = 0.01;
/// Chance of a false acceptance in a round.
pub const FALSE_RATE: f64 = 0.05;
/// Two rivals whose difference is within this one-sided level cannot be told apart.
const RIVAL_LEVEL: f64 = 0.05;
/// Resamples of a bootstrap: enough for the level of one among thirty candidates, tried beside four others.
const RESAMPLES: usize = 20_000;
/// After so many that lose, a chance is known well enough.
const LOSSES_ENOUGH: usize = 500;
/// So many candidates of a round are fitted in earnest.
const CONFIRMED: usize = 4;
/// A rival has at least this part of the gain.
const NEAR: f64 = 0.5;
/// More rounds than there are effects worth naming.
const ROUNDS_MAX: usize = 12;
/// Two that mask each other are looked for where this many times the squares are left that all candidates together
/// would leave on the fit flights.
const MUCH_LEFT: f64 = 1.5;
/// So many candidates are tried as the first of two.
const FIRSTS: usize = 4;

/// A candidate that was fitted and judged.
#[derive(Debug, Clone)]
pub struct Judged {
    /// The candidate.
    pub candidate: Candidate,
    /// The fit of it and of what was accepted before.
    pub fitted: Fitted,
    /// Gain on the test flights as a part of their squared error.
    pub gain: f64,
    /// Chance of as much without the effect.
    pub gain_chance: f64,
    /// The largest deviation of a parameter from the declared value, in units of its standard error.
    pub parameter_t: f64,
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
    #[must_use]
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
    pub before: Fitted,
    /// The model with all that was accepted.
    pub after: Fitted,
    /// The rounds.
    pub rounds: Vec<Round>,
}

impl Selection {
    /// Chance of as much gain without the accepted `effect`, in the round that took the best part of it.
    #[must_use]
    pub fn chance(&self, effect: &str) -> f64 {
        let taken = self.rounds.iter().filter_map(Round::taken);
        taken.filter(|own| own.candidate.effect == effect).map(|own| own.gain_chance).fold(1.0, f64::min)
    }
}

/// Selects among `candidates`, telling `progress` of each step.
///
/// Where flights have trims of their own, these are left out at first; in the end a shift of the centre of mass, which
/// is what most trims are, is tried with them.
pub fn select(bench: &mut Bench, candidates: &[Candidate], progress: &mut dyn FnMut(&str)) -> Selection {
    let declared = bench.model.parameters.declared();
    let base = bench.fitted(&declared, &[]);
    let mut course = Course { accepted: Vec::new(), rounds: Vec::new(), base };
    course.run(bench, candidates, progress);
    if bench.has_own_trims {
        let (base, of_trim) = (course.base.clone(), |own: &Candidate| own.effect == "com-offset");
        bench.has_own_trims = false;
        let shifts: Vec<Candidate> = candidates.iter().filter(|own| of_trim(own)).cloned().collect();
        course.run(bench, &shifts, progress);
        if !course.accepted.iter().any(of_trim) {
            bench.has_own_trims = true;
            course.base = base;
        }
    }
    let Course { accepted, rounds, base } = course;
    bench.weigh(&base, candidates);
    let after = bench.fitted(&base.values, &which(&accepted));
    let before = bench.fitted(&declared, &[]);
    Selection { accepted, before, after, rounds }
}

/// How far a selection has come.
struct Course {
    accepted: Vec<Candidate>,
    rounds: Vec<Round>,
    base: Fitted,
}

impl Course {
    /// Rounds among `candidates` until none changes anything.
    fn run(&mut self, bench: &mut Bench, candidates: &[Candidate], progress: &mut dyn FnMut(&str)) {
        for _ in 0..ROUNDS_MAX {
            let open = candidates.iter().filter(|candidate| !self.accepted.contains(candidate)).count();
            if open == 0 {
                break;
            }
            progress(&format!("round {}: {open} candidates", self.rounds.len() + 1));
            bench.weigh(&self.base, candidates);
            self.base = bench.fitted(&self.base.values, &which(&self.accepted));
            self.rounds.push(round(bench, &self.base, &self.accepted, candidates, FALSE_RATE));
            if !(self.take(bench) || self.take_two(bench, candidates)) {
                break;
            }
        }
    }

    /// Accepts what the last round took.
    fn take(&mut self, bench: &Bench) -> bool {
        let Some(taken) = self.rounds.last().and_then(Round::taken).cloned() else { return false };
        self.accepted.push(taken.candidate);
        self.base = without_idle(bench, taken.fitted, &mut self.accepted);
        true
    }

    /// Accepts two that only gain together: of two strong effects each can make the blocks worse in which the other
    /// acts. The firsts that are tried are chosen on the fit flights, the second in a round with the first, and then
    /// the first has to pass a round with the second.
    fn take_two(&mut self, bench: &Bench, candidates: &[Candidate]) -> bool {
        let Some(last) = self.rounds.last() else { return false };
        if bench.left(&self.base) < MUCH_LEFT {
            return false;
        }
        let mut firsts: Vec<&Judged> = last.judged.iter().collect();
        firsts.sort_by(|a, b| a.fitted.fit_sum().total_cmp(&b.fitted.fit_sum()));
        let firsts: Vec<Candidate> = firsts.iter().take(FIRSTS).map(|own| own.candidate.clone()).collect();
        let rate = FALSE_RATE / FIRSTS as f64;
        for first in firsts {
            let alone = fitted(bench, &self.base, &self.accepted, &first);
            let with_first = [&self.accepted[..], std::slice::from_ref(&first)].concat();
            let second_round = round(bench, &alone, &with_first, candidates, rate);
            let Some(second) = second_round.taken().cloned() else { continue };
            let with_second = [&self.accepted[..], std::slice::from_ref(&second.candidate)].concat();
            let both = [&with_first[..], std::slice::from_ref(&second.candidate)].concat();
            let without_first = without(bench, &second.fitted, &both, self.accepted.len());
            let mut first_round = round(bench, &without_first, &with_second, candidates, rate);
            first_round.taken =
                first_round.judged.iter().position(|own| own.candidate == first && own.is_accepted);
            let is_gain = chance(&self.base.test_squares, &second.fitted.test_squares) < rate;
            if is_gain && first_round.taken.is_some() {
                self.rounds.extend([first_round, second_round]);
                self.accepted = both;
                self.base = without_idle(bench, second.fitted, &mut self.accepted);
                return true;
            }
        }
        false
    }
}

/// The fit of `accepted` but that at `at`, from `base` on.
fn without(bench: &Bench, base: &Fitted, accepted: &[Candidate], at: usize) -> Fitted {
    let mut others = accepted.to_vec();
    let own = others.remove(at);
    let mut start = base.values.clone();
    own.which.iter().for_each(|at| start[*at] = bench.model.parameters.all[*at].declared);
    bench.fitted(&start, &which(&others))
}

/// The parameters of candidates.
#[must_use]
pub fn which(accepted: &[Candidate]) -> Vec<usize> {
    accepted.iter().flat_map(|candidate| candidate.which.clone()).collect()
}

/// Judges all of `candidates` that are not in `accepted`; `rate` is the chance of a false acceptance among them.
fn round(bench: &Bench, base: &Fitted, accepted: &[Candidate], candidates: &[Candidate], rate: f64) -> Round {
    let open: Vec<&Candidate> = candidates.iter().filter(|candidate| !accepted.contains(candidate)).collect();
    let level = rate / open.len().max(1) as f64;
    let screen = Screen::of(bench, base, accepted, &open);
    let judge = |candidate: &&Candidate| {
        let is_promise = candidate.starts.is_empty();
        let fitted = if is_promise {
            screen.promised(bench, base, candidate)
        } else {
            fitted(bench, base, accepted, candidate)
        };
        Judged { is_promise, ..judged(bench, base, candidate, fitted, level) }
    };
    let mut all: Vec<Judged> = open.par_iter().map(judge).collect();
    confirm(bench, base, accepted, &mut all, level);
    let taken = best(&all);
    Round { judged: all, taken }
}

/// Has those of whom the linearised equations promise most fitted in earnest; a promise alone is not accepted.
fn confirm(bench: &Bench, base: &Fitted, accepted: &[Candidate], all: &mut [Judged], level: f64) {
    let mut promises: Vec<&mut Judged> =
        all.iter_mut().filter(|own| own.is_accepted && own.is_promise).collect();
    promises.sort_by(|a, b| b.gain.total_cmp(&a.gain));
    promises.into_par_iter().enumerate().for_each(|(place, own)| {
        if place < CONFIRMED {
            let fitted = fitted(bench, base, accepted, &own.candidate);
            *own = judged(bench, base, &own.candidate, fitted, level);
        } else {
            own.is_accepted = false;
        }
    });
}

fn judged(bench: &Bench, base: &Fitted, candidate: &Candidate, fitted: Fitted, level: f64) -> Judged {
    let gain = base.test_sum() - fitted.test_sum();
    let gain_chance = chance(&base.test_squares, &fitted.test_squares);
    let parameter_t = parameter_t(bench, &fitted, candidate);
    let is_accepted = gain_chance < level
        && parameter_t > t_quantile(1.0 - level / 2.0, fitted.fit_squares.len())
        && gain > LEAST_GAIN * base.test_sum()
        && is_seen(bench, candidate, &fitted)
        && !is_beyond_bounds(bench, candidate, &fitted);
    Judged {
        candidate: candidate.clone(),
        gain: gain / base.test_sum(),
        gain_chance,
        parameter_t,
        is_accepted,
        is_promise: false,
        fitted,
    }
}

/// Whether one of its parameters is large enough to be more than an artefact of the grid: a delay of more than half a
/// step, anything else at least [`LEAST_PART`] of what is plausible.
fn is_seen(bench: &Bench, candidate: &Candidate, fitted: &Fitted) -> bool {
    candidate.which.iter().any(|at| {
        let own = &bench.model.parameters.all[*at];
        let least = if own.is_delay() { bench.least_delay_s() } else { LEAST_PART * own.plausible };
        (fitted.values[*at] - own.declared).abs() > least
    })
}

/// Whether every parameter that moved stopped at a bound: then more is asked for than the effect can be, and so another
/// is at work.
#[allow(clippy::float_cmp, reason = "values that stop at a bound are the bound")]
fn is_beyond_bounds(bench: &Bench, candidate: &Candidate, fitted: &Fitted) -> bool {
    candidate.which.iter().all(|at| {
        let (own, value) = (&bench.model.parameters.all[*at], fitted.values[*at]);
        value == own.declared || value == own.lower || value == own.upper
    })
}

/// The candidate's parameters fitted together with the accepted ones, from the best of its starts.
fn fitted(bench: &Bench, base: &Fitted, accepted: &[Candidate], candidate: &Candidate) -> Fitted {
    let mut all = which(accepted);
    all.extend(&candidate.which);
    let mut start = base.values.clone();
    let mut least = base.fit_squares.iter().sum::<f64>();
    for values in &candidate.starts {
        let mut tried = base.values.clone();
        candidate.which.iter().zip(values).for_each(|(at, value)| tried[*at] = *value);
        let squares = bench.squares(&bench.fit, &tried).iter().sum::<f64>();
        // The parts of a product have no slope at zero, so some other start is taken in any case.
        if squares < least || (start == base.values && candidate.which.len() > 1) {
            (start, least) = (tried, squares.min(least));
        }
    }
    bench.fitted(&start, &all)
}

fn parameter_t(bench: &Bench, fitted: &Fitted, candidate: &Candidate) -> f64 {
    let t = |at: &usize| {
        let away = (fitted.values[*at] - bench.model.parameters.all[*at].declared).abs();
        let deviation = fitted.deviation(*at).unwrap_or(0.0);
        if deviation > 0.0 { away / deviation } else { 0.0 }
    };
    candidate.which.iter().map(t).fold(0.0, f64::max)
}

/// Chance that the mean gain from `before` to `after` is not above zero, by resampling the blocks: of gains so
/// unequal, since a few blocks of violent flight hold most of them, a mean is far from normal.
fn chance(before: &[f64], after: &[f64]) -> f64 {
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

/// The quantile of Student's distribution for a mean over so many blocks.
fn t_quantile(probability: f64, blocks: usize) -> f64 {
    let freedom = (blocks as f64 - 1.0).max(1.0);
    StudentsT::new(0.0, 1.0, freedom).map_or(f64::INFINITY, |student| student.inverse_cdf(probability))
}

/// The accepted one with the greatest gain, or the one with the fewest parameters that is not worse beyond chance.
fn best(judged: &[Judged]) -> Option<usize> {
    let accepted: Vec<usize> = (0..judged.len()).filter(|at| judged[*at].is_accepted).collect();
    let by_gain = |a: &&usize, b: &&usize| judged[**a].gain.total_cmp(&judged[**b].gain);
    let greatest = *accepted.iter().max_by(by_gain)?;
    let is_rival = |at: &&usize| !is_worse(&judged[**at].fitted, &judged[greatest].fitted);
    let size = |at: usize| judged[at].candidate.which.len();
    accepted.iter().filter(is_rival).min_by(|a, b| size(**a).cmp(&size(**b)).then(by_gain(b, a))).copied()
}

/// Whether `fitted` is worse on the test flights than `other`, beyond chance.
#[must_use]
pub fn is_worse(fitted: &Fitted, other: &Fitted) -> bool {
    chance(&fitted.test_squares, &other.test_squares) < RIVAL_LEVEL
}

/// Takes back what no longer gains anything.
fn without_idle(bench: &Bench, mut base: Fitted, accepted: &mut Vec<Candidate>) -> Fitted {
    let mut at = 0;
    // The newest has just passed.
    while at + 1 < accepted.len() {
        let fitted = without(bench, &base, accepted, at);
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
    fit: Vec<normal::Block>,
    test: Vec<normal::Block>,
    accepted: Vec<usize>,
}

impl Screen {
    fn of(bench: &Bench, base: &Fitted, accepted: &[Candidate], open: &[&Candidate]) -> Self {
        let linear = open.iter().filter(|candidate| candidate.starts.is_empty());
        let mut columns = which(accepted);
        columns.extend(linear.flat_map(|candidate| candidate.which.clone()));
        let blocks = |flights| bench.blocks(flights, &base.values, &columns);
        let (fit, test) = (blocks(&bench.fit), blocks(&bench.test));
        Self { columns, fit, test, accepted: which(accepted) }
    }

    /// The fit that the linearised equations promise.
    fn promised(&self, bench: &Bench, base: &Fitted, candidate: &Candidate) -> Fitted {
        let wanted: Vec<usize> = self.accepted.iter().chain(&candidate.which).copied().collect();
        let at: Vec<usize> =
            wanted.iter().filter_map(|p| self.columns.iter().position(|own| own == p)).collect();
        let of = |blocks: &[Block]| -> Vec<Block> { blocks.iter().map(|block| block.of(&at)).collect() };
        let (fit, test) = (of(&self.fit), of(&self.test));
        let step = bench.step(&fit, &base.values, &wanted);
        let after =
            |blocks: &[Block]| -> Vec<f64> { blocks.iter().map(|own| own.squares_after(&step)).collect() };
        let moved: Vec<Block> = fit.iter().map(|own| own.after(&step)).collect();
        Fitted {
            values: bench.moved(&base.values, &wanted, &step),
            covariance: normal::covariance(&moved),
            test_squares: after(&test),
            fit_squares: after(&fit),
            which: wanted,
        }
    }
}

/// For an accepted candidate: the effects that would do as well in its place, of those that were anywhere near it when
/// it was taken.
#[must_use]
pub fn rivals(bench: &Bench, selection: &Selection, at: usize) -> Vec<&'static str> {
    let own = &selection.accepted[at];
    let mut others = selection.accepted.clone();
    others.remove(at);
    let base = without(bench, &selection.after, &selection.accepted, at);
    let is_rival =
        |candidate: &&Candidate| !is_worse(&fitted(bench, &base, &others, candidate), &selection.after);
    let near = near(selection, own);
    let mut names: Vec<&'static str> =
        near.par_iter().filter(|candidate| is_rival(candidate)).map(|candidate| candidate.effect).collect();
    names.dedup();
    names
}

/// The candidates of other effects that gained at least [`NEAR`] of what `own` did in the round that took it.
fn near<'s>(selection: &'s Selection, own: &Candidate) -> Vec<&'s Candidate> {
    let took = |round: &&Round| round.taken().is_some_and(|taken| taken.candidate == *own);
    let Some(round) = selection.rounds.iter().find(took) else { return Vec::new() };
    let gain = round.taken().map_or(0.0, |taken| taken.gain);
    let is_near = |judged: &&Judged| {
        judged.gain > NEAR * gain
            && judged.candidate.effect != own.effect
            && !selection.accepted.contains(&judged.candidate)
    };
    round.judged.iter().filter(is_near).map(|judged| &judged.candidate).collect()
}
