//! The IMU node: reads the plant's true motion, publishes what an inertial measurement unit makes of it.
//!
//! It reads at each of its periods. `crate::channel` says how readings are delayed and lost; a lost one repeats the
//! one before.
#![allow(non_snake_case, reason = "a trailing _B names the frame a vector is written in")]

use crate::channel::{Channel, ChannelState, QUEUE};
use crate::imu_model::{ImuModel, ImuParams, ImuReading, ImuState};
use crate::wire::{vector, vector_message};
use bus::kind::{Inputs, NodeKind, PortSpec};
use bus::messages::{Imu, PlantState, Vector3};
use bus::{BusError, Message, Node};
use diagnostics::unit::STANDARD_GRAVITY_M_S2;

/// The IMU, for manifests.
pub const KIND: NodeKind = NodeKind {
    name: "imu",
    summary: "accelerometer and gyroscope with noise and walking bias",
    inputs: Inputs::Ports(&[PortSpec::required("state", PlantState::SCHEMA)]),
    outputs: &[PortSpec::required("imu", Imu::SCHEMA)],
    check: |parameters, run| {
        let params: ImuParams = diagnostics::read(parameters)?;
        let rate_hz = run.period_s().recip();
        ImuModel::new(params, rate_hz)?;
        params.timing(rate_hz).check(run)
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
        let reading = read(&model, &mut imu_state, memory, &truth(tick.get(state)));
        let sent = send(&mut channel, memory, tick.time_ns(), reading);
        tick.write(output, sent)
    })
}

/// The reading of `truth`; the memory then holds what the next one needs.
fn read(model: &ImuModel, state: &mut ImuState, memory: &mut Memory, truth: &ImuReading) -> Imu {
    memory.restore(state);
    let reading = model.read(state, truth);
    memory.store(state);
    message(&reading)
}

/// What is sent at `now_ns`, at which `reading` was made.
fn send(channel: &mut Channel, memory: &mut Memory, now_ns: u64, reading: Imu) -> Imu {
    channel.step(&mut memory.channel, &mut memory.queue, now_ns, |last, chance| {
        if chance.is_lost(0) { *last } else { reading }
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{TICK_NS, require_hand_over};
    use bus::context::NodeContext;

    fn truth_at(tick: u64) -> ImuReading {
        ImuReading {
            specific_force_B_m_s2: nalgebra::Vector3::new(0.3, tick as f64 * 1e-3, 9.81),
            angular_velocity_B_rad_s: nalgebra::Vector3::new(0.1, -0.7, 0.02),
        }
    }

    /// What is sent, and what was read, tick by tick.
    fn flown(params: ImuParams, ticks: u64) -> Vec<(Imu, Imu)> {
        let model = ImuModel::new(params, 1000.0).unwrap();
        let mut channel = Channel::new(&params.timing(1000.0), 1e-3, 7, "imu").unwrap();
        let mut state = model.initial_state(7, "imu");
        let mut memory = Memory::new(&state);
        (0..ticks)
            .map(|tick| {
                let reading = read(&model, &mut state, &mut memory, &truth_at(tick));
                (send(&mut channel, &mut memory, tick * TICK_NS, reading), reading)
            })
            .collect()
    }

    fn bytes(imu: &Imu) -> &[u8] {
        bytemuck::bytes_of(imu)
    }

    #[test]
    fn by_default_the_readings_of_the_model_are_sent_as_they_are_made() {
        let model = ImuModel::new(ImuParams::default(), 1000.0).unwrap();
        let mut state = model.initial_state(7, "imu");
        for (tick, (sent, _)) in (0..1000).zip(flown(ImuParams::default(), 1000)) {
            assert_eq!(bytes(&sent), bytes(&message(&model.read(&mut state, &truth_at(tick)))));
        }
    }

    #[test]
    fn a_delayed_reading_is_that_of_as_many_ticks_before_and_before_the_first_it_rests_level() {
        let flown = flown(ImuParams { delay_ms: 5.0, ..ImuParams::default() }, 100);
        for (tick, (sent, _)) in flown.iter().enumerate() {
            match tick.checked_sub(5) {
                Some(tick) => assert_eq!(bytes(sent), bytes(&flown[tick].1)),
                None => assert_eq!(<[f64; 3]>::from(sent.specific_force), [0.0, 0.0, STANDARD_GRAVITY_M_S2]),
            }
        }
    }

    #[test]
    fn a_lost_reading_repeats_the_one_before_and_does_not_reshuffle_the_noise() {
        let flown = flown(ImuParams { dropout: 0.2, ..ImuParams::default() }, 5000);
        let mut lost = 0.0;
        for pair in flown.windows(2) {
            if bytes(&pair[1].0) != bytes(&pair[1].1) {
                assert_eq!(bytes(&pair[1].0), bytes(&pair[0].0));
                lost += 1.0;
            }
        }
        assert!((lost / 5000.0_f64 - 0.2).abs() < 6.0 * (0.16_f64 / 5000.0).sqrt(), "{lost}");
    }

    #[test]
    fn a_memory_that_is_handed_over_goes_on_byte_for_byte() {
        let params = ImuParams { delay_ms: 9.0, dropout: 0.1, dropout_mean_s: 0.02, ..ImuParams::default() };
        let model = ImuModel::new(params, 1000.0).unwrap();
        let start = Memory::new(&model.initial_state(7, "imu"));
        let channel = || Channel::new(&params.timing(1000.0), 1e-3, 7, "imu").unwrap();
        require_hand_over(channel, start, |channel, memory: &mut Memory, now_ns| {
            let mut state = model.initial_state(7, "imu");
            let reading = read(&model, &mut state, memory, &truth_at(now_ns / TICK_NS));
            send(channel, memory, now_ns, reading)
        });
    }

    #[test]
    fn impossible_losses_and_delays_are_named() {
        for (key, value) in [("delay_ms", -1.0), ("dropout", 1.0), ("dropout_mean_s", -1.0)] {
            let reason =
                (KIND.check)(&serde_json::json!({ key: value }), &NodeContext::new("node", &["state"]))
                    .unwrap_err()
                    .to_string();
            assert!(reason.contains(&format!("`{key}`")), "{reason}");
        }
        // Whether this is long enough depends on the rate, which the check does not know.
        let bursts = serde_json::json!({ "dropout": 0.1, "dropout_mean_s": 0.05 });
        (KIND.check)(&bursts, &NodeContext::new("node", &["state"])).unwrap();
    }
}
