//! The extended Kalman filter: motion and sensor errors from an IMU and any other sensors.
//!
//! *Two times.* Measurements arrive late, and not in the order in which they were measured. The filter proper
//! therefore stays at the time up to which nothing can arrive any more. It uses every measurement at its own
//! time, in order. It publishes its motion and its covariance, carried on to the present with the readings
//! since. Using a measurement at its own time is exact, where correcting the present by an old innovation is
//! not. It is also cheap: readings are integrated twice, and a covariance is carried once for each
//! measurement. The price is that a fast sensor waits for the slow ones' delay. Meanwhile the present drifts
//! by the IMU's noise: with the default IMU and 200 ms, by 1 mm/s and 0.005°.
//!
//! *Waiting measurements.* A measurement is used as soon as every sensor has shown one at least as late, and at the latest
//! when it is `delay_max_ms` old. One that arrives later than that is refused.
//!
//! *Outliers.* A measurement is refused if its normalised innovation squared is unlikely. Each refusal leaves the
//! covariance growing, so a filter that is wrong comes to accept what it refused. After twenty refusals of a
//! position in a row the filter counts as lost: it keeps its motion with hardly any confidence.

use super::history::{Newest, Reading, Readings, ReadingsHead, Source, Waiting, places};
use super::motion::Motion;
use super::observation::{self, Observation};
use super::params::EkfParams;
use super::start::{lost_covariance, start};
use super::transition::{Covariance, CovarianceView, STATES, Transition};
use crate::wire::attitude;
use component::{Message, Parameters as _, State, StateError, Transfer};
use diagnostics::parameter::{ParameterError, positive, require};
use nalgebra::{SMatrix, Vector3};

/// The covariance is carried over spans of at most this, since noise acts through the attitude in longer ones.
const SPAN_MAX_NS: u64 = 20_000_000;

/// Type of the state.
const STATE: &str = "EkfState";

/// No measurement was seen.
const NEVER: u64 = u64::MAX;

/// Number of refusals of a position in a row that mean that the filter is wrong, not the sensor. Tuned, no
/// source: 0.2 s of motion capture, 2 s of GPS.
const REFUSED_IN_ROW_MAX: u32 = 20;

/// State of the estimator, as it is handed over.
#[derive(Clone, Debug, PartialEq)]
pub struct EkfState {
    /// State besides the last readings.
    pub kept: Kept,
    /// The last readings.
    readings: Readings,
}

/// State of the filter besides the last readings.
#[derive(Clone, Copy, Debug, PartialEq, Message)]
#[repr(C)]
#[message(type_name = "hummingbus_msgs/msg/EkfKept")]
pub struct Kept {
    /// The reading at the filter's time; its time is that of the filter.
    at: Reading,
    /// The motion at the filter's time.
    settled: Motion,
    /// The covariance of its errors.
    #[field(unit = "")]
    covariance: [f64; STATES * STATES],
    /// The motion at the newest reading.
    present: Motion,
    /// Transition of the errors from the filter's time to the newest reading.
    since: Transition,
    /// Measurements that wait.
    waiting: Waiting,
    /// When the newest measurement of each sensor was taken; the largest number before the first.
    #[field(unit = "ns")]
    newest_ns: [u64; 4],
    /// Normalised innovation squared of the last update of each sensor, in the order of [`Source::ALL`].
    #[field(unit = "1")]
    pub normalised_squared: [f64; 4],
    /// Updates of each sensor so far.
    #[field(unit = "1")]
    pub updates: [u32; 4],
    /// Measurements of each sensor that were refused so far.
    #[field(unit = "1")]
    pub refused: [u32; 4],
    /// The same without one that was used in between.
    #[field(unit = "1")]
    refused_in_row: [u32; 4],
    /// 1 once the filter has begun.
    #[field(unit = "1")]
    has_begun: u32,
    #[field(unit = "")]
    pad0: u32,
}

