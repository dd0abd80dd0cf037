//! The thesis's wall following (§5.5), as it is told there, around velocity PD and cascade.
//!
//! The five states of `legs`; each gives way to the next where the wall ahead is at the reference distance.
//!
//! - Mode *varying* (Figs 5.36–5.45): the tilt towards the wall ahead is a function of the distance to it
//!   (`FreeFlight`). The PD sets the velocity across to zero, which also brakes the flight of the state
//!   before. The vehicle therefore stops where it comes to rest, and "does not keep its distance to walls
//!   constant".
//! - Mode *constant* (Figs 5.46–5.54): the PD holds constant velocity commands, the speed ahead and zero across, which
//!   change in steps as the states switch. At a low speed the vehicle comes to rest not far within the distance.
//!
//! Nothing holds the distance beside in either. `wall_follow` is ours. docs/walls.md flies both.

use crate::allocation::RotorWrench;
use crate::control::ControlOutput;
use crate::free_flight::FreeFlight;
use crate::law::{Law, LawContext, Predecessor};
use crate::law_inputs::WallInputs;
use crate::legs::{self, Beam, Leg};
use crate::velocity::{LoopsGains, VelocityLoop, VelocitySetPoint, VelocityState};
use component::Info;
use diagnostics::parameter::{ParameterError, finite, positive, refuse, up_to, within};
use serde::Deserialize;
use std::path::{Path, PathBuf};

gains! {
    /// Gains of the guidance, and of the loops inside.
    pub struct WallFollowThesisGains of file, built in "wall-follow-thesis.toml" {
        /// Mode varying: from the distance still to go to a tilt.
        free_flight: FreeFlight = FreeFlight::read(&file.table("free_flight")),
        /// The loops inside.
        loops: LoopsGains = LoopsGains::read(file),
    }
}

/// Demand of each state towards the wall ahead.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Ahead {
    /// Mode varying: this tilt, far from the wall, rad.
    Tilt(f64),
    /// Mode constant: this velocity, m/s.
    Velocity(f64),
}

/// The law.
///
/// ```
/// use component::messages::{AttitudeEstimate, WallEstimate};
/// use controllers::{controller::Controller, law_inputs::WallInputs, wall_follow_thesis::WallFollowThesisLaw};
///
/// let vehicle = concat!(env!("CARGO_MANIFEST_DIR"), "/../vehicles/hummingbird.toml");
/// let parameters = serde_json::json!({ "vehicle": vehicle, "altitude_m": 1.0, "mode": "constant", "speed_m_s": 0.5 });
/// let mut law = component::Harness::<Controller<WallFollowThesisLaw>>::from_json(&parameters).unwrap();
/// let mut asked_m_s = |ahead_m: f64| {
///     let walls = WallEstimate { distance: [ahead_m, 5.0, 5.0, 5.0], in_sight: [1; 4], ..Default::default() };
///     let status = law.step(WallInputs { walls: &walls, attitude: &AttitudeEstimate::default() }).unwrap().status;
///     status.unwrap().velocity_set_point
/// };
/// assert_eq!(asked_m_s(3.1), [0.5, 0.0], "to the first wall");
/// assert_eq!(asked_m_s(3.0), [0.0, -0.5], "a step, and along it");
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WallFollowThesisLaw {
    /// Gains of the guidance.
    pub gains: WallFollowThesisGains,
    /// The loops inside.
    pub velocity: VelocityLoop,
    /// Demand of each state towards the wall ahead.
    pub ahead: Ahead,
    /// Level distance from a wall at which the next state begins, m.
    pub distance_m: f64,
    /// Height above the ground below, m.
    pub altitude_m: f64,
    /// Yaw, rad.
    pub heading_rad: f64,
    /// The state in which it begins, 1 to 5.
    pub start_state: u32,
}

/// State of the law.
#[derive(Debug, Clone, Copy, PartialEq, Default, component::Message)]
#[repr(C)]
#[message(type_name = "hummingbus_msgs/msg/WallFollowThesisState")]
pub struct WallFollowThesisState {
    /// The loops inside.
    pub velocity: VelocityState,
    /// The state of the guidance, 1 to 5.
    #[field(unit = "1")]
    pub phase: u32,
    /// Laps flown.
    #[field(unit = "1")]
    pub laps: u32,
}

/// Mode of the flight.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
enum Mode {
    Varying,
    Constant,
}

/// Parameters of the thesis's wall-follow controller.
#[derive(Debug, component::Parameters)]
pub struct Parameters {
    /// Vehicle file, relative to the manifest.
    #[parameter(file = vehicles::FILE)]
    vehicle: PathBuf,
    /// Gains file, relative to the manifest.
    #[parameter(shown = "the gains of controllers/gains/wall-follow-thesis.toml", file = crate::gains_file::FILE)]
    gains: Option<PathBuf>,
    /// Kind of command. `varying`: a tilt towards the wall ahead that falls with the distance to it, and no
    /// velocity across (Figs 5.36–5.45). `constant`: velocity commands that switch in steps with the states
    /// (Figs 5.46–5.54).
    #[parameter(range = "`varying`, `constant`", example = "\"varying\"")]
    mode: Mode,
    /// Height above what is below.
    #[parameter(check = positive, example = "1.0")]
    altitude_m: f64,
    /// Mode varying: tilt far from the wall ahead.
    #[parameter(shown = "2.0", check = up_to(TILT_MAX_DEG, "deg"))]
    tilt_deg: Option<f64>,
    /// Mode constant: the speed.
    #[parameter(shown = "0.5", check = up_to(SPEED_MAX_M_S, "m/s"))]
    speed_m_s: Option<f64>,
    /// Level distance from the wall ahead at which the next state begins.
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
}

