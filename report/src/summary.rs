//! The summary of a run: for people, and as JSON for programs.

use crate::beyond::{self, Beyond};
use crate::ground::{self, BelowGround};
use crate::judge::{self, Figures, Found, Verdict, WindowErrors};
use crate::shadow::{self, Difference, Replacement};
use bus::plan::Plan;
use bus::remark::Remark;
use diagnostics::{Diagnostic, Error, printable_line};
use recorder::reader::Recording;
use runtime::checkpoint::Written;
use runtime::launcher::Outcome;
use runtime::manifest::{Content, PassCondition};
use runtime::rewind::Rewound;
use serde::Serialize;
use std::fmt;
use std::path::PathBuf;
use toml::Spanned;

/// Replacements that the text shows.
const REPLACEMENTS_SHOWN: usize = 5;

/// Summary of a run: its text is for people, its JSON for programs.
#[derive(Debug, Serialize)]
pub struct Summary {
    /// Name of the manifest.
    pub manifest: String,
    /// True if the run completed and every condition held.
    pub passed: bool,
    /// The first tick of the run: that of the checkpoint from which it went on, or 0.
    pub first_tick: u32,
    /// Simulated time of a tick.
    #[serde(skip)]
    tick_s: f64,
    /// Ticks completed, from that one on.
    pub ticks: u32,
    /// Simulated time.
    pub simulated_s: f64,
    /// Host time from first grant to last completed tick.
    pub host_s: f64,
    /// Ticks per second of host time.
    pub ticks_per_s: f64,
    /// Simulated time per host time.
    pub real_time_factor: f64,
    /// True if the run was stopped before its end.
    pub stopped_early: bool,
    /// Conditions that were not judged, because the run was stopped before its end.
    pub not_judged: usize,
    /// Deadlines missed.
    pub missed_deadlines: u32,
    /// The processes.
    pub processes: Vec<ProcessSummary>,
    /// Processes whose steps take simulated time.
    pub computing_times: Vec<OverrunSummary>,
    /// Remarks of the components on the run: facts that the user must know although it went on.
    pub remarks: Vec<Remark>,
    /// The recording.
    pub recording: Option<PathBuf>,
    /// Checkpoints that were written and kept.
    pub checkpoints: Vec<Written>,
    /// Checkpoints that could not be written, in words.
    pub missed_checkpoints: Vec<String>,
    /// Times at which the run went back in flight.
    pub rewinds: Vec<Rewound>,
    /// True if the conditions are not judged: the run went on from a checkpoint without figures of the flight before.
    pub is_unjudged: bool,
    /// Pass conditions.
    pub pass: Vec<Verdict>,
    /// Numbers that are reported and not judged.
    pub measures: Vec<Verdict>,
    /// Comparisons with measured states.
    pub compare: Vec<WindowErrors>,
    /// Backups that joined the run, took over, or were refused.
    #[serde(rename = "successions")]
    pub replacements: Vec<Replacement>,
    /// Quantities beyond the envelope in which the vehicle's model was validated; `None` of a flight that was not recorded.
    pub beyond: Option<Vec<Beyond>>,
    /// Flights below the ground with a backend that has no contacts; `None` of a flight that was not recorded.
    pub below_ground: Option<Vec<BelowGround>>,
    /// Names of vehicles with an envelope that was not evaluated, because the flight was not recorded.
    #[serde(skip)]
    pub unevaluated: Vec<String>,
    /// Differences between shadows and the processes that they shadowed.
    pub shadows: Vec<Difference>,
    /// Warnings of `check`; printed before the flight.
    pub warnings: Vec<Diagnostic>,
}

/// Summary of a process.
///
/// ```
/// use report::summary::ProcessSummary;
/// let plant = ProcessSummary { name: "plant".to_owned(), cpu_share: 0.25, late: 0 };
/// assert_eq!(serde_json::to_value(plant)?["cpu_share"], 0.25);
/// # Ok::<(), serde_json::Error>(())
/// ```
#[derive(Debug, Serialize)]
pub struct ProcessSummary {
    /// Name.
    pub name: String,
    /// Processor time per host time.
    pub cpu_share: f64,
    /// Deadlines at which it had not finished the tick before.
    pub late: u32,
}

