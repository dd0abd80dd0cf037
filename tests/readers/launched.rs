//! Processes of hummingbus that a test starts and does not wait for.

use crate::{HUMMINGBUS, ROOT};
use recorder::reader::Recording;
use rustix::process::{Pid, Signal, kill_process};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::thread::sleep;
use std::time::Duration;

/// Time between two looks at a process that ends.
const LOOK: Duration = Duration::from_millis(20);
/// Number of looks before a process is killed that does not end in order.
const LOOKS: u32 = 500;

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
        let mut is_asked = false;
        for _ in 0..LOOKS {
            let Ok(None) = self.0.try_wait() else { return };
            if !is_asked {
                is_asked = kill_process(Pid::from_child(&self.0), Signal::INT).is_ok();
            }
            sleep(LOOK);
        }
        let _ = self.0.kill();
        let _ = self.0.wait();
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
