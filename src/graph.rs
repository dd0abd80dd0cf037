//! From a manifest to the plan of a run: nodes, topics and edges, checked before anything starts.

use crate::judge;
use crate::kinds;
use crate::manifest::{Comparison, InputSetting, Manifest, OutputSetting, PassCondition, Process};
use crate::placement;
use crate::problem::{Problem, nearest};
use crate::program::{Executable, Program, Successor};
use bus::kind::{Inputs, NodeKind, PortSpec};
use bus::plan::{InputPlan, NodePlan, OutputPlan, Plan, TopicPlan};
use bus::schema::Schema;
use std::collections::BTreeMap;
use std::ops::Range;
use std::path::PathBuf;
use toml::Spanned;

/// Ticks that a fast node may be ahead of the slowest where the manifest does not say.
const DEFAULT_WINDOW_TICKS: u32 = 64;
/// More would only grow the queues: a window's samples are what shared memory must hold.
pub const WINDOW_TICKS_MAX: u32 = 4096;
const RATE_HZ_MAX: u32 = 1_000_000;

/// A checked manifest.
#[derive(Debug)]
pub struct Graph {
    /// What the processes of the run read.
    pub plan: Plan,
    /// What to start, in the order of the plan's nodes.
    pub programs: Vec<Program>,
    /// Who stands by or takes over, in the order in which they join.
    pub successors: Vec<Successor>,
    /// The vehicle files the processes name, each once.
    pub vehicles: Vec<PathBuf>,
}

/// An output on its way to a topic.
struct Published {
    node: usize,
    port: String,
    span: Range<usize>,
    topic: TopicPlan,
}

impl Graph {
    /// Checks `manifest` and resolves it.
    ///
    /// # Errors
    /// The first problem, with its place.
    pub fn build(manifest: &Manifest) -> Result<Self, Problem> {
        let names: Vec<&Spanned<String>> = manifest.content.process.keys().collect();
        let processes: Vec<&Process> = manifest.content.process.values().collect();
        if processes.is_empty() {
            return Err(Problem::in_file(
                &manifest.path,
                "there is no process",
                "add [process.<name>] tables",
            ));
        }
        let programs = names
            .iter()
            .zip(&processes)
            .map(|(name, process)| program(manifest, name, process))
            .collect::<Result<Vec<_>, _>>()?;
        let published = publish_all(manifest, &names, &processes, &programs)?;
        let topics: Vec<TopicPlan> = published.iter().map(|output| output.topic.clone()).collect();
        let mut nodes = Vec::new();
        for (index, (name, process)) in names.iter().zip(&processes).enumerate() {
            let inputs = inputs(manifest, name, process, &programs[index], &topics)?;
            let outputs = outputs(&published, index);
            nodes.push(NodePlan {
                restarts: false,
                name: name.get_ref().clone(),
                period_ticks: period_ticks(manifest, process)?,
                wait: process.wait.unwrap_or_default(),
                cpu: process.cpu.as_ref().map(|cpu| *cpu.get_ref()),
                inputs,
                outputs,
                parameters: serde_json::Value::Null,
            });
        }
        require_no_cycle(manifest, &names, &nodes, &published)?;
        let mut plan = plan(manifest, topics, nodes)?;
        order_inputs(&mut plan, &published);
        placement::place(&mut plan, manifest.content.run.clock_cpu);
        let vehicles = set_parameters(manifest, &names, &processes, &programs, &mut plan)?;
        require_one_recorder(manifest, &names, &programs)?;
        require_whole_recording(manifest, &names, &plan, &programs)?;
        check_evaluations(manifest, &plan, &programs)?;
        Ok(Self { plan, programs, successors: Vec::new(), vehicles })
    }
}

