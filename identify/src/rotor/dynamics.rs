//! The motor of the dynamic logs of a stand, with scores and findings.

use serde::Serialize;

use super::command_map::CommandLine;
use super::error::RotorError;
use super::lag::{self, Fit, Match, ONSET_ROWS_MAX};
use super::plateau::{median, range};
use super::response::Lag;
use super::score::{LEVEL, Score};
use super::stand::{Clock, Stand};
use super::step::{Cut, Hold, Step};
use crate::numbers::statistics::{Bootstrap, Estimate, MeanInterval, block_bootstrap_mean, jackknife, mean};

pub use super::lag::Order;

/// Steps that a fit needs.
const STEPS_MIN: usize = 3;
/// Resampled series of the comparison of orders.
const RESAMPLES: usize = 4000;
/// Seed of the comparison; any number would do, a fixed one makes runs equal.
const SEED: u64 = 1989;

/// Results of the dynamic logs.
#[derive(Debug, Clone, Serialize)]
pub struct Dynamics {
    /// The motor of first order.
    pub first: Fitted,
    /// The motor of second order.
    pub second: Fitted,
    /// Preferred one of the two, with the reason.
    pub comparison: Comparison,
    /// Time constant in s of rising steps alone, of all roles; absent with fewer than three.
    pub rising_s: Option<Estimate>,
    /// Time constant in s of falling steps alone, of all roles; absent with fewer than three.
    pub falling_s: Option<Estimate>,
    /// Time constant in s on the other clock than the stand file asks for.
    pub other_clock_s: Option<Estimate>,
    /// The line from the command to the steady speed; absent where the command is a speed itself.
    pub command: Option<CommandLine>,
    /// Every step that was used.
    pub steps: Vec<OneStep>,
    /// The commands that were held.
    pub holds: Vec<Hold>,
    /// Faults of the data, and data that were left out.
    pub findings: Vec<String>,
}

/// A motor of an order.
#[derive(Debug, Clone, Serialize)]
pub struct Fitted {
    /// The order.
    pub order: Order,
    /// First order: the time constant in s.
    pub time_constant_s: Option<Estimate>,
    /// Second order: the natural frequency in rad/s; absent where the fit falls back to the first order.
    pub natural_frequency_rad_s: Option<Estimate>,
    /// Second order: the damping ratio.
    pub damping_ratio: Option<Estimate>,
    /// Steps fitted.
    pub steps: usize,
    /// Errors of the speed on the steps fitted, in rad/s.
    pub fit: Option<Score>,
    /// Errors of the speed on the steps that were held out, in rad/s; onset and levels of each are its own.
    pub held_out: Option<Score>,
}

/// First against second order.
#[derive(Debug, Clone, Serialize)]
pub struct Comparison {
    /// Mean square error of the first order minus that of the second: of a stand over the steps held out, each relative
    /// to the square of the step's height; of flights over blocks of time that were left out, by the variance of the noise.
    pub first_minus_second: Option<MeanInterval>,
    /// The second only if its error is smaller beyond the interval, since it has a parameter more.
    pub preferred: Order,
    /// Reason of the preference.
    pub reason: &'static str,
}

/// A step by itself, as a motor of first order.
#[derive(Debug, Clone, Serialize)]
pub struct OneStep {
    /// The log.
    pub file: String,
    /// The command before, in the log's unit; in rad/s where it is a speed.
    pub from: f64,
    /// The command after.
    pub to: f64,
    /// True if it was held out.
    pub is_test: bool,
    /// Steady speed after minus before, in rad/s.
    pub height_rad_s: f64,
    /// The time constant of this step alone, in s.
    pub time_constant_s: f64,
    /// When the command took effect, from the row in which it is first seen, in s.
    pub onset_s: f64,
    /// Root of the mean square error, in rad/s.
    pub rms_rad_s: f64,
}

