//! Roles of flights: parameters are fitted on some, effects chosen on others, and test flights decide nothing.
use crate::simulated;
use flights::{FlightSet, Role};
use identify::report::Report;
use identify::run::identify;
use simulated::cases::Case;

const DURATION_S: f64 = 8.0;

/// Flights of a heavier vehicle with drag, one for each seed and role.
fn set(flights: &[(u64, Role)]) -> FlightSet {
    let of = |(seed, role): &(u64, Role)| {
        let mut set = Case::of(&["mass-error", "rotor-drag"], 1.0, *seed, DURATION_S).flights();
        let mut flight = set.flights.swap_remove(0);
        flight.role = *role;
        (set, flight)
    };
    let (mut sets, flights): (Vec<FlightSet>, Vec<_>) = flights.iter().map(of).unzip();
    FlightSet { flights, ..sets.swap_remove(0) }
}

fn report(flights: &[(u64, Role)]) -> Report {
    identify(&set(flights), &mut |_| ()).expect("flights to identify on").report
}

/// Estimates and chances of everything that was judged, bit for bit.
fn judged(report: &Report) -> String {
    format!("{:?} {:?} {:?}", report.verdict, report.effects, report.withdrawn)
}

#[test]
fn test_flights_decide_nothing() {
    let with = |seed| report(&[(31, Role::Fit), (seed, Role::Test)]);
    let (one, other) = (with(32), with(33));
    assert_eq!(judged(&one), judged(&other));
    assert_ne!(format!("{:?}", one.held_out), format!("{:?}", other.held_out));
}

#[test]
fn effects_are_chosen_on_the_flights_that_are_there_for_it() {
    let found = report(&[(31, Role::Fit), (34, Role::Select), (32, Role::Test)]);
    let mut verdict = found.verdict.clone();
    verdict.sort_unstable();
    assert_eq!(verdict, ["mass-error", "rotor-drag"], "{found}");
    let names = [&found.fitted, &found.selected, &found.held_out]
        .map(|errors| errors.keys().map(String::as_str).collect::<Vec<_>>());
    assert_eq!(names, [["seed 31"], ["seed 34"], ["seed 32"]], "{found}");
    let of_fit = report(&[(31, Role::Fit), (32, Role::Test)]);
    assert_ne!(judged(&found), judged(&of_fit), "chosen on other data");
    assert!(found.losses.is_empty() && of_fit.losses.is_empty(), "{found}\n{of_fit}");
}

/// A trim is a flight's own: an offset of the centre of mass has to be beyond its spread.
#[test]
fn trims_that_differ_are_no_offset_of_the_centre_of_mass() {
    let offsets = [0.004, -0.004, 0.003];
    let mut flights = Vec::new();
    let mut vehicle = None;
    for ((seed, offset_m), role) in (41..).zip(offsets).zip([Role::Fit, Role::Fit, Role::Test]) {
        let mut case = Case::null(seed, DURATION_S);
        case.plan.truth.push(simulated::effect("com-offset", &[("x", offset_m)]));
        let mut set = case.flights();
        let mut flight = set.flights.swap_remove(0);
        flight.role = role;
        flights.push(flight);
        vehicle.get_or_insert(set.vehicle);
    }
    let set = FlightSet {
        vehicle: vehicle.expect("a vehicle"),
        flights,
        next_flight: Default::default(),
        files: Default::default(),
    };
    let found = identify(&set, &mut |_| ()).expect("flights to identify on").report;
    let offset = found.effects.get("com-offset");
    let x = offset.and_then(|effect| effect.parameters.get("x"));
    println!("{:?} {x:?}", found.verdict);
    assert!(x.is_none_or(|x| x.low <= 0.0 && 0.0 <= x.high), "{found}");
    assert_eq!(found.trims.len(), 3, "{found}");
}
