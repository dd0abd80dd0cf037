//! Any content of a vehicle file is refused with file, line and key, or describes a physical vehicle.

use diagnostics::Diagnostic;
use proptest::prelude::*;
use toml::{Table, Value};
use vehicles::{Uncertainty, Vehicle};

const FILES: [&str; 3] = [
    vehicles::reference::HUMMINGBIRD,
    vehicles::reference::CRAZYFLIE,
    concat!(
        include_str!("../hummingbird.toml"),
        r#"
        [[effects]]
        name = "wind"
        x = { value = 3, unit = "m/s", source = "test", uncertainty = 1 }
        "#
    ),
];

/// Returns the values that a key may be replaced with.
fn value() -> impl Strategy<Value = Value> {
    prop_oneof![
        prop::num::f64::ANY.prop_map(Value::Float),
        prop::sample::select(vec![f64::NAN, f64::INFINITY, -1.0, -0.0, 0.0, 1e308, 5e-324])
            .prop_map(Value::Float),
        any::<i64>().prop_map(Value::Integer),
        any::<bool>().prop_map(Value::Boolean),
        "[a-z*/^0-9 ]{0,8}".prop_map(Value::String),
        prop::collection::vec(any::<f64>().prop_map(Value::Float), 0..5).prop_map(Value::Array),
        Just(Value::Table(Table::new())),
    ]
}

/// The dotted paths of all keys below `value`; an element of an array has its index as key.
fn paths(value: &Value, path: &[String], all: &mut Vec<Vec<String>>) {
    let children: Vec<(String, &Value)> = match value {
        Value::Table(table) => table.iter().map(|(key, value)| (key.clone(), value)).collect(),
        Value::Array(array) => {
            array.iter().enumerate().map(|(index, value)| (index.to_string(), value)).collect()
        }
        _ => Vec::new(),
    };
    for (key, child) in children {
        let path = [path, &[key]].concat();
        paths(child, &path, all);
        all.push(path);
    }
}

/// Replaces the value at `path`, or removes it.
fn change(value: &mut Value, path: &[String], new: Option<Value>) {
    let [key, rest @ ..] = path else { return };
    match value {
        Value::Array(array) => {
            let index: usize = key.parse().unwrap();
            match (rest, new) {
                ([], Some(new)) => array[index] = new,
                ([], None) => drop(array.remove(index)),
                (rest, new) => change(&mut array[index], rest, new),
            }
        }
        Value::Table(table) => match (rest, new) {
            ([], Some(new)) => drop(table.insert(key.clone(), new)),
            ([], None) => drop(table.remove(key)),
            (rest, new) => change(&mut table[key], rest, new),
        },
        _ => unreachable!("the path leads through tables and arrays"),
    }
}

fn require_physical(vehicle: &Vehicle) -> Result<(), TestCaseError> {
    let is_amount = |number: f64| number.is_finite() && number >= 0.0;
    prop_assert!(vehicle.mass_kg > 0.0 && vehicle.mass_kg.is_finite());
    prop_assert!(is_amount(vehicle.gravity_m_s2) && is_amount(vehicle.rotor_inertia_kg_m2));
    prop_assert!(is_amount(vehicle.thrust_coefficient) && is_amount(vehicle.torque_coefficient));
    prop_assert!(vehicle.inertia_kg_m2.iter().all(|entry| entry.is_finite()));
    prop_assert!(vehicle.inertia_kg_m2.diagonal().min() > 0.0);
    prop_assert!(vehicle.command.max > vehicle.command.min);
    prop_assert!(vehicle.rotors.iter().all(|rotor| rotor.position_m.iter().all(|x| x.is_finite())));
    for number in &vehicle.provenance {
        let is_said = matches!(number.uncertainty, Uncertainty::Said(_));
        let is_number = matches!(number.uncertainty, Uncertainty::OneSigma(sigma) if is_amount(sigma));
        prop_assert!(is_said || is_number, "{number:?}");
    }
    Ok(())
}

/// Refused with the place of a key, whose name or whose table's name is one of `keys`; or physical.
fn require_answer(answer: Result<Vehicle, Diagnostic>, keys: &[String]) -> Result<(), TestCaseError> {
    match answer {
        Ok(vehicle) => require_physical(&vehicle),
        Err(error) => {
            let message = error.to_string();
            prop_assert!(message.starts_with("any.toml:"), "{message}");
            prop_assert!(keys.iter().all(|key| message.contains(key.as_str())), "no {keys:?} in: {message}");
            Ok(())
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 2000, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn no_text_is_a_crash(text in "(?s).{0,300}") {
        require_answer(Vehicle::parse(&text, "any.toml"), &[])?;
    }

    #[test]
    fn no_toml_is_a_crash(text in r#"((\[{1,2}[a-z]{0,5}\]{1,2}|[a-z_]{1,8} ?= ?[0-9a-z{}",.\[\]+-]{0,12})\n){0,12}"#) {
        require_answer(Vehicle::parse(&text, "any.toml"), &[])?;
    }

    #[test]
    fn a_changed_key_is_named_or_physical(
        file in 0..FILES.len(),
        pick in any::<prop::sample::Index>(),
        new in prop::option::weighted(0.8, value()),
    ) {
        let mut tree = Value::Table(FILES[file].parse::<Table>().unwrap());
        let mut all = Vec::new();
        paths(&tree, &[], &mut all);
        let path = &all[pick.index(all.len())];
        change(&mut tree, path, new);
        let text = toml::to_string(&tree).unwrap();
        require_answer(Vehicle::parse(&text, "any.toml"), &path[..1])?;
    }

    #[test]
    fn an_unknown_key_is_named(
        // Not of the file with effects, whose keys only the plant's catalogue knows.
        file in 0..2_usize,
        pick in any::<prop::sample::Index>(),
        key in "zz[a-z]{1,6}",
        new in value(),
    ) {
        let mut tree = Value::Table(FILES[file].parse::<Table>().unwrap());
        let mut all = vec![Vec::new()];
        paths(&tree, &[], &mut all);
        let tables: Vec<_> = all.into_iter().filter(|path| find(&tree, path).is_some_and(Value::is_table)).collect();
        let path = [&tables[pick.index(tables.len())][..], std::slice::from_ref(&key)].concat();
        change(&mut tree, &path, Some(new));
        let error = Vehicle::parse(&toml::to_string(&tree).unwrap(), "any.toml").unwrap_err().to_string();
        prop_assert!(error.contains("unknown key") && error.contains(&key), "{error}");
    }
}

fn find<'a>(tree: &'a Value, path: &[String]) -> Option<&'a Value> {
    path.iter().try_fold(tree, |value, key| match value {
        Value::Array(array) => array.get(key.parse::<usize>().ok()?),
        Value::Table(table) => table.get(key),
        _ => None,
    })
}