/// Fits the dynamic logs of a stand; `None` if it has none.
pub fn fitted(stand: &Stand) -> Result<Option<Dynamics>, RotorError> {
    if stand.dynamics.is_empty() {
        return Ok(None);
    }
    let mut cut = Cut::default();
    stand.dynamics.iter().try_for_each(|log| cut.add(log))?;
    let Cut { steps, holds, zero_is_off, findings } = cut;
    let fit: Vec<&Step> = steps.iter().filter(|step| !step.is_test).collect();
    if fit.len() < STEPS_MIN {
        let expected = format!("{STEPS_MIN} steps of the command to fit on");
        let advice = "log more steps, or lower `before_s`, `after_s` or `held_out`";
        return Err(RotorError::too_little("motor", expected, fit.len(), advice));
    }
    let test: Vec<&Step> = steps.iter().filter(|step| step.is_test).collect();
    let (first, first_lag) = motor(Order::First, &fit, &test)?;
    let (second, second_lag) = motor(Order::Second, &fit, &test)?;
    let mut dynamics = Dynamics {
        comparison: compared(&test, first_lag, second_lag, &second),
        first,
        second,
        rising_s: direction(&steps, 1.0),
        falling_s: direction(&steps, -1.0),
        other_clock_s: time_constant(&fit, |step| other(step.clock)),
        command: CommandLine::fitted(&holds, zero_is_off),
        steps: steps.iter().filter_map(one_step).collect(),
        holds,
        findings,
    };
    let preferred = if dynamics.comparison.preferred == Order::First { first_lag } else { second_lag };
    dynamics.findings.extend(more_findings(&dynamics, &steps, preferred));
    Ok(Some(dynamics))
}

/// A motor of an order with its scores.
fn motor(order: Order, fit: &[&Step], test: &[&Step]) -> Result<(Fitted, Lag), RotorError> {
    let found = lag::fit(fit, order, |step| step.clock).ok_or_else(|| {
        let expected = "steps that tell the motor's parameters";
        RotorError::too_little("motor", expected, "none", "check the columns of speed and command")
    })?;
    let is_second = order == Order::Second && found.lag.a2_s2 > 0.0;
    let natural = is_second.then(|| estimate(&found, Lag::natural_frequency_rad_s)).flatten();
    let fitted = Fitted {
        order,
        time_constant_s: (order == Order::First).then(|| estimate(&found, |lag| lag.a1_s)).flatten(),
        damping_ratio: natural.and_then(|_| estimate(&found, Lag::damping_ratio)),
        natural_frequency_rad_s: natural,
        steps: fit.len(),
        fit: score(fit, found.lag),
        held_out: score(test, found.lag),
    };
    Ok((fitted, found.lag))
}

/// A parameter with its interval; `None` where leaving out a step gives a motor that has no such parameter.
fn estimate(fit: &Fit, parameter: impl Fn(Lag) -> f64) -> Option<Estimate> {
    let without_one: Vec<f64> = fit.without_one.iter().map(|lag| parameter(*lag)).collect();
    let estimate = jackknife(parameter(fit.lag), &without_one, LEVEL);
    estimate.sigma.is_finite().then_some(estimate)
}

/// The time constant of some steps on a clock.
fn time_constant(steps: &[&Step], clock_of: impl Fn(&Step) -> Clock) -> Option<Estimate> {
    estimate(&lag::fit(steps, Order::First, clock_of)?, |lag| lag.a1_s)
}

fn direction(steps: &[Step], sign: f64) -> Option<Estimate> {
    let alike: Vec<&Step> = steps.iter().filter(|step| step.height * sign > 0.0).collect();
    // Two steps give an interval without meaning.
    if alike.len() < STEPS_MIN { None } else { time_constant(&alike, |step| step.clock) }
}

fn other(clock: Clock) -> Clock {
    if clock == Clock::Rows { Clock::Stamps } else { Clock::Rows }
}

