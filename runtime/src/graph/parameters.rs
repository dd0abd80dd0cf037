//! Parameters: the values that each node reads about itself, checked by its kind.

use super::processes::DeclaredNode;
use super::{placeholders, ranges};
use crate::manifest::{InputSetting, Manifest, Process};
use crate::program::Executable;
use crate::registry::Registry;
use bus::context::{InputMessage, NodeContext, SampleTimes};
use bus::plan::Plan;
use bus::{FileKind, FileRole, Registration};
use diagnostics::{Diagnostic, ParameterError};
use inputs::{InputFile, InputFiles};
use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;
use std::path::{Path, PathBuf};
use toml::Spanned;

/// Key of the path of a file of settings in a table of parameters, whose other values replace those of the file.
const FILE: &str = "file";

/// Notes taken while a manifest becomes a plan.
#[derive(Debug, Default)]
pub struct Notes {
    /// The files that the processes name, and those that belong to them.
    pub models: Vec<PathBuf>,
    /// Legal but unusual values.
    pub warnings: Vec<Diagnostic>,
    /// Those about files that may explain why such a file is refused, by the key of the file.
    explaining: Vec<(String, Diagnostic)>,
    /// Times of the samples of each node's first process, by its name.
    pub times: BTreeMap<String, SampleTimes>,
    /// True if warnings were left out because the run was cut short.
    has_cut: bool,
}

impl Notes {
    /// True if `span` lies behind the end only because another text states the duration: `--set`, or a file that
    /// includes the one with `span`. The user then looks at the start of the run, and gets one warning about the
    /// rest.
    pub fn is_cut(&mut self, manifest: &Manifest, span: &Range<usize>) -> bool {
        let is_cut = !manifest.sources.is_one_text(span.start, manifest.content.run.duration_s.span().start);
        self.has_cut |= is_cut;
        is_cut
    }

    /// A fault of processes; if it refuses a file, with the warnings that may explain it.
    pub fn explain(&self, fault: Diagnostic) -> Diagnostic {
        let refused: Vec<String> = fault.all().map(|fault| fault.key().to_owned()).collect();
        let explaining = self.explaining.iter().filter(|(key, _)| refused.contains(key));
        let warnings: Vec<Diagnostic> = explaining.map(|(_, warning)| warning.clone()).collect();
        if warnings.is_empty() { fault } else { fault.with_warnings(warnings) }
    }

    /// The warnings, with one about everything that a run that was cut short leaves out.
    pub fn into_parts(mut self, manifest: &Manifest) -> (Vec<PathBuf>, Vec<Diagnostic>) {
        if self.has_cut {
            let duration = &manifest.content.run.duration_s;
            let message = format!(
                "`duration_s` is {} s, and set points, segments or conditions come after that",
                duration.get_ref()
            );
            let help = "set points do not act; a condition without a sample does not pass";
            self.warnings.push(manifest.problem(&duration.span(), message, help));
        }
        let mut noted = BTreeSet::new();
        self.models.retain(|path| noted.insert(path.clone()));
        (self.models, self.warnings)
    }
}

/// The parameters of `declared`, with resolved files, and the files that it reads. If its kind is built in, they are
/// checked for a node that computes every `period_ticks` of the run of `plan`. Notes its files, with those that they
/// name, and unusual values.
///
/// # Errors
/// A file or a parameter that is refused.
pub fn of(
    declared: &DeclaredNode<'_>,
    plan: &Plan,
    period_ticks: u32,
    notes: &mut Notes,
) -> Result<(serde_json::Value, Vec<InputFile>), Diagnostic> {
    checked(declared, plan, period_ticks, notes, Scope::All)
}

/// Checks the parameters of `declared` that do not depend on its inputs and on times, and the files that it names.
///
/// # Errors
/// Their faults.
pub fn check_alone(
    declared: &DeclaredNode<'_>,
    plan: &Plan,
    period_ticks: u32,
    notes: &mut Notes,
) -> Result<(), Diagnostic> {
    checked(declared, plan, period_ticks, notes, Scope::Alone).map(drop)
}

