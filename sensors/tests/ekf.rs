//! The extended Kalman filter against known flights: its covariance must agree with its errors.
//!
//! Two figures are chi-square where a filter is consistent (Bar-Shalom, Li and Kirubarajan, "Estimation with
//! Applications to Tracking and Navigation", 2001, §5.4): the normalised innovation squared (NIS) of a sensor, summed
//! over a run, and the normalised error squared (NEES) of the state, summed over independent runs.
#![allow(
    non_snake_case,
    reason = "a trailing _W or _B names the frame a vector is written in, _WB a rotation between the two"
)]

mod support;

use component::random::{Stream, normal, stream};
use nalgebra::{SVector, UnitQuaternion, Vector3};
use sensors::ekf::filter::{Ekf, EkfState, deviation};
use sensors::ekf::history::{Measurement, Newest, Reading, Source};
use sensors::ekf::params::EkfParams;
use sensors::imu_model::{ImuModel, ImuModelState, ImuParams, ImuReading};
use std::collections::VecDeque;
use std::f64::consts::TAU;
use support::{PERIOD_NS, PERIOD_S, Truth, fly};

/// The errors that are judged: position, velocity, attitude, gyroscope bias, accelerometer bias.
const JUDGED: usize = 15;
const SEEDS: std::ops::Range<u64> = 0..20;
const SECONDS: usize = 30;
/// Two-sided 95 % bounds of a standard normal.
const BOUND: f64 = 1.96;

/// Every axis turned and pushed, at periods that share no multiple within the flight.
fn excited(time_s: f64) -> [f64; 4] {
    let swing = |amplitude: f64, period_s: f64| amplitude * libm::sin(TAU * time_s / period_s);
    [swing(0.3, 2.7), swing(0.25, 3.4), swing(1.2, 11.0), swing(1.0, 2.1)]
}

/// When a sensor measures, and how late that arrives, in samples.
#[derive(Clone, Copy)]
struct Timing {
    sensor: Source,
    period: usize,
    delay: usize,
}

const GPS: Timing = Timing { sensor: Source::Gps, period: 100, delay: 80 };
const MOCAP: Timing = Timing { sensor: Source::Mocap, period: 10, delay: 10 };
const BAROMETER: Timing = Timing { sensor: Source::Barometer, period: 20, delay: 16 };
const MAGNETOMETER: Timing = Timing { sensor: Source::Magnetometer, period: 10, delay: 6 };

/// The sensors of a flight, with the uncertainties of `params`.
struct World {
    params: EkfParams,
    imu: ImuModel,
    imu_state: ImuModelState,
    random: Stream,
    gps_drift_W_m: Vector3<f64>,
    barometer_bias_m: f64,
}

impl World {
    fn new(params: EkfParams, seed: u64) -> Self {
        let mut random = stream(seed, "world");
        let force = params.initial_accelerometer_bias_sigma_m_s2 * normal3(&mut random);
        let rate = params.initial_gyroscope_bias_sigma_rad_s * normal3(&mut random);
        let imu = ImuParams {
            accelerometer_initial_bias_m_s2: force.into(),
            gyroscope_initial_bias_rad_s: rate.into(),
            ..ImuParams::default()
        };
        let imu = ImuModel::new(imu, 1.0 / PERIOD_S).unwrap();
        let imu_state = imu.initial_state(seed, "imu");
        let gps_drift_W_m = Vector3::from(params.gps_position_drift_m).component_mul(&normal3(&mut random));
        let barometer_bias_m = params.barometer_initial_bias_sigma_m * normal(&mut random);
        Self { params, imu, imu_state, random, gps_drift_W_m, barometer_bias_m }
    }

    /// GPS drift and barometer bias, one period on.
    fn wander(&mut self) {
        let fade = libm::exp(-PERIOD_S / self.params.gps_position_drift_time_s);
        let step = Vector3::from(self.params.gps_position_drift_m) * (1.0 - fade * fade).sqrt();
        self.gps_drift_W_m = fade * self.gps_drift_W_m + step.component_mul(&normal3(&mut self.random));
        let walk = self.params.barometer_bias_walk_m_sqrt_s * PERIOD_S.sqrt();
        self.barometer_bias_m += walk * normal(&mut self.random);
    }

