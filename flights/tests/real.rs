//! Flights of the repository's flights files, read from real logs in the folder that `HUMMINGBUS_DATA` names.

use crate::skipped;
use std::path::{Path, PathBuf};

use flights::{Channel, Flight, FlightSet, Role};

/// The folder of measured flights; says so where it is not given.
fn data() -> Option<PathBuf> {
    skipped::variable_or_skip("HUMMINGBUS_DATA", "the folder of measured flights").map(PathBuf::from)
}

fn load(name: &str) -> FlightSet {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(name);
    FlightSet::load(&path).unwrap_or_else(|error| panic!("{error}"))
}

fn length_s(flight: &Flight) -> f64 {
    flight.attitude.span_s().or(flight.command.span_s()).unwrap().1
}

#[test]
fn every_flights_file_is_read_without_a_doubt_about_units() {
    if data().is_none() {
        return;
    }
    let folder = Path::new(env!("CARGO_MANIFEST_DIR"));
    let files = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().file_name());
    let names = files.map(|name| name.into_string().unwrap());
    let is_flights_file = |name: &String| {
        Path::new(name).extension().is_some_and(|extension| extension == "toml") && name != "Cargo.toml"
    };
    let names: Vec<String> = names.filter(is_flights_file).collect();
    assert_eq!(names.len(), 11);
    // Quick tests read logs of four sources.
    let quick = ["arpl-crazyflie.toml", "crazypad-w1-m3-e9.toml", "nanobench-ramp.toml", "neurobem.toml"];
    for name in skipped::cases("flights files", names, |name| quick.contains(&name.as_str())) {
        let set = load(&name);
        assert!(set.vehicle.exists(), "{name}");
        for role in [Role::Fit, Role::Test] {
            assert!(set.flights.iter().any(|flight| flight.role == role), "{name} has no flight to {role:?}");
        }
        for flight in &set.flights {
            println!(
                "{name}: {} {:.2} s {:?} {:?}",
                flight.name,
                length_s(flight),
                flight.assumed,
                flight.notes
            );
            // Flights of NeuroBEM do pull 2 g in the median.
            let is_agile = |note: &String| name == "neurobem.toml" && note.contains("times gravity");
            let doubt =
                |note: &String| note.starts_with('`') && !note.contains("correlation") && !is_agile(note);
            assert!(!flight.notes.iter().any(doubt), "{:?}", flight.notes);
        }
    }
}

#[test]
fn nanobench_has_all_its_channels() {
    if data().is_none() {
        return;
    }
    let set = load("nanobench.toml");
    let flight = &set.flights[0];
    assert!((length_s(flight) - 16.5).abs() < 0.011, "{}", length_s(flight));
    assert!((1649..=1651).contains(&flight.position.time_s.len()), "{}", flight.position.time_s.len());
    // In the air, level on average, at about gravity and at the height that the source gives.
    assert!(flight.position.values.iter().all(|p| (0.8..1.2).contains(&p[2])));
    let mean_up = flight.specific_force.values.iter().map(|f| f[2]).sum::<f64>()
        / flight.specific_force.values.len() as f64;
    assert!((9.0..11.0).contains(&mean_up), "{mean_up}");
    assert!(flight.attitude.values.iter().all(|q| q[0].abs() > 0.7));
    assert!(flight.rotor_speed.is_empty());
}

#[test]
fn a_crazyflies_card_has_a_kilohertz_of_gyro_and_commands() {
    if data().is_none() {
        return;
    }
    let set = load("arpl-crazyflie.toml");
    let flight = &set.flights[0];
    assert!((flight.angular_velocity.period_s().unwrap() - 0.001).abs() < 1e-4);
    assert!(flight.attitude.is_empty() && flight.position.is_empty());
    // 600 deg/s are reached, 600 rad/s are not.
    let fastest = flight.angular_velocity.values.iter().flatten().fold(0.0_f64, |a, b| a.max(b.abs()));
    assert!((2.0..30.0).contains(&fastest), "{fastest}");
}

#[test]
fn a_hover_without_attitude_is_assumed_level_and_said() {
    if data().is_none() {
        return;
    }
    let set = load("crazypad-normal-e8.toml");
    let flight = &set.flights[0];
    assert_eq!(flight.assumed.len(), 2, "{:?}", flight.assumed);
    assert_eq!(flight.attitude.time_s, flight.command.time_s);
    assert!(flight.attitude.values.iter().all(|q| q[0] > 0.99 && q[1] == 0.0 && q[2] == 0.0));
    assert!(flight.battery_voltage.values.iter().all(|v| (3.0..4.3).contains(&v[0])));
}

