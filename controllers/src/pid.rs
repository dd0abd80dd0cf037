//! The altitude and attitude PID of the thesis (§3.2): set point and measurement to a wrench.
//!
//! Frames: world z up; body x forward, y left, z up; roll, pitch and yaw in the aerospace ZYX sequence.

use crate::airframe::HoverModel;
use crate::allocation::RotorWrench;
use crate::altitude_loop::{AltitudeLoop, LoopGains};
use crate::angle::wrap_rad;
use crate::control::{ControlOutput, HoverMotion, Integrals};
use crate::law::{Law, LawContext, Predecessor};
use crate::law_inputs::SetPointInputs;
use crate::pid_gains::PidGains;
use crate::set_points::SetPoint;
use component::Info;
use diagnostics::ParameterError;
use nalgebra::Vector3;
use serde_json::Value;
use std::path::{Path, PathBuf};

/// The law at one period, with everything that does not change during a run.
///
/// ```
/// use controllers::airframe::ControlledVehicle;
/// use controllers::control::{HoverMotion, Integrals, MotionEstimate};
/// use controllers::{pid::PidLaw, pid_gains::PidGains, set_points::SetPoint};
///
/// let vehicle = concat!(env!("CARGO_MANIFEST_DIR"), "/../vehicles/hummingbird.toml");
/// let craft = ControlledVehicle::load(&inputs::InputFiles::default(), vehicle.as_ref()).unwrap();
/// let law = PidLaw { gains: PidGains::default(), vehicle: craft.hover_model(), period_s: 1e-3 };
/// let asked = SetPoint { yaw_rad: 0.1, ..SetPoint::default() };
/// let wrench = law.wrench(&mut Integrals::default(), &asked, &HoverMotion::of(&MotionEstimate::default()));
/// assert!(wrench.torque_B_N_m.z > 0.0, "N*m about body z, towards the yaw that is asked for");
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PidLaw {
    /// Gains and limits.
    pub gains: PidGains,
    /// The vehicle that is flown.
    pub vehicle: HoverModel,
    /// Time between two steps, s.
    pub period_s: f64,
}

/// State of the law.
#[derive(Debug, Clone, Copy, PartialEq, Default, component::Message)]
#[repr(C)]
#[message(type_name = "hummingbus_msgs/msg/PidState")]
pub struct PidState {
    /// Outputs of its integrators.
    pub integrals: Integrals,
}

/// Parameters of the PID controller.
#[derive(Debug, component::Parameters)]
pub struct Parameters {
    /// Vehicle file, relative to the manifest.
    #[parameter(file = vehicles::FILE)]
    vehicle: PathBuf,
    /// Gains and limits: a table, or the path of a gains file, relative to the manifest.
    #[parameter(shown = "the gains of controllers/gains/pid.toml", file = crate::gains_file::FILE)]
    gains: Option<Value>,
}

impl Law for PidLaw {
    const INFO: Info =
        Info::new("pid", "altitude, roll, pitch and yaw PID of the thesis with control allocation");
    type Parameters = Parameters;
    type Inputs<'a> = SetPointInputs<'a>;
    type State = PidState;

    fn vehicle(parameters: &Self::Parameters) -> &Path {
        &parameters.vehicle
    }

    fn new(parameters: &Self::Parameters, context: &LawContext<'_>) -> Result<Self, ParameterError> {
        let gains = PidGains::given(&context.node.files, parameters.gains.as_ref())?;
        Ok(Self { gains, vehicle: context.craft.hover_model(), period_s: context.node.period_s() })
    }

    fn rate_gain_1_s(&self) -> f64 {
        let Self { gains, .. } = self;
        [gains.roll, gains.pitch, gains.yaw].iter().fold(0.0, |most, axis| axis.derivative_1_s.max(most))
    }

    fn start(&self, from: Option<&Predecessor<'_, PidState>>, inputs: &SetPointInputs<'_>) -> PidState {
        let measured = HoverMotion::of(&inputs.motion());
        let continued = |from| self.continued(from, inputs.set_point.altitude, &measured);
        PidState { integrals: from.map(continued).unwrap_or_default() }
    }

    fn step(&self, state: &mut PidState, _last: &RotorWrench, inputs: &SetPointInputs<'_>) -> ControlOutput {
        let (set_point, measured) = (inputs.asked(), HoverMotion::of(&inputs.motion()));
        let wrench = self.wrench(&mut state.integrals, &set_point, &measured);
        ControlOutput { wrench, integrals: state.integrals, set_point, ..ControlOutput::default() }
    }
}

