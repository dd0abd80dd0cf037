//! A component in a table of components: its declaration, and how one is made, without its type.

use crate::announcement::Announcement;
use crate::context::{NodeContext, StepContext};
use crate::interface::{Component, FirstFailure, Info, Role, State, StateError, StepError, Transfer};
use crate::parameters::{self, Parameter, Parameters};
use crate::ports::{InputPorts, InputSamples, Inputs, OutputPorts, OutputSamples, PortSpec};
use crate::sample_ticks::SampleTicks;
use crate::schema::Schema;
use diagnostics::ParameterError;
use inputs::FileKind;
use serde_json::Value;

/// A component in a table of components, with everything that a launcher must know about it.
#[derive(Clone, Copy, Debug)]
pub struct Registration {
    /// Name in manifests.
    pub name: &'static str,
    /// Summary in one line.
    pub summary: &'static str,
    /// Its role in a run.
    pub role: Role,
    /// As [`Info::needs_state`].
    pub needs_state: Option<&'static str>,
    /// As [`Info::first_failure`].
    pub first_failure: Option<FirstFailure>,
    /// Inputs.
    pub inputs: Inputs,
    /// Outputs.
    pub outputs: &'static [PortSpec],
    /// Transfer of its state to the process that takes its place.
    pub transfer: Transfer,
    /// Parameters in a manifest.
    pub parameters: &'static [Parameter],
    period: fn(&Value, u64) -> Option<u32>,
    sample_ticks: fn(&Value, u64, u32) -> Option<SampleTicks>,
    check: fn(&Value, &NodeContext<'_>) -> Result<(), ParameterError>,
    faults: fn(&Value) -> Vec<ParameterError>,
    without_faults: fn(&Value) -> Option<Value>,
    make: Make,
}

type Make = fn(&Value, &NodeContext<'_>) -> Result<Box<dyn Instance>, ParameterError>;

impl Registration {
    /// The component `C`.
    #[must_use]
    pub const fn of<C: Component + 'static>() -> Self {
        let Info { name, summary, role, needs_state, first_failure } = C::INFO;
        Self {
            name,
            summary,
            role,
            needs_state,
            first_failure,
            inputs: <C::Inputs<'static> as InputPorts<'static>>::DECLARED,
            outputs: C::Outputs::DECLARED,
            transfer: C::State::TRANSFER,
            parameters: C::Parameters::DECLARED,
            period: |parameters, tick_ns| {
                let parameters = diagnostics::read::<C::Parameters>(parameters).ok()?;
                Some(C::period_ticks(&parameters, tick_ns))
            },
            sample_ticks: |parameters, tick_ns, period_ticks| {
                let parameters = diagnostics::read::<C::Parameters>(parameters).ok()?;
                Some(C::sample_ticks(&parameters, tick_ns, period_ticks))
            },
            check: |parameters, context| make::<C>(parameters, context)?.rehearse(context),
            faults: parameters::faults::<C::Parameters>,
            without_faults: parameters::without_faults::<C::Parameters>,
            make: |parameters, context| {
                let component = make::<C>(parameters, context)?;
                Ok(Box::new(Made { state: component.initial(), component }))
            },
        }
    }

    /// True if it has a parameter called `name`.
    #[must_use]
    pub fn has_parameter(&self, name: &str) -> bool {
        self.parameter(name).is_some()
    }

    /// True if its parameter called `name` counts only at the start.
    #[must_use]
    pub fn is_initial(&self, name: &str) -> bool {
        self.parameter(name).is_some_and(|parameter| parameter.is_initial)
    }

    fn parameter(&self, name: &str) -> Option<&'static Parameter> {
        self.parameters.iter().find(|parameter| parameter.name == name)
    }

    /// Kind of the file that its parameter called `name` names; `None` if the component declares none.
    #[must_use]
    pub fn file(&self, name: &str) -> Option<FileKind> {
        self.parameter(name)?.file
    }

    /// As [`Component::period_ticks`]: at least one, and one of parameters that [`check`](Self::check) refuses.
    #[must_use]
    pub fn period_ticks(&self, parameters: &Value, tick_ns: u64) -> u32 {
        (self.period)(parameters, tick_ns).unwrap_or(1).max(1)
    }

    /// As [`Component::sample_ticks`]: all at which the node computes, of parameters that [`check`](Self::check) refuses.
    #[must_use]
    pub fn sample_ticks(&self, parameters: &Value, tick_ns: u64, period_ticks: u32) -> SampleTicks {
        let ticks = (self.sample_ticks)(parameters, tick_ns, period_ticks);
        ticks.unwrap_or(SampleTicks::every(period_ticks))
    }

    /// Checks `parameters` and the files that they name for a node, without running it.
    ///
    /// # Errors
    /// The first of [`Self::faults`]; without those, the parameters and files that are not valid or do not go together,
    /// as far as one does not follow from another.
    pub fn check(&self, parameters: &Value, context: &NodeContext<'_>) -> Result<(), ParameterError> {
        (self.check)(parameters, context)
    }

