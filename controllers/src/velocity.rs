//! Velocity PD around the cascade (thesis Fig 5.47): a velocity along the heading's level axes to roll and
//! pitch commands.
//!
//! a = a_ff + Kp·(v_c − v) − Kd·dv/dt + integral, cut to a limit. At constant height the thrust is m·g / (cos
//! φ·cos θ). Its level part accelerates by g·tan θ along the heading's x and by −g·tan φ / cos θ along its y.
//! So θ = atan(a_x / g), positive for nose down, and φ = −atan(a_y·cos θ / g). The integral and a_ff are the
//! guidance's; a law without guidance has none, as the thesis's.

use crate::airframe::HoverModel;
use crate::allocation::RotorWrench;
use crate::cascade::{CascadeLaw, CascadeState};
use crate::cascade_gains::CascadeGains;
use crate::control::{ControlOutput, HoverMotion, MotionEstimate};
use crate::gains_file::Table;
use crate::law::{Law, LawContext, Predecessor};
use crate::law_inputs::VelocityInputs;
use crate::set_points::SetPoint;
use component::Info;
use component::messages::Reference;
use diagnostics::parameter::{ParameterError, finite, refuse};
use diagnostics::unit::{ACCELERATION, PER_SECOND, PURE_NUMBER, TIME, VELOCITY};
use std::path::{Path, PathBuf};

gains! {
    /// Gains and limits of the velocity loops, the same along both axes.
    pub struct VelocityGains of file {
        /// Error of velocity (m/s) to acceleration (m/s²), 1/s.
        proportional_1_s: f64 = file.gain("proportional", PER_SECOND),
        /// Measured acceleration (m/s²) to acceleration against it (m/s²), 1.
        derivative: f64 = file.gain("derivative", PURE_NUMBER),
        /// Time constant of the filter before the derivative, s.
        derivative_filter_s: f64 = file.limit("derivative_filter", TIME),
        /// The demanded acceleration is cut to this, m/s².
        acceleration_max_m_s2: f64 = file.limit("acceleration_max", ACCELERATION),
        /// A commanded velocity gathers speed no faster than this, m/s².
        command_acceleration_max_m_s2: f64 = file.limit("command_acceleration_max", ACCELERATION),
        /// A commanded height moves no faster than this, m/s.
        climb_max_m_s: f64 = file.limit("climb_max", VELOCITY),
    }
}

impl VelocityGains {
    fn read_or_built_in(file: &Table<'_, '_>) -> Self {
        if file.has("velocity") {
            Self::read(&file.table("velocity"))
        } else {
            LoopsGains::default().velocity
        }
    }
}

gains! {
    /// The gains of the velocity loops and of the cascade inside: gains that a file leaves out are those built in.
    pub struct LoopsGains of file, built in "velocity.toml" {
        /// Of the velocity loops.
        velocity: VelocityGains = VelocityGains::read_or_built_in(file),
        /// Of the inner loops.
        cascade: CascadeGains = CascadeGains::read_or_built_in(file),
    }
}

/// Set point of the velocity loops.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct VelocitySetPoint {
    /// Velocity along the heading's level x and y, m/s.
    pub velocity_m_s: [f64; 2],
    /// Acceleration that following it takes, m/s².
    pub feed_forward_m_s2: [f64; 2],
    /// Acceleration that the guidance's integrators ask for, m/s².
    pub integral_m_s2: [f64; 2],
    /// Height, m.
    pub altitude_m: f64,
    /// Yaw, rad.
    pub yaw_rad: f64,
}

/// State of the velocity loops and of the law around them.
#[derive(Debug, Clone, Copy, PartialEq, Default, component::Message)]
#[repr(C)]
#[message(type_name = "hummingbus_msgs/msg/VelocityState")]
pub struct VelocityState {
    /// The inner loops.
    pub cascade: CascadeState,
    /// Velocity behind the filter of the derivative, along the heading's level x and y.
    #[field(unit = "m/s")]
    pub velocity_filtered: [f64; 2],
    /// Velocity that is asked for, along the heading's level x and y.
    #[field(unit = "m/s")]
    pub velocity_command: [f64; 2],
    /// Altitude that is asked for.
    #[field(unit = "m", frame = "world")]
    pub altitude_command: f64,
}

/// The velocity loops around the cascade, at the cascade's period.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct VelocityLoop {
    /// Gains and limits.
    pub gains: VelocityGains,
    /// The inner loops.
    pub cascade: CascadeLaw,
}

impl VelocityLoop {
    /// The loops with `gains` for `vehicle`.
    #[must_use]
    pub fn new(gains: &LoopsGains, vehicle: HoverModel, period_s: f64) -> Self {
        let cascade = CascadeLaw { gains: gains.cascade, vehicle, period_s, attitude_every_steps: 1 };
        Self { gains: gains.velocity, cascade }
    }

