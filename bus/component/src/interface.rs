//! A component: a value made from parameters, and a step that is a function of inputs, state and time.

use crate::announcement::Announcement;
use crate::context::{NodeContext, StepContext};
use crate::parameters::Parameters;
use crate::ports::{InputPorts, OutputPorts};
use crate::sample_ticks::SampleTicks;
use diagnostics::ParameterError;

pub use crate::state::{State, StateError, Transfer};

/// Error of a step, in words. Any error, and any text, becomes one by `?` or `into`.
///
/// ```
/// let too_low: component::StepError = "the battery is empty".into();
/// assert_eq!(too_low.to_string(), "the battery is empty");
/// ```
pub type StepError = Box<dyn std::error::Error + Send + Sync>;

/// A type that runs at ticks: a sensor, a controller, the plant, the recorder.
///
/// The keys of a manifest, the check and the process that runs the component follow from this declaration.
///
/// A component is a value that does not change after it is made. Everything that changes is in its [`State`]. A step is a
/// function of the inputs, the state and the time. It does not know of processes, so that a test can call it
/// ([`Harness`](crate::Harness)) and a thread can host it.
///
/// ```
/// use component::{Component, Info, StepError};
/// use component::context::{NodeContext, StepContext};
/// use component::messages::{PlantState, SetPoint};
///
/// /// Asks for a hover at the height at which the vehicle is, and some more.
/// struct Climb(Parameters);
///
/// #[derive(component::Parameters)]
/// struct Parameters {
///     /// Height above the vehicle.
///     more_m: f64,
/// }
///
/// #[derive(component::InputPorts)]
/// struct Inputs<'a> {
///     state: &'a PlantState,
/// }
///
/// #[derive(component::OutputPorts)]
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
///     fn new(parameters: Parameters, _: &NodeContext<'_>) -> Result<Self, component::ParameterError> {
///         Ok(Self(parameters))
///     }
///
///     fn initial(&self) -> Self::State {}
///
///     fn step(
///         &self,
///         _: &StepContext<'_>,
///         inputs: Inputs<'_>,
///         (): &mut Self::State,
///     ) -> Result<Outputs, StepError> {
///         let altitude = inputs.state.position.z + self.0.more_m;
///         Ok(Outputs { set_point: SetPoint { altitude, ..Default::default() } })
///     }
/// }
///
/// let mut climb = component::Harness::<Climb>::new(Parameters { more_m: 0.5 }).unwrap();
/// let state = PlantState { position: [0.0, 0.0, 2.0].into(), ..Default::default() };
/// assert_eq!(climb.step(Inputs { state: &state }).unwrap().set_point.altitude, 2.5);
/// ```
pub trait Component: Sized + Send {
    /// Its name in manifests, and its summary.
    const INFO: Info;
    /// Content of the manifest's `parameters` table.
    type Parameters: Parameters;
    /// Inputs.
    type Inputs<'a>: InputPorts<'a>;
    /// Outputs.
    type Outputs: OutputPorts;
    /// Everything that changes from tick to tick: a [`Message`](crate::Message), `()` if nothing changes, or a type that
    /// writes its own bytes.
    type State: State;

