//! The vehicle files that a recording has attached, and which of its vehicles flies which.

use crate::airframe::Body;
use plant::Airframe;
use plant::effects::entry::resolve;
use plant::effects::{Effect, TURBULENCE, WIND};
use recorder::RecordingError;
use recorder::reader::Recording;
use std::collections::BTreeSet;
use std::io;
use std::path::{Component, Path, PathBuf};
use toml::{Table, Value};
use vehicles::reader::{Document, Section};
use vehicles::{EffectEntry, Vehicle};

/// Motion of the air around a simulated vehicle, as its files state it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Wind {
    /// Velocity of the steady wind, in the world.
    pub velocity_W_m_s: [f64; 3],
    /// True if random gusts are added to it. No file has their course.
    pub has_gusts: bool,
}

impl Wind {
    /// The wind of these effects; `None` in still air.
    fn of(effects: &[Effect]) -> Option<Self> {
        let values = |kind: &str| effects.iter().find(|effect| effect.kind.name == kind).map(|it| it.values);
        let velocity_W_m_s = values(WIND.name).map_or([0.0; 3], |wind| [wind[0], wind[1], wind[2]]);
        let has_gusts = values(TURBULENCE.name).is_some_and(|gusts| gusts[0] > 0.0);
        let blows = velocity_W_m_s.iter().any(|part| *part != 0.0);
        (blows || has_gusts).then_some(Self { velocity_W_m_s, has_gusts })
    }
}

/// Files attached to a recording: the manifest, and the files that it names.
#[derive(Debug)]
pub struct Attached {
    /// The manifest with its includes.
    manifest: Table,
    /// The manifest file by file: the included ones first.
    tables: Vec<Table>,
    /// Texts by the names under which they are attached: those of the files alone, or, where two files have one, the ways from the
    /// folder that holds them all.
    files: Vec<(String, String)>,
}

impl Attached {
    /// The files that are attached to a recording.
    ///
    /// # Errors
    /// If the recording is damaged.
    pub fn to(recording: &Recording) -> Result<Self, RecordingError> {
        let files = recording.attachments()?.into_iter();
        // Meshes are not text.
        let files = files.filter_map(|(name, bytes)| Some((name, String::from_utf8(bytes).ok()?)));
        Ok(Self::of(files.collect()))
    }

    fn of(files: Vec<(String, String)>) -> Self {
        let tables = files.iter().filter_map(|(name, text)| Some((name, text.parse().ok()?)));
        let is_of_manifest = |(_, table): &(&String, Table)| {
            ["process", "set", "vehicle"].iter().any(|key| table.contains_key(*key))
        };
        let anchored = |(name, mut table): (&String, Table)| {
            anchor(&mut table, name, false);
            table
        };
        let mut tables: Vec<Table> = tables.filter(is_of_manifest).map(anchored).collect();
        // The manifest comes first, and its own values count before those of its includes.
        tables.reverse();
        let manifest = tables.iter().cloned().fold(Table::new(), |mut lower, upper| {
            put(&mut lower, upper);
            lower
        });
        Self { manifest, tables, files }
    }

    /// The names of the vehicles; empty if the manifest has only one, without a name.
    #[must_use]
    pub fn names(&self) -> Vec<&str> {
        self.vehicles().filter_map(|vehicle| vehicle.get("name")?.as_str()).collect()
    }

    /// The body of the vehicle that is called `name`, empty where it has none; nothing where no file of it is attached.
    #[must_use]
    pub fn body(&self, name: &str) -> Option<Body> {
        Body::of(&self.airframe(name)?)
    }

    /// The vehicle that is called `name`, empty where it has none, with the effects of its file; `None` where no file of it
    /// is attached.
    #[must_use]
    pub fn airframe(&self, name: &str) -> Option<Airframe> {
        let vehicle = match self.file_of(name, "vehicle") {
            Some(file) => self.vehicle(Path::new(&file)),
            None => self.only_vehicle(),
        };
        Airframe::from_files(vehicle?, &[]).ok()
    }

    /// The wind at the simulated vehicle that is called `name`, empty where it has none: that of its vehicle file and of its
    /// scene file. `None` in still air, without a plant, and where its vehicle file is not attached.
    #[must_use]
    pub fn wind(&self, name: &str) -> Option<Wind> {
        let mut entries = self.vehicle(Path::new(&self.file_of(name, "vehicle")?))?.effects;
        let scene = self.file_of(name, "scene");
        entries.extend(scene.map_or_else(Vec::new, |file| self.listed_effects(&file)));
        Wind::of(&resolve(&entries).ok()?)
    }

