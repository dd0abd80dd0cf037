//! Layout of a CDR message by its ROS 2 message definition (`ros2msg`).

use std::collections::BTreeMap;

/// A definition that is not understood.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum DefinitionError {
    /// Behind a line of `=`, another definition begins with its name.
    #[error("expected `MSG: …`, found {0:?}")]
    Head(String),
    /// A line without a type and a name.
    #[error("not a field: {0:?}")]
    Field(String),
    /// Text between the brackets of an array that is not a length.
    #[error("not an array length: {0:?}")]
    Length(String),
}

/// Bytes that do not fit their definition.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum DecodeError {
    /// The definition is not understood.
    #[error(transparent)]
    Definition(#[from] DefinitionError),
    /// Another encoding.
    #[error("it does not start with the header of little-endian CDR, 00 01 00 00")]
    Header,
    /// A value, by its path, for which there can be no bytes.
    #[error("`{0}`: the definition names more values than the message has bytes")]
    Values(String),
    /// Names that would take memory without bound.
    #[error(
        "the paths and units of its values are longer than {PATH_BYTES_MAX} times the message, or than {NAMES_BYTES_MAX} bytes"
    )]
    Paths,
    /// Values that would take memory without bound.
    #[error("it has more than {VALUES_MAX} values, as images have; name another topic")]
    Large,
    /// A type that the definition names only.
    #[error("type {0} is not defined")]
    Undefined(String),
    /// A type that holds itself, most likely.
    #[error("type {0} stands more than {DEPTH_MAX} messages deep")]
    Depth(String),
    /// Bytes that are missing.
    #[error("it ends at byte {end}, a value of {size} bytes is due at {at}")]
    End {
        /// The length of the body.
        end: usize,
        /// The bytes of the value.
        size: usize,
        /// The byte at which it is due.
        at: usize,
    },
    /// A string, by its length in bytes, that is longer than the rest of the message.
    #[error("a string of {0} bytes does not fit")]
    Text(usize),
}

/// A value of a leaf field.
#[derive(Clone, Debug, PartialEq)]
pub enum Value {
    /// A floating-point number.
    Float(f64),
    /// An integer.
    Integer(i128),
    /// A string.
    Text(String),
}

impl Value {
    /// The value as a number, if it is one.
    #[must_use]
    #[allow(clippy::cast_precision_loss, reason = "plots and statistics need no more than a double")]
    pub fn as_f64(&self) -> Option<f64> {
        match self {
            Self::Float(number) => Some(*number),
            Self::Integer(number) => Some(*number as f64),
            Self::Text(_) => None,
        }
    }
}

impl std::fmt::Display for Value {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Float(number) => write!(f, "{number:?}"),
            Self::Integer(number) => write!(f, "{number}"),
            Self::Text(text) => write!(f, "{text:?}"),
        }
    }
}

/// The number at `path` among `leaves`.
#[must_use]
pub fn number(leaves: &[Leaf], path: &str) -> Option<f64> {
    leaves.iter().find(|leaf| leaf.path == path)?.value.as_f64()
}

/// True for a field that fills a gap of the layout: `pad0`, `pad1`, …
#[must_use]
pub fn is_padding(path: &str) -> bool {
    let name = path.rsplit('.').next().unwrap_or(path);
    let digits = name.split('[').next().and_then(|name| name.strip_prefix("pad"));
    digits.is_some_and(|digits| !digits.is_empty() && digits.bytes().all(|byte| byte.is_ascii_digit()))
}

/// A leaf field of a message.
#[derive(Clone, Debug, PartialEq)]
pub struct Leaf {
    /// Path from the root, such as `position.z` or `command[2]`.
    pub path: String,
    /// Unit from the definition's comment (that of an enclosing field where the leaf has none).
    pub unit: String,
    /// Value.
    pub value: Value,
}

/// The type of a number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Number {
    F64,
    F32,
    I64,
    U64,
    I32,
    U32,
    I16,
    U16,
    I8,
    U8,
}

