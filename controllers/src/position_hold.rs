//! Holds the place while the pilot asks for no tilt, between a pilot and a law about hover such as `pid` or
//! `cascade`. Such laws hold an attitude but no place: under any push the vehicle drifts.
//!
//! Along each of the heading's level axes for itself, as autopilots' position modes do:
//! - While the pilot asks for roll, or for pitch, that angle passes as it is. Sticks at rest are never quite at zero: up
//!   to `stick_dead_band_deg` counts as none.
//! - When he lets go of it, the velocity along that axis is brought to zero, a = −Kv·v. Where it is below
//!   `lock_speed_m_s`, the place is locked, and held from then on: a = Kv·(Kx·(place − position) − v).
//!
//! The acceleration is cut to that of `tilt_max_deg`, and gravity turns it into pitch and roll (see `velocity`). The
//! altitude and the yaw pass as they are. There is no integrator: a lasting push of 1 m/s² moves it by 1/(Kv·Kx) m.

use crate::angle::wrap_rad;
use crate::set_points::SetPoint as Values;
use crate::velocity::{along_heading, tilt_rad};
use component::context::{NodeContext, StepContext};
use component::messages::{SetPoint, StateEstimate};
use component::{Component, Info, InputPorts, OutputPorts, StepError};
use diagnostics::parameter::{ParameterError, not_negative, positive, up_to};
use diagnostics::unit::STANDARD_GRAVITY_M_S2;
use nalgebra::{Quaternion, UnitQuaternion};

/// Parameters of the hold.
///
/// The gains are tuned, no source, around `pid` with its built-in gains, whose attitude follows within 0.4 s: the velocity
/// loop is to be slower than that, and the position loop slower than the velocity loop.
#[derive(Debug, Clone, Copy, component::Parameters)]
#[parameters(default)]
pub struct Parameters {
    /// Error of the place to a velocity, Kx.
    #[parameter(default = 0.45, check = positive)]
    position_1_s: f64,
    /// Error of that velocity to an acceleration, Kv.
    #[parameter(default = 1.5, check = positive)]
    velocity_1_s: f64,
    /// Greatest speed of the return to its place.
    #[parameter(default = 1.0, check = positive)]
    speed_max_m_s: f64,
    /// Greatest tilt.
    #[parameter(default = 10.0, check = up_to(TILT_MAX_DEG, "deg"))]
    tilt_max_deg: f64,
    /// Below this speed along an axis it locks the place.
    #[parameter(default = 0.1, check = positive)]
    lock_speed_m_s: f64,
    /// Up to this tilt the pilot asks for none.
    ///
    /// A tenth of the sticks' range (thesis §5.3), as PX4's parameter `MPC_HOLD_DZ` has it.
    #[parameter(default = 3.0, check = not_negative)]
    stick_dead_band_deg: f64,
}

/// Inputs of the hold.
#[derive(Debug, InputPorts)]
pub struct Inputs<'a> {
    /// Set point of the pilot.
    pub set_point: &'a SetPoint,
    /// The motion.
    pub estimate: &'a StateEstimate,
}

/// Outputs of the hold.
#[derive(Debug, OutputPorts)]
pub struct Outputs {
    /// The pilot's set point with the tilt that holds the place.
    pub set_point: SetPoint,
}

/// State of the position hold.
#[derive(Debug, Clone, Copy, Default, PartialEq, component::Message)]
#[repr(C)]
#[message(type_name = "hummingbus_msgs/msg/PositionHoldState")]
pub struct PositionHoldState {
    /// The place that is held; without meaning along an axis that is not locked.
    #[field(unit = "m", frame = "world")]
    pub place: [f64; 2],
    /// 1 where the place along the heading's x, or y, is locked.
    #[field(unit = "1")]
    pub locked: [u32; 2],
}

/// The component `position-hold`.
///
/// ```
/// use component::messages::{SetPoint, StateEstimate};
/// use controllers::position_hold::{Inputs, PositionHold};
///
/// let mut hold = component::Harness::<PositionHold>::from_json(&serde_json::json!({})).unwrap();
/// let mut asked = |roll: f64, x_m: f64| {
///     let estimate = StateEstimate { position: [x_m, 0.0, 1.0].into(), ..Default::default() };
///     hold.step(Inputs { set_point: &SetPoint { roll, ..Default::default() }, estimate: &estimate }).unwrap().set_point
/// };
/// assert_eq!(asked(0.0, 0.0).pitch, 0.0, "it locks the place where it stands");
/// assert!(asked(0.0, 0.5).pitch < 0.0, "rad: pushed ahead, it pitches nose up to return");
/// assert_eq!(asked(0.17, 0.5).roll, 0.17, "rad: the pilot's roll passes");
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PositionHold {
    position_1_s: f64,
    velocity_1_s: f64,
    speed_max_m_s: f64,
    acceleration_max_m_s2: f64,
    lock_speed_m_s: f64,
    stick_dead_band_rad: f64,
}