/// The filter at one sample period, with everything that does not change during a run.
///
/// ```
/// use component::Harness;
/// use component::context::NodeContext;
/// use component::messages::{Imu, Mocap};
/// use sensors::ekf::{EkfInputs, filter::Ekf, params::EkfParams};
///
/// let context = NodeContext::new("ekf", &["imu", "mocap"]);
/// let mut ekf = Harness::<Ekf>::in_context(EkfParams::default(), &context).unwrap();
/// let imu = Imu { specific_force: [0.0, 0.0, 9.81].into(), ..Default::default() };
/// let mocap = Mocap { position: [1.0, 2.0, 3.0].into(), valid: 1, ..Default::default() };
/// let inputs = || EkfInputs { imu: &imu, gps: None, mocap: Some(&mocap), barometer: None, magnetometer: None };
/// let estimate = (0..10).map(|_| ekf.step(inputs()).unwrap().estimate).last().unwrap();
/// assert!((estimate.position.z - 3.0).abs() < 1e-2, "m in the world: {estimate:?}");
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ekf {
    params: EkfParams,
    period_ns: u64,
    delay_max_ns: u64,
    /// Readings that are remembered.
    places: usize,
}

impl Ekf {
    /// A filter that is given a reading every `period_s`.
    ///
    /// # Errors
    /// A parameter or the period is outside its range, or the period is too short for the delay.
    pub fn with_period(params: EkfParams, period_s: f64) -> Result<Self, ParameterError> {
        params.validate()?;
        positive("period_s", period_s)?;
        let span_s = params.delay_max_ms * 1e-3 + SPAN_MAX_NS as f64 * 1e-9;
        let places = places(span_s, period_s);
        require(
            "delay_max_ms",
            params.delay_max_ms,
            places.is_some(),
            "at most four million of the node's periods",
        )?;
        let (period_ns, delay_max_ns) = ((period_s * 1e9).round() as u64, (params.delay_max_ms * 1e6) as u64);
        Ok(Self { params, period_ns, delay_max_ns, places: places.unwrap_or_default() })
    }

    /// The state before the first reading.
    #[must_use]
    pub fn initial_state(&self) -> EkfState {
        let kept = Kept {
            at: Reading::default(),
            settled: Motion::default(),
            covariance: [0.0; STATES * STATES],
            present: Motion::default(),
            since: Transition::default(),
            waiting: Waiting::default(),
            newest_ns: [NEVER; 4],
            normalised_squared: [0.0; 4],
            updates: [0; 4],
            refused: [0; 4],
            refused_in_row: [0; 4],
            has_begun: 0,
            pad0: 0,
        };
        EkfState { kept, readings: Readings::every(self.period_ns, self.places) }
    }

    /// Moves `state` on to `reading`, with the last measurements of the sensors.
    pub fn update_to(&self, state: &mut EkfState, reading: &Reading, newest: &Newest) {
        let last = state.readings.newest();
        // Without a reading that can be used, the last one goes on.
        let usable = if reading.is_finite() { *reading } else { last.unwrap_or_default() };
        let now_ns = reading.time_ns;
        state.readings.push(&Reading { time_ns: now_ns, ..usable });
        let begins = state.kept.has_begun == 0;
        if begins && !self.begin(state, newest) {
            return;
        }
        let was_full = self.collect(state, newest);
        if self.settle(state, newest, now_ns) || was_full || begins {
            self.catch_up(state);
        } else if let (Some(last), Some(now)) = (last, state.readings.newest()) {
            state.kept.present.travel(&last, &now, self.params.gravity_m_s2, &mut state.kept.since);
        }
    }

    /// Begins if a position is known; whether it has.
    fn begin(&self, state: &mut EkfState, newest: &Newest) -> bool {
        let Some((reading, start)) = start(newest, &state.readings, &self.params) else { return false };
        (state.kept.at, state.kept.settled) = (reading, start.motion);
        state.kept.covariance = flat(start.covariance(&self.params));
        for earlier in newest.iter().flatten().flatten().filter(|m| m.measured_ns < reading.time_ns) {
            state.kept.newest_ns[earlier.sensor().index()] = earlier.measured_ns;
        }
        state.kept.has_begun = 1;
        true
    }

