//! Velocity, height and distances to walls from range finders, an IMU and an estimated attitude.
//!
//! *Frames.* The filter works along the world's axes, as the attitude estimate has them: a velocity along
//! them does not turn with the vehicle, and an error of the attitude stands still in them. Walls are taken
//! to stand at right angles to these axes, as in the thesis's room; a range is that of the wall whose normal
//! is nearest to the beam. The estimate for controllers is turned to the heading.
//!
//! *Acceleration.* a_W = R_WB·f_B − g. With the attitude wrong by a rotation e_W it is wrong by e_W × a_W,
//! nearly g·(e_y, −e_x, 0): the bias of each axis. The complementary filter leans towards the accelerometer
//! by de_W/dt = f_W × z /(|f|·τ), which makes db/dt = −a/τ. That part is known, and removed: a flight of 1 s at 10°
//! would otherwise leave 0.06 m/s² of bias for the rest of the flight.
//!
//! *Ranges.* A beam that meets a wall at the angle γ from its normal reads distance/cos γ; if the beam is a
//! cone, some of it meets the wall up to half the opening angle nearer to the normal. A reading no shorter
//! than the beam's way to the floor is not one of a wall.
//!
//! *GPS.* Five ranges and an IMU do not observe a velocity along an axis with no wall across it: none of their
//! readings depends on it. There the velocity is the integral of an acceleration whose error, a tilt of 0.1°,
//! makes 1 m/s of it in a minute. If a receiver is wired, its level velocity is a further measurement; its
//! position is not used.

use super::axis::{AHEAD, Axis, Echo, PATH, Side, VELOCITY};
use super::gains::{Gains, TooLongAgo};
use super::params::RangeInertialParams;
use crate::wire::{attitude, vector, vector_message};
use component::messages::{
    AttitudeEstimate, Gps, Imu, Quaternion, Ranges, StateEstimate, Vector3 as Vector3Message, WallEstimate,
};
use component::{InputPorts, Message, Parameters as _};
use diagnostics::parameter::{ParameterError, positive};
use nalgebra::{UnitQuaternion, Vector3};

/// The level directions of the beams, in the order of [`Ranges`].
const LEVEL_BEAMS: [[f64; 3]; 4] = [[1.0, 0.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, -1.0, 0.0]];
/// The place of the beam that looks down.
const DOWN: usize = 4;

/// Number of samples that the filter can look back for the place of an echo.
const PAST: usize = 128;

/// A measurement came too late to be of use.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error(
    "what came on its input `{input}` was measured {age_s:.3} s ago, and it looks back {longest_s:.3} s at most: shorten the \
     sensor's delay, or compute the estimate less often"
)]
pub struct Late {
    input: &'static str,
    age_s: f64,
    longest_s: f64,
}

/// No range was ever measured then.
const NEVER: u64 = u64::MAX;

/// Beyond this fraction of gravity the complementary filter leaves the accelerometer out, and so do we.
const GRAVITY_TOLERANCE: f64 = 0.2;

/// In a room of known size an echo this far from the wall, m, is another vehicle's. Tuned, no source: above the error
/// that dead reckoning gathers while a wall is hidden, below a vehicle's size and gap.
const OBSTACLE_M: f64 = 0.5;

/// Standard deviation of where a vehicle is said to start in a room, m. Tuned, no source.
const START_SIGMA_M: f64 = 0.05;

/// A reading longer than this part of the beam's way to the floor may be the floor's.
const FLOOR_MARGIN: f64 = 0.9;

/// Pose of the vehicle at a sample.
#[derive(Clone, Copy, Debug, Default, PartialEq, Message)]
#[repr(C)]
#[message(type_name = "hummingbus_msgs/msg/RangeInertialPast")]
struct Past {
    /// Displacement since the start.
    #[field(unit = "m", frame = "world")]
    path: Vector3Message,
    /// Attitude, body to world.
    #[field(frame = "world")]
    attitude: Quaternion,
}

