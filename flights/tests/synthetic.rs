//! Made-up logs of every format: the flights that are read from them, and the errors for wrong ones.

use crate::support::made::{CHANNELS, changed, read, read_text, refused};
use crate::support::{self, Motion, Place, crc32};
use flights::{Flight, FlightSet, FlightsError};
use nalgebra::{Quaternion, UnitQuaternion};

#[test]
fn a_plain_flight_is_read_without_notes() {
    let flight = read(&Motion::default(), CHANNELS, "").unwrap();
    assert_eq!(flight.notes, [""; 0]);
    assert_eq!(flight.attitude.time_s.len(), 1001);
    assert_eq!(flight.command.values[7][..4], [100.0, 101.0, 102.0, 103.0]);
    assert!(
        (flight.attitude.values[0][0] - 1.0).abs() < 0.03,
        "w comes first: {:?}",
        flight.attitude.values[0]
    );
}

#[test]
fn the_part_and_the_delay_move_the_clock() {
    let extra = "from_s = 2.0\nto_s = 3.0\ndelay_s = { position = 0.05 }";
    let flight = read(&Motion::default(), CHANNELS, extra).unwrap();
    let whole = read(&Motion::default(), CHANNELS, "").unwrap();
    assert_eq!(flight.velocity.values.first(), whole.velocity.values.get(200));
    assert!(flight.velocity.time_s[0].abs() < 1e-9 && flight.velocity.span_s().unwrap().1 < 1.0 + 1e-9);
    // The sample stamped 2.05 s was true at 2 s.
    assert_eq!(flight.position.values.first(), whole.position.values.get(205));
    assert_eq!((flight.position.time_s[0], flight.position.time_s.len()), (0.0, 101));
    assert_eq!(flight.command.time_s[0], 0.0);
}

#[test]
fn a_gyroscope_in_whole_degrees_loses_no_sample() {
    let degree = 1_f64.to_radians();
    let coarse = changed("wx", 3, |_, rates| {
        rates.iter_mut().for_each(|rate| *rate = (*rate / degree).round() * degree);
    });
    let flight = read_text(&coarse).unwrap();
    let repeats = flight.angular_velocity.values.windows(2).filter(|pair| pair[0] == pair[1]).count();
    assert!(repeats > 100, "{repeats}: the case is none");
    assert_eq!((flight.angular_velocity.time_s.len(), &flight.notes[..]), (1001, &[][..]));
}

#[test]
fn an_attitude_that_stays_while_the_gyroscope_turns_is_refused() {
    let stays = |from: usize| {
        changed("qx", 4, move |row, q| {
            if row >= from {
                q.copy_from_slice(&[0.0, 0.0, 0.0, 1.0]);
            }
        })
    };
    // Three samples behind the jump are left out.
    for (text, from_s) in [(stays(0), "0.000 s"), (stays(400), "4.030 s")] {
        let message = read_text(&text).unwrap_err().to_string();
        let said =
            format!("`attitude`: it stays the same from {from_s} to 10.000 s, while the gyroscope turns by");
        assert!(message.contains(&said), "{message}");
    }
}

/// One flipped bit in a log of a thousand samples costs that sample.
#[test]
fn lone_wild_samples_are_left_out_and_said() {
    for (first, name, wild) in [
        ("wx", "angular_velocity", 1e30),
        ("wy", "angular_velocity", -35.0),
        ("vx", "velocity", 1e12),
        ("pz", "position", 1e15),
        ("fz", "specific_force", -1e20),
        ("m1", "command", 1e9),
        ("v", "battery_voltage", 1e6),
    ] {
        let text = changed(first, 1, |row, numbers| {
            if row == 400 {
                numbers[0] = wild;
            }
        });
        let flight = read_text(&text).unwrap_or_else(|error| panic!("{first}: {error}"));
        let note = format!(
            "{name}: 1 of 1001 samples are far from the samples before and after them, first at 4.000 s"
        );
        assert!(flight.notes.len() == 1 && flight.notes[0].starts_with(&note), "{first}: {:?}", flight.notes);
    }
}

