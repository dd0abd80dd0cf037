//! `modelDescription.xml`: the variables of an FMU, their units, and what it can do.
//!
//! Read here and not with `fmi-schema`: its release 0.8 has no units of FMI 2.0, and refuses attributes that it does not know.

use crate::units::{BASE_UNITS, BaseUnit};
use crate::values::ValueType;
use anyhow::{Context, Result, bail};
use roxmltree::{Document, Node};
use std::collections::BTreeMap;

/// Version of the standard.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Version {
    /// FMI 2.0.
    Two,
    /// FMI 3.0.
    Three,
}

/// Part of a variable in the exchange.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Causality {
    /// Set before every step.
    Input,
    /// Read after every step.
    Output,
    /// Set before the first step.
    Parameter,
    /// Decides sizes of arrays, and is set in a mode of its own.
    Structural,
    /// Anything else, such as a local variable.
    Other,
}

/// A variable.
#[derive(Clone, Debug)]
pub struct Variable {
    /// Its name, which is unique.
    pub name: String,
    /// Its handle.
    pub reference: u32,
    /// Its type.
    pub value_type: ValueType,
    /// Its part.
    pub causality: Causality,
    /// Name of its unit, if it has one.
    pub unit: Option<String>,
    /// True if it is a difference, to which the offset of a unit does not apply.
    pub is_relative: bool,
    /// Number of its elements: 1 for a scalar; `None` if parameters decide it.
    pub elements: Option<usize>,
}

/// Description of a co-simulation FMU.
#[derive(Clone, Debug)]
pub struct Description {
    /// Version of the standard.
    pub version: Version,
    /// Name of its library, without the ending.
    pub model_identifier: String,
    /// Text that the library compares: the GUID of FMI 2.0, the instantiation token of 3.0.
    pub token: String,
    /// Its variables, in the order of the file.
    pub variables: Vec<Variable>,
    /// Definitions of its units, by name.
    pub units: BTreeMap<String, BaseUnit>,
    /// True if it says that its state can be saved as bytes and restored.
    pub saves_state: bool,
    /// True if a process holds at most one instance.
    pub is_once_per_process: bool,
    /// Step of its own solver, of which a communication step has to be a multiple, s.
    pub internal_step_s: Option<f64>,
}

impl Description {
    /// Reads `text`.
    ///
    /// # Errors
    /// It is not XML, not of FMI 2.0 or 3.0, not of co-simulation, or lacks what the standard requires.
    pub fn parse(text: &str) -> Result<Self> {
        let document = Document::parse(text).context("modelDescription.xml is no XML")?;
        let root = document.root_element();
        let version = version(root)?;
        let Some(simulation) = child(root, "CoSimulation") else {
            let what = child(root, "ModelExchange").map_or(
                "has no interface that is known here",
                |_| "is for model exchange alone, which leaves the solver to its user",
            );
            bail!("the FMU {what}; export it for co-simulation")
        };
        let (token, get_and_set, serialize) = match version {
            Version::Two => ("guid", "canGetAndSetFMUstate", "canSerializeFMUstate"),
            Version::Three => ("instantiationToken", "canGetAndSetFMUState", "canSerializeFMUState"),
        };
        let types = types(root);
        let variables = child(root, "ModelVariables").map_or(Ok(Vec::new()), |list| {
            list.children()
                .filter(Node::is_element)
                .filter_map(|node| variable(node, version, &types))
                .collect()
        })?;
        Ok(Self {
            version,
            model_identifier: required(simulation, "modelIdentifier")?.to_owned(),
            token: required(root, token)?.to_owned(),
            variables,
            units: units(root)?,
            saves_state: is_true(simulation, get_and_set) && is_true(simulation, serialize),
            is_once_per_process: is_true(simulation, "canBeInstantiatedOnlyOncePerProcess"),
            internal_step_s: number(simulation, "fixedInternalStepSize")?,
        })
    }

    /// The variable called `name`.
    pub fn variable(&self, name: &str) -> Option<&Variable> {
        self.variables.iter().find(|variable| variable.name == name)
    }
}

fn version(root: Node<'_, '_>) -> Result<Version> {
    if root.tag_name().name() != "fmiModelDescription" {
        bail!(
            "modelDescription.xml begins with <{}>, not with <fmiModelDescription>",
            root.tag_name().name()
        );
    }
    match required(root, "fmiVersion")? {
        "2.0" => Ok(Version::Two),
        version if version.starts_with("3.0") => Ok(Version::Three),
        other => bail!("the FMU is of FMI {other}; 2.0 and 3.0 are known here"),
    }
}

