//! Fields of one topic, read from message after message without decoding the others.

use crate::definition::{Definition, Layout, Place, body};
use crate::error::RecordingError;
use crate::reader::Recording;
use crate::series::{Made, Series, parts};
use bus::announcement::Announcement;
use bus::schema::Extent;

/// Fields of one topic and their newest values.
///
/// The first message gives the places of the fields in its bytes. Reading further messages of the same layout does
/// not allocate.
///
/// ```
/// use bus::Message;
/// use bus::announcement::Announcement;
/// use bus::messages::PlantState;
/// use recorder::fields::TopicFields;
///
/// let mut fields = TopicFields::announced("/plant/state", &Announcement::of(PlantState::SCHEMA))?;
/// let [height, position] = ["position.z", "position"].map(|field| fields.add(field));
/// let state = PlantState { position: [1.0, 2.0, 3.0].into(), ..Default::default() };
/// fields.read(&[&[0, 1, 0, 0], bytemuck::bytes_of(&state)].concat())?;
/// assert_eq!((fields.values(height), fields.values(position)), (&[3.0][..], &[1.0, 2.0, 3.0][..]));
/// assert_eq!(fields.unit(height), "m");
/// # Ok::<(), recorder::RecordingError>(())
/// ```
#[derive(Clone, Debug)]
pub struct TopicFields {
    topic: String,
    type_name: String,
    definition: Definition,
    /// The part of a sample that counts; absent where it is all of it, as in a recording.
    extent: Option<Extent>,
    fields: Vec<Field>,
    layout: Option<Layout>,
}

/// A field, which is one number or a vector.
#[derive(Clone, Debug)]
struct Field {
    path: String,
    unit: String,
    parts: Vec<Made<Place>>,
    values: Vec<f64>,
}

impl TopicFields {
    /// An empty set of fields of `topic`, whose messages are as in `announcement`.
    ///
    /// # Errors
    /// If its definition is not understood.
    pub fn announced(topic: &str, announcement: &Announcement) -> Result<Self, RecordingError> {
        let type_name = announcement.type_name.clone();
        let definition = Definition::parse(&type_name, &announcement.definition);
        let definition = definition.map_err(|reason| RecordingError::Decode {
            topic: topic.to_owned(),
            type_name: type_name.clone(),
            reason: reason.into(),
        })?;
        Ok(Self { extent: announcement.extent, ..Self::of(topic, type_name, definition) })
    }

    fn of(topic: &str, type_name: String, definition: Definition) -> Self {
        Self {
            topic: topic.to_owned(),
            type_name,
            definition,
            extent: None,
            fields: Vec::new(),
            layout: None,
        }
    }

    /// The topic.
    #[must_use]
    pub fn topic(&self) -> &str {
        &self.topic
    }

    /// Adds the field at `path`; returns its number. One that is there already is not added again.
    pub fn add(&mut self, path: &str) -> usize {
        self.fields.iter().position(|field| field.path == path).unwrap_or_else(|| {
            let (path, unit) = (path.to_owned(), String::new());
            self.fields.push(Field { path, unit, parts: Vec::new(), values: Vec::new() });
            self.layout = None;
            self.fields.len() - 1
        })
    }

    /// Reads all fields of the message `cdr`.
    ///
    /// # Errors
    /// If it does not fit its definition, or has no such field.
    pub fn read(&mut self, cdr: &[u8]) -> Result<(), RecordingError> {
        let cdr = self.extent.map_or(cdr, |extent| extent.of_cdr(cdr));
        let body = body(cdr).map_err(|reason| self.undecoded(reason))?;
        if !self.layout.as_ref().is_some_and(|layout| layout.is_of(body)) {
            self.find(cdr)?;
        }
        for field in &mut self.fields {
            for (value, part) in field.values.iter_mut().zip(&field.parts) {
                // The layout is that of this body: every place is in it.
                *value = part.value(|place| place.read(body)).unwrap_or(f64::NAN);
            }
        }
        Ok(())
    }

    /// The newest values of field number `field`: one, three of a vector, none before the first message.
    #[must_use]
    pub fn values(&self, field: usize) -> &[f64] {
        &self.fields[field].values
    }

    /// The unit of field number `field`; empty before the first message.
    #[must_use]
    pub fn unit(&self, field: usize) -> &str {
        &self.fields[field].unit
    }

