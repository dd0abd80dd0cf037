//! A view as words: the same on the screen and on paper.

use crate::cells::Cells;
use crate::top::view::{ProcessRow, TopicRow, View};

/// The table of the processes.
pub fn processes(view: &View) -> Cells {
    Cells {
        headings: ["process", "state", "tick", "CPU %", "p50 µs", "p99 µs", "late"].map(str::to_owned).into(),
        is_number: vec![false, false, true, true, true, true, true],
        rows: view.processes.iter().map(process).collect(),
    }
}

fn process(row: &ProcessRow) -> Vec<String> {
    let or_dash =
        |value: Option<f64>, digits| value.map_or("-".to_owned(), |value| format!("{value:.digits$}"));
    vec![
        row.name.clone(),
        row.state.clone(),
        row.tick.to_string(),
        or_dash(row.cpu_share.map(|share| share * 100.0), 0),
        or_dash(row.step_p50_us, 1),
        or_dash(row.step_p99_us, 1),
        row.late.to_string(),
    ]
}

/// The table of the topics.
pub fn topics(view: &View) -> Cells {
    Cells {
        headings: ["topic", "publisher", "rate Hz", "samples", "lost"].map(str::to_owned).into(),
        is_number: vec![false, false, true, true, true],
        rows: view.topics.iter().map(topic).collect(),
    }
}

fn topic(row: &TopicRow) -> Vec<String> {
    let rate = format!("{:.0}", row.rate_hz);
    vec![row.name.clone(), row.publisher.clone(), rate, row.samples.to_string(), row.lost.to_string()]
}

/// What stands above the tables: the run, and how far it has come.
pub fn title(view: &View) -> [String; 2] {
    let status = &view.status;
    let missed = format!("{} deadlines missed", status.missed_deadlines);
    let manifest = std::path::Path::new(&view.manifest).file_name().unwrap_or_default().to_string_lossy();
    [
        format!("{manifest}  run {}  {}", status.run_id, status.state.word()),
        format!(
            "tick {} / {}  {:.3} s  {:.2} × real time  pace {}  {missed}",
            status.tick, status.end_tick, status.time_s, view.real_time_factor, status.pace
        ),
    ]
}

impl std::fmt::Display for View {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let [run, progress] = title(self);
        let (processes, topics) = (processes(self), topics(self));
        write!(f, "{run}\n{progress}\n\n{processes}\n{topics}")
    }
}
