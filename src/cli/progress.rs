//! Progress of a command on the terminal.

use super::output::say;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use runtime::event::RunEvent;

/// Times a second a bar is drawn at most.
const DRAW_HZ: u8 = 10;
/// Template of the bar of a run.
pub const RUN: &str = "{bar:30} {pos}/{len} ticks  {msg}";

/// A bar like `template`; hidden if `is_quiet`, or if standard error is not a terminal.
pub fn bar(template: &str, is_quiet: bool) -> ProgressBar {
    let target =
        if is_quiet { ProgressDrawTarget::hidden() } else { ProgressDrawTarget::stderr_with_hz(DRAW_HZ) };
    let style = ProgressStyle::with_template(template).unwrap_or_else(|_| ProgressStyle::default_bar());
    ProgressBar::with_draw_target(None, target).with_style(style)
}

/// Shows an event of a run: its ticks, their rate and the real-time factor.
pub fn show(bar: &ProgressBar, event: RunEvent<'_>) {
    match event {
        RunEvent::Note(text) => bar.suspend(|| say(text)),
        RunEvent::Progress(progress) => {
            if progress.host_s > 0.0 {
                let rate_hz = f64::from(progress.ticks) / progress.host_s;
                let (rate_khz, factor) = (rate_hz / 1e3, rate_hz * progress.tick_s);
                bar.set_message(format!("{rate_khz:.1} kticks/s, {factor:.1} × real time"));
            }
            bar.set_length(u64::from(progress.duration_ticks));
            bar.set_position(u64::from(progress.ticks));
        }
    }
}

/// Leaves the bar on the terminal.
pub fn finish(bar: &ProgressBar) {
    bar.abandon();
    if !bar.is_hidden() {
        // The next output starts on a line of its own.
        say("");
    }
}
