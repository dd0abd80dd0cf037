//! The node: an FMU with its parameters, its steps and its state.

use crate::archive::Archive;
use crate::description::{Causality, Description, Variable};
use crate::instance::{Instance, c_text};
use crate::library;
use crate::proof::{self, Probe};
use crate::values::{Number, Values};
use crate::wiring::{self, Direction, Group, Mapping, Port};
use bus::component::StateError;
use bus::dynamic::{DynamicNode, DynamicTick, Program};
use bus::process::RUN_VARIABLE;
use bus::schema::Schema;
use bus::{BusError, Registration};
use diagnostics::nine_decimals;
use inputs::sha256;
use serde_json::Value;
use std::cell::RefCell;
use std::collections::BTreeMap;
use std::path::PathBuf;

/// Room for a saved state where the manifest does not say, and the largest.
const STATE_BYTES: usize = 1 << 16;
const STATE_BYTES_MAX: usize = 1 << 30;
/// Type of the state, for messages.
const STATE_TYPE: &str = "FMU state";
/// Bytes before the FMU's own: the number of steps, and that of the bytes.
const HEAD_BYTES: usize = 16;
/// Number of bytes of a state that the FMU did not save.
const UNSAVED: u64 = u64::MAX;

/// Parameters of `kind = "fmu"`, for documentation.
pub const PARAMETERS: &[bus::parameters::Parameter] = <Parameters as bus::Parameters>::DECLARED;

/// Parameters of `kind = "fmu"`.
#[derive(Debug, bus::Parameters)]
struct Parameters {
    /// File of the FMU, relative to the manifest.
    fmu: PathBuf,
    /// Table of the fields of input ports, by input variable.
    #[parameter(default = Mapping::new())]
    inputs: Mapping,
    /// Table of the fields of output ports, by variable.
    #[parameter(default = Mapping::new())]
    outputs: Mapping,
    /// Table of values of variables before the FMU is initialized, in its own units.
    #[parameter(default = BTreeMap::new())]
    start: BTreeMap<String, Value>,
    /// True to save the FMU's state, false not to.
    #[parameter(shown = "what the FMU declares")]
    state: Option<bool>,
    /// Room for a saved state, in bytes.
    #[parameter(shown = "65536")]
    state_bytes: Option<usize>,
}

/// A value of a variable before the FMU is initialized.
enum Start {
    Numbers(u32, Values),
    Text(u32, std::ffi::CString),
}

/// Is the node of the run that started this process, with the messages of `components`.
///
/// # Errors
/// The manifest and the FMU do not fit, the FMU fails, or the run is aborted.
pub fn run(components: &'static [Registration]) -> Result<(), BusError> {
    let mut node = DynamicNode::join()?;
    let parameters: Parameters = diagnostics::read(node.parameters()).map_err(|error| node.error(error))?;
    let inputs = ports(&mut node, components, Direction::Inputs)?;
    let outputs = ports(&mut node, components, Direction::Outputs)?;
    let host = Host::new(&node, &parameters, &inputs, &outputs).map_err(|reason| node.error(reason))?;
    node.run_program(host)
}

/// Declares the ports that the manifest has, by the types of their topics.
fn ports(
    node: &mut DynamicNode,
    components: &'static [Registration],
    direction: Direction,
) -> Result<Vec<Port>, BusError> {
    let wired: Vec<(String, String)> = match direction {
        Direction::Inputs => node.wired_inputs().map(owned).collect(),
        Direction::Outputs => node.named_outputs().map(owned).collect(),
    };
    let mut ports = Vec::new();
    for (name, type_name) in wired {
        let schema = bus::message_of(components, &type_name).ok_or_else(|| {
            let message = format!("the port `{name}` carries {type_name}, which no built-in kind knows");
            node.error(format!("{message}; `hummingbus schema` lists the messages that an FMU can exchange"))
        })?;
        let number = declare(node, direction, &name, schema)?;
        ports.push(Port { name, number, schema });
    }
    Ok(ports)
}