/// The gyroscope of another clock, as in a second file or from another computer.
#[test]
fn a_gyroscope_on_another_clock_is_refused_with_its_delay() {
    let of = |late_s: f64| {
        let whole = Motion::default().csv();
        let (header, rows) = whole.split_once('\n').unwrap();
        let late = |row: &str| {
            let (time, rest) = row.split_once(',').unwrap();
            format!("{},{rest}\n", time.parse::<f64>().unwrap() + late_s)
        };
        let place = Place::new();
        place.write("log.csv", whole.as_bytes());
        let other: String = rows.lines().map(late).collect();
        place.write("imu.csv", format!("{header}\n{other}").as_bytes());
        let channels =
            CHANNELS.replace("[\"wx\", \"wy\", \"wz\"]", "[\"wx\", \"wy\", \"wz\"], file = \"imu.csv\"");
        place.load("log.csv", &channels, "").map(|flight| flight.notes).map_err(|error| error.to_string())
    };
    for late_s in [0.3, 0.6, -0.25, -1.0] {
        let error = of(late_s).unwrap_err();
        let fits =
            error.split_once("`delay_s = { angular_velocity = ").unwrap_or_else(|| panic!("{error}")).1;
        let delay_s: f64 = fits.split(' ').next().unwrap().parse().unwrap();
        let side = if late_s < 0.0 { "s early: the clocks of the two differ" } else { "s late: the clocks" };
        assert!((delay_s - late_s).abs() < 0.03 && error.contains(side), "{error}");
    }
    assert_eq!(of(0.0).unwrap(), [""; 0]);
}

#[test]
fn wrong_files_are_refused_with_line_and_advice() {
    let said = |text: String, parts: &[&str]| {
        parts.iter().for_each(|part| assert!(text.contains(part), "`{part}` is not in: {text}"));
    };
    said(
        refused(&CHANNELS.replace("\"px\"", "\"qq\""), ""),
        &["flights.toml:5:", "no column `qq`", "it has t, m1"],
    );
    said(
        refused(&CHANNELS.replace("\"m\" ", "\"ft\" "), ""),
        &["flights.toml:5:", "\"ft\"", "\"mm\"", "write one of these"],
    );
    said(refused(&CHANNELS.replace("position", "positon"), ""), &["flights.toml:5:", "positon", "position"]);
    said(refused(&CHANNELS.replace("time =", "# time ="), ""), &["no channel `time`", "add `time"]);
    said(
        refused(&CHANNELS.replace("[\"px\", \"py\", ", "[\"py\", "), ""),
        &["`columns`: expected 3 names, or that of an array, found 2"],
    );
    said(
        refused(&CHANNELS.replace("[\"px\", \"py\", ", "["), ""),
        &["line 2, column `pz`: expected an array", "found `1`", "name a column for each number"],
    );
    said(refused(CHANNELS, "from_s = 3\nto_s = 2"), &["flights.toml:", "`flight.0.to_s`", "found 2"]);
    said(refused(CHANNELS, "from_s = 300"), &["from 300 s on, found none", "set `from_s` and `to_s`"]);
    said(refused(CHANNELS, "format = \"ulog\""), &["no ULog", "check `format`"]);
    said(refused(CHANNELS, "format = \"crazyflie\""), &["no Crazyflie log", "check `format`"]);
    said(refused(CHANNELS, "format = \"mcap\""), &["cannot be read as MCAP", "check `format`"]);
    said(refused(CHANNELS, "assume = \"hover\""), &["flight.assume", "has both"]);
    said(refused(CHANNELS, "extra = 1"), &["extra`", "unknown key"]);
}

/// The made-up flight with its position and attitude in arrays.
fn with_arrays(delimiter: &str, position: &str, attitude: &str) -> String {
    let row = |line: &str| {
        let cells: Vec<&str> = line.split(',').collect();
        let mut row = cells[..5].to_vec();
        let position = position.replace("{}", &cells[5..8].join(", "));
        let attitude = attitude.replace("{}", &cells[11..15].join(" "));
        row.extend([position.as_str(), attitude.as_str(), cells[8]]);
        row.join(delimiter) + "\n"
    };
    let header = ["t", "m1", "m2", "m3", "m4", "p", "q", "vx"].join(delimiter) + "\n";
    header + &Motion::default().csv().lines().skip(1).map(row).collect::<String>()
}

const ARRAYS: &str = r#"
time = { columns = ["t"], unit = "s" }
command = { columns = ["m1", "m2", "m3", "m4"], unit = "count" }
position = { columns = ["p[0]", "p[1]", "p[2]"], unit = "m" }
attitude = { columns = ["q"] }
"#;