impl Number {
    /// The number called `base` in a definition.
    fn of(base: &str) -> Option<Self> {
        Some(match base {
            "float64" => Self::F64,
            "float32" => Self::F32,
            "int64" => Self::I64,
            "uint64" => Self::U64,
            "int32" => Self::I32,
            "uint32" => Self::U32,
            "int16" => Self::I16,
            "uint16" => Self::U16,
            "int8" => Self::I8,
            "uint8" | "byte" | "bool" => Self::U8,
            _ => return None,
        })
    }

    /// Bytes of a value.
    fn size(self) -> usize {
        match self {
            Self::F64 | Self::I64 | Self::U64 => 8,
            Self::F32 | Self::I32 | Self::U32 => 4,
            Self::I16 | Self::U16 => 2,
            Self::I8 | Self::U8 => 1,
        }
    }
}

/// Place of a number in the body of a message.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Place {
    at: usize,
    number: Number,
}

impl Place {
    /// The number in `body`; `None` if that ends before it.
    pub(crate) fn read(self, body: &[u8]) -> Option<f64> {
        Cursor { body, at: self.at }.number(self.number).ok()?.as_f64()
    }
}

/// Places of the leaves of one message, which are those of every message with the same lengths in it.
#[derive(Clone, Debug, Default)]
pub(crate) struct Layout {
    /// Place of each leaf; `None` for a string.
    pub(crate) places: Vec<Option<Place>>,
    /// Places of the lengths of strings and sequences, and these lengths.
    lengths: Vec<(Place, u32)>,
    /// Bytes of the body.
    size: usize,
}

impl Layout {
    /// True if `body` has its numbers at these places.
    pub(crate) fn is_of(&self, body: &[u8]) -> bool {
        let has = |(place, length): &(Place, u32)| place.read(body) == Some(f64::from(*length));
        body.len() == self.size && self.lengths.iter().all(has)
    }
}

/// The body of a message in little-endian CDR, behind its encapsulation header.
pub(crate) fn body(cdr: &[u8]) -> Result<&[u8], DecodeError> {
    match cdr.split_first_chunk::<4>() {
        Some((&[0, 1, 0, 0], body)) => Ok(body),
        _ => Err(DecodeError::Header),
    }
}

/// Comment of a field in a definition: `[m/s] in world: velocity of the centre of mass`. A part that it lacks is empty.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Comment {
    /// Unit.
    pub unit: String,
    /// Frame in which a vector is written.
    pub frame: String,
    /// Meaning of the field.
    pub meaning: String,
}

impl Comment {
    fn parse(text: &str) -> Self {
        let text = text.trim();
        let (unit, rest) = text.strip_prefix('[').and_then(|rest| rest.split_once(']')).unwrap_or(("", text));
        let rest = rest.trim();
        // The name of a frame is one word; other text with a colon is part of the meaning.
        let framed = rest.strip_prefix("in ").and_then(|rest| rest.split_once(':'));
        let (frame, meaning) = framed.filter(|(frame, _)| !frame.contains(' ')).unwrap_or(("", rest));
        Self { unit: unit.to_owned(), frame: frame.to_owned(), meaning: meaning.trim().to_owned() }
    }

    /// Takes unit and frame of `inner`, where it has them, and adds its meaning.
    fn narrow(&mut self, inner: &Self) {
        for (part, inner) in [(&mut self.unit, &inner.unit), (&mut self.frame, &inner.frame)] {
            if !inner.is_empty() {
                part.clone_from(inner);
            }
        }
        if !self.meaning.is_empty() && !inner.meaning.is_empty() {
            self.meaning.push(' ');
        }
        self.meaning.push_str(&inner.meaning);
    }
}

#[derive(Clone, Debug)]
struct Field {
    base: String,
    repeat: Repeat,
    name: String,
    comment: Comment,
}

#[derive(Clone, Copy, Debug)]
enum Repeat {
    One,
    Fixed(usize),
    Sequence,
}

/// Greatest depth of messages in messages; ROS 2's own stay below ten.
const DEPTH_MAX: usize = 64;
/// Bytes of the values' paths and units for each byte of the message, which counts as DEPTH_MAX bytes longer.
const PATH_BYTES_MAX: usize = 1024;

