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
    use bus::messages::{AttitudeEstimate, Gps, Imu, Ranges};
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

    #[test]
    fn a_receiver_tells_the_velocity_where_no_wall_does_and_one_that_lost_its_fix_tells_nothing() {
        let velocity_m_s = |valid: u32| {
            let parameters = json!({ "initial_velocity_sigma_m_s": 0.5 });
            let mut filter = Harness::<RangeInertial>::from_json(&parameters).unwrap();
            let imu = Imu { specific_force: [0.0, 0.0, 9.81].into(), ..Default::default() };
            let (ranges, attitude) = (Ranges::default(), AttitudeEstimate::default());
            let sent = (0..100_u64).map(|tick| {
                let measured_ns = tick * 1_000_000;
                let gps = Gps { measured_ns, velocity: [0.0, 1.0, 9.0].into(), valid, ..Default::default() };
                let inputs =
                    RangeInertialInputs { ranges: &ranges, imu: &imu, attitude: &attitude, gps: Some(&gps) };
                filter.step(inputs).unwrap().estimate.velocity
            });
            sent.last().unwrap()
        };
        let told = velocity_m_s(1);
        assert!(told.x.abs() < 1e-9 && (told.y - 1.0).abs() < 0.01, "{told:?}");
        assert!(told.z.abs() < 1e-9, "the climb is the ranges' and the accelerometer's: {told:?}");
        assert_eq!(velocity_m_s(0).y, 0.0);
    }
}
