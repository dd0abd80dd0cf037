//! Going back in flight: a paused run ends in order, and starts again from one of its checkpoints, under the same name.

use crate::checkpoint::{Checkpoint, Written};
use crate::ctl::Reply;
use bus::plan::Pace;
use serde::Serialize;
use std::cell::{Ref, RefCell};
use std::path::PathBuf;

/// Name of the attachment that says where a recording's run went back.
pub const MARK: &str = "rewinds.toml";

/// A rewind that is asked for or under way.
pub(crate) struct Rewind {
    /// The checkpoint to go on from.
    pub checkpoint: Checkpoint,
    /// The tick at which the run was paused.
    pub from_tick: u32,
    /// The pace that was asked for last.
    pub pace: Pace,
    /// The place of the answer, which is given when the run is paused again.
    pub reply: Reply,
}

/// A rewind of a run that has happened.
///
/// ```
/// let rewound = runtime::rewind::Rewound { from_tick: 7000, to_tick: 6000, recording: None };
/// assert_eq!(rewound.to_string(), "rewound from tick 7000 to tick 6000");
/// ```
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Rewound {
    /// The tick at which the run was paused.
    pub from_tick: u32,
    /// The tick of the checkpoint, from which it went on.
    pub to_tick: u32,
    /// The recording of what was flown up to `from_tick`.
    pub recording: Option<PathBuf>,
}

impl std::fmt::Display for Rewound {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "rewound from tick {} to tick {}", self.from_tick, self.to_tick)?;
        match &self.recording {
            Some(path) => write!(f, "; up to there it is recorded in {}", path.display()),
            None => Ok(()),
        }
    }
}

/// The rewinds of a run.
#[derive(Default)]
pub(crate) struct Rewinds {
    asked: RefCell<Option<Rewind>>,
    begun: RefCell<Option<Rewind>>,
    done: RefCell<Vec<Rewound>>,
    /// Checkpoints that were written before the one from which the run goes on.
    written: RefCell<Vec<Written>>,
}

impl Rewinds {
    /// Notes that the run is to end, and to go on from a checkpoint.
    pub fn ask(&self, rewind: Rewind) {
        self.asked.replace(Some(rewind));
    }

    /// The rewind that was asked for.
    pub fn take_asked(&self) -> Option<Rewind> {
        self.asked.take()
    }

    /// Notes that the run, whose recording so far is `recording` and whose checkpoints are `written`, goes back.
    pub fn begin(&self, rewind: Rewind, recording: Option<PathBuf>, written: Vec<Written>) {
        let (from_tick, to_tick) = (rewind.from_tick, rewind.checkpoint.tick());
        self.done.borrow_mut().push(Rewound { from_tick, to_tick, recording });
        self.written.replace(written.into_iter().filter(|written| written.tick <= to_tick).collect());
        self.begun.replace(Some(rewind));
    }

    /// The rewind from whose checkpoint the run starts now.
    pub fn take_begun(&self) -> Option<Rewind> {
        self.begun.take()
    }

    /// The checkpoints that were written before that one.
    pub fn take_written(&self) -> Vec<Written> {
        self.written.take()
    }

    /// All rewinds so far.
    pub fn done(&self) -> Ref<'_, Vec<Rewound>> {
        self.done.borrow()
    }

    /// The text that marks the recording of a run which went back; `None` for another run.
    pub fn mark(&self) -> Option<String> {
        let done = self.done.borrow();
        let last = done.last()?;
        let mut text =
            format!("# The run went back in flight: this recording begins at tick {}.\n", last.to_tick);
        for Rewound { from_tick, to_tick, recording } in &*done {
            text += &format!("\n[[rewind]]\nfrom_tick = {from_tick}\nto_tick = {to_tick}\n");
            if let Some(name) = recording.as_ref().and_then(|path| path.file_name()) {
                text += &format!("recording = {}\n", toml::Value::from(name.to_string_lossy().into_owned()));
            }
        }
        Some(text)
    }
}
