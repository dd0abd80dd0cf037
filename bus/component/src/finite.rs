//! Check that the numbers of a message are finite: the numbers are found once, and checked before every sample.

use crate::schema::{Extent, Kind, Primitive, Schema, VALUES_START};

/// Floating-point numbers that lie side by side in a message.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Span {
    /// Bytes from the start of the message.
    offset: usize,
    count: usize,
    is_double: bool,
}

/// Places of the floating-point numbers in a message.
#[derive(Debug)]
pub struct Floats {
    spans: Vec<Span>,
    /// The numbers behind the name that ends a message.
    named: Option<Extent>,
}

impl Floats {
    /// The floating-point numbers of `schema`.
    pub fn of(schema: &Schema) -> Self {
        let named = schema.extent().filter(|extent| extent.tail_bytes > 0);
        let mut floats = Self { spans: Vec::new(), named };
        floats.add_message(schema, 0);
        floats
    }

    fn add_message(&mut self, schema: &Schema, base: usize) {
        for field in schema.fields {
            self.add(&field.kind, base + field.offset);
        }
    }

    /// Adds the numbers of `kind` at `offset`; text and integers add none.
    fn add(&mut self, kind: &Kind, offset: usize) {
        match kind {
            Kind::Primitive(Primitive::F64) => self.add_span(Span { offset, count: 1, is_double: true }),
            Kind::Primitive(Primitive::F32) => self.add_span(Span { offset, count: 1, is_double: false }),
            // The place of named numbers depends on the name.
            Kind::Primitive(_) | Kind::Text | Kind::NamedNumbers(..) => {}
            Kind::Message(inner) => self.add_message(inner, offset),
            // Also the values behind the count, which are zero.
            Kind::Sequence(element, most) => self.add(&Kind::Array(element, *most), offset + VALUES_START),
            Kind::Array(element, length) => {
                for index in 0..*length {
                    self.add(element, offset + index * element.size());
                }
            }
        }
    }

    /// Numbers that touch those before become one span with them: most messages are one or two spans.
    fn add_span(&mut self, span: Span) {
        if let Some(last) = self.spans.last_mut()
            && last.is_double == span.is_double
            && last.offset + last.count * width(last.is_double) == span.offset
        {
            last.count += span.count;
        } else {
            self.spans.push(span);
        }
    }

    /// The first number in the message `bytes` that is not finite: its place in bytes, and its value.
    pub fn first_not_finite(&self, bytes: &[u8]) -> Option<(usize, f64)> {
        let named = || {
            let named = self.named?;
            let place = named.tail_of(bytes);
            let (index, number) = first_in(bytes.get(place.clone())?, named.tail_number_bytes)?;
            Some((place.start + index, number))
        };
        let in_span = |span: &Span| {
            let width = width(span.is_double);
            let (index, number) = first_in(&bytes[span.offset..][..span.count * width], width)?;
            Some((span.offset + index, number))
        };
        self.spans.iter().find_map(in_span).or_else(named)
    }
}

/// The first of `numbers`, of `width` bytes each, that is not finite: its place in bytes, and its value.
fn first_in(numbers: &[u8], width: usize) -> Option<(usize, f64)> {
    let mut numbers = numbers.chunks_exact(width).map(number);
    let index = numbers.clone().position(|number| !number.is_finite())?;
    Some((index * width, numbers.nth(index)?))
}

fn width(is_double: bool) -> usize {
    if is_double { size_of::<f64>() } else { size_of::<f32>() }
}

fn number(bytes: &[u8]) -> f64 {
    match bytes.try_into() {
        Ok(double) => f64::from_le_bytes(double),
        Err(_) => bytes.try_into().map_or(f64::NAN, |single| f64::from(f32::from_le_bytes(single))),
    }
}

/// The field of `schema` at `offset` bytes, such as `position.z` or `command[2]`.
pub fn field_at(schema: &Schema, offset: usize) -> String {
    let field = schema.fields.iter().rev().find(|field| field.offset <= offset);
    field.map_or_else(String::new, |field| {
        format!("{}{}", field.name, within(&field.kind, offset - field.offset))
    })
}

