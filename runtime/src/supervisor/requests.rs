//! Swaps requested while the run flies.

use super::Supervisor;
use crate::ctl::protocol::{Answer, Request};
use crate::program::BackupSpec;
use crate::supervisor::replacement::{Report, next_take_over, take_over_stride};
use crate::supervisor::state_machine::State;
use crate::view::View;
use crate::world::World;
use anyhow::{Result, bail};
use bus::plan::Plan;
use diagnostics::Diagnostic;

/// Ticks that a backup shadows where a request does not say.
const SHADOW_TICKS: u32 = 100;
/// Swaps that are taken a look at most, for the supervisor has more to look after.
const MAX_SWAPS_A_LOOK: usize = 16;

/// Least tick of a take-over by a backup that joins behind tick `granted` and shadows for `shadow_ticks`: a multiple of `stride`.
fn least_tick(granted: u32, shadow_ticks: u32, stride: u32) -> u64 {
    let first = u64::from(granted) + u64::from(shadow_ticks) + 1;
    first.next_multiple_of(u64::from(stride.max(1)))
}

/// Advice on a swap of `node` in a run that has granted `granted` ticks and ends at tick `end`: the least tick of a take-over after
/// `shadow_ticks`, or after the nearest number of ticks for which there is one.
fn advice(plan: &Plan, node: usize, (granted, end): (u32, u32), shadow_ticks: u32) -> String {
    let (period, stride) = (plan.nodes[node].period_ticks, take_over_stride(plan, node));
    let least = |shadow_ticks: u32| {
        let first = u32::try_from(least_tick(granted, shadow_ticks, stride)).ok()?;
        next_take_over(plan, node, first).filter(|least| *least < end)
    };
    // A backup joins and takes over at ticks at which its node computes.
    let whole = shadow_ticks.checked_next_multiple_of(period);
    let found = whole.into_iter().chain([period]).find_map(|shadow| Some((shadow, least(shadow)?)));
    match found {
        None => "no tick at which it could take over is left before the end of the run".to_owned(),
        Some((shadow, least)) if shadow == shadow_ticks => {
            format!("the least tick that works now is {least}")
        }
        Some((shadow, least)) => {
            format!("with --shadow-ticks {shadow}, the least tick that works now is {least}")
        }
    }
}

/// The answer to a swap that has ended, with the `warnings` of its backup.
fn answer(report: &Report, warnings: Vec<String>) -> Answer {
    match (&report.refused, report.take_over_tick) {
        (Some(reason), _) => Answer::refused(reason.clone()),
        (None, Some(tick)) => Answer::Done {
            text: format!(
                "`{}.{}` flies from tick {tick}; handed over: {}",
                report.process,
                report.generation,
                report.hand_over.unwrap_or("nothing")
            ),
            tick,
            warnings,
        },
        (None, None) => Answer::refused("the run ended before the take-over"),
    }
}

/// The answer to a swap that is refused before its backup starts, with the warnings that may explain the refusal.
fn refusal(error: &anyhow::Error) -> Answer {
    let warnings: &[Diagnostic] = error.downcast_ref::<Diagnostic>().map_or(&[], Diagnostic::warnings);
    Answer::Refused {
        reason: error.to_string(),
        warnings: warnings.iter().map(ToString::to_string).collect(),
    }
}

