//! Stands of known rotors: the truth lies in the intervals as often as they promise, and the right order is chosen.
//! The stand of esc-test: its figures and its faults.

use crate::skipped;
use std::fmt::Write as _;
use std::fs;
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::thread;

use identify::rotor::{self, Order, RotorReport};
use identify::statistics::Estimate;
use rand_chacha::ChaCha8Rng;
use rand_core::SeedableRng;
use tempfile::TempDir;

const C_T: f64 = 4.0e-6;
const C_Q: f64 = 6.0e-8;
const CASES: u64 = 200;
/// Cases of quick tests: at a true rate of 95 %, fewer than 90 hold the truth once in 90 times; the seeds are fixed.
const QUICK_CASES: u64 = 100;

/// Random numbers of a case.
struct Draws(ChaCha8Rng);

impl Draws {
    fn new(seed: u64) -> Self {
        Self(ChaCha8Rng::seed_from_u64(seed))
    }

    fn normal(&mut self) -> f64 {
        component::random::normal(&mut self.0)
    }

    /// From 0 to 1.
    fn uniform(&mut self) -> f64 {
        component::random::uniform(&mut self.0)
    }
}

/// A stand log at 20 Hz: a rest, 14 plateaus of 3 s, a rest. Readings have a tare, noise that remembers, and an error
/// of 1 % that stays for a plateau.
fn static_log(draws: &mut Draws, sign_of_torque: f64) -> String {
    let mut text = "time,speed,thrust,torque\n".to_owned();
    let speeds =
        (0..16).map(|plateau| if plateau % 15 == 0 { 0.0 } else { 200.0 + 85.0 * f64::from(plateau) });
    let (mut row, mut noise) = (0, [0.0; 2]);
    for speed in speeds {
        let errors = [draws.normal(), draws.normal()].map(|error| 1.0 + 0.01 * error);
        for _ in 0..60 {
            noise = noise.map(|state| 0.9 * state + 0.4 * draws.normal());
            let thrust = C_T * speed * speed * errors[0] - 0.03 + 0.01 * noise[0];
            let torque = sign_of_torque * (C_Q * speed * speed * errors[1] + 0.002 + 2e-4 * noise[1]);
            let measured = speed * (1.0 + 1e-3 * draws.normal());
            writeln!(text, "{:.3},{measured:.3},{thrust:.6},{torque:.8}", f64::from(row) * 0.05).unwrap();
            row += 1;
        }
    }
    text
}

/// A motor 1 / (a2 s^2 + a1 s + 1) and its present motion.
struct Motor {
    a1_s: f64,
    a2_s2: f64,
    speed: f64,
    acceleration: f64,
}

impl Motor {
    fn second(wn: f64, zeta: f64) -> Self {
        Self { a1_s: 2.0 * zeta / wn, a2_s2: 1.0 / (wn * wn), speed: 300.0, acceleration: 0.0 }
    }

    fn first(time_constant_s: f64) -> Self {
        Self { a1_s: time_constant_s, a2_s2: 0.0, speed: 300.0, acceleration: 0.0 }
    }

    /// Runs on by `h` seconds: exactly for a first order, by the fourth-order Runge-Kutta method for a second.
    fn run(&mut self, target: f64, h: f64) {
        if self.a2_s2 == 0.0 {
            self.speed = target + (self.speed - target) * libm::exp(-h / self.a1_s);
            return;
        }
        let rate = |[w, v]: [f64; 2]| [v, (target - w - self.a1_s * v) / self.a2_s2];
        let x = [self.speed, self.acceleration];
        let ahead = |k: [f64; 2], part: f64| [x[0] + part * h * k[0], x[1] + part * h * k[1]];
        let k1 = rate(x);
        let k2 = rate(ahead(k1, 0.5));
        let k3 = rate(ahead(k2, 0.5));
        let k4 = rate(ahead(k3, 1.0));
        let sum = [0, 1].map(|i| (k1[i] + 2.0 * k2[i] + 2.0 * k3[i] + k4[i]) / 6.0);
        [self.speed, self.acceleration] = ahead(sum, 1.0);
    }
}

