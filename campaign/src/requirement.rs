//! A requirement on the pass rate, which decides the exit code: `pass_rate >= 0.99 at 95 %`.

use crate::statistics::lower_limit;
use std::fmt;
use std::str::FromStr;

/// A smallest pass rate, and the confidence with which it must be shown.
///
/// ```
/// use campaign::requirement::Requirement;
/// let required: Requirement = "pass_rate >= 0.99 at 95 %".parse()?;
/// // 298 flights without a failure do not show it, 299 do.
/// assert!(!required.is_met(298, 298) && required.is_met(299, 299));
/// # Ok::<(), String>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Requirement {
    /// Smallest pass rate.
    pub pass_rate: f64,
    /// Confidence of the one-sided lower limit; `None` compares the rate of the flights themselves.
    pub confidence: Option<f64>,
}

impl Requirement {
    /// True if `passed` of `flights` show it.
    #[must_use]
    pub fn is_met(&self, passed: u64, flights: u64) -> bool {
        self.shown(passed, flights) >= self.pass_rate
    }

    /// The pass rate that `passed` of `flights` show.
    #[must_use]
    pub fn shown(&self, passed: u64, flights: u64) -> f64 {
        match self.confidence {
            Some(confidence) => lower_limit(passed, flights, confidence),
            None => passed as f64 / flights.max(1) as f64,
        }
    }
}

impl Requirement {
    /// Text of the pass rate that `passed` of `flights` show.
    ///
    /// ```
    /// # let required: campaign::requirement::Requirement = "pass_rate >= 0.99 at 95 %".parse()?;
    /// let words = "50 of 50 flights passed, which shows a pass rate of at least 0.9418 (one-sided lower limit at 95 %; the interval of \
    ///              the summary has two sides, each at 97.5 %)";
    /// assert_eq!(required.shown_in_words(50, 50), words);
    /// # Ok::<(), String>(())
    /// ```
    #[must_use]
    pub fn shown_in_words(&self, passed: u64, flights: u64) -> String {
        let shown = self.shown(passed, flights);
        let flown = format!("{passed} of {flights} flights passed");
        match self.confidence {
            None => format!("{flown}, a pass rate of {shown:.4}"),
            Some(confidence) => format!(
                "{flown}, which shows a pass rate of at least {shown:.4} (one-sided lower limit at {} %; the interval of \
                 the summary has two sides, each at 97.5 %)",
                percent(confidence)
            ),
        }
    }
}

/// A part of one in percent, without the digits that the product adds.
fn percent(part: f64) -> f64 {
    (part * 1e8).round() / 1e6
}

impl FromStr for Requirement {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let refused =
            || format!("expected `pass_rate >= 0.99 at 95 %` or `pass_rate >= 0.99`, found `{text}`");
        let beyond = |what: &str, range: &str| format!("the {what} must be {range}, found `{text}`");
        let rate =
            text.trim().strip_prefix("pass_rate").and_then(|rest| rest.trim_start().strip_prefix(">="));
        let rate = rate.ok_or_else(refused)?;
        let (rate, confidence) = match rate.split_once("at") {
            Some((rate, confidence)) => (rate, Some(confidence)),
            None => (rate, None),
        };
        let part = |text: &str, percent: f64| text.trim().parse::<f64>().ok().map(|number| number / percent);
        let pass_rate = part(rate, 1.0).ok_or_else(refused)?;
        if !(0.0..=1.0).contains(&pass_rate) {
            return Err(beyond("pass rate", "0 to 1"));
        }
        let confidence = confidence.map(|text| {
            let percent = text.trim().strip_suffix('%').ok_or_else(refused)?;
            let confidence = part(percent, 100.0).ok_or_else(refused)?;
            let is_known = (0.5..1.0).contains(&confidence);
            if is_known { Ok(confidence) } else { Err(beyond("confidence", "at least 50 % and below 100 %")) }
        });
        Ok(Self { pass_rate, confidence: confidence.transpose()? })
    }
}

impl fmt::Display for Requirement {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "pass_rate >= {}", self.pass_rate)?;
        self.confidence.map_or(Ok(()), |confidence| write!(f, " at {} %", percent(confidence)))
    }
}

#[cfg(test)]
mod tests {
    use super::Requirement;

    #[test]
    fn other_texts_are_refused() {
        for text in [
            "pass_rate > 0.9",
            "pass_rate >= 2",
            "pass_rate >= 0.9 at 95",
            "pass_rate >= 0.9 at 100 %",
            "rate",
        ] {
            let error = text.parse::<Requirement>().unwrap_err();
            assert!(error.contains(&format!("found `{text}`")), "{error}");
        }
        for (text, range) in [
            ("pass_rate >= 1.2", "the pass rate must be 0 to 1,"),
            ("pass_rate >= -0.1", "the pass rate must be 0 to 1,"),
            ("pass_rate >= nan", "the pass rate must be 0 to 1,"),
            ("pass_rate >= 0.9 at 0 %", "the confidence must be at least 50 % and below 100 %,"),
            ("pass_rate >= 0.9 at 100 %", "the confidence must be at least 50 % and below 100 %,"),
        ] {
            let error = text.parse::<Requirement>().unwrap_err();
            assert!(error.starts_with(range), "{error}");
        }
        assert_eq!("pass_rate>=0.5".parse::<Requirement>().unwrap().to_string(), "pass_rate >= 0.5");
    }
}
