//! Torques of the air in free flight: torque by speed and rate damping, alone and beside an inertia error.
use crate::simulated;
use crate::skipped::first;
use rayon::prelude::*;
use simulated::cases::{Case, Judgement};

const DURATION_S: f64 = 8.0;

/// Cases of several seeds, with slower pose samples than the default.
fn judged(names: &[&'static str], seeds: std::ops::Range<u64>) -> Vec<Judgement> {
    let one = |seed| {
        let mut case = Case::of(names, 1.0, seed, DURATION_S);
        case.plan.sensors.pose_ticks = 10;
        case.plan.sensors.has_rotor_speeds = true;
        case.judged()
    };
    let what = format!("seeds of {}", names.join(" and "));
    first(1, &what, seeds).into_par_iter().map(one).collect()
}

fn require_named_alone(names: &[&'static str], seeds: std::ops::Range<u64>) {
    for judgement in judged(names, seeds) {
        let told = format!("{:?}, true gains {:?}", judgement.named, judgement.true_gains);
        assert!(judgement.true_gains.iter().all(|(_, gain)| *gain > 0.01), "each should matter: {told}");
        assert!(judgement.missed().is_empty() && judgement.invented().is_empty(), "{names:?}: named {told}");
    }
}

#[test]
fn a_torque_by_speed_is_named_and_nothing_else() {
    require_named_alone(&["velocity-torque"], 2_100..2_104);
}

#[test]
fn rate_damping_is_named_and_nothing_else() {
    require_named_alone(&["rate-damping"], 2_200..2_204);
}

/// Without rate damping among the candidates the inertia would have to stand in for it.
#[test]
fn damping_is_told_from_inertia() {
    require_named_alone(&["rate-damping", "inertia-error"], 2_400..2_402);
    require_named_alone(&["inertia-error"], 2_450..2_452);
}
