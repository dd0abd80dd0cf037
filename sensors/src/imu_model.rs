//! The inertial measurement unit: specific force and angular rate in, a noisy reading out.
//!
//! Reading = true quantity + bias + white noise, cut off at the range of the part; see [`crate::noise`]. The
//! axes are those of the body (x forward, y left, z up). The true quantity is that at the centre of mass unless
//! [`crate::imu_part`] changes it.

use crate::channel::Timing;
use crate::noise::{BiasWalk, WhiteNoise};
use crate::wire::vector;
use component::Parameters as _;
use component::messages::Imu;
use component::random::{Stream, stream};
use diagnostics::parameter::{ParameterError, finite, not_negative, positive, within};
use nalgebra::Vector3;

/// Parameters of an IMU; the defaults are an Analog Devices ADIS16448.
///
/// The noise densities and bias walks are those of the ADIS16448 in the EuRoC micro aerial vehicle data set.
/// Source: Burri et al., "The EuRoC micro aerial vehicle datasets", IJRR 2016, file `imu0/sensor.yaml`. No
/// data sheet of a part of this class gives a bias walk. The ranges are the data sheet's (±18 g, ±1000 °/s).
/// The thesis does not name the part on the Hummingbird, so none of these is its own. The initial biases are
/// zero: an autopilot nulls them at rest before take-off. Readings are neither delayed nor lost: the
/// autopilot reads the part over a wire of a few centimetres.
#[derive(Debug, Clone, Copy, PartialEq, component::Parameters)]
#[parameters(default)]
pub struct ImuParams {
    /// White noise of the accelerometer.
    #[parameter(default = 2.0e-3, check = not_negative)]
    pub accelerometer_noise_density_m_s2_sqrt_hz: f64,
    /// Random walk of the accelerometer's bias.
    #[parameter(default = 3.0e-3, check = not_negative)]
    pub accelerometer_bias_walk_m_s3_sqrt_hz: f64,
    /// The accelerometer's bias at the first reading, body axes.
    #[parameter(default = [0.0; 3], check = finite, initial)]
    pub accelerometer_initial_bias_m_s2: [f64; 3],
    /// The accelerometer reads no more than this on any axis.
    #[parameter(default = 18.0 * diagnostics::unit::STANDARD_GRAVITY_M_S2, shown = "176.52 (18 g)", check = positive)]
    pub accelerometer_range_m_s2: f64,
    /// White noise of the gyroscope.
    #[parameter(default = 1.6968e-4, check = not_negative)]
    pub gyroscope_noise_density_rad_s_sqrt_hz: f64,
    /// Random walk of the gyroscope's bias.
    #[parameter(default = 1.9393e-5, check = not_negative)]
    pub gyroscope_bias_walk_rad_s2_sqrt_hz: f64,
    /// The gyroscope's bias at the first reading, body axes.
    #[parameter(default = [0.0; 3], check = finite, initial)]
    pub gyroscope_initial_bias_rad_s: [f64; 3],
    /// The gyroscope reads no more than this on any axis.
    #[parameter(default = 1000.0_f64.to_radians(), shown = "17.453 (1000 °/s)", check = positive)]
    pub gyroscope_range_rad_s: f64,
    /// Position of the part, seen from the centre of mass, body axes: it feels a turn as α × r + ω × (ω × r).
    #[parameter(default = [0.0; 3], check = within(-10.0..=10.0, "-10 to 10 m"))]
    pub position_m: [f64; 3],
    /// Rotation of the part against the body, as a rotation vector.
    #[parameter(default = [0.0; 3], check = within(-180.0..=180.0, "-180 to 180 deg"))]
    pub misalignment_deg: [f64; 3],
    /// Errors of the accelerometer's scale, of each axis.
    #[parameter(default = [0.0; 3], check = within(-0.5..=0.5, "-0.5 to 0.5"))]
    pub accelerometer_scale_error: [f64; 3],
    /// Cross-axis sensitivities of the accelerometer: x of y, x of z, y of x, y of z, z of x, z of y.
    #[parameter(default = [0.0; 6], check = within(-0.5..=0.5, "-0.5 to 0.5"))]
    pub accelerometer_cross_axis: [f64; 6],
    /// Corner frequency of the accelerometer's low pass of first order; 0 where there is none.
    #[parameter(default = 0.0, check = not_negative)]
    pub accelerometer_bandwidth_hz: f64,
    /// The accelerometer reads whole multiples of this; 0 where it resolves all.
    #[parameter(default = 0.0, check = not_negative)]
    pub accelerometer_resolution_m_s2: f64,
    /// Drift of the accelerometer's bias with temperature, of each axis.
    #[parameter(default = [0.0; 3], check = within(-1.0..=1.0, "-1 to 1 m/s^2/K"))]
    pub accelerometer_bias_drift_m_s2_k: [f64; 3],
    /// Amplitude d with which the unbalance of each rotor shakes the part: d Ω² of acceleration, once a turn in the rotors' plane, twice a
    /// turn across it.
    #[parameter(default = 0.0, check = within(0.0..=1e-3, "0 to 1e-3 m"))]
    pub accelerometer_vibration_m: f64,
    /// Errors of the gyroscope's scale, of each axis.
    #[parameter(default = [0.0; 3], check = within(-0.5..=0.5, "-0.5 to 0.5"))]
    pub gyroscope_scale_error: [f64; 3],
    /// Cross-axis sensitivities of the gyroscope, in the order of the accelerometer's.
    #[parameter(default = [0.0; 6], check = within(-0.5..=0.5, "-0.5 to 0.5"))]
    pub gyroscope_cross_axis: [f64; 6],
    /// Corner frequency of the gyroscope's low pass of first order; 0 where there is none.
    #[parameter(default = 0.0, check = not_negative)]
    pub gyroscope_bandwidth_hz: f64,
    /// The gyroscope reads whole multiples of this; 0 where it resolves all.
    #[parameter(default = 0.0, check = not_negative)]
    pub gyroscope_resolution_rad_s: f64,
    /// Drift of the gyroscope's bias with temperature, of each axis.
    #[parameter(default = [0.0; 3], check = within(-0.1..=0.1, "-0.1 to 0.1 rad/s/K"))]
    pub gyroscope_bias_drift_rad_s_k: [f64; 3],
    /// Sensitivity of the gyroscope's axes to the specific force along themselves.
    #[parameter(unit = "rad/s per m/s²", default = [0.0; 3], check = within(-0.1..=0.1, "-0.1 to 0.1 rad/s per m/s^2"))]
    pub gyroscope_g_sensitivity: [f64; 3],
    /// Angle φ by which the unbalance of each rotor shakes the part: a rate of φ Ω, in the same rhythm.
    #[parameter(default = 0.0, check = within(0.0..=0.01, "0 to 0.01 rad"))]
    pub gyroscope_vibration_rad: f64,
    /// Rise of the part's temperature after it is switched on, at tick 0.
    #[parameter(default = 0.0, check = within(-100.0..=100.0, "-100 to 100 K"))]
    pub warming_k: f64,
    /// The time constant of its warming up.
    #[parameter(default = 300.0, check = positive)]
    pub warming_time_s: f64,
    /// Time from a reading to its arrival; at most 30 periods.
    #[parameter(default = 0.0, check = not_negative)]
    pub delay_ms: f64,
    /// Fraction of the readings that are lost: the one before is sent again.
    #[parameter(default = 0.0, range = "0 to below 1", check = crate::channel::fraction_lost)]
    pub dropout: f64,
    /// Mean duration of losses; 0: each is independent of the one before.
    #[parameter(default = 0.0, check = not_negative)]
    pub dropout_mean_s: f64,
}