/// Steps of a process whose computing time is simulated; its text is a line of the summary.
///
/// ```
/// use report::summary::OverrunSummary;
/// let controller = OverrunSummary { name: "controller".to_owned(), overruns: 2, skipped_steps: 9 };
/// assert_eq!(controller.to_string(), "  computing time of `controller`: 2 steps overran, 9 were skipped");
/// ```
#[derive(Debug, Serialize)]
pub struct OverrunSummary {
    /// Name of the process.
    pub name: String,
    /// Steps that were not done when the next was due.
    pub overruns: u32,
    /// Steps that were skipped therefore.
    pub skipped_steps: u32,
}

impl fmt::Display for OverrunSummary {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { name, overruns, skipped_steps } = self;
        write!(f, "  computing time of `{name}`: {overruns} steps overran, {skipped_steps} were skipped")
    }
}

impl Summary {
    /// The summary of `outcome`, with nothing judged yet, of a run of `manifest` with ticks of `tick_s`.
    ///
    /// ```
    /// use report::summary::Summary;
    /// use runtime::launcher::Outcome;
    /// let outcome = Outcome {
    ///     first_tick: 0,
    ///     ticks: 2000,
    ///     was_stopped: false,
    ///     host_s: 0.5,
    ///     missed_deadlines: 0,
    ///     processes: vec![("plant".to_owned(), 0.25, 0)],
    ///     overruns: Vec::new(),
    ///     remarks: Vec::new(),
    ///     replacements: Vec::new(),
    ///     flight: None,
    ///     figures: None,
    ///     checkpoints: Vec::new(),
    ///     missed_checkpoints: Vec::new(),
    ///     rewinds: Vec::new(),
    /// };
    /// let summary = Summary::new("hover".to_owned(), outcome, 1e-3);
    /// assert_eq!((summary.passed, summary.real_time_factor), (true, 4.0));
    /// assert!(summary.to_string().starts_with("hover: 2000 ticks (2.000 s) in 0.500 s: 4000 ticks/s"));
    /// assert!(summary.to_string().ends_with("passed: the run completed, and no condition judges it"));
    /// ```
    pub fn new(manifest: String, outcome: Outcome, tick_s: f64) -> Self {
        let ticks = outcome.ticks.saturating_sub(outcome.first_tick);
        let ticks_per_s = f64::from(ticks) / outcome.host_s.max(1e-9);
        let replacement = |report| Replacement { report, steps: Vec::new() };
        let replacements: Vec<_> = outcome.replacements.into_iter().map(replacement).collect();
        let process = |(name, cpu_share, late)| ProcessSummary { name, cpu_share, late };
        let overruns = |(name, overruns, skipped_steps)| OverrunSummary { name, overruns, skipped_steps };
        Self {
            manifest,
            passed: !outcome.was_stopped && !replacements.iter().any(Replacement::has_failed),
            first_tick: outcome.first_tick,
            tick_s,
            ticks,
            simulated_s: f64::from(ticks) * tick_s,
            host_s: outcome.host_s,
            ticks_per_s,
            real_time_factor: ticks_per_s * tick_s,
            stopped_early: outcome.was_stopped,
            not_judged: 0,
            missed_deadlines: outcome.missed_deadlines,
            processes: outcome.processes.into_iter().map(process).collect(),
            computing_times: outcome.overruns.into_iter().map(overruns).collect(),
            remarks: outcome.remarks,
            recording: None,
            checkpoints: outcome.checkpoints,
            missed_checkpoints: outcome.missed_checkpoints,
            rewinds: outcome.rewinds,
            is_unjudged: false,
            pass: Vec::new(),
            measures: Vec::new(),
            compare: Vec::new(),
            replacements,
            beyond: None,
            below_ground: None,
            unevaluated: Vec::new(),
            shadows: Vec::new(),
            warnings: Vec::new(),
        }
    }

