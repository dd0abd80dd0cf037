//! Clocks of attitude and gyroscope against each other, whatever noise the attitude has, and of rotor speeds against the gyroscope.
use crate::simulated;
use crate::skipped::{cases, first};
use flights::Channel;
use identify::run::identify;
use rayon::prelude::*;
use simulated::cases::Case;

const DURATION_S: f64 = 8.0;
/// 0.2° of white noise, in multiples of the milliradian of `simulated`.
const NOISE: f64 = 3.5;
const SEEDS: u64 = 10;

/// The attitude's offset in both flights of a case whose pose is late by `late_s`: value, lower and upper end of its
/// interval, and the part that was removed.
fn offsets(seed: u64, late_s: f64) -> Vec<[f64; 4]> {
    let mut case = Case::null(seed, DURATION_S).with_noise(NOISE);
    case.plan.sensors.pose_ticks = 10;
    case.plan.sensors.pose_delay_s = late_s;
    let report = identify(&case.flights(), &mut |_| ()).expect("flights to identify on").report;
    let of_flight = report.time_offsets_s.values().filter_map(|offsets| offsets["attitude"]);
    of_flight.map(|offset| [offset.value, offset.low, offset.high, offset.taken_off]).collect()
}

#[test]
fn intervals_hold_the_truth_and_flights_that_were_measured_right_are_not_shifted() {
    for late_s in cases("delays", [0.0, 0.003, 0.0124], |late_s| *late_s > 0.01) {
        let found: Vec<[f64; 4]> =
            (0..SEEDS).into_par_iter().flat_map_iter(|seed| offsets(9000 + seed, late_s)).collect();
        assert_eq!(found.len(), 2 * SEEDS as usize);
        let held = found.iter().filter(|[_, low, high, _]| (*low..=*high).contains(&late_s)).count();
        let furthest = found.iter().map(|found| (found[0] - late_s).abs()).fold(0.0, f64::max);
        println!("late by {late_s} s: {held} of {} hold, furthest {furthest:.5} s", found.len());
        assert!(held as f64 >= 0.9 * found.len() as f64, "late by {late_s}: {held} of {}", found.len());
        assert!(found.iter().all(|found| found[3] == 0.0), "late by {late_s}: something was taken off");
    }
}

/// The rotor speeds' offsets in both flights of a case without commands, whose stamps are late by `late_s`: value, lower and upper end of
/// the interval, and the part that was removed; and the verdict.
fn rotor_offsets(seed: u64, names: &[&'static str], late_s: [f64; 2]) -> (Vec<[f64; 4]>, Vec<&'static str>) {
    let mut case = Case::of(names, 1.0, seed, DURATION_S);
    case.plan.sensors.pose_ticks = 10;
    case.plan.sensors.has_rotor_speeds = true;
    let mut set = case.flights();
    for (flight, late_s) in set.flights.iter_mut().zip(late_s) {
        flight.command = Channel::default();
        flight.rotor_speed.time_s.iter_mut().for_each(|time_s| *time_s += late_s);
    }
    let report = identify(&set, &mut |_| ()).expect("flights to identify on").report;
    let of = |at: usize| report.time_offsets_s[&set.flights[at].name]["rotor_speed"].expect("an offset");
    let found = (0..2).map(of).map(|found| [found.value, found.low, found.high, found.taken_off]).collect();
    (found, report.verdict)
}

#[test]
fn rotor_speeds_that_are_late_are_found_whatever_inertia_is_declared_and_no_effect_is_named_for_them() {
    let flown: Vec<(u64, &[&'static str], [f64; 2])> = first(2, "seeds", 0..4)
        .into_iter()
        .flat_map(|seed| {
            let of = |names, late_s| (9100 + seed, names, late_s);
            [
                of(&[][..], [-0.0321, 0.0045]),
                of(&["inertia-error"][..], [0.0123, -0.0051]),
                of(&[][..], [0.0; 2]),
            ]
        })
        .collect();
    let found: Vec<_> =
        flown.par_iter().map(|(seed, names, late_s)| rotor_offsets(*seed, names, *late_s)).collect();
    for ((seed, names, late_s), (offsets, verdict)) in flown.iter().zip(&found) {
        println!("{seed} {names:?}: true {late_s:?}, found {offsets:?}, named {verdict:?}");
        for ([value, _, _, taken_off], true_s) in offsets.iter().zip(late_s) {
            assert!((value - true_s).abs() < 0.002, "{seed} {names:?}: {value} for {true_s}");
            let wanted_s = if *true_s == 0.0 { 0.0 } else { *value };
            assert!(
                (taken_off - wanted_s).abs() < 1e-9,
                "{seed} {names:?}: {taken_off} of {value} taken off"
            );
        }
        assert_eq!(verdict, names, "seed {seed}");
    }
}
