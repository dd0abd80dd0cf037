//! The progress of a run on the terminal.

use super::output::say;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use runtime::event::RunEvent;

/// Times a second the bar is drawn at most.
const DRAW_HZ: u8 = 10;

/// A progress bar with tick rate and real-time factor.
pub struct Bar(ProgressBar);

impl Bar {
    /// A bar for a run; hidden where `quiet` or where standard error is no terminal.
    pub fn new(quiet: bool) -> Self {
        let target =
            if quiet { ProgressDrawTarget::hidden() } else { ProgressDrawTarget::stderr_with_hz(DRAW_HZ) };
        let bar = ProgressBar::with_draw_target(None, target);
        let style = ProgressStyle::with_template("{bar:30} {pos}/{len} ticks  {msg}");
        bar.set_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()));
        Self(bar)
    }

    /// Draws what a run tells.
    pub fn show(&self, event: RunEvent<'_>) {
        match event {
            RunEvent::Note(text) => self.0.suspend(|| say(text)),
            RunEvent::Progress(progress) => {
                if progress.host_s > 0.0 {
                    let rate_hz = f64::from(progress.ticks) / progress.host_s;
                    let (rate_khz, factor) = (rate_hz / 1e3, rate_hz * progress.tick_s);
                    self.0.set_message(format!("{rate_khz:.1} kticks/s, {factor:.1} × real time"));
                }
                self.0.set_length(u64::from(progress.duration_ticks));
                self.0.set_position(u64::from(progress.ticks));
            }
        }
    }

    /// Leaves the bar standing.
    pub fn finish(&self) {
        self.0.abandon();
        if !self.0.is_hidden() {
            // What is printed next starts on a line of its own.
            say("");
        }
    }
}