/// State of the estimator, as it is handed over.
#[derive(Clone, Copy, Debug, PartialEq, Message)]
#[repr(C)]
#[message(type_name = "hummingbus_msgs/msg/RangeInertialState")]
pub struct RangeInertialState {
    /// Samples so far.
    samples: u64,
    /// When the newest ranges were measured; the largest number before the first.
    #[field(unit = "ns")]
    measured_ns: u64,
    /// When the newest velocity of a receiver was measured; the largest number before the first.
    #[field(unit = "ns")]
    gps_measured_ns: u64,
    /// When the last echo came from ahead and from behind along x, and along y.
    #[field(unit = "ns")]
    echo_ns: [[u64; 2]; 2],
    /// In a room of known size: distances to what hides the walls, and when it was seen last, as above.
    #[field(unit = "m", frame = "world")]
    obstacle: [[f64; 2]; 2],
    /// See above; 0 for never.
    #[field(unit = "ns")]
    obstacle_ns: [[u64; 2]; 2],
    /// The last sample's acceleration.
    #[field(unit = "m/s^2", frame = "world")]
    acceleration: Vector3Message,
    /// The axes of the world; the ground is behind the third.
    axes: [Axis; 3],
    /// Gains of the velocity.
    gains: Gains,
    /// The last samples, sample k at the place k modulo the number of places.
    past: [Past; PAST],
}

/// Inputs of the estimator.
#[derive(Debug, InputPorts)]
pub struct RangeInertialInputs<'a> {
    /// Measurements of the range finders.
    pub ranges: &'a Ranges,
    /// Readings of the inertial measurement unit.
    pub imu: &'a Imu,
    /// The attitude.
    pub attitude: &'a AttitudeEstimate,
    /// Measurements of a satellite receiver, whose level velocity is used.
    pub gps: Option<&'a Gps>,
}

/// The estimator at one sample period, with everything that does not change during a run.
///
/// ```
/// use component::Harness;
/// use component::messages::{AttitudeEstimate, Imu, Ranges};
/// use sensors::range_inertial::filter::{RangeInertial, RangeInertialInputs};
/// use sensors::range_inertial::params::RangeInertialParams;
///
/// let parameters = RangeInertialParams { initial_height_m: 1.0, ..RangeInertialParams::default() };
/// let mut filter = Harness::<RangeInertial>::new(parameters).unwrap();
/// let imu = Imu { specific_force: [0.0, 0.0, 9.81].into(), ..Default::default() };
/// let attitude = AttitudeEstimate::default();
/// let ranges = Ranges { distance: [2.0, 3.0, 2.0, 3.0, 1.0], valid: [1; 5], ..Default::default() };
/// let inputs = || RangeInertialInputs { ranges: &ranges, imu: &imu, attitude: &attitude, gps: None };
/// let sent = (0..10).map(|_| filter.step(inputs()).unwrap()).last().unwrap();
/// assert!((sent.walls.distance[0] - 2.0).abs() < 0.1, "m to the wall ahead: {:?}", sent.walls);
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RangeInertial {
    params: RangeInertialParams,
    period_s: f64,
}

impl RangeInertial {
    /// An estimator that is given a sample every `period_s`.
    ///
    /// # Errors
    /// A parameter or the period is outside its range.
    pub fn with_period(params: RangeInertialParams, period_s: f64) -> Result<Self, ParameterError> {
        params.validate()?;
        ParameterError::both(params.validate_room(), positive("period_s", period_s))?;
        Ok(Self { params, period_s })
    }

    /// The state before the first sample: at rest at the initial height.
    #[must_use]
    pub fn initial_state(&self) -> RangeInertialState {
        let params = &self.params;
        let (velocity, bias) =
            (params.initial_velocity_sigma_m_s, params.initial_acceleration_bias_sigma_m_s2);
        let mut axes = [Axis::at_rest(velocity, bias); 3];
        axes[2].begin(Side::Behind, params.initial_height_m, params.range_sigma_m);
        let rooms = params.room_m.into_iter().flatten().zip(params.start_in_room_m.into_iter().flatten());
        for (axis, (size_m, start_m)) in axes.iter_mut().zip(rooms) {
            axis.begin(Side::Ahead, size_m - start_m, START_SIGMA_M);
            axis.begin(Side::Behind, start_m, START_SIGMA_M);
        }
        RangeInertialState {
            samples: 0,
            measured_ns: NEVER,
            gps_measured_ns: NEVER,
            echo_ns: [[0; 2]; 2],
            obstacle: [[0.0; 2]; 2],
            obstacle_ns: [[0; 2]; 2],
            acceleration: Vector3Message::default(),
            axes,
            gains: Gains::default(),
            past: [Past::default(); PAST],
        }
    }

