//! The barometer node: air pressure, and the height that follows from it.
//!
//! Reading = pressure at the centre of mass in the standard atmosphere (`crate::atmosphere`) + bias + white
//! noise. It has steps of the part's resolution and is cut off at its range. The bias walks at random, as
//! weather and temperature move it. The altitude follows from the reading and a reference pressure.
//! `crate::channel` gives the times, delays and losses of measurements.

use crate::atmosphere::{SEA_LEVEL_PRESSURE_PA, height_m, pressure_Pa};
use crate::channel::Chance;
use crate::noise::BiasWalk;
use crate::sensing::{Sensor, TruthInputs};
use crate::steps::in_steps;
use component::Info;
use component::messages::Barometer;
use component::random::normal;
use diagnostics::parameter::{ParameterError, finite, not_negative, positive};
use inputs::InputFiles;

/// The least pressure that the part reads, Pa (MS5611-01BA03 data sheet: 10 mbar).
const PRESSURE_MIN_PA: f64 = 1.0e3;
/// The most, Pa (the same: 1200 mbar).
const PRESSURE_MAX_PA: f64 = 1.2e5;

timed_parameters! {
    /// Parameters of a barometer; the defaults are a MEAS Switzerland (TE Connectivity) MS5611-01BA03.
    ///
    /// Its data sheet (DA5611-01BA03): resolution 0.012 mbar RMS at an oversampling ratio of 4096, which is its noise;
    /// the compensated reading in steps of 0.01 mbar; conversions of pressure and temperature of 8.22 ms each, one
    /// after the other, so that a reading is 16 ms old and 50 a second are possible. Bias walk: the data sheet states
    /// ±1 mbar a year, which is nothing in a flight; 0.2 Pa/√s, 1.5 Pa (13 cm) in a minute, stands for weather and
    /// warming (tuned, no source). The bias starts at zero: an autopilot nulls its altitude before take-off.
    ///
    /// ```
    /// use component::messages::PlantState;
    /// use sensors::barometer::BarometerParams;
    /// use sensors::sensing::{Sensing, TruthInputs};
    ///
    /// let mut barometer = component::Harness::<Sensing<BarometerParams>>::new(BarometerParams::default()).unwrap();
    /// let state = PlantState { position: [0.0, 0.0, 100.0].into(), ..Default::default() };
    /// let read = (0..=16).map(|_| barometer.step(TruthInputs { state: &state }).unwrap().barometer).last().unwrap();
    /// assert!((read.altitude - 100.0).abs() < 1.0, "after its delay of 16 ms it tells the height: {read:?}");
    /// ```
    #[derive(Copy)]
    pub struct BarometerParams timed { rate_hz: 50.0, delay_ms: 16.0 } {
        /// True pressure at the world's origin.
        #[parameter(default = SEA_LEVEL_PRESSURE_PA, check = positive)]
        pub ground_pressure_Pa: f64,
        /// Pressure at which the altitude is zero.
        #[parameter(default = SEA_LEVEL_PRESSURE_PA, check = positive)]
        pub reference_pressure_Pa: f64,
        /// Standard deviation of a reading.
        #[parameter(default = 1.2, check = not_negative)]
        pub noise_Pa: f64,
        /// The bias at the first reading.
        #[parameter(default = 0.0, check = finite, initial)]
        pub initial_bias_Pa: f64,
        /// Random walk of the bias.
        #[parameter(default = 0.2, check = not_negative)]
        pub bias_walk_Pa_sqrt_s: f64,
        /// Readings are multiples of this; 0 for any reading.
        #[parameter(default = 1.0, check = not_negative)]
        pub resolution_Pa: f64,
    }
}

sensor! {
    pub struct BarometerState as "hummingbus_msgs/msg/BarometerState" sends barometer: Barometer {
        /// The bias at the next measurement.
        #[field(unit = "Pa")]
        bias: f64,
    }
}

impl Sensor for BarometerParams {
    const INFO: Info = Info::new("barometer", "air pressure and altitude with noise, walking bias and delay");
    type Parameters = Self;
    type Inputs<'a> = TruthInputs<'a>;
    type Outputs = Outputs;
    type State = BarometerState;

    fn made_of(parameters: Self, _: &InputFiles) -> Result<Self, ParameterError> {
        Ok(parameters)
    }

    fn initial(&self) -> BarometerState {
        BarometerState { bias: self.initial_bias_Pa, ..BarometerState::default() }
    }

