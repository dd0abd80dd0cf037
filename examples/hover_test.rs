//! A simulation as a unit test: flies the hover with changed gains, on the thread of the test, and asserts on
//! the recording. `cargo test --example hover_test` runs it.

#[test]
fn a_softer_altitude_loop_still_reaches_its_set_point() -> Result<(), Box<dyn std::error::Error>> {
    use hummingbus::{Host, Launcher};
    let folder = tempfile::tempdir()?;
    let hover = concat!(env!("CARGO_MANIFEST_DIR"), "/manifests/hover.toml");
    let gains = toml::toml! { proportional_1_s2 = 9.0
    integral_1_s3 = 2.0
    derivative_1_s = 6.0 };
    let manifest = hummingbus::load(hover)?
        .set("run.duration_s", 6.0)?
        .set("process.controller.parameters.gains.altitude", gains)?;

    let launcher = Launcher::new(Host::InProcess);
    let (outcome, recording) = launcher.fly(&manifest, &folder.path().join("soft.mcap"))?;

    assert_eq!(outcome.ticks, 6000);
    let recording = recording.ok_or("the hover has a recorder")?;
    let altitude = &recording.series(&[("/plant/state", "position.z")])?[0];
    // The set point steps from 1.0 m to 1.5 m at 2 s.
    let settled =
        altitude.time_ns.iter().zip(&altitude.value).filter(|(time_ns, _)| **time_ns > 5_000_000_000);
    settled.for_each(|(time_ns, z)| assert!((z - 1.5).abs() < 0.05, "{z} m at {time_ns} ns"));
    Ok(())
}

fn main() {
    println!("run me with: cargo test --example hover_test");
}
