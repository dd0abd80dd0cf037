//! State machine of the launcher: the states of a run, the events in each, and the actions that follow.
//!
//! Nothing here touches a process: the whole table can be tested.

use crate::program::OnExit;

/// State of a run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum State {
    /// Processes are being started.
    Starting,
    /// Processes connect; tick 0 waits for the last of them.
    Gathering,
    /// Ticks are granted.
    Running,
    /// No more ticks are granted; processes finish those that were, and the recorder its file.
    Draining,
    /// Every process has left.
    Stopped,
    /// The run was aborted.
    Failed,
}

/// Event of a run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Event {
    /// Every process was started.
    Started,
    /// Every process has connected.
    Gathered,
    /// The last tick was granted.
    EndReached,
    /// A stop was requested: Ctrl-C, SIGTERM, `ctl stop`.
    StopRequested,
    /// A stop was requested a second time.
    Interrupted,
    /// A process died, or hung and was killed, before it had done its part.
    Died {
        /// Policy of its manifest.
        policy: OnExit,
        /// True if the policy can be carried out: a standby is there, or a restart makes progress.
        is_possible: bool,
    },
    /// A backup failed before it took over.
    BackupFailed,
    /// A sidecar ended with an error, was killed, or did not get ready.
    SidecarFailed {
        /// Policy of its manifest.
        policy: OnExit,
        /// True if a restart makes progress.
        is_possible: bool,
    },
    /// Every process has ended.
    AllEnded,
}

/// Action of the launcher after an event.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Action {
    /// Nothing.
    Nothing,
    /// Have the clock end the run at the next tick boundary.
    RequestStop,
    /// End the run at once: every wait of every process returns.
    Abort,
    /// Start another process in the place of the one that died.
    Restart,
    /// Have the standby take the place of the one that died.
    Promote,
    /// Take the backup out of the run; the primary flies on.
    Refuse,
}

impl State {
    /// True if the run is over.
    pub fn is_over(self) -> bool {
        matches!(self, Self::Stopped | Self::Failed)
    }

    /// The state after `event`, and the action.
    pub fn after(self, event: Event) -> (Self, Action) {
        use Action::{Abort, Nothing, Promote, Refuse, RequestStop, Restart};
        use State::{Draining, Failed, Gathering, Running, Starting, Stopped};
        match (self, event) {
            (Stopped | Failed, _) => (self, Nothing),
            (_, Event::Interrupted) => (Failed, Abort),
            (_, Event::StopRequested) => (self.at_least_draining(), RequestStop),
            (Starting, Event::Started) => (Gathering, Nothing),
            (Gathering, Event::Gathered) => (Running, Nothing),
            (Running, Event::EndReached) => (Draining, Nothing),
            (Running | Draining, Event::Died { policy: OnExit::Restart, is_possible: true }) => {
                (self, Restart)
            }
            (Running | Draining, Event::Died { policy: OnExit::Standby, is_possible: true }) => {
                (self, Promote)
            }
            (_, Event::Died { .. }) => (Failed, Abort),
            (_, Event::BackupFailed) => (self, Refuse),
            // The sidecar is not needed any more; it may have ended because the nodes have.
            (Draining, Event::SidecarFailed { .. }) => (self, Nothing),
            (_, Event::SidecarFailed { policy: OnExit::Restart, is_possible: true }) => (self, Restart),
            (_, Event::SidecarFailed { policy: OnExit::Ignore, .. }) => (self, Nothing),
            (_, Event::SidecarFailed { .. }) => (Failed, Abort),
            (Starting | Gathering | Running | Draining, Event::AllEnded) => (Stopped, Nothing),
            (Gathering | Running | Draining, Event::Started)
            | (Starting | Running | Draining, Event::Gathered)
            | (Starting | Gathering | Draining, Event::EndReached) => (self, Nothing),
        }
    }

    /// A stop before the first tick still waits for the processes to connect: they end in good order then.
    fn at_least_draining(self) -> Self {
        if self == Self::Running { Self::Draining } else { self }
    }
}

#[cfg(test)]
mod tests {
    use super::{Action, Event, State};
    use crate::program::OnExit;

    const STATES: [State; 6] =
        [State::Starting, State::Gathering, State::Running, State::Draining, State::Stopped, State::Failed];