    /// Puts new measurements among those that wait. Returns true if some had to be used early to make room.
    fn collect(&self, state: &mut EkfState, newest: &Newest) -> bool {
        let mut was_full = false;
        for measurement in newest.iter().flatten().flatten() {
            let sensor = measurement.sensor().index();
            if state.kept.newest_ns[sensor] == measurement.measured_ns {
                continue;
            }
            state.kept.newest_ns[sensor] = measurement.measured_ns;
            if state.kept.waiting.is_full() {
                self.use_first(state);
                was_full = true;
            }
            state.kept.waiting.insert(*measurement);
        }
        was_full
    }

    /// Uses every measurement before which nothing can arrive any more, and keeps the filter's time within
    /// reach of the readings; whether the filter's time or motion has changed.
    fn settle(&self, state: &mut EkfState, newest: &Newest, now_ns: u64) -> bool {
        let mut has_changed = false;
        let until_ns = self.settled_ns(state, newest, now_ns);
        while state.kept.waiting.first().is_some_and(|first| first.measured_ns <= until_ns) {
            self.use_first(state);
            has_changed = true;
        }
        let horizon_ns = now_ns.saturating_sub(self.delay_max_ns);
        if horizon_ns >= state.kept.at.time_ns + SPAN_MAX_NS {
            self.advance(state, horizon_ns);
            has_changed = true;
        }
        has_changed
    }

    /// Up to when nothing can arrive any more: no sensor sends its measurements out of order.
    fn settled_ns(&self, state: &EkfState, newest: &Newest, now_ns: u64) -> u64 {
        let seen = |sensor: &Source| match state.kept.newest_ns[sensor.index()] {
            NEVER => 0,
            newest_ns => newest_ns,
        };
        let wired = Source::ALL.iter().filter(|sensor| newest[sensor.index()].is_some());
        let all_seen_ns = wired.map(seen).min().unwrap_or(0);
        all_seen_ns.max(now_ns.saturating_sub(self.delay_max_ns))
    }

    /// Goes on to the time of the earliest measurement that waits, and uses it.
    fn use_first(&self, state: &mut EkfState) {
        let Some(measurement) = state.kept.waiting.pop() else { return };
        let is_known =
            measurement.measured_ns >= state.kept.at.time_ns && self.advance(state, measurement.measured_ns);
        if !is_known || !measurement.values.iter().all(|value| value.is_finite()) {
            state.kept.refused[measurement.sensor().index()] += 1;
            return;
        }
        let (motion, params) = (&state.kept.settled, &self.params);
        let sensor = measurement.sensor();
        match sensor {
            Source::Gps => self.update(state, sensor, &observation::gps(motion, &measurement, params)),
            Source::Mocap => self.update(state, sensor, &observation::mocap(motion, &measurement, params)),
            Source::Barometer => {
                self.update(state, sensor, &observation::barometer(motion, &measurement, params));
            }
            Source::Magnetometer => {
                self.update(state, sensor, &observation::magnetometer(motion, &measurement, params));
            }
        }
    }

    /// Carries the filter on to `until_ns`; false if there are no readings up to then.
    fn advance(&self, state: &mut EkfState, until_ns: u64) -> bool {
        while state.kept.at.time_ns < until_ns {
            let next_ns = until_ns.min(state.kept.at.time_ns + SPAN_MAX_NS);
            let Some(end) = state.readings.at(next_ns) else { return false };
            let mut span = Transition::default();
            let mut from = state.kept.at;
            for to in state.readings.after(from.time_ns).take_while(|reading| reading.time_ns < next_ns) {
                state.kept.settled.travel(&from, &to, self.params.gravity_m_s2, &mut span);
                from = to;
            }
            state.kept.settled.travel(&from, &end, self.params.gravity_m_s2, &mut span);
            state.kept.settled.fade_gps_drift(span.time_s(), self.params.gps_position_drift_time_s);
            state.kept.covariance = flat(span.carry(&state.covariance(), &self.params));
            state.kept.at = end;
        }
        true
    }

