//! Made-up logs of every format: the flights that are read from them, and the errors for wrong ones.

use crate::support;
use flights::{Flight, FlightSet, FlightsError, Quantity};
use nalgebra::{UnitQuaternion, Vector3};
use support::{Motion, Place, crc32};

const CHANNELS: &str = r#"
time = { columns = ["t"], unit = "s" }
command = { columns = ["m1", "m2", "m3", "m4"], unit = "count" }
position = { columns = ["px", "py", "pz"], unit = "m" }
velocity = { columns = ["vx", "vy", "vz"], unit = "m/s" }
attitude = { columns = ["qx", "qy", "qz", "qw"] }
angular_velocity = { columns = ["wx", "wy", "wz"], unit = "rad/s" }
specific_force = { columns = ["fx", "fy", "fz"], unit = "m/s^2" }
battery_voltage = { columns = ["v"], unit = "V" }
"#;

/// Reads the made-up flight in CSV with `channels`, and `extra` in the flight's table.
fn read(motion: &Motion, channels: &str, extra: &str) -> Result<Flight, FlightsError> {
    let place = Place::new();
    place.write("log.csv", motion.csv().as_bytes());
    place.load("log.csv", channels, extra)
}

/// The text with which the flight is refused.
fn refused(channels: &str, extra: &str) -> String {
    read(&Motion::default(), channels, extra).unwrap_err().to_string()
}

/// Returns the contradictions in the flight, each with the correction that fits.
fn findings(motion: &Motion, channels: &str) -> Vec<(Quantity, String)> {
    match read(motion, channels, "") {
        Err(FlightsError::Implausible { findings, .. }) => findings
            .into_iter()
            .map(|finding| (finding.channel, finding.fits.expect("a clear finding says what fits")))
            .collect(),
        other => panic!("{:?}", other.map(|flight| flight.notes).map_err(|error| error.to_string())),
    }
}

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
fn wrong_units_are_found_with_those_that_fit() {
    let is = |declared: &str, instead: &str, quantity: Quantity, fits: &str| {
        let found = findings(&Motion::default(), &CHANNELS.replace(declared, instead));
        assert!(found.iter().any(|(q, text)| *q == quantity && text.contains(fits)), "{instead}: {found:?}");
    };
    is("\"rad/s\"", "\"deg/s\"", Quantity::AngularVelocity, "rad/s");
    is("\"m/s^2\"", "\"g\"", Quantity::SpecificForce, "m/s^2");
    is("unit = \"m\" ", "unit = \"mm\" ", Quantity::Velocity, "");
    is("\"m/s\"", "\"mm/s\"", Quantity::Velocity, "m/s");
    is("\"V\"", "\"mV\"", Quantity::BatteryVoltage, "\"V\"");
    is("\"count\"", "\"fraction\"", Quantity::Command, "count");
    // The numbers are those of the log.
    let text = refused(&CHANNELS.replace("\"count\"", "\"fraction\""), "");
    let told = [
        "its commands go from 1",
        " in the log (`unit = \"fraction\"`), read as 19901 to 20498",
        " counts, the vehicle's from",
    ];
    assert!(told.iter().all(|part| text.contains(part)), "{text}");
}

#[test]
fn data_in_other_units_than_declared_are_found() {
    let deg = Motion { rate_unit: 57.295_779_5, ..Motion::default() };
    assert!(findings(&deg, CHANNELS).contains(&(Quantity::AngularVelocity, "`unit = \"deg/s\"`".to_owned())));
    let g = Motion { force_unit: 1.0 / 9.81, ..Motion::default() };
    assert!(findings(&g, CHANNELS).contains(&(Quantity::SpecificForce, "`unit = \"g\"`".to_owned())));
    let mm = Motion { length_unit: 1000.0, ..Motion::default() };
    assert!(findings(&mm, CHANNELS).iter().any(|(_, fits)| fits.contains("mm")));
    let share = Motion { command_unit: 1.0 / 200.0, ..Motion::default() };
    assert!(findings(&share, CHANNELS).contains(&(Quantity::Command, "`unit = \"fraction\"`".to_owned())));
}

