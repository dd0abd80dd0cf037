//! Flights whose logs lie in several files, part by part.

use crate::support;
use std::cell::RefCell;
use std::collections::BTreeMap;
use std::path::Path;

use flights::{Flight, FlightSet, KnownRotors};
use support::{Motion, Place, bag_of, ulog_of};

const CHANNELS: &str = r#"
time = { columns = ["t"], unit = "s" }
command = { columns = ["m1", "m2", "m3", "m4"], unit = "count" }
position = { columns = ["px", "py", "pz"], unit = "m" }
attitude = { columns = ["qx", "qy", "qz", "qw"] }
angular_velocity = { columns = ["wx", "wy", "wz"], unit = "rad/s" }
specific_force = { columns = ["fx", "fy", "fz"], unit = "m/s^2" }
battery_voltage = { columns = ["v"], unit = "V" }
"#;

/// The rows of the flight from one time to another, with the header.
fn rows(from_s: f64, to_s: f64) -> String {
    let whole = Motion::default().csv();
    let (header, rows) = whole.split_once('\n').unwrap();
    let is_in = |row: &&str| {
        let time_s: f64 = row.split(',').next().unwrap().parse().unwrap();
        (from_s..to_s).contains(&time_s)
    };
    let rows: Vec<&str> = rows.lines().filter(is_in).collect();
    format!("{header}\n{}\n", rows.join("\n"))
}

/// Files, each with its text.
type Texts<'a> = [(&'a str, String)];

/// A flight whose `file` has this value, of `place`.
fn load_at(place: &Place, file: &str, channels: &str, extra: &str) -> Result<Flight, String> {
    let vehicle = Path::new(env!("CARGO_MANIFEST_DIR")).join("../vehicles/hummingbird.toml");
    let text = format!(
        "vehicle = \"{}\"\n[channels]{channels}\n[[flight]]\nname = \"made up\"\nfile = {file}\nrole = \"fit\"\n{extra}\n",
        vehicle.display()
    );
    place.write("flights.toml", text.as_bytes());
    let set = FlightSet::load(&place.path("flights.toml")).map_err(|error| error.to_string());
    set.map(|mut set| set.flights.remove(0))
}

/// The same of a place with these files.
fn load(files: &Texts<'_>, file: &str, channels: &str, extra: &str) -> Result<Flight, String> {
    let place = Place::new();
    files.iter().for_each(|(name, text)| place.write(name, text.as_bytes()));
    load_at(&place, file, channels, extra)
}

fn says(name: &str, refused: Result<Flight, String>, parts: &[&str]) {
    let text = refused.map(|flight| flight.notes).expect_err(name);
    parts.iter().for_each(|part| assert!(text.contains(part), "{name}: `{part}` is not in: {text}"));
    assert!(text.contains("flights.toml:"), "{name}: {text}");
}

