//! A flight made ready for comparison: its grid, its knots, and which equations it can be held against.
#![allow(non_snake_case, reason = "a trailing _W or _B names the frame a vector is written in")]

use crate::data::clock::{Clock, Lateness};
use crate::data::measured::Measured;
use crate::data::memo::{Memo, Recent};
use crate::data::rig;
use crate::data::rotor_track::{EachRotor, Rotors};
use crate::data::sensing::SensorErrors;
use crate::data::track::{Track, valid_about};
use crate::data::unusable::Unusable;
use crate::data::window::{NUMEROV, SIMPSON, Window, central_difference, second_difference};
use flights::{Channel, Flight, KnownRotors, MeasuredVoltage, SETTLE_S};
use nalgebra::{Quaternion, UnitQuaternion, Vector3};
use std::borrow::Cow;
use std::ops::Range;
use std::sync::Arc;
use vehicles::{CommandMap, MotorModel, ROTORS_MAX, Vehicle};

/// An equation that measurement and model are both put into.
///
/// ```
/// use identify::Equation;
///
/// let force = Equation::SpecificForce;
/// assert_eq!((force.name(), force.unit(), force.size()), ("specific_force", "m/s^2", 3));
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Equation {
    /// Specific force in B, read by the accelerometer: forces.
    SpecificForce,
    /// Acceleration in W, from position or else from velocity: forces and gravity.
    Acceleration,
    /// Angular acceleration in B, from the gyroscope or else from the attitude: torques.
    AngularAcceleration,
    /// Angular velocity in B from the gyroscope against the attitude's rate of change: the sensors alone.
    Gyroscope,
    /// Measured speeds of the rotors against those that follow from the commands.
    /// It has so many rotors.
    RotorSpeed(usize),
}

impl Equation {
    /// Returns the number of its components.
    #[must_use]
    pub fn size(self) -> usize {
        if let Equation::RotorSpeed(count) = self { count } else { 3 }
    }

    /// Returns its name in reports.
    #[must_use]
    pub fn name(self) -> &'static str {
        self.name_and_unit().0
    }

    /// The unit of its residual.
    #[must_use]
    pub fn unit(self) -> &'static str {
        self.name_and_unit().1
    }

    fn name_and_unit(self) -> (&'static str, &'static str) {
        match self {
            Equation::SpecificForce => ("specific_force", "m/s^2"),
            Equation::Acceleration => ("acceleration", "m/s^2"),
            Equation::AngularAcceleration => ("angular_acceleration", "rad/s^2"),
            Equation::Gyroscope => ("gyroscope", "rad/s"),
            Equation::RotorSpeed(_) => ("rotor_speed", "rad/s"),
        }
    }
}

/// A channel that an acceleration in W follows from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Translation {
    /// By its second derivative.
    Position,
    /// By its first.
    Velocity,
}

impl Translation {
    fn channel(self, flight: &Flight) -> &Channel<3> {
        match self {
            Translation::Position => &flight.position,
            Translation::Velocity => &flight.velocity,
        }
    }

    /// Measured side and model side.
    fn windows(self, step_s: f64) -> (Window, Window) {
        let plain = Window::b_spline(BOX_STEPS);
        match self {
            Translation::Position => (plain.behind(second_difference(step_s)), plain.behind(NUMEROV)),
            Translation::Velocity => (plain.behind(central_difference(step_s)), plain.behind(SIMPSON)),
        }
    }
}

/// Grid, windows and equations with which a flight is read.
#[derive(Debug, Clone)]
pub struct Layout {
    /// The grid.
    pub clock: Clock,
    /// Middles of the windows that are compared.
    pub knots: Vec<usize>,
    /// The equations, in the order of their rows.
    pub equations: Vec<Equation>,
    /// Measured side and model side of each equation.
    pub windows: Vec<(Window, Window)>,
}

/// Measured channels on the grid.
#[derive(Debug, Clone)]
pub struct Tracks {
    /// Position in W.
    pub position: Track<3>,
    /// Velocity in W, measured or else from the position.
    pub velocity: Vec<[f64; 3]>,
    /// Attitude, B to W.
    pub attitude: Vec<UnitQuaternion<f64>>,
    /// Angular velocity in B.
    pub rates: Vec<[f64; 3]>,
    /// The measured side of every row: for each knot, each equation's components.
    pub rows: Vec<f64>,
}