/// A log of steps at 100 Hz; each takes effect somewhere within the row before it is seen, and stamps come in pairs.
fn dynamic_log(draws: &mut Draws, mut motor: Motor, noise_rad_s: f64) -> String {
    const PARTS: u32 = 20;
    let mut text = "time,duty,speed\n".to_owned();
    let duties = [20, 30, 45, 35, 50, 65, 55, 70, 85, 75, 60, 40, 25, 45, 65, 80, 60, 35, 50].map(f64::from);
    let target = |duty: f64| 60.0 + 12.0 * duty;
    motor.speed = target(duties[0]);
    let mut row = 0_u32;
    let mut before = duties[0];
    for duty in duties {
        let onset = (draws.uniform() * f64::from(PARTS)) as u32;
        for held in 0..80 {
            for part in 0..PARTS {
                let asked = if held == 0 && part < onset { before } else { duty };
                motor.run(target(asked), 0.01 / f64::from(PARTS));
            }
            let stamp =
                f64::from(row / 2 * 2 + 1) * 0.01 + 0.001 * f64::from(row % 2) + 9e-4 * draws.uniform();
            writeln!(text, "{stamp:.4},{duty},{:.3}", motor.speed + noise_rad_s * draws.normal()).unwrap();
            row += 1;
        }
        before = duty;
    }
    text
}

const STATIC: &str = r#"
[[static]]
file = "static.csv"
held_out = 0.3
time = { column = "time", unit = "s" }
speed = { column = "speed", unit = "rad/s" }
thrust = { column = "thrust", unit = "N" }
torque = { column = "torque", unit = "N*m" }
"#;

const DYNAMIC: &str = r#"
[[dynamic]]
file = "dynamic.csv"
held_out = 0.4
clock = "rows"
time = { column = "time", unit = "s" }
speed = { column = "speed", unit = "rad/s" }
command = { column = "duty", unit = "%" }
"#;

/// A folder with a stand file and its logs.
struct Stand {
    dir: TempDir,
}

impl Stand {
    fn new(tables: &str) -> Self {
        let stand = Self { dir: tempfile::tempdir().unwrap() };
        stand.write("stand.toml", &format!("name = \"made up\"\n{tables}"));
        stand
    }

    fn write(&self, name: &str, text: &str) {
        fs::write(self.dir.path().join(name), text).unwrap();
    }

    fn run(&self) -> Result<RotorReport, rotor::RotorError> {
        let found = rotor::run(&self.dir.path().join("stand.toml"))?;
        fs::create_dir_all(self.dir.path().join("out")).unwrap();
        self.write("out/rotor.toml", &found.tables);
        self.write("out/rotor.json", &found.figures);
        Ok(found.report)
    }

    fn text(&self, name: &str) -> String {
        fs::read_to_string(self.dir.path().join("out").join(name)).unwrap()
    }
}

fn static_stand(seed: u64) -> RotorReport {
    let stand = Stand::new(STATIC);
    stand.write("static.csv", &static_log(&mut Draws::new(seed), 1.0));
    stand.run().unwrap()
}

fn dynamic_stand(seed: u64, motor: Motor) -> RotorReport {
    let stand = Stand::new(DYNAMIC);
    stand.write("dynamic.csv", &dynamic_log(&mut Draws::new(seed), motor, 4.0));
    stand.run().unwrap()
}

