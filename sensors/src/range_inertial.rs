//! The range-inertial node: velocity, height and walls from range finders, an IMU and an attitude.

mod axis;
pub mod filter;
mod gains;
pub mod params;

use component::context::{NodeContext, StepContext};
use component::messages::{StateEstimate, WallEstimate};
use component::{Component, Info, OutputPorts, StepError};
use diagnostics::ParameterError;
use filter::{RangeInertial, RangeInertialInputs, RangeInertialState};
use params::RangeInertialParams;

/// Outputs of the estimator.
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
        &self,
        context: &StepContext<'_>,
        inputs: RangeInertialInputs<'_>,
        state: &mut RangeInertialState,
    ) -> Result<Outputs, StepError> {
        let now_ns = context.time_ns();
        self.update(state, now_ns, &inputs)?;
        let walls = self.walls(state, inputs.attitude.yaw, now_ns);
        Ok(Outputs { walls, estimate: self.motion(state, inputs.attitude) })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use component::Harness;
    use component::messages::{AttitudeEstimate, Gps, Imu, Ranges};
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
            (
                json!({ "room_m": [4.0, 4.0], "start_in_room_m": [2.0, 5.0] }),
                "`room_m.1` must be a finite number above `start_in_room_m.1`, 5, found 4",
            ),
        ] {
            let error = Harness::<RangeInertial>::from_json(&parameters).unwrap_err().to_string();
            assert!(error.contains(key), "{error}");
        }
        Harness::<RangeInertial>::from_json(&json!({})).unwrap();
    }

    #[test]
    fn all_faults_of_a_room_are_named() {
        let keys = |room_m: [f64; 2], start_in_room_m: [f64; 2]| {
            let parameters = json!({ "room_m": room_m, "start_in_room_m": start_in_room_m });
            let error = Harness::<RangeInertial>::from_json(&parameters).unwrap_err();
            error.into_each().iter().map(|error| error.key().to_owned()).collect::<Vec<_>>()
        };
        assert_eq!(keys([4.0, 4.0], [-1.0, 5.0]), ["start_in_room_m.0", "room_m.1"]);
        assert_eq!(keys([0.0, 4.0], [-1.0, 1.0]), ["start_in_room_m.0", "room_m.0"]);
        assert_eq!(keys([4.0, -4.0], [1.0, 1.0]), ["room_m.1"]);
    }

    /// At rest by the accelerometer, which is off by 0.2 m/s^2, ranges to nothing, and a receiver that reports
    /// `told` with this delay every 100 ms: the velocity after 20 s, and the worst since 5 s.
    fn with_late_receiver(delay_ms: u64, told: [f64; 2]) -> ([f64; 2], f64) {
        let parameters =
            json!({ "initial_velocity_sigma_m_s": 0.5, "initial_acceleration_bias_sigma_m_s2": 0.3 });
        let mut filter = Harness::<RangeInertial>::from_json(&parameters).unwrap();
        let imu = Imu { specific_force: [0.2, -0.2, 9.81].into(), ..Default::default() };
        let (ranges, attitude) = (Ranges::default(), AttitudeEstimate::default());
        let mut worst_m_s = 0.0_f64;
        let mut last = [0.0; 2];
        for tick in 0..20_000_u64 {
            let measured_ms = (tick.saturating_sub(delay_ms)) / 100 * 100;
            let gps = Gps {
                measured_ns: measured_ms * 1_000_000,
                velocity: [told[0], told[1], 0.0].into(),
                valid: u32::from(tick >= delay_ms),
                ..Default::default()
            };
            let inputs =
                RangeInertialInputs { ranges: &ranges, imu: &imu, attitude: &attitude, gps: Some(&gps) };
            let velocity = filter.step(inputs).unwrap().estimate.velocity;
            last = [velocity.x, velocity.y];
            if tick > 5_000 {
                worst_m_s = worst_m_s.max((last[0] - told[0]).abs()).max((last[1] - told[1]).abs());
            }
        }
        (last, worst_m_s)
    }

    #[test]
    fn a_late_receiver_tells_the_velocity_as_well_as_a_prompt_one_and_corrects_once() {
        for told in [[0.0, 0.0], [1.0, -2.0], [-0.5, 0.3]] {
            for delay_ms in [0, 50, 120, 200, 500, 1200] {
                let (last, worst_m_s) = with_late_receiver(delay_ms, told);
                // A bias is held to be forgotten in time: 0.035 m/s^2 of this one are not believed, for as long as it is late.
                let most_m_s = 0.045 + 0.035 * delay_ms as f64 * 1e-3;
                assert!(worst_m_s < most_m_s, "{delay_ms} ms late: {last:?} for {told:?}, worst {worst_m_s}");
            }
        }
    }

    #[test]
    fn a_receiver_that_is_later_than_can_be_looked_back_ends_the_run_in_words() {
        let mut filter = Harness::<RangeInertial>::from_json(&json!({})).unwrap();
        let imu = Imu { specific_force: [0.0, 0.0, 9.81].into(), ..Default::default() };
        let (ranges, attitude) = (Ranges::default(), AttitudeEstimate::default());
        let gps = Gps { measured_ns: 500_000_000, valid: 1, ..Default::default() };
        let inputs = |gps| RangeInertialInputs { ranges: &ranges, imu: &imu, attitude: &attitude, gps };
        for _ in 0..2_500 {
            filter.step(inputs(None)).unwrap();
        }
        let error = filter.step(inputs(Some(&gps))).unwrap_err().to_string();
        assert!(error.contains("`gps` was measured 2.000 s ago, and it looks back 1.27"), "{error}");
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
