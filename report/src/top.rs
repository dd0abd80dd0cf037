//! A live run in the terminal, steered from the keyboard.
//!
//! - `view`: a run as shown, for screen and paper
//! - `sample`: the state of a run at a moment, and the rates between two moments
//! - `screen`: the drawing of a view
//! - `keys`: actions of the keys
//! - `vehicles`: heights and attitudes of the vehicles
#![allow(clippy::disallowed_methods, reason = "rates are per host time")]

mod keys;
mod sample;
mod screen;
mod vehicles;
mod view;

pub use view::{ProcessRow, VehicleRow, View};

use diagnostics::Error;
use keys::Keys;
use ratatui::DefaultTerminal;
use ratatui::crossterm::event;
use runtime::run_dir::LiveRun;
use sample::{Sample, Source};
use screen::Screen;
use std::collections::VecDeque;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// Host time between two looks.
const REFRESH: Duration = Duration::from_millis(250);
/// Looks over which rates, shares and percentiles are computed: about the last second.
const LOOKS: usize = 5;
/// Host time over which a [`Watcher`] computes them.
const SPAN: Duration = Duration::from_secs(1);
/// Host time between the two looks of `--once`.
const ONCE: Duration = Duration::from_millis(500);

/// Looks at `run` for half a second.
///
/// # Errors
/// If it has ended.
pub fn look(run: &Arc<LiveRun>) -> Result<View, Error> {
    let mut source = Source::open(run)?;
    let before = source.sample();
    std::thread::sleep(ONCE);
    let after = source.sample();
    Ok(source.between(&before, &after))
}

/// Looks at a run again and again, at any times.
pub struct Watcher {
    source: Source,
    looks: VecDeque<(Instant, Sample)>,
}

impl Watcher {
    /// Opens `run`, which may just be starting.
    ///
    /// # Errors
    /// If it has ended.
    pub fn open(run: &Arc<LiveRun>) -> Result<Self, Error> {
        Ok(Self { source: Source::open(run)?, looks: VecDeque::new() })
    }

    /// State of the run now, and its rates over about the last second; without rates at the first look.
    pub fn look(&mut self) -> View {
        let (now, newest) = (Instant::now(), self.source.sample());
        // A look from before a long pause says nothing about the last second.
        if self.looks.back().is_some_and(|(at, _)| now.duration_since(*at) >= 2 * SPAN) {
            self.looks.clear();
        }
        // The oldest look that stays is one from a second ago, or the one before it.
        while self.looks.get(1).is_some_and(|(at, _)| now.duration_since(*at) >= SPAN) {
            self.looks.pop_front();
        }
        let view = self.source.between(self.looks.front().map_or(&newest, |(_, oldest)| oldest), &newest);
        if self.looks.back().is_none_or(|(at, _)| now.duration_since(*at) >= REFRESH) {
            self.looks.push_back((now, newest));
        }
        view
    }
}

/// Shows `run` in the terminal and lets the keys steer it until the user leaves, or `is_terminated` becomes true.
///
/// # Errors
/// If the run has ended, or the terminal cannot be drawn on.
pub fn watch(run: &Arc<LiveRun>, is_terminated: &AtomicBool) -> Result<(), Error> {
    let mut source = Source::open(run)?;
    let mut terminal = ratatui::try_init()?;
    let result = draw_until_left(&mut terminal, Keys::new(run), &mut source, is_terminated);
    ratatui::try_restore()?;
    Ok(result?)
}

/// Restores the terminal as it was before [`watch`], for code that ends the process meanwhile.
pub fn restore_terminal() {
    ratatui::restore();
}

fn draw_until_left(
    terminal: &mut DefaultTerminal,
    mut keys: Keys,
    source: &mut Source,
    is_terminated: &AtomicBool,
) -> anyhow::Result<()> {
    let mut looks: VecDeque<Sample> = VecDeque::from([source.sample()]);
    let mut last_look = Instant::now();
    while !keys.has_left && !is_terminated.load(Ordering::SeqCst) {
        if last_look.elapsed() >= REFRESH {
            last_look = Instant::now();
            looks.push_back(source.sample());
            looks.drain(..looks.len().saturating_sub(LOOKS));
        }
        let view = source.between(&looks[0], &looks[looks.len() - 1]);
        let scroll = keys.scroll;
        let screen = Screen { view: &view, notice: keys.notice(), scroll };
        terminal.draw(|frame| frame.render_widget(screen, frame.area()))?;
        if event::poll(REFRESH.saturating_sub(last_look.elapsed()))? {
            keys.press(&event::read()?, &view.status);
        }
    }
    Ok(())
}
