//! Batteries whose voltage was logged: it drives the motors, and its power is the only thing to find.
#![allow(non_snake_case, reason = "V is the volt")]
use crate::simulated;
use flights::{Channel, Flight, FlightSet, Role};
use identify::report::Report;
use identify::run::{identify, problem};
use identify::vehicle_file;
use plant::Airframe;
use plant::effects::Effect;
use simulated::cases::Case;
use simulated::effect;
use vehicles::Vehicle;

const DURATION_S: f64 = 12.0;
const ROLES: [Role; 3] = [Role::Fit, Role::Fit, Role::Test];
/// Parts of the charge that are gone when the flights start.
const DISCHARGED: [f64; 3] = [0.0, 0.8, 0.4];

/// The battery of flight number `at`: three cells from 12.6 V to 10.5 V, which drive the motors by this power of their voltage.
fn battery(at: usize, exponent: f64) -> Effect {
    let parameters = [
        ("internal_resistance", 0.06),
        ("discharge_drop", 2.1),
        ("discharged", DISCHARGED[at]),
        ("exponent", exponent),
    ];
    effect("battery-sag", &parameters)
}

/// Three flights that start with different voltages.
fn flights(seed: u64, exponent: f64) -> FlightSet {
    let of = |(at, role): (usize, Role)| {
        let mut case = Case::null(seed + at as u64, DURATION_S);
        case.plan.sensors.pose_ticks = 10;
        case.plan.sensors.imu_ticks = 2;
        case.plan.sensors.has_voltage = true;
        case.plan.truth = vec![battery(at, exponent)];
        let mut set = case.flights();
        let mut flight = set.flights.swap_remove(0);
        flight.role = role;
        (set, flight)
    };
    let (mut sets, flights): (Vec<FlightSet>, Vec<Flight>) = ROLES.into_iter().enumerate().map(of).unzip();
    FlightSet { flights, ..sets.swap_remove(0) }
}

fn report(set: &FlightSet) -> Report {
    identify(set, &mut |_| ()).expect("flights to identify on").report
}

/// Names of the parameters of the battery that flights of this set determine.
fn fitted(set: &FlightSet) -> Vec<&'static str> {
    let vehicle = Vehicle::load(&set.vehicle).expect("a vehicle file");
    let (problem, _) = problem(&vehicle, &[], set).expect("flights to identify on");
    let all = &problem.model.parameters.all;
    all.iter().filter(|entry| entry.kind.name == "battery-sag").map(|entry| entry.spec().name).collect()
}

/// Neither a scale of the thrust nor slow motors are named in place of a voltage that falls, and the new vehicle file flies.
#[test]
fn the_power_of_a_logged_voltage_is_found_where_flights_start_with_different_voltages() {
    let set = flights(4_700, 1.0);
    let outcome = identify(&set, &mut |_| ()).expect("flights to identify on");
    let report = &outcome.report;
    assert_eq!(report.verdict, ["battery-sag"], "{report}");
    let parameters = &report.effects["battery-sag"].parameters;
    assert_eq!(parameters.keys().copied().collect::<Vec<_>>(), ["exponent"], "{report}");
    let exponent = parameters["exponent"];
    assert!(exponent.low <= 1.0 && 1.0 <= exponent.high, "{report}");
    assert!((exponent.value - 1.0).abs() < 0.02, "{report}");

    let text =
        vehicle_file::text(&set.files, &set.vehicle, &outcome.effects, report).expect("a vehicle file");
    let vehicle = Vehicle::parse(&text, "identified.toml").expect("a vehicle");
    let airframe = Airframe::from_files(vehicle, &[]).expect("an airframe");
    let battery =
        airframe.effects().iter().find(|effect| effect.kind.name == "battery-sag").expect("a battery");
    let law = battery.kind.voltage_law.expect("a law");
    assert!((battery.values[law.exponent] - exponent.value).abs() < 1e-3, "{text}");
    assert!((battery.values[law.nominal] - 12.6).abs() < 1e-9, "{text}");
}

/// A drive that holds the speeds of its rotors needs no voltage, whatever it is.
#[test]
fn no_battery_is_named_where_the_speeds_do_not_follow_its_voltage() {
    let report = report(&flights(4_710, 0.0));
    assert!(!report.verdict.contains(&"battery-sag"), "{report}");
}

/// The battery of flights without a voltage is found by its charge, as before there were voltages; a channel that never changes is none.
#[test]
fn a_voltage_that_was_not_logged_changes_nothing() {
    let mut without = flights(4_720, 1.0);
    assert_eq!(fitted(&without), ["exponent"]);
    let mut dead = flights(4_720, 1.0);
    for flight in &mut without.flights {
        flight.battery_voltage = Channel::default();
    }
    for flight in &mut dead.flights {
        flight.battery_voltage.values.iter_mut().for_each(|value| *value = [11.1]);
    }
    let of_charge = ["internal_resistance", "discharge_drop", "discharged"];
    assert_eq!(fitted(&without), of_charge);
    assert_eq!(fitted(&dead), of_charge);
    let mut some = flights(4_720, 1.0);
    some.flights[1].battery_voltage = Channel::default();
    assert_eq!(fitted(&some), [&of_charge[..], &["exponent"]].concat(), "one flight has no voltage");
    let [without, dead] = [&without, &dead].map(|set| serde_json::to_string(&report(set)).expect("a report"));
    assert!(without == dead, "the reports differ");
}
