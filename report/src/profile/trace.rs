//! A timeline in the Trace Event Format (JSON), which ui.perfetto.dev and chrome://tracing open.

use crate::profile::path::CriticalPath;
use bus::profile::{Grant, TickTimes};
use runtime::flight::{Cause, Flight};
use serde_json::{Value, json};
use std::collections::BTreeSet;
use std::io::{self, Write};

/// Ticks from the start of the run that a trace holds at most.
const FIRST_TICKS: u32 = 2000;
/// Slowest ticks that it holds, each with the ticks before and after it.
const SLOWEST_TICKS: usize = 100;
/// Computations that it holds at most: six events of about 130 bytes each stay below 50 MB.
const COMPUTATIONS_MAX: usize = 60_000;
/// The clock's process in the trace; node n is process n + 2.
const CLOCK: usize = 1;

/// How every trace begins: `otherData` is where the format has room for who wrote it.
pub const START: &str = r#"{"otherData":{"writer":"hummingbus"},"#;

/// Writes the trace; returns which ticks it holds, in words.
pub fn write(flight: &Flight, path: &CriticalPath, out: &mut impl Write) -> io::Result<String> {
    let ticks = Ticks::of(flight, path);
    let mut trace =
        Trace { flight, ticks: &ticks.all, origin_ns: origin_ns(flight, &ticks.all), flows: 0, out };
    trace.write()?;
    Ok(format!("the first {} ticks and around the {} slowest", ticks.first, ticks.slowest))
}

struct Ticks {
    all: BTreeSet<u32>,
    first: u32,
    slowest: usize,
}

impl Ticks {
    fn of(flight: &Flight, path: &CriticalPath) -> Self {
        let nodes = flight.plan.nodes.len().max(1);
        let room = COMPUTATIONS_MAX / nodes;
        let slowest = path.slowest(SLOWEST_TICKS.min(room / 6));
        let room = u32::try_from(room - 3 * slowest.len()).unwrap_or(u32::MAX);
        let first = FIRST_TICKS.min(room).min(flight.ticks);
        let around = slowest.iter().flat_map(|&tick| tick.saturating_sub(1)..=tick.saturating_add(1));
        let all = (0..first).chain(around.filter(|&tick| tick < flight.ticks)).collect();
        Self { all, first, slowest: slowest.len() }
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
    out: &'a mut W,
}

impl<W: Write> Trace<'_, W> {
    fn write(&mut self) -> io::Result<()> {
        write!(self.out, "{START}\"displayTimeUnit\":\"ns\",\"traceEvents\":[")?;
        self.name(CLOCK, "clock", true)?;
        for node in 0..self.flight.plan.nodes.len() {
            self.name(node + 2, self.flight.node_name(node), false)?;
        }
        self.write_grants()?;
        for node in 0..self.flight.plan.nodes.len() {
            for &tick in self.ticks {
                if let Some(times) = self.flight.at(node, tick) {
                    self.write_tick(node, &times)?;
                }
            }
        }
        writeln!(self.out, "\n]}}")
    }

    fn name(&mut self, process: usize, name: &str, is_first: bool) -> io::Result<()> {
        let event = |key: &str, value: Value| json!({ "ph": "M", "name": key, "pid": process, "tid": 1, "args": value });
        self.event(&event("process_name", json!({ "name": name })), is_first)?;
        self.event(&event("process_sort_index", json!({ "sort_index": process })), false)?;
        self.event(&event("thread_name", json!({ "name": name })), false)
    }

