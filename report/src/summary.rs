//! The summary of a run: for people, and as JSON for programs.

use crate::judge::{Verdict, WindowErrors};
use crate::shadow::{Difference, Step};
use runtime::launcher::Outcome;
use runtime::problem::Problem;
use runtime::replacement::{Purpose, Report};
use serde::Serialize;
use std::fmt;
use std::path::PathBuf;

/// Successions that the text shows.
const SUCCESSIONS_SHOWN: usize = 5;

/// What there is to say about a run.
#[derive(Debug, Serialize)]
pub struct Summary {
    /// Name of the manifest.
    pub manifest: String,
    /// Whether the run completed and every condition held.
    pub passed: bool,
    /// Ticks completed.
    pub ticks: u32,
    /// Simulated time.
    pub simulated_s: f64,
    /// Host time from first grant to last completed tick.
    pub host_s: f64,
    /// Ticks per second of host time.
    pub ticks_per_s: f64,
    /// Simulated time per host time.
    pub real_time_factor: f64,
    /// Whether the run was stopped before its end.
    pub stopped_early: bool,
    /// Deadlines missed.
    pub missed_deadlines: u32,
    /// The processes.
    pub processes: Vec<ProcessSummary>,
    /// The recording.
    pub recording: Option<PathBuf>,
    /// Pass conditions.
    pub pass: Vec<Verdict>,
    /// Comparisons with measured states.
    pub compare: Vec<WindowErrors>,
    /// Who joined the run, took over, or was refused.
    pub successions: Vec<Succession>,
    /// What shadows asked for otherwise than those they shadowed.
    pub shadows: Vec<Difference>,
    /// What `check` found odd; told before the flight.
    pub warnings: Vec<Problem>,
}

/// What there is to say about a backup.
#[derive(Debug, Serialize)]
pub struct Succession {
    /// What became of it.
    #[serde(flatten)]
    pub report: Report,
    /// How the outputs went on at its take-over.
    pub steps: Vec<Step>,
}

/// What was judged on the recording.
#[derive(Debug, Default)]
pub struct Judgement {
    /// Pass conditions.
    pub pass: Vec<Verdict>,
    /// Comparisons with measured states.
    pub compare: Vec<WindowErrors>,
    /// The steps at the take-overs, by succession.
    pub steps: Vec<Vec<Step>>,
    /// Differences of shadows.
    pub shadows: Vec<Difference>,
}

/// What there is to say about a process.
#[derive(Debug, Serialize)]
pub struct ProcessSummary {
    /// Name.
    pub name: String,
    /// Processor time per host time.
    pub cpu_share: f64,
    /// Deadlines at which it had not finished the tick before.
    pub late: u32,
}

impl Summary {
    /// The summary of `outcome`.
    pub fn new(
        manifest: String,
        outcome: Outcome,
        tick_s: f64,
        recording: Option<PathBuf>,
        judgement: Judgement,
    ) -> Self {
        let Judgement { pass, compare, steps, shadows } = judgement;
        let ticks_per_s = f64::from(outcome.ticks) / outcome.host_s.max(1e-9);
        let held = pass.iter().all(|verdict| verdict.passed) && compare.iter().all(|errors| errors.passed);
        let steps = steps.into_iter().chain(std::iter::repeat_with(Vec::new));
        let successions = outcome.replacements.into_iter().zip(steps);
        let successions: Vec<_> = successions.map(|(report, steps)| Succession { report, steps }).collect();
        let processes = outcome.processes.into_iter();
        Self {
            manifest,
            passed: held && !successions.iter().any(Succession::has_failed) && !outcome.was_stopped,
            ticks: outcome.ticks,
            simulated_s: f64::from(outcome.ticks) * tick_s,
            host_s: outcome.host_s,
            ticks_per_s,
            real_time_factor: ticks_per_s * tick_s,
            stopped_early: outcome.was_stopped,
            missed_deadlines: outcome.missed_deadlines,
            processes: processes
                .map(|(name, cpu_share, late)| ProcessSummary { name, cpu_share, late })
                .collect(),
            recording,
            pass,
            compare,
            successions,
            shadows,
            warnings: Vec::new(),
        }
    }