/// Extent of a check.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Scope {
    /// All faults.
    All,
    /// Faults that do not depend on the inputs of the node and on times.
    Alone,
}

/// A file of a manifest and its copy with the values of `--set`, which the node reads.
struct Edited<'k> {
    key: &'k str,
    original: PathBuf,
    copy: PathBuf,
}

/// Parameters of a node with the paths of its files.
struct Resolved<'k> {
    parameters: BTreeMap<&'k str, serde_json::Value>,
    edited: Vec<Edited<'k>>,
    has_program: bool,
}

fn checked(
    declared: &DeclaredNode<'_>,
    plan: &Plan,
    period_ticks: u32,
    notes: &mut Notes,
    scope: Scope,
) -> Result<(serde_json::Value, Vec<InputFile>), Diagnostic> {
    let DeclaredNode { manifest, process, program, .. } = declared;
    let read = declared.files.listing_anew();
    let resolved = resolved(declared, &read, notes)?;
    let parameters = serde_json::to_value(&resolved.parameters).unwrap_or_default();
    if program.is_recorder() {
        require_none(manifest, process)?;
    } else if program.is_judge() {
        return Ok((serde_json::json!({ "conditions": manifest.content.conditions() }), Vec::new()));
    } else if let Executable::Component(kind) = &program.executable {
        let inputs: Vec<&str> = process.inputs.keys().map(|port| port.get_ref().as_str()).collect();
        let outputs: Vec<&str> = process.outputs.keys().map(|port| port.get_ref().as_str()).collect();
        let messages = messages(declared, plan);
        let context = NodeContext::new(declared.name.get_ref(), &inputs)
            .naming(&outputs)
            .reading(&messages)
            .timed(plan.tick_ns, period_ticks, plan.duration_ticks)
            .seeded(plan.seed)
            .given(&read);
        let checked = check_component(declared, kind, (&parameters, &resolved.edited), &context, scope);
        notes.times.entry(declared.name.get_ref().clone()).or_insert_with(|| context.times());
        // A program has files beside it.
        if resolved.has_program {
            notes.models.extend(read.used().into_iter().map(|file| file.path));
        }
        note_warnings(declared, context, &resolved.edited, notes);
        checked?;
    }
    Ok((parameters, read.used()))
}

/// The parameters of `declared` with the files that it names, as the node gets them. Notes the files.
fn resolved<'a>(
    declared: &DeclaredNode<'a>,
    read: &InputFiles,
    notes: &mut Notes,
) -> Result<Resolved<'a>, Diagnostic> {
    let DeclaredNode { manifest, name, process, program, .. } = declared;
    let (mut parameters, mut edited, mut has_program) = (stated(declared)?, Vec::new(), false);
    for (key, file, kind) in own_files(declared) {
        let path = manifest.resolve(&file)?;
        parameters.insert(key, path.to_string_lossy().into_owned().into());
        has_program |= kind.role == FileRole::Program;
        if kind.role != FileRole::Data {
            notes.models.extend(named_files(declared, read, key, path));
        }
    }
    for (key, file) in process.files() {
        let role = file_kind(declared, key).map(|kind| kind.role);
        let is_data = role == Some(FileRole::Data);
        has_program |= role == Some(FileRole::Program);
        let original = manifest.resolve(file)?;
        let copy = manifest.with_edits(declared.files, name.get_ref(), key, original.clone())?;
        let path = copy.to_string_lossy().into_owned();
        if copy != original {
            edited.push(Edited { key, original, copy });
        }
        if let Some(stated) = parameters.insert(key, path.as_str().into()) {
            let over_file = over_file(declared, key, &path, stated).ok_or_else(|| has_two(declared, key))?;
            parameters.insert(key, over_file);
        }
        let named = named_files(declared, read, key, path.into());
        if program.component().is_none() {
            read_named(read, key, &named, is_data).map_err(|message| {
                let message = format!("process `{}`: {message}", name.get_ref());
                manifest.problem(&file.span(), message, "give its path relative to the manifest")
            })?;
        }
        if !is_data {
            notes.models.extend(named);
        }
    }
    Ok(Resolved { parameters, edited, has_program })
}

