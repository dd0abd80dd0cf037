//! `hummingbus top`: shows a live run in the terminal, and steers it from the keyboard.
//!
//! - [`sample`]: what a run shows at a moment
//! - [`view`]: what two moments say about the time between them
//! - [`cells`]: the view as words, for screen and paper
//! - [`screen`]: how it is drawn
//! - [`keys`]: what the keys do
#![allow(clippy::disallowed_methods, reason = "rates are per host time")]

mod cells;
mod keys;
mod sample;
mod screen;
mod view;

use crate::run_dir::{LiveRun, find_live};
use anyhow::{Result, bail};
use clap::Args;
use keys::Keys;
use ratatui::DefaultTerminal;
use ratatui::crossterm::event;
use sample::{Sample, Source};
use screen::Screen;
use std::collections::VecDeque;
use std::io::IsTerminal;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};
use view::View;

/// What `top --help` ends with.
pub const HELP: &str =
    "Keys: space pauses and resumes, s and S step 1 and 100 ticks, + and - double and halve the
speed, f runs free, r in real time, arrows scroll, x stops the run, q leaves it flying.

Example: hummingbus top --once --json";

/// Host time between two looks.
const REFRESH: Duration = Duration::from_millis(250);
/// What rates, shares and percentiles speak of: about the last second.
const LOOKS: usize = 5;
/// The same for `--once`.
const ONCE: Duration = Duration::from_millis(500);

/// How long the drawing has to end after a signal.
const LEAVE: Duration = Duration::from_secs(2);

/// The arguments of `hummingbus top`.
#[derive(Args)]
pub struct TopArguments {
    /// The run; needed only if several are alive.
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
pub fn top(arguments: &TopArguments) -> Result<()> {
    if !arguments.once && !std::io::stdout().is_terminal() {
        bail!("standard output is no terminal: `hummingbus top --once` prints what it sees and ends");
    }
    let run = Arc::new(find_live(arguments.run.as_deref())?);
    let source = Source::open(&run)?;
    if !arguments.once {
        return watch(&run, &source);
    }
    let before = source.sample();
    std::thread::sleep(ONCE);
    let view = View::new(&source, &before, &source.sample());
    crate::output::print_text(&if arguments.json {
        serde_json::to_string_pretty(&view)?
    } else {
        cells::page(&view)
    })
}

/// Shows the run until the user leaves.
fn watch(run: &Arc<LiveRun>, source: &Source) -> Result<()> {
    let is_terminated = Arc::new(AtomicBool::new(false));
    let flag = is_terminated.clone();
    // Without it a signal would leave the terminal as it is while we draw. Where the terminal itself is gone, the
    // reader of its keys does not come back: then it is left behind.
    ctrlc::set_handler(move || {
        flag.store(true, Ordering::SeqCst);
        std::thread::sleep(LEAVE);
        ratatui::restore();
        std::process::exit(1);
    })?;
    let mut terminal = ratatui::try_init()?;
    let result = draw_until_left(&mut terminal, Keys::new(run), source, &is_terminated);
    ratatui::try_restore()?;
    result
}

fn draw_until_left(
    terminal: &mut DefaultTerminal,
    mut keys: Keys,
    source: &Source,
    is_terminated: &AtomicBool,
) -> Result<()> {
    let mut looks: VecDeque<Sample> = VecDeque::from([source.sample()]);
    let mut last_look = Instant::now();
    while !keys.has_left() && !is_terminated.load(Ordering::SeqCst) {
        if last_look.elapsed() >= REFRESH {
            last_look = Instant::now();
            looks.push_back(source.sample());
            looks.drain(..looks.len().saturating_sub(LOOKS));
        }
        let view = View::new(source, &looks[0], &looks[looks.len() - 1]);
        let scroll = keys.scroll();
        let screen = Screen { view: &view, notice: keys.notice(), scroll };
        terminal.draw(|frame| frame.render_widget(screen, frame.area()))?;
        if event::poll(REFRESH.saturating_sub(last_look.elapsed()))? {
            keys.press(&event::read()?, &view.status);
        }
    }
    Ok(())
}
