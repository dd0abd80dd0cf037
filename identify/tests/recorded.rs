//! Stands whose logs are recordings: read by field in the units that they state, and refused in words.

use std::fs;
use std::path::{Path, PathBuf};

use component::announcement::Announcement;
use component::messages::SetPoint;
use component::{Harness, Message};
use identify::rotor::{self, Found, RotorError};
use plant::propeller_stand::{PropellerStand, RotorLoad};
use recorder::writer::RecordingWriter;
use serde_json::json;
use tempfile::TempDir;

const STATIC: &str = r#"
[[static]]
file = "stand.mcap"
topic = "/stand/load"
held_out = 0.3
speed = { field = "rotor_speed", unit = "rad/s" }
thrust = { field = "thrust", unit = "N" }
torque = { field = "drag_torque", unit = "N*m" }
"#;

const DYNAMIC: &str = r#"
[[dynamic]]
file = "stand.mcap"
topic = "/stand/load"
held_out = 0.3
after_s = 1.0
speed = { field = "rotor_speed", unit = "rad/s" }
command = { field = "rotor_speed_commanded", unit = "rad/s" }
"#;

const VEHICLE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../vehicles/hummingbird.toml");

/// Returns the stand's readings of rotor `number`: two seconds at rest, then eight speeds for three seconds each.
fn loads(number: usize) -> Vec<RotorLoad> {
    let rpm = [1500.0, 3900.0, 2600.0, 5000.0, 3900.0, 6500.0, 3200.0, 4500.0];
    let speeds: Vec<_> = rpm
        .iter()
        .zip(0..)
        .map(|(rpm, leg)| json!({ "at_s": 2.0 + 3.0 * f64::from(leg), "to_rpm": rpm }))
        .collect();
    let parameters = json!({ "vehicle": VEHICLE, "rotor": number, "speeds": speeds });
    let mut stand = Harness::<PropellerStand>::from_json(&parameters).unwrap();
    (0..26_000).map(|_| stand.step(()).unwrap().load).collect()
}

/// A folder with a stand file and its recording.
struct Stand {
    folder: TempDir,
}

