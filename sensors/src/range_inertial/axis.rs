//! One axis of the range-inertial estimator: a Kalman filter over velocity, bias, path and two distances.

use super::params::RangeInertialParams;
use component::Message;
use nalgebra::{SMatrix, SVector};

const STATES: usize = 5;
pub(super) const VELOCITY: usize = 0;
const BIAS: usize = 1;
pub(super) const PATH: usize = 2;
/// The distance ahead, in the axis's positive direction; the distance behind follows it.
pub(super) const AHEAD: usize = 3;

type Mean = SVector<f64, STATES>;
type Covariance = SMatrix<f64, STATES, STATES>;

/// Estimate along one axis.
#[derive(Clone, Copy, Debug, PartialEq, Message)]
#[repr(C)]
#[message(type_name = "hummingbus_msgs/msg/RangeInertialAxis")]
pub struct Axis {
    /// Velocity.
    #[field(unit = "m/s", frame = "world")]
    pub velocity: f64,
    /// Error of the acceleration that is fed in.
    #[field(unit = "m/s^2", frame = "world")]
    pub bias: f64,
    /// Displacement since the start.
    #[field(unit = "m", frame = "world")]
    pub path: f64,
    /// Distances to what stands ahead and behind; without meaning where nothing is in sight.
    #[field(unit = "m", frame = "world")]
    pub distance: [f64; 2],
    /// 1 where something is in sight.
    #[field(unit = "1")]
    pub in_sight: [u32; 2],
    /// Covariance of the errors of the above, in their order and units.
    #[field(unit = "")]
    covariance: [f64; STATES * STATES],
}

/// The direction in which a distance is measured.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Side {
    /// Along the axis.
    Ahead,
    /// Against it.
    Behind,
}

impl Side {
    /// The place in arrays of two.
    pub fn index(self) -> usize {
        self as usize
    }

    /// Growth of the path when the distance shrinks by 1.
    fn sign(self) -> f64 {
        if self == Self::Ahead { 1.0 } else { -1.0 }
    }
}

/// A distance that was measured some time ago.
#[derive(Clone, Copy, Debug)]
pub struct Echo {
    /// Direction of the measurement.
    pub side: Side,
    /// Distance when it was measured, m.
    pub distance_m: f64,
    /// Its standard deviation, m.
    pub sigma_m: f64,
    /// Time since the measurement, s.
    pub age_s: f64,
    /// Growth of the path since, m.
    pub moved_m: f64,
}

impl Echo {
    /// The distance now, m.
    pub fn now_m(&self) -> f64 {
        self.distance_m - self.side.sign() * self.moved_m
    }
}

impl Axis {
    /// An axis at rest with nothing in sight.
    pub fn at_rest(velocity_sigma_m_s: f64, bias_sigma_m_s2: f64) -> Self {
        let mut covariance = Covariance::zeros();
        covariance[(VELOCITY, VELOCITY)] = velocity_sigma_m_s.powi(2);
        covariance[(BIAS, BIAS)] = bias_sigma_m_s2.powi(2);
        let covariance = flat(&covariance);
        Self { velocity: 0.0, bias: 0.0, path: 0.0, distance: [0.0; 2], in_sight: [0; 2], covariance }
    }

    /// Moves on by `period_s` under `acceleration_m_s2`, whose bias changes by `bias_change_m_s2`.
    pub fn predict(
        &mut self,
        acceleration_m_s2: f64,
        bias_change_m_s2: f64,
        params: &RangeInertialParams,
        period_s: f64,
    ) {
        let gained_m_s = (acceleration_m_s2 - self.bias) * period_s;
        let moved_m = (self.velocity + 0.5 * gained_m_s) * period_s;
        self.velocity += gained_m_s;
        self.bias += bias_change_m_s2;
        self.path += moved_m;
        self.distance[Side::Ahead.index()] -= moved_m;
        self.distance[Side::Behind.index()] += moved_m;
        self.spread(params, period_s);
    }

