//! Steps of the command, cut out of a log.

use diagnostics::digits;
use diagnostics::unit::SPEED;
use serde::Serialize;

use super::error::RotorError;
use super::plateau::{self, REST_RAD_S, median, spread};
use super::stand::{Clock, DynamicLog, held_out, short_name};
use super::table::LogTable;

/// A step has to be this many times as high as the speed's noise.
const HEIGHT_SIGMAS_MIN: f64 = 3.0;
/// Rows over which the mean distance of rows is taken.
const PERIOD_ROWS: usize = 500;
/// Rows by which the stamps of a step may shift before rows count as lost.
const LOST_ROWS: f64 = 1.5;
/// Rows before a step whose median is the speed that it starts from.
const ROWS_BEFORE_MIN: usize = 1;
/// Rows after it: the last third of them is where it ends.
const ROWS_AFTER_MIN: usize = 3;

/// One step of the command and the speed around it.
#[derive(Debug, Clone, PartialEq)]
pub struct Step {
    /// The log.
    pub file: String,
    /// The command before, in the log's unit; in rad/s where it is a speed.
    pub from: f64,
    /// The command after.
    pub to: f64,
    /// True if it is held out.
    pub is_test: bool,
    /// The mean distance of rows.
    pub period_s: f64,
    /// Times of the rows by each clock; 0 is the row in which the new command is first seen.
    pub rows_s: Vec<f64>,
    /// The same by the log's stamps.
    pub stamps_s: Vec<f64>,
    /// The clock that the stand file asks for.
    pub clock: Clock,
    /// Rotor speed in rad/s.
    pub speed: Vec<f64>,
    /// Steady speed after minus before, in rad/s.
    pub height: f64,
}

/// A command that was held, and the steady speed there.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Hold {
    /// The command, in the log's unit.
    pub command: f64,
    /// Median speed, the start of the hold left out, in rad/s.
    pub speed_rad_s: f64,
    /// True if it is held out.
    pub is_test: bool,
}

/// Steps and holds of logs.
#[derive(Default)]
pub struct Cut {
    /// Its usable steps.
    pub steps: Vec<Step>,
    /// The commands that were held long enough; none of a log whose command is a speed.
    pub holds: Vec<Hold>,
    /// True if the motor stands still at a command of 0.
    pub zero_is_off: bool,
    /// Findings, and data that were left out.
    pub findings: Vec<String>,
}

/// The numbers of a log.
struct Log<'s> {
    declared: &'s DynamicLog,
    name: String,
    time_s: Vec<f64>,
    speed: Vec<f64>,
    command: Vec<f64>,
    period_s: f64,
}

impl Cut {
    /// Cuts the steps out of a log.
    pub fn add(&mut self, declared: &DynamicLog) -> Result<(), RotorError> {
        let log = Log::read(declared)?;
        let mut left_out = LeftOut::default();
        let changes: Vec<usize> = (1..log.speed.len()).filter(|row| log.changes(*row)).collect();
        // Each with where the command is held since, and until when.
        let rows = [&[0], &changes[..], &[log.speed.len()]].concat();
        let steps = rows.windows(3).filter_map(|rows| log.step(rows[0], rows[1], rows[2], &mut left_out));
        let mut steps: Vec<Step> = steps.collect();
        let is_test = held_out(steps.len(), declared.role, declared.held_out);
        steps.iter_mut().zip(is_test).for_each(|(step, test)| step.is_test = test);
        self.findings.extend(log.findings(changes.len(), steps.len(), &left_out));
        self.steps.extend(steps);
        let holds = log.holds(&rows);
        if declared.is_commanded_in_speed() {
            self.findings.extend(speed_command_finding(&log.name, &holds));
            return Ok(());
        }
        self.zero_is_off |= log
            .command
            .iter()
            .zip(&log.speed)
            .any(|(command, speed)| *command <= 0.0 && speed.abs() < REST_RAD_S);
        self.holds.extend(holds);
        Ok(())
    }
}

/// Changes of the command that cannot be used as steps, by reason.
#[derive(Default)]
struct LeftOut {
    stopped: usize,
    short: usize,
    lost_rows: usize,
    weak: usize,
    wrong_way: Vec<String>,
}