    /// The effects that the file at `path` lists.
    fn listed_effects(&self, path: &str) -> Vec<EffectEntry> {
        // A manifest of the same name lists none.
        let listed =
            self.named(Path::new(path)).into_iter().filter_map(|(name, text)| read_effects(text, name));
        listed.flatten().collect()
    }

    /// The tables of a list of the manifest, such as `pass`: those of the included files first.
    #[must_use]
    pub fn list(&self, key: &str) -> Vec<&Table> {
        let lists = self.tables.iter().filter_map(|table| table.get(key)?.as_array());
        lists.flatten().filter_map(Value::as_table).collect()
    }

    /// The processes by their names, such as `imu` or `h1/imu`, with their tables.
    #[must_use]
    pub fn processes(&self) -> Vec<(String, Table)> {
        let names = self.names();
        let is_of_vehicle = |process: &str| {
            names.iter().any(|name| process.strip_prefix(name).is_some_and(|rest| rest.starts_with('/')))
        };
        let listed = |manifest: &Table| -> Vec<(String, Table)> {
            let processes = manifest.get("process").and_then(Value::as_table).into_iter().flatten();
            processes
                .filter_map(|(name, process)| Some((name.clone(), process.as_table()?.clone())))
                .collect()
        };
        let mut all = listed(&self.manifest);
        all.retain(|(process, _)| !is_of_vehicle(process));
        for name in &names {
            let of_vehicle = self.merged(name).map(|merged| listed(&merged)).unwrap_or_default();
            all.extend(of_vehicle.into_iter().map(|(process, table)| (format!("{name}/{process}"), table)));
        }
        all
    }

    fn vehicles(&self) -> impl Iterator<Item = &Value> {
        self.manifest.get("vehicle").and_then(Value::as_array).into_iter().flatten()
    }

    /// The path of the file that the plant names as `key`, `vehicle` or `scene`.
    fn file_of(&self, name: &str, key: &str) -> Option<String> {
        let merged = if name.is_empty() { self.manifest.clone() } else { self.merged(name)? };
        let is_plant = |process: &&Value| process.get("kind").and_then(Value::as_str) == Some("plant");
        let plant = merged.get("process")?.as_table()?.values().find(is_plant)?;
        let file = plant.get(key).or_else(|| plant.get("parameters")?.get(key))?;
        Some(file.as_str()?.to_owned())
    }

    /// The set of a vehicle with the vehicle's own values over it.
    fn merged(&self, name: &str) -> Option<Table> {
        let is_it = |vehicle: &&Value| vehicle.get("name").and_then(Value::as_str) == Some(name);
        let vehicle = self.vehicles().find(is_it)?.as_table()?;
        let set = vehicle.get("set").and_then(Value::as_str);
        let set = set.and_then(|set| self.manifest.get("set")?.get(set)?.as_table());
        let mut merged = set.cloned().unwrap_or_default();
        put(&mut merged, vehicle.clone());
        put(&mut merged, self.adjusted(name));
        Some(merged)
    }

    /// Adjustments of the vehicle's processes: tables such as `[process."h1/plant"]`.
    fn adjusted(&self, name: &str) -> Table {
        let processes = self.manifest.get("process").and_then(Value::as_table).into_iter().flatten();
        let adjusted = processes.filter_map(|(process, adjusted)| {
            let local = process.strip_prefix(name)?.strip_prefix('/')?;
            Some((local.to_owned(), adjusted.clone()))
        });
        Table::from_iter([("process".to_owned(), Value::Table(adjusted.collect()))])
    }

    /// The vehicle in the file at `path`: others, such as manifests, may have the same name.
    fn vehicle(&self, path: &Path) -> Option<Vehicle> {
        let is_complete = |text: &&str| text.parse().is_ok_and(|table: Table| table.contains_key("rotors"));
        let complete = |path: &Path| self.named(path).into_iter().map(|(_, text)| text).find(is_complete);
        let read =
            |path: &Path| complete(path).map(str::to_owned).ok_or_else(|| io::ErrorKind::NotFound.into());
        self.named(path).into_iter().find_map(|(name, text)| Vehicle::parse_with(text, name, &read).ok())
    }

    /// Names and texts of the files that may be the one at `path`.
    fn named(&self, path: &Path) -> Vec<(&str, &str)> {
        named(&self.files, path).into_iter().map(|(name, text)| (&**name, &**text)).collect()
    }

    /// The attached vehicle, if the manifest does not name it and there is only one.
    fn only_vehicle(&self) -> Option<Vehicle> {
        let names: BTreeSet<_> = self.files.iter().map(|(name, _)| name).collect();
        let mut found = names.into_iter().filter_map(|name| self.vehicle(Path::new(name)));
        found.next().filter(|_| found.next().is_none())
    }
}

