//! The pilot's set points: steps, ramps and doublets on four channels, over integer ticks.
//!
//! A step or a ramp leads a channel to a new value, which it keeps; a doublet is added on top and leaves
//! no change behind. The thesis's "10 degree roll doublet in 1 sec" (§5.1) leaves open what the second
//! covers. Here a doublet is `+amplitude` for `duration_s`, then `−amplitude` for `duration_s`, then
//! zero, so that one of 1 s lasts 2 s as a whole. Pulses of half a second bring the Hummingbird to
//! 9.1° and −8.8° only, behind its motors' lag (gains 16 and 6); with the thesis's 25 and 6, to 14.2° and −17.9°.

use component::messages::SetPoint as SetPointMessage;
use diagnostics::ParameterError;
use diagnostics::parameter::require;
use diagnostics::unit::{ANGLE, Dimension};
use nalgebra::UnitQuaternion;
use serde::Deserialize;
use std::ops::RangeInclusive;

/// Set point of the controllers.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct SetPoint {
    /// Height in the world, m.
    pub altitude_m: f64,
    /// Roll, rad.
    pub roll_rad: f64,
    /// Pitch, positive for nose down, rad.
    pub pitch_rad: f64,
    /// Yaw, counter-clockwise from above, rad.
    pub yaw_rad: f64,
}

impl SetPoint {
    /// A height and the angles of an attitude, body to world.
    pub(crate) fn held(altitude_m: f64, attitude_WB: &UnitQuaternion<f64>) -> Self {
        let (roll_rad, pitch_rad, yaw_rad) = attitude_WB.euler_angles();
        Self { altitude_m, roll_rad, pitch_rad, yaw_rad }
    }
}

impl From<&SetPointMessage> for SetPoint {
    fn from(message: &SetPointMessage) -> Self {
        let SetPointMessage { altitude, roll, pitch, yaw, .. } = *message;
        Self { altitude_m: altitude, roll_rad: roll, pitch_rad: pitch, yaw_rad: yaw }
    }
}

impl From<&SetPoint> for SetPointMessage {
    fn from(set_point: &SetPoint) -> Self {
        let SetPoint { altitude_m, roll_rad, pitch_rad, yaw_rad } = *set_point;
        Self { altitude: altitude_m, roll: roll_rad, pitch: pitch_rad, yaw: yaw_rad, ..Self::default() }
    }
}

/// One entry of a schedule as it stands in the manifest.
///
/// `{ kind = "step", channel = "altitude", at_s = 2.0, to = 1.5, unit = "m" }`,
/// `{ kind = "ramp", channel = "yaw", at_s = 4.0, over_s = 2.0, to = 90.0, unit = "deg" }` or
/// `{ kind = "doublet", channel = "roll", at_s = 6.0, amplitude = 10.0, unit = "deg", duration_s = 1.0 }`.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SetPointEntry {
    /// "step", "ramp" or "doublet".
    pub kind: String,
    /// "altitude", "roll", "pitch" or "yaw".
    pub channel: String,
    /// Start, s; it acts from the first tick that is not earlier.
    pub at_s: f64,
    /// The unit of `to` and `amplitude`: "m" for altitude, "rad" or "deg" for the angles.
    pub unit: String,
    /// The value that a step or ramp leads to.
    pub to: Option<f64>,
    /// Duration of a ramp, s.
    pub over_s: Option<f64>,
    /// The size of a doublet's pulses; a negative one starts downwards.
    pub amplitude: Option<f64>,
    /// Duration of each of a doublet's two pulses, s.
    pub duration_s: Option<f64>,
}

/// A schedule compiled for one tick rate.
///
/// ```
/// use controllers::set_points::{Schedule, SetPoint, SetPointEntry};
///
/// let entry = r#"{ "kind": "ramp", "channel": "yaw", "at_s": 1.0, "over_s": 2.0, "to": 90.0, "unit": "deg" }"#;
/// let entry: SetPointEntry = serde_json::from_str(entry).unwrap();
/// let schedule = Schedule::new(&[entry], &SetPoint::default(), 1000).unwrap();
/// assert_eq!(schedule.at(2000).yaw_rad, 45.0_f64.to_radians(), "half of the way after half of the time");
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct Schedule {
    channels: [ChannelPlan; 4],
}