impl<'s> Log<'s> {
    fn read(declared: &'s DynamicLog) -> Result<Self, RotorError> {
        let table = LogTable::read(&declared.source())?;
        let name = short_name(&declared.file);
        let time_s = table.times();
        let speed = table.column(&declared.speed, declared.speed.factor(SPEED))?;
        let command = table.column(&declared.command, declared.command_factor())?;
        let kept: Vec<usize> =
            (0..time_s.len()).filter(|row| speed[*row].is_finite() && command[*row].is_finite()).collect();
        let pick = |values: &[f64]| kept.iter().map(|row| values[*row]).collect::<Vec<f64>>();
        let (time_s, speed, command) = (pick(time_s), pick(&speed), pick(&command));
        let period_s = period(&time_s).ok_or_else(|| {
            let expected = "rows with time, speed and command";
            RotorError::too_little(&name, expected, "too few", "check the columns")
        })?;
        let log = Self { declared, name, time_s, speed, command, period_s };
        log.check_rate()?;
        Ok(log)
    }

    /// Refuses rows that are too far apart to show a step.
    fn check_rate(&self) -> Result<(), RotorError> {
        let (before_s, after_s) = (self.declared.before_s, self.declared.after_s);
        if self.rows(before_s) >= ROWS_BEFORE_MIN && self.rows(after_s) >= ROWS_AFTER_MIN {
            return Ok(());
        }
        let expected = format!(
            "at least {ROWS_BEFORE_MIN} row in the {before_s} s before a step and {ROWS_AFTER_MIN} in the {after_s} s after"
        );
        let advice = "correct the unit of `time`, or raise `before_s` and `after_s`";
        Err(RotorError::too_little(
            &self.name,
            expected,
            format!("one in {} s", digits(self.period_s)),
            advice,
        ))
    }

    /// True if the command of `row` differs from that of the row before.
    #[allow(clippy::float_cmp, reason = "a held command is the same number in every row")]
    fn changes(&self, row: usize) -> bool {
        self.command[row] != self.command[row - 1]
    }

    /// Returns the number of rows in `seconds`, but at most one more than the log has, whatever the stamps say.
    fn rows(&self, seconds: f64) -> usize {
        ((seconds / self.period_s).round() as usize).min(self.speed.len() + 1)
    }

    /// The step at `row` if the command is held long enough from `since` on and to `until`.
    fn step(&self, since: usize, row: usize, until: usize, left_out: &mut LeftOut) -> Option<Step> {
        let (before, after) = (self.rows(self.declared.before_s), self.rows(self.declared.after_s));
        let (from, to) = (self.command[row - 1], self.command[row]);
        if from <= 0.0 || to <= 0.0 {
            left_out.stopped += 1;
            return None;
        }
        if row < since + before || row + after > until {
            left_out.short += 1;
            return None;
        }
        let range = row - before..row + after;
        let speed = self.speed[range.clone()].to_vec();
        let stamps_s: Vec<f64> = range.clone().map(|at| self.time_s[at] - self.time_s[row]).collect();
        let rows_s: Vec<f64> = range.map(|at| (at as f64 - row as f64) * self.period_s).collect();
        if self.declared.clock == Clock::Rows && has_lost_rows(&stamps_s, &rows_s, before, self.period_s) {
            left_out.lost_rows += 1;
            return None;
        }
        let height = median(&speed[speed.len() - after / 3..]) - median(&speed[..before]);
        if height.abs() < HEIGHT_SIGMAS_MIN * spread(&speed[..before]) {
            left_out.weak += 1;
            return None;
        }
        if height * (to - from) < 0.0 {
            left_out.wrong_way.push(format!("{from} to {to} (by {height:.0} rad/s)"));
            return None;
        }
        let (file, clock, period_s) = (self.name.clone(), self.declared.clock, self.period_s);
        Some(Step { file, from, to, is_test: false, period_s, rows_s, stamps_s, clock, speed, height })
    }

