//! The process that hands out flights to workers: one worker a core, each a process, so that a flight that hangs or takes
//! its process with it costs that flight alone.

use crate::row::Row;
use crate::worker::{Greeting, Job, Order};
use anyhow::{Context, Result, bail};
use bus::host_time::monotonic_ns;
use bus::process::hold_stop_signals;
use runtime::event::StopToken;
use std::io::{BufRead as _, BufReader, Write as _};
use std::os::unix::process::{CommandExt as _, ExitStatusExt as _};
use std::process::{Child, ChildStdin, Command, ExitStatus, Stdio};
use std::sync::Mutex;
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::time::Duration;

/// Host time between two looks at the stop token while a worker is waited for.
const LOOK: Duration = Duration::from_millis(50);
/// Host time in which a worker must have read its inputs.
const START: Duration = Duration::from_secs(60);
/// Workers that may die of one flight: the first may have been ended by the host, for want of memory for example.
const ATTEMPTS: usize = 2;
/// Workers that are started, one after another, before the campaign is given up.
const STARTS: usize = 3;

/// Workers of a campaign.
#[derive(Debug)]
pub struct Pool<'a> {
    /// Command that starts a worker ([`crate::worker::serve`]): a program and its arguments.
    pub command: &'a [String],
    /// Number of workers.
    pub workers: usize,
    /// Campaign that they fly for.
    pub order: &'a Order,
    /// Host time after which a flight is given up.
    pub timeout: Duration,
}

impl Pool<'_> {
    /// Flies `jobs`; hands each row to `take` on the calling thread as it comes. No further flight begins once `stop` is used.
    ///
    /// # Errors
    /// If a worker cannot be started or refuses its inputs, or `take` fails; the rows of flights that are under way are lost
    /// then.
    pub fn fly(
        &self,
        jobs: impl Iterator<Item = Job> + Send,
        stop: &StopToken,
        mut take: impl FnMut(Row) -> Result<()>,
    ) -> Result<()> {
        let jobs = Mutex::new(jobs.fuse());
        let halt = StopToken::new();
        std::thread::scope(|scope| {
            let (sender, rows) = channel();
            for _ in 0..self.workers {
                let (sender, jobs, halt) = (sender.clone(), &jobs, &halt);
                scope.spawn(move || {
                    let next = || {
                        let is_stopped = stop.count() + halt.count() > 0;
                        (!is_stopped).then(|| jobs.lock().ok()?.next()).flatten()
                    };
                    if let Err(error) = self.work(next, stop, &sender) {
                        // Nobody listens any more where the campaign ended first.
                        let _ = sender.send(Err(error));
                    }
                });
            }
            drop(sender);
            let mut end = Ok(());
            for row in rows {
                // Flights that end behind an error are kept too.
                let taken = row.and_then(&mut take);
                if let (Err(error), Ok(())) = (taken, &end) {
                    end = Err(error);
                    halt.stop();
                }
            }
            end
        })
    }

    /// Flies what `next` yields on one worker after the other, as they die.
    fn work(
        &self,
        next: impl Fn() -> Option<Job>,
        stop: &StopToken,
        rows: &Sender<Result<Row>>,
    ) -> Result<()> {
        let mut worker = None;
        while let Some(job) = next() {
            match self.fly_one(&job, &mut worker, stop)? {
                Some(row) => rows.send(Ok(row))?,
                None => return Ok(()),
            }
        }
        Ok(())
    }

    /// Flies a flight on `worker`, or on a new one where that is gone; once more if the worker dies. `None` if the campaign is
    /// stopped.
    fn fly_one(&self, job: &Job, worker: &mut Option<Worker>, stop: &StopToken) -> Result<Option<Row>> {
        let mut deaths = Vec::new();
        while deaths.len() < ATTEMPTS {
            let mut alive = match worker.take() {
                Some(worker) => worker,
                None => match self.start(stop)? {
                    Some(started) => started,
                    None => return Ok(None),
                },
            };
            match alive.fly(job, self.timeout, stop)? {
                Flown::Row(row) => {
                    *worker = Some(alive);
                    return Ok(Some(row));
                }
                Flown::Died(why) => deaths.push(why),
                Flown::Late(why) => return Ok(Some(Row::ended(job.flight, why))),
                Flown::Stopped => return Ok(None),
            }
        }
        let why = format!("{ATTEMPTS} workers died of it: {}", deaths.join("; "));
        Ok(Some(Row::ended(job.flight, why)))
    }

    /// Starts a worker, again if it dies before it is ready; `None` if the campaign is stopped meanwhile.
    fn start(&self, stop: &StopToken) -> Result<Option<Worker>> {
        let mut last = String::new();
        for _ in 0..STARTS {
            let mut worker = Worker::spawn(self.command)?;
            match worker.greet(self.order, stop)? {
                Greeted::Ready => return Ok(Some(worker)),
                Greeted::Stopped => return Ok(None),
                Greeted::Ended(why) => last = why,
            }
        }
        bail!("{STARTS} workers ended before they were ready; the last one: {last}")
    }
}

