//! Form of a table's file, as a flights file declares it.

use std::num::NonZero;

use vehicles::table::Dialect;

use crate::declaration::Entry;

/// Declared form of a CSV or Parquet file.
pub struct Form<'a> {
    /// Header, delimiter and decimal mark.
    pub dialect: &'a Dialect,
    /// Number of rows that the file has at least.
    pub rows_min: usize,
    /// Number of the recording that is used, from 1.
    pub recording: Option<NonZero<usize>>,
    /// Advice for a file with several recordings.
    pub restarts: &'static str,
    /// Column of the times.
    pub time: Option<&'a Entry>,
    /// The channels that are read from the file, whose names find the header.
    pub channels: Vec<&'a Entry>,
}