    fn write_grants(&mut self) -> io::Result<()> {
        let is_in = |grant: &Grant| self.ticks.range(grant.first_tick..grant.end_tick).next().is_some();
        let grants: Vec<Grant> = self.flight.grants().filter(is_in).collect();
        let mut free_from_ns = 0;
        for grant in grants {
            let name = format!("grant {}…{}", grant.first_tick, grant.end_tick - 1);
            let event = match grant.deadline_ns {
                // From the deadline to the grant, without what it shares with a late grant before it.
                Some(deadline_ns) => {
                    let late_us = grant.granted_ns.saturating_sub(deadline_ns) as f64 / 1e3;
                    let start_ns = deadline_ns.max(free_from_ns);
                    let arguments = json!({ "late_us": late_us });
                    self.slice(CLOCK, &name, start_ns, grant.granted_ns, &arguments)
                }
                None => json!({
                    "ph": "i", "s": "p", "name": name, "pid": CLOCK, "tid": 1, "ts": self.us(grant.granted_ns)
                }),
            };
            self.event(&event, false)?;
            free_from_ns = grant.granted_ns;
        }
        Ok(())
    }

    fn write_tick(&mut self, node: usize, times: &TickTimes<'_>) -> io::Result<()> {
        let (process, tick) = (node + 2, times.tick);
        let waited = self.flight.waited(node, times);
        if let (Some(waited), Some(began_ns)) = (waited, times.began_ns.filter(|ns| *ns >= self.origin_ns)) {
            let end_ns = waited.ready_ns.clamp(began_ns, times.received_ns);
            let why = json!({ "for": self.cause(waited.cause) });
            if end_ns > began_ns {
                self.event(&self.slice(process, "wait", began_ns, end_ns, &why), false)?;
            }
            if times.received_ns > end_ns {
                self.event(&self.slice(process, "wake-up", end_ns, times.received_ns, &why), false)?;
            }
        }
        let whole =
            self.slice(process, &format!("tick {tick}"), times.received_ns, times.ended_ns, &json!({}));
        self.event(&whole, false)?;
        self.event(&self.slice(process, "compute", times.received_ns, times.done_ns, &json!({})), false)?;
        self.event(&self.slice(process, "publish", times.done_ns, times.ended_ns, &json!({})), false)?;
        if let Some(Cause::Sample { topic, tick: stamp }) = waited.map(|waited| waited.cause) {
            self.write_flow(node, topic, stamp, times.received_ns)?;
        }
        Ok(())
    }

    /// The arrow from the sending of a sample to the reader that waited for it.
    fn write_flow(&mut self, reader: usize, topic: usize, stamp: u32, received_ns: u64) -> io::Result<()> {
        let Some(sent_ns) = self.flight.sent_ns(topic, stamp).filter(|_| self.ticks.contains(&stamp)) else {
            return Ok(());
        };
        self.flows += 1;
        let sender = self.flight.publisher(topic).node;
        let event = |phase: &str, node: usize, ns: u64| {
            json!({
                "ph": phase, "bp": "e", "cat": "hop", "name": self.flight.topic_name(topic), "id": self.flows,
                "pid": node + 2, "tid": 1, "ts": self.us(ns)
            })
        };
        let (start, finish) = (event("s", sender, sent_ns), event("f", reader, received_ns));
        self.event(&start, false)?;
        self.event(&finish, false)
    }

    fn cause(&self, cause: Cause) -> String {
        match cause {
            Cause::Sample { topic, .. } => self.flight.topic_name(topic).to_owned(),
            Cause::Grant => "grant".to_owned(),
            Cause::Itself => "its own last tick".to_owned(),
        }
    }

    fn slice(&self, process: usize, name: &str, start_ns: u64, end_ns: u64, arguments: &Value) -> Value {
        let duration_us = end_ns.saturating_sub(start_ns) as f64 / 1e3;
        json!({
            "ph": "X", "cat": "tick", "name": name, "pid": process, "tid": 1, "ts": self.us(start_ns),
            "dur": duration_us, "args": arguments
        })
    }

    fn us(&self, ns: u64) -> f64 {
        ns.saturating_sub(self.origin_ns) as f64 / 1e3
    }

    fn event(&mut self, event: &Value, is_first: bool) -> io::Result<()> {
        write!(self.out, "{}\n{event}", if is_first { "" } else { "," })
    }
}
