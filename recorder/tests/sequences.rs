//! Messages that end with a bounded sequence: the recording holds the values that count, and readers show them.

use bus::announcement::Announcement;
use bus::messages::Time;
use bus::{Bounded, Message};
use recorder::reader::Recording;
use recorder::series;
use recorder::writer::RecordingWriter;

/// Voltages of a battery's cells.
#[derive(Clone, Copy, Message)]
#[repr(C)]
#[message(type_name = "test_msgs/msg/Cells")]
struct Cells {
    /// Simulation time.
    stamp: Time,
    /// Voltages.
    #[field(unit = "V")]
    voltage: Bounded<f64, 12>,
}

const TOPIC: &str = "/battery/cells";

/// A recording with one message a tick: its cells.
fn recorded(messages: &[&[f64]]) -> (tempfile::TempDir, Recording) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("cells.mcap");
    let mut writer = RecordingWriter::create(&path).unwrap();
    let channel = writer.add_channel(TOPIC, &Announcement::of(Cells::SCHEMA)).unwrap();
    for (tick, cells) in (0..).zip(messages) {
        let cells = Cells { stamp: Time::default(), voltage: Bounded::of(cells).unwrap() };
        let cdr = [&[0, 1, 0, 0], bytemuck::bytes_of(&cells)].concat();
        writer.write(channel, tick, u64::from(tick), &cdr).unwrap();
    }
    writer.finish().unwrap();
    let recording = Recording::open(&path).unwrap();
    (folder, recording)
}

#[test]
fn a_recording_holds_and_shows_the_values_that_count() {
    let (_folder, recording) = recorded(&[&[3.7, 3.8, 3.9], &[], &[4.0; 12]]);
    let records: Vec<_> = recording.messages().map(Result::unwrap).collect();
    let sizes: Vec<_> = records.iter().map(|record| record.cdr.len() - 4).collect();
    assert_eq!(sizes, [16 + 3 * 8, 12, 16 + 12 * 8]);
    let shown = |record| {
        let leaves = recording.decode(record).unwrap();
        leaves[2..]
            .iter()
            .map(|leaf| format!("{} {} {}", leaf.path, leaf.value, leaf.unit))
            .collect::<Vec<_>>()
    };
    assert_eq!(shown(&records[0]), ["voltage[0] 3.7 V", "voltage[1] 3.8 V", "voltage[2] 3.9 V"]);
    assert!(shown(&records[1]).is_empty());
    assert_eq!(shown(&records[2]).len(), 12);
}

#[test]
fn a_place_that_a_message_may_have_is_known_before_the_run_and_missed_afterwards() {
    let unit = |field| series::unit_of(Cells::SCHEMA, TOPIC, field);
    assert_eq!(unit("voltage[11]").unwrap().as_deref(), Some("V"));
    assert!(unit("voltage[12]").is_err());
    let (_folder, recording) = recorded(&[&[3.7, 3.8]]);
    assert_eq!(recording.series(&[(TOPIC, "voltage[1]")]).unwrap()[0].value, [3.8]);
    let error = recording.series(&[(TOPIC, "voltage[2]")]).unwrap_err().to_string();
    assert!(error.contains("voltage[2]") && error.contains("voltage[1]"), "{error}");
}
