//! One rotor of one flight: the commands that went in, and the speeds that came out.

use std::ops::Range;

use flights::{Flight, KnownRotors, SETTLE_S};
use vehicles::gaps::held_period_s;
use vehicles::{CommandMap, Vehicle};

use super::blocks::Blocks;
use super::voltage::Voltage;
use crate::rotor::response::Lag;

/// Speeds are compared no more often than this: the noise model looks back over sixteen of them.
const PERIOD_MIN_S: f64 = 0.004;
/// A gap of the speeds is a time without samples of more than so many periods.
const GAP_PERIODS: f64 = 3.5;
/// Slack at the ends of stretches: times are differences of decimal fractions.
const SLACK_S: f64 = 1e-6;

/// A command, from when on it holds.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Input {
    /// Time of the command in the log, in s.
    pub time_s: f64,
    /// Part of the range of the command map: 0 at its least command, 1 at its greatest.
    pub share: f64,
    /// 1 if the motor is on; 0 if the command switches it off.
    pub on: f64,
    /// Logarithm of the battery's voltage by the reference when the command was logged; 0 without a voltage.
    pub log_voltage: f64,
}

/// One rotor of one flight.
#[derive(Debug, Clone)]
pub struct Course {
    /// Number of the flight.
    pub flight: usize,
    /// Number of the rotor.
    pub rotor: usize,
    /// Commands.
    pub inputs: Vec<Input>,
    /// Voltage of the battery, if it counts.
    pub voltage: Option<Voltage>,
    /// Times of the speeds that are compared, in s.
    pub time_s: Vec<f64>,
    /// Speeds in rad/s.
    pub speed_rad_s: Vec<f64>,
    /// Samples without a gap between them.
    pub stretches: Vec<Range<usize>>,
    /// Block of time of each sample.
    pub blocks: Vec<usize>,
}

/// Returns the courses of the rotors of a flight; none without commands or without speeds.
pub fn courses(
    number: usize,
    flight: &Flight,
    vehicle: &Vehicle,
    voltage: Option<&Voltage>,
    blocks: &Blocks,
) -> Vec<Course> {
    if flight.command.is_empty() || flight.rotor_speed.is_empty() {
        return Vec::new();
    }
    let kept = kept(flight);
    let working = (0..flight.rotors).filter(|rotor| !vehicle.rotors[*rotor].has_failed);
    let course = |rotor: usize| course(number, rotor, flight, &vehicle.command, voltage, &kept, blocks);
    working.map(course).filter(|course| !course.time_s.is_empty()).collect()
}

/// Indices of the speeds that are compared: where the commands are known, and not more often than needed.
fn kept(flight: &Flight) -> Vec<usize> {
    let known = KnownRotors::of(flight);
    let period_s = flight.rotor_speed.period_s().unwrap_or(PERIOD_MIN_S);
    let every = (PERIOD_MIN_S / period_s + SLACK_S).floor().max(1.0) as usize;
    let times_s = flight.rotor_speed.time_s.iter().enumerate().step_by(every);
    times_s.filter(|(_, time_s)| known.hold(**time_s, **time_s)).map(|(index, _)| index).collect()
}

fn course(
    number: usize,
    rotor: usize,
    flight: &Flight,
    map: &CommandMap,
    voltage: Option<&Voltage>,
    kept: &[usize],
    blocks: &Blocks,
) -> Course {
    let commands = flight.command.time_s.iter().zip(&flight.command.values);
    let input = |(time_s, command): (&f64, &[f64; vehicles::ROTORS_MAX])| Input {
        time_s: *time_s,
        share: share(map, command[rotor]),
        on: if map.zero_is_off && command[rotor] <= 0.0 { 0.0 } else { 1.0 },
        log_voltage: voltage.map_or(0.0, |voltage| voltage.log_at(*time_s)),
    };
    let mut inputs: Vec<Input> = commands.map(input).collect();
    // A command that repeats the last one changes nothing.
    inputs.dedup_by(|next, last| Input { time_s: last.time_s, ..*next } == *last);
    let turns = turning(&inputs);
    let speed = |index: &usize| (flight.rotor_speed.time_s[*index], flight.rotor_speed.values[*index][rotor]);
    let is_used = |(time_s, speed): &(f64, f64)| speed.is_finite() && turns(*time_s);
    let (time_s, speed_rad_s): (Vec<f64>, Vec<f64>) = kept.iter().map(speed).filter(is_used).unzip();
    let stretches = stretches(&time_s);
    let blocks = time_s.iter().map(|time_s| blocks.of_time(number, *time_s)).collect();
    Course {
        flight: number,
        rotor,
        inputs,
        voltage: voltage.cloned(),
        time_s,
        speed_rad_s,
        stretches,
        blocks,
    }
}

