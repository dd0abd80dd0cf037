//! Swaps requested while the run flies.

use super::Supervisor;
use crate::ctl::protocol::{Answer, Request};
use crate::program::BackupSpec;
use crate::supervisor::replacement::{Report, next_take_over, take_over_stride};
use crate::supervisor::state_machine::State;
use crate::view::View;
use crate::world::World;
use anyhow::{Result, bail};

/// Ticks that a backup shadows where a request does not say.
const SHADOW_TICKS: u32 = 100;
/// Swaps that are taken a look at most, for the supervisor has more to look after.
const MAX_SWAPS_A_LOOK: usize = 16;

/// Least tick of a take-over by a backup that joins behind tick `granted` and shadows for `shadow_ticks`: a multiple of `stride`.
fn least_tick(granted: u32, shadow_ticks: u32, stride: u32) -> u64 {
    let first = u64::from(granted) + u64::from(shadow_ticks) + 1;
    first.next_multiple_of(u64::from(stride.max(1)))
}

/// The answer to a swap that has ended.
fn answer(report: &Report) -> Answer {
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
        },
        (None, None) => Answer::refused("the run ended before the take-over"),
    }
}

impl<W: World> Supervisor<'_, W> {
    /// Serves the requests to the run, and answers swaps that have ended.
    pub(super) fn serve_requests(&mut self) {
        for _ in 0..MAX_SWAPS_A_LOOK {
            let Some((request, reply)) = self.world.next_request() else { break };
            let Request::Swap { process, with, shadow_ticks, at_tick } = request else { continue };
            match self.request_swap(&process, &with, shadow_ticks, at_tick) {
                Ok(request) => self.swaps.push((request, reply)),
                Err(refused) => self.world.answer(reply, &Answer::refused(refused.to_string())),
            }
        }
        for (request, reply) in std::mem::take(&mut self.swaps) {
            let mut reports = self.decisions.replacements.reports.iter();
            match reports.find(|report| report.request == Some(request)) {
                Some(report) => self.world.answer(reply, &answer(report)),
                None => self.swaps.push((request, reply)),
            }
        }
    }

    /// Checks a requested swap, and has its backup started; returns the number of the request.
    fn request_swap(
        &mut self,
        process: &str,
        with: &str,
        shadow_ticks: Option<u32>,
        at_tick: Option<u32>,
    ) -> Result<u32> {
        let backup = self.world.backup_of(process, with)?;
        self.require_claimed_log(&backup)?;
        if self.decisions.state != State::Running {
            bail!("the run does not fly: `{process}` cannot be swapped now");
        }
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
        Ok(self.requests)
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
        let next = |tick: u32| next_take_over(self.plan, backup.node, tick);
        let least = u32::try_from(least_tick(granted, shadow_ticks, stride)).ok().and_then(next);
        let advice = match least.filter(|least| *least < end) {
            None => "no tick is left: lower --shadow-ticks".to_owned(),
            Some(_) if !shadow_ticks.is_multiple_of(period) => {
                format!("choose --shadow-ticks as a multiple of {period}")
            }
            Some(least) => format!("the least tick that works now is {least}"),
        };
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
        if next(tick) != Some(tick) {
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
    use super::least_tick;

    #[test]
    fn the_least_tick_is_the_first_multiple_whose_backup_can_join() {
        assert_eq!(least_tick(300, 100, 1), 401);
        assert_eq!(least_tick(300, 100, 5), 405);
        assert_eq!(least_tick(299, 100, 5), 400);
        assert_eq!(least_tick(u32::MAX, 1, 1), u64::from(u32::MAX) + 2);
    }
}
