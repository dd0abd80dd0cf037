//! Values in files of processes that `--set` replaces, such as `--set process.plant.vehicle.body.mass=0.5`. Components declare
//! these files as models or settings.
//!
//! The file on the disk is not changed. The process reads an edited copy under a path of its own beside the original.
//! A controller of the same vehicle file still reads the original.

use super::content::{Content, Process};
use super::put::put;
use super::sources::{Source, Sources};
use crate::registry::Registry;
use bus::parameters::Parameter;
use diagnostics::{Diagnostic, did_you_mean, nearest};
use inputs::InputFiles;
use std::ops::Range;
use std::path::{Path, PathBuf};
use toml::Spanned;
use toml_edit::{ArrayOfTables, DocumentMut, Item, Table, Value};

/// Key of the list of effects in a vehicle or scene file.
const EFFECTS: &str = "effects";
/// Key of the number or the vector in a quantity of a vehicle file.
const VALUE: &str = "value";

/// A value and its place in a file of a process.
#[derive(Clone, Debug)]
pub struct FileEdit {
    process: String,
    /// Key of the file.
    file: String,
    /// Keys in the file, such as `body`, `mass`.
    keys: Vec<String>,
    value: Value,
    /// Place of the `--set`.
    span: Range<usize>,
}

/// The process, the key of the file, and the keys in it. `None` unless `keys` lead into a file that is TOML
/// to a component of `registry`. The kind of the process is not known yet: [`all`] refuses one that does not
/// declare the file as TOML.
pub fn split<'k, 's>(keys: &'k [&'s str], registry: Registry) -> Option<(&'s str, &'s str, &'k [&'s str])> {
    let ["process", process, file, rest @ ..] = keys else { return None };
    let is_file = Process::file_keys().any(|key| key == *file);
    let is_toml = is_file && registry.has_toml_at(file);
    (is_toml && !rest.is_empty()).then_some((*process, *file, rest))
}

/// Path of the edited copy of a file: `hummingbird.toml` of `h1/plant` becomes `hummingbird@h1@plant.toml`.
pub fn edited_path(path: &Path, process: &str) -> PathBuf {
    let stem = path.file_stem().unwrap_or_default().to_string_lossy();
    let ending = path.extension().map_or(String::new(), |ending| format!(".{}", ending.to_string_lossy()));
    path.with_file_name(format!("{stem}@{}{ending}", process.replace('/', "@")))
}

/// The message `text` with other names of the file called `copy`: `name` returns one by the line behind the name, if there is one, and the key
/// behind that, which is empty if there is none.
pub fn renamed(text: &str, copy: &str, mut name: impl FnMut(Option<usize>, &str) -> String) -> String {
    let mut parts = text.split(copy);
    let first = parts.next().unwrap_or_default().to_owned();
    parts.fold(first, |all, part| {
        let line = part
            .strip_prefix(':')
            .map(|rest| &rest[..rest.len() - rest.trim_start_matches(|c: char| c.is_ascii_digit()).len()]);
        let number = line.and_then(|line| line.parse().ok());
        let rest = if number.is_some() { &part[1 + line.map_or(0, str::len)..] } else { part };
        let key = rest.strip_prefix(": `").and_then(|rest| rest.split('`').next()).unwrap_or_default();
        all + &name(number, key) + rest
    })
}

/// The processes and keys of files that `overrides` edit, each once.
pub fn edited_files<'s>(
    overrides: impl Iterator<Item = &'s str>,
    registry: Registry,
) -> Vec<(&'s str, &'s str)> {
    let mut found = Vec::new();
    for text in overrides {
        let keys: Vec<&str> = text.split('=').next().unwrap_or_default().split('.').map(str::trim).collect();
        if let Some((process, file, _)) = split(&keys, registry)
            && !found.contains(&(process, file))
        {
            found.push((process, file));
        }
    }
    found
}

/// Values in files that are given with `--set`, in their order.
///
/// # Errors
/// If there is no such process, it does not name such a file, or its kind does not declare the file as TOML.
pub fn all(sources: &Sources, content: &Content) -> Result<Vec<FileEdit>, Diagnostic> {
    let parse = |source: &Source| FileEdit::parse(&source.text, source.base, sources.registry);
    let edits = sources.overrides().filter_map(parse);
    let require = |edit: FileEdit| edit.require_file(sources, content).map(|()| edit);
    edits.map(require).collect()
}

