//! Thrust and torque of the static logs of a stand, with scores and findings.

use std::f64::consts::PI;

use diagnostics::Dimension;
use diagnostics::unit::{self, SPEED};
use serde::Serialize;

use super::coefficient::{Coefficient, PLATEAUS_MIN, Point};
use super::error::RotorError;
use super::plateau::{self, Plateaus, REST_RAD_S, median, median_error, without_outliers};
use super::stand::{Column, Stand, StaticLog, held_out, short_name};
use super::table::LogTable;
use crate::numbers::statistics::mean;

/// Density of air for checks of plausibility, in kg/m^3 (15 degrees C at sea level, ISO 2533).
pub const AIR_KG_M3: f64 = 1.225;

/// Results of the static logs.
#[derive(Debug, Clone, Serialize)]
pub struct Statics {
    /// c_T.
    pub thrust: Option<Coefficient>,
    /// c_Q.
    pub torque: Option<Coefficient>,
    /// Plausibility of the figures for a propeller; only if the stand file has its diameter.
    pub plausibility: Option<Plausibility>,
    /// Slowest and fastest plateau fitted, in rad/s.
    pub speeds_rad_s: (f64, f64),
    /// Faults of the data or of the law, and data that were left out.
    pub findings: Vec<String>,
}

/// Numbers without dimension, by which wrong units are noticed.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Plausibility {
    /// C_T = T / (rho n^2 D^4); propellers at rest have about 0.05 to 0.25.
    pub thrust_number: f64,
    /// Ideal over actual power at hover, c_T^(3/2) / (c_Q sqrt(2 rho A)); about 0.4 to 0.8, never above 1.
    pub figure_of_merit: Option<f64>,
}

/// The plateaus of a quantity of a log, and whether each is held out.
type Readings = Vec<(Point, bool)>;

/// A quantity of the stand, for texts and for its columns.
struct Quantity {
    name: &'static str,
    unit: &'static str,
    column: fn(&StaticLog) -> &Option<Column>,
    dimension: Dimension,
}

const THRUST: Quantity =
    Quantity { name: "thrust", unit: "N", column: |log| &log.thrust, dimension: unit::FORCE };
const TORQUE: Quantity =
    Quantity { name: "torque", unit: "N*m", column: |log| &log.torque, dimension: unit::TORQUE };

/// Fits the static logs of a stand; `None` if it has none.
pub fn fitted(stand: &Stand) -> Result<Option<Statics>, RotorError> {
    if stand.statics.is_empty() {
        return Ok(None);
    }
    let mut findings = Vec::new();
    let logs =
        stand.statics.iter().map(|log| Log::read(log, &mut findings)).collect::<Result<Vec<_>, _>>()?;
    let thrust = coefficient(&THRUST, &logs, &mut findings)?;
    let torque = coefficient(&TORQUE, &logs, &mut findings)?;
    let speeds: Vec<f64> = logs.iter().flat_map(Log::turning).map(|(speed, _)| speed).collect();
    let plausibility =
        stand.diameter_m.and_then(|diameter| Plausibility::of(diameter, thrust.as_ref(), torque.as_ref()));
    findings.extend(plausibility.iter().filter_map(Plausibility::finding));
    let (slowest, fastest) = plateau::range(&speeds);
    let speeds_rad_s = (slowest, fastest.max(0.0));
    Ok(Some(Statics { thrust, torque, plausibility, speeds_rad_s, findings }))
}

/// A static log, its rows with a speed.
struct Log<'s> {
    declared: &'s StaticLog,
    name: String,
    table: LogTable,
    kept: Vec<usize>,
    speed: Vec<f64>,
    plateaus: Plateaus,
}

impl<'s> Log<'s> {
    fn read(declared: &'s StaticLog, findings: &mut Vec<String>) -> Result<Self, RotorError> {
        let table = LogTable::read(&declared.source())?;
        let name = short_name(&declared.file);
        let time_s = table.times();
        let speed = table.column(&declared.speed, declared.speed.factor(SPEED))?;
        let kept: Vec<usize> = (0..speed.len()).filter(|row| speed[*row].is_finite()).collect();
        let time_s: Vec<f64> = kept.iter().map(|row| time_s[*row]).collect();
        let speed: Vec<f64> = kept.iter().map(|row| speed[*row]).collect();
        let plateaus = plateau::find(&time_s, &speed, declared.settle_s, declared.steady);
        let log = Self { declared, name, table, kept, speed, plateaus };
        log.look(findings);
        Ok(log)
    }