    /// Judges the run of `plan` by its `recording`, or by the `figures` of its judge ([`Outcome::figures`]): with both, figures decide, since
    /// they also hold the ticks before the checkpoint from which the run went on.
    ///
    /// # Errors
    /// As [`Summary::judge`] and [`Summary::judge_by`].
    pub fn judge_flight(
        &mut self,
        recording: Option<&Recording>,
        figures: Option<&[u8]>,
        plan: &Plan,
        content: &Content,
    ) -> Result<(), Error> {
        self.count_left_out(content);
        match (recording, figures) {
            (Some(recording), Some(figures)) => {
                self.judge_by(figures, content)?;
                self.describe(recording, plan)
            }
            // A run that was stopped has no verdicts, whatever flew before.
            (Some(recording), None) if self.first_tick > 0 && !self.stopped_early => {
                self.leave_unjudged(content);
                self.describe(recording, plan)
            }
            (Some(recording), None) => self.judge(recording, plan, content),
            (None, Some(figures)) => self.judge_by(figures, content),
            (None, None) => Ok(()),
        }
    }

    /// Counts the conditions in `content` that a run leaves out since it was stopped.
    fn count_left_out(&mut self, content: &Content) {
        if self.stopped_early {
            let compared = content.compare.iter().filter(|compare| compare.get_ref().judged);
            self.not_judged = content.pass.len() + compared.count();
        }
    }

    /// Notes that the flight before has no figures: conditions in `content` that are not judged have not held.
    fn leave_unjudged(&mut self, content: &Content) {
        self.is_unjudged = !content.conditions().topics().is_empty();
        let is_judged = content.compare.iter().any(|compare| compare.get_ref().judged);
        self.passed &= content.pass.is_empty() && !is_judged;
    }

    /// Judges the `recording` of the run: its shadows, its replacements, and the conditions in `content`. A run that
    /// was stopped has not flown the spans of its conditions, so these are left out.
    ///
    /// # Errors
    /// If the recording is damaged, or lacks data that a condition judges.
    pub fn judge(&mut self, recording: &Recording, plan: &Plan, content: &Content) -> Result<(), Error> {
        self.count_left_out(content);
        if !self.stopped_early {
            self.add(&judge::figures(&content.conditions(), recording)?, content)?;
        }
        self.describe(recording, plan)
    }

    /// Adds the shadows and replacements in the `recording` of the run.
    ///
    /// # Errors
    /// If the recording is damaged.
    pub fn describe(&mut self, recording: &Recording, plan: &Plan) -> Result<(), Error> {
        shadow::add_steps(recording, plan, &mut self.replacements)?;
        self.shadows = shadow::differences(recording, &shadow::joins(plan, &self.replacements))?;
        self.beyond = Some(beyond::of(recording)?);
        self.below_ground = Some(ground::of(recording, plan)?);
        self.recording = Some(recording.path().to_owned());
        Ok(())
    }

    /// Judges a run without a recording by the `figures` of its judge ([`Outcome::figures`]), as [`Summary::judge`] judges
    /// a recording.
    ///
    /// # Errors
    /// If the figures are not those of `content`, or there is nothing to compare.
    pub fn judge_by(&mut self, figures: &[u8], content: &Content) -> Result<(), Error> {
        self.count_left_out(content);
        if self.stopped_early { Ok(()) } else { self.add(&Figures::of_bytes(figures)?, content) }
    }

