//! The process that hands out flights to workers: one worker a core, each a process, so that a flight that hangs or takes
//! its process with it costs that flight alone.

use crate::row::Row;
use crate::worker::{Greeting, Job, Order};
use anyhow::{Context, Result, bail};
use runtime::event::StopToken;
use std::io::{BufRead as _, BufReader, Write as _};
use std::os::unix::process::ExitStatusExt as _;
use std::process::{Child, ChildStdin, Command, ExitStatus, Stdio};
use std::sync::Mutex;
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::time::{Duration, Instant};

/// Host time between two looks at the stop token while a flight is waited for.
const LOOK: Duration = Duration::from_millis(50);
/// Host time in which a worker must have read its inputs.
const START: Duration = Duration::from_secs(60);

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
                end = end.and_then(|()| take(row?));
                if end.is_err() {
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
            let mut alive = match worker.take() {
                Some(worker) => worker,
                None => Worker::start(self.command, self.order)?,
            };
            match alive.fly(&job, self.timeout, stop)? {
                Flown::Row(row) => {
                    worker = Some(alive);
                    rows.send(Ok(row))?;
                }
                Flown::Ended(why) => rows.send(Ok(Row::broken(job.flight, why)))?,
                Flown::Stopped => return Ok(()),
            }
        }
        Ok(())
    }
}

/// End of a flight.
enum Flown {
    Row(Row),
    /// The worker died or was ended; the reason.
    Ended(String),
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
    fn start(command: &[String], order: &Order) -> Result<Self> {
        let (program, arguments) = command.split_first().context("no command for the workers")?;
        let child =
            Command::new(program).args(arguments).stdin(Stdio::piped()).stdout(Stdio::piped()).spawn();
        let mut child = child.with_context(|| format!("cannot start the worker {program}"))?;
        let (input, output) = (child.stdin.take(), child.stdout.take());
        let (input, output) = input.zip(output).context("a worker has no pipes")?;
        let (sender, lines) = channel();
        std::thread::spawn(move || {
            // The receiver is gone once the worker is not needed.
            BufReader::new(output).lines().try_for_each(|line| sender.send(line)).ok();
        });
        let mut worker = Self { child, input, lines };
        worker.ask(order)?;
        match worker.lines.recv_timeout(START) {
            Ok(line) => match serde_json::from_str(&line?)? {
                Greeting::Ready => Ok(worker),
                Greeting::Refused(why) => bail!("{why}"),
            },
            Err(_) => bail!("a worker {} before it was ready", worker.end()),
        }
    }

    fn ask(&mut self, value: &impl serde::Serialize) -> Result<()> {
        Ok(writeln!(self.input, "{}", serde_json::to_string(value)?)?)
    }

    fn fly(&mut self, job: &Job, timeout: Duration, stop: &StopToken) -> Result<Flown> {
        // A worker that is dead says so below.
        let _ = self.ask(job);
        let begin = Instant::now();
        loop {
            match self.lines.recv_timeout(LOOK) {
                Ok(line) => {
                    let row: Row = serde_json::from_str(&line?).context("a worker's answer is not a row")?;
                    return Ok(Flown::Row(row));
                }
                Err(RecvTimeoutError::Disconnected) => {
                    return Ok(Flown::Ended(format!("the worker {}", self.end())));
                }
                // A second stop does not wait for the flight.
                Err(RecvTimeoutError::Timeout) if stop.count() > 1 => return Ok(Flown::Stopped),
                Err(RecvTimeoutError::Timeout) if begin.elapsed() > timeout => {
                    let seconds = timeout.as_secs_f64();
                    return Ok(Flown::Ended(format!(
                        "the flight took more than {seconds} s of host time (timeout_s_host)"
                    )));
                }
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
