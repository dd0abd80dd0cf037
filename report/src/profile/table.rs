//! A profile on the terminal.

use crate::cells::Cells;
use crate::profile::age::Age;
use crate::profile::figures::Profile;
use crate::profile::latency::{NodeLatency, Transport};
use crate::profile::path::PlaceShare;
use crate::profile::times::{Quantiles, Times};
use std::fmt::{self, Display, Formatter};

impl Display for Profile {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let ages = self.age.chunk_by(|a, b| a.command == b.command);
        let ages =
            ages.map(|ages| table(&format!("age in {} [µs]", ages[0].command), ages.iter().flat_map(age)));
        let path = &self.critical_path;
        let tick = std::iter::once(("tick".to_owned(), &path.tick_time));
        let hops = table("transport, where the reader waited [µs]", self.transport.iter().map(hop));
        let path = table("critical path [µs]", tick.chain(path.places.iter().map(place)));
        write!(f, "{}", table("node, per tick [µs]", self.nodes.iter().flat_map(node)))?;
        std::iter::once(hops).chain(ages).chain([path]).try_for_each(|table| write!(f, "\n{table}"))?;
        if self.age_from_stamps && !self.age.is_empty() {
            writeln!(
                f,
                "ages count from the stamps of samples: only a recording has the times of measurements"
            )?;
        }
        self.write_pacing(f)?;
        if self.first_tick > 0 {
            writeln!(f, "profiled from tick {} on: the run went on from its checkpoint", self.first_tick)?;
        }
        if self.left_out > 0 {
            writeln!(f, "not profiled: {} computations beyond the first of each node", self.left_out)?;
        }
        Ok(())
    }
}

impl Profile {
    fn write_pacing(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let Some(pacing) = &self.pacing else { return Ok(()) };
        let jitter = ("jitter: deadline to grant".to_owned(), &pacing.jitter);
        write!(f, "\n{}", table("deadlines [µs]", std::iter::once(jitter)))?;
        writeln!(f, "missed: {}; grants late by a tick: {}", pacing.missed_deadlines, pacing.late_grants)?;
        let overruns = pacing.overruns.iter().filter(|node| node.ticks > 0);
        let overruns: Vec<_> = overruns.map(|node| format!("{} {}", node.name, node.ticks)).collect();
        writeln!(f, "overruns: {}", if overruns.is_empty() { "none".into() } else { overruns.join(", ") })
    }
}

type Row<'a> = (String, &'a Times);

fn hop(hop: &Transport) -> Row<'_> {
    (format!("{} → {}", hop.topic, hop.reader), &hop.transport)
}

fn place(place: &PlaceShare) -> Row<'_> {
    (format!("{:5.1} % {}", 100.0 * place.share, place.place), &place.time)
}

/// The parts of a node's ticks; its name stands before the first.
fn node(node: &NodeLatency) -> [Row<'_>; 4] {
    let name = node.label();
    [
        (format!("{name:<40} wait"), &node.wait),
        (format!("{:<40} wake-up", ""), &node.wake_up),
        (format!("{:<40} compute", ""), &node.compute),
        (format!("{:<40} publish", ""), &node.publish),
    ]
}

fn age(age: &Age) -> [Row<'_>; 2] {
    [(format!("{:<40} simulated", age.source), &age.simulated), (format!("{:<40} host", ""), &age.host)]
}

fn table<'a>(title: &str, rows: impl Iterator<Item = Row<'a>>) -> Cells {
    // All tables have the same columns, unless names are long.
    let row = |(name, times): Row<'a>| std::iter::once(format!("{name:<51}")).chain(numbers(times)).collect();
    Cells::new(&[title, "count", "p50", "p90", "p99", "p99.9", "max"], 1, rows.map(row).collect())
}

/// Number of times, and their quantiles in µs if there are any; with room for ten milliseconds.
fn numbers(times: &Times) -> Vec<String> {
    let Quantiles { count, p50_us, p90_us, p99_us, p99_9_us, max_us, .. } = times.quantiles();
    let values = [p50_us, p90_us, p99_us, p99_9_us, max_us];
    // Times of ten milliseconds and more keep their columns, and need no tenths.
    let text = |us: f64| match count {
        0 => String::new(),
        _ => format!("{us:>6.*}", usize::from(us < 1e4)),
    };
    std::iter::once(format!("{count:>6}")).chain(values.map(text)).collect()
}
