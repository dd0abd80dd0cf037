//! Real flights, where they are: `HUMMINGBUS_DATA` names their folder.

use flights::FlightSet;
use identify::report::Report;
use identify::run::identify;
use std::io::Write as _;
use std::path::Path;

/// What identification makes of a flights file; `None`, with a word about it, where there is no data.
fn report(name: &str) -> Option<Report> {
    if std::env::var_os("HUMMINGBUS_DATA").is_none() {
        // Not `eprintln!`, which the test runner hides.
        let notice = "skipped: HUMMINGBUS_DATA, the folder of measured flights, is not set";
        let _ = writeln!(std::io::stderr(), "{notice}");
        return None;
    }
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("../flights/{name}.toml"));
    let set = FlightSet::load(&path).expect("the flights that HUMMINGBUS_DATA promises");
    Some(identify(&set, &mut |_| ()).expect("flights to identify on").report)
}

/// Of two flights that nothing was fitted on, every channel is predicted better over 0.1 s by a half, and the position
/// over 0.5 s. Attitudes over 0.5 s and more are no measure: without its controller the vehicle turns over by then.
#[test]
fn crazyflies_under_motion_capture_are_predicted_better() {
    let Some(report) = report("nanobench") else { return };
    assert!(report.verdict.contains(&"battery-sag"), "{report}");
    let drags = ["rotor-drag", "blade-flapping", "parasitic-drag"];
    assert!(report.verdict.iter().any(|name| drags.contains(name)), "{report}");
    assert_eq!(report.held_out.len(), 2);
    for (flight, horizons) in &report.held_out {
        for (channel, own) in &horizons["0.1"] {
            assert!(own.after < 0.5 * own.before, "{flight} {channel}: {own:?}\n{report}");
        }
        let position = horizons["0.5"]["position"];
        assert!(position.after < 0.5 * position.before, "{flight}: {position:?}\n{report}");
    }
    // What was found is not all that there is, and the report says so.
    assert!(!report.unexplained.is_empty() && report.trims.len() == 4, "{report}");
}
