//! Simulations as FMUs: what such an FMU holds, and how it is written.
//!
//! In its resources lies what a run directory has, the plan and the input files, and `model.json`: the variables. The
//! library of `bindings/fmu-export` steps the nodes of the plan.

mod description;
mod write;

use crate::description::Version;
use crate::fields::{self, Field};
use bus::schema::{Primitive, Schema};
use serde::{Deserialize, Serialize};

pub use write::{Contents, write};

/// Name of the model's file in the resources.
pub const MODEL: &str = "model.json";
/// Name of the parameter with the seed of the run.
pub const SEED: &str = "seed";
/// Handle of the time.
pub const TIME_REFERENCE: u32 = 0;
/// Handle of the seed.
pub const SEED_REFERENCE: u32 = 1;
/// Handle of the first variable.
pub const FIRST_REFERENCE: u32 = 2;

/// A simulation as an FMU has it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Model {
    /// Name of the model and of its library.
    pub name: String,
    /// Text that the importer hands to the library, which compares it.
    pub token: String,
    /// Time of a tick, s.
    pub tick_s: f64,
    /// Duration of the run that it was made from, s.
    pub duration_s: f64,
    /// Seed of that run.
    pub seed: u64,
    /// The node in whose place the importer stands.
    pub agent: String,
    /// Kinds of the nodes that are stepped, with their numbers in the plan.
    pub members: Vec<(usize, String)>,
    /// Variables; the handle of the first is [`FIRST_REFERENCE`].
    pub variables: Vec<ModelVariable>,
}

/// A variable of a simulation.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ModelVariable {
    /// Its name, such as `plant.state.position.z`.
    pub name: String,
    /// Its meaning.
    pub description: String,
    /// Its unit.
    pub unit: String,
    /// Message that it is a field of.
    pub source: Source,
    /// Type of that message.
    pub type_name: String,
    /// Path of the field.
    pub path: String,
    /// True for a small integer; everything else is a double.
    pub is_integer: bool,
    /// Value before the first step.
    pub start: f64,
}

/// Message of a variable.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Source {
    /// An output of the node in whose place the importer stands: an input of the FMU.
    Port(String),
    /// A topic: outputs of the FMU.
    Topic(String),
}

impl ModelVariable {
    /// The variables of the message `schema` from `source`, under names that begin with `prefix`: all numbers but stamps and padding. Of
    /// a sequence those that `example` has. `example` gives their start values.
    #[must_use]
    pub fn all(prefix: &str, source: &Source, schema: &'static Schema, example: &[u8]) -> Vec<Self> {
        let is_number = |part: &str| part != "stamp" && !part.starts_with("pad");
        let fields = fields::all(schema).into_iter().filter(|field| field.path.split('.').all(is_number));
        let variables = fields.filter_map(|field| {
            let start = field.read(example)?.float();
            Some(Self {
                name: format!("{prefix}.{}", field.path),
                description: format!("{} of {}", field.path, schema.type_name),
                unit: field.unit.to_owned(),
                source: source.clone(),
                type_name: schema.type_name.to_owned(),
                path: field.path,
                is_integer: matches!(
                    field.primitive,
                    Primitive::I32 | Primitive::I16 | Primitive::U16 | Primitive::I8 | Primitive::U8
                ),
                start,
            })
        });
        variables.collect()
    }

    /// True for an input of the FMU.
    #[must_use]
    pub fn is_input(&self) -> bool {
        matches!(self.source, Source::Port(_))
    }

    /// Its field in messages of `schema`.
    #[must_use]
    pub fn field(&self, schema: &'static Schema) -> Option<Field> {
        fields::all(schema).into_iter().find(|field| field.path == self.path)
    }
}

/// The version of the standard called `text`: `2` or `3`.
#[must_use]
pub fn version_of(text: &str) -> Option<Version> {
    match text {
        "2" | "2.0" => Some(Version::Two),
        "3" | "3.0" => Some(Version::Three),
        _ => None,
    }
}