/// Grid steps in a box of the window, which is also the way from knot to knot.
pub const BOX_STEPS: usize = 5;

/// Samples are kept so far before and behind a piece of a flight, in s: beyond all delays that are tried.
const BESIDE_S: f64 = 1.0;
/// Delays of sensors that are tried take samples from beside an instant: so much is left out at the ends of a flight.
const END_MARGIN_S: f64 = 0.2;
/// And so much about its gaps, where that leaves at least [`WORTH`] of the windows.
const GAP_MARGIN_S: f64 = 0.1;
const WORTH: f64 = 0.9;

/// Far below any tick, and above the rounding of times from which seconds since 1970 were subtracted.
const SLACK_S: f64 = 1e-6;

/// A flight with its layout.
#[derive(Debug)]
pub struct Prepared<'f> {
    /// The flight.
    pub flight: Cow<'f, Flight>,
    /// Its layout.
    pub layout: Layout,
    /// Lateness of its pose beyond that of `sensor-delay`, and of its rotor speeds.
    pub late: Lateness,
    /// Rotors whose measured speed is not believed.
    pub distrusted: [bool; ROTORS_MAX],
    /// The period of commands that are logged slower than the motors follow, without measured speeds.
    pub slow_period_s: Option<f64>,
    /// Rows that were computed lately.
    pub memo: Memo,
    /// Tracks, by the delays of pose and inertial unit, and the lateness of the pose.
    recent_tracks: Recent<(f64, f64, Lateness), Tracks>,
    /// Measured rotors, by the delay of the pose.
    pub recent_rotors: Recent<f64, Rotors>,
    /// Measured states for predictions, by the errors of the sensors; `None` where there is nothing to predict with.
    pub recent_measured: Recent<SensorErrors, Option<Measured>>,
    /// Number of the flight among the fit flights that may have a wind of their own.
    pub number: Option<usize>,
    /// True if the vehicle accelerates as it leans, or moves further to the side than any rig allows.
    pub moves_freely: bool,
    /// The measured voltage of the battery over the whole flight.
    pub voltage: Option<Arc<MeasuredVoltage>>,
}

/// Commands farther apart than this many time constants of the motors say nothing on most of the time between them.
const UNKNOWN_BETWEEN: f64 = 2.0;

impl<'f> Prepared<'f> {
    /// The flight on its grid.
    ///
    /// # Errors
    /// If the flight has less than three windows to compare: no drive, no motion, too little of both in flight.
    pub fn new(flight: &'f Flight, box_s: Option<f64>, propulsion: &Propulsion) -> Result<Self, Unusable> {
        let slow_period_s = propulsion.slow_period_s(flight);
        // Between slow commands nobody knows the others that were not logged: their repeats are none.
        let each_once = slow_period_s.and_then(|_| flight.without_held_commands());
        let used = each_once.map_or(Cow::Borrowed(flight), Cow::Owned);
        let flight = &*used;
        let moves_freely = rig::moves_freely(flight, propulsion.gravity_m_s2);
        let equations = equations(flight, slow_period_s.is_some());
        let motor_s = propulsion.motor_s;
        if let Some(period_s) = slow_period_s.filter(|period_s| *period_s > UNKNOWN_BETWEEN * motor_s) {
            return Err(Unusable::UnknownBetween { period_s, motor_s });
        }
        if equations.iter().all(|equation| matches!(equation, Equation::RotorSpeed(_))) {
            let slow = slow_period_s.map(|period_s| Unusable::SlowCommands { period_s, motor_s });
            return Err(Unusable::of_channels(flight).or(slow).unwrap_or(Unusable::NoMotion));
        }
        Unusable::of_channels(flight).map_or(Ok(()), Err)?;
        let shows_forces = [Equation::SpecificForce, Equation::Acceleration];
        if flight.without_torques && !equations.iter().any(|equation| shows_forces.contains(equation)) {
            return Err(Unusable::NothingCompared);
        }
        let apart = || Unusable::Apart { spans: flight.spans() };
        let (start_s, end_s) = common_span(flight, &equations).ok_or_else(apart)?;
        // At 100 Hz windows of 0.12 s.
        let box_s = box_s.unwrap_or_else(|| (3.0 * slowest_period_s(flight).unwrap_or(0.0)).max(0.02));
        // Windows over several commands: within one, nobody knows the others that were not logged.
        let box_s = box_s.max(slow_period_s.unwrap_or(0.0));
        let step_s = box_s / BOX_STEPS as f64;
        let clock = Clock::spanning(start_s, end_s, step_s);
        let windows = equations.iter().map(|equation| windows(*equation, flight, step_s)).collect();
        let layout = Layout { clock, knots: Vec::new(), equations, windows };
        let (late, distrusted) = (Lateness::default(), [false; ROTORS_MAX]);
        let voltage = MeasuredVoltage::of(flight).map(Arc::new);
        let mut prepared = Self {
            flight: used,
            layout,
            late,
            distrusted,
            slow_period_s,
            memo: Memo::default(),
            recent_tracks: Recent::default(),
            recent_rotors: Recent::default(),
            recent_measured: Recent::default(),
            number: None,
            moves_freely,
            voltage,
        };
        prepared.layout.knots = prepared.knots(propulsion);
        if prepared.layout.knots.len() >= 3 { Ok(prepared) } else { Err(prepared.unusable(propulsion)) }
    }

