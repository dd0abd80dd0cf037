//! Any content of a recording or a definition is read, or refused with a message. Nothing panics, runs for ever or
//! takes memory without bound.

use bus::Message;
use bus::announcement::Announcement;
use bus::messages::{BodyTransform, Imu, MotorCommand, PlantState, PoseStamped};
use bus::schema::Schema;
use proptest::prelude::*;
use recorder::definition::Definition;
use recorder::diff::first_difference;
use recorder::index::Index;
use recorder::reader::{Messages, Recording};
use recorder::writer::{RecordingWriter, START};
use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;
use std::collections::BTreeMap;
use std::path::Path;
use std::sync::LazyLock;

const SCHEMAS: [&Schema; 5] =
    [BodyTransform::SCHEMA, Imu::SCHEMA, MotorCommand::SCHEMA, PlantState::SCHEMA, PoseStamped::SCHEMA];
/// Bytes that may be held while a file of a few kilobytes is read, for any lengths that it states: its chunks, its
/// messages and the comparison with another. A claim of 4 GiB, or of a chunk of 256 MiB, is far beyond.
const HELD_BYTES_MAX: isize = 2 << 20;

/// Counts the bytes that each thread holds.
struct Counting;

thread_local! {
    static HELD: Cell<isize> = const { Cell::new(0) };
    static HELD_MAX: Cell<isize> = const { Cell::new(0) };
}

fn count(bytes: isize) {
    HELD.set(HELD.get() + bytes);
    HELD_MAX.set(HELD_MAX.get().max(HELD.get()));
}

// SAFETY: every call goes to the system's allocator unchanged.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        count(layout.size().cast_signed());
        // SAFETY: the caller's promise is passed on.
        unsafe { System.alloc(layout) }
    }
    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        count(layout.size().cast_signed());
        // SAFETY: the caller's promise is passed on.
        unsafe { System.alloc_zeroed(layout) }
    }
    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        count(-layout.size().cast_signed());
        // SAFETY: the caller's promise is passed on.
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// A recording of 90 ticks in three chunks.
static WHOLE: LazyLock<Vec<u8>> = LazyLock::new(|| {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("whole.mcap");
    let mut writer = RecordingWriter::create(&path).unwrap();
    writer.attach("run.toml", b"[run]\n").unwrap();
    let channel = writer.add_channel("/controller/command", &Announcement::of(MotorCommand::SCHEMA)).unwrap();
    for tick in 0..90 {
        let message = MotorCommand { command: [f64::from(tick); 4].into(), ..MotorCommand::default() };
        let cdr = [&[0, 1, 0, 0], bytemuck::bytes_of(&message)].concat();
        writer.write(channel, tick, u64::from(tick) * 1_000_000, &cdr).unwrap();
        if tick % 30 == 29 {
            writer.flush().unwrap();
        }
    }
    writer.finish().unwrap();
    std::fs::read(path).unwrap()
});

/// File as other writers make it: no compression, messages beside chunks, metadata, an attachment.
static PLAIN: LazyLock<Vec<u8>> = LazyLock::new(|| {
    let mut file = std::io::Cursor::new(Vec::new());
    let mut writer =
        mcap::WriteOptions::new().compression(None).chunk_size(Some(600)).create(&mut file).unwrap();
    let definition = MotorCommand::SCHEMA.ros2_definition();
    let schema = writer.add_schema(MotorCommand::SCHEMA.type_name, "ros2msg", definition.as_bytes()).unwrap();
    let about = BTreeMap::from([("offered_qos_profiles".to_owned(), "none".to_owned())]);
    let channel_id = writer.add_channel(schema, "/controller/command", "cdr", &about).unwrap();
    for sequence in 0..20 {
        let message = MotorCommand { command: [f64::from(sequence); 4].into(), ..MotorCommand::default() };
        let log_time = u64::from(sequence) * 1_000_000;
        let header = mcap::records::MessageHeader { channel_id, sequence, log_time, publish_time: log_time };
        writer
            .write_to_known_channel(&header, &[&[0, 1, 0, 0], bytemuck::bytes_of(&message)].concat())
            .unwrap();
    }
    let text = std::borrow::Cow::Borrowed(&b"[run]\n"[..]);
    let (name, media_type) = ("run.toml".to_owned(), "application/toml".to_owned());
    writer.attach(&mcap::Attachment { log_time: 0, create_time: 0, name, media_type, data: text }).unwrap();
    writer.write_metadata(&mcap::records::Metadata { name: "about".to_owned(), metadata: about }).unwrap();
    writer.finish().unwrap();
    drop(writer);
    file.into_inner()
});

