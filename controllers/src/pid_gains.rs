//! The gains of the `pid` controller: which signal each multiplies, ours beside the thesis's.
//!
//! Table 5.1 of the thesis gives three rows of bare numbers, without units or sample time. They are read
//! here as gains from an error to an acceleration, which mass and inertia then turn into force and
//! torque: so their units are powers of 1/s and they hold for any vehicle of like agility. The derivative
//! gain multiplies the measured rate, not the error's, so that a step of the set point gives no kick.
//!
//! | gain | thesis, Table 5.1 | here | why changed |
//! |---|---|---|---|
//! | altitude | 16, 1, 10 | 12, 3, 6 | see below |
//! | roll, pitch | 25, 0, 6 | 16, 0, 6 | see below |
//! | yaw | none | 2.25, 0, 3 | the thesis gives none; critically damped at 1.5 rad/s |
//!
//! The motors' lag (ω_n = 15.08 rad/s, ζ = 0.603, thesis §4.2) sits inside every one of these loops.
//! Linearised, a loop of gains Kp and Kd behind it has the polynomial
//! s⁴/ω_n² + 2ζ·s³/ω_n + s² + Kd·s + Kp, and on that model:
//!
//! | loop | phase margin | gain margin | reversal of the command from +10° to −10° |
//! |---|---|---|---|
//! | altitude 16, 1, 10 | 24° | 1.6 | |
//! | altitude 12, 3, 6 | 40° | 2.5 | |
//! | roll 25, 0, 6 | 23° | 2.0 | swings to −14.9° |
//! | roll 16, 0, 6 | 35° | 2.4 | swings to −10.1° |
//!
//! The altitude's integral gain is raised because 1 takes 12 s to make up for a mass that is 5 % off.
//! Our gains are all tuned on that model, no source. The numbers are in `controllers/gains/pid.toml` and
//! `pid-thesis.toml`; the former is built in.

use crate::altitude_loop::{AltitudeGains, LoopGains};
use crate::gains_file::{self, GAIN};
use diagnostics::parameter::{ParameterError, require};
use diagnostics::unit::{ACCELERATION, ANGULAR_ACCELERATION, VELOCITY};
use inputs::InputFiles;
use serde::{Deserialize, Serialize};
use serde_json::Value;
use std::path::Path;

/// The gains of the thesis.
const THESIS: &str = include_str!("../gains/pid-thesis.toml");

gains! {
    /// Gains and limits of the four loops. A loop's table is given whole or left out, except over a gains file.
    ///
    /// ```
    /// use controllers::pid_gains::PidGains;
    ///
    /// let (ours, thesis) = (PidGains::default(), PidGains::thesis());
    /// assert_eq!((ours.roll.proportional_1_s2, thesis.roll.proportional_1_s2), (16.0, 25.0));
    /// ```
    #[derive(Deserialize, Serialize)]
    #[serde(default, deny_unknown_fields, expecting = "a table of gains or the path of a gains file")]
    pub struct PidGains of file, built in "pid.toml" {
        /// Altitude error (m) and rate of climb (m/s) to vertical acceleration (m/s²).
        altitude: LoopGains = LoopGains::read(&file.table("altitude")),
        /// Roll error (rad) and body rate p (rad/s) to angular acceleration about body x (rad/s²).
        roll: LoopGains = LoopGains::read(&file.table("roll")),
        /// Pitch error (rad) and body rate q (rad/s) to angular acceleration about body y (rad/s²).
        pitch: LoopGains = LoopGains::read(&file.table("pitch")),
        /// Yaw error (rad) and body rate r (rad/s) to angular acceleration about body z (rad/s²).
        yaw: LoopGains = LoopGains::read(&file.table("yaw")),
        /// The altitude's integrator rests while the vehicle climbs or sinks faster than this, m/s.
        altitude_integral_climb_max_m_s: f64 = file.limit("altitude.integral_climb_max", VELOCITY),
        /// The most that the altitude's integrator may ask for, m/s².
        altitude_integral_max_m_s2: f64 = file.gain("altitude.integral_max", ACCELERATION),
        /// The most that an angle's integrator may ask for, rad/s².
        attitude_integral_max_rad_s2: f64 = file.gain("attitude.integral_max", ANGULAR_ACCELERATION),
        /// Roll and pitch commands are cut to this, rad.
        tilt_command_max_rad: f64 = file.tilt("attitude.command_max"),
    }
}