/// Bytes that the paths and units of the values of one message may have.
const NAMES_BYTES_MAX: usize = 64 << 20;
/// Values of one message: each takes a hundred times the memory of a byte of an image.
const VALUES_MAX: usize = 1 << 20;

/// A parsed definition.
///
/// ```
/// use recorder::definition::{Definition, Value};
///
/// let definition = Definition::parse("a_msgs/msg/Range", "float32 range  # [m]\nstring name\n")?;
/// let leaves = definition.decode(&[0, 1, 0, 0, 0, 0, 192, 63, 2, 0, 0, 0, b'a', 0])?;
/// assert_eq!((leaves[0].path.as_str(), leaves[0].unit.as_str()), ("range", "m"));
/// assert_eq!((&leaves[0].value, &leaves[1].value), (&Value::Float(1.5), &Value::Text("a".to_owned())));
///
/// let error = Definition::parse("a_msgs/msg/Range", "float32").unwrap_err();
/// assert_eq!(error.to_string(), "not a field: \"float32\"");
/// # Ok::<(), recorder::definition::DecodeError>(())
/// ```
#[derive(Clone, Debug)]
pub struct Definition {
    root: Vec<Field>,
    types: BTreeMap<String, Vec<Field>>,
}

impl Definition {
    /// Parses the text of a `ros2msg` schema of the type `name`, such as `geometry_msgs/msg/Pose`. Constants,
    /// defaults and bounds are ignored. A type without a package is of the package of its definition.
    ///
    /// # Errors
    /// The line that is not understood.
    pub fn parse(name: &str, text: &str) -> Result<Self, DefinitionError> {
        // For each message its name, in two parts and as written, and its fields; the first is the root.
        let mut messages = vec![(String::new(), name, Vec::new())];
        let mut lines = text.lines().map(str::trim_end);
        while let Some(line) = lines.next() {
            let (_, name, fields) = messages.last_mut().expect("there is the root");
            if !is_rule(line) {
                fields.extend(parse_field(line, name.split('/').next().unwrap_or_default())?);
                continue;
            }
            let head = lines.next().unwrap_or_default();
            let next =
                head.strip_prefix("MSG: ").ok_or_else(|| DefinitionError::Head(head.to_owned()))?.trim();
            messages.push((two_part(next), next, Vec::new()));
        }
        let mut messages = messages.into_iter().map(|(name, _, fields)| (name, fields));
        let root = messages.next().map_or(Vec::new(), |(_, fields)| fields);
        Ok(Self { root, types: messages.collect() })
    }

    /// The comment on the field at `path`, such as `position.z`. Unit and frame are those of the innermost field on the way that has them;
    /// the meaning is that of all fields on the way.
    ///
    /// ```
    /// use recorder::definition::Definition;
    ///
    /// let text = "a_msgs/Point[2] corner  # [m] in body: Corners.\n\
    ///             ================\nMSG: a_msgs/Point\nfloat64 x\nfloat64 y  # To the left.\n";
    /// let definition = Definition::parse("a_msgs/msg/Plate", text)?;
    /// let corner = definition.about("corner[1].y");
    /// assert_eq!((&*corner.unit, &*corner.frame, &*corner.meaning), ("m", "body", "Corners. To the left."));
    /// # Ok::<(), recorder::definition::DefinitionError>(())
    /// ```
    #[must_use]
    pub fn about(&self, path: &str) -> Comment {
        let (mut fields, mut about) = (&self.root[..], Comment::default());
        for part in path.split('.') {
            let name = part.split('[').next().unwrap_or(part);
            let Some(field) = fields.iter().find(|field| field.name == name) else { break };
            about.narrow(&field.comment);
            fields = self.types.get(&field.base).map_or(&[][..], Vec::as_slice);
        }
        about
    }

    /// Decodes a message: its encapsulation header and body.
    ///
    /// # Errors
    /// If the bytes do not fit the definition.
    pub fn decode(&self, cdr: &[u8]) -> Result<Vec<Leaf>, DecodeError> {
        self.decode_with_layout(cdr).map(|(leaves, _)| leaves)
    }

