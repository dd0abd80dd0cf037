//! The IMU node: reads the plant's true motion, publishes what an inertial measurement unit makes of it.
#![allow(non_snake_case, reason = "a trailing _B names the frame a vector is written in")]

use crate::imu_model::{ImuModel, ImuParams, ImuReading, ImuState};
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

/// What the IMU remembers, as it is handed over: its biases and how far its random stream was drawn.
#[derive(Clone, Copy, Message)]
#[repr(C)]
#[message(type_name = "hummingbus_msgs/msg/ImuState")]
struct Memory {
    /// The accelerometer's bias at the next reading.
    #[field(unit = "m/s^2", frame = "body")]
    accelerometer_bias: Vector3,
    /// The gyroscope's bias at the next reading.
    #[field(unit = "rad/s", frame = "body")]
    gyroscope_bias: Vector3,
    /// Words of 32 bits drawn from the random stream: the low and the high half of the count.
    #[field(unit = "1")]
    random_words: [u64; 2],
}

impl From<&ImuState> for Memory {
    #[allow(clippy::cast_possible_truncation, reason = "the halves of the count are taken apart")]
    fn from(state: &ImuState) -> Self {
        let words = state.random_words();
        Self {
            accelerometer_bias: <[f64; 3]>::from(state.accelerometer_bias_B_m_s2).into(),
            gyroscope_bias: <[f64; 3]>::from(state.gyroscope_bias_B_rad_s).into(),
            random_words: [words as u64, (words >> 64) as u64],
        }
    }
}

impl Memory {
    fn restore(&self, state: &mut ImuState) {
        let vector = |v: Vector3| nalgebra::Vector3::from(<[f64; 3]>::from(v));
        state.accelerometer_bias_B_m_s2 = vector(self.accelerometer_bias);
        state.gyroscope_bias_B_rad_s = vector(self.gyroscope_bias);
        let [low, high] = self.random_words;
        state.set_random_words(u128::from(high) << 64 | u128::from(low));
    }
}

fn run() -> Result<(), BusError> {
    let mut node = Node::join()?;
    let state = node.input::<PlantState>("state")?;
    let output = node.output::<Imu>("imu")?;
    let model = ImuModel::new(node.parameters()?, node.period_s().recip()).map_err(|e| node.error(e))?;
    let mut imu_state = model.initial_state(node.seed(), node.name());
    node.run_with_state(Memory::from(&imu_state), |tick, memory| {
        memory.restore(&mut imu_state);
        let truth = tick.get(state);
        let truth = ImuReading {
            specific_force_B_m_s2: <[f64; 3]>::from(truth.specific_force).into(),
            angular_velocity_B_rad_s: <[f64; 3]>::from(truth.angular_velocity).into(),
        };
        let reading = model.read(&mut imu_state, &truth);
        *memory = Memory::from(&imu_state);
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