/// The summary's index of the attachment once more: a file of any size could list it any number of times.
#[test]
fn an_attachment_that_is_listed_twice_is_refused() {
    const ATTACHMENT_INDEX: u8 = 0x0a;
    let mut bytes = PLAIN.clone();
    let number = |bytes: &[u8], at: usize| {
        usize::try_from(u64::from_le_bytes(bytes[at..at + 8].try_into().unwrap())).unwrap()
    };
    let footer = bytes.len() - 8 - 29;
    let mut at = number(&bytes, footer + 9);
    while bytes[at] != ATTACHMENT_INDEX {
        at += 9 + number(&bytes, at + 1);
    }
    let index = bytes[at..at + 9 + number(&bytes, at + 1)].to_vec();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("twice.mcap");
    let attachments = |bytes: &[u8]| {
        std::fs::write(&path, bytes).unwrap();
        Recording::open(&path)
            .and_then(|recording| recording.attachments())
            .map_err(|error| error.to_string())
    };
    assert_eq!(attachments(&bytes).unwrap().len(), 1);
    // Without a checksum of the summary.
    let crc = bytes.len() - 8 - 4;
    bytes[crc..crc + 4].fill(0);
    bytes.splice(at..at, index);
    assert!(
        attachments(&bytes)
            .unwrap_err()
            .to_string()
            .contains("expected an attachment that is not listed yet")
    );
}

/// Reads `bytes` as a recording in every way; returns the number of messages, where it reads.
fn read(bytes: &[u8]) -> Result<Option<usize>, TestCaseError> {
    let folder = tempfile::tempdir().unwrap();
    let file = |name: &str, bytes: &[u8]| {
        let path = folder.path().join(name);
        std::fs::write(&path, bytes).unwrap();
        path
    };
    let (path, whole) = (file("any.mcap", bytes), file("whole.mcap", &WHOLE));
    let before = HELD.get();
    HELD_MAX.set(before);
    let strict = Recording::open(&path);
    let _ = strict.as_ref().map(Recording::attachments);
    let salvaged = Recording::salvage(&path);
    if let (Err(strict), Err(salvaged)) = (&strict, &salvaged) {
        let names_file = |message: &str| message.contains("any.mcap");
        prop_assert!(
            names_file(&strict.to_string()) && names_file(&salvaged.to_string()),
            "{strict}; {salvaged}"
        );
    }
    prop_assert!(strict.is_err() || salvaged.is_ok(), "what opens can be salvaged");
    let count = salvaged.ok().map(|recording| {
        let _ = first_difference(&recording, &Recording::open(&whole).unwrap());
        let _ = (recording.attachments(), by_blocks(&recording));
        let records = recording.messages().map_while(Result::ok);
        records.filter(|record| recording.decode(record).is_ok()).count()
    });
    let held = HELD_MAX.get() - before;
    prop_assert!(held < HELD_BYTES_MAX, "{held} bytes were held");
    Ok(count)
}

/// Reads a recording block by block: the number of messages, where its index can be read.
fn by_blocks(recording: &Recording) -> Option<usize> {
    let index = Index::of(recording).ok()?;
    let of_block = |block: usize| index.messages(recording, block).map_while(Result::ok).count();
    Some((0..index.len()).map(of_block).sum())
}

