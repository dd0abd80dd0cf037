//! What the keys do: requests to the run, sent beside the drawing, since an answer may take long.

use bus::plan::Pace;
use ratatui::crossterm::event::{Event, KeyCode, KeyEvent, KeyModifiers};
use runtime::ctl::client;
use runtime::ctl::protocol::{Answer, Request, State, Status};
use runtime::manifest::PaceSetting;
use runtime::run_dir::LiveRun;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, Sender, channel};

const STOP_QUESTION: &str = "stop the run? y / n";

/// The keyboard of `top`, and what came of the keys.
pub struct Keys {
    run: Arc<LiveRun>,
    answers: Receiver<String>,
    sender: Sender<String>,
    notice: String,
    asks_to_stop: bool,
    /// Rows that are scrolled over.
    pub scroll: usize,
    /// Whether the user has left.
    pub has_left: bool,
}

/// What a key asks for.
enum Action {
    Ask(Request),
    Tell(&'static str),
    AskToStop,
    Scroll(isize),
    Leave,
    Nothing,
}

impl Keys {
    /// The keyboard that steers `run`.
    pub fn new(run: &Arc<LiveRun>) -> Self {
        let (sender, answers) = channel();
        let (run, notice) = (run.clone(), String::new());
        Self { run, answers, sender, notice, asks_to_stop: false, scroll: 0, has_left: false }
    }

    /// The newest thing to tell the user.
    pub fn notice(&mut self) -> &str {
        if let Some(answer) = self.answers.try_iter().last().filter(|_| !self.asks_to_stop) {
            self.notice = answer;
        }
        &self.notice
    }

    /// Does what `event` asks for of a run that is as `status` says.
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
        match action(*key, status) {
            Action::Ask(request) => self.ask(request),
            Action::Tell(text) => text.clone_into(&mut self.notice),
            Action::AskToStop => {
                self.asks_to_stop = true;
                STOP_QUESTION.clone_into(&mut self.notice);
            }
            Action::Scroll(rows) => self.scroll = self.scroll.saturating_add_signed(rows),
            Action::Leave => self.has_left = true,
            Action::Nothing => {}
        }
    }

    /// Asks the run in a thread, so that the next key can overtake a long step.
    fn ask(&self, request: Request) {
        let (run, sender) = (self.run.clone(), self.sender.clone());
        std::thread::spawn(move || {
            let text = match client::ask(&run, &request) {
                Ok(Answer::Done { text, .. }) => text,
                Ok(Answer::Refused { reason }) => reason,
                Ok(Answer::Status(status)) => status.to_string(),
                Err(error) => format!("{error:#}"),
            };
            let _ = sender.send(text);
        });
    }
}

fn action(key: KeyEvent, status: &Status) -> Action {
    if key.modifiers.contains(KeyModifiers::CONTROL) {
        return if key.code == KeyCode::Char('c') { Action::Leave } else { Action::Nothing };
    }
    match key.code {
        KeyCode::Char('q') | KeyCode::Esc => Action::Leave,
        KeyCode::Up => Action::Scroll(-1),
        KeyCode::Down => Action::Scroll(1),
        KeyCode::Char(_) if status.state == State::Ended => Action::Tell("the run has ended; q leaves"),
        KeyCode::Char(' ') => Action::Ask(match status.state {
            State::Paused | State::Pausing => Request::Resume,
            _ => Request::Pause,
        }),
        KeyCode::Char('s') => Action::Ask(Request::Step { ticks: 1 }),
        KeyCode::Char('S') => Action::Ask(Request::Step { ticks: 100 }),
        KeyCode::Char('f') => Action::Ask(Request::Pace { pace: PaceSetting(Pace::Free) }),
        KeyCode::Char('r') => pace(1.0),
        KeyCode::Char('+' | '=') => speed(status.pace.0, 2.0),
        KeyCode::Char('-') => speed(status.pace.0, 0.5),
        KeyCode::Char('x') => Action::AskToStop,
        _ => Action::Nothing,
    }
}

fn pace(factor: f64) -> Action {
    Action::Ask(Request::Pace { pace: PaceSetting(Pace::Factor(factor)) })
}

/// A free run goes as fast as it can: slower is real time.
fn speed(now: Pace, times: f64) -> Action {
    match now {
        Pace::Factor(factor) => pace(factor * times),
        Pace::Free if times < 1.0 => pace(1.0),
        Pace::Free => Action::Tell("it runs free, as fast as it can; r paces it"),
    }
}
