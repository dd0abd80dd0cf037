//! Revision of a finished search: one effect that is taken back, or one more that predictions ask for.
//!
//! Effects are found by the equations of each moment. What counts in the end are predictions: so the parameters are refined by
//! prediction errors (`refine`), and an effect without which these are smaller is taken back. Where predictions ask for other values than the
//! equations, they may ask for an effect that the equations hardly show. Such a candidate is added if predictions are better with it beyond chance.
//! Two effects go for one that predicts as well (`simpler`).

use crate::model::flight_wind::FLIGHT_WIND;
use crate::model::problem::Problem;
use crate::model::sensor_effects::{ATTITUDE_BIAS, SENSOR_EFFECTS};
use crate::numbers::digits::quantity;
use crate::search::candidate::{Candidate, free_parameters};
use crate::search::fit_result::FitResult;
use crate::search::foresight::Foresight;
use crate::search::judgement::{FALSE_RATE, Judged, Way, at_bound, fitted, joint_p_value};
use crate::search::logging;
use crate::search::refine::{Refined, refined};
use crate::search::simpler::{Exchange, exchanges};
use crate::search::worth::Worth;
use plant::effects::{Action, EffectKind};
use rayon::prelude::*;
use serde::Serialize;
use std::collections::{BTreeMap, BTreeSet};

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
    /// True if a parameter reached its bound: another cause is at work, which no name is given.
    pub at_bound: bool,
    /// The effect that was accepted instead of this and another one; `None` for all other reasons.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub replaced_by: Option<&'static str>,
}

impl Withdrawn {
    /// An effect that was withdrawn for this reason, without a bound that it reached and without a replacement.
    pub fn because(effect: &'static str, reason: String) -> Self {
        Self { effect, reason, at_bound: false, replaced_by: None }
    }

    /// The two effects that `exchange` replaces.
    fn replaced(exchange: &Exchange) -> Vec<Self> {
        let Exchange { new, old, .. } = exchange;
        let new = new.kind.name;
        let reason =
            format!("{new} alone predicts as well as {} together, with fewer parameters", old.join(" and "));
        let withdrawn = |effect| Self { replaced_by: Some(new), ..Self::because(effect, reason.clone()) };
        old.map(withdrawn).to_vec()
    }
}

/// The next turn of a search.
#[derive(Debug)]
pub enum Revision {
    /// Without these effects.
    Without(Vec<Withdrawn>),
    /// With this candidate.
    With(Box<Judged>),
    /// With one effect instead of two.
    Instead(Box<Exchange>, Vec<Withdrawn>),
    /// Nothing: it is over.
    Done(End),
}

/// The end of a search.
#[derive(Debug, Default)]
pub struct End {
    /// The refined fit, where that predicts better.
    pub refined: Option<FitResult>,
    /// Prediction errors of the judged flights with and without each accepted effect.
    pub worths: BTreeMap<&'static str, Vec<Worth>>,
    /// Accepted errors of sensors that change no prediction noticeably, each with the reason.
    pub without_worth: BTreeMap<&'static str, String>,
    /// True if the search was stopped before: then nothing was refined or judged by predictions.
    pub is_stopped: bool,
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

    /// The revision of the `accepted` effects with the fit `base`; `open` are the candidates that may be added, and
    /// `given_up` those that were accepted and were idle later.
    pub fn next(
        &mut self,
        problem: &Problem,
        (accepted, base): (&[Candidate], &FitResult),
        (open, given_up): (&[Candidate], &[Candidate]),
        progress: &mut dyn FnMut(&str),
    ) -> Revision {
        progress("every effect once more, by its parameters");
        let search = Found { problem, accepted, base };
        if let Some(found) = unsound(problem, accepted, base, &self.added) {
            return Revision::Without(vec![found]);
        }
        progress("refinement by prediction errors");
        let Some(moved) = refined(problem, base, self.near.as_deref()) else {
            progress("every effect once more, by predictions");
            let predictions = search.predictions();
            let together = |dropped: &[usize]| search.foresight(dropped);
            let found = search.unworthy(&predictions, together);
            if !found.is_empty() {
                return Revision::Without(found);
            }
            let exchange = search.simpler(&predictions.with, given_up, &self.added, None);
            return exchange.unwrap_or_else(|| Revision::Done(search.end(None, &predictions)));
        };
        self.near = Some(moved.result.values.clone());
        progress("every effect once more, by predictions");
        if let Some(found) = unsound_refined(problem, accepted, &moved.result) {
            return Revision::Without(vec![found]);
        }
        let predictions = search.predictions_refined(&moved);
        let found = search.unworthy(&predictions, |dropped| moved.foresight(dropped));
        if !found.is_empty() {
            return Revision::Without(found);
        }
        let near = Some(moved.result.values.as_slice());
        if let Some(exchange) = search.simpler(&predictions.with, given_up, &self.added, near) {
            return exchange;
        }
        progress("further effects, by predictions");
        match self.asked_for(&search, &moved, &predictions.with, open) {
            Some(found) => Revision::With(Box::new(found)),
            None => Revision::Done(search.end(Some(moved.result), &predictions)),
        }
    }