fn program(manifest: &Manifest, name: &Spanned<String>, process: &Process) -> Result<Program, Problem> {
    require_name(manifest, name)?;
    match (&process.kind, &process.command) {
        (Some(kind), None) => {
            let known = kinds::KINDS.map(|kind| kind.name);
            let help = match nearest(kind.get_ref(), known) {
                Some(near) => format!("did you mean `{near}`? The kinds are {}", kinds::names()),
                None => format!("the kinds are {}", kinds::names()),
            };
            let message = format!("there is no kind `{}`", kind.get_ref());
            let kind =
                kinds::find(kind.get_ref()).ok_or_else(|| manifest.problem(&kind.span(), message, help))?;
            Ok(Program::of(Executable::Kind(kind)))
        }
        (None, Some(command)) if !command.get_ref().is_empty() => {
            Ok(Program::of(Executable::Command(command.get_ref().clone())))
        }
        (None, Some(command)) => Err(manifest.problem(
            &command.span(),
            "`command` is empty",
            "name an executable and its arguments",
        )),
        _ => Err(manifest.problem(
            &name.span(),
            format!("process `{}` needs either `kind` or `command`", name.get_ref()),
            format!("the kinds are {}", kinds::names()),
        )),
    }
}

fn require_name(manifest: &Manifest, name: &Spanned<String>) -> Result<(), Problem> {
    let text = name.get_ref();
    let fits = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '-' || c == '_';
    if !text.is_empty() && text.chars().all(fits) && text != "clock" {
        return Ok(());
    }
    Err(manifest.problem(
        &name.span(),
        format!("`{text}` cannot name a process"),
        "use lower-case letters, digits, `-` and `_`; `clock` is taken by the clock service",
    ))
}

fn period_ticks(manifest: &Manifest, process: &Process) -> Result<u32, Problem> {
    match &process.period_ticks {
        None => Ok(1),
        Some(period) if *period.get_ref() >= 1 => Ok(*period.get_ref()),
        Some(period) => {
            Err(manifest.problem(&period.span(), "`period_ticks` is 0", "a node runs every 1 or more ticks"))
        }
    }
}

/// All outputs of all processes, each with its topic; two on one topic are refused.
fn publish_all(
    manifest: &Manifest,
    names: &[&Spanned<String>],
    processes: &[&Process],
    programs: &[Program],
) -> Result<Vec<Published>, Problem> {
    let mut all: Vec<Published> = Vec::new();
    for (node, (name, process)) in names.iter().zip(processes).enumerate() {
        for output in published_by(manifest, node, name, process, &programs[node])? {
            if let Some(other) = all.iter().find(|other| other.topic.name == output.topic.name) {
                let message = format!(
                    "two publishers on topic {}: `{}` and `{}`",
                    output.topic.name,
                    names[other.node].get_ref(),
                    name.get_ref()
                );
                let help = format!(
                    "give one of them another topic: [process.{}.outputs] {} = {{ topic = \"/…\" }}",
                    name.get_ref(),
                    output.port
                );
                return Err(manifest.problem(&output.span, message, help));
            }
            all.push(output);
        }
    }
    Ok(all)
}

fn published_by(
    manifest: &Manifest,
    node: usize,
    name: &Spanned<String>,
    process: &Process,
    program: &Program,
) -> Result<Vec<Published>, Problem> {
    let period = period_ticks(manifest, process)?;
    let declared: Vec<(&str, Option<&'static Schema>)> = match &program.executable {
        Executable::Kind(kind) => {
            let names = process.outputs.keys().map(|port| (port.get_ref().as_str(), port.span()));
            require_known_ports(manifest, "output", name, kind.outputs, names)?;
            let is_on = |port: &&PortSpec| port.required || setting(process, port.name).is_some();
            kind.outputs.iter().filter(is_on).map(|port| (port.name, Some(port.schema))).collect()
        }
        Executable::Command(_) => {
            process.outputs.keys().map(|port| (port.get_ref().as_str(), None)).collect()
        }
    };
    declared
        .into_iter()
        .map(|(port, schema)| {
            let (span, setting) = setting(process, port).map_or((name.span(), None), |(s, o)| (s, Some(o)));
            let type_name = type_name(manifest, &span, port, schema, setting)?;
            let period_ticks = output_period(manifest, &span, port, period, setting)?;
            let topic = setting.and_then(|setting| setting.topic.clone());
            let topic = topic.unwrap_or_else(|| format!("/{}/{port}", name.get_ref()));
            require_topic_name(manifest, &span, &topic)?;
            let topic = TopicPlan { name: topic, type_name, period_ticks };
            Ok(Published { node, port: port.to_owned(), span, topic })
        })
        .collect()
}

