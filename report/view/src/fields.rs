//! The fields of a recording's topics, and messages read for some of them.

use crate::shown::Shown;
use anyhow::{Result, bail};
use recorder::definition::Value;
use recorder::fields::TopicFields;
use recorder::reader::Record;
use recorder::series::ANGLES;
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;

/// Fields that are listed of one topic: an image has a million.
const FIELDS_OF_TOPIC_MAX: usize = 512;
/// Fields that are listed of all topics.
const FIELDS_MAX: usize = 16_384;
/// Fields of one request: the room shows 54 of a vehicle with all sensors and a shadow.
pub const ASKED_MAX: usize = 1024;

/// A requested field of a topic.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Deserialize, Serialize)]
pub struct Asked {
    /// The topic.
    pub topic: String,
    /// Path of a number, such as `position.z`.
    pub field: String,
}

/// A number of the messages of a topic.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Field {
    /// Its path, such as `position.z`.
    pub path: String,
    /// Its unit.
    pub unit: String,
}

/// The fields of the first message of each topic, as far as the recording was read for them.
#[derive(Debug, Default)]
pub struct Listed {
    fields: BTreeMap<String, Vec<Field>>,
    /// Blocks that were searched for first messages.
    blocks: usize,
    /// Number of fields, those of angles left out.
    count: usize,
}

impl Listed {
    /// The fields of a recording.
    ///
    /// # Errors
    /// If the recording is damaged.
    pub fn of(shown: &Shown) -> Result<Self> {
        let mut listed = Self::default();
        listed.update(shown)?;
        Ok(listed)
    }

    /// Fields by their topics.
    #[must_use]
    pub fn fields(&self) -> &BTreeMap<String, Vec<Field>> {
        &self.fields
    }

    /// Lists the topics that had no message before, in the blocks that were added since.
    ///
    /// # Errors
    /// If one of these blocks is damaged.
    pub fn update(&mut self, shown: &Shown) -> Result<()> {
        let topics = shown.recording().topics().iter();
        let with_messages =
            topics.filter(|(_, topic)| topic.message_count > 0).map(|(name, _)| name.as_str());
        let mut missing: BTreeSet<&str> =
            with_messages.filter(|name| !self.fields.contains_key(*name)).collect();
        for block in self.blocks..shown.block_count() {
            if missing.is_empty() {
                break;
            }
            // A topic may begin an hour behind the others.
            if !shown.may_have(block, missing.iter().copied()) {
                continue;
            }
            for record in shown.messages(block) {
                let record = record?;
                if missing.remove(record.topic.as_str()) {
                    self.add(shown, record);
                }
            }
        }
        self.blocks = shown.block_count();
        Ok(())
    }

    fn add(&mut self, shown: &Shown, record: Record) {
        // A message that does not fit its definition has no field that could be shown.
        let leaves = shown.recording().decode(&record).unwrap_or_default();
        let numbers = leaves.into_iter().filter(|leaf| !matches!(leaf.value, Value::Text(_)));
        let listed = numbers.take(FIELDS_OF_TOPIC_MAX.min(FIELDS_MAX - self.count));
        let listed: Vec<_> = listed.map(|leaf| Field { path: leaf.path, unit: leaf.unit }).collect();
        self.count += listed.len();
        self.fields.insert(record.topic, with_angles(listed));
    }
}

/// The fields with the angles of each quaternion behind it.
fn with_angles(fields: Vec<Field>) -> Vec<Field> {
    let quaternion = |field: &Field| {
        let whole = field.path.strip_suffix(".w")?.to_owned();
        let has = |part: &str| fields.iter().any(|other| other.path == format!("{whole}.{part}"));
        ["x", "y", "z"].iter().all(|part| has(part)).then_some(whole)
    };
    let behind = |field: &Field| -> Vec<Field> {
        let Some(whole) = quaternion(field) else { return Vec::new() };
        let angle = |name: &&str| Field { path: format!("{whole}.{name}"), unit: "rad".to_owned() };
        ANGLES.iter().map(angle).collect()
    };
    fields.iter().flat_map(|field| [vec![field.clone()], behind(field)].concat()).collect()
}

/// Reads fields of topics, message by message.
pub struct Columns {
    groups: Vec<Group>,
    count: usize,
    /// Values of the message that is read.
    values: Vec<(usize, f64)>,
}

/// The asked fields of one topic.
struct Group {
    fields: TopicFields,
    /// Number in the request, and number in `fields`.
    columns: Vec<(usize, usize)>,
}

/// The values of one message.
pub struct Sample<'a> {
    /// Number of the topic among those of the request.
    pub group: usize,
    /// Time since the first message, in ns.
    pub time_ns: u64,
    /// Numbers of the fields in the request, and their values; NaN where the message has no such field.
    pub values: &'a [(usize, f64)],
}

impl Columns {
    /// The fields that are `asked` for.
    ///
    /// # Errors
    /// If a topic is not in the recording, or too many fields are requested.
    pub fn new(shown: &Shown, asked: &[Asked]) -> Result<Self> {
        if asked.len() > ASKED_MAX {
            bail!("{} fields are asked for, expected at most {ASKED_MAX}", asked.len());
        }
        let mut by_topic: BTreeMap<&str, Vec<(usize, &str)>> = BTreeMap::new();
        for (number, Asked { topic, field }) in asked.iter().enumerate() {
            by_topic.entry(topic).or_default().push((number, field));
        }
        let group = |(topic, asked): (&str, Vec<(usize, &str)>)| {
            let mut fields = shown.recording().fields_of(topic)?;
            let columns = asked.into_iter().map(|(number, field)| (number, fields.add(field))).collect();
            Ok(Group { fields, columns })
        };
        let groups = by_topic.into_iter().map(group).collect::<Result<_>>()?;
        Ok(Self { groups, count: asked.len(), values: Vec::new() })
    }

    /// Number of fields.
    #[must_use]
    pub fn count(&self) -> usize {
        self.count
    }

    /// Number of topics.
    #[must_use]
    pub fn group_count(&self) -> usize {
        self.groups.len()
    }

    /// The topic with this number, and the numbers of its fields in the request.
    pub fn group(&self, group: usize) -> (&str, impl Iterator<Item = usize>) {
        let Group { fields, columns } = &self.groups[group];
        (fields.topic(), columns.iter().map(|(number, _)| *number))
    }

    /// Calls `visit` with the samples of these blocks, in the order of the file.
    ///
    /// # Errors
    /// If the recording is damaged.
    pub fn read(
        &mut self,
        shown: &Shown,
        blocks: Range<usize>,
        visit: &mut dyn FnMut(Sample<'_>),
    ) -> Result<()> {
        for record in blocks.flat_map(|block| shown.messages(block)) {
            self.read_message(&record?, visit);
        }
        Ok(())
    }

    /// Calls `visit` with the sample of one message, if it is of a requested topic.
    pub fn read_message(&mut self, record: &Record, visit: &mut dyn FnMut(Sample<'_>)) {
        let is_of = |group: &Group| group.fields.topic() == record.topic;
        let Some(group) = self.groups.iter().position(is_of) else { return };
        let Group { fields, columns } = &mut self.groups[group];
        let is_read = fields.read(&record.cdr).is_ok();
        self.values.clear();
        self.values.extend(columns.iter().map(|&(number, field)| {
            let value = fields.values(field).first().filter(|_| is_read);
            (number, value.copied().unwrap_or(f64::NAN))
        }));
        visit(Sample { group, time_ns: record.time_ns, values: &self.values });
    }
}
