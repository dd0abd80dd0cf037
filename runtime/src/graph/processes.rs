//! Processes: the executable of each, and its settings on the host.

use crate::manifest::{Manifest, Process, is_name};
use crate::output_file;
use crate::program::{Executable, OnExit, Program, Readiness};
use crate::spawn::SCRATCH_VARIABLE;
use bus::component::Transfer;
use bus::plan::NodePlan;
use bus::process::{LAUNCHER_VARIABLE, RUN_VARIABLE};
use bus::sample_ticks::SampleTicks;
use bus::{GENERATION_VARIABLE, NODE_VARIABLE, Registration};
use diagnostics::{Diagnostic, Faults, did_you_mean, suggestion};
use inputs::InputFiles;
use std::collections::BTreeMap;
use std::fs::File;
use std::io::Read as _;
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use std::time::Duration;
use toml::Spanned;

/// A process that takes part in the ticks, on its way into the plan.
#[derive(Clone)]
pub struct DeclaredNode<'m> {
    /// The manifest that declares it.
    pub manifest: &'m Manifest,
    /// The files of the run.
    pub files: &'m InputFiles,
    /// Its name.
    pub name: &'m Spanned<String>,
    /// Its table in the manifest.
    pub process: &'m Process,
    /// Its program.
    pub program: Program,
    /// True for a node with a fault that hides what it reads and sends: a check goes on without looking at it.
    pub is_unchecked: bool,
}

impl DeclaredNode<'_> {
    /// True for a backup: its keys are those of a process with those of its `with` or `standby`.
    pub fn is_backup(&self) -> bool {
        self.manifest.content.process.keys().all(|process| process.span() != self.name.span())
    }
}

/// The processes that take part in the ticks, by name; they read from `files`.
///
/// # Errors
/// If there is none, or one has a key that only a sidecar may have, or cannot be started.
pub fn declared_nodes<'m>(
    manifest: &'m Manifest,
    files: &'m InputFiles,
) -> Result<Vec<DeclaredNode<'m>>, Diagnostic> {
    let mut faults = Faults::default();
    let declared_nodes = declared_apart(manifest, files, &mut faults);
    let declared_nodes = faults.keep(declared_nodes);
    faults.finish(declared_nodes)
}

/// As [`declared_nodes`], for a check that goes on: a node with a fault, which goes to `faults`, is left unchecked.
///
/// # Errors
/// If there is none.
pub fn declared_apart<'m>(
    manifest: &'m Manifest,
    files: &'m InputFiles,
    faults: &mut Faults,
) -> Result<Vec<DeclaredNode<'m>>, Diagnostic> {
    let declared = |(name, process): (&'m Spanned<String>, &'m Process)| {
        let has_gap = manifest.repairs.processes.contains(name.get_ref());
        let program = (!has_gap).then(|| {
            require_no_sidecar(manifest, name, process)?;
            program(manifest, name, process)
        });
        let program = program.and_then(|program| faults.keep(program));
        let is_unchecked = program.is_none();
        let program = program.unwrap_or_else(Program::unknown);
        DeclaredNode { manifest, files, name, process, program, is_unchecked }
    };
    let declared_nodes = manifest.content.process.iter().filter(|(_, process)| takes_part(process));
    let declared_nodes: Vec<_> = declared_nodes.map(declared).collect();
    if declared_nodes.is_empty() {
        let file = manifest.path.display().to_string();
        return Err(Diagnostic::in_file(file, "there is no process").help("add [process.<name>] tables"));
    }
    Ok(declared_nodes)
}

/// True for a process that takes part in the ticks, and is no sidecar.
pub fn takes_part(process: &Process) -> bool {
    process.lockstep.as_ref().is_none_or(|lockstep| *lockstep.get_ref())
}

