//! A run as shown: in words for screen and paper, and as JSON.

use crate::cells::Cells;
use runtime::ctl::protocol::{State, Status};
use serde::Serialize;
use std::fmt;
use std::path::Path;

/// A run as shown; its text is a table of its vehicles, one of its processes and one of its topics.
///
/// ```
/// use bus::plan::Pace;
/// use report::top::View;
/// use runtime::ctl::protocol::{State, Status};
/// use runtime::manifest::PaceSetting;
/// let (run_id, state, pace) = ("1f-2e".to_owned(), State::Paused, PaceSetting(Pace::Free));
/// let (tick, end_tick, time_s, groups) = (5, 10, 0.005, Vec::new());
/// let status = Status { run_id, state, tick, end_tick, time_s, pace, missed_deadlines: 0, groups };
/// let (vehicles, processes, topics) = (Vec::new(), Vec::new(), Vec::new());
/// let manifest = "hover.toml".to_owned();
/// let view = View { manifest, status, span_s: 0.5, real_time_factor: 0.0, vehicles, processes, topics };
/// assert!(view.to_string().starts_with("hover.toml  run 1f-2e  paused\ntick 5 / 10  0.005 s"));
/// ```
#[derive(Clone, Debug, Serialize)]
pub struct View {
    /// The manifest that it flies.
    pub manifest: String,
    /// Progress of the run.
    #[serde(flatten)]
    pub status: Status,
    /// Host time between the looks, in seconds.
    pub span_s: f64,
    /// Simulated time per host time.
    pub real_time_factor: f64,
    /// The vehicles, of a run that is recorded.
    pub vehicles: Vec<VehicleRow>,
    /// The clock, then the nodes.
    pub processes: Vec<ProcessRow>,
    /// The topics.
    pub topics: Vec<TopicRow>,
}

/// A vehicle as shown; values are missing before its first sample.
#[derive(Clone, Debug, Default, Serialize)]
pub struct VehicleRow {
    /// Name; that of the plant's process for a vehicle without a set.
    pub name: String,
    /// Simulation time of the state, s.
    pub time_s: Option<f64>,
    /// Height of the centre of mass in the world, m.
    pub height_m: Option<f64>,
    /// Speed, m/s.
    pub speed_m_s: Option<f64>,
    /// Roll, degrees.
    pub roll_deg: Option<f64>,
    /// Pitch, degrees, positive nose down.
    pub pitch_deg: Option<f64>,
    /// Yaw, degrees, positive counter-clockwise from above.
    pub yaw_deg: Option<f64>,
}

/// A process as shown.
#[derive(Clone, Debug, Default, Serialize)]
pub struct ProcessRow {
    /// Name.
    pub name: String,
    /// Group with whose other members it shares a process: the processor time is that of all of them.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub group: Option<String>,
    /// Process number.
    pub process: Option<u32>,
    /// Its activity, or the event that it waits for.
    pub state: String,
    /// Ticks that it has completed.
    pub tick: u32,
    /// Processor time per host time; `None` where the process is gone.
    pub cpu_share: Option<f64>,
    /// Median of the time from inputs taken to outputs computed, in microseconds; `None` without steps.
    pub step_p50_us: Option<f64>,
    /// The time that 99 of 100 steps did not exceed.
    pub step_p99_us: Option<f64>,
    /// Deadlines at which it had not finished the tick before.
    pub late: u32,
}

/// A topic as shown.
#[derive(Clone, Debug, Serialize)]
pub struct TopicRow {
    /// Name.
    pub name: String,
    /// The node that sends it.
    pub publisher: String,
    /// Samples per second of host time.
    pub rate_hz: f64,
    /// Samples since the start.
    pub samples: u32,
    /// Samples that a reader missed: the first one ends the run.
    pub lost: u32,
}

/// The table of several vehicles; one alone has a line of its own.
pub fn vehicles(view: &View) -> Cells {
    let headings = ["vehicle", "height m", "speed m/s", "roll °", "pitch °", "yaw °"];
    let several = Some(&view.vehicles).filter(|vehicles| vehicles.len() > 1);
    Cells::new(&headings, 1, several.into_iter().flatten().map(vehicle).collect())
}

/// The state of the only vehicle in one line; empty if there is none or several.
pub fn only_vehicle(view: &View) -> String {
    let [only] = &view.vehicles[..] else { return String::new() };
    let [height, speed, roll, pitch, yaw] = &vehicle(only)[1..] else { return String::new() };
    let at = only.time_s.filter(|time_s| is_behind(view, *time_s));
    let at = at.map_or(String::new(), |time_s| format!("  at {time_s:.3} s"));
    format!("height {height} m  speed {speed} m/s  roll {roll}°  pitch {pitch}°  yaw {yaw}°{at}")
}

/// True for a state of a paused run that is older than the pause: the recording has it, and not yet the newer ones.
fn is_behind(view: &View, time_s: f64) -> bool {
    /// Longer than a tick at any rate that flies.
    const NEWEST_S: f64 = 0.02;
    view.status.state == State::Paused && view.status.time_s - time_s > NEWEST_S
}

fn vehicle(row: &VehicleRow) -> Vec<String> {
    let VehicleRow { name, height_m, speed_m_s, roll_deg, pitch_deg, yaw_deg, .. } = row;
    let angles = [roll_deg, pitch_deg, yaw_deg].map(|angle_deg| or_dash(*angle_deg, 1));
    [name.clone(), or_dash(*height_m, 3), or_dash(*speed_m_s, 2)].into_iter().chain(angles).collect()
}

/// A number with `digits` decimals, or a dash for none.
fn or_dash(value: Option<f64>, digits: usize) -> String {
    value.map_or("-".to_owned(), |value| format!("{value:.digits$}"))
}

/// The table of the processes.
pub fn processes(view: &View) -> Cells {
    let headings = ["process", "state", "tick", "CPU %", "p50 µs", "p99 µs", "late"];
    Cells::new(&headings, 2, view.processes.iter().map(process).collect())
}

fn process(row: &ProcessRow) -> Vec<String> {
    vec![
        row.group.as_ref().map_or(row.name.clone(), |group| format!("{} [{group}]", row.name)),
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
    let headings = ["topic", "publisher", "rate Hz", "samples", "lost"];
    Cells::new(&headings, 2, view.topics.iter().map(topic).collect())
}

fn topic(row: &TopicRow) -> Vec<String> {
    let rate = format!("{:.0}", row.rate_hz);
    vec![row.name.clone(), row.publisher.clone(), rate, row.samples.to_string(), row.lost.to_string()]
}

/// Lines above the tables: the run and its progress.
pub fn title(view: &View) -> [String; 2] {
    let status = &view.status;
    let missed = format!("{} deadlines missed", status.missed_deadlines);
    let manifest = Path::new(&view.manifest).file_name().unwrap_or_default().to_string_lossy();
    [
        format!("{manifest}  run {}  {}", status.run_id, status.state),
        format!(
            "tick {} / {}  {:.3} s  {:.2} × real time  pace {}  {missed}",
            status.tick, status.end_tick, status.time_s, view.real_time_factor, status.pace
        ),
    ]
}

impl fmt::Display for View {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [run, progress] = title(self);
        let (processes, topics) = (processes(self), topics(self));
        let (only, several) = (only_vehicle(self), vehicles(self));
        writeln!(f, "{run}\n{progress}")?;
        if !only.is_empty() {
            writeln!(f, "{only}")?;
        }
        writeln!(f)?;
        if !several.rows.is_empty() {
            writeln!(f, "{several}")?;
        }
        write!(f, "{processes}\n{topics}")
    }
}
