//! The law `level`: holds height and attitude by proportional-derivative control, with nothing to remember.

use crate::airframe::HoverModel;
use crate::allocation::RotorWrench;
use crate::control::{ControlOutput, HoverMotion};
use crate::law::{Law, LawContext, Predecessor};
use crate::law_inputs::SetPointInputs;
use component::Info;
use component::messages::Time;
use diagnostics::ParameterError;
use diagnostics::parameter::positive;
use nalgebra::Vector3;
use std::path::{Path, PathBuf};

/// Parameters of the law.
#[derive(Debug, component::Parameters)]
pub struct Parameters {
    /// Vehicle file, relative to the manifest.
    #[parameter(file = vehicles::FILE)]
    vehicle: PathBuf,
    /// Bandwidth of the loops of height and attitude.
    #[parameter(check = positive)]
    bandwidth_rad_s: f64,
}

/// The law: critically damped loops.
#[derive(Debug)]
pub struct LevelLaw {
    model: HoverModel,
    bandwidth_rad_s: f64,
}

/// It remembers nothing; a state has a field all the same.
#[derive(Debug, Clone, Copy, Default, component::Message)]
#[repr(C)]
#[message(type_name = "hummingbus_msgs/msg/LevelState")]
pub struct LevelState {
    /// Zero.
    stamp: Time,
}

impl Law for LevelLaw {
    const INFO: Info = Info::new("level", "holds height and attitude by proportional-derivative control");
    type Parameters = Parameters;
    type Inputs<'a> = SetPointInputs<'a>;
    type State = LevelState;

    fn vehicle(parameters: &Self::Parameters) -> &Path {
        &parameters.vehicle
    }

    fn new(parameters: &Self::Parameters, context: &LawContext<'_>) -> Result<Self, ParameterError> {
        Ok(Self { model: context.craft.hover_model(), bandwidth_rad_s: parameters.bandwidth_rad_s })
    }

    fn rate_gain_1_s(&self) -> f64 {
        2.0 * self.bandwidth_rad_s
    }

    fn start(&self, _: Option<&Predecessor<'_, LevelState>>, _: &SetPointInputs<'_>) -> LevelState {
        LevelState::default()
    }

    fn step(&self, _: &mut LevelState, _: &RotorWrench, inputs: &SetPointInputs<'_>) -> ControlOutput {
        let (asked, found) = (inputs.asked(), HoverMotion::of(&inputs.motion()));
        let [stiffness, damping] = [self.bandwidth_rad_s * self.bandwidth_rad_s, 2.0 * self.bandwidth_rad_s];
        let climb_m_s2 = stiffness * (asked.altitude_m - found.altitude_m) - damping * found.climb_rate_m_s;
        let tilt_rad = Vector3::new(found.roll_rad, found.pitch_rad, found.yaw_rad);
        let asked_rad = Vector3::new(asked.roll_rad, asked.pitch_rad, asked.yaw_rad);
        let turn_B_rad_s2 = stiffness * (asked_rad - tilt_rad) - damping * found.angular_velocity_B_rad_s;
        let wrench = RotorWrench {
            thrust_N: self.model.mass_kg * (self.model.gravity_m_s2 + climb_m_s2),
            torque_B_N_m: self.model.inertia_B_kg_m2.component_mul(&turn_B_rad_s2),
        };
        ControlOutput { wrench, set_point: asked, ..ControlOutput::default() }
    }
}