/// Refuses keys that only a sidecar may have.
fn require_no_sidecar(
    manifest: &Manifest,
    name: &Spanned<String>,
    process: &Process,
) -> Result<(), Diagnostic> {
    let name = name.get_ref();
    let message = |_: &Readiness| format!("`ready` of `{name}`, which takes part in the ticks");
    let help = "leave it out: a node is ready when it has joined; sidecars (lockstep = false) may say so";
    manifest.require(&process.ready, |_| false, message, help)?;
    if let Some(first) = process.after.first() {
        let message = format!("`after` of `{name}`, which takes part in the ticks");
        let help = "leave it out: nodes wait for each other's samples; sidecars (lockstep = false) start in an order";
        return Err(manifest.problem(&first.span(), message, help));
    }
    let message = |_: &OnExit| format!("`on_exit` of `{name}`: no tick can be computed without a node");
    let help = "stop (the default), restart or standby; only sidecars (lockstep = false) can be ignored";
    manifest.require(&process.on_exit, |on_exit| *on_exit != OnExit::Ignore, message, help)
}

/// Program of `process`, with its settings.
///
/// # Errors
/// If it cannot be started here: the faults of all of its settings.
pub fn program(
    manifest: &Manifest,
    name: &Spanned<String>,
    process: &Process,
) -> Result<Program, Diagnostic> {
    let mut faults = Faults::default();
    faults.keep(require_name(manifest, name));
    let environment = faults.keep(environment(manifest, process));
    faults.keep(require_core(manifest, &process.cpu, "cpu"));
    let help = "no process computes in no time: give milliseconds of host time, such as 20000";
    let watchdog = manifest.within("watchdog_ms_host", &process.watchdog_ms_host, 1..=u64::MAX, help);
    let watchdog = faults.keep(watchdog);
    let nice = faults.keep(manifest.within("nice", &process.nice, -20..=19, "it goes from -20 to 19"));
    let priority = &process.realtime_priority;
    let priority =
        faults.keep(manifest.within("realtime_priority", priority, 1..=99, "it goes from 1 to 99"));
    let directory = faults.keep(working_directory(manifest, process));
    let log = faults.keep(log(manifest, process));
    // The folders of PATH are those of its environment.
    let executable = environment
        .as_ref()
        .and_then(|environment| faults.keep(executable(manifest, name, process, environment)));
    let first_word = process.command.as_ref().and_then(|command| command.get_ref().first().cloned());
    let program = (|| {
        Some(Program {
            executable: executable?,
            first_word: first_word.unwrap_or_default(),
            environment: environment?,
            working_directory: directory?,
            nice: nice?,
            realtime_priority: priority?,
            on_exit: process.on_exit.as_ref().map_or(OnExit::Stop, |on_exit| *on_exit.get_ref()),
            watchdog: watchdog?.map_or(crate::program::WATCHDOG, Duration::from_millis),
            ready: process.ready.as_ref().map_or(Readiness::Started, |ready| *ready.get_ref()),
            after: Vec::new(),
            log: log?,
        })
    })();
    faults.finish(program)
}

fn executable(
    manifest: &Manifest,
    name: &Spanned<String>,
    process: &Process,
    environment: &BTreeMap<String, String>,
) -> Result<Executable, Diagnostic> {
    match (&process.kind, &process.command) {
        (Some(kind), None) => {
            let registry = manifest.registry();
            let component = registry.find(kind.get_ref()).map(Executable::Component);
            let found = component.or_else(|| registry.program(kind.get_ref()).map(Executable::Program));
            found.ok_or_else(|| {
                let near = suggestion(kind.get_ref(), registry.kinds());
                let near = near.map_or("the".to_owned(), |question| format!("{question} The"));
                let message = format!("there is no kind `{}`", kind.get_ref());
                manifest.problem(&kind.span(), message, format!("{near} kinds are {}", registry.names()))
            })
        }
        (None, Some(command)) => self::command(manifest, name, environment, command).map(Executable::Command),
        (Some(_), Some(command)) => {
            let message = format!("process `{}` has both `kind` and `command`", name.get_ref());
            Err(manifest.problem(&command.span(), message, "leave one of them out"))
        }
        (None, None) => Err(nameless(manifest, name)),
    }
}

