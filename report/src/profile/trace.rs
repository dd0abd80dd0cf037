//! A timeline in the Trace Event Format (JSON), which ui.perfetto.dev and chrome://tracing open.

use crate::profile::figures::Profile;
use crate::profile::latency::{PARTS, cause_name, parts};
use bus::profile::{Grant, TickTimes};
use runtime::flight::{Cause, Flight};
use serde_json::{Value, json};
use std::collections::BTreeSet;
use std::io::{self, Write};

/// Number of the first profiled ticks that a trace holds at most.
const FIRST_TICKS: u32 = 2000;
/// Slowest ticks that it holds, each with the ticks before and after it.
const SLOWEST_TICKS: usize = 100;
/// Computations that it holds at most: six events of about 130 bytes each stay below 50 MB.
const COMPUTATIONS_MAX: usize = 60_000;
/// The clock's process in the trace; node n is process n + 2.
const CLOCK: usize = 1;

/// Start of every trace: the format has room for the writer in `otherData`.
pub const START: &str = r#"{"otherData":{"writer":"hummingbus"},"#;

impl Profile {
    /// Writes a timeline that ui.perfetto.dev opens; returns which ticks it holds, in words.
    ///
    /// # Errors
    /// If `out` fails.
    pub fn write_trace(&self, flight: &Flight, out: &mut impl Write) -> io::Result<String> {
        let room = COMPUTATIONS_MAX / flight.plan.nodes.len().max(1);
        let slowest = self.critical_path.slowest(SLOWEST_TICKS.min(room / 6));
        let room = u32::try_from(room - 3 * slowest.len()).unwrap_or(u32::MAX);
        let begin = flight.plan.first_tick;
        let first = FIRST_TICKS.min(room).min(flight.ticks.saturating_sub(begin));
        let around = slowest.iter().flat_map(|&tick| tick.saturating_sub(1)..=tick.saturating_add(1));
        let ticks = (begin..begin + first).chain(around.filter(|&tick| tick < flight.ticks)).collect();
        let origin_ns = origin_ns(flight, &ticks);
        Trace { flight, ticks: &ticks, origin_ns, flows: 0, separator: "", out }.write()?;
        Ok(format!("the first {first} ticks and around the {} slowest", slowest.len()))
    }
}

/// The first host time of the trace, from which its times count.
fn origin_ns(flight: &Flight, ticks: &BTreeSet<u32>) -> u64 {
    let first = ticks.iter().next().copied().unwrap_or(0);
    let received = (0..flight.plan.nodes.len()).filter_map(|node| flight.at(node, first)?.received_ns.into());
    let granted = flight.grant(first).map(|grant| grant.deadline_ns.unwrap_or(grant.granted_ns));
    received.chain(granted).min().unwrap_or(0)
}

struct Trace<'a, W: Write> {
    flight: &'a Flight,
    ticks: &'a BTreeSet<u32>,
    origin_ns: u64,
    flows: u64,
    /// Text in front of the next event.
    separator: &'static str,
    out: &'a mut W,
}

