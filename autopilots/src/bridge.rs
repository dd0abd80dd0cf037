//! The component that holds a firmware.

use crate::autopilot::{Autopilot, Sensed};
use bus::announcement::Announcement;
use bus::component::{Component, Info, State, StateError, StepError, Transfer};
use bus::context::{NodeContext, StepContext};
use bus::messages::{Imu, MotorCommand, RcChannels, StateEstimate, Time};
use bus::{InputPorts, OutputPorts, ParameterError};

/// Inputs of a firmware.
#[derive(Debug, InputPorts)]
pub struct Inputs<'a> {
    /// Accelerometer and gyroscope.
    pub imu: &'a Imu,
    /// Place, motion and attitude, of which the firmware's other sensors are made: GPS, barometer, compass.
    pub estimate: &'a StateEstimate,
    /// The pilot's remote control.
    pub rc: &'a RcChannels,
}

/// Outputs of a firmware.
#[derive(Debug, OutputPorts)]
pub struct Outputs {
    /// To the motors.
    pub command: MotorCommand,
}

/// A firmware as a component: it boots before tick 0, and each step is an exchange with it.
///
/// ```no_run
/// let parameters = serde_json::json!({ "vehicle": "vehicles/hummingbird.toml", "firmware": "betaflight_SITL.elf" });
/// let mut betaflight = bus::Harness::<autopilots::Betaflight>::from_json(&parameters)?;
/// # Ok::<(), bus::ParameterError>(())
/// ```
#[derive(Debug)]
pub struct Bridge<A>(A);

/// The firmware's process, once it runs: what a firmware remembers is its own.
pub struct BridgeState<L> {
    link: Option<L>,
    /// Stamp of the channels of the step before.
    rc_stamp: Option<Time>,
}

impl<L> BridgeState<L> {
    /// True if the channels with `stamp` are others than those of the step before; notes them. A link gives those that were never sent a
    /// stamp before tick 0.
    fn is_rc_new(&mut self, stamp: Time) -> bool {
        let before = self.rc_stamp.replace(stamp);
        stamp.sec >= 0 && before != Some(stamp)
    }
}

impl<L: Send + 'static> State for BridgeState<L> {
    const TRANSFER: Transfer = Transfer::External("a firmware");

    fn size(&self) -> usize {
        0
    }

    fn save(&self, _: &mut [u8]) {}

    fn load(&mut self, _: &[u8]) -> Result<(), StateError> {
        let reason = "a firmware does not tell what it remembers".to_owned();
        Err(StateError::Contents { type_name: "a firmware", reason })
    }
}

impl<A: Autopilot> Component for Bridge<A> {
    const INFO: Info = A::INFO;
    type Parameters = A::Parameters;
    type Inputs<'a> = Inputs<'a>;
    type Outputs = Outputs;
    type State = BridgeState<A::Link>;

    fn new(parameters: A::Parameters, context: &NodeContext<'_>) -> Result<Self, ParameterError> {
        A::new(parameters, context).map(Self)
    }

    fn initial(&self) -> Self::State {
        BridgeState { link: None, rc_stamp: None }
    }

    fn connected(&self, _: &[(&str, &Announcement)], state: &mut Self::State) -> Result<(), StepError> {
        state.link = Some(self.0.boot()?);
        Ok(())
    }

    fn step(
        &self,
        context: &StepContext<'_>,
        inputs: Inputs<'_>,
        state: &mut Self::State,
    ) -> Result<Outputs, StepError> {
        let Inputs { imu, estimate, rc } = inputs;
        let is_rc_new = state.is_rc_new(rc.stamp);
        let Some(link) = &mut state.link else { return Err("the firmware was not started".into()) };
        let estimate = &self.0.origin().east_north_up(estimate);
        let sensed = Sensed { time_s: context.time_s(), imu, estimate, rc, is_rc_new };
        let throttles = self.0.exchange(link, &sensed)?;
        let range = &self.0.vehicle().command;
        let counts = throttles.map(|throttle| range.min + throttle.clamp(0.0, 1.0) * (range.max - range.min));
        Ok(Outputs { command: MotorCommand { command: counts, ..Default::default() } })
    }

    fn finish(&self, state: &mut Self::State) -> Result<(), StepError> {
        drop(state.link.take());
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn channels_are_new_once_and_never_before_they_were_sent() {
        let mut state = BridgeState::<()> { link: None, rc_stamp: None };
        let stamps = [(-1, 0), (-1, 0), (0, 0), (0, 0), (0, 20), (1, 20), (1, 20)];
        let are_new = stamps.map(|(sec, nanosec)| state.is_rc_new(Time { sec, nanosec }));
        assert_eq!(are_new, [false, false, true, false, true, true, false]);
    }
}