fn setting<'a>(process: &'a Process, port: &str) -> Option<(Range<usize>, &'a OutputSetting)> {
    process
        .outputs
        .iter()
        .find(|(name, _)| name.get_ref() == port)
        .map(|(name, setting)| (name.span(), setting))
}

fn type_name(
    manifest: &Manifest,
    span: &Range<usize>,
    port: &str,
    schema: Option<&'static Schema>,
    setting: Option<&OutputSetting>,
) -> Result<String, Problem> {
    let stated = setting.and_then(|setting| setting.type_name.as_deref());
    match (schema, stated) {
        (Some(schema), None) => Ok(schema.type_name.to_owned()),
        (Some(schema), Some(stated)) if schema.type_name == stated => Ok(stated.to_owned()),
        (Some(schema), Some(stated)) => Err(manifest.problem(
            span,
            format!("output `{port}` is stated as {stated}, the kind publishes {}", schema.type_name),
            "leave `type` out: a built-in kind knows it",
        )),
        (None, Some(stated)) => Ok(stated.to_owned()),
        (None, None) => Err(manifest.problem(
            span,
            format!("output `{port}` of a command has no `type`"),
            "add type = \"hummingbus_msgs/msg/MotorCommand\", for example; `hummingbus schema` lists the types",
        )),
    }
}

fn output_period(
    manifest: &Manifest,
    span: &Range<usize>,
    port: &str,
    node_period: u32,
    setting: Option<&OutputSetting>,
) -> Result<u32, Problem> {
    match setting.and_then(|setting| setting.every_ticks) {
        None => Ok(node_period),
        Some(every) if every > 0 && every.is_multiple_of(node_period) => Ok(every),
        Some(every) => Err(manifest.problem(
            span,
            format!("output `{port}` is due every {every} ticks, its process runs every {node_period}"),
            "`every_ticks` must be a multiple of the process's `period_ticks`",
        )),
    }
}

fn require_topic_name(manifest: &Manifest, span: &Range<usize>, topic: &str) -> Result<(), Problem> {
    let fits = |c: char| c.is_ascii_alphanumeric() || "/_-".contains(c);
    if topic.starts_with('/') && topic.len() > 1 && topic.len() <= 200 && topic.chars().all(fits) {
        return Ok(());
    }
    let help = "a topic starts with `/` and has letters, digits, `_`, `-` and `/`";
    Err(manifest.problem(span, format!("`{topic}` cannot name a topic"), help))
}

fn require_known_ports(
    manifest: &Manifest,
    direction: &str,
    process: &Spanned<String>,
    ports: &[PortSpec],
    used: impl Iterator<Item = (impl AsRef<str>, Range<usize>)>,
) -> Result<(), Problem> {
    for (name, span) in used {
        let name = name.as_ref();
        if ports.iter().all(|port| port.name != name) {
            let known: Vec<&str> = ports.iter().map(|port| port.name).collect();
            let message = format!("process `{}` has no {direction} `{name}`", process.get_ref());
            let list = if known.is_empty() {
                "it has none".to_owned()
            } else {
                format!("it has {}", known.join(", "))
            };
            let help = nearest(name, known).map_or(list, |near| format!("did you mean `{near}`?"));
            return Err(manifest.problem(&span, message, help));
        }
    }
    Ok(())
}

