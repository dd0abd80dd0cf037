//! The component `agent`: a controller or pilot in the program that steps a simulation, such as a program in Python
//! or the importer of an FMU.
//!
//! ```
//! use bus::messages::{MotorCommand, PlantState};
//! use hummingbus::{agent, bus, runtime};
//!
//! let text = "[run]\nrate_hz = 1000\nduration_s = 1.0\n[process.pilot]\nkind = \"agent\"\noutputs.command = {}\n";
//! let manifest = hummingbus::Manifest::parse(text.to_owned(), "fall.toml".as_ref(), &[], agent::registry())?;
//! let mut simulation = runtime::simulate(&manifest)?;
//! let mut actions = agent::Actions::default();
//! let command = MotorCommand { command: [76.5; 4].into(), ..Default::default() };
//! actions.entry("pilot".to_owned()).or_default().set("command", bytemuck::bytes_of(&command))?;
//! simulation.step_given(&actions)?;
//! let sent = simulation.topic::<MotorCommand>("/pilot/command")?;
//! assert_eq!(simulation.newest(sent).unwrap().command[3], 76.5);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

use crate::COMPONENTS;
use crate::components::effects;
use bus::component::{Component, Info, StepError};
use bus::context::{NodeContext, StepContext};
use bus::messages::{MotorCommand, Reference, SetPoint};
use bus::{Message, OutputPorts, ParameterError, Registration};
use runtime::registry::Registry;
use std::collections::BTreeMap;
use std::sync::OnceLock;

/// The components of this package, and `agent`.
#[must_use]
pub fn registry() -> Registry {
    static REGISTRY: OnceLock<Registry> = OnceLock::new();
    *REGISTRY.get_or_init(|| {
        let all = [COMPONENTS.components(), &[Registration::of::<Agent>()]].concat();
        Registry::new(all.leak()).with_programs(COMPONENTS.programs()).with_effects(effects)
    })
}

/// Actions of the agents of a simulation, by the names of their nodes.
pub type Actions = BTreeMap<String, Action>;

/// Messages that an agent sends at its next steps.
#[derive(Clone, Debug, Default)]
pub struct Action {
    command: Option<MotorCommand>,
    set_point: Option<SetPoint>,
    reference: Option<Reference>,
}

impl Action {
    /// Sends `message` on output `output` from now on.
    ///
    /// # Errors
    /// There is no such output, or the message has another size.
    pub fn set(&mut self, output: &str, message: &[u8]) -> Result<(), String> {
        match output {
            "command" => read(message).map(|message| self.command = Some(message)),
            "set_point" => read(message).map(|message| self.set_point = Some(message)),
            "reference" => read(message).map(|message| self.reference = Some(message)),
            _ => Err(format!("an agent has no output `{output}`; it has command, set_point, reference")),
        }
    }
}

fn read<T: Message>(message: &[u8]) -> Result<T, String> {
    bytemuck::try_pod_read_unaligned(message).map_err(|_| {
        format!("{} bytes are no {}, which has {}", message.len(), T::SCHEMA.type_name, size_of::<T>())
    })
}

/// A node that sends its messages among the [`Actions`] that [`Simulation::step_given`](bus::Simulation::step_given) gets.
#[derive(Debug)]
pub struct Agent {
    name: String,
}

/// Parameters: none.
#[derive(Debug, bus::Parameters)]
pub struct Parameters {}

/// Outputs, of which the manifest names some.
#[derive(Debug, OutputPorts)]
pub struct Outputs {
    /// To the motors.
    command: Option<MotorCommand>,
    /// To a controller.
    set_point: Option<SetPoint>,
    /// To a controller that follows a trajectory.
    reference: Option<Reference>,
}

impl Component for Agent {
    const INFO: Info = Info::new("agent", "sends what the host of the simulation has set");
    type Parameters = Parameters;
    type Inputs<'a> = ();
    type Outputs = Outputs;
    type State = ();

    fn new(_: Parameters, context: &NodeContext<'_>) -> Result<Self, ParameterError> {
        Ok(Self { name: context.name.to_owned() })
    }

    fn initial(&self) {}

    fn step(&self, context: &StepContext<'_>, (): (), (): &mut ()) -> Result<Outputs, StepError> {
        let actions = context.given::<Actions>();
        let action = actions.and_then(|actions| actions.get(&self.name)).cloned().unwrap_or_default();
        let Action { command, set_point, reference } = action;
        Ok(Outputs { command, set_point, reference })
    }
}

#[cfg(test)]
mod tests {
    use super::{Actions, registry};
    use bus::messages::MotorCommand;
    use runtime::manifest::Manifest;

    #[test]
    fn simulations_of_one_thread_have_actions_of_their_own() {
        let text = "[run]\nduration_s = 1.0\n[process.pilot]\nkind = \"agent\"\noutputs.command = {}\n";
        let mut simulations = [1.0, 2.0].map(|count| {
            let manifest = Manifest::parse(text.to_owned(), "fall.toml".as_ref(), &[], registry()).unwrap();
            let command = MotorCommand { command: [count; 4].into(), ..Default::default() };
            let mut actions = Actions::new();
            let action = actions.entry("pilot".to_owned()).or_default();
            action.set("command", bytemuck::bytes_of(&command)).unwrap();
            (runtime::simulate(&manifest).unwrap(), actions)
        });
        for _ in 0..3 {
            for (simulation, actions) in &mut simulations {
                simulation.step_given(&*actions).unwrap();
            }
        }
        let sent = simulations.map(|(simulation, _)| {
            let topic = simulation.topic::<MotorCommand>("/pilot/command").unwrap();
            simulation.newest(topic).unwrap().command[0]
        });
        assert_eq!(sent, [1.0, 2.0]);
    }
}