    /// Decodes a message, and returns the places of its leaves.
    ///
    /// # Errors
    /// As [`Definition::decode`].
    pub(crate) fn decode_with_layout(&self, cdr: &[u8]) -> Result<(Vec<Leaf>, Layout), DecodeError> {
        let body = body(cdr)?;
        let mut walk = Walk {
            definition: self,
            cdr: Cursor { body, at: 0 },
            leaves: Vec::new(),
            layout: Layout { size: body.len(), ..Layout::default() },
            depth: 0,
            values_left: DEPTH_MAX.saturating_mul(body.len() + 1),
            path_bytes_left: PATH_BYTES_MAX.saturating_mul(body.len() + DEPTH_MAX).min(NAMES_BYTES_MAX),
        };
        walk.message(&self.root, "", "")?;
        Ok((walk.leaves, walk.layout))
    }
}

/// True if a line separates two definitions.
fn is_rule(line: &str) -> bool {
    line.len() > 8 && line.bytes().all(|byte| byte == b'=')
}

/// Types that are not messages.
const PRIMITIVES: [&str; 15] = [
    "bool", "byte", "char", "float32", "float64", "int8", "uint8", "int16", "uint16", "int32", "uint32",
    "int64", "uint64", "string", "wstring",
];

/// The field in a line of a message of `package`, with its comment; `None` if the line is a constant or
/// empty.
fn parse_field(line: &str, package: &str) -> Result<Option<Field>, DefinitionError> {
    let (code, comment) = line.split_once('#').unwrap_or((line, ""));
    let code = code.trim();
    if code.is_empty() {
        return Ok(None);
    }
    let (kind, rest) =
        code.split_once(char::is_whitespace).ok_or_else(|| DefinitionError::Field(code.to_owned()))?;
    if rest.contains('=') {
        return Ok(None);
    }
    let name = rest.split_whitespace().next().unwrap_or_default().to_owned();
    let (base, repeat) = match kind.strip_suffix(']').and_then(|kind| kind.split_once('[')) {
        None => (kind, Repeat::One),
        Some((base, length)) if length.is_empty() || length.starts_with("<=") => (base, Repeat::Sequence),
        Some((base, length)) => {
            let length = length.parse().map_err(|_| DefinitionError::Length(length.to_owned()))?;
            (base, Repeat::Fixed(length))
        }
    };
    let comment = Comment::parse(comment);
    Ok(Some(Field { base: whole_name(base, package), repeat, name, comment }))
}

/// The type without a bound, and with its package.
fn whole_name(base: &str, package: &str) -> String {
    match base.split_once("<=").map_or(base, |(base, _)| base) {
        "char" => "uint8".to_owned(),
        "Header" => "std_msgs/Header".to_owned(),
        base if PRIMITIVES.contains(&base) => base.to_owned(),
        base if base.contains('/') => two_part(base),
        base => format!("{package}/{base}"),
    }
}

/// `package/Type` of `package/msg/Type`.
fn two_part(name: &str) -> String {
    name.replace("/msg/", "/")
}

struct Walk<'a> {
    definition: &'a Definition,
    cdr: Cursor<'a>,
    leaves: Vec<Leaf>,
    layout: Layout,
    depth: usize,
    /// Values that are still read. A value takes a byte at least or holds one that does, so that only messages
    /// without fields use this up: repeated, they would be read for ever.
    values_left: usize,
    /// Bytes that the paths of further values may have: names of any length, once for each value, would take memory
    /// without bound.
    path_bytes_left: usize,
}