fn inputs(
    manifest: &Manifest,
    name: &Spanned<String>,
    process: &Process,
    program: &Program,
    topics: &[TopicPlan],
) -> Result<Vec<InputPlan>, Problem> {
    if let Executable::Kind(NodeKind { inputs: Inputs::Any, .. }) = &program.executable
        && process.inputs.is_empty()
    {
        let all = topics.iter().enumerate();
        let port = |(topic, plan): (usize, &TopicPlan)| InputPlan {
            port: plan.name.clone(),
            topic,
            delay_ticks: 0,
            initial: None,
        };
        return Ok(all.map(port).collect());
    }
    if let Executable::Kind(NodeKind { inputs: Inputs::Ports(ports), .. }) = &program.executable {
        let used = process.inputs.keys().map(|port| (port.get_ref(), port.span()));
        require_known_ports(manifest, "input", name, ports, used)?;
        let is_wired = |port: &PortSpec| process.inputs.keys().any(|wired| wired.get_ref() == port.name);
        if let Some(missing) = ports.iter().find(|port| port.required && !is_wired(port)) {
            return Err(manifest.problem(
                &name.span(),
                format!("process `{}` has no publisher for its input `{}`", name.get_ref(), missing.name),
                format!(
                    "add [process.{}.inputs] {} = \"/…\", a topic of {}",
                    name.get_ref(),
                    missing.name,
                    missing.schema.type_name
                ),
            ));
        }
    }
    process
        .inputs
        .iter()
        .map(|(port, setting)| input(manifest, name, port, setting, program, topics))
        .collect()
}

fn input(
    manifest: &Manifest,
    name: &Spanned<String>,
    port: &Spanned<String>,
    setting: &InputSetting,
    program: &Program,
    topics: &[TopicPlan],
) -> Result<InputPlan, Problem> {
    let at = |message: String, help: String| manifest.problem(&port.span(), message, help);
    let who = format!("input `{}` of `{}`", port.get_ref(), name.get_ref());
    let Some(topic) = topics.iter().position(|topic| topic.name == setting.topic) else {
        let known: Vec<&str> = topics.iter().map(|topic| topic.name.as_str()).collect();
        let list = format!("the topics are {}", known.join(", "));
        let help = nearest(&setting.topic, known).map_or(list, |near| format!("did you mean {near}?"));
        return Err(at(format!("{who}: nobody publishes {}", setting.topic), help));
    };
    if let Executable::Kind(NodeKind { inputs: Inputs::Ports(ports), .. }) = &program.executable {
        let spec = ports.iter().find(|spec| spec.name == port.get_ref().as_str());
        let expected = spec.map_or("", |spec| spec.schema.type_name);
        let found = &topics[topic].type_name;
        if expected != found {
            let help = format!("wire a topic of {expected}");
            return Err(at(format!("{who} reads {expected}, {} carries {found}", setting.topic), help));
        }
    }
    match (setting.delay_ticks, &setting.initial) {
        (0, None) | (1, Some(_)) => {}
        (0, Some(_)) => {
            return Err(at(format!("{who} has an initial value but no delay"), "add delay_ticks = 1".into()));
        }
        (1, None) => {
            return Err(at(
                format!("{who} is delayed and has no initial value"),
                "state what it reads at tick 0, such as initial = { command = [1, 1, 1, 1] }".into(),
            ));
        }
        (delay, _) => {
            return Err(at(format!("{who} has delay_ticks = {delay}"), "a delay is 0 or 1 tick".into()));
        }
    }
    let schema = bus::messages::all().into_iter().find(|schema| schema.type_name == topics[topic].type_name);
    if let (Some(schema), Some(initial)) = (schema, &setting.initial) {
        bus::initial::sample(schema, initial).map_err(|reason| {
            at(format!("{who}: initial value: {reason}"), format!("give fields of {}", schema.type_name))
        })?;
    }
    Ok(InputPlan {
        port: port.get_ref().clone(),
        topic,
        delay_ticks: setting.delay_ticks,
        initial: setting.initial.clone(),
    })
}

fn outputs(published: &[Published], node: usize) -> Vec<OutputPlan> {
    let topics = published.iter().enumerate().filter(|(_, output)| output.node == node);
    topics.map(|(topic, output)| OutputPlan { port: output.port.clone(), topic }).collect()
}

