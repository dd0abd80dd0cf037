//! The component `operator`: set points of a person who flies by hand at the page of the run, or those of a recorded
//! flight.
//!
//! The set points enter the run as the samples of its output, so that a recording has them. A run of the same
//! manifest with `data`, that recording, sends the same samples again, at the same ticks.

use bus::asked::{Asked, AskedFile};
use bus::component::{Component, Info, StepError};
use bus::context::{NodeContext, StepContext};
use bus::messages::SetPoint;
use bus::{FileKind, OutputPorts};
use diagnostics::parameter::{ParameterError, refuse, up_to};
use recorder::reader::Recording;
use serde::Deserialize;
use std::path::{Path, PathBuf};
use std::time::Duration;

/// Host time without news after which the fallback acts.
pub const SILENCE: Duration = Duration::from_millis(250);
/// Speed of the fallback `land`, m/s of simulated time.
const LANDING_M_S: f64 = 0.5;
/// Limit of `tilt_max_deg`: the range of sticks.
const TILT_MAX_DEG: f64 = 30.0;
/// Limit of altitudes: no rotorcraft has flown above 12 442 m.
const ALTITUDE_MAX_M: f64 = 20_000.0;
/// Fields of a set point, in the order of [`Asked`].
const FIELDS: [&str; 4] = ["altitude", "roll", "pitch", "yaw"];
const SET_POINT: &str = "hummingbus_msgs/msg/SetPoint";

/// Parameters of `operator`.
#[derive(Debug, bus::Parameters)]
pub struct Parameters {
    /// Altitude until another one is requested; the angles are zero.
    #[parameter(example = "1.0", initial)]
    initial_altitude_m: f64,
    /// Lowest and highest altitude that can be requested.
    #[parameter(example = "[0.3, 3.0]")]
    altitudes_m: [f64; 2],
    /// Largest roll and pitch that can be requested.
    #[parameter(check = up_to(TILT_MAX_DEG, "deg"), example = "20.0")]
    tilt_max_deg: f64,
    /// Answer to a source that was silent for 250 ms.
    #[parameter(range = "`hold`, `level`, `land`", example = "\"level\"")]
    fallback: Fallback,
    /// Recording of such a run, relative to the manifest, whose set points are sent instead.
    #[parameter(file = FileKind::DATA)]
    data: Option<PathBuf>,
    /// Topic of these set points in the recording.
    #[parameter(shown = "`/NAME/set_point` of this process, or the only one")]
    topic: Option<String>,
}

/// Answer to a source that has been silent for [`SILENCE`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
enum Fallback {
    /// The last values hold.
    Hold,
    /// Roll and pitch are zero; altitude and yaw hold.
    Level,
    /// Roll and pitch are zero, yaw holds, and the altitude falls to the lowest one.
    Land,
}

/// Outputs of `operator`.
#[derive(Debug, OutputPorts)]
pub struct Outputs {
    /// Set point that is asked for.
    pub set_point: SetPoint,
}

/// State of `operator`.
#[derive(Debug, Clone, Copy, Default, PartialEq, bus::Message)]
#[repr(C)]
#[message(type_name = "hummingbus_msgs/msg/OperatorState")]
pub struct OperatorState {
    /// Altitude that was asked for last, within its limits.
    #[field(unit = "m", frame = "world")]
    pub altitude: f64,
    /// Roll that was asked for last, within its limit.
    #[field(unit = "rad")]
    pub roll: f64,
    /// Pitch that was asked for last, positive nose down, within its limit.
    #[field(unit = "rad")]
    pub pitch: f64,
    /// Yaw that was asked for last.
    #[field(unit = "rad")]
    pub yaw: f64,
    /// Altitude lost since the source fell silent.
    #[field(unit = "m", frame = "world")]
    pub lowered: f64,
    /// 1 once somebody has asked.
    pub is_asked: u32,
    /// Zero.
    pub reserved: u32,
}

impl OperatorState {
    fn asked(&self) -> Asked {
        let Self { altitude, roll, pitch, yaw, .. } = *self;
        Asked { altitude_m: altitude, roll_rad: roll, pitch_rad: pitch, yaw_rad: yaw }
    }
}

/// Source of set points.
#[derive(Debug)]
enum Source {
    /// A person at the page; none in a run on one thread.
    Person(Option<AskedFile>),
    /// A recorded flight.
    Flight(Flight),
}

