//! The command `top`.

use super::output::{print_json, print_text};
use anyhow::{Result, bail};
use clap::Args;
use report::top;
use runtime::run_dir::find_live;
use std::io::IsTerminal;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

/// End of the text of `top --help`.
pub const HELP: &str =
    "Keys: space pauses and resumes, s and S step 1 and 100 ticks, + and - double and halve the
speed, f runs free, r in real time, arrows scroll, x stops the run, q leaves it flying.

Example: hummingbus top --once --json";

/// Time that the drawing has to end after a signal.
const LEAVE: Duration = Duration::from_secs(2);

/// Arguments of `top`.
#[derive(Args)]
pub struct TopArguments {
    /// The run; needed only if several are alive, and not just one of them was started in this folder and on this terminal.
    #[arg(long, value_name = "ID")]
    run: Option<String>,
    /// Look for half a second, print what was seen, and end.
    #[arg(long)]
    once: bool,
    /// Print JSON.
    #[arg(long, requires = "once")]
    json: bool,
}

/// Shows a live run.
///
/// # Errors
/// If there is no such run, or no terminal to show it in.
pub fn top(arguments: &TopArguments) -> Result<bool> {
    if !arguments.once && !std::io::stdout().is_terminal() {
        bail!("standard output is no terminal: `hummingbus top --once` prints what it sees and ends");
    }
    let run = Arc::new(find_live(arguments.run.as_deref())?);
    if arguments.once {
        let view = top::look(&run)?;
        let printed = if arguments.json { print_json(&view) } else { print_text(&view.to_string()) };
        return printed.map(|()| true);
    }
    let is_terminated = Arc::new(AtomicBool::new(false));
    let flag = is_terminated.clone();
    // Without it a signal would leave the terminal in the state in which it is drawn on. If the terminal itself is
    // gone, the reader of its keys does not come back: then it is left behind.
    ctrlc::set_handler(move || {
        flag.store(true, Ordering::SeqCst);
        std::thread::sleep(LEAVE);
        top::restore_terminal();
        std::process::exit(1);
    })?;
    top::watch(&run, &is_terminated)?;
    Ok(true)
}
