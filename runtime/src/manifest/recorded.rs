//! The manifest's text as the recording holds it: the user's own, with its comments and the changes of `--set`.

use super::content::Process;
use super::file_edits;
use super::include;
use super::put::put;
use super::sources::Sources;
use super::tree;
use crate::registry::Registry;
use diagnostics::Diagnostic;
use std::collections::BTreeMap;
use std::path::Path;
use toml::Spanned;

/// The processes of the manifest by name.
type Processes = BTreeMap<Spanned<String>, Process>;

/// Keys of `[run]` that change the speed or the host of a run, never its results: they stay out of the recording.
const HOST_ONLY_KEYS: [&str; 10] = [
    "checkpoint_every_s",
    "checkpoint_keep",
    "clock_cpu",
    "compose",
    "lock_memory",
    "pace",
    "profile",
    "record",
    "start_order_seed",
    "window_ticks",
];
/// Keys of a process that change only its speed or its host.
const HOST_ONLY_PROCESS_KEYS: [&str; 8] = [
    "cpu",
    "environment",
    "log",
    "nice",
    "realtime_priority",
    "wait",
    "watchdog_ms_host",
    "working_directory",
];

/// The manifest's own text with those values of `--set` that may change the simulation.
///
/// # Errors
/// If an included file is not TOML.
pub fn text(sources: &Sources, processes: &Processes) -> Result<String, Diagnostic> {
    let original = &sources.all[0].text;
    let simulated: Vec<&String> =
        sources.overrides().map(|source| &source.text).filter(|text| !is_host_only(text)).collect();
    let Ok(mut document) = original.parse::<toml_edit::DocumentMut>() else { return Ok(original.clone()) };
    if simulated.is_empty() {
        return Ok(original.clone());
    }
    let mut elsewhere = String::new();
    for text in simulated {
        if is_of_a_file(text, sources.registry) || !set(&mut document, text, sources)? {
            // It changes another file, or a value in an included file or a set, which has no line of its own here.
            elsewhere += &format!("# --set {}\n", text.replace('\n', "\\n"));
        }
    }
    name_copies(&mut document, sources, processes);
    let text = document.to_string();
    let gap = if text.ends_with('\n') || elsewhere.is_empty() { "" } else { "\n" };
    Ok(text + gap + &elsewhere)
}

/// True if an override changes only where and how fast a run computes.
pub fn is_host_only(text: &str) -> bool {
    let path = text.split('=').next().unwrap_or_default();
    let keys: Vec<&str> = path.split('.').map(str::trim).collect();
    match keys.as_slice() {
        ["run", key] => HOST_ONLY_KEYS.contains(key),
        ["group", ..] => true,
        ["process", _, key, ..]
        | ["set", _, "process", _, key, ..]
        | ["vehicle", _, "process", _, key, ..] => HOST_ONLY_PROCESS_KEYS.contains(key),
        _ => false,
    }
}

/// True if an override leads into a file of a process.
fn is_of_a_file(text: &str, registry: Registry) -> bool {
    let keys: Vec<&str> = text.split('=').next().unwrap_or_default().split('.').map(str::trim).collect();
    file_edits::split(&keys, registry).is_some()
}

/// Writes an override into the text; false if its place is not in it.
fn set(document: &mut toml_edit::DocumentMut, text: &str, sources: &Sources) -> Result<bool, Diagnostic> {
    let Some((path, value)) = text.split_once('=') else { return Ok(false) };
    let value = value.trim();
    // A text counts as TOML here if it does when it is read.
    let parsed = tree::parse_value(value, 0).and_then(|_| value.parse::<toml_edit::Value>().ok());
    let value = parsed.unwrap_or_else(|| value.into());
    let mut keys: Vec<String> = path.split('.').map(|key| key.trim().to_owned()).collect();
    if let [list, index, ..] = keys.as_mut_slice()
        && let (true, Ok(number)) = (include::LISTS.contains(&list.as_str()), index.parse::<usize>())
    {
        // The elements of included files come first.
        let Some(local) = number.checked_sub(include::inherited(sources, list)?) else { return Ok(false) };
        *index = local.to_string();
    }
    // On a copy: a path that breaks off halfway must leave nothing behind.
    let mut changed = document.clone();
    let is_put = put(changed.as_item_mut(), &keys, value).is_some();
    if is_put {
        *document = changed;
    }
    Ok(is_put)
}

