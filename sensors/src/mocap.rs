//! The motion capture node: position and attitude as cameras around the room see them.
//!
//! Reading = truth + bias + white noise, the attitude's as a rotation in body axes. `crate::channel` gives the
//! times, delays and losses of measurements.

use crate::channel::Chance;
use crate::noise::standard_normal;
use crate::sensing::{Sensor, TruthInputs};
use crate::wire::{attitude, attitude_message, vector, vector_message};
use component::Info;
use component::messages::Mocap;
use diagnostics::parameter::{ParameterError, finite, not_negative};
use inputs::InputFiles;
use nalgebra::{UnitQuaternion, Vector3};

timed_parameters! {
    /// Parameters of motion capture; the defaults are a Vicon system of MX cameras.
    ///
    /// *Position*: Merriaux et al. find a mean error of 0.15 mm at rest and below 2 mm in motion ("A study of
    /// Vicon system positioning performance", Sensors 17(7), 2017); 0.5 mm lies between. *Attitude*: 0.5 mm
    /// seen on markers 0.3 m apart is about 0.1°. *Rate and delay*: such systems stream at 100 Hz and more;
    /// 10 ms are one frame of exposure and solving, as the network adds little (tuned, no source). Losses are
    /// off: they depend on the room.
    ///
    /// ```
    /// use component::messages::PlantState;
    /// use sensors::mocap::MocapParams;
    /// use sensors::sensing::{Sensing, TruthInputs};
    ///
    /// let parameters = MocapParams { delay_ms: 0.0, ..MocapParams::default() };
    /// let mut cameras = component::Harness::<Sensing<MocapParams>>::new(parameters).unwrap();
    /// let state = PlantState { position: [1.0, 2.0, 3.0].into(), ..Default::default() };
    /// let seen = cameras.step(TruthInputs { state: &state }).unwrap().mocap;
    /// assert!((seen.position.y - 2.0).abs() < 0.01, "{seen:?}");
    /// ```
    #[derive(Copy)]
    pub struct MocapParams timed { rate_hz: 100.0, delay_ms: 10.0 } {
        /// Standard deviation of each axis of a position.
        #[parameter(default = 0.5e-3, check = not_negative)]
        pub position_noise_m: f64,
        /// Standard deviation of the rotation about each body axis.
        #[parameter(default = 0.1, check = not_negative)]
        pub attitude_noise_deg: f64,
        /// Constant error of the position, world axes.
        #[parameter(default = [0.0; 3], check = finite)]
        pub position_bias_m: [f64; 3],
        /// Constant error of the attitude: a rotation about the body's axes.
        #[parameter(default = [0.0; 3], check = finite)]
        pub attitude_bias_deg: [f64; 3],
    }
}

sensor! {
    pub struct MocapState as "hummingbus_msgs/msg/MocapState" sends mocap: Mocap {}
}

impl Sensor for MocapParams {
    const INFO: Info =
        Info::new("mocap", "motion capture: position and attitude with noise, delay and drop-outs");
    type Parameters = Self;
    type Inputs<'a> = TruthInputs<'a>;
    type Outputs = Outputs;
    type State = MocapState;

    fn made_of(parameters: Self, _: &InputFiles) -> Result<Self, ParameterError> {
        Ok(parameters)
    }

    fn measure(
        &self,
        _: &mut MocapState,
        _: &Mocap,
        chance: &mut Chance<'_>,
        inputs: TruthInputs<'_>,
    ) -> Option<Mocap> {
        let truth = inputs.state;
        let position_error_W_m =
            Vector3::from(self.position_bias_m) + self.position_noise_m * standard_normal(chance.noise());
        let turn_B_deg =
            Vector3::from(self.attitude_bias_deg) + self.attitude_noise_deg * standard_normal(chance.noise());
        let turn = UnitQuaternion::from_scaled_axis(turn_B_deg.map(f64::to_radians));
        let position = vector_message(vector(truth.position) + position_error_W_m);
        let attitude = attitude_message(attitude(truth.attitude) * turn);
        Some(Mocap { position, attitude, ..Default::default() })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sensing::Sensing;
    use crate::testing::{TICK_NS, harness, refusal, require_normal};
    use component::Harness;
    use component::messages::PlantState;

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
        let mut sensor = harness::<MocapParams>(params, 10);
        (0..count).map(|_| sensor.step(TruthInputs { state: &truth() }).unwrap().mocap).collect()
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
        for axis in 0..3 {
            let errors_m = samples.iter().map(|sample| position_error_m(sample)[axis]);
            require_normal(errors_m, params.position_bias_m[axis], params.position_noise_m);
            let turns_deg = samples.iter().map(|sample| turn_B_deg(sample)[axis]);
            require_normal(turns_deg, params.attitude_bias_deg[axis], params.attitude_noise_deg);
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
    fn a_state_that_is_transferred_goes_on_byte_for_byte() {
        let params = MocapParams { delay_ms: 45.0, dropout: 0.2, ..MocapParams::default() };
        let truth = truth();
        Harness::require_transfer(|| harness::<MocapParams>(params, 1), |_| TruthInputs { state: &truth });
    }

    #[test]
    fn impossible_parameters_are_named_and_unknown_ones_are_refused() {
        let refused = |value| refusal::<MocapParams>(&value);
        assert!(refused(serde_json::json!({ "position_noise_m": -1.0 })).contains("`position_noise_m`"));
        assert!(refused(serde_json::json!({ "rate_hz": 0.0 })).contains("`rate_hz`"));
        assert!(refused(serde_json::json!({ "nose": 0.0 })).contains("`nose`"));
        Harness::<Sensing<MocapParams>>::from_json(&serde_json::json!({})).unwrap();
    }
}