    /// The flight with these `pieces` of its grid alone, ranges of instants in rising order. A piece's knots are those whose windows lie in it, with
    /// rotors that have settled.
    pub fn within(&self, pieces: &[Range<usize>]) -> Self {
        let clock = self.layout.clock.within(pieces);
        let (before, behind) = self.margins();
        let (mut knots, mut first) = (Vec::new(), 0);
        for piece in pieces {
            let inside = piece.start + before..piece.end.saturating_sub(behind);
            let of_piece = self.layout.knots.iter().filter(|knot| inside.contains(knot));
            knots.extend(of_piece.map(|knot| knot - piece.start + first));
            first += piece.len();
        }
        // Delays take samples from beside an instant.
        let sampled_s: Vec<(f64, f64)> =
            clock.pieces_s().iter().map(|(from_s, to_s)| (from_s - BESIDE_S, to_s + BESIDE_S)).collect();
        Self {
            flight: Cow::Owned(Flight {
                command: self.flight.command.clone(),
                ..self.flight.within(&sampled_s)
            }),
            layout: Layout { clock, knots, ..self.layout.clone() },
            late: self.late,
            distrusted: self.distrusted,
            slow_period_s: self.slow_period_s,
            memo: Memo::default(),
            recent_tracks: Recent::default(),
            recent_rotors: Recent::default(),
            recent_measured: Recent::default(),
            number: self.number,
            moves_freely: self.moves_freely,
            voltage: self.voltage.clone(),
        }
    }

    /// Instants from the begin of a piece of the flight to its first knot, and from its last knot to its end.
    pub fn margins(&self) -> (usize, usize) {
        // Slopes on the grid take a box to both sides.
        let reach = self.reach() + BOX_STEPS;
        ((self.settling_s() / self.layout.clock.step_s).ceil() as usize + reach, reach)
    }

    /// Time after which rotors are known that are simulated from any state on.
    pub fn settling_s(&self) -> f64 {
        if self.flight.command.is_empty() { 0.0 } else { SETTLE_S }
    }

    /// The reason why less than three windows are left.
    fn unusable(&self, propulsion: &Propulsion) -> Unusable {
        let (flight, clock) = (&*self.flight, &self.layout.clock);
        let (from_s, to_s) = (clock.at(0), clock.at(clock.count - 1));
        let known = KnownRotors::of(flight);
        if !known.stretches_s().iter().any(|stretch| stretch.0 < to_s && from_s < stretch.1) {
            let stretches: Vec<String> = known
                .stretches_s()
                .iter()
                .map(|(from_s, to_s)| format!("from {from_s:.3} s to {to_s:.3} s"))
                .collect();
            let known = if stretches.is_empty() { "nowhere".to_owned() } else { stretches.join(", ") };
            return Unusable::UnknownRotors { known, from_s, to_s };
        }
        let fastest = propulsion.speeds(flight, clock).into_iter().fold(0.0, f64::max);
        if fastest <= propulsion.least_rad_s {
            return Unusable::of_speeds(flight, fastest, propulsion.least_rad_s);
        }
        let box_s = BOX_STEPS as f64 * clock.step_s;
        Unusable::Short {
            left_s: box_s * self.layout.knots.len() as f64,
            window_s: 4.0 * box_s,
            common_s: to_s - from_s,
        }
    }