    fn measure(&mut self, sensor: Source, truth: &Truth, now_ns: u64) -> Measurement {
        let values = match sensor {
            Source::Gps => self.gps(truth),
            Source::Mocap => self.mocap(truth),
            Source::Barometer => vec![self.barometer(truth)],
            Source::Magnetometer => self.magnetometer(truth),
        };
        Measurement::new(sensor, now_ns, &values)
    }

    fn gps(&mut self, truth: &Truth) -> Vec<f64> {
        let noise =
            |sigma: [f64; 3], random: &mut Stream| Vector3::from(sigma).component_mul(&normal3(random));
        let error_m = self.gps_drift_W_m + noise(self.params.gps_position_noise_m, &mut self.random);
        let error_m_s = noise(self.params.gps_velocity_noise_m_s, &mut self.random);
        let (position, velocity) = (truth.position_W_m + error_m, truth.velocity_W_m_s + error_m_s);
        position.iter().chain(velocity.iter()).copied().collect()
    }

    fn mocap(&mut self, truth: &Truth) -> Vec<f64> {
        let position = truth.position_W_m + self.params.mocap_position_noise_m * normal3(&mut self.random);
        let turn_B = self.params.mocap_attitude_noise_deg.to_radians() * normal3(&mut self.random);
        let attitude = truth.attitude_WB * UnitQuaternion::from_scaled_axis(turn_B);
        position.iter().chain(attitude.coords.iter()).copied().collect()
    }

    fn barometer(&mut self, truth: &Truth) -> f64 {
        let error_m = self.barometer_bias_m + self.params.barometer_noise_m * normal(&mut self.random);
        truth.position_W_m.z + error_m
    }

    fn magnetometer(&mut self, truth: &Truth) -> Vec<f64> {
        let field_B = truth.attitude_WB.inverse() * self.params.field_W_T();
        let field_B = field_B + self.params.magnetometer_noise_T * normal3(&mut self.random);
        field_B.iter().copied().collect()
    }
}

fn normal3(random: &mut Stream) -> Vector3<f64> {
    Vector3::from([(); 3].map(|()| normal(random)))
}

/// One sample of a run.
struct Sample<'a> {
    number: usize,
    truth: &'a Truth,
    biases: (Vector3<f64>, Vector3<f64>),
    filter: &'a Ekf,
    state: &'a EkfState,
}