impl ImuParams {
    /// Returns the timing and the losses of readings, `rate_hz` of which are made in a second.
    pub(crate) fn timing(&self, rate_hz: f64) -> Timing {
        let Self { delay_ms, dropout, dropout_mean_s, .. } = *self;
        Timing { rate_hz, delay_ms, dropout, dropout_mean_s }
    }

    /// The default part without noise, bias walk or initial bias: within its range it reads the truth.
    #[must_use]
    pub fn perfect() -> Self {
        Self {
            accelerometer_noise_density_m_s2_sqrt_hz: 0.0,
            accelerometer_bias_walk_m_s3_sqrt_hz: 0.0,
            gyroscope_noise_density_rad_s_sqrt_hz: 0.0,
            gyroscope_bias_walk_rad_s2_sqrt_hz: 0.0,
            ..Self::default()
        }
    }
}

/// One sample of an IMU, or the truth that it measures; vectors in body axes.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct ImuReading {
    /// Acceleration less gravity, m/s²; at rest and level it is +g along z.
    pub specific_force_B_m_s2: Vector3<f64>,
    /// Angular rate of the body against the world, rad/s.
    pub angular_velocity_B_rad_s: Vector3<f64>,
}

impl From<&Imu> for ImuReading {
    fn from(imu: &Imu) -> Self {
        Self {
            specific_force_B_m_s2: vector(imu.specific_force),
            angular_velocity_B_rad_s: vector(imu.angular_velocity),
        }
    }
}

