//! Revision of a finished search: one effect that is taken back, or one more that predictions ask for.
//!
//! Effects are found by the equations of each moment. What counts in the end are predictions: so the parameters are refined by
//! prediction errors (`refine`), and an effect without which these are smaller is taken back. Where predictions ask for other values than the
//! equations, they may ask for an effect that the equations hardly show. Such a candidate is added if predictions are better with it beyond chance.

use crate::candidate::{Candidate, free_parameters};
use crate::fit::{FitResult, Problem};
use crate::foresight::{Foresight, Growth};
use crate::judgement::{FALSE_RATE, Judged, at_bound, fitted, joint_p_value};
use crate::refine::{Refined, refined};
use crate::sensor_effects::SENSOR_EFFECTS;
use plant::effects::Action;
use serde::Serialize;

/// Number of candidates that are fitted of those that predictions may ask for.
const TRIED: usize = 3;
/// Level at which a refined effect has to be beyond chance: it was so by the equations at [`FALSE_RATE`] already.
const REFINED_RATE: f64 = 0.05;
/// A candidate has to promise at least this part of the loss.
const LEAST_PROMISE: f64 = 0.02;

/// An effect that was accepted and taken back.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Withdrawn {
    /// The effect.
    pub effect: &'static str,
    /// The reason.
    pub reason: String,
}

/// The next turn of a search.
#[derive(Debug)]
pub enum Revision {
    /// Without this effect.
    Without(Withdrawn),
    /// With this candidate.
    With(Box<Judged>),
    /// Nothing: it is over. The fit is refined where that predicts better.
    Done(Option<FitResult>),
}

/// Revisions of one search, which know each other.
#[derive(Debug, Default)]
pub struct Revisions {
    /// The values that were refined last.
    near: Option<Vec<f64>>,
    /// Candidates that predictions have asked for once.
    tried: Vec<Candidate>,
    /// Those of them that were added.
    added: Vec<Candidate>,
}

impl Revisions {
    /// Candidates that were added since predictions ask for them. The equations alone may hardly show them.
    pub fn added(&self) -> &[Candidate] {
        &self.added
    }

    /// The revision of the `accepted` effects with the fit `base`; `open` are the candidates that may be added.
    pub fn next(
        &mut self,
        problem: &Problem,
        accepted: &[Candidate],
        base: &FitResult,
        open: &[Candidate],
        progress: &mut dyn FnMut(&str),
    ) -> Revision {
        progress("every effect once more, by its parameters");
        let search = Found { problem, accepted, base };
        if let Some(found) = search.unsound(base, FALSE_RATE, &self.added) {
            return Revision::Without(found);
        }
        progress("refinement by prediction errors");
        let Some(moved) = refined(problem, base, self.near.as_deref()) else {
            progress("every effect once more, by predictions");
            return search.worst().map_or(Revision::Done(None), Revision::Without);
        };
        self.near = Some(moved.result.values.clone());
        progress("every effect once more, by predictions");
        if let Some(found) =
            search.unsound(&moved.result, REFINED_RATE, &[]).or_else(|| search.worst_refined(&moved))
        {
            return Revision::Without(found);
        }
        progress("further effects, by predictions");
        match self.asked_for(&search, &moved, open) {
            Some(found) => Revision::With(Box::new(found)),
            None => Revision::Done(Some(moved.result)),
        }
    }

    /// The candidate with which predictions are better beyond chance, of those that promise most.
    fn asked_for(&mut self, search: &Found, now: &Refined, open: &[Candidate]) -> Option<Judged> {
        // A flight on which parameters were moved would ask for any effect.
        if !now.is_held_out() {
            return None;
        }
        let Found { problem, accepted, base } = *search;
        let is_open = |candidate: &&Candidate| {
            let is_linear = candidate.kind.guesses.is_empty() && !candidate.kind.is_delay;
            // A declared number is a gain of torques or forces. Where a controller answers disturbances, predictions ask for other gains
            // whatever the vehicle is (Forssell and Ljung, Automatica 35, 1999).
            let is_gain = candidate.kind.actions.iter().any(|action| matches!(action, Action::Vehicle(_)));
            let is_new = !accepted.contains(candidate) && !self.tried.contains(candidate);
            is_linear && is_new && !is_gain && !SENSOR_EFFECTS.contains(&candidate.kind)
        };
        let candidates: Vec<&Candidate> = open.iter().filter(is_open).collect();
        let mut promises: Vec<(f64, &Candidate)> =
            now.promises(&candidates).into_iter().zip(candidates).collect();
        promises.retain(|(promise, _)| *promise > LEAST_PROMISE);
        promises.sort_by(|a, b| b.0.total_cmp(&a.0));
        let level = FALSE_RATE / promises.len().max(1) as f64;
        for (_, candidate) in promises.into_iter().take(TRIED) {
            self.tried.push(candidate.clone());
            let fitted = fitted(problem, base, accepted, candidate);
            let Some(moved) = refined(problem, &fitted, Some(&now.result.values)) else { continue };
            let p_value = moved.foresight(&[]).chance_against(&now.foresight(&[]));
            let is_sound = at_bound(problem, candidate, &moved.result).is_none()
                && joint_p_value(problem, &moved.result, candidate) < FALSE_RATE;
            if p_value < level && is_sound {
                let gain = (base.validation_cost() - fitted.validation_cost()) / base.validation_cost();
                let candidate = candidate.clone();
                self.added.push(candidate.clone());
                return Some(Judged {
                    candidate,
                    fitted,
                    gain,
                    p_value,
                    is_accepted: true,
                    is_logging: false,
                    is_promise: false,
                });
            }
        }
        None
    }
}