    /// Finds the places of all fields in the message `cdr`.
    fn find(&mut self, cdr: &[u8]) -> Result<(), RecordingError> {
        let decoded = self.definition.decode_with_layout(cdr);
        let (leaves, layout) = decoded.map_err(|reason| self.undecoded(reason))?;
        for field in &mut self.fields {
            let unknown = || RecordingError::unknown_field(&self.topic, &field.path, &leaves);
            let names = parts(&leaves, &self.topic, &field.path)?;
            let made: Option<Vec<_>> = names.iter().map(|name| Made::of(&leaves, name)).collect();
            let made = made.ok_or_else(unknown)?;
            let places: Option<Vec<_>> =
                made.iter().map(|made| made.map(|&leaf| layout.places[leaf])).collect();
            field.parts = places.ok_or_else(unknown)?;
            field.values = vec![f64::NAN; field.parts.len()];
            field.unit = made.first().map_or(String::new(), |made| made.unit(&leaves).to_owned());
        }
        self.layout = Some(layout);
        Ok(())
    }

    fn undecoded(&self, reason: crate::definition::DecodeError) -> RecordingError {
        RecordingError::Decode { topic: self.topic.clone(), type_name: self.type_name.clone(), reason }
    }
}

impl Recording {
    /// An empty set of fields of `topic`, to be read from its messages.
    ///
    /// # Errors
    /// If there is no such topic; the error lists those there are.
    pub fn fields_of(&self, topic: &str) -> Result<TopicFields, RecordingError> {
        let found = self.topic(topic)?;
        Ok(TopicFields::of(topic, found.type_name.clone(), found.definition().clone()))
    }

    /// The values of `fields`, given as topic and field path: a series each, read in one pass.
    ///
    /// ```no_run
    /// use recorder::reader::Recording;
    ///
    /// let recording = Recording::open("hover.mcap".as_ref())?;
    /// let series = recording.series(&[("/plant/state", "position.z"), ("/plant/state", "attitude.yaw")])?;
    /// let highest_m = series[0].value.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    /// assert!(highest_m < 1.7);
    /// # Ok::<(), recorder::RecordingError>(())
    /// ```
    ///
    /// # Errors
    /// If there is no such topic or field, or the file is damaged.
    pub fn series(&self, fields: &[(&str, &str)]) -> Result<Vec<Series>, RecordingError> {
        let mut topics: Vec<TopicFields> = Vec::new();
        // The topic of each field, and its number there.
        let mut places = Vec::new();
        for (topic, field) in fields {
            let known = topics.iter().position(|of| of.topic() == *topic);
            let place = known.unwrap_or(topics.len());
            if known.is_none() {
                topics.push(self.fields_of(topic)?);
            }
            places.push((place, topics[place].add(field)));
        }
        let mut series = vec![Series::default(); fields.len()];
        self.visit::<RecordingError>(|message| {
            let wanted = topics.iter().position(|of| of.topic() == message.topic);
            let Some(wanted) = wanted else { return Ok(()) };
            let of = &mut topics[wanted];
            of.read(message.cdr)?;
            for (index, (_, number)) in places.iter().enumerate().filter(|(_, (place, _))| *place == wanted) {
                let &[value] = of.values(*number) else {
                    let leaves = self.decode_on(message.topic, message.cdr)?;
                    return Err(RecordingError::unknown_field(message.topic, fields[index].1, &leaves));
                };
                let series = &mut series[index];
                series.time_ns.push(message.time_ns);
                series.value.push(value);
                of.unit(*number).clone_into(&mut series.unit);
            }
            Ok(())
        })?;
        Ok(series)
    }
}

#[cfg(test)]
mod tests {
    use super::TopicFields;
    use crate::definition::Definition;
    use crate::reader::Recording;
    use crate::writer::RecordingWriter;
    use bus::Message;
    use bus::announcement::Announcement;
    use bus::messages::{MotorCommand, PlantState, PoseStamped, Quaternion};

    fn cdr<T: Message>(message: &T) -> Vec<u8> {
        [&[0, 1, 0, 0], bytemuck::bytes_of(message)].concat()
    }

    /// Angles and components along the body are those that the decoded leaves give.
    #[test]
    fn fields_have_the_values_that_decoding_gives() {
        let announcement = Announcement::of(PlantState::SCHEMA);
        let mut fields = TopicFields::announced("/s", &announcement).unwrap();
        let names = ["velocity.u", "attitude.yaw", "attitude.w", "position.y", "stamp.sec"];
        let numbers = names.map(|name| fields.add(name));
        let definition = Definition::parse(PlantState::SCHEMA.type_name, &announcement.definition).unwrap();
        for turn in [0.0, 0.3, 2.0] {
            let (z, w) = (libm::sin(turn / 2.0), libm::cos(turn / 2.0));
            let state = PlantState {
                attitude: Quaternion { x: 0.0, y: 0.0, z, w },
                velocity: [1.0, 2.0, turn].into(),
                position: [0.0, turn, 0.0].into(),
                ..PlantState::default()
            };
            fields.read(&cdr(&state)).unwrap();
            let leaves = definition.decode(&cdr(&state)).unwrap();
            for (name, number) in names.iter().zip(numbers) {
                let (value, unit) = crate::series::value(&leaves, name).unwrap();
                assert_eq!((fields.values(number), fields.unit(number)), (&[value][..], unit), "{name}");
            }
        }
    }