    /// The demand for `asked` at the measured `velocity_m_s` along the heading's axes.
    pub fn demand(
        &self,
        state: &mut VelocityState,
        last: &RotorWrench,
        asked: &VelocitySetPoint,
        velocity_m_s: &[f64; 2],
        measured: &HoverMotion,
    ) -> ControlOutput {
        let acceleration_m_s2 = self.accelerations_m_s2(state, asked, velocity_m_s);
        self.accelerate(state, last, asked, &acceleration_m_s2, measured)
    }

    /// Returns the accelerations that the PD on both axes asks for; advances its filters by one period.
    pub(crate) fn accelerations_m_s2(
        &self,
        state: &mut VelocityState,
        asked: &VelocitySetPoint,
        velocity_m_s: &[f64; 2],
    ) -> [f64; 2] {
        std::array::from_fn(|axis| self.acceleration_m_s2(state, asked, axis, velocity_m_s[axis]))
    }

    /// The demand that accelerates so along the heading's axes, at the height and yaw of `asked`.
    pub(crate) fn accelerate(
        &self,
        state: &mut VelocityState,
        last: &RotorWrench,
        asked: &VelocitySetPoint,
        acceleration_m_s2: &[f64; 2],
        measured: &HoverMotion,
    ) -> ControlOutput {
        state.velocity_command = asked.velocity_m_s;
        let climb_max_m = self.gains.climb_max_m_s * self.cascade.period_s;
        state.altitude_command +=
            (asked.altitude_m - state.altitude_command).clamp(-climb_max_m, climb_max_m);
        let (roll_rad, pitch_rad) = tilt_rad(acceleration_m_s2, self.cascade.vehicle.gravity_m_s2);
        let set_point =
            SetPoint { altitude_m: state.altitude_command, roll_rad, pitch_rad, yaw_rad: asked.yaw_rad };
        let output = self.cascade.demand(&mut state.cascade, last, &set_point, measured);
        ControlOutput { velocity_m_s: asked.velocity_m_s, ..output }
    }

    /// The state to begin with, after another law or as the first, at the height and speed where the vehicle is.
    #[must_use]
    pub fn begun<S>(
        &self,
        from: Option<&Predecessor<'_, S>>,
        velocity_m_s: &[f64; 2],
        measured: &HoverMotion,
    ) -> VelocityState {
        VelocityState {
            cascade: self.cascade.begun(from, measured.altitude_m, measured),
            velocity_filtered: *velocity_m_s,
            velocity_command: *velocity_m_s,
            altitude_command: measured.altitude_m,
        }
    }

    /// `before` moved towards `asked`: at once where that is slower, no faster than the limit where it gathers
    /// speed.
    pub(crate) fn gathered_m_s(&self, before_m_s: f64, asked_m_s: f64) -> f64 {
        let step_m_s = self.gains.command_acceleration_max_m_s2 * self.cascade.period_s;
        // Gathering speed is measured from standstill where the direction turns round.
        let same_way_m_s = if before_m_s * asked_m_s > 0.0 { before_m_s.abs() } else { 0.0 };
        asked_m_s.abs().min(same_way_m_s + step_m_s).copysign(asked_m_s)
    }

    fn acceleration_m_s2(
        &self,
        state: &mut VelocityState,
        asked: &VelocitySetPoint,
        axis: usize,
        velocity_m_s: f64,
    ) -> f64 {
        let time_s = self.gains.derivative_filter_s + self.cascade.period_s;
        let change_m_s2 = (velocity_m_s - state.velocity_filtered[axis]) / time_s;
        state.velocity_filtered[axis] += change_m_s2 * self.cascade.period_s;
        let asked_m_s2 = asked.feed_forward_m_s2[axis]
            + self.gains.proportional_1_s * (asked.velocity_m_s[axis] - velocity_m_s)
            - self.gains.derivative * change_m_s2
            + asked.integral_m_s2[axis];
        let max_m_s2 = self.gains.acceleration_max_m_s2;
        asked_m_s2.clamp(-max_m_s2, max_m_s2)
    }
}

/// Roll and pitch that accelerate so along the heading's axes at constant height.
pub(crate) fn tilt_rad(acceleration_m_s2: &[f64; 2], gravity_m_s2: f64) -> (f64, f64) {
    let pitch_rad = libm::atan(acceleration_m_s2[0] / gravity_m_s2);
    (-libm::atan(acceleration_m_s2[1] * libm::cos(pitch_rad) / gravity_m_s2), pitch_rad)
}

