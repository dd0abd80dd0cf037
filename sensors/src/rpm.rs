//! The rotor speed node: the speed of each rotor as its motor's controller counts it.
//!
//! Reading = truth + white noise, in steps of the part's resolution, never below zero. `crate::channel` gives
//! the times, delays and losses of measurements. Two faults can be put in, to see whether they are taken for
//! physics of the vehicle: a rotor whose reading is stuck, and one of which half is read.

use crate::channel::Chance;
use crate::sensing::{Sensor, TruthInputs};
use crate::steps::in_steps;
use component::messages::{ROTORS_MAX, RotorSpeeds};
use component::random::normal;
use component::{Info, StepError};
use diagnostics::parameter::{ParameterError, not_negative, require};
use inputs::InputFiles;

timed_parameters! {
    /// Parameters of the rotor speeds that the motors' controllers measure.
    ///
    /// *Resolution*: telemetry of electronic speed controllers (KISS, BLHeli_32) counts hundreds of electrical revolutions
    /// a minute; with 7 pole pairs, usual for motors of this size, these are 14.3 rpm, 1.5 rad/s. *Noise* and *rate* are
    /// tuned, no source: one count, 200 Hz. *Delay* is off: the count is timed where it is made.
    ///
    /// ```
    /// use component::messages::PlantState;
    /// use sensors::rpm::RpmParams;
    /// use sensors::sensing::{Sensing, TruthInputs};
    ///
    /// let parameters = RpmParams { half_reading_rotor: 2, ..RpmParams::default() };
    /// let mut rpm = component::Harness::<Sensing<RpmParams>>::new(parameters).unwrap();
    /// let state = PlantState { rotor_speed: [400.0; 4].into(), ..Default::default() };
    /// let speeds = rpm.step(TruthInputs { state: &state }).unwrap().speeds.rotor_speed;
    /// let (first, second) = (speeds[0], speeds[1]);
    /// assert!((first - 400.0).abs() < 10.0 && (second - 200.0).abs() < 10.0, "rad/s: {first}, {second}");
    /// ```
    #[derive(Copy)]
    pub struct RpmParams timed { rate_hz: 200.0, delay_ms: 0.0 } {
        /// Standard deviation of a speed.
        #[parameter(default = 1.5, check = not_negative)]
        pub noise_rad_s: f64,
        /// Speeds are multiples of this; 0 for any.
        #[parameter(default = 1.5, check = not_negative)]
        pub resolution_rad_s: f64,
        /// A fault: this rotor, 1 to 4, reads for ever its first reading; 0: none.
        #[parameter(default = 0, check = rotor)]
        pub stuck_rotor: usize,
        /// A fault: half of the speed of this rotor is read; 0: none.
        #[parameter(default = 0, check = rotor)]
        pub half_reading_rotor: usize,
    }
}

fn rotor(key: &str, number: f64) -> Result<(), ParameterError> {
    let expected = format!("the number of a rotor, 1 to {ROTORS_MAX}, or 0 for none");
    require(key, number, number <= ROTORS_MAX as f64, expected)
}

sensor! {
    pub struct RpmState as "hummingbus_msgs/msg/RpmState" sends speeds: RotorSpeeds {
        /// Speeds that were read last, lost ones included.
        #[field(unit = "rad/s")]
        read: [f64; ROTORS_MAX],
        /// 1 from the first reading on.
        #[field(unit = "1")]
        has_read: u64,
    }
}

impl Sensor for RpmParams {
    const INFO: Info =
        Info::new("rpm", "rotor speeds with noise and resolution, and faults of single rotors");
    type Parameters = Self;
    type Inputs<'a> = TruthInputs<'a>;
    type Outputs = Outputs;
    type State = RpmState;

    fn made_of(parameters: Self, _: &InputFiles) -> Result<Self, ParameterError> {
        Ok(parameters)
    }

    /// The vehicle's rotors are known with its first state.
    fn check_inputs(&self, inputs: &TruthInputs<'_>) -> Result<(), StepError> {
        let count = inputs.state.rotor_speed.len();
        let faults = [("stuck_rotor", self.stuck_rotor), ("half_reading_rotor", self.half_reading_rotor)];
        match faults.into_iter().find(|(_, rotor)| *rotor > count) {
            Some((key, rotor)) => Err(format!(
                "`{key}` is {rotor}, expected the number of a rotor, 1 to {count}: its input `state` has {count} rotor \
                 speeds"
            )
            .into()),
            None => Ok(()),
        }
    }

