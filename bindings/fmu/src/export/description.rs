//! `modelDescription.xml` of a simulation.

use super::{FIRST_REFERENCE, Model, ModelVariable, SEED, SEED_REFERENCE, TIME_REFERENCE};
use crate::description::Version;
use crate::units::{BASE_UNITS, of_field};
use std::collections::BTreeSet;
use std::fmt::Write as _;

/// Categories of messages.
const CATEGORIES: &str = "<LogCategories><Category name=\"logStatusError\"/></LogCategories>\n";

/// The description of `model` in `version`.
pub fn text(model: &Model, version: Version) -> String {
    match version {
        Version::Two => fmi2(model),
        Version::Three => fmi3(model),
    }
}

fn fmi2(model: &Model) -> String {
    let Model { name, token, tick_s, duration_s, seed, .. } = model;
    let mut xml = format!(
        "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n\
         <fmiModelDescription fmiVersion=\"2.0\" modelName=\"{name}\" guid=\"{token}\" generationTool=\"hummingbus\" \
         variableNamingConvention=\"flat\">\n\
         <CoSimulation modelIdentifier=\"{name}\"/>\n{}{CATEGORIES}\
         <DefaultExperiment startTime=\"0\" stopTime=\"{duration_s}\" stepSize=\"{tick_s}\"/>\n<ModelVariables>\n\
         <ScalarVariable name=\"time\" valueReference=\"{TIME_REFERENCE}\" causality=\"independent\" variability=\"continuous\">\
         <Real/></ScalarVariable>\n\
         <ScalarVariable name=\"{SEED}\" valueReference=\"{SEED_REFERENCE}\" causality=\"parameter\" variability=\"fixed\" \
         initial=\"exact\" description=\"seed of all noise\"><Integer start=\"{seed}\"/></ScalarVariable>\n",
        units(model)
    );
    for (reference, variable) in numbered(model) {
        let ModelVariable { name, description, unit, is_integer, start, .. } = variable;
        let variability = if *is_integer { "discrete" } else { "continuous" };
        let (causality, start) = if variable.is_input() {
            ("input", format!(" start=\"{start}\""))
        } else {
            ("output", String::new())
        };
        let element = if *is_integer {
            format!("<Integer{start}/>")
        } else {
            format!("<Real unit=\"{unit}\"{start}/>")
        };
        // Writing to a string cannot fail.
        let _ = writeln!(
            xml,
            "<ScalarVariable name=\"{name}\" valueReference=\"{reference}\" causality=\"{causality}\" \
             variability=\"{variability}\" description=\"{description}\">{element}</ScalarVariable>"
        );
    }
    // Numbers of variables in the file, counted from 1. Outputs change in steps alone, so that none depends on an input of its instant.
    let outputs =
        || numbered(model).filter(|(_, variable)| !variable.is_input()).map(|(reference, _)| reference + 1);
    let of = |attributes: &str| {
        outputs().map(|index| format!("<Unknown index=\"{index}\"{attributes}/>")).collect::<String>()
    };
    let (unknowns, initial) = (of(" dependencies=\"\""), of(""));
    let _ = writeln!(
        xml,
        "</ModelVariables>\n<ModelStructure><Outputs>{unknowns}</Outputs><InitialUnknowns>{initial}</InitialUnknowns>\
         </ModelStructure>\n</fmiModelDescription>"
    );
    xml
}

fn fmi3(model: &Model) -> String {
    let Model { name, token, tick_s, duration_s, seed, .. } = model;
    let mut xml = format!(
        "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n\
         <fmiModelDescription fmiVersion=\"3.0\" modelName=\"{name}\" instantiationToken=\"{token}\" \
         generationTool=\"hummingbus\" variableNamingConvention=\"flat\">\n\
         <CoSimulation modelIdentifier=\"{name}\" canHandleVariableCommunicationStepSize=\"true\" \
         fixedInternalStepSize=\"{tick_s}\"/>\n{}{CATEGORIES}\
         <DefaultExperiment startTime=\"0\" stopTime=\"{duration_s}\" stepSize=\"{tick_s}\"/>\n<ModelVariables>\n\
         <Float64 name=\"time\" valueReference=\"{TIME_REFERENCE}\" causality=\"independent\" variability=\"continuous\"/>\n\
         <Int32 name=\"{SEED}\" valueReference=\"{SEED_REFERENCE}\" causality=\"parameter\" variability=\"fixed\" \
         initial=\"exact\" description=\"seed of all noise\" start=\"{seed}\"/>\n",
        units(model)
    );
    for (reference, variable) in numbered(model) {
        let ModelVariable { name, description, unit, is_integer, start, .. } = variable;
        let (element, variability, unit) = if *is_integer {
            ("Int32", "discrete", String::new())
        } else {
            ("Float64", "continuous", format!(" unit=\"{unit}\""))
        };
        let (causality, start) = if variable.is_input() {
            ("input", format!(" start=\"{start}\""))
        } else {
            ("output", String::new())
        };
        let _ = writeln!(
            xml,
            "<{element} name=\"{name}\" valueReference=\"{reference}\" causality=\"{causality}\" \
             variability=\"{variability}\" description=\"{description}\"{unit}{start}/>"
        );
    }
    xml += "</ModelVariables>\n<ModelStructure>";
    for (element, dependencies) in [("Output", " dependencies=\"\""), ("InitialUnknown", "")] {
        for (reference, _) in numbered(model).filter(|(_, variable)| !variable.is_input()) {
            let _ = write!(xml, "<{element} valueReference=\"{reference}\"{dependencies}/>");
        }
    }
    xml += "</ModelStructure>\n</fmiModelDescription>\n";
    xml
}