/// Flies a filter with `believed` parameters in a world of `true_params`; `judge` sees every sample.
fn run(
    flight: &[Truth],
    timings: &[Timing],
    params: (EkfParams, EkfParams),
    seed: u64,
    mut judge: impl FnMut(&Sample<'_>),
) {
    run_with(flight, timings, params, seed, |_, measured| Some(measured), &mut judge);
}

/// The same, with measurements that pass through `spoil` on their way.
fn run_with(
    flight: &[Truth],
    timings: &[Timing],
    (true_params, believed): (EkfParams, EkfParams),
    seed: u64,
    spoil: impl Fn(usize, Measurement) -> Option<Measurement>,
    judge: &mut impl FnMut(&Sample<'_>),
) {
    let mut world = World::new(true_params, seed);
    let filter = Ekf::with_period(believed, PERIOD_S).unwrap();
    let mut state = filter.initial_state();
    let mut newest: Newest = [None; 4];
    timings.iter().for_each(|timing| newest[timing.sensor.index()] = Some(None));
    let mut under_way: VecDeque<(usize, Measurement)> = VecDeque::new();
    for (number, truth) in flight.iter().enumerate() {
        let now_ns = number as u64 * PERIOD_NS;
        for timing in timings.iter().filter(|timing| number % timing.period == 0) {
            let measured = spoil(number, world.measure(timing.sensor, truth, now_ns));
            under_way.extend(measured.map(|measured| (number + timing.delay, measured)));
        }
        for (_, arrived) in under_way.iter().filter(|(arrives, _)| *arrives == number) {
            newest[arrived.sensor().index()] = Some(Some(*arrived));
        }
        under_way.retain(|(arrives, _)| *arrives > number);
        let biases = (world.imu_state.gyroscope_bias_B_rad_s, world.imu_state.accelerometer_bias_B_m_s2);
        let read = world.imu.read(&mut world.imu_state, &truth.felt);
        filter.update_to(&mut state, &reading(&read, now_ns), &newest);
        world.wander();
        judge(&Sample { number, truth, biases, filter: &filter, state: &state });
    }
}

fn reading(read: &ImuReading, time_ns: u64) -> Reading {
    let specific_force = <[f64; 3]>::from(read.specific_force_B_m_s2).into();
    let angular_velocity = <[f64; 3]>::from(read.angular_velocity_B_rad_s).into();
    Reading { time_ns, specific_force, angular_velocity }
}

fn errors(sample: &Sample<'_>) -> SVector<f64, JUDGED> {
    let motion = sample.state.motion();
    let vector = |v: component::messages::Vector3| Vector3::from(<[f64; 3]>::from(v));
    let q = motion.attitude;
    let attitude = UnitQuaternion::from_quaternion(nalgebra::Quaternion::new(q.w, q.x, q.y, q.z));
    let turn_W = (sample.truth.attitude_WB * attitude.inverse()).scaled_axis();
    let parts = [
        sample.truth.position_W_m - vector(motion.position),
        sample.truth.velocity_W_m_s - vector(motion.velocity),
        turn_W,
        sample.biases.0 - vector(motion.gyroscope_bias),
        sample.biases.1 - vector(motion.accelerometer_bias),
    ];
    SVector::from_iterator(parts.iter().flat_map(|part| part.iter().copied()))
}

fn nees(sample: &Sample<'_>) -> f64 {
    let errors = errors(sample);
    let covariance = sample.filter.covariance(sample.state).fixed_view::<JUDGED, JUDGED>(0, 0).into_owned();
    errors.dot(&covariance.cholesky().expect("a covariance is positive").solve(&errors))
}

/// Consistency of the filter over all seeds.
struct Consistency {
    /// By sensor: how many runs had their summed NIS within its 95 % bounds.
    runs_within: [usize; 4],
    /// By sensor: mean NIS for each degree of freedom, which should be 1.
    nis: [f64; 4],
    /// At each second, NEES summed over the runs, in standard deviations from its expected value.
    nees_deviations: Vec<f64>,
    /// Mean NEES for each degree of freedom, which should be 1.
    nees: f64,
    /// RMS over runs and time from 10 s on, and the last second's standard deviations: position, velocity, attitude.
    rms: [f64; 3],
    refused: u32,
}

const DEGREES: [usize; 4] = [6, 6, 1, 3];

fn consistency(timings: &[Timing], true_params: EkfParams, believed: EkfParams) -> Consistency {
    let flight = fly(excited, [0.0, 0.0, 5.0], SECONDS * 1000);
    let mut nees_sums = vec![0.0; SECONDS];
    let (mut runs_within, mut nis, mut counts) = ([0; 4], [0.0; 4], [0; 4]);
    let (mut squares, mut squares_count, mut refused) = ([0.0; 3], 0, 0);
    for seed in SEEDS {
        let (mut sums, mut last) = ([0.0; 4], [0; 4]);
        run(&flight, timings, (true_params, believed), seed, |sample| {
            // Several updates of one sensor at one sample show only the last: count those.
            for sensor in 0..4 {
                if sample.state.kept.updates[sensor] + sample.state.kept.refused[sensor] != last[sensor] {
                    sums[sensor] += sample.state.kept.normalised_squared[sensor];
                    counts[sensor] += 1;
                }
                last[sensor] = sample.state.kept.updates[sensor] + sample.state.kept.refused[sensor];
            }
            if sample.number % 1000 == 999 {
                nees_sums[sample.number / 1000] += nees(sample);
            }
            if sample.number >= 10_000 {
                let errors = errors(sample);
                (0..3).for_each(|part| squares[part] += errors.fixed_rows::<3>(3 * part).norm_squared());
                squares_count += 1;
            }
            if sample.number == flight.len() - 1 {
                refused += sample.state.kept.refused.iter().sum::<u32>();
            }
        });
        let seeds_done = (seed - SEEDS.start + 1) as usize;
        for timing in timings {
            let sensor = timing.sensor.index();
            let degrees = DEGREES[sensor] * counts[sensor] / seeds_done;
            runs_within[sensor] += usize::from(deviation(sums[sensor], degrees).abs() <= BOUND);
            nis[sensor] += sums[sensor];
        }
    }
    let degrees = SEEDS.count() * JUDGED;
    (0..4).for_each(|sensor| nis[sensor] /= (DEGREES[sensor] * counts[sensor].max(1)) as f64);
    Consistency {
        runs_within,
        nis,
        nees: nees_sums.iter().sum::<f64>() / (degrees * SECONDS) as f64,
        nees_deviations: nees_sums.iter().map(|sum| deviation(*sum, degrees)).collect(),
        rms: squares.map(|sum| (sum / f64::from(squares_count)).sqrt()),
        refused,
    }
}

impl Consistency {
    /// True if the innovations and the errors are as large as the filter believes. Of 20 runs 19 are within their
    /// 95 % bounds on average, and 16 or fewer once in 60 times; of the seconds, which are not independent, three
    /// in four must be.
    fn holds(&self, timings: &[Timing]) -> bool {
        let of_sensor = |timing: &Timing| self.runs_within[timing.sensor.index()] >= 17;
        let within = self.nees_deviations.iter().filter(|deviation| deviation.abs() <= BOUND).count();
        // As if the seconds of a run were one and the same: the mean of independent ones is nearer.
        let degrees = SEEDS.count() * JUDGED;
        let mean = deviation(self.nees * degrees as f64, degrees);
        timings.iter().all(of_sensor) && 4 * within >= 3 * SECONDS && mean.abs() <= BOUND
    }
}

impl std::fmt::Display for Consistency {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        writeln!(f, "NIS a degree {:.3?}, runs within bounds {:?}", self.nis, self.runs_within)?;
        writeln!(f, "NEES a degree {:.3}, deviations {:.1?}", self.nees, self.nees_deviations)?;
        write!(f, "RMS {:.5?} (m, m/s, rad), refused {}", self.rms, self.refused)
    }
}

const OUTDOORS: [Timing; 3] = [GPS, BAROMETER, MAGNETOMETER];

#[test]
fn with_motion_capture_errors_and_innovations_are_as_large_as_believed() {
    let found = consistency(&[MOCAP], EkfParams::default(), EkfParams::default());
    println!("motion capture: {found}");
    assert!(found.holds(&[MOCAP]) && found.refused == 0, "{found}");
    let [position_m, velocity_m_s, attitude_rad] = found.rms;
    assert!(position_m < 0.5e-3 && velocity_m_s < 3e-3 && attitude_rad < 0.5e-3, "{found}");
}

#[test]
fn with_gps_barometer_and_magnetometer_errors_and_innovations_are_as_large_as_believed() {
    let found = consistency(&OUTDOORS, EkfParams::default(), EkfParams::default());
    println!("GPS, barometer and magnetometer: {found}");
    assert!(found.holds(&OUTDOORS), "{found}");
    let [_, velocity_m_s, attitude_rad] = found.rms;
    assert!(velocity_m_s < 0.04 && attitude_rad < 3e-3, "{found}");
}

#[test]
fn measurements_that_are_200_ms_late_are_as_consistent_as_prompt_ones() {
    let late = [Timing { delay: 200, ..MOCAP }];
    let found = consistency(&late, EkfParams::default(), EkfParams::default());
    println!("late motion capture: {found}");
    assert!(found.holds(&late) && found.refused == 0, "{found}");
}

/// Without this, the tests above might pass with any belief of the filter.
#[test]
fn a_filter_that_believes_a_wrong_noise_is_found_out() {
    let wrong = |change: fn(&mut EkfParams)| {
        let mut believed = EkfParams::default();
        change(&mut believed);
        consistency(&[MOCAP], EkfParams::default(), believed)
    };
    let too_sure = wrong(|params| params.mocap_position_noise_m *= 0.9);
    assert!(!too_sure.holds(&[MOCAP]), "{too_sure}");
    let too_humble = wrong(|params| params.mocap_attitude_noise_deg *= 1.1);
    assert!(!too_humble.holds(&[MOCAP]), "{too_humble}");
    let steady = wrong(|params| params.accelerometer_bias_walk_m_s3_sqrt_hz *= 0.5);
    assert!(!steady.holds(&[MOCAP]), "{steady}");
}

/// The largest errors of a run with motion capture whose measurements pass through `spoil` first.
fn run_spoilt(spoil: impl Fn(usize, Measurement) -> Option<Measurement>, mut judge: impl FnMut(&Sample<'_>)) {
    let flight = fly(excited, [0.0, 0.0, 5.0], 12_000);
    let params = EkfParams::default();
    run_with(&flight, &[MOCAP], (params, params), 3, spoil, &mut judge);
}

/// A barometer at 500 Hz would have to wait for a receiver 190 ms behind.
#[test]
fn more_measurements_than_can_wait_are_used_early_and_what_is_later_than_they_is_refused() {
    let crowd = [Timing { delay: 190, ..GPS }, Timing { period: 2, ..BAROMETER }];
    let flight = fly(excited, [0.0, 0.0, 5.0], 10_000);
    let params = EkfParams::default();
    let mut sums = Vec::new();
    run(&flight, &crowd, (params, params), 5, |sample| {
        if sample.number % 1000 == 999 {
            sums.push(nees(sample) / JUDGED as f64);
        }
        if sample.number == flight.len() - 1 {
            let ([gps, _, barometer, _], [late, ..]) = (sample.state.kept.updates, sample.state.kept.refused);
            assert!(barometer > 4000 && gps == 1 && late > 90, "{gps} {barometer} {late}");
        }
    });
    assert!(sums.iter().all(|nees| (0.2..2.5).contains(nees)), "{sums:.2?}");
}

#[test]
fn outliers_are_refused_and_counted_and_leave_no_mark() {
    let spoil = |number: usize, mut measured: Measurement| {
        if number > 2000 && number.is_multiple_of(500) {
            measured.values[0] += 0.5;
        }
        Some(measured)
    };
    let mut refused = 0;
    run_spoilt(spoil, |sample| {
        refused = sample.state.kept.refused[Source::Mocap.index()];
        if sample.number > 2000 {
            assert!(errors(sample).fixed_rows::<3>(0).norm() < 2e-3, "at sample {}", sample.number);
        }
    });
    assert_eq!(refused, 19);
}

#[test]
fn what_is_no_number_is_refused() {
    let spoil = |number: usize, mut measured: Measurement| {
        if number == 5000 {
            measured.values[4] = f64::NAN;
        }
        Some(measured)
    };
    let mut last = None;
    run_spoilt(spoil, |sample| last = Some((sample.state.kept.refused, errors(sample))));
    let (refused, errors) = last.unwrap();
    assert_eq!(refused, [0, 1, 0, 0]);
    assert!(errors.fixed_rows::<3>(0).norm() < 2e-3);
}

#[test]
fn a_gap_of_two_seconds_is_bridged_by_the_imu_as_well_as_the_filter_believes() {
    let spoil = |number: usize, measured| (!(4000..6000).contains(&number)).then_some(measured);
    run_spoilt(spoil, |sample| {
        let covariance = sample.filter.covariance(sample.state);
        let position_m = errors(sample).fixed_rows::<3>(0).norm();
        let sigma_m = covariance.fixed_view::<3, 3>(0, 0).trace().sqrt();
        assert!(sample.number < 2000 || position_m < 3.0 * sigma_m, "at sample {}", sample.number);
        match sample.number {
            5999 => assert!((0.01..0.1).contains(&sigma_m), "{sigma_m} m at the end of the gap"),
            7000 => assert!(sigma_m < 1e-3, "{sigma_m} m after it"),
            _ => {}
        }
    });
}

#[test]
fn without_a_magnetometer_gps_tells_the_yaw_of_a_vehicle_that_is_pushed_about_and_not_of_one_that_hovers() {
    let params = EkfParams { initial_yaw_deg: Some(0.0), ..EkfParams::default() };
    let yaw_sigma_deg = |manoeuvre| {
        let flight = fly(manoeuvre, [0.0, 0.0, 5.0], 20_000);
        let mut sigma_rad = 0.0;
        run(&flight, &[GPS], (params, params), 1, |sample| {
            if sample.number == flight.len() - 1 {
                sigma_rad = sample.filter.covariance(sample.state)[(8, 8)].sqrt();
            }
        });
        sigma_rad.to_degrees()
    };
    let (pushed_deg, hovering_deg) = (yaw_sigma_deg(excited), yaw_sigma_deg(|_| [0.0; 4]));
    println!("yaw sigma {pushed_deg:.2} deg pushed about, {hovering_deg:.2} deg hovering");
    assert!(pushed_deg < 1.5, "{pushed_deg}");
    assert!(hovering_deg > 4.5, "{hovering_deg}");
}

/// The start that the filter is told is off by far more than its stated error: motion capture is refused at first.
#[test]
fn a_filter_that_is_told_a_wrong_start_finds_its_way() {
    let flight = fly(excited, [0.0, 0.0, 5.0], 3_000);
    let believed = EkfParams { initial_position_m: Some([2.0, -1.0, 5.0]), ..EkfParams::default() };
    let mut refused = 0;
    let mut judge = |sample: &Sample<'_>| {
        refused = sample.state.kept.refused[Source::Mocap.index()];
        if sample.number > 1000 {
            assert!(errors(sample).fixed_rows::<3>(0).norm() < 5e-3, "at sample {}", sample.number);
        }
    };
    run_with(
        &flight,
        &[MOCAP],
        (EkfParams::default(), believed),
        4,
        |_, measured| Some(measured),
        &mut judge,
    );
    assert_eq!(refused, 20);
}

/// The least eigenvalue of the covariance, scaled to ones on its diagonal, over a flight; and whether it is symmetric.
fn conditioning(timings: &[Timing]) -> (f64, bool) {
    let flight = fly(excited, [0.0, 0.0, 5.0], SECONDS * 1000);
    let (mut least, mut is_symmetric) = (f64::INFINITY, true);
    run(&flight, timings, (EkfParams::default(), EkfParams::default()), 1, |sample| {
        if sample.number % 100 == 99 && sample.state.has_begun() {
            let covariance = sample.filter.covariance(sample.state);
            let sigma = covariance.diagonal().map(f64::sqrt);
            let scaled = covariance.component_div(&(sigma * sigma.transpose()));
            least = least.min(scaled.symmetric_eigenvalues().min());
            is_symmetric &= covariance == covariance.transpose();
        }
    });
    (least, is_symmetric)
}

/// The update of the covariance needs no Joseph's form: docs/decisions/011 has an hour of it.
#[test]
fn the_covariance_stays_well_conditioned() {
    for (timings, expected) in [(&[MOCAP][..], 0.03), (&OUTDOORS, 5e-5)] {
        let (least, is_symmetric) = conditioning(timings);
        println!("least eigenvalue {least}");
        assert!(least > expected && is_symmetric, "{least}");
    }
}
