//! Excerpts: effects are looked for in parts of long flights, and their parameters are fitted on all of them.
//!
//! A search tries some twenty effects in each of several rounds. What is worth naming shows in minutes, so that more than [`SEARCH_S`] of estimation data
//! would take longer and name the same.

use crate::data::parts::{MOST, within};
use crate::data::prepared::Prepared;
use crate::model::problem::Problem;
use crate::search::candidate::free_parameters;
use crate::search::fit_result::FitResult;
use crate::search::judgement::held_at_limits;
use crate::search::refine::refined;
use crate::search::revision::{Withdrawn, unsound, unsound_refined, without_effects};
use crate::search::select::Selection;

/// Effects are looked for in about so much of the estimation data, in s; tuned, no source.
const SEARCH_S: f64 = 160.0;
/// Their parameters are refined by predictions of about so much of it, in s.
const REFINED_S: f64 = 600.0;

/// The problem with pieces of its flights, spread evenly over each; `None` where there is not much more than the search needs.
pub fn excerpt<'f>(problem: &Problem<'f>) -> Option<Problem<'f>> {
    shortened(problem, SEARCH_S)
}

/// The problem with about `time_s` of its estimation data and as much of its validation data, where it has much more.
fn shortened<'f>(problem: &Problem<'f>, time_s: f64) -> Option<Problem<'f>> {
    let share = |flights: &[Prepared]| time_s / flights.iter().map(Prepared::compared_s).sum::<f64>();
    let of = |flights: &[Prepared<'f>]| {
        let share = share(flights);
        let of_flight = |flight| within(flight, if share < MOST { share } else { 1.0 });
        flights.iter().map(of_flight).collect()
    };
    (share(&problem.estimation) < MOST).then(|| Problem {
        model: problem.model.clone(),
        estimation: of(&problem.estimation),
        validation: of(&problem.validation),
        test: Vec::new(),
        noises: problem.noises.clone(),
        block_s: problem.block_s,
        shared_late_s: problem.shared_late_s,
    })
}

/// Fits the parameters of the selection that was `found` in an `excerpt` on all of the problem, and refines them by prediction errors again. The
/// problem gets the noises of the excerpt. Every effect is tested once more: one with a parameter at its bound is withdrawn, and one that is not
/// beyond chance beside the others.
pub fn on_all<'f>(problem: Problem<'f>, excerpt: &Problem, found: Selection) -> (Problem<'f>, Selection) {
    let problem = Problem { noises: excerpt.noises.clone(), ..problem };
    let before = problem.fitted(&problem.model.parameters.baseline(), &[]);
    let mut found = Selection { before, ..found };
    loop {
        let unsound = match fitted_on_all(&problem, &found) {
            Ok((after, refined)) => return (problem, Selection { after, refined, ..found }),
            Err(unsound) => unsound,
        };
        (found.accepted, found.after) =
            without_effects(&problem, &found.accepted, &found.after, &[unsound.effect]);
        found.worths.remove(unsound.effect);
        found.without_worth.remove(unsound.effect);
        found.withdrawn.push(unsound);
    }
}

/// The accepted effects of `found`, fitted on all of `problem`, and refined where they were; an error is the first effect that the fits do not
/// support.
fn fitted_on_all(problem: &Problem, found: &Selection) -> Result<(FitResult, Option<FitResult>), Withdrawn> {
    let accepted = &found.accepted;
    let fitted = problem.fitted(&found.after.values, &free_parameters(accepted));
    let after = held_at_limits(problem, fitted);
    if let Some(unsound) = unsound(problem, accepted, &after, &found.asked) {
        return Err(unsound);
    }
    let shorter = shortened(problem, REFINED_S);
    let predicted = shorter.as_ref().unwrap_or(problem);
    let moved = found.refined.as_ref().and_then(|near| refined(predicted, &after, Some(&near.values)));
    let moved = moved.map(|moved| moved.result);
    match moved.as_ref().and_then(|moved| unsound_refined(problem, accepted, moved)) {
        Some(unsound) => Err(unsound),
        None => Ok((after, moved)),
    }
}