    fn measure(
        &self,
        state: &mut BarometerState,
        _: &Barometer,
        chance: &mut Chance<'_>,
        inputs: TruthInputs<'_>,
    ) -> Option<Barometer> {
        let noise = normal(chance.noise());
        let step = normal(chance.noise());
        let true_Pa = pressure_Pa(inputs.state.position.z, self.ground_pressure_Pa);
        let read_Pa = true_Pa + state.bias + self.noise_Pa * noise;
        state.bias += BiasWalk::new(self.bias_walk_Pa_sqrt_s, self.rate_hz).step_sigma() * step;
        let pressure = in_steps(read_Pa, self.resolution_Pa).clamp(PRESSURE_MIN_PA, PRESSURE_MAX_PA);
        let altitude = height_m(pressure, self.reference_pressure_Pa);
        Some(Barometer { pressure, altitude, ..Default::default() })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{harness, refusal, require_normal};
    use component::Harness;
    use component::messages::PlantState;

    fn perfect() -> BarometerParams {
        let (noise_Pa, bias_walk_Pa_sqrt_s, resolution_Pa) = (0.0, 0.0, 0.0);
        BarometerParams { delay_ms: 0.0, noise_Pa, bias_walk_Pa_sqrt_s, resolution_Pa, ..Default::default() }
    }

    fn at(altitude_m: f64) -> PlantState {
        PlantState { position: [3.0, 4.0, altitude_m].into(), ..Default::default() }
    }

    fn samples(params: &BarometerParams, truth: &PlantState, count: u64) -> Vec<Barometer> {
        let mut sensor = harness::<BarometerParams>(*params, 20);
        (0..count).map(|_| sensor.step(TruthInputs { state: truth }).unwrap().barometer).collect()
    }

    #[test]
    fn a_perfect_one_reads_the_true_height_whatever_the_pressure_on_the_ground() {
        for pressure_Pa in [95_000.0, 101_325.0] {
            let (ground_pressure_Pa, reference_pressure_Pa) = (pressure_Pa, pressure_Pa);
            let params = BarometerParams { ground_pressure_Pa, reference_pressure_Pa, ..perfect() };
            for altitude_m in [-2.0, 0.0, 1.5, 400.0] {
                let found_m = samples(&params, &at(altitude_m), 1)[0].altitude;
                assert!((found_m - altitude_m).abs() < 1e-8, "{found_m}");
            }
        }
    }

    #[test]
    fn a_reference_that_is_too_high_reads_too_high() {
        // Near the ground a hectopascal is 8.3 m.
        let params = BarometerParams { reference_pressure_Pa: SEA_LEVEL_PRESSURE_PA + 100.0, ..perfect() };
        let found_m = samples(&params, &at(0.0), 1)[0].altitude;
        assert!((found_m - 8.32).abs() < 0.01, "{found_m}");
    }

    #[test]
    fn noise_and_bias_are_those_of_the_parameters() {
        let params = BarometerParams { noise_Pa: 1.2, initial_bias_Pa: 30.0, ..perfect() };
        let pressures = samples(&params, &at(0.0), 20_000).into_iter().map(|sample| sample.pressure);
        require_normal(pressures, SEA_LEVEL_PRESSURE_PA + 30.0, 1.2);
    }

    #[test]
    fn the_bias_walks_by_its_density_each_second() {
        let params = BarometerParams { bias_walk_Pa_sqrt_s: 0.5, ..perfect() };
        // 50 measurements are a second.
        let samples = samples(&params, &at(0.0), 50 * 2000);
        let seconds: Vec<f64> = samples.iter().step_by(50).map(|sample| sample.pressure).collect();
        require_normal(seconds.windows(2).map(|pair| pair[1] - pair[0]), 0.0, 0.5);
    }

    #[test]
    fn readings_are_multiples_of_the_resolution_and_within_the_range() {
        let params = BarometerParams { delay_ms: 0.0, ..Default::default() };
        assert!(samples(&params, &at(1.5), 100).iter().all(|sample| sample.pressure.fract() == 0.0));
        for (altitude_m, expected_Pa) in [(40_000.0, PRESSURE_MIN_PA), (-5000.0, PRESSURE_MAX_PA)] {
            let sample = samples(&params, &at(altitude_m), 1)[0];
            assert!(sample.pressure == expected_Pa && sample.altitude.is_finite(), "{sample:?}");
        }
    }

    #[test]
    fn a_state_that_is_transferred_goes_on_byte_for_byte() {
        let params = BarometerParams { dropout: 0.2, delay_ms: 145.0, ..Default::default() };
        let truths: Vec<_> = (0..2000).map(|tick| at(f64::from(tick) * 1e-3)).collect();
        let inputs = |tick| TruthInputs { state: &truths[tick as usize] };
        Harness::require_transfer(|| harness::<BarometerParams>(params, 1), inputs);
    }

    #[test]
    fn impossible_parameters_are_named() {
        let bad = [("ground_pressure_Pa", 0.0), ("reference_pressure_Pa", -1.0), ("noise_Pa", -1.0)];
        for (key, value) in bad.into_iter().chain([("bias_walk_Pa_sqrt_s", -1.0), ("resolution_Pa", -1.0)]) {
            let reason = refusal::<BarometerParams>(&serde_json::json!({ key: value }));
            assert!(reason.contains(&format!("`{key}`")), "{reason}");
        }
    }
}
