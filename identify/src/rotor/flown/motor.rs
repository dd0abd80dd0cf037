//! The motor that follows the commands of all courses best: command map, lag, delay, and dependence on the voltage.
//!
//! w(t) is the answer of 1 / (a2 s^2 + a1 s + 1) to (low + (high - low) x(t - delay)) (U / U_ref)^power. x is
//! the part of the command map's range. The speeds are simulated from the commands alone (an output-error
//! model, Ljung, System Identification, 2nd ed., section 4.3), and the residual is whitened.

use super::course::{Course, Input};
use super::least_squares::{self, Rows, Solution, Weighting};
use crate::model::noise_model::NoiseModel;
use crate::numbers::normal::{self, Block};
use crate::rotor::dynamics::Order;
use crate::rotor::response::Lag;

/// Parameters of a motor.
pub const PARAMETERS: usize = 6;
/// Speed at the least command, in rad/s.
pub const LOW: usize = 0;
/// Speed at the greatest command, in rad/s.
pub const HIGH: usize = 1;
/// First coefficient of the lag, in s.
pub const A1: usize = 2;
/// Delay, in s.
pub const DELAY: usize = 3;
/// Second coefficient of the lag, in s^2.
pub const A2: usize = 4;
/// Power of the voltage.
pub const POWER: usize = 5;

/// Time constants that the search begins at, in s.
const LAGS_S: [f64; 6] = [0.005, 0.015, 0.03, 0.06, 0.12, 0.25];
/// Delays that the search begins at, in s.
const DELAYS_S: [f64; 6] = [0.0, 0.01, 0.02, 0.04, 0.08, 0.15];
/// Greatest delay, in s; the first half second of a stretch is not compared.
pub const DELAY_MAX_S: f64 = 0.3;
/// Greatest first coefficient, in s.
pub const LAG_MAX_S: f64 = 1.0;
/// Least first coefficient, in s: a motor below it is immediate for any log.
const LAG_MIN_S: f64 = 1e-4;
/// Powers of the voltage between which a motor can be.
pub const POWERS: (f64, f64) = (-1.0, 3.0);
/// Damped Gauss-Newton steps of one descent.
const STEPS_MAX: usize = 30;
/// A descent is done when a step improves the squares by less than this part.
const SMALL_GAIN: f64 = 1e-7;
/// Estimates of the noise, each followed by a descent.
const ROUNDS: usize = 2;

/// Values of the parameters, in the order of their constants.
pub type Values = [f64; PARAMETERS];

/// Form of a motor that is fitted to courses.
#[derive(Debug, Clone, Copy)]
pub struct Form {
    /// Order of the lag.
    pub order: Order,
    /// True if the power of the voltage is free.
    pub with_voltage: bool,
    /// Least delay in s, below 0: logged commands may act earlier than the log says.
    pub delay_min_s: f64,
}

/// A motor, with its noise and the equations of each block of time about it.
#[derive(Debug, Clone)]
pub struct Fit {
    /// Form.
    pub form: Form,
    /// Values of all parameters.
    pub values: Values,
    /// Values with their scatter, of the free parameters.
    pub solution: Solution,
    /// Noise of the speeds.
    pub noise: NoiseModel,
}

impl Form {
    /// The free parameters.
    pub fn free(&self) -> Vec<usize> {
        let second = (self.order == Order::Second).then_some(A2);
        [LOW, HIGH, A1, DELAY].into_iter().chain(second).chain(self.with_voltage.then_some(POWER)).collect()
    }
}

/// The lag of some values.
pub fn lag(values: &Values) -> Lag {
    Lag { a1_s: values[A1], a2_s2: values[A2] }
}

/// Fits a motor to `courses`, from `start` or else from a search; `None` if they do not determine it.
pub fn fitted(courses: &[Course], form: Form, start: Option<Values>) -> Option<Fit> {
    let free = form.free();
    let mut values = start.or_else(|| searched(courses, form))?;
    if form.order == Order::Second && values[A2] == 0.0 {
        values[A2] = 0.1 * values[A1] * values[A1];
    }
    let white = NoiseModel::white(1.0);
    values = descended(courses, form, values, &white)?;
    let mut noise = white;
    for _ in 0..ROUNDS {
        noise = noise_of(courses, &values);
        values = descended(courses, form, values, &noise)?;
    }
    let blocks = blocks(courses, &values, &free, &noise);
    let at = free.iter().map(|parameter| values[*parameter]).collect();
    let solution = Solution::of(at, &blocks, &[]);
    (blocks.len() >= least_squares::BLOCKS_MIN).then_some(Fit { form, values, solution, noise })
}

impl Fit {
    /// All values from those of the free parameters.
    pub fn completed(&self, free: &[f64]) -> Values {
        let mut values = self.values;
        self.form.free().iter().zip(free).for_each(|(at, value)| values[*at] = *value);
        values
    }
}

/// Noise of the speeds about a motor.
pub fn noise_of(courses: &[Course], values: &Values) -> NoiseModel {
    let rows: Vec<Rows> = courses.iter().map(|course| rows(course, values, &[])).collect();
    least_squares::noises(&rows, &[], Weighting::Whitened)
        .into_iter()
        .next()
        .unwrap_or_else(|| NoiseModel::white(1.0))
}

/// Normal equations of each block of time about `values`.
pub fn blocks(courses: &[Course], values: &Values, free: &[usize], noise: &NoiseModel) -> Vec<Block> {
    let rows: Vec<Rows> = courses.iter().map(|course| rows(course, values, free)).collect();
    least_squares::blocks(&rows, std::slice::from_ref(noise))
}

