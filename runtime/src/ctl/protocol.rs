//! Requests to a live run: one JSON object a line, answered by one JSON object a line.

use crate::manifest::PaceSetting;
use bus::lockstep::{LiveView, Phase};
use bus::membership::Membership;
use bus::plan::Plan;
use serde::{Deserialize, Serialize};
use std::path::PathBuf;

/// The name of the socket in the run directory.
pub(crate) const SOCKET: &str = "ctl.sock";

/// A request to a run. On the socket each is a line of JSON.
///
/// ```
/// use runtime::ctl::protocol::Request;
/// let line = serde_json::to_string(&Request::Step { ticks: 7 })?;
/// assert_eq!(line, r#"{"request":"step","ticks":7}"#);
/// # Ok::<(), serde_json::Error>(())
/// ```
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(tag = "request", rename_all = "kebab-case", deny_unknown_fields)]
pub enum Request {
    /// Progress of the run.
    Status,
    /// Hold at the next tick boundary; answered when the run is held.
    Pause,
    /// Run this many ticks from the hold; answered when the run is held again.
    Step {
        /// Number of ticks, at least 1.
        ticks: u32,
    },
    /// Go on from the hold.
    Resume,
    /// Change the pace.
    Pace {
        /// To this.
        pace: PaceSetting,
    },
    /// End at the next tick boundary.
    Stop,
    /// Write a checkpoint of the next tick boundary; answered when the file is there.
    Checkpoint {
        /// The file; beside the recording and called after the tick where absent.
        path: Option<PathBuf>,
    },
    /// Go back in a paused run to one of its checkpoints; answered when the run is paused there. The newest one before where
    /// neither is given.
    Rewind {
        /// The tick of a checkpoint beside the recording.
        tick: Option<u32>,
        /// The file of a checkpoint of this run.
        path: Option<PathBuf>,
    },
    /// Replace a process; answered when the backup has taken over.
    Swap {
        /// The process to replace.
        process: String,
        /// The backup: TOML with the keys of a process in a manifest.
        with: String,
        /// Ticks that it computes beside the process first.
        shadow_ticks: Option<u32>,
        /// The tick from which on its outputs count.
        at_tick: Option<u32>,
    },
}

/// An answer of a run. On the socket each is a line of JSON.
///
/// ```
/// use runtime::ctl::protocol::Answer;
/// let answer: Answer = serde_json::from_str(r#"{"answer":"done","text":"paused at tick 5","tick":5}"#)?;
/// let Answer::Done { tick, .. } = answer else { panic!("{answer:?}") };
/// assert_eq!(tick, 5);
/// # Ok::<(), serde_json::Error>(())
/// ```
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(tag = "answer", rename_all = "kebab-case")]
pub enum Answer {
    /// The request was carried out.
    Done {
        /// Description of what happened.
        text: String,
        /// Ticks that every process has completed.
        tick: u32,
        /// Legal but unusual values of a process that was swapped in, with their places.
        #[serde(default, skip_serializing_if = "Vec::is_empty")]
        warnings: Vec<String>,
    },
    /// Progress of the run.
    Status(Status),
    /// The request was not carried out.
    Refused {
        /// Reason of the refusal.
        reason: String,
        /// Legal but unusual values of a process that was to be swapped in, which may explain the refusal.
        #[serde(default, skip_serializing_if = "Vec::is_empty")]
        warnings: Vec<String>,
    },
}

impl Answer {
    /// A refusal.
    pub fn refused(reason: impl Into<String>) -> Self {
        Self::Refused { reason: reason.into(), warnings: Vec::new() }
    }
}

/// State of a run.
///
/// ```
/// assert_eq!(runtime::ctl::protocol::State::Paused.to_string(), "paused");
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum State {
    /// Its processes are connecting.
    Starting,
    /// Ticks are granted.
    Running,
    /// Ticks are granted up to the next hold.
    Stepping,
    /// It is about to be held.
    Pausing,
    /// It is held at a tick boundary.
    Paused,
    /// It is ending before its time.
    Stopping,
    /// It has completed its last tick, or its launcher has gone.
    Ended,
}

impl State {
    /// State of the run of `control`.
    pub fn of(control: &LiveView) -> Self {
        let ticks = control.completed_ticks();
        match control.hold_tick() {
            _ if control.phase() != Phase::Running => Self::Starting,
            _ if ticks >= control.end_tick() => Self::Ended,
            _ if control.is_stop_requested() || control.is_aborted() => Self::Stopping,
            u32::MAX => Self::Running,
            // A hold for a process that joins is not one of the user's.
            hold_tick if control.held_at().is_some_and(|held| hold_tick <= held) => Self::Paused,
            hold_tick if hold_tick > ticks => Self::Stepping,
            _ => Self::Pausing,
        }
    }
}

impl std::fmt::Display for State {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        self.serialize(f)
    }
}