    /// True if its attitude or its rates were assumed instead of measured.
    pub fn is_assumed(&self) -> bool {
        !self.flight.assumed.is_empty()
    }

    /// True if predictions take the measured attitude and rates, because torques are not compared.
    pub fn turns_as_measured(&self) -> bool {
        let turns = !(self.flight.attitude.is_empty() && self.flight.angular_velocity.is_empty());
        turns && self.offset_of(Equation::AngularAcceleration).is_none()
    }

    /// Length of the compared part, in s.
    pub fn compared_s(&self) -> f64 {
        self.layout.knots.len() as f64 * BOX_STEPS as f64 * self.layout.clock.step_s
    }

    /// Rows of one knot.
    pub fn width(&self) -> usize {
        self.layout.equations.iter().map(|equation| equation.size()).sum()
    }

    /// The equation of the rotor speeds.
    pub fn rotor_speed(&self) -> Equation {
        Equation::RotorSpeed(self.flight.rotors)
    }

    /// Returns the index of the first row of `equation` within a knot.
    pub fn offset_of(&self, equation: Equation) -> Option<usize> {
        let at = self.layout.equations.iter().position(|known| *known == equation)?;
        Some(self.layout.equations[..at].iter().map(|equation| equation.size()).sum())
    }

    /// Returns the measured channels, with the pose late by `pose_s` and the inertial unit by `imu_s`.
    ///
    /// The instants are those of the pose's stamps, so another delay of the pose shifts all channels but the
    /// pose. The noise that interpolation leaves depends on how the samples of a slow and noisy channel lie on
    /// the grid. If the pose were shifted, a fit would move its samples to where that noise is least.
    pub fn tracks(&self, pose_s: f64, imu_s: f64) -> Arc<Tracks> {
        self.recent_tracks.at((pose_s, imu_s, self.late), || self.sampled(pose_s, imu_s))
    }

    fn sampled(&self, pose_s: f64, imu_s: f64) -> Tracks {
        let (flight, clock) = (&*self.flight, &self.layout.clock);
        let imu_s = imu_s - pose_s;
        let position = Track::sampled(&flight.position, self.late.position_s, clock);
        let velocity_track = Track::sampled(&flight.velocity, self.late.velocity_s, clock);
        let velocity = if flight.velocity.is_empty() {
            position.slope(BOX_STEPS, clock.step_s)
        } else {
            velocity_track.values.clone()
        };
        let attitude = attitudes(&Track::sampled(&flight.attitude, self.late.attitude_s, clock));
        let turning = turning(&attitude, clock.step_s);
        let gyroscope = Track::sampled(&flight.angular_velocity, imu_s, clock);
        let force = Track::sampled(&flight.specific_force, imu_s, clock);
        let is_of_rotors = self.offset_of(self.rotor_speed()).is_some();
        let speeds = if is_of_rotors { self.rotor_speeds(pose_s) } else { Track::default() };
        let rates = if flight.angular_velocity.is_empty() {
            Track { values: turning.clone(), valid: Vec::new() }.smoothed(BOX_STEPS / 2)
        } else {
            gyroscope.values.clone()
        };
        let translation = if flight.position.is_empty() { &velocity_track } else { &position };
        let rotation = if flight.angular_velocity.is_empty() { &turning } else { &gyroscope.values };
        let mut rows = Vec::with_capacity(self.layout.knots.len() * self.width());
        for &knot in &self.layout.knots {
            for (equation, (measured, model)) in self.layout.equations.iter().zip(&self.layout.windows) {
                match equation {
                    Equation::SpecificForce => rows.extend(measured.over(&force.values, knot)),
                    Equation::Acceleration => rows.extend(measured.over(&translation.values, knot)),
                    Equation::AngularAcceleration => rows.extend(measured.over(rotation, knot)),
                    Equation::Gyroscope => {
                        let (gyro, turned) =
                            (model.over(&gyroscope.values, knot), measured.over(&turning, knot));
                        rows.extend((0..3).map(|axis| gyro[axis] - turned[axis]));
                    }
                    Equation::RotorSpeed(count) => {
                        rows.extend(&measured.over(&speeds.values, knot)[..*count])
                    }
                }
            }
        }
        Tracks { position, velocity, attitude, rates, rows }
    }

