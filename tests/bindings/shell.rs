//! Shell blocks of pages, run as a reader runs them: all of a page by one shell, in a copy of the repository.

use crate::build::succeed;
use crate::skipped::{is_thorough, leave};
use crate::support::{HUMMINGBUS, Place, repository};
use std::collections::BTreeSet;
use std::fs;
use std::os::unix::fs::symlink;
use std::path::{Path, PathBuf};
use std::process::Command;

/// Longest run of a page, s. No page needs a tenth of it on an idle machine.
const WATCHDOG_S: &str = "300";

/// Folders and files of the repository that the commands read.
const READ: [&str; 8] =
    ["bindings", "controllers", "docs", "examples", "scenes", "scripts", "vehicles", "Cargo.toml"];
/// Folders whose files name others by paths that begin beside their folder, or that runs write into: they are copied.
const COPIED: [&str; 2] = ["flights", "manifests"];

/// Beginnings of the commands that run as they are written. Others, such as those that install or download, need an exception.
const ALLOWED: [&str; 13] = [
    "hummingbus ",
    "target/release/hummingbus ",
    "scripts/make_flights ",
    "python3 -m pythonfmu ",
    "cmake ",
    "fmpy ",
    "cp vehicles/",
    "cd ",
    "export PATH=",
    "V=$PWD/",
    "for ",
    "done",
    "wait",
];

/// A command of a page that is not run as it is written.
pub struct Exception {
    pub command: &'static str,
    /// Commands that run in its place, one a line.
    instead: Option<&'static str>,
    /// True if the thorough tests run the command itself.
    is_heavy: bool,
    /// True if the command itself runs, and has to exit with 1.
    is_negative: bool,
    reason: &'static str,
}

/// A command that the tests do not run.
pub const fn left_out(command: &'static str, reason: &'static str) -> Exception {
    Exception { command, instead: None, is_heavy: false, is_negative: false, reason }
}

/// A command with another one in its place.
pub const fn replaced(command: &'static str, instead: &'static str, reason: &'static str) -> Exception {
    Exception { command, instead: Some(instead), is_heavy: false, is_negative: false, reason }
}

/// A command that runs as it is written in the thorough tests, and elsewhere as `instead`.
pub const fn shortened(command: &'static str, instead: &'static str, reason: &'static str) -> Exception {
    Exception { command, instead: Some(instead), is_heavy: true, is_negative: false, reason }
}

/// A command whose answer is negative: exit code 1.
pub const fn negative(command: &'static str, reason: &'static str) -> Exception {
    Exception { command, instead: None, is_heavy: false, is_negative: true, reason }
}

/// The blocks of `page` that begin with this word.
pub fn blocks(page: &str, fence: &str) -> Vec<String> {
    let text = fs::read_to_string(repository(page)).unwrap();
    let opening = format!("\n```{fence}\n");
    let blocks = text.split(&opening).skip(1).map(|rest| rest.split("\n```").next().unwrap());
    blocks.map(str::to_owned).collect()
}

/// The commands in the shell blocks of `page`, without their comments. A command that continues on the next line is one;
/// `&&` joins several.
pub fn commands(page: &str) -> Vec<String> {
    let joined = |block: String| block.split("\\\n").map(str::trim_start).collect::<String>();
    let joined: Vec<String> = blocks(page, "sh").into_iter().map(joined).collect();
    let lines = joined.iter().flat_map(|block| block.lines()).map(|line| line.split(" #").next().unwrap());
    let commands = lines.flat_map(|line| line.split("&&")).map(|command| command.trim().to_owned());
    commands.filter(|command| !command.is_empty()).collect()
}

/// Requires that some page of `pages` has the command of each exception.
pub fn require_commands(exceptions: &[Exception], pages: &[&str]) {
    let commands: BTreeSet<String> = pages.iter().flat_map(|page| commands(page)).collect();
    for Exception { command, .. } in exceptions {
        assert!(commands.contains(*command), "no page has `{command}`");
    }
}

/// The repository as a reader has it after a build: the program is the one under test.
pub fn copy() -> Place {
    let place = Place::new();
    for name in READ {
        symlink(repository(name), place.path(name)).unwrap();
    }
    for name in COPIED {
        let mut copy = Command::new("cp");
        copy.args(["-r", &repository(name), &place.path(name)]);
        succeed(copy);
    }
    fs::create_dir(place.path("target")).unwrap();
    symlink(Path::new(HUMMINGBUS).parent().unwrap(), place.path("target/release")).unwrap();
    place
}

/// The commands that run in place of `command`; nothing if it is left out.
fn substitute(page: &str, command: &str, exceptions: &[Exception]) -> Option<String> {
    let Some(exception) = exceptions.iter().find(|exception| exception.command == command) else {
        let is_allowed = ALLOWED.iter().any(|start| command.starts_with(start));
        assert!(
            is_allowed,
            "{page}: `{command}` is not a command that tests run: add it to `EXCEPTIONS` or `ALLOWED`"
        );
        return Some(command.to_owned());
    };
    let Exception { instead, is_heavy, is_negative, reason, .. } = exception;
    if *is_negative {
        return Some(format!("code=0; {command} || code=$?; test $code = 1"));
    }
    if *is_heavy && is_thorough() {
        return Some(command.to_owned());
    }
    println!("{page}: `{command}` is not run as it is written: {reason}; instead: {instead:?}");
    if *is_heavy {
        leave(1, "whole command");
    }
    instead.map(str::to_owned)
}

/// Runs the commands of `page` in `place` with these variables, after the commands `before`; returns the number of commands
/// that have run. Nothing of them outlives the shell.
pub fn run(
    place: &Place,
    page: &str,
    exceptions: &[Exception],
    before: &str,
    variables: &[(&'static str, String)],
) -> usize {
    let commands = commands(page);
    let run: Vec<String> =
        commands.iter().filter_map(|command| substitute(page, command, exceptions)).collect();
    // A command that fails ends the shell, and what it has started in the background. `wait` is for those that end by themselves.
    let script = format!(
        "trap 'kill $(jobs -p) 2>/dev/null || true; wait || true' EXIT\n{before}\n{}\nwait\n",
        run.join("\n")
    );
    let mut shell = Command::new("timeout");
    // `-x` tells which command failed.
    shell.args([WATCHDOG_S, "bash", "-exc", &script]).current_dir(place.path(""));
    // `~` of the pages is a folder of the test.
    shell.env("HOME", place.path("home"));
    shell.env("BUILT", Path::new(HUMMINGBUS).parent().unwrap()).envs(variables.iter().cloned());
    place.mark(&mut shell);
    succeed(shell);
    place.await_no_process();
    // Other programs may leave temporary files.
    let is_ours = |path: &PathBuf| path.to_string_lossy().contains("/hummingbus-");
    let left: Vec<PathBuf> = place.run_dirs().into_iter().filter(is_ours).collect();
    assert!(left.is_empty(), "{page} leaves {left:?}");
    run.len()
}

/// `path` with the program on it.
pub fn with_program(path: &str) -> String {
    format!("{}:{path}", Path::new(HUMMINGBUS).parent().unwrap().display())
}

/// The search path of the test, with the program on it.
pub fn path() -> (&'static str, String) {
    ("PATH", with_program(&std::env::var("PATH").unwrap_or_default()))
}
