//! The GPS node: position and velocity as a satellite receiver reports them, in the world's axes.
//!
//! Position = truth + bias + drift + white noise; velocity = truth + white noise. The drift stands for orbits,
//! clocks and the ionosphere, which move the position slowly: a first-order Gauss–Markov process, stationary from
//! the first measurement on, d' = e^(−Δt/τ) d + σ √(1 − e^(−2Δt/τ)) n (Gelb, "Applied Optimal Estimation", MIT
//! Press 1974, §3.6). `crate::channel` gives the times, delays and losses of measurements.

use crate::channel::Chance;
use crate::noise::standard_normal;
use crate::sensing::{Sensor, TruthInputs};
use crate::wire::{vector, vector_message};
use component::Info;
use component::messages::Gps;
use component::random::Stream;
use diagnostics::parameter::{ParameterError, finite, not_negative, positive};
use inputs::InputFiles;
use nalgebra::Vector3;

timed_parameters! {
    /// Parameters of a satellite receiver; the defaults are a u-blox NEO-M8N.
    ///
    /// Its data sheet (UBX-15031086): 10 Hz; horizontal position within 2.5 m half of the time, which for equal axes
    /// is σ = 2.5 m / 1.177 = 2.1 m each; velocity within 0.05 m/s half of the time, σ = 0.05 / 0.6745 = 0.074 m/s.
    /// It has no vertical figures: 1.5 times the horizontal ones, the usual ratio of the dilutions of precision. Nearly
    /// all of the position's error is drift. Its time constant (300 s), the white part (0.3 m) and the delay (80 ms)
    /// are tuned, no source.
    ///
    /// ```
    /// use component::messages::PlantState;
    /// use sensors::gps::GpsParams;
    /// use sensors::sensing::{Sensing, TruthInputs};
    ///
    /// let parameters = GpsParams { delay_ms: 0.0, ..GpsParams::default() };
    /// let mut gps = component::Harness::<Sensing<GpsParams>>::new(parameters).unwrap();
    /// let state = PlantState { velocity: [3.0, 0.0, 0.0].into(), ..Default::default() };
    /// let fix = gps.step(TruthInputs { state: &state }).unwrap().gps;
    /// assert!(fix.valid == 1 && (fix.velocity.x - 3.0).abs() < 0.5, "{fix:?}");
    /// ```
    #[derive(Copy)]
    pub struct GpsParams timed { rate_hz: 10.0, delay_ms: 80.0 } {
        /// Standard deviation of the position's white noise along each axis.
        #[parameter(default = [0.3, 0.3, 0.45], check = not_negative)]
        pub position_noise_m: [f64; 3],
        /// Standard deviation of the position's drift along each axis.
        #[parameter(default = [2.1, 2.1, 3.15], check = not_negative)]
        pub position_drift_m: [f64; 3],
        /// Time constant of the drift.
        #[parameter(default = 300.0, check = positive)]
        pub position_drift_time_s: f64,
        /// Constant error of the position.
        #[parameter(default = [0.0; 3], check = finite)]
        pub position_bias_m: [f64; 3],
        /// Standard deviation of the velocity's white noise along each axis.
        #[parameter(default = [0.074, 0.074, 0.111], check = not_negative)]
        pub velocity_noise_m_s: [f64; 3],
    }
}

impl GpsParams {
    /// The drift one measurement after `drift_W_m`, which is `None` before the first.
    fn drift(&self, drift_W_m: Option<Vector3<f64>>, random: &mut Stream) -> Vector3<f64> {
        let sigma_m = Vector3::from(self.position_drift_m);
        let new_W_m = sigma_m.component_mul(&standard_normal(random));
        let Some(drift_W_m) = drift_W_m else { return new_W_m };
        let kept = libm::exp(-(self.rate_hz * self.position_drift_time_s).recip());
        kept * drift_W_m + (1.0 - kept * kept).sqrt() * new_W_m
    }
}

sensor! {
    pub struct GpsState as "hummingbus_msgs/msg/GpsState" sends gps: Gps {
        /// The drift at the last measurement; not a number before the first.
        #[field(unit = "m", frame = "world")]
        drift: component::messages::Vector3,
    }
}

impl Sensor for GpsParams {
    const INFO: Info =
        Info::new("gps", "satellite receiver: position and velocity with noise, drift and delay");
    type Parameters = Self;
    type Inputs<'a> = TruthInputs<'a>;
    type Outputs = Outputs;
    type State = GpsState;

    fn made_of(parameters: Self, _: &InputFiles) -> Result<Self, ParameterError> {
        Ok(parameters)
    }

    fn initial(&self) -> GpsState {
        GpsState { drift: [f64::NAN; 3].into(), ..GpsState::default() }
    }

