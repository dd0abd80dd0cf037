//! Ports that a component declares, and the transport of the inputs and outputs of a step to them.

use crate::error::BusError;
use crate::message::{Message, view, view_mut};
use crate::schema::Schema;
use std::marker::PhantomData;

/// A port of a component.
///
/// ```
/// use component::messages::Imu;
/// use component::ports::OutputPorts;
///
/// #[derive(component::OutputPorts)]
/// struct Outputs {
///     /// What the sensor measured.
///     imu: Imu,
/// }
/// let [port] = Outputs::DECLARED else { panic!() };
/// assert_eq!((port.name, port.doc, port.schema.type_name), ("imu", "What the sensor measured.", "hummingbus_msgs/msg/Imu"));
/// ```
#[derive(Clone, Copy, Debug)]
pub struct PortSpec {
    /// Name in the component.
    pub name: &'static str,
    /// Purpose in one line.
    pub doc: &'static str,
    /// Message type.
    pub schema: &'static Schema,
    /// True if the component needs it.
    pub required: bool,
}

/// Number of an output among those that a component declares. A step asks with it whether the output is due
/// ([`StepContext::is_due`](crate::context::StepContext::is_due)).
///
/// In a constant, a name that is not declared is an error of the compiler:
///
/// ```
/// use component::messages::{PlannedPath, Reference};
/// use component::ports::OutputNumber;
///
/// #[derive(component::OutputPorts)]
/// struct Outputs {
///     reference: Reference,
///     path: Option<PlannedPath>,
/// }
/// const PATH: OutputNumber = OutputNumber::of::<Outputs>("path");
/// assert_ne!(PATH, OutputNumber::of::<Outputs>("reference"));
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct OutputNumber(pub(crate) usize);

impl OutputNumber {
    /// Number of the output called `name` among the outputs `O`.
    ///
    /// # Panics
    /// If there is no such output.
    #[must_use]
    pub const fn of<O: OutputPorts>(name: &str) -> Self {
        let ports = O::DECLARED;
        let mut number = 0;
        while number < ports.len() {
            if is_same(ports[number].name, name) {
                return Self(number);
            }
            number += 1;
        }
        panic!("the component declares no output of this name")
    }
}

/// True if two names are equal; `==` is not for constants.
const fn is_same(one: &str, other: &str) -> bool {
    let (one, other) = (one.as_bytes(), other.as_bytes());
    let mut index = 0;
    while index < one.len() && index < other.len() && one[index] == other[index] {
        index += 1;
    }
    index == one.len() && index == other.len()
}