/// Files that `declared` names among its `parameters`: those that its component declares under a key that is no key of a process.
fn own_files<'a>(declared: &DeclaredNode<'a>) -> Vec<(&'a str, Spanned<String>, FileKind)> {
    let Some(component) = declared.program.component() else { return Vec::new() };
    let of = |(key, value): (&'a Spanned<String>, &serde_json::Value)| {
        let name = key.get_ref().as_str();
        let kind = component.file(name).filter(|_| !is_file_key(name))?;
        Some((name, Spanned::new(key.span(), value.as_str()?.to_owned()), kind))
    };
    declared.process.parameters.iter().filter_map(of).collect()
}

/// True for a key of a process that names a file.
fn is_file_key(key: &str) -> bool {
    Process::file_keys().any(|file| file == key)
}

/// Checks the `parameters` of `declared`, a component of `kind`, some of whose files are `edited` copies.
fn check_component(
    declared: &DeclaredNode<'_>,
    kind: &Registration,
    (parameters, edited): (&serde_json::Value, &[Edited<'_>]),
    context: &NodeContext<'_>,
    scope: Scope,
) -> Result<(), Diagnostic> {
    let DeclaredNode { manifest, name, process, .. } = declared;
    let ranges = ranges::check(manifest, name, process);
    let refused = |error: ParameterError| {
        let error = edited.iter().fold(error, |error, Edited { key, original, copy }| {
            manifest.without_copy(declared.files, (name.get_ref(), key), (original, copy), error)
        });
        Err::<(), _>(refused(declared, &error))
    };
    // No kind is made of a number that is out of all range.
    let errors = match ranges.is_ok().then(|| kind.check(parameters, context)) {
        None => {
            let rest = ranges::without(parameters);
            [kind.faults(parameters), kind.faults_of_files(&rest, &context.clone())].concat()
        }
        Some(Ok(())) => Vec::new(),
        Some(Err(told)) => all_errors(kind, parameters, context, told, scope),
    };
    beside(ranges, Diagnostic::gather(errors.into_iter().map(refused)).map(drop))
}

/// Notes the warnings of the component that was made in `context`.
fn note_warnings(
    declared: &DeclaredNode<'_>,
    context: NodeContext<'_>,
    edited: &[Edited<'_>],
    notes: &mut Notes,
) {
    let DeclaredNode { manifest, name, .. } = declared;
    for warning in context.into_warnings() {
        let at = place(declared, &warning.key);
        if warning.is_behind_end && notes.is_cut(manifest, &at) {
            continue;
        }
        let message = edited.iter().fold(warning.message, |message, Edited { key, original, copy }| {
            manifest.without_copy_in(declared.files, (name.get_ref(), key), (original, copy), &message)
        });
        let warning_at = problem(declared, &at, &message, String::new());
        if file_kind(declared, &warning.key).is_some_and(|kind| kind.has_explaining_warnings) {
            notes.explaining.push((warning.key, warning_at.clone()));
        }
        notes.warnings.push(warning_at);
    }
}

/// The parameters as the manifest states them. Those of a command may hold placeholders, which are replaced.
fn stated<'a>(declared: &DeclaredNode<'a>) -> Result<BTreeMap<&'a str, serde_json::Value>, Diagnostic> {
    let is_command = matches!(declared.program.executable, Executable::Command(_));
    let of = |(key, value): (&'a Spanned<String>, &serde_json::Value)| {
        let value = if is_command {
            placeholders::replaced(declared.manifest, &key.span(), value)?
        } else {
            value.clone()
        };
        Ok((key.get_ref().as_str(), value))
    };
    declared.process.parameters.iter().map(of).collect()
}

/// The errors of `parameters`, which `kind` refuses as `told` says.
fn all_errors(
    kind: &Registration,
    parameters: &serde_json::Value,
    context: &NodeContext<'_>,
    told: ParameterError,
    scope: Scope,
) -> Vec<ParameterError> {
    let faults = kind.faults(parameters);
    let of_files = match faults.is_empty() {
        true => Vec::new(),
        // Warnings and times of parameters that nobody wrote are those of another node.
        false => kind.faults_of_files(parameters, &context.clone()),
    };
    let is_of_file = |error: &ParameterError| matches!(error, ParameterError::File { .. });
    let told = told.into_each().into_iter().filter(|error| scope == Scope::All || is_of_file(error));
    let mut errors: Vec<ParameterError> = Vec::new();
    for error in told.chain(faults).chain(of_files) {
        if !errors.contains(&error) {
            errors.push(error);
        }
    }
    errors
}

/// Both faults; of those at one place, the `first`.
fn beside(first: Result<(), Diagnostic>, second: Result<(), Diagnostic>) -> Result<(), Diagnostic> {
    let (Err(first), Err(second)) = (&first, &second) else { return first.and(second) };
    let more: Vec<_> =
        second.all().filter(|fault| first.all().all(|other| other.place != fault.place)).collect();
    Err(first.clone().and(more))
}

/// The parameter `key` of a component that names the file of settings at `path` and has the table `stated` in its parameters:
/// the values of the table replace those of the file. `None` if the two exclude each other.
fn over_file(
    declared: &DeclaredNode<'_>,
    key: &str,
    path: &str,
    stated: serde_json::Value,
) -> Option<serde_json::Value> {
    declared.program.component()?;
    let serde_json::Value::Object(mut table) = stated else { return None };
    let has_settings = file_kind(declared, key).is_some_and(|kind| kind.role == FileRole::Settings);
    if !has_settings || table.contains_key(FILE) {
        return None;
    }
    table.insert(FILE.to_owned(), path.into());
    Some(table.into())
}

/// A file and a parameter at the same `key` of `declared`, of which only one can be used.
fn has_two(declared: &DeclaredNode<'_>, key: &str) -> Diagnostic {
    let name = declared.name.get_ref();
    let message = format!("`{name}` has `{key}` twice: as a file, and in its parameters");
    let help = format!("leave one of them out; to change values, name another file: {key} = \"PATH\"");
    declared.manifest.problem(&place(declared, key), message, help)
}

/// The kind of the file `key` of `declared`, if it is declared.
fn file_kind(declared: &DeclaredNode<'_>, key: &str) -> Option<FileKind> {
    declared.manifest.registry().file(declared.program.component(), key)
}

/// The file at `path`, the value of `key` of `declared`, with the files that it names itself.
fn named_files(declared: &DeclaredNode<'_>, files: &InputFiles, key: &str, path: PathBuf) -> Vec<PathBuf> {
    let others = file_kind(declared, key).map_or(Vec::new(), |kind| (kind.others)(files, &path));
    std::iter::once(path).chain(others).collect()
}

/// Reads the files that a command names at `key`, which are not checked before it starts. The program alone knows its data: a device or a
/// folder is left to it.
fn read_named(files: &InputFiles, key: &str, named: &[PathBuf], is_data: bool) -> Result<(), String> {
    let is_left = |path: &&PathBuf| is_data && !path.is_file();
    named.iter().filter(|path| !is_left(path)).try_for_each(|path| {
        let read = files.bytes(path).map(drop);
        read.map_err(|cause| format!("`{key}`: cannot read {}: {cause}", path.display()))
    })
}

/// Messages of the inputs of `declared`, as far as the registry knows them.
fn messages<'a>(declared: &DeclaredNode<'a>, plan: &Plan) -> Vec<InputMessage<'a>> {
    let of = |(port, input): (&'a Spanned<String>, &'a InputSetting)| {
        let topic = plan.topics.iter().find(|topic| topic.name == input.topic)?;
        let schema = declared.manifest.registry().message(&topic.type_name)?;
        let (period_ticks, initial) = (topic.ticks.mean(), input.initial.as_ref());
        Some(InputMessage { port: port.get_ref(), bytes: schema.size, period_ticks, initial })
    };
    declared.process.inputs.iter().filter_map(of).collect()
}