/// Refuses a cycle of edges without delay: at its first tick every node of it would wait for another.
fn require_no_cycle(
    manifest: &Manifest,
    names: &[&Spanned<String>],
    nodes: &[NodePlan],
    published: &[Published],
) -> Result<(), Problem> {
    let Some(cycle) = placement::zero_delay_cycle(nodes, |topic| published[topic].node) else {
        return Ok(());
    };
    let path: Vec<&str> =
        cycle.iter().chain(cycle.first()).map(|&node| names[node].get_ref().as_str()).collect();
    Err(manifest.problem(
        &names[cycle[0]].span(),
        format!("a cycle without delay: {}", path.join(" → ")),
        "give one input of the cycle delay_ticks = 1 and an initial value, usually the plant's command",
    ))
}

fn plan(manifest: &Manifest, topics: Vec<TopicPlan>, nodes: Vec<NodePlan>) -> Result<Plan, Problem> {
    let run = &manifest.content.run;
    let rate_hz = *run.rate_hz.get_ref();
    if !(1..=RATE_HZ_MAX).contains(&rate_hz) || 1_000_000_000 % rate_hz != 0 {
        return Err(manifest.problem(
            &run.rate_hz.span(),
            format!("`rate_hz` is {rate_hz}"),
            "a tick must be a whole number of nanoseconds: choose a divisor of 1 000 000 000 such as 250, 500, 1000",
        ));
    }
    let ticks = run.duration_s.get_ref() * f64::from(rate_hz);
    if !(ticks >= 1.0 && ticks <= f64::from(u32::MAX - 2 * WINDOW_TICKS_MAX)) {
        return Err(manifest.problem(
            &run.duration_s.span(),
            format!("`duration_s` is {} s, which is {ticks} ticks", run.duration_s.get_ref()),
            "a run has between 1 and about 4 thousand million ticks",
        ));
    }
    let window_ticks = run.window_ticks.as_ref().map_or(DEFAULT_WINDOW_TICKS, |window| *window.get_ref());
    if !(1..=WINDOW_TICKS_MAX).contains(&window_ticks) {
        let span = run.window_ticks.as_ref().map_or(0..0, Spanned::span);
        return Err(manifest.problem(
            &span,
            format!("`window_ticks` is {window_ticks}"),
            format!("a window has 1 to {WINDOW_TICKS_MAX} ticks"),
        ));
    }
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "checked above")]
    let duration_ticks = ticks.round() as u32;
    Ok(Plan {
        run_id: String::new(),
        seed: run.seed,
        tick_ns: u64::from(1_000_000_000 / rate_hz),
        duration_ticks,
        window_ticks,
        pace: run.pace.0,
        clock_cpu: None,
        profile: false,
        lock_memory: false,
        topics,
        nodes,
    })
}

/// Puts each node's inputs in the order in which they are waited for: the one that arrives last first.
fn order_inputs(plan: &mut Plan, published: &[Published]) {
    let depths = placement::depths(&plan.nodes, |topic| published[topic].node);
    for node in &mut plan.nodes {
        node.inputs.sort_by_key(|input| {
            let producer_depth = if input.delay_ticks == 0 { depths[published[input.topic].node] } else { 0 };
            std::cmp::Reverse(producer_depth)
        });
    }
}

/// Gives every node its parameters, files resolved, and has built-in kinds check theirs.
fn set_parameters(
    manifest: &Manifest,
    names: &[&Spanned<String>],
    processes: &[&Process],
    programs: &[Program],
    plan: &mut Plan,
) -> Result<Vec<PathBuf>, Problem> {
    let mut vehicles = Vec::new();
    for (index, process) in processes.iter().enumerate() {
        let mut parameters: BTreeMap<&str, serde_json::Value> =
            process.parameters.iter().map(|(key, value)| (key.get_ref().as_str(), value.clone())).collect();
        for (key, file) in [("vehicle", &process.vehicle), ("data", &process.data)] {
            if let Some(file) = file {
                let path = manifest.resolve(file)?;
                parameters.insert(key, path.to_string_lossy().into());
                if key == "vehicle" && !vehicles.contains(&path) {
                    vehicles.push(path);
                }
            }
        }
        let parameters = serde_json::to_value(parameters).unwrap_or_default();
        if programs[index].is_recorder() {
            require_no_parameters(manifest, process)?;
        } else if let Executable::Kind(kind) = &programs[index].executable {
            let inputs: Vec<&str> = process.inputs.keys().map(|port| port.get_ref().as_str()).collect();
            (kind.check)(&parameters, &inputs)
                .map_err(|reason| parameter_problem(manifest, names[index], process, &reason))?;
        }
        plan.nodes[index].parameters = parameters;
    }
    Ok(vehicles)
}