/// The controller `velocity`: a reference's velocity, or a constant one.
///
/// ```
/// use component::messages::StateEstimate;
/// use controllers::{controller::Controller, law_inputs::VelocityInputs, velocity::VelocityLaw};
///
/// let vehicle = concat!(env!("CARGO_MANIFEST_DIR"), "/../vehicles/hummingbird.toml");
/// let parameters = serde_json::json!({ "vehicle": vehicle, "altitude_m": 1.0, "velocity_m_s": [1.0, 0.0] });
/// let mut velocity = component::Harness::<Controller<VelocityLaw>>::from_json(&parameters).unwrap();
/// let estimate = StateEstimate { position: [0.0, 0.0, 1.0].into(), ..Default::default() };
/// let inputs = || VelocityInputs { estimate: &estimate, attitude: None, reference: None };
/// let status = (0..50).map(|_| velocity.step(inputs()).unwrap().status.unwrap()).last().unwrap();
/// assert!(status.attitude_set_point[1] > 0.0, "rad: it pitches nose down to fly ahead: {status:?}");
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct VelocityLaw {
    /// The loops.
    pub velocity: VelocityLoop,
    /// Set point where no reference is wired.
    pub constant: Option<VelocitySetPoint>,
}

impl VelocityLaw {
    /// The constant set point, or that of `reference`: [`Parameters::check`] requires one of them.
    fn asked(&self, reference: Option<&Reference>, measured: &HoverMotion) -> VelocitySetPoint {
        let by_reference = |reference: &Reference| VelocitySetPoint {
            velocity_m_s: along_heading([reference.velocity.x, reference.velocity.y], measured.yaw_rad),
            altitude_m: reference.position.z,
            yaw_rad: reference.yaw,
            ..VelocitySetPoint::default()
        };
        self.constant.or_else(|| reference.map(by_reference)).unwrap_or_default()
    }
}

/// Parameters of the velocity controller.
#[derive(Debug, component::Parameters)]
pub struct Parameters {
    /// Vehicle file, relative to the manifest.
    #[parameter(file = vehicles::FILE)]
    vehicle: PathBuf,
    /// Gains file, relative to the manifest.
    #[parameter(shown = "the gains of controllers/gains/velocity.toml", file = crate::gains_file::FILE)]
    gains: Option<PathBuf>,
    /// Velocity along the heading's x and y, without the input `reference`.
    #[parameter(shown = "[0.0, 0.0]", check = finite)]
    velocity_m_s: Option<[f64; 2]>,
    /// Height in the world, without `reference`.
    #[parameter(shown = "required without `reference`", check = finite)]
    altitude_m: Option<f64>,
    /// Yaw, without `reference`.
    #[parameter(shown = "0.0", check = finite)]
    yaw_rad: Option<f64>,
}

impl Parameters {
    /// The velocity is given by a reference or by parameters, never by both.
    fn check(&self, has_reference: bool) -> Result<(), ParameterError> {
        let given = [
            ("velocity_m_s", self.velocity_m_s.is_some()),
            ("altitude_m", self.altitude_m.is_some()),
            ("yaw_rad", self.yaw_rad.is_some()),
        ];
        let twice = given.into_iter().map(|(key, is_given)| {
            refuse(has_reference && is_given, "reference", || {
                format!("`{key}` is given, and so is the input `reference`; leave one of them out")
            })
        });
        ParameterError::gather(twice)?;
        refuse(!has_reference && self.altitude_m.is_none(), "altitude_m", || {
            "missing key `altitude_m`: without the input `reference` a velocity controller needs `altitude_m` and \
             `velocity_m_s`"
        })
    }

    fn constant(&self) -> Option<VelocitySetPoint> {
        let altitude_m = self.altitude_m?;
        let constant = VelocitySetPoint {
            velocity_m_s: self.velocity_m_s.unwrap_or_default(),
            altitude_m,
            yaw_rad: self.yaw_rad.unwrap_or_default(),
            ..VelocitySetPoint::default()
        };
        Some(constant)
    }
}

impl Law for VelocityLaw {
    const INFO: Info = Info::new("velocity", "velocity PD around the cascade's inner loops");
    type Parameters = Parameters;
    type Inputs<'a> = VelocityInputs<'a>;
    type State = VelocityState;

    fn vehicle(parameters: &Self::Parameters) -> &Path {
        &parameters.vehicle
    }

    fn new(parameters: &Self::Parameters, context: &LawContext<'_>) -> Result<Self, ParameterError> {
        let gains = LoopsGains::load(&context.node.files, parameters.gains.as_deref());
        let checked = parameters.check(context.node.has("reference"));
        let (gains, ()) = ParameterError::both(gains, checked)?;
        let velocity = VelocityLoop::new(&gains, context.craft.hover_model(), context.node.period_s());
        Ok(Self { velocity, constant: parameters.constant() })
    }

