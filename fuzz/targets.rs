//! Functions that the fuzzers call: each reads bytes as one kind of input, as hummingbus does.
//!
//! An input is accepted or refused with words that name its file; it never panics, never hangs and never takes memory
//! without bound. The functions say which of the two it was: the seeds of `corpus/` that are named `accepted-…` must
//! stay accepted, or they would no longer lead anywhere. `tests/runs/corpus.rs` replays the corpus with them.

use flights::FlightSet;
use recorder::diff::first_difference;
use recorder::index::Index;
use recorder::reader::Recording;
use scenes::Scene;
use std::fmt::Display;
use std::path::{Path, PathBuf};
use tempfile::TempDir;
use vehicles::Vehicle;

/// Reads an input; whether it was accepted.
pub type Target = fn(&[u8]) -> bool;

/// Every target by its name, which is that of its folder in `corpus/`.
pub const TARGETS: [(&str, Target); 11] = [
    ("manifest", manifest),
    ("vehicle", vehicle),
    ("model", model),
    ("scene", scene),
    ("flights", flights),
    ("csv", csv),
    ("ulog", ulog),
    ("crazyflie", crazyflie),
    ("dataflash", dataflash),
    ("parquet", parquet),
    ("mcap", mcap),
];

/// Columns of the seeds in Parquet.
const PARQUET_CHANNELS: &str = r#"
time = { columns = ["t"], unit = "s" }
command = { columns = ["m1", "m2", "m3", "m4"], unit = "count" }
position = { columns = ["px", "py", "pz"], unit = "m" }
"#;

/// A line of a manifest that begins with this is a `--set` as well.
const OVERRIDE: &str = "#--set ";
/// Columns of the seeds in CSV.
const CSV_CHANNELS: &str = r#"
time = { columns = ["t"], unit = "s" }
command = { columns = ["m1", "m2", "m3", "m4"], unit = "count" }
position = { columns = ["px", "py", "pz"], unit = "m" }
attitude = { columns = ["qx", "qy", "qz", "qw"] }
angular_velocity = { columns = ["wx", "wy", "wz"], unit = "rad/s" }
"#;
/// Fewer of them, for logs in which a column was hit.
const CSV_FEW: &str = r#"
time = { columns = ["t"], unit = "s" }
command = { columns = ["m1", "m2", "m3", "m4"], unit = "count" }
"#;
/// Variables of the seeds in the Crazyflie's format.
const CRAZYFLIE_CHANNELS: &str = r#"
command = { columns = ["motor.m1", "motor.m2", "motor.m3", "motor.m4"], unit = "count" }
specific_force = { columns = ["acc.x", "acc.y", "acc.z"], unit = "g" }
battery_voltage = { columns = ["pm.vbatMV"], unit = "mV" }
"#;
/// Fields of the seeds in ULog whose messages are of no type that is known.
const ULOG_CHANNELS: &str = r#"
angular_velocity = { topic = "sensor_combined", fields = ["gyro_rad[0]", "gyro_rad[1]", "gyro_rad[2]"], unit = "rad/s" }
battery_voltage = { topic = "battery", fields = ["cell[1].volts"], unit = "V" }
"#;

/// Fields of the seeds in ArduPilot's format.
const DATAFLASH_CHANNELS: &str = r#"
angular_velocity = { topic = "IMU" }
command = { topic = "RCOU", fields = ["C1", "C2", "C3", "C4"], unit = "count" }
"#;

/// A manifest in the folder of the shipped ones.
pub fn manifest(bytes: &[u8]) -> bool {
    let text = String::from_utf8_lossy(bytes);
    let overrides = text.lines().filter_map(|line| line.strip_prefix(OVERRIDE));
    let overrides: Vec<String> = overrides.map(str::to_owned).collect();
    let path = repository().join("manifests/under-test.toml");
    let result = hummingbus::check_text(&text, &path, &overrides);
    let checked = said(result, "");
    checked.is_some_and(|checked| checked.json().is_object() && !checked.to_string().is_empty())
}

/// A vehicle file; one that is accepted is put into the hover.
pub fn vehicle(bytes: &[u8]) -> bool {
    let place = Place::with("under-test.toml", bytes);
    // A refusal can also name the file that it is based on.
    said(Vehicle::load(&place.path("under-test.toml")), ":").is_some()
        && place.is_flown_by("hover.toml", "process.plant.vehicle")
}

/// A model in URDF or SDF; one that is accepted becomes a vehicle file that loads.
pub fn model(bytes: &[u8]) -> bool {
    let text = String::from_utf8_lossy(bytes);
    let made = said(vehicles::from_model::convert(&text, "under-test.sdf"), "under-test.sdf");
    made.is_some_and(|made| Vehicle::parse(&made.text, "under-test.sdf").is_ok())
}

/// A scene file; one that is accepted is put around the hover with contacts and rigs.
pub fn scene(bytes: &[u8]) -> bool {
    let place = Place::with("under-test.toml", bytes);
    said(Scene::load(&place.path("under-test.toml")), "under-test.toml").is_some()
        && place.is_flown_by("hover-rapier.toml", "process.plant.scene")
}

/// A flights file beside a log in CSV.
pub fn flights(bytes: &[u8]) -> bool {
    let place = Place::with("log.csv", include_bytes!("corpus/csv/accepted-motion.csv"));
    place.write("flights.toml", bytes);
    said(FlightSet::load(&place.path("flights.toml")), "flights.toml").is_some()
}