impl PidGains {
    /// The thesis's own numbers (Table 5.1), with our yaw loop and limits, which it does not give.
    #[must_use]
    pub fn thesis() -> Self {
        gains_file::parse(THESIS, "controllers/gains/pid-thesis.toml", Self::read)
            .expect("a test reads the built-in gains")
    }

    /// The gains that a manifest gives: the table `parameters.gains`, the path of a gains file, or those built in. A table with the
    /// absolute path of a gains file at `file` replaces values of that file.
    ///
    /// # Errors
    /// The file or a number is refused; the text names the key.
    pub(crate) fn given(files: &InputFiles, given: Option<&Value>) -> Result<Self, ParameterError> {
        match given {
            None => Ok(Self::default()),
            Some(Value::String(path)) => Self::load(files, Some(path.as_ref())),
            Some(table) => {
                let whole = Self::over_file(files, table)?;
                let gains = component::parameters::read(whole.as_ref().unwrap_or(table))
                    .and_then(|gains: Self| gains.check().map(|()| gains));
                gains.map_err(|error| error.within("gains"))
            }
        }
    }

    /// The gains of the file that `table` names, with the values of `table` in place of the file's; `None` if it names no file.
    fn over_file(files: &InputFiles, table: &Value) -> Result<Option<Value>, ParameterError> {
        let file = table.get("file").and_then(Value::as_str).map(Path::new);
        let Some(file) = file.filter(|file| file.is_absolute()) else { return Ok(None) };
        let gains = Self::load(files, Some(file))?;
        let mut whole = serde_json::to_value(gains).unwrap_or_default();
        let values = table.as_object().into_iter().flatten().filter(|(key, _)| *key != "file");
        for (key, value) in values {
            put_over(&mut whole[key], value);
        }
        Ok(Some(whole))
    }

    /// Returns the gains of the altitude loop.
    pub(crate) fn altitude_gains(&self) -> AltitudeGains {
        AltitudeGains {
            loop_gains: self.altitude,
            integral_climb_max_m_s: self.altitude_integral_climb_max_m_s,
            integral_max_m_s2: self.altitude_integral_max_m_s2,
        }
    }

    /// Refuses values that a gains file could not have either.
    fn check(&self) -> Result<(), ParameterError> {
        let loops =
            [("altitude", self.altitude), ("roll", self.roll), ("pitch", self.pitch), ("yaw", self.yaw)];
        let loops = loops.into_iter().flat_map(|(name, of)| {
            [
                GAIN.check(&format!("{name}.proportional_1_s2"), of.proportional_1_s2),
                GAIN.check(&format!("{name}.integral_1_s3"), of.integral_1_s3),
                GAIN.check(&format!("{name}.derivative_1_s"), of.derivative_1_s),
            ]
        });
        let tilt_rad = self.tilt_command_max_rad;
        let is_good = tilt_rad > 0.0 && tilt_rad < std::f64::consts::FRAC_PI_3;
        let limits = [
            GAIN.check("altitude_integral_climb_max_m_s", self.altitude_integral_climb_max_m_s),
            GAIN.check("altitude_integral_max_m_s2", self.altitude_integral_max_m_s2),
            GAIN.check("attitude_integral_max_rad_s2", self.attitude_integral_max_rad_s2),
            require("tilt_command_max_rad", tilt_rad, is_good, "above 0 and below 1.0472 (60 deg)"),
        ];
        ParameterError::gather(loops.chain(limits)).map(drop)
    }
}