/// A recorder's file and attachments come from the launcher.
fn require_none(manifest: &Manifest, process: &Process) -> Result<(), Diagnostic> {
    let Some(key) = process.parameters.keys().next() else { return Ok(()) };
    let message = format!("a recorder has no parameter `{}`", key.get_ref());
    let help = "name the file with run.record or --record, and the topics with inputs";
    Err(manifest.problem(&key.span(), message, help))
}

/// A refused parameter, at its place.
fn refused(declared: &DeclaredNode<'_>, error: &ParameterError) -> Diagnostic {
    let (name, key) = (declared.name.get_ref(), error.key());
    let is_file = is_file_key(key);
    let has_two = declared.process.file(key).is_some()
        && declared.process.parameters.keys().any(|parameter| parameter.get_ref() == key);
    let help = match error {
        ParameterError::Missing { .. } if declared.is_backup() => {
            let value = if is_file { format!("{key} = \"PATH\"") } else { format!("parameters.{key} = …") };
            let kept = kept_by_another_kind(declared.manifest.registry());
            format!("add {value} to the keys of the backup; a backup of another kind keeps {kept}")
        }
        ParameterError::Missing { .. } if is_file => format!("add {key} = \"PATH\" to [process.{name}]"),
        ParameterError::Missing { .. } => format!("add {key} = … to [process.{name}.parameters]"),
        ParameterError::Value { .. } if has_two => {
            format!(
                "change the values in a copy of the {key} file, and write {key} = \"COPY\" in place of parameters.{key}"
            )
        }
        ParameterError::Unknown { .. } if key == "rate_hz" => error.suggestion().unwrap_or_else(|| {
            format!("the rate of `{name}` follows from `period_ticks` in [process.{name}]")
        }),
        ParameterError::Conflict { help, .. } => help.clone(),
        _ => error.suggestion().unwrap_or_default(),
    };
    let is_unknown = matches!(error, ParameterError::Unknown { .. });
    let at = place_within(declared, key, is_unknown);
    let mut error = tidied(error.clone()).of(format!("process `{name}`"));
    if declared.manifest.sources.is_override(at.start) {
        error = with_start_of_path(error);
    }
    declared.manifest.problem(&at, error, help)
}