#[test]
fn cells_may_hold_arrays() {
    let plain = read(&Motion::default(), CHANNELS, "").unwrap();
    let place = Place::new();
    for (delimiter, position) in [(",", "\"[{}]\""), (";", "[{}]"), ("\t", "({})")] {
        place.write("log.csv", with_arrays(delimiter, position, "[{}]").as_bytes());
        for whole in [ARRAYS.to_owned(), ARRAYS.replace("\"p[0]\", \"p[1]\", \"p[2]\"", "\"p\"")] {
            let flight = place.load("log.csv", &whole, "").unwrap();
            assert_eq!((&flight.position, &flight.attitude), (&plain.position, &plain.attitude));
            assert_eq!(flight.notes, [""; 0]);
        }
    }
}

/// The made-up flight with the rotation matrix of its attitude in a cell, its rows in arrays.
fn with_matrices() -> String {
    let row = |line: &str| {
        let cells: Vec<f64> = line.split(',').map(|cell| cell.parse().unwrap()).collect();
        let q = Quaternion::new(cells[14], cells[11], cells[12], cells[13]);
        let matrix = UnitQuaternion::from_quaternion(q).to_rotation_matrix();
        let of_row = |row: usize| {
            let [x, y, z] = [0, 1, 2].map(|column| matrix[(row, column)]);
            format!("[{x}, {y}, {z}]")
        };
        let command = cells[..5].iter().map(f64::to_string).collect::<Vec<_>>().join(",");
        format!("{command},\"[{}, {}, {}]\"\n", of_row(0), of_row(1), of_row(2))
    };
    "t,m1,m2,m3,m4,R\n".to_owned() + &Motion::default().csv().lines().skip(1).map(row).collect::<String>()
}

#[test]
fn a_cell_may_hold_a_matrix_as_arrays_in_an_array() {
    let plain = read(&Motion::default(), CHANNELS, "").unwrap().attitude;
    let place = Place::new();
    place.write("log.csv", with_matrices().as_bytes());
    let channels = |names: &str| {
        let kept = ARRAYS.lines().filter(|line| line.starts_with("time") || line.starts_with("command"));
        let kept: String = kept.map(|line| format!("{line}\n")).collect();
        format!("{kept}attitude = {{ matrix = [{names}] }}\n")
    };
    let part = |index: usize| format!("\"R[{}][{}]\"", index / 3, index % 3);
    let parts: Vec<String> = (0..9).map(part).collect();
    for names in ["\"R\"".to_owned(), parts.join(", ")] {
        let attitude = place.load("log.csv", &channels(&names), "").unwrap().attitude;
        assert_eq!(attitude.values.len(), plain.values.len(), "{names}");
        for (a, b) in attitude.values.iter().zip(&plain.values) {
            assert!(a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>().abs() > 1.0 - 1e-9, "{a:?} {b:?}");
        }
    }
    let refused =
        |names: &[String]| place.load("log.csv", &channels(&names.join(", ")), "").unwrap_err().to_string();
    let beyond = [&parts[..8], &["\"R[2][3]\"".to_owned()]].concat();
    let error = refused(&beyond);
    assert!(
        error.contains("line 2, column `R`: expected arrays in an array")
            && error.contains("a number [2][3], found `[["),
        "{error}"
    );
    let flat = [&parts[..8], &["\"R[9]\"".to_owned()]].concat();
    assert!(refused(&flat).contains("expected an array of more than 9 numbers"));
}

#[test]
fn wrong_arrays_are_refused_with_line_and_column() {
    let place = Place::new();
    let said = |text: &str, channels: &str, parts: &[&str]| {
        place.write("log.csv", text.as_bytes());
        let found = place.load("log.csv", channels, "").unwrap_err().to_string();
        parts.iter().for_each(|part| assert!(found.contains(part), "`{part}` is not in: {found}"));
    };
    let good = with_arrays(";", "[{}]", "[{}]");
    let mut lines: Vec<String> = good.lines().map(str::to_owned).collect();
    let cut = lines[7].find(']').unwrap();
    lines[7].remove(cut);
    said(
        &lines.join("\n"),
        ARRAYS,
        &["flights.toml:5:", "line 8, column `p`", "an array", "found `[", "correct"],
    );
    said(&good, &ARRAYS.replace("p[2]", "p[3]"), &["line 2, column `p`", "more than 3 numbers"]);
    said(&good, &ARRAYS.replace("p[2]", "r[2]"), &["no column `r[2]`", "it has t, m1"]);
    said(&with_arrays(",", "[{}]", "[{}]"), ARRAYS, &["line 2, column `p`", "in quotation marks"]);
    // A cell without anything is a sample that is left out.
    let mut lines: Vec<String> = good.lines().map(str::to_owned).collect();
    let (from, to) = (lines[7].find('[').unwrap(), lines[7].find(']').unwrap());
    lines[7].replace_range(from..=to, "");
    place.write("log.csv", lines.join("\n").as_bytes());
    let notes = place.load("log.csv", ARRAYS, "").unwrap().notes;
    assert_eq!(notes, ["position: 1 of 1001 samples have no finite number; left out"]);
}