    /// Notes how much of the log is steady, and any oddity of its speed.
    fn look(&self, findings: &mut Vec<String>) {
        let steady: usize = self.plateaus.rows.iter().map(std::iter::ExactSizeIterator::len).sum();
        let spikes = self.plateaus.is_spike.iter().filter(|spike| **spike).count();
        findings.push(format!(
            "{}: {} of {} rows are on {} plateaus that were steady for {} s; {} are in transition and left out, \
             {spikes} speeds are spikes",
            self.name,
            steady,
            self.speed.len(),
            self.plateaus.rows.len(),
            self.declared.settle_s,
            self.speed.len() - steady,
        ));
        findings.extend(plateau::stuck_finding(&self.name, &self.speed));
    }

    /// Mean speed and rows of each plateau on which the rotor turns.
    fn turning(&self) -> Vec<(f64, Vec<usize>)> {
        self.all_plateaus().into_iter().filter(|(speed, _)| *speed > REST_RAD_S).collect()
    }

    /// Mean speed and rows, spikes left out, of each plateau.
    fn all_plateaus(&self) -> Vec<(f64, Vec<usize>)> {
        let rows = |plateau: &std::ops::Range<usize>| {
            plateau.clone().filter(|row| !self.plateaus.is_spike[*row]).collect::<Vec<usize>>()
        };
        let plateaus = self.plateaus.rows.iter().map(rows).filter(|rows| !rows.is_empty());
        plateaus.map(|rows| (mean(&self.speeds(&rows)), rows)).collect()
    }

    fn speeds(&self, rows: &[usize]) -> Vec<f64> {
        rows.iter().map(|row| self.speed[*row]).collect()
    }

    /// The plateaus of a quantity of the stand's log `number`, its tare taken off, and the standard error of that; `None`
    /// if the log does not have it.
    fn readings(
        &self,
        number: usize,
        quantity: &Quantity,
        findings: &mut Vec<String>,
    ) -> Result<Option<(Readings, f64)>, RotorError> {
        let Some(column) = (quantity.column)(self.declared) else { return Ok(None) };
        let values = self.table.column(column, column.factor(quantity.dimension))?;
        let read = |row: &usize| Some(values[self.kept[*row]]).filter(|value| value.is_finite());
        let (tare, tare_sigma) = self.tare(quantity, |rows| rows.iter().filter_map(read).collect(), findings);
        let mut outliers = 0;
        let mut points = Vec::new();
        for (_, rows) in self.turning() {
            let of_row = |row: &usize| Some((self.speed[*row].powi(2), read(row)? - tare));
            let (kept, left_out) = without_outliers(rows.iter().filter_map(of_row).collect());
            outliers += left_out;
            let (squares, forces): (Vec<f64>, Vec<f64>) = kept.into_iter().unzip();
            if !forces.is_empty() {
                points.push(Point { squared: mean(&squares), force: mean(&forces), log: number });
            }
        }
        if outliers > 0 {
            findings.push(format!(
                "{}: {outliers} readings of {} are outliers, left out",
                self.name, quantity.name
            ));
        }
        let is_test = held_out(points.len(), self.declared.role, self.declared.held_out);
        Ok(Some((points.into_iter().zip(is_test).collect(), tare_sigma)))
    }

    /// Returns the stand's reading at rest before the run, with its standard error from the readings' scatter. A rest
    /// after the run only shows the drift: by then a stand is warm, and a person may be at it.
    fn tare(
        &self,
        quantity: &Quantity,
        read: impl Fn(&[usize]) -> Vec<f64>,
        findings: &mut Vec<String>,
    ) -> (f64, f64) {
        let Quantity { name, unit, .. } = quantity;
        let plateaus = self.all_plateaus().into_iter();
        let at_rest = plateaus.filter(|(speed, _)| *speed <= REST_RAD_S).map(|(_, rows)| read(&rows));
        let rests: Vec<Vec<f64>> = at_rest.filter(|readings| !readings.is_empty()).collect();
        let (Some(first), Some(last)) = (rests.first(), rests.last()) else {
            findings.push(format!("{}: no {name} at rest was logged: no tare is taken off", self.name));
            return (0.0, 0.0);
        };
        let (tare, sigma) = (median(first), median_error(first));
        let (low, high) = plateau::range(last);
        let end = if rests.len() > 1 {
            format!(
                "; at the end it reads {low:.2e} to {high:.2e}, so plateaus are uncertain by such a drift"
            )
        } else {
            String::new()
        };
        let error = format!("{tare:.3e} {unit}, with a standard error of {sigma:.1e}");
        findings.push(format!("{}: tare of {name}, taken off: {error}{end}", self.name));
        (tare, sigma)
    }
}

