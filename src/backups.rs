//! Backups requested in flight, checked against a manifest of this package.

use crate::COMPONENTS;
use runtime::graph::{Graph, backup_of};
use runtime::manifest::Manifest;
use std::path::Path;

fn hover() -> (Manifest, Graph) {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("manifests/hover.toml");
    let manifest = Manifest::load(&path, &["run.duration_s=1".to_owned()], COMPONENTS).unwrap();
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
    let message = refused("contorller", "");
    assert!(message.starts_with("--with:1:1: there is no process `contorller`"), "{message}");
    let message = refused("controller", "wait = \"spin\"\nknid = 3");
    assert!(message.starts_with("--with:2:1: unknown key `knid`"), "{message}");
    assert!(refused("controller", "parameters.gain = 3").contains("--with:1:12: process `controller`"));
    assert!(refused("controller", "x = ").starts_with("--with:1:"));
    assert!(refused("recorder", "").contains("its file would be torn"));
}
