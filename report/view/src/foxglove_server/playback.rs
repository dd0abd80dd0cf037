//! The state of a run as a player shows it, and the requests of a player to the run.

use crate::live::Live;
use bus::plan::{Pace, Plan};
use foxglove::websocket::{
    PlaybackCommand, PlaybackControlRequest, PlaybackState, PlaybackStatus, Status as Notice,
};
use runtime::ctl::protocol::{Answer, Request, State, Status};
use runtime::manifest::PaceSetting;
use std::sync::atomic::{AtomicU64, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, mpsc};
use std::time::Duration;

/// Longest time for which a client waits for the answer to its request; the state of the run follows when it changes.
const ANSWER: Duration = Duration::from_millis(500);
/// Requests to the run that wait for their answers at the same time.
const ASKERS: usize = 8;
/// Speed that players show for a run without a pace.
const FREE_SPEED: f32 = 1.0;
/// Identity of the notice with the run's refusal, which the next request replaces.
const NOTICE: &str = "request";

/// The run as a player sees it.
pub struct Playback {
    tick_ns: u64,
    live: Mutex<Option<Arc<Live>>>,
    /// Time of the newest sample, ns; `u64::MAX` before the first one.
    reached_ns: AtomicU64,
    /// Times that were sent, and the state.
    told: Mutex<Told>,
    refusals: Arc<Mutex<Vec<Notice>>>,
    asking: Arc<AtomicUsize>,
}

#[derive(Default)]
struct Told {
    time_ns: Option<u64>,
    state: Option<(PlaybackStatus, f32)>,
}

impl Playback {
    /// The playback of the run of `plan`, which comes later.
    pub fn new(plan: &Plan) -> Self {
        Self {
            tick_ns: plan.tick_ns,
            live: Mutex::default(),
            reached_ns: AtomicU64::new(u64::MAX),
            told: Mutex::default(),
            refusals: Arc::default(),
            asking: Arc::default(),
        }
    }

    /// Steers `live` from now on; true if it takes the place of another run.
    pub fn steer(&self, live: Arc<Live>) -> bool {
        self.reached_ns.store(u64::MAX, Ordering::Relaxed);
        *locked(&self.told) = Told::default();
        locked(&self.live).replace(live).is_some()
    }

    /// Notes the time of the newest sample.
    pub fn reached(&self, time_ns: u64) {
        self.reached_ns.store(time_ns, Ordering::Relaxed);
    }

    /// The time of the newest sample, if it was not sent before.
    pub fn new_time_ns(&self) -> Option<u64> {
        let now_ns = self.reached_ns.load(Ordering::Relaxed);
        let mut told = locked(&self.told);
        if now_ns == u64::MAX || told.time_ns == Some(now_ns) {
            return None;
        }
        told.time_ns = Some(now_ns);
        Some(now_ns)
    }

    /// The state of the run, if it has changed since it was sent.
    pub fn new_state(&self) -> Option<PlaybackState> {
        let state = self.state();
        let key = (state.status, state.playback_speed);
        let mut told = locked(&self.told);
        if told.state == Some(key) {
            return None;
        }
        told.state = Some(key);
        Some(state)
    }

    /// Reasons for which the run has refused requests since the last call.
    pub fn take_refusals(&self) -> Vec<Notice> {
        std::mem::take(&mut *locked(&self.refusals))
    }

    fn state(&self) -> PlaybackState {
        let live = locked(&self.live).clone();
        let status = live.as_ref().and_then(|live| live.status());
        let reached_ns = self.reached_ns.load(Ordering::Relaxed);
        let tick = status.as_ref().map_or(0, |status| status.tick);
        let current_time = if reached_ns == u64::MAX { u64::from(tick) * self.tick_ns } else { reached_ns };
        let shown_status = match &status {
            Some(status) => shown(status.state),
            None if live.is_some_and(|live| !live.is_live()) => PlaybackStatus::Ended,
            // A run on one thread has no control segment.
            None if reached_ns != u64::MAX => PlaybackStatus::Playing,
            None => PlaybackStatus::Buffering,
        };
        let playback_speed = status.map_or(FREE_SPEED, |status| speed(status.pace));
        PlaybackState {
            status: shown_status,
            current_time,
            playback_speed,
            did_seek: false,
            request_id: None,
        }
    }