/// Error of a process without `kind` and `command`: most likely a name in a `--set` that no process has.
fn nameless(manifest: &Manifest, name: &Spanned<String>) -> Diagnostic {
    let found = name.get_ref();
    if !manifest.sources.is_override(name.span().start) {
        let message = format!("process `{found}` needs either `kind` or `command`");
        let help = format!("the kinds are {}", manifest.registry().names());
        return manifest.problem(&name.span(), message, help);
    }
    let others = manifest.content.process.keys().map(|name| name.get_ref().as_str());
    let help = did_you_mean(found, others.filter(|name| name != found), "the processes are");
    manifest.problem(&name.span(), format!("there is no process `{found}`"), help)
}

/// The arguments of a command; the first becomes the path of a file that can be executed, with its variables replaced. A shell may have
/// variables of its own in the others.
fn command(
    manifest: &Manifest,
    name: &Spanned<String>,
    environment: &BTreeMap<String, String>,
    command: &Spanned<Vec<String>>,
) -> Result<Vec<String>, Diagnostic> {
    let refused = |message: &str, help: &str| manifest.problem(&command.span(), message, help);
    let Some((word, arguments)) = command.get_ref().split_first() else {
        return Err(refused("`command` is empty", "name an executable and its arguments"));
    };
    if command.get_ref().iter().any(|word| word.contains('\0')) {
        return Err(refused("a word of `command` holds a NUL", "no program can be given one"));
    }
    let who = format!("process `{}`: cannot start", name.get_ref());
    let written = Spanned::new(command.span(), word.clone());
    let word = &manifest.expand(&written, "the program is")?;
    let path = if word.contains('/') {
        let path = manifest.resolve(&written)?;
        if let Some((why, help)) = objection(&path) {
            return Err(refused(&format!("{who} {}: {why}", path.display()), help));
        }
        path.to_string_lossy().into_owned()
    } else {
        in_path(environment, word).ok_or_else(|| {
            let message = format!("{who} `{word}`: no folder of PATH holds such an executable");
            refused(&message, "install it, or give a path with a `/`, relative to the manifest")
        })?
    };
    Ok(std::iter::once(&path).chain(arguments).cloned().collect())
}

/// Reason why a file cannot be executed, and advice.
fn objection(path: &Path) -> Option<(&'static str, &'static str)> {
    if !path.is_file() {
        let help = if is_python_of_environment(path) {
            "make this Python environment and install hummingbus into it: README.md of the project has the lines with \
             `python3 -m venv` and `pip install`, and so has docs/python.md"
        } else {
            "build it, or give its path relative to the manifest"
        };
        Some(("there is no such file", help))
    } else if !is_executable(path) {
        Some(("it is not executable", "make it so with chmod +x"))
    } else if is_text_without_interpreter(path) {
        let help =
            "begin it with #! and its interpreter, or name that first, such as [\"python3\", \"script.py\"]";
        Some(("it is text that names no interpreter", help))
    } else {
        None
    }
}

/// True for the interpreter of a Python environment, such as `venv/bin/python`.
fn is_python_of_environment(path: &Path) -> bool {
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    name.starts_with("python")
        && !path.starts_with("/usr")
        && path.parent().is_some_and(|folder| folder.ends_with("bin"))
}

/// True if no kernel can execute the file: it is text that does not begin with `#!`. The C library would pass any
/// such file to a shell.
fn is_text_without_interpreter(path: &Path) -> bool {
    let mut start = Vec::new();
    let read = File::open(path).and_then(|file| file.take(256).read_to_end(&mut start));
    // A file that can be executed but not read is left to the kernel, as is one with another kind of program.
    read.is_ok() && !start.starts_with(b"#!") && !start.contains(&0)
}

