//! The live run behind a page: its state, and the requests of the page.

use crate::fields::Asked as Field;
use crate::newest::Newest;
use crate::schedule::Schedule;
use crate::shown::Shown;
use crate::take_overs::{TakeOver, TakeOvers};
use anyhow::{Context as _, Result, ensure};
use bus::asked::{Asked, AskedFile};
use bus::lockstep::LiveView;
use bus::plan::Plan;
use runtime::ctl::client;
use runtime::ctl::protocol::{Answer, Request, State, Status};
use runtime::run_dir::LiveRun;
use serde::Deserialize;
use serde_json::{Value, json};
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

/// Set points that a page requests.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Asking {
    /// Node that sends them.
    process: String,
    altitude_m: f64,
    roll_rad: f64,
    pitch_rad: f64,
    yaw_rad: f64,
}

/// A live run that a page shows and steers.
#[derive(Debug)]
pub struct Live {
    run: Arc<LiveRun>,
    plan: Plan,
    schedule: Schedule,
    newest: Mutex<Newest>,
    take_overs: Mutex<TakeOvers>,
    /// Opened at the first look that finds it.
    control: OnceLock<LiveView>,
}

impl Live {
    /// The run that flies `plan`.
    pub fn of(run: LiveRun, plan: Plan) -> Self {
        let newest = Mutex::new(Newest::of(&run, &plan));
        let take_overs = Mutex::default();
        Self {
            run: Arc::new(run),
            plan,
            schedule: Schedule::default(),
            newest,
            take_overs,
            control: OnceLock::new(),
        }
    }

    /// True while the launcher of the run lives.
    pub fn is_live(&self) -> bool {
        self.run.is_live()
    }

    /// State, tick and pace now. `None` until the run has a control segment; one on a single thread has none.
    pub fn status(&self) -> Option<Status> {
        let mut status = Status::of(&self.plan, self.control()?);
        if !self.run.is_live() {
            status.state = State::Ended;
        }
        Some(status)
    }

    /// Processes that have taken over from others since the first look.
    pub(crate) fn take_overs(&self) -> Vec<TakeOver> {
        let Some(control) = self.control() else { return Vec::new() };
        let mut take_overs = self.take_overs.lock().unwrap_or_else(PoisonError::into_inner);
        take_overs.look(&self.run.entry.run_dir, &self.plan, control)
    }

    /// The tick as planned and as it goes; null until the run has a control segment.
    pub fn schedule(&self) -> Value {
        if self.control().is_none() { Value::Null } else { self.schedule.look(&self.run, &self.plan) }
    }

    /// Time of the newest sample and the newest values of `fields`, which may be newer than the recording `shown`; `None` if
    /// nothing newer can be had.
    ///
    /// # Errors
    /// As [`Newest::values`].
    pub(crate) fn newest(&self, shown: &Shown, fields: &[Field]) -> Result<Option<Vec<f64>>> {
        if !self.run.is_live() {
            return Ok(None);
        }
        self.newest.lock().unwrap_or_else(PoisonError::into_inner).values(&self.run, shown, fields)
    }

    fn control(&self) -> Option<&LiveView> {
        if self.control.get().is_none()
            && let Ok(control) = LiveView::open(&self.plan)
        {
            // Another look may have opened it meanwhile.
            let _ = self.control.set(control);
        }
        self.control.get()
    }

    /// The run's answer to `request`; waits for it, which may take as long as the action.
    pub fn ask(&self, request: &Request) -> Answer {
        if let Request::Checkpoint { .. } = request {
            return Answer::refused("the page writes no files; `hummingbus ctl checkpoint` does");
        }
        client::ask(&self.run, request).unwrap_or_else(|error| Answer::refused(error.with_causes()))
    }

    /// Hands set points to the node that sends them.
    ///
    /// # Errors
    /// If they are not finite, or no node of this name takes any.
    pub fn fly(&self, asking: &Asking) -> Result<()> {
        let Asking { process, altitude_m, roll_rad, pitch_rad, yaw_rad } = asking;
        let asked =
            Asked { altitude_m: *altitude_m, roll_rad: *roll_rad, pitch_rad: *pitch_rad, yaw_rad: *yaw_rad };
        ensure!(asked.is_finite(), "a set point is not finite");
        ensure!(self.run.is_live(), "the run has ended");
        ensure!(
            self.plan.nodes.iter().any(|node| node.name == *process),
            "the run has no process `{process}`"
        );
        let about =
            || format!("`{process}` takes no set points of a person: expected a process of kind `operator`");
        AskedFile::open(&self.run.entry.run_dir, process)
            .and_then(|file| file.write(&asked))
            .with_context(about)
    }

    /// Processes that a person can fly by hand, with their limits.
    fn operators(&self) -> Vec<Value> {
        let takes_some = |name: &str| AskedFile::open(&self.run.entry.run_dir, name).is_ok();
        let operators = self.plan.nodes.iter().filter(|node| takes_some(&node.name));
        let limits = operators.map(|node| {
            let stated = |key: &str| node.parameters[key].clone();
            json!({
                "process": node.name,
                "initial_altitude_m": stated("initial_altitude_m"),
                "altitudes_m": stated("altitudes_m"),
                "tilt_max_deg": stated("tilt_max_deg"),
                "fallback": stated("fallback"),
            })
        });
        limits.collect()
    }

    /// Lasting facts about the run.
    pub fn described(&self) -> Value {
        let name = self.run.entry.manifest.file_name().unwrap_or_default().to_string_lossy();
        let processes: Vec<&str> = self.plan.nodes.iter().map(|node| node.name.as_str()).collect();
        json!({
            "run_id": self.plan.run_id,
            "manifest": name,
            "tick_s": self.plan.tick_s(),
            "processes": processes,
            "operators": self.operators(),
        })
    }
}

/// The file to which the run of `plan` records.
///
/// # Errors
/// If it records nothing.
///
/// ```
/// # use bus::Registration;
/// # use runtime::{graph::Graph, manifest::ManifestBuilder, registry::Registry};
/// # const COMPONENTS: Registry = Registry::new(&[Registration::of::<recorder::node::Recorder>()]);
/// # let folder = tempfile::tempdir()?;
/// # let manifest = ManifestBuilder::new().set("process.recorder.kind", "recorder").set("run.duration_s", 2.0);
/// # let manifest = manifest.build(&folder.path().join("a.toml"), COMPONENTS)?;
/// let mut plan = Graph::build(&manifest)?.plan;
/// // The launcher names the file.
/// plan.nodes[0].parameters = serde_json::json!({ "path": "/tmp/a.partial.mcap" });
/// assert_eq!(view::live::recording_of(&plan)?, "/tmp/a.partial.mcap");
/// plan.nodes.clear();
/// assert!(view::live::recording_of(&plan).is_err());
/// # Ok::<(), anyhow::Error>(())
/// ```
pub fn recording_of(plan: &Plan) -> Result<&str> {
    let recorder = plan.nodes.iter().find(|node| node.is_recorder);
    recorder.and_then(|node| node.parameters["path"].as_str()).ok_or_else(|| {
        anyhow::anyhow!(
            "run {} records nothing, so that there is nothing to show: start it with --record FILE",
            plan.run_id
        )
    })
}