impl Walk<'_> {
    fn message(&mut self, fields: &[Field], prefix: &str, unit: &str) -> Result<(), DecodeError> {
        for field in fields {
            let unit = if field.comment.unit.is_empty() { unit } else { &field.comment.unit };
            let path =
                if prefix.is_empty() { field.name.clone() } else { format!("{prefix}.{}", field.name) };
            let length = match field.repeat {
                Repeat::One => {
                    self.value(&field.base, path, unit)?;
                    continue;
                }
                Repeat::Fixed(length) => length,
                Repeat::Sequence => self.length()?,
            };
            (0..length).try_for_each(|index| self.value(&field.base, format!("{path}[{index}]"), unit))?;
        }
        Ok(())
    }

    fn value(&mut self, base: &str, path: String, unit: &str) -> Result<(), DecodeError> {
        self.values_left =
            self.values_left.checked_sub(1).ok_or_else(|| DecodeError::Values(path.clone()))?;
        let names = path.len() + unit.len();
        self.path_bytes_left = self.path_bytes_left.checked_sub(names).ok_or(DecodeError::Paths)?;
        if self.leaves.len() == VALUES_MAX {
            return Err(DecodeError::Large);
        }
        let (value, place) = match Number::of(base) {
            Some(number) => {
                let value = self.cdr.number(number)?;
                (value, Some(Place { at: self.cdr.at - number.size(), number }))
            }
            None if base == "string" => {
                let length = self.length()?;
                (Value::Text(self.cdr.text(length)?), None)
            }
            None => {
                let definition = self.definition;
                let fields =
                    definition.types.get(base).ok_or_else(|| DecodeError::Undefined(base.to_owned()))?;
                if self.depth == DEPTH_MAX {
                    return Err(DecodeError::Depth(base.to_owned()));
                }
                self.depth += 1;
                let read = self.message(fields, &path, unit);
                self.depth -= 1;
                return read;
            }
        };
        self.leaves.push(Leaf { path, unit: unit.to_owned(), value });
        self.layout.places.push(place);
        Ok(())
    }

    /// The length of a string or a sequence.
    fn length(&mut self) -> Result<usize, DecodeError> {
        let length = u32::from_le_bytes(self.cdr.take()?);
        let number = Number::U32;
        self.layout.lengths.push((Place { at: self.cdr.at - number.size(), number }, length));
        Ok(length as usize)
    }
}

/// A place in the body of a CDR message.
struct Cursor<'a> {
    body: &'a [u8],
    at: usize,
}

impl Cursor<'_> {
    /// The next `N` bytes; XCDR1 aligns every primitive to its size, counted from the start of the body.
    fn take<const N: usize>(&mut self) -> Result<[u8; N], DecodeError> {
        let start = self.at.next_multiple_of(N);
        let bytes = self.body.get(start..start + N).and_then(|bytes| bytes.try_into().ok());
        self.at = start + N;
        bytes.ok_or(DecodeError::End { end: self.body.len(), size: N, at: start })
    }

    fn number(&mut self, number: Number) -> Result<Value, DecodeError> {
        Ok(match number {
            Number::F64 => Value::Float(f64::from_le_bytes(self.take()?)),
            Number::F32 => Value::Float(f32::from_le_bytes(self.take()?).into()),
            Number::I64 => Value::Integer(i64::from_le_bytes(self.take()?).into()),
            Number::U64 => Value::Integer(u64::from_le_bytes(self.take()?).into()),
            Number::I32 => Value::Integer(i32::from_le_bytes(self.take()?).into()),
            Number::U32 => Value::Integer(u32::from_le_bytes(self.take()?).into()),
            Number::I16 => Value::Integer(i16::from_le_bytes(self.take()?).into()),
            Number::U16 => Value::Integer(u16::from_le_bytes(self.take()?).into()),
            Number::I8 => Value::Integer(i8::from_le_bytes(self.take()?).into()),
            Number::U8 => Value::Integer(u8::from_le_bytes(self.take()?).into()),
        })
    }

    fn text(&mut self, length: usize) -> Result<String, DecodeError> {
        let bytes = self.body.get(self.at..self.at + length);
        self.at += length;
        let bytes = bytes.ok_or(DecodeError::Text(length))?;
        Ok(String::from_utf8_lossy(bytes.strip_suffix(&[0]).unwrap_or(bytes)).into_owned())
    }
}

#[cfg(test)]
mod tests {
    use super::{Comment, Definition, Value, is_padding};
    use bus::Message;
    use bus::messages::{
        BodyTransform, FrameName, LaserScan, MotorCommand, Odometry, Orientation, Point, PoseStamped,
        StandardImu, StandardRange, Time, Vector3,
    };
    use std::collections::BTreeMap;

