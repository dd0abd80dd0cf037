//! Wiring of the variables of the FMU to the fields of the ports.

use crate::description::{Causality, Description, Variable, Version};
use crate::fields::{self, Field};
use crate::units::{self, BaseUnit, Conversion};
use crate::values::{Number, Values};
use bus::dynamic::DynamicTick;
use bus::schema::Schema;
use diagnostics::did_you_mean;
use serde::Deserialize;
use std::collections::BTreeMap;

/// The fields of a variable as a manifest names them: `PORT.FIELD`, or a list for an array.
#[derive(Clone, Debug, Deserialize)]
#[serde(untagged)]
pub enum Paths {
    /// One path: a number, or as many as the variable has elements.
    One(String),
    /// A path for each part of an array.
    Many(Vec<String>),
}

/// Fields by variable.
pub type Mapping = BTreeMap<String, Paths>;

/// A port of the node with its message.
#[derive(Clone, Debug)]
pub struct Port {
    /// Its name in the manifest.
    pub name: String,
    /// Its number in the node.
    pub number: usize,
    /// Its message.
    pub schema: &'static Schema,
}

/// Names that an error lists.
const NAMES_MAX: usize = 40;

/// Direction of ports, with the manifest's word for it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Direction {
    /// From messages to variables.
    Inputs,
    /// From variables to messages.
    Outputs,
}

/// Variables of one type, which are set or read together.
#[derive(Clone, Debug)]
pub struct Group {
    /// Their handles.
    pub references: Vec<u32>,
    /// Their values, array by array.
    pub values: Values,
    /// The field of each value.
    links: Vec<Link>,
}

/// A value's field.
#[derive(Clone, Debug)]
struct Link {
    variable: String,
    port: Port,
    field: Field,
    conversion: Conversion,
}

impl Direction {
    fn word(self) -> &'static str {
        match self {
            Self::Inputs => "inputs",
            Self::Outputs => "outputs",
        }
    }
}

/// The groups of `mapping`, whose fields are in the messages of `ports`.
///
/// # Errors
/// A variable or a field that there is not, one with another unit or number of elements, or a port that nothing uses; with the
/// key.
pub fn groups(
    direction: Direction,
    mapping: &Mapping,
    description: &Description,
    ports: &[Port],
) -> Result<Vec<Group>, String> {
    let mut groups: Vec<Group> = Vec::new();
    for (name, paths) in mapping {
        let key = format!("parameters.{}.{name}", direction.word());
        let variable = find(description, name).map_err(|reason| format!("`{key}`: {reason}"))?;
        let links = links(direction, variable, paths, description, ports);
        add(&mut groups, variable, links.map_err(|reason| format!("`{key}` {reason}"))?, description.version)
            .ok_or_else(|| format!("`{key}` is a string, which no message holds"))?;
    }
    let linked = || groups.iter().flat_map(|group| &group.links);
    for port in ports {
        if !linked().any(|link| link.port.name == port.name) {
            let (word, name) = (direction.word(), &port.name);
            return Err(format!(
                "`{word}.{name}` is wired, and no variable of parameters.{word} names a field of it, such as \
                 `{name}.{}`",
                fields::all(port.schema).last().map_or("", |field| field.path.as_str())
            ));
        }
    }
    if direction == Direction::Outputs {
        require_each_once(linked())?;
    }
    Ok(groups)
}

/// The variable `name`.
///
/// # Errors
/// There is none, with the nearest and the names that there are.
pub fn find<'d>(description: &'d Description, name: &str) -> Result<&'d Variable, String> {
    description.variable(name).ok_or_else(|| {
        let exchanged =
            description.variables.iter().filter(|variable| variable.causality != Causality::Other);
        let names = exchanged.map(|variable| variable.name.as_str()).take(NAMES_MAX);
        format!("the FMU has no variable `{name}`; {}", did_you_mean(name, names, "it has"))
    })
}

fn links(
    direction: Direction,
    variable: &Variable,
    paths: &Paths,
    description: &Description,
    ports: &[Port],
) -> Result<Vec<Link>, String> {
    if direction == Direction::Inputs && variable.causality != Causality::Input {
        return Err("is no input of the FMU; parameters.start sets parameters".to_owned());
    }
    let elements =
        variable.elements.ok_or("is an array whose size parameters decide; fixed sizes are known here")?;
    let paths = match paths {
        Paths::One(path) => std::slice::from_ref(path),
        Paths::Many(paths) => paths.as_slice(),
    };
    let mut links = Vec::new();
    for path in paths {
        let (port, named) = fields_of(direction, path, ports)?;
        // A sequence has room for more than an array needs.
        let room = if named.iter().all(|field| field.sequence.is_some()) {
            elements.saturating_sub(links.len()).max(1)
        } else {
            named.len()
        };
        for field in named.into_iter().take(room) {
            if direction == Direction::Outputs && field.path.starts_with("stamp.") {
                return Err(format!("is `{path}`: the bus fills in the stamp"));
            }
            let conversion = conversion(variable, &field, description)?;
            links.push(Link { variable: variable.name.clone(), port: port.clone(), field, conversion });
        }
    }
    if links.len() == elements {
        return Ok(links);
    }
    Err(format!("has {elements} elements, and {paths:?} are {} fields", links.len()))
}

