//! From commands to rotor speeds: the motors of the flights, in common and one by one, with intervals and held-out errors.

use flights::{Flight, Role};
use serde::Serialize;
use vehicles::gaps::held_period_s;
use vehicles::{MotorModel, Vehicle};

use super::blocks::Blocks;
use super::course::{Course, courses, share};
use super::figure::{Figure, HeldOut, rms};
use super::least_squares;
use super::motor::{
    self, A1, A2, DELAY, DELAY_MAX_S, Fit, Form, HIGH, LAG_MAX_S, LOW, POWER, POWERS, Values,
};
use super::voltage::{self, Voltage};
use crate::numbers::normal;
use crate::numbers::statistics::{Bootstrap, Estimate, block_bootstrap_mean};
use crate::rotor::dynamics::{Comparison, Order};
use crate::rotor::plateau::median;
use crate::rotor::score::LEVEL;

/// Part of the commands that is left out at both ends of the range that was flown.
const RARE: f64 = 0.005;
/// A steady speed is within so many times the declared greatest one.
const FASTER_MAX: f64 = 3.0;
/// Resampled series of the comparison of orders.
const RESAMPLES: usize = 4000;
/// Seed of the comparison; any number would do, a fixed one makes runs equal.
const SEED: u64 = 1989;

/// The motors as the flights show them.
#[derive(Debug, Clone, Serialize)]
pub struct FlownMotor {
    /// Least and greatest command of the vehicle file's map.
    pub command_range: (f64, f64),
    /// Commands that were flown: all but 0.5 % at both ends.
    pub flown_commands: (f64, f64),
    /// Usual longest time between two logged commands in s; absent where the log has every change.
    pub command_period_s: Option<f64>,
    /// Voltage in V at which the speeds of the map hold; absent where not all flights have one.
    pub reference_voltage_v: Option<f64>,
    /// All rotors in common, by the preferred order.
    pub common: MotorFigures,
    /// Lag of first order, of all rotors in common.
    pub first: LagFigures,
    /// Lag of second order.
    pub second: LagFigures,
    /// Preferred order, with the reason.
    pub comparison: Comparison,
    /// Each rotor alone, by the preferred order.
    pub rotors: Vec<RotorMotor>,
    /// Errors of the speeds that follow from the commands of each test flight.
    pub held_out: Vec<HeldOut>,
    /// Faults of the data, and data that were left out.
    pub findings: Vec<String>,
    #[serde(skip)]
    fit: Fit,
    #[serde(skip)]
    logging: Logging,
}

/// One rotor alone.
#[derive(Debug, Clone, Serialize)]
pub struct RotorMotor {
    /// Its name in the vehicle file.
    pub name: String,
    /// Its motor; absent if its flights do not determine it.
    pub motor: Option<MotorFigures>,
}

/// Command map and lag.
#[derive(Debug, Clone, Serialize)]
pub struct MotorFigures {
    /// Steady speed at the least command of the map, in rad/s.
    pub speed_at_min: Figure,
    /// Steady speed at the greatest command.
    pub speed_at_max: Figure,
    /// Steady speed at the middle of the commands that were flown.
    pub speed_in_flight: Figure,
    /// Power of the battery's voltage that the speeds follow: 1 of an open-loop motor, 0 of one whose speed is controlled.
    pub voltage_power: Figure,
    /// Lag.
    pub lag: LagFigures,
}

/// Lag and delay from the command to the measured speed.
#[derive(Debug, Clone, Serialize)]
pub struct LagFigures {
    /// First order: the time constant in s.
    pub time_constant: Option<Figure>,
    /// Second order: the natural frequency in rad/s.
    pub natural_frequency: Option<Figure>,
    /// Second order: the damping ratio.
    pub damping_ratio: Option<Figure>,
    /// Delay in s, with that of the speed sensor.
    pub delay: Figure,
    /// Time in s by which the speeds follow slow changes: the first coefficient of the lag and the delay together.
    pub lateness: Figure,
}

/// Flights by role, as courses.
struct Set {
    fit: Vec<Course>,
    select: Vec<Course>,
    test: Vec<Course>,
}

