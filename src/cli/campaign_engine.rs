//! Engines that fly a campaign: worker processes on this machine, or tasks of a Slurm job array.

use super::interrupts::stop_token;
use super::output::say;
use anyhow::{Context, Result, bail};
use campaign::chunk::{Attempt, Shared, Task};
use campaign::cluster::Cluster;
use campaign::pool::Pool;
use campaign::row::Row;
use campaign::worker::{Job, Order};
use clap::{Args, ValueEnum};
use inputs::sha256_of;
use std::fs::File;
use std::path::{Path, PathBuf};
use std::time::Duration;

/// The hidden argument of a worker.
pub const WORKER: &str = "--worker";
/// The hidden argument of a task.
const TASK_OF: &str = "--task-of";
/// Digits of the digest of an executable.
const DIGITS: usize = 12;
/// Folder that the tasks share, in the folder of the campaign.
const SHARED: &str = "slurm";
/// Least number of flights of a task that is not stated: a task takes seconds to start.
const CHUNK_MIN: usize = 50;
/// Most tasks if their flights are not stated; Slurm's own limit (MaxArraySize) is 1001 by default.
const TASKS_MAX: usize = 500;

/// Options of `sbatch` that the campaign gives itself, or that would undo what it relies on; each with its short form and what is
/// there instead.
const OPTIONS_OF_OURS: [(&str, Option<char>, &str); 9] = [
    ("--array", Some('a'), "--chunk sets the flights of a task"),
    ("--cpus-per-task", Some('c'), "--workers sets the processors of a task"),
    ("--output", Some('o'), "the tasks' output lies in the campaign's folder"),
    ("--error", Some('e'), "the tasks' output lies in the campaign's folder"),
    (
        "--clusters",
        Some('M'),
        "the environment variable SLURM_CLUSTERS names a cluster for all commands of Slurm",
    ),
    ("--wait", Some('W'), "the campaign waits by itself"),
    ("--parsable", None, "the campaign asks for it"),
    ("--wrap", None, "the campaign brings the script"),
    ("--test-only", None, "nothing would be flown"),
];
/// Short options of `sbatch` without a value, behind which another one may stand.
const FLAGS: &str = "hHkOQsvV";

/// Engine that flies.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Engine {
    /// Worker processes on this machine.
    Local,
    /// Tasks of a Slurm job array.
    Slurm,
}

/// Arguments of the engines.
#[derive(Args, Clone)]
pub struct EngineArguments {
    /// Engine that flies; `slurm` submits a job array on a host that may submit jobs.
    #[arg(long, value_enum, default_value = "local")]
    engine: Engine,
    /// Number of worker processes, one for each core where absent; with Slurm those of a task, one where absent.
    #[arg(long, value_name = "COUNT", value_parser = clap::value_parser!(u16).range(1..=1024))]
    workers: Option<u16>,
    /// Flights of a task (Slurm); at least 50 in at most 500 tasks where absent.
    #[arg(long, value_name = "FLIGHTS", value_parser = clap::value_parser!(u32).range(1..))]
    chunk: Option<u32>,
    /// Option for sbatch, such as --sbatch=--partition=fast; may be given several times (Slurm).
    #[arg(long, value_name = "OPTION", allow_hyphen_values = true)]
    sbatch: Vec<String>,
    /// Shell command that starts this program on a node, such as "apptainer exec hummingbus.sif hummingbus" (Slurm).
    #[arg(long, value_name = "COMMAND")]
    node_command: Option<String>,
}

/// A campaign to fly.
pub struct Flight<'a> {
    /// Folder of the campaign.
    pub folder: &'a Path,
    /// Campaign that workers fly for; its folder is of this machine.
    pub order: Order,
    /// Host time after which a flight is given up, s.
    pub timeout_s_host: f64,
}

impl EngineArguments {
    /// Worker processes on this machine: so many, or one for each core.
    pub const fn local(workers: Option<u16>) -> Self {
        Self { engine: Engine::Local, workers, chunk: None, sbatch: Vec::new(), node_command: None }
    }

    /// Refuses options of Slurm for another engine.
    ///
    /// # Errors
    /// The option.
    pub fn check(&self) -> Result<()> {
        let stated = [
            ("--chunk", self.chunk.is_some()),
            ("--sbatch", !self.sbatch.is_empty()),
            ("--node-command", self.node_command.is_some()),
        ];
        if let Some((option, _)) =
            stated.iter().find(|(_, is_stated)| *is_stated && self.engine != Engine::Slurm)
        {
            bail!("{option} needs --engine slurm");
        }
        for option in &self.sbatch {
            if let Some(instead) = instead_of(option) {
                bail!("--sbatch={option} cannot be given: {instead}");
            }
        }
        Ok(())
    }

