//! States of vehicles over time, read from a recording.

use anyhow::Result;
use flights::state::{VehicleState, WindowEndErrors};
use recorder::reader::Recording;
use recorder::series::Series;

/// The vectors of a state, simulated or measured, and their parts.
const VECTORS: [(&str, &[&str]); 4] = [
    ("position", &["x", "y", "z"]),
    ("velocity", &["x", "y", "z"]),
    ("attitude", &["x", "y", "z", "w"]),
    ("angular_velocity", &["x", "y", "z"]),
];

/// Number of fields of a state without its rates.
pub(crate) const FIELDS_OF_POSE: usize = 10;
/// Number of fields of a state.
pub(crate) const FIELDS_OF_STATE: usize = 13;

/// The states of one topic over time.
pub(crate) struct Track {
    fields: Vec<Series>,
}

impl Track {
    /// The times of the states in ns, growing.
    pub fn time_ns(&self) -> &[u64] {
        &self.fields[0].time_ns
    }

    /// The errors against `measured` states at `times_ns`, where both have a state.
    pub fn errors(&self, measured: &Self, times_ns: impl Iterator<Item = u64>) -> WindowEndErrors {
        let mut errors = WindowEndErrors::default();
        let both = times_ns.filter_map(|time_ns| self.at(time_ns).zip(measured.at(time_ns)));
        both.for_each(|(simulated, measured)| errors.add(&simulated, &measured));
        errors
    }

    /// The states, each with its time in ns.
    pub fn states(&self) -> impl Iterator<Item = (u64, VehicleState)> {
        self.time_ns().iter().filter_map(|&time_ns| Some((time_ns, self.at(time_ns)?)))
    }

    /// The state stamped `time_ns`; fields that were not read are 0.
    fn at(&self, time_ns: u64) -> Option<VehicleState> {
        let index = self.time_ns().binary_search(&time_ns).ok()?;
        let field = |field: usize| self.fields.get(field).map_or(0.0, |series| series.value[index]);
        Some(VehicleState {
            position_W_m: std::array::from_fn(field),
            velocity_W_m_s: std::array::from_fn(|axis| field(3 + axis)),
            attitude_WB: std::array::from_fn(|part| field(6 + part)),
            angular_velocity_B_rad_s: std::array::from_fn(|axis| field(10 + axis)),
        })
    }
}

/// The names of all fields of a state.
pub(crate) fn names_of_state() -> impl Iterator<Item = String> {
    VECTORS.iter().flat_map(|(vector, parts)| parts.iter().map(move |part| format!("{vector}.{part}")))
}

/// The first `fields` fields of the states of all `topics`, read in one pass.
///
/// # Errors
/// If a topic is not in the recording or holds no state.
pub(crate) fn tracks(recording: &Recording, topics: &[String], fields: usize) -> Result<Vec<Track>> {
    let names: Vec<String> = names_of_state().take(fields).collect();
    let wanted = topics.iter().flat_map(|topic| names.iter().map(|name| (topic.as_str(), name.as_str())));
    let wanted: Vec<(&str, &str)> = wanted.collect();
    let mut series = recording.series(&wanted)?.into_iter();
    Ok(topics.iter().map(|_| Track { fields: series.by_ref().take(fields).collect() }).collect())
}