/// The keys that a backup of another kind keeps, and those that it does not, in words.
fn kept_by_another_kind(registry: Registry) -> String {
    let keys_of = |role: FileRole| -> Vec<String> {
        let keys = Process::file_keys().filter(|key| registry.file_role(key) == Some(role));
        keys.map(|key| format!("`{key}`")).collect()
    };
    let (models, settings) = (keys_of(FileRole::Model), keys_of(FileRole::Settings));
    let models = match models.as_slice() {
        [] => String::new(),
        [one] => format!(" and, if that kind reads it, {one}"),
        all => format!(", and {} if that kind reads them", all.join(" and ")),
    };
    let others = match settings.as_slice() {
        [] => "not `parameters`".to_owned(),
        all => format!("neither `parameters` nor {}", all.join(" nor ")),
    };
    format!("`inputs`{models}, but {others}")
}

/// The same error of a value of `--set`; the advice on a file that cannot be read names the folder at which its path starts.
fn with_start_of_path(error: ParameterError) -> ParameterError {
    let advice =
        format!("{}; here, a relative path starts at the folder of the manifest", Diagnostic::CHECK_PATH);
    error.reworded(|text| text.replace(Diagnostic::CHECK_PATH, &advice))
}

/// The same error with the paths of its files without detours: an included manifest names files from its own folder.
fn tidied(error: ParameterError) -> ParameterError {
    let ParameterError::File { faults, .. } = &error else { return error };
    let short = |file: &str| inputs::tidy(Path::new(file)).display().to_string();
    let files: BTreeMap<String, String> =
        faults.each.iter().map(|fault| (fault.file.clone(), short(&fault.file))).collect();
    let reword =
        |text: &str| files.iter().fold(text.to_owned(), |text, (long, short)| text.replace(long, short));
    error.reworded(reword)
}

