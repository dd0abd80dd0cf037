//! The two vehicle files, and the error for every fault in a file.
#![allow(non_snake_case, reason = "units stand last in names, and the newton is N")]

use diagnostics::Diagnostic;
use std::f64::consts::PI;
use std::path::Path;

use vehicles::reference::{CRAZYFLIE, HUMMINGBIRD};
use vehicles::{MotorModel, Uncertainty, Vehicle};

const MASS_LINE: &str = r#"mass = { value = 0.480, unit = "kg", source = "thesis Table 2.1: take-off weight with the 2100 mAh battery", uncertainty = "not stated" }"#;

fn rpm(speed_rad_s: f64) -> f64 {
    speed_rad_s * 30.0 / PI
}

/// The line of the Hummingbird's file on which `needle` first stands, from 1.
fn line_of(needle: &str) -> usize {
    HUMMINGBIRD.lines().position(|line| line.contains(needle)).unwrap() + 1
}

fn refused(from: &str, to: &str) -> Diagnostic {
    assert!(HUMMINGBIRD.contains(from), "the test looks for {from:?}, which the file does not hold");
    Vehicle::parse(&HUMMINGBIRD.replacen(from, to, 1), "bird.toml").expect_err("this file must be refused")
}

/// The fault `from` -> `to` is reported on `line` and its message holds every one of `words`.
fn assert_refused(from: &str, to: &str, line: usize, words: &[&str]) {
    let error = refused(from, to);
    let message = error.to_string();
    let start = format!("bird.toml:{line}:");
    assert!(message.starts_with(&start), "expected {start} in: {message}");
    for word in words {
        assert!(message.contains(word), "expected {word:?} in: {message}");
    }
}

#[test]
fn the_hummingbird_is_the_thesiss() {
    let bird = Vehicle::parse(HUMMINGBIRD, "hummingbird.toml").unwrap();
    assert_eq!(bird.mass_kg, 0.480);
    assert_eq!(bird.inertia_kg_m2.diagonal().as_slice(), [5.6e-3, 5.6e-3, 8.1e-3]);
    assert!((rpm(bird.hover_speed_rad_s()) - 3930.0).abs() < 1.0);
    assert!((rpm(bird.command.speed(1.0)) - 1075.0).abs() < 1e-9);
    assert!((rpm(bird.command.speed(200.0)) - 8600.0).abs() < 1e-9);
    let names: Vec<_> = bird.rotors.iter().map(|rotor| rotor.name.as_str()).collect();
    assert_eq!(names, ["front", "right", "rear", "left"]);
    assert_eq!(bird.rotors.iter().map(|rotor| rotor.spin).collect::<Vec<_>>(), [-1.0, 1.0, -1.0, 1.0]);
}

#[test]
fn the_hummingbirds_motor_is_the_thesiss_transfer_function() {
    let MotorModel::SecondOrder { natural_frequency_rad_s: wn, damping_ratio: zeta } =
        Vehicle::parse(HUMMINGBIRD, "").unwrap().motor
    else {
        panic!("expected a second-order motor")
    };
    assert!((1.0 / (wn * wn) - 0.0044).abs() < 1e-15);
    assert!((2.0 * zeta / wn - 0.08).abs() < 1e-15);
}

#[test]
fn the_crazyflie_follows_its_sources_where_it_hovers() {
    let fly = Vehicle::parse(CRAZYFLIE, "crazyflie-2.1.toml").unwrap();
    let pwm = fly.hover_command();
    // Foerster's own thrust polynomial at this PWM: the quadratic law and his fit agree within 6 %.
    let thrust_N = 2.130295e-11 * pwm * pwm + 1.032633e-6 * pwm + 5.48456e-4;
    assert!((4.0 * thrust_N / (fly.mass_kg * fly.gravity_m_s2) - 1.0).abs() < 0.06);
    assert!((37_000.0..39_000.0).contains(&pwm), "hover PWM {pwm}");
    assert_eq!(fly.command.speed(0.0), 0.0);
    assert!((fly.command.speed(30_000.0) - (0.04076521 * 30_000.0 + 380.8359)).abs() < 1e-3);
}

