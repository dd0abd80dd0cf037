//! The player node: publishes the motor commands and the measured states of a real flight.

use crate::flight_log::{ColumnMap, FlightLog, Gap, Row};
use component::context::{NodeContext, StepContext};
use component::messages::{Battery, MeasuredState, MotorCommand, Quaternion};
use component::{Component, Info, OutputPorts, StepError};
use diagnostics::parameter::{ParameterError, refuse};
use inputs::{FileKind, InputFiles};
use serde::Deserialize;
use std::path::PathBuf;

/// Parameters of the player.
#[derive(Debug, component::Parameters)]
pub struct Parameters {
    /// CSV file of the flight, relative to the manifest.
    #[parameter(file = FileKind::DATA)]
    data: PathBuf,
    /// Time in the flight, from its first row, at which tick 0 lies.
    #[parameter(default = 0.0, range = "within the flight")]
    from_s: f64,
    /// Table of the columns of the quantities and their units.
    #[parameter(table = ColumnMap, example = "{ time = { columns = [\"t\"], unit = \"s\" }, command = { columns = [\"m1\", \"m2\", \"m3\", \"m4\"], unit = \"count\" }, position = { columns = [\"x\", \"y\", \"z\"], unit = \"m\" }, velocity = { columns = [\"vx\", \"vy\", \"vz\"], unit = \"m/s\" }, attitude = { columns = [\"qx\", \"qy\", \"qz\", \"qw\"], unit = \"1\" }, angular_velocity = { columns = [\"p\", \"q\", \"r\"], unit = \"rad/s\" } }")]
    columns: ColumnMap,
    /// Treatment of gaps, times without rows or without measured commands: the run is refused, or the rows are played as they stand.
    #[parameter(default = Gaps::Refuse, shown = "refuse", range = "`refuse`, `hold`")]
    gaps: Gaps,
}

/// Treatment of gaps: times without rows, or with commands that a logger held or an exporter filled in.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
enum Gaps {
    /// A run that plays one is refused.
    #[default]
    Refuse,
    /// Rows are played as they stand, and the last command holds where there are none.
    Hold,
}

fn load(parameters: &Parameters, files: &InputFiles) -> Result<FlightLog, ParameterError> {
    let log = FlightLog::load(files, &parameters.data, &parameters.columns)?;
    let (from_s, length_s) = (parameters.from_s, log.duration_s());
    refuse(!(0.0..length_s).contains(&from_s), "from_s", || {
        format!("`from_s` is {from_s} s, the flight lasts {length_s:.3} s")
    })
    .map_err(|error| error.advised("choose a time within the flight, from 0 on"))?;
    Ok(log)
}

/// Times are sums of decimal fractions: a nanosecond of slack, as for the rows.
const SLACK_S: f64 = 1e-9;

/// Refuses a run that goes on behind the end of the flight.
fn require_length(log: &FlightLog, from_s: f64, run: &NodeContext<'_>) -> Result<(), ParameterError> {
    let last_tick = (run.duration_ticks.max(1) - 1) / run.period_ticks * run.period_ticks;
    let (last_s, left_s) = (f64::from(last_tick) * run.tick_s(), log.duration_s() - from_s);
    refuse(last_s > left_s + SLACK_S, "from_s", || {
        format!(
            "the flight ends {left_s:.3} s after `from_s`, and the run's last tick lies at {last_s:.3} s; shorten \
             run.duration_s"
        )
    })
}

/// Refuses a run that plays a gap.
fn require_no_gap(log: &FlightLog, from_s: f64, run: &NodeContext<'_>) -> Result<(), ParameterError> {
    let last_s = from_s + f64::from(run.duration_ticks) * run.tick_s();
    let Some(Gap { from_s: begin_s, to_s: end_s, cause }) =
        log.gaps_within(from_s, last_s).into_iter().next()
    else {
        return Ok(());
    };
    refuse(true, "gaps", || {
        format!(
            "the flight has {cause} from {begin_s:.3} s to {end_s:.3} s after its first row, so that the commands there are \
             unknown. Play a part without gaps by `from_s` and run.duration_s, or set `gaps = \"hold\"` to play the rows as they stand"
        )
    })
}

/// Output ports of the player.
#[derive(Debug, OutputPorts)]
pub struct Outputs {
    /// The commands of the flight.
    pub command: MotorCommand,
    /// The measured motion.
    pub measured: MeasuredState,
    /// The measured voltage of the battery, without current and charge; not valid where the flight has none.
    pub battery: Option<Battery>,
}

/// A recorded flight that is played.
///
/// ```
/// use controllers::player::Player;
///
/// let error = component::Harness::<Player>::from_json(&serde_json::json!({ "data": "flight.csv" })).unwrap_err();
/// assert!(error.to_string().contains("columns"), "it has to know which columns hold what: {error}");
/// ```
#[derive(Debug)]
pub struct Player {
    log: FlightLog,
    from_s: f64,
    gaps: Gaps,
}

impl Component for Player {
    const INFO: Info =
        Info::new("player", "commands and measured states of a recorded flight (CSV with a column map)");
    type Parameters = Parameters;
    type Inputs<'a> = ();
    type Outputs = Outputs;
    type State = ();

    fn new(parameters: Parameters, context: &NodeContext<'_>) -> Result<Self, ParameterError> {
        let log = load(&parameters, &context.files)?;
        Ok(Self { log, from_s: parameters.from_s, gaps: parameters.gaps })
    }

    fn rehearse(self, context: &NodeContext<'_>) -> Result<(), ParameterError> {
        let length = require_length(&self.log, self.from_s, context);
        let gaps = match self.gaps {
            Gaps::Refuse => require_no_gap(&self.log, self.from_s, context),
            Gaps::Hold => Ok(()),
        };
        ParameterError::both(length, gaps).map(drop)
    }

    fn initial(&self) {}

    fn step(&self, context: &StepContext<'_>, (): (), (): &mut ()) -> Result<Outputs, StepError> {
        let time_s = self.from_s + context.time_s();
        let left_s = self.log.duration_s() - self.from_s;
        if time_s > self.log.duration_s() + SLACK_S {
            return Err(
                format!("the flight ends {left_s:.3} s after `from_s`; shorten run.duration_s").into()
            );
        }
        let row = self.log.at(time_s);
        let command = MotorCommand { command: row.command, ..Default::default() };
        Ok(Outputs { command, measured: message(&row), battery: Some(battery(&row, context.time_ns())) })
    }
}

/// The voltage of a row. A battery that flies has one above zero.
fn battery(row: &Row, measured_ns: u64) -> Battery {
    let measured = row.battery_v.filter(|voltage| *voltage > 0.0);
    Battery {
        measured_ns,
        voltage: measured.unwrap_or_default(),
        valid: u32::from(measured.is_some()),
        ..Default::default()
    }
}

fn message(row: &Row) -> MeasuredState {
    let [x, y, z, w] = row.attitude;
    MeasuredState {
        position: row.position_m.into(),
        velocity: row.velocity_m_s.into(),
        attitude: Quaternion { x, y, z, w },
        angular_velocity: row.angular_velocity_rad_s.into(),
        ..Default::default()
    }
}