    /// Adds the verdicts on the conditions in `content`, of which these are the figures.
    fn add(&mut self, figures: &Figures, content: &Content) -> Result<(), Error> {
        let tick_s = self.tick_s;
        let of = |(pass, found): (&Spanned<PassCondition>, &Found)| {
            Verdict::of(pass.get_ref(), found).in_ticks_of(tick_s)
        };
        self.pass = content.pass.iter().zip(&figures.pass).map(of).collect();
        self.measures = content.measure.iter().zip(&figures.measures).map(of).collect();
        let compared = content.compare.iter().zip(&figures.compare);
        let compared = compared.map(|(compare, found)| WindowErrors::of(compare.get_ref(), found));
        self.compare = compared.collect::<anyhow::Result<_>>()?;
        let held = self.pass.iter().all(|verdict| verdict.passed);
        self.passed &= held && self.compare.iter().all(|errors| errors.passed);
        Ok(())
    }

    /// True if no limit of a condition or of a comparison judges the run.
    fn has_no_condition(&self) -> bool {
        self.pass.is_empty() && !self.compare.iter().any(WindowErrors::has_limits)
    }

    /// The first tick by which a condition failed.
    #[must_use]
    pub fn failed_at_tick(&self) -> Option<u32> {
        // A condition that only its whole span decides has no sample to go back to.
        let failed = self.pass.iter().filter(|verdict| !verdict.passed && !verdict.failed_at_end);
        failed.filter_map(|verdict| verdict.failed_at_tick).min()
    }

    /// The checkpoint to go back to: the newest before a condition failed first, or the newest. A run that went on from
    /// the checkpoint `from` and failed before its own first one goes back to `from`.
    #[must_use]
    pub fn checkpoint_to_go_back_to<'a>(&'a self, from: Option<&'a Written>) -> Option<&'a Written> {
        let failed_at = self.failed_at_tick();
        let is_before = |written: &&Written| failed_at.is_none_or(|failed_at| written.tick <= failed_at);
        let written = self.checkpoints.iter().rev().find(is_before);
        written.or_else(|| from.filter(|from| failed_at.is_some() && is_before(from)))
    }

    /// The end of a run that was stopped: its time, and the conditions that were not judged. Nothing has failed, and nothing has passed.
    fn stop_in_words(&self) -> String {
        let stopped_at_s = f64::from(self.first_tick + self.ticks) * self.tick_s;
        let left_out = match self.not_judged {
            0 => String::new(),
            1 => "; its condition was not judged".to_owned(),
            count => format!("; its {count} conditions were not judged"),
        };
        format!("stopped before its end, at {stopped_at_s:.3} s{left_out}")
    }

    /// The replacements as text; those that were refused are never left out.
    fn write_replacements(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let all = self.replacements.iter().enumerate();
        let is_shown =
            |(index, it): &(usize, &Replacement)| *index < REPLACEMENTS_SHOWN || it.report.refused.is_some();
        let (shown, left_out): (Vec<_>, Vec<_>) = all.partition(is_shown);
        shown.iter().try_for_each(|(_, replacement)| writeln!(f, "{replacement}"))?;
        match left_out.len() {
            0 => Ok(()),
            more => writeln!(f, "  … and {more} more; --json has them all"),
        }
    }
}

