//! Evidence of simulated flights: a lively flight separates what calm flights leave open, and really flown it does.
mod simulated;

use flights::{Flight, FlightSet, Role};
use identify::run::identify;
use identify::{OpenQuestions, Question};
use simulated::cases::{Case, scaled};
use simulated::{Plan, Sensors, fly};

const SEED: u64 = 71;

/// A plan of `duration_s` with rotor drag, about a hover if it is calm.
fn plan(seed: u64, is_calm: bool, duration_s: f64) -> Plan {
    let sensors = Sensors { pose_ticks: 10, has_rotor_speeds: true, ..Sensors::default() };
    let truth = vec![scaled("rotor-drag", 1.0)];
    Plan { sensors, is_calm, duration_s, ..Plan::of(truth, seed) }
}

fn flown(plan: &Plan, role: Role) -> Flight {
    fly(&Case::null(0, 1.0).declared().0, plan, role)
}

/// A flight along the course of a seed under each hypothesis, by sensors without noise.
fn under_each(questions: &OpenQuestions, seed: u64, is_calm: bool) -> Vec<Flight> {
    let of = |at: usize| {
        let mut plan = plan(seed, is_calm, 8.0);
        plan.truth = questions.effects(at);
        plan.sensors.noise = 0.0;
        flown(&plan, Role::Fit)
    };
    (0..questions.hypotheses()).map(of).collect()
}

/// The separation of rotor drag from another effect: the least of all.
fn separation(questions: &OpenQuestions, separations: &[f64]) -> f64 {
    let is_of_drag = |question: &Question| matches!(question, Question::Names { effect, rival } if [*effect, *rival].contains(&"rotor-drag"));
    let of_drag = questions.questions().zip(separations).filter(|(question, _)| is_of_drag(question));
    of_drag.map(|(_, separation)| *separation).fold(f64::INFINITY, f64::min)
}

#[test]
fn a_lively_flight_is_expected_to_separate_what_calm_ones_cannot_and_does() {
    let calm = |seed, role| flown(&plan(seed, true, 16.0), role);
    let mut set = FlightSet {
        vehicle: simulated::vehicle_file("hummingbird.toml"),
        flights: vec![calm(SEED, Role::Fit), calm(SEED + 1, Role::Test)],
        next_flight: Default::default(),
        files: Default::default(),
    };
    let outcome = identify(&set, &mut |_| ()).expect("flights to identify on");
    let questions = outcome.questions.expect("rivals of rotor drag").expecting(16.0);

    let evidence =
        |seed, is_calm| questions.evidence(&under_each(&questions, seed, is_calm)).expect("flights");
    let (one, other, hover) = (evidence(1, false), evidence(2, false), evidence(3, true));
    let of = |evidence: &[&identify::Evidence]| separation(&questions, &questions.separations(evidence));
    let lively = of(&[&one]);
    assert!(lively > 3.0 && lively > 3.0 * of(&[&hover]), "lively {lively}, hover {}", of(&[&hover]));
    assert!(of(&[&one, &other]) > 1.15 * lively, "two flights say more than one: {}", of(&[&one, &other]));
    assert!(of(&[]).abs() < 1e-9, "no flight says nothing");
    let fitted = questions.fitted_separations(&under_each(&questions, 1, false)).expect("flights");
    let fitted = separation(&questions, &fitted);
    assert!((fitted / lively - 1.0).abs() < 0.3, "by equations {lively}, by a fit {fitted}");

    set.flights.push(flown(&plan(1, false, 8.0), Role::Fit));
    let outcome = identify(&set, &mut |_| ()).expect("flights to identify on");
    assert_eq!(outcome.report.verdict, ["rotor-drag"], "{}", outcome.report);
    assert!(outcome.report.effects["rotor-drag"].confused_with.is_empty(), "{}", outcome.report);
}