/// Set points of a recording by their times.
#[derive(Debug)]
struct Flight {
    time_ns: Vec<u64>,
    asked: Vec<Asked>,
}

/// The component `operator`.
///
/// ```
/// use hummingbus::operator::Operator;
///
/// let parameters = serde_json::json!({
///     "initial_altitude_m": 1.5, "altitudes_m": [0.3, 3.0], "tilt_max_deg": 15.0, "fallback": "level",
/// });
/// let mut operator = bus::Harness::<Operator>::from_json(&parameters).unwrap();
/// let set_point = operator.step(()).unwrap().set_point;
/// assert_eq!((set_point.altitude, set_point.roll), (1.5, 0.0), "nobody has asked");
/// ```
#[derive(Debug)]
pub struct Operator {
    initial_altitude_m: f64,
    altitudes_m: [f64; 2],
    tilt_max_rad: f64,
    fallback: Fallback,
    period_s: f64,
    source: Source,
}

impl Component for Operator {
    const INFO: Info = Info::new(
        "operator",
        "set points of a person at the page of the run, or those of a recording of such a run",
    );
    type Parameters = Parameters;
    type Inputs<'a> = ();
    type Outputs = Outputs;
    type State = OperatorState;

    fn new(parameters: Parameters, context: &NodeContext<'_>) -> Result<Self, ParameterError> {
        let Parameters { initial_altitude_m, altitudes_m, tilt_max_deg, fallback, data, topic } = parameters;
        let [lowest_m, highest_m] = altitudes_m;
        let is_range = lowest_m < highest_m && lowest_m.abs().max(highest_m.abs()) <= ALTITUDE_MAX_M;
        let range = refuse(!is_range, "altitudes_m", || {
            format!(
                "`altitudes_m` is [{lowest_m}, {highest_m}], expected the lowest and the highest altitude, of at most {ALTITUDE_MAX_M} m"
            )
        });
        let is_outside = is_range && !(lowest_m..=highest_m).contains(&initial_altitude_m);
        let start = refuse(is_outside, "initial_altitude_m", || {
            format!(
                "`initial_altitude_m` is {initial_altitude_m} m, expected one within `altitudes_m`, {lowest_m} m to {highest_m} m"
            )
        });
        let named = refuse(topic.is_some() && data.is_none(), "topic", || {
            "`topic` names set points in no recording: add `data`, the recording".to_owned()
        });
        let source = match data {
            Some(path) => Flight::read(&path, topic.as_deref(), context).map(Source::Flight),
            None => file(context).map(Source::Person),
        };
        let (_, source) = ParameterError::both(ParameterError::gather([range, start, named]), source)?;
        Ok(Self {
            initial_altitude_m,
            altitudes_m,
            tilt_max_rad: tilt_max_deg.to_radians(),
            fallback,
            period_s: context.period_s(),
            source,
        })
    }

    fn initial(&self) -> OperatorState {
        OperatorState { altitude: self.initial_altitude_m, ..OperatorState::default() }
    }

    fn step(
        &self,
        context: &StepContext<'_>,
        (): (),
        state: &mut OperatorState,
    ) -> Result<Outputs, StepError> {
        let asked = match &self.source {
            Source::Flight(flight) => flight.at(context.time_ns()).unwrap_or_else(|| self.initial().asked()),
            Source::Person(file) => self.allowed(file.as_ref().and_then(AskedFile::read), state),
        };
        let Asked { altitude_m: altitude, roll_rad: roll, pitch_rad: pitch, yaw_rad: yaw } = asked;
        Ok(Outputs { set_point: SetPoint { altitude, roll, pitch, yaw, ..Default::default() } })
    }
}

/// The file through which this node is asked, in a run that has a directory.
fn file(context: &NodeContext<'_>) -> Result<Option<AskedFile>, ParameterError> {
    let Some(run_dir) = context.run_dir else { return Ok(None) };
    AskedFile::create(run_dir, context.name).map(Some).map_err(|error| {
        ParameterError::conflict(
            "",
            format!("cannot make the file for set points in the run directory: {error}"),
        )
    })
}