impl<W: Write> Trace<'_, W> {
    fn write(&mut self) -> io::Result<()> {
        write!(self.out, "{START}\"displayTimeUnit\":\"ns\",\"traceEvents\":[")?;
        self.name(CLOCK, "clock")?;
        let nodes = 0..self.flight.plan.nodes.len();
        nodes.clone().try_for_each(|node| self.name(node + 2, self.flight.node_name(node)))?;
        self.write_grants()?;
        for node in nodes {
            for times in self.ticks.iter().filter_map(|tick| self.flight.at(node, *tick)) {
                self.write_tick(node, &times)?;
            }
        }
        writeln!(self.out, "\n]}}")
    }

    fn name(&mut self, process: usize, name: &str) -> io::Result<()> {
        let named = json!({ "name": name });
        let order = json!({ "sort_index": process });
        let all = [("process_name", &named), ("process_sort_index", &order), ("thread_name", &named)];
        all.into_iter().try_for_each(|(key, value)| {
            self.event(&json!({ "ph": "M", "name": key, "pid": process, "tid": 1, "args": value }))
        })
    }

    fn write_grants(&mut self) -> io::Result<()> {
        let is_in = |grant: &Grant| self.ticks.range(grant.first_tick..grant.end_tick).next().is_some();
        let mut free_from_ns = 0;
        for grant in self.flight.grants().filter(is_in) {
            let name = format!("grant {}…{}", grant.first_tick, grant.end_tick - 1);
            if let Some(deadline_ns) = grant.deadline_ns {
                // From the deadline to the grant, without the part that it shares with a late grant before it.
                let late_us = grant.granted_ns.saturating_sub(deadline_ns) as f64 / 1e3;
                let start_ns = deadline_ns.max(free_from_ns);
                self.slice(CLOCK, &name, [start_ns, grant.granted_ns], &json!({ "late_us": late_us }))?;
            } else {
                let ts = self.us(grant.granted_ns);
                self.event(&json!({ "ph": "i", "s": "p", "name": name, "pid": CLOCK, "tid": 1, "ts": ts }))?;
            }
            free_from_ns = grant.granted_ns;
        }
        Ok(())
    }

    fn write_tick(&mut self, node: usize, times: &TickTimes<'_>) -> io::Result<()> {
        let parts = parts(self.flight, node, times);
        let cause = parts[0].cause;
        let is_noted = times.began_ns.is_some_and(|ns| ns >= self.origin_ns);
        let [wait, wake_up, compute, publish] = parts.map(|part| [part.start_ns, part.end_ns]);
        if let Some(cause) = cause.filter(|_| is_noted) {
            let why = json!({ "for": cause_name(self.flight, cause) });
            for (name, ends) in [(PARTS[0], wait), (PARTS[1], wake_up)] {
                if ends[0] < ends[1] {
                    self.slice(node + 2, name, ends, &why)?;
                }
            }
        }
        let whole = [times.received_ns, times.ended_ns];
        self.slice(node + 2, &format!("tick {}", times.tick), whole, &json!({}))?;
        self.slice(node + 2, PARTS[2], compute, &json!({}))?;
        self.slice(node + 2, PARTS[3], publish, &json!({}))?;
        match cause {
            Some(Cause::Sample { topic, tick }) => self.write_flow(node, topic, tick, times.received_ns),
            _ => Ok(()),
        }
    }

    /// The arrow from the sending of a sample to the reader that waited for it.
    fn write_flow(&mut self, reader: usize, topic: usize, stamp: u32, received_ns: u64) -> io::Result<()> {
        let Some(sent_ns) = self.flight.sent_ns(topic, stamp).filter(|_| self.ticks.contains(&stamp)) else {
            return Ok(());
        };
        self.flows += 1;
        let sender = self.flight.publisher(topic);
        for (phase, node, ns) in [("s", sender, sent_ns), ("f", reader, received_ns)] {
            self.event(&json!({
                "ph": phase, "bp": "e", "cat": "hop", "name": self.flight.topic_name(topic), "id": self.flows,
                "pid": node + 2, "tid": 1, "ts": self.us(ns)
            }))?;
        }
        Ok(())
    }

    fn slice(&mut self, process: usize, name: &str, ends_ns: [u64; 2], args: &Value) -> io::Result<()> {
        let duration_us = ends_ns[1].saturating_sub(ends_ns[0]) as f64 / 1e3;
        self.event(&json!({
            "ph": "X", "cat": "tick", "name": name, "pid": process, "tid": 1, "ts": self.us(ends_ns[0]),
            "dur": duration_us, "args": args
        }))
    }

    fn us(&self, ns: u64) -> f64 {
        ns.saturating_sub(self.origin_ns) as f64 / 1e3
    }

    fn event(&mut self, event: &Value) -> io::Result<()> {
        write!(self.out, "{}\n{event}", std::mem::replace(&mut self.separator, ","))
    }
}