/// Progress of a run.
///
/// ```
/// let text = r#"{"run_id":"1-a","state":"paused","tick":500,"end_tick":1000,"time_s":0.5,"pace":"free","missed_deadlines":0}"#;
/// let status: runtime::ctl::protocol::Status = serde_json::from_str(text)?;
/// assert_eq!(status.to_string(), "1-a: paused at tick 500 of 1000 (0.500 s), pace free");
/// # Ok::<(), serde_json::Error>(())
/// ```
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Status {
    /// The run's name.
    pub run_id: String,
    /// State of the run.
    pub state: State,
    /// Ticks that every process has completed.
    pub tick: u32,
    /// The tick at which the run ends.
    pub end_tick: u32,
    /// Simulated time, in seconds.
    pub time_s: f64,
    /// The requested pace.
    pub pace: PaceSetting,
    /// Deadlines missed (paced runs).
    pub missed_deadlines: u32,
    /// Groups whose processes are alive, in the answer to a request.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub groups: Vec<Group>,
}

/// Nodes of a run that share a process.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Group {
    /// Name of the group.
    pub name: String,
    /// Names of its nodes; without those that a process of their own has replaced.
    pub members: Vec<String>,
}

impl Status {
    /// Progress of the run of `plan`, without its groups.
    pub fn of(plan: &Plan, control: &LiveView) -> Self {
        let tick = control.completed_ticks();
        Self {
            run_id: plan.run_id.clone(),
            state: State::of(control),
            tick,
            end_tick: control.end_tick(),
            time_s: f64::from(tick) * plan.tick_s(),
            pace: PaceSetting(control.pace()),
            missed_deadlines: control.missed_deadlines(),
            groups: Vec::new(),
        }
    }

    /// Adds the groups of `plan`, with the members that `membership` has in them still.
    #[must_use]
    pub fn with_groups(mut self, plan: &Plan, membership: &Membership) -> Self {
        let groups = plan.groups.iter().map(|group| {
            let nodes = group.members.iter().map(|member| member.node);
            // A member's successor has a process of its own.
            let members = nodes.filter(|&node| membership.nodes[node].primary.generation == 0);
            let members = members.map(|node| plan.nodes[node].name.clone()).collect();
            Group { name: group.name.clone(), members }
        });
        self.groups = groups.filter(|group| !group.members.is_empty()).collect();
        self
    }
}

impl std::fmt::Display for Status {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self { run_id, state, tick, end_tick, time_s, pace, missed_deadlines, groups } = self;
        write!(f, "{run_id}: {state} at tick {tick} of {end_tick} ({time_s:.3} s), pace {pace}")?;
        if *missed_deadlines > 0 {
            write!(f, ", {missed_deadlines} deadlines missed")?;
        }
        let mut groups = groups.iter();
        groups.try_for_each(|Group { name, members }| write!(f, "\ngroup {name}: {}", members.join(", ")))
    }
}

#[cfg(test)]
mod tests {
    use super::{Answer, Request, Status};

    /// Requires that `line` is the text of a request, and that a request is written as `line`.
    fn require_round_trip(line: &str) {
        let request: Request = serde_json::from_str(line).unwrap_or_else(|error| panic!("{line}: {error}"));
        assert_eq!(serde_json::to_string(&request).unwrap(), line);
    }

    #[test]
    fn a_request_is_one_json_object() {
        require_round_trip(r#"{"request":"status"}"#);
        require_round_trip(r#"{"request":"step","ticks":7}"#);
        require_round_trip(r#"{"request":"checkpoint","path":"/a/b.ckpt"}"#);
        require_round_trip(r#"{"request":"rewind","tick":6000,"path":null}"#);
        require_round_trip(r#"{"request":"pace","pace":"free"}"#);
        require_round_trip(r#"{"request":"pace","pace":"realtime"}"#);
        require_round_trip(r#"{"request":"pace","pace":"0.25"}"#);
        require_round_trip(
            r#"{"request":"swap","process":"pid","with":"kind='pid'","shadow_ticks":5,"at_tick":null}"#,
        );
        for wrong in [r#"{"request":"fly"}"#, r#"{"request":"step"}"#, r#"{"request":"pace","pace":-1}"#] {
            assert!(serde_json::from_str::<Request>(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn a_status_has_a_line_for_each_group() {
        let progress = r#"{"run_id":"1-a","state":"paused","tick":5,"end_tick":9,"time_s":0.005,"pace":"free","missed_deadlines":2"#;
        let read = |more: &str| serde_json::from_str::<Status>(&format!("{progress}{more}}}")).unwrap();
        let line = "1-a: paused at tick 5 of 9 (0.005 s), pace free, 2 deadlines missed";
        assert_eq!(read("").to_string(), line);
        assert_eq!(serde_json::to_string(&read("")).unwrap(), format!("{progress}}}"));
        let groups = r#","groups":[{"name":"a","members":["ekf","imu"]},{"name":"b","members":["plant"]}]"#;
        assert_eq!(read(groups).to_string(), format!("{line}\ngroup a: ekf, imu\ngroup b: plant"));
        assert_eq!(serde_json::to_string(&read(groups)).unwrap(), format!("{progress}{groups}}}"));
    }

    #[test]
    fn an_answer_is_one_json_object() {
        let done = Answer::Done { text: "paused at tick 5".to_owned(), tick: 5, warnings: Vec::new() };
        assert_eq!(
            serde_json::to_string(&done).unwrap(),
            r#"{"answer":"done","text":"paused at tick 5","tick":5}"#
        );
        let refused = serde_json::to_string(&Answer::refused("no")).unwrap();
        assert_eq!(refused, r#"{"answer":"refused","reason":"no"}"#);
    }
}
