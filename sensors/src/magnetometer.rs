//! The magnetometer node: the earth's magnetic field in body axes, as the vehicle's own iron lets it through.
//!
//! Reading = soft-iron scale · field in body axes + hard iron + white noise, in steps of the part's resolution and
//! cut off at its range. `crate::channel` gives the times, delays and losses of measurements.

use crate::channel::Chance;
use crate::earth_field;
use crate::noise::standard_normal;
use crate::sensing::{Sensor, TruthInputs};
use crate::steps::in_steps;
use crate::wire::{attitude, vector_message};
use component::Info;
use component::messages::Magnetometer;
use diagnostics::parameter::{ParameterError, finite, not_negative, positive, within};
use inputs::InputFiles;
use nalgebra::Vector3;

timed_parameters! {
    /// Parameters of a magnetometer; the defaults are a Honeywell HMC5883L.
    ///
    /// Its data sheet (900405): noise floor 2 mG, 1090 counts per gauss in its default range of ±1.3 gauss, up to
    /// 160 Hz in single measurements of 6 ms each. The default field is that of Krailling near Munich.
    ///
    /// ```
    /// use component::messages::PlantState;
    /// use sensors::magnetometer::MagnetometerParams;
    /// use sensors::sensing::{Sensing, TruthInputs};
    ///
    /// let parameters = MagnetometerParams { delay_ms: 0.0, noise_T: 0.0, ..MagnetometerParams::default() };
    /// let mut magnetometer = component::Harness::<Sensing<MagnetometerParams>>::new(parameters).unwrap();
    /// let level = PlantState::default();
    /// let field = magnetometer.step(TruthInputs { state: &level }).unwrap().magnetometer.field;
    /// assert!(field.x > 0.0 && field.z < 0.0, "in Europe it points north and down: {field:?}");
    /// ```
    #[derive(Copy)]
    pub struct MagnetometerParams timed { rate_hz: 100.0, delay_ms: 6.0 } {
        /// Magnetic flux density of the earth's field.
        #[parameter(default = earth_field::FIELD_T, check = not_negative)]
        pub field_T: f64,
        /// Inclination of the earth's field, below the horizon.
        #[parameter(default = earth_field::INCLINATION_DEG, check = within(-90.0..=90.0, "from -90 to 90"))]
        pub inclination_deg: f64,
        /// Declination: angle of magnetic north east of the world's x axis.
        #[parameter(default = earth_field::DECLINATION_DEG, check = finite)]
        pub declination_deg: f64,
        /// Field of the vehicle's magnetised parts, body axes.
        #[parameter(default = [0.0; 3], check = finite)]
        pub hard_iron_T: [f64; 3],
        /// Share of the field that is left along each body axis.
        #[parameter(default = [1.0; 3], check = finite)]
        pub soft_iron_scale: [f64; 3],
        /// Standard deviation of each axis.
        #[parameter(default = 2.0e-7, check = not_negative)]
        pub noise_T: f64,
        /// Readings are multiples of this; 0 for any reading.
        #[parameter(default = 1e-4 / 1090.0, check = not_negative)]
        pub resolution_T: f64,
        /// The most that an axis reads.
        #[parameter(default = 1.3e-4, check = positive)]
        pub range_T: f64,
    }
}

sensor! {
    pub struct MagnetometerState as "hummingbus_msgs/msg/MagnetometerState" sends magnetometer: Magnetometer {}
}

impl Sensor for MagnetometerParams {
    const INFO: Info =
        Info::new("magnetometer", "the earth's magnetic field with hard and soft iron, noise and delay");
    type Parameters = Self;
    type Inputs<'a> = TruthInputs<'a>;
    type Outputs = Outputs;
    type State = MagnetometerState;

    fn made_of(parameters: Self, _: &InputFiles) -> Result<Self, ParameterError> {
        Ok(parameters)
    }