/// Facts of the log that intervals need.
#[derive(Debug, Clone, Copy)]
struct Logging {
    /// Longest period of logged commands in s; 0 where each change was logged.
    period_s: f64,
    /// Greatest declared speed.
    fastest_rad_s: f64,
    /// Share of the voltage's variance that is noise.
    voltage_noise: f64,
    /// Share of the map at the middle of the flown commands.
    middle: f64,
}

/// Fits the motors to the flights that log commands and speeds.
///
/// # Errors
/// The reason why there is nothing to fit.
pub fn fitted(all: &[&Flight], vehicle: &Vehicle) -> Result<FlownMotor, String> {
    let usable: Vec<&Flight> = all
        .iter()
        .copied()
        .filter(|flight| !flight.command.is_empty() && !flight.rotor_speed.is_empty())
        .collect();
    if !usable.iter().any(|flight| flight.role == Role::Fit) {
        return Err(missing(all));
    }
    let of_fit: Vec<&Flight> = usable.iter().copied().filter(|flight| flight.role == Role::Fit).collect();
    let reference = voltage::reference_v(&usable).filter(|_| voltage::varies(&of_fit));
    let set = Set::of(&usable, vehicle, reference);
    let flown = flown(&of_fit, vehicle);
    let map = &vehicle.command;
    let logging = Logging {
        period_s: period_s(&of_fit).unwrap_or(0.0),
        fastest_rad_s: FASTER_MAX * map.speed_at_max_rad_s,
        voltage_noise: voltage::noise_share(&of_fit),
        middle: share(map, flown.1),
    };
    let form = |order| Form { order, with_voltage: reference.is_some(), delay_min_s: -logging.period_s };
    let few =
        || format!("too few commands with speeds: {} blocks of time are needed", least_squares::BLOCKS_MIN);
    let first = motor::fitted(&set.fit, form(Order::First), None).ok_or_else(few)?;
    let second = motor::fitted(&set.fit, form(Order::Second), Some(first.values));
    let comparison = compared(&set, &first, second.as_ref());
    let preferred = match (comparison.preferred, &second) {
        (Order::Second, Some(second)) => second,
        _ => &first,
    };
    let figures = |fit: &Fit| figures(fit, logging, reference.is_some());
    let alone = |rotor: usize| {
        let courses: Vec<Course> = set.fit.iter().filter(|course| course.rotor == rotor).cloned().collect();
        motor::fitted(&courses, preferred.form, Some(preferred.values)).map(|fit| figures(&fit))
    };
    let rotors = vehicle.rotors.iter().enumerate();
    let rotors: Vec<RotorMotor> =
        rotors.map(|(number, rotor)| RotorMotor { name: rotor.name.clone(), motor: alone(number) }).collect();
    let untold = || LagFigures::missing(Order::Second, "the fit of a second order does not converge");
    let mut motor = FlownMotor {
        command_range: (map.min, map.max),
        flown_commands: (flown.0, flown.2),
        command_period_s: period_s(&of_fit),
        reference_voltage_v: reference,
        common: figures(preferred),
        first: LagFigures::of(&first, logging),
        second: second.as_ref().map_or_else(untold, |fit| LagFigures::of(fit, logging)),
        comparison,
        rotors,
        held_out: held_out(&usable, &set.test, &preferred.values, vehicle),
        findings: Vec::new(),
        fit: preferred.clone(),
        logging,
    };
    motor.findings = findings(&motor, &usable);
    Ok(motor)
}

/// Reason why no flight to fit on has commands and speeds.
fn missing(all: &[&Flight]) -> String {
    let of_fit = || all.iter().filter(|flight| flight.role == Role::Fit);
    let lacks = if of_fit().all(|flight| flight.command.is_empty()) { "command" } else { "rotor_speed" };
    format!(
        "no flight with role \"fit\" has both `command` and `rotor_speed` (`{lacks}` is not logged): command map, lag, delay and \
         dependence on the voltage are left out"
    )
}

