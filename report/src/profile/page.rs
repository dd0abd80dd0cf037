//! One HTML page that needs no network: tables, histograms, and the slowest ticks on a time axis.
//!
//! It is drawn by `page.js` with plotly.js ([`crate::page`]).

use crate::page::{self, PLOTLY_BASIC};
use crate::profile::figures::Profile;
use crate::profile::latency::{PARTS, cause_name, parts};
use crate::profile::path::{Path, name};
use crate::profile::times::Times;
use runtime::flight::Flight;
use serde_json::{Value, json};

/// Slowest ticks on the page.
const SLOWEST_TICKS: usize = 20;
/// Bars on a timeline at most: the longest.
const BARS_MAX: usize = 1500;
/// Ticks before and after a slow one that are looked at: fast nodes are that far ahead at most.
const TICKS_AROUND: u32 = 40;
/// Points of the course of the tick time over the run: of the ticks that fall on one, the slowest is shown.
const COURSE_POINTS: usize = 2000;
/// Bins per decade of the histograms.
const BINS_PER_DECADE: f64 = 20.0;

impl Profile {
    /// A page with histograms and the slowest ticks of run `run`.
    #[must_use]
    pub fn page(&self, run: &str, flight: &Flight) -> Vec<u8> {
        let data = data(run, flight, self);
        page::page(include_str!("page.html"), &PLOTLY_BASIC, include_str!("page.js"), &data)
    }
}

fn data(run: &str, flight: &Flight, profile: &Profile) -> Value {
    let histogram = |name: &str, times: &Times| json!({ "name": name, "bins": times.bins(BINS_PER_DECADE) });
    let nodes = profile.nodes.iter().map(|node| {
        let times = [&node.wait, &node.wake_up, &node.compute, &node.publish];
        let parts = PARTS.iter().zip(times).map(|(name, times)| histogram(name, times));
        json!({ "name": node.label(), "parts": parts.collect::<Vec<_>>() })
    });
    let jitter = profile.pacing.as_ref().map(|pacing| histogram("deadline to grant", &pacing.jitter));
    json!({
        "run": run,
        "profile": profile,
        "bins_per_decade": BINS_PER_DECADE,
        "parts": PARTS,
        "nodes": nodes.collect::<Vec<_>>(),
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

/// Activities of every node while the critical path of `tick` is walked, in µs from the path's start.
fn timeline(flight: &Flight, closing: &[usize], tick: u32) -> Option<Value> {
    let path = Path::of(flight, closing, tick)?;
    let (origin_ns, end_ns) = path.span_ns();
    let margin_ns = path.length_ns() / 5;
    let seen = origin_ns.saturating_sub(margin_ns)..end_ns + margin_ns;
    let us = |ns: u64| (ns as f64 - origin_ns as f64) / 1e3;
    let ticks = tick.saturating_sub(TICKS_AROUND)..=(tick + TICKS_AROUND).min(flight.ticks.saturating_sub(1));
    let mut bars = Vec::new();
    for node in 0..flight.plan.nodes.len() {
        for times in ticks.clone().filter_map(|tick| flight.at(node, tick)) {
            for (number, part) in parts(flight, node, &times).into_iter().enumerate() {
                let (start_ns, end_ns) = (part.start_ns.max(seen.start), part.end_ns.min(seen.end));
                if part.start_ns < part.end_ns && start_ns < end_ns {
                    let cause = part.cause.map(|cause| cause_name(flight, cause));
                    let whole_ns = part.end_ns - part.start_ns;
                    let (length_us, whole_us) = ((end_ns - start_ns) as f64 / 1e3, whole_ns as f64 / 1e3);
                    let bar = json!([node, number, times.tick, us(start_ns), length_us, whole_us, cause]);
                    bars.push((whole_ns, bar));
                }
            }
        }
    }
    bars.sort_by_key(|(whole_ns, _)| std::cmp::Reverse(*whole_ns));
    let places = path.0.iter().map(|stretch| {
        json!({
            "place": name(flight, stretch.place),
            "node": flight.node_name(stretch.place.node()),
            "start": us(stretch.start_ns),
            "end": us(stretch.end_ns),
        })
    });
    Some(json!({
        "tick": tick,
        "length_us": path.length_ns() as f64 / 1e3,
        "bars": bars.into_iter().take(BARS_MAX).map(|(_, bar)| bar).collect::<Vec<_>>(),
        "path": places.collect::<Vec<_>>(),
    }))
}
