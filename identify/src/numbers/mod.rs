//! Numbers of any kind: statistics, least squares, and numbers in texts. Nothing here knows a flight.
//!
//! | file | contents |
//! |---|---|
//! | `statistics` | statistics of residuals, and intervals of estimates |
//! | `normal` | least squares over blocks of time: normal equations |
//! | `offset` | the offset in time between two channels |
//! | `digits` | numbers in texts for people |

pub mod digits;
pub mod normal;
pub mod offset;
pub mod statistics;