/// The IMU at one sample rate, with everything that does not change during a run.
///
/// ```
/// use nalgebra::Vector3;
/// use sensors::imu_model::{ImuModel, ImuParams, ImuReading};
///
/// let model = ImuModel::new(ImuParams::perfect(), 1000.0).unwrap();
/// let mut state = model.initial_state(1, "imu");
/// let truth = ImuReading {
///     specific_force_B_m_s2: Vector3::new(0.0, 0.0, 9.81),
///     angular_velocity_B_rad_s: Vector3::new(100.0, 0.0, 0.0),
/// };
/// let reading = model.read(&mut state, &truth);
/// assert_eq!(reading.specific_force_B_m_s2, truth.specific_force_B_m_s2);
/// assert!((reading.angular_velocity_B_rad_s.x - 1000.0_f64.to_radians()).abs() < 1e-9, "cut off at its range");
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ImuModel {
    params: ImuParams,
    accelerometer_noise: WhiteNoise,
    accelerometer_walk: BiasWalk,
    gyroscope_noise: WhiteNoise,
    gyroscope_walk: BiasWalk,
}

/// Variable part of the model: the biases as they have walked, and the node's random stream.
#[derive(Debug, Clone)]
pub struct ImuModelState {
    /// The accelerometer's bias at the next reading, body axes, m/s².
    pub accelerometer_bias_B_m_s2: Vector3<f64>,
    /// The gyroscope's bias at the next reading, body axes, rad/s.
    pub gyroscope_bias_B_rad_s: Vector3<f64>,
    /// The node's random stream.
    pub(crate) random: Stream,
}

impl ImuModel {
    /// An IMU with `params` that is sampled `rate_hz` times a second (the node's own rate, that is the
    /// tick rate divided by its period).
    ///
    /// # Errors
    /// A parameter or the rate is outside its range.
    pub fn new(params: ImuParams, rate_hz: f64) -> Result<Self, ParameterError> {
        params.validate()?;
        positive("rate_hz", rate_hz)?;
        Ok(Self {
            params,
            accelerometer_noise: WhiteNoise::new(params.accelerometer_noise_density_m_s2_sqrt_hz, rate_hz),
            accelerometer_walk: BiasWalk::new(params.accelerometer_bias_walk_m_s3_sqrt_hz, rate_hz),
            gyroscope_noise: WhiteNoise::new(params.gyroscope_noise_density_rad_s_sqrt_hz, rate_hz),
            gyroscope_walk: BiasWalk::new(params.gyroscope_bias_walk_rad_s2_sqrt_hz, rate_hz),
        })
    }

