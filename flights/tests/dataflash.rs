//! Dataflash logs of ArduPilot: the flights that are read from them, and the errors for damaged ones.

use crate::dataflash_file as dataflash;
use crate::support;
use dataflash::{fmt, log, message};
use flights::{Flight, FlightsError};
use support::Place;

const CHANNELS: &str = r#"
attitude = { topic = "ATT" }
angular_velocity = { topic = "IMU" }
specific_force = { topic = "IMU" }
"#;

fn load(log: &[u8], channels: &str, keys: &str) -> Result<Flight, FlightsError> {
    let place = Place::new();
    place.write("00000001.BIN", log);
    place.load("00000001.BIN", channels, keys)
}

fn read(log: &[u8]) -> Flight {
    load(log, CHANNELS, "").unwrap_or_else(|error| panic!("{error}"))
}

fn note<'a>(flight: &'a Flight, part: &str) -> &'a str {
    flight
        .notes
        .iter()
        .find(|note| note.contains(part))
        .unwrap_or_else(|| panic!("{part}: {:?}", flight.notes))
}

#[test]
fn a_log_is_read_by_its_own_description_with_and_without_units() {
    for has_units in [true, false] {
        let flight = read(&log(400, has_units));
        assert_eq!(flight.notes, [""; 0]);
        assert_eq!((flight.attitude.time_s.len(), flight.attitude.time_s[0]), (400, 0.0));
        assert!((flight.attitude.time_s[399] - 3.99).abs() < 1e-9);
        // Level, heading east, at first; then rolled by as many degrees as the log has hundredths.
        let east = [1.0, 0.0, 0.0, 0.0];
        let off = |row: usize| {
            let found = flight.attitude.values[row];
            libm::acos((0..4).map(|part| found[part] * east[part]).sum::<f64>().abs().min(1.0)) * 2.0
        };
        assert!(off(0) < 1e-6, "{:?}", flight.attitude.values[0]);
        assert!((off(79).to_degrees() - 10.0).abs() < 0.01, "{}", off(79).to_degrees());
        // Forward, left, up of forward, right, down.
        assert!((flight.specific_force.values[0][2] - 9.8).abs() < 1e-6);
        assert!((flight.angular_velocity.values[0][0] - 0.349).abs() < 1e-3);
    }
}

#[test]
fn zeros_in_front_of_a_log_are_passed_over() {
    let behind = [vec![0; 64], log(400, true)].concat();
    let flight = read(&behind);
    assert_eq!(
        (flight.attitude.time_s.len(), flight.attitude.values),
        (400, read(&log(400, true)).attitude.values)
    );
    assert!(flight.notes.iter().all(|note| note.contains("64 bytes")), "{:?}", flight.notes);
}

#[test]
fn further_sensors_are_topics_of_their_own() {
    let second = CHANNELS.replace("\"IMU\"", "\"IMU:1\"");
    for has_units in [true, false] {
        let flight = load(&log(400, has_units), &second, "trust_units = true").unwrap();
        assert!((flight.angular_velocity.values[0][0] - 0.449).abs() < 1e-3);
        assert_eq!(flight.angular_velocity.time_s.len(), 400);
    }
}

#[test]
fn outputs_and_scaled_numbers_are_read_by_their_fields() {
    let channels = r#"
command = { topic = "RCOU", fields = ["C1", "C2", "C3", "C4"], unit = "count" }
battery_voltage = { topic = "BAT", fields = ["Volt"], unit = "V" }
"#;
    let flight = load(&log(100, true), channels, "trust_units = true").unwrap();
    assert_eq!(flight.command.values[7][..4], [1500.0, 1501.0, 1502.0, 1503.0]);
    // By the multiplier of FMTU, not by the type of the field.
    assert!((flight.battery_voltage.values[0][0] - 11.1).abs() < 1e-9);
}

#[test]
fn nothing_declared_takes_what_is_clear() {
    let flight = load(&log(400, true), "", "").unwrap();
    note(&flight, "attitude: taken from ATT");
    note(&flight, "more than one topic has it (IMU, IMU:1)");
    assert_eq!(flight.battery_voltage.values[0], [11.1]);
}