/// Refuses `edits` of a file with this `text` if it is not TOML, for a process whose component does not report that.
///
/// # Errors
/// The first edit, and what to do.
pub fn require_toml(text: &str, edits: &[&FileEdit], sources: &Sources) -> Result<(), Diagnostic> {
    match (text.parse::<DocumentMut>(), edits.first()) {
        (Err(_), Some(edit)) => Err(edit.not_toml(sources, "the file is not TOML")),
        _ => Ok(()),
    }
}

/// `text` with `edits`, which may name these `effects`; `base` returns the text of the file that it is based on, by the path
/// written in it.
///
/// # Errors
/// The edit that has no place, and the reason.
pub fn edited<'e>(
    text: &str,
    edits: &[&'e FileEdit],
    effects: &[&str],
    base: &dyn Fn(&str) -> Option<String>,
) -> Result<String, (&'e FileEdit, String)> {
    // The reader of the file reports the place at which it is not TOML.
    let Ok(mut document) = text.parse::<DocumentMut>() else { return Ok(text.to_owned()) };
    for edit in edits {
        edit.inherit(&mut document, base);
        edit.apply(&mut document, effects).map_err(|message| (*edit, message))?;
    }
    Ok(document.to_string())
}

impl FileEdit {
    /// The edit in the text of a `--set`, if it leads into a file.
    fn parse(text: &str, base: usize, registry: Registry) -> Option<Self> {
        let (path, value) = text.split_once('=')?;
        let keys: Vec<&str> = path.split('.').map(str::trim).collect();
        let (process, file, keys) = split(&keys, registry)?;
        let value = value.trim();
        Some(Self {
            process: process.to_owned(),
            file: file.to_owned(),
            keys: keys.iter().map(|key| (*key).to_owned()).collect(),
            value: value.parse().unwrap_or_else(|_| value.into()),
            span: base..base + path.len(),
        })
    }

    /// True if the edit belongs to the file `key` of the process `name`.
    pub fn is_of(&self, name: &str, key: &str) -> bool {
        self.process == name && self.file == key
    }

    /// Place of the `--set`.
    pub fn span(&self) -> &Range<usize> {
        &self.span
    }

    /// True if a fault of the dotted `key` is one of the value of this edit of the file with this `text`.
    pub fn is_about(&self, key: &str, text: &str) -> bool {
        let document = text.parse::<DocumentMut>().ok();
        let mut keys = match &document {
            Some(document) => self.keys_in(document.as_item()),
            None => self.keys.clone(),
        };
        // A quantity's faults are those of its own key; the unit and the source stay those of the file.
        if keys.last().is_some_and(|last| last == VALUE) && self.keys.last().is_some_and(|last| last != VALUE)
        {
            keys.pop();
            if key.split('.').nth(keys.len()).is_some_and(|below| below != VALUE) {
                return false;
            }
        }
        let fault: Vec<&str> = key.split('.').collect();
        // A table that the file lacks is there by this edit alone.
        let is_new = document.is_some_and(|document| !document.contains_key(fault[0]));
        let depth = if is_new { 1 } else { keys.len().min(2) };
        !key.is_empty() && keys.iter().zip(&fault).all(|(a, b)| a == b) && fault.len() >= depth
    }

    fn require_file(&self, sources: &Sources, content: &Content) -> Result<(), Diagnostic> {
        let name = &self.process;
        let Some((_, process)) = content.process.iter().find(|(other, _)| other.get_ref() == name) else {
            let known = content.process.keys().map(|known| known.get_ref().as_str());
            let help = did_you_mean(name, known, "the processes are");
            return Err(sources.problem(&self.span, format!("there is no process `{name}`"), help));
        };
        self.require_toml(process, sources)?;
        let is_over_file = process.parameters.keys().any(|parameter| *parameter.get_ref() == self.file);
        if is_over_file {
            let message = format!(
                "process `{name}` has values of its own for `{}`, which come before the file's",
                self.file
            );
            let help = format!("change them: process.{name}.parameters.{}.…", self.file);
            return Err(sources.problem(&self.span, message, help));
        }
        if process.file(&self.file).is_some() {
            return Ok(());
        }
        let message = format!("process `{name}` names no {} file", self.file);
        let file = &self.file;
        let help = format!(
            "add {file} = \"PATH\" to [process.{name}], or give --set process.{name}.{file}=PATH, too"
        );
        Err(sources.problem(&self.span, message, help))
    }

