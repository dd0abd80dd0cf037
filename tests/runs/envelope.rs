//! Flights beyond the envelope in which the model of a vehicle was validated.

use crate::support::{Place, repository};

/// The hover with a vehicle whose envelope is `limits`.
fn hover(place: &Place, limits: &str) -> Vec<String> {
    let base = toml::Value::from(repository("vehicles/hummingbird.toml"));
    let text = format!("name = \"validated\"\nbase = {base}\n\n[envelope]\n{limits}");
    let vehicle = format!("process.plant.vehicle={}", place.write("validated.toml", text));
    ["--set", "run.duration_s=4", "--set", &vehicle].map(str::to_owned).to_vec()
}

fn limit(key: &str, value: f64, unit: &str) -> String {
    format!("{key} = {{ value = {value:?}, unit = \"{unit}\", source = \"test\", uncertainty = \"none\" }}\n")
}

#[test]
fn a_flight_beyond_it_is_told_before_and_after() {
    let place = Place::new();
    let narrow = [
        limit("height_max", 1.2, "m"),
        limit("height_min", 1.1, "m"),
        limit("tilt_max", 45.0, "deg"),
        limit("specific_force_max", 10.0, "m/s^2"),
    ];
    let changes = hover(&place, &narrow.concat());
    let changes: Vec<&str> = changes.iter().map(String::as_str).collect();
    let manifest = repository("manifests/hover.toml");
    let checked = place.call(&[&["check", &manifest], &changes[..]].concat()).with_code(0);
    checked.says(&["the initial height of 1.000 m", "validated, from 1.100 up to 1.200 m"]);
    let recording = place.path("hover.mcap");
    let flown = place.call(&[&["run", &manifest, "--record", &recording], &changes[..]].concat());
    // It stands at 1 m for two seconds, and climbs to 1.5 m: below and then above.
    flown.prints(&[
        "beyond the validated envelope: height on /plant/state for",
        "(limit 1.100 m)",
        "(limit 1.200 m)",
        "specific force on /plant/state for",
        "(limit 10.000 m/s^2)",
    ]);
    assert!(!flown.output.contains("tilt on"), "{}", flown.output);
}

#[test]
fn a_flight_within_it_says_nothing() {
    let place = Place::new();
    let wide = [limit("height_max", 3.0, "m"), limit("speed_max", 5.0, "m/s")];
    let changes = hover(&place, &wide.concat());
    let changes: Vec<&str> = changes.iter().map(String::as_str).collect();
    let manifest = repository("manifests/hover.toml");
    let recording = place.path("hover.mcap");
    let flown = place.call(&[&["run", &manifest, "--record", &recording], &changes[..]].concat());
    assert!(!flown.output.contains("envelope"), "{}", flown.output);
}

#[test]
fn a_flight_without_a_recording_says_that_its_envelope_was_not_evaluated() {
    let place = Place::new();
    let changes = hover(&place, &limit("height_max", 3.0, "m"));
    let manifest = repository("manifests/hover.toml");
    let unrecorded = ["run", &manifest, "--record", "none", "--set", "run.duration_s=4"];
    let flown = place.call(&[&unrecorded[..], &["--set", &changes[3]]].concat());
    flown.prints(&["the flight envelope of validated was not evaluated: it needs a recording"]);
    // Without an envelope nothing is missing.
    let flown = place.call(&unrecorded);
    assert!(!flown.output.contains("envelope"), "{}", flown.output);
}

#[test]
fn a_flight_below_the_ground_is_told_where_the_ground_does_not_carry() {
    let place = Place::new();
    let fall = "process.plant.parameters.initial_velocity_m_s=[0.0, 0.0, -6.0]";
    let manifest = repository("manifests/hover.toml");
    let flown = |more: &[&str]| {
        let recording = place.path("fall.mcap");
        let short = ["--set", "run.duration_s=2", "--record", &recording];
        place.call(&[&["run", &manifest], &short[..], more].concat()).output
    };
    let text = flown(&["--set", fall]);
    assert!(text.contains("below the ground on /plant/state: first at 0."), "{text}");
    assert!(text.contains("set `backend = \"rapier\"`"), "{text}");
    let json = flown(&["--set", fall, "--json"]);
    assert!(json.contains("\"below_ground\"") && json.contains("\"depth_m\": 1."), "{json}");
    let level = flown(&[]);
    assert!(!level.contains("below the ground"), "{level}");
}
