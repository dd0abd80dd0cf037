//! Geometric tracking on SE(3): a reference with its derivatives and a motion to a wrench, at any attitude.
//!
//! T. Lee, M. Leok and N. H. McClamroch, "Geometric tracking control of a quadrotor UAV on SE(3)", CDC 2010, their
//! z axis turned up and their gains divided by mass and inertia:
//!
//! | here | in the paper |
//! |---|---|
//! | e_x = x − x_d, e_v = v − v_d | tracking errors of position and velocity |
//! | t = a_d + g·z − k_p·e_x − k_v·e_v − d̂ | the vector that its b_3c lies along; d̂ is the `disturbance` that is observed |
//! | R_c: body z along t, the yaw of the reference | R_c, with the yaw of `flatness` |
//! | thrust = m·t·(R z) | f |
//! | e_R = ½(R_cᵀR − RᵀR_c)^∨, e_Ω = Ω − RᵀR_c·Ω_c | tracking errors of attitude and angular velocity |
//! | torque = J·(−k_R·e_R − k_Ω·e_Ω) + Ω × JΩ − J·(Ω × RᵀR_c·Ω_c − RᵀR_c·Ω_c′) | M |
//!
//! Ω_c and its rate follow from the first two derivatives of t, which hold the reference's jerk and snap and those of
//! the errors. The paper leaves open where the errors of acceleration and jerk come from. Here they follow from
//! d̂ and the foreseen thrust of the rotors (`motor_lag`), at the estimated attitude and rates.

use crate::airframe::ControlledVehicle;
use crate::allocation::RotorWrench;
use crate::control::{ControlOutput, MotionEstimate};
use crate::disturbance::{Disturbance, ObserverState};
use crate::flatness::{self, Moving, Target};
use crate::foresight::{Foresight, ForesightState};
use crate::geometric_gains::GeometricGains;
use crate::law::{FileParameters, Law, LawContext, Predecessor};
use crate::law_inputs::ReferenceInputs;
use crate::motor_lag::Made;
use crate::set_points::SetPoint;
use crate::trajectory::Point;
use component::Info;
use diagnostics::ParameterError;
use nalgebra::Vector3;
use std::path::Path;

/// The law at one period, with everything that does not change during a run.
///
/// ```
/// use component::messages::{Reference, StateEstimate};
/// use controllers::{controller::Controller, geometric::GeometricLaw, law_inputs::ReferenceInputs};
///
/// let vehicle = concat!(env!("CARGO_MANIFEST_DIR"), "/../vehicles/hummingbird.toml");
/// let parameters = serde_json::json!({ "vehicle": vehicle });
/// let mut law = component::Harness::<Controller<GeometricLaw>>::from_json(&parameters).unwrap();
/// let reference = Reference { position: [0.0, 0.0, 1.0].into(), ..Default::default() };
/// let estimate = StateEstimate { position: [0.0, 0.0, 1.0].into(), ..Default::default() };
/// let inputs = ReferenceInputs { reference: &reference, estimate: &estimate, attitude: None };
/// let thrust_N = law.step(inputs).unwrap().status.unwrap().thrust;
/// assert!((thrust_N - 0.48 * 9.81).abs() < 1e-3, "on its reference it carries its weight: {thrust_N} N");
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct GeometricLaw {
    gains: GeometricGains,
    foresight: Foresight,
}

/// Motion of the vehicle by the model, in the world.
struct Push {
    acceleration_W_m_s2: Vector3<f64>,
    jerk_W_m_s3: Vector3<f64>,
}

impl GeometricLaw {
    /// The law for `craft`.
    #[must_use]
    pub fn for_craft(gains: GeometricGains, craft: &ControlledVehicle, period_s: f64) -> Self {
        Self { gains, foresight: Foresight::new(craft, &gains.observer, period_s) }
    }

    /// The demand, and the attitude behind it; advances the observer.
    fn asked(
        &self,
        observer: &mut ObserverState,
        made: &Made,
        inputs: &ReferenceInputs<'_>,
    ) -> (RotorWrench, Target) {
        let (reference, motion) = (&Point::from(inputs.reference), &inputs.motion());
        let push = self.push(made, motion);
        let disturbance =
            self.gains.observer.step(observer, motion, &push.acceleration_W_m_s2, self.foresight.period_s);
        let thrust_W_m_s2 = self.thrust_vector(&push, &disturbance, motion, reference);
        let target = flatness::target(&thrust_W_m_s2, reference.yaw_rad, reference.yaw_rate_rad_s);
        let z_W = motion.attitude_WB * Vector3::z();
        let wanted = RotorWrench {
            thrust_N: self.foresight.mass_kg * thrust_W_m_s2.value.dot(&z_W),
            torque_B_N_m: self.torque(&target, motion),
        };
        let hurried = self.foresight.lag.hurried(&self.gains.motor, made, &wanted);
        (RotorWrench { thrust_N: self.foresight.limited_N(hurried.thrust_N), ..hurried }, target)
    }

