//! Doubts about an angular velocity: it is compared with the derivative of the attitude, as declared and in other readings of both.

use nalgebra::Vector3;

use crate::agreement::{Agreement, Pairs};
use crate::axes::{Axes, axis_by_axis};
use crate::declaration::{Frame, Holds};
use crate::finding::Finding;
use crate::flight::Channel;
use crate::frame;
use crate::lateness;
use crate::plausible::{
    ALIKE, CLEARLY, DERIVATIVE_TOLERANCE, Judge, QUIET_ACCELERATION_M_S2, SAME, either, is_clearly_better,
    late,
};
use crate::quantity::Quantity;
use crate::specific_force::with_attitude;
use crate::units::finding;

/// Windows over which rates are derived, in s: long against the jitter between channels.
const WINDOW_S: f64 = 0.1;
/// Below this the vehicle hardly turns, and noise is compared with noise.
const QUIET_RAD_S: f64 = 0.05;
/// A gyroscope that is late by less is aligned by its readers.
const ALIGNED_S: f64 = 0.2;
/// Readings whose correlations differ by less explain the rates equally well.
const EQUAL: f64 = 0.02;
/// Least difference between rates along the axes of the body and of the world, as a part of the rates. A gyroscope that is mounted a few
/// degrees askew differs from the attitude by as much.
const APART: f64 = 0.05;
/// Farthest from 1 that the part of the other axes in the rates may be.
const PART_OFF: f64 = 0.25;
/// The part has to be above one half by so many standard deviations.
const DEVIATIONS: f64 = 5.0;
/// Part of the residual that the other axes may leave.
const LEFT: f64 = 0.75;

/// A reading of the channels under which the angular velocity is the attitude's derivative.
struct Reading {
    correlation: f64,
    finding: Finding,
}