/// The most that `tilt_max_deg` may be: the range of the sticks (thesis §5.3).
const TILT_MAX_DEG: f64 = 30.0;

impl Component for PositionHold {
    const INFO: Info = Info::new(
        "position-hold",
        "holds the place around a law about hover while the pilot asks for no tilt",
    );
    type Parameters = Parameters;
    type Inputs<'a> = Inputs<'a>;
    type Outputs = Outputs;
    type State = PositionHoldState;

    fn new(parameters: Parameters, _: &NodeContext<'_>) -> Result<Self, ParameterError> {
        let Parameters { position_1_s, velocity_1_s, speed_max_m_s, tilt_max_deg, lock_speed_m_s, .. } =
            parameters;
        let stick_dead_band_deg = parameters.stick_dead_band_deg;
        let acceleration_max_m_s2 = STANDARD_GRAVITY_M_S2 * libm::tan(tilt_max_deg.to_radians());
        Ok(Self {
            position_1_s,
            velocity_1_s,
            speed_max_m_s,
            acceleration_max_m_s2,
            lock_speed_m_s,
            stick_dead_band_rad: stick_dead_band_deg.to_radians(),
        })
    }

    fn initial(&self) -> PositionHoldState {
        PositionHoldState::default()
    }

    fn step(
        &self,
        _: &StepContext<'_>,
        inputs: Inputs<'_>,
        state: &mut PositionHoldState,
    ) -> Result<Outputs, StepError> {
        let SetPoint { altitude, roll, pitch, yaw, .. } = *inputs.set_point;
        let asked = Values { altitude_m: altitude, roll_rad: roll, pitch_rad: pitch, yaw_rad: yaw };
        let held = self.held(state, &asked, inputs.estimate);
        let Values { roll_rad: roll, pitch_rad: pitch, .. } = held;
        Ok(Outputs { set_point: SetPoint { altitude, roll, pitch, yaw, ..Default::default() } })
    }
}

impl PositionHold {
    /// `asked` with the tilt that holds the place, along the axes where it asks for none.
    fn held(&self, state: &mut PositionHoldState, asked: &Values, estimate: &StateEstimate) -> Values {
        let yaw_rad = yaw_rad(estimate);
        let position_m = [estimate.position.x, estimate.position.y];
        let velocity_m_s = along_heading([estimate.velocity.x, estimate.velocity.y], yaw_rad);
        // Pitch moves along the heading's x, roll along its y.
        let is_free =
            // After a whole turn the pilot asks for none.
            [asked.pitch_rad, asked.roll_rad].map(|asked_rad| wrap_rad(asked_rad).abs() <= self.stick_dead_band_rad);
        let from_m: [f64; 2] = std::array::from_fn(|axis| state.place[axis] - position_m[axis]);
        let mut error_m = along_heading(from_m, yaw_rad);
        for axis in 0..2 {
            let is_slow = velocity_m_s[axis].abs() < self.lock_speed_m_s;
            let was_locked = state.locked[axis] == 1;
            if !(is_free[axis] && was_locked) {
                error_m[axis] = 0.0;
            }
            state.locked[axis] = u32::from(is_free[axis] && (was_locked || is_slow));
        }
        // Along an axis that is not locked the place goes with the vehicle.
        let back_m = along_heading(error_m, -yaw_rad);
        state.place = std::array::from_fn(|axis| position_m[axis] + back_m[axis]);
        let acceleration_m_s2 =
            std::array::from_fn(|axis| self.acceleration_m_s2(error_m[axis], velocity_m_s[axis]));
        let (roll_rad, pitch_rad) = tilt_rad(&acceleration_m_s2, STANDARD_GRAVITY_M_S2);
        Values {
            roll_rad: if is_free[1] { roll_rad } else { asked.roll_rad },
            pitch_rad: if is_free[0] { pitch_rad } else { asked.pitch_rad },
            ..*asked
        }
    }

