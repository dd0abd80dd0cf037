//! The deadlines of a paced run.

use crate::profile::times::Times;
use bus::profile::TickTimes;
use runtime::flight::Flight;
use serde::Serialize;

/// Deadlines of a paced run: jitter of the clock, missed deadlines, and overruns of the nodes.
#[derive(Debug, Serialize)]
pub struct Pacing {
    /// Time from a deadline to its grant.
    pub jitter: Times,
    /// Grants that came after the next deadline.
    pub late_grants: u64,
    /// Deadlines that the clock counted as missed: a node had not finished the tick before, or the grant was
    /// late.
    pub missed_deadlines: u32,
    /// Ticks that a node ended after the next deadline, for each node.
    pub overruns: Vec<Overruns>,
}

/// The overruns of a node.
#[derive(Debug, Serialize)]
pub struct Overruns {
    /// The node.
    pub name: String,
    /// Ticks that it ended after the next deadline.
    pub ticks: usize,
}

impl Pacing {
    /// The deadlines of `flight`; `None` if it had none.
    pub fn of(flight: &Flight, missed_deadlines: u32) -> Option<Self> {
        let mut jitter = Times::default();
        let mut late_grants = 0;
        for grant in flight.grants() {
            let Some(deadline_ns) = grant.deadline_ns else { continue };
            jitter.add(grant.granted_ns.saturating_sub(deadline_ns));
            late_grants += u64::from(is_after_next(flight, grant.first_tick, grant.granted_ns));
        }
        let nodes = flight.plan.nodes.iter().enumerate();
        let overruns = nodes.map(|(node, plan)| {
            let late = |times: &TickTimes<'_>| is_after_next(flight, times.tick, times.ended_ns);
            Overruns { name: plan.name.clone(), ticks: flight.ticks_of(node).filter(late).count() }
        });
        let overruns = overruns.collect();
        (!jitter.is_empty()).then_some(Self { jitter, late_grants, missed_deadlines, overruns })
    }
}

/// True if host time `ns` lies after the deadline of the tick after `tick`.
fn is_after_next(flight: &Flight, tick: u32, ns: u64) -> bool {
    let next = flight.grant(tick + 1).and_then(|grant| grant.deadline_ns);
    next.is_some_and(|deadline_ns| ns > deadline_ns)
}