/// The findings of a search.
#[derive(Clone, Copy)]
struct Found<'s, 'f> {
    problem: &'s Problem<'f>,
    accepted: &'s [Candidate],
    base: &'s FitResult,
}

impl Found<'_, '_> {
    /// An accepted effect with a parameter that `fitted` left at a bound, or the one that is least beyond chance beside the others, if that is not at
    /// `level`. Those `asked` for by predictions alone need not be.
    fn unsound(&self, fitted: &FitResult, level: f64, asked: &[Candidate]) -> Option<Withdrawn> {
        let stopped = |candidate: &Candidate| {
            let bound = at_bound(self.problem, candidate, fitted)?;
            let reason = format!("{bound}: more is asked for than this effect can be");
            Some(Withdrawn { effect: candidate.kind.name, reason })
        };
        let chance =
            |candidate: &Candidate| (candidate.kind.name, joint_p_value(self.problem, fitted, candidate));
        let by_chance = || {
            let all = self.accepted.iter().filter(|candidate| !asked.contains(candidate)).map(chance);
            let unsure = all.filter(|(_, chance)| *chance >= level);
            let (effect, chance) = unsure.max_by(|a, b| a.1.total_cmp(&b.1))?;
            let reason =
                format!("its parameters are no longer beyond chance beside those of the others: {chance:.3}");
            Some(Withdrawn { effect, reason })
        };
        self.accepted.iter().find_map(stopped).or_else(by_chance)
    }

    /// The accepted candidates of an effect.
    fn of_effect(&self, name: &str) -> Vec<Candidate> {
        self.accepted.iter().filter(|candidate| candidate.kind.name == name).cloned().collect()
    }

    /// The accepted effect without which predictions are better, of several the one with the greatest growth.
    fn worst(&self) -> Option<Withdrawn> {
        let Self { problem, accepted, base } = self;
        if accepted.is_empty() {
            return None;
        }
        let equations = problem.equations(&base.values, &base.free);
        self.worst_by(&Foresight::of(problem, &equations, base, &[]), |name| {
            let of_effect = self.of_effect(name);
            // What begins at a guess is far from linear: the others are fitted in full.
            if of_effect.iter().any(|candidate| !candidate.kind.guesses.is_empty()) {
                let (_, fitted) = without_effect(problem, accepted, base, name);
                let equations = problem.equations(&fitted.values, &fitted.free);
                Foresight::of(problem, &equations, &fitted, &[])
            } else {
                Foresight::of(problem, &equations, base, &free_parameters(&of_effect))
            }
        })
    }

    /// The same with the others refined by prediction errors, as the effect is.
    fn worst_refined(&self, refined: &Refined) -> Option<Withdrawn> {
        self.worst_by(&refined.foresight(&[]), |name| {
            let of_effect = self.of_effect(name);
            // Errors of sensors are not refined: without them the others are fitted and refined anew.
            if of_effect.iter().any(|candidate| SENSOR_EFFECTS.contains(&candidate.kind)) {
                self.refined_without(name, &refined.result.values)
            } else {
                refined.foresight(&free_parameters(&of_effect))
            }
        })
    }

    /// Predictions without an effect, with the others fitted and refined from the values `near` on.
    fn refined_without(&self, effect: &str, near: &[f64]) -> Foresight {
        let Self { problem, accepted, base } = self;
        let (_, fitted) = without_effect(problem, accepted, base, effect);
        refined(problem, &fitted, Some(near)).map_or_else(
            || Foresight::of(problem, &problem.equations(&fitted.values, &fitted.free), &fitted, &[]),
            |moved| moved.foresight(&[]),
        )
    }

    /// One error that grows with an effect does not matter where all of them together become smaller.
    fn worst_by(&self, with: &Foresight, without: impl Fn(&'static str) -> Foresight) -> Option<Withdrawn> {
        let mut names: Vec<&'static str> =
            self.accepted.iter().map(|candidate| candidate.kind.name).collect();
        names.dedup();
        let growth = |name: &'static str| {
            let without = without(name);
            let growth = with.growth(&without)?;
            (!with.is_better_than(&without)).then_some((name, growth))
        };
        let (effect, Growth { channel, horizon_s, without, with, unit }) =
            names.into_iter().filter_map(growth).max_by(|a, b| a.1.ratio().total_cmp(&b.1.ratio()))?;
        let reason = format!(
            "the error of {channel} after {horizon_s} s is {without:.3} {unit} without it, {with:.3} {unit} with it"
        );
        Some(Withdrawn { effect, reason })
    }
}

/// The accepted candidates but those of an effect, and their fit.
pub fn without_effect(
    problem: &Problem,
    accepted: &[Candidate],
    base: &FitResult,
    effect: &str,
) -> (Vec<Candidate>, FitResult) {
    let (dropped, others): (Vec<Candidate>, Vec<Candidate>) =
        accepted.iter().cloned().partition(|candidate| candidate.kind.name == effect);
    let mut start = base.values.clone();
    free_parameters(&dropped)
        .into_iter()
        .for_each(|at| start[at] = problem.model.parameters.all[at].baseline);
    let fitted = problem.fitted(&start, &free_parameters(&others));
    (others, fitted)
}
