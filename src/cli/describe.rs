//! What `schema` and `cat` print.

use crate::COMPONENTS;
use std::fmt::Write as _;

/// Every message with its fields, units, frames and layout hash.
pub fn schemas() -> String {
    COMPONENTS.messages().into_iter().fold(String::new(), |mut text, schema| {
        let _ = write!(text, "{}  layout {:016x}\n  {}\n", schema.layout(), schema.layout_hash(), schema.doc);
        text.push('\n');
        text
    })
}

/// The same as JSON, with the ROS 2 definitions.
pub fn schemas_json() -> String {
    let schemas: Vec<_> =
        COMPONENTS.messages().into_iter().map(bus::announcement::Announcement::of).collect();
    serde_json::to_string_pretty(&schemas).unwrap_or_default()
}

/// A value of a recording as JSON; JSON has no NaN and no infinity, so these are strings.
pub fn json_value(value: &recorder::definition::Value) -> serde_json::Value {
    use recorder::definition::Value;
    match value {
        Value::Float(number) if number.is_finite() => (*number).into(),
        Value::Float(number) => number.to_string().into(),
        Value::Integer(number) => match i64::try_from(*number) {
            Ok(number) => number.into(),
            Err(_) => u64::try_from(*number).map_or_else(|_| number.to_string().into(), Into::into),
        },
        Value::Text(text) => text.clone().into(),
    }
}
