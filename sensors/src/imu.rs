//! The IMU node: reads the plant's true motion, publishes the readings of an inertial measurement unit.
//!
//! It reads at each of its periods. `crate::channel` gives the delays and losses of readings; a lost one repeats the
//! one before.

use crate::channel::{Channel, ChannelState, Queued, Remembered};
use crate::frame::{body_frame_of, frame};
use crate::imu_model::{ImuModel, ImuModelState, ImuParams, ImuReading};
use crate::imu_part::{ImuMotion, ImuPart, ImuPartState};
use crate::noise::{drawn, drawn_words};
use crate::sensing::TruthInputs;
use crate::wire::{vector, vector_message};
use component::context::{NodeContext, StepContext};
use component::messages::{FrameName, Imu, PlantState, ROTORS_MAX, StandardImu, Vector3};
use component::random::Stream;
use component::{Component, Info, Message, OutputPorts, StepError};
use diagnostics::ParameterError;
use diagnostics::unit::STANDARD_GRAVITY_M_S2;

/// State of the IMU: its biases, the place in its random stream, and the readings under way.
#[derive(Debug, Clone, Copy, Default, Message)]
#[repr(C)]
#[message(type_name = "hummingbus_msgs/msg/ImuState")]
pub struct ImuState {
    /// The accelerometer's bias at the next reading.
    #[field(unit = "m/s^2", frame = "body")]
    accelerometer_bias: Vector3,
    /// The gyroscope's bias at the next reading.
    #[field(unit = "rad/s", frame = "body")]
    gyroscope_bias: Vector3,
    /// Words of 32 bits drawn from the random stream: the low and the high half of the count.
    #[field(unit = "1")]
    random_words: [u64; 2],
    /// Readings so far.
    #[field(unit = "1")]
    readings: u64,
    /// The angle of each rotor, from where it started.
    #[field(unit = "rad")]
    rotor_angles: [f64; ROTORS_MAX],
    /// The true angular velocity at the last reading.
    #[field(unit = "rad/s", frame = "body")]
    last_angular_velocity: Vector3,
    /// Specific force behind the accelerometer's low pass.
    #[field(unit = "m/s^2", frame = "body")]
    filtered_specific_force: Vector3,
    /// Angular velocity behind the gyroscope's low pass.
    #[field(unit = "rad/s", frame = "body")]
    filtered_angular_velocity: Vector3,
    /// Measurements that are under way.
    channel: ChannelState,
}

impl ImuState {
    /// Before the first reading.
    fn new(model: &ImuModelState) -> Self {
        let mut state = Self::default();
        state.store(model);
        state
    }

    fn store(&mut self, model: &ImuModelState) {
        self.accelerometer_bias = vector_message(model.accelerometer_bias_B_m_s2);
        self.gyroscope_bias = vector_message(model.gyroscope_bias_B_rad_s);
        self.random_words = drawn_words(&model.random);
    }

    fn part(&self) -> ImuPartState {
        ImuPartState {
            readings: self.readings,
            rotor_angles_rad: self.rotor_angles,
            last_B_rad_s: vector(self.last_angular_velocity),
            filtered: ImuReading {
                specific_force_B_m_s2: vector(self.filtered_specific_force),
                angular_velocity_B_rad_s: vector(self.filtered_angular_velocity),
            },
        }
    }

    fn store_part(&mut self, part: &ImuPartState) {
        self.readings = part.readings;
        self.rotor_angles = part.rotor_angles_rad;
        self.last_angular_velocity = vector_message(part.last_B_rad_s);
        self.filtered_specific_force = vector_message(part.filtered.specific_force_B_m_s2);
        self.filtered_angular_velocity = vector_message(part.filtered.angular_velocity_B_rad_s);
    }

    /// State of the model; `random` is the node's random stream.
    fn model(&self, random: &Stream) -> ImuModelState {
        ImuModelState {
            accelerometer_bias_B_m_s2: vector(self.accelerometer_bias),
            gyroscope_bias_B_rad_s: vector(self.gyroscope_bias),
            random: drawn(random, self.random_words),
        }
    }
}

impl Remembered for ImuState {
    type Measurement = Imu;

    fn channel(&mut self) -> &mut ChannelState {
        &mut self.channel
    }
}

/// Outputs of the IMU.
#[derive(Debug, OutputPorts)]
pub struct Outputs {
    /// The reading that arrived last.
    pub imu: Imu,
    /// The same reading as `sensor_msgs/Imu`, in the frame of the body.
    pub data_raw: Option<StandardImu>,
}

