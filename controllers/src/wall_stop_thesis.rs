//! The thesis's stop before a wall (§5.5, Figs 5.30–5.34), as it is told there: no integrator and no feed-forward.
//!
//! - Free flight: the pitch command is a function of the distance to the wall ahead (`FreeFlight`), which decreases on
//!   the way. The velocity ahead is not controlled: it rises until the reference distance is reached.
//! - Then "the quadrotor slowed down and stopped with referenced constant distance (3 m)", by the PD on the velocity, set
//!   to zero. Velocity alone would stop it wherever it comes to rest; so the pitch goes on as a function of the distance,
//!   pushing back, `stiffness` times the distance's error.
//! - The PD sets the velocity along y to zero throughout.
//!
//! `wall_stop` is ours, along a velocity curve. docs/walls.md flies both.

use crate::allocation::RotorWrench;
use crate::control::ControlOutput;
use crate::free_flight::FreeFlight;
use crate::law::{Law, LawContext, Predecessor};
use crate::law_inputs::WallInputs;
use crate::velocity::{LoopsGains, VelocityLoop, VelocitySetPoint, VelocityState};
use component::Info;
use diagnostics::parameter::{ParameterError, finite, positive, up_to};
use diagnostics::unit::PER_SECOND_2;
use std::path::{Path, PathBuf};

/// Flying by the pitch that the distance makes.
pub const FREE_FLIGHT: u32 = 1;
/// The reference distance was reached: slowing down and standing.
pub const STOPPING: u32 = 2;

gains! {
    /// Gains of the guidance, and of the loops inside.
    pub struct WallStopThesisGains of file, built in "wall-stop-thesis.toml" {
        /// From the distance still to go to a pitch.
        free_flight: FreeFlight = FreeFlight::read(&file.table("free_flight")),
        /// Once it stops: error of the distance (m) to acceleration (m/s²), which gravity turns into pitch, 1/s².
        stiffness_1_s2: f64 = file.gain("stop.stiffness", PER_SECOND_2),
        /// The loops inside.
        loops: LoopsGains = LoopsGains::read(file),
    }
}

/// The law.
///
/// ```
/// use component::messages::{AttitudeEstimate, WallEstimate};
/// use controllers::{controller::Controller, law_inputs::WallInputs, wall_stop_thesis::WallStopThesisLaw};
///
/// let vehicle = concat!(env!("CARGO_MANIFEST_DIR"), "/../vehicles/hummingbird.toml");
/// let parameters = serde_json::json!({ "vehicle": vehicle, "altitude_m": 1.0, "pitch_deg": 1.0 });
/// let pitch_deg = |distance_m: f64| {
///     let mut law = component::Harness::<Controller<WallStopThesisLaw>>::from_json(&parameters).unwrap();
///     let walls = WallEstimate { distance: [distance_m; 4], in_sight: [1; 4], height: 1.0, ..Default::default() };
///     let attitude = AttitudeEstimate::default();
///     let status = (0..2000).map(|_| law.step(WallInputs { walls: &walls, attitude: &attitude }).unwrap().status);
///     status.last().unwrap().unwrap().attitude_set_point[1].to_degrees()
/// };
/// assert!((pitch_deg(7.65) - 1.0).abs() < 1e-6, "at first sight");
/// assert!((pitch_deg(5.325) - 0.5).abs() < 1e-6, "half way to 3 m");
/// assert!(pitch_deg(2.9) < 0.0, "too near");
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WallStopThesisLaw {
    /// Gains of the guidance.
    pub gains: WallStopThesisGains,
    /// The loops inside.
    pub velocity: VelocityLoop,
    /// Pitch of free flight, far from the wall, rad.
    pub pitch_rad: f64,
    /// Level distance from the wall at which it stops, m.
    pub distance_m: f64,
    /// Height above the ground below, m.
    pub altitude_m: f64,
    /// Yaw, rad.
    pub heading_rad: f64,
}

/// State of the law.
#[derive(Debug, Clone, Copy, PartialEq, Default, component::Message)]
#[repr(C)]
#[message(type_name = "hummingbus_msgs/msg/WallStopThesisState")]
pub struct WallStopThesisState {
    /// The loops inside.
    pub velocity: VelocityState,
    /// [`FREE_FLIGHT`] or [`STOPPING`].
    #[field(unit = "1")]
    pub phase: u32,
    /// Zero.
    #[field(unit = "")]
    pub pad0: u32,
}