/// The attached `files` that may be the one at `path`, by name and content: those whose names have most of its folders, and at least its own
/// name. Older recordings have several files under one name.
pub(crate) fn named<'a, T>(files: &'a [(String, T)], path: &Path) -> Vec<&'a (String, T)> {
    let path = without_ways_up(path);
    let in_common = |(name, _): &&(String, T)| {
        let parts = Path::new(name).components().rev().zip(path.components().rev());
        parts.take_while(|(a, b)| a == b).count()
    };
    let most = files.iter().map(|file| in_common(&file)).max().filter(|parts| *parts > 0);
    files.iter().filter(|file| Some(in_common(file)) == most).collect()
}

/// `path` without ways down and up again. Nothing is there to be looked at: the files lie in the recording.
fn without_ways_up(path: &Path) -> PathBuf {
    let mut short = PathBuf::new();
    for part in path.components() {
        match part {
            Component::CurDir => {}
            Component::ParentDir if short.file_name().is_some() => {
                short.pop();
            }
            _ => short.push(part),
        }
    }
    short
}

/// Makes paths of vehicles and scenes, which begin at the manifest that states them, begin where its own `name` begins.
fn anchor(table: &mut Table, name: &str, is_of_process: bool) {
    for (key, value) in table {
        match value {
            Value::Table(inner) => anchor(inner, name, is_of_process || key == "process"),
            Value::Array(list) => {
                let tables = list.iter_mut().filter_map(Value::as_table_mut);
                tables.for_each(|inner| anchor(inner, name, is_of_process));
            }
            Value::String(path) if is_of_process && ["vehicle", "scene"].contains(&&**key) => {
                if let Some(folder) = Path::new(name).parent().filter(|folder| *folder != Path::new("")) {
                    *path = without_ways_up(&folder.join(&*path)).to_string_lossy().into_owned();
                }
            }
            _ => {}
        }
    }
}

/// The effects that a scene file lists; `None` if it cannot be read.
fn read_effects(text: &str, file: &str) -> Option<Vec<EffectEntry>> {
    let document = Document::new(file, text);
    let tree = document.tree().ok()?;
    vehicles::effects::read(&Section::new(&document, String::new(), 0..0, tree.get_ref())).ok()
}