    /// The present anew, from the filter's time.
    fn catch_up(&self, state: &mut EkfState) {
        (state.kept.present, state.kept.since) = (state.kept.settled, Transition::default());
        let mut from = state.kept.at;
        for to in state.readings.after(from.time_ns) {
            state.kept.present.travel(&from, &to, self.params.gravity_m_s2, &mut state.kept.since);
            from = to;
        }
    }

    /// The Kalman update, or the refusal of an outlier.
    fn update<const N: usize>(&self, state: &mut EkfState, sensor: Source, observed: &Observation<N>) {
        let index = sensor.index();
        let cross = observed.cross_covariance(&state.covariance());
        let spread = observed.spread(&cross);
        let Some(spread) = spread.cholesky() else {
            state.kept.refused[index] += 1;
            return;
        };
        let normalised_squared = observed.innovation.dot(&spread.solve(&observed.innovation));
        state.kept.normalised_squared[index] = normalised_squared;
        if deviation(normalised_squared, N) > self.params.gate_sigma {
            state.kept.refused[index] += 1;
            state.kept.refused_in_row[index] += 1;
            if state.kept.refused_in_row[index] < REFUSED_IN_ROW_MAX || !sensor.tells_position() {
                return;
            }
            // It is not the sensor that is wrong.
            state.kept.covariance = flat(lost_covariance(&self.params));
            state.kept.refused_in_row[index] = 0;
            return self.update(state, sensor, observed);
        }
        state.kept.refused_in_row[index] = 0;
        let gain = cross * spread.inverse();
        state.kept.settled.correct(&(gain * observed.innovation));
        state.kept.covariance = flat(reduced(&state.covariance(), &gain, &cross));
        state.kept.updates[index] += 1;
    }

    /// The covariance of the present motion's errors.
    #[must_use]
    pub fn covariance(&self, state: &EkfState) -> Covariance {
        state.kept.since.carry(&state.covariance(), &self.params)
    }

    /// The variances of the errors of the present position, m², velocity, m²/s², and attitude, rad²; the last about the
    /// body's axes.
    pub(crate) fn motion_variances(&self, state: &EkfState) -> [Vector3<f64>; 3] {
        let turn_BW = attitude(state.kept.present.attitude).inverse().to_rotation_matrix();
        state.kept.since.motion_variances(&state.covariance(), turn_BW.matrix(), &self.params)
    }
}

impl State for EkfState {
    const TRANSFER: Transfer = Transfer::Bytes(STATE);

    /// As many readings of another period reach another time back.
    fn configuration(&self) -> u64 {
        self.readings.period_ns()
    }

    fn size(&self) -> usize {
        let (_, ring) = self.readings.parts();
        size_of::<Kept>() + size_of::<ReadingsHead>() + ring.len()
    }

    fn save(&self, bytes: &mut [u8]) {
        let (head, ring) = self.readings.parts();
        let (kept, rest) = bytes.split_at_mut(size_of::<Kept>());
        let (of_head, of_ring) = rest.split_at_mut(size_of::<ReadingsHead>());
        kept.copy_from_slice(bytemuck::bytes_of(&self.kept));
        of_head.copy_from_slice(bytemuck::bytes_of(&head));
        of_ring.copy_from_slice(ring);
    }

    fn load(&mut self, bytes: &[u8]) -> Result<(), StateError> {
        StateError::check_size(STATE, self.size(), bytes)?;
        let (kept, rest) = bytes.split_at(size_of::<Kept>());
        let (head, ring) = rest.split_at(size_of::<ReadingsHead>());
        self.kept = bytemuck::pod_read_unaligned(kept);
        self.readings.go_on(bytemuck::pod_read_unaligned(head), ring);
        Ok(())
    }
}

impl EkfState {
    /// The motion at the newest reading.
    #[must_use]
    pub fn motion(&self) -> &Motion {
        &self.kept.present
    }