/// One channel's schedule, in SI units.
#[derive(Debug, Clone, PartialEq, Default)]
struct ChannelPlan {
    initial: f64,
    /// Steps and ramps in the order in which they begin; of two at one tick the later entry wins.
    legs: Vec<Leg>,
    /// In the order of the entries, in which they are summed.
    doublets: Vec<Doublet>,
}

/// From one value to another over `length_ticks`, zero for a step.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Leg {
    start_tick: u64,
    length_ticks: u64,
    from: f64,
    to: f64,
}

#[derive(Debug, Clone, Copy, PartialEq)]
struct Doublet {
    start_tick: u64,
    pulse_ticks: u64,
    amplitude: f64,
}

/// Heights in the world that a set point may ask for, m: the record of all rotorcraft is 12 442 m (SA 315B Lama, FAI,
/// 1972), and the world's origin may lie as far above.
pub(crate) const ALTITUDES_M: RangeInclusive<f64> = -20_000.0..=20_000.0;
/// The same for messages.
pub(crate) const ALTITUDES_EXPECTED: &str = "-20 000 m to 20 000 m: no rotorcraft has flown above 12 442 m";
/// Angles that a set point may ask for, rad: a hundred turns of yaw.
const ANGLES_RAD: RangeInclusive<f64> = -628.4..=628.4;

/// Range of the set points on a channel.
struct Channel {
    name: &'static str,
    units: Dimension,
    /// In SI.
    range: RangeInclusive<f64>,
    expected: &'static str,
}

const fn angle(name: &'static str) -> Channel {
    Channel { name, units: ANGLE, range: ANGLES_RAD, expected: "an angle of at most a hundred turns" }
}

const METRES: Dimension = Dimension::of("height", &[("m", 1.0)]);

/// The channels in the order of [`Schedule::channels`].
static CHANNELS: [Channel; 4] = [
    Channel { name: "altitude", units: METRES, range: ALTITUDES_M, expected: ALTITUDES_EXPECTED },
    angle("roll"),
    angle("pitch"),
    angle("yaw"),
];

impl Schedule {
    /// The schedule that `entries` describe from `initial` on, at `tick_rate_hz` ticks a second.
    ///
    /// # Errors
    /// Entries that have an unknown kind, channel or unit. Keys that a kind lacks or does not know. Times
    /// that are negative or not finite. The error has all of these faults.
    pub fn new(
        entries: &[SetPointEntry],
        initial: &SetPoint,
        tick_rate_hz: u32,
    ) -> Result<Self, ParameterError> {
        let mut schedule = Self::holding(initial);
        let read = entries.iter().enumerate().map(|(index, entry)| {
            let read = Reader { entry, tick_rate_hz }.add_to(&mut schedule.channels);
            read.map_err(|error| error.within(&format!("set_points.{index}")))
        });
        ParameterError::gather(read)?;
        schedule.channels.iter_mut().for_each(ChannelPlan::link);
        Ok(schedule)
    }

    /// The set point at `tick`, a function of the tick alone.
    #[must_use]
    pub fn at(&self, tick: u64) -> SetPoint {
        let [altitude_m, roll_rad, pitch_rad, yaw_rad] =
            std::array::from_fn(|channel| self.channels[channel].value(tick));
        SetPoint { altitude_m, roll_rad, pitch_rad, yaw_rad }
    }

    fn holding(initial: &SetPoint) -> Self {
        let values = [initial.altitude_m, initial.roll_rad, initial.pitch_rad, initial.yaw_rad];
        Self { channels: values.map(|initial| ChannelPlan { initial, ..ChannelPlan::default() }) }
    }
}