/// The file behind a bare name, in the folders of the PATH that the process will have.
fn in_path(environment: &BTreeMap<String, String>, word: &str) -> Option<String> {
    let path = environment.get("PATH").map(Into::into).or_else(|| std::env::var_os("PATH"))?;
    let mut files = std::env::split_paths(&path).map(|folder| folder.join(word));
    let found = files.find(|file| !word.is_empty() && is_executable(file))?;
    Some(std::path::absolute(&found).unwrap_or(found).to_string_lossy().into_owned())
}

fn is_executable(path: &Path) -> bool {
    path.metadata().is_ok_and(|file| file.is_file() && file.permissions().mode() & 0o111 != 0)
}

/// Each part of a name: the process's own, or a vehicle's and the process's in its set.
fn require_name(manifest: &Manifest, name: &Spanned<String>) -> Result<(), Diagnostic> {
    let text = name.get_ref();
    if text != "clock" && text.split('/').all(is_name) {
        return Ok(());
    }
    let help = "use lower-case letters, digits, `-` and `_`; `clock` is taken by the clock service";
    Err(manifest.problem(&name.span(), format!("`{text}` cannot name a process"), help))
}

/// Ticks between two computations of `process`, which is of `kind` if it is a component: as stated, or those that the component
/// chooses by its parameters.
///
/// # Errors
/// If it is 0.
pub fn period_ticks(
    manifest: &Manifest,
    process: &Process,
    kind: Option<&Registration>,
) -> Result<u32, Diagnostic> {
    let help = "a node runs every 1 or more ticks";
    if let Some(period) = manifest.within("period_ticks", &process.period_ticks, 1..=u32::MAX, help)? {
        return Ok(period);
    }
    // Outputs whose period is stated are multiples of the node's.
    let has_stated_output = process.outputs.values().any(|output| output.every_ticks.is_some());
    let Some(kind) = kind.filter(|_| !has_stated_output) else { return Ok(1) };
    Ok(kind.period_ticks(&parameters(process), tick_ns(manifest)))
}

/// Ticks at which the outputs of `process` are sent that state no `every_ticks`; it computes every `period` ticks, and is of `kind`
/// if it is a component. A computing time moves what it sends to other ticks than those at which measurements arrive.
pub fn sample_ticks(
    manifest: &Manifest,
    process: &Process,
    kind: Option<&Registration>,
    period: u32,
) -> SampleTicks {
    let of = |kind: &Registration| kind.sample_ticks(&parameters(process), tick_ns(manifest), period);
    kind.filter(|_| process.computing_time.is_none()).map_or(SampleTicks::every(period), of)
}

/// The parameters of `process` as its table states them.
fn parameters(process: &Process) -> serde_json::Value {
    let parameters = process.parameters.iter().map(|(key, value)| (key.get_ref().clone(), value.clone()));
    parameters.collect::<serde_json::Map<_, _>>().into()
}

fn tick_ns(manifest: &Manifest) -> u64 {
    1_000_000_000 / u64::from((*manifest.content.run.rate_hz.get_ref()).max(1))
}

/// The environment variables of `process`, their values with those of the launcher replaced.
fn environment(manifest: &Manifest, process: &Process) -> Result<BTreeMap<String, String>, Diagnostic> {
    /// Variables that the launcher sets.
    const SET: [&str; 5] =
        [GENERATION_VARIABLE, LAUNCHER_VARIABLE, NODE_VARIABLE, RUN_VARIABLE, SCRATCH_VARIABLE];
    let expanded = |(name, value): (&Spanned<String>, &String)| {
        let text = name.get_ref();
        if SET.contains(&text.as_str()) {
            let help = "leave it out: by it a process finds its run";
            return Err(manifest.problem(&name.span(), format!("{text} is set by the launcher"), help));
        }
        if text.is_empty() || text.contains(['=', '\0']) || value.contains('\0') {
            let message = format!("{text:?} = {value:?} cannot be an environment variable");
            return Err(manifest.problem(&name.span(), message, "a name has no `=`, and neither has a NUL"));
        }
        let written = Spanned::new(name.span(), value.clone());
        Ok((text.clone(), manifest.expand(&written, &format!("`environment.{text}` is"))?))
    };
    let all = Diagnostic::gather(process.environment.iter().map(expanded))?;
    Ok(all.into_iter().collect())
}

