//! The wall-follow controller node: laps along the walls of a room.

use crate::airframe::ControlledVehicle;
use crate::controller;
use crate::rehearsal;
use crate::room::Room;
use crate::velocity_law::VelocityLoop;
use crate::wall_follow_law::{Mode, Shared, WallFollowGains, WallFollowLaw};
use bus::kind::{Inputs, NodeKind, PortSpec};
use bus::messages::{AttitudeEstimate, ControlStatus, MotorCommand, WallEstimate};
use bus::{BusError, Message, Node};
use diagnostics::parameter::{ParameterError, finite, positive, positive_up_to};
use serde::Deserialize;
use std::path::PathBuf;

/// The wall-follow controller, for manifests.
pub const KIND: NodeKind = NodeKind {
    name: "wall-follow",
    summary: "follows the walls of a room by range finders, at varying or constant speed",
    inputs: Inputs::Ports(&[
        PortSpec::required("walls", WallEstimate::SCHEMA),
        PortSpec::required("attitude", AttitudeEstimate::SCHEMA),
    ]),
    outputs: &[
        PortSpec::required("command", MotorCommand::SCHEMA),
        PortSpec::optional("status", ControlStatus::SCHEMA),
    ],
    check: |parameters, run| {
        let (law, craft) = build(&diagnostics::read(parameters)?, run.period_s())?;
        rehearsal::check(&law, &craft, run)
    },
    run,
};

/// Parameters of the wall-follow controller.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Parameters {
    /// Vehicle file.
    vehicle: PathBuf,
    /// Gains file; the built-in `controllers/gains/wall-follow.toml` where there is none.
    gains: Option<PathBuf>,
    /// "varying" or "constant".
    mode: String,
    /// Height above what is below.
    altitude_m: f64,
    /// The constant speed, or the most of the varying one.
    speed_m_s: Option<f64>,
    /// Distance from the walls.
    #[serde(default = "default_distance_m")]
    distance_m: f64,
    /// Yaw.
    #[serde(default)]
    heading_rad: f64,
    /// The state in which it begins.
    #[serde(default = "default_start_state")]
    start_state: u32,
    /// Size of the room, where it is shared with other vehicles.
    room_m: Option<[f64; 2]>,
    /// Where it starts, from the walls at -x and -y.
    start_in_room_m: Option<[f64; 2]>,
    /// Least distance to a vehicle ahead.
    ahead_min_m: Option<f64>,
}

/// Thesis §5.5.
fn default_distance_m() -> f64 {
    3.0
}

fn default_start_state() -> u32 {
    1
}

/// Tuned, no source: the thesis does not say how fast it flies.
const VARYING_SPEED_M_S: f64 = 1.5;
const CONSTANT_SPEED_M_S: f64 = 0.7;

/// Twice a Hummingbird's width. Tuned, no source: ten vehicles on a loop of 16 m see each other at 1.3 m, where twice
/// this does not slow them down yet.
const AHEAD_MIN_M: f64 = 0.6;

/// Beyond these the sensors' reach of 7.65 m (thesis §5.5) leaves too little to turn in.
const SPEED_MAX_M_S: f64 = 2.0;
const DISTANCE_MAX_M: f64 = 5.0;

impl Parameters {
    fn mode(&self) -> Result<Mode, ParameterError> {
        match self.mode.as_str() {
            "varying" => Ok(Mode::Varying),
            "constant" => Ok(Mode::Constant),
            other => Err(ParameterError::conflict(
                "mode",
                format!("`mode` must be \"varying\" or \"constant\", found \"{other}\""),
            )),
        }
    }

    fn check(&self) -> Result<(), ParameterError> {
        positive("altitude_m", self.altitude_m)?;
        finite("heading_rad", self.heading_rad)?;
        positive_up_to("distance_m", self.distance_m, DISTANCE_MAX_M, "m")?;
        let speed_m_s = self.speed_m_s.unwrap_or(CONSTANT_SPEED_M_S);
        positive_up_to("speed_m_s", speed_m_s, SPEED_MAX_M_S, "m/s")?;
        if (1..=5).contains(&self.start_state) {
            return Ok(());
        }
        Err(ParameterError::conflict(
            "start_state",
            format!("`start_state` must be 1 to 5, found {}", self.start_state),
        ))
    }

    fn shared(&self, mode: Mode) -> Result<Option<Shared>, ParameterError> {
        let of_a_room = [
            ("start_in_room_m", self.start_in_room_m.is_some()),
            ("ahead_min_m", self.ahead_min_m.is_some()),
        ];
        let Some(size_m) = self.room_m else {
            return match of_a_room.into_iter().find(|(_, is_given)| *is_given) {
                Some((key, _)) => Err(ParameterError::conflict(
                    "room_m",
                    format!("`{key}` has a meaning only with `room_m`; add that"),
                )),
                None => Ok(None),
            };
        };
        if mode == Mode::Varying {
            return Err(ParameterError::conflict(
                "room_m",
                "`room_m` has a meaning only in the mode \"constant\"; leave it out",
            ));
        }
        let least_m = 2.0 * self.distance_m;
        if !size_m.iter().all(|side_m| side_m.is_finite() && *side_m > least_m) {
            return Err(ParameterError::conflict(
                "room_m",
                format!("`room_m` must be two lengths above 2 distance_m = {least_m} m, found {size_m:?}"),
            ));
        }
        let ahead_min_m = self.ahead_min_m.unwrap_or(AHEAD_MIN_M);
        positive_up_to("ahead_min_m", ahead_min_m, DISTANCE_MAX_M, "m")?;
        self.check_start(size_m)?;
        Ok(Some(Shared { room: Room { size_m }, start_m: self.start_in_room_m, ahead_min_m }))
    }

    fn check_start(&self, size_m: [f64; 2]) -> Result<(), ParameterError> {
        let start_m = self.start_in_room_m.unwrap_or(size_m);
        if start_m.iter().zip(size_m).all(|(at_m, side_m)| (0.0..=side_m).contains(at_m)) {
            return Ok(());
        }
        Err(ParameterError::conflict(
            "start_in_room_m",
            format!("`start_in_room_m` must lie within room_m = {size_m:?} m, found {start_m:?}"),
        ))
    }
}

fn build(
    parameters: &Parameters,
    period_s: f64,
) -> Result<(WallFollowLaw, ControlledVehicle), ParameterError> {
    let mode = parameters.mode()?;
    parameters.check()?;
    let craft = ControlledVehicle::load(&parameters.vehicle)?;
    let gains = WallFollowGains::load(parameters.gains.as_deref())
        .map_err(|error| ParameterError::conflict("gains", error))?;
    let usual_m_s = if mode == Mode::Varying { VARYING_SPEED_M_S } else { CONSTANT_SPEED_M_S };
    let law = WallFollowLaw {
        velocity: VelocityLoop::new(&gains.loops, craft.hover_model(), period_s),
        gains,
        mode,
        speed_m_s: parameters.speed_m_s.unwrap_or(usual_m_s),
        distance_m: parameters.distance_m,
        altitude_m: parameters.altitude_m,
        heading_rad: parameters.heading_rad,
        start_state: parameters.start_state,
        shared: parameters.shared(mode)?,
    };
    Ok((law, craft))
}

fn run() -> Result<(), BusError> {
    let node = Node::join()?;
    let (law, craft) = build(&node.parameters()?, node.period_s()).map_err(|error| node.error(error))?;
    controller::run(node, &law, &craft)
}
