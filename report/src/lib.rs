//! What recordings and runs show: verdicts, summaries, figures, profiles and pages.
//!
//! | room | what it holds |
//! |---|---|
//! | [`judge`] | pass conditions and comparisons, evaluated on a recording |
//! | `response` | lag and gain of a signal behind another |
//! | [`shadow`] | how outputs went on at take-overs, and what shadows asked for otherwise |
//! | [`summary`] | all that there is to say about a run, as text and as JSON |
//! | [`plot`] | curves over time and paths in space, as a page, PNG or SVG |
//! | [`profile`] | where the host time of ticks goes |
//! | [`validate`] | measured flights flown again, and their errors at the ends of windows |
//! | [`top`] | a live run in the terminal |
//! | [`identification`] | the page of an identification |
//! | [`page`] | what all pages share |
//!
//! Texts, JSON and bytes are returned: but for [`top::watch`], nothing here prints.
#![forbid(unsafe_code)]

mod cells;
pub mod identification;
pub mod judge;
pub mod page;
pub mod plot;
pub mod profile;
mod response;
pub mod shadow;
mod states;
pub mod summary;
pub mod top;
pub mod validate;
