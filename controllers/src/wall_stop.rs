//! Guidance to a stop before a wall along a velocity curve, around velocity PD and cascade: ours. `wall_stop_thesis` has
//! the thesis's (§5.5, Figs 5.30–5.34), where the pitch is a function of the distance; docs/walls.md flies both.
//!
//! It flies along the heading's +x. The velocity command is the cruising speed, or the `Approach` curve over
//! the distance still to go where that is slower. The acceleration of the curve is fed forward, earlier by the lag of
//! the pitch behind its command. The vehicle therefore pitches up just before the curve begins, and its speed falls
//! without rising again. Once it has arrived, an integrator over the distance compensates a tilted attitude estimate.
//!
//! Along y it holds its place by the integral of the estimated velocity, as well as that is known: well with a wall
//! beside in sight, and not at all in the open, where no range depends on it.
//!
//! It knows the wall by the range finders' estimate alone, and its height by the beam downwards.

use crate::allocation::RotorWrench;
use crate::approach::Approach;
use crate::control::ControlOutput;
use crate::law::{Law, LawContext, Predecessor};
use crate::law_inputs::WallInputs;
use crate::velocity::{LoopsGains, VelocityLoop, VelocitySetPoint, VelocityState};
use component::Info;
use diagnostics::parameter::{ParameterError, finite, positive, up_to};
use diagnostics::unit::{ACCELERATION, LENGTH, PER_SECOND, PER_SECOND_3, TIME, VELOCITY};
use std::path::{Path, PathBuf};

/// Flying at the cruising speed.
pub const CRUISING: u32 = 1;
/// Slowing down before the wall.
pub const BRAKING: u32 = 2;
/// Holding the distance.
pub const HOLDING: u32 = 3;

/// Factor of the holding limit within which a vehicle goes on holding; beyond it, it counts as braking again.
/// Tuned, no source: so large that no noise exceeds it.
const HOLDING_LEFT_FACTOR: f64 = 3.0;

gains! {
    /// Gains of the guidance, and of the loops inside.
    pub struct WallStopGains of file, built in "wall-stop.toml" {
        /// From the distance still to go to a velocity.
        approach: Approach = Approach::read(&file.table("approach")),
        /// Time by which the fed-forward acceleration is ahead of the velocity command, s.
        lead_s: f64 = file.limit("approach.lead", TIME),
        /// Greatest speed back from a wall that is too near, and back along it, m/s.
        retreat_max_m_s: f64 = file.limit("approach.retreat_max", VELOCITY),
        /// Error of distance (m) held for one second to acceleration (m/s²), 1/s³.
        integral_1_s3: f64 = file.gain("hold.integral", PER_SECOND_3),
        /// The most that the integrator asks for, m/s².
        integral_max_m_s2: f64 = file.gain("hold.integral_max", ACCELERATION),
        /// Holding begins within this of the distance, m,
        holding_distance_m: f64 = file.limit("hold.distance", LENGTH),
        /// below this speed, m/s.
        holding_speed_m_s: f64 = file.limit("hold.speed", VELOCITY),
        /// Displacement along y (m) to a velocity back (m/s), 1/s.
        aside_1_s: f64 = file.gain("hold.aside", PER_SECOND),
        /// Greatest displacement that counts, m.
        aside_max_m: f64 = file.limit("hold.aside_max", LENGTH),
        /// The loops inside.
        loops: LoopsGains = LoopsGains::read(file),
    }
}

