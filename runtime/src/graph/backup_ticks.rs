//! Ticks of a backup's samples: a topic keeps those of the process that is replaced.

use super::processes::{period_ticks, sample_ticks};
use crate::manifest::{Manifest, Process};
use crate::supervisor::replacement::greatest_common_divisor;
use bus::Registration;
use bus::plan::{OutputPlan, Plan};
use bus::sample_ticks::SampleTicks;
use diagnostics::Diagnostic;
use std::ops::Range;

/// Number of ticks that a warning lists.
const LISTED: u64 = 4;

/// A backup of the node `node` of the run of `plan`, as its `manifest` declares it.
pub struct Backup<'a> {
    /// The manifest.
    pub manifest: &'a Manifest,
    /// The plan of the run.
    pub plan: &'a Plan,
    /// The node.
    pub node: usize,
    /// The process that it backs up.
    pub present: &'a Process,
    /// The process that it is, whose parameters are valid.
    pub whole: &'a Process,
    /// The kind of that process.
    pub kind: &'a Registration,
}

impl Backup<'_> {
    /// Warning, placed at `span`, of an output whose samples are sent at other ticks than those at which the backup has something new.
    /// An output that states its `every_ticks` is sent at these with any process.
    ///
    /// # Errors
    /// If the period of the backup is refused.
    pub fn other_ticks(&self, span: &Range<usize>) -> Result<Option<Diagnostic>, Diagnostic> {
        let Self { manifest, plan, whole, kind, .. } = *self;
        let period = plan.nodes[self.node].period_ticks;
        let ticks = sample_ticks(manifest, whole, Some(kind), period);
        let is_other = |output: &&OutputPlan| {
            let is_stated = self
                .present
                .outputs
                .iter()
                .any(|(port, setting)| *port.get_ref() == output.port && setting.every_ticks.is_some());
            !is_stated && plan.topics[output.topic].ticks != ticks
        };
        let Some(output) = plan.nodes[self.node].outputs.iter().find(is_other) else { return Ok(None) };
        let both = greatest_common_divisor(period, period_ticks(manifest, whole, Some(kind))?);
        Ok(Some(self.warning(output, ticks, both, span)))
    }

    /// The warning of `output`, for which the backup has samples at `ticks`; multiples of `both` are ticks of both processes.
    fn warning(&self, output: &OutputPlan, ticks: SampleTicks, both: u32, span: &Range<usize>) -> Diagnostic {
        let (name, topic) = (&self.plan.nodes[self.node].name, &self.plan.topics[output.topic]);
        let (tick_s, port) = (self.plan.tick_s(), &output.port);
        let [waits, repeats] = ["its samples wait for these", "its samples are sent more than once"];
        let [takes_time, took_time] = [self.whole, self.present].map(|of| of.computing_time.is_some());
        let [effect, equal] = if takes_time && !took_time {
            [waits, "leave out its `computing_time`"]
        } else if took_time && !takes_time {
            [repeats, "give it a `computing_time`, too"]
        } else if ticks.mean() < topic.ticks.mean() {
            ["some of its samples are never sent", "give it the rate of the other"]
        } else if ticks.mean() > topic.ticks.mean() {
            [repeats, "give it the rate of the other"]
        } else {
            [waits, "give it the delay of the other"]
        };
        let message = format!(
            "the backup of `{name}` has new samples at ticks {}, and {} is sent at ticks {}, as before: {effect}",
            listed(ticks, tick_s),
            topic.name,
            listed(topic.ticks, tick_s)
        );
        let help = format!(
            "{equal}; or let `{name}` send at the ticks of both: period_ticks = {both}, outputs.{port}.every_ticks = {both}"
        );
        self.manifest.problem(span, message, help)
    }
}

/// The first of `ticks`, and how many there are a second.
fn listed(ticks: SampleTicks, tick_s: f64) -> String {
    let first: Vec<String> = (0..LISTED).map(|number| ticks.tick(number).to_string()).collect();
    let rate_hz = (1e3 / (ticks.mean() * tick_s)).round() / 1e3;
    format!("{}, … ({rate_hz} Hz)", first.join(", "))
}

#[cfg(test)]
mod tests {
    use super::listed;
    use bus::sample_ticks::SampleTicks;

    #[test]
    fn ticks_are_listed_with_their_rate() {
        assert_eq!(listed(SampleTicks::every(20), 1e-3), "0, 20, 40, 60, … (50 Hz)");
        let late = SampleTicks::measured(20, 1_000_000, 100_000_000, 80_000_000);
        assert_eq!(listed(late, 1e-3), "0, 80, 180, 280, … (10 Hz)");
    }
}
