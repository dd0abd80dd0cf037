//! The pages of vehicle and scene files have every key of the readers, with its units, bounds and default.

use crate::support::repository;
use diagnostics::Diagnostic;
use scenes::Scene;
use std::collections::BTreeSet;
use std::fs;
use toml_edit::{DocumentMut, Item, Table, Value};
use vehicles::Vehicle;
use vehicles::reference::{CRAZYFLIE, HUMMINGBIRD};

fn page(name: &str) -> String {
    fs::read_to_string(repository(name)).unwrap()
}

/// The keys that the refusals of `unknown_key` in each table of `text` name as known, as `body.mass`.
fn known_keys(text: &str, read: impl Fn(&str) -> Result<(), Diagnostic>) -> BTreeSet<String> {
    let mut keys = BTreeSet::new();
    let headers = text.match_indices("\n[").map(|(at, _)| at + 1 + text[at + 1..].find('\n').unwrap() + 1);
    for at in [0].into_iter().chain(headers) {
        let Err(error) = read(&format!("{}unknown_key = 1\n{}", &text[..at], &text[at..])) else { continue };
        for line in error.to_string().lines() {
            let Some((before, list)) = line.split_once("unknown_key`, expected ") else { continue };
            let (_, path) = before.split_once("unknown key `").unwrap();
            let table =
                path.split('.').filter(|part| part.parse::<usize>().is_err()).collect::<Vec<_>>().join(".");
            keys.extend(list.split('`').skip(1).step_by(2).map(|key| format!("{table}{key}")));
        }
    }
    keys
}

fn keys_of_vehicles() -> BTreeSet<String> {
    let read = |text: &str| Vehicle::parse(text, "vehicle.toml").map(drop);
    let texts = [HUMMINGBIRD.to_owned() + "\n[envelope]\n", CRAZYFLIE.to_owned()];
    texts.iter().flat_map(|text| known_keys(text, read)).collect()
}

#[test]
fn the_page_of_scene_files_has_every_key() {
    let page = page("docs/scenes.md");
    let files = ["room", "office", "workshop", "slung-load", "driven-joints", "rig-sliding"];
    let mut keys = BTreeSet::new();
    for file in files.map(|name| repository(&format!("scenes/{name}.toml"))) {
        let read = |text: &str| Scene::parse(text, &file).map(drop);
        keys.extend(known_keys(&fs::read_to_string(&file).unwrap(), read));
    }
    for expected in
        ["boxes.size", "meshes.solid", "balls.radius", "joints.axis", "joints.drive.limit", "rig.heave"]
    {
        assert!(keys.contains(expected), "{expected} is not in {keys:?}");
    }
    for key in keys {
        let name = key.rsplit('.').next().unwrap();
        let forms = [format!("`{name}`"), format!("[{name}]"), format!(".{name}]")];
        assert!(forms.iter().any(|form| page.contains(form)), "docs/scenes.md has no `{key}`");
    }
}

/// A row of the page of vehicle files.
struct Row {
    keys: Vec<String>,
    units: String,
    values: String,
    default: String,
}

fn rows() -> Vec<Row> {
    let page = page("docs/vehicles.md");
    let (_, table) =
        page.split_once("| key | unit | values | default | meaning |\n|---|---|---|---|---|\n").unwrap();
    let rows = table.lines().take_while(|line| line.starts_with('|'));
    let row = |line: &str| {
        let cells: Vec<&str> = line.trim_matches('|').split(" | ").map(str::trim).collect();
        let [keys, units, values, default, _] = cells[..] else { panic!("five cells: {line}") };
        let keys = keys.split('`').skip(1).step_by(2).map(|key| key.trim_matches(['[', ']']).to_owned());
        let [units, values, default] = [units, values, default].map(str::to_owned);
        Row { keys: keys.collect(), units, values, default }
    };
    rows.map(row).collect()
}

/// The table `name` of a vehicle file; of `rotors` the first.
fn table<'a>(document: &'a mut DocumentMut, name: &str) -> &'a mut Table {
    match &mut document[name] {
        Item::ArrayOfTables(tables) => tables.get_mut(0).unwrap(),
        item => item.as_table_mut().unwrap(),
    }
}