/// Reads a PX4 log with a made-up flights file.
fn ulog(data: &Path, file: &str, channels: &str) -> Flight {
    let folder = tempfile::tempdir().unwrap();
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let text = format!(
        "vehicle = \"{}\"\n[channels]\n{channels}\n[[flight]]\nname = \"px4\"\nrole = \"fit\"\nfile = \"{}\"\n",
        root.join("vehicles/hummingbird.toml").display(),
        data.join("px4-ulog").join(file).display()
    );
    let path = folder.path().join("flights.toml");
    std::fs::write(&path, text).unwrap();
    FlightSet::load(&path).unwrap_or_else(|error| panic!("{error}")).flights.remove(0)
}

#[test]
fn a_ulog_is_read_by_the_types_of_its_messages() {
    let Some(data) = data() else { return };
    let flight = ulog(&data, "sample.ulg", "");
    println!("{:?}", flight.notes);
    assert!((6400..=6461).contains(&flight.attitude.time_s.len()), "{}", flight.attitude.time_s.len());
    assert!(flight.specific_force.values.len() > 16_000);
    // Level on the whole, so that gravity is +9.8 along our z, in an own frame.
    let f = &flight.specific_force.values;
    let mean_z = f.iter().map(|f| f[2]).sum::<f64>() / f.len() as f64;
    assert!((9.3..10.3).contains(&mean_z), "{mean_z}");
    // Its estimator had no horizontal position: `xy_valid` is 0 in all messages.
    assert!(flight.position.is_empty() && flight.velocity.is_empty());
    let said = "not taken from vehicle_local_position, whose messages say that they hold no value";
    assert!(flight.notes.iter().any(|note| note.contains(said)), "{:?}", flight.notes);
}

#[test]
fn commands_of_a_ulog_are_read_by_field_and_as_a_share_of_the_vehicles_range() {
    let Some(data) = data() else { return };
    let channels = "command = { topic = \"actuator_motors\", fields = [\"control[0]\", \"control[1]\", \
                    \"control[2]\", \"control[3]\"], unit = \"fraction\" }\n\
                    attitude = { topic = \"vehicle_attitude\" }\n\
                    angular_velocity = { topic = \"vehicle_angular_velocity\" }\n\
                    battery_voltage = { topic = \"battery_status\" }";
    let flight = ulog(&data, "sample_px4_events.ulg", channels);
    println!("{:?}", flight.notes);
    let (low, high) = (1.0, 200.0);
    assert!(
        flight
            .command
            .values
            .iter()
            .flat_map(|command| &command[..4])
            .all(|command| (low..=high).contains(command))
    );
    assert!(flight.angular_velocity.time_s.len() > 1500);
    assert!(
        (10.0..17.0).contains(&flight.battery_voltage.values[0][0]),
        "{:?}",
        flight.battery_voltage.values[0]
    );
}

#[test]
fn the_canonical_file_of_a_real_flight_has_a_row_for_each_attitude() {
    if data().is_none() {
        return;
    }
    let set = load("nanobench.toml");
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("flight.csv");
    let written = flights::write_csv(&set.flights[0], &path).unwrap();
    assert_eq!(written.rows, set.flights[0].attitude.time_s.len());
    let lines = std::fs::read_to_string(&path).unwrap().lines().count();
    assert_eq!(lines, written.rows + 1);
}

/// The log with the specific force along the axes of the world, less `gravity_g` up, in g.
fn in_world(log: &str, gravity_g: f64) -> String {
    let mut lines = log.lines();
    let header = lines.next().unwrap();
    let columns = |names: &[&str]| -> Vec<usize> {
        let column = |name: &&str| header.split(',').position(|header| header == *name).unwrap();
        names.iter().map(column).collect()
    };
    let attitude = columns(&["qw", "qx", "qy", "qz"]);
    let force = columns(&["imu_acc_x", "imu_acc_y", "imu_acc_z"]);
    let turned = lines.map(|line| {
        let mut cells: Vec<String> = line.split(',').map(str::to_owned).collect();
        let number = |column: &usize| cells[*column].parse::<f64>().unwrap_or(f64::NAN);
        let q: Vec<f64> = attitude.iter().map(number).collect();
        let f: Vec<f64> = force.iter().map(number).collect();
        let q = nalgebra::UnitQuaternion::from_quaternion(nalgebra::Quaternion::new(q[0], q[1], q[2], q[3]));
        let f = q * nalgebra::Vector3::new(f[0], f[1], f[2]) - gravity_g * nalgebra::Vector3::z();
        force.iter().zip(f.iter()).for_each(|(column, number)| cells[*column] = number.to_string());
        cells.join(",") + "\n"
    });
    format!("{header}\n{}", turned.collect::<String>())
}