/// A recorder's file and attachments come from the launcher.
fn require_no_parameters(manifest: &Manifest, process: &Process) -> Result<(), Problem> {
    match process.parameters.keys().next() {
        None => Ok(()),
        Some(key) => Err(manifest.problem(
            &key.span(),
            format!("a recorder has no parameter `{}`", key.get_ref()),
            "name the file with run.record or --record, and the topics with inputs",
        )),
    }
}

/// The place of a refused parameter: that of the first key the reason names, or of the process.
fn parameter_problem(
    manifest: &Manifest,
    name: &Spanned<String>,
    process: &Process,
    reason: &str,
) -> Problem {
    let mut quoted = reason.split('`').skip(1).step_by(2);
    let key = |word: &str| process.parameters.keys().find(|key| key.get_ref() == word).map(Spanned::span);
    let file = |word: &str| match word {
        "vehicle" => process.vehicle.as_ref().map(Spanned::span),
        "data" => process.data.as_ref().map(Spanned::span),
        _ => None,
    };
    let span = quoted.find_map(|word| key(word).or_else(|| file(word))).unwrap_or_else(|| name.span());
    let help = match reason.split('`').nth(1).filter(|_| reason.starts_with("missing field")) {
        Some(file @ ("vehicle" | "data")) => format!("add {file} = \"PATH\" to [process.{}]", name.get_ref()),
        Some(key) => format!("add {key} = … to [process.{}.parameters]", name.get_ref()),
        None => String::new(),
    };
    manifest.problem(&span, format!("process `{}`: {reason}", name.get_ref()), help)
}

/// Checks that what is evaluated after the run will be recorded, and that its fields and units exist.
fn check_evaluations(manifest: &Manifest, plan: &Plan, programs: &[Program]) -> Result<(), Problem> {
    check_recorded(manifest, plan, programs)?;
    manifest.content.compare.iter().try_for_each(|compare| check_window(manifest, plan, compare))?;
    manifest.content.pass.iter().try_for_each(|pass| check_field(manifest, plan, pass))
}

/// How often the publisher of `topic` is set to a measured state, if it is a plant that is.
fn reset_window_s(plan: &Plan, topic: &str) -> Option<f64> {
    let publishes =
        |node: &&NodePlan| node.outputs.iter().any(|output| plan.topics[output.topic].name == topic);
    plan.nodes.iter().find(publishes)?.parameters.get("window_s")?.as_f64()
}

fn check_window(manifest: &Manifest, plan: &Plan, compare: &Spanned<Comparison>) -> Result<(), Problem> {
    let window_s = compare.get_ref().window_s;
    let duration_s = f64::from(plan.duration_ticks) * plan.tick_s();
    let limits = compare.get_ref();
    if [limits.max_position_m, limits.max_velocity_m_s, limits.max_attitude_deg] == [None; 3] {
        return Err(manifest.problem(
            &compare.span(),
            "the comparison has no limit, so it cannot fail",
            "add max_position_m, max_velocity_m_s or max_attitude_deg",
        ));
    }
    if let Some(set_s) = reset_window_s(plan, &limits.simulated).filter(|set_s| *set_s != window_s) {
        return Err(manifest.problem(
            &compare.span(),
            format!(
                "`window_s` is {window_s} s, but the plant behind {} is set every {set_s} s",
                limits.simulated
            ),
            "give both the same length",
        ));
    }
    // The last tick lies one tick before the end.
    if window_s > 0.0 && window_s <= duration_s - plan.tick_s() + 1e-9 {
        return Ok(());
    }
    Err(manifest.problem(
        &compare.span(),
        format!("`window_s` is {window_s} s: no window of that length ends within the run of {duration_s} s"),
        "choose a window shorter than run.duration_s",
    ))
}