fn matched(step: &Step, lag: Lag) -> Match {
    lag::matched(step, lag::times(step, step.clock), lag)
}

/// Errors of the speed over all rows of some steps; the variance is that within steps.
fn score(steps: &[&Step], lag: Lag) -> Option<Score> {
    let mut pairs = Vec::new();
    for step in steps {
        let mean = mean(&step.speed);
        let errors = matched(step, lag).errors;
        pairs.extend(
            errors.iter().zip(&step.speed).map(|(error, speed)| (speed - mean + error, speed - mean)),
        );
    }
    Score::of(&pairs).map(|score| Score { segments: steps.len(), ..score })
}

fn compared(test: &[&Step], first: Lag, second: Lag, second_fit: &Fitted) -> Comparison {
    let error = |step: &Step, lag| lag::relative_square(step, &matched(step, lag).errors);
    let gains: Vec<f64> = test.iter().map(|step| error(step, first) - error(step, second)).collect();
    // Steps are seconds apart: each is a block of its own.
    let how = Bootstrap { block: 1, resamples: RESAMPLES, seed: SEED, level: LEVEL };
    let first_minus_second = (!test.is_empty()).then(|| block_bootstrap_mean(&gains, &how));
    let (preferred, reason) = match first_minus_second {
        None => (Order::First, "no step was held out to judge on: the simpler motor"),
        Some(_) if second_fit.damping_ratio.is_none() => (
            Order::First,
            "the second coefficient of the second order cannot be told from 0: it is the first order",
        ),
        Some(interval) if interval.low > 0.0 && test.len() > 1 => {
            (Order::Second, "its held-out error is smaller beyond the interval")
        }
        Some(_) => (
            Order::First,
            "the second order's held-out error is not smaller beyond the interval: the simpler motor",
        ),
    };
    Comparison { first_minus_second, preferred, reason }
}

fn one_step(step: &Step) -> Option<OneStep> {
    let lag = lag::fit(&[step], Order::First, |step| step.clock)?.lag;
    let found = matched(step, lag);
    let squares: f64 = found.errors.iter().map(|error| error * error).sum();
    Some(OneStep {
        file: step.file.clone(),
        from: step.from,
        to: step.to,
        is_test: step.is_test,
        height_rad_s: step.height,
        time_constant_s: lag.a1_s,
        onset_s: found.onset_s,
        rms_rad_s: (squares / found.errors.len() as f64).sqrt(),
    })
}

/// Returns findings of the fits about the data; `preferred` is the motor of the preferred order.
fn more_findings(dynamics: &Dynamics, steps: &[Step], preferred: Lag) -> Vec<String> {
    let matches: Vec<Match> = steps.iter().map(|step| matched(step, preferred)).collect();
    // In ms with one digit; 0 after a minus would read as a number.
    let onsets: Vec<f64> = matches.iter().map(|found| (1e4 * found.onset_s).round() / 10.0 + 0.0).collect();
    let clamped = matches.iter().filter(|found| found.is_clamped).count();
    let (earliest, latest) = range(&onsets);
    let mut findings = vec![format!(
        "commands took effect {:.1} ms from the row that shows them first (median; {earliest:.1} to {latest:.1} ms), \
         {clamped} of {} at the end of the {ONSET_ROWS_MAX} row that is allowed",
        median(&onsets),
        onsets.len()
    )];
    let directions = dynamics.rising_s.zip(dynamics.falling_s);
    if directions.is_some_and(|(rising, falling)| rising.high < falling.low || falling.high < rising.low) {
        let text =
            "rising and falling steps differ beyond their intervals: one motor for both is a compromise";
        findings.push(text.to_owned());
    }
    if let Some(command) = &dynamics.command {
        let (at, miss) = command.worst;
        findings.push(format!(
            "the line from the command to the speed misses by up to {miss:.0} rad/s (at {at}): a vehicle file has no curve"
        ));
    }
    findings
}