/// Inputs of a component.
#[derive(Clone, Copy, Debug)]
pub enum Inputs {
    /// The listed ports.
    Ports(&'static [PortSpec]),
    /// One or more of this message, under names that the manifest chooses.
    Many(&'static Schema),
    /// Any topics; all of the run where the manifest names none.
    Any,
    /// One or more of any message without text, under names that the manifest chooses, each a tick late; the component
    /// has an output of the same name and message for each.
    Forwarded {
        /// Bytes that a message may have.
        bytes_max: usize,
    },
}

/// The inputs of a component at one tick; implement it with `#[derive(component::InputPorts)]`.
///
/// Each field is a port of the same name: `&'a T` one that must be wired, `Option<&'a T>` one that may be left out.
/// A component whose inputs the manifest names takes [`Many`] or [`AnyInputs`], one without inputs `()`.
///
/// ```
/// use component::messages::{Gps, Imu};
/// use component::ports::{InputPorts, Inputs};
///
/// #[derive(component::InputPorts)]
/// struct Measurements<'a> {
///     /// At every tick.
///     imu: &'a Imu,
///     /// Where a receiver is on board.
///     gps: Option<&'a Gps>,
/// }
/// let Inputs::Ports([imu, gps]) = Measurements::DECLARED else { panic!() };
/// assert_eq!((imu.name, imu.required, gps.name, gps.required), ("imu", true, "gps", false));
/// ```
pub trait InputPorts<'a>: Sized {
    /// The ports.
    const DECLARED: Inputs;

    /// The inputs among `samples`.
    fn read(samples: InputSamples<'a>) -> Self;
}

/// The outputs of a component at one tick; implement it with `#[derive(component::OutputPorts)]`.
///
/// Each field is a port of the same name: `T` one that is always there, `Option<T>` one that is there where the
/// manifest names it. An output that is not there or not due is dropped; a due output that is `None` ends the run.
///
/// ```
/// use component::messages::{ControlStatus, MotorCommand};
/// use component::ports::OutputPorts;
///
/// #[derive(component::OutputPorts)]
/// struct Answer {
///     command: MotorCommand,
///     status: Option<ControlStatus>,
/// }
/// assert_eq!(Answer::DECLARED.iter().map(|port| port.name).collect::<Vec<_>>(), ["command", "status"]);
/// ```
pub trait OutputPorts: Sized {
    /// The ports.
    const DECLARED: &'static [PortSpec];

    /// Writes the outputs.
    ///
    /// # Errors
    /// If shared memory cannot be had.
    fn write(&self, samples: &mut OutputSamples<'_>) -> Result<(), BusError>;

    /// Outputs that were sent last; `None` if a required one was never sent.
    fn read(samples: InputSamples<'_>) -> Option<Self>;
}

/// The samples that a step may read, by the numbers of its ports.
#[derive(Clone, Copy)]
pub struct InputSamples<'a>(#[doc(hidden)] pub &'a dyn SampleSource);

/// Source of samples: the bus, or the caller that steps a component without it.
#[doc(hidden)]
pub trait SampleSource {
    /// Number of ports.
    fn count(&self) -> usize;
    /// The newest sample of a port; `None` where that is not wired.
    fn words(&self, port: usize) -> Option<&[u64]>;
    /// The tick at which it was sent; `None` where none was.
    fn sent_tick(&self, port: usize) -> Option<u64>;
    /// The CDR bytes of a port's sample, if it was sent at this tick.
    fn fresh(&self, port: usize) -> Option<&[u8]>;
    /// The CDR bytes of a port's newest sample from before the checkpoint from which the run goes on.
    fn restored(&self, _port: usize) -> Option<&[u8]> {
        None
    }
    /// The CDR bytes of the sample of the process that shadows the publisher, if it was sent at this tick.
    fn fresh_shadow(&self, port: usize) -> Option<&[u8]>;
}

impl std::fmt::Debug for InputSamples<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("InputSamples").field("count", &self.0.count()).finish()
    }
}

impl<'a> InputSamples<'a> {
    /// The newest sample of port `port`; `None` where it is not wired.
    #[must_use]
    pub fn get<T: Message>(&self, port: usize) -> Option<&'a T> {
        self.0.words(port).map(view)
    }
}

/// Samples that a step may write, by the numbers of its ports: the declared ones first, then those of
/// [`Inputs::Forwarded`] in the order of their names.
pub struct OutputSamples<'a>(#[doc(hidden)] pub &'a mut dyn SampleSink);

/// Destination of samples: the bus, or the caller that steps a component without it.
#[doc(hidden)]
pub trait SampleSink {
    /// The words of a port's sample; `None` where that is not wired or not due.
    fn words(&mut self, port: usize) -> Result<Option<&mut [u64]>, BusError>;
}

impl OutputSamples<'_> {
    /// Writes a message as bytes to port `port`, where that is wired and due.
    ///
    /// # Errors
    /// If shared memory cannot be had.
    pub fn write_bytes(&mut self, port: usize, message: &[u8]) -> Result<(), BusError> {
        if let Some(words) = self.0.words(port)? {
            bytemuck::cast_slice_mut(&mut words[1..])[..message.len()].copy_from_slice(message);
        }
        Ok(())
    }
}

impl std::fmt::Debug for OutputSamples<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("OutputSamples").finish_non_exhaustive()
    }
}