/// With the index of chunks, and without one: of a file whose end is missing, and of messages beside chunks.
#[test]
fn blocks_have_all_messages_and_a_cut_file_has_the_attachments_in_front_of_them() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("any.mcap");
    let counts = |bytes: &[u8]| {
        std::fs::write(&path, bytes).unwrap();
        let recording = Recording::salvage(&path).unwrap();
        let names = recording.attachments().unwrap().into_iter().map(|(name, _)| name);
        (by_blocks(&recording).unwrap(), recording.messages().count(), names.collect::<Vec<_>>())
    };
    let attached = vec!["run.toml".to_owned()];
    assert_eq!(counts(&WHOLE), (90, 90, attached.clone()));
    assert_eq!(counts(&PLAIN), (20, 20, attached.clone()));
    // Without the magic bytes at its end; PLAIN has its attachment behind the messages.
    assert_eq!(counts(&WHOLE[..WHOLE.len() - 8]), (90, 90, attached));
    assert_eq!(counts(&PLAIN[..PLAIN.len() - 8]), (20, 20, vec![]));
}

/// A finished file whose footer names no summary, as writers may leave it.
#[test]
fn a_finished_file_without_a_summary_is_read_whole() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("plain.mcap");
    let mut bytes = WHOLE.clone();
    let footer = bytes.len() - 8 - 20;
    bytes[footer..footer + 20].fill(0);
    std::fs::write(&path, &bytes).unwrap();
    std::fs::write(folder.path().join("whole.mcap"), &*WHOLE).unwrap();
    let whole = Recording::open(&folder.path().join("whole.mcap")).unwrap();
    for recording in [Recording::open(&path).unwrap(), Recording::salvage(&path).unwrap()] {
        assert_eq!((recording.cut(), recording.messages().count()), (None, 90));
        let counts = |of: &Recording| -> Vec<_> {
            of.topics().iter().map(|(name, topic)| (name.clone(), topic.message_count)).collect()
        };
        assert_eq!(counts(&recording), counts(&whole));
        assert_eq!(recording.attachments().unwrap(), whole.attachments().unwrap());
        assert_eq!(by_blocks(&recording), Some(90));
    }
    // A damaged chunk is an error, as in a file with a summary.
    let frame = bytes.windows(4).position(|window| window == [0x28, 0xb5, 0x2f, 0xfd]).unwrap();
    bytes[frame] ^= 0xff;
    std::fs::write(&path, &bytes).unwrap();
    assert!(Recording::open(&path).is_err());
}