/// Puts the values of `upper` over those of `lower`.
fn put(lower: &mut Table, upper: Table) {
    for (key, value) in upper {
        match (lower.get_mut(&key), value) {
            (Some(Value::Table(lower)), Value::Table(upper)) => put(lower, upper),
            (_, value) => {
                lower.insert(key, value);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::{Attached, Wind};
    use std::path::Path;

    fn attached(files: &[(&str, &str)]) -> Attached {
        Attached::of(files.iter().map(|(name, text)| ((*name).to_owned(), (*text).to_owned())).collect())
    }

    const PLAIN: &str = vehicles::reference::HUMMINGBIRD;

    fn named(name: &str) -> String {
        format!("name = \"{name}\"\nbase = \"../files/hummingbird.toml\"\n")
    }

    #[test]
    fn the_file_of_the_plant_counts_and_not_that_of_the_controller() {
        let manifest = "[process.controller]\nkind = \"pid\"\nvehicle = \"x/hummingbird.toml\"\n\
                        [process.plant]\nvehicle = \"x/dragging.toml\"\n";
        let set = "[process.plant]\nkind = \"plant\"\nvehicle = \"y/hummingbird.toml\"\n";
        let found = attached(&[
            ("run.toml", manifest),
            ("set.toml", set),
            ("hummingbird.toml", PLAIN),
            ("dragging.toml", &named("with drag")),
        ]);
        assert_eq!(found.body("").unwrap().name, "with drag");
        assert!(found.names().is_empty());
    }

    #[test]
    fn files_of_one_name_are_told_by_their_folders() {
        let manifest = "[process.controller]\nkind = \"pid\"\nvehicle = \"quad.toml\"\n\
                        [process.plant]\nvehicle = \"../b/quad.toml\"\n";
        let set = "[process.plant]\nkind = \"plant\"\nvehicle = \"quad.toml\"\n";
        let light = PLAIN.replace("AscTec Hummingbird", "light");
        let on_base = "name = \"on a base\"\nbase = \"quad.toml\"\n";
        let files = [
            ("a/run.toml", manifest),
            ("sets/set.toml", set),
            ("a/quad.toml", PLAIN),
            ("b/quad.toml", &light),
            ("b/heavy.toml", on_base),
        ];
        assert_eq!(attached(&files).body("").unwrap().name, "light");
        let of_controller = manifest.replace("../b/quad", "quad");
        let mut other = files;
        other[0].1 = &of_controller;
        assert_eq!(attached(&other).body("").unwrap().name, "AscTec Hummingbird");
        // The base lies beside the file that names it.
        let heavy = manifest.replace("../b/quad", "../b/heavy");
        other[0].1 = &heavy;
        let light = light.replace("0.480", "0.3");
        other[3].1 = &light;
        let mass_kg = attached(&other).vehicle(Path::new("b/heavy.toml")).unwrap().mass_kg;
        assert!(mass_kg < 0.4, "{mass_kg}");
        assert_eq!(attached(&other).body("").unwrap().name, "on a base");
    }

    #[test]
    fn every_vehicle_has_the_file_of_its_set_or_its_own() {
        let manifest = "[[vehicle]]\nname = \"h1\"\nset = \"bird\"\n\
                        [[vehicle]]\nname = \"h2\"\nset = \"bird\"\nprocess.plant.vehicle = \"other.toml\"\n";
        let set = "[set.bird.process.plant]\nkind = \"plant\"\nvehicle = \"hummingbird.toml\"\n";
        let found = attached(&[
            ("run.toml", manifest),
            ("set.toml", set),
            ("hummingbird.toml", PLAIN),
            ("other.toml", &named("another")),
        ]);
        assert_eq!(found.names(), ["h1", "h2"]);
        let names = ["h1", "h2"].map(|name| found.body(name).unwrap().name);
        assert_eq!(names, ["AscTec Hummingbird", "another"]);
        assert!(found.body("h3").is_none(), "two are attached, and none is told to be its");
        let processes = found.processes();
        let names: Vec<_> = processes.iter().map(|(name, _)| name.as_str()).collect();
        assert_eq!(names, ["h1/plant", "h2/plant"]);
        assert_eq!(processes[1].1["vehicle"].as_str(), Some("other.toml"));
    }

    fn effect(name: &str, parameters: &[(&str, f64)]) -> String {
        let stated = |(key, value): &(&str, f64)| {
            format!(
                "{key} = {{ value = {value}, unit = \"m/s\", source = \"test\", uncertainty = \"exact\" }}\n"
            )
        };
        let parameters: String = parameters.iter().map(stated).collect();
        format!("[[effects]]\nname = \"{name}\"\n{parameters}")
    }

    #[test]
    fn the_wind_is_that_of_the_plant_s_vehicle_and_of_its_scene() {
        let manifest =
            "[process.plant]\nkind = \"plant\"\nvehicle = \"x/windy.toml\"\nscene = \"y/air.toml\"\n";
        let still = manifest.replace("windy", "hummingbird").replace("air", "calm");
        let windy = named("windy") + &effect("wind", &[("x", 3.0), ("z", -0.5)]);
        let air = format!("name = \"air\"\n{}", effect("turbulence", &[("wind_at_20_ft", 5.0)]));
        let wind = |manifest: &str| {
            let files = [("run.toml", manifest), ("windy.toml", &*windy), ("hummingbird.toml", PLAIN)];
            attached(&[&files[..], &[("air.toml", &*air), ("calm.toml", "name = \"calm\"\n")]].concat())
                .wind("")
        };
        let velocity_W_m_s = [3.0, 0.0, -0.5];
        assert_eq!(wind(manifest), Some(Wind { velocity_W_m_s, has_gusts: true }));
        assert_eq!(wind(&manifest.replace("air", "calm")), Some(Wind { velocity_W_m_s, has_gusts: false }));
        assert_eq!(wind(&still), None);
        assert_eq!(wind(&still.replace("vehicle = ", "# ")), None, "the file of the vehicle is not told");
        assert_eq!(
            wind(&still.replace("calm", "air")),
            Some(Wind { velocity_W_m_s: [0.0; 3], has_gusts: true })
        );
    }

    #[test]
    fn lists_add_up_the_included_files_first() {
        let manifest = "[process.plant]\nkind = \"plant\"\n[[pass]]\nname = \"second\"\n";
        let included = "[process.imu]\nkind = \"imu\"\n[[pass]]\nname = \"first\"\n";
        let found = attached(&[("run.toml", manifest), ("sensors.toml", included)]);
        let processes: Vec<_> = found.processes().into_iter().map(|(name, _)| name).collect();
        assert_eq!(processes, ["imu", "plant"]);
        let names: Vec<_> = found.list("pass").iter().map(|pass| pass["name"].as_str().unwrap()).collect();
        assert_eq!(names, ["first", "second"]);
        assert!(found.list("swap").is_empty());
    }

    #[test]
    fn the_only_file_counts_where_the_manifest_does_not_tell() {
        assert!(attached(&[("run.toml", "[run]\n"), ("hummingbird.toml", PLAIN)]).body("h1").is_some());
        assert!(attached(&[("run.toml", "[run]\n")]).body("h1").is_none());
    }
}