/// A field of a struct of inputs.
pub trait InputPort<'a>: Sized {
    /// The message that it reads.
    const SCHEMA: &'static Schema;
    /// True if it must be wired.
    const REQUIRED: bool;
    /// The input at port `port`.
    fn read(samples: InputSamples<'a>, port: usize) -> Self;
}

impl<'a, T: Message> InputPort<'a> for &'a T {
    const SCHEMA: &'static Schema = T::SCHEMA;
    const REQUIRED: bool = true;

    fn read(samples: InputSamples<'a>, port: usize) -> Self {
        samples
            .get(port)
            .unwrap_or_else(|| panic!("no sample of {}, which must be wired", T::SCHEMA.type_name))
    }
}

impl<'a, T: Message> InputPort<'a> for Option<&'a T> {
    const SCHEMA: &'static Schema = T::SCHEMA;
    const REQUIRED: bool = false;

    fn read(samples: InputSamples<'a>, port: usize) -> Self {
        samples.get(port)
    }
}

/// A field of a struct of outputs.
pub trait OutputPort: Sized {
    /// The message that it sends.
    const SCHEMA: &'static Schema;
    /// True if it is always sent.
    const REQUIRED: bool;
    /// Writes the output to port `port`.
    ///
    /// # Errors
    /// If shared memory cannot be had.
    fn write(&self, samples: &mut OutputSamples<'_>, port: usize) -> Result<(), BusError>;
    /// Output that was sent last on port `port`; `None` if a required output was never sent.
    fn read(samples: InputSamples<'_>, port: usize) -> Option<Self>;
}

impl<T: Message> OutputPort for T {
    const SCHEMA: &'static Schema = T::SCHEMA;
    const REQUIRED: bool = true;

    fn write(&self, samples: &mut OutputSamples<'_>, port: usize) -> Result<(), BusError> {
        if let Some(words) = samples.0.words(port)? {
            *view_mut(words) = *self;
        }
        Ok(())
    }

    fn read(samples: InputSamples<'_>, port: usize) -> Option<Self> {
        samples.get(port).copied()
    }
}

impl<T: Message> OutputPort for Option<T> {
    const SCHEMA: &'static Schema = T::SCHEMA;
    const REQUIRED: bool = false;

    fn write(&self, samples: &mut OutputSamples<'_>, port: usize) -> Result<(), BusError> {
        self.as_ref().map_or(Ok(()), |message| message.write(samples, port))
    }

    fn read(samples: InputSamples<'_>, port: usize) -> Option<Self> {
        Some(samples.get(port).copied())
    }
}

impl<'a> InputPorts<'a> for () {
    const DECLARED: Inputs = Inputs::Ports(&[]);

    fn read(_: InputSamples<'a>) -> Self {}
}

impl OutputPorts for () {
    const DECLARED: &'static [PortSpec] = &[];

    fn write(&self, _: &mut OutputSamples<'_>) -> Result<(), BusError> {
        Ok(())
    }

    fn read(_: InputSamples<'_>) -> Option<Self> {
        Some(())
    }
}

/// One or more inputs of one message, in the order of the names that the manifest gives them.
///
/// ```
/// use component::messages::PlantState;
/// use component::ports::{InputPorts, Inputs, Many};
///
/// /// The height of the highest of all vehicles that the manifest wires.
/// fn highest_m(vehicles: &Many<'_, PlantState>) -> f64 {
///     vehicles.iter().map(|state| state.position.z).fold(f64::MIN, f64::max)
/// }
/// assert!(matches!(<Many<'_, PlantState> as InputPorts<'_>>::DECLARED, Inputs::Many(_)));
/// ```
#[derive(Clone, Copy, Debug)]
pub struct Many<'a, T> {
    samples: InputSamples<'a>,
    message: PhantomData<T>,
}

impl<'a, T: Message> Many<'a, T> {
    /// The newest sample of each.
    pub fn iter(&self) -> impl Iterator<Item = &'a T> + use<'a, T> {
        let samples = self.samples;
        (0..samples.0.count()).filter_map(move |port| samples.get(port))
    }
}

impl<'a, T: Message> InputPorts<'a> for Many<'a, T> {
    const DECLARED: Inputs = Inputs::Many(T::SCHEMA);

    fn read(samples: InputSamples<'a>) -> Self {
        Self { samples, message: PhantomData }
    }
}

/// The inputs of a component that takes any messages as bytes, in the order of their topics' names.
#[derive(Clone, Copy, Debug)]
pub struct AnyInputs<'a>(InputSamples<'a>);

