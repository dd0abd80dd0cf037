//! Messages as C and C++: structs with the layout of shared memory, and the tables by which a program declares them.

use bus::schema::{Field, Kind, Primitive, Schema};
use std::fmt::Write as _;

/// A language that messages are written in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Language {
    /// C11 for `hummingbus.h`.
    C,
    /// C++17 for `hummingbus.hpp`.
    Cpp,
}

/// A header with `schemas`, and with the messages within them before them. Messages with a text in them are left out: only
/// plants and sensors send these, for tools of ROS 2.
pub fn header(schemas: &[&'static Schema], language: Language) -> String {
    let mut ordered = Vec::new();
    for schema in schemas.iter().filter(|schema| !schema.has_text()) {
        add_with_nested(schema, &mut ordered);
    }
    let (start, end) = frame(language);
    let structs = ordered.iter().map(|schema| match language {
        Language::C => c_message(schema),
        Language::Cpp => cpp_message(schema),
    });
    format!("{start}{}{end}", structs.collect::<String>())
}

/// Beginning and end of a header.
fn frame(language: Language) -> (&'static str, &'static str) {
    match language {
        Language::C => (
            "// The messages of hummingbus for C. Made by `hummingbus schema --c`: not to be edited.\n\n\
             #ifndef HUMMINGBUS_MESSAGES_H\n#define HUMMINGBUS_MESSAGES_H\n\n#include \"hummingbus.h\"\n\n\
             #include <stddef.h>\n#include <stdint.h>\n",
            "\n#endif // HUMMINGBUS_MESSAGES_H\n",
        ),
        Language::Cpp => (
            "// The messages of hummingbus for C++17. Made by `hummingbus schema --cpp`: not to be edited.\n\n\
             #pragma once\n\n#include \"hummingbus.hpp\"\n\n#include <array>\n#include <cstdint>\n",
            "",
        ),
    }
}

/// Adds `schema` behind those that it holds, each once.
fn add_with_nested(schema: &'static Schema, ordered: &mut Vec<&'static Schema>) {
    for field in schema.fields {
        if let Value { nested: Some(nested), .. } = value(&field.kind) {
            add_with_nested(nested, ordered);
        }
    }
    if ordered.iter().all(|other| other.type_name != schema.type_name) {
        ordered.push(schema);
    }
}

/// A field's value, taken apart.
struct Value {
    primitive: Option<Primitive>,
    nested: Option<&'static Schema>,
    /// Lengths of fixed arrays, the outermost first.
    array: Vec<usize>,
    sequence: Option<usize>,
}

fn value(kind: &Kind) -> Value {
    let plain = Value { primitive: None, nested: None, array: Vec::new(), sequence: None };
    match kind {
        Kind::Primitive(primitive) => Value { primitive: Some(*primitive), ..plain },
        Kind::Message(schema) => Value { nested: Some(schema), ..plain },
        Kind::Array(element, length) => {
            let mut inner = value(element);
            inner.array.insert(0, *length);
            inner
        }
        Kind::Sequence(element, most) => Value { sequence: Some(*most), ..value(element) },
        Kind::Text | Kind::NamedNumbers(..) => plain,
    }
}

/// Name of a primitive in C and C++.
fn number_type(primitive: Primitive) -> &'static str {
    match primitive {
        Primitive::F64 => "double",
        Primitive::F32 => "float",
        Primitive::I64 => "int64_t",
        Primitive::U64 => "uint64_t",
        Primitive::I32 => "int32_t",
        Primitive::U32 => "uint32_t",
        Primitive::I16 => "int16_t",
        Primitive::U16 => "uint16_t",
        Primitive::I8 => "int8_t",
        Primitive::U8 => "uint8_t",
    }
}

/// Name of a primitive in the tables of fields.
fn table_kind(primitive: Primitive) -> String {
    let letter = match primitive.ros_name().as_bytes().first() {
        Some(b'f') => 'F',
        Some(b'u') => 'U',
        _ => 'I',
    };
    format!("HB_{letter}{}", 8 * primitive.size())
}

/// `PlantState` of `hummingbus_msgs/msg/PlantState`.
fn short(schema: &Schema) -> &'static str {
    schema.type_name.rsplit('/').next().unwrap_or(schema.type_name)
}

/// `PLANT_STATE` of `PlantState`.
fn screaming(name: &str) -> String {
    let letters: Vec<char> = name.chars().collect();
    let mut text = String::new();
    for (index, letter) in letters.iter().enumerate() {
        let begins_word = letter.is_ascii_uppercase()
            && index > 0
            && (letters[index - 1].is_ascii_lowercase()
                || letters[index - 1].is_ascii_digit()
                || letters.get(index + 1).is_some_and(char::is_ascii_lowercase));
        if begins_word {
            text.push('_');
        }
        text.push(letter.to_ascii_uppercase());
    }
    text
}