/// An inertial measurement unit.
///
/// ```
/// use component::messages::PlantState;
/// use sensors::imu::ImuSensor;
/// use sensors::imu_model::ImuParams;
/// use sensors::sensing::TruthInputs;
///
/// let mut imu = component::Harness::<ImuSensor>::new(ImuParams::default()).unwrap();
/// let at_rest = PlantState { specific_force: [0.0, 0.0, 9.81].into(), ..Default::default() };
/// let reading = imu.step(TruthInputs { state: &at_rest }).unwrap().imu;
/// assert!((reading.specific_force.z - 9.81).abs() < 1.0, "m/s^2 in body axes: {reading:?}");
/// ```
#[derive(Debug)]
pub struct ImuSensor {
    part: ImuPart,
    model: ImuModel,
    channel: Channel,
    /// The model's state before the first reading. It holds the node's random stream.
    initial: ImuModelState,
    /// Frame of the body, if its name is not too long.
    frame: Option<FrameName>,
}

impl Component for ImuSensor {
    const INFO: Info =
        Info::new("imu", "accelerometer and gyroscope: noise, walking bias, and the mechanics of the part");
    type Parameters = ImuParams;
    type Inputs<'a> = TruthInputs<'a>;
    type Outputs = Outputs;
    type State = Queued<ImuState>;

    fn new(params: ImuParams, context: &NodeContext<'_>) -> Result<Self, ParameterError> {
        let rate_hz = context.period_s().recip();
        let model = ImuModel::new(params, rate_hz)?;
        let part = ImuPart::new(params, rate_hz);
        let channel = Channel::new(&params.timing(rate_hz), context)?;
        let initial = model.initial_state(context.seed, context.name);
        let frame = frame(context, "data_raw", &body_frame_of(context.name))?;
        Ok(Self { part, model, channel, initial, frame })
    }

    /// Until the first reading arrives, the IMU reads rest and level.
    fn initial(&self) -> Queued<ImuState> {
        let at_rest = Imu { specific_force: [0.0, 0.0, STANDARD_GRAVITY_M_S2].into(), ..Default::default() };
        self.channel.state(ImuState::new(&self.initial), at_rest)
    }

    fn step(
        &self,
        context: &StepContext<'_>,
        inputs: TruthInputs<'_>,
        state: &mut Queued<ImuState>,
    ) -> Result<Outputs, StepError> {
        let sensor = &mut state.sensor;
        let mut model = sensor.model(&self.initial.random);
        let mut part = sensor.part();
        let felt = self.part.feel(&mut part, &motion(inputs.state, context.time_ns()));
        let reading = self.part.in_steps(&self.model.read(&mut model, &felt));
        let reading = message(&reading);
        sensor.store_part(&part);
        sensor.store(&model);
        let imu =
            self.channel.measure(
                context.time_ns(),
                state,
                |_, last, chance| {
                    if chance.is_lost(0) { *last } else { reading }
                },
            );
        let data_raw = self.frame.map(|frame| standard(&imu, &frame, &self.model));
        Ok(Outputs { imu, data_raw })
    }
}

/// The covariances are those of the white noise; that of a part without noise is unknown.
fn standard(imu: &Imu, frame: &FrameName, model: &ImuModel) -> StandardImu {
    let (gyroscope, accelerometer) = model.variances();
    StandardImu::new(frame, imu.angular_velocity, gyroscope, imu.specific_force, accelerometer)
}

fn truth(state: &PlantState) -> ImuReading {
    ImuReading {
        specific_force_B_m_s2: vector(state.specific_force),
        angular_velocity_B_rad_s: vector(state.angular_velocity),
    }
}