    /// The measured rotor speeds, with the pose late by `pose_s`.
    pub fn rotor_speeds(&self, pose_s: f64) -> Track<ROTORS_MAX> {
        Track::sampled(&self.flight.rotor_speed, self.late.rotor_speed_s - pose_s, &self.layout.clock)
    }

    /// The acceleration in W by position or velocity alone, seen through the windows: three components for each knot;
    /// `None` where that is not logged, or not compared.
    pub fn translation_rows(&self, translation: Translation) -> Option<Vec<f64>> {
        self.offset_of(Equation::Acceleration).filter(|_| !self.is_assumed())?;
        let channel = translation.channel(&self.flight);
        let (measured, _) = translation.windows(self.layout.clock.step_s);
        let values = || Track::sampled(channel, 0.0, &self.layout.clock).values;
        (!channel.is_empty()).then(|| self.rows_over(&measured, &values()))
    }

    /// The same by accelerometer and attitude, late by `force_s` and `attitude_s`.
    pub fn inertial_rows(
        &self,
        translation: Translation,
        attitude_s: f64,
        force_s: f64,
        gravity_m_s2: f64,
    ) -> Vec<f64> {
        let clock = &self.layout.clock;
        let attitude_WB = attitudes(&Track::sampled(&self.flight.attitude, attitude_s, clock));
        let force_B = Track::sampled(&self.flight.specific_force, force_s, clock);
        let turned = |(attitude_WB, force_B): (&UnitQuaternion<f64>, &[f64; 3])| {
            (attitude_WB * Vector3::from(*force_B) - gravity_m_s2 * Vector3::z()).into()
        };
        let acceleration_W: Vec<[f64; 3]> = attitude_WB.iter().zip(&force_B.values).map(turned).collect();
        self.rows_over(&translation.windows(clock.step_s).1, &acceleration_W)
    }

    /// Takes its pose and rotor speeds as `late`, and leaves out the knots about which it was not sampled then.
    pub fn set_late(&mut self, late: Lateness) {
        self.late = late;
        let (flight, clock) = (&*self.flight, &self.layout.clock);
        let reach = self.reach();
        let moved = [
            sampled_if_late(&flight.attitude, late.attitude_s, clock),
            sampled_if_late(&flight.position, late.position_s, clock),
            sampled_if_late(&flight.velocity, late.velocity_s, clock),
            sampled_if_late(&flight.rotor_speed, late.rotor_speed_s, clock),
        ];
        for is_valid in moved.into_iter().flatten() {
            let about = valid_about(&is_valid, reach);
            self.layout.knots.retain(|knot| about[*knot]);
        }
        // Their rows are those of the knots before.
        (self.memo, self.recent_tracks, self.recent_rotors, self.recent_measured) = Default::default();
    }

    /// Instants that a window reaches to both sides.
    pub fn reach(&self) -> usize {
        self.layout.windows.iter().map(|(a, b)| a.reach().max(b.reach())).max().unwrap_or(0)
    }

    fn rows_over(&self, window: &Window, values: &[[f64; 3]]) -> Vec<f64> {
        self.layout.knots.iter().flat_map(|knot| window.over(values, *knot)).collect()
    }

    /// Middles of windows in which every compared channel was sampled and the motors were running.
    fn knots(&self, propulsion: &Propulsion) -> Vec<usize> {
        let of = |gap_margin_s: f64| self.knots_within(&self.valid(propulsion, gap_margin_s));
        let (wide, all) = (of(GAP_MARGIN_S), of(0.0));
        if wide.len() as f64 >= WORTH * all.len() as f64 { wide } else { all }
    }

    fn knots_within(&self, valid: &[bool]) -> Vec<usize> {
        let reach = self.reach();
        let (about, last) = (valid_about(valid, reach), valid.len().saturating_sub(reach + 1));
        (reach..last).step_by(BOX_STEPS).filter(|knot| about[*knot]).collect()
    }

