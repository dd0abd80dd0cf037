//! The run directory, and the promise that a run leaves nothing behind.

use anyhow::{Context, Result};
use bus::control::shm_prefix;
use std::path::{Path, PathBuf};

const CREATE_ATTEMPTS: u32 = 100;

/// Where a run keeps its files; dropping it removes them and the run's shared memory.
#[derive(Debug)]
pub struct RunDir {
    path: PathBuf,
    run_id: String,
}

impl RunDir {
    /// Creates a directory for a new run, open to this user alone.
    pub fn create() -> Result<Self> {
        use std::os::unix::fs::DirBuilderExt;
        let run_id = format!("{:x}-{:x}", std::process::id(), bus::control::monotonic_ns());
        let user = bus::process::user_id();
        let path = std::env::temp_dir().join(format!("hummingbus-{user}")).join(&run_id);
        // Another run that ends may remove the user's folder between its making and that of this run's.
        let create = || std::fs::DirBuilder::new().recursive(true).mode(0o700).create(&path);
        (1..CREATE_ATTEMPTS)
            .find_map(|_| create().ok())
            .map_or_else(create, Ok)
            .with_context(|| format!("cannot create the run directory {}", path.display()))?;
        Ok(Self { path, run_id })
    }

    /// The directory.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The run's name, unique on this machine.
    pub fn run_id(&self) -> &str {
        &self.run_id
    }
}

impl Drop for RunDir {
    fn drop(&mut self) {
        remove_shared_memory(&self.run_id);
        let _ = std::fs::remove_dir_all(&self.path);
        // The user's folder goes with the last run in it; while another is there, this fails, as it should.
        let _ = self.path.parent().map(std::fs::remove_dir);
    }
}

/// Removes every shared-memory file of a run whose processes are gone.
fn remove_shared_memory(run_id: &str) {
    let prefix = shm_prefix(run_id);
    for entry in std::fs::read_dir("/dev/shm").into_iter().flatten().flatten() {
        if entry.file_name().to_string_lossy().starts_with(&prefix) {
            let _ = std::fs::remove_file(entry.path());
        }
    }
}