/// Text that looks like a definition.
fn definition() -> impl Strategy<Value = String> {
    let line = prop_oneof![
        6 => r"(float64|uint8|string|T[0-3])(\[[0-9]{0,12}\])? [a-z]{0,3}( +# \[[a-z]{0,2}\]?[ -~]{0,4})?",
        1 => Just(format!("{}\nMSG: T0", "=".repeat(80))),
        1 => Just(format!("{}\nMSG: T1", "=".repeat(80))),
        1 => "[ -~]{0,10}",
    ];
    prop::collection::vec(line, 0..12).prop_map(|lines| lines.join("\n"))
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 1500, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn no_definition_is_a_crash_and_none_reads_for_ever(
        text in prop_oneof![definition().boxed(), "(?s).{0,200}".boxed()],
        body in prop::collection::vec(any::<u8>(), 0..200),
    ) {
        if let Ok(definition) = Definition::parse("a/msg/A", &text) {
            let _ = definition.decode(&body);
            let _ = definition.decode(&[&[0, 1, 0, 0], &body[..]].concat());
        }
    }

    #[test]
    fn no_bytes_are_a_crash_for_the_messages_of_the_bus(
        pick in 0..SCHEMAS.len(),
        body in prop::collection::vec(any::<u8>(), 0..600),
    ) {
        let definition = Definition::parse(SCHEMAS[pick].type_name, &SCHEMAS[pick].ros2_definition()).unwrap();
        let read = definition.decode(&[&[0, 1, 0, 0], &body[..]].concat());
        // Bounds of sequences count for nothing: the bytes of one are those that its count asks for.
        let count = |at: usize| body.get(at..at + 4).map(|bytes| u32::from_le_bytes(bytes.try_into().unwrap()));
        let least = SCHEMAS[pick].extent().map_or(SCHEMAS[pick].size, |extent| match count(extent.count_offset) {
            Some(0) | None => extent.count_offset + 4,
            Some(count) => extent.values_offset + count as usize * extent.value_bytes,
        });
        prop_assert!(SCHEMAS[pick].has_text() || read.is_ok() == (body.len() >= least));
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 300, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn no_bytes_are_a_crash(bytes in prop::collection::vec(any::<u8>(), 0..400), is_mcap in any::<bool>()) {
        let magic = &WHOLE[..8];
        read(&if is_mcap { [magic, &bytes, magic].concat() } else { bytes })?;
    }

    #[test]
    fn no_changed_byte_is_a_crash(
        changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..6),
        cut in prop::option::of(any::<prop::sample::Index>()),
        is_plain in any::<bool>(),
    ) {
        let mut bytes = if is_plain { PLAIN.clone() } else { WHOLE.clone() };
        let whole = bytes.len();
        for (at, byte) in changes {
            let at = at.index(bytes.len());
            bytes[at] = byte;
        }
        bytes.truncate(cut.map_or(usize::MAX, |cut| cut.index(whole)));
        read(&bytes)?;
    }

    #[test]
    fn a_length_of_any_size_is_a_refusal_and_not_an_allocation(
        at in any::<prop::sample::Index>(),
        length in prop_oneof![Just(u64::MAX), Just(u64::MAX / 2), Just(1 << 40), Just(1 << 28), any::<u64>()],
        is_cut in any::<bool>(),
        is_plain in any::<bool>(),
    ) {
        let mut bytes = if is_plain { PLAIN.clone() } else { WHOLE.clone() };
        let at = at.index(bytes.len() - 8);
        bytes[at..at + 8].copy_from_slice(&length.to_le_bytes());
        bytes.truncate(bytes.len() - usize::from(is_cut));
        read(&bytes)?;
    }
}

/// Every place at which a length can stand, and the lengths that reach beyond the file: 4 GiB, a chunk's limit, twice.
#[test]
fn no_length_at_any_byte_of_a_recording_takes_more_memory_than_the_file_holds() {
    for whole in [&*PLAIN, &*WHOLE] {
        for length in [u64::from(u32::MAX), 1 << 28, 1 << 63] {
            for at in 0..whole.len() - 8 {
                let mut bytes = whole.clone();
                bytes[at..at + 8].copy_from_slice(&length.to_le_bytes());
                let before = HELD.get();
                HELD_MAX.set(before);
                let count = Messages::new(&bytes).map_while(Result::ok).count();
                let held = HELD_MAX.get() - before;
                assert!(held < HELD_BYTES_MAX, "{length} at byte {at}: {held} bytes were held");
                assert!(count <= 90, "{length} at byte {at}");
            }
        }
    }
}

