//! Guidance along the walls of a room, around velocity PD and cascade: ours, in the thesis's five states (`legs`).
//! `wall_follow_thesis` has the thesis's own (§5.5, Figs 5.36 and 5.46); docs/walls.md flies both.
//!
//! A state gives way to the next where the wall ahead is as near as the wall beside is to be.
//!
//! - Mode *varying*: the velocity ahead shrinks with the distance to the wall ahead, and with it the tilt; the
//!   velocity across is held at zero. Nothing holds the distance to the wall beside.
//! - Mode *constant*: the velocity across is the `Approach` curve over the error of the distance to the wall
//!   beside. The velocity ahead is the rest of the constant speed, √(v² − v_across²). The next state begins
//!   where the curve's velocity towards the wall ahead, which is then the one beside, equals the speed. So
//!   the velocity command turns in a corner without changing its length, and there is no jump in it. An
//!   integrator over that error compensates a tilted attitude estimate.
//!
//! If the room's size is known ([`Room`]), other vehicles in the beams are distinguished from walls. A
//! vehicle that is ahead slows this one down to a stop.

use crate::allocation::RotorWrench;
use crate::approach::Approach;
use crate::control::ControlOutput;
use crate::law::{Law, LawContext, Predecessor};
use crate::law_inputs::WallInputs;
use crate::legs::{self, Beam, Leg};
use crate::room::Room;
use crate::velocity::{LoopsGains, VelocityLoop, VelocitySetPoint, VelocityState};
use component::Info;
use component::messages::WallEstimate;
use diagnostics::nine_decimals;
use diagnostics::parameter::{ParameterError, finite, positive, refuse, require, up_to, within};
use diagnostics::unit::{ACCELERATION, PER_SECOND, PER_SECOND_3, VELOCITY};
use serde::Deserialize;
use std::path::{Path, PathBuf};

/// Something ahead is a vehicle where it is this much nearer than the wall must be, m. Tuned, no source: above the
/// error of the wall's place, below any gap that matters.
const OBSTACLE_MARGIN_M: f64 = 0.5;

gains! {
    /// Gains of the guidance, and of the loops inside.
    pub struct WallFollowGains of file, built in "wall-follow.toml" {
        /// Mode varying: distance still to go (m) to velocity ahead (m/s), 1/s.
        varying_slope_1_s: f64 = file.limit("varying.slope", PER_SECOND),
        /// Mode varying: velocity with which the next state is reached, m/s.
        exit_speed_m_s: f64 = file.limit("varying.exit_speed", VELOCITY),
        /// Mode constant: error of the distance to the wall beside to velocity towards it.
        across: Approach = Approach::read(&file.table("constant")),
        /// Mode constant: that error (m) held for one second to acceleration (m/s²), 1/s³.
        integral_1_s3: f64 = file.gain("constant.integral", PER_SECOND_3),
        /// The most that the integrator asks for, m/s².
        integral_max_m_s2: f64 = file.gain("constant.integral_max", ACCELERATION),
        /// The loops inside.
        loops: LoopsGains = LoopsGains::read(file),
    }
}

/// Choice of the velocity along the walls.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Mode {
    /// By the distance to the wall ahead.
    Varying,
    /// Constant, at a constant distance to the wall beside.
    Constant,
}

/// Room that is known beforehand, for a vehicle that shares it with others.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Shared {
    /// The room.
    pub room: Room,
    /// Place of the vehicle at the start, from the walls at -x and -y, m; that by the beams where it is not given.
    pub start_m: Option<[f64; 2]>,
    /// It stops where an object ahead is nearer than this, and flies at full speed from twice this on, m.
    pub ahead_min_m: f64,
}

/// The law.
///
/// ```
/// use component::messages::{AttitudeEstimate, WallEstimate};
/// use controllers::{controller::Controller, law_inputs::WallInputs, wall_follow::WallFollowLaw};
///
/// let vehicle = concat!(env!("CARGO_MANIFEST_DIR"), "/../vehicles/hummingbird.toml");
/// let parameters = serde_json::json!({ "vehicle": vehicle, "altitude_m": 1.0, "mode": "constant" });
/// let mut law = component::Harness::<Controller<WallFollowLaw>>::from_json(&parameters).unwrap();
/// let walls = WallEstimate { distance: [5.0; 4], in_sight: [1; 4], height: 1.0, ..Default::default() };
/// let inputs = WallInputs { walls: &walls, attitude: &AttitudeEstimate::default() };
/// let status = law.step(inputs).unwrap().status.unwrap();
/// assert!(status.state == 1 && status.velocity_set_point[0] > 0.0, "m/s to the first wall: {status:?}");
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WallFollowLaw {
    /// Gains of the guidance.
    pub gains: WallFollowGains,
    /// The loops inside.
    pub velocity: VelocityLoop,
    /// Choice of the velocity.
    pub mode: Mode,
    /// The constant speed, or the most of the varying one, m/s.
    pub speed_m_s: f64,
    /// Level distance from the walls, m.
    pub distance_m: f64,
    /// Height above the ground below, m.
    pub altitude_m: f64,
    /// Yaw, rad.
    pub heading_rad: f64,
    /// The state in which it begins, 1 to 5.
    pub start_state: u32,
    /// For a room that is shared.
    pub shared: Option<Shared>,
}

