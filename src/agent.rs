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
//! agent::acting(&mut actions, || simulation.step())?;
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
use std::cell::RefCell;
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

/// Actions of the agents of a simulation, by their names.
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

thread_local! {
    /// Actions of the simulation that this thread steps, by the names of their nodes.
    static ACTIONS: RefCell<Actions> = RefCell::default();
}

/// Runs `step` on this thread, whose agents send `actions`.
pub fn acting<R>(actions: &mut Actions, step: impl FnOnce() -> R) -> R {
    ACTIONS.with_borrow_mut(|current| std::mem::swap(current, actions));
    let stepped = step();
    ACTIONS.with_borrow_mut(|current| std::mem::swap(current, actions));
    stepped
}

/// A node that sends the values that the host of the simulation has set.
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

    fn step(&self, _: &StepContext<'_>, (): (), (): &mut ()) -> Result<Outputs, StepError> {
        let action = ACTIONS.with_borrow(|actions| actions.get(&self.name).cloned()).unwrap_or_default();
        let Action { command, set_point, reference } = action;
        Ok(Outputs { command, set_point, reference })
    }
}