fn owned((port, type_name): (&str, &str)) -> (String, String) {
    (port.to_owned(), type_name.to_owned())
}

fn declare(
    node: &mut DynamicNode,
    direction: Direction,
    name: &str,
    schema: &'static Schema,
) -> Result<usize, BusError> {
    match direction {
        Direction::Inputs => node.input(name, schema),
        Direction::Outputs => node.output(name, schema),
    }
}

/// An FMU in its run.
struct Host {
    instance: Box<dyn Instance>,
    inputs: Vec<Group>,
    outputs: Vec<Group>,
    period_s: f64,
    /// Steps of the FMU: its time is theirs.
    steps: u64,
    state: Option<SavedState>,
    /// Failure of a saving, which the next step tells.
    unsaved: RefCell<Option<String>>,
    /// Goes after the instance.
    _archive: Archive,
}

/// A state that a replay has proved.
struct SavedState {
    /// Number of this FMU with its start values and period among all.
    configuration: u64,
    /// Bytes of room.
    room: usize,
}

impl Host {
    fn new(
        node: &DynamicNode,
        parameters: &Parameters,
        inputs: &[Port],
        outputs: &[Port],
    ) -> Result<Self, String> {
        let shown = parameters.fmu.display();
        let bytes =
            node.files().bytes(&parameters.fmu).map_err(|error| format!("cannot read {shown}: {error}"))?;
        let folder = std::env::var_os(RUN_VARIABLE).map_or_else(std::env::temp_dir, PathBuf::from);
        let archive = Archive::unpack(&bytes, &folder).map_err(|error| format!("{shown}: {error:#}"))?;
        let description =
            Description::parse(&archive.description).map_err(|error| format!("{shown}: {error:#}"))?;
        let period_s = node.period_s();
        require_step(&description, period_s)?;
        let wired = |direction, mapping, ports| wiring::groups(direction, mapping, &description, ports);
        let (inputs, outputs) = (
            wired(Direction::Inputs, &parameters.inputs, inputs)?,
            wired(Direction::Outputs, &parameters.outputs, outputs)?,
        );
        let start = start_values(&description, &parameters.start)?;
        let make = || started(&archive, &description, node.name(), &start);
        let saves_state = saves_state(&description, parameters.state)?;
        let room = parameters.state_bytes.unwrap_or(STATE_BYTES);
        if room > STATE_BYTES_MAX {
            return Err(format!("`parameters.state_bytes` is {room}; expected at most {STATE_BYTES_MAX}"));
        }
        if saves_state {
            let found = prove(&make, &description, parameters, period_s)?;
            require_room(found, room)?;
        }
        let state = saves_state
            .then(|| SavedState { configuration: configuration(&bytes, &parameters.start, period_s), room });
        let instance = make()?;
        Ok(Self {
            instance,
            inputs,
            outputs,
            period_s,
            steps: 0,
            state,
            unsaved: RefCell::default(),
            _archive: archive,
        })
    }

    /// Writes the state into `bytes`.
    fn write_state(&self, bytes: &mut [u8]) -> Result<(), String> {
        let state = self.instance.save()?;
        let (head, room) = bytes.split_at_mut(HEAD_BYTES);
        let found = state.len();
        // Also of a state that does not fit, for whoever loads it.
        head[8..].copy_from_slice(&(found as u64).to_le_bytes());
        // It may have grown since the proof.
        require_room(found, room.len())?;
        room[..found].copy_from_slice(&state);
        Ok(())
    }
}

impl Program for Host {
    const STATE_TYPE: &'static str = STATE_TYPE;

    fn configuration(&self) -> u64 {
        self.state.as_ref().map_or(0, |state| state.configuration)
    }

    fn state_size(&self) -> Option<usize> {
        self.state.as_ref().map(|state| HEAD_BYTES + state.room)
    }