impl Judge<'_> {
    /// The angular velocity is the attitude's derivative.
    pub fn rates(&self) -> Option<Finding> {
        if !self.flight.assumed.is_empty() {
            return None;
        }
        let pairs = Pairs::rates(&self.flight.attitude, &self.flight.angular_velocity, WINDOW_S);
        let agreement = pairs.agreement(QUIET_RAD_S)?;
        if agreement.correlation > SAME {
            self.following_rates(agreement)
        } else {
            Some(self.unlike_rates(&pairs, agreement))
        }
    }

    /// The attitude as it would be if the columns named x, y, z, w held w, x, y, z; `None` in other frames.
    pub fn w_first(&self) -> Option<Channel<4>> {
        let entry = self.units.declared(Quantity::Attitude)?;
        let plain = entry.frame.unwrap_or_default() == Frame::FluEnu && entry.columns.is_some();
        plain.then(|| Channel {
            time_s: self.flight.attitude.time_s.clone(),
            values: self.flight.attitude.values.iter().map(|[w, x, y, z]| [*x, *y, *z, *w]).collect(),
        })
    }

    /// The finding about rates that follow the attitude's derivative: their size, their axes or their lateness.
    fn following_rates(&self, agreement: Agreement) -> Option<Finding> {
        let quantity = Quantity::AngularVelocity;
        let what = format!("it is {:.4} times the derivative of the attitude", agreement.slope);
        if let Some(angles) = self.angles_that_fit(agreement.slope) {
            let unit = self.units.unit_that_fits(quantity, agreement.slope, DERIVATIVE_TOLERANCE);
            return Some(finding(quantity, either(unit, Some(angles)), &what));
        }
        self.units
            .by_unit_or_scale(quantity, agreement.slope, DERIVATIVE_TOLERANCE, &what)
            .or_else(|| self.rates_along_other_axes())
            .or_else(|| late(quantity, agreement).map(|vague| self.late_rates(agreement).unwrap_or(vague)))
    }

    /// The finding about rates that are not the attitude's derivative: the reading that explains them best, or all that do so equally.
    fn unlike_rates(&self, pairs: &Pairs, declared: Agreement) -> Finding {
        let rates = &self.flight.angular_velocity;
        let reordered = self
            .w_first()
            .and_then(|attitude| Pairs::rates(&attitude, rates, WINDOW_S).agreement(QUIET_RAD_S));
        let signs = pairs.signs();
        let signed = pairs.turned(|rate| rate.component_mul(&Vector3::from(signs))).agreement(QUIET_RAD_S);
        let along = self.along_other_axes().map(|[_, other]| other);
        // A sine with the wrong sign is one that is late by half of its period, too.
        let at_once = best([Some(declared), reordered, signed], declared);
        let placed = Axes::that_fit(pairs, QUIET_RAD_S).filter(|(_, placed)| {
            placed.correlation > SAME && placed.correlation > at_once.correlation + CLEARLY
        });
        let known = best([Some(at_once), along, placed.map(|(_, placed)| placed)], at_once);
        if let Some(late) = self.late_rates(known) {
            return late;
        }
        let fits = |agreement: &Agreement| agreement.correlation > SAME;
        let readings = [
            reordered.filter(fits).map(|reordered| self.reordered_attitude(declared, reordered)),
            placed.map(|(axes, placed)| self.exchanged_axes(declared, axes, placed)),
            signed.filter(fits).and_then(|signed| self.other_signs(declared, signs, signed)),
            along.filter(fits).map(|along| self.other_axes(declared, along)),
        ];
        best_of(readings.into_iter().flatten().collect(), declared).unwrap_or_else(|| {
            let (told, axes) = (of_derivative(declared), axis_by_axis(signs));
            finding(Quantity::AngularVelocity, None, &format!("{told} ({axes})"))
        })
    }

    /// The attitude with w first has the rates as its derivative.
    fn reordered_attitude(&self, declared: Agreement, better: Agreement) -> Reading {
        let what = format!(
            "its derivative has a correlation of {:.2} with the angular velocity, {:.2} with w first",
            declared.correlation, better.correlation
        );
        let fits = "the order w, x, y, z: name the columns in the order x, y, z, w".to_owned();
        let finding = finding(Quantity::Attitude, Some(fits), &what);
        Reading { correlation: better.correlation, finding }
    }

    /// The rates have their axes in another order.
    fn exchanged_axes(&self, declared: Agreement, axes: Axes, placed: Agreement) -> Reading {
        let quantity = Quantity::AngularVelocity;
        let what = format!(
            "{}, and of {:.2} with its axes in another order",
            of_derivative(declared),
            placed.correlation
        );
        let finding = finding(quantity, Some(axes.advice(self.units.declared(quantity))), &what);
        Reading { correlation: placed.correlation, finding }
    }

    /// The rates have other signs; `None` if no axis has the opposite sign.
    fn other_signs(&self, declared: Agreement, signs: [f64; 3], signed: Agreement) -> Option<Reading> {
        let correlation = signed.correlation;
        let [x, y, z] = signs.map(|sign| sign < 0.0);
        if !(x || y || z) {
            return None;
        }
        if signs[0] > 0.0 && y && z {
            return Some(Reading { correlation, finding: self.one_frame_is_wrong(declared.correlation) });
        }
        let fits = if x && y && z {
            format!("an attitude that takes the world to the body: {}", self.inverse_advice())
        } else {
            "the axes, or angles of the attitude, with a `-` before the name".to_owned()
        };
        let what = format!("{} ({})", of_derivative(declared), axis_by_axis(signs));
        Some(Reading { correlation, finding: finding(Quantity::AngularVelocity, Some(fits), &what) })
    }

    /// The rates are along the axes of the world, or of the body if declared in the world.
    fn other_axes(&self, declared: Agreement, along: Agreement) -> Reading {
        let other = other_axes(self.axes_of_rates());
        let what = format!(
            "{}, and of {:.2} if it is along the axes of the {}",
            of_derivative(declared),
            along.correlation,
            other.name()
        );
        let finding = finding(Quantity::AngularVelocity, Some(of_axes(other)), &what);
        Reading { correlation: along.correlation, finding }
    }

    /// The finding about rates that follow the attitude's derivative, and clearly better along the other axes.
    fn rates_along_other_axes(&self) -> Option<Finding> {
        let [now, then] = self.along_other_axes()?;
        let axes = self.axes_of_rates();
        let what = format!(
            "along the axes of the {} it has a correlation of {:.4} with the derivative of the attitude, and of {:.4} along those of \
             the {}",
            axes.name(),
            now.correlation,
            then.correlation,
            other_axes(axes).name()
        );
        Some(finding(Quantity::AngularVelocity, Some(of_axes(other_axes(axes))), &what))
    }

    /// The agreement with the axes as declared, and that with the others, if the rates are clearly along the others.
    fn along_other_axes(&self) -> Option<[Agreement; 2]> {
        let (attitude, rates) = (&self.flight.attitude, &self.flight.angular_velocity);
        let found = compared(self.along_axes(rates)?)?;
        // On a circle at constant heading, a lateness looks like a turn about z.
        if let Some(late) = lateness::of_rates(attitude, rates, WINDOW_S, QUIET_RAD_S) {
            let time_s = rates.time_s.iter().map(|time_s| time_s - late.late_s).collect();
            compared(self.along_axes(&Channel { time_s, values: rates.values.clone() })?)?;
        }
        Some(found)
    }

    /// The pairs of `rates` with the axes as declared, and with the others, both at the same times.
    fn along_axes(&self, rates: &Channel<3>) -> Option<[Pairs; 2]> {
        let attitude = &self.flight.attitude;
        let frame = self.units.declared(Quantity::AngularVelocity)?.frame.unwrap_or_default();
        let now = self.axes_of_rates();
        let then = other_axes(now);
        let declared = with_attitude(rates, attitude, |rate, _| rate);
        let other = with_attitude(rates, attitude, |rate, q| {
            let read = if now.is_in_world() { q * rate } else { rate };
            // Each change of frames undoes itself.
            let logged = frame::axes(frame, now, read.into());
            let vector = Vector3::from(frame::axes(frame, then, logged));
            if then.is_in_world() { q.inverse() * vector } else { vector }
        });
        Some([declared, other].map(|rates| Pairs::rates(attitude, &rates, WINDOW_S)))
    }

    /// The axes that the rates are declared along.
    fn axes_of_rates(&self) -> Holds {
        let entry = self.units.declared(Quantity::AngularVelocity);
        entry.and_then(|entry| entry.holds).unwrap_or(Holds::Body)
    }

    /// The attitude's derivative has y and z of the angular velocity with the other sign: one of the two is in another frame.
    /// The attitude is, if in the other one the vehicle accelerates as it leans.
    fn one_frame_is_wrong(&self, correlation: f64) -> Finding {
        let attitude = &self.flight.attitude;
        let turned = Channel {
            time_s: attitude.time_s.clone(),
            // The same change leads back.
            values: attitude.values.iter().map(|wxyz| frame::attitude(Frame::FrdNed, *wxyz)).collect(),
        };
        let leans = |attitude: &Channel<4>| {
            let agreement = self.leaning_pairs_of(attitude).1.agreement(QUIET_ACCELERATION_M_S2);
            agreement.map(|agreement| agreement.correlation)
        };
        let [here, there] = [Quantity::AngularVelocity, Quantity::Attitude].map(|one| self.other_frame(one));
        let what = format!("it has a correlation of {correlation:.2} with the derivative of the attitude");
        match (leans(attitude), leans(&turned)) {
            (Some(declared), Some(other)) if is_clearly_better(other, declared) => {
                let what = format!(
                    "its derivative has a correlation of {correlation:.2} with the angular velocity, and its lean of {declared:.2} \
                     with the acceleration; in the other frame that is {other:.2}"
                );
                finding(Quantity::Attitude, Some(there), &what)
            }
            (Some(declared), Some(other)) if is_clearly_better(declared, other) => {
                finding(Quantity::AngularVelocity, Some(here), &what)
            }
            _ => {
                let either = format!("{here} here or {there} of `attitude`");
                finding(Quantity::AngularVelocity, Some(either), &what)
            }
        }
    }

    /// The angular velocity is the attitude's derivative, but on another clock.
    fn late_rates(&self, agreement: Agreement) -> Option<Finding> {
        let (attitude, rates) = (&self.flight.attitude, &self.flight.angular_velocity);
        let late = lateness::of_rates(attitude, rates, WINDOW_S, QUIET_RAD_S)
            .filter(|late| late.correlation > agreement.correlation + ALIKE)?;
        let what = format!(
            "it has a correlation of {:.2} with the derivative of the attitude, and of {:.2} if it is {:.2} s {}: the clocks \
             of the two differ by about that",
            agreement.correlation,
            late.correlation,
            late.late_s.abs(),
            if late.late_s < 0.0 { "early" } else { "late" }
        );
        let fits = format!(
            "`delay_s = {{ angular_velocity = {:.2} }}` of the flight, added to a delay that is there already (and the same for channels of the same \
             sensor or file)",
            late.late_s
        );
        // Less than this `identify` finds and takes off by itself.
        let is_clear = late.late_s.abs() > ALIGNED_S;
        Some(finding(Quantity::AngularVelocity, is_clear.then_some(fits), &what))
    }

    /// Names under which an attitude that takes the world to the body is read.
    fn inverse_advice(&self) -> &'static str {
        let is_matrix = self.units.declared(Quantity::Attitude).is_some_and(|entry| entry.matrix.is_some());
        if is_matrix {
            "name the columns of its `matrix` column by column"
        } else {
            "negate x, y and z of its columns"
        }
    }
}