    fn acceleration_m_s2(&self, error_m: f64, velocity_m_s: f64) -> f64 {
        let wanted_m_s = (self.position_1_s * error_m).clamp(-self.speed_max_m_s, self.speed_max_m_s);
        let max_m_s2 = self.acceleration_max_m_s2;
        (self.velocity_1_s * (wanted_m_s - velocity_m_s)).clamp(-max_m_s2, max_m_s2)
    }
}

fn yaw_rad(estimate: &StateEstimate) -> f64 {
    let q = estimate.attitude;
    UnitQuaternion::new_unchecked(Quaternion::new(q.w, q.x, q.y, q.z)).euler_angles().2
}

#[cfg(test)]
mod tests {
    use super::*;
    use component::Harness;
    use serde_json::json;

    fn hold() -> Harness<PositionHold> {
        Harness::from_json(&json!({})).unwrap()
    }

    fn step(hold: &mut Harness<PositionHold>, roll: f64, y_m: f64, v_m_s: f64, yaw_rad: f64) -> SetPoint {
        let q = UnitQuaternion::from_euler_angles(0.0, 0.0, yaw_rad);
        let estimate = StateEstimate {
            position: [0.0, y_m, 1.0].into(),
            velocity: [0.0, v_m_s, 0.0].into(),
            attitude: component::messages::Quaternion { x: q.i, y: q.j, z: q.k, w: q.w },
            ..Default::default()
        };
        let set_point = SetPoint { altitude: 1.5, roll, ..Default::default() };
        hold.step(Inputs { set_point: &set_point, estimate: &estimate }).unwrap().set_point
    }

    #[test]
    fn the_place_is_locked_where_the_vehicle_comes_to_rest_after_the_pilot_let_go() {
        let mut hold = hold();
        assert_eq!(step(&mut hold, 0.1, 2.0, -1.0, 0.0).roll, 0.1);
        // It flies on to the right, and is braked: left side up pushes right, so right side up.
        let braking = step(&mut hold, 0.0, 1.5, -1.0, 0.0);
        assert!(braking.roll < 0.0, "{braking:?}");
        assert!(step(&mut hold, 0.0, 1.0, -0.05, 0.0).roll.abs() < braking.roll.abs());
        assert_eq!(step(&mut hold, 0.0, 1.0, 0.0, 0.0).roll, 0.0, "it is locked at 1 m");
        assert!(step(&mut hold, 0.0, 1.3, 0.0, 0.0).roll > 0.0, "pushed to the left, it rolls to the right");
    }

    #[test]
    fn sticks_that_do_not_quite_come_back_to_the_middle_let_the_place_be_held() {
        for (parameters, dead_band_deg) in
            [(json!({}), 3.0_f64), (json!({ "stick_dead_band_deg": 0.0 }), 0.0)]
        {
            let mut hold = Harness::<PositionHold>::from_json(&parameters).unwrap();
            let dead_band_rad = dead_band_deg.to_radians();
            step(&mut hold, dead_band_rad, 1.0, 0.0, 0.0);
            let pushed = step(&mut hold, -dead_band_rad, 1.3, 0.0, 0.0);
            assert!(pushed.roll > 0.02, "it is held: {pushed:?}");
            let asked_rad = dead_band_rad + 0.001;
            assert_eq!(step(&mut hold, asked_rad, 1.3, 0.0, 0.0).roll, asked_rad, "it gives way");
        }
    }

    #[test]
    fn turned_to_the_left_it_holds_the_same_place_by_pitch() {
        let mut hold = hold();
        step(&mut hold, 0.0, 0.0, 0.0, 0.0);
        let turned = step(&mut hold, 0.0, 0.5, 0.0, std::f64::consts::FRAC_PI_2);
        assert!(turned.pitch < 0.0 && turned.roll.abs() < 1e-12, "{turned:?}");
        assert_eq!(turned.altitude, 1.5);
    }

    #[test]
    fn impossible_parameters_are_named() {
        for (parameters, key) in [
            (json!({ "position_1_s": 0.0 }), "position_1_s"),
            (json!({ "tilt_max_deg": 60.0 }), "tilt_max_deg"),
            (json!({ "lock_speed_m_s": -0.1 }), "lock_speed_m_s"),
            (json!({ "stick_dead_band_deg": -1.0 }), "stick_dead_band_deg"),
            (json!({ "speed": 1.0 }), "speed"),
        ] {
            let error = Harness::<PositionHold>::from_json(&parameters).unwrap_err().to_string();
            assert!(error.contains(key), "{error}");
        }
    }
}