impl Stand {
    fn new(tables: &str) -> Self {
        let stand = Self { folder: tempfile::tempdir().unwrap() };
        fs::write(stand.path("stand.toml"), format!("name = \"recorded\"\nvehicle = {VEHICLE:?}\n{tables}"))
            .unwrap();
        stand
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn run(&self) -> Result<Found, RotorError> {
        rotor::run(&self.path("stand.toml"))
    }

    fn refusal(&self) -> String {
        self.run().map(|found| found.tables).unwrap_err().to_string()
    }
}

/// Records loads on topics, with a topic that is something else beside.
fn record(path: &Path, of_topics: &[(&str, &[RotorLoad])]) {
    let mut writer = RecordingWriter::create(path).unwrap();
    writer.add_channel("/pilot/set_point", &Announcement::of(SetPoint::SCHEMA)).unwrap();
    for (topic, loads) in of_topics {
        let channel = writer.add_channel(topic, &Announcement::of(RotorLoad::SCHEMA)).unwrap();
        for (tick, load) in (0..).zip(*loads) {
            let cdr = [&[0, 1, 0, 0], bytemuck::bytes_of(load)].concat();
            writer.write(channel, tick, u64::from(tick) * 1_000_000, &cdr).unwrap();
        }
    }
    writer.finish().unwrap();
}

fn recorded(tables: &str, loads: &[RotorLoad]) -> Stand {
    let stand = Stand::new(tables);
    record(&stand.path("stand.mcap"), &[("/stand/load", loads)]);
    stand
}

/// The refusal of a stand file in which `from` is `to`, of a recording without much in it.
fn refused(tables: &str, from: &str, to: &str) -> String {
    assert!(tables.contains(from), "{from}");
    recorded(&tables.replace(from, to), &[RotorLoad::default(); 10]).refusal()
}

#[track_caller]
fn require_said(message: &str, parts: &[&str]) {
    parts.iter().for_each(|part| assert!(message.contains(part), "no {part:?} in: {message}"));
}

#[test]
fn a_recording_of_either_rotor_gives_the_vehicles_constants() {
    let declared = vehicles::Vehicle::load(Path::new(VEHICLE)).unwrap();
    let mount = STATIC.replace("drag_torque", "mount_torque");
    for (rotor, tables) in [(1, STATIC), (2, &mount)] {
        let found = recorded(&(tables.to_owned() + DYNAMIC), &loads(rotor)).run().unwrap();
        let (statics, dynamics) = (found.report.statics.unwrap(), found.report.dynamics.unwrap());
        let c_t = statics.thrust.unwrap().value.value;
        let c_q = statics.torque.unwrap().value.value;
        assert!((c_t / declared.thrust_coefficient - 1.0).abs() < 1e-12, "{c_t}");
        // The mount also feels the rotor speed up and slow down.
        let near = if rotor == 1 { 1e-12 } else { 1e-3 };
        assert!((c_q / declared.torque_coefficient - 1.0).abs() < near, "{c_q}");
        let has_outliers = statics.findings.iter().any(|finding| finding.contains("outliers"));
        assert_eq!(has_outliers, rotor == 2, "{:?}", statics.findings);
        assert_eq!(dynamics.comparison.preferred, rotor::Order::Second);
        assert!(
            dynamics.command.is_none() && dynamics.holds.is_empty(),
            "a speed is no command of a vehicle"
        );
        let tables: toml::Table = found.tables.parse().unwrap();
        assert_eq!(tables["command"]["max"]["value"].as_float(), Some(declared.command.max));
    }
}

#[test]
fn what_is_not_in_a_recording_is_named_with_what_is() {
    let topic = refused(STATIC, "/stand/load", "/stand/loads");
    require_said(
        &topic,
        &["stand.mcap", "no topic /stand/loads", "/pilot/set_point, /stand/load", "`topic`"],
    );
    let field = refused(DYNAMIC, "\"rotor_speed\"", "\"speed\"");
    require_said(
        &field,
        &["stand.mcap", "/stand/load has no field `speed`", "rotor_speed_commanded, rotor_speed, thrust"],
    );
}

#[test]
fn a_unit_that_contradicts_the_recording_is_refused() {
    let thrust = refused(STATIC, "\"N\"", "\"gf\"");
    require_said(
        &thrust,
        &["stand.mcap", "`thrust` of /stand/load", "recorded in N", "says gf", "`thrust.unit`"],
    );
    let command = refused(DYNAMIC, "commanded\", unit = \"rad/s\"", "commanded\", unit = \"%\"");
    require_said(&command, &["recorded in rad/s", "says %", "`command.unit`"]);
    // Of another quantity, whatever is recorded.
    let torque = refused(STATIC, "\"N*m\"", "\"N\"");
    require_said(&torque, &["stand.toml", "`static.0.torque.unit`", "\"N*m\"", "found N"]);
    // A field of another quantity than the key.
    let swapped = refused(STATIC, "field = \"thrust\"", "field = \"rotor_speed\"");
    require_said(&swapped, &["`rotor_speed` of /stand/load", "recorded in rad/s", "says N"]);
}

#[test]
fn a_stand_file_that_mixes_tables_and_recordings_is_refused() {
    let column = refused(STATIC, "field = \"thrust\"", "column = \"thrust\"");
    require_said(&column, &["`static.0.thrust.column`", "give `field`"]);
    let neither = refused(STATIC, "field = \"thrust\", ", "");
    require_said(&neither, &["`static.0.thrust.field`", "a field of /stand/load"]);
    let time = refused(STATIC, "speed =", "time = { field = \"stamp.sec\", unit = \"s\" }\nspeed =");
    require_said(&time, &["`static.0.time`", "leave it out"]);
    let no_topic = refused(DYNAMIC, "topic = \"/stand/load\"\n", "");
    require_said(&no_topic, &["`dynamic.0.speed.field`", "`topic` of a recording", "`dynamic.0.time`"]);
    let table = "[[static]]\nfile = \"stand.mcap\"\ntime = { column = \"t\", unit = \"s\" }\n\
                 speed = { column = \"w\", unit = \"rad/s\" }\nthrust = { column = \"T\", unit = \"N\" }\n";
    require_said(&refused(table, "\"w\"", "\"w\""), &["stand.mcap", "a table, found a recording", "`topic`"]);
}

#[test]
fn files_that_are_no_recording_or_an_empty_one_end_in_words() {
    let stand = recorded(STATIC, &[]);
    require_said(&stand.refusal(), &["stand.mcap: /stand/load", "expected samples, found none"]);
    let whole = fs::read(stand.path("stand.mcap")).unwrap();
    let with = |bytes: &[u8]| {
        fs::write(stand.path("stand.mcap"), bytes).unwrap();
        stand.refusal()
    };
    require_said(&with(b""), &["stand.mcap", "not a complete MCAP file"]);
    require_said(&with(b"time,speed\n0,0\n"), &["stand.mcap", "expected the magic bytes"]);
    require_said(&with(&whole[..whole.len() / 2]), &["stand.mcap", "not a complete MCAP file"]);
    fs::remove_file(stand.path("stand.mcap")).unwrap();
    require_said(&stand.refusal(), &["stand.mcap", "cannot read this file", "check the path"]);
    let short = recorded(DYNAMIC, &[RotorLoad::default()]);
    require_said(&short.refusal(), &["stand.mcap", "too few"]);
}

#[test]
fn a_recording_that_is_fitted_on_is_not_tested_on_but_its_other_topics_may_be() {
    let test = STATIC.replace("held_out = 0.3", "role = \"test\"");
    let same = recorded(&(STATIC.to_owned() + &test), &loads(1)).refusal();
    require_said(&same, &["role \"test\"", "the same file"]);
    let copy = Stand::new(&(STATIC.to_owned() + &test.replace("stand.mcap", "other.mcap")));
    let (first, second) = (loads(1), loads(2));
    record(&copy.path("stand.mcap"), &[("/stand/load", &first)]);
    record(&copy.path("other.mcap"), &[("/stand/load", &first[1..])]);
    require_said(&copy.refusal(), &["other.mcap", "rows are the same"]);
    let tables = (STATIC.to_owned() + &test.replace("/stand/load", "/spare/load")).replace("drag", "mount");
    let two = Stand::new(&tables);
    record(&two.path("stand.mcap"), &[("/stand/load", &first), ("/spare/load", &second)]);
    two.run().unwrap();
}
