//! The test that README prints: `documentation.rs` compares both.

use hummingbus::{Host, Launcher};

#[test]
fn the_hover_holds_its_height() -> Result<(), Box<dyn std::error::Error>> {
    let manifest = hummingbus::load("manifests/hover.toml")?;
    let flown = hummingbus::fly(Launcher::new(Host::InProcess), &manifest, "target/hover.mcap")?;
    assert!(flown.summary.passed, "{}", flown.summary);
    let altitude = &flown.recording.ok_or("no recorder")?.series(&[("/plant/state", "position.z")])?[0];
    assert!(altitude.value.iter().all(|z| (0.9..1.6).contains(z)));
    Ok(())
}