impl<W: World> Supervisor<'_, W> {
    /// Serves the requests to the run, and answers swaps that have ended. A swap waits until the run flies.
    pub(super) fn serve_requests(&mut self) {
        let mut asked = std::mem::take(&mut self.early);
        for _ in 0..MAX_SWAPS_A_LOOK {
            let Some(request) = self.world.next_request() else { break };
            asked.push(request);
        }
        if matches!(self.decisions.state, State::Starting | State::Gathering) {
            self.early = asked;
            return;
        }
        for (request, reply) in asked {
            let Request::Swap { process, with, shadow_ticks, at_tick } = request else { continue };
            match self.request_swap(&process, &with, shadow_ticks, at_tick) {
                Ok((request, warnings)) => self.swaps.push((request, warnings, reply)),
                Err(error) => self.world.answer(reply, &refusal(&error)),
            }
        }
        for (request, warnings, reply) in std::mem::take(&mut self.swaps) {
            let mut reports = self.decisions.replacements.reports.iter();
            match reports.find(|report| report.request == Some(request)) {
                Some(report) => self.world.answer(reply, &answer(report, warnings)),
                None => self.swaps.push((request, warnings, reply)),
            }
        }
    }

    /// Checks a requested swap, and has its backup started; returns the number of the request, and the warnings of the backup.
    fn request_swap(
        &mut self,
        process: &str,
        with: &str,
        shadow_ticks: Option<u32>,
        at_tick: Option<u32>,
    ) -> Result<(u32, Vec<String>)> {
        if self.decisions.state != State::Running {
            bail!("the run is ending: `{process}` cannot be swapped any more");
        }
        let (backup, warnings) = self.world.backup_of(process, with)?;
        self.require_claimed_log(&backup)?;
        if self.decisions.replacements.is_busy(backup.node) {
            bail!("`{process}` has a backup, a standby or a shadow already; one at a time");
        }
        self.see();
        let end = self.decisions.replacements.view.end_tick;
        let shadow_ticks = shadow_ticks.unwrap_or(SHADOW_TICKS);
        if shadow_ticks == 0 || shadow_ticks >= end {
            bail!("shadowing for {shadow_ticks} ticks is not within the run's {end} ticks");
        }
        if let Some(tick) = at_tick {
            self.require_joinable(process, &backup, shadow_ticks, tick)?;
        }
        self.requests += 1;
        self.decisions.replacements.request_swap(backup, shadow_ticks, at_tick, self.requests);
        Ok((self.requests, warnings.iter().map(ToString::to_string).collect()))
    }

    /// Refuses a take-over at `tick` for which `backup` cannot join in time, or at which it does not send.
    fn require_joinable(
        &self,
        process: &str,
        backup: &BackupSpec,
        shadow_ticks: u32,
        tick: u32,
    ) -> Result<()> {
        let View { granted, end_tick: end, .. } = self.decisions.replacements.view;
        let join = tick.saturating_sub(shadow_ticks);
        let (period, stride) = (backup.plan.period_ticks, take_over_stride(self.plan, backup.node));
        let advice = advice(self.plan, backup.node, (granted, end), shadow_ticks);
        if tick >= end {
            bail!("tick {tick} is not within the run, which has {end} ticks; {advice}");
        }
        if join <= granted {
            bail!(
                "tick {tick} less {shadow_ticks} ticks of shadowing is not ahead of the run, which has granted \
                 {granted} of {end} ticks; {advice}"
            );
        }
        if !tick.is_multiple_of(stride) || !join.is_multiple_of(period) {
            bail!(
                "`{process}` sends every {stride} and computes every {period} ticks: let it take over at a multiple \
                 of the first and join at one of the second; {advice}"
            );
        }
        if next_take_over(self.plan, backup.node, tick) != Some(tick) {
            bail!(
                "no measurement of `{process}` arrives at tick {tick}: let it take over where one does; {advice}"
            );
        }
        Ok(())
    }

    /// Refuses a log of its own to a backup requested in flight: this run has not claimed the file.
    fn require_claimed_log(&self, backup: &BackupSpec) -> Result<()> {
        let planned = self.graph.backups.iter().filter(|other| other.node == backup.node);
        let mut known = planned.map(|other| &other.program).chain([&self.graph.programs[backup.node]]);
        match &backup.program.log {
            Some(log) if !known.any(|program| program.log.as_ref() == Some(log)) => {
                bail!(
                    "`log` = {}: a run claims its logs when it starts, and cannot claim another in flight; leave it \
                     out, or write the swap into the manifest",
                    log.display()
                )
            }
            _ => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::{advice, least_tick};
    use crate::supervisor::replacement::tests::plan;
    use bus::sample_ticks::SampleTicks;

    #[test]
    fn the_least_tick_is_the_first_multiple_whose_backup_can_join() {
        assert_eq!(least_tick(300, 100, 1), 401);
        assert_eq!(least_tick(300, 100, 5), 405);
        assert_eq!(least_tick(299, 100, 5), 400);
        assert_eq!(least_tick(u32::MAX, 1, 1), u64::from(u32::MAX) + 2);
    }

    /// A run of 1000 ticks, and a node that computes every 10 ticks.
    #[test]
    fn the_advice_names_ticks_that_work() {
        let advice = |sent: SampleTicks, granted, shadow| advice(&plan(&[sent]), 0, (granted, 1000), shadow);
        let every = SampleTicks::every(20);
        assert_eq!(advice(every, 300, 100), "the least tick that works now is 420");
        let whole = "with --shadow-ticks 110, the least tick that works now is 420";
        assert_eq!(advice(every, 300, 105), whole, "it joins at a tick at which it computes");
        let shorter = "with --shadow-ticks 10, the least tick that works now is 920";
        assert_eq!(advice(every, 900, 100), shorter, "it would take over behind the end");
        let late = "no tick at which it could take over is left before the end of the run";
        assert_eq!(advice(every, 980, 10), late, "no shadowing is short enough");
        // Measurements arrive at 80, 180, … and 980.
        let measured = SampleTicks::measured(10, 1_000_000, 100_000_000, 80_000_000);
        assert_eq!(advice(measured, 300, 100), "the least tick that works now is 480");
        assert_eq!(advice(measured, 970, 10), late);
    }
}