    fn save(&self, bytes: &mut [u8]) {
        bytes.fill(0);
        bytes[..8].copy_from_slice(&self.steps.to_le_bytes());
        bytes[8..HEAD_BYTES].copy_from_slice(&UNSAVED.to_le_bytes());
        if let Err(reason) = self.write_state(bytes) {
            self.unsaved.replace(Some(reason));
        }
    }

    fn load(&mut self, bytes: &[u8]) -> Result<(), StateError> {
        StateError::check_size(STATE_TYPE, self.state_size().unwrap_or(0), bytes)?;
        let refused = |reason: String| StateError::Contents { type_name: STATE_TYPE, reason };
        let (head, state) = bytes.split_at(HEAD_BYTES);
        let word = |from: usize| u64::from_le_bytes(head[from..from + 8].try_into().unwrap_or_default());
        let (length, room) = (word(8), state.len());
        if length == UNSAVED {
            return Err(refused("the FMU before did not save it".to_owned()));
        }
        let state = usize::try_from(length).ok().and_then(|length| state.get(..length));
        let state = state.ok_or_else(|| {
            refused(format!("it has {length} bytes, and parameters.state_bytes leaves room for {room}"))
        })?;
        self.instance.restore(state).map_err(refused)?;
        self.steps = word(0);
        Ok(())
    }

    fn step(&mut self, tick: &mut DynamicTick<'_, '_>) -> Result<(), String> {
        if let Some(reason) = self.unsaved.take() {
            return Err(reason);
        }
        for group in &mut self.inputs {
            group.take(tick)?;
            self.instance.set(&group.references, &group.values)?;
        }
        self.instance.step(self.steps as f64 * self.period_s, self.period_s)?;
        self.steps += 1;
        for group in &mut self.outputs {
            self.instance.get(&group.references, &mut group.values)?;
            group.give(tick)?;
        }
        Ok(())
    }
}

/// Refuses a state of `found` bytes for which there is no room.
fn require_room(found: usize, room: usize) -> Result<(), String> {
    if found <= room {
        return Ok(());
    }
    Err(format!(
        "the FMU's state has {found} bytes, and there is room for {room}; give parameters.state_bytes, at least {found}"
    ))
}

/// Hash of an FMU, its start values and its period. Start values are part of its state, and its time is
/// counted in periods.
fn configuration(fmu: &[u8], start: &BTreeMap<String, Value>, period_s: f64) -> u64 {
    let text = format!("{} {} {period_s:?}", sha256(fmu), serde_json::json!(start));
    u64::from_str_radix(&sha256(text.as_bytes())[..16], 16).unwrap_or_default()
}

/// An instance after its initialization.
fn started(
    archive: &Archive,
    description: &Description,
    name: &str,
    start: &[(String, Start)],
) -> Result<Box<dyn Instance>, String> {
    let instance = library::instantiate(archive, description, name)?;
    for (variable, value) in start {
        let set = match value {
            Start::Numbers(reference, values) => instance.set(&[*reference], values),
            Start::Text(reference, text) => instance.set_text(*reference, text),
        };
        set.map_err(|reason| format!("`parameters.start.{variable}`: {reason}"))?;
    }
    instance.initialize()?;
    Ok(instance)
}

/// Values of the variables that the manifest gives, by their names.
fn start_values(
    description: &Description,
    given: &BTreeMap<String, Value>,
) -> Result<Vec<(String, Start)>, String> {
    let value = |(name, value): (&String, &Value)| {
        let start =
            wiring::find(description, name).and_then(|variable| start_value(description, variable, value));
        start
            .map(|start| (name.clone(), start))
            .map_err(|reason| format!("`parameters.start.{name}`: {reason}"))
    };
    given.iter().map(value).collect()
}

