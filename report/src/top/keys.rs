//! Actions of the keys: requests to the run, sent beside the drawing, since an answer may take long.

use bus::plan::Pace;
use ratatui::crossterm::event::{Event, KeyCode, KeyModifiers};
use runtime::ctl::client;
use runtime::ctl::protocol::{Answer, Request, State, Status};
use runtime::manifest::PaceSetting;
use runtime::run_dir::LiveRun;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, Sender, channel};

const STOP_QUESTION: &str = "stop the run? y / n";

/// The keyboard of `top`, and the results of the keys.
pub struct Keys {
    run: Arc<LiveRun>,
    answers: Receiver<String>,
    sender: Sender<String>,
    notice: String,
    asks_to_stop: bool,
    /// Rows that are scrolled over.
    pub scroll: usize,
    /// True if the user has left.
    pub has_left: bool,
}

impl Keys {
    /// The keyboard that steers `run`.
    pub fn new(run: &Arc<LiveRun>) -> Self {
        let (sender, answers) = channel();
        let (run, notice) = (run.clone(), String::new());
        Self { run, answers, sender, notice, asks_to_stop: false, scroll: 0, has_left: false }
    }

    /// The newest notice for the user.
    pub fn notice(&mut self) -> &str {
        if let Some(answer) = self.answers.try_iter().last().filter(|_| !self.asks_to_stop) {
            self.notice = answer;
        }
        &self.notice
    }

    /// Carries out `event` on a run whose state is `status`.
    pub fn press(&mut self, event: &Event, status: &Status) {
        let Event::Key(key) = event else { return };
        if !key.is_press() {
            return;
        }
        if std::mem::take(&mut self.asks_to_stop) {
            self.notice.clear();
            if matches!(key.code, KeyCode::Char('y' | 'Y')) {
                return self.ask(Request::Stop);
            }
        }
        let is_paused = matches!(status.state, State::Paused | State::Pausing);
        match key.code {
            KeyCode::Char('c') if key.modifiers.contains(KeyModifiers::CONTROL) => self.has_left = true,
            _ if key.modifiers.contains(KeyModifiers::CONTROL) => {}
            KeyCode::Char('q') | KeyCode::Esc => self.has_left = true,
            KeyCode::Up => self.scroll = self.scroll.saturating_sub(1),
            KeyCode::Down => self.scroll = self.scroll.saturating_add(1),
            KeyCode::Char(_) if status.state == State::Ended => self.tell("the run has ended; q leaves"),
            KeyCode::Char(' ') => self.ask(if is_paused { Request::Resume } else { Request::Pause }),
            KeyCode::Char('s') => self.ask(Request::Step { ticks: 1 }),
            KeyCode::Char('S') => self.ask(Request::Step { ticks: 100 }),
            KeyCode::Char('f') => self.pace(Pace::Free),
            KeyCode::Char('r') => self.pace(Pace::Factor(1.0)),
            KeyCode::Char('+' | '=') => match status.pace.0 {
                Pace::Factor(factor) => self.pace(Pace::Factor(factor * 2.0)),
                Pace::Free => self.tell("it runs free, as fast as it can; r paces it"),
            },
            KeyCode::Char('-') => match status.pace.0 {
                Pace::Factor(factor) => self.pace(Pace::Factor(factor * 0.5)),
                // A free run goes as fast as it can: slower is real time.
                Pace::Free => self.pace(Pace::Factor(1.0)),
            },
            KeyCode::Char('x') => {
                self.asks_to_stop = true;
                self.tell(STOP_QUESTION);
            }
            _ => {}
        }
    }

    fn tell(&mut self, text: &str) {
        text.clone_into(&mut self.notice);
    }

    fn pace(&self, pace: Pace) {
        self.ask(Request::Pace { pace: PaceSetting(pace) });
    }

    /// Asks the run in a thread, so that the next key can overtake a long step.
    fn ask(&self, request: Request) {
        let (run, sender) = (self.run.clone(), self.sender.clone());
        std::thread::spawn(move || {
            let text = match client::ask(&run, &request) {
                Ok(Answer::Done { text, .. }) => text,
                Ok(Answer::Refused { reason, .. }) => reason,
                Ok(Answer::Status(status)) => status.to_string(),
                Err(error) => error.with_causes(),
            };
            let _ = sender.send(text);
        });
    }
}
