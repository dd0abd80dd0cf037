//! Flies the controller in the process of the test.

use super::Controller;
use hummingbus::bus::Registration;
use hummingbus::runtime::registry::Registry;
use hummingbus::{Host, Launcher, Manifest};
use std::error::Error;
use std::path::Path;

/// The manifest, whose process `controller` is the program of this package.
const MANIFEST: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/src/cli/project/hover-rust.toml");

/// The manifest with the controller as a component of this process instead of a program.
fn in_this_process() -> Result<Manifest, Box<dyn Error>> {
    let mut manifest: toml::Table = std::fs::read_to_string(MANIFEST)?.parse()?;
    let controller = manifest["process"]["controller"].as_table_mut().ok_or("no [process.controller]")?;
    controller.remove("command");
    controller.remove("outputs");
    controller.insert("kind".to_owned(), "own-controller".into());
    let components = [hummingbus::COMPONENTS.components(), &[Registration::of::<Controller>()]].concat();
    let registry = Registry::new(components.leak());
    Ok(Manifest::parse(manifest.to_string(), Path::new(MANIFEST), &[], registry)?)
}

#[test]
fn the_controller_reaches_the_height_that_the_pilot_asks_for() -> Result<(), Box<dyn Error>> {
    let folder = tempfile::tempdir()?;
    let (_, recording) =
        Launcher::new(Host::InProcess).fly(&in_this_process()?, &folder.path().join("hover.mcap"))?;
    let recording = recording.ok_or("the manifest has no recorder")?;
    let height = &recording.series(&[("/plant/state", "position.z")])?[0];
    // The set point steps from 1.0 m to 1.5 m at 1 s.
    let settled = height.time_ns.iter().zip(&height.value).filter(|(time_ns, _)| **time_ns > 4_000_000_000);
    let heights: Vec<f64> = settled.map(|(_, z)| *z).collect();
    assert!(heights.len() > 1000, "only {} samples", heights.len());
    heights.iter().for_each(|z| assert!((z - 1.5).abs() < 0.05, "{z} m"));
    Ok(())
}
