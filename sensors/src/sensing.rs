//! A sensor as a component: it measures its inputs, and a channel has the times, delays and losses of measurements.

use crate::channel::{Chance, Channel, Queued, Remembered};
use crate::parameters::Timed;
use component::context::{NodeContext, StepContext};
use component::messages::{Barometer, Battery, Gps, Magnetometer, Mocap, PlantState, Ranges, RotorSpeeds};
use component::ports::{InputPorts, OutputPorts};
use component::sample_ticks::SampleTicks;
use component::{Component, Info, InputPorts, Message, StepError};
use diagnostics::ParameterError;
use inputs::InputFiles;

/// Declares the state of a sensor, `type_name` on the bus, and its output: the message at the port that is named.
macro_rules! sensor {
    (
        pub struct $State:ident as $type_name:literal sends $port:ident: $Message:ident {
            $($(#[$field_meta:meta])* $field:ident: $type:ty,)*
        }
    ) => {
        /// State of the sensor.
        #[derive(Debug, Clone, Copy, Default, component::Message)]
        #[repr(C)]
        #[message(type_name = $type_name, role = "state")]
        pub struct $State {
            /// Measurements that are under way.
            channel: $crate::channel::ChannelState,
            $($(#[$field_meta])* $field: $type,)*
        }

        impl $crate::channel::Remembered for $State {
            type Measurement = $Message;

            fn channel(&mut self) -> &mut $crate::channel::ChannelState {
                &mut self.channel
            }
        }

        /// Outputs of the sensor.
        #[derive(Debug, component::OutputPorts)]
        pub struct Outputs {
            /// The measurement that arrived last.
            pub $port: $Message,
        }

        impl From<$Message> for Outputs {
            fn from($port: $Message) -> Self {
                Self { $port }
            }
        }
    };
}

/// Messages that sensors send.
pub trait Measurement: Copy {
    /// Returns the message that is sent after `last` for what was `measured`; `None` means that there was
    /// nothing to measure.
    fn sent(measured: Option<Self>, last: &Self, chance: &mut Chance<'_>) -> Self;
}

/// Measurements that are lost as a whole: then the one before is sent again, not valid.
macro_rules! lost_as_a_whole {
    ($($Message:ident),*) => {$(
        impl Measurement for $Message {
            fn sent(measured: Option<Self>, last: &Self, chance: &mut Chance<'_>) -> Self {
                match measured {
                    Some(measured) if !chance.is_lost(0) => {
                        Self { measured_ns: chance.now_ns, valid: 1, ..measured }
                    }
                    _ => Self { valid: 0, ..*last },
                }
            }
        }
    )*};
}

lost_as_a_whole!(Barometer, Battery, Gps, Magnetometer, Mocap, RotorSpeeds);

/// Each beam is lost on its own.
impl Measurement for Ranges {
    fn sent(measured: Option<Self>, last: &Self, chance: &mut Chance<'_>) -> Self {
        Self { measured_ns: chance.now_ns, ..measured.unwrap_or(*last) }
    }
}

/// A sensor, with everything that does not change during a run.
pub trait Sensor: Sized + Send {
    /// Its name in manifests, and its description.
    const INFO: Info;
    /// Parameters in the manifest.
    type Parameters: Timed;
    /// Inputs.
    type Inputs<'a>: InputPorts<'a>;
    /// Outputs.
    type Outputs: OutputPorts + From<Sent<Self>>;
    /// State from tick to tick.
    type State: Message + Default + Remembered<Measurement: Measurement + Message + Default>;

    /// Makes the sensor of parameters that are within their ranges, and of the files that they name.
    ///
    /// # Errors
    /// Parameters that do not go together, or a file that is refused.
    fn made_of(parameters: Self::Parameters, files: &InputFiles) -> Result<Self, ParameterError>;

    /// The state before the first tick.
    fn initial(&self) -> Self::State {
        Self::State::default()
    }

    /// The measurement that is sent until the first arrives.
    fn first(&self) -> Sent<Self> {
        Sent::<Self>::default()
    }

    /// The sensor as the node of `run`; refuses ports that do not go with its parameters.
    ///
    /// # Errors
    /// The ports, and advice.
    fn in_run(self, _run: &NodeContext<'_>) -> Result<Self, ParameterError> {
        Ok(self)
    }

    /// The outputs that have the measurement `sent`.
    fn outputs(&self, sent: Sent<Self>) -> Self::Outputs {
        sent.into()
    }

    /// Refuses inputs that do not go with its parameters.
    ///
    /// # Errors
    /// The inputs, and advice.
    fn check_inputs(&self, _inputs: &Self::Inputs<'_>) -> Result<(), StepError> {
        Ok(())
    }

    /// Measures after `last`, at the times when a measurement is due; `None` where there is nothing to measure.
    fn measure(
        &self,
        state: &mut Self::State,
        last: &Sent<Self>,
        chance: &mut Chance<'_>,
        inputs: Self::Inputs<'_>,
    ) -> Option<Sent<Self>>;
}

/// Message that a sensor sends.
pub(crate) type Sent<S> = <<S as Sensor>::State as Remembered>::Measurement;

/// Inputs of most sensors.
#[derive(Debug, InputPorts)]
pub struct TruthInputs<'a> {
    /// The truth.
    pub state: &'a PlantState,
}

/// The component that a sensor is.
///
/// ```
/// use component::messages::PlantState;
/// use sensors::gps::GpsParams;
/// use sensors::sensing::{Sensing, TruthInputs};
///
/// let mut gps = component::Harness::<Sensing<GpsParams>>::new(GpsParams::default()).unwrap();
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
    type State = Queued<S::State>;

    fn new(parameters: S::Parameters, context: &NodeContext<'_>) -> Result<Self, ParameterError> {
        let channel = Channel::new(&parameters.timing(), context);
        let sensor = S::made_of(parameters, &context.files).and_then(|sensor| sensor.in_run(context));
        let (channel, sensor) = ParameterError::both(channel, sensor)?;
        Ok(Self { sensor, channel })
    }

    fn period_ticks(parameters: &S::Parameters, tick_ns: u64) -> u32 {
        parameters.timing().period_ticks(tick_ns)
    }

    fn sample_ticks(parameters: &S::Parameters, tick_ns: u64, period_ticks: u32) -> SampleTicks {
        parameters.timing().sample_ticks(tick_ns, period_ticks)
    }

    fn initial(&self) -> Queued<S::State> {
        self.channel.state(self.sensor.initial(), self.sensor.first())
    }

    fn step(
        &self,
        context: &StepContext<'_>,
        inputs: S::Inputs<'_>,
        state: &mut Queued<S::State>,
    ) -> Result<S::Outputs, StepError> {
        self.sensor.check_inputs(&inputs)?;
        let arrived = self.channel.measure(context.time_ns(), state, |state, last, chance| {
            let measured = self.sensor.measure(state, last, chance, inputs);
            Measurement::sent(measured, last, chance)
        });
        Ok(self.sensor.outputs(arrived))
    }
}
