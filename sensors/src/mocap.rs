//! The motion capture node: position and attitude as cameras around the room see them.
//!
//! Reading = truth + bias + white noise, the attitude's as a rotation in body axes. [`crate::channel`] says when
//! it measures, how measurements are delayed and lost.
#![allow(non_snake_case, reason = "a trailing _W or _B names the frame a vector is written in")]

use crate::channel::{Channel, ChannelState, QUEUE, Timing};
use crate::noise::standard_normal;
use crate::parameter::{ParameterError, all_finite, not_negative};
use crate::wire::{attitude, attitude_message, vector, vector_message};
use bus::kind::{Inputs, NodeKind, PortSpec, read_parameters};
use bus::messages::{Mocap, PlantState};
use bus::random::Stream;
use bus::{BusError, Message, Node};
use nalgebra::{UnitQuaternion, Vector3};
use serde::Deserialize;

/// Motion capture, for manifests.
pub const KIND: NodeKind = NodeKind {
    name: "mocap",
    summary: "motion capture: position and attitude with noise, delay and drop-outs",
    inputs: Inputs::Ports(&[PortSpec::required("state", PlantState::SCHEMA)]),
    outputs: &[PortSpec::required("mocap", Mocap::SCHEMA)],
    check: |parameters, _| {
        read_parameters::<MocapParams>(parameters)?.validate().map_err(|error| error.to_string())
    },
    run,
};

/// What motion capture does to the truth; the defaults are a Vicon system of MX cameras.
///
/// *Position*: Merriaux et al., "A study of Vicon system positioning performance" (Sensors 17(7), 2017), find a
/// mean error of 0.15 mm at rest and below 2 mm in motion; 0.5 mm lies between. *Attitude*: 0.5 mm seen on
/// markers 0.3 m apart is about 0.1°. *Rate and delay*: such systems stream at 100 Hz and more; 10 ms are one
/// frame of exposure and solving, as the network adds little (tuned, no source). Losses are off: they depend on
/// the room.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct MocapParams {
    /// Measurements a second.
    pub rate_hz: f64,
    /// How long after measuring a measurement arrives, ms.
    pub delay_ms: f64,
    /// The fraction of measurements that are lost.
    pub dropout: f64,
    /// How long losses last on average, s; 0 where each is independent of the one before.
    pub dropout_mean_s: f64,
    /// Standard deviation of each axis of a position, m.
    pub position_noise_m: f64,
    /// Standard deviation of the rotation about each body axis, degrees.
    pub attitude_noise_deg: f64,
    /// Constant error of the position, world axes, m.
    pub position_bias_m: [f64; 3],
    /// Constant error of the attitude: a rotation about the body's axes, degrees.
    pub attitude_bias_deg: [f64; 3],
}

impl Default for MocapParams {
    fn default() -> Self {
        Self {
            rate_hz: 100.0,
            delay_ms: 10.0,
            dropout: 0.0,
            dropout_mean_s: 0.0,
            position_noise_m: 0.5e-3,
            attitude_noise_deg: 0.1,
            position_bias_m: [0.0; 3],
            attitude_bias_deg: [0.0; 3],
        }
    }
}

impl MocapParams {
    fn timing(&self) -> Timing {
        let Self { rate_hz, delay_ms, dropout, dropout_mean_s, .. } = *self;
        Timing { rate_hz, delay_ms, dropout, dropout_mean_s }
    }

    fn validate(&self) -> Result<(), ParameterError> {
        self.timing().validate()?;
        not_negative("position_noise_m", self.position_noise_m)?;
        not_negative("attitude_noise_deg", self.attitude_noise_deg)?;
        all_finite("position_bias_m", &self.position_bias_m)?;
        all_finite("attitude_bias_deg", &self.attitude_bias_deg)
    }

    /// What cameras make of a body at `position_W_m` with `attitude_WB`.
    fn measure(
        &self,
        position_W_m: Vector3<f64>,
        attitude_WB: UnitQuaternion<f64>,
        random: &mut Stream,
    ) -> (Vector3<f64>, UnitQuaternion<f64>) {
        let position_error_W_m =
            Vector3::from(self.position_bias_m) + self.position_noise_m * standard_normal(random);
        let turn_B_deg =
            Vector3::from(self.attitude_bias_deg) + self.attitude_noise_deg * standard_normal(random);
        let turn = UnitQuaternion::from_scaled_axis(turn_B_deg.map(f64::to_radians));
        (position_W_m + position_error_W_m, attitude_WB * turn)
    }
}

/// What the node remembers, as it is handed over.
#[derive(Clone, Copy, Message)]
#[repr(C)]
#[message(type_name = "hummingbus_msgs/msg/MocapState")]
struct Memory {
    /// What is under way.
    channel: ChannelState,
    /// The last measurements.
    queue: [Mocap; QUEUE],
}

impl Default for Memory {
    fn default() -> Self {
        Self { channel: ChannelState::default(), queue: [Mocap::default(); QUEUE] }
    }
}

fn run() -> Result<(), BusError> {
    let mut node = Node::join()?;
    let state = node.input::<PlantState>("state")?;
    let output = node.output::<Mocap>("mocap")?;
    let params: MocapParams = node.parameters()?;
    params.validate().map_err(|error| node.error(error))?;
    let mut channel = Channel::new(&params.timing(), node.period_s(), node.seed(), node.name())
        .map_err(|error| node.error(error))?;
    node.run_with_state(Memory::default(), |tick, memory| {
        let sent = sample(&params, &mut channel, memory, tick.time_ns(), tick.get(state));
        tick.write(output, sent)
    })
}

