//! The extended Kalman filter as a node: position, velocity and attitude from an IMU and other sensors.

pub mod filter;
pub mod history;
mod motion;
mod observation;
pub mod params;
mod start;
mod transition;

use crate::wire::{attitude, vector, vector_message};
use component::context::{NodeContext, SampleTimes, StepContext};
use component::messages::{
    AttitudeEstimate, Barometer, Gps, Imu, Innovation, Magnetometer, Mocap, StateEstimate, Vector3,
};
use component::{Component, Info, InputPorts, OutputPorts, StepError};
use diagnostics::parameter::{ParameterError, refuse};
use filter::{Ekf, EkfState};
use history::{Measurement, Reading, Source};
use params::EkfParams;

/// The position's standard deviation before the filter has begun, m, and likewise of all else: nothing is known.
const UNKNOWN_SIGMA: f64 = 1e6;

/// Degrees of freedom of the measurements, in the order of [`Source::ALL`].
const DEGREES_OF_FREEDOM: [u32; 4] = [6, 6, 1, 3];

/// Inputs of the filter.
#[derive(Debug, InputPorts)]
pub struct EkfInputs<'a> {
    /// Readings of the inertial measurement unit.
    pub imu: &'a Imu,
    /// Positions and velocities.
    pub gps: Option<&'a Gps>,
    /// Positions and attitudes.
    pub mocap: Option<&'a Mocap>,
    /// Altitudes.
    pub barometer: Option<&'a Barometer>,
    /// The earth's magnetic field.
    pub magnetometer: Option<&'a Magnetometer>,
}

/// Outputs of the filter.
#[derive(Debug, OutputPorts)]
pub struct Outputs {
    /// The motion.
    pub estimate: StateEstimate,
    /// Agreement of the measurements with it.
    pub innovation: Option<Innovation>,
    /// The attitude alone, for controllers that take it from another estimator than the position.
    pub attitude: Option<AttitudeEstimate>,
}

impl Component for Ekf {
    const INFO: Info = Info::new(
        "ekf",
        "extended Kalman filter: the motion from an IMU, GPS or motion capture, barometer, magnetometer",
    );
    type Parameters = EkfParams;
    type Inputs<'a> = EkfInputs<'a>;
    type Outputs = Outputs;
    type State = EkfState;

    fn new(params: EkfParams, context: &NodeContext<'_>) -> Result<Self, ParameterError> {
        let filter = Self::with_period(params, context.period_s());
        let remembered_s = Some(params.delay_max_ms * 1e-3);
        context.state_times(SampleTimes { remembered_s, ..SampleTimes::default() });
        let has_position = context.has("gps") || context.has("mocap");
        let unwired = "nothing tells the position: wire `inputs.gps`, `inputs.mocap` or both";
        let position = refuse(!has_position, "", || unwired);
        ParameterError::both(filter, position).map(|(filter, ())| filter)
    }

    fn initial(&self) -> EkfState {
        self.initial_state()
    }

    fn step(
        &self,
        context: &StepContext<'_>,
        inputs: EkfInputs<'_>,
        state: &mut EkfState,
    ) -> Result<Outputs, StepError> {
        let newest = [
            inputs.gps.map(gps),
            inputs.mocap.map(mocap),
            inputs.barometer.map(barometer),
            inputs.magnetometer.map(magnetometer),
        ];
        self.update_to(state, &reading(inputs.imu, context.time_ns()), &newest);
        Ok(Outputs {
            estimate: state_estimate(self, state),
            innovation: Some(innovations(state)),
            attitude: Some(attitude_estimate(state)),
        })
    }
}

fn reading(imu: &Imu, time_ns: u64) -> Reading {
    Reading { time_ns, specific_force: imu.specific_force, angular_velocity: imu.angular_velocity }
}

fn gps(sample: &Gps) -> Option<Measurement> {
    let (p, v) = (sample.position, sample.velocity);
    let values = [p.x, p.y, p.z, v.x, v.y, v.z];
    (sample.valid == 1).then(|| Measurement::new(Source::Gps, sample.measured_ns, &values))
}