impl ChannelPlan {
    /// Orders the legs and lets each begin where the one before has come to.
    fn link(&mut self) {
        // Stable, so that entries of one tick keep their order.
        self.legs.sort_by_key(|leg| leg.start_tick);
        let mut before = Leg { start_tick: 0, length_ticks: 0, from: self.initial, to: self.initial };
        for leg in &mut self.legs {
            leg.from = before.value(leg.start_tick);
            before = *leg;
        }
    }

    fn value(&self, tick: u64) -> f64 {
        let begun = self.legs.partition_point(|leg| leg.start_tick <= tick);
        let held = if begun == 0 { self.initial } else { self.legs[begun - 1].value(tick) };
        held + self.doublets.iter().map(|doublet| doublet.value(tick)).sum::<f64>()
    }
}

impl Leg {
    /// The value at `tick`, which is not before the start.
    fn value(&self, tick: u64) -> f64 {
        let elapsed_ticks = tick - self.start_tick;
        if elapsed_ticks >= self.length_ticks {
            return self.to;
        }
        self.from + (self.to - self.from) * (elapsed_ticks as f64 / self.length_ticks as f64)
    }
}

impl Doublet {
    fn value(&self, tick: u64) -> f64 {
        match tick.checked_sub(self.start_tick).map(|elapsed| elapsed / self.pulse_ticks) {
            Some(0) => self.amplitude,
            Some(1) => -self.amplitude,
            _ => 0.0,
        }
    }
}

/// Reads one entry.
struct Reader<'a> {
    entry: &'a SetPointEntry,
    tick_rate_hz: u32,
}

