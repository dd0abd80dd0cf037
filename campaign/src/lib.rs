//! Campaigns: thousands of flights of one manifest, each with other values.
//!
//! | module | contents |
//! |---|---|
//! | [`declaration`] | the campaign file: the manifest, the varied values, the number of flights |
//! | [`distribution`], [`list`] | distributions of a varied value; values that are listed one by one |
//! | [`fork`] | the campaign file of `run --from FILE --fork N --vary …` |
//! | [`measures`] | measures of the campaign file, read behind the manifest |
//! | [`draw`] | values of all flights, drawn from the campaign's seed |
//! | [`plan`] | the plan: the values of every flight, a CSV file that may be edited |
//! | [`base`] | the manifest that all flights have in common, and the files it reads |
//! | [`row`] | the result of one flight |
//! | [`worker`], [`pool`] | processes that fly, and the process that hands out flights |
//! | [`slurm`], [`chunk`], [`cluster`] | Slurm's commands, the flights of one task, and the process that submits tasks and takes their rows |
//! | [`store`] | the output folder: lock, plan, rows flown so far |
//! | [`table`] | all rows as Parquet |
//! | [`tuning`], [`search`], [`flying`], [`gains_file`] | gains that cost less: the table `[tune]`, the optimiser, its flights, the new file |
//! | [`statistics`], [`requirement`], [`pass_rates`], [`report`], [`page`] | pass rate, distributions, rank correlations, the gate for continuous integration |
//!
//! A flight is a run on one thread of a worker process, without a recording. Its row depends on the plan alone: the number
//! of workers, their order and the load of the machine change no value.
#![forbid(unsafe_code)]

pub mod base;
pub mod chunk;
pub mod cluster;
pub mod declaration;
pub mod distribution;
pub mod draw;
pub mod flying;
pub mod fork;
pub mod gains_file;
pub mod list;
pub mod measures;
pub mod page;
pub mod pass_rates;
pub mod plan;
pub mod pool;
pub mod report;
pub mod requirement;
pub mod row;
pub mod search;
pub mod slurm;
pub mod statistics;
pub mod store;
pub mod table;
pub mod tuning;
pub mod worker;