/// The sample to send at `now_ns`.
fn sample(
    params: &MocapParams,
    channel: &mut Channel,
    memory: &mut Memory,
    now_ns: u64,
    truth: &PlantState,
) -> Mocap {
    channel.step(&mut memory.channel, &mut memory.queue, now_ns, |last, chance| {
        let measured = params.measure(vector(truth.position), attitude(truth.attitude), chance.noise);
        if chance.is_lost(0) {
            return Mocap { valid: 0, ..*last };
        }
        let (position, attitude) = (vector_message(measured.0), attitude_message(measured.1));
        Mocap { measured_ns: now_ns, position, attitude, valid: 1, ..Default::default() }
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    const TICK_NS: u64 = 1_000_000;

    fn truth() -> PlantState {
        PlantState {
            position: [1.0, -2.0, 1.5].into(),
            attitude: attitude_message(UnitQuaternion::from_euler_angles(0.2, -0.1, 2.0)),
            ..Default::default()
        }
    }

    /// The samples of `count` measurements, none delayed.
    fn samples(params: &MocapParams, count: u64) -> Vec<Mocap> {
        let params = MocapParams { delay_ms: 0.0, ..*params };
        let mut channel = Channel::new(&params.timing(), 0.01, 5, "mocap").unwrap();
        let mut memory = Memory::default();
        let mut sample = |n| sample(&params, &mut channel, &mut memory, n * 10 * TICK_NS, &truth());
        (0..count).map(&mut sample).collect()
    }

    fn position_error_m(sample: &Mocap) -> Vector3<f64> {
        vector(sample.position) - vector(truth().position)
    }

    fn turn_B_deg(sample: &Mocap) -> Vector3<f64> {
        let turn = attitude(truth().attitude).inverse() * attitude(sample.attitude);
        turn.scaled_axis().map(f64::to_degrees)
    }

    #[test]
    fn noise_and_bias_are_those_of_the_parameters() {
        let params = MocapParams {
            position_bias_m: [0.01, 0.0, -0.02],
            attitude_bias_deg: [0.0, 0.5, -0.3],
            ..MocapParams::default()
        };
        let samples = samples(&params, 10_000);
        require_normal(&samples, position_error_m, params.position_bias_m, params.position_noise_m);
        require_normal(&samples, turn_B_deg, params.attitude_bias_deg, params.attitude_noise_deg);
    }

    /// Mean and variance of each axis are within six of their standard deviations.
    #[track_caller]
    fn require_normal(samples: &[Mocap], error: impl Fn(&Mocap) -> Vector3<f64>, mean: [f64; 3], sigma: f64) {
        let count = samples.len() as f64;
        for (axis, expected) in mean.into_iter().enumerate() {
            let errors = samples.iter().map(|sample| error(sample)[axis] - expected);
            let (sum, squares) = errors.fold((0.0, 0.0), |(sum, squares), e| (sum + e, squares + e * e));
            assert!((sum / count).abs() < 6.0 * sigma / count.sqrt(), "axis {axis}: mean {}", sum / count);
            let ratio = squares / count / sigma / sigma;
            assert!((ratio - 1.0).abs() < 6.0 * (2.0 / count).sqrt(), "axis {axis}: variance ratio {ratio}");
        }
    }

    #[test]
    fn a_perfect_system_reads_the_truth() {
        let perfect =
            MocapParams { position_noise_m: 0.0, attitude_noise_deg: 0.0, ..MocapParams::default() };
        let sample = samples(&perfect, 1)[0];
        assert_eq!((sample.position, sample.attitude), (truth().position, truth().attitude));
        assert_eq!((sample.measured_ns, sample.valid), (0, 1));
    }

    #[test]
    fn a_lost_measurement_repeats_the_one_before_and_says_so() {
        let params = MocapParams { dropout: 0.3, dropout_mean_s: 0.05, ..MocapParams::default() };
        let samples = samples(&params, 1000);
        assert!(samples.iter().any(|sample| sample.valid == 0));
        for (index, pair) in samples.windows(2).enumerate() {
            let now_ns = (index as u64 + 1) * 10 * TICK_NS;
            let [before, after] = pair else { unreachable!() };
            let expected_ns = if after.valid == 1 { now_ns } else { before.measured_ns };
            assert_eq!(after.measured_ns, expected_ns);
            assert!(after.valid == 1 || after.position == before.position);
        }
    }

    #[test]
    fn a_memory_that_is_handed_over_goes_on_byte_for_byte() {
        let params = MocapParams { delay_ms: 45.0, dropout: 0.2, ..MocapParams::default() };
        let channel = || Channel::new(&params.timing(), 1e-3, 5, "mocap").unwrap();
        let (mut first, mut memory) = (channel(), Memory::default());
        for tick in 0..777 {
            sample(&params, &mut first, &mut memory, tick * TICK_NS, &truth());
        }
        let (mut second, mut handed) = (channel(), memory);
        for tick in 777..2000 {
            let expected = sample(&params, &mut first, &mut memory, tick * TICK_NS, &truth());
            let found = sample(&params, &mut second, &mut handed, tick * TICK_NS, &truth());
            assert_eq!(bytemuck::bytes_of(&found), bytemuck::bytes_of(&expected), "at tick {tick}");
        }
        assert!(bytemuck::bytes_of(&handed) == bytemuck::bytes_of(&memory));
    }

    #[test]
    fn impossible_parameters_are_named_and_unknown_ones_are_refused() {
        let refused = |value| (KIND.check)(&value, &["state"]).unwrap_err();
        assert!(refused(serde_json::json!({ "position_noise_m": -1.0 })).contains("`position_noise_m`"));
        assert!(refused(serde_json::json!({ "rate_hz": 0.0 })).contains("`rate_hz`"));
        assert!(refused(serde_json::json!({ "nose": 0.0 })).contains("`nose`"));
        (KIND.check)(&serde_json::json!({}), &["state"]).unwrap();
    }
}
