//! A hexacopter and an octocopter: one of their rotors is weak, and that one is found.
use crate::simulated;
use crate::skipped::first;
use identify::report::Report;
use identify::run::identify;
use simulated::cases::Case;

/// The report on flights of 10 s in which the rotor `weak` lacks a part of its thrust.
fn report_of(vehicle: &'static str, seed: u64, weak: &str, loss: f64) -> Report {
    let mut case = Case::null(seed, 10.0);
    case.vehicle = vehicle;
    case.plan.truth = vec![simulated::effect("weak-rotor", &[(weak, loss)])];
    identify(&case.flights(), &mut |_| ()).expect("flights to identify on").report
}

#[test]
fn the_weak_one_of_six_rotors_is_found() {
    for (seed, rotor, loss) in [(31, 5, 0.15), (32, 2, 0.08)] {
        let weak = format!("loss_{rotor}");
        let report = report_of("dji-f550.toml", seed, &weak, loss);
        assert_eq!(report.verdict, ["weak-rotor"], "{report}");
        let found = &report.effects["weak-rotor"].parameters;
        for (name, estimate) in found {
            let truth = if *name == weak { loss } else { 0.0 };
            assert!((estimate.value - truth).abs() < 0.01, "{name}: {report}");
        }
        assert!(found.contains_key(&*weak), "{report}");
    }
}

/// The last rotor, the first one, and one between: its loss lies in its interval, and no other rotor is named. Of intervals of 95 %
/// one in twenty misses the truth; the seeds are fixed.
#[test]
fn the_weak_one_of_eight_rotors_is_found_and_no_other() {
    for (seed, rotor, loss) in first(1, "rotors", [(34, 8, 0.12), (35, 1, 0.15), (36, 4, 0.08)]) {
        let weak = format!("loss_{rotor}");
        let report = report_of("tarot-t18.toml", seed, &weak, loss);
        assert_eq!(report.verdict, ["weak-rotor"], "{report}");
        let found = &report.effects["weak-rotor"].parameters;
        assert_eq!(found.keys().copied().collect::<Vec<_>>(), [weak.as_str()], "{report}");
        let estimate = &found[weak.as_str()];
        assert!((estimate.low..=estimate.high).contains(&loss), "{report}");
        // An interval that held everything would hold the truth, too.
        assert!(estimate.high - estimate.low < 0.02, "{report}");
    }
}

#[test]
fn a_hexacopter_without_faults_lacks_nothing() {
    let mut case = Case::null(33, 10.0);
    case.vehicle = "dji-f550.toml";
    case.plan.sensors.has_rotor_speeds = true;
    let report = identify(&case.flights(), &mut |_| ()).expect("flights to identify on").report;
    assert!(report.verdict.is_empty() && report.faults.is_empty(), "{report}");
}