    /// True once the filter has begun: before, there is no estimate.
    #[must_use]
    pub fn has_begun(&self) -> bool {
        self.kept.has_begun == 1
    }

    /// The newest reading.
    pub(crate) fn newest_reading(&self) -> Reading {
        self.readings.newest().unwrap_or_default()
    }

    fn covariance(&self) -> CovarianceView<'_> {
        CovarianceView::from_slice(&self.kept.covariance)
    }
}

/// The covariance after an update: the short form, for which docs/decisions/011 has the figures. One half is computed, the
/// other is the same.
fn reduced<const N: usize>(
    covariance: &CovarianceView<'_>,
    gain: &SMatrix<f64, STATES, N>,
    cross: &SMatrix<f64, STATES, N>,
) -> Covariance {
    let mut reduced = covariance.into_owned();
    for state in 0..STATES {
        for number in 0..N {
            let (gains, cross) = (gain.column(number), cross[(state, number)]);
            for other in state..STATES {
                reduced[(other, state)] -= gains[other] * cross;
            }
        }
    }
    reduced.fill_upper_triangle_with_lower_triangle();
    reduced
}

/// Returns the deviation of a chi-square of `degrees` of freedom from its mean, in standard deviations: its cube root
/// is nearly normal (Wilson and Hilferty, "The distribution of chi-square", PNAS 17, 1931).
#[must_use]
pub fn deviation(chi_square: f64, degrees: usize) -> f64 {
    let degrees = degrees as f64;
    let variance = 2.0 / (9.0 * degrees);
    (libm::cbrt(chi_square / degrees) - (1.0 - variance)) / variance.sqrt()
}

/// The numbers of the covariance, column by column.
fn flat(covariance: Covariance) -> [f64; STATES * STATES] {
    let mut numbers = [0.0; STATES * STATES];
    numbers.copy_from_slice(covariance.as_slice());
    numbers
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ekf::history::Measurement;

    /// The covariance after a second of hover under motion capture.
    fn settled(params: EkfParams) -> (Motion, Covariance) {
        let filter = Ekf::with_period(params, 1e-3).unwrap();
        let mut state = filter.initial_state();
        for tick in 0..1000 {
            let time_ns = tick * 1_000_000;
            let specific_force = [0.0, 0.0, params.gravity_m_s2].into();
            let reading = Reading { time_ns, specific_force, angular_velocity: Default::default() };
            let pose = Measurement::new(Source::Mocap, time_ns / 10_000_000 * 10_000_000, &POSE);
            filter.update_to(&mut state, &reading, &[None, Some(Some(pose)), None, None]);
        }
        assert_eq!(state.kept.updates[Source::Mocap.index()], 100);
        (state.kept.settled, state.covariance().into_owned())
    }

    const POSE: [f64; 7] = [1.0, 2.0, 3.0, 0.0, 0.0, 0.0, 1.0];

    #[test]
    fn the_short_form_of_the_update_is_josephs() {
        let params = EkfParams::default();
        let (motion, covariance) = settled(params);
        let pose = Measurement::new(Source::Mocap, 0, &POSE);
        let observed = observation::mocap(&motion, &pose, &params);
        let cross = covariance * observed.jacobian.transpose();
        let noise = SMatrix::<f64, 6, 6>::from_diagonal(&observed.variance);
        let gain = cross * (observed.jacobian * cross + noise).cholesky().unwrap().inverse();
        let left = Covariance::identity() - gain * observed.jacobian;
        let joseph = left * covariance * left.transpose() + gain * noise * gain.transpose();
        assert!((observed.cross_covariance(&covariance.as_view()) - cross).amax() < 1e-15);
        let short = reduced(&covariance.as_view(), &gain, &cross);
        let sigma = joseph.diagonal().map(f64::sqrt);
        let worst = (short - joseph).component_div(&(sigma * sigma.transpose())).amax();
        assert!(worst < 1e-12, "{worst}");
        assert!(short[(0, 0)] < covariance[(0, 0)]);
    }
}
