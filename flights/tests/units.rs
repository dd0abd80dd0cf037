//! Units and scales: those that the log has and those that are declared.

use crate::support::made::{CHANNELS, changed, findings, read, refused, without};
use crate::support::{Motion, Place};
use flights::Quantity;
use nalgebra::{UnitQuaternion, Vector3};

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

#[test]
fn shares_beyond_the_range_are_refused() {
    let percent = CHANNELS.replace("\"count\"", "\"%\"");
    // Commands of about 100 of 200.
    let of_commands = |command_unit: f64| Motion { command_unit, ..Motion::default() };
    assert_eq!(read(&of_commands(0.5), &percent, "").unwrap().notes, [""; 0]);
    let found = findings(&of_commands(1.4), &percent);
    let says = |fits: &str| fits.contains("a `scale` by which full thrust");
    assert!(found.iter().any(|(quantity, fits)| *quantity == Quantity::Command && says(fits)), "{found:?}");
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

/// The plain log with its times in minutes, hours or days.
fn in_long_units(unit_s: f64) -> String {
    let plain = Motion::default().csv();
    let (header, rows) = plain.split_once('\n').unwrap();
    let row = |line: &str| {
        let (time, rest) = line.split_once(',').unwrap();
        format!("{:.12},{rest}\n", time.parse::<f64>().unwrap() / unit_s)
    };
    format!("{header}\n{}", rows.lines().map(row).collect::<String>())
}

#[test]
fn times_in_minutes_hours_and_days_are_found_with_their_scale() {
    let place = Place::new();
    for (name, unit_s) in [("minutes", 60.0), ("hours", 3600.0), ("days", 86_400.0)] {
        place.write("log.csv", in_long_units(unit_s).as_bytes());
        let text = place.load("log.csv", CHANNELS, "").unwrap_err().to_string();
        let fits = format!("`unit = \"s\"` with `scale = {unit_s}` ({name})");
        assert!(text.contains("flights.toml:3:") && text.contains(&fits), "{text}");
        let scaled = CHANNELS.replacen("unit = \"s\"", &format!("unit = \"s\", scale = {unit_s}"), 1);
        assert_eq!(place.load("log.csv", &scaled, "").unwrap().notes, [""; 0], "{name}");
    }
}

#[test]
fn a_pitch_beyond_a_right_angle_is_refused() {
    let attitude = "attitude = { euler = [\"roll\", \"pitch\", \"yaw\"], unit = \"deg\" }";
    let quaternion = "attitude = { columns = [\"qx\", \"qy\", \"qz\", \"qw\"] }";
    let channels = CHANNELS.replace(quaternion, attitude);
    assert_ne!(channels, CHANNELS);
    let in_degrees = |part: f64| Motion { angle_unit: 57.295_779_5 * part, ..Motion::default() };
    assert_eq!(read(&in_degrees(1.0), &channels, "").unwrap().notes, [""; 0]);
    let text = read(&in_degrees(100.0), &channels, "").unwrap_err().to_string();
    for part in
        ["`attitude`", "a pitch of at most 90 degrees either way", "found up to", "`unit`", "`scale = 0.1`"]
    {
        assert!(text.contains(part), "{part} is not in: {text}");
    }
    let scaled = channels.replace("unit = \"deg\" }", "unit = \"deg\", scale = 0.01 }");
    assert_eq!(read(&in_degrees(100.0), &scaled, "").unwrap().notes, [""; 0]);
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
    assert!(text.contains("write `unit = \"deg\"`, which would fit"), "{text}");
    assert!(read(&degrees, &poses("rad"), "trust_units = true").is_ok());
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
    assert!(refused(&of_rates, "").contains("expected this key in `rotor_speed` alone"));
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
        let has_source = fits.contains("(take the figure of the sensor's data sheet)");
        assert!(has_source || fits.contains("alone leaves the values"), "{fits}");
    };
    let force = |force_unit| Motion { force_unit, ..Motion::default() };
    scaled(Quantity::SpecificForce, force(4096.0 / 9.81), 9.81 / 4096.0);
    scaled(Quantity::SpecificForce, force(0.01), 100.0);
    let rate = |rate_unit| Motion { rate_unit, ..Motion::default() };
    scaled(Quantity::AngularVelocity, rate(16.4 * 57.3), 1.0 / 16.4 / 57.3);
    scaled(Quantity::AngularVelocity, rate(0.01), 100.0);
}

/// The median force of a flight is not exactly gravity's: a scale of a known unit is not rounded to it.
#[test]
fn accelerations_in_a_foreign_unit_are_advised_with_its_exact_size() {
    for (per_m_s2, declared, scale, name) in [
        (1000.0, "m/s^2", "0.001", "mm/s^2"),
        (1000.0, "g", "0.001", "mm/s^2"),
        (1.0 / 0.3048, "m/s^2", "0.3048", "ft/s^2"),
    ] {
        let motion = Motion { force_unit: per_m_s2, ..Motion::default() };
        let declare = |keys: &str| CHANNELS.replace("unit = \"m/s^2\"", keys);
        let found = findings(&motion, &declare(&format!("unit = {declared:?}")));
        let fits = format!("no unit alone, but `unit = \"m/s^2\"` with `scale = {scale}` ({name})");
        assert!(found.contains(&(Quantity::SpecificForce, fits)), "{per_m_s2} {declared}: {found:?}");
        let flight = read(&motion, &declare(&format!("unit = \"m/s^2\", scale = {scale}")), "").unwrap();
        assert_eq!(flight.notes, [""; 0]);
    }
}

/// A flight does not show the 2 % between them.
#[test]
fn mg_and_cm_s2_are_advised_together() {
    for per_m_s2 in [100.0, 1000.0 / 9.806_65] {
        let found = findings(&Motion { force_unit: per_m_s2, ..Motion::default() }, CHANNELS);
        let fits = "`unit = \"mg\"` or `unit = \"m/s^2\"` with `scale = 0.01` (cm/s^2)".to_owned();
        assert!(found.contains(&(Quantity::SpecificForce, fits)), "{found:?}");
    }
}

#[test]
fn trusted_units_are_noted_only() {
    let deg = Motion { rate_unit: 57.295_779_5, ..Motion::default() };
    let flight = read(&deg, CHANNELS, "trust_units = true").unwrap();
    assert!(flight.notes.iter().any(|note| note.contains("deg/s")), "{:?}", flight.notes);
}

#[test]
fn torques_are_compared_unless_the_flight_says_that_they_are_not() {
    for (key, expected) in [("", false), ("torques = true", false), ("torques = false", true)] {
        assert_eq!(read(&Motion::default(), CHANNELS, key).unwrap().without_torques, expected, "{key}");
    }
}