    /// All faults of `parameters` that can be found without a node: keys that are unknown, values of a wrong type and numbers out of
    /// their ranges. None follows from another.
    #[must_use]
    pub fn faults(&self, parameters: &Value) -> Vec<ParameterError> {
        (self.faults)(parameters)
    }

    /// All faults of the files that `parameters` name for a node, although others of `parameters` are faulty. `context` gets warnings
    /// that may follow from the faults.
    #[must_use]
    pub fn faults_of_files(&self, parameters: &Value, context: &NodeContext<'_>) -> Vec<ParameterError> {
        let Some(rest) = (self.without_faults)(parameters) else { return Vec::new() };
        let errors = (self.check)(&rest, context).err().map_or(Vec::new(), ParameterError::into_each);
        errors.into_iter().filter(|error| matches!(error, ParameterError::File { .. })).collect()
    }

    /// The component, made of `parameters` for the node that `context` describes.
    ///
    /// # Errors
    /// The parameters or files that are not valid.
    #[doc(hidden)]
    pub fn make(
        &self,
        parameters: &Value,
        context: &NodeContext<'_>,
    ) -> Result<Box<dyn Instance>, ParameterError> {
        (self.make)(parameters, context)
    }

    /// The messages of its ports.
    pub fn messages(&self) -> impl Iterator<Item = &'static Schema> {
        let (inputs, one) = match self.inputs {
            Inputs::Ports(ports) => (ports, None),
            Inputs::Many(schema) => (&[] as &[_], Some(schema)),
            Inputs::Any | Inputs::Forwarded { .. } => (&[] as &[_], None),
        };
        inputs.iter().chain(self.outputs).map(|port| port.schema).chain(one)
    }
}

/// The message called `type_name` among those of `components`.
#[must_use]
pub fn message_of(components: &'static [Registration], type_name: &str) -> Option<&'static Schema> {
    components.iter().flat_map(Registration::messages).find(|schema| schema.type_name == type_name)
}

fn make<C: Component>(parameters: &Value, context: &NodeContext<'_>) -> Result<C, ParameterError> {
    make_of(diagnostics::read(parameters)?, context)
}

/// Makes a component of parameters that are within their ranges.
pub(crate) fn make_of<C: Component>(
    parameters: C::Parameters,
    context: &NodeContext<'_>,
) -> Result<C, ParameterError> {
    parameters.validate()?;
    C::new(parameters, context)
}

/// A component with its state, without their types. Its steps do not allocate.
#[doc(hidden)]
pub trait Instance: Send {
    /// As [`State::configuration`].
    fn configuration(&self) -> u64;
    /// As [`State::size`].
    fn state_size(&self) -> usize;
    /// As [`State::save`].
    fn save(&self, bytes: &mut [u8]);
    /// As [`State::load`].
    fn load(&mut self, bytes: &[u8]) -> Result<(), StateError>;
    /// As [`State::adopt`].
    fn adopt(&mut self, bytes: &[u8]) -> Result<bool, StateError>;
    fn connected(&mut self, topics: &[(&str, &Announcement)]) -> Result<(), StepError>;
    fn step(
        &mut self,
        context: &StepContext<'_>,
        inputs: InputSamples<'_>,
        outputs: &mut OutputSamples<'_>,
    ) -> Result<(), StepError>;
    /// As [`Component::remark`].
    fn remark(&self) -> Option<String>;
    fn finish(&mut self) -> Result<(), StepError>;
}

/// A component that was made, and its state.
struct Made<C: Component> {
    component: C,
    state: C::State,
}

impl<C: Component> Instance for Made<C> {
    fn configuration(&self) -> u64 {
        self.state.configuration()
    }

    fn state_size(&self) -> usize {
        self.state.size()
    }

    fn save(&self, bytes: &mut [u8]) {
        self.state.save(bytes);
    }

    fn load(&mut self, bytes: &[u8]) -> Result<(), StateError> {
        self.state.load(bytes)
    }

    fn adopt(&mut self, bytes: &[u8]) -> Result<bool, StateError> {
        self.state.adopt(bytes)
    }

    fn connected(&mut self, topics: &[(&str, &Announcement)]) -> Result<(), StepError> {
        self.component.connected(topics, &mut self.state)
    }

    fn step(
        &mut self,
        context: &StepContext<'_>,
        inputs: InputSamples<'_>,
        outputs: &mut OutputSamples<'_>,
    ) -> Result<(), StepError> {
        // By reference: the outputs of a plant are two kilobytes, which each move would copy.
        match self.component.step(context, C::Inputs::read(inputs), &mut self.state) {
            Ok(ref sent) => Ok(sent.write(outputs)?),
            Err(error) => Err(error),
        }
    }

    fn remark(&self) -> Option<String> {
        self.component.remark(&self.state)
    }

    fn finish(&mut self) -> Result<(), StepError> {
        self.component.finish(&mut self.state)
    }
}