fn mocap(sample: &Mocap) -> Option<Measurement> {
    let (p, q) = (sample.position, sample.attitude);
    let values = [p.x, p.y, p.z, q.x, q.y, q.z, q.w];
    (sample.valid == 1).then(|| Measurement::new(Source::Mocap, sample.measured_ns, &values))
}

fn barometer(sample: &Barometer) -> Option<Measurement> {
    (sample.valid == 1).then(|| Measurement::new(Source::Barometer, sample.measured_ns, &[sample.altitude]))
}

fn magnetometer(sample: &Magnetometer) -> Option<Measurement> {
    let values = <[f64; 3]>::from(sample.field);
    (sample.valid == 1).then(|| Measurement::new(Source::Magnetometer, sample.measured_ns, &values))
}

fn state_estimate(filter: &Ekf, state: &EkfState) -> StateEstimate {
    let motion = state.motion();
    let sigma = state
        .has_begun()
        .then(|| filter.motion_variances(state).map(|variances| vector_message(variances.map(f64::sqrt))));
    let [position_sigma, velocity_sigma, attitude_sigma] = sigma.unwrap_or([[UNKNOWN_SIGMA; 3].into(); 3]);
    StateEstimate {
        position: motion.position,
        velocity: motion.velocity,
        attitude: motion.attitude,
        angular_velocity: angular_velocity(state),
        position_sigma,
        velocity_sigma,
        attitude_sigma,
        ..Default::default()
    }
}

fn angular_velocity(state: &EkfState) -> Vector3 {
    let read = vector(state.newest_reading().angular_velocity);
    vector_message(read - vector(state.motion().gyroscope_bias))
}

fn attitude_estimate(state: &EkfState) -> AttitudeEstimate {
    let (roll, pitch, yaw) = attitude(state.motion().attitude).euler_angles();
    let angular_velocity = angular_velocity(state);
    AttitudeEstimate {
        attitude: state.motion().attitude,
        roll,
        pitch,
        yaw,
        angular_velocity,
        ..Default::default()
    }
}

fn innovations(state: &EkfState) -> Innovation {
    Innovation {
        normalised_squared: state.kept.normalised_squared,
        degrees_of_freedom: DEGREES_OF_FREEDOM,
        updates: state.kept.updates,
        refused: state.kept.refused,
        ..Default::default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use component::Registration;
    use serde_json::json;

    fn refused(parameters: &serde_json::Value, inputs: &[&str]) -> Option<String> {
        Registration::of::<Ekf>()
            .check(parameters, &NodeContext::new("ekf", inputs))
            .err()
            .map(|error| error.to_string())
    }

    #[test]
    fn a_filter_that_nothing_tells_the_position_is_refused() {
        let error = refused(&json!({}), &["imu", "barometer"]).unwrap();
        assert!(error.contains("`inputs.gps`") && error.contains("`inputs.mocap`"), "{error}");
        assert_eq!(refused(&json!({}), &["imu", "gps"]), None);
        assert_eq!(refused(&json!({}), &["imu", "mocap"]), None);
    }

    #[test]
    fn impossible_parameters_are_named() {
        for (parameters, key) in [
            (json!({ "mocap_position_noise_m": 0.0 }), "`mocap_position_noise_m`"),
            (json!({ "gps_position_noise_m": [0.3, -1.0, 0.3] }), "`gps_position_noise_m`"),
            (json!({ "inclination_deg": 90.0 }), "`inclination_deg`"),
            (json!({ "initial_position_m": [0.0, 0.0] }), "`initial_position_m`"),
            (json!({ "mocap_sigma": 1.0 }), "`mocap_sigma`"),
        ] {
            let error = refused(&parameters, &["imu", "mocap"]).unwrap();
            assert!(error.contains(key), "{error}");
        }
    }
}
