//! The attitude node: the complementary filter over an IMU's readings.
#![allow(non_snake_case, reason = "a trailing _B names the frame a vector is written in")]

use crate::complementary::{Complementary, ComplementaryParams, ComplementaryState};
use crate::imu_model::ImuReading;
use bus::kind::{Inputs, NodeKind, PortSpec, read_parameters};
use bus::messages::{AttitudeEstimate, Imu, Quaternion, Vector3};
use bus::{BusError, Message, Node};

/// The attitude estimator, for manifests.
pub const KIND: NodeKind = NodeKind {
    name: "attitude",
    summary: "complementary filter: roll, pitch and yaw from an IMU",
    inputs: Inputs::Ports(&[PortSpec::required("imu", Imu::SCHEMA)]),
    outputs: &[PortSpec::required("estimate", AttitudeEstimate::SCHEMA)],
    check: |parameters, _| {
        let params: ComplementaryParams = read_parameters(parameters)?;
        Complementary::new(params, 1.0).map(|_| ()).map_err(|error| error.to_string())
    },
    run,
};

fn run() -> Result<(), BusError> {
    let mut node = Node::join()?;
    let imu = node.input::<Imu>("imu")?;
    let output = node.output::<AttitudeEstimate>("estimate")?;
    let filter =
        Complementary::new(node.parameters()?, node.period_s()).map_err(|error| node.error(error))?;
    let mut memory = ComplementaryState::default();
    node.run(|tick| {
        let imu = tick.get(imu);
        let reading = ImuReading {
            specific_force_B_m_s2: <[f64; 3]>::from(imu.specific_force).into(),
            angular_velocity_B_rad_s: <[f64; 3]>::from(imu.angular_velocity).into(),
        };
        let estimate = filter.step(&mut memory, &reading);
        let [x, y, z, w] = estimate.attitude_WB.coords.into();
        tick.write(
            output,
            AttitudeEstimate {
                attitude: Quaternion { x, y, z, w },
                roll: estimate.roll_rad,
                pitch: estimate.pitch_rad,
                yaw: estimate.yaw_rad,
                angular_velocity: Vector3::from(<[f64; 3]>::from(estimate.angular_velocity_B_rad_s)),
                ..Default::default()
            },
        )
    })
}
