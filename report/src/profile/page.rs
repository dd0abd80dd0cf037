//! One HTML page that needs no network: tables, histograms, and the slowest ticks on a time axis.
//!
//! It is drawn by `page.js` with plotly.js ([`crate::page`]).

use crate::page::{PLOTLY_BASIC, Page};
use crate::profile::figures::Profile;
use crate::profile::path::{Path, name};
use crate::profile::times::Times;
use bus::profile::TickTimes;
use runtime::flight::{Cause, Flight};
use serde_json::{Value, json};

const PAGE: Page =
    Page { body: include_str!("page.html"), plotly: PLOTLY_BASIC, script: include_str!("page.js") };

/// Slowest ticks on the page.
const SLOWEST_TICKS: usize = 20;
/// Bars on a timeline at most: the longest.
const BARS_MAX: usize = 1500;
/// The parts of a tick, as `page.js` numbers them.
const PARTS: [&str; 4] = ["wait", "wake-up", "compute", "publish"];
/// Points of the course of the tick time over the run: of the ticks that fall on one, the slowest is shown.
const COURSE_POINTS: usize = 2000;
/// Bins per decade of the histograms.
const BINS_PER_DECADE: f64 = 20.0;

/// The page of run `run`.
pub fn page(run: &str, flight: &Flight, profile: &Profile) -> Vec<u8> {
    PAGE.with(&data(run, flight, profile))
}

fn data(run: &str, flight: &Flight, profile: &Profile) -> Value {
    let histogram = |name: &str, times: &Times| json!({ "name": name, "bins": times.bins(BINS_PER_DECADE) });
    let nodes = profile.nodes.iter().map(|node| {
        let times = [&node.wait, &node.wake_up, &node.compute, &node.publish];
        let parts = PARTS.iter().zip(times).map(|(name, times)| histogram(name, times));
        json!({ "name": node.name, "parts": parts.collect::<Vec<_>>() })
    });
    let jitter = profile.pacing.as_ref().map(|pacing| histogram("deadline to grant", &pacing.jitter));
    json!({
        "run": run,
        "profile": profile,
        "bins_per_decade": BINS_PER_DECADE,
        "parts": PARTS,
        "nodes": nodes.collect::<Vec<_>>(),
        "tick_time": histogram("tick", &profile.critical_path.tick_time),
        "jitter": jitter,
        "course": course(profile, flight.plan.tick_s()),
        "slowest": slowest(flight, profile),
    })
}

/// Simulated time and tick time in µs of the slowest tick of each stretch of the run.
fn course(profile: &Profile, tick_s: f64) -> Vec<[f64; 2]> {
    let lengths = &profile.critical_path.lengths_ns;
    let slowest = |ticks: &[(u32, u64)]| ticks.iter().max_by_key(|(_, ns)| *ns).copied();
    let points = lengths.chunks(lengths.len().div_ceil(COURSE_POINTS).max(1)).filter_map(slowest);
    points.map(|(tick, ns)| [f64::from(tick) * tick_s, ns as f64 / 1e3]).collect()
}

fn slowest(flight: &Flight, profile: &Profile) -> Vec<Value> {
    let closing = flight.closing_topics();
    let ticks = profile.critical_path.slowest(SLOWEST_TICKS);
    ticks.into_iter().filter_map(|tick| timeline(flight, &closing, tick)).collect()
}

/// What every node does while the critical path of `tick` is walked, in µs from the path's start.
fn timeline(flight: &Flight, closing: &[usize], tick: u32) -> Option<Value> {
    let path = Path::of(flight, closing, tick)?;
    let window = Window::around(&path);
    let mut bars = Vec::new();
    for node in 0..flight.plan.nodes.len() {
        let first = tick.saturating_sub(window.ticks);
        let ticks = first..=tick.saturating_add(window.ticks).min(flight.ticks.saturating_sub(1));
        for times in ticks.filter_map(|tick| flight.at(node, tick)) {
            bars.extend(node_bars(flight, node, &times, &window));
        }
    }
    bars.sort_by_key(|bar: &Bar| std::cmp::Reverse(bar.end_ns - bar.start_ns));
    let bars: Vec<Value> = bars.iter().take(BARS_MAX).map(|bar| bar.json(flight, &window)).collect();
    let places = path.0.iter().map(|stretch| {
        json!({
            "place": name(flight, stretch.place),
            "node": flight.node_name(stretch.place.node()),
            "start": window.us(stretch.start_ns),
            "end": window.us(stretch.end_ns),
        })
    });
    Some(json!({
        "tick": tick,
        "length_us": path.length_ns() as f64 / 1e3,
        "bars": bars,
        "path": places.collect::<Vec<_>>(),
    }))
}

/// The stretch of host time that a timeline shows.
struct Window {
    origin_ns: u64,
    start_ns: u64,
    end_ns: u64,
    /// Ticks before and after that are looked at: fast nodes are that far ahead at most.
    ticks: u32,
}

impl Window {
    fn around(path: &Path) -> Self {
        let (start_ns, end_ns) = path.span_ns();
        let margin_ns = path.length_ns() / 5;
        Self {
            origin_ns: start_ns,
            start_ns: start_ns.saturating_sub(margin_ns),
            end_ns: end_ns + margin_ns,
            ticks: 40,
        }
    }

    fn us(&self, ns: u64) -> f64 {
        if ns >= self.origin_ns {
            (ns - self.origin_ns) as f64 / 1e3
        } else {
            -((self.origin_ns - ns) as f64) / 1e3
        }
    }
}

/// A part of a node's tick.
struct Bar {
    node: usize,
    tick: u32,
    part: usize,
    start_ns: u64,
    end_ns: u64,
    /// What the node waited for.
    cause: Option<Cause>,
}

fn node_bars(flight: &Flight, node: usize, times: &TickTimes<'_>, window: &Window) -> Vec<Bar> {
    let began_ns = times.began_ns.unwrap_or(times.received_ns);
    let waited = flight.waited(node, times);
    let ready_ns = waited.map_or(began_ns, |waited| waited.ready_ns.clamp(began_ns, times.received_ns));
    let ends = [began_ns, ready_ns, times.received_ns, times.done_ns, times.ended_ns];
    let is_seen =
        |bar: &Bar| bar.start_ns < bar.end_ns && bar.end_ns > window.start_ns && bar.start_ns < window.end_ns;
    let bars = ends.windows(2).enumerate().map(|(part, ends)| Bar {
        node,
        tick: times.tick,
        part,
        start_ns: ends[0],
        end_ns: ends[1],
        cause: waited.map(|waited| waited.cause).filter(|_| part < 2),
    });
    bars.filter(is_seen).collect()
}

impl Bar {
    /// Node, part, tick, start and length of what is seen and whole length in µs, what was waited for.
    fn json(&self, flight: &Flight, window: &Window) -> Value {
        let (from_ns, to_ns) = (self.start_ns.max(window.start_ns), self.end_ns.min(window.end_ns));
        let why = self.cause.map(|cause| match cause {
            Cause::Sample { topic, .. } => flight.topic_name(topic),
            Cause::Grant => "grant",
            Cause::Itself => "its own tick before",
        });
        let us = |ns: u64| ns as f64 / 1e3;
        let whole_ns = self.end_ns - self.start_ns;
        json!([self.node, self.part, self.tick, window.us(from_ns), us(to_ns - from_ns), us(whole_ns), why])
    }
}