impl Set {
    fn of(usable: &[&Flight], vehicle: &Vehicle, reference: Option<f64>) -> Self {
        let span_s = |flight: &&Flight| {
            flight.rotor_speed.span_s().map_or(0.0, |(first_s, last_s)| last_s - first_s.min(0.0))
        };
        let ends_s: Vec<f64> = usable.iter().map(span_s).collect();
        let fit_s = usable.iter().filter(|flight| flight.role == Role::Fit).map(span_s_of).sum();
        let blocks = Blocks::of(fit_s, &ends_s);
        let of_role = |role: Role| {
            let of_role = usable.iter().enumerate().filter(|(_, flight)| flight.role == role);
            of_role
                .flat_map(|(number, flight)| {
                    let voltage = reference.and_then(|reference| Voltage::of(flight, reference));
                    courses(number, flight, vehicle, voltage.as_ref(), &blocks)
                })
                .collect()
        };
        Self { fit: of_role(Role::Fit), select: of_role(Role::Select), test: of_role(Role::Test) }
    }
}

fn span_s_of(flight: &&Flight) -> f64 {
    flight.rotor_speed.span_s().map_or(0.0, |(first_s, last_s)| last_s - first_s)
}

/// Usual longest time between two commands, of the flight in which it is longest; `None` where each change was logged.
fn period_s(flights: &[&Flight]) -> Option<f64> {
    let logged = flights.iter().filter(|flight| !flight.commands_on_change);
    logged.filter_map(|flight| held_period_s(&flight.command.time_s)).reduce(f64::max)
}

/// Least, median and greatest command that was flown, of all rotors; the rarest at both ends left out.
fn flown(flights: &[&Flight], vehicle: &Vehicle) -> (f64, f64, f64) {
    let working = || (0..vehicle.rotors.len()).filter(|rotor| !vehicle.rotors[*rotor].has_failed);
    let samples = flights.iter().flat_map(|flight| &flight.command.values);
    let mut all: Vec<f64> = samples.flat_map(|command| working().map(|rotor| command[rotor])).collect();
    all.sort_by(f64::total_cmp);
    let at = |part: f64| {
        all.get((part * all.len().saturating_sub(1) as f64) as usize).copied().unwrap_or(f64::NAN)
    };
    (at(RARE), at(0.5), at(1.0 - RARE))
}

impl FlownMotor {
    /// Steady speed at a raw command, on the line of all rotors in common.
    pub(crate) fn speed_at(&self, command: f64) -> Figure {
        let (min, max) = self.command_range;
        speed_at(&self.fit, self.logging, (command - min) / (max - min))
    }
}

/// Steady speed at a part of the map's range.
fn speed_at(fit: &Fit, logging: Logging, part: f64) -> Figure {
    let speed = fit.solution.estimate(|values| (1.0 - part) * values[LOW] + part * values[HIGH]);
    Figure::within("rad/s", speed, (0.0, logging.fastest_rad_s))
}

fn figures(fit: &Fit, logging: Logging, has_voltage: bool) -> MotorFigures {
    let at = |part: f64| speed_at(fit, logging, part);
    MotorFigures {
        speed_at_min: at(0.0),
        speed_at_max: at(1.0),
        speed_in_flight: at(logging.middle),
        voltage_power: if has_voltage {
            power(fit, logging)
        } else {
            Figure::missing(
                "1",
                "`battery_voltage` is not logged in all flights, or does not vary beyond its noise",
            )
        },
        lag: LagFigures::of(fit, logging),
    }
}

/// Power of the voltage. The noise of the voltage flattens it by its share of the variance.
fn power(fit: &Fit, logging: Logging) -> Figure {
    let Estimate { value, sigma, low, high } = fit.solution.estimate(|free| fit.completed(free)[POWER]);
    let flatter = value.abs() * logging.voltage_noise;
    Figure::within("1", Estimate { value, sigma, low: low - flatter, high: high + flatter }, POWERS)
}

