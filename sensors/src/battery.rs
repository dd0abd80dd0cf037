//! The battery monitor node: voltage and current at the battery's terminals, and the charge that is left.
//!
//! Reading = truth + bias + white noise, in steps of the part's resolution. The charge is as a monitor can know it:
//! the measured current counted from `initial_charge` on. `crate::channel` gives the times, delays and losses of
//! measurements; the count goes on through losses. If the truth is not valid, since the plant has no model of its
//! battery, nothing is measured and `valid` is 0.

use crate::channel::Chance;
use crate::sensing::Sensor;
use crate::steps::in_steps;
use component::messages::Battery;
use component::random::normal;
use component::{Info, InputPorts};
use diagnostics::parameter::{ParameterError, finite, not_negative, positive, within};
use inputs::InputFiles;

timed_parameters! {
    /// Parameters of a battery monitor; the defaults are a Texas Instruments INA226 with a shunt of 2 mΩ.
    ///
    /// Its data sheet (SBOS547): 1.25 mV a count of voltage, 2.5 µV a count of shunt voltage, which is 1.25 mA; 1.1 ms
    /// for each of the two conversions. It states no noise: one count of each, no source. The rate is 10 Hz, tuned, no
    /// source. The capacity is the Hummingbird's (thesis, Table 2.1: 2100 mAh).
    ///
    /// ```
    /// use component::messages::Battery;
    /// use sensors::battery::{BatteryInputs, BatteryParams};
    /// use sensors::sensing::Sensing;
    ///
    /// let parameters = BatteryParams { delay_ms: 0.0, ..BatteryParams::default() };
    /// let mut monitor = component::Harness::<Sensing<BatteryParams>>::new(parameters).unwrap();
    /// let battery = Battery { voltage: 11.1, current: 8.0, valid: 1, ..Default::default() };
    /// let read = monitor.step(BatteryInputs { battery: &battery }).unwrap().measured;
    /// assert!((read.voltage - 11.1).abs() < 0.01 && (read.current - 8.0).abs() < 0.01, "{read:?}");
    /// ```
    #[derive(Copy)]
    pub struct BatteryParams timed { rate_hz: 10.0, delay_ms: 2.2 } {
        /// Standard deviation of a voltage.
        #[parameter(default = 1.25e-3, check = not_negative)]
        pub voltage_noise_V: f64,
        /// Constant error of the voltage.
        #[parameter(default = 0.0, check = finite)]
        pub voltage_bias_V: f64,
        /// Voltages are multiples of this; 0 for any.
        #[parameter(default = 1.25e-3, check = not_negative)]
        pub voltage_resolution_V: f64,
        /// Standard deviation of a current.
        #[parameter(default = 1.25e-3, check = not_negative)]
        pub current_noise_A: f64,
        /// Constant error of the current.
        #[parameter(default = 0.0, check = finite)]
        pub current_bias_A: f64,
        /// Currents are multiples of this; 0 for any.
        #[parameter(default = 1.25e-3, check = not_negative)]
        pub current_resolution_A: f64,
        /// Capacity of the battery.
        #[parameter(default = 2.1, check = positive)]
        pub capacity_Ah: f64,
        /// The charge that is taken for granted at the first measurement.
        #[parameter(default = 1.0, check = within(0.0..=1.0, "from 0 to 1"), initial)]
        pub initial_charge: f64,
    }
}

/// One quantity as a converter reads it.
fn read(truth: f64, bias: f64, sigma: f64, step: f64, chance: &mut Chance<'_>) -> f64 {
    let noise = normal(chance.noise());
    in_steps(truth + bias + sigma * noise, step)
}

sensor! {
    pub struct BatteryMonitorState as "hummingbus_msgs/msg/BatteryMonitorState" sends measured: Battery {
        /// The charge that is left.
        #[field(unit = "1")]
        charge: f64,
        /// Until when it is counted; the end of time before the first measurement.
        #[field(unit = "ns")]
        counted_ns: u64,
    }
}

/// Inputs of the monitor.
#[derive(Debug, InputPorts)]
pub struct BatteryInputs<'a> {
    /// The truth.
    pub battery: &'a Battery,
}

impl Sensor for BatteryParams {
    const INFO: Info = Info::new(
        "battery",
        "battery monitor: voltage and current with noise, and the charge counted from it",
    );
    type Parameters = Self;
    type Inputs<'a> = BatteryInputs<'a>;
    type Outputs = Outputs;
    type State = BatteryMonitorState;

    fn made_of(parameters: Self, _: &InputFiles) -> Result<Self, ParameterError> {
        Ok(parameters)
    }

    fn initial(&self) -> BatteryMonitorState {
        BatteryMonitorState { charge: self.initial_charge, counted_ns: u64::MAX, ..Default::default() }
    }

