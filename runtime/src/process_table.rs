//! Information of the kernel about processes: their parents, and the run named in their environment.

use bus::process::RUN_VARIABLE;
use rustix::process::Pid;
use std::ffi::OsStr;
use std::os::unix::ffi::OsStrExt;
use std::path::PathBuf;

/// The children of this process.
pub fn children() -> Vec<Pid> {
    let this = rustix::process::getpid();
    let entries = std::fs::read_dir("/proc").into_iter().flatten().flatten();
    let all = entries.filter_map(|entry| entry.file_name().to_str()?.parse().ok().and_then(Pid::from_raw));
    all.filter(|&process| parent_of(process) == Some(this)).collect()
}

/// The processes above a process, its parent first.
pub fn ancestors(process: Pid) -> impl Iterator<Item = Pid> {
    std::iter::successors(Some(process), |&process| parent_of(process)).skip(1)
}

/// The parent of a process; `None` for one that is gone, and for the first one.
fn parent_of(process: Pid) -> Option<Pid> {
    let stat = std::fs::read(format!("/proc/{process}/stat")).ok()?;
    // The name stands in brackets and may hold any bytes; behind it come the state and the parent (proc_pid_stat(5)).
    let behind = stat.iter().rposition(|&byte| byte == b')')? + 1;
    let mut fields = stat[behind..].split(u8::is_ascii_whitespace).filter(|field| !field.is_empty());
    std::str::from_utf8(fields.nth(1)?).ok()?.parse().ok().and_then(Pid::from_raw)
}

/// The run directory that a process carries in its environment; `None` for one that has ended or carries none.
pub fn run_dir_of(process: Pid) -> Option<PathBuf> {
    let environment = std::fs::read(format!("/proc/{process}/environ")).ok()?;
    let mut variables = environment.split(|&byte| byte == 0);
    let value = variables.find_map(|variable| {
        variable.strip_prefix(RUN_VARIABLE.as_bytes()).and_then(|rest| rest.strip_prefix(b"="))
    })?;
    Some(PathBuf::from(OsStr::from_bytes(value)))
}

#[cfg(test)]
mod tests {
    use super::{ancestors, children};
    use rustix::process::{Pid, getpid};
    use std::process::Command;

    #[test]
    fn a_child_is_known_whatever_its_name() {
        let folder = tempfile::tempdir().unwrap();
        let program = folder.path().join("a ) R 1 (");
        std::os::unix::fs::symlink("/bin/sleep", &program).unwrap();
        let mut child = Command::new(&program).arg("600").spawn().unwrap();
        let process = Pid::from_child(&child);
        assert!(children().contains(&process));
        assert_eq!(ancestors(process).next(), Some(getpid()));
        assert!(ancestors(process).count() >= 2);
        child.kill().unwrap();
        child.wait().unwrap();
        assert!(!children().contains(&process));
    }
}