    /// The candidate with which predictions are better beyond chance, of those that promise most.
    fn asked_for(
        &mut self,
        search: &Found,
        now: &Refined,
        predictions: &Foresight,
        open: &[Candidate],
    ) -> Option<Judged> {
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
            let is_new = !candidate.is_in(accepted) && !self.tried.contains(candidate);
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
            let p_value = moved.foresight(&[]).chance_against(predictions);
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
                    way: Way::Full,
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
    /// The accepted candidates of an effect.
    fn of_effect(&self, name: &str) -> Vec<Candidate> {
        self.accepted.iter().filter(|candidate| candidate.kind.name == name).cloned().collect()
    }

    /// Predictions with all effects, and without each of them.
    fn predictions(&self) -> Predictions {
        let Self { problem, accepted, base } = self;
        if accepted.is_empty() {
            return Predictions::default();
        }
        let equations = problem.equations(&base.values, &base.free);
        let without = |name| {
            let of_effect = self.of_effect(name);
            // What begins at a guess is far from linear: the others are fitted in full.
            if of_effect.iter().any(|candidate| !candidate.kind.guesses.is_empty()) {
                let (_, fitted) = without_effects(problem, accepted, base, &[name]);
                let equations = problem.equations(&fitted.values, &fitted.free);
                Foresight::of(problem, &equations, &fitted, &[])
            } else {
                Foresight::of(problem, &equations, base, &free_parameters(&of_effect))
            }
        };
        let with = Foresight::of(problem, &equations, base, &[]);
        Predictions {
            with,
            without: self.names().into_par_iter().map(|name| (name, without(name))).collect(),
        }
    }

    /// The same with the others refined by prediction errors, as the effect is.
    fn predictions_refined(&self, refined: &Refined) -> Predictions {
        let without = |name| {
            let of_effect = self.of_effect(name);
            // Errors of sensors and winds of flights are not refined: without them the others are fitted and refined anew.
            let is_held = |kind: &'static EffectKind| SENSOR_EFFECTS.contains(&kind) || *kind == FLIGHT_WIND;
            if of_effect.iter().any(|candidate| is_held(candidate.kind)) {
                self.refined_without(name, &refined.result.values)
            } else {
                refined.foresight(&free_parameters(&of_effect))
            }
        };
        let with = refined.foresight(&[]);
        Predictions {
            with,
            without: self.names().into_par_iter().map(|name| (name, without(name))).collect(),
        }
    }

    /// Names of the accepted effects.
    fn names(&self) -> Vec<&'static str> {
        let mut names: Vec<&'static str> =
            self.accepted.iter().map(|candidate| candidate.kind.name).collect();
        // Of an effect whose parameters are candidates by themselves others may have been accepted in between.
        let mut known = BTreeSet::new();
        names.retain(|name| known.insert(*name));
        names
    }

    /// Predictions without an effect, with the others fitted and refined from the values `near` on.
    fn refined_without(&self, effect: &str, near: &[f64]) -> Foresight {
        let Self { problem, accepted, base } = self;
        let (_, fitted) = without_effects(problem, accepted, base, &[effect]);
        refined(problem, &fitted, Some(near))
            .map_or_else(|| unrefined_foresight(problem, &fitted), |moved| moved.foresight(&[]))
    }