    fn measure(
        &self,
        state: &mut RpmState,
        _: &RotorSpeeds,
        chance: &mut Chance<'_>,
        inputs: TruthInputs<'_>,
    ) -> Option<RotorSpeeds> {
        for (rotor, truth_rad_s) in inputs.state.rotor_speed.into_iter().enumerate() {
            // Drawn whatever the fault is: a fault reshuffles no noise.
            let noise = normal(chance.noise());
            if rotor + 1 != self.stuck_rotor || state.has_read == 0 {
                let part = if rotor + 1 == self.half_reading_rotor { 0.5 } else { 1.0 };
                let speed_rad_s = truth_rad_s + self.noise_rad_s * noise;
                state.read[rotor] = in_steps(part * speed_rad_s.max(0.0), self.resolution_rad_s);
            }
        }
        state.has_read = 1;
        let rotor_speed = inputs.state.rotor_speed.iter().zip(state.read).map(|(_, read)| read).collect();
        Some(RotorSpeeds { rotor_speed, ..Default::default() })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{harness, refusal, require_normal};
    use component::Harness;
    use component::messages::{PerRotor, PlantState};

    fn truth_at(time_s: f64) -> PlantState {
        let rotor_speed = [400.0, 410.0 + 50.0 * time_s, 420.0, 430.0].into();
        PlantState { rotor_speed, ..Default::default() }
    }

    /// Readings every 5 ms while the second rotor speeds up.
    fn readings(params: &RpmParams, count: u64) -> Vec<PerRotor> {
        let mut sensor = harness::<RpmParams>(*params, 5);
        let sample = |n: u64| {
            let state = truth_at(n as f64 * 5e-3);
            sensor.step(TruthInputs { state: &state }).unwrap().speeds.rotor_speed
        };
        (0..count).map(sample).collect()
    }

    #[test]
    fn speeds_have_their_noise() {
        let params = RpmParams { noise_rad_s: 4.0, resolution_rad_s: 0.0, ..RpmParams::default() };
        let readings = readings(&params, 10_000);
        for (rotor, mean) in [(0, 400.0), (2, 420.0), (3, 430.0)] {
            require_normal(readings.iter().map(|reading| reading[rotor]), mean, 4.0);
        }
    }

    #[test]
    fn speeds_are_counts_and_a_perfect_sensor_reads_the_truth() {
        for reading in readings(&RpmParams::default(), 100) {
            assert!(reading.iter().all(|speed| (speed / 1.5 - (speed / 1.5).round()).abs() < 1e-9));
        }
        let perfect = RpmParams { noise_rad_s: 0.0, resolution_rad_s: 0.0, ..RpmParams::default() };
        assert_eq!(readings(&perfect, 3)[2], truth_at(0.01).rotor_speed);
    }

    #[test]
    fn a_fault_is_of_its_rotor_alone() {
        let sound = readings(&RpmParams::default(), 100);
        let stuck = readings(&RpmParams { stuck_rotor: 2, ..RpmParams::default() }, 100);
        let half = readings(&RpmParams { half_reading_rotor: 2, ..RpmParams::default() }, 100);
        for (n, sound_reading) in sound.iter().enumerate() {
            for rotor in [0, 2, 3] {
                assert_eq!((stuck[n][rotor], half[n][rotor]), (sound_reading[rotor], sound_reading[rotor]));
            }
            assert_eq!(stuck[n][1], sound[0][1]);
            assert!((half[n][1] - sound_reading[1] / 2.0).abs() <= 1.5);
        }
    }

    #[test]
    fn it_reads_as_many_rotors_as_there_are_and_refuses_a_fault_of_another() {
        let six = PlantState { rotor_speed: PerRotor::filled(6, 400.0), ..Default::default() };
        let read = |params: RpmParams| harness::<RpmParams>(params, 5).step(TruthInputs { state: &six });
        let half = RpmParams { half_reading_rotor: 6, ..RpmParams::default() };
        let speeds = read(half).unwrap().speeds.rotor_speed;
        assert!(speeds.len() == 6 && (speeds[5] - 200.0).abs() < 10.0, "{speeds:?}");
        let error = read(RpmParams { stuck_rotor: 7, ..RpmParams::default() }).unwrap_err().to_string();
        assert!(error.contains("`stuck_rotor` is 7") && error.contains("1 to 6"), "{error}");
    }

    #[test]
    fn a_state_that_is_transferred_goes_on_byte_for_byte() {
        let params = RpmParams { dropout: 0.2, delay_ms: 45.0, stuck_rotor: 3, ..RpmParams::default() };
        let truths: Vec<_> = (0..2000).map(|tick| truth_at(f64::from(tick) * 1e-3)).collect();
        let inputs = |tick| TruthInputs { state: &truths[tick as usize] };
        Harness::require_transfer(|| harness::<RpmParams>(params, 1), inputs);
    }

    #[test]
    fn impossible_parameters_are_named() {
        let bad = [("noise_rad_s", -1.0), ("resolution_rad_s", -1.0), ("dropout", 1.0)];
        for (key, value) in bad {
            let reason = refusal::<RpmParams>(&serde_json::json!({ key: value }));
            assert!(reason.contains(&format!("`{key}`")), "{reason}");
        }
        for key in ["stuck_rotor", "half_reading_rotor"] {
            let reason = refusal::<RpmParams>(&serde_json::json!({ key: 13 }));
            assert!(reason.contains(&format!("`{key}`")), "{reason}");
        }
    }
}