/// End of a worker's start.
enum Greeted {
    Ready,
    Ended(String),
    Stopped,
}

/// End of a flight.
enum Flown {
    Row(Row),
    /// The worker died; how.
    Died(String),
    /// The flight took longer than it may.
    Late(String),
    /// The campaign was stopped.
    Stopped,
}

/// Result of waiting for a worker.
enum Answer {
    Line(String),
    /// The worker has ended.
    Dead(String),
    /// It took longer than it may.
    Late,
    /// The campaign was stopped.
    Stopped,
}

/// A worker process; it ends with this value.
struct Worker {
    child: Child,
    input: ChildStdin,
    lines: Receiver<std::io::Result<String>>,
}

impl Worker {
    fn spawn(command: &[String]) -> Result<Self> {
        let (program, arguments) = command.split_first().context("no command for the workers")?;
        let mut command = Command::new(program);
        // A group of its own: Ctrl-C ends the campaign, and the flights under way end as they are.
        command.args(arguments).process_group(0).stdin(Stdio::piped()).stdout(Stdio::piped());
        // Slurm sends SIGTERM to all processes of a task: to the worker it would cost the flight under way.
        hold_stop_signals(&mut command);
        let child = command.spawn();
        let mut child = child.with_context(|| format!("cannot start the worker {program}"))?;
        let (input, output) = (child.stdin.take(), child.stdout.take());
        let (input, output) = input.zip(output).context("a worker has no pipes")?;
        let (sender, lines) = channel();
        std::thread::spawn(move || {
            // The receiver is gone once the worker is not needed.
            BufReader::new(output).lines().try_for_each(|line| sender.send(line)).ok();
        });
        Ok(Self { child, input, lines })
    }

    /// Gives the worker its order, and waits until it has read its inputs.
    fn greet(&mut self, order: &Order, stop: &StopToken) -> Result<Greeted> {
        // A worker that is dead says so below.
        let _ = self.ask(order);
        match self.answer(START, stop)? {
            Answer::Line(line) => match serde_json::from_str(&line)? {
                Greeting::Ready => Ok(Greeted::Ready),
                Greeting::Refused(why) => bail!("{why}"),
            },
            Answer::Dead(why) => Ok(Greeted::Ended(why)),
            Answer::Late => Ok(Greeted::Ended(format!("it was not ready within {} s", START.as_secs()))),
            Answer::Stopped => Ok(Greeted::Stopped),
        }
    }

    fn ask(&mut self, value: &impl serde::Serialize) -> Result<()> {
        Ok(writeln!(self.input, "{}", serde_json::to_string(value)?)?)
    }

    fn fly(&mut self, job: &Job, timeout: Duration, stop: &StopToken) -> Result<Flown> {
        // A worker that is dead says so below.
        let _ = self.ask(job);
        Ok(match self.answer(timeout, stop)? {
            Answer::Line(line) => {
                Flown::Row(serde_json::from_str(&line).context("a worker's answer is not a row")?)
            }
            Answer::Dead(why) => Flown::Died(format!("the worker {why}")),
            Answer::Late => {
                let seconds = timeout.as_secs_f64();
                Flown::Late(format!("the flight took more than {seconds} s of host time (timeout_s_host)"))
            }
            Answer::Stopped => Flown::Stopped,
        })
    }