/// The answers of all cases that the running test takes, by two threads.
fn all_cases<T: Send>(case: impl Fn(u64) -> T + Sync) -> Vec<T> {
    let count = if skipped::is_thorough() { CASES } else { QUICK_CASES };
    skipped::leave((CASES - count) as usize, "seeds");
    let half = |odd: u64| (0..count / 2).map(|index| case(2 * index + odd)).collect::<Vec<T>>();
    thread::scope(|scope| {
        let other = scope.spawn(|| half(1));
        let mut all = half(0);
        all.extend(other.join().unwrap());
        all
    })
}

fn require_coverage(name: &str, truth: f64, estimates: impl Iterator<Item = Option<Estimate>>) {
    let inside = |estimate: Option<Estimate>| {
        estimate.is_some_and(|estimate| estimate.low <= truth && truth <= estimate.high)
    };
    let estimates: Vec<Option<Estimate>> = estimates.collect();
    let count = estimates.len();
    let holds = estimates.into_iter().filter(|estimate| inside(*estimate)).count() as f64 / count as f64;
    let _ =
        writeln!(std::io::stderr(), "{name}: the truth is inside in {:.1} % of {count} cases", 100.0 * holds);
    assert!((0.90..=0.99).contains(&holds), "{name}: {holds}");
}

#[test]
fn coefficients_lie_in_their_intervals_at_their_rate() {
    let reports = all_cases(static_stand);
    let statics = || reports.iter().map(|report| report.statics.as_ref().unwrap());
    require_coverage("c_T", C_T, statics().map(|fit| fit.thrust.as_ref().map(|thrust| thrust.value)));
    require_coverage("c_Q", C_Q, statics().map(|fit| fit.torque.as_ref().map(|torque| torque.value)));
    let powers = || statics().flat_map(|fit| [&fit.thrust, &fit.torque]).flatten();
    let truth_is_inside = powers().filter(|fit| fit.exponent.low <= 2.0 && 2.0 <= fit.exponent.high);
    let holds = truth_is_inside.count() as f64 / powers().count() as f64;
    let _ = writeln!(std::io::stderr(), "power of w: the truth is inside in {:.1} %", 100.0 * holds);
    assert!((0.90..=0.99).contains(&holds), "power of w: {holds}");
    assert!(statics().all(|fit| fit.thrust.as_ref().unwrap().held_out.unwrap().r_squared > 0.99));
}

#[test]
fn a_first_order_motor_is_told_as_one() {
    let reports = all_cases(|seed| dynamic_stand(seed, Motor::first(0.04)));
    let dynamics = || reports.iter().map(|report| report.dynamics.as_ref().unwrap());
    require_coverage("time constant", 0.04, dynamics().map(|fit| fit.first.time_constant_s));
    let right = dynamics().filter(|fit| fit.comparison.preferred == Order::First).count();
    assert!(right >= reports.len() * 95 / 100, "{right} of {}", reports.len());
}

#[test]
fn a_second_order_motor_is_told_as_one() {
    let reports = all_cases(|seed| dynamic_stand(seed, Motor::second(45.0, 0.8)));
    let dynamics = || reports.iter().map(|report| report.dynamics.as_ref().unwrap());
    require_coverage("natural frequency", 45.0, dynamics().map(|fit| fit.second.natural_frequency_rad_s));
    require_coverage("damping ratio", 0.8, dynamics().map(|fit| fit.second.damping_ratio));
    let right = dynamics().filter(|fit| fit.comparison.preferred == Order::Second).count();
    assert!(right >= reports.len() * 95 / 100, "{right} of {}", reports.len());
}

#[test]
fn the_line_from_the_command_to_the_speed_is_found() {
    let report = dynamic_stand(7, Motor::first(0.05));
    let command = report.dynamics.unwrap().command.unwrap();
    assert_eq!((command.min, command.max, command.zero_is_off), (20.0, 85.0, false));
    assert!((command.speed_at_min_rad_s.value - 300.0).abs() < 2.0, "{command:?}");
    assert!((command.speed_at_max_rad_s.value - 1080.0).abs() < 2.0, "{command:?}");
}