fn start_value(description: &Description, variable: &Variable, given: &Value) -> Result<Start, String> {
    if variable.causality == Causality::Structural {
        return Err("it is a structural parameter, which is set in the tool that exports the FMU".to_owned());
    }
    if let Value::String(text) = given {
        let is_text = variable.value_type == crate::values::ValueType::String;
        return if is_text {
            Ok(Start::Text(variable.reference, c_text(text)?))
        } else {
            Err(format!("it is a number, found the text {text:?}"))
        };
    }
    let mut values = library::values_of(variable, description.version)?;
    let given = given.as_array().map_or(std::slice::from_ref(given), Vec::as_slice);
    if given.len() != values.len() {
        return Err(format!("it has {} elements, found {}", values.len(), given.len()));
    }
    for (index, given) in given.iter().enumerate() {
        let number = match given {
            Value::Bool(truth) => Some(Number::Integer(i128::from(*truth))),
            Value::Number(number) => number
                .as_i64()
                .map(i128::from)
                .or(number.as_u64().map(i128::from))
                .map(Number::Integer)
                .or(number.as_f64().map(Number::Float)),
            _ => None,
        };
        let set = number.and_then(|number| values.set(index, number));
        set.ok_or_else(|| format!("{given} is not {}", values.name()))?;
    }
    Ok(Start::Numbers(variable.reference, values))
}

/// Refuses a period that is no multiple of the step of the FMU's own solver.
fn require_step(description: &Description, period_s: f64) -> Result<(), String> {
    let Some(step_s) = description.internal_step_s else { return Ok(()) };
    let ratio = period_s / step_s;
    let nearest = libm::round(ratio);
    if nearest >= 1.0 && (ratio - nearest).abs() < 1e-6 {
        return Ok(());
    }
    Err(format!(
        "the FMU computes in steps of {step_s} s, and its process every {} s, which is no multiple; set its period_ticks",
        nine_decimals(period_s)
    ))
}

fn saves_state(description: &Description, asked: Option<bool>) -> Result<bool, String> {
    let offered = match (description.saves_state, description.is_once_per_process) {
        (true, false) => Ok(()),
        (false, _) => Err("the FMU does not say that it can save its state (canSerializeFMUstate)"),
        (true, true) => {
            Err("a process holds only one instance of the FMU, so that its state cannot be proved on another")
        }
    };
    match (asked, offered) {
        (Some(true), Err(reason)) => Err(format!("`parameters.state` is true, and {reason}")),
        (Some(asked), _) => Ok(asked),
        (None, offered) => Ok(offered.is_ok()),
    }
}

/// Replays the FMU from a state that it saved; returns the number of bytes of the state.
fn prove(
    make: &dyn Fn() -> Result<Box<dyn Instance>, String>,
    description: &Description,
    parameters: &Parameters,
    period_s: f64,
) -> Result<usize, String> {
    let probe = |name: &String| -> Result<Probe, String> {
        let variable = wiring::find(description, name)?;
        let values = library::values_of(variable, description.version)?;
        Ok(Probe { reference: variable.reference, name: name.clone(), values })
    };
    let inputs: Vec<Probe> = parameters.inputs.keys().map(probe).collect::<Result<_, _>>()?;
    let outputs: Vec<Probe> = parameters.outputs.keys().map(probe).collect::<Result<_, _>>()?;
    let others = description.variables.iter().filter(|variable| variable.causality == Causality::Output);
    let others = others.filter(|variable| !parameters.outputs.contains_key(&variable.name));
    let others = others.filter_map(|variable| probe(&variable.name).ok());
    let outputs: Vec<Probe> = outputs.into_iter().chain(others).collect();
    let first = make()?;
    proof::replay(first, make, period_s, &inputs, &outputs).map_err(|reason| {
        format!(
            "the FMU says that it saves its state, and a replay does not prove it: {reason}. It leaves something out, or \
             is not the same at every run. With parameters.state = false it flies without: whoever takes its place begins anew, and a checkpoint does not hold it"
        )
    })
}