#[test]
fn all_faults_are_told_at_once() {
    let channels = CHANNELS.replace("\"px\"", "\"qq\"").replace("\"wx\"", "\"rr\"");
    let text = refused(&channels, "");
    assert!(text.contains("no column `qq`") && text.contains("no column `rr`"), "{text}");
    let text = refused(CHANNELS, "from_s = 3\nto_s = 2\ndelay_s = { position = inf }");
    assert!(text.contains("`flight.0.to_s`") && text.contains("`flight.0.delay_s.position`"), "{text}");
}

#[test]
fn bad_cells_and_times_are_counted() {
    let place = Place::new();
    let mut lines: Vec<String> = Motion::default().csv().lines().map(str::to_owned).collect();
    lines[5] = lines[5].replacen(',', ",nonsense", 1);
    lines[9] = lines[8].clone();
    lines[20] = "0.19".to_owned();
    place.write("log.csv", lines.join("\n").as_bytes());
    let flight = place.load("log.csv", CHANNELS, "").unwrap();
    let has = |text: &str| {
        assert!(flight.notes.iter().any(|note| note.contains(text)), "{text}: {:?}", flight.notes)
    };
    has("command: 2 of 1001 samples have no finite number");
    let others = "attitude, position, velocity, angular_velocity, specific_force, battery_voltage";
    has(&format!("{others}: 1 of 1001 samples have no finite number"));
    has(&format!("{others}: 1 of 1000 samples have a time that does not increase"));
}

#[test]
fn nothing_left_is_an_error() {
    let place = Place::new();
    for log in ["", "t", "t,m1,m2,m3,m4,px,py,pz,vx,vy,vz,qx,qy,qz,qw,wx,wy,wz,fx,fy,fz,v\nx,x,x"] {
        place.write("log.csv", log.as_bytes());
        let error = place.load("log.csv", CHANNELS, "").unwrap_err().to_string();
        assert!(error.contains("flights.toml:"), "{error}");
    }
}

#[test]
fn the_canonical_file_derives_what_was_not_logged() {
    let channels: String = CHANNELS
        .lines()
        .filter(|line| !line.starts_with("velocity") && !line.starts_with("angular"))
        .map(|line| line.to_owned() + "\n")
        .collect();
    let motion = Motion::default();
    let flight = read(&motion, &channels, "").unwrap();
    let whole = read(&motion, CHANNELS, "").unwrap();
    let place = Place::new();
    let path = place.path("flight.csv");
    let written = flights::write_csv(&flight, &path).unwrap();
    assert_eq!((written.rows, written.notes.len()), (1001, 3), "{:?}", written.notes);
    // Its own column map reads it again.
    let again = place.load("flight.csv", &format!("\n{}", flights::columns(&flight)), "").unwrap();
    for (a, b) in again.velocity.values.iter().zip(&whole.velocity.values) {
        assert!(a.iter().zip(b).all(|(a, b)| (a - b).abs() < 2e-3), "{a:?} {b:?}");
    }
    for (a, b) in again.angular_velocity.values.iter().zip(&whole.angular_velocity.values) {
        assert!(a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-2), "{a:?} {b:?}");
    }
    assert_eq!(again.position.values, whole.position.values);
}

#[test]
fn rows_in_gaps_are_left_out_of_the_canonical_file() {
    let place = Place::new();
    let motion = Motion::default().csv();
    let blanked = motion.lines().enumerate().map(|(row, line)| {
        // From 3 s to 4 s the capture sees nothing.
        let mut cells: Vec<&str> = line.split(',').collect();
        if (301..=400).contains(&row) {
            cells[5..11].fill("");
        }
        cells.join(",") + "\n"
    });
    place.write("log.csv", blanked.collect::<String>().as_bytes());
    let flight = place.load("log.csv", CHANNELS, "").unwrap();
    assert!(
        flight.notes.iter().any(|note| note.contains("position, velocity: 1 gaps")),
        "{:?}",
        flight.notes
    );
    let written = flights::write_csv(&flight, &place.path("flight.csv")).unwrap();
    assert_eq!(written.rows, 901);
    assert!(written.notes.iter().any(|note| note.contains("100 of 1001 rows")), "{:?}", written.notes);
}

