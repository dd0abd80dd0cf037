//! The progress of a run on the terminal.

use crate::output::say;
use bus::control::{Control, monotonic_ns};
use bus::plan::Plan;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

/// Times a second the bar is drawn at most.
const DRAW_HZ: u8 = 10;

/// A progress bar with tick rate and real-time factor.
pub struct Progress {
    bar: ProgressBar,
    tick_s: f64,
}

impl Progress {
    /// A bar for the run of `plan`; hidden where `quiet` or where standard error is no terminal.
    pub fn new(plan: &Plan, quiet: bool) -> Self {
        let target =
            if quiet { ProgressDrawTarget::hidden() } else { ProgressDrawTarget::stderr_with_hz(DRAW_HZ) };
        let bar = ProgressBar::with_draw_target(Some(u64::from(plan.duration_ticks)), target);
        let style = ProgressStyle::with_template("{bar:30} {pos}/{len} ticks  {msg}");
        bar.set_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()));
        Self { bar, tick_s: plan.tick_s() }
    }

    /// Draws how far the run has come.
    pub fn show(&self, control: &Control) {
        let ticks = control.completed_ticks();
        let (start_ns, _) = control.host_span_ns();
        if start_ns > 0 {
            let rate_hz = f64::from(ticks) / (monotonic_ns().saturating_sub(start_ns).max(1) as f64 * 1e-9);
            self.bar.set_message(format!(
                "{:.1} kticks/s, {:.1} × real time",
                rate_hz / 1e3,
                rate_hz * self.tick_s
            ));
        }
        self.bar.set_position(u64::from(ticks));
    }

    /// Says something that the user should know while the run goes on.
    pub fn say(&self, words: &str) {
        self.bar.suspend(|| say(words));
    }

    /// Draws the end and leaves the bar standing.
    pub fn finish(&self, control: &Control) {
        self.bar.set_position(u64::from(control.completed_ticks()));
        self.bar.abandon();
        if !self.bar.is_hidden() {
            // What is printed next starts on a line of its own.
            say("");
        }
    }
}
