//! The range-inertial node: velocity, height and walls from range finders, an IMU and an attitude.

mod axis;
pub mod filter;
pub mod params;

use bus::OutputPorts;
use bus::component::{Component, Info, StepError};
use bus::context::{NodeContext, StepContext};
use bus::messages::{StateEstimate, WallEstimate};
use diagnostics::ParameterError;
use filter::{RangeInertial, RangeInertialInputs, RangeInertialState};
use params::RangeInertialParams;

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
        let now_ns = context.time_ns();
        self.update(state, now_ns, &inputs);
        let walls = self.walls(state, inputs.attitude.yaw, now_ns);
        Ok(Outputs { walls, estimate: self.motion(state, inputs.attitude) })
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
            (json!({ "room_m": [4.0, 4.0] }), "`start_in_room_m` must be given where `room_m` is"),
            (json!({ "start_in_room_m": [4.0, 4.0] }), "`room_m` must be given where `start_in_room_m` is"),
            (json!({ "room_m": [4.0, 4.0], "start_in_room_m": [2.0, 5.0] }), "`room_m`"),
        ] {
            let error = Harness::<RangeInertial>::from_json(&parameters).unwrap_err().to_string();
            assert!(error.contains(key), "{error}");
        }
        Harness::<RangeInertial>::from_json(&json!({})).unwrap();
    }
}