    /// The covariance after `period_s`, to first order in it.
    fn spread(&mut self, params: &RangeInertialParams, period_s: f64) {
        let mut transition = Covariance::identity();
        transition[(VELOCITY, BIAS)] = -period_s;
        transition[(PATH, VELOCITY)] = period_s;
        transition[(AHEAD, VELOCITY)] = -period_s;
        transition[(AHEAD + 1, VELOCITY)] = period_s;
        let mut covariance = transition * self.covariance() * transition.transpose();
        covariance[(VELOCITY, VELOCITY)] +=
            params.accelerometer_noise_density_m_s2_sqrt_hz.powi(2) * period_s;
        covariance[(BIAS, BIAS)] += params.acceleration_bias_walk_m_s3_sqrt_hz.powi(2) * period_s;
        self.covariance = flat(&covariance);
    }

    /// Corrects the axis by `echo`. An echo further than `gate_sigma` from the expected one comes from
    /// another object than before: its distance is taken as it is, and the velocity is not corrected.
    pub fn correct(&mut self, echo: &Echo, gate_sigma: f64) {
        let side = echo.side.index();
        let now_m = echo.now_m();
        let innovation_m = now_m - self.distance[side];
        let observation = observation(echo);
        let cross = self.covariance() * observation;
        let variance = observation.dot(&cross) + echo.sigma_m.powi(2);
        if self.in_sight[side] == 0 || innovation_m.powi(2) > gate_sigma.powi(2) * variance {
            return self.begin(echo.side, now_m, echo.sigma_m);
        }
        self.take_up(&cross, innovation_m, variance);
    }

    /// Corrects the axis by a velocity that was measured `age_s` ago with `sigma_m_s`. `told_m_s` is that
    /// velocity plus the gain since by the accelerometer: the present velocity, but for the bias. A NaN is left
    /// out.
    pub fn correct_velocity(&mut self, told_m_s: f64, sigma_m_s: f64, age_s: f64) {
        let innovation_m_s = told_m_s - (self.velocity + self.bias * age_s);
        if !innovation_m_s.is_finite() {
            return;
        }
        // What the bias did to the velocity since then is in what was gained.
        let mut observation = Mean::zeros();
        observation[VELOCITY] = 1.0;
        observation[BIAS] = age_s;
        let cross = self.covariance() * observation;
        let variance = observation.dot(&cross) + sigma_m_s.powi(2);
        self.take_up(&cross, innovation_m_s, variance);
    }

    /// The Kalman update by an innovation of `variance`, whose covariance with the states is `cross`.
    fn take_up(&mut self, cross: &Mean, innovation: f64, variance: f64) {
        self.add(&(cross * (innovation / variance)));
        let covariance = self.covariance() - cross * cross.transpose() / variance;
        self.covariance = flat(&covariance);
    }

    /// Takes `distance_m` for the distance to something new.
    pub fn begin(&mut self, side: Side, distance_m: f64, sigma_m: f64) {
        let state = AHEAD + side.index();
        let mut covariance = self.covariance();
        covariance.row_mut(state).fill(0.0);
        covariance.column_mut(state).fill(0.0);
        covariance[(state, state)] = sigma_m.powi(2);
        self.covariance = flat(&covariance);
        self.distance[side.index()] = distance_m;
        self.in_sight[side.index()] = 1;
    }

    /// Forgets the wall in sight.
    pub fn lose(&mut self, side: Side) {
        self.in_sight[side.index()] = 0;
    }

    /// Standard deviation of one of the states.
    pub(super) fn sigma(&self, state: usize) -> f64 {
        self.covariance()[(state, state)].sqrt()
    }

    fn covariance(&self) -> Covariance {
        Covariance::from_column_slice(&self.covariance)
    }

    fn add(&mut self, change: &Mean) {
        self.velocity += change[VELOCITY];
        self.bias += change[BIAS];
        self.path += change[PATH];
        self.distance[0] += change[AHEAD];
        self.distance[1] += change[AHEAD + 1];
    }
}

/// Returns the derivatives of an echo by the errors of the present state: the velocity at its time was another.
fn observation(echo: &Echo) -> Mean {
    let mut observation = Mean::zeros();
    observation[AHEAD + echo.side.index()] = 1.0;
    observation[VELOCITY] = echo.side.sign() * echo.age_s;
    observation[BIAS] = echo.side.sign() * 0.5 * echo.age_s.powi(2);
    observation
}

fn flat(covariance: &Covariance) -> [f64; STATES * STATES] {
    let symmetric = 0.5 * (covariance + covariance.transpose());
    std::array::from_fn(|index| symmetric[index])
}