/// Speeds of a course that follow from its commands, in rad/s.
pub fn simulated(course: &Course, values: &Values) -> Vec<f64> {
    answers(course, values).iter().map(|units| speed(values, units)).collect()
}

/// The answers of a course's motor to [`units`].
fn answers(course: &Course, values: &Values) -> Vec<[f64; 2]> {
    // The voltage acts at the time at which the command does.
    let log_voltage = |input: &Input| match &course.voltage {
        Some(voltage) if values[POWER] != 0.0 => voltage.log_at(input.time_s + values[DELAY]),
        _ => 0.0,
    };
    course.filtered(lag(values), values[DELAY], |input| units(input, values[POWER] * log_voltage(input)))
}

fn speed(values: &Values, [least, range]: &[f64; 2]) -> f64 {
    values[LOW] * least + (values[HIGH] - values[LOW]) * range
}

/// The least command, and the range of the map, that an input asks for, at a gain of this logarithm.
fn units(input: &Input, log_gain: f64) -> [f64; 2] {
    let gain = input.on * if log_gain == 0.0 { 1.0 } else { libm::exp(log_gain) };
    [gain, gain * input.share]
}

/// Residual of the speeds and derivatives by the parameters `free`.
fn rows(course: &Course, values: &Values, free: &[usize]) -> Rows {
    let units = answers(course, values);
    let measured = course.speed_rad_s.iter().zip(&units);
    let column = |parameter: &usize| match *parameter {
        LOW => units.iter().map(|[least, range]| least - range).collect(),
        HIGH => units.iter().map(|[_, range]| *range).collect(),
        other => slope(course, values, other),
    };
    Rows {
        component: 0,
        stretches: course.stretches.clone(),
        values: measured.map(|(measured, units)| measured - speed(values, units)).collect(),
        columns: free.iter().map(column).collect(),
        blocks: course.blocks.clone(),
    }
}

/// Derivative of the simulated speeds by a parameter in which they are not linear, by differences.
fn slope(course: &Course, values: &Values, parameter: usize) -> Vec<f64> {
    let aside = match parameter {
        A1 => 1e-3 * values[A1],
        A2 => 1e-3 * values[A1] * values[A1],
        DELAY => 1e-4,
        _ => 1e-3,
    };
    // A second coefficient has no other side at 0.
    let is_one_sided = parameter == A2 && values[A2] < aside;
    let with = |by: f64| {
        let mut moved = *values;
        moved[parameter] += by;
        simulated(course, &moved)
    };
    let (up, down) = (with(aside), with(if is_one_sided { 0.0 } else { -aside }));
    let width = if is_one_sided { aside } else { 2.0 * aside };
    up.iter().zip(&down).map(|(up, down)| (up - down) / width).collect()
}

/// The best lag and delay of a grid, each with the best line of the command map.
fn searched(courses: &[Course], form: Form) -> Option<Values> {
    let delays_s = DELAYS_S.into_iter().chain((form.delay_min_s < 0.0).then_some(form.delay_min_s));
    let candidates = delays_s.flat_map(|delay_s| LAGS_S.map(|lag_s| (lag_s, delay_s)));
    let fits = candidates.filter_map(|(lag_s, delay_s)| {
        let start = [0.0, 0.0, lag_s, delay_s, 0.0, 0.0];
        let total = normal::sum(&blocks(courses, &start, &[LOW, HIGH], &NoiseModel::white(1.0)));
        let step = -(normal::inverse(&total.gram) * &total.gradient);
        (total.gram.iter().any(|entry| *entry > 0.0))
            .then(|| ([step[0], step[1], lag_s, delay_s, 0.0, 0.0], total.cost_after(&step)))
    });
    fits.min_by(|a, b| a.1.total_cmp(&b.1)).map(|(values, _)| values)
}

/// Descends from `values` by damped Gauss-Newton steps; `None` if nothing is finite.
fn descended(courses: &[Course], form: Form, start: Values, noise: &NoiseModel) -> Option<Values> {
    let free = form.free();
    let equations = |values: &Values| normal::sum(&blocks(courses, values, &free, noise));
    let (mut values, mut damping) = (start, 1e-3);
    let mut total = equations(&values);
    for _ in 0..STEPS_MAX {
        let mut damped = total.clone();
        (0..free.len()).for_each(|at| damped.gram[(at, at)] *= 1.0 + damping);
        let moved = within(&values, &free, &least_squares::step(&damped), form);
        let after = equations(&moved);
        if after.cost < total.cost {
            let gain = 1.0 - after.cost / total.cost;
            (values, total, damping) = (moved, after, (0.1 * damping).max(1e-12));
            if gain < SMALL_GAIN {
                break;
            }
        } else if damping > 1e6 {
            break;
        } else {
            damping *= 10.0;
        }
    }
    total.cost.is_finite().then_some(values)
}

/// The values after a step, within what a motor can be.
fn within(values: &Values, free: &[usize], step: &[f64], form: Form) -> Values {
    let mut moved = *values;
    free.iter().zip(step).for_each(|(parameter, step)| moved[*parameter] += step);
    moved[A1] = moved[A1].clamp(0.3 * values[A1], 3.0 * values[A1]).clamp(LAG_MIN_S, LAG_MAX_S);
    moved[A2] = moved[A2].max(0.0);
    moved[DELAY] = moved[DELAY].clamp(form.delay_min_s, DELAY_MAX_S);
    moved[POWER] = moved[POWER].clamp(POWERS.0, POWERS.1);
    moved
}