impl<'a> AnyInputs<'a> {
    /// The sample of input `input` as CDR bytes, if it was sent at this tick.
    #[must_use]
    pub fn fresh(&self, input: usize) -> Option<&'a [u8]> {
        self.0.0.fresh(input)
    }

    /// The newest sample of input `input` from before the checkpoint from which the run goes on, as CDR bytes.
    #[must_use]
    pub fn restored(&self, input: usize) -> Option<&'a [u8]> {
        self.0.0.restored(input)
    }

    /// The sample of the process that shadows the publisher of the input, as CDR bytes, if it was sent at this tick.
    #[must_use]
    pub fn fresh_shadow(&self, input: usize) -> Option<&'a [u8]> {
        self.0.0.fresh_shadow(input)
    }
}

impl<'a> InputPorts<'a> for AnyInputs<'a> {
    const DECLARED: Inputs = Inputs::Any;

    fn read(samples: InputSamples<'a>) -> Self {
        Self(samples)
    }
}

/// The inputs of a component that forwards messages as bytes, in the order of their names. It sends its results on
/// outputs of the same names ([`OutputSamples::write_bytes`]), and a message keeps the stamp of its first sender.
///
/// ```
/// use component::ports::ForwardedInputs;
/// /// The bytes of the first input's message, if that is a new one.
/// fn first_new<'a>(inputs: &ForwardedInputs<'a>, last_tick: Option<u64>) -> Option<&'a [u8]> {
///     (inputs.sent_tick(0) > last_tick).then(|| inputs.newest(0))
/// }
/// ```
#[derive(Clone, Copy, Debug)]
pub struct ForwardedInputs<'a>(InputSamples<'a>);

impl<'a> ForwardedInputs<'a> {
    /// The newest sample of input `input` as bytes, up to seven zeros behind the message: at tick 0 the initial value.
    #[must_use]
    pub fn newest(&self, input: usize) -> &'a [u8] {
        self.0.0.words(input).map_or(&[], |words| bytemuck::cast_slice(&words[1..]))
    }

    /// The tick at which that was sent; none for the initial value, and where a test steps the component.
    #[must_use]
    pub fn sent_tick(&self, input: usize) -> Option<u64> {
        self.0.0.sent_tick(input)
    }
}

impl<'a> InputPorts<'a> for ForwardedInputs<'a> {
    /// Room for every message but tables of many vehicles.
    const DECLARED: Inputs = Inputs::Forwarded { bytes_max: FORWARDED_BYTES_MAX };

    fn read(samples: InputSamples<'a>) -> Self {
        Self(samples)
    }
}

/// Bytes that a forwarded message has at most.
pub const FORWARDED_BYTES_MAX: usize = 256;

#[cfg(test)]
mod tests {
    use super::OutputNumber;
    use crate::messages::{PlannedPath, Reference};

    #[derive(crate::OutputPorts)]
    struct Outputs {
        path_reference: Reference,
        path: Option<PlannedPath>,
        pat: Option<PlannedPath>,
    }

    #[test]
    fn a_name_finds_its_output_and_not_one_that_begins_alike() {
        for (number, name) in ["path_reference", "path", "pat"].into_iter().enumerate() {
            assert_eq!(OutputNumber::of::<Outputs>(name), OutputNumber(number), "{name}");
        }
    }

    #[test]
    #[should_panic(expected = "declares no output")]
    fn a_name_that_is_not_declared_is_refused() {
        let _ = OutputNumber::of::<Outputs>("paths");
    }
}
