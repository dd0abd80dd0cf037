//! ULogs that are damaged, cut or subscribed again: the flights that are read from them, and the notes.

use crate::skipped::cases;
use crate::support;
use flights::Flight;
use support::{Place, ulog, ulog_message};

const CHANNELS: &str = r#"
specific_force = { topic = "sensor_combined" }
angular_velocity = { topic = "sensor_combined" }
battery_voltage = { topic = "battery", fields = ["cell[1].volts"], unit = "V" }
"#;

/// A sync message.
const SYNC: [u8; 11] = [8, 0, b'S', 0x2F, 0x73, 0x13, 0x20, 0x25, 0x0C, 0xBB, 0x12];

fn read(log: &[u8]) -> Flight {
    let place = Place::new();
    place.write("log.ulg", log);
    place.load("log.ulg", CHANNELS, "").unwrap_or_else(|error| panic!("{error}"))
}

/// First byte of each message behind the header.
fn messages(log: &[u8]) -> Vec<usize> {
    let mut starts = vec![16];
    while starts[starts.len() - 1] < log.len() {
        let at = starts[starts.len() - 1];
        starts.push(at + 3 + usize::from(u16::from_le_bytes([log[at], log[at + 1]])));
    }
    starts
}

/// A log of 400 samples at 100 Hz with a sync message in front of every fiftieth pair.
fn with_syncs() -> Vec<u8> {
    let log = ulog(400);
    let starts = messages(&log);
    let mut synced = log[..starts[5]].to_vec();
    for (k, pair) in starts[5..].windows(3).step_by(2).enumerate() {
        if k % 50 == 0 {
            synced.extend(SYNC);
        }
        synced.extend(&log[pair[0]..pair[2]]);
    }
    synced
}

fn note<'a>(flight: &'a Flight, part: &str) -> &'a str {
    flight.notes.iter().find(|note| note.contains(part)).unwrap_or_else(|| panic!("{:?}", flight.notes))
}

#[test]
fn a_whole_log_with_sync_messages_has_no_notes_of_damage() {
    let flight = read(&with_syncs());
    assert_eq!(flight.specific_force.time_s.len(), 400);
    assert!(
        !flight.notes.iter().any(|note| note.contains("damaged") || note.contains("cut")),
        "{:?}",
        flight.notes
    );
}

#[test]
fn one_wrong_byte_anywhere_costs_what_is_at_it_alone() {
    let log = with_syncs();
    let starts = messages(&log);
    // Every byte of the heads and of the content of the messages in the middle of the log.
    let values = cases("values", [0, 1, 0x44, 0x4F, 0x7F, 0xFF], |value| [0, 0xFF].contains(value));
    for at in starts[300]..starts[306] {
        for value in values.iter().copied() {
            let mut broken = log.clone();
            broken[at] = value;
            let flight = read(&broken);
            let left = flight.specific_force.time_s.len();
            assert!(left >= 397, "byte {at} as {value}: {left} of 400 samples are left, {:?}", flight.notes);
            let left = flight.battery_voltage.time_s.len();
            assert!(left >= 397, "byte {at} as {value}: {left} of 400 voltages are left, {:?}", flight.notes);
            assert!(!flight.notes.iter().any(|note| note.contains("dropped out")), "{:?}", flight.notes);
        }
    }
}

#[test]
fn a_wrong_length_is_said_in_bytes_and_seconds() {
    let log = with_syncs();
    let starts = messages(&log);
    for (high, low) in [(0, 7), (0, 200), (3, 0), (0xFF, 0xFF)] {
        let mut broken = log.clone();
        broken[starts[300]..starts[300] + 2].copy_from_slice(&[low, high]);
        let flight = read(&broken);
        let size = starts[301] - starts[300];
        let said = note(&flight, "damaged in 1 places");
        assert!(said.contains(&format!("at byte {}: {size} bytes", starts[300])), "{said}");
        assert!(said.contains("0.010 s") || said.contains("0.000 s"), "{said}");
        assert_eq!(flight.specific_force.time_s.len() + flight.battery_voltage.time_s.len(), 799, "{said}");
    }
}

