//! A component stepped without a run: for tests, and for uses that need its numbers alone.

use crate::context::{NodeContext, StepContext};
use crate::interface::{Component, State, StepError};
use crate::ports::{OutputNumber, OutputPorts, SampleSource};
use crate::registration::make_of;
use crate::sample_memory::SampleMemory;
use crate::sample_ticks::SampleTicks;
use diagnostics::ParameterError;

/// A component with its state and its time, stepped by hand.
///
/// As [`Component`] shows, inputs and outputs are the component's own structs.
#[derive(Debug)]
pub struct Harness<C: Component> {
    component: C,
    /// State of the component.
    pub state: C::State,
    /// The tick of the next step.
    pub tick: u32,
    tick_ns: u64,
    period_ticks: u32,
    /// Ticks of the samples, by output; `None` for outputs that are not wired.
    sends: Vec<Option<SampleTicks>>,
    /// Last samples of a predecessor, until the next step.
    predecessor: Option<SampleMemory>,
}

impl<C: Component> Harness<C> {
    /// A component by itself, stepped once a millisecond in a run with seed 1; its node is called like it.
    ///
    /// # Errors
    /// As [`Component::new`].
    pub fn new(parameters: C::Parameters) -> Result<Self, ParameterError> {
        Self::in_context(parameters, &NodeContext::new(C::INFO.name, &[]))
    }

    /// A component by itself, with the parameters as in a manifest.
    ///
    /// # Errors
    /// They do not fit, or as [`Component::new`].
    pub fn from_json(parameters: &serde_json::Value) -> Result<Self, ParameterError> {
        Self::new(diagnostics::read(parameters)?)
    }

    /// A component as the node that `context` describes.
    ///
    /// # Errors
    /// As [`Component::new`].
    pub fn in_context(parameters: C::Parameters, context: &NodeContext<'_>) -> Result<Self, ParameterError> {
        let component: C = make_of(parameters, context)?;
        let state = component.initial();
        let (tick_ns, period_ticks) = (context.tick_ns, context.period_ticks);
        let sends = vec![Some(SampleTicks::every(1)); <C::Outputs as OutputPorts>::DECLARED.len()];
        Ok(Self { component, state, tick: 0, tick_ns, period_ticks, sends, predecessor: None })
    }

    /// The same component whose output `port` is sent at `ticks`, or is not wired if that is `None`. Without this, all
    /// outputs are due at each step.
    ///
    /// ```
    /// use component::{Component, Info, StepError};
    /// use component::context::{NodeContext, StepContext};
    /// use component::messages::{PlannedPath, SetPoint};
    /// use component::ports::OutputNumber;
    /// use component::sample_ticks::SampleTicks;
    ///
    /// /// Asks for a hover, and sends its way there.
    /// struct Planner;
    ///
    /// #[derive(component::OutputPorts)]
    /// struct Outputs {
    ///     set_point: SetPoint,
    ///     path: Option<PlannedPath>,
    /// }
    ///
    /// const PATH: OutputNumber = OutputNumber::of::<Outputs>("path");
    ///
    /// impl Component for Planner {
    ///     const INFO: Info = Info::new("planner", "plans a way");
    ///     type Parameters = std::collections::BTreeMap<String, f64>;
    ///     type Inputs<'a> = ();
    ///     type Outputs = Outputs;
    ///     type State = ();
    ///
    ///     fn new(_: Self::Parameters, _: &NodeContext<'_>) -> Result<Self, component::ParameterError> {
    ///         Ok(Self)
    ///     }
    ///
    ///     fn initial(&self) {}
    ///
    ///     fn step(&self, context: &StepContext<'_>, (): (), (): &mut ()) -> Result<Outputs, StepError> {
    ///         let path = context.is_due(PATH).then(|| PlannedPath::new([]));
    ///         Ok(Outputs { set_point: SetPoint::default(), path })
    ///     }
    /// }
    ///
    /// let planner = component::Harness::<Planner>::from_json(&serde_json::json!({})).unwrap();
    /// let mut planner = planner.sending("path", Some(SampleTicks::every(3)));
    /// let planned: Vec<u32> = (0..8).filter(|_| planner.step(()).unwrap().path.is_some()).collect();
    /// assert_eq!(planned, [0, 3, 6]);
    /// ```
    ///
    /// # Panics
    /// If the component has no such output.
    #[must_use]
    pub fn sending(mut self, port: &str, ticks: Option<SampleTicks>) -> Self {
        self.sends[OutputNumber::of::<C::Outputs>(port).0] = ticks;
        self
    }

    /// The component.
    #[must_use]
    pub fn component(&self) -> &C {
        &self.component
    }

    /// Makes the next step take the place of a process that sent `outputs` last and transferred no state.
    pub fn replaces(&mut self, outputs: C::Outputs) {
        self.predecessor = Some(SampleMemory::of(outputs));
    }

    /// Computes the next tick.
    ///
    /// # Errors
    /// As [`Component::step`].
    pub fn step(&mut self, inputs: C::Inputs<'_>) -> Result<C::Outputs, StepError> {
        let predecessor = self.predecessor.take();
        let context = StepContext {
            tick: self.tick,
            time_ns: u64::from(self.tick) * self.tick_ns,
            sends: &self.sends,
            predecessor: predecessor.as_ref().map(|sent| sent as &dyn SampleSource),
            given: None,
        };
        self.tick += self.period_ticks;
        self.component.step(&context, inputs, &mut self.state)
    }
}

impl<C: Component> Harness<C> {
    /// Bytes of the state.
    ///
    /// # Panics
    /// If the state leaves a byte unwritten.
    #[must_use]
    pub fn saved(&self) -> Vec<u8> {
        let saved = |fill: u8| {
            let mut bytes = vec![fill; self.state.size()];
            self.state.save(&mut bytes);
            bytes
        };
        let bytes = saved(0x55);
        assert!(bytes == saved(0xaa), "the state of {} leaves bytes unwritten", C::INFO.name);
        bytes
    }

    /// Steps a component, loads its state into a second one amid the run, and steps both. Requires the same outputs
    /// and the same bytes of the state from both. `inputs` returns the inputs of a step.
    ///
    /// # Panics
    /// If they differ, or a step fails.
    #[track_caller]
    pub fn require_transfer<'i>(make: impl Fn() -> Self, inputs: impl Fn(u32) -> C::Inputs<'i>) {
        const ALONE: u32 = 777;
        const TOGETHER: u32 = 1223;
        let (mut first, mut second) = (make(), make());
        let step = |harness: &mut Self| {
            let outputs = harness.step(inputs(harness.tick)).unwrap_or_else(|error| panic!("{error}"));
            SampleMemory::of(outputs)
        };
        for _ in 0..ALONE {
            step(&mut first);
        }
        second.state.load(&first.saved()).unwrap_or_else(|error| panic!("{error}"));
        second.tick = first.tick;
        for _ in 0..TOGETHER {
            let tick = first.tick;
            assert!(step(&mut second) == step(&mut first), "other outputs at tick {tick}");
            assert!(second.saved() == first.saved(), "another state after tick {tick}");
        }
    }
}
