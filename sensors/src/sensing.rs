//! A sensor as a component: it measures what its inputs hold, and a channel says when, and what becomes of it.

use crate::channel::{Channel, Tick};
use crate::parameters::Parameters;
use bus::component::{Component, Info, StepError};
use bus::context::{NodeContext, StepContext};
use bus::messages::PlantState;
use bus::ports::{InputPorts, OutputPorts};
use bus::{InputPorts, Message};
use diagnostics::ParameterError;

/// A sensor: all of it that does not change during a run.
pub trait Sensor: Sized {
    /// Its name in manifests, and what it does.
    const INFO: Info;
    /// What the manifest's `parameters` table holds.
    type Parameters: Parameters;
    /// What it reads.
    type Inputs<'a>: InputPorts<'a>;
    /// What it sends.
    type Outputs: OutputPorts;
    /// All that it remembers from tick to tick.
    type State: Message;

    /// Makes the sensor of parameters that are within their ranges.
    ///
    /// # Errors
    /// Parameters that do not go together, or a file that is refused.
    fn new(parameters: Self::Parameters) -> Result<Self, ParameterError>;

    /// The state before the first tick.
    fn initial(&self) -> Self::State;

    /// What is sent at `tick`.
    fn sample(&self, tick: &mut Tick<'_>, state: &mut Self::State, inputs: Self::Inputs<'_>)
    -> Self::Outputs;
}

/// What most sensors read.
#[derive(Debug, InputPorts)]
pub struct TruthInputs<'a> {
    /// The truth.
    pub state: &'a PlantState,
}

/// The component that a sensor is.
///
/// ```
/// use bus::messages::PlantState;
/// use sensors::gps::GpsParams;
/// use sensors::sensing::{Sensing, TruthInputs};
///
/// let mut gps = bus::Harness::<Sensing<GpsParams>>::new(GpsParams::default()).unwrap();
/// let state = PlantState { position: [10.0, -20.0, 5.0].into(), ..Default::default() };
/// let sent: Vec<_> = (0..=80).map(|_| gps.step(TruthInputs { state: &state }).unwrap().gps).collect();
/// assert_eq!((sent[79].valid, sent[80].valid), (0, 1), "its first measurement arrives after 80 ms");
/// assert!((sent[80].position.x - 10.0).abs() < 20.0);
/// ```
#[derive(Debug)]
pub struct Sensing<S> {
    sensor: S,
    channel: Channel,
}

impl<S: Sensor> Component for Sensing<S> {
    const INFO: Info = S::INFO;
    type Parameters = S::Parameters;
    type Inputs<'a> = S::Inputs<'a>;
    type Outputs = S::Outputs;
    type State = S::State;

    fn new(parameters: S::Parameters, context: &NodeContext<'_>) -> Result<Self, ParameterError> {
        parameters.validate()?;
        let channel = Channel::new(&parameters.timing(), context)?;
        Ok(Self { sensor: S::new(parameters)?, channel })
    }

    fn initial(&self) -> S::State {
        self.sensor.initial()
    }

    fn step(
        &mut self,
        context: &StepContext<'_>,
        inputs: S::Inputs<'_>,
        state: &mut S::State,
    ) -> Result<S::Outputs, StepError> {
        Ok(self.sensor.sample(&mut self.channel.at(context.time_ns()), state, inputs))
    }
}
