//! Clocks of the flights in the text of a report: offsets that were taken off, and poses whose offset was not found.

use std::fmt;

use crate::numbers::digits::rounded;
use crate::numbers::offset::{LATE_MAX_S, LEAST_BLOCKS};
use crate::report::flight_report::FlightReport;
use crate::report::results::Report;
use crate::search::align::Offset;

impl Report {
    /// Writes a line for each flight whose clocks were not compared, and for each channel whose times were changed.
    pub(crate) fn write_clocks(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (flight, offsets) in &self.time_offsets_s {
            let report = self.flights.iter().find(|report| report.name == *flight);
            if offsets.values().all(Option::is_none)
                && let Some(advice) = report.and_then(|report| self.advice_on_clocks(report))
            {
                writeln!(f, "clock: {flight}: {advice}")?;
            }
            for (channel, offset) in offsets {
                let Some(offset) = offset.filter(|offset| offset.taken_off != 0.0) else { continue };
                writeln!(f, "clock: {channel} of {flight} is {}", clock_in_words(offset))?;
            }
        }
        Ok(())
    }

    /// Reason why a flight with a position has no offset between its clocks, and what to do; `None` without a position.
    fn advice_on_clocks(&self, flight: &FlightReport) -> Option<String> {
        let has = |equation| flight.equations.contains(&equation);
        let least_s = LEAST_BLOCKS as f64 * self.block_s;
        let advice = if !has("acceleration") {
            return None;
        } else if !(has("gyroscope") && has("specific_force")) {
            "nothing to compare the pose with; log gyroscope and accelerometer".to_owned()
        } else if flight.compared_s < least_s {
            format!(
                "its pose was not compared with gyroscope and accelerometer in time: expected {least_s:.1} s of flight, found {:.1} \
                 s; if one of them is late, set `delay_s`",
                flight.compared_s
            )
        } else {
            format!(
                "the pose agrees with gyroscope and accelerometer at no delay up to {LATE_MAX_S} s; their clocks differ by more, or \
                 one of them is wrong: set `delay_s`, or choose one clock"
            )
        };
        Some(advice)
    }
}

/// A clock's offset and its correction.
fn clock_in_words(offset: Offset) -> String {
    let Offset { value, taken_off, .. } = offset;
    let [size_ms, moved_ms] = [value, taken_off].map(|time_s| rounded(1e3 * time_s.abs()));
    let late = if value < 0.0 { "early" } else { "late" };
    let moved = if taken_off < 0.0 { "added to" } else { "taken off" };
    format!("{size_ms} ms {late}; {moved_ms} ms were {moved} its times")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::search::align::Offsets;
    use flights::Role;
    use std::collections::BTreeMap;

    #[test]
    fn clocks_that_were_not_compared_have_their_reason() {
        let text = |compared_s: f64, equations: &[&'static str]| {
            let flight = FlightReport {
                name: "hop".to_owned(),
                role: Role::Fit,
                compared_s,
                window_s: 0.1,
                equations: equations.to_vec(),
                assumed: Vec::new(),
                notes: Vec::new(),
            };
            let unknown = Offsets::from([("attitude", None), ("position", None)]);
            let report = Report {
                flights: vec![flight],
                time_offsets_s: BTreeMap::from([("hop".to_owned(), unknown)]),
                block_s: 0.5,
                ..Report::of_nothing()
            };
            report.to_string()
        };
        let both = ["gyroscope", "specific_force", "acceleration"];
        assert!(text(20.0, &both).contains(
            "clock: hop: the pose agrees with gyroscope and accelerometer at no delay up to 0.4 s"
        ));
        assert!(text(1.0, &both).contains("clock: hop: its pose was not compared with gyroscope and accelerometer in time: expected 2.5 s of flight, found 1.0 s;"));
        assert!(text(20.0, &both[1..]).contains("clock: hop: nothing to compare the pose with"));
        assert!(!text(20.0, &both[..2]).contains("clock:"));
    }
    #[test]
    fn a_clock_that_is_early_is_not_late_by_a_negative_time() {
        let offset = |value: f64| Offset { value, low: value, high: value, taken_off: value };
        assert_eq!(clock_in_words(offset(-0.01264)), "12.64 ms early; 12.64 ms were added to its times");
        assert_eq!(clock_in_words(offset(0.01264)), "12.64 ms late; 12.64 ms were taken off its times");
    }
}