/// State of the law.
#[derive(Debug, Clone, Copy, PartialEq, Default, component::Message)]
#[repr(C)]
#[message(type_name = "hummingbus_msgs/msg/WallFollowState")]
pub struct WallFollowState {
    /// The loops inside.
    pub velocity: VelocityState,
    /// Acceleration that the integrators over the distance beside ask for, along the heading's level x and y.
    #[field(unit = "m/s^2")]
    pub integral: [f64; 2],
    /// Distances from the walls at the heading's -x and -y, where the room is known.
    #[field(unit = "m")]
    pub room_position: [f64; 2],
    /// The state of the guidance, 1 to 5.
    #[field(unit = "1")]
    pub phase: u32,
    /// Laps flown.
    #[field(unit = "1")]
    pub laps: u32,
}

/// Parameters of the wall-follow controller.
#[derive(Debug, component::Parameters)]
pub struct Parameters {
    /// Vehicle file, relative to the manifest.
    #[parameter(file = vehicles::FILE)]
    vehicle: PathBuf,
    /// Gains file, relative to the manifest.
    #[parameter(shown = "the gains of controllers/gains/wall-follow.toml", file = crate::gains_file::FILE)]
    gains: Option<PathBuf>,
    /// The speed shrinks with the distance to the wall ahead, or speed and distance are constant.
    #[parameter(range = "`varying`, `constant`", example = "\"varying\"")]
    mode: Mode,
    /// Height above what is below.
    #[parameter(check = positive, example = "1.0")]
    altitude_m: f64,
    /// The constant speed, or the most of the varying one.
    #[parameter(shown = "0.7, varying 1.5", check = up_to(SPEED_MAX_M_S, "m/s"))]
    speed_m_s: Option<f64>,
    /// Level distance from the walls.
    ///
    /// Thesis §5.5.
    #[parameter(default = 3.0, check = up_to(DISTANCE_MAX_M, "m"))]
    distance_m: f64,
    /// Yaw.
    #[parameter(default = 0.0, check = finite)]
    heading_rad: f64,
    /// The state in which it begins.
    #[parameter(default = 1, check = within(1.0..=5.0, "1 to 5"))]
    start_state: u32,
    /// Mode constant, in a room shared with other vehicles: its size along the heading's x and y.
    #[parameter(range = "two lengths above 2 `distance_m`")]
    room_m: Option<[f64; 2]>,
    /// Place at the start, from the walls at −x and −y, with `room_m`.
    #[parameter(shown = "what the beams tell", range = "within `room_m`")]
    start_in_room_m: Option<[f64; 2]>,
    /// It stops where a vehicle ahead is this near, and slows down from twice this on, with `room_m`.
    #[parameter(shown = "0.6", check = up_to(DISTANCE_MAX_M, "m"))]
    ahead_min_m: Option<f64>,
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
    fn shared(&self) -> Result<Option<Shared>, ParameterError> {
        let of_a_room = [
            ("start_in_room_m", self.start_in_room_m.is_some()),
            ("ahead_min_m", self.ahead_min_m.is_some()),
        ];
        let Some(size_m) = self.room_m else {
            let lonely = of_a_room.into_iter().map(|(key, is_given)| {
                refuse(is_given, "room_m", || format!("`{key}` has a meaning only with `room_m`; add that"))
            });
            return ParameterError::gather(lonely).map(|_| None);
        };
        let is_constant = refuse(
            self.mode == Mode::Varying,
            "room_m",
            || "`room_m` has a meaning only in the mode \"constant\"; leave it out",
        );
        let least_m = 2.0 * self.distance_m;
        let has_room = size_m.iter().all(|side_m| side_m.is_finite() && *side_m > least_m);
        let expected = format!("two lengths above 2 distance_m = {} m", nine_decimals(least_m));
        let room = require("room_m", format_args!("{size_m:?}"), has_room, expected);
        ParameterError::gather([is_constant, room, self.start_within(size_m, has_room)])?;
        let ahead_min_m = self.ahead_min_m.unwrap_or(AHEAD_MIN_M);
        Ok(Some(Shared { room: Room { size_m }, start_m: self.start_in_room_m, ahead_min_m }))
    }