    /// The replacements as text; those that were refused are never left out.
    fn write_successions(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut left_out = 0;
        for (index, succession) in self.successions.iter().enumerate() {
            if index < SUCCESSIONS_SHOWN || succession.report.refused.is_some() {
                writeln!(f, "{succession}")?;
            } else {
                left_out += 1;
            }
        }
        match left_out {
            0 => Ok(()),
            more => writeln!(f, "  … and {more} more; --json has them all"),
        }
    }
}

impl Succession {
    /// Whether it was planned and did not come about, which fails the run.
    fn has_failed(&self) -> bool {
        self.report.is_planned && self.report.refused.is_some()
    }
}

impl fmt::Display for Summary {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(
            f,
            "{}: {} ticks ({:.3} s) in {:.3} s: {:.0} ticks/s, {:.2} × real time",
            self.manifest, self.ticks, self.simulated_s, self.host_s, self.ticks_per_s, self.real_time_factor
        )?;
        if self.stopped_early {
            writeln!(f, "  stopped before its end")?;
        }
        if self.missed_deadlines > 0 {
            writeln!(f, "  {} deadlines missed", self.missed_deadlines)?;
        }
        let share = |process: &ProcessSummary| format!("{} {:.0} %", process.name, process.cpu_share * 100.0);
        writeln!(f, "  cpu: {}", self.processes.iter().map(share).collect::<Vec<_>>().join(", "))?;
        self.write_successions(f)?;
        self.shadows.iter().try_for_each(|difference| writeln!(f, "{difference}"))?;
        self.compare.iter().try_for_each(|errors| writeln!(f, "{errors}"))?;
        self.pass.iter().try_for_each(|verdict| writeln!(f, "{verdict}"))?;
        if let Some(recording) = &self.recording {
            writeln!(f, "  recording: {}", recording.display())?;
        }
        let refused = self.successions.iter().filter(|succession| succession.has_failed()).count();
        match (self.passed, refused) {
            (true, _) => write!(f, "passed"),
            (false, 0) => write!(f, "FAILED"),
            (false, 1) => write!(f, "FAILED: a backup was refused"),
            (false, _) => write!(f, "FAILED: {refused} backups were refused"),
        }
    }
}

impl fmt::Display for Succession {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let report = &self.report;
        let purpose = match report.purpose {
            Purpose::Swap => "swap",
            Purpose::Standby => "standby",
            Purpose::Shadow => "shadow",
            Purpose::Restart => "restart",
        };
        write!(f, "  {purpose} of `{}`", report.process)?;
        match (report.join_tick, report.take_over_tick, report.purpose) {
            (_, Some(take_over), Purpose::Restart) => write!(f, " at tick {take_over}")?,
            (Some(join), Some(take_over), _) => {
                write!(f, ": shadowed from tick {join}, flew from {take_over}")?
            }
            (Some(join), None, _) => write!(f, ": shadowed from tick {join}")?,
            (None, ..) => {}
        }
        if let (Some(_), Some(hand_over)) = (report.take_over_tick, report.hand_over) {
            write!(f, ", handed over: {hand_over}")?;
        }
        if report.join_tick.is_some() {
            let (start_ms, hold_ms) = (report.start_ms, report.hold_ms);
            write!(f, " (started in {start_ms:.1} ms, held the clock for {hold_ms:.1} ms)")?;
        }
        if let Some(reason) = &report.refused {
            // Its last words stand below how it ended.
            let lines: Vec<&str> = reason.lines().map(str::trim).take(3).collect();
            write!(f, ": REFUSED: {}", lines.join("; "))?;
        }
        self.steps.iter().try_for_each(|step| write!(f, "\n{step}"))
    }
}
