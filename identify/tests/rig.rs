//! Vehicles that a bearing holds at a point: flights of an integrator of their own, with hidden truths. The whole table is made by
//! `cargo run --release -p hummingbus-identify --example rigs`, see docs/validation.md.
use crate::simulated;
use crate::skipped::{cases, first, is_left};
use flights::{FlightSet, Role};
use identify::run::identify;
use rayon::prelude::*;
use simulated::bearing::{Bearing, Friction};
use simulated::rigs::{DURATION_S, Judgement, Rig, STICKING, TRUTHS, errors_of_ratios, judged, report};
use simulated::{Plan, Sensors};
use vehicles::Vehicle;

/// Every truth once, every other with a position and an accelerometer in its log, which then are left out.
#[test]
fn every_truth_on_a_rig_is_named_or_said_to_be_confounded() {
    let one = |number: usize| {
        let plain = Bearing::plain(10_000 + number as u64, DURATION_S);
        let (name, truth, change) = TRUTHS[number];
        let found = report(&change(if number.is_multiple_of(2) { plain.tracked() } else { plain }));
        let judgement = judged(truth, &found);
        println!("{name}: {judgement:?} {:?}", found.verdict);
        assert!(
            matches!(judgement, Judgement::Right | Judgement::Confounded),
            "{name}: {judgement:?} {found}"
        );
        assert!(found.faults.is_empty(), "{name}: {found}");
        let is_noted =
            found.flights.iter().all(|flight| flight.notes.iter().any(|note| note.contains("rig")));
        assert_eq!(is_noted, number.is_multiple_of(2), "{name}: {found}");
        let equations = found.flights.iter().flat_map(|flight| &flight.equations);
        assert!(
            equations.into_iter().all(|name| !name.contains("specific") && *name != "acceleration"),
            "{found}"
        );
    };
    let numbers = (0..TRUTHS.len()).filter(|number| TRUTHS[*number].0 != STICKING);
    // Friction, inertia, and two at once; with and without a position. Other tests have friction about each axis and thrust.
    cases("truths", numbers, |number| [5, 7, 10].contains(number)).into_par_iter().for_each(one);
}

/// A bearing that sticks for much of the flight: the model of friction creeps there. What that leaves may be named, but as no thrust,
/// no inertia and no weight below the bearing.
#[test]
fn a_bearing_that_sticks_is_no_thrust_scale_and_no_inertia() {
    if is_left("`dry_friction_about_each_axis_is_no_thrust_scale_and_no_inertia` has dry friction") {
        return;
    }
    let (number, (_, _, change)) =
        TRUTHS.iter().enumerate().find(|(_, truth)| truth.0 == STICKING).expect("the truth of this name");
    let found = report(&change(Bearing::plain(10_000 + number as u64, DURATION_S).tracked()));
    assert!(found.verdict.contains(&"gimbal-friction"), "{found}");
    let wrong = ["thrust-scale", "inertia-error", "rig-pendulum", "bearing-friction"];
    assert!(found.verdict.iter().all(|name| !wrong.contains(name)), "{found}");
}

/// Dry friction about each axis is no weaker thrust and no larger inertia.
#[test]
fn dry_friction_about_each_axis_is_no_thrust_scale_and_no_inertia() {
    for seed in first(1, "seeds", 1..=2) {
        let friction = Friction::Gimbal([0.004, 0.006, 0.003], [0.0; 3]);
        let found = report(&Bearing { friction, ..Bearing::plain(seed, DURATION_S) });
        assert_eq!(found.verdict, ["gimbal-friction"], "seed {seed}: {found}");
        let parameters = &found.effects["gimbal-friction"].parameters;
        for (name, truth) in [("coulomb_x", 0.004), ("coulomb_y", 0.006), ("coulomb_z", 0.003)] {
            let found = parameters[name];
            assert!((found.value / truth - 1.0).abs() < 0.15, "seed {seed}, {name}: {found:?}");
        }
        let ratios = found.ratios.expect("rotation alone");
        assert!(ratios.of_axes.iter().all(|ratio| (ratio.value - 1.0).abs() < 0.01), "{ratios}");
    }
}

