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
/// Time between two lines about flights.
const FLIGHTS_PERIOD: Duration = Duration::from_secs(30);
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
        let _ = write!(out, "{:.1}/s", rate_hz(state.pos().saturating_sub(start), state.elapsed()));
    };
    let left = move |state: &ProgressState, out: &mut dyn Write| {
        let rate_hz = rate_hz(state.pos().saturating_sub(start), state.elapsed());
        let steps = state.len().unwrap_or(0).saturating_sub(state.pos());
        let _ = write!(out, "{}", time_of(steps, rate_hz));
    };
    let bar = bar.with_position(start);
    bar.set_style(bar.style().with_key("rate", rate).with_key("left", left));
    bar.set_length(length);
    bar
}

/// Steps a second, if `elapsed` passed in so many steps.
fn rate_hz(steps: u64, elapsed: Duration) -> f64 {
    let elapsed_s = elapsed.as_secs_f64();
    if elapsed_s > 0.0 { steps as f64 / elapsed_s } else { 0.0 }
}

/// Time that so many steps take, as text; a dash if the rate does not say.
fn time_of(steps: u64, rate_hz: f64) -> String {
    let time = Duration::try_from_secs_f64(steps as f64 / rate_hz);
    time.map_or_else(|_| "–".to_owned(), |time| format!("{:#}", HumanDuration(time)))
}

/// Progress of flights as plain lines, where no terminal draws a bar.
pub struct FlightLines {
    start: u64,
    /// Time of the last line since the beginning.
    told: Duration,
}

impl FlightLines {
    /// Lines about flights of which the first `start` were flown earlier.
    pub const fn new(start: u64) -> Self {
        Self { start, told: Duration::ZERO }
    }

    /// The line that is due `elapsed` after the beginning, when `flown` of `planned` flights were flown; `None` if the last line is less than 30 s old.
    pub fn due(&mut self, flown: u64, planned: u64, elapsed: Duration) -> Option<String> {
        if elapsed < self.told + FLIGHTS_PERIOD {
            return None;
        }
        self.told = elapsed;
        let rate_hz = rate_hz(flown.saturating_sub(self.start), elapsed);
        let left = time_of(planned.saturating_sub(flown), rate_hz);
        Some(format!("{flown} of {planned} flights: {rate_hz:.1}/s, {left} left"))
    }
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
    use super::{FlightLines, Lines, bar_from, rate_hz};
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
            let found = rate_hz(state.pos() - 900, state.elapsed());
            assert!((found - 0.5).abs() < 0.01, "{found}");
        });
    }

    #[test]
    fn flights_that_no_terminal_shows_have_a_line_twice_a_minute() {
        let mut lines = FlightLines::new(400);
        let mut due = |flown, s| lines.due(flown, 1000, Duration::from_secs(s));
        assert_eq!(due(401, 1), None);
        assert_eq!(due(430, 30).as_deref(), Some("430 of 1000 flights: 1.0/s, 10m left"));
        assert_eq!(due(445, 59), None);
        // A pause of the cluster.
        assert_eq!(due(520, 240).as_deref(), Some("520 of 1000 flights: 0.5/s, 16m left"));
        assert_eq!(due(521, 269), None);
        let mut none = FlightLines::new(0);
        assert_eq!(
            none.due(0, 10, Duration::from_secs(31)).as_deref(),
            Some("0 of 10 flights: 0.0/s, – left")
        );
    }
}