    /// Moves `state` on to `now_ns`, the time of `inputs`, one period after the last.
    ///
    /// # Errors
    /// If ranges or a velocity were measured longer ago than the filter can look back.
    pub fn update(
        &self,
        state: &mut RangeInertialState,
        now_ns: u64,
        inputs: &RangeInertialInputs<'_>,
    ) -> Result<(), Late> {
        self.predict(state, inputs);
        state.remember(inputs.attitude.attitude);
        let ranges = inputs.ranges;
        // Each is used once.
        if ranges.measured_ns != state.measured_ns && ranges.valid.contains(&1) {
            state.measured_ns = ranges.measured_ns;
            self.correct(state, now_ns, ranges)?;
        }
        if let Some(gps) = inputs.gps
            && gps.valid == 1
            && gps.measured_ns != state.gps_measured_ns
        {
            state.gps_measured_ns = gps.measured_ns;
            self.correct_velocity(state, now_ns, gps)?;
        }
        self.lose_sight(state, now_ns);
        Ok(())
    }

    fn predict(&self, state: &mut RangeInertialState, inputs: &RangeInertialInputs<'_>) {
        let force_B = vector(inputs.imu.specific_force);
        if !force_B.iter().all(|axis| axis.is_finite()) {
            return;
        }
        let gravity_W = Vector3::new(0.0, 0.0, self.params.gravity_m_s2);
        let acceleration_W = attitude(inputs.attitude.attitude) * force_B - gravity_W;
        let last_W = if state.samples == 0 { acceleration_W } else { vector(state.acceleration) };
        state.acceleration = vector_message(acceleration_W);
        if state.samples == 0 {
            return;
        }
        let mean_W = 0.5 * (last_W + acceleration_W);
        state.gains.add(&(mean_W * self.period_s), self.period_s);
        let lean_W = self.lean_m_s3(&mean_W, force_B.norm()) * self.period_s;
        for (index, axis) in state.axes.iter_mut().enumerate() {
            axis.predict(mean_W[index], lean_W[index], &self.params, self.period_s);
        }
    }

    /// Returns the rate at which the attitude estimate's leaning towards the accelerometer changes the bias.
    fn lean_m_s3(&self, acceleration_W_m_s2: &Vector3<f64>, force_m_s2: f64) -> Vector3<f64> {
        let gravity_m_s2 = self.params.gravity_m_s2;
        if (force_m_s2 - gravity_m_s2).abs() > GRAVITY_TOLERANCE * gravity_m_s2 {
            return Vector3::zeros();
        }
        let level_W = Vector3::new(acceleration_W_m_s2.x, acceleration_W_m_s2.y, 0.0);
        -level_W / self.params.attitude_time_constant_s
    }

    fn correct(&self, state: &mut RangeInertialState, now_ns: u64, ranges: &Ranges) -> Result<(), Late> {
        let age_ns = now_ns.saturating_sub(ranges.measured_ns);
        let age_s = age_ns as f64 * 1e-9;
        let Some(past) = state.past(age_s / self.period_s) else {
            let longest_s = (PAST - 1) as f64 * self.period_s;
            let late = Late { input: "ranges", age_s, longest_s };
            return if age_s > longest_s { Err(late) } else { Ok(()) };
        };
        for (beam, &reading_m) in ranges.distance.iter().enumerate() {
            let is_valid = ranges.valid[beam] == 1 && reading_m.is_finite();
            let seen = is_valid.then(|| self.read(state, &past, beam, reading_m)).flatten();
            let Some((axis, side, distance_m, sigma_m)) = seen else { continue };
            let moved_m = state.axes[axis].path - vector(past.path)[axis];
            let echo = Echo { side, distance_m, sigma_m, age_s, moved_m };
            if beam != DOWN && self.is_obstacle(&state.axes[axis], &echo) {
                state.obstacle[axis][side.index()] = echo.now_m();
                state.obstacle_ns[axis][side.index()] = now_ns;
                continue;
            }
            state.axes[axis].correct(&echo, self.params.gate_sigma);
            if let Some(echo_ns) = state.echo_ns.get_mut(axis) {
                echo_ns[side.index()] = now_ns;
            }
        }
        Ok(())
    }