#[test]
fn a_wrong_length_in_a_log_without_sync_messages_costs_no_more() {
    let log = ulog(400);
    let starts = messages(&log);
    let mut broken = log.clone();
    broken[starts[300] + 1] ^= 0x10;
    assert_eq!(read(&broken).specific_force.time_s.len() + read(&broken).battery_voltage.time_s.len(), 799);
}

#[test]
fn lost_bytes_and_zeros_are_no_dropouts() {
    let log = with_syncs();
    let starts = messages(&log);
    let (from, to) = (starts[300], starts[400]);
    // Half a second is lost, cut out in the middle of messages, or overwritten.
    let cut = [&log[..from + 5], &log[to + 9..]].concat();
    let fill = |byte: u8| {
        let mut filled = log.clone();
        filled[from + 5..to + 9].fill(byte);
        filled
    };
    for (name, broken) in [("cut", cut), ("zeros", fill(0)), ("ones", fill(0xFF)), ("Os", fill(b'O'))] {
        let flight = read(&broken);
        let said = note(&flight, "damaged in");
        assert!(said.contains("0.5"), "{name}: {said}");
        assert!(!flight.notes.iter().any(|note| note.contains("dropped out")), "{name}: {:?}", flight.notes);
        assert!((347..=350).contains(&flight.specific_force.time_s.len()), "{name}: {:?}", flight.notes);
    }
    // Zeros at the end, as a file that was made larger ahead of its data has them.
    let flight = read(&[&log[..], &[0; 4096]].concat());
    assert!(note(&flight, "the log is cut").contains("last 4096 bytes"));
    assert_eq!(flight.specific_force.time_s.len(), 400);
}

#[test]
fn a_wrong_byte_in_the_definitions_does_not_cost_the_data() {
    let log = with_syncs();
    let starts = messages(&log);
    let mut broken = log.clone();
    // An info message in front of the formats, with a length that reaches into them.
    let info = ulog_message(b'I', b"\x0duint32_t abcd\x01\0\0\0");
    broken.splice(starts[0]..starts[0], info);
    broken[starts[0]] += 40;
    let flight = read(&broken);
    assert_eq!(flight.specific_force.time_s.len(), 400, "{:?}", flight.notes);
}

#[test]
fn real_dropouts_are_said() {
    let log = with_syncs();
    let starts = messages(&log);
    let mut with = log.clone();
    with.splice(starts[300]..starts[300], ulog_message(b'O', &120_u16.to_le_bytes()));
    assert!(note(&read(&with), "dropped out 1 times").contains("0.120 s"));
}

#[test]
fn a_topic_that_is_subscribed_again_stays_one() {
    let log = with_syncs();
    let starts = messages(&log);
    let again = |id: u8, name: &[u8]| ulog_message(b'A', &[&[0, id, 0], name].concat());
    let mut renamed = log[..starts[300]].to_vec();
    renamed.extend([again(7, b"sensor_combined"), again(9, b"battery")].concat());
    for pair in starts[300..].windows(2) {
        let mut message = log[pair[0]..pair[1]].to_vec();
        if message[2] == b'D' {
            message[3] = if message[3] == 1 { 7 } else { 9 };
        }
        renamed.extend(message);
    }
    let flight = read(&renamed);
    assert_eq!(flight.specific_force.time_s.len(), 400, "{:?}", flight.notes);
    assert_eq!(flight.battery_voltage.time_s.len(), 400, "{:?}", flight.notes);
    // The same id once more.
    let mut same = log.clone();
    same.splice(starts[300]..starts[300], again(1, b"sensor_combined"));
    assert_eq!(read(&same).specific_force.time_s.len(), 400);
}