    fn measure(
        &self,
        state: &mut GpsState,
        _: &Gps,
        chance: &mut Chance<'_>,
        inputs: TruthInputs<'_>,
    ) -> Option<Gps> {
        let last_W_m = vector(state.drift);
        let drift_W_m = self.drift((!last_W_m.x.is_nan()).then_some(last_W_m), chance.noise());
        state.drift = vector_message(drift_W_m);
        let mut noise =
            |sigma: [f64; 3]| Vector3::from(sigma).component_mul(&standard_normal(chance.noise()));
        let position_error_W_m =
            Vector3::from(self.position_bias_m) + drift_W_m + noise(self.position_noise_m);
        let velocity_error_W_m_s = noise(self.velocity_noise_m_s);
        Some(Gps {
            position: vector_message(vector(inputs.state.position) + position_error_W_m),
            velocity: vector_message(vector(inputs.state.velocity) + velocity_error_W_m_s),
            ..Default::default()
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sensing::Sensing;
    use crate::testing::{TICK_NS, refusal, require_normal};
    use component::Harness;
    use component::context::NodeContext;
    use component::messages::PlantState;

    fn truth() -> PlantState {
        PlantState {
            position: [10.0, -20.0, 5.0].into(),
            velocity: [1.0, 2.0, -0.5].into(),
            ..Default::default()
        }
    }

    fn undelayed() -> GpsParams {
        GpsParams { delay_ms: 0.0, ..GpsParams::default() }
    }

    /// The samples of `count` measurements in the run seeded with `seed`.
    fn samples(params: &GpsParams, seed: u64, count: u64) -> Vec<Gps> {
        let context = NodeContext::new("gps", &["state"]).timed(100 * TICK_NS, 1, 1_000_000).seeded(seed);
        let mut receiver = Harness::<Sensing<GpsParams>>::in_context(*params, &context).unwrap();
        (0..count).map(|_| receiver.step(TruthInputs { state: &truth() }).unwrap().gps).collect()
    }

    #[test]
    fn position_and_velocity_have_their_noise_and_bias() {
        let position_bias_m = [1.0, -1.0, 0.5];
        let params = GpsParams { position_drift_m: [0.0; 3], position_bias_m, ..undelayed() };
        let samples = samples(&params, 5, 10_000);
        for (axis, bias_m) in position_bias_m.into_iter().enumerate() {
            let truth_m = vector(truth().position)[axis] + bias_m;
            let positions = samples.iter().map(|sample| vector(sample.position)[axis]);
            require_normal(positions, truth_m, params.position_noise_m[axis]);
            let velocities = samples.iter().map(|sample| vector(sample.velocity)[axis]);
            require_normal(velocities, vector(truth().velocity)[axis], params.velocity_noise_m_s[axis]);
        }
    }

    #[test]
    fn the_drift_is_stationary_from_the_first_measurement_on() {
        let params = GpsParams { position_noise_m: [0.0; 3], ..undelayed() };
        for number in [0, 40] {
            let of_seed = |seed| samples(&params, seed, number + 1).last().unwrap().position.z;
            require_normal((0..2000).map(of_seed), truth().position.z, params.position_drift_m[2]);
        }
    }

    #[test]
    fn the_drift_fades_with_its_time_constant() {
        let params = GpsParams { position_noise_m: [0.0; 3], position_drift_time_s: 5.0, ..undelayed() };
        let drift_m: Vec<f64> = samples(&params, 5, 400_000)
            .iter()
            .map(|sample| sample.position.x - truth().position.x)
            .collect();
        let mean_of = |lag: usize| {
            drift_m.iter().zip(&drift_m[lag..]).map(|(a, b)| a * b).sum::<f64>()
                / (drift_m.len() - lag) as f64
        };
        // 50 measurements are one time constant; 400 000 hold some 4000 independent ones.
        let ratio = mean_of(50) / mean_of(0);
        assert!((ratio - libm::exp(-1.0)).abs() < 6.0 / 4000.0_f64.sqrt(), "{ratio}");
    }

    #[test]
    fn a_measurement_arrives_80_ms_late_with_the_truth_of_its_time() {
        let perfect = GpsParams {
            position_noise_m: [0.0; 3],
            position_drift_m: [0.0; 3],
            velocity_noise_m_s: [0.0; 3],
            ..GpsParams::default()
        };
        let mut receiver = Harness::<Sensing<GpsParams>>::new(perfect).unwrap();
        for tick in 0..1000_u64 {
            let state = &PlantState { position: [tick as f64, 0.0, 0.0].into(), ..Default::default() };
            let sample = receiver.step(TruthInputs { state }).unwrap().gps;
            let expected = tick.checked_sub(80).map(|tick| tick / 100 * 100);
            assert_eq!(sample.valid, u32::from(expected.is_some()), "at tick {tick}");
            assert_eq!(sample.measured_ns, expected.unwrap_or(0) * TICK_NS);
            assert_eq!(sample.position.x, expected.unwrap_or(0) as f64);
        }
    }

    #[test]
    fn a_state_that_is_transferred_goes_on_byte_for_byte() {
        let params = GpsParams { dropout: 0.2, delay_ms: 245.0, ..GpsParams::default() };
        let state = truth();
        let receiver = || Harness::<Sensing<GpsParams>>::new(params).unwrap();
        Harness::require_transfer(receiver, |_| TruthInputs { state: &state });
    }

    #[test]
    fn impossible_parameters_are_named() {
        let refused = |parameters| refusal::<GpsParams>(&parameters);
        let reason = refused(serde_json::json!({ "position_drift_time_s": 0.0 }));
        assert!(reason.contains("`position_drift_time_s`"), "{reason}");
        for key in ["position_noise_m", "position_drift_m", "velocity_noise_m_s"] {
            let reason = refused(serde_json::json!({ key: [0.1, -0.1, 0.1] }));
            assert!(reason.contains(&format!("`{key}`")), "{reason}");
        }
    }
}
