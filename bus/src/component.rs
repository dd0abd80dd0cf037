//! A component is a type: what it declares, how it is made, and its step.

use crate::announcement::Announcement;
use crate::context::{NodeContext, StepContext};
use crate::message::Message;
use crate::ports::{InputPorts, OutputPorts};
use crate::schema::Schema;
use diagnostics::ParameterError;
use serde::de::DeserializeOwned;

/// What goes wrong in a step, in words. Any error, and any text, becomes one by `?` or `into`.
///
/// ```
/// let too_low: bus::component::StepError = "the battery is empty".into();
/// assert_eq!(too_low.to_string(), "the battery is empty");
/// ```
pub type StepError = Box<dyn std::error::Error + Send + Sync>;

/// Everything that runs at ticks: sensors, controllers, the plant, the recorder.
///
/// What a manifest may say of it, how it is checked, and the process that runs it all follow from the declaration. A step
/// is a function of its inputs, of the state and of the time: it does not know of processes, so that a test can call it
/// ([`Harness`](crate::Harness)).
///
/// ```
/// use bus::component::{Component, Info, StepError};
/// use bus::context::{NodeContext, StepContext};
/// use bus::messages::{PlantState, SetPoint};
///
/// /// Asks for a hover at the height at which the vehicle is, and some more.
/// struct Climb(Parameters);
///
/// #[derive(serde::Deserialize)]
/// #[serde(deny_unknown_fields)]
/// struct Parameters {
///     more_m: f64,
/// }
///
/// #[derive(bus::InputPorts)]
/// struct Inputs<'a> {
///     state: &'a PlantState,
/// }
///
/// #[derive(bus::OutputPorts)]
/// struct Outputs {
///     set_point: SetPoint,
/// }
///
/// impl Component for Climb {
///     const INFO: Info = Info::new("climb", "asks for a hover above the vehicle");
///     type Parameters = Parameters;
///     type Inputs<'a> = Inputs<'a>;
///     type Outputs = Outputs;
///     type State = ();
///
///     fn new(parameters: Parameters, _: &NodeContext<'_>) -> Result<Self, bus::ParameterError> {
///         Ok(Self(parameters))
///     }
///
///     fn initial(&self) -> Self::State {}
///
///     fn step(
///         &mut self,
///         _: &StepContext<'_>,
///         inputs: Inputs<'_>,
///         (): &mut Self::State,
///     ) -> Result<Outputs, StepError> {
///         let altitude = inputs.state.position.z + self.0.more_m;
///         Ok(Outputs { set_point: SetPoint { altitude, ..Default::default() } })
///     }
/// }
///
/// let mut climb = bus::Harness::<Climb>::new(Parameters { more_m: 0.5 }).unwrap();
/// let state = PlantState { position: [0.0, 0.0, 2.0].into(), ..Default::default() };
/// assert_eq!(climb.step(Inputs { state: &state }).unwrap().set_point.altitude, 2.5);
/// ```
pub trait Component: Sized {
    /// Its name in manifests, and what it does.
    const INFO: Info;
    /// What the manifest's `parameters` table holds: a struct that refuses unknown fields.
    type Parameters: DeserializeOwned;
    /// What it reads.
    type Inputs<'a>: InputPorts<'a>;
    /// What it sends.
    type Outputs: OutputPorts;
    /// All that it remembers from tick to tick: a [`Message`] that is transferred to another process, `()` where there is
    /// nothing to remember, or [`Internal`].
    type State: State;

    /// Makes the component, for a check of the manifest as for a run.
    ///
    /// # Errors
    /// A parameter or a file that cannot be meant.
    fn new(parameters: Self::Parameters, context: &NodeContext<'_>) -> Result<Self, ParameterError>;

    /// Tries the component before a run, in a check: what goes wrong, or is odd, although each parameter can be meant.
    ///
    /// # Errors
    /// What goes wrong.
    fn rehearse(self, _context: &NodeContext<'_>) -> Result<(), ParameterError> {
        Ok(())
    }

    /// The state before the first tick.
    fn initial(&self) -> Self::State;

    /// Learns what its inputs carry, where these are [`AnyInputs`](crate::ports::AnyInputs): once, before the first tick.
    ///
    /// # Errors
    /// What stands against it.
    fn connected(&mut self, _topics: &[(&str, &Announcement)]) -> Result<(), StepError> {
        Ok(())
    }

    /// Computes one tick.
    ///
    /// # Errors
    /// What goes wrong: the run ends with it.
    fn step(
        &mut self,
        context: &StepContext<'_>,
        inputs: Self::Inputs<'_>,
        state: &mut Self::State,
    ) -> Result<Self::Outputs, StepError>;

    /// Ends what it has begun, after the last tick: also of a run that failed.
    ///
    /// # Errors
    /// What stands against it.
    fn finish(&mut self) -> Result<(), StepError> {
        Ok(())
    }
}

/// What is told of a component.
///
/// ```
/// use bus::component::{Info, Role};
///
/// const LOGGER: Info = Info::new("logger", "writes what it reads to a file").recorder();
/// assert_eq!((LOGGER.name, LOGGER.role), ("logger", Role::Record));
/// ```
#[derive(Clone, Copy, Debug)]
pub struct Info {
    /// Name in manifests.
    pub name: &'static str,
    /// What it does, in one line.
    pub summary: &'static str,
    /// What it does for the run.
    pub role: Role,
}

/// What a component does for a run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Role {
    /// It computes outputs.
    Compute,
    /// It writes the run's recording: there is one in a run, it takes every sample, and the launcher names its file.
    Record,
}

impl Info {
    /// A component that computes outputs.
    #[must_use]
    pub const fn new(name: &'static str, summary: &'static str) -> Self {
        Self { name, summary, role: Role::Compute }
    }

    /// The same component as the one that writes the run's recording.
    #[must_use]
    pub const fn recorder(self) -> Self {
        Self { role: Role::Record, ..self }
    }
}

/// What happens to a component's state when another process takes its place.
#[derive(Clone, Copy, Debug)]
pub enum Transfer {
    /// It is transferred as this message.
    Message(&'static Schema),
    /// There is none.
    Nothing,
    /// It lives inside of the process and dies with it.
    Internal,
}

/// What a component remembers from tick to tick.
///
/// ```
/// use bus::component::{Internal, State, Transfer};
///
/// fn transfer<S: State>() -> Transfer {
///     S::TRANSFER
/// }
/// assert!(matches!(transfer::<bus::messages::SetPoint>(), Transfer::Message(_)));
/// assert!(matches!(transfer::<()>(), Transfer::Nothing));
/// assert!(matches!(transfer::<Internal>(), Transfer::Internal));
/// ```
pub trait State: bytemuck::Pod {
    /// What happens to it when another process takes the component's place.
    const TRANSFER: Transfer;
}

impl<M: Message> State for M {
    const TRANSFER: Transfer = Transfer::Message(M::SCHEMA);
}

impl State for () {
    const TRANSFER: Transfer = Transfer::Nothing;
}

/// The state of a component that keeps it in its own fields: no other process can take its place.
#[derive(Clone, Copy, Debug, Default, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub struct Internal;

impl State for Internal {
    const TRANSFER: Transfer = Transfer::Internal;
}