impl Operator {
    /// Values within the limits: the requested ones, or the fallback if they are too old. In a run that goes on from
    /// a checkpoint those from before it are too old.
    fn allowed(&self, read: Option<(Asked, Duration)>, state: &mut OperatorState) -> Asked {
        let read = read.filter(|(asked, _)| asked.is_finite());
        if let Some((asked, _)) = &read {
            self.note(asked, state);
        }
        if state.is_asked == 0 {
            return state.asked();
        }
        let is_silent = read.is_none_or(|(_, age)| age >= SILENCE);
        // A run from a checkpoint may have other limits.
        let Asked { altitude_m, roll_rad, pitch_rad, yaw_rad } = self.within_limits(&state.asked());
        let tilt = |tilt_rad: f64| match self.fallback {
            Fallback::Level | Fallback::Land if is_silent => 0.0,
            _ => tilt_rad,
        };
        state.lowered = match self.fallback {
            Fallback::Land if is_silent => state.lowered + LANDING_M_S * self.period_s,
            _ => 0.0,
        };
        let altitude_m = (altitude_m - state.lowered).max(self.altitudes_m[0]);
        Asked { altitude_m, roll_rad: tilt(roll_rad), pitch_rad: tilt(pitch_rad), yaw_rad }
    }

    fn within_limits(&self, asked: &Asked) -> Asked {
        let [lowest_m, highest_m] = self.altitudes_m;
        let tilt = |tilt_rad: f64| tilt_rad.clamp(-self.tilt_max_rad, self.tilt_max_rad);
        Asked {
            altitude_m: asked.altitude_m.clamp(lowest_m, highest_m),
            roll_rad: tilt(asked.roll_rad),
            pitch_rad: tilt(asked.pitch_rad),
            yaw_rad: asked.yaw_rad,
        }
    }

    /// Stores the requested values in the state, within the limits.
    fn note(&self, asked: &Asked, state: &mut OperatorState) {
        let Asked { altitude_m: altitude, roll_rad: roll, pitch_rad: pitch, yaw_rad: yaw } =
            self.within_limits(asked);
        *state = OperatorState { altitude, roll, pitch, yaw, is_asked: 1, ..*state };
    }
}

impl Flight {
    fn read(path: &Path, topic: Option<&str>, context: &NodeContext<'_>) -> Result<Self, ParameterError> {
        let shown = path.display();
        let bad =
            |error: &dyn std::fmt::Display| ParameterError::conflict("data", format!("{shown}: {error}"));
        let bytes = context.files.bytes(path).map_err(|error| bad(&error))?;
        let recording = Recording::of_bytes(bytes, path).map_err(|error| bad(&error))?;
        let of_type = recording.topics().iter().filter(|(_, found)| found.type_name == SET_POINT);
        let names: Vec<&str> = of_type.map(|(name, _)| name.as_str()).collect();
        let named = format!("/{}/set_point", context.name);
        let topic = match (topic, &names[..]) {
            (Some(topic), names) if names.contains(&topic) => topic,
            (None, names) if names.contains(&named.as_str()) => &named,
            (None, [only]) => *only,
            (_, []) => return Err(bad(&"it has no set points; expected a topic of type SetPoint")),
            (wanted, names) => {
                let wanted = wanted.map_or("`topic` is missing".to_owned(), |topic| {
                    format!("it has no set points at {topic}")
                });
                return Err(bad(&format!("{wanted}; expected one of {}", names.join(", "))));
            }
        };
        let series = recording.series(&FIELDS.map(|field| (topic, field))).map_err(|error| bad(&error))?;
        let [altitude, roll, pitch, yaw] = [0, 1, 2, 3].map(|index| &series[index].value);
        let asked = (0..altitude.len()).map(|index| Asked {
            altitude_m: altitude[index],
            roll_rad: roll[index],
            pitch_rad: pitch[index],
            yaw_rad: yaw[index],
        });
        Ok(Self { asked: asked.collect(), time_ns: series[0].time_ns.clone() })
    }

