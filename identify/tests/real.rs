//! Real flights, where they are: `HUMMINGBUS_DATA` names their folder.

use flights::FlightSet;
use std::path::Path;

#[test]
fn explore_real() {
    let name = std::env::var("FLIGHTS").unwrap_or("nanobench".to_owned());
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("../flights/{name}.toml"));
    let set = FlightSet::load(&path).unwrap();
    let outcome = identify::run::identify(&set, &mut |step| eprintln!("{step}")).unwrap();
    println!("{}", outcome.report);
    println!("{}", serde_json::to_string_pretty(&outcome.report).unwrap());
}
