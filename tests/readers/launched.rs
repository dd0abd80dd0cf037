//! Processes of hummingbus that a test starts and does not wait for.

use crate::{HUMMINGBUS, ROOT};
use recorder::reader::Recording;
use rustix::process::{Pid, Signal, kill_process};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant};

/// Longest time that a process may take to end in order.
const GRACE: Duration = Duration::from_secs(10);
/// Time between two looks at a process that ends.
const LOOK: Duration = Duration::from_millis(20);

/// A process of hummingbus. Dropping it ends it as Ctrl-C does: the launcher of a run removes the run's shared memory, also where the test has
/// failed. One that does not end is killed.
pub struct Launched(pub Child);

impl Launched {
    /// Ends the process as Ctrl-C does.
    pub fn interrupt(&self) {
        kill_process(Pid::from_child(&self.0), Signal::INT).unwrap();
    }
}

impl Drop for Launched {
    fn drop(&mut self) {
        let begun = Instant::now();
        let mut is_asked = false;
        while let Ok(None) = self.0.try_wait() {
            if !is_asked {
                is_asked = kill_process(Pid::from_child(&self.0), Signal::INT).is_ok();
            }
            if begun.elapsed() > GRACE {
                let _ = self.0.kill();
                let _ = self.0.wait();
                return;
            }
            sleep(LOOK);
        }
    }
}

#[test]
fn a_run_that_is_dropped_finishes_its_recording() {
    let folder = tempfile::tempdir().unwrap();
    let [recording, partial] = ["dropped.mcap", "dropped.partial.mcap"].map(|name| folder.path().join(name));
    let mut command = Command::new(HUMMINGBUS);
    command.arg("run").arg(Path::new(ROOT).join("manifests/hover.toml")).arg("--record").arg(&recording);
    command.args(["--pace", "realtime", "--set", "run.duration_s=4000"]);
    let mut run = Launched(command.stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap());
    while Recording::salvage(&partial).map_or(true, |recording| recording.topics().is_empty()) {
        assert!(run.0.try_wait().unwrap().is_none(), "the run has ended");
        sleep(LOOK);
    }
    drop(run);
    assert!(recording.exists() && !partial.exists(), "it was not ended in order");
}