fn problem(declared: &DeclaredNode<'_>, at: &Range<usize>, message: &str, help: String) -> Diagnostic {
    declared.manifest.problem(at, format!("process `{}`: {message}", declared.name.get_ref()), help)
}

/// Place of the value of the dotted `key`, or of the key itself if it `is_unknown`: that of a single entry where a parameter is a
/// list or a table.
fn place_within(declared: &DeclaredNode<'_>, key: &str, is_unknown: bool) -> Range<usize> {
    let at = place(declared, key);
    // A table of the manifest may have been merged with one of a live swap: the value is told where it is written.
    let [of_key, of_value] = declared.manifest.in_argument(&format!("parameters.{key}")).unwrap_or_default();
    if of_key != of_value {
        return if is_unknown { of_key } else { of_value };
    }
    let path: Vec<&str> = key.split('.').skip(1).collect();
    let is_parameter = declared.process.parameters.keys().any(|parameter| parameter.span() == at);
    if path.is_empty() || !is_parameter {
        return at;
    }
    // A vehicle of a set is given as SET/PROCESS.
    let set = match declared.name.get_ref().split_once('/') {
        Some((set, process)) => format!("set.{set}.process.{process}.parameters"),
        None => format!("process.{}.parameters", declared.name.get_ref()),
    };
    let [of_key, of_value] = declared.manifest.inside(&at, &path, &set);
    if is_unknown { of_key } else { of_value }
}

/// Place of the dotted `key`: an input as `inputs.PORT`, or by its first name a parameter or a file; else the place of
/// the process.
fn place(declared: &DeclaredNode<'_>, key: &str) -> Range<usize> {
    if let Some(port) = key.strip_prefix("inputs.")
        && let Some(input) = declared.process.inputs.keys().find(|input| input.get_ref() == port)
    {
        return input.span();
    }
    let first = key.split('.').next().unwrap_or(key);
    let parameter = declared.process.parameters.keys().find(|key| key.get_ref() == first).map(Spanned::span);
    let file = declared.process.file(first).map(Spanned::span);
    parameter.or(file).unwrap_or_else(|| declared.name.span())
}

#[cfg(test)]
mod tests {
    use super::{kept_by_another_kind, read_named};
    use crate::graph::Graph;
    use crate::manifest::Manifest;
    use crate::registry::Registry;
    use bus::component::{Component, Info, StepError};
    use bus::context::{NodeContext, StepContext};
    use bus::messages::MotorCommand;
    use bus::parameters::Parameter;
    use bus::{FileKind, FileRole, ParameterError, Registration};
    use controllers::controller::Controller;
    use controllers::pid::PidLaw;
    use inputs::InputFiles;
    use std::path::PathBuf;

    /// Settings with a table beside them.
    const SETTINGS: FileKind = FileKind {
        others: |_, path| vec![path.with_file_name("table.csv")],
        ..FileKind::of(FileRole::Settings)
    };

    #[derive(bus::Parameters)]
    #[allow(dead_code, reason = "the launcher alone reads it")]
    struct Parameters {
        /// Settings.
        #[parameter(file = SETTINGS)]
        configuration: PathBuf,
    }

    #[derive(bus::OutputPorts)]
    struct Outputs {
        command: MotorCommand,
    }

    /// Sends zeros.
    struct Source;
    impl Component for Source {
        const INFO: Info = Info::new("source", "sends zeros");
        type Parameters = Parameters;
        type Inputs<'a> = ();
        type Outputs = Outputs;
        type State = ();
        fn new(_: Parameters, _: &NodeContext<'_>) -> Result<Self, ParameterError> {
            Ok(Self)
        }
        fn initial(&self) {}
        fn step(&self, _: &StepContext<'_>, (): (), (): &mut ()) -> Result<Outputs, StepError> {
            Ok(Outputs { command: MotorCommand::default() })
        }
    }