#[test]
fn a_torque_of_the_other_sign_is_turned_and_said() {
    let stand = Stand::new(STATIC);
    stand.write("static.csv", &static_log(&mut Draws::new(3), -1.0));
    let statics = stand.run().unwrap().statics.unwrap();
    assert!((statics.torque.unwrap().value.value / C_Q - 1.0).abs() < 0.03);
    assert!(
        statics.findings.iter().any(|finding| finding.contains("torque: it is negative")),
        "{:?}",
        statics.findings
    );
}

#[test]
fn an_electrical_speed_is_divided_or_found_out() {
    let log = static_log(&mut Draws::new(4), 1.0);
    let odd = |report: &RotorReport| report.to_string().contains("no propeller has");
    let plain = STATIC.replace("[[static]]", "propeller_diameter_m = 0.1778\n[[static]]");
    let run = |tables: &str| {
        let stand = Stand::new(tables);
        stand.write("static.csv", &log);
        stand.run().unwrap()
    };
    assert!(!odd(&run(&plain)), "{}", run(&plain));
    let divided = run(&plain.replace("unit = \"rad/s\"", "unit = \"rad/s\", pole_pairs = 7"));
    assert!(odd(&divided), "{divided}");
}

/// A vehicle file whose tables are replaced by those of `tables`.
fn merged(tables: &str) -> String {
    let base = vehicles::reference::HUMMINGBIRD;
    let mut file: toml::Table = base.parse().unwrap();
    let tables: toml::Table = tables.parse().unwrap();
    file.extend(tables);
    file.to_string()
}

fn hummingbird() -> String {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../vehicles/hummingbird.toml");
    format!("vehicle = {}\n", toml::Value::from(path.to_str().unwrap()))
}

#[test]
fn the_tables_belong_into_a_vehicle_file() {
    for motor in [Motor::first(0.05), Motor::second(30.0, 0.7)] {
        let stand = Stand::new(&(hummingbird() + STATIC + DYNAMIC));
        let mut draws = Draws::new(5);
        stand.write("static.csv", &static_log(&mut draws, 1.0));
        stand.write("dynamic.csv", &dynamic_log(&mut draws, motor, 4.0));
        let report = stand.run().unwrap();
        let vehicle = vehicles::Vehicle::parse(&merged(&stand.text("rotor.toml")), "merged.toml").unwrap();
        // Vehicle files have six digits, reports all.
        let thrust = report.statics.unwrap().thrust.unwrap().value.value;
        assert!(
            (vehicle.thrust_coefficient / thrust - 1.0).abs() < 5e-6,
            "{} for {thrust}",
            vehicle.thrust_coefficient
        );
        assert_eq!(vehicle.rotor_inertia_kg_m2, 3.1e-5);
        assert_eq!(vehicle.command.max, 85.0);
        let json: serde_json::Value = serde_json::from_str(&stand.text("rotor.json")).unwrap();
        assert_eq!(json["statics"]["thrust"]["value"]["value"], thrust);
    }
}

#[test]
fn what_a_stand_does_not_tell_is_taken_over() {
    let stand = Stand::new(&(hummingbird() + STATIC));
    stand.write("static.csv", &static_log(&mut Draws::new(6), 1.0));
    stand.run().unwrap();
    let vehicle = vehicles::Vehicle::parse(&merged(&stand.text("rotor.toml")), "merged.toml").unwrap();
    let base = vehicles::Vehicle::parse(vehicles::reference::HUMMINGBIRD, "").unwrap();
    assert_eq!((vehicle.motor, vehicle.command), (base.motor, base.command));
}