    /// A sample has room for twelve, and a message of them as many as it says.
    #[test]
    fn a_sample_with_room_for_more_values_is_read_as_the_recording_of_it_is() {
        let announcement = Announcement::of(MotorCommand::SCHEMA);
        let mut fields = TopicFields::announced("/c", &announcement).unwrap();
        let last = fields.add("command[3]");
        let command = [1.0, 2.0, 3.0, 4.5].into();
        fields.read(&cdr(&MotorCommand { command, ..MotorCommand::default() })).unwrap();
        assert_eq!(fields.values(last), [4.5]);
        let command = [1.0].into();
        let error = fields.read(&cdr(&MotorCommand { command, ..MotorCommand::default() })).unwrap_err();
        assert!(error.to_string().contains("command[3]"), "{error}");
    }

    /// A string of another length moves all fields behind it.
    #[test]
    fn messages_of_other_lengths_are_read_where_their_fields_are() {
        let definition = Definition::parse("a/msg/A", "string name\nfloat64 value\n").unwrap();
        let mut fields = TopicFields::of("/a", "a/msg/A".to_owned(), definition);
        let value = fields.add("value");
        let message = |name: &str, value: f64| {
            let mut bytes =
                [&[0, 1, 0, 0][..], &(name.len() as u32 + 1).to_le_bytes(), name.as_bytes(), &[0]].concat();
            bytes.resize((bytes.len() - 4).next_multiple_of(8) + 4, 0);
            [&bytes[..], &value.to_le_bytes()].concat()
        };
        for (name, number) in [("a", 1.0), ("abcdefgh", 2.0), ("abc", 3.0), ("", 4.0)] {
            fields.read(&message(name, number)).unwrap();
            assert_eq!(fields.values(value), [number], "{name}");
        }
        let error = fields.read(&[0, 1, 0, 0, 9]).unwrap_err().to_string();
        assert!(error.contains("topic /a") && error.contains("ends at byte 1"), "{error}");
    }

    #[test]
    fn the_series_of_a_recording_have_the_values_that_were_written() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("climb.mcap");
        let mut writer = RecordingWriter::create(&path).unwrap();
        let state = writer.add_channel("/state", &Announcement::of(PlantState::SCHEMA)).unwrap();
        let command = writer.add_channel("/command", &Announcement::of(MotorCommand::SCHEMA)).unwrap();
        for tick in 0..3 {
            let (time_ns, number) = (u64::from(tick) * 1_000_000, f64::from(tick));
            let climb = PlantState { position: [0.0, 0.0, number].into(), ..PlantState::default() };
            writer.write(state, tick, time_ns, &cdr(&climb)).unwrap();
            let commanded = MotorCommand { command: [number + 7.0; 4].into(), ..MotorCommand::default() };
            writer.write(command, tick, time_ns, &cdr(&commanded)).unwrap();
        }
        writer.finish().unwrap();
        let recording = Recording::open(&path).unwrap();
        let fields = [("/state", "position.z"), ("/command", "command[1]"), ("/state", "position.z")];
        let series = recording.series(&fields).unwrap();
        let [height, speed, again] = &series[..] else { panic!("{series:?}") };
        assert_eq!((&height.value[..], height.unit.as_str()), (&[0.0, 1.0, 2.0][..], "m"));
        assert_eq!(
            (&speed.value[..], &speed.time_ns[..]),
            (&[7.0, 8.0, 9.0][..], &[0, 1_000_000, 2_000_000][..])
        );
        assert_eq!(height, again);
        for field in ["position", "position.q"] {
            let error = recording.series(&[("/command", "command[0]"), ("/state", field)]).unwrap_err();
            let words = error.to_string();
            assert!(words.contains(field) && words.contains("position.z"), "{words}");
        }
    }

    #[test]
    fn a_field_that_is_not_there_or_is_text_is_refused_with_those_there_are() {
        for field in ["pose.position.q", "header.frame_id"] {
            let mut fields = TopicFields::announced("/p", &Announcement::of(PoseStamped::SCHEMA)).unwrap();
            fields.add(field);
            let error = fields.read(&cdr(&PoseStamped::default())).unwrap_err().to_string();
            assert!(error.contains(field) && error.contains("pose.orientation.w"), "{error}");
        }
    }
}