fn within(kind: &Kind, offset: usize) -> String {
    match kind {
        Kind::Message(inner) => format!(".{}", field_at(inner, offset)),
        Kind::Array(element, _) => {
            let size = element.size().max(1);
            format!("[{}]{}", offset / size, within(element, offset % size))
        }
        Kind::Sequence(element, _) => within(&Kind::Array(element, 0), offset.saturating_sub(VALUES_START)),
        Kind::Primitive(_) | Kind::Text | Kind::NamedNumbers(..) => String::new(),
    }
}

#[cfg(test)]
mod tests {
    use super::{Floats, field_at};
    use crate::Message;
    use crate::messages::{MotorCommand, PlantState, Vector3};

    /// Singles behind an odd count of bytes, and messages in an array.
    #[derive(Clone, Copy, Default, crate::Message)]
    #[repr(C)]
    #[message(type_name = "test_msgs/msg/Mixed")]
    struct Mixed {
        #[field(unit = "1")]
        count: u32,
        #[field(unit = "V")]
        voltage: [f32; 3],
        #[field(unit = "m", frame = "world")]
        points: [Vector3; 2],
    }

    fn found<T: Message>(message: &T) -> Option<(String, f64)> {
        let found = Floats::of(T::SCHEMA).first_not_finite(bytemuck::bytes_of(message));
        found.map(|(offset, value)| (field_at(T::SCHEMA, offset), value))
    }

    #[test]
    fn a_number_that_is_not_finite_is_named_by_its_field() {
        let mut state = PlantState::default();
        assert_eq!(found(&state), None);
        state.position.z = f64::INFINITY;
        assert_eq!(found(&state), Some(("position.z".to_owned(), f64::INFINITY)));
        let command = MotorCommand { command: [1.0, 2.0, f64::NAN, 4.0].into(), ..Default::default() };
        let (field, value) = found(&command).unwrap();
        assert!(field == "command[2]" && value.is_nan(), "{field} = {value}");
    }

    #[test]
    fn the_numbers_behind_a_name_are_looked_at_wherever_they_begin() {
        use crate::messages::{BodyTransform, FrameName, LaserScan, Orientation, Point, StandardRange};
        let level = Orientation { w: 1.0, ..Orientation::default() };
        for name in ["b", "seven77", "eight888", "h1/body"] {
            let at = |z: f64| {
                let point = Point { z, ..Point::default() };
                found(&BodyTransform::new(&FrameName::new(name).unwrap(), point, level))
            };
            assert_eq!(at(1.0), None);
            assert_eq!(at(f64::INFINITY), Some(("child".to_owned(), f64::INFINITY)), "{name}");
            let singles = |range: f32| {
                found(&StandardRange::new(&FrameName::new(name).unwrap(), 1, [0.1, 0.2, 7.0, range, 0.0]))
            };
            assert_eq!(singles(1.0), None);
            assert_eq!(singles(f32::INFINITY), Some(("beam".to_owned(), f64::INFINITY)), "{name}");
            let scan = |range: f32| {
                let frame = FrameName::new(name).unwrap();
                found(&LaserScan::new(&frame, 0.1, [0.2, 7.0], [1.0, 1.0, 1.0, range]))
            };
            assert_eq!(scan(1.0), None, "counts are no numbers that could be infinite");
            assert_eq!(scan(f32::INFINITY), Some(("scan".to_owned(), f64::INFINITY)), "{name}");
        }
    }

    #[test]
    fn every_number_of_a_mixed_message_is_looked_at_and_no_integer() {
        // All bits set: as a float this would be a NaN.
        let clean = Mixed { count: u32::MAX, ..Default::default() };
        assert_eq!(found(&clean), None);
        let voltage = [0.0, 0.0, f32::NEG_INFINITY];
        assert_eq!(found(&Mixed { voltage, ..clean }), Some(("voltage[2]".to_owned(), f64::NEG_INFINITY)));
        let mut points = [Vector3::default(); 2];
        points[1].y = f64::INFINITY;
        assert_eq!(found(&Mixed { points, ..clean }), Some(("points[1].y".to_owned(), f64::INFINITY)));
    }
}