/// Parameters of the thesis's wall-stop controller.
#[derive(Debug, component::Parameters)]
pub struct Parameters {
    /// Vehicle file, relative to the manifest.
    #[parameter(file = vehicles::FILE)]
    vehicle: PathBuf,
    /// Gains file, relative to the manifest.
    #[parameter(shown = "the gains of controllers/gains/wall-stop-thesis.toml", file = crate::gains_file::FILE)]
    gains: Option<PathBuf>,
    /// Height above what is below.
    #[parameter(check = positive, example = "1.0")]
    altitude_m: f64,
    /// Pitch of free flight far from the wall.
    ///
    /// Tuned, no source: the thesis's text has no number. From 5 m to go and in still air the law alone makes 0.96 m/s.
    #[parameter(default = 1.0, check = up_to(PITCH_MAX_DEG, "deg"))]
    pitch_deg: f64,
    /// Level distance from the wall at which it stops.
    ///
    /// Thesis §5.5.
    #[parameter(default = 3.0, check = up_to(DISTANCE_MAX_M, "m"))]
    distance_m: f64,
    /// Yaw.
    #[parameter(default = 0.0, check = finite)]
    heading_rad: f64,
}

/// Beyond this it comes too fast to stop within the 3 m. Tuned, no source.
const PITCH_MAX_DEG: f64 = 5.0;
/// Beyond this the sensors' reach of 7.65 m (thesis §5.5) leaves too little to fly by.
const DISTANCE_MAX_M: f64 = 5.0;

impl Law for WallStopThesisLaw {
    const INFO: Info = Info::new(
        "wall-stop-thesis",
        "the thesis's stop before a wall: pitch by the distance, then velocity PD to zero",
    );
    type Parameters = Parameters;
    type Inputs<'a> = WallInputs<'a>;
    type State = WallStopThesisState;

    fn vehicle(parameters: &Self::Parameters) -> &Path {
        &parameters.vehicle
    }

    fn new(parameters: &Self::Parameters, context: &LawContext<'_>) -> Result<Self, ParameterError> {
        let gains = WallStopThesisGains::load(&context.node.files, parameters.gains.as_deref())?;
        Ok(Self {
            velocity: VelocityLoop::new(&gains.loops, context.craft.hover_model(), context.node.period_s()),
            gains,
            pitch_rad: parameters.pitch_deg.to_radians(),
            distance_m: parameters.distance_m,
            altitude_m: parameters.altitude_m,
            heading_rad: parameters.heading_rad,
        })
    }

    fn rate_gain_1_s(&self) -> f64 {
        self.velocity.cascade.rate_gain_1_s()
    }

    fn start(
        &self,
        from: Option<&Predecessor<'_, WallStopThesisState>>,
        inputs: &WallInputs<'_>,
    ) -> WallStopThesisState {
        let velocity = self.velocity.begun(from, &inputs.walls.velocity, &inputs.measured());
        WallStopThesisState { velocity, phase: FREE_FLIGHT, ..WallStopThesisState::default() }
    }

    fn step(
        &self,
        state: &mut WallStopThesisState,
        last: &RotorWrench,
        inputs: &WallInputs<'_>,
    ) -> ControlOutput {
        let to_go_m = inputs.walls.distance[0] - self.distance_m;
        if to_go_m <= 0.0 {
            state.phase = STOPPING;
        }
        let (altitude_m, yaw_rad) = (self.altitude_m, self.heading_rad);
        let at_rest = VelocitySetPoint { altitude_m, yaw_rad, ..VelocitySetPoint::default() };
        let braking_m_s2 =
            self.velocity.accelerations_m_s2(&mut state.velocity, &at_rest, &inputs.walls.velocity);
        let acceleration_m_s2 = [self.ahead_m_s2(state.phase, to_go_m, braking_m_s2[0]), braking_m_s2[1]];
        let measured = inputs.measured();
        let output =
            self.velocity.accelerate(&mut state.velocity, last, &at_rest, &acceleration_m_s2, &measured);
        ControlOutput { phase: state.phase, ..output }
    }
}

impl WallStopThesisLaw {
    /// The acceleration towards the wall, where the PD asks for `braking_m_s2`.
    fn ahead_m_s2(&self, phase: u32, to_go_m: f64, braking_m_s2: f64) -> f64 {
        if phase == FREE_FLIGHT {
            let gravity_m_s2 = self.velocity.cascade.vehicle.gravity_m_s2;
            return self.gains.free_flight.acceleration_m_s2(to_go_m, self.pitch_rad, gravity_m_s2);
        }
        let max_m_s2 = self.velocity.gains.acceleration_max_m_s2;
        (self.gains.stiffness_1_s2 * to_go_m + braking_m_s2).clamp(-max_m_s2, max_m_s2)
    }
}
