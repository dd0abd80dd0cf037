//! Starting one process of a run.

use crate::claimed_file::append_to_log;
use crate::program::{Executable, Program};
use crate::role::Role;
use anyhow::{Context, Result, anyhow};
use bus::description::DESCRIBE_VARIABLE;
use bus::group::GROUP_VARIABLE;
use bus::process::{LAUNCHER_VARIABLE, RUN_VARIABLE};
use bus::random::{FNV_OFFSET, fnv1a};
use bus::{GENERATION_VARIABLE, NODE_VARIABLE};
use std::fs::{File, OpenOptions};
use std::io;
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};

/// The environment variable with the socket on which a sidecar says that it is ready (sd_notify(3)).
const NOTIFY_VARIABLE: &str = "NOTIFY_SOCKET";

/// The environment variable with the folder of a command for files of its own, which goes with the run.
pub const SCRATCH_VARIABLE: &str = "HUMMINGBUS_SCRATCH";

/// Beginning of the names of a group's files. That of the process `group/x` is `group.x`.
const GROUP_PREFIX: &str = "group~";
/// Longest name of a file that the kernel allows, in bytes (`NAME_MAX`).
const FILE_NAME_BYTES: usize = 255;
/// Longest beginning that a shortened file name keeps, in bytes.
const BEGINNING_BYTES: usize = 64;

/// Process to start.
#[derive(Clone, Copy)]
pub enum Started<'a> {
    /// The clock service.
    Clock,
    /// The process of one node or sidecar.
    One(&'a Program),
    /// The process of a group.
    Group,
}

impl<'a> Started<'a> {
    fn program(self) -> Option<&'a Program> {
        match self {
            Self::One(program) => Some(program),
            Self::Clock | Self::Group => None,
        }
    }
}

/// The process `name` of the run in `run_dir`, and the file of its output.
///
/// # Errors
/// If it cannot be started, or its niceness or priority is not allowed.
pub fn start(
    exe: &Path,
    run_dir: &Path,
    name: &str,
    role: Role,
    started: Started<'_>,
    notify: Option<&Path>,
) -> Result<(Child, PathBuf)> {
    let mut command = command(exe, started);
    let program = started.program();
    match role {
        Role::Clock => {}
        Role::Node { .. } if matches!(started, Started::Group) => {
            command.env(GROUP_VARIABLE, name);
        }
        Role::Node { generation, .. } => {
            command.env(NODE_VARIABLE, name).env(GENERATION_VARIABLE, generation.to_string());
        }
        Role::Sidecar { .. } => {
            // One that this launcher's own service manager listens on is not the sidecar's.
            command.env_remove(NOTIFY_VARIABLE);
            command.envs(notify.map(|socket| (NOTIFY_VARIABLE, socket)));
            bus::process::die_with_this_one(&mut command);
        }
    }
    if let Some(Executable::Command(_)) = program.map(|program| &program.executable) {
        command.env(SCRATCH_VARIABLE, scratch(name, role, run_dir)?);
    }
    let log = program.and_then(|program| program.log.as_deref());
    let log_name =
        if matches!(started, Started::Group) { format!("{GROUP_PREFIX}{name}") } else { name.to_owned() };
    let (file, path) = open_log(&log_name, role, run_dir, log)?;
    command
        .env(RUN_VARIABLE, run_dir)
        .env(LAUNCHER_VARIABLE, std::process::id().to_string())
        .stdin(Stdio::null())
        .stdout(file.try_clone().context("cannot share a log file")?)
        .stderr(file)
        // A group of its own: Ctrl-C in the terminal reaches the launcher alone, which stops the run
        // at a tick boundary.
        .process_group(0);
    let mut child = command.spawn().with_context(|| {
        format!("process `{name}`: cannot start {}", command.get_program().to_string_lossy())
    })?;
    if let Err(error) = program.map_or(Ok(()), |program| set_priority(&child, name, program)) {
        bus::process::kill_group(child.id());
        let _ = child.wait();
        return Err(error);
    }
    Ok((child, path))
}

/// Command that executes `program`: the binary `exe`, which becomes a component with these arguments, or a command.
fn command(exe: &Path, started: Started<'_>) -> Command {
    let program = started.program();
    let mut command = match program.map(|program| &program.executable) {
        Some(Executable::Command(args)) => {
            let mut command = Command::new(&args[0]);
            command.args(&args[1..]);
            command
        }
        Some(Executable::Component(_) | Executable::Program(_)) | None => {
            let kind = match started {
                Started::Clock => "clock",
                Started::Group => "group",
                Started::One(program) => program.kind().unwrap_or(""),
            };
            let mut command = Command::new(exe);
            command.arg0("hummingbus").args(["node", kind]);
            // A `command` may be a shell that starts other programs first, which would not receive these signals
            // either.
            bus::process::hold_stop_signals(&mut command);
            command
        }
    };
    // That of a check which started this launcher is not meant for the nodes of its run.
    command.env_remove(DESCRIBE_VARIABLE);
    if let Some(program) = program {
        command.envs(&program.environment);
        if let Some(folder) = &program.working_directory {
            command.current_dir(folder);
        }
    }
    command
}

