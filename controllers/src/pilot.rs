//! The pilot node: publishes the set points of a schedule, or of a recording of sticks.

use crate::set_points::{Schedule, SetPoint as Values, SetPointEntry};
use crate::sticks::Sticks;
use bus::kind::{Inputs, NodeKind, PortSpec, read_parameters};
use bus::messages::SetPoint;
use bus::{BusError, Message, Node};
use serde::Deserialize;
use std::path::PathBuf;

/// The pilot, for manifests.
pub const KIND: NodeKind = NodeKind {
    name: "pilot",
    summary: "set points from the manifest: steps, ramps and doublets; or from a recording of sticks",
    inputs: Inputs::Ports(&[]),
    outputs: &[PortSpec::required("set_point", SetPoint::SCHEMA)],
    check: |parameters, _| Pilot::new(&read_parameters(parameters)?, 1000).map(|_| ()),
    run,
};

/// Parameters of the pilot.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Parameters {
    /// Altitude until the first entry changes it; the angles start at zero.
    initial_altitude_m: f64,
    /// The schedule.
    #[serde(default)]
    set_points: Vec<SetPointEntry>,
    /// A recording of sticks, whose channels the schedule leaves alone.
    data: Option<PathBuf>,
}

/// What the pilot asks for over time.
#[derive(Debug)]
struct Pilot {
    schedule: Schedule,
    sticks: Option<Sticks>,
}

impl Pilot {
    fn new(parameters: &Parameters, rate_hz: u32) -> Result<Self, String> {
        let initial = Values { altitude_m: parameters.initial_altitude_m, ..Values::default() };
        let schedule = Schedule::new(&parameters.set_points, &initial, rate_hz)
            .map_err(|error| format!("`set_points`: {error}"))?;
        let sticks = parameters.data.as_deref().map(Sticks::load).transpose();
        let sticks = sticks.map_err(|error| error.to_string())?;
        let taken = |entry: &&SetPointEntry| sticks.as_ref().is_some_and(|it| it.has(&entry.channel));
        match parameters.set_points.iter().find(taken) {
            None => Ok(Self { schedule, sticks }),
            Some(entry) => Err(format!(
                "`set_points` has an entry on channel {}, which the sticks in `data` hold; leave one of them out",
                entry.channel
            )),
        }
    }

    fn at(&self, tick: u64, time_s: f64) -> Values {
        let scheduled = self.schedule.at(tick);
        self.sticks.as_ref().map_or(scheduled, |sticks| sticks.at(time_s, &scheduled))
    }
}

fn run() -> Result<(), BusError> {
    let mut node = Node::join()?;
    let output = node.output::<SetPoint>("set_point")?;
    let pilot = Pilot::new(&node.parameters()?, node.rate_hz()).map_err(|error| node.error(error))?;
    node.run(|tick| {
        let asked = pilot.at(u64::from(tick.number()), tick.time_s());
        tick.write(
            output,
            SetPoint {
                altitude: asked.altitude_m,
                roll: asked.roll_rad,
                pitch: asked.pitch_rad,
                yaw: asked.yaw_rad,
                ..Default::default()
            },
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pilot(more: &str) -> Result<Pilot, String> {
        let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../manifests/sticks/roll.csv");
        let text = format!("initial_altitude_m = 1.5\ndata = {path:?}\n{more}");
        Pilot::new(&toml::from_str(&text).unwrap(), 1000)
    }

    #[test]
    fn sticks_hold_their_channels_and_the_schedule_the_others() {
        let climb = r#"{kind="step", channel="altitude", at_s=2.0, to=2.0, unit="m"}"#;
        let pilot = pilot(&format!("set_points = [{climb}]")).unwrap();
        assert_eq!((pilot.at(0, 0.0).altitude_m, pilot.at(3000, 3.0).altitude_m), (1.5, 2.0));
        assert!((0..30).any(|at_s| pilot.at(0, f64::from(at_s)).roll_rad != 0.0));
    }

    #[test]
    fn a_schedule_on_a_channel_of_the_sticks_is_refused() {
        let roll = r#"{kind="step", channel="roll", at_s=2.0, to=5.0, unit="deg"}"#;
        let error = pilot(&format!("set_points = [{roll}]")).unwrap_err();
        assert!(error.contains("channel roll") && error.contains("`set_points`"), "{error}");
    }
}