/// A log in CSV.
pub fn csv(bytes: &[u8]) -> bool {
    let place = Place::with("log", bytes);
    let whole = place.reads_log("csv", CSV_CHANNELS);
    place.reads_log("csv", CSV_FEW);
    whole
}

/// A log in PX4's format.
pub fn ulog(bytes: &[u8]) -> bool {
    let place = Place::with("log", bytes);
    let known = place.reads_log("ulog", "");
    place.reads_log("ulog", ULOG_CHANNELS);
    known
}

/// A log of a Crazyflie, with its own checksum and with the one that fits.
pub fn crazyflie(bytes: &[u8]) -> bool {
    let place = Place::with("log", bytes);
    let as_it_is = place.reads_log("crazyflie", CRAZYFLIE_CHANNELS);
    if let Some((content, stored)) = bytes.split_last_chunk::<4>() {
        let fitting = crc32(content).to_le_bytes();
        if *stored != fitting {
            place.write("log", &[content, &fitting].concat());
            place.reads_log("crazyflie", CRAZYFLIE_CHANNELS);
        }
    }
    as_it_is
}

/// A log of ArduPilot.
pub fn dataflash(bytes: &[u8]) -> bool {
    let place = Place::with("log", bytes);
    place.reads_log("dataflash", "") | place.reads_log("dataflash", DATAFLASH_CHANNELS)
}

/// A table in Parquet.
pub fn parquet(bytes: &[u8]) -> bool {
    Place::with("log", bytes).reads_log("parquet", PARQUET_CHANNELS)
}

/// A recording of hummingbus or a bag of ROS 2.
pub fn mcap(bytes: &[u8]) -> bool {
    let place = Place::with("log", bytes);
    let path = place.path("log");
    let strict = said(Recording::open(&path), "log");
    let salvaged = said(Recording::salvage(&path), "log");
    assert!(strict.is_none() || salvaged.is_some(), "what opens can be salvaged");
    if let (Some(strict), Some(salvaged)) = (&strict, &salvaged) {
        let _ = strict.attachments();
        let _ = first_difference(strict, salvaged);
    }
    if let Some(recording) = salvaged {
        let _ = recording.attachments();
        if let Ok(index) = Index::of(&recording) {
            (0..index.len())
                .for_each(|block| drop(index.messages(&recording, block).map_while(Result::ok).last()));
        }
        recording.messages().map_while(Result::ok).for_each(|record| drop(recording.decode(&record)));
    }
    place.reads_log("mcap", "")
}

/// The value, or none behind a refusal whose words hold `file`.
fn said<T, E: Display>(result: Result<T, E>, file: &str) -> Option<T> {
    result
        .inspect_err(|error| {
            let words = error.to_string();
            assert!(!words.trim().is_empty() && words.contains(file), "`{file}` is not named: {words}");
        })
        .ok()
}

/// The folder of the project.
fn repository() -> PathBuf {
    let mut folders = Path::new(env!("CARGO_MANIFEST_DIR")).ancestors();
    folders
        .find(|folder| folder.join("manifests/hover.toml").is_file())
        .expect("the shipped manifests")
        .into()
}

/// A folder for one input, with the shipped vehicles in it.
struct Place(TempDir);

impl Place {
    fn with(name: &str, bytes: &[u8]) -> Self {
        let place = Self(tempfile::tempdir().expect("a temporary folder"));
        std::os::unix::fs::symlink(repository().join("vehicles"), place.path("vehicles")).expect("a link");
        place.write(name, bytes);
        place
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    fn write(&self, name: &str, bytes: &[u8]) {
        std::fs::write(self.path(name), bytes).expect("the temporary folder can be written");
    }

    /// True if the shipped `manifest` is accepted with the file under test at `key`.
    fn is_flown_by(&self, manifest: &str, key: &str) -> bool {
        let manifest = repository().join("manifests").join(manifest);
        let path = self.path("under-test.toml");
        let overrides = [format!("{key}={:?}", path.display().to_string())];
        said(hummingbus::check(&manifest, &overrides), "hover").is_some()
    }

    /// True if the log of `format` is read with `channels`, and can be written as one table.
    fn reads_log(&self, format: &str, channels: &str) -> bool {
        let text = format!(
            "vehicle = \"vehicles/hummingbird.toml\"\nformat = \"{format}\"\n[channels]\n{channels}\n[[flight]]\n\
             name = \"under test\"\nfile = \"log\"\nrole = \"fit\"\ntrust_units = true\n"
        );
        self.write("flights.toml", text.as_bytes());
        let Some(set) = said(FlightSet::load(&self.path("flights.toml")), "log") else { return false };
        set.flights.iter().for_each(|flight| drop(flights::write_csv(flight, &self.path("table.csv"))));
        true
    }
}

/// CRC-32 as in zip, bit by bit.
fn crc32(bytes: &[u8]) -> u32 {
    let bit = |crc: u32, _| if crc & 1 == 1 { (crc >> 1) ^ 0xEDB8_8320 } else { crc >> 1 };
    !bytes.iter().fold(!0, |crc, byte| (0..8).fold(crc ^ u32::from(*byte), bit))
}