    /// Refuses the edit if the kind of `process` has the file as a parameter and does not declare it as TOML: another kind declares it.
    fn require_toml(&self, process: &Process, sources: &Sources) -> Result<(), Diagnostic> {
        let Some(kind) = process.kind.as_ref().map(Spanned::get_ref) else { return Ok(()) };
        let component = sources.registry.find(kind).map(|component| component.parameters);
        let program = || sources.registry.program(kind).map(|program| program.parameters);
        let parameters = component.or_else(program).unwrap_or_default();
        let is_toml = |parameter: &Parameter| parameter.file.is_some_and(|file| file.role.is_toml());
        if parameters.iter().find(|parameter| parameter.name == self.file).is_none_or(is_toml) {
            return Ok(());
        }
        let why =
            format!("the kind `{kind}` does not declare it as TOML, with #[parameter(file = …)] in Rust");
        Err(self.not_toml(sources, &why))
    }

    /// The problem of this edit of a file that is not TOML; `why` says so.
    fn not_toml(&self, sources: &Sources, why: &str) -> Diagnostic {
        let (name, file) = (&self.process, &self.file);
        let message =
            format!("cannot set a value in the {file} file of process `{name}`: expected TOML, but {why}");
        let help = format!("change a copy of the file, and name it: --set process.{name}.{file}=COPY");
        sources.problem(&self.span, message, help)
    }

    /// Takes the table of the edited key over from the base: a file states a table whole, or not at all.
    fn inherit(&self, document: &mut DocumentMut, base: &dyn Fn(&str) -> Option<String>) {
        let (Some(first), Some(path)) = (self.keys.first(), document.get("base").and_then(Item::as_str))
        else {
            return;
        };
        if document.contains_key(first) {
            return;
        }
        let below = base(path).and_then(|text| text.parse::<DocumentMut>().ok());
        if let Some(item) = below.and_then(|mut below| below.remove(first)) {
            document.insert(first, item);
        }
    }

    fn apply(&self, document: &mut DocumentMut, effects: &[&str]) -> Result<(), String> {
        self.list_effect(document, effects)?;
        let keys = self.keys_in(document.as_item());
        let value = self.with_source(&keys);
        put(document.as_item_mut(), &keys, value)
            .ok_or_else(|| format!("the {} file has no place `{}`", self.file, self.keys.join(".")))
    }

    /// Adds an effect that the file does not list behind those that it lists, with the neutral values of its parameters.
    /// Refuses one whose value has no unit: only a quantity of the file would give it. `effects` are the names of
    /// all effects.
    fn list_effect(&self, document: &mut DocumentMut, effects: &[&str]) -> Result<(), String> {
        let [list, name, ..] = self.keys.as_slice() else { return Ok(()) };
        if list != EFFECTS || name.parse::<usize>().is_ok() {
            return Ok(());
        }
        let listed = document.get(EFFECTS).and_then(Item::as_array_of_tables);
        let names: Vec<&str> =
            listed.into_iter().flatten().filter_map(|effect| effect.get("name")?.as_str()).collect();
        if names.contains(&name.as_str()) {
            return Ok(());
        }
        if !is_quantity(&self.value) {
            let known = if names.is_empty() { "none".to_owned() } else { names.join(", ") };
            return Err(format!(
                "the {} file lists no effect `{name}` (it lists {known}); {}",
                self.file,
                way_out(name, effects)
            ));
        }
        let mut effect = Table::new();
        effect.insert("name", toml_edit::value(name.as_str()));
        let effects = document.entry(EFFECTS).or_insert_with(|| Item::ArrayOfTables(ArrayOfTables::new()));
        effects.as_array_of_tables_mut().map(|effects| effects.push(effect)).ok_or_else(|| {
            format!("`{EFFECTS}` of the {} file is no list of tables, [[{EFFECTS}]]", self.file)
        })
    }