/// Reads all logs of a folder with pose, and a specific force as declared.
fn with_force(logs: &Path, columns: &str, keys: &str) -> Result<Vec<Flight>, String> {
    let vehicle = Path::new(env!("CARGO_MANIFEST_DIR")).join("../vehicles/crazyflie-2.1.toml");
    let text = format!(
        "vehicle = \"{}\"\n[channels]\ntime = {{ columns = [\"t\"], unit = \"s\" }}\n\
         position = {{ columns = [\"px\", \"py\", \"pz\"], unit = \"m\" }}\n\
         attitude = {{ columns = [\"qx\", \"qy\", \"qz\", \"qw\"] }}\n\
         specific_force = {{ columns = [{columns}], unit = \"g\"{keys} }}\n\
         [[flight]]\nfile = \"{}/B*_rep*.csv\"\nrole = \"fit\"\n",
        vehicle.display(),
        logs.display()
    );
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("flights.toml");
    std::fs::write(&path, text).unwrap();
    FlightSet::load(&path).map(|set| set.flights).map_err(|error| error.to_string())
}

const IMU: &str = r#""imu_acc_x", "imu_acc_y", "imu_acc_z""#;
/// Of the firmware's estimator: along the axes of the world, without gravity.
const ESTIMATE: &str = r#""est_stateEstimate_ax", "est_stateEstimate_ay", "est_stateEstimate_az""#;

#[test]
fn a_real_acceleration_in_the_world_is_refused_as_one() {
    let Some(data) = data() else { return };
    let logs = data.join("nanobench");
    let plain = with_force(&logs, IMU, "").unwrap();
    assert_eq!(plain.len(), 5);
    let refused = |found: Result<Vec<Flight>, String>, holds: &str, least: usize| {
        let found = found.unwrap_err();
        assert!(found.matches(&format!("`holds = \"{holds}\"`")).count() >= least, "{found}");
    };
    refused(with_force(&logs, ESTIMATE, ""), "world-acceleration", 5);
    let estimated = with_force(&logs, ESTIMATE, ", holds = \"world-acceleration\"").unwrap();
    let kinds = [(1.0, "world-acceleration"), (0.0, "world-specific-force")];
    for (gravity_g, holds) in skipped::first(1, "kinds of forces", kinds) {
        let turned = tempfile::tempdir().unwrap();
        for flight in &plain {
            let log = std::fs::read_to_string(&flight.file).unwrap();
            std::fs::write(turned.path().join(flight.file.file_name().unwrap()), in_world(&log, gravity_g))
                .unwrap();
        }
        refused(with_force(turned.path(), IMU, ""), holds, 4);
        let read = with_force(turned.path(), IMU, &format!(", holds = \"{holds}\"")).unwrap();
        for ((plain, read), estimated) in plain.iter().zip(&read).zip(&estimated) {
            // Standard gravity there, the vehicle file's here.
            assert!(rms(&plain.specific_force, &read.specific_force) < 0.01, "{}", read.name);
            // The estimator filters, by its own attitude.
            let onboard = rms(&plain.specific_force, &estimated.specific_force);
            assert!(onboard < 1.0, "{}: {onboard}", read.name);
        }
    }
}

/// The root mean square of the difference between two channels at the same times.
fn rms(a: &Channel<3>, b: &Channel<3>) -> f64 {
    let pairs = a.time_s.iter().zip(&a.values).filter_map(|(time_s, a)| {
        let index = b.time_s.iter().position(|other_s| (other_s - time_s).abs() < 1e-6)?;
        Some(a.iter().zip(&b.values[index]).map(|(a, b)| (a - b) * (a - b)).sum::<f64>())
    });
    let squares: Vec<f64> = pairs.collect();
    assert!(squares.len() > 1000, "{}", squares.len());
    (squares.iter().sum::<f64>() / squares.len() as f64).sqrt()
}