fn numbered(model: &Model) -> impl Iterator<Item = (u32, &ModelVariable)> {
    (FIRST_REFERENCE..).zip(&model.variables)
}

/// Definitions of the units by base units.
fn units(model: &Model) -> String {
    let names: BTreeSet<&str> = model.variables.iter().map(|variable| variable.unit.as_str()).collect();
    let definitions: String = names.into_iter().map(definition).collect();
    format!("<UnitDefinitions>{definitions}</UnitDefinitions>\n")
}

fn definition(name: &str) -> String {
    let Some(unit) = of_field(name) else { return format!("<Unit name=\"{name}\"/>") };
    let mut base = String::new();
    for (exponent, symbol) in unit.exponents.iter().zip(BASE_UNITS) {
        if *exponent != 0 {
            let _ = write!(base, " {symbol}=\"{exponent}\"");
        }
    }
    if unit.factor != 1.0 {
        let _ = write!(base, " factor=\"{}\"", unit.factor);
    }
    format!("<Unit name=\"{name}\"><BaseUnit{base}/></Unit>")
}

#[cfg(test)]
mod tests {
    use super::text;
    use crate::description::{Causality, Description, Version};
    use crate::export::{Model, ModelVariable, Source};
    use crate::values::ValueType;
    use bus::Message;
    use bus::messages::{MotorCommand, PlantState};

    #[test]
    fn a_description_that_is_written_is_the_one_that_is_read() {
        let command = MotorCommand { command: [76.5; 4].into(), ..Default::default() };
        let state = PlantState { rotor_speed: [400.0; 4].into(), ..Default::default() };
        let inputs = ModelVariable::all(
            "controller.command",
            &Source::Port("command".to_owned()),
            MotorCommand::SCHEMA,
            bytemuck::bytes_of(&command),
        );
        let outputs = ModelVariable::all(
            "plant.state",
            &Source::Topic("/plant/state".to_owned()),
            PlantState::SCHEMA,
            bytemuck::bytes_of(&state),
        );
        let model = Model {
            name: "hover".to_owned(),
            token: "{0}".to_owned(),
            tick_s: 0.001,
            duration_s: 8.0,
            seed: 1,
            agent: "controller".to_owned(),
            members: Vec::new(),
            variables: [inputs, outputs].concat(),
        };
        for version in [Version::Two, Version::Three] {
            let read = Description::parse(&text(&model, version)).unwrap();
            assert_eq!((read.version, read.model_identifier.as_str()), (version, "hover"));
            let names: Vec<_> =
                read.variables.iter().skip(2).map(|variable| variable.name.as_str()).collect();
            assert_eq!(
                names,
                model.variables.iter().map(|variable| variable.name.as_str()).collect::<Vec<_>>()
            );
            let first = read.variable("controller.command.command[0]").unwrap();
            assert_eq!((first.reference, first.causality), (2, Causality::Input));
            let height = read.variable("plant.state.position.z").unwrap();
            assert_eq!((height.unit.as_deref(), height.value_type), (Some("m"), ValueType::Float64));
            assert_eq!(read.units["m/s"].exponents, [0, 1, -1, 0, 0, 0, 0, 0]);
            assert!(read.variable("plant.state.rotor_speed[3]").is_some());
            assert!(
                read.variable("plant.state.rotor_speed[4]").is_none()
                    && read.variable("plant.state.stamp.sec").is_none()
            );
        }
    }
}
