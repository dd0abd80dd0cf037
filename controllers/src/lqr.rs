//! The linear-quadratic regulator about hover, made to follow a reference.
//!
//! The gain K of `riccati` for the model of `lqr_model` is computed at the start from the vehicle file and the weights. The
//! demand is u = u_d − K·(x − x_d): x_d is the attitude, the rates and the wrench that the reference's
//! acceleration, jerk and snap and the observed disturbance need (`flatness`). The motors lag by 2ζ/ω_n: u_d
//! is the wrench to demand of them so that they make that of x_d. Position and velocity are compared in axes
//! that turn with the vehicle's heading, attitude and rates in the axes of x_d. So any yaw and any tilt of
//! the reference is a hover to the regulator.

use crate::airframe::ControlledVehicle;
use crate::allocation::RotorWrench;
use crate::control::{ControlOutput, MotionEstimate};
use crate::disturbance::Disturbance;
use crate::flatness::{self, Moving, Target};
use crate::foresight::{Foresight, ForesightState};
use crate::law::{FileParameters, Law, LawContext, Predecessor};
use crate::law_inputs::ReferenceInputs;
use crate::lqr_gains::LqrGains;
use crate::lqr_model::{self, INPUTS, MADE, MADE_RATE, RATE, ROTATION, STATES, VELOCITY};
use crate::motor_lag::Made;
use crate::riccati;
use crate::set_points::SetPoint;
use crate::trajectory::Point;
use component::Info;
use diagnostics::ParameterError;
use nalgebra::{Rotation3, SMatrix, SVector, Vector3};
use std::path::Path;

/// The law at one period, with everything that does not change during a run.
///
/// ```
/// use component::messages::{Reference, StateEstimate};
/// use controllers::{controller::Controller, lqr::LqrLaw, law_inputs::ReferenceInputs};
///
/// let vehicle = concat!(env!("CARGO_MANIFEST_DIR"), "/../vehicles/hummingbird.toml");
/// let parameters = serde_json::json!({ "vehicle": vehicle });
/// let mut law = component::Harness::<Controller<LqrLaw>>::from_json(&parameters).unwrap();
/// let reference = Reference { position: [0.0, 0.0, 1.0].into(), ..Default::default() };
/// let estimate = StateEstimate { position: [0.0, 0.0, 1.0].into(), ..Default::default() };
/// let inputs = ReferenceInputs { reference: &reference, estimate: &estimate, attitude: None };
/// let thrust_N = law.step(inputs).unwrap().status.unwrap().thrust;
/// assert!((thrust_N - 0.48 * 9.81).abs() < 1e-3, "on its reference it carries its weight: {thrust_N} N");
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct LqrLaw {
    gains: LqrGains,
    gain: SMatrix<f64, INPUTS, STATES>,
    foresight: Foresight,
}

/// Attitude, wrench and rate of the thrust that the reference needs.
struct Needed {
    attitude: Target,
    wrench: RotorWrench,
    thrust_rate_N_s: f64,
}

impl LqrLaw {
    /// The law for `craft`.
    ///
    /// # Errors
    /// The Riccati equation has no solution that stabilises the vehicle, or none that can be computed.
    pub fn for_craft(
        gains: LqrGains,
        craft: &ControlledVehicle,
        period_s: f64,
    ) -> Result<Self, ParameterError> {
        let (state_weights, input_weights) = lqr_model::weights(&gains);
        let regulator = lqr_model::step(&craft.vehicle, period_s).and_then(|step| {
            riccati::regulator(&step.transition, &step.input, &state_weights, &input_weights)
        });
        let unsolved = "the Riccati equation for this `vehicle` and these `gains` has no stabilising solution that can be \
                        computed: look for a vehicle without gravity, or weights that are many orders of magnitude \
                        apart";
        let regulator = regulator.ok_or_else(|| ParameterError::conflict("vehicle", unsolved))?;
        let foresight = Foresight::new(craft, &gains.observer, period_s);
        Ok(Self { gains, gain: regulator.gain, foresight })
    }

    /// K: reduction of the demanded thrust (N) and torque (N·m) by each state's deviation.
    #[must_use]
    pub fn gain(&self) -> &SMatrix<f64, INPUTS, STATES> {
        &self.gain
    }

    fn needed(&self, disturbance: &Disturbance, reference: &Point) -> Needed {
        let [_, _, acceleration_W, jerk_W, snap_W] = reference.path_W;
        let wanted_W = Moving {
            value: acceleration_W - disturbance.acceleration_W_m_s2,
            first: jerk_W - disturbance.jerk_W_m_s3,
            second: snap_W,
        };
        let thrust_W = wanted_W.against(self.foresight.gravity_m_s2);
        let attitude = flatness::target(&thrust_W, reference.yaw_rad, reference.yaw_rate_rad_s);
        let (rate_B, inertia) = (attitude.angular_velocity_B_rad_s, &self.foresight.inertia_B_kg_m2);
        let torque_B_N_m =
            inertia * attitude.angular_acceleration_B_rad_s2 + rate_B.cross(&(inertia * rate_B));
        let z_W = thrust_W.value.normalize();
        Needed {
            attitude,
            wrench: RotorWrench { thrust_N: self.foresight.mass_kg * thrust_W.value.norm(), torque_B_N_m },
            thrust_rate_N_s: self.foresight.mass_kg * thrust_W.first.dot(&z_W),
        }
    }