    /// The value; where it is a parameter of an effect with its unit, with the source and uncertainty that files state.
    fn with_source(&self, keys: &[String]) -> Value {
        let mut value = self.value.clone();
        if let Some(table) =
            value.as_inline_table_mut().filter(|_| is_quantity(&self.value) && keys[0] == EFFECTS)
        {
            for (key, text) in [("source", "--set"), ("uncertainty", "not stated")] {
                table.entry(key).or_insert_with(|| text.into());
            }
        }
        value
    }

    /// The keys to the number itself: a quantity keeps its unit and source.
    fn keys_in(&self, document: &Item) -> Vec<String> {
        let is_quantity = |item: &Item| item.as_table_like().is_some_and(|table| table.contains_key(VALUE));
        let (mut keys, mut item) = (Vec::new(), Some(document));
        for key in &self.keys {
            // An element of a vector.
            if item.is_some_and(is_quantity) && key.parse::<usize>().is_ok() {
                keys.push(VALUE.to_owned());
                item = item.and_then(|quantity| quantity.get(VALUE));
            }
            let key = item.and_then(|list| index_of(list, key)).unwrap_or_else(|| key.clone());
            item = item.and_then(|inside| at(inside, &key));
            keys.push(key);
        }
        if item.is_some_and(is_quantity) && !self.value.is_inline_table() {
            keys.push(VALUE.to_owned());
        }
        keys
    }

    /// The number at the place of this edit in `text`; `None` if there is none.
    fn number_in(&self, text: &str, base: &dyn Fn(&str) -> Option<String>) -> Option<f64> {
        let mut document: DocumentMut = text.parse().ok()?;
        self.inherit(&mut document, base);
        let keys = self.keys_in(document.as_item());
        let item = keys.iter().try_fold(document.as_item(), |item, key| at(item, key))?;
        let integer = || item.as_integer().map(|number| number as f64);
        item.as_float().or_else(integer)
    }

    /// This edit's problem with the file at `path`.
    pub fn problem(&self, sources: &Sources, message: &str, path: &Path) -> Diagnostic {
        sources.problem(&self.span, message, format!("{} shows the keys", inputs::tidy(path).display()))
    }
}

/// The number that the `key` of a `--set` leads to in a file, whose path `find` gives by the process and the file's key;
/// `None` if `key` leads into no file, or to no number.
pub fn number(
    files: &InputFiles,
    key: &str,
    registry: Registry,
    find: impl FnOnce(&str, &str) -> Option<PathBuf>,
) -> Option<f64> {
    let edit = FileEdit::parse(&format!("{key}=0"), 0, registry)?;
    let path = find(&edit.process, &edit.file)?;
    edit.number_in(&files.text(&path).ok()?, &|base| base_text(files, &path, base))
}

/// The text of the file that the one at `path` is based on.
pub fn base_text(files: &InputFiles, path: &Path, base: &str) -> Option<String> {
    files.text(&path.parent()?.join(base)).ok()
}

/// The item at `key`, a name in a table or an index in a list.
fn at<'i>(inside: &'i Item, key: &str) -> Option<&'i Item> {
    match key.parse::<usize>() {
        Ok(index) if !inside.is_table_like() => inside.get(index),
        _ => inside.get(key),
    }
}

/// Advice on the effect `name` that a file does not list; `effects` are the names of all effects.
fn way_out(name: &str, effects: &[&str]) -> String {
    let near = nearest(name, effects.iter().copied());
    match near.filter(|near| *near != name) {
        Some(near) => format!("did you mean `{near}`?"),
        None if effects.is_empty() || effects.contains(&name) => format!(
            "to add it, give the value as {{ value = NUMBER, unit = \"UNIT\" }}; `hummingbus effects {name}` prints its \
             parameters and units"
        ),
        None => "`hummingbus effects` lists all effects".to_owned(),
    }
}

/// True for a number with its unit, as files state it.
fn is_quantity(value: &Value) -> bool {
    value.as_inline_table().is_some_and(|table| [VALUE, "unit"].iter().all(|key| table.contains_key(key)))
}

/// Index of the table called `name` in a list of tables, as the effects of a vehicle are named.
fn index_of(list: &Item, name: &str) -> Option<String> {
    let is_it = |table: &Table| table.get("name").and_then(Item::as_str) == Some(name);
    list.as_array_of_tables()?.iter().position(is_it).map(|index| index.to_string())
}