fn check_field(manifest: &Manifest, plan: &Plan, pass: &Spanned<PassCondition>) -> Result<(), Problem> {
    let condition = pass.get_ref();
    let at = |message: String, help: &str| {
        manifest.problem(&pass.span(), format!("pass condition `{}`: {message}", condition.name), help)
    };
    if condition.min.is_none() && condition.max.is_none() {
        return Err(at("it has no limit, so it cannot fail".into(), "add `min`, `max`, or both"));
    }
    let type_name =
        plan.topics.iter().find(|topic| topic.name == condition.topic).map(|topic| &topic.type_name);
    // A user's own type is known only to its publisher: it is checked when the run is judged.
    let Some(schema) = bus::messages::all()
        .into_iter()
        .find(|schema| Some(schema.type_name) == type_name.map(String::as_str))
    else {
        return Ok(());
    };
    let unit = recorder::series::unit_of(schema, &condition.topic, &condition.field)
        .map_err(|error| at(error.to_string(), "name one of these fields"))?;
    match unit.map(|unit| judge::conversion(&unit, &condition.unit)) {
        Some(Err(reason)) => Err(at(reason, "state the limits in a unit of the field's quantity")),
        _ => Ok(()),
    }
}

/// A second recorder would write to the same file.
fn require_one_recorder(
    manifest: &Manifest,
    names: &[&Spanned<String>],
    programs: &[Program],
) -> Result<(), Problem> {
    let mut recorders = names.iter().zip(programs).filter(|(_, program)| program.is_recorder());
    match (recorders.next(), recorders.next()) {
        (Some((first, _)), Some((second, _))) => Err(manifest.problem(
            &second.span(),
            format!("`{}` is a second recorder beside `{}`", second.get_ref(), first.get_ref()),
            "a run has one recording: give all topics to one recorder",
        )),
        _ => Ok(()),
    }
}

/// A recorder that ran less often, or looked back, would leave samples out.
fn require_whole_recording(
    manifest: &Manifest,
    names: &[&Spanned<String>],
    plan: &Plan,
    programs: &[Program],
) -> Result<(), Problem> {
    let recorders = plan.nodes.iter().zip(names).zip(programs).filter(|(_, program)| program.is_recorder());
    for ((node, name), _) in recorders {
        if node.period_ticks != 1 || node.inputs.iter().any(|input| input.delay_ticks != 0) {
            return Err(manifest.problem(
                &name.span(),
                format!("the recorder `{}` would leave samples out", name.get_ref()),
                "leave `period_ticks` and `delay_ticks` out: a recorder takes every sample",
            ));
        }
    }
    Ok(())
}

fn check_recorded(manifest: &Manifest, plan: &Plan, programs: &[Program]) -> Result<(), Problem> {
    let content = &manifest.content;
    let passes = content.pass.iter().map(|pass| (pass.span(), vec![&pass.get_ref().topic]));
    let compares = content
        .compare
        .iter()
        .map(|compare| (compare.span(), vec![&compare.get_ref().simulated, &compare.get_ref().measured]));
    for (span, topics) in passes.chain(compares) {
        for topic in topics {
            if !plan.topics.iter().any(|known| known.name == *topic) {
                let known: Vec<&str> = plan.topics.iter().map(|topic| topic.name.as_str()).collect();
                let list = format!("the topics are {}", known.join(", "));
                let help = nearest(topic, known).map_or(list, |near| format!("did you mean {near}?"));
                return Err(manifest.problem(&span, format!("nobody publishes {topic}"), help));
            }
            let recorders = plan.nodes.iter().zip(programs).filter(|(_, program)| program.is_recorder());
            let is_recorded = recorders
                .flat_map(|(node, _)| &node.inputs)
                .any(|input| plan.topics[input.topic].name == *topic);
            if !is_recorded {
                let help = "add a process with kind = \"recorder\" that takes it";
                return Err(manifest.problem(&span, format!("{topic} is judged but not recorded"), help));
            }
        }
    }
    Ok(())
}