const CRAZYFLIE: &str = r#"
command = { fields = ["motor.m1", "motor.m2", "motor.m3", "motor.m4"], unit = "count" }
specific_force = { fields = ["acc.x", "acc.y", "acc.z"], unit = "g" }
battery_voltage = { fields = ["pm.vbatMV"], unit = "mV" }
"#;

#[test]
fn a_crazyflie_log_is_read() {
    let place = Place::new();
    let log = support::crazyflie_log(200);
    place.write("log00", &log);
    let flight = place.load("log00", CRAZYFLIE, "").unwrap();
    assert_eq!(flight.command.values[3][..4], [10.0, 20.0, 30.0, 40.0]);
    assert!((flight.specific_force.values[0][2] - 9.80665).abs() < 1e-6);
    assert_eq!(flight.battery_voltage.values[0], [3.7]);
    assert!((flight.command.time_s[3] - 0.03).abs() < 1e-9);
}

/// Reads `log` as a Crazyflie's, by its first bytes.
fn crazyflie(log: &[u8]) -> Result<Flight, FlightsError> {
    let place = Place::new();
    place.write("log00", log);
    place.load("log00", CRAZYFLIE, "trust_units = true")
}

#[test]
fn a_crazyflie_log_is_read_as_far_as_it_goes() {
    let log = support::crazyflie_log(200);
    let record = 2 + 8 + 29;
    let start = log.len() - 4 - 200 * record;
    let said = |flight: &Flight, part: &str| {
        assert!(flight.notes.iter().any(|note| note.contains(part)), "`{part}`: {:?}", flight.notes);
    };
    for (cut, records) in [(2, 200), (14, 199), (4 + record, 199), (4 + record + 1, 198), (700, 182)] {
        let flight = crazyflie(&log[..log.len() - cut]).unwrap();
        assert_eq!(flight.command.time_s.len(), records, "{cut}: {:?}", flight.notes);
        said(&flight, &format!("cut or damaged; {records} records were read"));
    }
    // Cut, with a checksum that fits.
    let mut cut = log[..log.len() - 10].to_vec();
    cut.extend(crc32(&cut).to_le_bytes());
    said(&crazyflie(&cut).unwrap(), "33 bytes of the log belong to no record");
    // A wrong event, a wrong byte in a value, and bytes that are missing, all in the middle.
    let mut broken = log.clone();
    broken[start + 100 * record] = 7;
    let flight = crazyflie(&broken).unwrap();
    assert_eq!(flight.command.time_s.len(), 199);
    said(&flight, "199 records were read, 43 bytes outside of records were left out");
    let mut broken = log.clone();
    broken[start + 100 * record + 10] ^= 1;
    said(&crazyflie(&broken).unwrap(), "200 records were read, 0 bytes");
    let missing = [&log[..start + 100 * record + 20], &log[start + 120 * record + 7..]].concat();
    let flight = crazyflie(&missing).unwrap();
    assert!((178..=180).contains(&flight.command.time_s.len()), "{:?}", flight.notes);
    // Nothing is left of it.
    let error = crazyflie(&log[..start + 10]).unwrap_err().to_string();
    assert!(error.contains("none of 0"), "{error}");
    let error = crazyflie(&log[..start - 10]).unwrap_err().to_string();
    assert!(error.contains("a whole header") && error.contains("copy the log"), "{error}");
}

#[test]
fn a_crazyflie_log_of_another_version_is_named_without_its_format() {
    for version in [1, 3] {
        let mut log = support::crazyflie_log(20);
        log[1] = version;
        let error = crazyflie(&log).unwrap_err().to_string();
        for part in ["a log of version 2", &format!("found version {version}"), "newer firmware"] {
            assert!(error.contains(part), "`{part}` is not in: {error}");
        }
    }
}

const ULOG: &str = r#"
specific_force = { topic = "sensor_combined" }
battery_voltage = { topic = "battery", fields = ["cell[1].volts"], unit = "V" }
"#;