#[cfg(test)]
mod tests {
    use super::{FileEdit, edited, edited_files, edited_path};
    use crate::registry::Registry;
    use bus::Registration;
    use controllers::controller::Controller;
    use controllers::pid::PidLaw;
    use inputs::InputFiles;
    use std::path::Path;

    /// A plant and its controller, whose files are edited.
    const COMPONENTS: Registry =
        Registry::new(&[Registration::of::<plant::node::Plant>(), Registration::of::<Controller<PidLaw>>()]);

    const VEHICLE: &str = "[body]\nmass = { value = 0.48, unit = \"kg\" } # weighed\n[[rotors]]\nname = \"front\"\n\
                           position = { value = [0.17, 0, 0], unit = \"m\" }\n";

    fn edit(set: &str) -> FileEdit {
        FileEdit::parse(set, 0, COMPONENTS).unwrap()
    }

    fn changed(set: &str) -> Result<String, String> {
        edited(VEHICLE, &[&edit(set)], &["wind", "gusts"], &|_| None).map_err(|(_, message)| message)
    }

    #[test]
    fn a_table_of_the_base_is_taken_over_whole() {
        let mass = edit("process.plant.vehicle.body.mass=0.5");
        let base = |path: &str| {
            (path == "b.toml").then(|| "[body]\nmass = { value = 1, unit = \"kg\" }\nlength = 2\n".into())
        };
        let found = edited("base = \"b.toml\"\n", &[&mass], &[], &base).unwrap();
        assert_eq!(found, "base = \"b.toml\"\n[body]\nmass = { value = 0.5, unit = \"kg\" }\nlength = 2\n");
    }

    #[test]
    fn a_fault_of_a_value_is_about_its_edit_and_one_of_its_unit_is_not() {
        let mass = edit("process.plant.vehicle.body.mass=heavy");
        let is_about = |key: &str| mass.is_about(key, VEHICLE);
        assert!(is_about("body.mass") && is_about("body.mass.value"));
        assert!(!is_about("body.mass.unit") && !is_about("body.length") && !is_about(""));
        let unit = edit("process.plant.vehicle.body.mass.unit=lb");
        assert!(unit.is_about("body.mass.unit", VEHICLE) && !unit.is_about("body.mass.value", VEHICLE));
    }

    #[test]
    fn a_fault_of_a_table_that_an_edit_makes_is_about_that_edit() {
        let misspelt = edit("process.plant.vehicle.bdoy.mass=1");
        assert!(misspelt.is_about("bdoy", VEHICLE) && misspelt.is_about("bdoy.mass", VEHICLE));
        assert!(!misspelt.is_about("body", VEHICLE));
        assert!(!edit("process.plant.vehicle.body.mass=1").is_about("body", VEHICLE));
    }

    #[test]
    fn a_line_of_the_copy_in_a_message_is_named_otherwise() {
        let text = "too heavy; look at /v@p.toml:21: `body.mass`, /v@p.toml:3: `body.gravity`, and /v@p.toml";
        let found = super::renamed(text, "/v@p.toml", |line, key| match (line, key) {
            (Some(21), "body.mass") => "--set a=1".to_owned(),
            (Some(3), "body.gravity") => "/v.toml:2".to_owned(),
            (None, "") => "/v.toml".to_owned(),
            other => panic!("{other:?}"),
        });
        assert_eq!(
            found,
            "too heavy; look at --set a=1: `body.mass`, /v.toml:2: `body.gravity`, and /v.toml"
        );
    }

    #[test]
    fn a_quantity_keeps_its_unit_and_its_comment() {
        let found = changed("process.plant.vehicle.body.mass=0.5").unwrap();
        assert_eq!(found, VEHICLE.replace("0.48", "0.5"));
        let found = changed("process.plant.vehicle.body.mass.unit=g").unwrap();
        assert_eq!(found, VEHICLE.replace("kg", "g"));
    }

    #[test]
    fn an_element_of_a_vector_in_a_list_is_reached() {
        for rotor in ["0", "front"] {
            let found = changed(&format!("process.plant.vehicle.rotors.{rotor}.position.2=0.01")).unwrap();
            assert_eq!(found, VEHICLE.replace("0.17, 0, 0", "0.17, 0, 0.01"));
        }
    }