    /// Makes the component of parameters within their ranges, for a check of the manifest as for a run.
    ///
    /// # Errors
    /// A parameter or a file that cannot be meant.
    fn new(parameters: Self::Parameters, context: &NodeContext<'_>) -> Result<Self, ParameterError>;

    /// Ticks of `tick_ns` between two steps of a node whose manifest states no `period_ticks`: one, except for a component that has
    /// something new to send more seldom.
    fn period_ticks(_parameters: &Self::Parameters, _tick_ns: u64) -> u32 {
        1
    }

    /// Ticks at which a node that computes every `period_ticks` ticks of `tick_ns` has something new to send: those at which it
    /// computes, except for a component that measures. Its outputs are sent at these ticks, unless the manifest states `every_ticks`.
    fn sample_ticks(_parameters: &Self::Parameters, _tick_ns: u64, period_ticks: u32) -> SampleTicks {
        SampleTicks::every(period_ticks)
    }

    /// Tries the component before a run, in a check: finds errors and oddities although each parameter is valid.
    ///
    /// # Errors
    /// The error that the run would meet.
    fn rehearse(self, _context: &NodeContext<'_>) -> Result<(), ParameterError> {
        Ok(())
    }

    /// The state before the first tick.
    fn initial(&self) -> Self::State;

    /// Receives the message types of its inputs, if these are [`AnyInputs`](crate::ports::AnyInputs): once, before
    /// the first tick.
    ///
    /// # Errors
    /// The reason why it cannot use them.
    fn connected(
        &self,
        _topics: &[(&str, &Announcement)],
        _state: &mut Self::State,
    ) -> Result<(), StepError> {
        Ok(())
    }

    /// Computes one tick.
    ///
    /// # Errors
    /// The error with which the run ends.
    fn step(
        &self,
        context: &StepContext<'_>,
        inputs: Self::Inputs<'_>,
        state: &mut Self::State,
    ) -> Result<Self::Outputs, StepError>;

    /// Returns a remark on the run for its summary, in one line, after the last tick: a fact that the user must know although
    /// the run went on. It is asked for once, off the tick path.
    ///
    /// ```
    /// use component::{Component, Info, StepError};
    /// use component::context::{NodeContext, StepContext};
    ///
    /// /// Finds no root in every fourth step, and takes the nearest number.
    /// struct Roots;
    ///
    /// impl Component for Roots {
    ///     const INFO: Info = Info::new("roots", "finds roots");
    ///     type Parameters = std::collections::BTreeMap<String, f64>;
    ///     type Inputs<'a> = ();
    ///     type Outputs = ();
    ///     type State = Missed;
    ///
    ///     fn new(_: Self::Parameters, _: &NodeContext<'_>) -> Result<Self, component::ParameterError> {
    ///         Ok(Self)
    ///     }
    ///
    ///     fn initial(&self) -> Missed {
    ///         Missed::default()
    ///     }
    ///
    ///     fn step(&self, context: &StepContext<'_>, (): (), missed: &mut Missed) -> Result<(), StepError> {
    ///         missed.steps += u64::from(context.tick() % 4 == 3);
    ///         Ok(())
    ///     }
    ///
    ///     fn remark(&self, missed: &Missed) -> Option<String> {
    ///         (missed.steps > 0).then(|| format!("no root in {} steps", missed.steps))
    ///     }
    /// }
    ///
    /// /// Steps without a root.
    /// #[derive(Clone, Copy, Debug, Default, component::Message)]
    /// #[repr(C)]
    /// #[message(type_name = "example_msgs/msg/Missed")]
    /// struct Missed {
    ///     #[field(unit = "1")]
    ///     steps: u64,
    /// }
    ///
    /// let mut roots = component::Harness::<Roots>::from_json(&serde_json::json!({})).unwrap();
    /// (0..8).for_each(|_| roots.step(()).unwrap());
    /// assert_eq!(roots.component().remark(&roots.state).as_deref(), Some("no root in 2 steps"));
    /// ```
    fn remark(&self, _state: &Self::State) -> Option<String> {
        None
    }

    /// Finishes its work after the last tick, also in a run that failed.
    ///
    /// # Errors
    /// The reason why it could not finish.
    fn finish(&self, _state: &mut Self::State) -> Result<(), StepError> {
        Ok(())
    }
}

/// Condition that cannot hold any more.
///
/// ```
/// use component::Failure;
///
/// let failure = Failure { condition: "touches nothing".to_owned(), time_ns: 1_500_000 };
/// assert_eq!(failure.time_ns / 1_000_000, 1, "tick 1 at 1 kHz");
/// ```
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Failure {
    /// Name of the condition.
    pub condition: String,
    /// Simulation time of the first sample after which it cannot hold, ns.
    pub time_ns: u64,
}

/// Function that returns the first failure from the bytes of a judge's state, if a condition has failed.
pub type FirstFailure = fn(&[u8]) -> Option<Failure>;

/// Description of a component.
///
/// ```
/// use component::{Info, Role};
///
/// const LOGGER: Info = Info::new("logger", "writes what it reads to a file").recorder();
/// assert_eq!((LOGGER.name, LOGGER.role), ("logger", Role::Record));
/// ```
#[derive(Clone, Copy, Debug)]
pub struct Info {
    /// Name in manifests.
    pub name: &'static str,
    /// Summary in one line.
    pub summary: &'static str,
    /// Its role in the run.
    pub role: Role,
    /// Reason why it cannot take the place of a component from whose state it does not go on, if it cannot.
    pub needs_state: Option<&'static str>,
    /// The first failure that a judge has seen, if it is one.
    pub first_failure: Option<FirstFailure>,
}

/// Role of a component in a run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Role {
    /// It computes outputs.
    Compute,
    /// It writes the run's recording: there is one in a run, it takes every sample, and the launcher names its file.
    Record,
    /// It evaluates the conditions of a run that is not recorded. The launcher adds it; a manifest cannot name it.
    Judge,
}

impl Info {
    /// A component that computes outputs.
    #[must_use]
    pub const fn new(name: &'static str, summary: &'static str) -> Self {
        Self { name, summary, role: Role::Compute, needs_state: None, first_failure: None }
    }

    /// The same component, which takes the place of another one only if it goes on from its state; `reason` says why.
    ///
    /// ```
    /// use component::Info;
    ///
    /// const WORLD: Info = Info::new("world", "moves bodies").needing_state("the bodies would be lost");
    /// assert!(WORLD.needs_state.is_some());
    /// ```
    #[must_use]
    pub const fn needing_state(self, reason: &'static str) -> Self {
        Self { needs_state: Some(reason), ..self }
    }

    /// The same component as the one that writes the run's recording.
    #[must_use]
    pub const fn recorder(self) -> Self {
        Self { role: Role::Record, ..self }
    }

    /// The same component as the one that judges a run that is not recorded. `first_failure` returns the first failure that
    /// it has seen, from the bytes of its state.
    #[must_use]
    pub const fn judge(self, first_failure: FirstFailure) -> Self {
        Self { role: Role::Judge, first_failure: Some(first_failure), ..self }
    }
}