/// Puts `over` in place of `base`; of two tables, each value of `over` in place of the one of `base`.
fn put_over(base: &mut Value, over: &Value) {
    match (base, over) {
        (Value::Object(base), Value::Object(over)) => {
            over.iter().for_each(|(key, value)| put_over(base.entry(key).or_insert(Value::Null), value));
        }
        (base, over) => *base = over.clone(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_built_in_files_hold_the_numbers_that_the_head_of_this_room_compares() {
        let pid = |p, i, d| LoopGains { proportional_1_s2: p, integral_1_s3: i, derivative_1_s: d };
        let (ours, thesis) = (PidGains::default(), PidGains::thesis());
        assert_eq!(
            (ours.altitude, ours.roll, ours.pitch),
            (pid(12.0, 3.0, 6.0), pid(16.0, 0.0, 6.0), ours.roll)
        );
        assert_eq!((thesis.altitude, thesis.roll), (pid(16.0, 1.0, 10.0), pid(25.0, 0.0, 6.0)));
        let same = PidGains { altitude: ours.altitude, roll: ours.roll, pitch: ours.pitch, ..thesis };
        assert_eq!(same, ours, "what the thesis does not give");
        assert_eq!(ours.tilt_command_max_rad, 30.0_f64.to_radians());
    }

    #[test]
    fn negative_gains_and_impossible_limits_are_refused_with_their_key() {
        let refused = |from: &str, to: &str| {
            assert_eq!(PidGains::BUILT_IN.matches(from).count(), 1, "{from}");
            gains_file::parse(&PidGains::BUILT_IN.replace(from, to), "my.toml", PidGains::read)
                .unwrap_err()
                .to_string()
        };
        let error = refused("value = 12", "value = -12");
        assert!(error.contains("my.toml:") && error.contains("altitude.proportional"), "{error}");
        let error = refused("value = 30", "value = 80");
        assert!(error.contains("attitude.command_max") && error.contains("below 60"), "{error}");
        let error = refused("unit = \"deg\"", "unit = \"m\"");
        assert!(error.contains("\"rad\", \"deg\""), "{error}");
        let table = |text| {
            let table: Value = toml::from_str(text).unwrap();
            PidGains::given(&InputFiles::default(), Some(&table)).unwrap_err().to_string()
        };
        let error = table("yaw = { proportional_1_s2 = 1, integral_1_s3 = -1, derivative_1_s = 1 }");
        assert!(error.contains("`gains.yaw.integral_1_s3`") && error.contains("found -1"), "{error}");
        assert!(table("tilt_command_max_rad = 2").contains("`gains.tilt_command_max_rad` must be"));
    }

    #[test]
    fn a_table_or_a_path_is_taken_and_nothing_else() {
        let given =
            |json| PidGains::given(&InputFiles::default(), Some(&serde_json::from_str(json).unwrap()));
        let thesis = concat!("\"", env!("CARGO_MANIFEST_DIR"), "/gains/pid-thesis.toml\"");
        assert_eq!((given(thesis), given("{}")), (Ok(PidGains::thesis()), Ok(PidGains::default())));
        let error = given("3").unwrap_err().to_string();
        assert!(error.contains("`gains`") && error.contains("a table of gains or the path"), "{error}");
        assert!(given("{\"rol\": 1}").unwrap_err().to_string().contains("unknown key `gains.rol`"));
        let error = given("\"no-such.toml\"").unwrap_err().to_string();
        assert!(error.contains("no-such.toml") && error.contains("cannot read"), "{error}");
    }

    #[test]
    fn a_loop_that_is_left_out_keeps_its_default() {
        let text = "[roll]\nproportional_1_s2 = 20\nintegral_1_s3 = 0\nderivative_1_s = 7";
        let gains: PidGains = toml::from_str(text).unwrap();
        assert_eq!(
            gains,
            PidGains {
                roll: LoopGains { proportional_1_s2: 20.0, integral_1_s3: 0.0, derivative_1_s: 7.0 },
                ..PidGains::default()
            }
        );
    }

    #[test]
    fn unknown_and_missing_keys_are_named() {
        let error = toml::from_str::<PidGains>("rol = 1").unwrap_err().to_string();
        assert!(error.contains("rol"), "{error}");
        let error = toml::from_str::<PidGains>("[roll]\nproportional_1_s2 = 20").unwrap_err().to_string();
        assert!(error.contains("integral_1_s3"), "{error}");
    }

    #[test]
    fn values_of_a_table_replace_those_of_the_file_that_it_names() {
        let (files, path) = (InputFiles::default(), Path::new("/gains.toml"));
        files.keep(path, THESIS.into());
        let given = |table: &str| {
            let table = format!("{{\"file\": \"/gains.toml\", {table}}}");
            PidGains::given(&files, Some(&serde_json::from_str(&table).unwrap()))
        };
        let mut expected = PidGains::thesis();
        expected.roll.derivative_1_s = 7.0;
        assert_eq!(given("\"roll\": {\"derivative_1_s\": 7}"), Ok(expected));
        let refused = |table: &str| given(table).unwrap_err().to_string();
        assert!(refused("\"rol\": 1").contains("unknown key `gains.rol`"), "{}", refused("\"rol\": 1"));
        assert!(refused("\"yaw\": 1").contains("`gains.yaw`"), "{}", refused("\"yaw\": 1"));
        let relative = serde_json::json!({ "file": "gains.toml" });
        let error = PidGains::given(&files, Some(&relative)).unwrap_err().to_string();
        assert!(error.contains("unknown key `gains.file`"), "{error}");
    }
}