    fn measure(
        &self,
        _: &mut MagnetometerState,
        _: &Magnetometer,
        chance: &mut Chance<'_>,
        inputs: TruthInputs<'_>,
    ) -> Option<Magnetometer> {
        let field_W_T = earth_field::vector_W_T(self.field_T, self.inclination_deg, self.declination_deg);
        let field_B_T = attitude(inputs.state.attitude).inverse_transform_vector(&field_W_T);
        let through_B_T = field_B_T.component_mul(&Vector3::from(self.soft_iron_scale));
        let noise_B_T = self.noise_T * standard_normal(chance.noise());
        let read_B_T = through_B_T + Vector3::from(self.hard_iron_T) + noise_B_T;
        let cut = |axis_T| in_steps(axis_T, self.resolution_T).clamp(-self.range_T, self.range_T);
        Some(Magnetometer { field: vector_message(read_B_T.map(cut)), ..Default::default() })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{harness, refusal, require_normal};
    use crate::wire::{attitude_message, vector};
    use component::Harness;
    use component::messages::PlantState;
    use nalgebra::UnitQuaternion;

    fn perfect() -> MagnetometerParams {
        MagnetometerParams { delay_ms: 0.0, noise_T: 0.0, resolution_T: 0.0, ..Default::default() }
    }

    fn turned(roll_deg: f64, pitch_deg: f64, yaw_deg: f64) -> PlantState {
        let [roll, pitch, yaw] = [roll_deg, pitch_deg, yaw_deg].map(f64::to_radians);
        let attitude = attitude_message(UnitQuaternion::from_euler_angles(roll, pitch, yaw));
        PlantState { attitude, ..Default::default() }
    }

    fn samples(params: &MagnetometerParams, truth: &PlantState, count: u64) -> Vec<Magnetometer> {
        let mut sensor = harness::<MagnetometerParams>(*params, 10);
        (0..count).map(|_| sensor.step(TruthInputs { state: truth }).unwrap().magnetometer).collect()
    }

    fn read(params: &MagnetometerParams, truth: &PlantState) -> Vector3<f64> {
        vector(samples(params, truth, 1)[0].field)
    }

    #[test]
    fn the_heading_of_the_level_field_is_the_yaw_less_the_declination_backwards() {
        for declination_deg in [-20.0, 0.0, 4.11] {
            let params = MagnetometerParams { declination_deg, ..perfect() };
            for yaw_deg in [-170.0, -30.0, 0.0, 45.0, 120.0] {
                // The needle points to -declination in the world, from which the body has turned by its yaw.
                let field_B_T = read(&params, &turned(0.0, 0.0, yaw_deg));
                let needle_deg = libm::atan2(field_B_T.y, field_B_T.x).to_degrees();
                let error_deg = (needle_deg + declination_deg + yaw_deg).rem_euclid(360.0);
                assert!(error_deg.min(360.0 - error_deg) < 1e-9, "{error_deg} at {yaw_deg}");
            }
        }
    }

    #[test]
    fn the_field_keeps_its_size_at_any_attitude() {
        for (roll_deg, pitch_deg) in [(0.0, 0.0), (30.0, -20.0), (180.0, 0.0), (0.0, 90.0)] {
            let size_T = read(&perfect(), &turned(roll_deg, pitch_deg, 70.0)).norm();
            assert!((size_T - perfect().field_T).abs() < 1e-15, "{size_T}");
        }
        // Nose down by 90°, body x points down, as most of the field does.
        assert!(read(&perfect(), &turned(0.0, 90.0, 0.0)).x > 4.0e-5);
    }

    #[test]
    fn hard_iron_is_added_in_body_axes_and_soft_iron_scales_them() {
        let truth = turned(10.0, 20.0, 30.0);
        let plain = read(&perfect(), &truth);
        let (hard_iron_T, soft_iron_scale) = ([1e-5, -2e-5, 3e-6], [0.9, 1.1, 1.0]);
        let found = read(&MagnetometerParams { hard_iron_T, soft_iron_scale, ..perfect() }, &truth);
        let expected = plain.component_mul(&Vector3::from(soft_iron_scale)) + Vector3::from(hard_iron_T);
        assert_eq!(found, expected);
    }

    #[test]
    fn each_axis_has_the_noise_of_the_parameters() {
        let (truth, params) = (turned(0.0, 0.0, 40.0), MagnetometerParams { noise_T: 2.0e-7, ..perfect() });
        let (samples, expected) = (samples(&params, &truth, 10_000), read(&perfect(), &truth));
        for axis in 0..3 {
            let values = samples.iter().map(|sample| vector(sample.field)[axis]);
            require_normal(values, expected[axis], 2.0e-7);
        }
    }

    #[test]
    fn readings_are_counts_of_the_part_within_its_range() {
        let truth = turned(0.0, 0.0, 40.0);
        let params =
            MagnetometerParams { delay_ms: 0.0, hard_iron_T: [2e-4, 0.0, 0.0], ..Default::default() };
        for sample in samples(&params, &truth, 100) {
            let counts = sample.field.y / params.resolution_T;
            assert!((counts - counts.round()).abs() < 1e-6, "{counts}");
            assert_eq!(sample.field.x, params.range_T);
        }
    }

    #[test]
    fn a_state_that_is_transferred_goes_on_byte_for_byte() {
        let params = MagnetometerParams { dropout: 0.2, delay_ms: 45.0, ..Default::default() };
        let truths: Vec<_> = (0..2000).map(|tick| turned(1.0, 2.0, f64::from(tick) * 0.1)).collect();
        let inputs = |tick| TruthInputs { state: &truths[tick as usize] };
        Harness::require_transfer(|| harness::<MagnetometerParams>(params, 1), inputs);
    }

    #[test]
    fn impossible_parameters_are_named() {
        let bad = [("field_T", -1.0), ("inclination_deg", 91.0), ("noise_T", -1.0), ("range_T", 0.0)];
        for (key, value) in bad {
            let reason = refusal::<MagnetometerParams>(&serde_json::json!({ key: value }));
            assert!(reason.contains(&format!("`{key}`")), "{reason}");
        }
    }
}