    /// Refuses a start outside of a room of this size. A room that is refused does not limit the start.
    fn start_within(&self, size_m: [f64; 2], has_room: bool) -> Result<(), ParameterError> {
        let Some(start_m) = self.start_in_room_m else { return Ok(()) };
        let limits_m = if has_room { size_m } else { [f64::INFINITY; 2] };
        let is_within = start_m.iter().zip(limits_m).all(|(at_m, limit_m)| (0.0..=limit_m).contains(at_m));
        let expected = format!("within room_m = {size_m:?} m");
        require("start_in_room_m", format_args!("{start_m:?}"), is_within, expected)
    }
}

impl Law for WallFollowLaw {
    const INFO: Info = Info::new(
        "wall-follow",
        "follows the walls of a room by range finders, at varying or constant speed",
    );
    type Parameters = Parameters;
    type Inputs<'a> = WallInputs<'a>;
    type State = WallFollowState;

    fn vehicle(parameters: &Self::Parameters) -> &Path {
        &parameters.vehicle
    }

    fn new(parameters: &Self::Parameters, context: &LawContext<'_>) -> Result<Self, ParameterError> {
        let gains = WallFollowGains::load(&context.node.files, parameters.gains.as_deref());
        let (gains, shared) = ParameterError::both(gains, parameters.shared())?;
        let nominal_m_s =
            if parameters.mode == Mode::Varying { VARYING_SPEED_M_S } else { CONSTANT_SPEED_M_S };
        Ok(Self {
            velocity: VelocityLoop::new(&gains.loops, context.craft.hover_model(), context.node.period_s()),
            gains,
            mode: parameters.mode,
            speed_m_s: parameters.speed_m_s.unwrap_or(nominal_m_s),
            distance_m: parameters.distance_m,
            altitude_m: parameters.altitude_m,
            heading_rad: parameters.heading_rad,
            start_state: parameters.start_state,
            shared,
        })
    }

    fn rate_gain_1_s(&self) -> f64 {
        self.velocity.cascade.rate_gain_1_s()
    }

    fn start(
        &self,
        from: Option<&Predecessor<'_, WallFollowState>>,
        inputs: &WallInputs<'_>,
    ) -> WallFollowState {
        // A backup in flight goes on from where it is, not from where the run began.
        let place_m = |shared: Shared| {
            let start_m = shared.start_m.filter(|_| from.is_none());
            start_m.unwrap_or_else(|| shared.room.begun_m(inputs.walls))
        };
        WallFollowState {
            velocity: self.velocity.begun(from, &inputs.walls.velocity, &inputs.measured()),
            room_position: self.shared.map_or([0.0; 2], place_m),
            phase: self.start_state,
            ..WallFollowState::default()
        }
    }

    fn step(
        &self,
        state: &mut WallFollowState,
        last: &RotorWrench,
        inputs: &WallInputs<'_>,
    ) -> ControlOutput {
        let distances_m = self.wall_distances_m(state, inputs.walls);
        self.enter_phase(state, &distances_m);
        let leg = Leg::of(state.phase);
        let asked = match self.mode {
            Mode::Varying => self.varying(state, leg, &distances_m),
            Mode::Constant => self.constant(state, leg, &distances_m, inputs.walls),
        };
        let measured = inputs.measured();
        let output =
            self.velocity.demand(&mut state.velocity, last, &asked, &inputs.walls.velocity, &measured);
        ControlOutput { phase: state.phase, laps: state.laps, ..output }
    }
}

impl WallFollowLaw {
    /// Distances of the walls at +x, −x, +y, −y: by the room's size where that is known, else those of the beams.
    fn wall_distances_m(&self, state: &mut WallFollowState, walls: &WallEstimate) -> [f64; 4] {
        let Some(Shared { room, .. }) = self.shared else { return walls.distance };
        let period_s = self.velocity.cascade.period_s;
        state.room_position = room.moved_m(&state.room_position, walls, period_s);
        room.distances_m(&state.room_position)
    }

    fn enter_phase(&self, state: &mut WallFollowState, distances_m: &[f64; 4]) {
        let ahead = Leg::of(state.phase).ahead;
        let corner_m = match self.mode {
            Mode::Varying => self.distance_m,
            Mode::Constant => self.distance_m + self.gains.across.distance_m(self.speed_m_s),
        };
        if distances_m[ahead.0] > corner_m {
            return;
        }
        (state.phase, state.laps) = legs::next(state.phase, state.laps);
    }