fn ab(a: String, b: String) -> [(&'static str, String); 2] {
    [("a.csv", a), ("b.csv", b)]
}

const AB: &str = "[\"a.csv\", \"b.csv\"]";

#[test]
fn parts_without_a_gap_are_the_whole_flight() {
    let whole = load(&[("a.csv", Motion::default().csv())], "\"a.csv\"", CHANNELS, "").unwrap();
    let files = ab(rows(0.0, 4.0), rows(4.0, 99.0));
    let joined = load(&files, AB, CHANNELS, "").unwrap();
    assert_eq!(joined.notes, [""; 0]);
    assert_eq!(joined.position, whole.position);
    assert_eq!((&joined.command, &joined.attitude), (&whole.command, &whole.attitude));
    let names: Vec<_> = joined.files().map(|file| file.file_name().unwrap().to_owned()).collect();
    assert_eq!(names, ["a.csv", "b.csv"]);
    // By a pattern, in the order of their names; a list of one file is that file.
    assert_eq!(load(&files, "[\"*.csv\"]", CHANNELS, "").unwrap().position, whole.position);
    assert_eq!(load(&files[..1], "[\"a.csv\"]", CHANNELS, "").unwrap().position.time_s.len(), 400);
}

#[test]
fn the_time_between_two_parts_is_a_gap_of_all_channels() {
    for missing_s in [0.03, 0.3, 3.0] {
        let files = ab(rows(0.0, 4.0), rows(4.0 + missing_s, 99.0));
        let flight = load(&files, AB, CHANNELS, "").unwrap();
        let between =
            |time_s: &[f64]| time_s.iter().any(|time_s| (3.995..4.0 + missing_s - 0.005).contains(time_s));
        assert!(!between(&flight.position.time_s) && !between(&flight.command.time_s));
        let to_s = 4.0 + missing_s;
        let expected =
            format!("the log has 2 files; nothing was logged between them from 3.990 s to {to_s:.3} s");
        let said = flight.notes.contains(&expected);
        assert!(said, "{:?}", flight.notes);
        let known = KnownRotors::of(&flight);
        assert!(
            known.hold(3.0, 3.9)
                && !known.hold(3.9, 4.0 + missing_s)
                && !known.hold(4.0 + missing_s, 4.2 + missing_s)
        );
        assert!(known.hold(4.6 + missing_s, 9.0));
        let (written, text) = flights::csv(&flight).unwrap();
        let times = text.lines().skip(1).map(|row| row.split(',').next().unwrap().parse::<f64>().unwrap());
        assert!(!between(&times.collect::<Vec<_>>()) && written.rows > 600);
    }
}

#[test]
fn commands_on_change_do_not_hold_from_part_to_part() {
    let files = ab(rows(0.0, 4.0), rows(6.0, 99.0));
    let channels = CHANNELS.replace("unit = \"count\"", "unit = \"count\", on_change = true");
    let flight = load(&files, AB, &channels, "from_s = 1.0").unwrap();
    assert_eq!(flight.command_breaks_s.len(), 1);
    let (from_s, to_s) = flight.command_breaks_s[0];
    assert!((from_s - 2.99).abs() < 1e-9 && (to_s - 5.0).abs() < 1e-9, "{from_s} {to_s}");
    let known = KnownRotors::of(&flight);
    assert!(known.hold(2.0, 2.9) && !known.hold(2.9, 3.1) && !known.hold(5.1, 5.4) && known.hold(5.5, 7.0));
    let whole = load(&files[..1], "\"a.csv\"", &channels, "").unwrap();
    assert!(whole.command_breaks_s.is_empty() && KnownRotors::of(&whole).hold(3.0, 60.0));
}

#[test]
fn parts_that_are_no_parts_of_one_log_are_refused() {
    let refused = |a: String, b: String| load(&ab(a, b), AB, CHANNELS, "");
    says(
        "overlap",
        refused(rows(0.0, 5.0), rows(4.0, 9.0)),
        &[
            "part ",
            "b.csv",
            "after those of ",
            "a.csv",
            "4.990 s",
            "from 4.000 s",
            "the parts overlap",
            "cut one",
        ],
    );
    let order = &["b.csv", "a.csv", "from 0.000 s to 3.990 s", "list the files in the order of time"];
    says("the wrong order", refused(rows(4.0, 9.0), rows(0.0, 4.0)), order);
    says(
        "twice",
        load(&ab(rows(0.0, 4.0), String::new()), "[\"a.csv\", \"a.csv\"]", CHANNELS, ""),
        &["is a copy"],
    );
    let again = Motion { length_unit: 0.5, ..Motion::default() }.csv();
    says("a clock that starts again", refused(rows(0.0, 5.0), again), &["starts again", "a flight of each"]);
    let other = rows(4.0, 9.0).replacen("m1,m2", "m2,m1", 1);
    says(
        "another order",
        refused(rows(0.0, 4.0), other),
        &["b.csv", "`m1` as column 2", "a.csv", "found `m2`", "same columns"],
    );
    let fewer: String =
        rows(4.0, 9.0).lines().map(|row| format!("{}\n", row.rsplit_once(',').unwrap().0)).collect();
    says("a missing column", refused(rows(0.0, 4.0), fewer), &["`sz` as column 29", "found no column"]);
    says("no header", refused(rows(0.0, 4.0), "4,1,2,3\n5,1,2,3\n".to_owned()), &["b.csv", "csv"]);
    says(
        "a missing file",
        load(&ab(rows(0.0, 4.0), String::new()), "[\"a.csv\", \"c.csv\"]", CHANNELS, ""),
        &["c.csv", "cannot read"],
    );
    let ulog = format!("ULog{}", "\u{1}\u{12}5 ");
    says("another format", refused(rows(0.0, 4.0), ulog), &["b.csv", "ulog"]);
    let chosen = load(&ab(rows(0.0, 4.0), rows(4.0, 9.0)), AB, CHANNELS, "recording = 2");
    says("a recording of parts", chosen, &["flight.0.recording", "one `file`", "beside a list"]);
    let whole = format!("{}{}", rows(0.0, 4.0), Motion::default().csv().split_once('\n').unwrap().1);
    says(
        "two recordings in a part",
        refused(whole, rows(4.0, 9.0)),
        &["a.csv", "2 recordings", "cut the file there"],
    );
    says("an empty list", load(&[], "[]", CHANNELS, ""), &["at least one file"]);
    says("a number", load(&[], "3", CHANNELS, ""), &["a list of the files of one log"]);
    says(
        "a pattern without files",
        load(&[], "[\"no*.csv\"]", CHANNELS, ""),
        &["flight.0.file", "none", "pattern"],
    );
}

/// The columns of `text` at these places.
fn columns(text: &str, places: &[usize]) -> String {
    let line = |line: &str| {
        let cells: Vec<&str> = line.split(',').collect();
        places.iter().map(|place| cells[*place]).collect::<Vec<_>>().join(",") + "\n"
    };
    text.lines().map(line).collect()
}

const VOLTAGE: [usize; 2] = [0, 21];
const POSITION: [usize; 4] = [0, 5, 6, 7];

#[test]
fn a_channel_can_have_parts_of_its_own() {
    let files = [
        ("a.csv", Motion::default().csv()),
        ("p1.csv", columns(&rows(0.0, 5.0), &POSITION)),
        ("p2.csv", columns(&rows(5.5, 99.0), &POSITION)),
        ("v.csv", columns(&Motion::default().csv(), &VOLTAGE)),
    ];
    let own = CHANNELS.replace("position = {", "position = { file = [\"p1.csv\", \"p2.csv\"],");
    let own = own.replace("battery_voltage = {", "battery_voltage = { file = \"v.csv\",");
    let flight = load(&files, "\"a.csv\"", &own, "").unwrap();
    assert!(!flight.position.time_s.iter().any(|time_s| (4.995..5.495).contains(time_s)));
    assert_eq!((flight.command.time_s.len(), flight.files().count()), (1001, 4));
    says(
        "an overlap",
        load(&files, "\"a.csv\"", &own.replace("\"p1.csv\", \"p2.csv\"", "\"p2.csv\", \"p1.csv\""), ""),
        &["`position`", "p1.csv", "p2.csv", "in the order of time"],
    );
}

#[test]
fn a_recording_of_a_channels_own_file_is_chosen_beside_it() {
    let voltage = columns(&Motion::default().csv(), &VOLTAGE);
    let again = format!("{voltage}{}", voltage.split_once('\n').unwrap().1.replace("11.", "10."));
    let files = [("a.csv", Motion::default().csv()), ("v.csv", again)];
    let own = |keys: &str| CHANNELS.replace("battery_voltage = {", &format!("battery_voltage = {{ {keys}, "));
    let load = |keys: &str| load(&files, "\"a.csv\"", &own(keys), "");
    says(
        "two",
        load("file = \"v.csv\""),
        &["v.csv", "2 recordings", "`recording` beside the channel's `file`"],
    );
    for (number, first_v) in [(1, 11.1), (2, 10.1)] {
        let flight = load(&format!("file = \"v.csv\", recording = {number}")).unwrap();
        assert_eq!(flight.battery_voltage.values[0][0], first_v);
    }
    says("a third", load("file = \"v.csv\", recording = 3"), &["3 of 2"]);
    says(
        "no file",
        load("recording = 1"),
        &["channels.battery_voltage.recording", "the flight's `recording`"],
    );
    says(
        "a list",
        load("file = [\"v.csv\"], recording = 1"),
        &["channels.battery_voltage.recording", "alone"],
    );
}

#[test]
fn parts_in_other_formats_keep_their_clocks() {
    let place = Place::new();
    let names = |kind: &str| format!("[\"a.{kind}\", \"b.{kind}\"]");
    place.write("whole.mcap", &bag_of(0..600, None));
    place.write("a.mcap", &bag_of(0..300, None));
    place.write("b.mcap", &bag_of(300..600, Some(mcap::Compression::Zstd)));
    let channels = "\nspecific_force = { topic = \"/imu/imu\", unit = \"m/s^2\" }";
    let load = |file: &str| load_at(&place, file, channels, "").unwrap();
    let (whole, joined) = (load("\"whole.mcap\""), load(&names("mcap")));
    assert_eq!(joined.specific_force.values, whole.specific_force.values);
    let apart =
        joined.specific_force.time_s.iter().zip(&whole.specific_force.time_s).map(|(a, b)| (a - b).abs());
    assert!(apart.fold(0.0, f64::max) < 1e-9 && joined.notes == whole.notes, "{:?}", joined.notes);
    place.write("b.mcap", &bag_of(400..600, None));
    let gap = load(&names("mcap")).notes;
    assert!(gap.iter().any(|note| note.contains("from 2.990 s to 4.000 s")), "{gap:?}");

    place.write("whole.ulg", &ulog_of(0..600));
    place.write("a.ulg", &ulog_of(0..300));
    place.write("b.ulg", &ulog_of(300..600));
    let channels = "\nspecific_force = { topic = \"sensor_combined\" }";
    let load = |file: &str| load_at(&place, file, channels, "");
    let (whole, joined) = (load("\"whole.ulg\"").unwrap(), load(&names("ulg")).unwrap());
    assert_eq!((&joined.specific_force, &joined.notes), (&whole.specific_force, &whole.notes));
    let mut cut = ulog_of(300..600);
    cut.truncate(cut.len() - 5);
    place.write("b.ulg", &cut);
    let notes = load(&names("ulg")).unwrap().notes;
    assert!(notes.iter().any(|note| note.contains("b.ulg: the log is cut")), "{notes:?}");
    place.write("b.ulg", &ulog_of(0..300));
    says("a clock that starts again", load(&names("ulg")), &["b.ulg", "starts again in each file"]);
}

#[test]
fn a_topic_has_one_type_in_all_parts() {
    let place = Place::new();
    place.write("a.mcap", &bag_of(0..300, None));
    let mut file = std::io::Cursor::new(Vec::new());
    let mut writer = mcap::Writer::new(&mut file).unwrap();
    let schema = writer.add_schema("other/msg/Imu", "ros2msg", b"float64 x\n").unwrap();
    let channel_id = writer.add_channel(schema, "/imu/imu", "cdr", &BTreeMap::new()).unwrap();
    let ns = 9_000_000_000;
    let header = mcap::records::MessageHeader { channel_id, sequence: 0, log_time: ns, publish_time: ns };
    writer.write_to_known_channel(&header, &[&[0, 1, 0, 0], &1_f64.to_le_bytes()[..]].concat()).unwrap();
    writer.finish().unwrap();
    drop(writer);
    place.write("b.mcap", &file.into_inner());
    let channels = "\nspecific_force = { topic = \"/imu/imu\", fields = \"x\", unit = \"m/s^2\" }";
    let channels =
        channels.replace("\"x\"", "[\"specific_force.x\", \"specific_force.y\", \"specific_force.z\"]");
    let refused = load_at(&place, "[\"a.mcap\", \"b.mcap\"]", &channels, "");
    says("another type", refused, &["b.mcap", "/imu/imu", "found other/msg/Imu", "same columns and types"]);
}

#[test]
fn a_part_of_a_flight_is_not_held_out_from_it() {
    let place = Place::new();
    for (name, text) in ab(rows(0.0, 5.0), rows(5.0, 99.0)) {
        place.write(name, text.as_bytes());
    }
    let vehicle = Path::new(env!("CARGO_MANIFEST_DIR")).join("../vehicles/hummingbird.toml");
    let set = |fit: &str, test: &str| {
        let text = format!(
            "vehicle = \"{}\"\n[channels]{CHANNELS}\n[[flight]]\nname = \"f\"\nrole = \"fit\"\n{fit}\n[[flight]]\n\
             name = \"t\"\nrole = \"test\"\n{test}\n",
            vehicle.display()
        );
        place.write("flights.toml", text.as_bytes());
        FlightSet::load(&place.path("flights.toml")).map_err(|error| error.to_string())
    };
    let refused = set("file = [\"a.csv\", \"b.csv\"]", "file = \"b.csv\"").unwrap_err();
    assert!(refused.contains("not held out") && refused.contains("5.000 s to 10.000 s"), "{refused}");
    let parts = set("file = [\"a.csv\", \"b.csv\"]\nto_s = 6.0", "file = \"b.csv\"\nfrom_s = 2.0").unwrap();
    assert_eq!(parts.flights.len(), 2);
}

#[test]
fn each_part_is_read_once() {
    let reads: RefCell<BTreeMap<String, u32>> = RefCell::default();
    let read = |path: &Path| {
        let name = path.file_name().unwrap().to_string_lossy().into_owned();
        *reads.borrow_mut().entry(name.clone()).or_default() += 1;
        Ok(match name.as_str() {
            "a.csv" => rows(0.0, 5.0).into_bytes(),
            "b.csv" => rows(5.0, 99.0).into_bytes(),
            _ => vehicles::reference::HUMMINGBIRD.into(),
        })
    };
    let own = CHANNELS.replace("position = {", "position = { file = [\"a.csv\", \"b.csv\"],");
    let text = format!(
        "vehicle = \"v.toml\"\n[channels]{own}\n[[flight]]\nname = \"f\"\nrole = \"fit\"\nfile = {AB}\nto_s = 5.0\n\
         [[flight]]\nname = \"t\"\nrole = \"test\"\nfile = {AB}\nfrom_s = 5.0\n"
    );
    let set = FlightSet::parse("flights.toml".as_ref(), text, &read).unwrap();
    assert_eq!(set.flights[1].position.time_s.len(), 501);
    let once = ["a.csv", "b.csv", "v.toml"].map(|name| (name.to_owned(), 1));
    assert_eq!(*reads.borrow(), BTreeMap::from(once));
}
