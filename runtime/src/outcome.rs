//! The outcome of a run.

use crate::checkpoint::Written;
use crate::flight::Flight;
use crate::rewind::Rewound;
use crate::supervisor::replacement::Report;
use bus::remark::Remark;

/// The outcome of a run, as [`Launcher::fly`](crate::launcher::Launcher::fly) returns it.
#[derive(Debug)]
pub struct Outcome {
    /// The first tick that was computed: 0, or that of the checkpoint from which the run went on.
    pub first_tick: u32,
    /// Ticks that every node completed, those before the first one too.
    pub ticks: u32,
    /// True if the run was stopped before its end.
    pub was_stopped: bool,
    /// Host time from the first grant to the last completed tick.
    pub host_s: f64,
    /// Deadlines missed (paced runs).
    pub missed_deadlines: u32,
    /// Name, processor share of one core, and deadlines at which it was late, for each process.
    pub processes: Vec<(String, f64, u32)>,
    /// Name, overruns and skipped steps of each process whose steps take simulated time. An overrun is a step that
    /// took longer than to the next due tick; a skipped step is a due tick without a step.
    pub overruns: Vec<(String, u32, u32)>,
    /// Remarks of the components on the run, in the order of the nodes.
    pub remarks: Vec<Remark>,
    /// Results of backups.
    pub replacements: Vec<Report>,
    /// The host times that the processes noted, in a run that is profiled.
    pub flight: Option<Flight>,
    /// Figures of the conditions, as the judge of a run without a recording wrote them; `None` for a run that was stopped.
    pub figures: Option<Vec<u8>>,
    /// Files of the checkpoints that were written and kept, in their order.
    pub checkpoints: Vec<Written>,
    /// Checkpoints of the plan that could not be written, in words.
    pub missed_checkpoints: Vec<String>,
    /// Times at which the run went back in flight.
    pub rewinds: Vec<Rewound>,
}
