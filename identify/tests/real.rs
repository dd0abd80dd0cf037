//! Real flights, where they are: `HUMMINGBUS_DATA` names their folder. docs/validation-real.md has all of them.

use crate::skipped;
use flights::{Flight, FlightSet, Role};
use identify::Fault;
use identify::report::Report;
use identify::run::{faults, identify};
use std::path::Path;

/// The flights of a flights file; `None`, with a word about it, where there is no data.
fn flights(name: &str) -> Option<FlightSet> {
    skipped::variable_or_skip("HUMMINGBUS_DATA", "the folder of measured flights")?;
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("../flights/{name}.toml"));
    Some(FlightSet::load(&path).expect("the flights that HUMMINGBUS_DATA promises"))
}

fn report(set: &FlightSet) -> Report {
    identify(set, &mut |_| ()).expect("flights to identify on").report
}

/// A figure eight predicts a Lissajous figure: after 0.1 s every channel errs by less than a third of before.
#[test]
fn a_crazyflie_under_motion_capture_is_predicted_better() {
    if skipped::is_left("`weights_are_seen_where_they_were_put` has flights of a Crazyflie") {
        return;
    }
    let Some(mut set) = flights("nanobench") else { return };
    set.flights.retain(|flight| ["figure eight 1", "lissajous 1"].contains(&flight.name.as_str()));
    let report = report(&set);
    assert!(report.verdict.contains(&"blade-flapping") || report.verdict.contains(&"rotor-drag"), "{report}");
    for (channel, change) in &report.held_out["lissajous 1"]["0.1"] {
        assert!(change.after < 0.33 * change.before, "{channel}: {change:?}\n{report}");
    }
}

/// A weight near a motor moves the centre of mass towards it, seen in the commands alone. Unweighted, nothing moves.
#[test]
fn weights_are_seen_where_they_were_put() {
    for (name, forward, left) in [
        ("crazypad-w1-m3-m4-e8", 0.0, 1.0),
        ("crazypad-w1-m3-e9", -1.0, 1.0),
        ("crazypad-w3-m3-e9", -1.0, 1.0),
    ] {
        let Some(set) = flights(name) else { return };
        let report = report(&set);
        assert!(report.verdict.contains(&"com-offset"), "{name}: {report}");
        let offset_mm = |axis: &str| 1e3 * report.effects["com-offset"].parameters[axis].value;
        let (x, y) = (offset_mm("x"), offset_mm("y"));
        // In front or behind by a millimetre or more where a weight asks for it, within half of one where not.
        let is_there =
            |found: f64, wanted: f64| if wanted == 0.0 { found.abs() < 0.5 } else { found * wanted > 0.5 };
        assert!(is_there(x, forward) && is_there(y, left), "{name}: x {x:.2} mm, y {y:.2} mm");
    }
    let Some(set) = flights("crazypad-normal-e8") else { return };
    assert!(!report(&set).verdict.contains(&"com-offset"));
}

/// Every other order of a Crazyflie's motors is found, though the commands explain a tenth of the angular accelerations.
#[test]
fn every_other_order_of_real_motors_is_found() {
    let Some(set) = flights("nanobench") else { return };
    assert_eq!(faults(&set).unwrap_or_else(|error| panic!("{error}")), []);
    let fits = set.flights.iter().filter(|flight| flight.role == Role::Fit).count();
    let codes = (0..256_usize).map(|code| [code / 64, code / 16 % 4, code / 4 % 4, code % 4]);
    let others = codes.filter(|order| (0..4).all(|rotor| order.contains(&rotor))).skip(1);
    let others = skipped::cases("orders", others.enumerate(), |(number, _)| number % 10 == 0);
    let wrong: Vec<String> = others
        .into_iter()
        .filter_map(|(_, order)| {
            let mut set = set.clone();
            for commands in set.flights.iter_mut().flat_map(|flight| &mut flight.command.values) {
                let logged = *commands;
                order.iter().enumerate().for_each(|(rotor, at)| commands[rotor] = logged[*at]);
            }
            let put_right: [usize; 4] =
                std::array::from_fn(|rotor| order.iter().position(|at| *at == rotor).expect("an order"));
            let put_right = put_right.map(|at| (at + 1).to_string()).join(", ");
            let wanted = format!("the order {put_right} of the logged ones explains");
            let told = match faults(&set) {
                Ok(found) => format!("not refused: {found:#?}"),
                Err(error) => error.to_string(),
            };
            (told.matches(&wanted).count() != fits).then(|| format!("{order:?}: {told}"))
        })
        .collect();
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn real_flights_have_their_motors_in_order() {
    // Quick tests of faults take nanobench whole.
    let all = ["nanobench", "arpl-crazyflie", "nanodrone", "neurobem"];
    for name in skipped::cases("sets of flights", all, |name| ["arpl-crazyflie", "neurobem"].contains(name)) {
        let Some(set) = flights(name) else { return };
        // All together, and each flight by itself: in quick tests every fifth.
        let of_role = |flight: &Flight, role| Flight { role, ..flight.clone() };
        let numbered = set.flights.iter().enumerate();
        let alone = skipped::cases(&format!("flights of {name}"), numbered, |(number, _)| number % 5 == 0);
        let alone = alone
            .into_iter()
            .map(|(_, flight)| [Role::Fit, Role::Test].map(|role| of_role(flight, role)).to_vec());
        for flights in std::iter::once(set.flights.clone()).chain(alone) {
            let found = faults(&FlightSet { flights, ..set.clone() });
            let found = found.unwrap_or_else(|error| panic!("{name}: {error}"));
            let is_of_order = |fault: &Fault| ["swapped", "reversed-spins"].contains(&fault.kind);
            assert!(!found.iter().any(is_of_order), "{name}: {found:#?}");
        }
    }
}
