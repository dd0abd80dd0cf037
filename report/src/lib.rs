//! Reports on recordings and runs: verdicts, summaries, figures, profiles and pages.
//!
//! | room | content |
//! |---|---|
//! | [`judge`] | pass conditions and comparisons, evaluated on a recording |
//! | `response` | lag and gain of a signal behind another |
//! | [`shadow`] | steps of outputs at take-overs, and differences of shadows |
//! | [`summary`] | the summary of a run, as text and as JSON |
//! | [`airframe`] | the body of a vehicle: the parts that are seen, and the parts that touch |
//! | [`attached`] | the vehicles whose files a recording has attached |
//! | [`beyond`] | time of a flight beyond the validated envelope of its vehicle |
//! | [`ground`] | flights below the ground, with a backend that has no contacts |
//! | [`columns`], [`export`] | recordings as tables: Parquet and CSV |
//! | [`topics`] | names of topics and of message types |
//! | [`urdf`] | a vehicle as other tools show it |
//! | [`plot`] | curves over time and paths in space, as a page, PNG or SVG |
//! | [`profile`] | host time of ticks, part by part |
//! | [`validate`] | measured flights flown again, and their errors at the ends of windows |
//! | [`top`] | a live run in the terminal |
//! | [`identification`] | the page of an identification |
//! | [`page`] | the common part of all pages |
//!
//! Without the features `plots`, `tables` and `terminal`, [`plot`], [`columns`] with [`export`], and [`top`] are absent, and
//! with them what they need.
//!
//! Texts, JSON and bytes are returned: but for [`top::watch`], nothing here prints.
#![forbid(unsafe_code)]
#![allow(non_snake_case, reason = "a trailing _B or _W names the frame that a vector is written in")]

pub mod airframe;
pub mod attached;
pub mod beyond;
mod cells;
#[cfg(feature = "tables")]
pub mod columns;
#[cfg(feature = "tables")]
pub mod export;
pub mod ground;
pub mod identification;
pub mod judge;
pub mod page;
#[cfg(feature = "plots")]
pub mod plot;
pub mod profile;
mod response;
pub mod shadow;
mod states;
pub mod summary;
#[cfg(feature = "terminal")]
pub mod top;
pub mod topics;
pub mod urdf;
pub mod validate;
