//! The run directory, and the promise that a run leaves nothing behind.

use anyhow::{Context, Result};
use bus::control::shm_prefix;
use std::path::{Path, PathBuf};

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
        // One level only: a folder shared by runs could vanish with another run that ends.
        let path = std::env::temp_dir().join(format!("hummingbus-{user}-{run_id}"));
        std::fs::DirBuilder::new()
            .mode(0o700)
            .create(&path)
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