/// A variable; `None` for what carries no number and no text, such as a clock.
fn variable(node: Node<'_, '_>, version: Version, types: &BTreeMap<&str, &str>) -> Option<Result<Variable>> {
    let typed = match version {
        Version::Two => {
            node.children().find(|child| value_type(child.tag_name().name(), version).is_some())?
        }
        Version::Three => node,
    };
    let value_type = value_type(typed.tag_name().name(), version)?;
    Some((|| {
        let name = required(node, "name")?.to_owned();
        let reference = required(node, "valueReference")?;
        let reference =
            reference.parse().with_context(|| format!("variable `{name}` has no valueReference"))?;
        let declared = typed.attribute("declaredType").and_then(|declared| types.get(declared).copied());
        let unit = typed.attribute("unit").or(declared).map(str::to_owned);
        let causality = match node.attribute("causality") {
            Some("input") => Causality::Input,
            Some("output") => Causality::Output,
            Some("parameter") => Causality::Parameter,
            Some("structuralParameter") => Causality::Structural,
            _ => Causality::Other,
        };
        let elements = elements(typed).with_context(|| format!("variable `{name}`"))?;
        let is_relative = is_true(typed, "relativeQuantity");
        Ok(Variable { name, reference, value_type, causality, unit, is_relative, elements })
    })())
}

fn value_type(tag: &str, version: Version) -> Option<ValueType> {
    match (tag, version) {
        ("Real", Version::Two) | ("Float64", Version::Three) => Some(ValueType::Float64),
        ("Integer" | "Enumeration", Version::Two) | ("Int32", Version::Three) => Some(ValueType::Int32),
        ("Int64" | "Enumeration", Version::Three) => Some(ValueType::Int64),
        ("Float32", Version::Three) => Some(ValueType::Float32),
        ("Int16", Version::Three) => Some(ValueType::Int16),
        ("Int8", Version::Three) => Some(ValueType::Int8),
        ("UInt64", Version::Three) => Some(ValueType::UInt64),
        ("UInt32", Version::Three) => Some(ValueType::UInt32),
        ("UInt16", Version::Three) => Some(ValueType::UInt16),
        ("UInt8", Version::Three) => Some(ValueType::UInt8),
        ("Boolean", _) => Some(ValueType::Boolean),
        ("String", _) => Some(ValueType::String),
        _ => None,
    }
}

/// Product of the dimensions.
fn elements(typed: Node<'_, '_>) -> Result<Option<usize>> {
    let mut product = 1_usize;
    for dimension in typed.children().filter(|child| child.has_tag_name("Dimension")) {
        let Some(length) = dimension.attribute("start") else { return Ok(None) };
        let length: usize = length.parse().with_context(|| format!("has a dimension `{length}`"))?;
        product =
            product.checked_mul(length).filter(|product| *product <= 1 << 20).context("is too large")?;
    }
    Ok(Some(product))
}

/// Units of the types that variables may declare, by the names of the types.
fn types<'a>(root: Node<'a, '_>) -> BTreeMap<&'a str, &'a str> {
    let definitions = child(root, "TypeDefinitions").into_iter().flat_map(|list| list.children());
    let named = definitions.filter_map(|definition| {
        let name = definition.attribute("name")?;
        let of_child = || definition.children().find_map(|child| child.attribute("unit"));
        Some((name, definition.attribute("unit").or_else(of_child)?))
    });
    named.collect()
}

/// Units that are defined by base units.
fn units(root: Node<'_, '_>) -> Result<BTreeMap<String, BaseUnit>> {
    let mut units = BTreeMap::new();
    for unit in child(root, "UnitDefinitions").into_iter().flat_map(|list| list.children()) {
        let (Some(name), Some(base)) = (unit.attribute("name"), child(unit, "BaseUnit")) else { continue };
        let mut exponents = [0; 8];
        for (exponent, symbol) in exponents.iter_mut().zip(BASE_UNITS) {
            let Some(text) = base.attribute(symbol) else { continue };
            *exponent = text.parse().with_context(|| format!("unit `{name}` has {symbol} = `{text}`"))?;
        }
        let (factor, offset) =
            (number(base, "factor")?.unwrap_or(1.0), number(base, "offset")?.unwrap_or(0.0));
        units.insert(name.to_owned(), BaseUnit { exponents, factor, offset });
    }
    Ok(units)
}

