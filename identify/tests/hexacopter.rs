//! A hexacopter: one of its six rotors is weak, and that one is found.
use crate::simulated;
use identify::run::identify;
use simulated::cases::Case;

#[test]
fn the_weak_one_of_six_rotors_is_found() {
    for (seed, rotor, loss) in [(31, 5, 0.15), (32, 2, 0.08)] {
        let weak = format!("loss_{rotor}");
        let mut case = Case::null(seed, 10.0);
        case.vehicle = "dji-f550.toml";
        case.plan.truth = vec![simulated::effect("weak-rotor", &[(&weak, loss)])];
        let report = identify(&case.flights(), &mut |_| ()).expect("flights to identify on").report;
        assert_eq!(report.verdict, ["weak-rotor"], "{report}");
        let found = &report.effects["weak-rotor"].parameters;
        for (name, estimate) in found {
            let truth = if *name == weak { loss } else { 0.0 };
            assert!((estimate.value - truth).abs() < 0.01, "{name}: {report}");
        }
        assert!(found.contains_key(&*weak), "{report}");
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