    fn events() -> Vec<Event> {
        let ends = [OnExit::Stop, OnExit::Restart, OnExit::Standby, OnExit::Ignore]
            .into_iter()
            .flat_map(|policy| [false, true].map(|is_possible| (policy, is_possible)));
        let died = ends.clone().map(|(policy, is_possible)| Event::Died { policy, is_possible });
        let sidecars = ends.map(|(policy, is_possible)| Event::SidecarFailed { policy, is_possible });
        let others = [
            Event::Started,
            Event::Gathered,
            Event::EndReached,
            Event::StopRequested,
            Event::Interrupted,
            Event::BackupFailed,
            Event::AllEnded,
        ];
        died.chain(sidecars).chain(others).collect()
    }

    fn all() -> impl Iterator<Item = (State, Event, State, Action)> {
        STATES.into_iter().flat_map(|state| {
            events().into_iter().map(move |event| {
                let (next, action) = state.after(event);
                (state, event, next, action)
            })
        })
    }

    /// A run only goes forward, and every abort is a failure.
    #[test]
    fn no_event_leads_back() {
        let rank = |state: State| STATES.iter().position(|&other| other == state);
        for (state, event, next, action) in all() {
            assert!(rank(next) >= rank(state), "{state:?} {event:?} leads back to {next:?}");
            assert_eq!(
                next == State::Failed && !state.is_over(),
                action == Action::Abort,
                "{state:?} {event:?}"
            );
        }
    }

    #[test]
    fn what_is_over_stays_as_it_is() {
        for (state, event, next, action) in all().filter(|(state, ..)| state.is_over()) {
            assert_eq!((next, action), (state, Action::Nothing), "{event:?}");
        }
    }

    #[test]
    fn a_death_is_answered_by_its_policy_or_ends_the_run() {
        for (state, event, next, action) in all() {
            let Event::Died { policy, is_possible } = event else { continue };
            let flies = matches!(state, State::Running | State::Draining);
            let expected = match policy {
                _ if state.is_over() => Action::Nothing,
                OnExit::Restart if flies && is_possible => Action::Restart,
                OnExit::Standby if flies && is_possible => Action::Promote,
                _ => Action::Abort,
            };
            assert_eq!(action, expected, "{state:?} {event:?}");
            assert_eq!(next == state, action != Action::Abort, "{state:?} {event:?}");
        }
    }

    #[test]
    fn a_sidecar_that_fails_ends_the_run_unless_its_manifest_says_otherwise() {
        for (state, event, next, action) in all() {
            let Event::SidecarFailed { policy, is_possible } = event else { continue };
            let expected = match policy {
                _ if state.is_over() || state == State::Draining => Action::Nothing,
                OnExit::Ignore => Action::Nothing,
                OnExit::Restart if is_possible => Action::Restart,
                _ => Action::Abort,
            };
            assert_eq!(action, expected, "{state:?} {event:?}");
            assert_eq!(next == state, action != Action::Abort, "{state:?} {event:?}");
        }
    }

    #[test]
    fn every_state_can_reach_an_end_and_only_two_are_ends() {
        for state in STATES {
            let ends = events().into_iter().any(|event| state.after(event).0.is_over());
            assert!(ends, "{state:?}");
            let stays = events().into_iter().all(|event| state.after(event).0 == state);
            assert_eq!(stays, state.is_over(), "{state:?}");
        }
    }

    #[test]
    fn a_run_goes_through_its_states_in_order() {
        let path = [Event::Started, Event::Gathered, Event::EndReached, Event::AllEnded];
        let mut state = State::Starting;
        let states: Vec<State> = path
            .into_iter()
            .map(|event| {
                state = state.after(event).0;
                state
            })
            .collect();
        assert_eq!(states, [State::Gathering, State::Running, State::Draining, State::Stopped]);
    }

    #[test]
    fn a_stop_is_asked_of_the_clock_and_drains_what_flies() {
        for (state, event, next, action) in all().filter(|(_, event, ..)| *event == Event::StopRequested) {
            let expected = if state.is_over() { Action::Nothing } else { Action::RequestStop };
            assert_eq!(action, expected, "{state:?} {event:?}");
            let drains = matches!(state, State::Running | State::Draining);
            assert_eq!(next == State::Draining, drains, "{state:?}");
        }
    }

    #[test]
    fn a_failed_backup_never_ends_the_run() {
        for (state, _, next, action) in all().filter(|(_, event, ..)| *event == Event::BackupFailed) {
            assert_eq!(next, state);
            assert_eq!(action == Action::Refuse, !state.is_over());
        }
    }
}
