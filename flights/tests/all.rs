//! Tests of logs of flights, in one program, which builds sooner than one for each file.

#[path = "support/dataflash.rs"]
mod dataflash_file;
#[path = "support/lz4.rs"]
mod lz4;
#[path = "support/parquet.rs"]
mod parquet_file;
#[path = "../../tests/runs/skipped.rs"]
mod skipped;
mod support;

mod axes;
mod bags;
mod commands;
mod dataflash;
mod force;
mod held_out;
mod parquet;
mod parts;
mod patterns;
mod read_once;
mod real;
mod rig;
mod synthetic;
mod tables;
mod ulog;
mod units;
mod wind;