#[test]
fn mistakes_are_said_with_what_to_do() {
    let error = |tables: &str| {
        let stand = Stand::new(tables);
        stand.write("static.csv", "time,speed,thrust,torque\n0,0,0,0\n1,0,0,0\n");
        stand.write("dynamic.csv", "time,duty,speed\n0,10,100\n1,10,100\n");
        stand.run().unwrap_err().to_string()
    };
    assert!(error("").contains("at least one log"), "{}", error(""));
    let both = error(&STATIC.replace("held_out = 0.3", "held_out = 2.0\nsettle_s = -1.0"));
    assert!(both.contains("`static.0.held_out`") && both.contains("`static.0.settle_s`"), "{both}");
    assert!(error("extra = 1").contains("unknown key `extra`"), "{}", error("extra = 1"));
    let unit = error(&STATIC.replace("\"N*m\"", "\"gf\""));
    assert!(unit.contains("static.0.torque.unit") && unit.contains("found gf"), "{unit}");
    let column = error(&STATIC.replace("column = \"thrust\"", "column = \"Thrust\""));
    assert!(column.contains("no column `Thrust`; it has time, speed, thrust, torque"), "{column}");
    assert!(error(STATIC).contains("4 plateaus to fit on, found 0"), "{}", error(STATIC));
    assert!(error(DYNAMIC).contains("found"), "{}", error(DYNAMIC));
    let path = error(&STATIC.replace("static.csv", "${NOT_SET_ANYWHERE}/static.csv"));
    assert!(path.contains("`static.0.file`"), "{path}");
}

/// A stand whose log `first` is fitted on and `second` tested on; the text of the refusal, if it is one.
fn held_out(table: &str, first: &str, second: &str) -> Result<(), String> {
    let name = if table == STATIC { "static" } else { "dynamic" };
    let test = table
        .replace(&format!("{name}.csv"), "other.csv")
        .replace("held_out = 0", "role = \"test\"\nheld_out = 0");
    let stand = Stand::new(&format!("{table}{test}"));
    stand.write(&format!("{name}.csv"), first);
    stand.write("other.csv", second);
    stand.run().map(|_| ()).map_err(|error| error.to_string())
}

#[test]
fn a_log_to_test_on_that_is_fitted_on_is_refused() {
    let logs = |seed: u64| {
        let motor = || Motor::first(0.04);
        [
            (STATIC, static_log(&mut Draws::new(seed), 1.0)),
            (DYNAMIC, dynamic_log(&mut Draws::new(seed), motor(), 4.0)),
        ]
    };
    for ((table, first), (_, other)) in logs(1).into_iter().zip(logs(2)) {
        held_out(table, &first, &other).unwrap();
        let part: String = first
            .lines()
            .enumerate()
            .filter(|(row, _)| *row == 0 || *row > 300)
            .map(|(_, line)| line.to_owned() + "\n")
            .collect();
        for (second, how) in [(&first, "copies of the same bytes"), (&part, "rows are the same")] {
            let message = held_out(table, &first, second).unwrap_err();
            for part in [how, "other.csv", "role \"test\"", "is not held out", "by `held_out`"] {
                assert!(message.contains(part), "`{part}` is not in: {message}");
            }
        }
    }
    let stand = Stand::new(&format!("{STATIC}{}", STATIC.replace("held_out = 0.3", "role = \"test\"")));
    stand.write("static.csv", &static_log(&mut Draws::new(1), 1.0));
    assert!(stand.run().unwrap_err().to_string().contains("the same file"));
}