    /// x − x_d.
    fn deviation(
        &self,
        needed: &Needed,
        made: &Made,
        motion: &MotionEstimate,
        reference: &Point,
    ) -> SVector<f64, STATES> {
        let off_W_m = motion.position_W_m - reference.path_W[0];
        let off_W_m_s = motion.velocity_W_m_s - reference.path_W[1];
        let (_, _, heading_rad) = motion.attitude_WB.euler_angles();
        let to_heading = Rotation3::from_axis_angle(&Vector3::z_axis(), -heading_rad);
        let relative = needed.attitude.attitude_WB.inverse() * motion.attitude_WB;
        let rate = relative * motion.angular_velocity_B_rad_s - needed.attitude.angular_velocity_B_rad_s;
        let mut deviation: SVector<f64, STATES> = SVector::zeros();
        let mut set = |at: usize, part: Vector3<f64>| deviation.fixed_rows_mut::<3>(at).copy_from(&part);
        set(0, to_heading * off_W_m.cap_magnitude(self.gains.position_max_m));
        set(VELOCITY, to_heading * off_W_m_s.cap_magnitude(self.gains.velocity_max_m_s));
        set(ROTATION, relative.scaled_axis());
        set(RATE, rate);
        set(MADE + 1, made.wrench.torque_B_N_m - needed.wrench.torque_B_N_m);
        set(MADE_RATE + 1, made.rate.torque_B_N_m);
        deviation[MADE] = made.wrench.thrust_N - needed.wrench.thrust_N;
        deviation[MADE_RATE] = made.rate.thrust_N - needed.thrust_rate_N_s;
        deviation
    }

    fn demand(&self, needed: &Needed, deviation: &SVector<f64, STATES>) -> RotorWrench {
        let answer = self.gain * deviation;
        let ahead_N = self.foresight.lag.delay_s() * needed.thrust_rate_N_s;
        RotorWrench {
            thrust_N: self.foresight.limited_N(needed.wrench.thrust_N + ahead_N - answer[0]),
            torque_B_N_m: needed.wrench.torque_B_N_m - answer.fixed_rows::<3>(1),
        }
    }

    /// The acceleration that the foreseen thrust means.
    fn explained_W_m_s2(&self, made: &Made, motion: &MotionEstimate) -> Vector3<f64> {
        let thrust_B_m_s2 = Vector3::z() * (made.wrench.thrust_N / self.foresight.mass_kg);
        motion.attitude_WB * thrust_B_m_s2 - Vector3::z() * self.foresight.gravity_m_s2
    }
}

impl Law for LqrLaw {
    const INFO: Info = Info::new(
        "lqr",
        "linear-quadratic regulator about hover, its gains computed at the start from the vehicle file",
    );
    type Parameters = FileParameters;
    type Inputs<'a> = ReferenceInputs<'a>;
    type State = ForesightState;

    fn vehicle(parameters: &Self::Parameters) -> &Path {
        &parameters.vehicle
    }

    fn new(parameters: &Self::Parameters, context: &LawContext<'_>) -> Result<Self, ParameterError> {
        let gains = LqrGains::load(&context.node.files, parameters.gains.as_deref())?;
        Self::for_craft(gains, context.craft, context.node.period_s())
    }

    fn start(
        &self,
        from: Option<&Predecessor<'_, ForesightState>>,
        inputs: &ReferenceInputs<'_>,
    ) -> ForesightState {
        self.foresight.start(from, &inputs.motion())
    }

    fn last_wrench(&self, before: Option<&RotorWrench>) -> RotorWrench {
        self.foresight.last_wrench(before)
    }

    fn step(
        &self,
        state: &mut ForesightState,
        last: &RotorWrench,
        inputs: &ReferenceInputs<'_>,
    ) -> ControlOutput {
        let (made, motion) = (self.foresight.advance(state, last), &inputs.motion());
        let explained_W_m_s2 = self.explained_W_m_s2(&made, motion);
        let observer = &mut state.observer;
        let disturbance =
            self.gains.observer.step(observer, motion, &explained_W_m_s2, self.foresight.period_s);
        let reference = Point::from(inputs.reference);
        let needed = self.needed(&disturbance, &reference);
        let deviation = self.deviation(&needed, &made, motion, &reference);
        let wrench = self.demand(&needed, &deviation);
        let set_point = SetPoint::held(inputs.reference.position.z, &needed.attitude.attitude_WB);
        ControlOutput { wrench, integrals: state.integrals(), set_point, ..ControlOutput::default() }
    }
}