    /// Takes up the level velocity that a receiver measured some time ago.
    fn correct_velocity(&self, state: &mut RangeInertialState, now_ns: u64, gps: &Gps) -> Result<(), Late> {
        let age_s = now_ns.saturating_sub(gps.measured_ns) as f64 * 1e-9;
        let gained = state.gains.since(age_s, self.period_s);
        let gained = gained.map_err(|TooLongAgo(longest_s)| Late { input: "gps", age_s, longest_s })?;
        let Some(gained_W_m_s) = gained else { return Ok(()) };
        let told_m_s = vector(gps.velocity) + gained_W_m_s;
        for (axis, told_m_s) in state.axes.iter_mut().zip(&told_m_s).take(2) {
            axis.correct_velocity(*told_m_s, self.params.gps_velocity_sigma_m_s, age_s);
        }
        Ok(())
    }

    /// True if an echo, in a room of known size, is not that of the wall.
    fn is_obstacle(&self, axis: &Axis, echo: &Echo) -> bool {
        let wall_m = axis.distance[echo.side.index()];
        self.params.room_m.is_some() && (echo.now_m() - wall_m).abs() > OBSTACLE_M
    }

    /// The axis, the side, the distance at right angles and its standard deviation that a reading means.
    fn read(
        &self,
        state: &RangeInertialState,
        past: &Past,
        beam: usize,
        reading_m: f64,
    ) -> Option<(usize, Side, f64, f64)> {
        let beam_W = attitude(past.attitude) * beam_B(beam);
        let (axis, side) = if beam == DOWN { (2, Side::Behind) } else { facing(&beam_W) };
        let cosine = if beam == DOWN { -beam_W.z } else { beam_W[axis].abs() };
        let angle_rad = libm::acos(cosine.clamp(-1.0, 1.0));
        if angle_rad > self.params.incidence_max_rad {
            return None;
        }
        if beam != DOWN && reading_m > FLOOR_MARGIN * self.floor_m(state, &beam_W) {
            return None;
        }
        let incidence_rad = (angle_rad - self.params.half_angle_deg.to_radians()).max(0.0);
        let (reading_m, sigma_m) = self.reading(reading_m);
        let turn_sigma_m = reading_m * libm::sin(incidence_rad) * self.params.attitude_sigma_rad;
        Some((axis, side, reading_m * libm::cos(incidence_rad), libm::hypot(sigma_m, turn_sigma_m)))
    }

    /// A reading and its standard deviation; the nearest reading only shows that something is within it.
    fn reading(&self, reading_m: f64) -> (f64, f64) {
        let nearest_m = self.params.nearest_m;
        if reading_m > nearest_m {
            return (reading_m, self.params.range_sigma_m);
        }
        // The mean and the standard deviation of what is anywhere from 0 to the nearest reading.
        (0.5 * nearest_m, libm::hypot(self.params.range_sigma_m, nearest_m / 12.0_f64.sqrt()))
    }

    /// Returns the way of a beam's lower edge to the floor, m.
    fn floor_m(&self, state: &RangeInertialState, beam_W: &Vector3<f64>) -> f64 {
        let dive_rad = self.params.half_angle_deg.to_radians() - libm::asin(beam_W.z.clamp(-1.0, 1.0));
        if dive_rad > 0.0 { state.height_m() / libm::sin(dive_rad) } else { f64::INFINITY }
    }

    /// Forgets the walls without an echo for too long, and those further than the reach.
    fn lose_sight(&self, state: &mut RangeInertialState, now_ns: u64) {
        if self.params.room_m.is_some() {
            // They are where they were, hidden or not.
            return;
        }
        for (axis, echo_ns) in state.axes.iter_mut().zip(&state.echo_ns) {
            for side in [Side::Ahead, Side::Behind] {
                let silent_s = now_ns.saturating_sub(echo_ns[side.index()]) as f64 * 1e-9;
                let is_far = axis.distance[side.index()] > self.params.reach_m;
                if silent_s > self.params.sight_hold_s || is_far {
                    axis.lose(side);
                }
            }
        }
    }