/// The time of a flight that is compared in an excerpt, as a note for the report.
pub fn note(flight: &Prepared) -> String {
    let pieces = flight.layout.clock.pieces_s().len();
    let parts = if pieces == 1 { "one piece".to_owned() } else { format!("{pieces} pieces") };
    format!(
        "effects are looked for in {:.0} s of it, in {parts}; their parameters are fitted on all of it",
        flight.compared_s()
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::prepared::Propulsion;
    use crate::model::parameter::Parameters;
    use crate::model::physics::Model;
    use crate::model::problem::Problem;
    use crate::model::whitening::Noises;
    use crate::simulated::effect;
    use crate::test_flights::{candidate, flown, hummingbird, simulated, with_light_rotors};
    use flights::{Channel, Flight};
    use std::collections::BTreeMap;

    fn problem(flights: &[Flight]) -> Problem<'_> {
        let vehicle = hummingbird();
        let propulsion = Propulsion::of(&vehicle);
        let of_flight = |flight| Prepared::new(flight, None, &propulsion).unwrap();
        Problem {
            model: Model { parameters: Parameters::of(&vehicle, &[]), vehicle },
            estimation: flights.iter().map(of_flight).collect(),
            validation: Vec::new(),
            test: Vec::new(),
            noises: Noises::new(),
            block_s: 2.0,
            shared_late_s: 0.0,
        }
    }

    fn flight(duration_s: f64) -> Flight {
        flown(
            [duration_s, 0.01],
            |t| [2.0 * libm::sin(1.3 * t), 1.5 * libm::cos(0.9 * t), 0.6 + 0.3 * libm::sin(2.0 * t)],
            |t| [0.3 * libm::sin(2.1 * t), 0.2 * libm::cos(1.7 * t), 0.1 * t],
        )
    }

    /// The same flight with commands in place of rotor speeds.
    fn commanded(flight: Flight) -> Flight {
        let time_s = flight.rotor_speed.time_s.clone();
        let hover = hummingbird().hover_command();
        let command = |t: &f64| std::array::from_fn(|rotor| hover + 3.0 * libm::sin(5.0 * t + rotor as f64));
        let command = Channel { values: time_s.iter().map(command).collect(), time_s };
        Flight { command, rotor_speed: Channel::default(), ..flight }
    }

    /// The rows of an excerpt are those that the whole flight has at the same moments, with rotors measured or simulated.
    #[test]
    fn rows_of_an_excerpt_are_those_of_the_whole_flight() {
        let flights = [flight(200.0), commanded(flight(250.0))];
        let whole = problem(&flights);
        let part = excerpt(&whole).expect("450 s are more than a search needs");
        let values = whole.model.parameters.baseline();
        for (whole_flight, part_flight) in whole.estimation.iter().zip(&part.estimation) {
            let ratio = part_flight.compared_s() / whole_flight.compared_s();
            assert!((ratio - SEARCH_S / 450.0).abs() < 0.02, "{ratio}");
            let pieces_s = part_flight.layout.clock.pieces_s();
            assert!(pieces_s.len() > 5 && pieces_s.windows(2).all(|pair| pair[0].1 < pair[1].0));
            let rows = |flight: &Prepared| {
                let residual = whole.model.residual_under(flight, &values);
                let times = flight.layout.knots.iter().map(|knot| flight.layout.clock.at(*knot));
                times.zip(residual.chunks(flight.width()).map(<[f64]>::to_vec)).collect::<Vec<_>>()
            };
            let of_whole = rows(whole_flight);
            for (at_s, row) in rows(part_flight) {
                let same = of_whole.iter().find(|(whole_s, _)| (whole_s - at_s).abs() < 1e-6);
                let (_, expected) = same.expect("a knot of the whole flight");
                let apart = row.iter().zip(expected).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
                // Motors that began anew differ by what is left of their lag after half a second.
                let most = if part_flight.flight.command.is_empty() { 1e-9 } else { 0.01 };
                assert!(apart < most, "{at_s} s: {apart}, expected at most {most}");
            }
        }
    }

    /// Motors that are faster than declared ask for a negative delay, so that a delay is not beyond chance. The mass is.
    #[test]
    fn every_effect_is_tested_once_more_on_all_flights() {
        let vehicle = with_light_rotors();
        let truth = [effect("mass-error", &[("error", 0.2)]), effect("motor-lag", &[("slowness", -0.3)])];
        let set = simulated(&vehicle, &truth);
        let of_set = || crate::run::problem(&vehicle, &[], &set).expect("usable flights").0;
        let (whole, mut part) = (of_set(), of_set());
        let accepted = ["mass-error", "command-delay"].map(|name| candidate(&part, name)).to_vec();
        let before = part.fitted(&part.model.parameters.baseline(), &[]);
        part.weigh(&before, &accepted);
        let after = part.fitted(&before.values, &free_parameters(&accepted));
        let mass = accepted[0].clone();
        let found = Selection {
            accepted,
            before,
            after,
            refined: None,
            rounds: Vec::new(),
            withdrawn: Vec::new(),
            worths: BTreeMap::from([("command-delay", Vec::new())]),
            without_worth: BTreeMap::new(),
            asked: Vec::new(),
            is_stopped: false,
        };
        let (whole, tested) = on_all(whole, &part, found.clone());
        assert_eq!(tested.accepted, std::slice::from_ref(&mass), "{:?}", tested.withdrawn);
        let [withdrawn] = &tested.withdrawn[..] else { panic!("{:?}", tested.withdrawn) };
        assert_eq!((withdrawn.effect, withdrawn.at_bound), ("command-delay", false));
        let reason = "its parameters are no longer beyond chance beside those of the others";
        assert!(withdrawn.reason.starts_with(reason), "{}", withdrawn.reason);
        assert!(tested.worths.is_empty() && tested.after.free == mass.free, "{tested:?}");
        // Predictions may ask for an effect that the equations hardly show.
        let asked = vec![found.accepted[1].clone()];
        let (_, kept) = on_all(whole, &part, Selection { asked, ..found });
        assert_eq!(kept.accepted.len(), 2, "{:?}", kept.withdrawn);
    }

    #[test]
    fn flights_of_the_length_of_a_search_stay_whole() {
        assert!(excerpt(&problem(&[flight(60.0), flight(60.0), flight(60.0)])).is_none());
    }
}
