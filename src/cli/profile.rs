//! The command `profile`, and its files.

use super::files::PAGE;
use anyhow::Result;
use clap::Args;
use report::profile::{Profile, TRACE_START};
use runtime::flight::Flight;
use runtime::output_file::{self, Kind, Mark};
use runtime::outputs::Output;
use serde::Serialize;
use std::io::Write as _;
use std::path::{Path, PathBuf};

const TRACE: Kind = Kind { name: "trace", mark: Mark::Start(TRACE_START.as_bytes()) };

/// Files to write beside what is printed.
#[derive(Args, Clone, Serialize)]
pub struct Files {
    /// Write a timeline that ui.perfetto.dev opens.
    #[arg(long, value_name = "FILE")]
    trace: Option<PathBuf>,
    /// Write a page with histograms and the slowest ticks.
    #[arg(long, value_name = "FILE")]
    html: Option<PathBuf>,
}

impl Files {
    /// Both, named like the recording and beside it.
    pub fn beside(recording: &Path) -> Self {
        let file = |extension| Some(recording.with_extension(extension));
        Self { trace: file("trace.json"), html: file("profile.html") }
    }

    /// The requested files, to be checked before a run is flown for them.
    pub fn outputs(&self) -> Vec<Output> {
        let output = |what: &str, path: &Option<PathBuf>, kind, flag: &str| {
            let advice = format!("name another with {flag} FILE");
            path.as_ref().map(|path| Output { what: what.to_owned(), path: path.clone(), kind, advice })
        };
        let trace = output("the trace", &self.trace, &TRACE, "--trace");
        trace.into_iter().chain(output("the page", &self.html, &PAGE, "--html")).collect()
    }

    /// Writes the requested files; returns a line about the content of each.
    ///
    /// # Errors
    /// If one cannot be written.
    pub fn write(&self, name: &str, flight: &Flight, profile: &Profile) -> Result<Vec<String>> {
        let mut lines = Vec::new();
        if let Some(path) = &self.trace {
            let written = output_file::write(path, &TRACE, |out| profile.write_trace(flight, out))?;
            lines.push(format!("trace: {} ({written}); open it in ui.perfetto.dev", path.display()));
        }
        if let Some(path) = &self.html {
            output_file::write(path, &PAGE, |out| out.write_all(&profile.page(name, flight)))?;
            lines.push(format!("page: {}", path.display()));
        }
        Ok(lines)
    }
}
