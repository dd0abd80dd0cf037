//! A simulation with variables.

use bus::plan::Plan;
use bus::schema::Schema;
use bus::{BusError, Registration};
use fmu::export::{FIRST_REFERENCE, MODEL, Model, ModelVariable, SEED_REFERENCE, Source, TIME_REFERENCE};
use fmu::{Field, Number};
use hummingbus::agent::{Actions, registry};
use hummingbus::inputs::InputFiles;
use std::collections::BTreeMap;
use std::path::Path;

/// Part of a tick that a step may be off: communication points are sums of doubles.
const TICK_TOLERANCE: f64 = 1e-3;

/// A simulation of an FMU.
pub struct Simulation {
    model: Model,
    plan: Plan,
    files: InputFiles,
    variables: Vec<Variable>,
    /// Messages that the importer sends, by the ports of the agent.
    ports: BTreeMap<String, Port>,
    seed: u64,
    /// Once it is initialized.
    running: Option<bus::Simulation>,
    /// The reason why it cannot go on: until it is reset.
    ended: Option<String>,
    actions: Actions,
}

struct Variable {
    source: Source,
    field: Field,
}

struct Port {
    message: Vec<u8>,
    is_changed: bool,
}

impl Simulation {
    /// The simulation in the folder `resources`, which the importer knows by `token`.
    ///
    /// # Errors
    /// A file is missing or of another version, or the token is another one.
    pub fn load(resources: &Path, token: &str) -> Result<Self, String> {
        let path = resources.join(MODEL);
        let text =
            std::fs::read(&path).map_err(|error| format!("cannot read {}: {error}", path.display()))?;
        let model: Model = serde_json::from_slice(&text)
            .map_err(|error| format!("cannot read {}: {error}", path.display()))?;
        if model.token != token {
            return Err(format!("the token is `{token}`, and the FMU's is `{}`", model.token));
        }
        let plan = Plan::load(resources).map_err(|error| error.to_string())?;
        let listed: Vec<_> = plan.nodes.iter().flat_map(|node| node.files.iter().cloned()).collect();
        let files = InputFiles::stored(&resources.join(Plan::INPUTS), &listed);
        let (mut variables, mut ports) = (Vec::new(), BTreeMap::new());
        for variable in &model.variables {
            let schema = schema(variable)?;
            let field = variable.field(schema).ok_or_else(|| unknown(variable))?;
            if let Source::Port(port) = &variable.source {
                let empty = || Port { message: vec![0; schema.size], is_changed: true };
                let port = ports.entry(port.clone()).or_insert_with(empty);
                field
                    .write(&mut port.message, Number::Float(variable.start))
                    .ok_or_else(|| unknown(variable))?;
            }
            variables.push(Variable { source: variable.source.clone(), field });
        }
        let seed = model.seed;
        Ok(Self {
            model,
            plan,
            files,
            variables,
            ports,
            seed,
            running: None,
            ended: None,
            actions: Actions::new(),
        })
    }

    /// Makes the nodes, and computes what they send before the importer's first step.
    ///
    /// # Errors
    /// A node cannot be made, or fails.
    pub fn initialize(&mut self) -> Result<(), String> {
        if self.running.is_some() {
            return Err("it is initialized already".to_owned());
        }
        let known = registry();
        let member = |(node, kind): &(usize, String)| -> Result<(usize, &'static Registration), String> {
            let component = known.find(kind).ok_or_else(|| format!("there is no kind `{kind}`"))?;
            Ok((*node, component))
        };
        let members = self.model.members.iter().map(member).collect::<Result<Vec<_>, _>>()?;
        let plan = Plan { seed: self.seed, ..self.plan.clone() };
        let made = bus::Simulation::new(&plan, members, known.components(), &self.files);
        let mut simulation = made.map_err(|error| error.to_string())?;
        simulation.step_last(&self.model.agent).map_err(|error| error.to_string())?;
        self.running = Some(simulation);
        self.act()?;
        self.computed(|simulation, actions| simulation.begin_step_given(actions))
    }

    /// Steps over `period_s` seconds from `time_s` on.
    ///
    /// # Errors
    /// The time is another one, the period no multiple of a tick, or a node fails.
    pub fn step(&mut self, time_s: f64, period_s: f64) -> Result<(), String> {
        let tick_s = self.model.tick_s;
        let now_s = self.time_s();
        if (time_s - now_s).abs() > TICK_TOLERANCE * tick_s {
            return Err(format!("the step begins at {time_s} s, and the simulation is at {now_s} s"));
        }
        let ticks = (period_s / tick_s).round();
        if !(1.0..=1e9).contains(&ticks) || (period_s - ticks * tick_s).abs() > TICK_TOLERANCE * tick_s {
            return Err(format!("a step of {period_s} s is no multiple of the tick of {tick_s} s"));
        }
        self.act()?;
        self.computed(|simulation, actions| {
            for _ in 0..ticks as u64 {
                simulation.step_given(actions)?;
                simulation.begin_step_given(actions)?;
            }
            Ok(())
        })
    }

