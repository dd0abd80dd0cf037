//! Going back in flight: a paused run ends in order, and starts again from one of its checkpoints, under the same name.

use crate::ctl::Reply;
use crate::graph::Graph;
use crate::output_file::{RECORDING, check};
use bus::plan::Pace;
use diagnostics::Error;
use serde::Serialize;
use std::cell::{Ref, RefCell};
use std::path::PathBuf;

/// Name of the attachment that says where a recording's run went back. Files of a user are attached under names without a slash:
/// none takes its place.
pub const MARK: &str = "hummingbus/rewinds.toml";

/// A rewind that is requested or under way.
pub(crate) struct Rewind {
    /// The tick at which the run was paused.
    pub from_tick: u32,
    /// The tick of the checkpoint.
    pub to_tick: u32,
    /// File of the checkpoint.
    pub path: PathBuf,
    /// The pace that was requested last.
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
    /// The recording of the flight up to `from_tick`.
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
    /// With the graph that goes on from the checkpoint.
    asked: RefCell<Option<(Rewind, Graph)>>,
    begun: RefCell<Option<Rewind>>,
    done: RefCell<Vec<Rewound>>,
    /// Place of the recording so far, if the run goes back.
    place: RefCell<Option<PathBuf>>,
}

impl Rewinds {
    /// Notes that the run is to end, and that `graph` goes on from a checkpoint.
    pub fn ask(&self, rewind: Rewind, graph: Graph) {
        self.asked.replace(Some((rewind, graph)));
    }

    /// True if a rewind was asked for.
    pub fn is_asked(&self) -> bool {
        self.asked.borrow().is_some()
    }

    /// The requested rewind, and the graph that goes on.
    pub fn take_asked(&self) -> Option<(Rewind, Graph)> {
        self.asked.take()
    }

    /// Notes where the recording so far is kept when the run goes back.
    pub fn keep_at(&self, place: Option<PathBuf>) {
        self.place.replace(place);
    }

    /// Refuses a rewind that cannot keep the recording of the flight.
    ///
    /// # Errors
    /// If something else lies there.
    pub fn require_place(&self) -> Result<(), Error> {
        self.place.borrow().as_ref().map_or(Ok(()), |place| check(place, &RECORDING))
    }

    /// Notes that the run, whose recording so far is `recording`, goes back.
    pub fn begin(&self, rewind: Rewind, recording: Option<PathBuf>) {
        let Rewind { from_tick, to_tick, .. } = rewind;
        self.done.borrow_mut().push(Rewound { from_tick, to_tick, recording });
        self.begun.replace(Some(rewind));
    }

    /// The rewind from whose checkpoint the run starts now.
    pub fn take_begun(&self) -> Option<Rewind> {
        self.begun.take()
    }

    /// Rewinds so far.
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