/// The agreement with the greatest correlation, or else this one.
fn best(agreements: [Option<Agreement>; 3], otherwise: Agreement) -> Agreement {
    let all = agreements.into_iter().flatten();
    all.max_by(|a, b| a.correlation.total_cmp(&b.correlation)).unwrap_or(otherwise)
}

/// The finding of the reading with the greatest correlation, with the advice of all that are equal to it.
fn best_of(mut readings: Vec<Reading>, declared: Agreement) -> Option<Finding> {
    readings.sort_by(|a, b| b.correlation.total_cmp(&a.correlation));
    let greatest = readings.first()?.correlation;
    readings.retain(|reading| reading.correlation > greatest - EQUAL);
    if readings.len() == 1 {
        return readings.pop().map(|reading| reading.finding);
    }
    let quantity = Quantity::AngularVelocity;
    let fits = readings.into_iter().filter_map(|Reading { finding, .. }| {
        let of =
            if finding.channel == quantity { String::new() } else { format!(" for `{}`", finding.channel) };
        finding.fits.map(|fits| fits + &of)
    });
    let fits = fits.collect::<Vec<_>>().join(", or ");
    let what =
        format!("{}, and {greatest:.2} with each of the following corrections", of_derivative(declared));
    Some(finding(quantity, Some(fits), &what))
}