    /// Goes back to where it was before it was initialized, with the start values.
    ///
    /// # Errors
    /// Never; the functions of the standard take a result.
    pub fn reset(&mut self) -> Result<(), String> {
        (self.running, self.ended, self.seed, self.actions) = (None, None, self.model.seed, Actions::new());
        for (variable, of_model) in self.variables.iter().zip(&self.model.variables) {
            if let Source::Port(port) = &variable.source
                && let Some(port) = self.ports.get_mut(port)
            {
                port.is_changed = true;
                variable.field.write(&mut port.message, Number::Float(of_model.start));
            }
        }
        Ok(())
    }

    /// Ends the simulation for `reason`: no step follows, until it is reset.
    pub fn end(&mut self, reason: &str) {
        self.ended = Some(reason.to_owned());
    }

    /// Time of the simulation, s.
    pub fn time_s(&self) -> f64 {
        self.running.as_ref().map_or(0.0, bus::Simulation::time_s)
    }

    /// Sets the variable `reference`.
    ///
    /// # Errors
    /// It is none that can be set now, or its field does not hold `number`.
    pub fn set(&mut self, reference: u32, number: Number) -> Result<(), String> {
        if reference == SEED_REFERENCE {
            if self.running.is_some() {
                return Err("the seed is set before the simulation is initialized".to_owned());
            }
            let seed = number.integer::<u64>();
            self.seed = seed.ok_or_else(|| format!("the seed {number} is no whole number from 0 on"))?;
            return Ok(());
        }
        let variable = self.variables.get(index(reference)?).ok_or_else(|| no_variable(reference))?;
        let name = || &self.model.variables[variable_index(reference)].name;
        let Source::Port(port) = &variable.source else { return Err(format!("`{}` is an output", name())) };
        let port = self.ports.get_mut(port).ok_or_else(|| no_variable(reference))?;
        port.is_changed = true;
        let written = variable.field.write(&mut port.message, number);
        written.ok_or_else(|| format!("`{}` does not hold {number}", name()))
    }

    /// The variable `reference`; of one that nothing has sent yet its start value.
    ///
    /// # Errors
    /// There is none.
    pub fn get(&self, reference: u32) -> Result<Number, String> {
        match reference {
            TIME_REFERENCE => return Ok(Number::Float(self.time_s())),
            SEED_REFERENCE => return Ok(Number::Integer(self.seed.into())),
            _ => {}
        }
        let variable = self.variables.get(index(reference)?).ok_or_else(|| no_variable(reference))?;
        let message = match &variable.source {
            Source::Port(port) => self.ports.get(port).map(|port| port.message.as_slice()),
            Source::Topic(topic) => match &self.running {
                None => None,
                Some(simulation) => simulation.newest_bytes(topic).map_err(|error| error.to_string())?.1,
            },
        };
        let of_model = &self.model.variables[variable_index(reference)];
        match message {
            None => Ok(Number::Float(of_model.start)),
            Some(message) => {
                let number = variable.field.read(message);
                number.ok_or_else(|| {
                    format!("the newest sample has no `{}`: it has fewer values", of_model.name)
                })
            }
        }
    }

    /// Hands the messages of the importer to the agent.
    fn act(&mut self) -> Result<(), String> {
        for (name, port) in &mut self.ports {
            if std::mem::take(&mut port.is_changed) {
                if !self.actions.contains_key(&self.model.agent) {
                    self.actions.insert(self.model.agent.clone(), hummingbus::agent::Action::default());
                }
                let action = self.actions.get_mut(&self.model.agent).ok_or("the agent is gone")?;
                action.set(name, &port.message)?;
            }
        }
        Ok(())
    }

    fn computed(
        &mut self,
        compute: impl FnOnce(&mut bus::Simulation, &Actions) -> Result<(), BusError>,
    ) -> Result<(), String> {
        if let Some(reason) = &self.ended {
            return Err(format!("the simulation has ended: {reason}"));
        }
        let simulation = self.running.as_mut().ok_or("the simulation is not initialized")?;
        let computed = compute(simulation, &self.actions).map_err(|error| error.to_string());
        computed.inspect_err(|reason| self.ended = Some(reason.clone()))
    }
}

fn schema(variable: &ModelVariable) -> Result<&'static Schema, String> {
    registry().message(&variable.type_name).ok_or_else(|| unknown(variable))
}

fn unknown(variable: &ModelVariable) -> String {
    let ModelVariable { name, type_name, path, .. } = variable;
    format!("the variable `{name}` is `{path}` of {type_name}, which this library does not know")
}

fn variable_index(reference: u32) -> usize {
    reference.saturating_sub(FIRST_REFERENCE) as usize
}

fn index(reference: u32) -> Result<usize, String> {
    reference.checked_sub(FIRST_REFERENCE).map(|index| index as usize).ok_or_else(|| no_variable(reference))
}

fn no_variable(reference: u32) -> String {
    format!("there is no variable with the reference {reference}")
}