/// On a rig a weaker thrust and a larger inertia are alike: the report says which ratio is determined, and a free flight in the
/// same set tells the two apart.
#[test]
fn a_free_flight_separates_thrust_from_inertia() {
    let bearing = Bearing { thrust: 0.95, inertia: [1.0; 3], ..Bearing::plain(31, DURATION_S) };
    let held = bearing.flights("hummingbird.toml");
    let found = identify(&held, &mut |_| ()).expect("flights to identify on").report;
    let ratios = found.ratios.as_ref().expect("rotation alone");
    for ratio in &ratios.of_axes[..2] {
        assert!((ratio.value - 0.95).abs() < 0.005 && ratio.low < ratio.value, "{ratios}");
    }
    let text = found.to_string();
    assert!(text.contains("ratios only") && text.contains("known weight at a known arm"), "{text}");
    let vehicle = Vehicle::load(&simulated::vehicle_file("hummingbird.toml")).expect("a vehicle file");
    let truth = vec![simulated::effect("thrust-scale", &[("error", -0.05)])];
    let free = |seed, role| {
        simulated::fly(&vehicle, &Plan { duration_s: 12.0, ..Plan::of(truth.clone(), seed) }, role)
    };
    let mut flights = held.flights.clone();
    flights.extend([free(41, Role::Fit), free(42, Role::Test)]);
    let found = identify(&FlightSet { flights, ..held }, &mut |_| ()).expect("flights to identify on").report;
    assert_eq!(found.verdict, ["thrust-scale"], "{found}");
    assert!(found.effects["thrust-scale"].confused_with.is_empty() && found.ratios.is_none(), "{found}");
}

/// Noise of measured rotor speeds makes no ratio smaller: least squares is 0.3 to 0.5 % too low about x and y here.
#[test]
fn noisy_rotor_speeds_make_no_ratio_smaller() {
    let of_seed = |seed: u64| {
        let sensors = Sensors { noise: 10.0, has_rotor_speeds: true, ..Sensors::default() };
        let bearing = Bearing { sensors, ..Bearing::plain(7000 + seed, DURATION_S) };
        errors_of_ratios(&Rig { bearing, is_without_gyroscope: false }, &[])
    };
    let found: Vec<_> = (0..12).into_par_iter().map(of_seed).collect();
    for axis in 0..2 {
        let mean = found.iter().map(|axes| axes[axis].0).sum::<f64>() / found.len() as f64;
        assert!(mean.abs() < 0.002, "axis {axis}: {mean} in {found:?}");
    }
}

/// Friction of the rig does not act in the free flight of the same set.
#[test]
fn effects_of_a_rig_act_on_the_rig_alone() {
    if is_left("`a_free_flight_separates_thrust_from_inertia` has a free flight beside a rig") {
        return;
    }
    let friction = Friction::Gimbal([0.004, 0.006, 0.003], [0.0; 3]);
    let held = Bearing { friction, ..Bearing::plain(33, DURATION_S) }.tracked().flights("hummingbird.toml");
    let vehicle = Vehicle::load(&simulated::vehicle_file("hummingbird.toml")).expect("a vehicle file");
    let free =
        |seed, role| simulated::fly(&vehicle, &Plan { duration_s: 12.0, ..Plan::of(Vec::new(), seed) }, role);
    let mut flights = held.flights.clone();
    flights.extend([free(43, Role::Fit), free(44, Role::Test)]);
    let found = identify(&FlightSet { flights, ..held }, &mut |_| ()).expect("flights to identify on").report;
    assert_eq!(found.verdict, ["gimbal-friction"], "{found}");
    let found = found.effects["gimbal-friction"].parameters["coulomb_y"];
    assert!((found.value / 0.006 - 1.0).abs() < 0.15, "{found:?}");
}