    /// The next line of the worker.
    fn answer(&mut self, timeout: Duration, stop: &StopToken) -> Result<Answer> {
        let end_ns = monotonic_ns() + timeout.as_nanos() as u64;
        loop {
            match self.lines.recv_timeout(LOOK) {
                Ok(line) => return Ok(Answer::Line(line?)),
                Err(RecvTimeoutError::Disconnected) if stop.count() > 0 => return Ok(Answer::Stopped),
                Err(RecvTimeoutError::Disconnected) => return Ok(Answer::Dead(self.end())),
                // A second stop does not wait for the flight.
                Err(RecvTimeoutError::Timeout) if stop.count() > 1 => return Ok(Answer::Stopped),
                Err(RecvTimeoutError::Timeout) if monotonic_ns() > end_ns => return Ok(Answer::Late),
                Err(RecvTimeoutError::Timeout) => {}
            }
        }
    }

    /// Waits for the process, which has closed its output, and says how it ended.
    fn end(&mut self) -> String {
        let _ = self.child.kill();
        self.child.wait().map_or_else(|error| format!("cannot be waited for: {error}"), described)
    }
}

impl Drop for Worker {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

fn described(status: ExitStatus) -> String {
    match (status.signal(), status.code()) {
        (Some(signal), _) => format!("was ended by signal {signal}"),
        (_, Some(code)) => format!("ended with exit code {code}"),
        _ => "ended".to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::Pool;
    use crate::row::Row;
    use crate::worker::{Job, Order};
    use runtime::event::StopToken;
    use std::collections::BTreeMap;
    use std::path::PathBuf;
    use std::time::Duration;

    /// A worker that kills itself when it is handed flight 1 for the first time, and whenever it is handed flight 2.
    const DIES: &str = r#"
        read -r order; echo '"Ready"'
        while read -r job; do
            flight=${job#*:}; flight=${flight%%,*}
            echo "$flight" >>"$0/flown"
            case $flight in
                1) mkdir "$0/once" 2>/dev/null && kill -9 $$ ;;
                2) kill -9 $$ ;;
            esac
            echo "{\"flight\":$flight,\"passed\":true,\"failed\":null,\"failed_at_s\":null,\"error\":null,\"figures\":[],\"wall_s\":0.0}"
        done
    "#;

    #[test]
    fn a_flight_whose_worker_died_is_flown_again_once_and_then_counted_as_lost() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().to_str().unwrap().to_owned();
        let command = ["sh", "-c", DIES, &path].map(str::to_owned);
        let order = Order {
            build: String::new(),
            path: PathBuf::new(),
            text: String::new(),
            fingerprint: String::new(),
            folder: folder.path().to_owned(),
        };
        let pool = Pool { command: &command, workers: 1, order: &order, timeout: Duration::from_secs(60) };
        let mut rows: BTreeMap<u64, Row> = BTreeMap::new();
        let jobs = (0..4).map(|flight| Job { flight, sets: Vec::new() });
        pool.fly(jobs, &StopToken::new(), |row| {
            rows.insert(row.flight, row);
            Ok(())
        })
        .unwrap();
        let passed: Vec<u64> = rows.values().filter(|row| row.passed).map(|row| row.flight).collect();
        assert_eq!(passed, [0, 1, 3]);
        let died = "the worker was ended by signal 9";
        let why = format!("2 workers died of it: {died}; {died}");
        assert!(rows[&2].is_of_host && rows[&2].error.as_deref() == Some(&why), "{:?}", rows[&2]);
        let flown = std::fs::read_to_string(folder.path().join("flown")).unwrap();
        assert_eq!(flown, "0\n1\n1\n2\n2\n3\n");
    }
}