#[test]
fn every_file_in_the_folder_loads_from_disk() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR"));
    for name in ["hummingbird.toml", "crazyflie-2.1.toml", "dji-f550.toml", "tarot-t18.toml"] {
        let vehicle = Vehicle::load(&folder.join(name)).unwrap();
        assert!(vehicle.provenance.len() >= 16 && vehicle.provenance.iter().all(|p| !p.source.is_empty()));
        // The spins cancel: hover needs no yaw torque.
        assert_eq!(vehicle.rotors.iter().map(|rotor| rotor.spin).sum::<f64>(), 0.0);
    }
}

#[test]
fn an_uncertainty_is_kept_in_si_or_in_words() {
    let fly = Vehicle::parse(CRAZYFLIE, "").unwrap();
    let of = |key: &str| fly.provenance.iter().find(|p| p.key == key).unwrap().uncertainty.clone();
    assert_eq!(of("rotors.0.position"), Uncertainty::OneSigma(0.0025));
    assert_eq!(of("body.mass"), Uncertainty::Said("not stated".into()));
}

#[test]
fn products_of_inertia_are_tensor_entries() {
    let line = r#"inertia_xy = { value = -2, unit = "g*m^2", source = "test", uncertainty = 0 }"#;
    let text = HUMMINGBIRD.replacen("[rotor]", &format!("{line}\n[rotor]"), 1);
    let tensor = Vehicle::parse(&text, "").unwrap().inertia_kg_m2;
    assert_eq!((tensor[(0, 1)], tensor[(1, 0)]), (-2e-3, -2e-3));
}

#[test]
fn the_unit_is_converted_and_the_files_own_unit_kept() {
    let text = HUMMINGBIRD.replacen("value = 0.480, unit = \"kg\"", "value = 480, unit = \"g\"", 1);
    let bird = Vehicle::parse(&text, "").unwrap();
    assert!((bird.mass_kg - 0.480).abs() < 1e-15);
    let mass = bird.provenance.iter().find(|p| p.key == "body.mass").unwrap();
    assert_eq!((mass.unit.as_str(), mass.line), ("g", line_of("mass = ")));
}

#[test]
fn a_missing_file_is_named() {
    let message = Vehicle::load(Path::new("no/such.toml")).unwrap_err().to_string();
    assert!(message.starts_with("no/such.toml: cannot read"), "{message}");
}

#[test]
fn an_unknown_key_is_named_with_its_place_and_the_known_ones() {
    let line = line_of("mass = ");
    assert_refused("mass = {", "mess = {", line, &["unknown key `body.mess`"]);
    assert_refused(
        "[rotor]",
        "colour = 1\n[rotor]",
        line_of("[rotor]"),
        &["unknown key `body.colour`", "inertia_xx"],
    );
    assert_refused(
        MASS_LINE,
        &MASS_LINE.replace(" }", ", sigma = 1 }"),
        line,
        &["unknown key `body.mass.sigma`", "`source`, `uncertainty`, `unit`, `value`"],
    );
    assert_refused("name = \"Asc", "nmae = 3\nname = \"Asc", line_of("name = "), &["`nmae`"]);
}

