//! The extended Kalman filter as a node: position, velocity and attitude from an IMU and what else measures.

pub mod filter;
pub mod history;
pub mod motion;
pub mod observation;
pub mod params;
pub mod start;
pub mod transition;

use crate::wire::{attitude, vector, vector_message};
use bus::kind::{Inputs, NodeKind, PortSpec};
use bus::messages::{
    AttitudeEstimate, Barometer, Gps, Imu, Innovation, Magnetometer, Mocap, StateEstimate, Vector3,
};
use bus::{BusError, Input, Message, Node, Tick};
use filter::{Ekf, EkfState};
use history::{Measurement, Newest, Reading, Sensor};
use params::EkfParams;
use transition::{ATTITUDE, Covariance, POSITION, VELOCITY};

/// The filter, for manifests.
pub const KIND: NodeKind = NodeKind {
    name: "ekf",
    summary: "extended Kalman filter: the motion from an IMU, GPS or motion capture, barometer, magnetometer",
    inputs: Inputs::Ports(&[
        PortSpec::required("imu", Imu::SCHEMA),
        PortSpec::optional("gps", Gps::SCHEMA),
        PortSpec::optional("mocap", Mocap::SCHEMA),
        PortSpec::optional("barometer", Barometer::SCHEMA),
        PortSpec::optional("magnetometer", Magnetometer::SCHEMA),
    ]),
    outputs: &[
        PortSpec::required("estimate", StateEstimate::SCHEMA),
        PortSpec::optional("innovation", Innovation::SCHEMA),
        PortSpec::optional("attitude", AttitudeEstimate::SCHEMA),
    ],
    check: |parameters, run| {
        let params: EkfParams = diagnostics::read(parameters)?;
        Ekf::new(params, run.period_s())?;
        let has_position = run.has("gps") || run.has("mocap");
        let unwired = "nothing tells the position: wire `inputs.gps`, `inputs.mocap` or both";
        if has_position { Ok(()) } else { Err(diagnostics::ParameterError::conflict("", unwired)) }
    },
    run,
};

/// The position's standard deviation before the filter has begun, m, and likewise of all else: nothing is known.
const UNKNOWN_SIGMA: f64 = 1e6;

/// Degrees of freedom of the measurements, in the order of [`Sensor::ALL`].
const DEGREES_OF_FREEDOM: [u32; 4] = [6, 6, 1, 3];

/// The sensors that are wired.
#[derive(Clone, Copy)]
struct Sensors {
    gps: Option<Input<Gps>>,
    mocap: Option<Input<Mocap>>,
    barometer: Option<Input<Barometer>>,
    magnetometer: Option<Input<Magnetometer>>,
}

impl Sensors {
    fn declare(node: &mut Node) -> Self {
        Self {
            gps: node.optional_input("gps"),
            mocap: node.optional_input("mocap"),
            barometer: node.optional_input("barometer"),
            magnetometer: node.optional_input("magnetometer"),
        }
    }

    fn newest(&self, tick: &Tick<'_>) -> Newest {
        [
            self.gps.map(|input| gps(tick.get(input))),
            self.mocap.map(|input| mocap(tick.get(input))),
            self.barometer.map(|input| barometer(tick.get(input))),
            self.magnetometer.map(|input| magnetometer(tick.get(input))),
        ]
    }
}

fn run() -> Result<(), BusError> {
    let mut node = Node::join()?;
    let imu = node.input::<Imu>("imu")?;
    let sensors = Sensors::declare(&mut node);
    let estimate = node.output::<StateEstimate>("estimate")?;
    let innovation = node.optional_output::<Innovation>("innovation")?;
    let attitude = node.optional_output::<AttitudeEstimate>("attitude")?;
    let filter = Ekf::new(node.parameters()?, node.period_s()).map_err(|error| node.error(error))?;
    node.run_with_state(filter.initial_state(), |tick, state| {
        let newest = sensors.newest(tick);
        filter.step(state, &reading(tick.get(imu), tick.time_ns()), &newest);
        if tick.is_due(estimate) {
            tick.write(estimate, state_estimate(&filter, state))?;
        }
        if let Some(attitude) = attitude {
            tick.write(attitude, attitude_estimate(state))?;
        }
        innovation.map_or(Ok(()), |innovation| tick.write(innovation, innovations(state)))
    })
}

fn reading(imu: &Imu, time_ns: u64) -> Reading {
    Reading { time_ns, specific_force: imu.specific_force, angular_velocity: imu.angular_velocity }
}

fn gps(sample: &Gps) -> Option<Measurement> {
    let (p, v) = (sample.position, sample.velocity);
    let values = [p.x, p.y, p.z, v.x, v.y, v.z];
    (sample.valid == 1).then(|| Measurement::new(Sensor::Gps, sample.measured_ns, &values))
}

fn mocap(sample: &Mocap) -> Option<Measurement> {
    let (p, q) = (sample.position, sample.attitude);
    let values = [p.x, p.y, p.z, q.x, q.y, q.z, q.w];
    (sample.valid == 1).then(|| Measurement::new(Sensor::Mocap, sample.measured_ns, &values))
}

fn barometer(sample: &Barometer) -> Option<Measurement> {
    (sample.valid == 1).then(|| Measurement::new(Sensor::Barometer, sample.measured_ns, &[sample.altitude]))
}

fn magnetometer(sample: &Magnetometer) -> Option<Measurement> {
    let values = <[f64; 3]>::from(sample.field);
    (sample.valid == 1).then(|| Measurement::new(Sensor::Magnetometer, sample.measured_ns, &values))
}

fn state_estimate(filter: &Ekf, state: &EkfState) -> StateEstimate {
    let motion = state.motion();
    let sigma = state.has_begun().then(|| sigmas(&filter.covariance(state), state));
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

/// Standard deviations of position, velocity and attitude, the last about the body's axes.
fn sigmas(covariance: &Covariance, state: &EkfState) -> [Vector3; 3] {
    let block = |from: usize| covariance.fixed_view::<3, 3>(from, from).into_owned();
    let to_body = attitude(state.motion().attitude).inverse().to_rotation_matrix();
    let turned = to_body * block(ATTITUDE) * to_body.transpose();
    [block(POSITION), block(VELOCITY), turned].map(|block| vector_message(block.diagonal().map(f64::sqrt)))
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
        normalised_squared: state.normalised_squared(),
        degrees_of_freedom: DEGREES_OF_FREEDOM,
        updates: state.updates(),
        refused: state.refused(),
        ..Default::default()
    }
}

#[cfg(test)]
mod tests {
    use super::KIND;
    use bus::context::NodeContext;
    use serde_json::json;

    #[test]
    fn a_filter_that_nothing_tells_the_position_is_refused() {
        let error = (KIND.check)(&json!({}), &NodeContext::new("node", &["imu", "barometer"]))
            .unwrap_err()
            .to_string();
        assert!(error.contains("`inputs.gps`") && error.contains("`inputs.mocap`"), "{error}");
        assert_eq!((KIND.check)(&json!({}), &NodeContext::new("node", &["imu", "gps"])), Ok(()));
        assert_eq!((KIND.check)(&json!({}), &NodeContext::new("node", &["imu", "mocap"])), Ok(()));
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
            let error = (KIND.check)(&parameters, &NodeContext::new("node", &["imu", "mocap"]))
                .unwrap_err()
                .to_string();
            assert!(error.contains(key), "{error}");
        }
    }
}
