//! Patterns of logs: a flight for each log that is found.

use crate::support;
use std::path::Path;

use flights::{FlightSet, Role};
use support::{Motion, Place};

const HEAD: &str = r#"
[channels]
time = { columns = ["t"], unit = "s" }
position = { columns = ["px", "py", "pz"], unit = "m" }
attitude = { columns = ["qx", "qy", "qz", "qw"] }
"#;

/// Reads the flights that `entries` name.
fn load(place: &Place, entries: &str) -> Result<FlightSet, String> {
    let vehicle = Path::new(env!("CARGO_MANIFEST_DIR")).join("../vehicles/hummingbird.toml");
    let text = format!("vehicle = \"{}\"{HEAD}{entries}", vehicle.display());
    place.write("flights.toml", text.as_bytes());
    FlightSet::load(&place.path("flights.toml")).map_err(|error| error.to_string())
}

fn names(place: &Place, entries: &str) -> Vec<String> {
    load(place, entries).unwrap().flights.into_iter().map(|flight| flight.name).collect()
}

/// A folder with logs at these paths.
fn with_logs(paths: &[&str]) -> Place {
    let place = Place::new();
    for path in paths {
        std::fs::create_dir_all(place.path(path).parent().unwrap()).unwrap();
        place.write(path, Motion::default().csv().as_bytes());
    }
    place
}

#[test]
fn each_log_becomes_a_flight_in_the_order_of_their_names() {
    let place = with_logs(&[
        "logs/c.csv",
        "logs/a.csv",
        "logs/b1.csv",
        "logs/.hidden.csv",
        "logs/a.txt",
        "logs/in/d.csv",
    ]);
    let set = load(&place, "[[flight]]\nfile = \"logs/*.csv\"\nrole = \"fit\"\nfrom_s = 2.0\n").unwrap();
    let of = |flight: &flights::Flight| (flight.name.clone(), flight.file.clone(), flight.role);
    let expected =
        ["a", "b1", "c"].map(|name| (name.to_owned(), place.path(&format!("logs/{name}.csv")), Role::Fit));
    assert_eq!(set.flights.iter().map(of).collect::<Vec<_>>(), expected);
    assert!(set.flights.iter().all(|flight| flight.position.time_s.len() == 801), "the keys are of all");
    let entry = |keys: &str| format!("[[flight]]\n{keys}\nrole = \"fit\"\n");
    assert_eq!(names(&place, &entry("name = \"day 1\"\nfile = \"logs/?.csv\"")), ["day 1 a", "day 1 c"]);
    assert_eq!(names(&place, &entry("file = \"./*/*/*.csv\"")), ["logs/in/d"]);
    assert_eq!(names(&place, &entry("file = \"logs/b1.csv\"")), ["b1"]);
    assert_eq!(names(&place, &entry("name = \"x\"\nfile = \"logs/b1.csv\"")), ["x"]);
}

#[test]
fn brackets_stand_for_themselves() {
    let place = with_logs(&["run [1]/a.csv", "run [1]/b*.csv", "run 1/c.csv"]);
    let entry = |file: &str| format!("[[flight]]\nfile = \"{file}\"\nrole = \"fit\"\n");
    assert_eq!(names(&place, &entry("run [1]/*.csv")), ["a", "b*"]);
    assert_eq!(names(&place, &entry("run [1]/b*.csv")), ["b*"], "a log of that very name");
}

#[test]
fn what_finds_nothing_is_refused_with_folder_and_pattern() {
    let place = with_logs(&["logs/a.csv", "other/a.csv"]);
    let said = |entries: &str, parts: &[&str]| {
        let found = load(&place, entries).unwrap_err();
        parts.iter().for_each(|part| assert!(found.contains(part), "`{part}` is not in: {found}"));
    };
    let entry = |file: &str| format!("[[flight]]\nfile = \"{file}\"\nrole = \"fit\"\n");
    let folder = place.path("logs").display().to_string();
    said(
        &entry("logs/*.ulg"),
        &["flights.toml:7:", "`flight.0.file`", "`logs/*.ulg`", &folder, "found none", "correct"],
    );
    said(&entry("lags/*.csv"), &["`lags/*.csv`", "found no such folder"]);
    said(&entry("**/*.csv"), &["found `**`"]);
    let twice = format!("{}{}", entry("logs/*.csv"), entry("other/*.csv"));
    said(&twice, &["flights.toml:10:", "`flight.1.name`", "\"a\" a second time"]);
    assert_eq!(names(&place, &entry("*/*.csv")), ["logs/a", "other/a"]);
}

#[test]
fn logs_of_a_pattern_are_held_out_too() {
    let place = with_logs(&["logs/a.csv", "logs/b.csv", "test.csv"]);
    let entries = "[[flight]]\nfile = \"logs/*.csv\"\nrole = \"fit\"\n\
                   [[flight]]\nfile = \"test.csv\"\nrole = \"test\"\n";
    let found = load(&place, entries).unwrap_err();
    for part in ["flights.toml:10:8", "`test`", "`a`", "copies of the same bytes"] {
        assert!(found.contains(part), "`{part}` is not in: {found}");
    }
}
