//! Contracts of the sensors as processes: they read what they should, and hand over what is under way.

use crate::recordings::{require_same_messages, topics};
use crate::support::{Place, repository};

/// Every sensor of manifests/sensors.toml that is not part of hover.toml.
const SENSORS: [&str; 7] = ["gps", "barometer", "magnetometer", "mocap", "range", "battery", "rpm"];

/// manifests/sensors.toml cut to 1 s, with more tables.
fn short(place: &Place, name: &str, tables: &str) -> String {
    let manifest = repository("manifests/sensors.toml");
    place.write(name, format!("include = [{manifest:?}]\n[run]\nduration_s = 1.0\n{tables}"))
}

#[test]
fn every_sensor_reads_what_it_should_in_a_hover() {
    let place = Place::new();
    let (manifest, recording) = (repository("manifests/sensors.toml"), place.path("sensors.mcap"));
    place.call(&["run", &manifest, "--record", &recording]).with_code(0);
}

#[test]
fn sensors_that_are_swapped_in_flight_leave_no_trace() {
    let place = Place::new();
    // Each with measurements under way: the IMU's are delayed too.
    let delayed = "[process.imu.parameters]\ndelay_ms = 7.0\ndropout = 0.1\n";
    let swap = |(index, process): (usize, &&str)| {
        let at_tick = 300 + 80 * index;
        format!("[[swap]]\nprocess = \"{process}\"\nat_tick = {at_tick}\nshadow_ticks = 20\n")
    };
    let processes = [&SENSORS[..], &["imu"]].concat();
    let swaps: String = processes.iter().enumerate().map(swap).collect();
    let [plain, swapped] = ["plain", "swapped"].map(|name| place.path(&format!("{name}.mcap")));
    let manifest = short(&place, "plain.toml", delayed);
    place.call(&["run", &manifest, "--record", &plain, "--json"]).flown();
    let manifest = short(&place, "swapped.toml", &format!("{delayed}{swaps}"));
    let ended = place.call(&["run", &manifest, "--record", &swapped, "--json"]).flown();
    let summary = ended.json();
    let successions = summary["successions"].as_array().unwrap();
    assert_eq!(successions.len(), processes.len(), "{ended}");
    assert!(successions.iter().all(|succession| succession["hand_over"] == "state"), "{ended}");
    let [plain, mut swapped] = [topics(&plain), topics(&swapped)];
    swapped.retain(|topic, _| !topic.starts_with("/shadow/"));
    require_same_messages(&plain, &swapped);
}

#[test]
fn a_sensor_that_should_measure_more_often_than_it_computes_is_refused() {
    let place = Place::new();
    let manifest = short(&place, "slow.toml", "[process.mocap]\nperiod_ticks = 20\n");
    place.call(&["run", &manifest]).with_code(2).says(&["`rate_hz`", "`period_ticks`", "mocap"]);
}

/// A period that nobody states changes the number of samples alone: whoever reads them sees the same.
#[test]
fn a_sensor_sends_at_its_rate_and_readers_see_no_difference() {
    let place = Place::new();
    let text = std::fs::read_to_string(repository("manifests/hover.toml")).unwrap();
    let text = text.replace("\"../vehicles/", &format!("\"{}/", repository("vehicles")));
    let stated = "kind = \"mocap\"\nperiod_ticks = 5\n";
    assert!(text.contains(stated));
    let flown = |name: &str, mocap: &str| {
        let text = text.replace(stated, &format!("kind = \"mocap\"\n{mocap}"));
        let (manifest, recording) =
            (place.write(&format!("{name}.toml"), text), place.path(&format!("{name}.mcap")));
        place.call(&["run", &manifest, "--record", &recording, "--set", "run.duration_s=4.0"]).flown();
        topics(&recording)
    };
    let parameters = "parameters = { rate_hz = 50.0, delay_ms = 10.0, dropout = 0.1 }\n";
    let [mut each_tick, mut at_its_rate] =
        [("each", format!("period_ticks = 1\n{parameters}")), ("rate", parameters.to_owned())]
            .map(|(name, mocap)| flown(name, &mocap));
    let [each, rate] =
        [&mut each_tick, &mut at_its_rate].map(|topics| topics.remove("/mocap/mocap").unwrap());
    assert_eq!((each.len(), rate.len()), (4000, 400));
    require_same_messages(&each_tick, &at_its_rate);
}