#[test]
fn stray_marks_and_stamps_of_any_size_in_stand_logs_end_in_words() {
    let of_static = |log: &str| {
        let stand = Stand::new(STATIC);
        stand.write("static.csv", log);
        stand.run().map(|_| ()).map_err(|error| error.to_string())
    };
    let log = static_log(&mut Draws::new(1), 1.0);
    of_static(&log).unwrap();
    let mut lines: Vec<String> = log.lines().map(str::to_owned).collect();
    lines[101] = lines[101].replacen(',', ",\"", 1);
    let message = of_static(&lines.join("\n")).unwrap_err();
    assert!(message.contains("static.csv") && message.contains("line 102, cell 2"), "{message}");
    let stamped = |stamp: &dyn Fn(f64) -> f64, log: &str| {
        let mut rows = log.lines();
        let mut text = rows.next().unwrap().to_owned() + "\n";
        for (row, line) in rows.enumerate() {
            text += &format!("{},{}\n", stamp(row as f64), line.split_once(',').unwrap().1);
        }
        text
    };
    let of_dynamic = |log: &str| {
        let stand = Stand::new(DYNAMIC);
        stand.write("dynamic.csv", log);
        stand.run().map(|_| ()).map_err(|error| error.to_string())
    };
    let steps = dynamic_log(&mut Draws::new(1), Motor::first(0.04), 4.0);
    let stamps: [&dyn Fn(f64) -> f64; 4] =
        [&|row| 1e16 * row, &|row| 1e-300 * row, &|row| if row < 1.0 { 0.0 } else { 1e16 + row }, &|_| 0.0];
    for stamp in stamps {
        let (of_static, of_dynamic) = (of_static(&stamped(stamp, &log)), of_dynamic(&stamped(stamp, &steps)));
        assert!(of_static.is_err() || of_dynamic.is_err(), "no log of a stand has such stamps");
    }
}

/// The report of a stand of this project on esc-test; says so where the data is not given.
fn esc_test(stand: &str) -> Option<RotorReport> {
    skipped::variable_or_skip("HUMMINGBUS_DATA", "the folder of measured flights")?;
    let path: PathBuf = Path::new(env!("CARGO_MANIFEST_DIR")).join("../flights/stands").join(stand);
    Some(rotor::run(&path).unwrap().report)
}

/// True if the text of the report contains `text`.
fn says(report: &RotorReport, text: &str) -> bool {
    report.to_string().contains(text)
}

#[test]
fn esc_test_f40_has_plausible_figures_and_its_faults_are_named() {
    let Some(report) = esc_test("esc-test-f40.toml") else { return };
    let statics = report.statics.as_ref().unwrap();
    let (thrust, torque) = (statics.thrust.as_ref().unwrap(), statics.torque.as_ref().unwrap());
    assert!((4.3e-6..4.6e-6).contains(&thrust.value.value), "{report}");
    assert!((5.8e-8..6.1e-8).contains(&torque.value.value), "{report}");
    assert!(
        thrust.held_out.unwrap().r_squared > 0.99 && torque.held_out.unwrap().r_squared > 0.99,
        "{report}"
    );
    assert!((0.5..0.75).contains(&statics.plausibility.unwrap().figure_of_merit.unwrap()), "{report}");
    let dynamics = report.dynamics.as_ref().unwrap();
    let time = dynamics.first.time_constant_s.unwrap();
    assert!((0.02..0.06).contains(&time.value) && time.sigma < 0.005, "{report}");
    assert_eq!(dynamics.comparison.preferred, Order::First, "{report}");
    // Which clock is taken must not decide.
    let other = dynamics.other_clock_s.unwrap().value;
    assert!(time.low < other && other < time.high, "{report}");
    for text in
        ["thrust: it grows as w^2.2", "are in transition", "tare of thrust", "rows are taken as evenly"]
    {
        assert!(says(&report, text), "{text}: {report}");
    }
}

#[test]
fn esc_test_f60_falls_more_slowly_than_it_rises() {
    let Some(report) = esc_test("esc-test-f60.toml") else { return };
    assert!(report.statics.is_none());
    let dynamics = report.dynamics.as_ref().unwrap();
    let (rising, falling) = (dynamics.rising_s.unwrap(), dynamics.falling_s.unwrap());
    assert!((0.02..0.06).contains(&rising.value) && (0.02..0.06).contains(&falling.value), "{report}");
    assert!(says(&report, "rising and falling steps differ"), "{report}");
    assert!(says(&report, "the speed went against the command: 95 to 100"), "{report}");
}