    fn measure(
        &self,
        state: &mut BatteryMonitorState,
        _: &Battery,
        chance: &mut Chance<'_>,
        inputs: BatteryInputs<'_>,
    ) -> Option<Battery> {
        let truth = inputs.battery;
        if truth.valid == 0 {
            return None;
        }
        let Self { voltage_bias_V, voltage_noise_V, voltage_resolution_V, .. } = *self;
        let Self { current_bias_A, current_noise_A, current_resolution_A, .. } = *self;
        let voltage = read(truth.voltage, voltage_bias_V, voltage_noise_V, voltage_resolution_V, chance);
        let current = read(truth.current, current_bias_A, current_noise_A, current_resolution_A, chance);
        let elapsed_ns = chance.now_ns.saturating_sub(state.counted_ns);
        let drawn = current * elapsed_ns as f64 * 1e-9 / 3600.0 / self.capacity_Ah;
        let charge = (state.charge - drawn).clamp(0.0, 1.0);
        (state.charge, state.counted_ns) = (charge, chance.now_ns);
        Some(Battery { voltage, current, charge, ..Default::default() })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{harness, refusal, require_normal};
    use component::Harness;

    fn truth() -> Battery {
        Battery { voltage: 11.3, current: 8.4, charge: 0.5, valid: 1, ..Default::default() }
    }

    fn samples(params: &BatteryParams, count: u64) -> Vec<Battery> {
        let mut sensor = harness::<BatteryParams>(*params, 100);
        (0..count).map(|_| sensor.step(BatteryInputs { battery: &truth() }).unwrap().measured).collect()
    }

    fn undelayed() -> BatteryParams {
        BatteryParams { delay_ms: 0.0, ..BatteryParams::default() }
    }

    #[test]
    fn voltage_and_current_have_their_noise_and_bias() {
        let params = BatteryParams {
            voltage_noise_V: 0.02,
            voltage_bias_V: 0.1,
            voltage_resolution_V: 0.0,
            current_noise_A: 0.05,
            current_bias_A: -0.2,
            current_resolution_A: 0.0,
            ..undelayed()
        };
        let samples = samples(&params, 10_000);
        require_normal(samples.iter().map(|sample| sample.voltage), 11.4, 0.02);
        require_normal(samples.iter().map(|sample| sample.current), 8.2, 0.05);
    }

    #[test]
    fn readings_are_counts_of_the_part() {
        for sample in samples(&undelayed(), 100) {
            for counts in [sample.voltage / 1.25e-3, sample.current / 1.25e-3] {
                assert!((counts - counts.round()).abs() < 1e-6, "{counts}");
            }
        }
    }

    #[test]
    fn the_charge_is_counted_from_the_measured_current_and_not_the_true_one() {
        let params = BatteryParams {
            current_noise_A: 0.0,
            current_bias_A: 2.1,
            initial_charge: 0.8,
            dropout: 0.5,
            ..undelayed()
        };
        // 8.4 A and the bias are 10.5 A, drawn for a tenth of a second between two measurements.
        let samples = samples(&params, 3000);
        for (number, sample) in samples.iter().enumerate().filter(|(_, sample)| sample.valid == 1) {
            let expected = (0.8 - number as f64 * 0.1 * 10.5 / 3600.0 / 2.1).max(0.0);
            assert!((sample.charge - expected).abs() < 1e-9, "{} {expected}", sample.charge);
        }
    }

    #[test]
    fn nothing_is_measured_of_a_battery_that_the_plant_does_not_model() {
        let params = undelayed();
        let mut sensor = harness::<BatteryParams>(params, 100);
        for _ in 0..100 {
            let sent = sensor.step(BatteryInputs { battery: &Battery::default() }).unwrap().measured;
            assert_eq!((sent.valid, sent.voltage, sent.current), (0, 0.0, 0.0));
        }
        assert_eq!(sensor.state.sensor.charge, params.initial_charge, "nothing is drawn from it");
    }

    #[test]
    fn an_empty_battery_stays_at_zero() {
        let params = BatteryParams { initial_charge: 0.01, ..undelayed() };
        assert_eq!(samples(&params, 2000).last().unwrap().charge, 0.0);
    }

    #[test]
    fn a_state_that_is_transferred_goes_on_byte_for_byte() {
        let params = BatteryParams { dropout: 0.2, delay_ms: 245.0, ..BatteryParams::default() };
        let truth = truth();
        Harness::require_transfer(
            || harness::<BatteryParams>(params, 1),
            |_| BatteryInputs { battery: &truth },
        );
    }

    #[test]
    fn impossible_parameters_are_named() {
        let bad = [("capacity_Ah", 0.0), ("initial_charge", 1.1), ("voltage_noise_V", -1.0)];
        for (key, value) in bad.into_iter().chain([("current_resolution_A", -1.0), ("dropout", 1.0)]) {
            let reason = refusal::<BatteryParams>(&serde_json::json!({ key: value }));
            assert!(reason.contains(&format!("`{key}`")), "{reason}");
        }
    }
}
