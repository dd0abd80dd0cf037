//! The component that holds a firmware.

use crate::autopilot::{Autopilot, Sensed};
use bus::announcement::Announcement;
use bus::component::{Component, Info, State, StateError, StepError, Transfer};
use bus::context::{NodeContext, StepContext};
use bus::messages::{Imu, MotorCommand, RcChannels, StateEstimate};
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
pub struct BridgeState<L>(Option<L>);

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
        BridgeState(None)
    }

    fn connected(
        &self,
        _: &[(&str, &Announcement)],
        BridgeState(link): &mut Self::State,
    ) -> Result<(), StepError> {
        *link = Some(self.0.boot()?);
        Ok(())
    }

    fn step(
        &self,
        context: &StepContext<'_>,
        inputs: Inputs<'_>,
        BridgeState(link): &mut Self::State,
    ) -> Result<Outputs, StepError> {
        let Some(link) = link else { return Err("the firmware was not started".into()) };
        let Inputs { imu, estimate, rc } = inputs;
        let sensed = Sensed { time_s: context.time_s(), imu, estimate, rc };
        let throttles = self.0.exchange(link, &sensed)?;
        let range = &self.0.vehicle().command;
        let counts = throttles.map(|throttle| range.min + throttle.clamp(0.0, 1.0) * (range.max - range.min));
        Ok(Outputs { command: MotorCommand { command: counts, ..Default::default() } })
    }

    fn finish(&self, BridgeState(link): &mut Self::State) -> Result<(), StepError> {
        drop(link.take());
        Ok(())
    }
}
