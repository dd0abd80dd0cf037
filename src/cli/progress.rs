//! Progress of a command on the terminal.

use super::output::say;
use indicatif::{HumanDuration, ProgressBar, ProgressDrawTarget, ProgressState, ProgressStyle};
use runtime::event::RunEvent;
use std::fmt::Write;
use std::sync::{Mutex, PoisonError};
use std::time::Duration;

/// Times a second a bar is drawn at most.
const DRAW_HZ: u8 = 10;
/// Time between two lines about one stage.
const LINE_PERIOD: Duration = Duration::from_secs(10);
/// Template of the bar of a run.
pub const RUN: &str = "{bar:30} {pos}/{len} ticks  {msg}";

/// A bar like `template`; hidden if `is_quiet`, or if standard error is not a terminal.
pub fn bar(template: &str, is_quiet: bool) -> ProgressBar {
    let target =
        if is_quiet { ProgressDrawTarget::hidden() } else { ProgressDrawTarget::stderr_with_hz(DRAW_HZ) };
    let style = ProgressStyle::with_template(template).unwrap_or_else(|_| ProgressStyle::default_bar());
    ProgressBar::with_draw_target(None, target).with_style(style)
}

/// A bar like `template` that begins at `start` of `length`: its keys `rate` and `left` tell of the steps from there on, since
/// earlier ones took time that nobody measured.
pub fn bar_from(template: &str, start: u64, length: u64, is_quiet: bool) -> ProgressBar {
    let bar = bar(template, is_quiet);
    let rate = move |state: &ProgressState, out: &mut dyn Write| {
        // A bar that cannot be drawn is left out.
        let _ = write!(out, "{:.1}/s", rate_hz(state, start));
    };
    let left = move |state: &ProgressState, out: &mut dyn Write| {
        let rate_hz = rate_hz(state, start);
        let steps = state.len().unwrap_or(0).saturating_sub(state.pos());
        let _ = match Duration::try_from_secs_f64(steps as f64 / rate_hz) {
            Ok(left) => write!(out, "{:#}", HumanDuration(left)),
            Err(_) => write!(out, "–"),
        };
    };
    let bar = bar.with_position(start);
    bar.set_style(bar.style().with_key("rate", rate).with_key("left", left));
    bar.set_length(length);
    bar
}

/// Steps a second since the bar was made, at `start`.
fn rate_hz(state: &ProgressState, start: u64) -> f64 {
    let elapsed_s = state.elapsed().as_secs_f64();
    if elapsed_s > 0.0 { state.pos().saturating_sub(start) as f64 / elapsed_s } else { 0.0 }
}

/// Progress as lines, where no terminal draws a bar: each stage is told once, and its count now and then.
#[derive(Default)]
pub struct Lines(Mutex<Option<(String, Duration)>>);

impl Lines {
    /// True if `text` is to be told, `elapsed` after the beginning: it is of another stage than the last line, or that is old. The stage is
    /// what stands in front of the last colon.
    pub fn is_due(&self, text: &str, elapsed: Duration) -> bool {
        let stage = text.rsplit_once(": ").map_or(text, |(stage, _)| stage);
        let mut last = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let is_due = last.as_ref().is_none_or(|(of, at)| of != stage || elapsed >= *at + LINE_PERIOD);
        if is_due {
            *last = Some((stage.to_owned(), elapsed));
        }
        is_due
    }
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

#[cfg(test)]
mod tests {
    use super::{Lines, bar_from, rate_hz};
    use std::time::Duration;

    #[test]
    fn a_stage_is_told_once_and_its_count_now_and_then() {
        let lines = Lines::default();
        let told = |text: &str, s: u64| lines.is_due(text, Duration::from_secs(s));
        assert!(told("round 1: 23 candidates", 0) && told("round 2: 22 candidates", 1));
        assert!(told("next flight: 1 of 39 manoeuvres", 2) && !told("next flight: 2 of 39 manoeuvres", 3));
        assert!(!told("next flight: 9 of 39 manoeuvres", 11) && told("next flight: 10 of 39 manoeuvres", 12));
        assert!(told("next flight, limits raised: 1 of 39 manoeuvres", 13));
        assert!(told("refinement", 14) && !told("refinement", 15));
    }

    #[test]
    fn the_rate_of_a_continued_campaign_is_that_of_its_own_flights() {
        let bar = bar_from("{rate} {left}", 900, 1000, true).with_elapsed(Duration::from_secs(10));
        bar.inc(5);
        bar.update(|state| {
            let found = rate_hz(state, 900);
            assert!((found - 0.5).abs() < 0.01, "{found}");
        });
    }
}
