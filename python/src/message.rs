//! Messages as Python declares and reads them: JSON, of which `hummingbus/_messages.py` makes types of numpy.

use crate::error::raised;
use bus::dynamic::{FieldDescription, KindDescription, MessageDescription};
use bus::schema::{Field, Kind, Primitive, Schema};
use hummingbus::COMPONENTS;
use pyo3::prelude::*;
use serde_json::{Value, json};

const PRIMITIVES: [Primitive; 10] = [
    Primitive::F64,
    Primitive::F32,
    Primitive::I64,
    Primitive::U64,
    Primitive::I32,
    Primitive::U32,
    Primitive::I16,
    Primitive::U16,
    Primitive::I8,
    Primitive::U8,
];

/// Names of all messages that components send or read, and of their states that are messages.
#[pyfunction]
pub fn messages() -> Vec<&'static str> {
    let schemas = COMPONENTS.messages().into_iter().chain(COMPONENTS.states());
    schemas.filter(|schema| !schema.has_text()).map(|schema| schema.type_name).collect()
}

/// The message `name`, with or without its package, as JSON.
#[pyfunction]
pub fn message(name: &str) -> PyResult<String> {
    let schema = known(name).map_err(raised)?;
    let mut description = described(schema);
    // Many readers of JSON round integers beyond 53 bits, so that the hash is a text.
    description["layout_hash"] = json!(format!("{:016x}", schema.layout_hash()));
    Ok(description.to_string())
}

/// The schema of the built-in message `name`, with or without its package, which a port carries or which is part of one.
fn known(name: &str) -> Result<&'static Schema, String> {
    let schemas = COMPONENTS.messages().into_iter().chain(COMPONENTS.states());
    let found = schemas.into_iter().find_map(|schema| within(schema, name));
    let found = found.ok_or_else(|| {
        format!("there is no message {name}; hummingbus.messages() lists those of hummingbus, hummingbus.message makes others")
    })?;
    if found.has_text() {
        return Err(format!(
            "the message {name} holds a text: only plants and sensors send it, for tools of ROS 2"
        ));
    }
    Ok(found)
}

/// The message `name` in `schema`: itself, or one that it holds.
fn within(schema: &'static Schema, name: &str) -> Option<&'static Schema> {
    let is_meant = schema.type_name == name || schema.type_name.rsplit('/').next() == Some(name);
    if is_meant {
        Some(schema)
    } else {
        schema.fields.iter().find_map(|field| within_kind(&field.kind, name))
    }
}

fn within_kind(kind: &'static Kind, name: &str) -> Option<&'static Schema> {
    match kind {
        Kind::Message(schema) => within(schema, name),
        Kind::Array(element, _) | Kind::Sequence(element, _) => within_kind(element, name),
        Kind::Primitive(_) | Kind::Text | Kind::NamedNumbers(..) => None,
    }
}

fn described(schema: &Schema) -> Value {
    let fields: Vec<Value> = schema.fields.iter().map(field_described).collect();
    json!({ "type_name": schema.type_name, "doc": schema.doc, "size": schema.size, "fields": fields })
}

fn field_described(field: &Field) -> Value {
    let kind = kind_described(&field.kind);
    let Field { name, doc, unit, frame, offset, .. } = field;
    json!({ "name": name, "doc": doc, "unit": unit, "frame": frame, "offset": offset, "kind": kind })
}

fn kind_described(kind: &Kind) -> Value {
    match kind {
        Kind::Primitive(primitive) => json!(primitive.ros_name()),
        Kind::Message(schema) => described(schema),
        Kind::Array(element, length) => json!({ "array": kind_described(element), "length": length }),
        Kind::Sequence(element, most) => json!({ "sequence": kind_described(element), "most": most }),
        Kind::Text | Kind::NamedNumbers(..) => Value::Null,
    }
}

/// The schema of a message that is declared as JSON: a built-in one by its name, or one with its fields. A state is carried
/// by no topic.
///
/// # Errors
/// There is no such message, or it breaks a rule of messages.
pub(crate) fn declared(text: &str, is_state: bool) -> Result<&'static Schema, String> {
    let value: Value = serde_json::from_str(text).map_err(|error| error.to_string())?;
    if let Value::String(name) = &value {
        return known(name);
    }
    let description = read(&value)?;
    if is_state { description.declare_state() } else { description.declare() }
}

fn read(value: &Value) -> Result<MessageDescription, String> {
    let fields =
        value["fields"].as_array().into_iter().flatten().map(read_field).collect::<Result<_, _>>()?;
    Ok(MessageDescription {
        type_name: text(value, "type_name"),
        doc: text(value, "doc"),
        size: size(value, "size"),
        fields,
    })
}

fn read_field(value: &Value) -> Result<FieldDescription, String> {
    let [name, doc, unit, frame] = ["name", "doc", "unit", "frame"].map(|key| text(value, key));
    Ok(FieldDescription {
        name,
        doc,
        unit,
        frame,
        offset: size(value, "offset"),
        kind: read_kind(&value["kind"])?,
    })
}

fn read_kind(value: &Value) -> Result<KindDescription, String> {
    if let Some(name) = value.as_str() {
        let primitive = PRIMITIVES.into_iter().find(|primitive| primitive.ros_name() == name);
        return primitive
            .map(KindDescription::Primitive)
            .ok_or_else(|| format!("there are no numbers of type {name}"));
    }
    if let Some(element) = value.get("array") {
        return Ok(KindDescription::Array(Box::new(read_kind(element)?), size(value, "length")));
    }
    if let Some(element) = value.get("sequence") {
        return Ok(KindDescription::Sequence(Box::new(read_kind(element)?), size(value, "most")));
    }
    Ok(KindDescription::Message(Box::new(read(value)?)))
}

fn text(value: &Value, key: &str) -> String {
    value[key].as_str().unwrap_or_default().to_owned()
}

fn size(value: &Value, key: &str) -> usize {
    value[key].as_u64().and_then(|size| usize::try_from(size).ok()).unwrap_or_default()
}
