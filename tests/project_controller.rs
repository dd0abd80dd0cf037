//! The test that `hummingbus new` writes into a project, flown with the templates.

#[allow(dead_code, reason = "its `main` is for a process of its own")]
#[path = "../src/cli/project/rust/src/main.rs"]
mod controller;