    /// Ahead by the distance still to go, nothing across.
    fn varying(&self, state: &WallFollowState, leg: Leg, distances_m: &[f64; 4]) -> VelocitySetPoint {
        let to_go_m = distances_m[leg.ahead.0] - self.distance_m;
        let wanted_m_s =
            (self.gains.varying_slope_1_s * to_go_m).max(self.gains.exit_speed_m_s).min(self.speed_m_s);
        let mut velocity_m_s = [0.0; 2];
        velocity_m_s[leg.ahead.axis()] = self.gathered_m_s(state, leg.ahead, wanted_m_s);
        self.asked(state, velocity_m_s, [0.0; 2])
    }

    /// Along the wall beside at a constant distance and speed.
    fn constant(
        &self,
        state: &mut WallFollowState,
        leg: Leg,
        distances_m: &[f64; 4],
        walls: &WallEstimate,
    ) -> VelocitySetPoint {
        let (mut velocity_m_s, mut feed_forward_m_s2) = ([0.0; 2], [0.0; 2]);
        if let Some(beside) = leg.beside {
            let error_m = distances_m[beside.0] - self.distance_m;
            let closing_m_s = beside.sign() * walls.velocity[beside.axis()];
            let wanted_m_s = self.gains.across.speed_m_s(error_m).clamp(-self.speed_m_s, self.speed_m_s);
            let bent_m_s2 = self.gains.across.acceleration_m_s2(error_m, closing_m_s);
            velocity_m_s[beside.axis()] = beside.sign() * wanted_m_s;
            feed_forward_m_s2[beside.axis()] = beside.sign() * bent_m_s2;
            self.integrate(state, beside, error_m);
        }
        let across_m_s = velocity_m_s[leg.across()];
        let left_m_s = (self.speed_m_s * self.speed_m_s - across_m_s * across_m_s).max(0.0).sqrt();
        let wanted_m_s = left_m_s * self.free_part(distances_m[leg.ahead.0], walls.distance[leg.ahead.0]);
        velocity_m_s[leg.ahead.axis()] = self.gathered_m_s(state, leg.ahead, wanted_m_s);
        self.asked(state, velocity_m_s, feed_forward_m_s2)
    }

    /// Only small errors are integrated: in a corner the distance is on its way.
    fn integrate(&self, state: &mut WallFollowState, beside: Beam, error_m: f64) {
        let on_its_way_m = 0.5 * self.gains.across.distance_m(self.speed_m_s);
        if error_m.abs() < on_its_way_m {
            let step_m_s2 = self.gains.integral_1_s3 * error_m * self.velocity.cascade.period_s;
            let max_m_s2 = self.gains.integral_max_m_s2;
            let integral = &mut state.integral[beside.axis()];
            *integral = (*integral + beside.sign() * step_m_s2).clamp(-max_m_s2, max_m_s2);
        }
    }

    /// The part of the speed that a vehicle ahead leaves: 1 where the beam ahead sees the wall.
    fn free_part(&self, wall_m: f64, beam_m: f64) -> f64 {
        match self.shared {
            Some(Shared { ahead_min_m, .. }) if beam_m < wall_m - OBSTACLE_MARGIN_M => {
                ((beam_m - ahead_min_m) / ahead_min_m).clamp(0.0, 1.0)
            }
            _ => 1.0,
        }
    }

    fn gathered_m_s(&self, state: &WallFollowState, ahead: Beam, wanted_m_s: f64) -> f64 {
        let before_m_s = state.velocity.velocity_command[ahead.axis()];
        self.velocity.gathered_m_s(before_m_s, ahead.sign() * wanted_m_s)
    }

    fn asked(
        &self,
        state: &WallFollowState,
        velocity_m_s: [f64; 2],
        feed_forward_m_s2: [f64; 2],
    ) -> VelocitySetPoint {
        let (altitude_m, yaw_rad) = (self.altitude_m, self.heading_rad);
        let integral_m_s2 = state.integral;
        VelocitySetPoint { velocity_m_s, feed_forward_m_s2, integral_m_s2, altitude_m, yaw_rad }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gains_file::parse;

    #[test]
    fn impossible_gains_are_refused_with_their_key() {
        let text = WallFollowGains::BUILT_IN.replacen("value = 0.6", "value = -0.6", 1);
        let error = parse(&text, "my.toml", WallFollowGains::read).unwrap_err().to_string();
        assert!(error.contains("varying.slope"), "{error}");
    }
}