impl LagFigures {
    fn of(fit: &Fit, logging: Logging) -> Self {
        let estimate = |of: &dyn Fn(&Values) -> f64| fit.solution.estimate(|free| of(&fit.completed(free)));
        let short = (fit.values[A1] < 0.5 * logging.period_s).then(|| {
            format!(
                "the lag of {:.1} ms is below half of the commands' logging period of {:.1} ms",
                1e3 * fit.values[A1],
                1e3 * logging.period_s
            )
        });
        let lag = |unit, of: &dyn Fn(&Values) -> f64, range| {
            Figure::within(unit, estimate(of), range).doubted(short.clone())
        };
        let is_second = fit.form.order == Order::Second;
        let natural = |values: &Values| motor::lag(values).natural_frequency_rad_s();
        Self {
            time_constant: (!is_second).then(|| {
                let estimate = slower(estimate(&|values| values[A1]), logging.period_s);
                Figure::within("s", estimate, (0.0, LAG_MAX_S)).doubted(short.clone())
            }),
            natural_frequency: is_second.then(|| lag("rad/s", &natural, (0.0, f64::INFINITY))),
            damping_ratio: is_second
                .then(|| lag("1", &|values| motor::lag(values).damping_ratio(), (0.0, f64::INFINITY))),
            delay: Figure::within(
                "s",
                later(estimate(&|values| values[DELAY]), logging.period_s),
                (fit.form.delay_min_s, DELAY_MAX_S),
            ),
            lateness: Figure::within(
                "s",
                later(estimate(&|values| values[A1] + values[DELAY]), logging.period_s),
                (fit.form.delay_min_s, LAG_MAX_S),
            ),
        }
    }

    fn missing(order: Order, reason: &str) -> Self {
        let figure = |unit| Figure::missing(unit, reason);
        let is_second = order == Order::Second;
        Self {
            time_constant: (!is_second).then(|| figure("s")),
            natural_frequency: is_second.then(|| figure("rad/s")),
            damping_ratio: is_second.then(|| figure("1")),
            delay: figure("s"),
            lateness: figure("s"),
        }
    }
}

/// An interval that also holds the delay if the controller sent more commands than were logged: these act late by half of
/// their period, so that the delay comes out short by as much.
fn later(estimate: Estimate, period_s: f64) -> Estimate {
    Estimate { high: estimate.high + 0.5 * period_s, ..estimate }
}

/// The same for a time constant: holding commands over a period has a variance in time of a twelfth of its square, which the
/// lag comes out short by.
fn slower(estimate: Estimate, period_s: f64) -> Estimate {
    Estimate { high: libm::hypot(estimate.high, period_s / 12.0_f64.sqrt()), ..estimate }
}

/// First against second order: on the flights with role `select`, or else by cross-validation over blocks of time.
fn compared(set: &Set, first: &Fit, second: Option<&Fit>) -> Comparison {
    let simpler = |reason| Comparison { first_minus_second: None, preferred: Order::First, reason };
    let Some(second) = second else { return simpler("the fit of a second order does not converge") };
    let relative = second.solution.estimate(|free| second.completed(free)[A2]);
    if relative.low <= 0.0 {
        return simpler(
            "the second coefficient of the second order cannot be told from 0: it is the first order",
        );
    }
    let costs = |fit: &Fit| {
        if set.select.is_empty() {
            left_out(&set.fit, fit, second)
        } else {
            of_select(&set.select, fit, second)
        }
    };
    let gains: Vec<f64> =
        costs(first).iter().zip(costs(second)).map(|(first, second)| first - second).collect();
    let how = Bootstrap { block: 1, resamples: RESAMPLES, seed: SEED, level: LEVEL };
    let gain = block_bootstrap_mean(&gains, &how);
    let (preferred, reason) = if gain.low > 0.0 {
        (Order::Second, "its error on blocks of time that were left out is smaller beyond the interval")
    } else {
        (
            Order::First,
            "the second order's error on blocks of time that were left out is not smaller beyond the interval: the simpler motor",
        )
    };
    Comparison { first_minus_second: Some(gain), preferred, reason }
}

/// Squares of each block under parameters that were fitted on the others, with the noise of `second`.
fn left_out(courses: &[Course], fit: &Fit, second: &Fit) -> Vec<f64> {
    let blocks = motor::blocks(courses, &fit.values, &fit.form.free(), &second.noise);
    let total = normal::sum(&blocks);
    let others = |block: &normal::Block| {
        let rest = total.without(block);
        block.cost_after(&-(normal::inverse(&rest.gram) * &rest.gradient))
    };
    blocks.iter().map(others).collect()
}