impl Reader<'_> {
    fn add_to(&self, channels: &mut [ChannelPlan; 4]) -> Result<(), ParameterError> {
        let SetPointEntry { kind, to, over_s, amplitude, duration_s, .. } = self.entry;
        let channel = self.channel();
        let known = channel.as_ref().ok().copied();
        let start = ParameterError::both(channel, self.start_tick());
        match kind.as_str() {
            "step" | "ramp" => {
                let is_ramp = kind == "ramp";
                let only = self.require_only(if is_ramp { &["to", "over_s"] } else { &["to"] });
                let length = if is_ramp { self.length_ticks("over_s", *over_s) } else { Ok(0) };
                let sizes = ParameterError::both(self.value("to", *to, known), length);
                let (start, (sizes, ())) = ParameterError::both(start, ParameterError::both(sizes, only))?;
                let (((place, _), start_tick), (to, length_ticks)) = (start, sizes);
                channels[place].legs.push(Leg { start_tick, length_ticks, from: to, to });
            }
            "doublet" => {
                let only = self.require_only(&["amplitude", "duration_s"]);
                let length = self.length_ticks("duration_s", *duration_s);
                let sizes = ParameterError::both(self.value("amplitude", *amplitude, known), length);
                let (start, (sizes, ())) = ParameterError::both(start, ParameterError::both(sizes, only))?;
                let (((place, _), start_tick), (amplitude, pulse_ticks)) = (start, sizes);
                channels[place].doublets.push(Doublet { start_tick, pulse_ticks, amplitude });
            }
            other => {
                let expected = "\"step\", \"ramp\" or \"doublet\"";
                let error = ParameterError::value("kind", expected, format_args!("\"{other}\""));
                return ParameterError::both(start, Err::<(), _>(error)).map(drop);
            }
        }
        Ok(())
    }

    /// The place of the entry's channel in [`CHANNELS`], and the factor from the entry's unit to SI.
    fn channel(&self) -> Result<(usize, f64), ParameterError> {
        let SetPointEntry { channel: name, unit, .. } = self.entry;
        let place = CHANNELS.iter().position(|channel| channel.name == name);
        let place = place.ok_or_else(|| {
            let expected = "\"altitude\", \"roll\", \"pitch\" or \"yaw\"";
            ParameterError::value("channel", expected, format_args!("\"{name}\""))
        })?;
        let units = &CHANNELS[place].units;
        let si_per_unit = units.factor(unit).ok_or_else(|| {
            let expected = format!("{} on channel {name}", units.names(" or "));
            ParameterError::value("unit", expected, format_args!("\"{unit}\""))
        })?;
        Ok((place, si_per_unit))
    }

    /// A value of the channel in SI, within its range; not compared with that if the channel is not `known`.
    fn value(
        &self,
        key: &'static str,
        value: Option<f64>,
        known: Option<(usize, f64)>,
    ) -> Result<f64, ParameterError> {
        let value = self.number(key, value)?;
        let Some((place, si_per_unit)) = known else { return Ok(value) };
        let (channel, si) = (&CHANNELS[place], si_per_unit * value);
        let found = format_args!("{value} {}", self.entry.unit);
        require(key, found, channel.range.contains(&si), channel.expected).map(|()| si)
    }

    /// The first tick that is not before `at_s`.
    fn start_tick(&self) -> Result<u64, ParameterError> {
        let at_s = self.entry.at_s;
        require("at_s", at_s, at_s.is_finite() && at_s >= 0.0, "a finite time, zero or more")?;
        // A time that is a tick's in decimal may come out just above it in binary.
        Ok((at_s * f64::from(self.tick_rate_hz) - 1e-6).ceil().max(0.0) as u64)
    }

    /// A length of time as a whole number of ticks, at least one.
    fn length_ticks(&self, key: &'static str, value: Option<f64>) -> Result<u64, ParameterError> {
        let length_s = self.number(key, value)?;
        require(key, length_s, length_s > 0.0, "a time greater than zero")?;
        Ok((length_s * f64::from(self.tick_rate_hz)).round().max(1.0) as u64)
    }

    fn number(&self, key: &'static str, value: Option<f64>) -> Result<f64, ParameterError> {
        value.filter(|number| number.is_finite()).ok_or_else(|| {
            let found = value.map_or("nothing".to_owned(), |number| number.to_string());
            ParameterError::value(key, format!("a finite number in a {}", self.entry.kind), found)
        })
    }

    /// Refuses numbers that the entry's kind does not have: all but those under `keys`.
    fn require_only(&self, keys: &[&str]) -> Result<(), ParameterError> {
        let SetPointEntry { kind, to, over_s, amplitude, duration_s, .. } = self.entry;
        let given = [("to", to), ("over_s", over_s), ("amplitude", amplitude), ("duration_s", duration_s)];
        let others = given.into_iter().filter(|(key, _)| !keys.contains(key));
        let checked = others.filter_map(|(key, value)| {
            let number = (*value)?;
            Some(Err::<(), _>(ParameterError::value(key, format!("left out of a {kind}"), number)))
        });
        ParameterError::gather(checked).map(drop)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Deserialize)]
    struct Manifest {
        set_points: Vec<SetPointEntry>,
    }

    fn schedule(entries: &str) -> Result<Schedule, ParameterError> {
        let manifest: Manifest = toml::from_str(&format!("set_points = [{entries}]")).unwrap();
        Schedule::new(&manifest.set_points, &SetPoint { altitude_m: 1.0, ..SetPoint::default() }, 1000)
    }

    #[test]
    fn the_scenario_of_the_thesis_steps_and_rolls_on_its_ticks() {
        let schedule = schedule(
            r#"{kind="doublet", channel="roll", at_s=6.0, amplitude=10.0, unit="deg", duration_s=1.0},
               {kind="step", channel="altitude", at_s=2.0, to=1.5, unit="m"}"#,
        )
        .unwrap();
        let altitude_m = |tick| schedule.at(tick).altitude_m;
        assert_eq!((altitude_m(0), altitude_m(1999), altitude_m(2000)), (1.0, 1.0, 1.5));
        let roll_deg = |tick| schedule.at(tick).roll_rad.to_degrees().round();
        let ticks = [5999, 6000, 6999, 7000, 7999, 8000, 1_000_000];
        assert_eq!(ticks.map(roll_deg), [0.0, 10.0, 10.0, -10.0, -10.0, 0.0, 0.0]);
    }

    #[test]
    fn a_ramp_starts_from_where_the_channel_is_even_within_another() {
        let schedule = schedule(
            r#"{kind="ramp", channel="altitude", at_s=1.0, over_s=2.0, to=3.0, unit="m"},
               {kind="ramp", channel="altitude", at_s=2.0, over_s=1.0, to=0.0, unit="m"},
               {kind="step", channel="yaw", at_s=0.0, to=0.5, unit="rad"}"#,
        )
        .unwrap();
        let altitude_m = |tick| schedule.at(tick).altitude_m;
        let ticks = [1000, 1500, 2000, 2500, 3000, 9000];
        assert_eq!(ticks.map(altitude_m), [1.0, 1.5, 2.0, 1.0, 0.0, 0.0]);
        assert_eq!(schedule.at(0).yaw_rad, 0.5);
    }

    #[test]
    fn a_doublet_rides_on_a_step_and_a_decimal_time_meets_its_tick() {
        let schedule = schedule(
            r#"{kind="step", channel="pitch", at_s=0.007, to=0.1, unit="rad"},
               {kind="doublet", channel="pitch", at_s=0.057, amplitude=-0.2, unit="rad", duration_s=0.001}"#,
        )
        .unwrap();
        let pitch_rad = |tick| schedule.at(tick).pitch_rad;
        assert_eq!((pitch_rad(6), pitch_rad(7), pitch_rad(56)), (0.0, 0.1, 0.1));
        assert_eq!((pitch_rad(57), pitch_rad(58), pitch_rad(59)), (0.1 - 0.2, 0.1 + 0.2, 0.1));
    }

    #[test]
    fn all_errors_of_all_entries_are_told() {
        let entries = r#"{kind="step", channel="roll", at_s=-1.0, to=1.0, unit="m"},
                         {kind="doublet", channel="altitude", at_s=0.0, amplitude=1e9, unit="m", duration_s=0.0},
                         {kind="jump", channel="rol", at_s=0.0, unit="deg"}"#;
        let errors = schedule(entries).unwrap_err().into_each();
        let mut keys: Vec<&str> = errors.iter().map(ParameterError::key).collect();
        keys.sort_unstable();
        let expected = ["0.at_s", "0.unit", "1.amplitude", "1.duration_s", "2.channel", "2.kind"];
        assert_eq!(keys, expected.map(|key| format!("set_points.{key}")));
    }

    #[test]
    fn errors_name_the_entry_the_key_what_may_stand_there_and_what_does() {
        let good = r#"{kind="step", channel="roll", at_s=0.0, to=1.0, unit="deg"}"#;
        let cases = [
            (
                r#"{kind="jump", channel="roll", at_s=0.0, to=1.0, unit="deg"}"#,
                "`set_points.1.kind` must be \"step\"",
            ),
            (r#"{kind="step", channel="rol", at_s=0.0, to=1.0, unit="deg"}"#, "found \"rol\""),
            (
                r#"{kind="step", channel="roll", at_s=0.0, to=1.0, unit="m"}"#,
                "`set_points.1.unit` must be \"rad\" or",
            ),
            (
                r#"{kind="step", channel="roll", at_s=0.0, unit="deg"}"#,
                "`set_points.1.to` must be a finite number",
            ),
            (
                r#"{kind="step", channel="roll", at_s=-1.0, to=1.0, unit="deg"}"#,
                "`set_points.1.at_s` must be",
            ),
            (
                r#"{kind="doublet", channel="roll", at_s=0.0, to=1.0, unit="deg"}"#,
                "`set_points.1.to` must be left out of a doublet, found 1",
            ),
            (
                r#"{kind="ramp", channel="roll", at_s=0.0, over_s=0.0, to=1.0, unit="deg"}"#,
                "`set_points.1.over_s` must be a time greater than zero, found 0",
            ),
        ];
        for (entry, expected) in cases {
            let error = schedule(&format!("{good}, {entry}")).unwrap_err().to_string();
            assert!(error.contains("`set_points.1.") && error.contains(expected), "{error}");
        }
    }
}
