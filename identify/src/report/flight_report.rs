//! A flight in the report.

use flights::Role;
use serde::Serialize;

/// A flight as it was used.
#[derive(Debug, Clone, Serialize)]
pub struct FlightReport {
    /// Its name.
    pub name: String,
    /// `fit`, `select` or `test`.
    pub role: Role,
    /// Length of the compared part, in s.
    pub compared_s: f64,
    /// Width of the windows in which measurement and model are compared, in s.
    pub window_s: f64,
    /// The equations that its channels allow.
    pub equations: Vec<&'static str>,
    /// Assumptions in place of measurements.
    pub assumed: Vec<String>,
    /// Notes of the reader.
    pub notes: Vec<String>,
}