/// Meaning of a field with its unit and frame, as a comment.
fn comment(field: &Field) -> String {
    let unit = if field.unit.is_empty() { String::new() } else { format!(" [{}]", field.unit) };
    let frame = if field.frame.is_empty() { String::new() } else { format!(" in {}", field.frame) };
    format!("// {}{unit}{frame}", field.doc)
}

/// A text in quotes.
fn quoted(text: &str) -> String {
    format!("\"{}\"", text.replace('\\', "\\\\").replace('"', "\\\""))
}

fn c_message(schema: &Schema) -> String {
    let name = format!("Hb{}", short(schema));
    let constant = format!("HB_{}", screaming(short(schema)));
    let (mut members, mut rows) = (String::new(), String::new());
    for field in schema.fields {
        let Value { primitive, nested, array, sequence } = value(&field.kind);
        let element = primitive.map_or_else(
            || nested.map_or_else(String::new, |nested| format!("Hb{}", short(nested))),
            |primitive| number_type(primitive).to_owned(),
        );
        let lengths: String = array.iter().map(|length| format!("[{length}]")).collect();
        let member = match sequence {
            Some(most) => {
                format!("struct {{ uint32_t count; uint32_t pad; {element} values[{most}]; }} {}", field.name)
            }
            None => format!("{element} {}{lengths}", field.name),
        };
        let _ = writeln!(members, "  {}\n  {member};", comment(field));
        let kind = primitive.map_or_else(|| "HB_NESTED".to_owned(), table_kind);
        let message =
            nested.map_or_else(|| "NULL".to_owned(), |nested| format!("&HB_{}", screaming(short(nested))));
        let _ = writeln!(
            rows,
            "  {{ {}, {}, {}, {}, offsetof({name}, {}), {kind}, {message}, {}, {}, {} }},",
            quoted(field.name),
            quoted(field.doc),
            quoted(field.unit),
            quoted(field.frame),
            field.name,
            array.first().unwrap_or(&0),
            array.get(1).unwrap_or(&0),
            sequence.unwrap_or(0),
        );
    }
    format!(
        "\n// {}\ntypedef struct {name} {{\n{members}}} {name};\n\nstatic const HbField {constant}_FIELDS[] = {{\n{rows}}};\n\n\
         static const HbMessage {constant} = {{ {}, {}, sizeof({name}), {constant}_FIELDS, {} }};\n",
        schema.doc,
        quoted(schema.type_name),
        quoted(schema.doc),
        schema.fields.len(),
    )
}

fn cpp_message(schema: &Schema) -> String {
    let name = short(schema);
    let (mut members, mut rows) = (String::new(), Vec::new());
    for field in schema.fields {
        let _ = writeln!(members, "  {}\n  {} {}{{}};", comment(field), cpp_type(&field.kind), field.name);
        rows.push(format!(
            "    HUMMINGBUS_FIELD({}, {}, {}, {})",
            field.name,
            quoted(field.unit),
            quoted(field.frame),
            quoted(field.doc)
        ));
    }
    format!(
        "\nnamespace hummingbus::msgs {{\n// {}\nstruct {name} {{\n{members}}};\n}} // namespace hummingbus::msgs\n\n\
         HUMMINGBUS_MESSAGE(hummingbus::msgs::{name}, {}, {},\n{});\n",
        schema.doc,
        quoted(schema.type_name),
        quoted(schema.doc),
        rows.join(",\n"),
    )
}

fn cpp_type(kind: &Kind) -> String {
    match kind {
        Kind::Primitive(primitive) => {
            let name = number_type(*primitive);
            if name.ends_with("_t") { format!("std::{name}") } else { name.to_owned() }
        }
        Kind::Message(schema) => short(schema).to_owned(),
        Kind::Array(element, length) => format!("std::array<{}, {length}>", cpp_type(element)),
        Kind::Sequence(element, most) => format!("hummingbus::Bounded<{}, {most}>", cpp_type(element)),
        Kind::Text | Kind::NamedNumbers(..) => String::new(),
    }
}

#[cfg(test)]
mod tests {
    use super::{Language, header, screaming};
    use hummingbus::COMPONENTS;

    #[test]
    fn words_begin_where_capitals_do() {
        let words = ["PlantState", "LawId", "GPSFix", "Vector3", "EKFState2D"].map(screaming);
        assert_eq!(words, ["PLANT_STATE", "LAW_ID", "GPS_FIX", "VECTOR3", "EKF_STATE2_D"]);
    }

    #[test]
    fn a_message_stands_behind_those_that_it_holds() {
        let state = COMPONENTS.message("hummingbus_msgs/msg/PlantState").unwrap();
        for language in [Language::C, Language::Cpp] {
            let text = header(&[state], language);
            let place = |name: &str| text.find(name).unwrap_or_else(|| panic!("no {name} in {text}"));
            assert!(place("Vector3 {") < place("PlantState {") && place("Time {") < place("PlantState {"));
        }
    }
}