    #[test]
    fn the_number_at_a_key_is_found() {
        let files = InputFiles::default();
        files.keep("/v.toml".as_ref(), VEHICLE.into());
        let number = |key: &str| super::number(&files, key, COMPONENTS, |_, _| Some("/v.toml".into()));
        assert_eq!(number("process.plant.vehicle.body.mass"), Some(0.48));
        assert_eq!(number("process.plant.vehicle.rotors.front.position.0"), Some(0.17));
        assert_eq!(number("process.plant.vehicle.rotors.front.position.1"), Some(0.0));
        assert_eq!(number("process.plant.vehicle.body.name"), None);
        assert_eq!(number("run.seed"), None);
        let mass = "process.plant.vehicle.body.mass";
        let undeclared = super::number(&files, mass, Registry::default(), |_, _| Some("/v.toml".into()));
        assert_eq!(undeclared, None);
    }

    #[test]
    fn a_missing_key_is_added_and_an_impossible_one_refused() {
        let quantity = "{ value = 0.1, unit = \"1\" }";
        let found = changed(&format!("process.plant.vehicle.rotor.lift={quantity}")).unwrap();
        assert!(found.contains("[rotor]") && found.contains(&format!("lift = {quantity}")), "{found}");
        for keys in ["rotors.3.position", "body.mass.value.deep"] {
            let message = changed(&format!("process.plant.vehicle.{keys}=1")).unwrap_err();
            assert_eq!(message, format!("the vehicle file has no place `{keys}`"));
        }
    }

    #[test]
    fn an_effect_that_the_file_does_not_list_is_refused_by_name() {
        let message = changed("process.plant.vehicle.effects.wind.x=3").unwrap_err();
        assert!(message.starts_with("the vehicle file lists no effect `wind` (it lists none)"), "{message}");
        assert!(message.contains("`hummingbus effects wind` prints its parameters"), "{message}");
        let message = changed("process.plant.vehicle.effects.winds.x=3").unwrap_err();
        assert!(message.ends_with("did you mean `wind`?"), "{message}");
        let message = changed("process.plant.vehicle.effects.lightning.x=3").unwrap_err();
        assert!(message.ends_with("`hummingbus effects` lists all effects"), "{message}");
        let text = format!("{VEHICLE}[[effects]]\nname = \"wind\"\nx = {{ value = 0, unit = \"m/s\" }}\n");
        let set = edit("process.plant.vehicle.effects.wind.x=3");
        assert_eq!(edited(&text, &[&set], &[], &|_| None).unwrap(), text.replace("value = 0,", "value = 3,"));
        let gust = edit("process.plant.vehicle.effects.gust.x=3");
        let (_, message) = edited(&text, &[&gust], &[], &|_| None).unwrap_err();
        assert!(message.contains("`gust` (it lists wind)"), "{message}");
    }

    #[test]
    fn an_effect_with_a_unit_is_added_and_its_next_parameter_joins_it() {
        let set = |key: &str| {
            let text = format!("process.plant.vehicle.effects.{key}={{ value = 3, unit = \"m/s\" }}");
            edit(&text)
        };
        let found = edited(VEHICLE, &[&set("wind.x"), &set("wind.y")], &[], &|_| None).unwrap();
        let effects = found.strip_prefix(VEHICLE).unwrap().trim_start();
        let quantity = "{ value = 3, unit = \"m/s\" , source = \"--set\", uncertainty = \"not stated\" }";
        let table = format!("[[effects]]\nname = \"wind\"\nx = {quantity}\ny = {quantity}\n");
        assert_eq!(effects.replace(" ,", ",").replace("\"}", "\" }"), table.replace(" ,", ","));
    }

    #[test]
    fn the_copy_lies_beside_the_original() {
        let found = edited_path(Path::new("/a/b.toml"), "h1/plant");
        assert_eq!(found, Path::new("/a/b@h1@plant.toml"));
        let overrides =
            ["process.p.vehicle.a=1", "run.seed=3", "process.p.vehicle.b=1", "process.p.gains.c=1"];
        assert_eq!(edited_files(overrides.into_iter(), COMPONENTS), [("p", "vehicle"), ("p", "gains")]);
    }
}