fn child<'a, 'input>(node: Node<'a, 'input>, tag: &str) -> Option<Node<'a, 'input>> {
    node.children().find(|child| child.has_tag_name(tag))
}

fn required<'a>(node: Node<'a, '_>, attribute: &str) -> Result<&'a str> {
    let tag = node.tag_name().name();
    node.attribute(attribute).with_context(|| format!("modelDescription.xml: <{tag}> has no `{attribute}`"))
}

fn number(node: Node<'_, '_>, attribute: &str) -> Result<Option<f64>> {
    let Some(text) = node.attribute(attribute) else { return Ok(None) };
    let number =
        text.parse().with_context(|| format!("modelDescription.xml: {attribute} = `{text}` is no number"))?;
    Ok(Some(number))
}

fn is_true(node: Node<'_, '_>, attribute: &str) -> bool {
    matches!(node.attribute(attribute), Some("true" | "1"))
}

#[cfg(test)]
mod tests {
    use super::{Causality, Description, Version};
    use crate::values::ValueType;

    #[test]
    fn a_description_of_either_version_is_read() {
        let two = r#"<?xml version="1.0"?><fmiModelDescription fmiVersion="2.0" modelName="m" guid="{1}" vendor="x">
            <CoSimulation modelIdentifier="m" canGetAndSetFMUstate="true" canSerializeFMUstate="1" other="y"/>
            <UnitDefinitions><Unit name="deg/s"><BaseUnit s="-1" rad="1" factor="0.0175"/></Unit></UnitDefinitions>
            <TypeDefinitions><SimpleType name="Rate"><Real unit="deg/s"/></SimpleType></TypeDefinitions>
            <ModelVariables><!-- none -->
              <ScalarVariable name="w" valueReference="3" causality="input"><Annotations/><Real declaredType="Rate"/></ScalarVariable>
              <ScalarVariable name="on" valueReference="4" causality="output"><Boolean/></ScalarVariable>
            </ModelVariables></fmiModelDescription>"#;
        let two = Description::parse(two).unwrap();
        assert_eq!((two.version, two.token.as_str(), two.saves_state), (Version::Two, "{1}", true));
        let rate = two.variable("w").unwrap();
        assert_eq!(
            (rate.reference, rate.causality, rate.unit.as_deref()),
            (3, Causality::Input, Some("deg/s"))
        );
        assert_eq!(two.units["deg/s"].exponents, [0, 0, -1, 0, 0, 0, 0, 1]);
        assert_eq!(two.variable("on").unwrap().value_type, ValueType::Boolean);

        let three = r#"<fmiModelDescription fmiVersion="3.0.1" modelName="m" instantiationToken="t">
            <CoSimulation modelIdentifier="m" fixedInternalStepSize="1e-3"/>
            <ModelVariables>
              <Float32 name="u" valueReference="1" causality="input" unit="m"><Dimension start="2"/><Dimension start="3"/></Float32>
              <Float64 name="v" valueReference="2" causality="output"><Dimension valueReference="9"/></Float64>
              <Clock name="c" valueReference="5"/>
            </ModelVariables></fmiModelDescription>"#;
        let three = Description::parse(three).unwrap();
        assert_eq!((three.variables.len(), three.internal_step_s, three.saves_state), (2, Some(1e-3), false));
        assert_eq!(three.variable("u").unwrap().elements, Some(6));
        assert_eq!(three.variable("v").unwrap().elements, None);
    }

    #[test]
    fn what_cannot_be_simulated_is_refused_in_words() {
        let refused = |text: &str| Description::parse(text).unwrap_err().to_string();
        assert!(refused("no").contains("is no XML"));
        assert!(refused("<x/>").contains("begins with <x>"));
        assert!(refused(r#"<fmiModelDescription fmiVersion="1.0"/>"#).contains("is of FMI 1.0"));
        let exchange = r#"<fmiModelDescription fmiVersion="2.0"><ModelExchange/></fmiModelDescription>"#;
        assert!(refused(exchange).contains("for model exchange alone"));
        let nameless = r#"<fmiModelDescription fmiVersion="2.0"><CoSimulation/></fmiModelDescription>"#;
        assert!(refused(nameless).contains("<CoSimulation> has no `modelIdentifier`"));
    }
}