#[test]
fn a_length_beyond_the_file_is_refused_with_its_place() {
    let refused = |bytes: &[u8]| Messages::new(bytes).find_map(Result::err).unwrap().to_string();
    let head = [mcap::MAGIC, &[1], &100_u64.to_le_bytes()].concat();
    assert_eq!(refused(&head), "byte 8: a record (header) says that it is 100 bytes long, 0 are left");
    let body = [u32::MAX.to_le_bytes(), [0; 4]].concat();
    let header = [mcap::MAGIC, &[1], &8_u64.to_le_bytes(), &body].concat();
    assert_eq!(
        refused(&header),
        "byte 8: a record (header) says that 4294967295 bytes follow, 4 are left in it"
    );
    let at = WHOLE.windows(9).position(|bytes| bytes[0] == 6 && bytes[3..9] == [0; 6]).unwrap();
    let mut claims = WHOLE.clone();
    claims[at + 25..at + 33].copy_from_slice(&(1_u64 << 24).to_le_bytes());
    let said = refused(&claims);
    assert!(
        said.starts_with(&format!("byte {at}: a chunk says that it unpacks to 16777216 bytes, and ")),
        "{said}"
    );
    // A chunk that unpacks to more than it says, without a checksum.
    claims[at + 25..at + 33].copy_from_slice(&1_u64.to_le_bytes());
    claims[at + 33..at + 37].fill(0);
    let said = refused(&claims);
    assert!(said.ends_with("a chunk says that it unpacks to 1 bytes, and unpacks to 2"), "{said}");
    // A record of a chunk that goes on behind the chunk's end, in the same file.
    let at = PLAIN.windows(9).position(|bytes| bytes[0] == 6 && bytes[3..9] == [0; 6]).unwrap();
    let mut beyond = PLAIN.clone();
    beyond[at + 33..at + 37].fill(0);
    beyond[at + 49 + 1..at + 49 + 9].copy_from_slice(&2000_u64.to_le_bytes());
    let said = refused(&beyond);
    assert!(
        said.contains(&format!("of the chunk at byte {at}: a record")) && said.contains("are left"),
        "{said}"
    );
}

#[test]
fn what_was_flushed_survives_at_every_byte_behind_it() {
    let mut last = 0;
    for length in 0..=WHOLE.len() {
        let ticks = read(&WHOLE[..length]).unwrap().unwrap_or(0);
        assert!(
            ticks >= last && ticks.is_multiple_of(30),
            "{length} bytes hold {ticks} ticks, a byte less held {last}"
        );
        last = ticks;
    }
    assert_eq!(last, 90);
}

#[test]
fn a_definition_that_holds_itself_or_repeats_nothing_is_refused() {
    let rule = "=".repeat(80);
    let definition = Definition::parse("p/msg/B", &format!("A a\n{rule}\nMSG: p/A\nA a\n")).unwrap();
    assert!(definition.decode(&[0, 1, 0, 0, 1, 2, 3]).unwrap_err().to_string().contains("messages deep"));
    let definition =
        Definition::parse("p/msg/B", &format!("A[18446744073709551615] a\n{rule}\nMSG: p/A\n")).unwrap();
    assert!(definition.decode(&[0, 1, 0, 0, 1, 2, 3]).unwrap_err().to_string().contains("more values than"));
    let definition = Definition::parse("p/msg/B", &format!("uint8[1000] {}\n", "a".repeat(5000))).unwrap();
    assert!(
        definition
            .decode(&[[0, 1, 0, 0].as_slice(), &[7; 1000]].concat())
            .unwrap_err()
            .to_string()
            .contains("paths")
    );
}

#[test]
fn a_recording_that_is_not_there_is_named() {
    let error = Recording::salvage(Path::new("no/such.mcap")).unwrap_err().to_string();
    assert!(error.contains("no/such.mcap") && error.contains("No such file"), "{error}");
}

#[test]
fn a_recording_starts_as_every_one_does_and_replaces_nothing() {
    assert!(WHOLE.starts_with(START));
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("own.mcap");
    std::fs::write(&path, "own").unwrap();
    let refused = RecordingWriter::create(&path).err().unwrap().to_string();
    assert!(refused.contains("own.mcap: it exists and is not empty; name another file"), "{refused}");
    assert_eq!(std::fs::read_to_string(&path).unwrap(), "own");
    let link = folder.path().join("link.mcap");
    std::os::unix::fs::symlink("own.mcap", &link).unwrap();
    let refused = RecordingWriter::create(&link).err().unwrap().to_string();
    assert!(refused.contains("is not a regular file") && link.is_symlink(), "{refused}");
    let empty = folder.path().join("empty.mcap");
    std::fs::write(&empty, "").unwrap();
    RecordingWriter::create(&empty).unwrap().finish().unwrap();
    assert!(Recording::open(&empty).unwrap().topics().is_empty());
}