#[test]
fn a_misspelt_key_is_told_once_at_its_own_line() {
    for (from, to, key, meant) in [
        ("mass = {", "mas = {", "body.mas", "mass"),
        ("[motor]", "[moter]", "moter", "motor"),
        ("[body]", "[boddy]", "boddy", "body"),
        ("value = 0.480", "vlaue = 0.480", "body.mass.vlaue", "value"),
        ("name = \"front\"", "nmae = \"front\"", "rotors.0.nmae", "name"),
        ("spin = { value = \"clockwise\"", "spin = { valu = \"clockwise\"", "rotors.0.spin.valu", "value"),
    ] {
        let error = refused(from, to);
        assert_eq!(error.all().count(), 1, "{error}");
        assert_eq!((error.key(), &*error.help), (key, &*format!("did you mean `{meant}`?")), "{error}");
        assert_eq!(error.place.unwrap().line, line_of(from), "{key}");
    }
    let both = HUMMINGBIRD.replacen("[body]", "[boddy]", 1).replacen("[motor]", "[moter]", 1);
    let error = Vehicle::parse(&both, "bird.toml").unwrap_err();
    let keys: Vec<String> = error.all().map(|fault| fault.key().to_owned()).collect();
    assert_eq!(keys, ["boddy", "moter"], "{error}");
    let start = HUMMINGBIRD.find("[motor]").unwrap();
    let end = HUMMINGBIRD.find("[command]").unwrap();
    let without = [&HUMMINGBIRD[..start], &HUMMINGBIRD[end..]].concat();
    let told = Vehicle::parse(&without, "bird.toml").unwrap_err().to_string();
    let line = line_of("name = \"Asc");
    let told_of = format!(
        "bird.toml:{line}:1: missing key `motor`, expected a table\n  help: add [motor] to this file"
    );
    assert_eq!(told, told_of, "the first line that is no comment");
}

#[test]
fn a_column_points_at_the_value() {
    let error = refused("unit = \"kg\"", "unit = \"lb\"");
    let place = error.place.unwrap();
    assert_eq!(place.column, MASS_LINE.find("\"kg\"").unwrap() + 1);
}

#[test]
fn a_wrong_unit_is_named_with_the_accepted_ones() {
    let line = line_of("mass = ");
    assert_refused("unit = \"kg\"", "unit = \"lb\"", line, &["`body.mass.unit`", "\"kg\", \"g\"", "\"lb\""]);
    assert_refused("N/rpm^2", "N", line_of("thrust_coefficient"), &["N/(rad/s)^2", "N/rpm^2"]);
}

#[test]
fn a_parameter_lacking_a_field_is_refused() {
    let line = line_of("mass = ");
    for (field, key) in [
        ("value = 0.480, ", "body.mass.value"),
        (" unit = \"kg\",", "body.mass.unit"),
        ("source = \"thesis Table 2.1: take-off weight with the 2100 mAh battery\", ", "body.mass.source"),
        (", uncertainty = \"not stated\"", "body.mass.uncertainty"),
    ] {
        let without = MASS_LINE.replacen(field, "", 1);
        assert_refused(MASS_LINE, &without, line, &[&format!("missing key `{key}`")]);
    }
}