    /// The state before the first reading of the IMU node `node` in a run seeded with `run_seed`.
    #[must_use]
    pub fn initial_state(&self, run_seed: u64, node: &str) -> ImuModelState {
        ImuModelState {
            accelerometer_bias_B_m_s2: self.params.accelerometer_initial_bias_m_s2.into(),
            gyroscope_bias_B_rad_s: self.params.gyroscope_initial_bias_rad_s.into(),
            random: stream(run_seed, node),
        }
    }

    /// Variances of the white noise on each axis: of the gyroscope, rad²/s², and of the accelerometer, m²/s⁴.
    pub(crate) fn variances(&self) -> (f64, f64) {
        (self.gyroscope_noise.variance(), self.accelerometer_noise.variance())
    }

    /// The reading of `truth`; the biases then walk one step on.
    ///
    /// The stream is drawn in a fixed order under any parameters, so that changing one of them does
    /// not reshuffle the noise of the others.
    pub fn read(&self, state: &mut ImuModelState, truth: &ImuReading) -> ImuReading {
        let random = &mut state.random;
        let force_noise = self.accelerometer_noise.sample(random);
        let rate_noise = self.gyroscope_noise.sample(random);
        let force = truth.specific_force_B_m_s2 + state.accelerometer_bias_B_m_s2 + force_noise;
        let rate = truth.angular_velocity_B_rad_s + state.gyroscope_bias_B_rad_s + rate_noise;
        state.accelerometer_bias_B_m_s2 =
            self.accelerometer_walk.step(state.accelerometer_bias_B_m_s2, random);
        state.gyroscope_bias_B_rad_s = self.gyroscope_walk.step(state.gyroscope_bias_B_rad_s, random);
        ImuReading {
            specific_force_B_m_s2: saturate(force, self.params.accelerometer_range_m_s2),
            angular_velocity_B_rad_s: saturate(rate, self.params.gyroscope_range_rad_s),
        }
    }
}

