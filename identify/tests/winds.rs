//! One wind for each flight: named where the flights have several winds, and only there.
use crate::simulated;
use flights::{Flight, FlightSet, Role};
use identify::report::Report;
use identify::run::identify;
use plant::effects::Effect;
use simulated::cases::Case;
use simulated::effect;

const DURATION_S: f64 = 10.0;
const ROLES: [Role; 4] = [Role::Fit, Role::Fit, Role::Fit, Role::Test];

/// The report on three fit flights and one for test, each with its own truth beyond the declared `vehicle`.
fn report(vehicle: &'static str, seed: u64, truths: [Vec<Effect>; 4]) -> Report {
    let of = |((seed, role), truth): ((u64, Role), Vec<Effect>)| {
        let mut case = Case::null(seed, DURATION_S);
        case.vehicle = vehicle;
        case.plan.sensors.pose_ticks = 10;
        case.plan.truth = truth;
        let mut set = case.flights();
        let mut flight = set.flights.swap_remove(0);
        flight.role = role;
        (set, flight)
    };
    let (mut sets, flights): (Vec<FlightSet>, Vec<Flight>) = (seed..).zip(ROLES).zip(truths).map(of).unzip();
    let set = FlightSet { flights, ..sets.swap_remove(0) };
    identify(&set, &mut |_| ()).expect("flights to identify on").report
}

fn wind([x, y]: [f64; 2]) -> Effect {
    effect("wind", &[("x", x), ("y", y)])
}

#[test]
fn several_winds_are_named_beside_the_drags_by_which_they_act() {
    let winds = [[0.0, 0.0], [4.0, 0.0], [-6.0, 3.0], [2.0, 1.0]];
    let drags = [("rotor-drag", "coefficient", 8e-5), ("parasitic-drag", "coefficient_xy", 0.01)];
    let truth = |of: [f64; 2]| -> Vec<Effect> {
        let drags = drags.iter().map(|(name, parameter, value)| effect(name, &[(*parameter, *value)]));
        drags.chain([wind(of)]).collect()
    };
    let found = report("hummingbird.toml", 4_400, winds.map(truth));
    assert!(found.verdict.contains(&"flight-wind") && !found.verdict.contains(&"wind"), "{found}");
    assert_eq!(found.winds.len(), 3, "{found}");
    for (estimate, [x, y]) in found.winds.iter().zip(winds) {
        let is_near = (estimate.x.value - x).abs() < 1.5 && (estimate.y.value - y).abs() < 1.5;
        assert!(is_near, "{}: expected {x}, {y}\n{found}", estimate.flight);
    }
    for (name, parameter, truth) in drags {
        assert!(found.verdict.contains(&name), "{name}\n{found}");
        let estimate = found.effects[name].parameters[parameter];
        // Intervals leave the truth out in one case of twenty.
        let slack = 0.1 * truth;
        assert!(estimate.low - slack < truth && truth < estimate.high + slack, "{name}\n{found}");
    }
}

#[test]
fn one_wind_of_all_flights_is_one() {
    let found = report("hummingbird-drag.toml", 4_410, [(); 4].map(|()| vec![wind([4.0, -2.0])]));
    assert!(found.verdict.contains(&"wind") && !found.verdict.contains(&"flight-wind"), "{found}");
    assert!(found.winds.is_empty(), "{found}");
}

/// Trims of forces and torques that differ from flight to flight.
#[test]
fn trims_are_no_winds() {
    let trims = [(0.004, 0.02), (-0.004, -0.02), (0.003, 0.01), (-0.002, -0.01)];
    let truth =
        |(x, error)| vec![effect("com-offset", &[("x", x)]), effect("thrust-scale", &[("error", error)])];
    let found = report("hummingbird-drag.toml", 4_420, trims.map(truth));
    assert!(!found.verdict.contains(&"flight-wind"), "{found}");
    assert!(found.winds.is_empty(), "{found}");
}