    fn cdr<T: Message>(message: &T) -> Vec<u8> {
        [&[0, 1, 0, 0], bytemuck::bytes_of(message)].concat()
    }

    #[test]
    fn a_comment_has_unit_frame_and_meaning_and_may_lack_each() {
        let parts = |text: &str| {
            let Comment { unit, frame, meaning } = Comment::parse(text);
            [unit, frame, meaning]
        };
        assert_eq!(parts(" [m/s] in world: velocity of the body"), ["m/s", "world", "velocity of the body"]);
        assert_eq!(parts(" [1]"), ["1", "", ""]);
        assert_eq!(parts(" in body: force"), ["", "body", "force"]);
        assert_eq!(parts("in units of the sensor: counts"), ["", "", "in units of the sensor: counts"]);
        let schema = MotorCommand::SCHEMA;
        let definition = Definition::parse(schema.type_name, &schema.ros2_definition()).unwrap();
        assert_eq!(definition.about("command[3]").unit, "count");
        assert_eq!(definition.about("none"), Comment::default());
    }

    #[test]
    fn padding_is_known_by_its_name() {
        assert!(is_padding("pad0") && is_padding("status.pad12") && is_padding("pad0[3]"));
        assert!(!is_padding("pad") && !is_padding("padding") && !is_padding("pad0.x"));
    }

    #[test]
    fn a_message_decodes_to_its_fields() {
        let definition =
            Definition::parse(MotorCommand::SCHEMA.type_name, &MotorCommand::SCHEMA.ros2_definition())
                .unwrap();
        let message =
            MotorCommand { stamp: Time { sec: 3, nanosec: 4 }, command: [1.0, 2.0, 3.0, 4.5].into() };
        let leaves = definition.decode(&cdr(&message)).unwrap();
        let paths: Vec<_> = leaves.iter().map(|leaf| leaf.path.as_str()).collect();
        assert_eq!(paths[..3], ["stamp.sec", "stamp.nanosec", "command[0]"]);
        assert_eq!(leaves[5].value, Value::Float(4.5));
        assert_eq!(leaves[5].unit, "count");
    }

    #[test]
    fn strings_and_sequences_of_standard_messages_decode() {
        let definition =
            Definition::parse(PoseStamped::SCHEMA.type_name, &PoseStamped::SCHEMA.ros2_definition()).unwrap();
        let leaves = definition.decode(&cdr(&PoseStamped::default())).unwrap();
        assert_eq!(leaves[2].value, Value::Text("map".to_owned()));
        assert_eq!(leaves.last().unwrap().path, "pose.orientation.w");
        let definition =
            Definition::parse(BodyTransform::SCHEMA.type_name, &BodyTransform::SCHEMA.ros2_definition())
                .unwrap();
        for name in ["hb_body", "v0/body", "a-vehicle-with-a-long-name/body"] {
            let (frame, at) = (FrameName::new(name).unwrap(), Point { x: 1.0, y: 2.0, z: 3.0 });
            let leaves =
                definition.decode(&cdr(&BodyTransform::new(&frame, at, Orientation::default()))).unwrap();
            assert_eq!((&leaves[3].value, leaves.len()), (&Value::Text(name.to_owned()), 11));
            assert_eq!(leaves[6].value, Value::Float(3.0));
        }
    }