    /// Flies `jobs`; hands each row to `take` as it comes.
    ///
    /// # Errors
    /// If no worker can be started, or Slurm refuses.
    pub fn fly(
        &self,
        flight: Flight<'_>,
        jobs: Vec<Job>,
        tell: &dyn Fn(&str),
        take: impl FnMut(Row) -> Result<()>,
    ) -> Result<()> {
        let Flight { folder, order, timeout_s_host } = flight;
        let stop = stop_token()?;
        if self.engine == Engine::Local {
            let command = worker_command()?;
            let workers = self.workers.map_or_else(cores, usize::from).min(jobs.len());
            let timeout = Duration::from_secs_f64(timeout_s_host);
            return Pool { command: &command, workers, order: &order, timeout }.fly(
                jobs.into_iter(),
                &stop,
                take,
            );
        }
        // The nodes' workers write on their own node.
        let order = Order { folder: PathBuf::new(), ..order };
        let task = Task { order, workers: self.workers.map_or(1, usize::from), timeout_s_host };
        let folder = std::path::absolute(folder.join(SHARED))?;
        let chunk = jobs.len().div_ceil(TASKS_MAX).max(CHUNK_MIN);
        let cluster = Cluster {
            script: &self.script(&folder)?,
            folder: &folder,
            chunk: self.chunk.map_or(chunk, |chunk| chunk as usize),
            task: &task,
            options: &self.sbatch,
            tell,
        };
        cluster.fly(&jobs, &stop, take)
    }

    /// Shell script that each task runs: as this process, from the same folder.
    fn script(&self, folder: &Path) -> Result<String> {
        let here = std::env::current_dir().context("the working directory is gone")?;
        let program = match &self.node_command {
            Some(command) => command.clone(),
            None => quoted(&std::env::current_exe().context("cannot find this program")?)?,
        };
        let (here, folder) = (quoted(&here)?, quoted(folder)?);
        Ok(format!("#!/bin/sh\ncd {here} || exit 1\nexec {program} campaign {TASK_OF} {folder}\n"))
    }
}

/// Text of what is there instead of `option` of `sbatch`, if it cannot be given.
fn instead_of(option: &str) -> Option<&'static str> {
    let of = |is_meant: &dyn Fn(&str, Option<char>) -> bool| {
        OPTIONS_OF_OURS.iter().find(|(long, short, _)| is_meant(long, *short)).map(|(_, _, instead)| *instead)
    };
    if option.starts_with("--") {
        // sbatch takes the beginning of an option for the option. One that may be several, such as `--a`, it refuses itself.
        let name = option.split('=').next().unwrap_or(option);
        let is_meant = |long: &str, _| name.len() > "--".len() && long.starts_with(name);
        return of(&is_meant);
    }
    match option.strip_prefix('-').filter(|letters| !letters.is_empty()) {
        Some(letters) => {
            let letter = letters.chars().find(|letter| !FLAGS.contains(*letter))?;
            of(&|_, short| short == Some(letter))
        }
        None => Some("it is no option; expected one such as --partition=fast"),
    }
}

/// Flies the chunk of this task of a job array, whose shared folder is `folder`.
///
/// # Errors
/// Outside of a job array, or if the inputs are refused.
pub fn fly_task(folder: &Path) -> Result<()> {
    let attempt = Attempt::of_environment()?;
    let node = std::env::var("SLURMD_NODENAME").unwrap_or_else(|_| "an unknown node".to_owned());
    say(&format!("chunk {} on {node}", attempt.chunk));
    Shared::new(folder).fly(&attempt, &worker_command()?, &stop_token()?)
}

/// A path as the shell reads it.
fn quoted(path: &Path) -> Result<String> {
    let path = path.to_str().with_context(|| format!("the path {} is not UTF-8", path.display()))?;
    Ok(format!("'{}'", path.replace('\'', "'\\''")))
}

/// This build of hummingbus: its version, as `--version` prints it, and a digest of the executable. The version's commit says nothing of what
/// was changed since.
pub fn build() -> Result<String> {
    let version = env!("HUMMINGBUS_VERSION");
    // The running one, also where a newer one has taken its place.
    let digest = File::open("/proc/self/exe").and_then(sha256_of).context("cannot read this program")?;
    Ok(format!("{version} (executable {})", &digest[..DIGITS]))
}

/// Number of this machine's cores.
pub fn cores() -> usize {
    std::thread::available_parallelism().map_or(1, std::num::NonZero::get)
}

/// The command that starts a worker.
pub fn worker_command() -> Result<Vec<String>> {
    let program = std::env::current_exe().context("cannot find this program")?;
    let program = program.to_str().context("the path of this program is not UTF-8")?.to_owned();
    Ok(vec![program, "campaign".to_owned(), WORKER.to_owned()])
}

#[cfg(test)]
mod tests {
    use super::instead_of;

    #[test]
    fn options_that_would_undo_those_of_the_campaign_are_known_in_each_spelling() {
        let refused = [
            "--array=1-3",
            "--array",
            "--arr=0-1",
            "-a1-3",
            "-a",
            "-Qa0-1",
            "-QW",
            "-c4",
            "-o/tmp/x",
            "--out=x",
            "--error=x",
            "-Mother",
            "--clusters=other",
            "--cluster=other",
            "--wait",
            "--wrap=ls",
            "--test-only",
            "other.sh",
            "-",
            "",
        ];
        for option in refused {
            assert!(instead_of(option).is_some(), "{option}");
        }
        let taken = [
            "--partition=fast",
            "-pfast",
            "-pWide",
            "--time=30",
            "--mem=4G",
            "--account=a",
            "-Q",
            "-QHpfast",
            "--output-x",
            "--no-requeue",
        ];
        for option in taken {
            assert!(instead_of(option).is_none(), "{option}");
        }
    }
}