    /// One effect of `given_up` instead of two, of which `now` with both is worth no more.
    fn simpler(
        &self,
        now: &Foresight,
        given_up: &[Candidate],
        kept: &[Candidate],
        near: Option<&[f64]>,
    ) -> Option<Revision> {
        let Self { problem, accepted, base } = self;
        // Where nothing is predicted, the equations alone decide.
        if now.worths(now).is_empty() {
            return None;
        }
        let is_as_good = |exchange: &Exchange| {
            let Exchange { new, fitted, .. } = exchange;
            let moved = refined(problem, fitted, near);
            let result = moved.as_ref().map_or(fitted, |moved| &moved.result);
            let is_sound =
                at_bound(problem, new, result).is_none() && joint_p_value(problem, result, new) < FALSE_RATE;
            let predictions = || match &moved {
                Some(moved) => moved.foresight(&[]),
                None => unrefined_foresight(problem, fitted),
            };
            is_sound && !now.is_worth_more_than(&predictions())
        };
        let found = exchanges(problem, (accepted, base), given_up, kept).into_iter().find(is_as_good)?;
        let old = Withdrawn::replaced(&found);
        Some(Revision::Instead(Box::new(found), old))
    }

    /// The accepted effect that predictions are better without, of several the one with the greatest growth.
    /// Else the effects that they gain nothing by: all of them, if predictions gain nothing by all `together`
    /// (predictions with these parameters at their baselines). Else the one of these that they gain least by.
    /// The part that such an effect takes is missing in the numbers of the others.
    fn unworthy(
        &self,
        predictions: &Predictions,
        together: impl Fn(&[usize]) -> Foresight,
    ) -> Vec<Withdrawn> {
        if let Some(worst) = predictions.worst() {
            return vec![worst];
        }
        let mut idle = predictions.idle(|name| self.may_be_idle(name));
        if idle.len() > 1 {
            let candidates: Vec<Candidate> =
                idle.iter().flat_map(|withdrawn| self.of_effect(withdrawn.effect)).collect();
            // What begins at a guess is far from linear, as above.
            let is_linear = candidates.iter().all(|candidate| candidate.kind.guesses.is_empty());
            if !is_linear || predictions.with.is_worth_more_than(&together(&free_parameters(&candidates))) {
                idle.truncate(1);
            }
        }
        idle
    }

    /// Predictions of the fit, with the parameters `dropped` at their baselines.
    fn foresight(&self, dropped: &[usize]) -> Foresight {
        let Self { problem, base, .. } = self;
        Foresight::of(problem, &problem.equations(&base.values, &base.free), base, dropped)
    }

    /// The end of a search with these `predictions`.
    fn end(&self, refined: Option<FitResult>, predictions: &Predictions) -> End {
        let (worths, without_worth) = (predictions.worths(), self.without_worth(predictions));
        End { refined, worths, without_worth, is_stopped: false }
    }

    /// Accepted errors of sensors that change no prediction noticeably, each with the reason. They stay in the fit: without the rotation of a sensor, the
    /// equations would explain its mean forces by another effect.
    fn without_worth(&self, predictions: &Predictions) -> BTreeMap<&'static str, String> {
        let idle = predictions.idle(|name| self.is_of_attitude(name));
        idle.into_iter().map(|Withdrawn { effect, reason, .. }| (effect, reason)).collect()
    }

    /// True if an effect is the rotation of the attitude's sensor alone. It shows by the direction of forces, and so in predictions. Biases of gyroscope
    /// and accelerometer show against another sensor: predictions do not judge them.
    fn is_of_attitude(&self, name: &str) -> bool {
        self.of_effect(name).iter().all(|candidate| *candidate.kind == ATTITUDE_BIAS)
    }

    /// Errors of sensors may be great and yet change no prediction, and what stands for the logging of the commands is no effect.
    fn may_be_idle(&self, name: &str) -> bool {
        self.of_effect(name).iter().all(|candidate| {
            let is_of_sensor = SENSOR_EFFECTS.contains(&candidate.kind);
            !is_of_sensor && logging::explained_lead_s(self.problem, candidate, self.base).is_none()
        })
    }
}

/// Predictions with all accepted effects, and without each of them.
#[derive(Debug, Default)]
struct Predictions {
    with: Foresight,
    without: Vec<(&'static str, Foresight)>,
}

impl Predictions {
    fn worths(&self) -> BTreeMap<&'static str, Vec<Worth>> {
        self.without.iter().map(|(name, without)| (*name, self.with.worths(without))).collect()
    }

