//! Recordings read back and compared.

use recorder::definition::Leaf;
use recorder::reader::Recording;
use std::collections::BTreeMap;
use std::path::Path;

/// A message without its topic.
#[derive(Debug, PartialEq)]
pub struct Message {
    pub tick: u32,
    pub time_ns: u64,
    pub cdr: Vec<u8>,
}

/// The messages of a recording by topic, in the order of the file.
pub type Topics = BTreeMap<String, Vec<Message>>;

#[track_caller]
pub fn open(path: &str) -> Recording {
    Recording::open(Path::new(path)).unwrap_or_else(|error| panic!("{error}"))
}

/// The tick of the first message of a recording.
pub fn first_tick(path: &str) -> u64 {
    open(path).messages().map(|record| u64::from(record.unwrap().tick)).min().unwrap()
}

/// Returns all messages of the recording at `path`.
#[track_caller]
pub fn topics(path: &str) -> Topics {
    let recording = open(path);
    let mut topics: Topics = recording.topics().keys().map(|topic| (topic.clone(), Vec::new())).collect();
    for record in recording.messages().map(Result::unwrap) {
        let message = Message { tick: record.tick, time_ns: record.time_ns, cdr: record.cdr };
        topics.get_mut(&record.topic).unwrap().push(message);
    }
    topics
}

/// A message with its numbers by field path.
#[derive(Clone, Debug)]
pub struct Row {
    pub tick: u32,
    pub time_ns: u64,
    fields: BTreeMap<String, f64>,
}

impl Row {
    /// The number in `field`.
    #[track_caller]
    pub fn get(&self, field: &str) -> f64 {
        *self.fields.get(field).unwrap_or_else(|| panic!("no field {field} in {self:?}"))
    }

    /// The numbers in `vector.x`, `vector.y` and `vector.z`.
    #[track_caller]
    pub fn vector(&self, vector: &str) -> [f64; 3] {
        ["x", "y", "z"].map(|axis| self.get(&format!("{vector}.{axis}")))
    }

    /// The stamp in the message, in nanoseconds.
    pub fn stamp_ns(&self) -> f64 {
        self.get("stamp.sec") * 1e9 + self.get("stamp.nanosec")
    }
}

/// The messages of `topic` in the recording at `path`.
#[track_caller]
pub fn rows(path: &str, topic: &str) -> Vec<Row> {
    let recording = open(path);
    let records = recording.messages().map(Result::unwrap);
    let number = |leaf: Leaf| leaf.value.as_f64().map(|number| (leaf.path, number));
    records
        .filter(|record| record.topic == topic)
        .map(|record| {
            let leaves = recording.decode(&record).unwrap();
            let fields = leaves.into_iter().filter_map(number).collect();
            Row { tick: record.tick, time_ns: record.time_ns, fields }
        })
        .collect()
}

/// Requires that the recording at `path` is the file `expected`, and names the first difference.
#[track_caller]
pub fn require_same(expected: &[u8], path: &str) {
    if std::fs::read(path).unwrap() == expected {
        return;
    }
    let reference = format!("{path}.expected");
    std::fs::write(&reference, expected).unwrap();
    let difference = recorder::diff::first_difference(&open(&reference), &open(path)).unwrap();
    panic!("{path} is another file: {}", difference.unwrap());
}

/// Requires the same messages on the same topics.
#[track_caller]
pub fn require_same_messages(expected: &Topics, found: &Topics) {
    assert_eq!(expected.keys().collect::<Vec<_>>(), found.keys().collect::<Vec<_>>());
    for (topic, expected) in expected {
        let found = &found[topic];
        let differing = expected.iter().zip(found).find(|(a, b)| a != b);
        assert!(differing.is_none(), "{topic}: {differing:?}");
        assert_eq!(expected.len(), found.len(), "messages on {topic}");
    }
}