    fn rate_gain_1_s(&self) -> f64 {
        self.velocity.cascade.rate_gain_1_s()
    }

    fn start(
        &self,
        from: Option<&Predecessor<'_, VelocityState>>,
        inputs: &VelocityInputs<'_>,
    ) -> VelocityState {
        let motion = inputs.motion();
        let measured = HoverMotion::of(&motion);
        self.velocity.begun(from, &velocity_m_s(&motion, &measured), &measured)
    }

    fn step(
        &self,
        state: &mut VelocityState,
        last: &RotorWrench,
        inputs: &VelocityInputs<'_>,
    ) -> ControlOutput {
        let motion = inputs.motion();
        let measured = HoverMotion::of(&motion);
        let mut asked = self.asked(inputs.reference, &measured);
        for (axis, asked_m_s) in asked.velocity_m_s.iter_mut().enumerate() {
            *asked_m_s = self.velocity.gathered_m_s(state.velocity_command[axis], *asked_m_s);
        }
        self.velocity.demand(state, last, &asked, &velocity_m_s(&motion, &measured), &measured)
    }
}

/// The estimated velocity along the heading's level axes.
fn velocity_m_s(motion: &MotionEstimate, measured: &HoverMotion) -> [f64; 2] {
    let velocity_W_m_s = motion.velocity_W_m_s;
    along_heading([velocity_W_m_s.x, velocity_W_m_s.y], measured.yaw_rad)
}

/// A level vector of the world along the axes of a heading.
pub(crate) fn along_heading([x, y]: [f64; 2], yaw_rad: f64) -> [f64; 2] {
    let (sin, cos) = libm::sincos(yaw_rad);
    [cos * x + sin * y, cos * y - sin * x]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gains_file::parse;
    use nalgebra::Vector3;

    fn velocity() -> VelocityLoop {
        let vehicle = HoverModel {
            mass_kg: 0.5,
            inertia_B_kg_m2: Vector3::new(5.0e-3, 6.0e-3, 8.0e-3),
            gravity_m_s2: 9.81,
            thrust_min_N: 1.0,
            thrust_max_N: 10.0,
        };
        VelocityLoop::new(&LoopsGains::default(), vehicle, 1e-3)
    }

    #[test]
    fn forward_is_nose_down_and_left_is_right_side_up() {
        let (roll_rad, pitch_rad) = tilt_rad(&[1.0, 0.0], 9.81);
        assert!(pitch_rad > 0.0 && roll_rad == 0.0);
        let (roll_rad, pitch_rad) = tilt_rad(&[0.0, 1.0], 9.81);
        assert!(roll_rad < 0.0 && pitch_rad == 0.0);
    }

    /// The thrust that holds the height is turned by the tilt into the level acceleration that was asked for.
    #[test]
    fn the_tilt_makes_the_acceleration_on_both_axes_at_once() {
        let asked_m_s2 = [1.5, -2.0];
        let (roll_rad, pitch_rad) = tilt_rad(&asked_m_s2, 9.81);
        let up_B = nalgebra::UnitQuaternion::from_euler_angles(roll_rad, pitch_rad, 0.0) * Vector3::z();
        let made_m_s2 = up_B * (9.81 / up_B.z);
        assert!((made_m_s2.x - asked_m_s2[0]).abs() < 1e-12 && (made_m_s2.y - asked_m_s2[1]).abs() < 1e-12);
    }

    #[test]
    fn a_command_gathers_speed_slowly_and_loses_it_at_once() {
        let velocity = velocity();
        let step_m_s = velocity.gains.command_acceleration_max_m_s2 * 1e-3;
        assert!((velocity.gathered_m_s(0.5, 1.0) - (0.5 + step_m_s)).abs() < 1e-12);
        assert_eq!(velocity.gathered_m_s(0.5, 0.1), 0.1);
        assert!((velocity.gathered_m_s(0.5, -1.0) + step_m_s).abs() < 1e-12);
        assert_eq!(velocity.gathered_m_s(0.0, 0.0), 0.0);
    }

    #[test]
    fn a_world_velocity_is_seen_along_the_heading() {
        let [x, y] = along_heading([0.0, 1.0], std::f64::consts::FRAC_PI_2);
        assert!((x - 1.0).abs() < 1e-12 && y.abs() < 1e-12);
    }

    #[test]
    fn a_negative_gain_is_refused_with_its_key() {
        let text = LoopsGains::BUILT_IN.replace("value = 2.2", "value = -2.2");
        let error = parse(&text, "my.toml", LoopsGains::read).unwrap_err().to_string();
        assert!(error.contains("velocity.proportional"), "{error}");
    }
}