/// A record of an MCAP file.
fn record(opcode: u8, body: &[u8]) -> Vec<u8> {
    [&[opcode][..], &(body.len() as u64).to_le_bytes(), body].concat()
}

/// A text or a table with its length in front.
fn sized(bytes: &[u8]) -> Vec<u8> {
    [&u32::try_from(bytes.len()).unwrap().to_le_bytes()[..], bytes].concat()
}

fn schema(id: u16, text: &str) -> Vec<u8> {
    record(
        3,
        &[&id.to_le_bytes()[..], &sized(b"a/msg/A"), &sized(b"ros2msg"), &sized(text.as_bytes())].concat(),
    )
}

fn channel(id: u16, schema: u16, topic: &str) -> Vec<u8> {
    let ids = [id.to_le_bytes(), schema.to_le_bytes()].concat();
    record(4, &[&ids[..], &sized(topic.as_bytes()), &sized(b"cdr"), &sized(b"")].concat())
}

fn message(channel: u16, body: &[u8]) -> Vec<u8> {
    record(5, &[&channel.to_le_bytes()[..], &[0; 20], &[0, 1, 0, 0], body].concat())
}

/// A file whose writer was cut off behind a chunk that holds `records`, packed as far as zstd packs.
fn packed(records: &[u8]) -> Vec<u8> {
    let chunk = zstd::encode_all(records, 3).unwrap();
    let head = [[0; 16].as_slice(), &(records.len() as u64).to_le_bytes(), &[0; 4], &sized(b"zstd")].concat();
    let body = [&head[..], &(chunk.len() as u64).to_le_bytes(), &chunk].concat();
    [mcap::MAGIC, &record(1, &[0; 8]), &record(6, &body)].concat()
}

/// Reads a small file in every way, which must take little memory; returns the reason why reading ends, if there is one.
#[track_caller]
fn refused(bytes: &[u8]) -> Option<String> {
    assert!(bytes.len() < 20_000, "{} bytes", bytes.len());
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("small.mcap");
    std::fs::write(&path, bytes).unwrap();
    let before = HELD.get();
    HELD_MAX.set(before);
    let reason = Messages::new(bytes).find_map(Result::err).map(|damage| damage.to_string());
    let salvaged = Recording::salvage(&path);
    let undecoded = salvaged.as_ref().ok().and_then(|recording| {
        recording.messages().map_while(Result::ok).find_map(|record| recording.decode(&record).err())
    });
    let held = HELD_MAX.get() - before;
    // A chunk of 16 MiB while it grows, and a million values.
    assert!(held < 400 << 20, "{held} bytes were held");
    let told = salvaged.err().or(undecoded).map(|error| error.to_string());
    // A command tells what a reader of the bare messages does.
    let reason = reason.filter(|reason| !reason.contains("a record begins, and 0 bytes are left"));
    assert!(reason.is_none() || told.is_some(), "{reason:?} is not told");
    told
}

#[test]
fn a_small_file_that_unpacks_to_gigabytes_is_refused() {
    let zeros = vec![0; 200 << 20];
    let bomb = packed(&zeros);
    let said = refused(&bomb).unwrap();
    assert!(
        said.contains("a chunk says that it unpacks to 209715200 bytes") && said.contains("convert it"),
        "{said}"
    );
    // Each chunk is small, and all together are not.
    let chunk = &packed(&record(0x80, &zeros[..9 << 20]))[8 + 17..];
    let said = refused(&[&bomb[..8 + 17], &chunk.repeat(5)].concat()).unwrap();
    assert!(said.contains("all chunks of this file may unpack to"), "{said}");
    // A chunk of a few megabytes that is as constant as can be is read.
    let constant = [
        schema(1, "uint8[] data"),
        channel(1, 1, "/a"),
        message(1, &[&4_u32.to_le_bytes()[..], &[0; 4]].concat()),
    ];
    assert_eq!(refused(&packed(&[constant.concat(), record(0x80, &zeros[..8 << 20])].concat())), None);
}