    /// The newest at `time_ns`; `None` before the first.
    fn at(&self, time_ns: u64) -> Option<Asked> {
        let behind = self.time_ns.partition_point(|&time| time <= time_ns);
        behind.checked_sub(1).map(|index| self.asked[index])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use bus::component::State as _;
    use serde_json::{Value, json};

    fn parameters(fallback: &str) -> Value {
        json!({ "initial_altitude_m": 1.5, "altitudes_m": [0.5, 3.0], "tilt_max_deg": 10.0, "fallback": fallback })
    }

    fn operator(fallback: &str) -> Operator {
        let context = NodeContext::new("pilot", &[]);
        Operator::new(serde_json::from_value(parameters(fallback)).unwrap(), &context).unwrap()
    }

    fn asked(altitude_m: f64, roll_rad: f64) -> Asked {
        Asked { altitude_m, roll_rad, pitch_rad: -roll_rad, yaw_rad: 1.0 }
    }

    #[test]
    fn what_is_asked_stays_within_the_limits() {
        let operator = operator("hold");
        let mut state = operator.initial();
        let mut allowed = |asked| operator.allowed(Some((asked, Duration::ZERO)), &mut state);
        assert_eq!(allowed(asked(f64::NAN, 0.0)), Asked { altitude_m: 1.5, ..Asked::default() });
        assert_eq!(allowed(asked(2.0, 0.1)), asked(2.0, 0.1));
        assert_eq!(allowed(asked(9.0, 2.0)), asked(3.0, 10_f64.to_radians()));
        assert_eq!(allowed(asked(-9.0, -2.0)), asked(0.5, -(10_f64.to_radians())));
        assert_eq!(allowed(asked(f64::NAN, 0.0)), asked(0.5, -(10_f64.to_radians())));
    }

    #[test]
    fn a_run_that_goes_on_keeps_the_last_values_and_answers_the_silence_before_it() {
        let after = |fallback| {
            let operator = operator(fallback);
            let mut before = operator.initial();
            assert_eq!(operator.allowed(None, &mut before).altitude_m, 1.5, "nobody has asked");
            operator.allowed(Some((asked(2.0, 0.1), Duration::ZERO)), &mut before);
            let mut state = OperatorState::default();
            state.load(bytemuck::bytes_of(&before)).unwrap();
            operator.allowed(None, &mut state)
        };
        assert_eq!(after("hold"), asked(2.0, 0.1));
        assert_eq!(after("level"), Asked { roll_rad: 0.0, pitch_rad: 0.0, ..asked(2.0, 0.0) });
        assert_eq!(after("land").altitude_m, 2.0 - LANDING_M_S * 1e-3);
        let mut state = OperatorState { altitude: 9.0, roll: 1.0, is_asked: 1, ..OperatorState::default() };
        let within = operator("hold").allowed(None, &mut state);
        assert_eq!(
            (within.altitude_m, within.roll_rad),
            (3.0, 10_f64.to_radians()),
            "the limits are those of this run"
        );
    }

    #[test]
    fn a_source_that_falls_silent_is_answered_by_the_stated_fallback() {
        let news = Some((asked(2.0, 0.1), SILENCE - Duration::from_millis(1)));
        let silent = Some((asked(2.0, 0.1), SILENCE));
        let after = |fallback, steps: usize| {
            let operator = operator(fallback);
            let mut state = operator.initial();
            assert_eq!(operator.allowed(news, &mut state), asked(2.0, 0.1));
            let last = (0..steps).map(|_| operator.allowed(silent, &mut state)).last().unwrap();
            assert_eq!(operator.allowed(news, &mut state), asked(2.0, 0.1), "it is heard again");
            last
        };
        assert_eq!(after("hold", 1000), asked(2.0, 0.1));
        let level = Asked { roll_rad: 0.0, pitch_rad: 0.0, ..asked(2.0, 0.0) };
        assert_eq!(after("level", 1000), level);
        let landing = after("land", 1000);
        assert!((landing.altitude_m - 1.5).abs() < 1e-9 && landing.roll_rad == 0.0, "{landing:?}");
        assert_eq!(after("land", 10_000).altitude_m, 0.5);
    }

    #[test]
    fn parameters_that_cannot_be_are_refused_with_what_is_expected() {
        let refused = |key: &str, value: Value| {
            let mut parameters = parameters("hold");
            parameters[key] = value;
            bus::Harness::<Operator>::from_json(&parameters).unwrap_err().to_string()
        };
        assert!(refused("altitudes_m", json!([3.0, 0.5])).contains("the lowest and the highest altitude"));
        assert!(refused("initial_altitude_m", json!(4.0)).contains("0.5 m to 3 m"));
        assert!(refused("tilt_max_deg", json!(31.0)).contains("30"));
        assert!(refused("topic", json!("/pilot/set_point")).contains("`data`"));
        assert!(refused("data", json!("none.mcap")).contains("none.mcap"));
    }
}