    /// A plant and its controller, which declare models and settings, and a component with settings under another key.
    const COMPONENTS: Registry = Registry::new(&[
        Registration::of::<plant::node::Plant>(),
        Registration::of::<Controller<PidLaw>>(),
        Registration::of::<Source>(),
    ]);

    #[test]
    fn a_file_is_treated_as_its_component_declares_it() {
        let text = "[run]\nduration_s = 1.0\n[process.source]\nkind = \"source\"\nconfiguration = \"/flight/a.toml\"\n";
        let models = |set: &[String]| {
            let manifest =
                Manifest::parse(text.to_owned(), "/flight/m.toml".as_ref(), set, COMPONENTS).unwrap();
            let files = InputFiles::default();
            files.keep("/flight/a.toml".as_ref(), b"gain = 1".to_vec());
            Graph::build_from(&manifest, files).unwrap().models
        };
        assert_eq!(models(&[]), ["/flight/a.toml", "/flight/table.csv"].map(PathBuf::from));
        let edited = models(&["process.source.configuration.gain=2".to_owned()]);
        assert_eq!(edited, ["/flight/a@source.toml", "/flight/table.csv"].map(PathBuf::from));
    }

    #[derive(bus::Parameters)]
    struct MapParameters {
        /// Map.
        #[parameter(file = SETTINGS)]
        map: PathBuf,
    }

    /// Reads a file at a key that the launcher does not know.
    struct Mapper;
    impl Component for Mapper {
        const INFO: Info = Info::new("mapper", "sends zeros beside a map");
        type Parameters = MapParameters;
        type Inputs<'a> = ();
        type Outputs = Outputs;
        type State = ();
        fn new(parameters: MapParameters, context: &NodeContext<'_>) -> Result<Self, ParameterError> {
            let read = context.files.text(&parameters.map);
            read.map(|_| Self).map_err(|cause| ParameterError::conflict("map", cause))
        }
        fn initial(&self) {}
        fn step(&self, _: &StepContext<'_>, (): (), (): &mut ()) -> Result<Outputs, StepError> {
            Ok(Outputs { command: MotorCommand::default() })
        }
    }

    const WITH_A_MAP: Registry = Registry::new(&[Registration::of::<Mapper>()]);

    #[test]
    fn a_component_names_a_file_at_a_key_of_its_own() {
        let built = |map: &str| {
            let process = format!("[process.mapper]\nkind = \"mapper\"\nparameters.map = \"{map}\"\n");
            let text = format!("[run]\nduration_s = 1.0\n{process}");
            let manifest = Manifest::parse(text, "/flight/m.toml".as_ref(), &[], WITH_A_MAP).unwrap();
            let files = InputFiles::default();
            files.keep("/flight/maps/a.toml".as_ref(), b"gain = 1".to_vec());
            Graph::build_from(&manifest, files)
        };
        let graph = built("maps/a.toml").unwrap();
        assert_eq!(graph.models, ["/flight/maps/a.toml", "/flight/maps/table.csv"].map(PathBuf::from));
        let node = &graph.plan.nodes[0];
        assert_eq!(node.parameters["map"], "/flight/maps/a.toml");
        assert!(node.files.iter().any(|file| file.path == graph.models[0]), "{:?}", node.files);
        let error = built("maps/b.toml").unwrap_err().to_string();
        assert!(error.contains("m.toml:5:") && error.contains("process `mapper`"), "{error}");
    }

    /// The file of the source in another role.
    const fn with_role(role: FileRole) -> [Parameter; 1] {
        let configuration = <Parameters as bus::Parameters>::DECLARED[0];
        [Parameter { file: Some(FileKind::of(role)), ..configuration }]
    }

    const AS_PROGRAM: [Parameter; 1] = with_role(FileRole::Program);
    const AS_DATA: [Parameter; 1] = with_role(FileRole::Data);