impl PidLaw {
    /// The wrench to demand now; advances the integrators by one period.
    pub fn wrench(
        &self,
        integrals: &mut Integrals,
        set_point: &SetPoint,
        measured: &HoverMotion,
    ) -> RotorWrench {
        RotorWrench {
            thrust_N: self.altitude_loop().thrust_N(&mut integrals.lift, set_point.altitude_m, measured),
            torque_B_N_m: self.torque_B_N_m(&mut integrals.turn, set_point, measured),
        }
    }

    /// The integrators that go on from another law's.
    fn continued<S>(
        &self,
        from: &Predecessor<'_, S>,
        altitude_set_m: f64,
        measured: &HoverMotion,
    ) -> Integrals {
        let gains = [self.gains.roll, self.gains.pitch, self.gains.yaw].map(|axis| axis.integral_1_s3);
        let max_rad_s2 = self.gains.attitude_integral_max_rad_s2;
        self.altitude_loop().continued(from, gains, max_rad_s2, altitude_set_m, measured)
    }

    fn altitude_loop(&self) -> AltitudeLoop<'_> {
        AltitudeLoop { gains: self.gains.altitude_gains(), vehicle: &self.vehicle, period_s: self.period_s }
    }

    /// Torque = inertia · (Kp·error + integral − Kd·body rate), axis by axis. The cross product of rate
    /// and angular momentum is left to the loops: at 1 rad/s it is below 0.003 N·m on the Hummingbird.
    fn torque_B_N_m(
        &self,
        turn_rad_s2: &mut [f64; 3],
        set_point: &SetPoint,
        measured: &HoverMotion,
    ) -> Vector3<f64> {
        let tilt_max_rad = self.gains.tilt_command_max_rad;
        let roll_set_rad = set_point.roll_rad.clamp(-tilt_max_rad, tilt_max_rad);
        let pitch_set_rad = set_point.pitch_rad.clamp(-tilt_max_rad, tilt_max_rad);
        let errors_rad = [
            wrap_rad(roll_set_rad - measured.roll_rad),
            pitch_set_rad - measured.pitch_rad,
            wrap_rad(set_point.yaw_rad - measured.yaw_rad),
        ];
        let gains = [&self.gains.roll, &self.gains.pitch, &self.gains.yaw];
        let acceleration_B_rad_s2 = Vector3::from_fn(|axis, _| {
            let rate_rad_s = measured.angular_velocity_B_rad_s[axis];
            self.angle_loop_rad_s2(gains[axis], &mut turn_rad_s2[axis], errors_rad[axis], rate_rad_s)
        });
        self.vehicle.inertia_B_kg_m2.component_mul(&acceleration_B_rad_s2)
    }

    fn angle_loop_rad_s2(
        &self,
        gains: &LoopGains,
        integral_rad_s2: &mut f64,
        error_rad: f64,
        rate_rad_s: f64,
    ) -> f64 {
        let max_rad_s2 = self.gains.attitude_integral_max_rad_s2;
        *integral_rad_s2 = gains.integrate(*integral_rad_s2, error_rad, self.period_s, max_rad_s2);
        gains.demand(error_rad, *integral_rad_s2, rate_rad_s)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn law() -> PidLaw {
        let vehicle = HoverModel {
            mass_kg: 0.5,
            inertia_B_kg_m2: Vector3::new(5.0e-3, 6.0e-3, 8.0e-3),
            gravity_m_s2: 9.81,
            thrust_min_N: 1.0,
            thrust_max_N: 10.0,
        };
        PidLaw { gains: PidGains::default(), vehicle, period_s: 1e-3 }
    }

    fn level() -> HoverMotion {
        HoverMotion {
            altitude_m: 1.0,
            climb_rate_m_s: 0.0,
            roll_rad: 0.0,
            pitch_rad: 0.0,
            yaw_rad: 0.0,
            angular_velocity_B_rad_s: Vector3::zeros(),
        }
    }

    fn hold() -> SetPoint {
        SetPoint { altitude_m: 1.0, ..SetPoint::default() }
    }

    fn step(set_point: &SetPoint, measured: &HoverMotion) -> RotorWrench {
        law().wrench(&mut Integrals::default(), set_point, measured)
    }

    /// One second of holding 1 m at a measurement that stays as it is.
    fn settle(law: &PidLaw, state: &mut Integrals, measured: &HoverMotion) {
        for _ in 0..1000 {
            law.wrench(state, &hold(), measured);
        }
    }

    fn after(wrench: RotorWrench, integrals: Option<Integrals>) -> Predecessor<'static, PidState> {
        Predecessor { wrench, integrals, state: None }
    }

    #[test]
    fn a_backup_goes_on_from_the_integrators_that_it_has_a_gain_for() {
        let wrench = RotorWrench { thrust_N: 5.2, torque_B_N_m: Vector3::new(1e-3, -2e-3, 1e-3) };
        let before = after(wrench, Some(Integrals { lift: 9.0, turn: [0.1; 3] }));
        let integrals = law().continued(&before, 1.0, &level());
        assert_eq!(integrals, Integrals { lift: 2.0, turn: [0.0; 3] });
    }

    #[test]
    fn a_backup_that_knows_only_the_last_command_asks_for_its_thrust() {
        let wrench = RotorWrench { thrust_N: 5.2, torque_B_N_m: Vector3::zeros() };
        let measured = HoverMotion { roll_rad: 0.05, altitude_m: 0.99, ..level() };
        let mut integrals = law().continued(&after(wrench, None), 1.0, &measured);
        let still = PidLaw { period_s: 0.0, ..law() };
        let asked = still.wrench(&mut integrals, &hold(), &measured);
        assert!((asked.thrust_N - wrench.thrust_N).abs() < 1e-12);
    }

    #[test]
    fn at_the_set_point_the_wrench_is_the_weight() {
        let wrench = step(&hold(), &level());
        assert!((wrench.thrust_N - 0.5 * 9.81).abs() < 1e-12);
        assert_eq!(wrench.torque_B_N_m, Vector3::zeros());
    }

    /// Eq. 3.19 as printed would divide by cos φ·sin θ, which is zero here.
    #[test]
    fn a_tilt_is_made_up_for_up_to_sixty_degrees() {
        let tilted = |roll_deg: f64| {
            let measured = HoverMotion { roll_rad: roll_deg.to_radians(), pitch_rad: 0.1, ..level() };
            step(&hold(), &measured).thrust_N
        };
        let expected_N = 0.5 * 9.81 / (libm::cos(20.0_f64.to_radians()) * libm::cos(0.1));
        assert!((tilted(20.0) - expected_N).abs() < 1e-12);
        assert!((tilted(80.0) - 2.0 * 0.5 * 9.81).abs() < 1e-12);
    }

    #[test]
    fn every_error_and_rate_acts_with_its_sign_and_inertia() {
        let law = law();
        let set = SetPoint { roll_rad: 0.1, pitch_rad: -0.1, yaw_rad: 0.2, ..hold() };
        let torque = step(&set, &level()).torque_B_N_m;
        let (roll, pitch, yaw) = (law.gains.roll, law.gains.pitch, law.gains.yaw);
        assert!((torque.x - 5.0e-3 * roll.proportional_1_s2 * 0.1).abs() < 1e-12);
        assert!((torque.y + 6.0e-3 * pitch.proportional_1_s2 * 0.1).abs() < 1e-12);
        assert!((torque.z - 8.0e-3 * yaw.proportional_1_s2 * 0.2).abs() < 1e-12);
        let turning = HoverMotion { angular_velocity_B_rad_s: Vector3::new(1.0, 0.0, 0.0), ..level() };
        assert!((step(&hold(), &turning).torque_B_N_m.x + 5.0e-3 * roll.derivative_1_s).abs() < 1e-12);
        let climbing = HoverMotion { climb_rate_m_s: 0.1, ..level() };
        assert!(step(&hold(), &climbing).thrust_N < 0.5 * 9.81);
    }

    #[test]
    fn yaw_turns_the_short_way() {
        let set = SetPoint { yaw_rad: 3.1, ..hold() };
        let measured = HoverMotion { yaw_rad: -3.1, ..level() };
        assert!(step(&set, &measured).torque_B_N_m.z < 0.0);
    }

    #[test]
    fn tilt_commands_are_cut_to_the_range_of_the_sticks() {
        let at = |roll_deg: f64| {
            step(&SetPoint { roll_rad: roll_deg.to_radians(), ..hold() }, &level()).torque_B_N_m.x
        };
        assert_eq!(at(70.0), at(30.0));
    }

    #[test]
    fn the_altitude_integrator_takes_up_a_lasting_error_but_rests_in_a_climb() {
        let mut state = Integrals::default();
        let low = HoverMotion { altitude_m: 0.95, ..level() };
        settle(&law(), &mut state, &low);
        let asked_m_s2 = law().gains.altitude.integral_1_s3 * 0.05;
        assert!((state.lift - asked_m_s2).abs() < 1e-9);
        let before = state;
        settle(&law(), &mut state, &HoverMotion { climb_rate_m_s: 0.3, ..low });
        assert_eq!(state, before);
    }

    #[test]
    fn the_integrator_rests_at_the_thrust_limit_and_comes_back_from_it() {
        let mut weak = law();
        weak.vehicle.thrust_max_N = 4.0;
        let mut state = Integrals { lift: 1.0, ..Integrals::default() };
        let sunk = HoverMotion { altitude_m: 0.95, ..level() };
        settle(&weak, &mut state, &sunk);
        assert_eq!(state.lift, 1.0);
        let above = HoverMotion { altitude_m: 1.05, ..level() };
        settle(&weak, &mut state, &above);
        assert!(state.lift < 1.0);
    }
}