/// The agreement with the declared axes, and that with the others, if the others explain the rates.
fn compared([declared, other]: [Pairs; 2]) -> Option<[Agreement; 2]> {
    let [now, then] = [declared.agreement(QUIET_RAD_S)?, other.agreement(QUIET_RAD_S)?];
    is_other(&declared, &other, now.slope.abs()).then_some([now, then])
}

/// True if the other axes explain the derived vectors beyond noise, and the declared axes do not. `scale`: size of the logged vectors over
/// that of the derived ones.
fn is_other(declared: &Pairs, other: &Pairs, scale: f64) -> bool {
    let all = || declared.logged.iter().zip(&other.logged).zip(&declared.derived);
    // The change of the vectors with the axes, and the change that would make them the derived ones.
    let changes: Vec<(Vector3<f64>, Vector3<f64>)> =
        all().map(|((here, there), derived)| (there - here, derived * scale - here)).collect();
    let sum = |of: &dyn Fn(&Vector3<f64>, &Vector3<f64>) -> f64| {
        changes.iter().map(|(change, wanted)| of(change, wanted)).sum::<f64>()
    };
    let size = declared.logged.iter().map(Vector3::norm_squared).sum::<f64>();
    let apart = sum(&|change, _| change.norm_squared());
    if apart <= APART * APART * size {
        return false;
    }
    let part = sum(&|change, wanted| change.dot(wanted)) / apart;
    let noise = sum(&|change, wanted| (wanted - change * part).norm_squared()) / (3 * changes.len()) as f64;
    let deviation = (noise / apart).sqrt();
    let residual = sum(&|_, wanted| wanted.norm_squared());
    let left = sum(&|change, wanted| (wanted - change).norm_squared());
    (part - 1.0).abs() < PART_OFF && part - DEVIATIONS * deviation > 0.5 && left < LEFT * LEFT * residual
}

