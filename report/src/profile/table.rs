//! A profile on the terminal: within 100 columns unless names are long.

use crate::profile::figures::Profile;
use crate::profile::times::{Quantiles, Times};
use std::fmt::{self, Display, Formatter};

const NAME_COLUMNS: usize = 52;

impl Display for Profile {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        self.write_nodes(f)?;
        self.write_transport(f)?;
        self.write_ages(f)?;
        self.write_path(f)?;
        self.write_pacing(f)?;
        if self.left_out > 0 {
            writeln!(f, "not profiled: {} computations beyond the first of each node", self.left_out)?;
        }
        Ok(())
    }
}

impl Profile {
    fn write_nodes(&self, f: &mut Formatter<'_>) -> fmt::Result {
        head(f, "node, per tick [µs]")?;
        for node in &self.nodes {
            row(f, &format!("{:<40} wait", node.name), &node.wait)?;
            for (part, times) in
                [("wake-up", &node.wake_up), ("compute", &node.compute), ("publish", &node.publish)]
            {
                row(f, &format!("{:<40} {part}", ""), times)?;
            }
        }
        Ok(())
    }

    fn write_transport(&self, f: &mut Formatter<'_>) -> fmt::Result {
        head(f, "\ntransport, where the reader waited [µs]")?;
        let mut hops = self.transport.iter();
        hops.try_for_each(|hop| row(f, &format!("{} → {}", hop.topic, hop.reader), &hop.transport))
    }

    fn write_ages(&self, f: &mut Formatter<'_>) -> fmt::Result {
        for (index, age) in self.age.iter().enumerate() {
            if index == 0 || self.age[index - 1].command != age.command {
                head(f, &format!("\nage in {} [µs]", age.command))?;
            }
            row(f, &format!("{:<40} simulated", age.source), &age.simulated)?;
            row(f, &format!("{:<40} host", ""), &age.host)?;
        }
        Ok(())
    }

    fn write_path(&self, f: &mut Formatter<'_>) -> fmt::Result {
        head(f, "\ncritical path [µs]")?;
        row(f, "tick", &self.critical_path.tick_time)?;
        for place in &self.critical_path.places {
            let share = format!("{:5.1} %", 100.0 * place.share);
            row(f, &format!("{share} {}", place.place), &place.time)?;
        }
        Ok(())
    }

    fn write_pacing(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let Some(pacing) = &self.pacing else { return Ok(()) };
        head(f, "\ndeadlines [µs]")?;
        row(f, "jitter: deadline to grant", &pacing.jitter)?;
        writeln!(f, "missed: {}; grants late by a tick: {}", pacing.missed_deadlines, pacing.late_grants)?;
        let overruns = pacing.overruns.iter().filter(|node| node.ticks > 0);
        let overruns: Vec<_> = overruns.map(|node| format!("{} {}", node.name, node.ticks)).collect();
        writeln!(f, "overruns: {}", if overruns.is_empty() { "none".into() } else { overruns.join(", ") })
    }
}

fn head(f: &mut Formatter<'_>, title: &str) -> fmt::Result {
    let (space, title) = title.strip_prefix('\n').map_or(("", title), |title| ("\n", title));
    let columns = ["count", "p50", "p90", "p99", "p99.9", "max"];
    write!(f, "{space}{title:<NAME_COLUMNS$}")?;
    columns.iter().try_for_each(|column| write!(f, "{column:>8}"))?;
    writeln!(f)
}

fn row(f: &mut Formatter<'_>, name: &str, times: &Times) -> fmt::Result {
    if name.chars().count() >= NAME_COLUMNS {
        write!(f, "{name}\n{:NAME_COLUMNS$}", "")?;
    } else {
        write!(f, "{name:<NAME_COLUMNS$}")?;
    }
    let quantiles = times.quantiles();
    write!(f, "{:>8}", quantiles.count)?;
    if !times.is_empty() {
        let Quantiles { p50_us, p90_us, p99_us, p99_9_us, max_us, .. } = quantiles;
        let values = [p50_us, p90_us, p99_us, p99_9_us, max_us];
        // Times of ten milliseconds and more keep their columns, and need no tenths.
        values.iter().try_for_each(|&us| write!(f, "{us:>8.*}", usize::from(us < 1e4)))?;
    }
    writeln!(f)
}