/// Names the edited copies of files in the place of the originals. A process that has no line here, since an included file or
/// a set declares it, gets one.
fn name_copies(document: &mut toml_edit::DocumentMut, sources: &Sources, processes: &Processes) {
    let overrides = sources.overrides().map(|source| source.text.as_str());
    for (process, file) in file_edits::edited_files(overrides, sources.registry) {
        let found = processes.iter().find(|(name, _)| name.get_ref() == process);
        let Some(written) = found.and_then(|(_, found)| found.file(file)) else { continue };
        let copy = file_edits::edited_path(Path::new(written.get_ref()), process);
        let keys = ["process", process, file].map(str::to_owned);
        // It fails only if `process` is not a table, and then there is no process.
        let _ = put(document.as_item_mut(), &keys, copy.to_string_lossy().into_owned().into());
    }
}

#[cfg(test)]
mod tests {
    use super::super::sources::{Origin, Sources};
    use super::super::{repair, whole_tree};
    use super::{is_host_only, text};
    use crate::registry::Registry;
    use bus::Registration;

    /// A plant, whose vehicle file is edited.
    const COMPONENTS: Registry = Registry::new(&[Registration::of::<plant::node::Plant>()]);

    fn recorded(manifest: &str, overrides: &[&str]) -> String {
        let mut sources = Sources::of(COMPONENTS);
        sources.add(Origin::File("a.toml".into()), manifest.to_owned());
        sources.order.push(0);
        overrides.iter().for_each(|text| sources.add(Origin::Override, (*text).to_owned()));
        let content = whole_tree(&sources).and_then(|tree| repair::readable(&sources, tree));
        text(&sources, &content.map(|(content, _)| content.process).unwrap_or_default()).unwrap()
    }

    #[test]
    fn host_only_overrides_are_known() {
        for text in ["run.pace=free", "run.profile=true", "process.imu.wait=spin", "process.h1/imu.cpu=1"] {
            assert!(is_host_only(text), "{text}");
        }
        assert!(is_host_only("process.imu.environment.RUST_LOG=debug") && is_host_only("process.imu.nice=3"));
        assert!(!is_host_only("run.seed=1") && !is_host_only("process.imu.parameters.wait=1"));
    }

    #[test]
    fn an_override_keeps_comments_and_stays_out_if_it_is_host_only() {
        let found = recorded("[run]\nseed = 1 # why\n", &["run.seed=2", "run.pace=3"]);
        assert_eq!(found, "[run]\nseed = 2 # why\n");
        assert_eq!(recorded("[run]\nseed = 1 # why\n", &["run.pace=3"]), "[run]\nseed = 1 # why\n");
    }

    #[test]
    fn elements_of_lists_are_reached() {
        let found = recorded("[[swap]]\nat_tick = 1\n[[swap]]\nat_tick = 2\n", &["swap.1.at_tick=5"]);
        assert_eq!(found, "[[swap]]\nat_tick = 1\n[[swap]]\nat_tick = 5\n");
        assert_eq!(recorded("a = [{ b = 1 }]\n", &["a.0.b=2"]), "a = [{ b = 2 }]\n");
    }

    #[test]
    fn an_edited_file_is_named_in_the_place_of_the_original() {
        let manifest = "[run]\nduration_s = 1.0\n[process.plant]\nvehicle = \"../a.toml\" # why\n";
        let edits = ["process.plant.vehicle.body.mass=2", "process.plant.vehicle=../b.toml"];
        let expected =
            manifest.replace("../a.toml", "../b@plant.toml") + "# --set process.plant.vehicle.body.mass=2\n";
        assert_eq!(recorded(manifest, &edits), expected);
    }

    #[test]
    fn what_has_no_place_in_the_text_is_noted_below_it() {
        let found = recorded("a = 1\n", &["process.h1/pilot.parameters.set_points.0.to=2"]);
        assert_eq!(found, "a = 1\n# --set process.h1/pilot.parameters.set_points.0.to=2\n");
    }
}