    /// Asks the run for what a player requests. Returns the state of the run, at the latest after [`ANSWER`].
    pub fn answer(&self, request: &PlaybackControlRequest) -> Option<PlaybackState> {
        let live = locked(&self.live).clone();
        if let Some(live) = live
            && let Some(status) = live.status()
        {
            match requests(request, &status, self.tick_ns) {
                Ok(requests) => self.ask(live, requests),
                Err(reason) => refuse(&self.refusals, reason),
            }
        } else {
            refuse(
                &self.refusals,
                "the run does not fly yet, or takes no requests (--in-process)".to_owned(),
            );
        }
        let state = self.state();
        locked(&self.told).state = Some((state.status, state.playback_speed));
        Some(state)
    }

    /// Sends `requests` to the run, one after the other, and waits for the answers for a while.
    fn ask(&self, live: Arc<Live>, requests: Vec<Request>) {
        let (refusals, asking) = (self.refusals.clone(), self.asking.clone());
        if asking.fetch_add(1, Ordering::Relaxed) >= ASKERS {
            asking.fetch_sub(1, Ordering::Relaxed);
            return refuse(&refusals, format!("{ASKERS} requests wait for their answers: try again"));
        }
        let (done, answered) = mpsc::channel();
        let ask = move || {
            for request in requests {
                if let Answer::Refused { reason, .. } = live.ask(&request) {
                    refuse(&refusals, reason);
                    break;
                }
            }
            asking.fetch_sub(1, Ordering::Relaxed);
            let _ = done.send(());
        };
        tokio::task::spawn_blocking(ask);
        // The other tasks of this thread go on meanwhile.
        let _ = tokio::task::block_in_place(|| answered.recv_timeout(ANSWER));
    }
}

fn locked<T>(value: &Mutex<T>) -> MutexGuard<'_, T> {
    value.lock().unwrap_or_else(PoisonError::into_inner)
}

fn refuse(refusals: &Mutex<Vec<Notice>>, reason: String) {
    locked(refusals).push(Notice::warning(format!("Refused: {reason}")).with_id(NOTICE));
}

fn shown(state: State) -> PlaybackStatus {
    match state {
        State::Starting => PlaybackStatus::Buffering,
        State::Running | State::Stepping => PlaybackStatus::Playing,
        State::Pausing | State::Paused => PlaybackStatus::Paused,
        State::Stopping | State::Ended => PlaybackStatus::Ended,
    }
}

#[allow(clippy::cast_possible_truncation, reason = "a speed of a few digits")]
fn speed(PaceSetting(pace): PaceSetting) -> f32 {
    match pace {
        Pace::Free => FREE_SPEED,
        Pace::Factor(factor) => factor as f32,
    }
}

/// Requests to a run with this `status` that stand for what a player asked for, in their order.
///
/// # Errors
/// Reason why there are none.
fn requests(asked: &PlaybackControlRequest, status: &Status, tick_ns: u64) -> Result<Vec<Request>, String> {
    let mut requests = Vec::new();
    // A player repeats the speed in every request.
    if asked.playback_speed != speed(status.pace) {
        requests.push(Request::Pace { pace: pace(asked.playback_speed)? });
    }
    let is_held = matches!(status.state, State::Paused | State::Pausing);
    if let Some(seek_ns) = asked.seek_time {
        requests.extend(steps(seek_ns / tick_ns.max(1), status, is_held)?);
    }
    match asked.playback_command {
        PlaybackCommand::Pause if !is_held => requests.push(Request::Pause),
        PlaybackCommand::Play if is_held => requests.push(Request::Resume),
        PlaybackCommand::Pause | PlaybackCommand::Play => {}
    }
    Ok(requests)
}

/// The pace of a speed, with the digits that a person sees.
fn pace(speed: f32) -> Result<PaceSetting, String> {
    let factor = speed.to_string().parse::<f64>().unwrap_or(f64::NAN);
    if factor.is_finite() && factor > 0.0 {
        Ok(PaceSetting(Pace::Factor(factor)))
    } else {
        Err(format!("a speed of {speed} is no pace: expected a number above 0"))
    }
}