    /// The steady speeds of commands that were held from a change to the next for longer than a step is looked at; the
    /// log's ends are changes.
    fn holds(&self, changes: &[usize]) -> Vec<Hold> {
        let settle = self.rows(self.declared.after_s);
        let shortest = settle + self.rows(self.declared.before_s);
        let hold = |rows: &[usize]| {
            let (command, steady) = (self.command[rows[0]], rows[0] + settle..rows[1]);
            let is_held = command > 0.0 && rows[1] >= rows[0] + shortest;
            is_held.then(|| Hold { command, speed_rad_s: median(&self.speed[steady]), is_test: false })
        };
        let mut holds: Vec<Hold> = changes.windows(2).filter_map(hold).collect();
        let is_test = held_out(holds.len(), self.declared.role, self.declared.held_out);
        holds.iter_mut().zip(is_test).for_each(|(hold, test)| hold.is_test = test);
        holds
    }

    fn findings(&self, changes: usize, used: usize, left_out: &LeftOut) -> Vec<String> {
        let LeftOut { stopped, short, lost_rows, weak, wrong_way } = left_out;
        let name = &self.name;
        let mut findings = vec![format!(
            "{name}: {used} of {changes} changes of the command are used; left out: {stopped} from or to a stopped \
             motor, {short} not held long enough, {lost_rows} with lost rows, {weak} below the noise, {} the wrong way",
            wrong_way.len()
        )];
        if !wrong_way.is_empty() {
            let list = wrong_way.join(", ");
            findings
                .push(format!("{name}: the speed went against the command: {list}: the supply or a limit"));
        }
        findings.extend(plateau::stuck_finding(name, &self.speed));
        findings.push(format!("{name}: {}", self.stamps()));
        findings
    }

    /// Describes how even the stamps are.
    fn stamps(&self) -> String {
        let mut gaps_s: Vec<f64> = self.time_s.windows(2).map(|pair| pair[1] - pair[0]).collect();
        gaps_s.sort_by(f64::total_cmp);
        let share = |part: f64| 1e3 * gaps_s[((gaps_s.len() - 1) as f64 * part) as usize];
        let clock = match self.declared.clock {
            Clock::Rows => "rows are taken as evenly spaced",
            Clock::Stamps => "stamps are taken as they are",
        };
        format!(
            "rows are {:.3} ms apart on average, their stamps {:.0}, {:.0} and {:.0} ms (5, 50 and 95 %): {clock}",
            1e3 * self.period_s,
            share(0.05),
            share(0.5),
            share(0.95)
        )
    }
}

/// Returns a finding about a log whose command is the speed that is asked for.
fn speed_command_finding(log: &str, holds: &[Hold]) -> Option<String> {
    let misses = holds.iter().map(|hold| (hold.speed_rad_s - hold.command).abs());
    let most = misses.reduce(f64::max)?;
    Some(format!(
        "{log}: the command is the speed that is asked for, which the {} held speeds miss by up to {most:.2e} rad/s; \
         it does not tell the vehicle's own command, [command]",
        holds.len()
    ))
}

/// The distance of rows: the median over long stretches, which single gaps do not move.
fn period(time_s: &[f64]) -> Option<f64> {
    let stretch = PERIOD_ROWS.min(time_s.len() / 2);
    let periods: Vec<f64> =
        time_s.iter().zip(time_s.get(stretch..)?).map(|(a, b)| (b - a) / stretch as f64).collect();
    Some(median(&periods)).filter(|period| *period > 0.0)
}

/// True if the stamps shift against the rows from before a step to after it by more than groups explain.
fn has_lost_rows(stamps_s: &[f64], rows_s: &[f64], before: usize, period_s: f64) -> bool {
    let late: Vec<f64> = stamps_s.iter().zip(rows_s).map(|(stamp, row)| stamp - row).collect();
    let shift = median(&late[late.len() - before.max(1)..]) - median(&late[..before]);
    shift.abs() > LOST_ROWS * period_s
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_period_outlives_a_gap_and_groups() {
        let time_s: Vec<f64> =
            (0..2000).map(|row| f64::from(row / 2) * 0.02 + if row > 900 { 0.18 } else { 0.0 }).collect();
        assert!((period(&time_s).unwrap() - 0.01).abs() < 1e-5);
        assert_eq!(period(&[]), None);
    }
}
