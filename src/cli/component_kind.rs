//! A kind that a manifest may name, as its documentation shows it.

use bus::Registration;
use bus::component::{Role, Transfer};
use bus::parameters::Parameter;
use bus::ports::{Inputs, PortSpec};
use bus::schema::Schema;
use hummingbus::COMPONENTS;
use runtime::registry::NodeProgram;

/// A kind of a manifest.
#[derive(Clone, Copy)]
pub(crate) enum Kind {
    Component(&'static Registration),
    Program(&'static NodeProgram),
}

/// Every kind.
pub(crate) fn all() -> impl Iterator<Item = Kind> {
    COMPONENTS.iter().map(Kind::Component).chain(COMPONENTS.programs().iter().map(Kind::Program))
}

impl Kind {
    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Component(component) => component.name,
            Self::Program(program) => program.name,
        }
    }

    pub(crate) fn summary(self) -> String {
        match self {
            Self::Component(component) => component.summary.to_owned(),
            Self::Program(program) => format!("{}; a process of its own", program.summary),
        }
    }

    /// Parameters in a manifest: recorders and judges are given theirs by the launcher.
    pub(crate) fn parameters(self) -> &'static [Parameter] {
        match self {
            Self::Component(component) if component.role == Role::Compute => component.parameters,
            Self::Component(_) => &[],
            Self::Program(program) => program.parameters,
        }
    }

    /// Inputs with a declaration.
    pub(crate) fn inputs(self) -> &'static [PortSpec] {
        match self {
            Self::Component(Registration { inputs: Inputs::Ports(ports), .. }) => ports,
            Self::Component(_) | Self::Program(_) => &[],
        }
    }

    /// Other inputs, in words; empty if there are none.
    pub(crate) fn other_inputs(self) -> String {
        match self {
            Self::Component(component) => match component.inputs {
                Inputs::Ports(_) => String::new(),
                Inputs::Many(schema) => format!("any number of {}", type_name(schema)),
                Inputs::Any => "any topics".to_owned(),
                Inputs::Forwarded { bytes_max } => format!("any topics of at most {bytes_max} bytes"),
            },
            Self::Program(_) => "the ports that the manifest names".to_owned(),
        }
    }

    /// Outputs with a declaration.
    pub(crate) fn outputs(self) -> &'static [PortSpec] {
        match self {
            Self::Component(component) => component.outputs,
            Self::Program(_) => &[],
        }
    }

    /// Other outputs, in words; empty if there are none.
    pub(crate) fn other_outputs(self) -> &'static str {
        match self {
            Self::Component(Registration { inputs: Inputs::Forwarded { .. }, .. }) => "each input's topic",
            Self::Component(_) => "",
            Self::Program(_) => "the ports that the manifest names",
        }
    }

    /// The state that it hands over, in words.
    pub(crate) fn state(self) -> &'static str {
        let Self::Component(component) = self else { return "what it can save" };
        match component.transfer {
            Transfer::Message(schema) => type_name(schema),
            Transfer::Bytes(type_name) => short(type_name),
            Transfer::Nothing => "–",
            Transfer::File | Transfer::Growing(_) => "cannot be replaced",
            Transfer::External(_) => "cannot be saved",
        }
    }
}

/// A message's name without its package.
pub(crate) fn type_name(schema: &Schema) -> &'static str {
    short(schema.type_name)
}

/// The name of a type without its package.
fn short(type_name: &'static str) -> &'static str {
    type_name.rsplit('/').next().unwrap_or(type_name)
}