    /// Returns the walls in the order of `LEVEL_BEAMS` along the heading at `yaw_rad`; the reach where nothing
    /// is in sight.
    #[must_use]
    pub fn walls(&self, state: &RangeInertialState, yaw_rad: f64, now_ns: u64) -> WallEstimate {
        let heading = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), yaw_rad);
        let seen = LEVEL_BEAMS.map(|direction| {
            let direction_W = heading * Vector3::from(direction);
            let (axis, side) = facing(&direction_W);
            let along_m = self.in_front_m(state, axis, side, now_ns) / direction_W[axis].abs();
            let in_sight = state.axes[axis].in_sight[side.index()];
            (if in_sight == 1 { along_m } else { self.params.reach_m }, in_sight)
        });
        let velocity_W_m_s = state.velocity_W_m_s();
        let velocity_m_s = heading.inverse() * velocity_W_m_s;
        WallEstimate {
            distance: seen.map(|(distance_m, _)| distance_m),
            in_sight: seen.map(|(_, in_sight)| in_sight),
            velocity: [velocity_m_s.x, velocity_m_s.y],
            height: state.height_m(),
            climb_rate: velocity_W_m_s.z,
            ..Default::default()
        }
    }

    /// The motion, at the attitude that is fed in: level displacement since the start, and height above the
    /// ground below.
    #[must_use]
    pub fn motion(&self, state: &RangeInertialState, attitude: &AttitudeEstimate) -> StateEstimate {
        let [x, y, z] = &state.axes;
        let height_sigma_m = z.sigma(AHEAD + Side::Behind.index());
        let [start_x_m, start_y_m] = self.params.initial_level_position_m;
        StateEstimate {
            position: [start_x_m + x.path, start_y_m + y.path, state.height_m()].into(),
            velocity: vector_message(state.velocity_W_m_s()),
            attitude: attitude.attitude,
            angular_velocity: attitude.angular_velocity,
            position_sigma: [x.sigma(PATH), y.sigma(PATH), height_sigma_m].into(),
            velocity_sigma: state.axes.map(|axis| axis.sigma(VELOCITY)).into(),
            attitude_sigma: [self.params.attitude_sigma_rad; 3].into(),
            ..Default::default()
        }
    }

    /// The distance to the object that hides the wall, or to the wall.
    fn in_front_m(&self, state: &RangeInertialState, axis: usize, side: Side, now_ns: u64) -> f64 {
        let side = side.index();
        let seen_ns = state.obstacle_ns[axis][side];
        let hold_ns = self.params.sight_hold_s * 1e9;
        let is_hidden = seen_ns > state.echo_ns[axis][side] && ((now_ns - seen_ns) as f64) < hold_ns;
        if is_hidden { state.obstacle[axis][side] } else { state.axes[axis].distance[side] }
    }
}

impl RangeInertialState {
    /// Velocity, world axes, m/s.
    #[must_use]
    pub fn velocity_W_m_s(&self) -> Vector3<f64> {
        Vector3::from(self.axes.map(|axis| axis.velocity))
    }

    /// Height above the ground below, m.
    #[must_use]
    pub fn height_m(&self) -> f64 {
        self.axes[2].distance[Side::Behind.index()]
    }

    fn remember(&mut self, attitude: Quaternion) {
        let path = self.axes.map(|axis| axis.path).into();
        self.past[self.samples as usize % PAST] = Past { path, attitude };
        self.samples += 1;
    }

    /// Returns the vehicle's place `samples` samples ago, if that is remembered.
    fn past(&self, samples: f64) -> Option<Past> {
        let back = samples.round() as u64;
        let is_known = back < self.samples.min(PAST as u64);
        is_known.then(|| self.past[(self.samples - 1 - back) as usize % PAST])
    }
}

fn beam_B(beam: usize) -> Vector3<f64> {
    LEVEL_BEAMS.get(beam).map_or(-Vector3::z(), |&direction| Vector3::from(direction))
}

/// The level axis of the world, and the side of it, that is nearest to a direction.
fn facing(direction_W: &Vector3<f64>) -> (usize, Side) {
    let axis = usize::from(direction_W.x.abs() < direction_W.y.abs());
    (axis, if direction_W[axis] > 0.0 { Side::Ahead } else { Side::Behind })
}
