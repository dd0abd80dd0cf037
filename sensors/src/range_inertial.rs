//! The range-inertial node: velocity, height and walls from range finders, an IMU and an attitude.

mod axis;
pub mod filter;
pub mod params;

use crate::imu_model::ImuReading;
use crate::wire::{attitude as rotation, vector_message};
use bus::component::{Component, Info, StepError};
use bus::context::{NodeContext, StepContext};
use bus::messages::{AttitudeEstimate, Imu, Ranges, StateEstimate, WallEstimate};
use bus::{InputPorts, OutputPorts};
use diagnostics::ParameterError;
use filter::{RangeInertial, RangeInertialState};
use params::RangeInertialParams;

/// What the estimator reads.
#[derive(Debug, InputPorts)]
pub struct RangeInertialInputs<'a> {
    /// Measurements of the range finders.
    pub ranges: &'a Ranges,
    /// Readings of the inertial measurement unit.
    pub imu: &'a Imu,
    /// The attitude.
    pub attitude: &'a AttitudeEstimate,
}

/// What the estimator sends.
#[derive(Debug, OutputPorts)]
pub struct Outputs {
    /// Walls, height and velocities.
    pub walls: WallEstimate,
    /// The motion.
    pub estimate: StateEstimate,
}

impl Component for RangeInertial {
    const INFO: Info = Info::new(
        "range-inertial",
        "velocity, height and distances to walls from range finders, IMU and attitude",
    );
    type Parameters = RangeInertialParams;
    type Inputs<'a> = RangeInertialInputs<'a>;
    type Outputs = Outputs;
    type State = RangeInertialState;

    fn new(params: RangeInertialParams, context: &NodeContext<'_>) -> Result<Self, ParameterError> {
        Self::with_period(params, context.period_s())
    }

    fn initial(&self) -> RangeInertialState {
        self.initial_state()
    }

    fn step(
        &mut self,
        context: &StepContext<'_>,
        inputs: RangeInertialInputs<'_>,
        state: &mut RangeInertialState,
    ) -> Result<Outputs, StepError> {
        let (now_ns, attitude) = (context.time_ns(), inputs.attitude);
        let measured = filter::Measured {
            now_ns,
            imu: ImuReading::from(inputs.imu),
            attitude_WB: rotation(attitude.attitude),
            ranges: inputs.ranges,
        };
        self.update(state, &measured);
        Ok(Outputs {
            walls: wall_estimate(self, state, attitude.yaw, now_ns),
            estimate: state_estimate(self, state, attitude),
        })
    }
}

fn wall_estimate(
    filter: &RangeInertial,
    state: &RangeInertialState,
    yaw_rad: f64,
    now_ns: u64,
) -> WallEstimate {
    let walls = filter.walls(state, yaw_rad, now_ns);
    WallEstimate {
        distance: walls.map(|wall| wall.distance_m),
        in_sight: walls.map(|wall| u32::from(wall.is_in_sight)),
        velocity: state.velocity_heading_m_s(yaw_rad),
        height: state.height_m(),
        climb_rate: state.velocity_W_m_s().z,
        ..Default::default()
    }
}

fn state_estimate(
    filter: &RangeInertial,
    state: &RangeInertialState,
    attitude: &AttitudeEstimate,
) -> StateEstimate {
    StateEstimate {
        position: vector_message(state.position_W_m()),
        velocity: vector_message(state.velocity_W_m_s()),
        attitude: attitude.attitude,
        angular_velocity: attitude.angular_velocity,
        position_sigma: vector_message(state.position_sigma_W_m()),
        velocity_sigma: vector_message(state.velocity_sigma_W_m_s()),
        attitude_sigma: [filter.attitude_sigma_rad(); 3].into(),
        ..Default::default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use bus::Harness;
    use serde_json::json;

    #[test]
    fn impossible_parameters_are_named() {
        for (parameters, key) in [
            (json!({ "range_sigma_m": 0.0 }), "`range_sigma_m`"),
            (json!({ "half_angle_deg": 90.0 }), "`half_angle_deg`"),
            (json!({ "initial_height_m": -1.0 }), "`initial_height_m`"),
            (json!({ "dead_zone_m": 0.2 }), "`dead_zone_m`"),
        ] {
            let error = Harness::<RangeInertial>::from_json(&parameters).unwrap_err().to_string();
            assert!(error.contains(key), "{error}");
        }
        Harness::<RangeInertial>::from_json(&json!({})).unwrap();
    }
}
