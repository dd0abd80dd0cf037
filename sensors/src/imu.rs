//! The IMU node: reads the plant's true motion, publishes what an inertial measurement unit makes of it.
//!
//! It reads at each of its periods. [`crate::channel`] says how readings are delayed and lost; a lost one repeats the
//! one before.
#![allow(non_snake_case, reason = "a trailing _B names the frame a vector is written in")]

use crate::channel::{Channel, ChannelState, QUEUE};
use crate::imu_model::{ImuModel, ImuParams, ImuReading, ImuState};
use crate::units::STANDARD_GRAVITY_M_S2;
use crate::wire::{vector, vector_message};
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

/// What the IMU remembers, as it is handed over: its biases, how far its random stream was drawn, and the readings
/// under way.
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
    /// What is under way.
    channel: ChannelState,
    /// The last readings.
    queue: [Imu; QUEUE],
}

impl Memory {
    /// Before the first reading: until it arrives, the IMU says that it rests level.
    fn new(state: &ImuState) -> Self {
        let at_rest = Imu { specific_force: [0.0, 0.0, STANDARD_GRAVITY_M_S2].into(), ..Default::default() };
        let mut memory = Self {
            accelerometer_bias: Vector3::default(),
            gyroscope_bias: Vector3::default(),
            random_words: [0; 2],
            channel: ChannelState::default(),
            queue: [at_rest; QUEUE],
        };
        memory.store(state);
        memory
    }

    #[allow(clippy::cast_possible_truncation, reason = "the halves of the count are taken apart")]
    fn store(&mut self, state: &ImuState) {
        let words = state.random_words();
        self.accelerometer_bias = vector_message(state.accelerometer_bias_B_m_s2);
        self.gyroscope_bias = vector_message(state.gyroscope_bias_B_rad_s);
        self.random_words = [words as u64, (words >> 64) as u64];
    }

    fn restore(&self, state: &mut ImuState) {
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
    let params: ImuParams = node.parameters()?;
    let rate_hz = node.period_s().recip();
    let model = ImuModel::new(params, rate_hz).map_err(|error| node.error(error))?;
    let mut channel = Channel::of_node(&params.timing(rate_hz), &node)?;
    let mut imu_state = model.initial_state(node.seed(), node.name());
    node.run_with_state(Memory::new(&imu_state), |tick, memory| {
        memory.restore(&mut imu_state);
        let reading = message(&model.read(&mut imu_state, &truth(tick.get(state))));
        memory.store(&imu_state);
        let Memory { channel: under_way, queue, .. } = memory;
        let sent =
            channel.step(
                under_way,
                queue,
                tick.time_ns(),
                |last, chance| {
                    if chance.is_lost(0) { *last } else { reading }
                },
            );
        tick.write(output, sent)
    })
}

fn truth(state: &PlantState) -> ImuReading {
    ImuReading {
        specific_force_B_m_s2: vector(state.specific_force),
        angular_velocity_B_rad_s: vector(state.angular_velocity),
    }
}

fn message(reading: &ImuReading) -> Imu {
    Imu {
        specific_force: vector_message(reading.specific_force_B_m_s2),
        angular_velocity: vector_message(reading.angular_velocity_B_rad_s),
        ..Default::default()
    }
}
