//! The folder of a PX4 that runs: its program, the commands of its start-up script, and the parameters.

use crate::process::Scratch;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};

/// Script with parameters of the user, which PX4's start-up script runs in its middle from wherever the search path has it first.
const PARAMETER_SCRIPT: &str = "px4-rc.params";
/// PX4's start-up script in the folder `etc` of its build.
const START_UP_SCRIPT: &str = "init.d-posix/rcS";
/// Beginning of the names of the start-up script's commands, which are PX4's program under other names.
const COMMANDS: &str = "px4-";

/// Paths of the folder.
#[derive(Debug)]
pub struct Folder {
    /// The program.
    pub program: PathBuf,
    /// The folder `etc` of the build.
    pub etc: PathBuf,
    /// The folder in which it runs.
    pub root: PathBuf,
}

impl Folder {
    /// Fills the folder of `scratch` with the program, which was built as `source`, and the commands that set its parameters.
    ///
    /// # Errors
    /// A file of the build is not there, or one of the folder cannot be written.
    pub fn fill(scratch: &Scratch, program: &[u8], source: &Path, parameters: &str) -> Result<Self, String> {
        let source =
            fs::canonicalize(source).map_err(|error| format!("cannot find {}: {error}", source.display()))?;
        let build = source.parent().unwrap_or(&source);
        let etc = build.with_file_name("etc");
        if !etc.join(START_UP_SCRIPT).is_file() {
            let (etc, script) = (etc.display(), START_UP_SCRIPT);
            return Err(format!(
                "no file {etc}/{script}: PX4 needs the folder `etc` of its build beside that of its program, bin/px4"
            ));
        }
        let program = scratch.write("px4", program)?;
        link_commands(scratch, build)?;
        scratch.write(PARAMETER_SCRIPT, parameters.as_bytes())?;
        Ok(Self { program, etc, root: scratch.add_folder("rootfs")? })
    }
}

/// Links the commands of the start-up script: most of them are links to the program.
fn link_commands(scratch: &Scratch, build: &Path) -> Result<(), String> {
    let unread = |error: io::Error| format!("cannot read {}: {error}", build.display());
    for entry in fs::read_dir(build).map_err(unread)? {
        let entry = entry.map_err(unread)?;
        let (name, path) = (entry.file_name(), entry.path());
        if name.to_string_lossy().starts_with(COMMANDS) && name != PARAMETER_SCRIPT {
            let to = if path.is_symlink() { Path::new("px4") } else { &path };
            scratch.link(&name, to)?;
        }
    }
    Ok(())
}
