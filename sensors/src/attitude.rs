//! The attitude node: the complementary filter over an IMU's readings.

use crate::complementary::{Complementary, ComplementaryParams, ComplementaryState};
use crate::imu_model::ImuReading;
use crate::wire::{attitude, attitude_message, vector, vector_message};
use bus::component::{Component, Info, StepError};
use bus::context::{NodeContext, StepContext};
use bus::messages::{AttitudeEstimate, Imu, Quaternion, Vector3};
use bus::{InputPorts, Message, OutputPorts};
use diagnostics::ParameterError;

/// All that the filter remembers.
#[derive(Debug, Clone, Copy, Message)]
#[repr(C)]
#[message(type_name = "hummingbus_msgs/msg/ComplementaryState")]
pub struct AttitudeState {
    /// The estimated attitude, body to world.
    #[field(frame = "world")]
    attitude: Quaternion,
    /// The last sample's angular rate; not a number before the first.
    #[field(unit = "rad/s", frame = "body")]
    last_angular_velocity: Vector3,
}

impl From<&ComplementaryState> for AttitudeState {
    fn from(state: &ComplementaryState) -> Self {
        let last = state.last_angular_velocity_B_rad_s;
        Self {
            attitude: attitude_message(state.attitude_WB),
            last_angular_velocity: last.map_or([f64::NAN; 3].into(), vector_message),
        }
    }
}

impl From<&AttitudeState> for ComplementaryState {
    fn from(state: &AttitudeState) -> Self {
        let last = vector(state.last_angular_velocity);
        Self {
            attitude_WB: attitude(state.attitude),
            last_angular_velocity_B_rad_s: (!last.x.is_nan()).then_some(last),
        }
    }
}

/// What the filter reads.
#[derive(Debug, InputPorts)]
pub struct ImuInputs<'a> {
    /// Readings of the inertial measurement unit.
    pub imu: &'a Imu,
}

/// What the filter sends.
#[derive(Debug, OutputPorts)]
pub struct Outputs {
    /// The attitude.
    pub estimate: AttitudeEstimate,
}

impl Component for Complementary {
    const INFO: Info = Info::new("attitude", "complementary filter: roll, pitch and yaw from an IMU");
    type Parameters = ComplementaryParams;
    type Inputs<'a> = ImuInputs<'a>;
    type Outputs = Outputs;
    type State = AttitudeState;

    fn new(params: ComplementaryParams, context: &NodeContext<'_>) -> Result<Self, ParameterError> {
        Self::with_period(params, context.period_s())
    }

    fn initial(&self) -> AttitudeState {
        AttitudeState::from(&ComplementaryState::default())
    }

    fn step(
        &mut self,
        _: &StepContext<'_>,
        inputs: ImuInputs<'_>,
        state: &mut AttitudeState,
    ) -> Result<Outputs, StepError> {
        let mut filter_state = ComplementaryState::from(&*state);
        let estimate = self.update(&mut filter_state, &ImuReading::from(inputs.imu));
        *state = AttitudeState::from(&filter_state);
        let estimate = AttitudeEstimate {
            attitude: attitude_message(estimate.attitude_WB),
            roll: estimate.roll_rad,
            pitch: estimate.pitch_rad,
            yaw: estimate.yaw_rad,
            angular_velocity: vector_message(estimate.angular_velocity_B_rad_s),
            ..Default::default()
        };
        Ok(Outputs { estimate })
    }
}