fn of_select(courses: &[Course], fit: &Fit, second: &Fit) -> Vec<f64> {
    motor::blocks(courses, &fit.values, &[], &second.noise).iter().map(|block| block.cost).collect()
}

/// Motor and map of the vehicle file, its effects left out.
fn declared(vehicle: &Vehicle) -> Values {
    let mut values = [0.0; motor::PARAMETERS];
    (values[LOW], values[HIGH]) = (vehicle.command.speed_at_min_rad_s, vehicle.command.speed_at_max_rad_s);
    (values[A1], values[A2]) = match vehicle.motor {
        MotorModel::FirstOrder { time_constant_s } => (time_constant_s, 0.0),
        MotorModel::SecondOrder { natural_frequency_rad_s, damping_ratio } => {
            (2.0 * damping_ratio / natural_frequency_rad_s, natural_frequency_rad_s.powi(-2))
        }
    };
    values
}

fn held_out(usable: &[&Flight], test: &[Course], fitted: &Values, vehicle: &Vehicle) -> Vec<HeldOut> {
    let declared = declared(vehicle);
    let of_flight = |(number, flight): (usize, &&Flight)| {
        let courses = || test.iter().filter(|course| course.flight == number);
        let errors = |values: &Values| -> Vec<f64> {
            let of_course = |course: &Course| {
                let simulated = motor::simulated(course, values);
                simulated.into_iter().zip(&course.speed_rad_s).map(|(a, b)| a - b).collect::<Vec<f64>>()
            };
            courses().flat_map(of_course).collect()
        };
        courses().next().is_some().then(|| HeldOut {
            flight: flight.name.clone(),
            quantity: "rotor speed from the commands",
            unit: "rad/s",
            declared: rms(&errors(&declared)),
            fitted: rms(&errors(fitted)),
        })
    };
    usable.iter().enumerate().filter_map(of_flight).collect()
}

fn findings(motor: &FlownMotor, usable: &[&Flight]) -> Vec<String> {
    let mut findings = vec![share_text(motor)];
    if motor.reference_voltage_v.is_none() {
        let mean: Vec<f64> =
            usable.iter().flat_map(|flight| &flight.battery_voltage.values).map(|[value]| *value).collect();
        let at = if mean.is_empty() { String::new() } else { format!(", about {:.2} V", median(&mean)) };
        findings.push(format!("command map: it holds at the battery's voltage of these flights{at}"));
    }
    if let Some(period_s) = motor.command_period_s {
        findings.push(format!(
            "commands are logged every {:.1} ms: if the controller sent more of them, they act late by half of that in the log, \
             which the upper ends of the intervals of delay and lag include",
            1e3 * period_s
        ));
    }
    findings.extend(differing("steady speed in flight", motor, |motor| &motor.speed_in_flight));
    findings.extend(differing("lateness", motor, |motor| &motor.lag.lateness));
    findings
}

fn share_text(motor: &FlownMotor) -> String {
    format!(
        "command map: commands from {:.4} to {:.4} were flown, of the vehicle file's range from {} to {}; beyond them the line is \
         extrapolated",
        motor.flown_commands.0, motor.flown_commands.1, motor.command_range.0, motor.command_range.1
    )
}

/// Rotors that differ beyond their intervals.
fn differing(name: &str, motor: &FlownMotor, of: impl Fn(&MotorFigures) -> &Figure) -> Option<String> {
    let known = |rotor: &RotorMotor| Some((rotor.name.clone(), *of(rotor.motor.as_ref()?).determined()?));
    let known: Vec<(String, Estimate)> = motor.rotors.iter().filter_map(known).collect();
    let least = known.iter().min_by(|a, b| a.1.high.total_cmp(&b.1.high))?;
    let most = known.iter().max_by(|a, b| a.1.low.total_cmp(&b.1.low))?;
    (least.1.high < most.1.low).then(|| {
        format!(
            "{name}: the rotors differ beyond their intervals, from {:.5} ({}) to {:.5} ({}): one motor for all is a compromise",
            least.1.value, least.0, most.1.value, most.0
        )
    })
}