/// Refuses a core that this machine does not have, or does not allow.
///
/// # Errors
/// With the cores there are.
pub fn require_core(manifest: &Manifest, cpu: &Option<Spanned<usize>>, key: &str) -> Result<(), Diagnostic> {
    let allowed = bus::process::allowed_cores();
    let list: Vec<String> = allowed.iter().map(ToString::to_string).collect();
    let message = |cpu: &usize| format!("`{key}` is {cpu}, a core that is not allowed here");
    let help = format!("the allowed cores are {}", list.join(", "));
    manifest.require(cpu, |cpu| allowed.is_empty() || allowed.contains(cpu), message, help)
}

fn working_directory(manifest: &Manifest, process: &Process) -> Result<Option<PathBuf>, Diagnostic> {
    let Some(written) = &process.working_directory else { return Ok(None) };
    let path = manifest.resolve(written)?;
    if path.is_dir() {
        return Ok(Some(path));
    }
    let message = format!("`working_directory`: {} is no folder", path.display());
    Err(manifest.problem(&written.span(), message, "make this folder, or name another"))
}

fn log(manifest: &Manifest, process: &Process) -> Result<Option<PathBuf>, Diagnostic> {
    let Some(written) = &process.log else { return Ok(None) };
    let path = manifest.resolve(written)?;
    let at = |message: String, help: &str| Err(manifest.problem(&written.span(), message, help));
    if path.is_dir() {
        return at(format!("`log`: {} is a folder", path.display()), "name a file in it");
    }
    if !path.parent().is_some_and(Path::is_dir) {
        return at(format!("`log`: the folder of {} is not there", path.display()), "make it");
    }
    match output_file::check(&path, &output_file::LOG) {
        Ok(()) => Ok(Some(path)),
        Err(error) => at(format!("`log`: {}", error.with_causes()), ""),
    }
}

/// Refuses two processes that would write over each other's log.
///
/// # Errors
/// With both names.
pub fn require_own_logs(manifest: &Manifest) -> Result<(), Diagnostic> {
    let mut logs: BTreeMap<PathBuf, &str> = BTreeMap::new();
    for (name, process) in &manifest.content.process {
        let Some(written) = &process.log else { continue };
        if let Some(other) = logs.insert(manifest.resolve(written)?, name.get_ref()) {
            let message = format!("`log`: `{}` writes to the file of `{other}`", name.get_ref());
            let help = "give each a file of its own, those of a set in the [[vehicle]] tables";
            return Err(manifest.problem(&written.span(), message, help));
        }
    }
    Ok(())
}

/// Refuses to keep a run going without a process where that cannot work.
///
/// # Errors
/// With the reason.
pub fn require_replaceable(declared: &DeclaredNode<'_>, node: &NodePlan) -> Result<(), Diagnostic> {
    let Some(reason) = irreplaceable(declared, node) else { return Ok(()) };
    let message = |_: &OnExit| format!("`on_exit` of `{}`: {reason}", declared.name.get_ref());
    let help = "leave it out: the run stops when the process does";
    declared.manifest.require(&declared.process.on_exit, |on_exit| *on_exit == OnExit::Stop, message, help)
}

/// Reason why another process cannot go on in the place of this one.
pub fn irreplaceable(declared: &DeclaredNode<'_>, node: &NodePlan) -> Option<&'static str> {
    let component = declared.program.component();
    if declared.program.is_recorder() {
        Some("it is the recorder, and its file would be torn")
    } else if component
        .is_some_and(|component| matches!(component.transfer, Transfer::File | Transfer::Growing(_)))
    {
        Some("it writes a file, which no other process can go on with")
    } else if node.outputs.is_empty() {
        Some("it has no outputs, so nothing could be transferred")
    } else {
        None
    }
}