/// Tuned, no source: the thesis gives neither.
const TILT_DEG: f64 = 2.0;
const SPEED_M_S: f64 = 0.5;

/// Beyond these the sensors' reach of 7.65 m (thesis §5.5) leaves too little to stop in.
const TILT_MAX_DEG: f64 = 5.0;
const SPEED_MAX_M_S: f64 = 2.0;
const DISTANCE_MAX_M: f64 = 5.0;

impl Parameters {
    fn ahead(&self) -> Result<Ahead, ParameterError> {
        let of_the_other = |key: &'static str, is_given: bool, mode: &str| {
            refuse(is_given, key, || {
                format!("`{key}` has a meaning only in the mode \"{mode}\"; leave it out")
            })
        };
        match self.mode {
            Mode::Varying => {
                of_the_other("speed_m_s", self.speed_m_s.is_some(), "constant")?;
                let tilt_deg = self.tilt_deg.unwrap_or(TILT_DEG);
                Ok(Ahead::Tilt(tilt_deg.to_radians()))
            }
            Mode::Constant => {
                of_the_other("tilt_deg", self.tilt_deg.is_some(), "varying")?;
                let speed_m_s = self.speed_m_s.unwrap_or(SPEED_M_S);
                Ok(Ahead::Velocity(speed_m_s))
            }
        }
    }
}

impl Law for WallFollowThesisLaw {
    const INFO: Info = Info::new(
        "wall-follow-thesis",
        "the thesis's wall following: tilt by the distance ahead, or constant velocities that switch",
    );
    type Parameters = Parameters;
    type Inputs<'a> = WallInputs<'a>;
    type State = WallFollowThesisState;

    fn vehicle(parameters: &Self::Parameters) -> &Path {
        &parameters.vehicle
    }

    fn new(parameters: &Self::Parameters, context: &LawContext<'_>) -> Result<Self, ParameterError> {
        let gains = WallFollowThesisGains::load(&context.node.files, parameters.gains.as_deref());
        let (gains, ahead) = ParameterError::both(gains, parameters.ahead())?;
        Ok(Self {
            velocity: VelocityLoop::new(&gains.loops, context.craft.hover_model(), context.node.period_s()),
            gains,
            ahead,
            distance_m: parameters.distance_m,
            altitude_m: parameters.altitude_m,
            heading_rad: parameters.heading_rad,
            start_state: parameters.start_state,
        })
    }

    fn rate_gain_1_s(&self) -> f64 {
        self.velocity.cascade.rate_gain_1_s()
    }

    fn start(
        &self,
        from: Option<&Predecessor<'_, WallFollowThesisState>>,
        inputs: &WallInputs<'_>,
    ) -> WallFollowThesisState {
        let velocity = self.velocity.begun(from, &inputs.walls.velocity, &inputs.measured());
        WallFollowThesisState { velocity, phase: self.start_state, laps: 0 }
    }

    fn step(
        &self,
        state: &mut WallFollowThesisState,
        last: &RotorWrench,
        inputs: &WallInputs<'_>,
    ) -> ControlOutput {
        let to_go_m = |phase| inputs.walls.distance[Leg::of(phase).ahead.0] - self.distance_m;
        if to_go_m(state.phase) <= 0.0 {
            (state.phase, state.laps) = legs::next(state.phase, state.laps);
        }
        let ahead = Leg::of(state.phase).ahead;
        let asked = self.asked(ahead);
        let mut acceleration_m_s2 =
            self.velocity.accelerations_m_s2(&mut state.velocity, &asked, &inputs.walls.velocity);
        if let Ahead::Tilt(tilt_rad) = self.ahead {
            let gravity_m_s2 = self.velocity.cascade.vehicle.gravity_m_s2;
            acceleration_m_s2[ahead.axis()] = ahead.sign()
                * self.gains.free_flight.acceleration_m_s2(to_go_m(state.phase), tilt_rad, gravity_m_s2);
        }
        let measured = inputs.measured();
        let output =
            self.velocity.accelerate(&mut state.velocity, last, &asked, &acceleration_m_s2, &measured);
        ControlOutput { phase: state.phase, laps: state.laps, ..output }
    }
}

impl WallFollowThesisLaw {
    /// Returns the set point of the PD: in mode constant the speed ahead, and nothing else.
    fn asked(&self, ahead: Beam) -> VelocitySetPoint {
        let (altitude_m, yaw_rad) = (self.altitude_m, self.heading_rad);
        let mut asked = VelocitySetPoint { altitude_m, yaw_rad, ..VelocitySetPoint::default() };
        if let Ahead::Velocity(speed_m_s) = self.ahead {
            asked.velocity_m_s[ahead.axis()] = ahead.sign() * speed_m_s;
        }
        asked
    }
}