    /// Returns the vehicle's motion by the model: rotors as foreseen, gravity, and drag where it is stated.
    fn push(&self, made: &Made, motion: &MotionEstimate) -> Push {
        let z_W = motion.attitude_WB * Vector3::z();
        let turning_W = motion.attitude_WB * motion.angular_velocity_B_rad_s.cross(&Vector3::z());
        let (push_m_s2, push_rate_m_s3) =
            (made.wrench.thrust_N / self.foresight.mass_kg, made.rate.thrust_N / self.foresight.mass_kg);
        let drag_1_s = self.gains.drag_1_s;
        let acceleration_W_m_s2 =
            z_W * push_m_s2 - Vector3::z() * self.foresight.gravity_m_s2 - motion.velocity_W_m_s * drag_1_s;
        let jerk_W_m_s3 = turning_W * push_m_s2 + z_W * push_rate_m_s3 - acceleration_W_m_s2 * drag_1_s;
        Push { acceleration_W_m_s2, jerk_W_m_s3 }
    }

    /// Thrust for each unit of mass with two derivatives: t of the table above.
    fn thrust_vector(
        &self,
        push: &Push,
        disturbance: &Disturbance,
        motion: &MotionEstimate,
        reference: &Point,
    ) -> Moving {
        let gains = &self.gains;
        let (kp, kv) = (gains.position_proportional_1_s2, gains.position_derivative_1_s);
        let found_W = [
            motion.position_W_m,
            motion.velocity_W_m_s,
            push.acceleration_W_m_s2 + disturbance.acceleration_W_m_s2,
            push.jerk_W_m_s3 + disturbance.jerk_W_m_s3,
        ];
        // How far the vehicle is off its reference, and the first three derivatives of that.
        let off_W: [Vector3<f64>; 4] = std::array::from_fn(|order| found_W[order] - reference.path_W[order]);
        let answer = -off_W[0] * kp - off_W[1] * kv - disturbance.acceleration_W_m_s2;
        let answer_first = -off_W[1] * kp - off_W[2] * kv - disturbance.jerk_W_m_s3;
        let answer_second = -off_W[2] * kp - off_W[3] * kv;
        // What exceeds the limit is scaled down with its derivatives.
        let part = (gains.acceleration_max_m_s2 / answer.norm()).min(1.0);
        let ahead = |order: usize| reference.path_W[order] + reference.path_W[order - 1] * gains.drag_1_s;
        let acceleration_W = Moving {
            value: ahead(2) + answer * part,
            first: ahead(3) + answer_first * part,
            second: ahead(4) + answer_second * part,
        };
        acceleration_W.against(self.foresight.gravity_m_s2)
    }

    fn torque(&self, target: &Target, motion: &MotionEstimate) -> Vector3<f64> {
        let rate_B = motion.angular_velocity_B_rad_s;
        // Takes the target's axes to the body's: RᵀR_c.
        let relative = motion.attitude_WB.inverse() * target.attitude_WB;
        let matrix = relative.to_rotation_matrix().into_inner();
        let skew = (matrix.transpose() - matrix) * 0.5;
        let attitude_error = Vector3::new(skew.m32, skew.m13, skew.m21);
        let target_rate_B = relative * target.angular_velocity_B_rad_s;
        let rate_error_B = rate_B - target_rate_B;
        let ahead_B = relative * target.angular_acceleration_B_rad_s2 - rate_B.cross(&target_rate_B);
        let gains = &self.gains;
        let (tilt, yaw) = (gains.attitude_proportional_1_s2, gains.yaw_proportional_1_s2);
        let (tilt_rate, yaw_rate) = (gains.attitude_derivative_1_s, gains.yaw_derivative_1_s);
        let acceleration_B = ahead_B
            - Vector3::new(tilt, tilt, yaw).component_mul(&attitude_error)
            - Vector3::new(tilt_rate, tilt_rate, yaw_rate).component_mul(&rate_error_B);
        self.foresight.inertia_B_kg_m2 * acceleration_B
            + rate_B.cross(&(self.foresight.inertia_B_kg_m2 * rate_B))
    }
}

impl Law for GeometricLaw {
    const INFO: Info = Info::new(
        "geometric",
        "tracking on SE(3) (Lee, Leok, McClamroch 2010) with jerk and snap fed forward",
    );
    type Parameters = FileParameters;
    type Inputs<'a> = ReferenceInputs<'a>;
    type State = ForesightState;

    fn vehicle(parameters: &Self::Parameters) -> &Path {
        &parameters.vehicle
    }

    fn new(parameters: &Self::Parameters, context: &LawContext<'_>) -> Result<Self, ParameterError> {
        let gains = GeometricGains::load(&context.node.files, parameters.gains.as_deref())?;
        Ok(Self::for_craft(gains, context.craft, context.node.period_s()))
    }

    fn rate_gain_1_s(&self) -> f64 {
        self.gains.attitude_derivative_1_s.max(self.gains.yaw_derivative_1_s)
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
        let made = self.foresight.advance(state, last);
        let (wrench, target) = self.asked(&mut state.observer, &made, inputs);
        let set_point = SetPoint::held(inputs.reference.position.z, &target.attitude_WB);
        ControlOutput { wrench, integrals: state.integrals(), set_point, ..ControlOutput::default() }
    }
}