#[test]
fn names_that_are_not_there_are_told_with_those_that_are() {
    let told = |channels: &str| load(&log(10, true), channels, "").unwrap_err().to_string();
    let message = told("attitude = { topic = \"AHR2\" }");
    assert!(message.contains("no topic `AHR2`; it has ATT, BAT"), "{message}");
    let message = told("battery_voltage = { topic = \"BAT\", fields = [\"Text\"], unit = \"V\" }");
    assert!(message.contains("no number `Text`; it has TimeUS, Volt, Text"), "{message}");
    let message = told("battery_voltage = { fields = [\"Volt\"], unit = \"V\" }");
    assert!(message.contains("`topic`") && message.contains("such as `IMU`"), "{message}");
}

#[test]
fn a_second_type_of_one_name_is_a_topic_of_its_own() {
    let other = fmt(250, 3 + 8 + 4, "ATT", "Qf", "TimeUS,Volt");
    let sample = message(250, &[&60_000_000_u64.to_le_bytes()[..], &4.2_f32.to_le_bytes()].concat());
    let flight = read(&[log(400, false), other.clone(), sample.clone()].concat());
    assert_eq!((flight.notes, flight.attitude.time_s.len()), (Vec::new(), 400));
    let channels = "attitude = { topic = \"ATT\" }\n\
                    battery_voltage = { topic = \"ATT of type 250\", fields = [\"Volt\"], unit = \"V\" }\n";
    let flight = load(&[log(400, false), other, sample].concat(), channels, "trust_units = true").unwrap();
    assert!((flight.battery_voltage.values[0][0] - 4.2).abs() < 1e-6, "{:?}", flight.battery_voltage);
}

#[test]
fn damage_costs_what_is_at_it_alone_and_is_said() {
    let whole = log(400, true);
    let first = whole.len() - 400 * (17 + 2 * 36 + 19 + 17);
    let sample = (whole.len() - first) / 400;
    for at in first + 100 * sample..first + 101 * sample {
        let mut broken = whole.clone();
        broken[at] ^= 0x5A;
        let flight = load(&broken, CHANNELS, "trust_units = true").unwrap();
        let (attitudes, rates) = (flight.attitude.time_s.len(), flight.angular_velocity.time_s.len());
        // Jumps of the pose leave a gap of six samples.
        assert!(attitudes >= 390 && rates >= 396, "byte {at}: {attitudes}, {rates}, {:?}", flight.notes);
    }
    let mut broken = whole.clone();
    broken[first + 100 * sample] = 0;
    assert!(
        note(&read(&broken), "damaged in 1 places")
            .contains(&format!("byte {}: 17 bytes", first + 100 * sample))
    );
    let missing = [&whole[..first + 100 * sample + 5], &whole[first + 150 * sample + 30..]].concat();
    note(&load(&missing, CHANNELS, "trust_units = true").unwrap(), "damaged in 1 places");
    for (tail, left) in [(vec![0xFF; 5000], 5000), (vec![0; 3], 3), (whole[first..first + 10].to_vec(), 10)] {
        let flight = read(&[&whole[..], &tail].concat());
        assert!(
            note(&flight, "the log is cut").contains(&format!("last {left} bytes")),
            "{:?}",
            flight.notes
        );
        assert_eq!(flight.attitude.time_s.len(), 400);
    }
}

#[test]
fn formats_that_cannot_be_meant_are_no_formats() {
    for (length, format, names) in
        [(2, "Q", "TimeUS"), (5, "QQ", "TimeUS,A"), (11, "?", "TimeUS"), (0, "", "")]
    {
        let mut bytes = fmt(128, 89, "FMT", "BBnNZ", "Type,Length,Name,Format,Columns");
        bytes.extend(fmt(20, length, "ODD", format, names));
        bytes.extend(message(20, &[0; 8]).repeat(10));
        let told = load(&bytes, "battery_voltage = { topic = \"ODD\", fields = [\"A\"], unit = \"V\" }", "");
        assert!(told.is_err());
    }
}