    #[test]
    fn standard_messages_of_frames_with_names_of_any_length_decode() {
        let (ahead, level) = (Vector3 { x: 5.0, ..Vector3::default() }, Orientation::default());
        for name in ["h", "hb_body", "h1/range/down", "a-vehicle-with-a-long-name/body"] {
            let frame = FrameName::new(name).unwrap();
            let imu = decoded(&StandardImu::new(&frame, Vector3::default(), 1e-6, ahead, 4e-6));
            assert_eq!(imu["header.frame_id"], Value::Text(name.to_owned()));
            assert_eq!(imu["orientation_covariance[0]"], Value::Float(-1.0));
            assert_eq!(imu["linear_acceleration.x"], Value::Float(5.0));
            assert_eq!(imu["linear_acceleration_covariance[8]"], Value::Float(4e-6));
            let odometry = decoded(&Odometry::new(&frame, Point::default(), level, ahead, ahead));
            assert_eq!(odometry["header.frame_id"], Value::Text("map".to_owned()));
            assert_eq!(odometry["child_frame_id"], Value::Text(name.to_owned()));
            assert_eq!(odometry["twist.twist.linear.x"], Value::Float(5.0));
            assert_eq!(odometry["twist.covariance[35]"], Value::Float(0.0));
            let range = decoded(&StandardRange::new(&frame, 1, [0.25, 0.5, 7.5, 1.5, 0.125]));
            assert_eq!(range["header.frame_id"], Value::Text(name.to_owned()));
            assert_eq!(range["radiation_type"], Value::Integer(1));
            assert_eq!(range["range"], Value::Float(1.5));
            assert_eq!((&range["variance"], range.len()), (&Value::Float(0.125), 9));
            let scan = decoded(&LaserScan::new(&frame, 0.5, [0.25, 7.5], [7.0, 4.0, 3.0, 15.0]));
            assert_eq!(scan["header.frame_id"], Value::Text(name.to_owned()));
            assert_eq!((&scan["ranges[3]"], &scan["range_max"]), (&Value::Float(15.0), &Value::Float(7.5)));
            assert_eq!((&scan["scan_time"], scan.len()), (&Value::Float(0.5), 3 + 7 + 4));
        }
    }

    /// The fields of a message, read by its own definition from the bytes that are recorded.
    fn decoded<T: Message>(message: &T) -> BTreeMap<String, Value> {
        let definition = Definition::parse(T::SCHEMA.type_name, &T::SCHEMA.ros2_definition()).unwrap();
        let leaves = definition.decode(T::SCHEMA.extent().unwrap().of_cdr(&cdr(message))).unwrap();
        leaves.into_iter().map(|leaf| (leaf.path, leaf.value)).collect()
    }

    #[test]
    fn a_short_message_is_an_error() {
        let definition =
            Definition::parse(MotorCommand::SCHEMA.type_name, &MotorCommand::SCHEMA.ros2_definition())
                .unwrap();
        let message = MotorCommand { command: [1.0; 4].into(), ..MotorCommand::default() };
        let error = definition.decode(&cdr(&message)[..20]).unwrap_err();
        assert!(error.to_string().contains("a value of 8 bytes is due at 16"), "{error}");
    }

    #[test]
    fn constants_defaults_bounds_and_short_names_are_read() {
        let text = "Header header\nuint8 STATUS_FULL = 4 # full\nPose[<=3] poses\nstring<=8 name \"x\"\n\
                    float32 voltage  # [V]\n========================================\nMSG: std_msgs/msg/Header\n\
                    builtin_interfaces/Time stamp\n========================================\n\
                    MSG: builtin_interfaces/msg/Time\nint32 sec\nuint32 nanosec\n\
                    ========================================\nMSG: geometry_msgs/Pose\nchar x\n";
        let definition = Definition::parse("geometry_msgs/msg/Poses", text).unwrap();
        let body = [1, 0, 0, 0, 2, 0, 0, 0, 2, 0, 0, 0, 7, 8, 0, 0, 2, 0, 0, 0, b'a', 0, 0, 0, 0, 0, 128, 63];
        let leaves = definition.decode(&[&[0, 1, 0, 0], &body[..]].concat()).unwrap();
        let found: Vec<_> = leaves.iter().map(|leaf| (leaf.path.as_str(), leaf.value.clone())).collect();
        let expected = [
            ("header.stamp.sec", Value::Integer(1)),
            ("header.stamp.nanosec", Value::Integer(2)),
            ("poses[0].x", Value::Integer(7)),
            ("poses[1].x", Value::Integer(8)),
            ("name", Value::Text("a".to_owned())),
            ("voltage", Value::Float(1.0)),
        ];
        assert_eq!(found, expected);
        assert_eq!(leaves[5].unit, "V");
    }
}