/// Steps to `tick`, to which a player jumps.
fn steps(tick: u64, status: &Status, is_held: bool) -> Result<Option<Request>, String> {
    let tick = u32::try_from(tick).unwrap_or(u32::MAX).min(status.end_tick);
    match tick.checked_sub(status.tick) {
        Some(0) => Ok(None),
        Some(ticks) if is_held => Ok(Some(Request::Step { ticks })),
        Some(_) => {
            Err("a run that flies gets there by itself: pause it, and jump then; or choose another speed"
                .to_owned())
        }
        None => Err(format!(
            "a live run does not go back to tick {tick}: `hummingbus ctl rewind` goes back to a checkpoint, and the \
             recording shows any time"
        )),
    }
}

#[cfg(test)]
mod tests {
    use super::requests;
    use bus::plan::Pace;
    use foxglove::websocket::{PlaybackCommand, PlaybackControlRequest};
    use runtime::ctl::protocol::{State, Status};
    use runtime::manifest::PaceSetting;

    const TICK_NS: u64 = 1_000_000;

    fn status(state: State, pace: Pace) -> Status {
        Status {
            run_id: "1-a".to_owned(),
            state,
            tick: 500,
            end_tick: 1000,
            time_s: 0.5,
            pace: PaceSetting(pace),
            missed_deadlines: 0,
            groups: Vec::new(),
        }
    }

    /// The requests as lines of JSON, or the refusal.
    fn lines(
        command: PlaybackCommand,
        speed: f32,
        seek_tick: Option<u64>,
        status: &Status,
    ) -> Result<Vec<String>, String> {
        let asked = PlaybackControlRequest {
            playback_command: command,
            playback_speed: speed,
            seek_time: seek_tick.map(|tick| tick * TICK_NS),
            request_id: "1".to_owned(),
        };
        let requests = requests(&asked, status, TICK_NS)?;
        Ok(requests.iter().map(|request| serde_json::to_string(request).unwrap()).collect())
    }

    #[test]
    fn buttons_of_a_player_pause_resume_and_pace_a_run() {
        let (running, paused) =
            (status(State::Running, Pace::Factor(1.0)), status(State::Paused, Pace::Factor(1.0)));
        let [play, pause] = [PlaybackCommand::Play, PlaybackCommand::Pause];
        assert_eq!(lines(pause, 1.0, None, &running).unwrap(), [r#"{"request":"pause"}"#]);
        assert_eq!(lines(play, 1.0, None, &paused).unwrap(), [r#"{"request":"resume"}"#]);
        assert!(lines(play, 1.0, None, &running).unwrap().is_empty());
        assert!(lines(pause, 1.0, None, &paused).unwrap().is_empty());
        assert_eq!(lines(play, 0.1, None, &running).unwrap(), [r#"{"request":"pace","pace":"0.1"}"#]);
        for speed in [0.0, -1.0, f32::NAN, f32::INFINITY] {
            assert!(lines(play, speed, None, &running).unwrap_err().contains("above 0"), "{speed}");
        }
    }

    #[test]
    fn a_run_without_a_pace_keeps_none_until_another_speed_is_chosen() {
        let held = status(State::Paused, Pace::Free);
        assert_eq!(lines(PlaybackCommand::Play, 1.0, None, &held).unwrap(), [r#"{"request":"resume"}"#]);
        let both = [r#"{"request":"pace","pace":"2"}"#, r#"{"request":"resume"}"#];
        assert_eq!(lines(PlaybackCommand::Play, 2.0, None, &held).unwrap(), both);
    }

    #[test]
    fn a_jump_ahead_of_a_paused_run_is_a_step_and_others_are_refused() {
        let (running, paused) =
            (status(State::Running, Pace::Factor(1.0)), status(State::Paused, Pace::Factor(1.0)));
        let pause = PlaybackCommand::Pause;
        assert_eq!(lines(pause, 1.0, Some(600), &paused).unwrap(), [r#"{"request":"step","ticks":100}"#]);
        assert_eq!(lines(pause, 1.0, Some(1 << 40), &paused).unwrap(), [r#"{"request":"step","ticks":500}"#]);
        assert!(lines(pause, 1.0, Some(500), &paused).unwrap().is_empty());
        assert!(lines(pause, 1.0, Some(499), &paused).unwrap_err().contains("ctl rewind"));
        assert!(lines(pause, 1.0, Some(600), &running).unwrap_err().contains("pause it"));
    }
}
