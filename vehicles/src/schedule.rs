//! Schedules: parameters that are lines of times and values.

use crate::reader::{Origin, Section, seen};
use diagnostics::Diagnostic;
use diagnostics::parameter::Bounds;
use diagnostics::unit::Dimension;
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
    /// The first point that is not one, with its place.
    pub fn schedule(
        &self,
        name: &'d str,
        dimension: Dimension,
        bounds: [&Bounds; 2],
    ) -> Result<Vec<[f64; 2]>, Diagnostic> {
        let parameter = self.parameter(name)?;
        let value = parameter.need("value", POINTS)?;
        let factor = parameter.meta(dimension, Origin::Chosen)?;
        let points = value.get_ref().as_array().map_or(&[][..], |array| array);
        if points.is_empty() {
            return Err(parameter.no_points(&value.span(), "value", value));
        }
        let mut schedule: Vec<[f64; 2]> = Vec::with_capacity(points.len());
        for (place, point) in points.iter().enumerate() {
            let key = format!("value.{place}");
            let [time, target] = parameter.point(&key, point)?;
            let point_si = [time, target * factor];
            for ((si, bounds), unit) in point_si.into_iter().zip(bounds).zip(["s", dimension.si()]) {
                let refused = |error: diagnostics::ParameterError| {
                    Diagnostic::at(self.doc.place(&point.span()), error.in_unit(unit))
                };
                bounds.check(&parameter.key(&key), si).map_err(refused)?;
            }
            let before_s = schedule.last().map_or(f64::NEG_INFINITY, |[before_s, _]| *before_s);
            if time < before_s {
                let expected =
                    format!("a time of {before_s} s or later: the points are in the order of time");
                let found = format!("{time} s");
                return Err(self.doc.bad(&point.span(), &parameter.key(&key), expected, found));
            }
            schedule.push(point_si);
        }
        Ok(schedule)
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