    fn valid(&self, propulsion: &Propulsion, gap_margin_s: f64) -> Vec<bool> {
        let (flight, clock) = (&*self.flight, &self.layout.clock);
        let mut valid = vec![true; clock.count];
        let mut require = |other: Vec<bool>| valid.iter_mut().zip(other).for_each(|(all, one)| *all &= one);
        let about = [
            sampled_about(&flight.position, uses_pose(flight), clock, gap_margin_s),
            sampled_about(&flight.velocity, of_velocity(flight), clock, gap_margin_s),
            sampled_about(&flight.attitude, true, clock, gap_margin_s),
            sampled_about(&flight.angular_velocity, true, clock, gap_margin_s),
            sampled_about(&flight.specific_force, true, clock, gap_margin_s),
        ];
        about.into_iter().flatten().for_each(&mut require);
        if !flight.rotor_speed.is_empty() {
            require(Track::sampled(&flight.rotor_speed, 0.0, clock).valid);
        }
        if !flight.command.is_empty() {
            let known = KnownRotors::of(flight);
            // The rotors are simulated from the first instant on.
            let is_known = |at_s: f64| at_s - clock.at(0) >= SETTLE_S && known.hold(at_s, at_s);
            require((0..clock.count).map(|index| is_known(clock.at(index))).collect());
        }
        require(
            propulsion
                .speeds(flight, clock)
                .into_iter()
                .map(|speed| speed > propulsion.least_rad_s)
                .collect(),
        );
        valid
    }
}

/// A motor that turns below this part of the hover speed does not carry the vehicle.
const FLYING: f64 = 0.5;

/// Facts of a vehicle's rotors by which flights are read.
#[derive(Debug, Clone, Copy)]
pub struct Propulsion {
    command: CommandMap,
    /// Mean speed of the rotors above which the vehicle is in the air.
    least_rad_s: f64,
    gravity_m_s2: f64,
    /// Time constant of the motors.
    pub motor_s: f64,
}

impl Propulsion {
    /// Facts of `vehicle`.
    pub fn of(vehicle: &Vehicle) -> Self {
        let motor_s = match vehicle.motor {
            MotorModel::FirstOrder { time_constant_s } => time_constant_s,
            MotorModel::SecondOrder { natural_frequency_rad_s, .. } => 1.0 / natural_frequency_rad_s,
        };
        Self {
            command: vehicle.command,
            least_rad_s: FLYING * vehicle.hover_speed_rad_s(),
            gravity_m_s2: vehicle.gravity_m_s2,
            motor_s,
        }
    }

    /// Longest period of commands that show how the motors follow: two samples within their time constant.
    pub fn longest_period_s(&self) -> f64 {
        self.motor_s / 2.0
    }

    /// The period of the commands of `flight`, if it is too long for the motors and no speeds were measured.
    fn slow_period_s(&self, flight: &Flight) -> Option<f64> {
        let is_known =
            flight.commands_on_change || !flight.rotor_speed.is_empty() || !flight.assumed.is_empty();
        flight.command_period_s().filter(|period_s| !is_known && *period_s > self.longest_period_s())
    }

    /// Mean speeds of the rotors at the instants of `clock`, by commands or else as measured.
    fn speeds(&self, flight: &Flight, clock: &Clock) -> Vec<f64> {
        let mean = |speeds: EachRotor| speeds.iter().sum::<f64>() / flight.rotors as f64;
        if flight.command.is_empty() {
            let measured = Track::sampled(&flight.rotor_speed, 0.0, clock).values;
            return measured.into_iter().map(mean).collect();
        }
        let mut held = Held::new(&flight.command);
        let commanded = |index| {
            let mut each = held.at(clock.at(index));
            each[..flight.rotors].iter_mut().for_each(|command| *command = self.command.speed(*command));
            each
        };
        (0..clock.count).map(commanded).map(mean).collect()
    }
}

/// Returns for each instant whether a channel that is `late_s` late was sampled there; `None` if it is not late
/// or not logged.
fn sampled_if_late<const N: usize>(channel: &Channel<N>, late_s: f64, clock: &Clock) -> Option<Vec<bool>> {
    (late_s != 0.0 && !channel.is_empty()).then(|| Track::sampled(channel, late_s, clock).valid)
}