fn saturate(value: Vector3<f64>, range: f64) -> Vector3<f64> {
    value.map(|axis| axis.clamp(-range, range))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::noise::{drawn, drawn_words};

    const RATE_HZ: f64 = 1000.0;

    fn truth() -> ImuReading {
        ImuReading {
            specific_force_B_m_s2: Vector3::new(0.3, -0.2, 9.81),
            angular_velocity_B_rad_s: Vector3::new(0.1, -0.7, 0.02),
        }
    }

    fn readings(params: ImuParams, node: &str, count: usize) -> Vec<ImuReading> {
        let model = ImuModel::new(params, RATE_HZ).unwrap();
        let mut state = model.initial_state(7, node);
        (0..count).map(|_| model.read(&mut state, &truth())).collect()
    }

    #[test]
    fn without_noise_the_truth_passes_bit_for_bit() {
        assert!(readings(ImuParams::perfect(), "imu", 100).iter().all(|reading| *reading == truth()));
    }

    #[test]
    fn the_noise_on_either_part_has_its_own_density() {
        let walk_free = ImuParams {
            accelerometer_bias_walk_m_s3_sqrt_hz: 0.0,
            gyroscope_bias_walk_rad_s2_sqrt_hz: 0.0,
            ..ImuParams::default()
        };
        let readings = readings(walk_free, "imu", 20_000);
        let mean_square = |error: fn(&ImuReading) -> Vector3<f64>| {
            readings.iter().map(|reading| error(reading).norm_squared()).sum::<f64>()
                / (3 * readings.len()) as f64
        };
        let force = mean_square(|r| r.specific_force_B_m_s2 - truth().specific_force_B_m_s2);
        let rate = mean_square(|r| r.angular_velocity_B_rad_s - truth().angular_velocity_B_rad_s);
        let bound = 6.0 * (2.0 / (3.0 * 20_000.0_f64)).sqrt();
        assert!((force / (2.0e-3_f64.powi(2) * RATE_HZ) - 1.0).abs() < bound);
        assert!((rate / (1.6968e-4_f64.powi(2) * RATE_HZ) - 1.0).abs() < bound);
    }

    /// With the walk alone, the Allan variance at averaging time τ is walk²·τ/3 (IEEE Std 952, annex C):
    /// a line that white noise, whose Allan variance falls with τ, cannot give.
    #[test]
    fn the_bias_walk_has_the_allan_variance_of_a_random_walk() {
        let walk = 0.02;
        let params = ImuParams { gyroscope_bias_walk_rad_s2_sqrt_hz: walk, ..ImuParams::perfect() };
        let readings = readings(params, "imu", 400_000);
        for tau_ticks in [50, 200] {
            let means: Vec<Vector3<f64>> = readings
                .chunks_exact(tau_ticks)
                .map(|c| {
                    c.iter().map(|r| r.angular_velocity_B_rad_s).sum::<Vector3<f64>>() / tau_ticks as f64
                })
                .collect();
            let pairs = (means.len() - 1) as f64;
            let sum: f64 = means.windows(2).map(|pair| (pair[1] - pair[0]).norm_squared()).sum();
            let ratio = sum / 3.0 / pairs / 2.0 / (walk * walk * tau_ticks as f64 / RATE_HZ / 3.0);
            assert!(
                (ratio - 1.0).abs() < 0.12,
                "{ratio} of the expected Allan variance at {tau_ticks} ticks"
            );
        }
    }

    #[test]
    fn initial_biases_are_added_and_the_range_cuts() {
        let params = ImuParams {
            accelerometer_initial_bias_m_s2: [0.1, 0.0, 0.0],
            accelerometer_range_m_s2: 5.0,
            gyroscope_initial_bias_rad_s: [0.0, 0.0, 0.03],
            gyroscope_range_rad_s: 0.5,
            ..ImuParams::perfect()
        };
        let reading = readings(params, "imu", 1)[0];
        assert_eq!(reading.specific_force_B_m_s2, Vector3::new(0.3 + 0.1, -0.2, 5.0));
        assert_eq!(reading.angular_velocity_B_rad_s, Vector3::new(0.1, -0.5, 0.02 + 0.03));
    }

    #[test]
    fn a_state_that_is_restored_goes_on_as_the_one_it_was_taken_from() {
        let model = ImuModel::new(ImuParams::default(), RATE_HZ).unwrap();
        let mut first = model.initial_state(7, "imu");
        for _ in 0..17 {
            model.read(&mut first, &truth());
        }
        let mut second = model.initial_state(7, "imu");
        second.accelerometer_bias_B_m_s2 = first.accelerometer_bias_B_m_s2;
        second.gyroscope_bias_B_rad_s = first.gyroscope_bias_B_rad_s;
        second.random = drawn(&second.random, drawn_words(&first.random));
        for _ in 0..100 {
            assert_eq!(model.read(&mut first, &truth()), model.read(&mut second, &truth()));
        }
    }

    #[test]
    fn a_reading_is_a_function_of_seed_and_name() {
        let first = readings(ImuParams::default(), "imu", 10);
        assert_eq!(first, readings(ImuParams::default(), "imu", 10));
        let other = readings(ImuParams::default(), "imu_spare", 10);
        assert!(
            first.iter().zip(&other).all(|(a, b)| a.angular_velocity_B_rad_s != b.angular_velocity_B_rad_s)
        );
    }

    #[test]
    fn parameters_default_by_key_and_unknown_keys_are_refused() {
        let given: ImuParams = toml::from_str("gyroscope_noise_density_rad_s_sqrt_hz = 0.001").unwrap();
        let expected = ImuParams { gyroscope_noise_density_rad_s_sqrt_hz: 0.001, ..ImuParams::default() };
        assert_eq!(given, expected);
        let error = toml::from_str::<ImuParams>("gyro_noise = 0.1").unwrap_err().to_string();
        assert!(error.contains("gyro_noise"), "{error}");
    }

    #[test]
    fn impossible_parameters_are_named() {
        let params = ImuParams { gyroscope_range_rad_s: 0.0, ..ImuParams::default() };
        let error = ImuModel::new(params, RATE_HZ).unwrap_err().to_string();
        assert!(error.contains("gyroscope_range_rad_s") && error.contains("found 0"), "{error}");
    }
}