/// The made-up flight in CSV, its columns from `first` on changed by `change`, which knows the row.
fn changed(first: &str, count: usize, change: impl Fn(usize, &mut [f64])) -> String {
    let whole = Motion::default().csv();
    let mut lines = whole.lines();
    let header = lines.next().unwrap();
    let at = header.split(',').position(|name| name == first).unwrap();
    let row = |(row, line): (usize, &str)| {
        let mut cells: Vec<f64> = line.split(',').map(|cell| cell.parse().unwrap()).collect();
        change(row, &mut cells[at..at + count]);
        cells.iter().map(f64::to_string).collect::<Vec<_>>().join(",") + "\n"
    };
    header.to_owned() + "\n" + &lines.enumerate().map(row).collect::<String>()
}

fn read_text(text: &str) -> Result<Flight, FlightsError> {
    let place = Place::new();
    place.write("log.csv", text.as_bytes());
    place.load("log.csv", CHANNELS, "")
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

#[test]
fn a_position_alone_that_is_too_fast_is_found() {
    let channels = without("velocity").replace("attitude =", "# attitude =");
    let mm = Motion { length_unit: 1000.0, ..Motion::default() };
    assert_eq!(
        findings(&mm, &channels),
        [(Quantity::Position, "`unit = \"cm\"` or `unit = \"mm\"`".to_owned())]
    );
    assert_eq!(read(&Motion::default(), &channels, "").unwrap().notes, [""; 0]);
}

#[test]
fn a_position_alone_is_held_against_how_the_vehicle_leans() {
    let channels = without("velocity");
    let cm = Motion { length_unit: 100.0, ..Motion::default() };
    assert_eq!(findings(&cm, &channels), [(Quantity::Position, "`unit = \"cm\"`".to_owned())]);
    // As little as that also moves a point beside the bearing of a rig, which turns with the vehicle: in swings of one
    // frequency along each axis it follows the lean.
    let declared = channels.replace("unit = \"m\"", "unit = \"mm\"");
    let notes = read(&Motion::default(), &declared, "").unwrap().notes;
    assert!(
        notes.len() == 1 && notes[0].contains("on a rig, or in another unit (`unit = \"m\"`)"),
        "{notes:?}"
    );
    let refused = read(&Motion::default(), &declared, "rig = false").unwrap_err().to_string();
    assert!(
        refused.contains("`position`: declared in mm") && refused.contains("`unit = \"m\"` would fit"),
        "{refused}"
    );
    // No point of a rig follows the lean in swings of two frequencies.
    let place = Place::new();
    place.write("log.csv", two_swings().as_bytes());
    let lines = declared
        .lines()
        .filter(|line| ["time", "command", "attitude", "position"].iter().any(|it| line.starts_with(it)));
    let declared: String = lines.map(|line| format!("{line}\n")).collect();
    let refused = place.load("log.csv", &declared, "").unwrap_err().to_string();
    assert!(
        refused.contains("`position`: declared in mm") && refused.contains("`unit = \"m\"` would fit"),
        "{refused}"
    );
    place.load("log.csv", &declared.replace("\"mm\"", "\"m\""), "").unwrap();
}

/// A flight in which the vehicle leans to and fro, slowly and fast at once: times, commands, positions in m and attitudes.
fn two_swings() -> String {
    let mut text = "t,m1,m2,m3,m4,px,py,pz,qx,qy,qz,qw\n".to_owned();
    for row in 0..=1000 {
        let t = 0.01 * f64::from(row);
        let (x, y) = (
            1.4 * libm::sin(1.4 * t) + 0.1 * libm::sin(5.0 * t),
            libm::cos(2.0 * t) + 0.1 * libm::cos(4.4 * t),
        );
        let along_x = -2.744 * libm::sin(1.4 * t) - 2.5 * libm::sin(5.0 * t);
        let along_y = -4.0 * libm::cos(2.0 * t) - 1.936 * libm::cos(4.4 * t);
        let force = Vector3::new(along_x, along_y, 9.81);
        let q = UnitQuaternion::rotation_between(&Vector3::z(), &force).unwrap();
        let row = format!("{t:.2},100,101,102,103,{x},{y},1,{},{},{},{}\n", q.i, q.j, q.k, q.w);
        text.push_str(&row);
    }
    text
}

/// A position or a velocity in feet or inches fits no unit.
#[test]
fn lengths_in_no_known_unit_are_refused_with_a_scale() {
    let declared = |name: &str| without(if name == "position" { "velocity" } else { "position" });
    for (per_m, fits) in
        [(3.2808, "no unit alone, but a `scale` of about 0.3"), (39.37, "a `scale` of about 0.02")]
    {
        let foreign = Motion { length_unit: per_m, ..Motion::default() };
        let found = findings(&foreign, &declared("position"));
        assert!(found.len() == 1 && found[0].1.starts_with(fits), "{per_m}: {found:?}");
        let velocity = changed("vx", 3, |_, v| v.iter_mut().for_each(|v| *v *= per_m));
        let place = Place::new();
        place.write("log.csv", velocity.as_bytes());
        let error = place.load("log.csv", &declared("velocity"), "").unwrap_err().to_string();
        assert!(error.contains("`velocity`: declared in m/s, it accelerates"), "{error}");
        assert!(error.contains("a `scale` of about 0.") && error.contains("would fit"), "{error}");
    }
}

/// Counts of 16.4 LSB/(deg/s) are near to milliradians per second, but not the same.
#[test]
fn a_scale_comes_before_a_unit_that_is_only_near() {
    let counts = Motion { rate_unit: 16.4 * 57.295_78, ..Motion::default() };
    let found = findings(&counts, CHANNELS);
    let [(Quantity::AngularVelocity, fits)] = &found[..] else { panic!("{found:?}") };
    assert!(
        fits.starts_with(
            "a `scale` of about 1.06e-3 (`unit = \"mrad/s\"` alone leaves the values about 6 % too "
        ),
        "{fits}"
    );
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
        let note =
            format!("{name}: 1 of 1001 samples are far from those before and behind them, first at 4.000 s");
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
    for late_s in [0.3, 0.6, -1.0] {
        let error = of(late_s).unwrap_err();
        let fits =
            error.split_once("`delay_s = { angular_velocity = ").unwrap_or_else(|| panic!("{error}")).1;
        let delay_s: f64 = fits.split(' ').next().unwrap().parse().unwrap();
        assert!((delay_s - late_s).abs() < 0.03 && error.contains("the clocks of the two differ"), "{error}");
    }
    assert_eq!(of(0.0).unwrap(), [""; 0]);
}

/// An axis that does not follow is not one with a wrong sign.
#[test]
fn an_axis_without_a_signal_is_not_advised_a_sign() {
    let text = changed("wx", 1, |row, rate| rate[0] = if row % 2 == 0 { 9.0 } else { -9.0 });
    let notes = read_text(&text).unwrap_or_else(|error| panic!("{error}")).notes;
    assert!(notes.iter().any(|note| note.contains("(y, z: alike; x: without a relation)")), "{notes:?}");
}

#[test]
fn times_in_another_unit_are_found_before_a_part_is_cut_out() {
    let in_ms = Motion { time_unit: 1000.0, ..Motion::default() };
    assert!(read(&in_ms, &CHANNELS.replace("\"s\"", "\"ms\""), "").is_ok());
    let text = read(&in_ms, CHANNELS, "").unwrap_err().to_string();
    assert!(text.contains("flights.toml:3:") && text.contains("`unit = \"ms\"` would fit"), "{text}");
    for slower in [10.0, 40.0, 100.0] {
        let slow = Motion { time_unit: slower, ..Motion::default() };
        let channels = "time = { columns = [\"t\"], unit = \"s\" }\ncommand = { columns = [\"m1\", \"m2\", \"m3\", \"m4\"], \
                        unit = \"count\" }";
        assert!(read(&slow, channels, "").is_ok(), "10 Hz to 1 Hz is slow, and no other unit");
    }
    for declared in ["\"ms\"", "\"us\""] {
        let channels = CHANNELS.replace("\"s\"", declared);
        for extra in ["", "from_s = 2.0\nto_s = 3.0"] {
            let text = read(&Motion::default(), &channels, extra).unwrap_err().to_string();
            assert!(text.contains("flights.toml:3:") && text.contains("`unit = \"s\"` would fit"), "{text}");
        }
    }
}

#[test]
fn angles_in_another_unit_are_found() {
    let poses = |unit: &str| {
        let attitude =
            format!("attitude = {{ euler = [\"roll\", \"pitch\", \"yaw\"], unit = \"{unit}\" }}\n");
        let kept = CHANNELS
            .lines()
            .filter(|line| ["time", "command", "position"].iter().any(|own| line.starts_with(own)));
        kept.map(|line| line.to_owned() + "\n").collect::<String>() + &attitude
    };
    assert_eq!(read(&Motion::default(), &poses("rad"), "").unwrap().notes, [""; 0]);
    let found = findings(&Motion::default(), &poses("deg"));
    assert_eq!(found[0].0, Quantity::Position);
    assert!(found.len() == 1 && found[0].1.ends_with("or `unit = \"rad\"` of `attitude`"), "{found:?}");
    let degrees = Motion { angle_unit: 57.295_779_5, ..Motion::default() };
    let text = read(&degrees, &poses("rad"), "").unwrap_err().to_string();
    assert!(text.contains("`unit = \"deg\"` would fit"), "{text}");
    assert!(read(&degrees, &poses("rad"), "trust_units = true").is_ok());
}

#[test]
fn a_pose_whose_axes_are_mistaken_is_found_without_a_gyroscope() {
    let poses = |angles: &str, position: &str| {
        format!(
            "time = {{ columns = [\"t\"], unit = \"s\" }}\n\
             command = {{ columns = [\"m1\", \"m2\", \"m3\", \"m4\"], unit = \"count\" }}\n\
             attitude = {{ euler = [{angles}], unit = \"rad\" }}\n\
             position = {{ columns = [{position}], unit = \"m\" }}\n"
        )
    };
    let (angles, position) = (r#""roll", "pitch", "yaw""#, r#""px", "py", "pz""#);
    assert_eq!(read(&Motion::default(), &poses(angles, position), "").unwrap().notes, [""; 0]);
    let fits = |angles: &str, position: &str, advised: &str| {
        let found = findings(&Motion::default(), &poses(angles, position));
        let [(Quantity::Attitude, advice)] = &found[..] else { panic!("{angles} {position}: {found:?}") };
        assert!(advice.split(", or ").any(|own| own == advised), "{angles} {position}: {advice}");
    };
    fits(r#""roll", "-pitch", "yaw""#, position, "a `-` before the pitch");
    fits(r#""-roll", "-pitch", "yaw""#, position, "a `-` before roll and pitch");
    fits(r#""pitch", "roll", "yaw""#, position, "roll and pitch in each other's place");
    fits(angles, r#""py", "px", "pz""#, "x and y of the position in each other's place");
}

/// The channels without one of them.
fn without(channel: &str) -> String {
    let kept = CHANNELS.lines().filter(|line| !line.starts_with(channel));
    kept.map(|line| line.to_owned() + "\n").collect()
}

#[test]
fn rotor_speeds_are_compared_with_hover() {
    let vehicle = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../vehicles/hummingbird.toml");
    let hover = vehicles::Vehicle::load(&vehicle).unwrap().hover_speed_rad_s();
    // The columns of the commands hold speeds here, about that of hover in rpm.
    let rpm = Motion { command_unit: hover / 101.5 * 60.0 / std::f64::consts::TAU, ..Motion::default() };
    let channels = CHANNELS.replace("command =", "rotor_speed =");
    let declared = |unit: &str| channels.replace("\"count\"", &format!("\"{unit}\""));
    assert_eq!(findings(&rpm, &declared("rad/s")), [(Quantity::RotorSpeed, "`unit = \"rpm\"`".to_owned())]);
    let flight = read(&rpm, &declared("rpm"), "").unwrap();
    assert!((flight.rotor_speed.values[0][0] / hover - 1.0).abs() < 0.02 && flight.notes.is_empty());
}

#[test]
fn commands_that_do_not_bear_the_vehicle_are_refused() {
    let weak = Motion { command_unit: 0.35, ..Motion::default() };
    let found = findings(&weak, CHANNELS);
    let [(Quantity::Command, fits)] = &found[..] else { panic!("{found:?}") };
    assert!(fits.contains("`[command]`") && fits.contains("`scale`"), "{fits}");
    // Hover takes 76.4 counts; these are 0.35 times 101.5.
    assert!(fits.contains("commands 2.15 times as large") && fits.contains("in place of 200"), "{fits}");
    let text = read(&weak, CHANNELS, "").unwrap_err().to_string();
    assert!(text.contains("in flight their thrust is 0.") && text.contains("times the weight"), "{text}");
    assert!(read(&weak, CHANNELS, "trust_units = true").is_ok());
    let scaled = CHANNELS.replace("unit = \"count\"", "unit = \"count\", scale = 2.857");
    assert_eq!(read(&weak, &scaled, "").unwrap().notes, [""; 0]);
}

#[test]
fn electrical_rotor_speeds_are_divided_by_the_pole_pairs() {
    let vehicle = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../vehicles/hummingbird.toml");
    let hover = vehicles::Vehicle::load(&vehicle).unwrap().hover_speed_rad_s();
    let rpm = 60.0 / std::f64::consts::TAU;
    let electrical = Motion { command_unit: 7.0 * hover / 101.5 * rpm, ..Motion::default() };
    let channels = CHANNELS.replace("command =", "rotor_speed =").replace("\"count\"", "\"rpm\"");
    let declared = |keys: &str| channels.replace("\"rpm\"", &format!("\"rpm\"{keys}"));
    let flight = read(&electrical, &declared(", pole_pairs = 7"), "").unwrap();
    assert!((flight.rotor_speed.values[0][0] / (hover * 100.0 / 101.5) - 1.0).abs() < 1e-9);
    assert_eq!(flight.notes, [""; 0]);
    // Without them the speeds are far from those of hover; those of a motor with two pairs are not.
    let found = findings(&electrical, &channels);
    let [(Quantity::RotorSpeed, fits)] = &found[..] else { panic!("{found:?}") };
    assert!(fits.contains("`pole_pairs`") && fits.contains("about 7"), "{fits}");
    let two = Motion { command_unit: 2.0 * hover / 101.5 * rpm, ..Motion::default() };
    let notes = read(&two, &channels, "").unwrap().notes;
    assert!(
        notes.len() == 1 && notes[0].contains("need `pole_pairs`") && notes[0].contains("about 2"),
        "{notes:?}"
    );
    let mechanical = Motion { command_unit: hover / 101.5 * rpm, ..Motion::default() };
    let found = findings(&mechanical, &declared(", pole_pairs = 7"));
    let [(Quantity::RotorSpeed, fits)] = &found[..] else { panic!("{found:?}") };
    assert_eq!(fits, "mechanical speeds, without `pole_pairs`,");
    let zero = refused(&declared(", pole_pairs = 0"), "");
    assert!(
        zero.contains("flights.toml:4:") && zero.contains("`pole_pairs`") && zero.contains("magnets"),
        "{zero}"
    );
    let of_rates = CHANNELS.replace("\"rad/s\"", "\"rad/s\", pole_pairs = 7");
    assert!(refused(&of_rates, "").contains("expected `rotor_speed` alone"));
}

#[test]
fn a_unit_is_advised_only_where_it_alone_fits() {
    let vehicle = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../vehicles/hummingbird.toml");
    let hover = vehicles::Vehicle::load(&vehicle).unwrap().hover_speed_rad_s();
    let rpm = 60.0 / std::f64::consts::TAU;
    let channels = CHANNELS.replace("command =", "rotor_speed =");
    let hundreds = Motion { command_unit: 7.0 * hover / 101.5 * rpm / 100.0, ..Motion::default() };
    let declared = |keys: &str| channels.replace("unit = \"count\"", keys);
    // A hundredth of electrical revolutions a minute is near to hertz, and no multiple of a unit.
    for (keys, fits) in [
        ("unit = \"rpm\", pole_pairs = 7", "`unit = \"rpm\"` with `scale = 100` (hundreds)"),
        ("unit = \"Hz\", pole_pairs = 7", "`unit = \"rpm\"` with `scale = 100` (hundreds)"),
        ("unit = \"rad/s\", pole_pairs = 7", "`unit = \"rpm\"` with `scale = 100` (hundreds)"),
        ("unit = \"rpm\"", "with the motor's `pole_pairs`, here about 7"),
        ("unit = \"rpm\", pole_pairs = 7, scale = 10", "`unit = \"rad/s\"`, or a `scale` of about 99.5"),
    ] {
        let found = findings(&hundreds, &declared(keys));
        let [(Quantity::RotorSpeed, said)] = &found[..] else { panic!("{keys}: {found:?}") };
        assert!(said.contains(fits), "{keys}: {said}");
    }
    let flight = read(&hundreds, &declared("unit = \"rpm\", pole_pairs = 7, scale = 100"), "").unwrap();
    assert_eq!(flight.notes, [""; 0]);
    let scaled = |quantity, motion: Motion, scale: f64| {
        let found = findings(&motion, CHANNELS);
        let fits = found.iter().find(|(found, _)| *found == quantity).map(|(_, fits)| fits.clone()).unwrap();
        let number = fits.split_once("a `scale` of about ").unwrap_or_else(|| panic!("{fits}")).1;
        let number: f64 = number.split(' ').next().unwrap().parse().unwrap();
        assert!((number / scale - 1.0).abs() < 0.1, "{fits} for {scale}");
    };
    let force = |force_unit| Motion { force_unit, ..Motion::default() };
    scaled(Quantity::SpecificForce, force(1000.0), 1e-3);
    scaled(Quantity::SpecificForce, force(4096.0 / 9.81), 9.81 / 4096.0);
    scaled(Quantity::SpecificForce, force(0.01), 100.0);
    let rate = |rate_unit| Motion { rate_unit, ..Motion::default() };
    scaled(Quantity::AngularVelocity, rate(16.4 * 57.3), 1.0 / 16.4 / 57.3);
    scaled(Quantity::AngularVelocity, rate(0.01), 100.0);
}

#[test]
fn a_quaternion_with_w_first_or_the_wrong_way_is_found() {
    let w_first = CHANNELS.replace("\"qx\", \"qy\", \"qz\", \"qw\"", "\"qw\", \"qx\", \"qy\", \"qz\"");
    let found = findings(&Motion::default(), &w_first);
    assert!(
        found.iter().any(|(q, fits)| *q == Quantity::Attitude && fits.contains("w, x, y, z")),
        "{found:?}"
    );
    let inverse = CHANNELS.replace("\"qx\", \"qy\", \"qz\"", "\"-qx\", \"-qy\", \"-qz\"");
    let found = findings(&Motion::default(), &inverse);
    assert!(
        found.iter().any(|(_, fits)| fits.contains("world to the body") || fits.contains("the axes")),
        "{found:?}"
    );
}

/// A gyroscope whose columns are exchanged is not taken for motors in another order: its own columns are named, in either frame.
#[test]
fn a_gyroscope_with_its_axes_in_another_order_is_found() {
    let declared = "[\"wx\", \"wy\", \"wz\"]";
    for (columns, frd_ned, fits) in [
        ("[\"wy\", \"wx\", \"wz\"]", false, "the names in the order [\"wx\", \"wy\", \"wz\"]"),
        ("[\"wz\", \"-wx\", \"wy\"]", false, "the names in the order [\"wx\", \"wy\", \"wz\"]"),
        ("[\"wy\", \"-wx\", \"wz\"]", true, "the names in the order [\"wx\", \"wy\", \"wz\"]"),
    ] {
        let channels = CHANNELS.replace(declared, columns);
        let channels = if frd_ned { channels.replace(" }", ", frame = \"frd-ned\" }") } else { channels };
        let found = findings(&Motion { frd_ned, ..Motion::default() }, &channels);
        let of_rates: Vec<_> =
            found.iter().filter(|(found, _)| *found == Quantity::AngularVelocity).collect();
        assert!(matches!(&of_rates[..], [(_, said)] if said == fits), "{columns}: {found:?}");
    }
}

#[test]
fn frames_are_converted_and_a_wrong_one_is_found() {
    let frd = Motion { frd_ned: true, ..Motion::default() };
    let framed = CHANNELS.replace(" }", ", frame = \"frd-ned\" }");
    let (converted, plain) =
        (read(&frd, &framed, "").unwrap(), read(&Motion::default(), CHANNELS, "").unwrap());
    for (a, b) in converted.position.values.iter().zip(&plain.position.values) {
        assert!(a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-9), "{a:?} {b:?}");
    }
    for (a, b) in converted.attitude.values.iter().zip(&plain.attitude.values) {
        assert!(a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>().abs() > 1.0 - 1e-9, "{a:?} {b:?}");
    }
    for (a, b) in converted.specific_force.values.iter().zip(&plain.specific_force.values) {
        assert!(a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-6), "{a:?} {b:?}");
    }
    let body = "specific_force = { columns = [\"fx\", \"fy\", \"fz\"], unit = \"m/s^2\" }";
    let wrong = framed.replace(&body.replace(" }", ", frame = \"frd-ned\" }"), body);
    assert!(findings(&frd, &wrong).iter().any(|(_, fits)| fits.contains("frd-ned")));
}

/// The gyroscope contradicts an attitude in the wrong frame, but it is not the gyroscope that is wrong.
#[test]
fn a_wrong_frame_is_looked_for_where_it_is() {
    let other = "`frame = \"frd-ned\"`";
    let in_other_frame = |channels: &str, channel: &str| {
        let line = |line: &str| match line.starts_with(channel) {
            true => format!("{}\n", line.replace(" }", ", frame = \"frd-ned\" }")),
            false => format!("{line}\n"),
        };
        channels.lines().map(line).collect::<String>()
    };
    let wrong =
        |channels: &str, channel: &str| findings(&Motion::default(), &in_other_frame(channels, channel));
    let flu = other.replace("frd-ned", "flu-enu");
    let attitude = wrong(CHANNELS, "attitude");
    assert!(attitude.contains(&(Quantity::Attitude, flu.clone())), "{attitude:?}");
    assert!(attitude.iter().all(|(channel, _)| *channel != Quantity::AngularVelocity), "{attitude:?}");
    let rates = wrong(CHANNELS, "angular_velocity");
    assert_eq!(rates, [(Quantity::AngularVelocity, flu.clone())]);
    // Nothing else tells which of the two is wrong.
    let alone: String = CHANNELS
        .lines()
        .filter(|line| {
            !["position", "velocity", "specific_force"].iter().any(|channel| line.starts_with(channel))
        })
        .map(|line| format!("{line}\n"))
        .collect();
    for (channel, fits) in [
        ("attitude", format!("{other} here or {flu} of `attitude`")),
        ("angular_velocity", format!("{flu} here or {other} of `attitude`")),
    ] {
        assert_eq!(wrong(&alone, channel), [(Quantity::AngularVelocity, fits)]);
    }
}

/// The channels with a specific force from other columns.
fn with_force(columns: &str, keys: &str) -> String {
    CHANNELS.replace("\"fx\", \"fy\", \"fz\"", columns).replace("\"m/s^2\"", &format!("\"m/s^2\"{keys}"))
}

const WORLD_ACCELERATION: &str = r#""ax", "ay", "az""#;
const WORLD_FORCE: &str = r#""ax", "ay", "sz""#;

#[test]
fn accelerations_in_the_world_become_specific_force_in_the_body() {
    let plain = read(&Motion::default(), CHANNELS, "").unwrap().specific_force;
    let same = |flight: &Flight| {
        assert_eq!(flight.specific_force.time_s, plain.time_s);
        for (a, b) in flight.specific_force.values.iter().zip(&plain.values) {
            assert!(a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-6), "{a:?} {b:?}");
        }
        let [note] = &flight.notes[..] else { panic!("{:?}", flight.notes) };
        assert!(
            note.starts_with("specific_force: computed with the attitude from what is declared as world-")
        );
    };
    for (columns, holds) in
        [(WORLD_ACCELERATION, "world-acceleration"), (WORLD_FORCE, "world-specific-force")]
    {
        let channels = with_force(columns, &format!(", holds = \"{holds}\""));
        same(&read(&Motion::default(), &channels, "").unwrap());
        let framed = channels.replace(" }", ", frame = \"frd-ned\" }");
        same(&read(&Motion { frd_ned: true, ..Motion::default() }, &framed, "").unwrap());
    }
}

#[test]
fn what_is_no_specific_force_is_refused_as_what_it_is() {
    let fits = |motion: &Motion, channels: &str, expected: &str| {
        let found = findings(motion, channels);
        assert_eq!(found, [(Quantity::SpecificForce, expected.to_owned())], "{channels}");
    };
    let plain = Motion::default();
    for channels in [
        with_force(WORLD_ACCELERATION, ""),
        with_force(WORLD_ACCELERATION, "").replace("velocity", "# velocity"),
    ] {
        let channels = channels.replace("angular_# velocity", "angular_velocity");
        fits(&plain, &channels, "`holds = \"world-acceleration\"`");
    }
    fits(&plain, &with_force(WORLD_FORCE, ""), "`holds = \"world-specific-force\"`");
    let body = with_force(r#""fx", "fy", "fz""#, ", holds = \"world-acceleration\"");
    fits(&plain, &body, "`holds = \"specific-force\"`");
    let force = with_force(WORLD_FORCE, ", holds = \"world-acceleration\"");
    fits(&plain, &force, "`holds = \"world-specific-force\"`");
    // PX4's own, beside channels whose frame is said, or in place of an accelerometer of its body.
    let frd = Motion { frd_ned: true, ..Motion::default() };
    let framed = with_force(WORLD_ACCELERATION, "").replace(" }", ", frame = \"frd-ned\" }");
    fits(&frd, &framed, "`holds = \"world-acceleration\"`");
    let unframed = framed.replace("\"m/s^2\", frame = \"frd-ned\"", "\"m/s^2\"");
    fits(&frd, &unframed, "`holds = \"world-acceleration\"` with `frame = \"frd-ned\"`");
    let text = read(&plain, &with_force(WORLD_ACCELERATION, ""), "").unwrap_err().to_string();
    assert!(
        text.contains("flights.toml:9:") && text.contains("differs from the vehicle's acceleration by"),
        "{text}"
    );
    let in_g = Motion { force_unit: 1.0 / 9.81, ..Motion::default() };
    fits(&in_g, &with_force(WORLD_ACCELERATION, ", holds = \"world-acceleration\""), "`unit = \"g\"`");
    assert!(read(&plain, &with_force(WORLD_ACCELERATION, ""), "trust_units = true").is_ok());
}

#[test]
fn what_a_force_holds_needs_an_attitude_and_a_force() {
    let channels = with_force(WORLD_ACCELERATION, ", holds = \"world-acceleration\"");
    let without = channels.replace("attitude =", "# attitude =");
    let text = refused(&without, "");
    assert!(
        text.contains("`holds`: expected an attitude at its times") && text.contains("map `attitude`"),
        "{text}"
    );
    let other = refused(&CHANNELS.replace("\"m/s\"", "\"m/s\", holds = \"world-acceleration\""), "");
    assert!(other.contains("`velocity`: `holds`: expected `specific_force` alone"), "{other}");
}

#[test]
fn trusted_units_are_noted_only() {
    let deg = Motion { rate_unit: 57.295_779_5, ..Motion::default() };
    let flight = read(&deg, CHANNELS, "trust_units = true").unwrap();
    assert!(flight.notes.iter().any(|note| note.contains("deg/s")), "{:?}", flight.notes);
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
        &["flights.toml:5:", "\"ft\"", "\"mm\"", "correct"],
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
    said(refused(CHANNELS, "from_s = 300"), &["no sample lies", "300", "from_s"]);
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
    has(&format!("{others}: 1 of 1000 samples have a time that does not grow"));
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
    assert_eq!((written.rows, written.notes.len()), (1001, 2), "{:?}", written.notes);
    // Its own column map reads it again.
    let again = place.load("flight.csv", &format!("\n{}", flights::columns(4)), "").unwrap();
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
    said(&crazyflie(&cut).unwrap(), "33 bytes of the log are no record");
    // A wrong event, a wrong byte in a value, and bytes that are missing, all in the middle.
    let mut broken = log.clone();
    broken[start + 100 * record] = 7;
    let flight = crazyflie(&broken).unwrap();
    assert_eq!(flight.command.time_s.len(), 199);
    said(&flight, "199 records were read, 43 bytes that are no record left out");
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