#[test]
fn a_number_without_a_source_says_so() {
    let changed = HUMMINGBIRD.replace(MASS_LINE, r#"mass = { value = 0.5, unit = "kg", source = "none" }"#);
    let bird = Vehicle::parse(&changed, "bird.toml").unwrap();
    let mass = bird.provenance.iter().find(|number| number.key == "body.mass").unwrap();
    assert_eq!((bird.mass_kg, mass.has_source()), (0.5, false));
    assert_eq!(mass.uncertainty, Uncertainty::Said("not stated".to_owned()));
    assert_eq!(bird.provenance.iter().filter(|number| !number.has_source()).count(), 1);
    let without = r#"mass = { value = 0.5, unit = "kg" }"#;
    assert_refused(
        MASS_LINE,
        without,
        line_of("mass = "),
        &["missing key `body.mass.source`", "or \"none\""],
    );
}

#[test]
fn a_number_that_is_not_physical_is_refused() {
    let mass = line_of("mass = ");
    assert_refused("value = 0.480", "value = -0.48", mass, &["body.mass", "above 0", "-0.48"]);
    assert_refused("value = 0.480", "value = 0", mass, &["above 0"]);
    assert_refused("value = 0.480", "value = nan", mass, &["finite"]);
    assert_refused("value = 0.480", "value = inf", mass, &["finite"]);
    assert_refused("value = 8.1e-3", "value = 11.3e-3", line_of("inertia_zz"), &["sum of the other two"]);
    assert_refused("value = 200", "value = 1", line_of("max = "), &["command.max", "above `command.min`"]);
    assert_refused("value = 7.6184e-8", "value = 1e308", line_of("thrust_coefficient"), &["finite in SI"]);
    assert_refused("\"not stated\"", "-1", mass, &["body.mass.uncertainty"]);
}

#[test]
fn a_wrong_type_is_named() {
    let mass = line_of("mass = ");
    assert_refused("value = 0.480", "value = \"0.480\"", mass, &["finite number", "the text \"0.480\""]);
    assert_refused(MASS_LINE, "mass = 0.48", mass, &["a table with value, unit, source and uncertainty"]);
    let bare = refused(MASS_LINE, "mass = 0.48");
    assert!(
        bare.help.starts_with("write mass = { value = 0.48, unit = \"kg\", source = \"none\" }"),
        "{bare}"
    );
    let text = refused(MASS_LINE, "mass = \"480 g\"");
    assert!(text.help.starts_with("write mass = { value = 480.0, unit = \"g\", source = "), "{text}");
    assert!(!refused(MASS_LINE, "mass = \"480 m\"").help.contains("value = 480"), "no unit of mass");
    let quoted = refused("value = 0.480", "value = \"0.480\"");
    assert_eq!(quoted.help, "a number has no quotation marks: write `value = 0.48`");
    assert_eq!(refused("[0.17, 0, 0]", "[\"0.17\", 0, 0]").help, "write numbers without quotation marks");
    assert_refused(
        "[0.17, 0, 0]",
        "[0.17, 0]",
        line_of("[0.17, 0, 0]"),
        &["an array of three numbers, found an array of 2"],
    );
    assert_refused("\"second-order\"", "\"third-order\"", line_of("second-order"), &["\"first-order\""]);
    let near = refused("\"second-order\"", "\"secondorder\"");
    assert_eq!(near.help, "did you mean \"second-order\"?");
    assert_refused("\"clockwise\"", "\"left\"", line_of("\"clockwise\""), &["counter-clockwise"]);
}

#[test]
fn a_vehicle_has_one_to_twelve_rotors() {
    let first = HUMMINGBIRD.find("[[rotors]]").unwrap();
    let last = HUMMINGBIRD.rfind("[[rotors]]").unwrap();
    let (before, rotor) = (&HUMMINGBIRD[..first], &HUMMINGBIRD[last..]);
    let named = |number: usize| rotor.replacen("name = \"left\"", &format!("name = \"rotor {number}\""), 1);
    let parse = |count: usize| {
        Vehicle::parse(&format!("{before}{}", (0..count).map(named).collect::<String>()), "bird.toml")
    };
    for count in [1, 3, 6, 12] {
        let vehicle = parse(count).unwrap();
        assert_eq!(vehicle.rotors.len(), count);
        let lift_N = count as f64 * vehicle.thrust_coefficient * vehicle.hover_speed_rad_s().powi(2);
        assert!(
            (lift_N / (vehicle.mass_kg * vehicle.gravity_m_s2) - 1.0).abs() < 1e-12,
            "{count}: {lift_N} N"
        );
    }
    let message = parse(13).unwrap_err().to_string();
    assert!(message.contains("must be 1 to 12 rotors, found 13"), "{message}");
    let message = parse(0).unwrap_err().to_string();
    assert!(message.contains("missing key `rotors`"), "{message}");
}

#[test]
fn two_rotors_of_one_name_are_refused_with_both_lines() {
    let text = HUMMINGBIRD.replace("name = \"rear\"", "name = \"front\"");
    let fault = Vehicle::parse(&text, "bird.toml").unwrap_err();
    assert_eq!(fault.key(), "rotors.2.name");
    let (first, second) = (line_of("name = \"front\""), line_of("name = \"rear\""));
    assert!(fault.to_string().contains(&format!("`rotors.0` in line {first}")), "{fault}");
    let shown = format!("{fault:#}");
    assert!(shown.contains(&format!("{first} | name = ")), "{shown}");
    assert!(shown.contains(&format!("{second} | name = ")), "{shown}");
}

/// The first rotor's `position` with a line behind it.
fn with_line(line: &str) -> String {
    let first = HUMMINGBIRD.find("position = ").unwrap();
    let end = first + HUMMINGBIRD[first..].find('\n').unwrap();
    format!("{}\n{line}{}", &HUMMINGBIRD[..end], &HUMMINGBIRD[end..])
}

#[test]
fn a_rotors_axis_is_a_direction_of_any_length() {
    let axis = |value: &str| {
        let line = format!("axis = {{ value = {value}, unit = \"1\", source = \"test\", uncertainty = 0 }}");
        Vehicle::parse(&with_line(&line), "bird.toml").map(|vehicle| vehicle.rotors[0].axis)
    };
    assert_eq!(Vehicle::parse(HUMMINGBIRD, "").unwrap().rotors[0].axis.as_slice(), [0.0, 0.0, 1.0]);
    assert_eq!(axis("[0, 0, 1]").unwrap().as_slice(), [0.0, 0.0, 1.0]);
    let tilted = axis("[0, 3, 4]").unwrap();
    assert!((tilted.y - 0.6).abs() < 1e-15 && (tilted.z - 0.8).abs() < 1e-15, "{tilted}");
    assert_eq!(axis("[0, 0, -2]").unwrap().as_slice(), [0.0, 0.0, -1.0]);
    assert_eq!(axis("[1, 0, 0]").unwrap().as_slice(), [1.0, 0.0, 0.0]);
    let message = axis("[0, 0, 0]").unwrap_err().to_string();
    assert!(message.contains("`rotors.0.axis` must be a direction, such as"), "{message}");
    assert!(axis("[nan, 0, 1]").is_err() && axis("[0, 1]").is_err());
}

/// A vehicle file on the Hummingbird's.
fn on_hummingbird(tables: &str) -> Result<Vehicle, Diagnostic> {
    let text = format!("name = \"mine\"\nbase = \"hummingbird.toml\"\n{tables}");
    Vehicle::parse_with(&text, "mine.toml", &|_| Ok(HUMMINGBIRD.to_owned()))
}

#[test]
fn a_file_on_a_base_replaces_single_numbers() {
    let base = Vehicle::parse(HUMMINGBIRD, "hummingbird.toml").unwrap();
    let number = |value: &str, unit: &str| {
        format!("{{ value = {value}, unit = \"{unit}\", source = \"scales\", uncertainty = 0.001 }}")
    };
    let tables = format!(
        "[body]\nmass = {}\n[command]\nspeed_at_max = {}",
        number("0.6", "kg"),
        number("9000", "rpm")
    );
    let vehicle = on_hummingbird(&tables).unwrap();
    assert_eq!((vehicle.mass_kg, &*vehicle.name), (0.6, "mine"));
    assert!((rpm(vehicle.command.speed_at_max_rad_s) - 9000.0).abs() < 1e-9);
    let command =
        vehicles::CommandMap { speed_at_max_rad_s: base.command.speed_at_max_rad_s, ..vehicle.command };
    let (mass_kg, name) = (base.mass_kg, base.name.clone());
    let provenance = base.provenance.clone();
    let rest = Vehicle { mass_kg, name, command, provenance, ..vehicle.clone() };
    assert_eq!(rest, base);
    // Each number once, with the file that it is from.
    let file = |key: &str| {
        let of: Vec<_> = vehicle.provenance.iter().filter(|number| number.key == key).collect();
        assert_eq!(of.len(), 1, "{key}");
        of[0].file.clone()
    };
    assert_eq!(vehicle.provenance.len(), base.provenance.len());
    assert_eq!([file("body.mass"), file("command.speed_at_max")], ["mine.toml", "mine.toml"]);
    assert_eq!([file("body.gravity"), file("command.min")], ["hummingbird.toml", "hummingbird.toml"]);
}

#[test]
fn a_value_alone_keeps_unit_source_and_uncertainty_of_the_base() {
    let base = Vehicle::parse(HUMMINGBIRD, "hummingbird.toml").unwrap();
    let of =
        |vehicle: &Vehicle, key: &str| vehicle.provenance.iter().find(|it| it.key == key).unwrap().clone();
    for mass in ["0.6", "{ value = 0.6 }"] {
        let vehicle =
            on_hummingbird(&format!("[body]\nmass = {mass}\n[command]\nspeed_at_max = 9000\n")).unwrap();
        assert_eq!(vehicle.mass_kg, 0.6);
        assert_eq!(vehicle.provenance.len(), base.provenance.len());
        let (own, of_base) = (of(&vehicle, "body.mass"), of(&base, "body.mass"));
        assert_eq!((&*own.file, own.line), ("mine.toml", 4));
        assert_eq!(
            (own.unit, own.source, own.uncertainty),
            (of_base.unit, of_base.source, of_base.uncertainty)
        );
    }
    let told = |tables: &str| on_hummingbird(tables).unwrap_err().to_string();
    let message = told("[body]\nmass = -1");
    assert!(message.starts_with("mine.toml:4:8: `body.mass` must be"), "{message}");
    let message = told("[body]\nmass = { value = 0.6, unit = \"kg\" }");
    assert!(message.contains("missing key `body.mass.source`"), "{message}");
    // Without a base there is nothing to keep.
    let line = HUMMINGBIRD.lines().find(|line| line.starts_with("mass = ")).unwrap();
    let message =
        Vehicle::parse(&HUMMINGBIRD.replacen(line, "mass = 0.6", 1), "a.toml").unwrap_err().to_string();
    assert!(message.contains("a table with value, unit, source and uncertainty, found 0.6"), "{message}");
}

#[test]
fn what_a_file_on_a_base_replaces_wrongly_is_told_at_its_place() {
    let told = |tables: &str| on_hummingbird(tables).unwrap_err().to_string();
    let number = "{ value = 300, unit = \"1\", source = \"test\", uncertainty = \"exact\" }";
    let message = told(&format!("[command]\nmin = {number}"));
    assert!(
        message.starts_with("mine.toml:4:17: `command.min` must be a command below `command.max`"),
        "{message}"
    );
    let moment = "{ value = 1, unit = \"kg*m^2\", source = \"test\", uncertainty = \"exact\" }";
    let message = told(&format!("[body]\ninertia_zz = {moment}"));
    assert!(message.starts_with("mine.toml:4:24: `body.inertia_xx, inertia_yy, inertia_zz`"), "{message}");
    // In a file of its own, too, the moment that is larger than the other two together is to blame.
    let line = HUMMINGBIRD.lines().find(|line| line.starts_with("inertia_zz")).unwrap();
    let number = HUMMINGBIRD.lines().position(|other| other == line).unwrap() + 1;
    let wrong = HUMMINGBIRD.replacen(line, &format!("inertia_zz = {moment}"), 1);
    let message = Vehicle::parse(&wrong, "a.toml").unwrap_err().to_string();
    assert!(message.contains(&format!("a.toml:{number}:24: `body.inertia_xx")), "{message}");
    let message = told("[body]\nmas = 3");
    assert!(message.starts_with("mine.toml:4:1: unknown key `body.mas`"), "{message}");
    assert!(message.ends_with("did you mean `mass`?"), "{message}");
}

#[test]
fn a_misspelt_key_is_told_beside_another_that_is_missing() {
    let gravity = HUMMINGBIRD.lines().find(|line| line.starts_with("gravity = ")).unwrap();
    let text = HUMMINGBIRD.replacen(gravity, "", 1).replacen("mass = {", "mas = {", 1);
    let message = Vehicle::parse(&text, "bird.toml").unwrap_err().to_string();
    assert!(message.contains("missing key `body.gravity`"), "{message}");
    assert!(!message.contains("missing key `body.mass`"), "{message}");
    assert!(
        message.contains("unknown key `body.mas`") && message.ends_with("did you mean `mass`?"),
        "{message}"
    );
}

#[test]
fn a_rotor_that_has_failed_stands_still_and_carries_nothing() {
    let line = "failed = { value = true, source = \"test\" }";
    let vehicle = Vehicle::parse(&with_line(line), "bird.toml").unwrap();
    let whole = Vehicle::parse(HUMMINGBIRD, "").unwrap();
    assert_eq!(
        vehicle.rotors.iter().map(|rotor| rotor.has_failed).collect::<Vec<_>>(),
        [true, false, false, false]
    );
    assert_eq!(
        (vehicle.commanded_speed_rad_s(0, 100.0), vehicle.commanded_speed_rad_s(1, 100.0)),
        (0.0, whole.command.speed(100.0))
    );
    let more = vehicle.hover_speed_rad_s() / whole.hover_speed_rad_s();
    assert!((more - (4.0_f64 / 3.0).sqrt()).abs() < 1e-12, "{more}");
}

#[test]
fn broken_toml_is_named_with_its_place() {
    assert_refused("[body]", "[body", line_of("[body]"), &["not valid TOML"]);
}

/// A small fixed generator, so that the test is the same on every machine.
struct Lcg(u64);

impl Lcg {
    fn below(&mut self, bound: usize) -> usize {
        self.0 = self.0.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        ((self.0 >> 33) as usize) % bound
    }
}

/// One to four random edits of the bytes: replaced, dropped, doubled, or cut off.
fn mutated(text: &str, random: &mut Lcg) -> String {
    let mut bytes = text.as_bytes().to_vec();
    for _ in 0..=random.below(4) {
        let (at, span) = (random.below(bytes.len()), random.below(30));
        let end = (at + span).min(bytes.len());
        match random.below(4) {
            0 => bytes[at] = b"{}[]=\"'#\n.,-0e9x_\xff"[random.below(18)],
            1 => drop(bytes.drain(at..end)),
            2 => bytes.splice(at..at, bytes[at..end].to_vec()).for_each(drop),
            _ => bytes.truncate(at.max(1)),
        }
        if bytes.is_empty() {
            bytes.push(b'x');
        }
    }
    String::from_utf8_lossy(&bytes).into_owned()
}

#[test]
fn no_text_makes_the_reader_panic_and_what_it_accepts_is_physical() {
    let mut random = Lcg(7);
    for round in 0..6000 {
        let source = if round % 2 == 0 { HUMMINGBIRD } else { CRAZYFLIE };
        match Vehicle::parse(&mutated(source, &mut random), "mutant.toml") {
            Ok(vehicle) => {
                assert!(vehicle.mass_kg > 0.0 && vehicle.mass_kg.is_finite());
                assert!(vehicle.inertia_kg_m2.try_inverse().is_some());
                assert!(vehicle.command.max > vehicle.command.min);
            }
            Err(error) => assert!(error.place.is_some_and(|place| place.line > 0)),
        }
    }
}

#[test]
fn several_faults_are_told_at_once_each_with_its_place() {
    let text =
        HUMMINGBIRD.replacen("value = 0.480", "value = -1", 1).replacen("\"first-order\"", "\"none\"", 1);
    let text = text.replacen("\"second-order\"", "\"none\"", 1).replacen("spin", "spni", 1);
    let error = Vehicle::parse(&text, "bird.toml").unwrap_err();
    let faults: Vec<Diagnostic> = error.all().collect();
    assert_eq!(faults.len(), 3, "{error}");
    for (fault, key) in faults.iter().zip(["`body.mass", "`motor.model`", "spin"]) {
        let message = fault.to_string();
        assert!(message.starts_with("bird.toml:") && message.contains(key), "{message}");
        assert!(error.to_string().contains(&message));
    }
}

#[test]
fn all_faults_of_a_number_a_rotor_and_an_effect_are_told() {
    let keys = |changes: &[(&str, &str)]| {
        let change = |text: String, (from, to): &(&str, &str)| {
            assert!(text.contains(from), "the file has {from}");
            text.replacen(from, to, 1)
        };
        let text = changes.iter().fold(HUMMINGBIRD.to_owned(), change);
        let error = Vehicle::parse(&text, "bird.toml").unwrap_err();
        error.all().map(|fault| fault.key().to_owned()).collect::<Vec<_>>()
    };
    let mass = MASS_LINE.replacen("0.480, unit = \"kg\"", "\"x\", unit = \"m\"", 1);
    let mass = mass.replacen("source", "colour = 1, source", 1);
    assert_eq!(keys(&[(MASS_LINE, &mass)]), ["body.mass.value", "body.mass.unit", "body.mass.colour"]);
    let rotor = [("[0.17, 0, 0]", "[0.17, 0]"), ("value = \"clockwise\", source", "value = \"left\", sorce")];
    let of_rotor = ["rotors.0.position.value", "rotors.0.spin.value", "rotors.0.spin.sorce"];
    assert_eq!(keys(&rotor), of_rotor);
    assert_eq!(keys(&[("[0.17, 0, 0]", "[1e9, 0, 1e9]")]), ["rotors.0.position"; 2]);
    let moments = [("inertia_xx = { value = 5.6e-3", "inertia_xx = { value = -1"), ("8.1e-3", "0")];
    assert_eq!(keys(&moments), ["body.inertia_xx", "body.inertia_zz"]);
    assert_eq!(
        keys(&[("value = 200", "value = 1"), ("value = 8600", "value = 1000")]),
        ["command.max", "command.speed_at_max"]
    );
    let effect = "[[effects]]\nname = 3\nx = 1\n[envelope]\nspeed_max = 1\ntilt_max = 2\n\n[[rotors]]";
    let of_effect = ["effects.0.name", "effects.0.x", "envelope.speed_max", "envelope.tilt_max"];
    assert_eq!(keys(&[("[[rotors]]", effect)]), of_effect);
}

#[test]
fn the_faults_of_a_base_and_of_the_file_on_it_are_told() {
    let base = HUMMINGBIRD.replacen("value = 0.480", "value = -1", 1);
    let text = "name = \"mine\"\nbase = \"bird.toml\"\n[command]\nmax = \"x\"\n";
    let error = Vehicle::parse_with(text, "mine.toml", &|_| Ok(base.clone())).unwrap_err();
    let told: Vec<String> = error.all().map(|fault| format!("{} {}", fault.file, fault.key())).collect();
    assert_eq!(told, ["bird.toml body.mass", "mine.toml command.max"]);
}

#[test]
fn robot_descriptions_are_named_and_the_page_of_keys_has_every_key() {
    let urdf = "<?xml version=\"1.0\"?>\n<!-- mine -->\n<robot name=\"q\"><link name=\"base\"/></robot>";
    let cases = [
        (urdf, "URDF"),
        ("\u{feff}<robot name=\"q\"/>", "URDF"),
        ("<?xml version=\"1.0\"?><sdf version=\"1.6\"><model name=\"iris\"/></sdf>", "SDF"),
        ("\n<mujoco model=\"x2\"/>", "MJCF"),
        ("<html></html>", "XML"),
    ];
    for (text, name) in cases {
        let error = Vehicle::parse(text, "quad.urdf").unwrap_err().to_string();
        assert!(error.contains("quad.urdf") && error.contains(name) && error.contains("TOML"), "{error}");
        assert!(error.contains("docs/vehicles.md"), "{error}");
        let made_by = if matches!(name, "URDF" | "SDF") { "new vehicle --from quad.urdf" } else { "" };
        assert!(error.contains(made_by) && (name != "XML" || !error.contains("new vehicle")), "{error}");
    }
    let page = include_str!("../../docs/vehicles.md");
    let vehicle = Vehicle::parse(vehicles::reference::HUMMINGBIRD, "hummingbird.toml").unwrap();
    for number in &vehicle.provenance {
        let key = number.key.rsplit('.').next().unwrap();
        assert!(page.contains(key), "docs/vehicles.md has no `{}`", number.key);
    }
}