fn other_axes(axes: Holds) -> Holds {
    if axes.is_in_world() { Holds::Body } else { Holds::World }
}

/// The key of the axes.
fn of_axes(axes: Holds) -> String {
    format!("`holds = \"{}\"`", axes.name())
}

fn of_derivative(agreement: Agreement) -> String {
    format!("it has a correlation of {:.2} with the derivative of the attitude", agreement.correlation)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Rates of a vehicle that leans by `lean_rad`, as derived, and logged along the other axes and along its own.
    fn pairs(lean_rad: f64, noise: f64) -> [Pairs; 2] {
        let turn = nalgebra::UnitQuaternion::from_euler_angles(0.0, lean_rad, 0.0);
        let derived: Vec<_> = (0..200)
            .map(|k| 0.1 * f64::from(k))
            .map(|t| Vector3::new(libm::sin(t), 0.5 * libm::cos(1.7 * t), 0.4 * libm::sin(2.9 * t)))
            .collect();
        let rough = |k: usize| noise * libm::sin(1000.0 * k as f64);
        let own: Vec<_> = derived.iter().enumerate().map(|(k, v)| v + Vector3::repeat(rough(k))).collect();
        let other = own.iter().map(|v| turn * v).collect();
        [Pairs { logged: other, derived: derived.clone() }, Pairs { logged: own, derived }]
    }

    #[test]
    fn the_other_axes_are_told_only_where_the_lean_shows_them() {
        let [other, own] = pairs(0.3, 0.05);
        assert!(is_other(&other, &own, 1.0));
        assert!(!is_other(&own, &other, 1.0));
        // A small lean, and noise that hides a larger one.
        let [other, own] = pairs(0.03, 0.0);
        assert!(!is_other(&other, &own, 1.0));
        let [other, own] = pairs(0.06, 1.0);
        assert!(!is_other(&other, &own, 1.0));
    }

    #[test]
    fn readings_that_explain_equally_are_told_together() {
        let declared = Agreement { slope: 1.0, correlation: 0.1 };
        let reading = |correlation, channel, fits: &str| Reading {
            correlation,
            finding: finding(channel, Some(fits.to_owned()), "it differs"),
        };
        let all = |other| {
            let rates = reading(0.99, Quantity::AngularVelocity, "`a`");
            best_of(vec![reading(other, Quantity::Attitude, "`b`"), rates], declared).unwrap()
        };
        assert_eq!(all(0.985).fits.as_deref(), Some("`a`, or `b` for `attitude`"));
        assert_eq!(all(0.93).fits.as_deref(), Some("`a`"));
        assert!(best_of(Vec::new(), declared).is_none());
    }
}
