//! The pilot: publishes the set points of a schedule, or of a recording of sticks.

use crate::set_points::{ALTITUDES_EXPECTED, ALTITUDES_M, Schedule, SetPoint as Values, SetPointEntry};
use crate::sticks::Sticks;
use component::context::{NodeContext, StepContext};
use component::messages::SetPoint;
use component::{Component, FileKind, Info, OutputPorts, StepError};
use diagnostics::nine_decimals;
use diagnostics::parameter::{ParameterError, refuse};
use std::collections::BTreeSet;
use std::path::PathBuf;

/// Parameters of the pilot.
#[derive(Debug, component::Parameters)]
pub struct Parameters {
    /// Altitude until the first set point; the angles start at zero.
    #[parameter(example = "1.0")]
    initial_altitude_m: f64,
    /// List of steps, ramps and doublets.
    #[parameter(default = Vec::new())]
    set_points: Vec<SetPointEntry>,
    /// Recording of sticks, relative to the manifest; `set_points` then has other channels only.
    #[parameter(file = FileKind::DATA)]
    data: Option<PathBuf>,
    /// Time in the recording at which tick 0 lies; below 0 the sticks act that much later than recorded.
    #[parameter(default = 0.0)]
    from_s: f64,
}

/// Warns of set points that the run ends before.
fn warn_of_late(entries: &[SetPointEntry], run: &NodeContext<'_>) {
    let end_s = run.duration_s();
    for (index, entry) in entries.iter().enumerate().filter(|(_, entry)| entry.at_s >= end_s) {
        run.warn_behind_end("set_points", format!(
            "`set_points`: set point {index} (the first is 0): `at_s` is {} s, and the run ends at {} s: it never \
             acts",
            entry.at_s,
            nine_decimals(end_s)
        ));
    }
}

/// Outputs of the pilot.
#[derive(Debug, OutputPorts)]
pub struct Outputs {
    /// Set point of the pilot.
    pub set_point: SetPoint,
}

/// Pilot: a schedule of set points over time.
///
/// ```
/// use controllers::pilot::Pilot;
/// use serde_json::json;
///
/// let step = json!({ "kind": "step", "channel": "altitude", "at_s": 0.002, "to": 1.5, "unit": "m" });
/// let parameters = json!({ "initial_altitude_m": 1.0, "set_points": [step] });
/// let mut pilot = component::Harness::<Pilot>::from_json(&parameters).unwrap();
/// let asked_m = [0, 1, 2].map(|_| pilot.step(()).unwrap().set_point.altitude);
/// assert_eq!(asked_m, [1.0, 1.0, 1.5]);
/// ```
#[derive(Debug)]
pub struct Pilot {
    schedule: Schedule,
    sticks: Option<Sticks>,
    /// Time in the sticks' recording at which tick 0 lies.
    from_s: f64,
}

impl Component for Pilot {
    const INFO: Info = Info::new(
        "pilot",
        "set points from the manifest: steps, ramps and doublets; or from a recording of sticks",
    );
    type Parameters = Parameters;
    type Inputs<'a> = ();
    type Outputs = Outputs;
    type State = ();

    fn new(parameters: Parameters, context: &NodeContext<'_>) -> Result<Self, ParameterError> {
        let altitude_m = parameters.initial_altitude_m;
        let altitude = refuse(!ALTITUDES_M.contains(&altitude_m), "initial_altitude_m", || {
            format!("`initial_altitude_m` is {altitude_m} m, expected {ALTITUDES_EXPECTED}")
        });
        let initial = Values { altitude_m, ..Values::default() };
        let schedule = Schedule::new(&parameters.set_points, &initial, context.rate_hz());
        let from_s = parameters.from_s;
        let start = refuse(from_s != 0.0 && parameters.data.is_none(), "from_s", || {
            format!(
                "`from_s` is {from_s} s, in no recording: it moves the sticks in `data`, not the schedule"
            )
        });
        let load = |path| Sticks::load(&context.files, path);
        let sticks = parameters.data.as_deref().map(load).transpose();
        let numbers = ParameterError::gather([altitude, start]);
        let read = ParameterError::both(schedule, sticks);
        let (_, (schedule, sticks)) = ParameterError::both(numbers, read)?;
        let taken = |entry: &&SetPointEntry| sticks.as_ref().is_some_and(|it| it.has(&entry.channel));
        let taken: BTreeSet<&str> =
            parameters.set_points.iter().filter(taken).map(|entry| entry.channel.as_str()).collect();
        let twice = taken.into_iter().map(|channel| {
            let message = format!(
                "`set_points` has an entry on channel {channel}, which the sticks in `data` hold; leave one of them out"
            );
            Err::<(), _>(ParameterError::conflict("set_points", message))
        });
        ParameterError::gather(twice)?;
        warn_of_late(&parameters.set_points, context);
        Ok(Self { schedule, sticks, from_s })
    }