/// A folder for the files of a process, which is removed with the run directory. A backup and a restarted process have their own.
fn scratch(name: &str, role: Role, run_dir: &Path) -> Result<PathBuf> {
    let path = run_dir.join(file_name(name, role, "scratch"));
    std::fs::create_dir_all(&path)
        .with_context(|| format!("process `{name}`: cannot make the folder {}", path.display()))?;
    Ok(path)
}

/// Name of a file of a process in the run directory: a backup and a restarted process have their number in it. A name that is too
/// long for a file, or that another name would share, is cut, and a hash of the whole name follows.
fn file_name(name: &str, role: Role, ending: &str) -> String {
    let generation = role.generation();
    let number = if generation == 0 { String::new() } else { format!("#{generation}") };
    let stem = name.replace('/', ".");
    let whole = format!("{stem}{number}.{ending}");
    // No name of a process has a dot or a tilde. A group's that has one would be the file of `a/b` or of a cut name.
    let is_taken = name.strip_prefix(GROUP_PREFIX).unwrap_or(name).contains(['.', '~']);
    if whole.len() <= FILE_NAME_BYTES && !is_taken {
        return whole;
    }
    let beginning = &stem[..stem.floor_char_boundary(BEGINNING_BYTES)];
    format!("{beginning}~{:016x}{number}.{ending}", fnv1a(name.as_bytes(), FNV_OFFSET))
}

/// Log file of a process: the file that the manifest names, to which a backup appends, or one in the run directory.
/// There a backup has its own.
fn open_log(name: &str, role: Role, run_dir: &Path, log: Option<&Path>) -> Result<(File, PathBuf)> {
    if let Some(path) = log {
        let file = append_to_log(path).with_context(|| format!("process `{name}`"))?;
        return Ok((file, path.to_owned()));
    }
    let path = run_dir.join(file_name(name, role, "log"));
    let file = OpenOptions::new().create(true).append(true).open(&path);
    Ok((file.with_context(|| format!("process `{name}`: cannot open {}", path.display()))?, path))
}

/// Gives a started process its niceness and its priority.
fn set_priority(child: &Child, name: &str, program: &Program) -> Result<()> {
    type Set = fn(u32, i32) -> io::Result<()>;
    let settings: [(_, _, _, Set); 2] = [
        ("nice", program.nice, "-e", bus::process::set_nice),
        ("realtime_priority", program.realtime_priority, "-r", bus::process::set_fifo),
    ];
    for (key, value, limit, set) in settings {
        let Some(value) = value else { continue };
        set(child.id(), value).map_err(|error| {
            anyhow!(
                "process `{name}`: `{key} = {value}` is refused: {error}. It needs the capability CAP_SYS_NICE, or a \
                 limit that allows it (`ulimit {limit}`); or leave the key out"
            )
        })?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    const FIRST: Role = Role::Node { node: 0, generation: 0 };
    const RESTARTED: Role = Role::Node { node: 0, generation: u32::MAX };

    #[test]
    fn a_short_name_stays_whole() {
        assert_eq!(file_name("h1/plant", FIRST, "log"), "h1.plant.log");
        assert_eq!(file_name("h1/plant", Role::Node { node: 0, generation: 2 }, "log"), "h1.plant#2.log");
        let longest = "g".repeat(FILE_NAME_BYTES - ".log".len());
        assert_eq!(file_name(&longest, FIRST, "log"), format!("{longest}.log"));
    }

    #[test]
    fn long_names_give_files_of_different_names() {
        let folder = tempfile::tempdir().unwrap();
        let members = |last: &str| format!("{GROUP_PREFIX}{}{last}", "h1/plant+".repeat(40));
        let unicode = format!("{GROUP_PREFIX}{}", "é".repeat(300));
        let mut names = vec![members("h1/imu"), members("h1/ekf"), "g".repeat(252), unicode];
        names.extend(["a/b", "a.b", "a~b"].map(|group| format!("{GROUP_PREFIX}{group}")));
        // Processes of a vehicle that is called `group`, and a group that is called like the first.
        names.extend(["group/x".to_owned(), "group/a/b".to_owned(), format!("{GROUP_PREFIX}x")]);
        names.push(file_name(&names[0], FIRST, "log").replace(".log", ""));
        for name in &names {
            for (role, ending) in [(FIRST, "log"), (RESTARTED, "log"), (FIRST, "scratch")] {
                let file = file_name(name, role, ending);
                // A name that another one has is refused here, and so is one that is too long.
                let made = File::create_new(folder.path().join(&file));
                assert!(made.is_ok(), "{file}: {made:?}");
            }
        }
        assert!(file_name(&members("h1/imu"), FIRST, "log").starts_with("group~h1.plant+h1.plant+"));
    }
}