    /// The source under another `name`, with its file in another role.
    const fn source(name: &'static str, parameters: &'static [Parameter]) -> Registration {
        let mut source = Registration::of::<Source>();
        source.name = name;
        source.parameters = parameters;
        source
    }

    /// A source that does not declare its file as TOML, and one that does.
    const BOTH: Registry = Registry::new(&[source("other", &AS_PROGRAM), Registration::of::<Source>()]);

    #[test]
    fn a_value_for_a_command_in_a_file_that_is_not_toml_is_refused() {
        let viewer = "[process.viewer]\ncommand = [\"viewer\"]\nconfiguration = \"/flight/a.txt\"\n";
        let text = format!("[run]\nduration_s = 1.0\n{viewer}");
        let set = ["process.viewer.configuration.gain=2".to_owned()];
        let manifest = Manifest::parse(text, "/flight/m.toml".as_ref(), &set, BOTH).unwrap();
        let edited = |content: &str| {
            let files = InputFiles::default();
            files.keep("/flight/a.txt".as_ref(), content.into());
            manifest.with_edits(&files, "viewer", "configuration", "/flight/a.txt".into())
        };
        assert_eq!(edited("gain = 1").unwrap(), PathBuf::from("/flight/a@viewer.txt"));
        let error = edited("GAIN 1").unwrap_err().to_string();
        assert!(error.contains("of process `viewer`: expected TOML, but the file is not TOML"), "{error}");
    }

    /// A source whose file is data.
    const OF_DATA: Registry = Registry::new(&[source("recorded", &AS_DATA)]);

    #[test]
    fn a_run_does_not_record_a_file_that_is_declared_as_data() {
        let text = "[run]\nduration_s = 1.0\n[process.source]\nkind = \"recorded\"\nconfiguration = \"/flight/a.csv\"\n";
        let manifest = Manifest::parse(text.to_owned(), "/flight/m.toml".as_ref(), &[], OF_DATA).unwrap();
        let files = InputFiles::default();
        files.keep("/flight/a.csv".as_ref(), b"time_s\n0\n".to_vec());
        assert_eq!(Graph::build_from(&manifest, files).unwrap().models, Vec::<PathBuf>::new());
    }

    #[test]
    fn a_folder_in_the_place_of_data_is_left_to_the_command() {
        let folder = [std::env::temp_dir()];
        let read = |is_data| read_named(&InputFiles::default(), "data", &folder, is_data);
        assert_eq!(read(true), Ok(()));
        assert!(read(false).unwrap_err().starts_with("`data`: cannot read "));
    }

    #[test]
    fn a_value_is_set_in_a_file_that_is_toml_to_the_kind_of_its_process_and_in_no_other() {
        let parsed = |kind: &str| {
            let process = format!("[process.source]\nkind = \"{kind}\"\nconfiguration = \"a.txt\"\n");
            let text = format!("[run]\nduration_s = 1.0\n{process}");
            let set = ["process.source.configuration.gain=2".to_owned()];
            Manifest::parse(text, "/flight/m.toml".as_ref(), &set, BOTH)
        };
        parsed("source").unwrap();
        let error = parsed("other").unwrap_err().to_string();
        for part in [
            "--set process.source.configuration.gain=2",
            "expected TOML, but the kind `other` does not declare it as TOML",
            "name it: --set process.source.configuration=COPY",
        ] {
            assert!(error.contains(part), "{part}: {error}");
        }
    }

    #[test]
    fn a_backup_of_another_kind_keeps_the_files_that_are_declared_as_models() {
        let declared = "`inputs`, and `vehicle` and `scene` if that kind reads them, but neither `parameters` nor `gains`";
        let registry = Registry::new(&COMPONENTS.components()[..2]);
        assert_eq!(kept_by_another_kind(registry), declared);
        assert_eq!(kept_by_another_kind(Registry::default()), "`inputs`, but not `parameters`");
    }
}
