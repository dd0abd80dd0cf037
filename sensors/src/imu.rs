//! The IMU node: reads the plant's true motion, publishes what an inertial measurement unit makes of it.
#![allow(non_snake_case, reason = "a trailing _B names the frame a vector is written in")]

use crate::imu_model::{ImuModel, ImuParams, ImuReading};
use bus::kind::{Inputs, NodeKind, PortSpec, read_parameters};
use bus::messages::{Imu, PlantState, Vector3};
use bus::{BusError, Message, Node};

/// The IMU, for manifests.
pub const KIND: NodeKind = NodeKind {
    name: "imu",
    summary: "accelerometer and gyroscope with noise and walking bias",
    inputs: Inputs::Ports(&[PortSpec::required("state", PlantState::SCHEMA)]),
    outputs: &[PortSpec::required("imu", Imu::SCHEMA)],
    check: |parameters, _| {
        let params: ImuParams = read_parameters(parameters)?;
        // Any rate serves here: only the parameters are checked.
        ImuModel::new(params, 1.0).map(|_| ()).map_err(|error| error.to_string())
    },
    run,
};

fn run() -> Result<(), BusError> {
    let mut node = Node::join()?;
    let state = node.input::<PlantState>("state")?;
    let output = node.output::<Imu>("imu")?;
    let model = ImuModel::new(node.parameters()?, node.period_s().recip()).map_err(|e| node.error(e))?;
    let mut memory = model.initial_state(node.seed(), node.name());
    node.run(|tick| {
        let truth = tick.get(state);
        let truth = ImuReading {
            specific_force_B_m_s2: <[f64; 3]>::from(truth.specific_force).into(),
            angular_velocity_B_rad_s: <[f64; 3]>::from(truth.angular_velocity).into(),
        };
        let reading = model.read(&mut memory, &truth);
        let vector = |v: nalgebra::Vector3<f64>| Vector3::from(<[f64; 3]>::from(v));
        tick.write(
            output,
            Imu {
                specific_force: vector(reading.specific_force_B_m_s2),
                angular_velocity: vector(reading.angular_velocity_B_rad_s),
                ..Default::default()
            },
        )
    })
}