/// Returns for each instant whether a channel was sampled there, and at `gap_margin_s` before and after it.
/// Instants at the channel's ends do not count as sampled. `None` if the channel is not compared, or was not
/// logged.
fn sampled_about<const N: usize>(
    channel: &Channel<N>,
    is_compared: bool,
    clock: &Clock,
    gap_margin_s: f64,
) -> Option<Vec<bool>> {
    if !is_compared || channel.is_empty() {
        return None;
    }
    let mut valid = Track::sampled(channel, 0.0, clock).valid;
    for delay_s in [-gap_margin_s, gap_margin_s] {
        let trial = Track::sampled(channel, delay_s, clock).valid;
        valid.iter_mut().zip(trial).for_each(|(all, one)| *all &= one);
    }
    let (first_s, last_s) = channel.span_s().unwrap_or_default();
    let inside = first_s + END_MARGIN_S..=last_s - END_MARGIN_S;
    let at_instants = valid.iter_mut().enumerate();
    at_instants.for_each(|(index, is_valid)| *is_valid &= inside.contains(&clock.at(index)));
    Some(valid)
}

/// A channel whose samples hold until the next.
#[derive(Debug)]
pub struct Held<'c> {
    channel: &'c Channel<ROTORS_MAX>,
    next: usize,
}

impl<'c> Held<'c> {
    /// From its beginning.
    pub fn new(channel: &'c Channel<ROTORS_MAX>) -> Self {
        Self { channel, next: 0 }
    }

    /// Returns the sample that holds at `at_s`, before the first sample the first. Times have to grow from call
    /// to call.
    pub fn at(&mut self, at_s: f64) -> EachRotor {
        // Times are differences of decimal fractions since 1970: the slack puts an instant on its own sample.
        while self.next < self.channel.time_s.len() && self.channel.time_s[self.next] <= at_s + SLACK_S {
            self.next += 1;
        }
        self.channel.values[self.next.saturating_sub(1)]
    }

    /// The commands at `at_s`, interpolated between the logged ones; times have to grow from call to call.
    pub fn between(&mut self, at_s: f64) -> EachRotor {
        let before = self.at(at_s);
        let (Some(last), Some(next_s)) = (self.next.checked_sub(1), self.channel.time_s.get(self.next))
        else {
            return before;
        };
        let (last_s, after) = (self.channel.time_s[last], self.channel.values[self.next]);
        let part = ((at_s - last_s) / (next_s - last_s)).clamp(0.0, 1.0);
        std::array::from_fn(|i| before[i] + part * (after[i] - before[i]))
    }

    /// The mean of the held values from `from_s` to `to_s`; times have to grow from call to call.
    pub fn mean(&mut self, from_s: f64, to_s: f64) -> EachRotor {
        let (mut at_s, mut sum) = (from_s, [0.0; ROTORS_MAX]);
        loop {
            let value = self.at(at_s);
            let end_s = self.channel.time_s.get(self.next).copied().unwrap_or(f64::INFINITY);
            if end_s >= to_s - SLACK_S {
                let part = (to_s - at_s) / (to_s - from_s);
                // One that holds all the time is not rounded.
                return if at_s == from_s {
                    value
                } else {
                    std::array::from_fn(|i| sum[i] + part * value[i])
                };
            }
            let part = (end_s - at_s) / (to_s - from_s);
            sum.iter_mut().zip(value).for_each(|(sum, value)| *sum += part * value);
            at_s = end_s;
        }
    }
}

/// Windows of flights without an inertial unit: twice a derivative of a position needs more of it.
const POSE_BOX_S: f64 = 0.04;

/// The box of a flight's windows, in s; `None` for that of its slowest channel.
pub fn box_s(flight: &Flight) -> Option<f64> {
    let has_imu = !flight.angular_velocity.is_empty() || !flight.specific_force.is_empty();
    let period_s = flight.attitude.period_s().unwrap_or(0.0).max(flight.position.period_s().unwrap_or(0.0));
    (!has_imu).then_some((3.0 * period_s).max(POSE_BOX_S))
}

/// Length of the blocks of time that count as independent, where so much is compared: about 40 of them.
pub fn block_s(total_s: f64) -> f64 {
    (total_s / 40.0).clamp(0.5, 2.0)
}

/// True if accelerations come from the velocity.
fn of_velocity(flight: &Flight) -> bool {
    uses_pose(flight) && flight.position.is_empty()
}

fn uses_pose(flight: &Flight) -> bool {
    !flight.attitude.is_empty()
}

