//! A component in a table of components: its declaration, and how one is made, without its type.

use crate::announcement::Announcement;
use crate::component::{Component, Info, State, StepError, Transfer};
use crate::context::{NodeContext, StepContext};
use crate::ports::{InputPorts, InputSamples, Inputs, OutputPorts, OutputSamples, PortSpec};
use serde::de::DeserializeOwned;
use serde_json::Value;

/// A component in a table of components: all that a launcher must know of it.
#[derive(Clone, Copy, Debug)]
pub struct Registration {
    /// Name, summary and role.
    pub info: Info,
    /// Inputs.
    pub inputs: Inputs,
    /// Outputs.
    pub outputs: &'static [PortSpec],
    /// What happens to its state when another process takes its place.
    pub transfer: Transfer,
    pub(crate) make: fn(&Value, &NodeContext<'_>) -> Result<Box<dyn Stepper>, String>,
    check: fn(&Value, &NodeContext<'_>) -> Result<(), String>,
}

impl Registration {
    /// The component `C`.
    #[must_use]
    pub const fn of<C: Component + 'static>() -> Self {
        Self {
            info: C::INFO,
            inputs: <C::Inputs<'static> as InputPorts<'static>>::DECLARED,
            outputs: C::Outputs::DECLARED,
            transfer: C::State::TRANSFER,
            make: |parameters, context| Ok(Box::new(make::<C>(parameters, context)?)),
            check: |parameters, context| make::<C>(parameters, context)?.rehearse(context),
        }
    }

    /// Name in manifests.
    #[must_use]
    pub const fn name(&self) -> &'static str {
        self.info.name
    }

    /// Checks `parameters` and the files that they name for a node, without running it.
    ///
    /// # Errors
    /// What cannot be meant, the key in backticks.
    pub fn check(&self, parameters: &Value, context: &NodeContext<'_>) -> Result<(), String> {
        (self.check)(parameters, context)
    }
}

fn make<C: Component>(parameters: &Value, context: &NodeContext<'_>) -> Result<C, String> {
    C::new(read_parameters(parameters)?, context)
}

/// Reads the parameters of a component; the error names the key.
///
/// # Errors
/// What does not fit `P`.
pub fn read_parameters<P: DeserializeOwned>(parameters: &Value) -> Result<P, String> {
    serde_path_to_error::deserialize(parameters).map_err(|error| {
        let (path, words) = (error.path().to_string(), error.inner().to_string());
        // An unknown or missing key is named by the words already.
        if path == "." || words.contains("field `") { words } else { format!("`{path}`: {words}") }
    })
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