impl fmt::Display for Summary {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(
            f,
            "{}: {} ticks ({:.3} s) in {:.3} s: {:.0} ticks/s, {:.2} × real time",
            printable_line(&self.manifest),
            self.ticks,
            self.simulated_s,
            self.host_s,
            self.ticks_per_s,
            self.real_time_factor
        )?;
        if self.first_tick > 0 {
            writeln!(f, "  from the checkpoint of tick {} on", self.first_tick)?;
        }
        self.rewinds.iter().try_for_each(|rewound| writeln!(f, "  {rewound}"))?;
        if self.missed_deadlines > 0 {
            writeln!(f, "  {} deadlines missed", self.missed_deadlines)?;
        }
        let share = |process: &ProcessSummary| format!("{} {:.0} %", process.name, process.cpu_share * 100.0);
        if !self.processes.is_empty() {
            writeln!(f, "  cpu: {}", self.processes.iter().map(share).collect::<Vec<_>>().join(", "))?;
        }
        self.computing_times.iter().try_for_each(|overruns| writeln!(f, "{overruns}"))?;
        self.write_replacements(f)?;
        f.write_str(&shadow::lines(&self.shadows))?;
        self.compare.iter().try_for_each(|errors| writeln!(f, "{errors}"))?;
        self.pass.iter().chain(&self.measures).try_for_each(|verdict| writeln!(f, "{verdict}"))?;
        self.beyond.iter().flatten().try_for_each(|beyond| writeln!(f, "{beyond}"))?;
        self.below_ground.iter().flatten().try_for_each(|below| writeln!(f, "{below}"))?;
        self.remarks.iter().try_for_each(|remark| writeln!(f, "  warning: {remark}"))?;
        self.unevaluated.iter().try_for_each(|name| {
            let name = printable_line(name);
            writeln!(f, "  the flight envelope of {name} was not evaluated: it needs a recording")
        })?;
        if self.is_unjudged {
            let advice = "a run with --checkpoint-every has one";
            writeln!(
                f,
                "  conditions: not judged, since no judge flew before tick {}; {advice}",
                self.first_tick
            )?;
        }
        if let Some(recording) = &self.recording {
            writeln!(f, "  recording: {}", recording.display())?;
        }
        if let Some(last) = self.checkpoints.last() {
            writeln!(f, "  checkpoints: {}, the last {}", self.checkpoints.len(), last.path.display())?;
        }
        self.missed_checkpoints.iter().try_for_each(|missed| writeln!(f, "  warning: {missed}"))?;
        let refused = self.replacements.iter().filter(|replacement| replacement.has_failed()).count();
        if self.stopped_early && refused > 0 {
            writeln!(f, "  {}", self.stop_in_words())?;
        }
        match (self.passed, refused) {
            (true, _) if self.has_no_condition() => {
                write!(f, "passed: the run completed, and no condition judges it")
            }
            (true, _) => write!(f, "passed"),
            (false, 0) if self.stopped_early => f.write_str(&self.stop_in_words()),
            (false, 0) if self.is_unjudged => write!(f, "FAILED: the conditions were not judged"),
            (false, 0) => write!(f, "FAILED"),
            (false, 1) => write!(f, "FAILED: a backup was refused"),
            (false, _) => write!(f, "FAILED: {refused} backups were refused"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::Summary;
    use runtime::launcher::Outcome;
    use runtime::manifest::Content;

    fn stopped(conditions: usize) -> Summary {
        let outcome = Outcome {
            first_tick: 100,
            ticks: 2000,
            was_stopped: true,
            host_s: 2.0,
            missed_deadlines: 0,
            processes: Vec::new(),
            overruns: Vec::new(),
            remarks: Vec::new(),
            replacements: Vec::new(),
            flight: None,
            figures: None,
            checkpoints: Vec::new(),
            missed_checkpoints: Vec::new(),
            rewinds: Vec::new(),
        };
        let mut summary = Summary::new("hover".to_owned(), outcome, 1e-3);
        let condition = "[[pass]]\nname = \"high\"\ntopic = \"/plant/state\"\nfield = \"position.z\"\nunit = \"m\"\n\
                         statistic = \"every\"\nmin = 1.0\n";
        let manifest = format!("[run]\nduration_s = 9.0\n[process]\n{}", condition.repeat(conditions));
        let content: Content = toml::from_str(&manifest).unwrap();
        summary.judge_by(&[], &content).unwrap();
        summary
    }

    #[test]
    fn a_run_that_was_stopped_has_neither_passed_nor_failed() {
        for (conditions, end) in [
            (0, "stopped before its end, at 2.000 s"),
            (1, "stopped before its end, at 2.000 s; its condition was not judged"),
            (2, "stopped before its end, at 2.000 s; its 2 conditions were not judged"),
        ] {
            let summary = stopped(conditions);
            assert!(!summary.passed && summary.not_judged == conditions, "{summary}");
            let text = summary.to_string();
            assert!(text.ends_with(end) && text.matches("stopped").count() == 1, "{text}");
            assert!(!text.contains("FAILED") && !text.contains("passed"), "{text}");
        }
    }
}
