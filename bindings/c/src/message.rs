//! Messages as a C program describes them: a table of fields, made by `hummingbus schema --c` or by hand.

use crate::guard;
use bus::dynamic::{FieldDescription, KindDescription, MessageDescription};
use bus::schema::Primitive;
use std::ffi::c_char;

/// Type of a value.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum HbKind {
    /// `double`.
    HbF64 = 0,
    /// `float`.
    HbF32 = 1,
    /// `int64_t`.
    HbI64 = 2,
    /// `uint64_t`.
    HbU64 = 3,
    /// `int32_t`.
    HbI32 = 4,
    /// `uint32_t`.
    HbU32 = 5,
    /// `int16_t`.
    HbI16 = 6,
    /// `uint16_t`.
    HbU16 = 7,
    /// `int8_t`.
    HbI8 = 8,
    /// `uint8_t`.
    HbU8 = 9,
    /// Another message.
    HbNested = 10,
}

/// A field of a message. Texts are UTF-8; where there is none, null or empty.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct HbField {
    /// Name, as ROS 2 allows it: small letters, digits, single underscores.
    pub name: *const c_char,
    /// Meaning, in one line.
    pub doc: *const c_char,
    /// Unit of its numbers, `1` where they have none, empty where the enclosing field states it.
    pub unit: *const c_char,
    /// Frame in which it is expressed, empty where it has none.
    pub frame: *const c_char,
    /// Bytes from the start of the message.
    pub offset: usize,
    /// Type of the value, or of each value of an array or a sequence: an `HbKind`.
    pub kind: u32,
    /// Message of a `HbNested`; null otherwise.
    pub message: *const HbMessage,
    /// Values of a fixed array, or its arrays; 0 for a single value.
    pub array: usize,
    /// Values of each array of an array of arrays; 0 otherwise.
    pub inner_array: usize,
    /// The most values of a sequence: `uint32_t` count, `uint32_t` zero, then room for so many; 0 where it is none.
    pub sequence: usize,
}

/// A message: its name, its size and its fields in memory order, without padding. Both ends of a topic have to agree on
/// all of it but the documentation.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct HbMessage {
    /// ROS 2 name of three parts, such as `my_msgs/msg/Battery`.
    pub type_name: *const c_char,
    /// Meaning, in one line.
    pub doc: *const c_char,
    /// Size in bytes.
    pub size: usize,
    /// The fields.
    pub fields: *const HbField,
    /// Their number.
    pub field_count: usize,
}

/// Hash of the layout of a message, which both ends of a topic have to agree on; 0 if it is refused, and `hb_last_error` says
/// why.
///
/// # Safety
/// `message` is a description.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hb_message_layout_hash(message: *const HbMessage) -> u64 {
    // SAFETY: the caller's promise.
    guard::noted(|| Ok(unsafe { described(message) }?.declare_state()?.layout_hash()), 0)
}

/// The most messages within messages: what is deeper holds itself.
const DEPTH_MAX: usize = 16;

/// The description of `message`.
///
/// # Errors
/// A pointer is null, or a text is not UTF-8.
///
/// # Safety
/// `message` is null or points to a message whose pointers are null or valid.
pub(crate) unsafe fn described(message: *const HbMessage) -> Result<MessageDescription, String> {
    // SAFETY: the caller's promise is passed on.
    unsafe { at_depth(message, 0) }
}

/// # Safety
/// As [`described`].
unsafe fn at_depth(message: *const HbMessage, depth: usize) -> Result<MessageDescription, String> {
    // SAFETY: the caller's promise.
    let message = unsafe { message.as_ref() }.ok_or("the description of a message is a null pointer")?;
    if depth > DEPTH_MAX {
        return Err("the description of a message holds itself".to_owned());
    }
    // SAFETY: the caller's promise.
    let type_name = unsafe { guard::text(message.type_name, "type_name") }?.to_owned();
    if message.fields.is_null() {
        return Err(format!("the description of {type_name} has no fields"));
    }
    // SAFETY: the caller's promise: there are as many as the message says.
    let fields = unsafe { std::slice::from_raw_parts(message.fields, message.field_count) };
    // SAFETY: the caller's promise.
    let fields =
        fields.iter().map(|field| unsafe { field_described(field, depth) }).collect::<Result<_, _>>()?;
    // SAFETY: the caller's promise.
    let doc = unsafe { optional_text(message.doc) }?;
    Ok(MessageDescription { type_name, doc, size: message.size, fields })
}

/// # Safety
/// As [`described`].
unsafe fn field_described(field: &HbField, depth: usize) -> Result<FieldDescription, String> {
    // SAFETY: the caller's promise.
    let name = unsafe { guard::text(field.name, "name of a field") }?.to_owned();
    let value = match primitive(field.kind) {
        Some(primitive) => KindDescription::Primitive(primitive),
        None if field.kind == HbKind::HbNested as u32 => {
            // SAFETY: the caller's promise.
            let nested = unsafe { at_depth(field.message, depth + 1) }?;
            KindDescription::Message(Box::new(nested))
        }
        None => {
            return Err(format!(
                "the field `{name}` has the kind {}, expected an HbKind (0 to 10)",
                field.kind
            ));
        }
    };
    let array = |value, length| KindDescription::Array(Box::new(value), length);
    let kind = match (field.array, field.inner_array, field.sequence) {
        (0, 0, 0) => value,
        (length, 0, 0) => array(value, length),
        (0, 0, most) => KindDescription::Sequence(Box::new(value), most),
        (0, ..) => return Err(format!("the field `{name}` has inner arrays and no array")),
        (outer, inner, 0) => array(array(value, inner), outer),
        _ => return Err(format!("the field `{name}` is both an array and a sequence")),
    };
    // SAFETY: the caller's promise.
    unsafe {
        Ok(FieldDescription {
            name,
            doc: optional_text(field.doc)?,
            unit: optional_text(field.unit)?,
            frame: optional_text(field.frame)?,
            offset: field.offset,
            kind,
        })
    }
}

/// # Safety
/// As [`guard::text`].
unsafe fn optional_text(text: *const c_char) -> Result<String, String> {
    if text.is_null() {
        return Ok(String::new());
    }
    // SAFETY: the caller's promise is passed on.
    unsafe { guard::text(text, "text of a message") }.map(str::to_owned)
}

/// The primitive of this `HbKind`; `None` for others.
fn primitive(kind: u32) -> Option<Primitive> {
    const PRIMITIVES: [(HbKind, Primitive); 10] = [
        (HbKind::HbF64, Primitive::F64),
        (HbKind::HbF32, Primitive::F32),
        (HbKind::HbI64, Primitive::I64),
        (HbKind::HbU64, Primitive::U64),
        (HbKind::HbI32, Primitive::I32),
        (HbKind::HbU32, Primitive::U32),
        (HbKind::HbI16, Primitive::I16),
        (HbKind::HbU16, Primitive::U16),
        (HbKind::HbI8, Primitive::I8),
        (HbKind::HbU8, Primitive::U8),
    ];
    PRIMITIVES.into_iter().find(|(known, _)| *known as u32 == kind).map(|(_, primitive)| primitive)
}