/// The law.
///
/// ```
/// use component::messages::{AttitudeEstimate, WallEstimate};
/// use controllers::{controller::Controller, law_inputs::WallInputs, wall_stop::{HOLDING, WallStopLaw}};
///
/// let vehicle = concat!(env!("CARGO_MANIFEST_DIR"), "/../vehicles/hummingbird.toml");
/// let parameters = serde_json::json!({ "vehicle": vehicle, "altitude_m": 1.0 });
/// let mut law = component::Harness::<Controller<WallStopLaw>>::from_json(&parameters).unwrap();
/// let walls = WallEstimate { distance: [3.0; 4], in_sight: [1; 4], height: 1.0, ..Default::default() };
/// let inputs = WallInputs { walls: &walls, attitude: &AttitudeEstimate::default() };
/// assert_eq!(law.step(inputs).unwrap().status.unwrap().state, HOLDING, "it rests 3 m before the wall");
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WallStopLaw {
    /// Gains of the guidance.
    pub gains: WallStopGains,
    /// The loops inside.
    pub velocity: VelocityLoop,
    /// Speed towards the wall, m/s.
    pub cruise_speed_m_s: f64,
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
#[message(type_name = "hummingbus_msgs/msg/WallStopState")]
pub struct WallStopState {
    /// The loops inside.
    pub velocity: VelocityState,
    /// Acceleration that the integrator over the distance asks for.
    #[field(unit = "m/s^2")]
    pub integral: f64,
    /// Displacement along the heading's y, by the estimated velocity, up to a limit.
    #[field(unit = "m")]
    pub aside: f64,
    /// [`CRUISING`], [`BRAKING`] or [`HOLDING`].
    #[field(unit = "1")]
    pub phase: u32,
    /// Zero.
    #[field(unit = "")]
    pub pad0: u32,
}

/// Parameters of the wall-stop controller.
#[derive(Debug, component::Parameters)]
pub struct Parameters {
    /// Vehicle file, relative to the manifest.
    #[parameter(file = vehicles::FILE)]
    vehicle: PathBuf,
    /// Gains file, relative to the manifest.
    #[parameter(shown = "the gains of controllers/gains/wall-stop.toml", file = crate::gains_file::FILE)]
    gains: Option<PathBuf>,
    /// Height above what is below.
    #[parameter(check = positive, example = "1.0")]
    altitude_m: f64,
    /// Speed towards the wall. It never flies faster than it could stop before a wall just out of sight.
    ///
    /// Tuned, no source: the thesis does not say how fast it flies.
    #[parameter(default = 1.0, check = up_to(SPEED_MAX_M_S, "m/s"))]
    cruise_speed_m_s: f64,
    /// Level distance from the wall at which it stops.
    ///
    /// Thesis §5.5.
    #[parameter(default = 3.0, check = up_to(DISTANCE_MAX_M, "m"))]
    distance_m: f64,
    /// Yaw.
    #[parameter(default = 0.0, check = finite)]
    heading_rad: f64,
}

/// Beyond this the sensors' reach of 7.65 m (thesis §5.5) leaves too little to brake in.
const DISTANCE_MAX_M: f64 = 5.0;
/// Greatest cruise speed. If no wall is in sight, the estimate's distance is the sensors' reach. The approach
/// to a wall there keeps the speed below this in any case.
const SPEED_MAX_M_S: f64 = 3.0;

impl Law for WallStopLaw {
    const INFO: Info = Info::new("wall-stop", "flies towards a wall and stops before it, by range finders");
    type Parameters = Parameters;
    type Inputs<'a> = WallInputs<'a>;
    type State = WallStopState;

    fn vehicle(parameters: &Self::Parameters) -> &Path {
        &parameters.vehicle
    }

    fn new(parameters: &Self::Parameters, context: &LawContext<'_>) -> Result<Self, ParameterError> {
        let gains = WallStopGains::load(&context.node.files, parameters.gains.as_deref())?;
        Ok(Self {
            velocity: VelocityLoop::new(&gains.loops, context.craft.hover_model(), context.node.period_s()),
            gains,
            cruise_speed_m_s: parameters.cruise_speed_m_s,
            distance_m: parameters.distance_m,
            altitude_m: parameters.altitude_m,
            heading_rad: parameters.heading_rad,
        })
    }

    fn rate_gain_1_s(&self) -> f64 {
        self.velocity.cascade.rate_gain_1_s()
    }

    fn start(&self, from: Option<&Predecessor<'_, WallStopState>>, inputs: &WallInputs<'_>) -> WallStopState {
        let measured = inputs.measured();
        let velocity = self.velocity.begun(from, &inputs.walls.velocity, &measured);
        WallStopState { velocity, ..WallStopState::default() }
    }

    fn step(&self, state: &mut WallStopState, last: &RotorWrench, inputs: &WallInputs<'_>) -> ControlOutput {
        let to_go_m = inputs.walls.distance[0] - self.distance_m;
        let speed_m_s = inputs.walls.velocity[0];
        state.phase = self.phase(state.phase, to_go_m, speed_m_s);
        self.integrate(state, to_go_m);
        let aside_m = state.aside + inputs.walls.velocity[1] * self.velocity.cascade.period_s;
        state.aside = aside_m.clamp(-self.gains.aside_max_m, self.gains.aside_max_m);
        let asked = self.asked(state, to_go_m);
        let measured = inputs.measured();
        let output =
            self.velocity.demand(&mut state.velocity, last, &asked, &inputs.walls.velocity, &measured);
        ControlOutput { phase: state.phase, ..output }
    }
}

impl WallStopLaw {
    fn phase(&self, before: u32, to_go_m: f64, speed_m_s: f64) -> u32 {
        let (near_m, slow_m_s) = (self.gains.holding_distance_m, self.gains.holding_speed_m_s);
        let has_left = to_go_m.abs() > HOLDING_LEFT_FACTOR * near_m;
        let has_arrived = to_go_m.abs() < near_m && speed_m_s.abs() < slow_m_s;
        if has_arrived || (before == HOLDING && !has_left) {
            HOLDING
        } else if self.gains.approach.speed_m_s(to_go_m) < self.cruise_speed_m_s {
            BRAKING
        } else {
            CRUISING
        }
    }

    /// Only a vehicle that holds integrates: while it approaches, the distance still to go is not an error.
    fn integrate(&self, state: &mut WallStopState, to_go_m: f64) {
        if state.phase == HOLDING {
            let step_m_s2 = self.gains.integral_1_s3 * to_go_m * self.velocity.cascade.period_s;
            let max_m_s2 = self.gains.integral_max_m_s2;
            state.integral = (state.integral + step_m_s2).clamp(-max_m_s2, max_m_s2);
        }
    }

    /// Returns the acceleration of the curve at the place that the vehicle reaches within the lead, at `command_m_s`.
    ///
    /// It is zero where the cruising speed or the limit of the retreat applies instead of the curve. It does not depend
    /// on the measured velocity, which the velocity loop already feeds back.
    fn braking_m_s2(&self, to_go_m: f64, command_m_s: f64) -> f64 {
        let ahead_m = to_go_m - self.gains.lead_s * command_m_s;
        let ahead_m_s = self.gains.approach.speed_m_s(ahead_m);
        let is_on_curve = (-self.gains.retreat_max_m_s..self.cruise_speed_m_s).contains(&ahead_m_s);
        if is_on_curve { self.gains.approach.acceleration_m_s2(ahead_m, ahead_m_s) } else { 0.0 }
    }

    fn asked(&self, state: &WallStopState, to_go_m: f64) -> VelocitySetPoint {
        let near_m_s = self.gains.approach.speed_m_s(to_go_m);
        let wanted_m_s = near_m_s.clamp(-self.gains.retreat_max_m_s, self.cruise_speed_m_s);
        let command_m_s = self.velocity.gathered_m_s(state.velocity.velocity_command[0], wanted_m_s);
        // The hold is stiffer without the curve's acceleration, and its integrator does the same work.
        let is_braking = command_m_s == wanted_m_s && state.phase != HOLDING;
        let braking_m_s2 = if is_braking { self.braking_m_s2(to_go_m, command_m_s) } else { 0.0 };
        let back_max_m_s = self.gains.retreat_max_m_s;
        let back_m_s = (-self.gains.aside_1_s * state.aside).clamp(-back_max_m_s, back_max_m_s);
        VelocitySetPoint {
            velocity_m_s: [command_m_s, back_m_s],
            feed_forward_m_s2: [braking_m_s2, 0.0],
            integral_m_s2: [state.integral, 0.0],
            altitude_m: self.altitude_m,
            yaw_rad: self.heading_rad,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gains_file::parse;

    #[test]
    fn impossible_gains_are_refused_with_their_key() {
        let cases = [
            ("value = 1.1, unit = \"1/s\"", "value = 0, unit = \"1/s\"", "approach.slope"),
            ("value = 0.4, unit = \"1/s^3\"", "value = -0.4, unit = \"1/s^3\"", "hold.integral"),
        ];
        for (good, bad, key) in cases {
            assert_eq!(WallStopGains::BUILT_IN.matches(good).count(), 1, "{good}");
            let error = parse(&WallStopGains::BUILT_IN.replace(good, bad), "my.toml", WallStopGains::read)
                .unwrap_err()
                .to_string();
            assert!(error.contains(key), "{error}");
        }
    }

    /// Pushed aside for 10 s at 1 m/s, it flies back by no more than the limit.
    #[test]
    fn what_it_remembers_of_a_push_aside_has_a_limit() {
        use crate::controller::Controller;
        let vehicle = concat!(env!("CARGO_MANIFEST_DIR"), "/../vehicles/hummingbird.toml");
        let parameters = serde_json::json!({ "vehicle": vehicle, "altitude_m": 1.0 });
        let mut law = component::Harness::<Controller<WallStopLaw>>::from_json(&parameters).unwrap();
        let mut walls = component::messages::WallEstimate {
            distance: [3.0; 4],
            in_sight: [1; 4],
            height: 1.0,
            ..Default::default()
        };
        let attitude = component::messages::AttitudeEstimate::default();
        let mut fly = |aside_m_s: f64, steps: u32| {
            walls.velocity[1] = aside_m_s;
            let inputs = || WallInputs { walls: &walls, attitude: &attitude };
            let status = (0..steps).map(|_| law.step(inputs()).unwrap().status.unwrap());
            status.last().unwrap().velocity_set_point[1]
        };
        assert_eq!(fly(1.0, 10_000), -0.3, "back at the most that it may");
        assert!(fly(-1.0, 1000).abs() < 1e-9, "it was 1 m away by its own count, and is back");
    }

    #[test]
    fn a_file_may_hold_the_gains_of_the_loops_inside_too() {
        let velocity = include_str!("../gains/velocity.toml").replace("value = 2.2", "value = 1.5");
        let gains =
            parse(&format!("{}\n{velocity}", WallStopGains::BUILT_IN), "my.toml", WallStopGains::read)
                .unwrap();
        assert_eq!(gains.loops.velocity.proportional_1_s, 1.5);
        assert_eq!(gains.loops.cascade, LoopsGains::default().cascade);
    }
}
