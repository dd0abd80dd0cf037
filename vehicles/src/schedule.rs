//! Schedules: parameters that are lines of times and values.

use crate::reader::{Origin, Section, seen};
use diagnostics::parameter::{Bounds, ParameterError};
use diagnostics::unit::Dimension;
use diagnostics::{Diagnostic, Faults};
use std::ops::Range;
use toml::Spanned;
use toml::de::DeValue;

/// Kind of value that a schedule is.
const POINTS: &str = "an array of one or more points [time in s, value]";

impl<'d, 't> Section<'d, 't> {
    /// A parameter whose value is an array of points `[time, value]`, the times in s and not falling, the values of
    /// `dimension`; both in SI and each within its `bounds`. It was chosen, so it has an `uncertainty` only if
    /// the file has one.
    ///
    /// # Errors
    /// The invalid points, each with its place.
    pub fn schedule(
        &self,
        name: &'d str,
        dimension: Dimension,
        bounds: [&Bounds; 2],
    ) -> Result<Vec<[f64; 2]>, Diagnostic> {
        let parameter = self.parameter(name)?;
        let mut faults = Faults::default();
        let value = faults.keep(parameter.need("value", POINTS));
        let factor = faults.keep(parameter.meta(dimension, Origin::Chosen));
        let (value, factor) = faults.finish(value.zip(factor))?;
        let points = value.get_ref().as_array().map_or(&[][..], |array| array);
        if points.is_empty() {
            return Err(parameter.no_points(&value.span(), "value", value));
        }
        let (mut faults, mut before_s) = (Faults::default(), f64::NEG_INFINITY);
        let mut schedule: Vec<[f64; 2]> = Vec::with_capacity(points.len());
        for (place, point) in points.iter().enumerate() {
            let key = format!("value.{place}");
            let read = parameter.point(&key, point).map(|[time_s, target]| [time_s, target * factor]);
            let Some([time_s, target]) = faults.keep(read) else { continue };
            for ((si, bounds), unit) in [time_s, target].into_iter().zip(bounds).zip(["s", dimension.si()]) {
                let refused = |error: ParameterError| {
                    Diagnostic::at(self.doc.place(&point.span()), error.in_unit(unit))
                };
                faults.keep(bounds.check(&parameter.key(&key), si).map_err(refused));
            }
            if time_s < before_s {
                let expected =
                    format!("a time of {before_s} s or later: the points are in the order of time");
                let found = format!("{time_s} s");
                faults.keep(Err::<(), _>(self.doc.bad(&point.span(), &parameter.key(&key), expected, found)));
            }
            before_s = time_s;
            schedule.push([time_s, target]);
        }
        faults.finish(Some(schedule))
    }

    /// The two numbers of a point.
    fn point(&self, key: &str, point: &Spanned<DeValue<'t>>) -> Result<[f64; 2], Diagnostic> {
        let numbers: Vec<_> = point.get_ref().as_array().into_iter().flat_map(|array| array.iter()).collect();
        let [time, target] = numbers[..] else {
            return Err(self.no_points(&point.span(), key, point));
        };
        Ok([self.number(key, time)?, self.number(key, target)?])
    }

    /// The error of a value that has no points.
    fn no_points(&self, at: &Range<usize>, key: &str, value: &Spanned<DeValue<'t>>) -> Diagnostic {
        let found = match value.get_ref().as_array() {
            Some(array) if array.is_empty() => "an empty array".to_owned(),
            Some(array) => format!("an array of {}", array.len()),
            None => seen(value),
        };
        let expected =
            if key == "value" { POINTS } else { "a point: an array of two numbers, time in s and value" };
        self.doc.bad(at, &self.key(key), expected, found)
    }
}