/// Part of the range of the map that a command is at, saturated as the map is.
pub fn share(map: &CommandMap, command: f64) -> f64 {
    ((command - map.min) / (map.max - map.min)).clamp(0.0, 1.0)
}

/// Tells for a time whether the motor has been on for so long that it follows its commands.
fn turning(inputs: &[Input]) -> impl Fn(f64) -> bool + use<> {
    // From each command that switches off to the next one.
    let pairs = inputs.iter().zip(inputs.iter().skip(1).map(|next| next.time_s).chain([f64::INFINITY]));
    let off: Vec<(f64, f64)> =
        pairs.filter(|(input, _)| input.on == 0.0).map(|(input, end_s)| (input.time_s, end_s)).collect();
    move |time_s| off.iter().all(|(from_s, to_s)| time_s < *from_s || time_s > to_s + SETTLE_S)
}

fn stretches(time_s: &[f64]) -> Vec<Range<usize>> {
    let gap_s = GAP_PERIODS * held_period_s(time_s).unwrap_or(f64::INFINITY);
    let mut first = 0;
    let next = |stretch: &[f64]| {
        first += stretch.len();
        first - stretch.len()..first
    };
    time_s.chunk_by(|before, after| after - before <= gap_s).map(next).collect()
}

impl Course {
    /// The signals `of` the commands, each behind the motor `lag` and late by `delay_s`, at the times of the speeds.
    ///
    /// A signal is constant from command to command, so that the motor's response is exact.
    pub fn filtered<const K: usize>(
        &self,
        lag: Lag,
        delay_s: f64,
        of: impl Fn(&Input) -> [f64; K],
    ) -> Vec<[f64; K]> {
        let Some(first) = self.inputs.first() else { return Vec::new() };
        let mut motor = Filter::resting(lag, of(first), first.time_s + delay_s);
        let mut next = 1;
        let at = |time_s: &f64| {
            while let Some(input) =
                self.inputs.get(next).filter(|input| input.time_s + delay_s <= *time_s + SLACK_S)
            {
                motor.advance(input.time_s + delay_s);
                motor.turn_to(of(input));
                next += 1;
            }
            motor.advance(*time_s);
            motor.values()
        };
        self.time_s.iter().map(at).collect()
    }
}

/// Transitions that are kept: the steps of a log are few different ones.
const KEPT: usize = 4;
/// Steps that differ by less are the same.
const SAME_S: f64 = 1e-9;

/// Signals behind a motor: the distance of each from its target, and the rate of that.
struct Filter<const K: usize> {
    lag: Lag,
    target: [f64; K],
    away: [[f64; 2]; K],
    now_s: f64,
    /// Steps with their transitions, the oldest of which is replaced next.
    kept: [(f64, [[f64; 2]; 2]); KEPT],
    oldest: usize,
}

impl<const K: usize> Filter<K> {
    fn resting(lag: Lag, target: [f64; K], now_s: f64) -> Self {
        let kept = [(0.0, lag.transition(0.0)); KEPT];
        Self { lag, target, away: [[0.0; 2]; K], now_s, kept, oldest: 0 }
    }

    fn advance(&mut self, to_s: f64) {
        if to_s <= self.now_s {
            return;
        }
        let [[a, b], [c, d]] = self.transition(to_s - self.now_s);
        self.away = self.away.map(|[away, rate]| [a * away + b * rate, c * away + d * rate]);
        self.now_s = to_s;
    }

    fn transition(&mut self, step_s: f64) -> [[f64; 2]; 2] {
        if let Some((_, known)) = self.kept.iter().find(|(known_s, _)| (known_s - step_s).abs() < SAME_S) {
            return *known;
        }
        let transition = self.lag.transition(step_s);
        self.kept[self.oldest] = (step_s, transition);
        self.oldest = (self.oldest + 1) % KEPT;
        transition
    }

    fn turn_to(&mut self, target: [f64; K]) {
        for ((away, before), after) in self.away.iter_mut().zip(self.target).zip(target) {
            away[0] += before - after;
        }
        self.target = target;
    }

    fn values(&self) -> [f64; K] {
        std::array::from_fn(|k| self.target[k] + self.away[k][0])
    }
}
