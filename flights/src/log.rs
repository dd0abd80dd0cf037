//! A log of any format: samples of numbers by name.

use crate::error::LogError;
use crate::number_rows::NumberRows;
use crate::seams::SeamList;

/// Samples of some numbers as the log has them: any origin of time, any unit.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Samples {
    /// When, in seconds; need not grow, and can be NaN where the log has no number.
    pub time_s: Vec<f64>,
    /// The numbers in the order they were asked for; NaN where the log has none.
    pub rows: NumberRows,
    /// Notes on the samples, such as which stamp was taken.
    pub notes: Vec<String>,
    /// Seams of a log in several files: for each, the time of the last sample before it, and of the first behind it. Infinite
    /// where there is none.
    pub seams: SeamList,
}

/// Interface of every format.
pub trait Log {
    /// The samples of `names` on `topic`.
    fn samples(&self, topic: Option<&str>, names: &[String]) -> Result<Samples, LogError>;

    /// The line of the row whose time is nearest to `time_s`, where the format has lines.
    fn line(&self, _time_s: f64) -> Option<u64> {
        None
    }

    /// Checks that the times of these topics are of one clock.
    fn check_clocks(&self, _topics: &[&str]) -> Result<(), LogError> {
        Ok(())
    }

    /// Time of the log's clock, in ns, from which the times of samples count.
    fn origin_ns(&self) -> i128 {
        0
    }

    /// The names of a table's columns; none where the format has topics.
    fn columns(&self) -> Vec<String> {
        Vec::new()
    }

    /// The topics that have data, with the type of each; none where the format has no types.
    fn topics(&self) -> Vec<(String, String)> {
        Vec::new()
    }
}
