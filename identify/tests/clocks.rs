//! Clocks of attitude and gyroscope against each other, whatever noise the attitude has.
mod simulated;

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
    for late_s in [0.0, 0.003, 0.0124] {
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
