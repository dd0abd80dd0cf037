//! Contracts of the sensors as processes: they read what they should, and hand over what is under way.

use crate::recordings::{require_same_messages, topics};
use crate::support::{Place, repository};

/// The sensors of manifests/sensors.toml, each with a tick at which one of its measurements arrives.
const SENSORS: [(&str, u32); 8] = [
    ("gps", 280),
    ("barometer", 376),
    ("magnetometer", 446),
    ("mocap", 530),
    ("range", 650),
    ("battery", 720),
    ("rpm", 800),
    ("imu", 860),
];

/// A swap by an identical process.
fn swap((process, at_tick): (&str, u32)) -> String {
    format!("[[swap]]\nprocess = \"{process}\"\nat_tick = {at_tick}\nshadow_ticks = 20\n")
}

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
    let swaps: String = SENSORS.into_iter().map(swap).collect();
    let [plain, swapped] = ["plain", "swapped"].map(|name| place.path(&format!("{name}.mcap")));
    let manifest = short(&place, "plain.toml", delayed);
    place.call(&["run", &manifest, "--record", &plain, "--json"]).flown();
    let manifest = short(&place, "swapped.toml", &format!("{delayed}{swaps}"));
    let ended = place.call(&["run", &manifest, "--record", &swapped, "--json"]).flown();
    let summary = ended.json();
    let successions = summary["successions"].as_array().unwrap();
    assert_eq!(successions.len(), SENSORS.len(), "{ended}");
    assert!(successions.iter().all(|succession| succession["hand_over"] == "state"), "{ended}");
    let [plain, mut swapped] = [topics(&plain), topics(&swapped)];
    swapped.retain(|topic, _| !topic.starts_with("/shadow/"));
    require_same_messages(&plain, &swapped);
}

/// A backup sends as it takes over.
#[test]
fn a_sensor_is_swapped_where_one_of_its_measurements_arrives() {
    let place = Place::new();
    let manifest = short(&place, "between.toml", &swap(("gps", 300)));
    let told = ["takes over at tick 300, at which no measurement of `gps` arrives", "choose tick 380"];
    place.call(&["check", &manifest]).with_code(2).says(&told);
}

/// A topic keeps the ticks of its samples.
#[test]
fn a_sensor_that_is_swapped_for_one_with_new_samples_at_other_ticks_is_told() {
    let place = Place::new();
    let sent = "/gps/gps is sent at ticks 0, 80, 180, 280, … (10 Hz), as before";
    let checked = |name: &str, tables: &str, with: &str| {
        let tables = format!("{tables}{}with = {{ {with} }}\n", swap(("gps", 280)));
        place.call(&["check", &short(&place, name, &tables)]).with_code(0)
    };
    let help = "send at the ticks of both: period_ticks = 10, outputs.gps.every_ticks = 10";
    for (name, with, told) in [
        (
            "fast",
            "parameters.rate_hz = 20.0",
            ["0, 80, 130, 180, … (20 Hz)", "some of its samples are never sent"],
        ),
        (
            "slow",
            "parameters.rate_hz = 5.0",
            ["0, 80, 280, 480, … (5 Hz)", "its samples are sent more than once"],
        ),
        (
            "late",
            "parameters.delay_ms = 100.0",
            ["0, 100, 200, 300, … (10 Hz)", "its samples wait for these"],
        ),
    ] {
        let [ticks, effect] = told;
        checked(&format!("{name}.toml"), "", with).says(&[sent, help, ticks, effect]);
    }
    let alike = "parameters.position_noise_m = [0.1, 0.1, 0.1]";
    let stated = "[process.gps]\noutputs.gps.every_ticks = 10\n";
    for (name, tables, with) in [("alike", "", alike), ("stated", stated, "parameters.rate_hz = 20.0")] {
        let checked = checked(&format!("{name}.toml"), tables, with);
        assert!(!checked.to_string().contains("as before"), "{checked}");
    }
}

#[test]
fn a_sensor_that_should_measure_more_often_than_it_computes_is_refused() {
    let place = Place::new();
    let manifest = short(&place, "slow.toml", "[process.mocap]\nperiod_ticks = 20\n");
    place.call(&["run", &manifest]).with_code(2).says(&["`rate_hz`", "`period_ticks`", "mocap"]);
}

/// Each sample behind the first is a new measurement, with any period of the process, and readers see the same.
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
    let [mut each_tick, at_its_rate] =
        [("each", format!("period_ticks = 1\n{parameters}")), ("rate", parameters.to_owned())]
            .map(|(name, mocap)| flown(name, &mocap));
    let sent: Vec<u32> = at_its_rate["/mocap/mocap"].iter().map(|message| message.tick).collect();
    let expected: Vec<u32> = std::iter::once(0).chain((10..4000).step_by(20)).collect();
    assert_eq!(sent, expected);
    require_same_messages(&each_tick, &at_its_rate);
    // A stated `every_ticks` repeats measurements.
    let stated = format!("period_ticks = 1\noutputs.mocap.every_ticks = 1\n{parameters}");
    let mut repeated = flown("stated", &stated);
    assert_eq!(repeated.remove("/mocap/mocap").unwrap().len(), 4000);
    each_tick.remove("/mocap/mocap");
    require_same_messages(&each_tick, &repeated);
}