/// The port of `path` and the fields that it means.
fn fields_of<'p>(
    direction: Direction,
    path: &str,
    ports: &'p [Port],
) -> Result<(&'p Port, Vec<Field>), String> {
    let Some((name, field)) = path.split_once('.') else {
        return Err(format!("is `{path}`; a field is `PORT.FIELD`, such as `state.position.z`"));
    };
    let Some(port) = ports.iter().find(|port| port.name == name) else {
        let names = ports.iter().map(|port| port.name.as_str());
        let help = did_you_mean(name, names, "they are");
        return Err(format!("is `{path}`: the {} of the process have no `{name}`; {help}", direction.word()));
    };
    let all = fields::all(port.schema);
    let named: Vec<Field> = fields::named(&all, field).into_iter().cloned().collect();
    if !named.is_empty() {
        return Ok((port, named));
    }
    let help = did_you_mean(field, all.iter().map(|field| field.path.as_str()), "it has");
    Err(format!("is `{path}`: {} has no field `{field}`; {help}", port.schema.type_name))
}

fn conversion(variable: &Variable, field: &Field, description: &Description) -> Result<Conversion, String> {
    let Some(unit) = &variable.unit else { return Ok(Conversion::NONE) };
    let defined = description.units.get(unit).copied();
    let defined =
        defined.map(|unit| if variable.is_relative { BaseUnit { offset: 0.0, ..unit } } else { unit });
    units::conversion(field.unit, unit, defined)
}

/// Adds a variable to the group of its type; `None` for a string.
fn add(groups: &mut Vec<Group>, variable: &Variable, links: Vec<Link>, version: Version) -> Option<()> {
    let empty = Values::zeros(variable.value_type, 0, version == Version::Two)?;
    let same = |group: &&mut Group| std::mem::discriminant(&group.values) == std::mem::discriminant(&empty);
    let Some(group) = groups.iter_mut().find(same) else {
        groups.push(Group { references: Vec::new(), values: empty, links: Vec::new() });
        return add(groups, variable, links, version);
    };
    group.references.push(variable.reference);
    group.links.extend(links);
    group.values = Values::zeros(variable.value_type, group.links.len(), version == Version::Two)?;
    Some(())
}

/// Refuses a field that two variables write, and a sequence with a gap.
fn require_each_once<'l>(links: impl Iterator<Item = &'l Link> + Clone) -> Result<(), String> {
    for link in links.clone() {
        let same = |other: &&Link| other.port.name == link.port.name && other.field.path == link.field.path;
        let place = format!("`{}.{}`", link.port.name, link.field.path);
        if links.clone().filter(same).count() > 1 {
            return Err(format!("parameters.outputs: more than one variable writes {place}"));
        }
        let Some((sequence, index)) = link.field.sequence else { continue };
        let before = |other: &&Link| {
            other.port.name == link.port.name
                && other.field.sequence.is_some_and(|(place, other)| place == sequence && other < index)
        };
        if links.clone().filter(before).count() < index {
            return Err(format!("parameters.outputs: {place} is written, and not all values before it"));
        }
    }
    Ok(())
}

impl Group {
    /// Takes the values of the variables from the newest samples.
    ///
    /// # Errors
    /// A number that the variable's type does not hold, or a sequence that is too short.
    pub fn take(&mut self, tick: &DynamicTick<'_, '_>) -> Result<(), String> {
        for (index, link) in self.links.iter().enumerate() {
            let message = tick.input(link.port.number)?;
            let number = link.field.read(message).ok_or_else(|| link.too_short())?;
            let number = link.converted(number, |conversion, number| conversion.to_variable(number));
            self.values.set(index, number).ok_or_else(|| link.refused(number, self.values.name()))?;
        }
        Ok(())
    }

    /// Gives the values of the variables to the samples of this tick that are due.
    ///
    /// # Errors
    /// A number that the field's type does not hold.
    pub fn give(&self, tick: &mut DynamicTick<'_, '_>) -> Result<(), String> {
        for (index, link) in self.links.iter().enumerate() {
            // Where none is due, none is written.
            let Some(message) = tick.output(link.port.number)? else { continue };
            let number =
                link.converted(self.values.get(index), |conversion, number| conversion.to_field(number));
            let type_name = link.field.primitive.ros_name();
            link.field.write(message, number).ok_or_else(|| link.refused(number, type_name))?;
        }
        Ok(())
    }
}

impl Link {
    /// A number in the unit of the other side; what needs no conversion stays as it is, integers too.
    fn converted(&self, number: Number, convert: impl Fn(Conversion, f64) -> f64) -> Number {
        if self.conversion.is_none() {
            number
        } else {
            Number::Float(convert(self.conversion, number.float()))
        }
    }

    fn too_short(&self) -> String {
        let (place, variable) = (format!("{}.{}", self.port.name, self.field.path), &self.variable);
        format!("the variable `{variable}` is `{place}`, and the sample has fewer values")
    }

    fn refused(&self, number: Number, expected: &str) -> String {
        let (place, variable) = (format!("{}.{}", self.port.name, self.field.path), &self.variable);
        format!("the variable `{variable}` is `{place}`: {number} is not {expected}")
    }
}