/// The equations that the channels of a flight allow.
fn equations(flight: &Flight, is_slow: bool) -> Vec<Equation> {
    let has_position = !flight.position.is_empty() || !flight.velocity.is_empty();
    let (has_attitude, has_gyroscope) = (!flight.attitude.is_empty(), !flight.angular_velocity.is_empty());
    // An assumed attitude says nothing that a gyroscope could be held against.
    let is_assumed = !flight.assumed.is_empty();
    let has_both_speeds = !flight.rotor_speed.is_empty() && !flight.command.is_empty();
    let all = [
        (Equation::SpecificForce, !flight.specific_force.is_empty()),
        (Equation::Acceleration, has_position && has_attitude),
        // Torques follow commands that were not logged.
        (
            Equation::AngularAcceleration,
            (has_attitude || has_gyroscope) && !is_slow && !flight.without_torques,
        ),
        (Equation::Gyroscope, has_attitude && has_gyroscope && !is_assumed),
        (Equation::RotorSpeed(flight.rotors), has_both_speeds),
    ];
    all.into_iter().filter(|(_, is_there)| *is_there).map(|(equation, _)| equation).collect()
}

fn windows(equation: Equation, flight: &Flight, step_s: f64) -> (Window, Window) {
    let plain = Window::b_spline(BOX_STEPS);
    let central = central_difference(step_s);
    match equation {
        Equation::SpecificForce | Equation::RotorSpeed(_) => (plain.clone(), plain),
        Equation::Acceleration if flight.position.is_empty() => Translation::Velocity.windows(step_s),
        Equation::Acceleration => Translation::Position.windows(step_s),
        Equation::AngularAcceleration if flight.angular_velocity.is_empty() => {
            (plain.behind(central), plain.behind(SIMPSON).behind(SIMPSON))
        }
        Equation::AngularAcceleration => (plain.behind(central), plain.behind(SIMPSON)),
        // The attitude's rate is a mean over two steps, so the gyroscope is averaged alike.
        Equation::Gyroscope => (plain.clone(), plain.behind(SIMPSON)),
    }
}

/// The time in which all compared channels were sampled.
fn common_span(flight: &Flight, equations: &[Equation]) -> Option<(f64, f64)> {
    let drive = match flight.command.span_s() {
        None => flight.rotor_speed.span_s(),
        // The last command holds.
        Some((first_s, _)) if flight.commands_on_change => Some((first_s, f64::INFINITY)),
        span => span,
    };
    let motion = [
        flight.position.span_s().filter(|_| equations.contains(&Equation::Acceleration)),
        flight.velocity.span_s().filter(|_| of_velocity(flight)),
        flight.attitude.span_s(),
        flight.angular_velocity.span_s(),
        flight.specific_force.span_s(),
    ];
    let spans = motion.into_iter().flatten().chain([drive?]);
    Some(spans.fold((f64::MIN, f64::MAX), |(start, end), span| (start.max(span.0), end.min(span.1))))
        .filter(|(start, end)| end > start)
}

/// The longest of the periods of the compared channels.
fn slowest_period_s(flight: &Flight) -> Option<f64> {
    let periods = [
        flight.position.period_s(),
        flight.velocity.period_s().filter(|_| of_velocity(flight)),
        flight.attitude.period_s(),
        flight.angular_velocity.period_s(),
        flight.specific_force.period_s(),
    ];
    periods.into_iter().flatten().reduce(f64::max)
}

/// The attitudes of quaternions that were interpolated, and so are not of length one.
pub fn attitudes(track: &Track<4>) -> Vec<UnitQuaternion<f64>> {
    let unit = |[w, x, y, z]: &[f64; 4]| {
        let raw = Quaternion::new(*w, *x, *y, *z);
        if raw.norm() > 1e-6 { UnitQuaternion::new_normalize(raw) } else { UnitQuaternion::identity() }
    };
    track.values.iter().map(unit).collect()
}

/// The mean angular velocity in B from the instant before to the instant after.
fn turning(attitude: &[UnitQuaternion<f64>], step_s: f64) -> Vec<[f64; 3]> {
    let count = attitude.len();
    let between =
        |i: usize| -> Vector3<f64> { (attitude[i].inverse() * attitude[i + 1]).scaled_axis() / step_s };
    if count < 3 {
        return vec![[0.0; 3]; count];
    }
    let about = |i: usize| ((between(i - 1) + between(i)) / 2.0).into();
    (0..count).map(|i| about(i.clamp(1, count - 2))).collect()
}