fn motion(state: &PlantState, time_ns: u64) -> ImuMotion {
    ImuMotion { motion: truth(state), rotor_speeds_rad_s: state.rotor_speed, time_s: time_ns as f64 / 1e9 }
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
    use component::Harness;

    fn truth_at(tick: u32) -> PlantState {
        PlantState {
            specific_force: [0.3, f64::from(tick) * 1e-3, 9.81].into(),
            angular_velocity: [0.1, -0.7, 0.02].into(),
            ..Default::default()
        }
    }

    fn imu(params: ImuParams) -> Harness<ImuSensor> {
        Harness::in_context(params, &NodeContext::new("imu", &[]).seeded(7)).unwrap()
    }

    /// Returns the model's readings of the truth, tick by tick.
    fn read(params: ImuParams, ticks: u32) -> Vec<Imu> {
        let model = ImuModel::new(params, 1000.0).unwrap();
        let mut state = model.initial_state(7, "imu");
        (0..ticks).map(|tick| message(&model.read(&mut state, &truth(&truth_at(tick))))).collect()
    }

    /// Returns the readings that are sent and those that were made, tick by tick.
    fn flown(params: ImuParams, ticks: u32) -> Vec<(Imu, Imu)> {
        let mut imu = imu(params);
        let sent = (0..ticks).map(|tick| imu.step(TruthInputs { state: &truth_at(tick) }).unwrap().imu);
        sent.zip(read(params, ticks)).collect()
    }

    fn bytes(imu: &Imu) -> &[u8] {
        bytemuck::bytes_of(imu)
    }

    #[test]
    fn by_default_the_readings_of_the_model_are_sent_as_they_are_made() {
        for (sent, read) in flown(ImuParams::default(), 1000) {
            assert_eq!(bytes(&sent), bytes(&read));
        }
    }

    #[test]
    fn the_standard_message_has_the_same_reading_and_the_variance_of_the_noise() {
        let params = ImuParams {
            gyroscope_noise_density_rad_s_sqrt_hz: 1e-3,
            accelerometer_noise_density_m_s2_sqrt_hz: 2e-2,
            ..ImuParams::default()
        };
        let context = NodeContext::new("h1/imu", &[]).timed(4_000_000, 1, 1000);
        let mut imu = Harness::<ImuSensor>::in_context(params, &context).unwrap();
        let Outputs { imu, data_raw } = imu.step(TruthInputs { state: &truth_at(1) }).unwrap();
        let data_raw = data_raw.unwrap();
        let name = bytemuck::bytes_of(&data_raw).windows(8).any(|bytes| bytes == b"h1/body\0");
        let numbers = data_raw.numbers();
        assert!(name && numbers[4] == -1.0, "the frame, and no orientation: {data_raw:?}");
        assert_eq!(numbers[13..16], <[f64; 3]>::from(imu.angular_velocity));
        assert_eq!(numbers[25..28], <[f64; 3]>::from(imu.specific_force));
        for (first, variance) in [(16, 1e-6 * 250.0), (28, 4e-4 * 250.0)] {
            for (index, found) in numbers[first..][..9].iter().enumerate() {
                let expected = if index % 4 == 0 { variance } else { 0.0 };
                assert!((found - expected).abs() < 1e-12, "{numbers:?}");
            }
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
    fn a_state_that_is_transferred_goes_on_byte_for_byte() {
        let params = ImuParams { delay_ms: 9.0, dropout: 0.1, dropout_mean_s: 0.02, ..ImuParams::default() };
        let truths: Vec<_> = (0..2000).map(truth_at).collect();
        Harness::require_transfer(|| imu(params), |tick| TruthInputs { state: &truths[tick as usize] });
    }

    #[test]
    fn so_is_that_of_a_part_in_detail() {
        let params = ImuParams {
            position_m: [0.02, 0.01, 0.0],
            gyroscope_bandwidth_hz: 40.0,
            accelerometer_vibration_m: 1e-6,
            warming_k: 20.0,
            gyroscope_bias_drift_rad_s_k: [1e-3; 3],
            gyroscope_resolution_rad_s: 1e-3,
            ..ImuParams::default()
        };
        let truth_at =
            |tick| PlantState { rotor_speed: [400.0, 410.0, 390.0, 405.0].into(), ..truth_at(tick) };
        let truths: Vec<_> = (0..2000).map(truth_at).collect();
        Harness::require_transfer(|| imu(params), |tick| TruthInputs { state: &truths[tick as usize] });
        let mut imu = imu(params);
        let readings = truths.iter().map(|state| imu.step(TruthInputs { state }).unwrap().imu);
        let steps = readings.map(|imu| imu.angular_velocity.x / 1e-3).collect::<Vec<_>>();
        assert!(steps.iter().all(|steps| (steps - steps.round()).abs() < 1e-9), "it is in steps");
        assert!(steps.iter().any(|other| *other != steps[0]), "and it moves");
    }

    #[test]
    fn impossible_losses_and_delays_are_named() {
        for (key, value) in [("delay_ms", -1.0), ("dropout", 1.0), ("dropout_mean_s", -1.0)] {
            let parameters = serde_json::json!({ key: value });
            let reason = Harness::<ImuSensor>::from_json(&parameters).unwrap_err().to_string();
            assert!(reason.contains(&format!("`{key}`")), "{reason}");
        }
        // Whether this is long enough depends on the rate, which the check does not know.
        let bursts = serde_json::json!({ "dropout": 0.1, "dropout_mean_s": 0.05 });
        Harness::<ImuSensor>::from_json(&bursts).unwrap();
    }
}
