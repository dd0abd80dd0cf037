//! Any initial value of a manifest, and any content in the place of a plan, fits or is refused with a message.

use bus::Message;
use bus::initial::sample;
use bus::messages::{AttitudeEstimate, Imu, MotorCommand, PlantState, PoseStamped, SetPoint};
use bus::plan::Plan;
use bus::schema::Schema;
use proptest::prelude::*;
use serde_json::{Map, Value};

const SCHEMAS: [&Schema; 6] = [
    AttitudeEstimate::SCHEMA,
    Imu::SCHEMA,
    MotorCommand::SCHEMA,
    PlantState::SCHEMA,
    PoseStamped::SCHEMA,
    SetPoint::SCHEMA,
];
/// Keys of tables: names of fields, and others.
const KEYS: [&str; 13] = [
    "stamp", "sec", "nanosec", "command", "position", "x", "y", "z", "header", "frame_id", "pose", "other",
    "",
];

fn json() -> impl Strategy<Value = Value> {
    let leaf = prop_oneof![
        Just(Value::Null),
        any::<bool>().prop_map(Value::from),
        any::<f64>().prop_map(Value::from),
        any::<i64>().prop_map(Value::from),
        any::<u64>().prop_map(Value::from),
        "[a-z]{0,5}".prop_map(Value::from),
    ];
    leaf.prop_recursive(4, 40, 6, |inner| {
        let field = (prop::sample::select(&KEYS[..]).prop_map(str::to_owned), inner.clone());
        prop_oneof![
            prop::collection::vec(inner, 0..6).prop_map(Value::from),
            prop::collection::vec(field, 0..6).prop_map(|fields| Value::Object(fields.into_iter().collect())),
        ]
    })
}

fn table(name: &str, value: impl Into<Value>) -> Value {
    Value::Object(Map::from_iter([(name.to_owned(), value.into())]))
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 1000, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn any_initial_value_fits_or_is_refused_in_words(pick in 0..SCHEMAS.len(), value in json()) {
        match sample(SCHEMAS[pick], &value) {
            Ok(words) => prop_assert_eq!(words.len(), 1 + SCHEMAS[pick].size.div_ceil(8)),
            Err(reason) => prop_assert!(!reason.to_string().is_empty()),
        }
    }

    #[test]
    fn an_unknown_field_is_named_with_those_there_are(pick in 0..SCHEMAS.len(), name in "zz[a-z]{1,6}") {
        let reason = sample(SCHEMAS[pick], &table(&name, 1.0)).unwrap_err().to_string();
        prop_assert!(reason.contains(&name), "{reason}");
        prop_assert!(SCHEMAS[pick].fields.iter().all(|field| reason.contains(field.name)), "{reason}");
    }

    #[test]
    fn a_value_of_another_kind_is_named_with_its_field(
        pick in 0..SCHEMAS.len(),
        at in any::<prop::sample::Index>(),
    ) {
        let field = at.get(SCHEMAS[pick].fields);
        // No field of any message is a truth value.
        let reason = sample(SCHEMAS[pick], &table(field.name, true)).unwrap_err().to_string();
        prop_assert!(reason.contains(field.name), "{reason}");
    }

    #[test]
    fn no_text_in_the_place_of_a_plan_is_a_crash(text in "(?s).{0,200}") {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join(Plan::FILE), text).unwrap();
        let error = Plan::load(folder.path()).unwrap_err().to_string();
        prop_assert!(error.contains(Plan::FILE) && error.contains("the plan of a run"), "{error}");
    }
}