/// A shipped vehicle with `value` in place of the number `key`, or without the number; without the provenance of its numbers.
fn vehicle_with(key: &str, value: Option<&str>) -> Result<Vehicle, Diagnostic> {
    let (name, key) = key.split_once('.').unwrap();
    let mut documents = [HUMMINGBIRD, CRAZYFLIE].map(|text| text.parse::<DocumentMut>().unwrap());
    // A motor has the numbers of its model.
    let number = documents.iter_mut().position(|document| table(document, name).contains_key(key));
    let document = &mut documents[number.unwrap_or(0)];
    match value {
        Some(value) => {
            table(document, name).insert(key, Item::Value(value.parse::<Value>().unwrap()));
        }
        None => drop(table(document, name).remove(key)),
    }
    let vehicle = Vehicle::parse(&document.to_string(), "vehicle.toml")?;
    Ok(Vehicle { provenance: Vec::new(), ..vehicle })
}

/// The vehicle with this value and unit.
fn vehicle_of(key: &str, value: &str, unit: &str) -> Result<Vehicle, Diagnostic> {
    let number =
        format!("{{ value = {value}, unit = \"{unit}\", source = \"none\", uncertainty = \"exact\" }}");
    vehicle_with(key, Some(&number))
}

/// The part of a refusal between these words.
fn expected(error: &Diagnostic, before: &str, after: &str) -> Option<String> {
    let error = error.to_string();
    Some(error.split_once(before)?.1.split_once(after)?.0.to_owned())
}

#[test]
fn the_page_of_vehicle_files_has_every_key() {
    let page = page("docs/vehicles.md");
    let keys = keys_of_vehicles();
    assert!(keys.len() > 35, "{keys:?}");
    let documented: BTreeSet<String> = rows().into_iter().flat_map(|row| row.keys).collect();
    let tables: BTreeSet<&str> = keys.iter().filter_map(|key| Some(key.split_once('.')?.0)).collect();
    for key in keys.iter().filter(|key| !tables.contains(&key[..])) {
        let is_of_envelope =
            key.strip_prefix("envelope.").is_some_and(|name| page.contains(&format!("`{name}`")));
        assert!(documented.contains(key) || is_of_envelope, "docs/vehicles.md has no `{key}`");
    }
}

#[test]
fn the_page_of_vehicle_files_has_units_bounds_and_defaults() {
    let mut count = 0;
    for Row { keys, units, values, default } in rows() {
        for key in keys.iter().filter(|key| key.contains('.')) {
            let first = units.split('`').nth(1).unwrap_or("1");
            let vector = |number: &str| match &key[..] {
                "rotors.position" | "rotors.axis" => format!("[{number}, 0, 0]"),
                _ => number.to_owned(),
            };
            let error = vehicle_of(key, &vector("1e300"), first).expect_err(key);
            let limits = expected(&error, "` must be ", " (").filter(|limits| limits.contains(" to "));
            let Some((min, max)) = limits.as_deref().and_then(|limits| limits.split_once(" to ")) else {
                assert_eq!(values, "–", "docs/vehicles.md, `{key}`: the reader has no bounds: {error}");
                continue;
            };
            let number = |text: &str| text.split(' ').next().unwrap().parse::<f64>().unwrap();
            let documented = values.split_once(" … ").map(|(min, max)| (number(min), number(max)));
            assert_eq!(documented, Some((number(min), number(max))), "docs/vehicles.md, values of `{key}`");

            let error = vehicle_of(key, &vector("1"), "?").expect_err(key);
            let read = expected(&error, ": \"", ", found").unwrap().replace('"', "");
            assert_eq!(units.replace('`', ""), read, "docs/vehicles.md, units of `{key}`");

            let without = vehicle_with(key, None);
            match &default[..] {
                "required" => assert!(without.is_err(), "docs/vehicles.md: `{key}` is not required"),
                default => assert_eq!(without.unwrap(), vehicle_of(key, default, first).unwrap(), "{key}"),
            }
            count += 1;
        }
    }
    assert!(count >= 20, "{count}");
}
