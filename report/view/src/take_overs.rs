//! Processes that took over from others while the run was watched: swaps, standbys and restarts. No recording has them.

use bus::lockstep::LiveView;
use bus::membership::{Membership, NodeInstances};
use bus::plan::Plan;
use serde::Serialize;
use std::collections::BTreeMap;
use std::path::Path;

/// A process that took over.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct TakeOver {
    /// Name of the process.
    process: String,
    /// Its generation: the first process of this name has 0.
    generation: u32,
    /// Simulated time from which on its samples count, in seconds.
    time_s: f64,
}

/// The take-overs that were seen so far.
#[derive(Debug, Default)]
pub struct TakeOvers {
    epoch: Option<u32>,
    /// Generation of the process whose samples count, by node.
    generations: BTreeMap<usize, u32>,
    /// Generation and tick of the take-over that is arranged, by node.
    arranged: BTreeMap<usize, (u32, u32)>,
    seen: Vec<TakeOver>,
}

/// Processes of a node at one look.
struct Processes {
    /// Generation of the one whose samples count.
    generation: u32,
    /// Generation of its backup, and the tick from which on that one's samples count.
    arranged: Option<(u32, u32)>,
}

impl Processes {
    fn of(node: &NodeInstances) -> Self {
        let tick = Some(node.take_over_tick).filter(|tick| *tick != u32::MAX);
        let backup = node.backup.as_ref().map(|backup| backup.generation);
        Self { generation: node.primary.generation, arranged: backup.zip(tick) }
    }
}

impl TakeOvers {
    /// Those of the run in `run_dir`, which flies `plan`, up to now.
    pub fn look(&mut self, run_dir: &Path, plan: &Plan, control: &LiveView) -> Vec<TakeOver> {
        let epoch = control.epoch();
        // The supervisor writes a take-over that has happened into the membership that arranged it. A membership that has gone meanwhile has a
        // successor, which the next look finds.
        if (self.epoch != Some(epoch) || !self.arranged.is_empty())
            && let Ok(membership) = Membership::load(run_dir, epoch)
        {
            self.epoch = Some(epoch);
            let now_s = f64::from(control.completed_ticks()) * plan.tick_s();
            for (number, (node, planned)) in membership.nodes.iter().zip(&plan.nodes).enumerate() {
                self.take(number, &planned.name, &Processes::of(node), (now_s, plan.tick_s()));
            }
        }
        self.seen.clone()
    }

    /// Takes the processes of node `number`, called `name`; `times_s` are now and the length of a tick.
    fn take(&mut self, number: usize, name: &str, processes: &Processes, times_s: (f64, f64)) {
        let generation = processes.generation;
        let arranged = match processes.arranged {
            Some(arranged) => self.arranged.insert(number, arranged),
            None => self.arranged.remove(&number),
        };
        let before = self.generations.insert(number, generation);
        if before.is_some_and(|before| before < generation) {
            let arranged = arranged.filter(|(backup, _)| *backup == generation);
            // A take-over that was arranged and done between two looks has the time at which it was found.
            let time_s = arranged.map_or(times_s.0, |(_, tick)| f64::from(tick) * times_s.1);
            self.seen.push(TakeOver { process: name.to_owned(), generation, time_s });
        }
    }
}

#[cfg(test)]
mod tests {
    use super::{Processes, TakeOver, TakeOvers};

    #[test]
    fn a_take_over_has_the_tick_for_which_it_was_arranged_or_else_the_time_of_the_look() {
        let mut take_overs = TakeOvers::default();
        let mut look = |number, name, generation, arranged, now_s| {
            take_overs.take(number, name, &Processes { generation, arranged }, (now_s, 0.001));
            take_overs.seen.clone()
        };
        let seen =
            |process: &str, generation, time_s| TakeOver { process: process.to_owned(), generation, time_s };
        assert_eq!(look(0, "pid", 0, None, 0.1), []);
        assert_eq!(look(0, "pid", 0, Some((1, 250)), 0.2), [], "the backup only shadows");
        assert_eq!(look(1, "ekf", 2, None, 0.2), [], "those before the first look are not known");
        assert_eq!(look(0, "pid", 1, None, 0.3), [seen("pid", 1, 0.25)]);
        assert_eq!(look(0, "pid", 1, None, 0.4).len(), 1);
        assert_eq!(look(1, "ekf", 3, None, 0.5), [seen("pid", 1, 0.25), seen("ekf", 3, 0.5)]);
        assert_eq!(look(0, "pid", 1, Some((2, 650)), 0.6).len(), 2);
        assert_eq!(look(0, "pid", 1, None, 0.7).len(), 2, "the backup was withdrawn");
        assert!(take_overs.arranged.is_empty());
    }
}
