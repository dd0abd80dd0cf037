//! Another torque coefficient than the declared one: the vehicle yaws faster by the same commands.
use crate::simulated;
use crate::skipped::first;
use rayon::prelude::*;
use simulated::cases::{Case, Judgement};

const DURATION_S: f64 = 8.0;

/// A moment of inertia about z explains nearly the same. It has more parameters, and stands beside the effect as its rival at most.
#[test]
fn a_greater_torque_coefficient_is_named_and_nothing_else() {
    let judged = |seed: u64| -> Judgement {
        // Half more than declared.
        let mut case = Case::of(&["torque-scale"], 2.5, seed, DURATION_S);
        case.plan.sensors.pose_ticks = 10;
        case.judged()
    };
    let seeds = first(1, "seeds", 2_600..2_604_u64);
    let judgements: Vec<Judgement> = seeds.into_par_iter().map(judged).collect();
    for judgement in judgements {
        let told = format!("{:?}, true gains {:?}", judgement.named, judgement.true_gains);
        assert!(judgement.true_gains[0].1 > 0.01, "it should matter: {told}");
        assert!(judgement.missed().is_empty() && judgement.invented().is_empty(), "named {told}");
        let error = judgement.report.effects["torque-scale"].parameters["error"];
        assert!((0.4..0.6).contains(&error.value), "{error:?}");
    }
}