    /// One error that grows with an effect does not matter where all of them together become smaller.
    fn worst(&self) -> Option<Withdrawn> {
        let growth = |(name, without): &(&'static str, Foresight)| {
            let growth = self.with.growth(without)?;
            (!self.with.is_better_than(without)).then_some((*name, growth))
        };
        let (effect, Worth { channel, horizon_s, without, with, unit }) =
            self.without.iter().filter_map(growth).max_by(|a, b| a.1.ratio().total_cmp(&b.1.ratio()))?;
        let [without, with] = [without, with].map(|error| quantity(error, unit));
        let reason =
            format!("the error of {channel} after {horizon_s} s is {without} without it, {with} with it");
        Some(Withdrawn::because(effect, reason))
    }

    /// The effects, of those that may be, without which no error grows; the one that gains least first.
    fn idle(&self, may_be: impl Fn(&'static str) -> bool) -> Vec<Withdrawn> {
        let gain = |(name, without): &(&'static str, Foresight)| {
            let most =
                self.with.worths(without).into_iter().min_by(|a, b| a.ratio().total_cmp(&b.ratio()))?;
            let is_idle = may_be(name) && !self.with.is_worth_more_than(without);
            is_idle.then_some((*name, most))
        };
        let mut idle: Vec<(&'static str, Worth)> = self.without.iter().filter_map(gain).collect();
        idle.sort_by(|a, b| b.1.ratio().total_cmp(&a.1.ratio()));
        let withdrawn = |(effect, Worth { channel, horizon_s, without, with, unit })| {
            let [without, with] = [without, with].map(|error| quantity(error, unit));
            let reason = format!(
                "no prediction error falls noticeably with it; most, the error of {channel} after {horizon_s} s, is {without} \
                 without it, {with} with it"
            );
            Withdrawn::because(effect, reason)
        };
        idle.into_iter().map(withdrawn).collect()
    }
}

/// Predictions of a fit that is not refined.
fn unrefined_foresight(problem: &Problem, fitted: &FitResult) -> Foresight {
    Foresight::of(problem, &problem.equations(&fitted.values, &fitted.free), fitted, &[])
}

/// An accepted effect with a parameter that a fit of the equations left at a bound, or that is not beyond chance beside the others. Those `asked` for
/// by predictions need not be: the equations alone may hardly show them.
pub fn unsound(
    problem: &Problem,
    accepted: &[Candidate],
    fitted: &FitResult,
    asked: &[Candidate],
) -> Option<Withdrawn> {
    let by_chance = || by_chance(problem, accepted, fitted, (FALSE_RATE, asked));
    beyond_bounds(problem, accepted, fitted).or_else(by_chance)
}

/// The same by a refined fit.
pub fn unsound_refined(problem: &Problem, accepted: &[Candidate], refined: &FitResult) -> Option<Withdrawn> {
    let by_chance = || by_chance(problem, accepted, refined, (REFINED_RATE, &[]));
    beyond_bounds(problem, accepted, refined).or_else(by_chance)
}

/// The effect that is least beyond chance beside the others, if it misses `level`, all of its parameters together. Those `asked` for do not count.
fn by_chance(
    problem: &Problem,
    accepted: &[Candidate],
    fitted: &FitResult,
    (level, asked): (f64, &[Candidate]),
) -> Option<Withdrawn> {
    let chance = |candidate: &Candidate| (candidate.kind.name, joint_p_value(problem, fitted, candidate));
    let all = accepted.iter().filter(|candidate| !asked.contains(candidate)).map(chance);
    let unsure = all.filter(|(_, chance)| *chance >= level);
    let (effect, chance) = unsure.max_by(|a, b| a.1.total_cmp(&b.1))?;
    let reason =
        format!("its parameters are no longer beyond chance beside those of the others: {chance:.3}");
    Some(Withdrawn::because(effect, reason))
}

/// The first of the `accepted` effects with a parameter that `fitted` left at a bound.
fn beyond_bounds(problem: &Problem, accepted: &[Candidate], fitted: &FitResult) -> Option<Withdrawn> {
    let of_candidate = |candidate: &Candidate| {
        let reason = at_bound(problem, candidate, fitted)?;
        Some(Withdrawn { at_bound: true, ..Withdrawn::because(candidate.kind.name, reason) })
    };
    accepted.iter().find_map(of_candidate)
}

/// The accepted candidates but those of these effects, and their fit.
pub fn without_effects(
    problem: &Problem,
    accepted: &[Candidate],
    base: &FitResult,
    effects: &[&str],
) -> (Vec<Candidate>, FitResult) {
    let (dropped, others): (Vec<Candidate>, Vec<Candidate>) =
        accepted.iter().cloned().partition(|candidate| effects.contains(&candidate.kind.name));
    let mut start = base.values.clone();
    free_parameters(&dropped)
        .into_iter()
        .for_each(|at| start[at] = problem.model.parameters.all[at].baseline);
    let fitted = problem.fitted(&start, &free_parameters(&others));
    (others, fitted)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::sensor_effects::ACCELEROMETER_BIAS;
    use crate::run::problem;
    use crate::simulated::effect;
    use crate::test_flights::{candidate, simulated, with_light_rotors};

    /// The rotation of the attitude's sensor stands below the verdict where predictions do as well without it, a bias of the accelerometer in the verdict.
    #[test]
    fn the_rotation_of_a_sensor_that_changes_no_prediction_has_no_worth() {
        let vehicle = with_light_rotors();
        let set = simulated(&vehicle, &[]);
        let (mut problem, _) = problem(&vehicle, &[], &set).expect("usable flights");
        let of_kind = |kind: &'static EffectKind| {
            let all = &problem.model.parameters.all;
            Candidate { kind, free: (0..all.len()).filter(|at| all[*at].kind == kind).collect() }
        };
        let [attitude, accelerometer] = [&ATTITUDE_BIAS, &ACCELEROMETER_BIAS].map(of_kind);
        let alone = std::slice::from_ref(&attitude);
        let declared = problem.fitted(&problem.model.parameters.baseline(), &[]);
        problem.weigh(&declared, alone);
        let base = problem.fitted(&declared.values, &attitude.free);
        // Errors without the bias, in units of those with it.
        let without_worth = |accepted: &[Candidate], times: f64| {
            let found = Found { problem: &problem, accepted, base: &base };
            let with = unrefined_foresight(&problem, &base);
            let without = vec![(ATTITUDE_BIAS.name, unrefined_foresight(&problem, &base).times(times))];
            found.without_worth(&Predictions { with, without })
        };
        let found = without_worth(alone, 1.0);
        let reason = found.get("sensor-bias").expect("the same errors without it");
        assert!(reason.starts_with("no prediction error falls noticeably with it"), "{reason}");
        assert!(without_worth(alone, 2.0).is_empty(), "twice as large without it");
        assert!(without_worth(&[attitude.clone(), accelerometer], 1.0).is_empty());
    }

    /// The equations allow the exchange. Predictions with half the errors do not.
    #[test]
    fn two_effects_are_exchanged_only_where_one_predicts_as_well() {
        let vehicle = with_light_rotors();
        let set = simulated(&vehicle, &[effect("mass-error", &[("error", 0.2)])]);
        let (mut problem, _) = problem(&vehicle, &[], &set).expect("usable flights");
        let [mass, thrust, inertia] =
            ["mass-error", "thrust-scale", "inertia-error"].map(|name| candidate(&problem, name));
        let declared = problem.fitted(&problem.model.parameters.baseline(), &[]);
        problem.weigh(&declared, std::slice::from_ref(&mass));
        let accepted = [thrust, inertia];
        let base = problem.fitted(&declared.values, &free_parameters(&accepted));
        let found = Found { problem: &problem, accepted: &accepted, base: &base };
        let exchanged = |times: f64| {
            let now = found.predictions().with.times(times);
            found.simpler(&now, std::slice::from_ref(&mass), &[], None)
        };
        let Some(Revision::Instead(exchange, old)) = exchanged(1.0) else { panic!("no exchange") };
        assert_eq!(exchange.accepted, std::slice::from_ref(&mass));
        assert_eq!(old.len(), 2);
        let worse = exchanged(0.5);
        assert!(worse.is_none(), "{worse:?}");
    }
}
