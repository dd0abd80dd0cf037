//! The player node: publishes the motor commands and the measured states of a real flight.

use crate::flight_log::{ColumnMap, FlightLog, Row};
use bus::context::NodeContext;
use bus::kind::{Inputs, NodeKind, PortSpec};
use bus::messages::{MeasuredState, MotorCommand};
use bus::{BusError, Message, Node};
use diagnostics::ParameterError;
use serde::Deserialize;
use std::path::PathBuf;

/// The player, for manifests.
pub const KIND: NodeKind = NodeKind {
    name: "player",
    summary: "commands and measured states of a recorded flight (CSV with a column map)",
    inputs: Inputs::Ports(&[]),
    outputs: &[
        PortSpec::required("command", MotorCommand::SCHEMA),
        PortSpec::required("measured", MeasuredState::SCHEMA),
    ],
    check: |parameters, run| {
        let parameters = diagnostics::read(parameters)?;
        require_length(&load(&parameters)?, parameters.from_s, run)
    },
    run,
};

/// Parameters of the player.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Parameters {
    /// The flight.
    data: PathBuf,
    /// Time in the flight, from its first row, at which tick 0 lies.
    #[serde(default)]
    from_s: f64,
    /// Which columns hold what.
    columns: ColumnMap,
}

fn load(parameters: &Parameters) -> Result<FlightLog, ParameterError> {
    let log = FlightLog::load(&parameters.data, &parameters.columns)
        .map_err(|error| ParameterError::conflict("data", error))?;
    if (0.0..log.duration_s()).contains(&parameters.from_s) {
        Ok(log)
    } else {
        let (from_s, length_s) = (parameters.from_s, log.duration_s());
        Err(ParameterError::conflict(
            "from_s",
            format!("`from_s` is {from_s} s, the flight lasts {length_s:.3} s"),
        ))
    }
}

/// Times are sums of decimal fractions: a nanosecond of slack, as for the rows.
const SLACK_S: f64 = 1e-9;

/// Refuses a run that goes on behind the end of the flight.
fn require_length(log: &FlightLog, from_s: f64, run: &NodeContext<'_>) -> Result<(), ParameterError> {
    let last_tick = (run.duration_ticks.max(1) - 1) / run.period_ticks * run.period_ticks;
    let (last_s, left_s) = (f64::from(last_tick) * run.tick_s(), log.duration_s() - from_s);
    if last_s <= left_s + SLACK_S {
        return Ok(());
    }
    Err(ParameterError::conflict(
        "from_s",
        format!(
            "the flight ends {left_s:.3} s after `from_s`, and the run's last tick lies at {last_s:.3} s; shorten \
         run.duration_s"
        ),
    ))
}

fn run() -> Result<(), BusError> {
    let mut node = Node::join()?;
    let command = node.output::<MotorCommand>("command")?;
    let measured = node.output::<MeasuredState>("measured")?;
    let parameters: Parameters = node.parameters()?;
    let log = load(&parameters).map_err(|error| node.error(error))?;
    let mut hint = 0;
    node.run(|tick| {
        let time_s = parameters.from_s + tick.time_s();
        if time_s > log.duration_s() + SLACK_S {
            return Err(format!(
                "the flight ends {:.3} s after `from_s`; shorten run.duration_s",
                log.duration_s() - parameters.from_s
            ));
        }
        let row = log.at(time_s, &mut hint);
        tick.write(command, MotorCommand { command: row.command, ..Default::default() })
            .and_then(|()| tick.write(measured, message(&row)))
            .map_err(|error| error.to_string())
    })
}

fn message(row: &Row) -> MeasuredState {
    MeasuredState {
        position: row.position_m.into(),
        velocity: row.velocity_m_s.into(),
        attitude: row.quaternion(),
        angular_velocity: row.angular_velocity_rad_s.into(),
        ..Default::default()
    }
}
