//! Backups requested in flight, checked against a manifest of this package.

use crate::COMPONENTS;
use runtime::graph::{Graph, backup_of, successor_of};
use runtime::manifest::Manifest;
use std::path::Path;

fn hover() -> (Manifest, Graph) {
    hover_with(&[])
}

fn hover_with(overrides: &[&str]) -> (Manifest, Graph) {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("manifests/hover.toml");
    let overrides: Vec<String> =
        ["run.duration_s=1"].iter().chain(overrides).map(|text| (*text).to_owned()).collect();
    let manifest = Manifest::load(&path, &overrides, COMPONENTS).unwrap();
    let graph = Graph::build(&manifest).unwrap();
    (manifest, graph)
}

#[test]
fn a_backup_in_a_live_run_differs_in_what_is_asked_for() {
    let (manifest, graph) = hover();
    let with = "parameters.gains.altitude_integral_max_m_s2 = 1.5";
    let backup = backup_of(&manifest, &graph.plan, &graph.files, "controller", with).unwrap();
    let node = &graph.plan.nodes[backup.node];
    assert_eq!((node.name.as_str(), backup.take_over_tick, backup.is_standby), ("controller", None, false));
    assert_eq!(backup.plan.parameters["gains"]["altitude_integral_max_m_s2"], 1.5);
    assert_eq!(backup.plan.parameters["vehicle"], node.parameters["vehicle"]);
    let topics = |plan: &bus::plan::NodePlan| plan.inputs.iter().map(|input| input.topic).collect::<Vec<_>>();
    assert_eq!(topics(&backup.plan), topics(node));
    assert_eq!(backup.plan.cpu, node.cpu);
}

#[test]
fn a_backup_in_a_live_run_that_cannot_be_is_refused_with_its_place() {
    let (manifest, graph) = hover();
    let refused = |process: &str, with: &str| {
        backup_of(&manifest, &graph.plan, &graph.files, process, with).map(|_| ()).unwrap_err().to_string()
    };
    // An argument that was not given has no fault.
    for (process, reason) in [("contorller", "there is no process"), ("recorder", "its file would be torn")] {
        let message = refused(process, "");
        assert!(message.contains(reason) && message.contains("manifests/hover.toml: "), "{message}");
        assert!(!message.contains("--with"), "{message}");
    }
    let message = refused("controller", "wait = \"spin\"\nknid = 3");
    assert!(message.starts_with("--with:2:1: unknown key `knid`"), "{message}");
    assert!(refused("controller", "parameters.gain = 3").contains("--with:1:12: process `controller`"));
    assert!(refused("controller", "x = ").starts_with("--with:1:"));
}

/// As `check` does for a swap in the manifest.
#[test]
fn a_live_swap_to_a_refused_vehicle_has_the_warnings_that_may_explain_it() {
    let (manifest, graph) = hover();
    let vehicle = Path::new(env!("CARGO_MANIFEST_DIR")).join("vehicles/hummingbird.toml");
    let text = std::fs::read_to_string(vehicle).unwrap();
    let heavy = text.replace("mass = { value = 0.480,", "mass = { value = 1000.0,");
    graph.files.keep("/heavy.toml".as_ref(), heavy.into_bytes());
    let swap = successor_of(&manifest, &graph.plan, &graph.files, "plant", "vehicle = \"/heavy.toml\"");
    let fault = swap.map(drop).unwrap_err();
    assert!(fault.to_string().contains("cannot fly"), "{fault}");
    let warnings: Vec<String> = fault.warnings().iter().map(ToString::to_string).collect();
    assert!(warnings.iter().any(|warning| warning.contains("moment of inertia")), "{warnings:?}");
}

#[test]
fn a_backup_changes_values_of_the_gains_file_that_its_process_names() {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("controllers/gains/pid-thesis.toml");
    let (manifest, graph) = hover_with(&[&format!("process.controller.gains={}", file.display())]);
    let backup = |with: &str| {
        backup_of(&manifest, &graph.plan, &graph.files, "controller", &format!("parameters.{with}"))
    };
    let plan = backup("gains.roll = { proportional_1_s2 = 20.0, integral_1_s3 = 0.0, derivative_1_s = 7.0 }");
    let gains = plan.unwrap().plan.parameters["gains"].clone();
    assert_eq!((gains["file"].as_str(), &gains["roll"]["derivative_1_s"]), (file.to_str(), &7.0.into()));
    assert!(backup("gains.roll.proportional_1_s2 = 20.0").is_ok(), "the file has the others");
    for (with, place, reason) in [
        ("gains.rol = 3", "--with:1:18: ", "unknown key `gains.rol`"),
        ("gains.roll.proportional = 20", "--with:1:23: ", "unknown key `gains.roll.proportional`"),
        ("gains.roll.proportional_1_s2 = -1", "--with:1:43: ", "`gains.roll.proportional_1_s2`"),
        ("gains.roll.proportional_1_s2 = \"a\"", "--with:1:43: ", "`gains.roll.proportional_1_s2`"),
        ("gains = 3", "--with:1:12: ", "`gains` twice"),
    ] {
        let message = backup(with).map(drop).unwrap_err().to_string();
        assert!(message.starts_with(place) && message.contains(reason), "{with}: {message}");
    }
}

#[test]
fn another_gains_file_takes_the_place_of_values_too() {
    let (manifest, graph) =
        hover_with(&["process.controller.parameters.gains.altitude_integral_max_m_s2=1.5"]);
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("controllers/gains/pid-thesis.toml");
    let backup = |with: &str| {
        let backup = backup_of(&manifest, &graph.plan, &graph.files, "controller", with).unwrap();
        backup.plan.parameters["gains"].clone()
    };
    let of_file = format!("gains = {:?}", file.display().to_string());
    assert_eq!(backup(&of_file).as_str(), file.to_str());
    let with_value = backup(&format!("{of_file}\nparameters.gains.altitude_integral_max_m_s2 = 2.0"));
    assert_eq!(with_value["altitude_integral_max_m_s2"], 2.0);
    assert_eq!(backup("wait = \"spin\"")["altitude_integral_max_m_s2"], 1.5);
}

#[test]
fn a_backup_of_another_kind_keeps_the_vehicle() {
    let (manifest, graph) = hover();
    let backup = |with: &str| backup_of(&manifest, &graph.plan, &graph.files, "controller", with);
    let plan = backup("kind = \"cascade\"").unwrap().plan;
    assert_eq!(plan.parameters["vehicle"], graph.plan.nodes[0].parameters["vehicle"]);
    let message = backup("kind = \"cascade\"\nvehicle = \"none.toml\"").map(drop).unwrap_err().to_string();
    assert!(message.starts_with("--with:2:"), "{message}");
}