    fn initial(&self) {}

    fn step(&self, context: &StepContext<'_>, (): (), (): &mut ()) -> Result<Outputs, StepError> {
        let asked = self.at(u64::from(context.tick()), context.time_s());
        Ok(Outputs { set_point: SetPoint::from(&asked) })
    }
}

impl Pilot {
    fn at(&self, tick: u64, time_s: f64) -> Values {
        let scheduled = self.schedule.at(tick);
        self.sticks.as_ref().map_or(scheduled, |sticks| sticks.at(self.from_s + time_s, &scheduled))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use component::Registration;

    fn pilot(more: &str) -> Result<Pilot, ParameterError> {
        let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../manifests/sticks/roll.csv");
        let text = format!("initial_altitude_m = 1.5\ndata = {path:?}\n{more}");
        Pilot::new(toml::from_str(&text).unwrap(), &NodeContext::new("pilot", &[]))
    }

    #[test]
    fn sticks_hold_their_channels_and_the_schedule_the_others() {
        let climb = r#"{kind="step", channel="altitude", at_s=2.0, to=2.0, unit="m"}"#;
        let pilot = pilot(&format!("set_points = [{climb}]")).unwrap();
        assert_eq!((pilot.at(0, 0.0).altitude_m, pilot.at(3000, 3.0).altitude_m), (1.5, 2.0));
        assert!((0..30).any(|at_s| pilot.at(0, f64::from(at_s)).roll_rad != 0.0));
    }

    #[test]
    fn sticks_act_as_much_later_as_tick_0_lies_before_their_recording() {
        let (prompt, late) = (pilot("").unwrap(), pilot("from_s = -0.15").unwrap());
        let moving_s = (0..300).map(|tenth| f64::from(tenth) / 10.0);
        for at_s in moving_s {
            let (there, here) = (prompt.at(0, at_s).roll_rad, late.at(0, at_s + 0.15).roll_rad);
            assert!((there - here).abs() < 1e-9, "at {at_s}");
        }
        assert_ne!(prompt.at(0, 5.0), late.at(0, 5.0));
        let parameters = serde_json::json!({"initial_altitude_m": 1.0, "from_s": -0.15});
        let refused =
            Registration::of::<Pilot>().check(&parameters, &NodeContext::new("node", &[])).unwrap_err();
        assert!(refused.to_string().contains("`from_s` is -0.15 s, in no recording"), "{refused}");
    }

    #[test]
    fn a_set_point_behind_the_end_of_the_run_is_told_and_one_before_is_not() {
        let step = |at_s: f64| serde_json::json!({"kind": "step", "channel": "altitude", "at_s": at_s, "to": 2.0, "unit": "m"});
        let parameters = serde_json::json!({"initial_altitude_m": 1.0, "set_points": [step(0.5), step(1.0)]});
        let run = NodeContext::new("node", &[]).timed(1_000_000, 1, 1000);
        assert_eq!(Registration::of::<Pilot>().check(&parameters, &run), Ok(()));
        let warnings = run.into_warnings();
        assert!(warnings.len() == 1 && warnings[0].message.contains("set point 1"), "{warnings:?}");
    }

    #[test]
    fn an_altitude_that_no_rotorcraft_reaches_is_refused_with_the_range() {
        let step =
            serde_json::json!({"kind": "step", "channel": "altitude", "at_s": 0.5, "to": 1e5, "unit": "m"});
        for parameters in [
            serde_json::json!({"initial_altitude_m": -100_000.0}),
            serde_json::json!({"initial_altitude_m": 1.0, "set_points": [step]}),
        ] {
            let message = Registration::of::<Pilot>()
                .check(&parameters, &NodeContext::new("node", &[]))
                .unwrap_err()
                .to_string();
            assert!(message.contains("-20 000 m to 20 000 m") && message.contains("00000 m"), "{message}");
        }
    }

    #[test]
    fn a_schedule_on_a_channel_of_the_sticks_is_refused() {
        let roll = r#"{kind="step", channel="roll", at_s=2.0, to=5.0, unit="deg"}"#;
        let error = pilot(&format!("set_points = [{roll}]")).unwrap_err().to_string();
        assert!(error.contains("channel roll") && error.contains("`set_points`"), "{error}");
    }
}