/// The coefficient of a quantity from all logs; `None` if no log has it.
fn coefficient(
    quantity: &Quantity,
    logs: &[Log],
    findings: &mut Vec<String>,
) -> Result<Option<Coefficient>, RotorError> {
    let mut readings: Option<Readings> = None;
    let mut tare_sigmas = vec![0.0; logs.len()];
    for (number, log) in logs.iter().enumerate() {
        if let Some((more, tare_sigma)) = log.readings(number, quantity, findings)? {
            readings.get_or_insert_default().extend(more);
            tare_sigmas[number] = tare_sigma;
        }
    }
    let Some(readings) = readings else { return Ok(None) };
    let of_role = |is_wanted: bool| {
        let of_role = readings.iter().filter(|(_, is_test)| *is_test == is_wanted);
        of_role.map(|(point, _)| *point).collect::<Vec<_>>()
    };
    let (mut fit, mut test) = (of_role(false), of_role(true));
    let total: f64 = fit.iter().map(|point| point.force).sum();
    if total < 0.0 {
        findings.push(format!("{}: it is negative while the rotor turns: its sign is turned", quantity.name));
        fit.iter_mut().chain(&mut test).for_each(|point| point.force = -point.force);
    }
    let coefficient = Coefficient::fitted(&fit, &test, &tare_sigmas).ok_or_else(|| {
        let expected = format!("{PLATEAUS_MIN} plateaus to fit on");
        let advice = "log more steady speeds, or lower `settle_s` or `held_out`";
        RotorError::too_little(quantity.name, expected, fit.len(), advice)
    })?;
    findings.extend(law(quantity, &coefficient));
    Ok(Some(coefficient))
}

/// Returns a finding if the data contradict the law y = c w^2.
fn law(quantity: &Quantity, coefficient: &Coefficient) -> Option<String> {
    let Coefficient { exponent, intercept, at_slowest, at_fastest, .. } = coefficient;
    let holds = exponent.low <= 2.0 && 2.0 <= exponent.high;
    (!holds).then(|| {
        format!(
            "{}: it grows as w^{:.2} ({:.2} to {:.2}), not w^2: y/w^2 is {at_slowest:.3e} at the slowest and \
             {at_fastest:.3e} at the fastest plateau; the line's intercept of {:.1e} {} is this, not a tare",
            quantity.name, exponent.value, exponent.low, exponent.high, intercept.value, quantity.unit
        )
    })
}

impl Plausibility {
    fn of(diameter_m: f64, thrust: Option<&Coefficient>, torque: Option<&Coefficient>) -> Option<Self> {
        let c_t = thrust?.value.value;
        let area_m2 = 0.25 * PI * diameter_m * diameter_m;
        let merit = |c_q: f64| libm::pow(c_t, 1.5) / (c_q * (2.0 * AIR_KG_M3 * area_m2).sqrt());
        Some(Self {
            thrust_number: c_t * 4.0 * PI * PI / (AIR_KG_M3 * diameter_m.powi(4)),
            figure_of_merit: torque.map(|torque| merit(torque.value.value)),
        })
    }

    /// Returns a finding if no propeller can have these figures.
    fn finding(&self) -> Option<String> {
        let is_thrust_odd = !(0.02..0.4).contains(&self.thrust_number);
        let is_merit_odd = self.figure_of_merit.is_some_and(|merit| !(0.15..1.0).contains(&merit));
        (is_thrust_odd || is_merit_odd).then(|| {
            format!(
                "no propeller has a thrust number of {:.3} and a figure of merit of {:.2}: check the units, \
                 `pole_pairs` (electrical or mechanical speed) and the diameter",
                self.thrust_number,
                self.figure_of_merit.unwrap_or(f64::NAN)
            )
        })
    }
}
