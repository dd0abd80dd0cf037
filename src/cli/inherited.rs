//! Variables that a command inherited from the run that started it are dropped: the command is not a process of that
//! run.

use bus::process::{LAUNCHER_VARIABLE, RUN_VARIABLE};
use bus::{GENERATION_VARIABLE, NODE_VARIABLE};
use std::os::unix::process::CommandExt;
use std::process::Command;

/// Environment variables of a launcher for its processes.
const VARIABLES: [&str; 4] = [RUN_VARIABLE, LAUNCHER_VARIABLE, NODE_VARIABLE, GENERATION_VARIABLE];

/// Begins this command anew without the variables of another run, if it has one. The kernel shows the variables with
/// which a program began, even if it changes them later, and `clean` uses those of the kernel.
pub fn forget() {
    if VARIABLES.iter().all(|variable| std::env::var_os(variable).is_none()) {
        return;
    }
    let mut args = std::env::args_os();
    let mut command = Command::new("/proc/self/exe");
    command.arg0(args.next().unwrap_or_else(|| "hummingbus".into())).args(args);
    for variable in VARIABLES {
        command.env_remove(variable);
    }
    // It comes back only where it failed, without /proc for one: then there is nothing that `clean` could go by.
    let _ = command.exec();
}