#[test]
fn a_ulog_is_read_to_where_it_was_cut() {
    let place = Place::new();
    let log = support::ulog(100);
    place.write("log.ulg", &log);
    let flight = place.load("log.ulg", ULOG, "").unwrap();
    assert_eq!(flight.specific_force.time_s.len(), 100);
    assert!((flight.specific_force.values[0][2] - 9.8).abs() < 1e-6, "{:?}", flight.specific_force.values[0]);
    assert_eq!(flight.battery_voltage.values[0], [4.0]);
    place.write("log.ulg", &log[..log.len() - 50]);
    let flight = place.load("log.ulg", ULOG, "").unwrap();
    assert!(flight.specific_force.time_s.len() < 100);
    assert!(flight.notes.iter().any(|note| note.contains("the log is cut")), "{:?}", flight.notes);
    let error =
        place.load("log.ulg", &ULOG.replace("sensor_combined", "sensors"), "").unwrap_err().to_string();
    assert!(error.contains("no topic `sensors`") && error.contains("battery"), "{error}");
}

#[test]
fn a_recording_of_ours_needs_no_channels() {
    let place = Place::new();
    support::recording(&place.path("log.mcap"), 200);
    let flight = place.load("log.mcap", "", "").unwrap();
    assert_eq!(flight.command.values[0][..4], [100.0, 101.0, 102.0, 103.0]);
    assert!((flight.specific_force.values[5][2] - 9.81).abs() < 0.1);
    assert!(flight.notes.iter().any(|note| note.contains("command: taken from /control/command")));
    assert_eq!(flight.angular_velocity.time_s.len(), 200);
}

#[test]
fn standard_messages_of_a_bag_are_read_by_topic_and_header() {
    let place = Place::new();
    support::recording(&place.path("log.mcap"), 200);
    let channels = "battery_voltage = { topic = \"/battery\" }\ncommand = { topic = \"/control/command\" }";
    let flight = place.load("log.mcap", channels, "").unwrap();
    // Behind constants, and with the header's stamp, which is 0.1 s after the log's time.
    assert_eq!(
        flight.battery_voltage.values,
        vec![[15.5]; 200].into_iter().take(flight.battery_voltage.values.len()).collect::<Vec<_>>()
    );
    assert!(flight.notes.iter().any(|note| note.contains("stamp")), "{:?}", flight.notes);
    let wrong = place.load("log.mcap", "position = { topic = \"/battery\" }", "").unwrap_err().to_string();
    assert!(wrong.contains("BatteryState") && wrong.contains("add `fields`"), "{wrong}");
}

mod mutated {
    use super::*;
    use proptest::prelude::*;

    fn mutate(
        mut bytes: Vec<u8>,
        changes: &[(prop::sample::Index, u8)],
        cut: prop::sample::Index,
    ) -> Vec<u8> {
        for (index, byte) in changes {
            let index = index.index(bytes.len());
            bytes[index] = *byte;
        }
        bytes.truncate(cut.index(bytes.len()) + bytes.len() / 2);
        bytes
    }

    fn changes() -> impl Strategy<Value = Vec<(prop::sample::Index, u8)>> {
        prop::collection::vec(any::<(prop::sample::Index, u8)>(), 0..8)
    }

    proptest! {
        #![proptest_config(ProptestConfig { cases: 200, failure_persistence: None, ..ProptestConfig::default() })]

        #[test]
        fn crazyflie_logs_never_panic(changes in changes(), cut: prop::sample::Index) {
            let place = Place::new();
            let mut log = mutate(support::crazyflie_log(20), &changes, cut);
            log.extend(crc32(&log).to_le_bytes());
            place.write("log00", &log);
            let _ = place.load("log00", CRAZYFLIE, "format = \"crazyflie\"");
        }

        #[test]
        fn ulogs_never_panic(changes in changes(), cut: prop::sample::Index) {
            let place = Place::new();
            place.write("log.ulg", &mutate(support::ulog(20), &changes, cut));
            let _ = place.load("log.ulg", ULOG, "format = \"ulog\"");
        }

        #[test]
        fn bags_never_panic(changes in changes(), cut: prop::sample::Index) {
            let place = Place::new();
            support::recording(&place.path("whole.mcap"), 5);
            let log = std::fs::read(place.path("whole.mcap")).unwrap();
            place.write("log.mcap", &mutate(log, &changes, cut));
            let _ = place.load("log.mcap", "", "format = \"mcap\"");
        }

        #[test]
        fn flights_files_never_panic(changes in changes(), cut: prop::sample::Index) {
            let place = Place::new();
            let text = format!("vehicle = \"v.toml\"\n[channels]\n{CHANNELS}\n[[flight]]\nname = \"a\"\nfile = \"b\"\n");
            place.write("flights.toml", &mutate(text.into_bytes(), &changes, cut));
            prop_assert!(FlightSet::load(&place.path("flights.toml")).is_err());
        }
    }
}