#[test]
fn a_small_file_that_declares_much_is_refused() {
    let long =
        packed(&[schema(1, &"a b\n".repeat(3 << 20)), channel(1, 1, "/a"), message(1, &[0; 8])].concat());
    let said = refused(&long).unwrap();
    assert!(said.contains("the schemas and channels of this file take more than"), "{said}");
    // One schema of many channels is read for each of them.
    let channels = (0..600).flat_map(|id| [channel(id, 1, &format!("/{id}")), message(id, &[0; 8])].concat());
    let shared = packed(&[schema(1, &"int8 b\n".repeat(4096)), channels.collect()].concat());
    let said = refused(&shared).unwrap();
    assert!(said.contains("the schemas and channels of this file take more than"), "{said}");
    let named =
        packed(&[schema(1, "int8 b"), channel(1, 1, &"x".repeat(5000)), message(1, &[0; 8])].concat());
    let said = refused(&named).unwrap();
    assert!(said.contains("the name of a topic is 5000 bytes long, expected at most 4096"), "{said}");
}

#[test]
fn a_message_of_millions_of_values_is_refused() {
    let body = [&(12_u32 << 20).to_le_bytes()[..], &vec![0; 12 << 20]].concat();
    let image = packed(&[schema(1, "uint8[] data"), channel(1, 1, "/a"), message(1, &body)].concat());
    let said = refused(&image).unwrap();
    assert!(said.contains("more than 1048576 values, as images have"), "{said}");
    let units = format!("uint8[100000] data # [{}]", "m".repeat(5000));
    let long = packed(&[schema(1, &units), channel(1, 1, "/a"), message(1, &[0; 100_000])].concat());
    assert!(refused(&long).unwrap().contains("the paths and units of its values are longer than"));
}

/// An attachment may lie within another: both would be read whole.
#[test]
fn attachments_that_are_longer_than_the_file_are_refused() {
    const ATTACHMENT_INDEX: u8 = 0x0a;
    let mut bytes = PLAIN.clone();
    let number = |bytes: &[u8], at: usize| {
        usize::try_from(u64::from_le_bytes(bytes[at..at + 8].try_into().unwrap())).unwrap()
    };
    let mut at = number(&bytes, bytes.len() - 8 - 29 + 9);
    while bytes[at] != ATTACHMENT_INDEX {
        at += 9 + number(&bytes, at + 1);
    }
    let mut index = bytes[at..at + 9 + number(&bytes, at + 1)].to_vec();
    index[9] += 1;
    index[17..25].copy_from_slice(&(2 * PLAIN.len() as u64).to_le_bytes());
    bytes.splice(at..at, index);
    let crc = bytes.len() - 8 - 4;
    bytes[crc..crc + 4].fill(0);
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("nested.mcap");
    std::fs::write(&path, bytes).unwrap();
    let error = Recording::open(&path).unwrap_err().to_string();
    assert!(error.contains("the attachments are longer than the file"), "{error}");
}

#[test]
fn a_recording_that_is_cut_while_it_is_read_is_an_error_in_words() {
    let folder = tempfile::tempdir().unwrap();
    let [path, other] = ["flown.mcap", "other.mcap"].map(|name| folder.path().join(name));
    std::fs::write(&other, &*WHOLE).unwrap();
    // Both a complete recording and what is left of one.
    for length in [WHOLE.len(), WHOLE.len() - 1] {
        std::fs::write(&path, &WHOLE[..length]).unwrap();
        let recording = Recording::salvage(&path).unwrap();
        let mut messages = recording.messages();
        assert!(messages.next().unwrap().is_ok());
        std::fs::File::options().write(true).open(&path).unwrap().set_len(4096).unwrap();
        let error = messages.find_map(Result::err).unwrap().to_string();
        assert!(
            error.contains("flown.mcap") && error.contains("another program has cut the file"),
            "{error}"
        );
        let error = first_difference(&recording, &Recording::open(&other).unwrap());
        assert!(error.is_err() || length != WHOLE.len(), "{error:?}");
    }
}
