//! A component in a table of components: its declaration, and how one is made, without its type.

use crate::announcement::Announcement;
use crate::component::{Component, Info, Role, State, StepError, Transfer};
use crate::context::{NodeContext, StepContext};
use crate::parameter_names;
use crate::plan::{NodePlan, Plan};
use crate::ports::{InputPorts, InputSamples, Inputs, OutputPorts, OutputSamples, PortSpec};
use crate::schema::Schema;
use diagnostics::ParameterError;
use inputs::InputFiles;
use serde_json::Value;

/// A component in a table of components: all that a launcher must know of it.
#[derive(Clone, Copy, Debug)]
pub struct Registration {
    /// Name in manifests.
    pub name: &'static str,
    /// What it does, in one line.
    pub summary: &'static str,
    /// What it does for a run.
    pub role: Role,
    /// Inputs.
    pub inputs: Inputs,
    /// Outputs.
    pub outputs: &'static [PortSpec],
    /// What happens to its state when another process takes its place.
    pub transfer: Transfer,
    parameters: fn() -> &'static [&'static str],
    check: fn(&Value, &NodeContext<'_>) -> Result<(), ParameterError>,
    make: Make,
}

type Make = fn(&Value, &NodeContext<'_>) -> Result<Box<dyn Stepper>, ParameterError>;

impl Registration {
    /// The component `C`.
    #[must_use]
    pub const fn of<C: Component + 'static>() -> Self {
        let Info { name, summary, role } = C::INFO;
        Self {
            name,
            summary,
            role,
            inputs: <C::Inputs<'static> as InputPorts<'static>>::DECLARED,
            outputs: C::Outputs::DECLARED,
            transfer: C::State::TRANSFER,
            parameters: parameter_names::of::<C::Parameters>,
            check: |parameters, context| make::<C>(parameters, context)?.rehearse(context),
            make: |parameters, context| Ok(Box::new(make::<C>(parameters, context)?)),
        }
    }

    /// The names of its parameters.
    #[must_use]
    pub fn parameters(&self) -> &'static [&'static str] {
        (self.parameters)()
    }

    /// Checks `parameters` and the files that they name for a node, without running it.
    ///
    /// # Errors
    /// What cannot be meant.
    pub fn check(&self, parameters: &Value, context: &NodeContext<'_>) -> Result<(), ParameterError> {
        (self.check)(parameters, context)
    }

    /// The component, made for `node` of `plan` from the run's `files`.
    pub(crate) fn make_for(
        &self,
        plan: &Plan,
        node: &NodePlan,
        files: &InputFiles,
    ) -> Result<Box<dyn Stepper>, ParameterError> {
        let inputs: Vec<&str> = node.inputs.iter().map(|input| input.port.as_str()).collect();
        let outputs: Vec<&str> = node.outputs.iter().map(|output| output.port.as_str()).collect();
        let context = NodeContext::new(&node.name, &inputs)
            .naming(&outputs)
            .timed(plan.tick_ns, node.period_ticks, plan.duration_ticks)
            .seeded(plan.seed)
            .given(files);
        (self.make)(&node.parameters, &context)
    }

    /// Bytes of its state.
    pub(crate) fn state_bytes(&self) -> usize {
        match self.transfer {
            Transfer::Message(schema) => schema.size,
            Transfer::Nothing | Transfer::Internal => 0,
        }
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
    C::new(diagnostics::read(parameters)?, context)
}

/// A component that was made, without its type; its state is kept by whoever steps it.
pub(crate) trait Stepper {
    /// The bytes of the state before the first tick, in words.
    fn initial(&self) -> Box<[u64]>;
    fn connected(&mut self, topics: &[(&str, &Announcement)]) -> Result<(), StepError>;
    fn step(
        &mut self,
        context: &StepContext<'_>,
        inputs: InputSamples<'_>,
        state: &mut [u8],
        outputs: &mut OutputSamples<'_>,
    ) -> Result<(), StepError>;
    fn finish(&mut self) -> Result<(), StepError>;
}

impl<C: Component> Stepper for C {
    fn initial(&self) -> Box<[u64]> {
        let state = Component::initial(self);
        let mut words = vec![0; size_of::<C::State>().div_ceil(8)].into_boxed_slice();
        bytemuck::cast_slice_mut(&mut words)[..size_of::<C::State>()]
            .copy_from_slice(bytemuck::bytes_of(&state));
        words
    }

    fn connected(&mut self, topics: &[(&str, &Announcement)]) -> Result<(), StepError> {
        Component::connected(self, topics)
    }

    fn step(
        &mut self,
        context: &StepContext<'_>,
        inputs: InputSamples<'_>,
        state: &mut [u8],
        outputs: &mut OutputSamples<'_>,
    ) -> Result<(), StepError> {
        let sent = Component::step(self, context, C::Inputs::read(inputs), bytemuck::from_bytes_mut(state))?;
        Ok(sent.write(outputs)?)
    }

    fn finish(&mut self) -> Result<(), StepError> {
        Component::finish(self)
    }
}
