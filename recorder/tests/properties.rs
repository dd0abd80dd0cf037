//! Whatever stands in a recording or a definition: it reads, or is refused in words; nothing panics, runs for ever or
//! takes memory without bound.

use bus::Message;
use bus::announcement::Announcement;
use bus::messages::{BodyTransform, Imu, MotorCommand, PlantState, PoseStamped};
use bus::schema::Schema;
use proptest::prelude::*;
use recorder::definition::Definition;
use recorder::diff::first_difference;
use recorder::reader::Recording;
use recorder::writer::{RecordingWriter, START};
use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;
use std::path::Path;
use std::sync::LazyLock;

const SCHEMAS: [&Schema; 5] =
    [BodyTransform::SCHEMA, Imu::SCHEMA, MotorCommand::SCHEMA, PlantState::SCHEMA, PoseStamped::SCHEMA];
/// What may be taken while a damaged file of a few kilobytes is read: a record at its limit of 256 MiB, while its
/// buffer grows, and 4 GiB of untouched address space, since mcap 0.26 reserves what a string says that it is long,
/// in 32 bits, before it sees that the record is shorter.
const HELD_BYTES_MAX: isize = (4 << 30) + (1 << 30);

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
        let message = MotorCommand { command: [f64::from(tick); 4], ..MotorCommand::default() };
        let cdr = [&[0, 1, 0, 0], bytemuck::bytes_of(&message)].concat();
        writer.write(channel, tick, u64::from(tick) * 1_000_000, &cdr).unwrap();
        if tick % 30 == 29 {
            writer.flush().unwrap();
        }
    }
    writer.finish().unwrap();
    std::fs::read(path).unwrap()
});

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
        let names_file = |words: &str| words.contains("any.mcap");
        prop_assert!(
            names_file(&strict.to_string()) && names_file(&salvaged.to_string()),
            "{strict}; {salvaged}"
        );
    }
    prop_assert!(strict.is_err() || salvaged.is_ok(), "what opens can be salvaged");
    let count = salvaged.ok().map(|recording| {
        let _ = first_difference(&recording, &Recording::open(&whole).unwrap());
        let records = recording.messages().map_while(Result::ok);
        records.filter(|record| recording.decode(record).is_ok()).count()
    });
    let held = HELD_MAX.get() - before;
    prop_assert!(held < HELD_BYTES_MAX, "{held} bytes were held");
    Ok(count)
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
        if let Ok(definition) = Definition::parse(&text) {
            let _ = definition.decode(&body);
            let _ = definition.decode(&[&[0, 1, 0, 0], &body[..]].concat());
        }
    }

    #[test]
    fn no_bytes_are_a_crash_for_the_messages_of_the_bus(
        pick in 0..SCHEMAS.len(),
        body in prop::collection::vec(any::<u8>(), 0..600),
    ) {
        let definition = Definition::parse(&SCHEMAS[pick].ros2_definition()).unwrap();
        let read = definition.decode(&[&[0, 1, 0, 0], &body[..]].concat());
        prop_assert!(SCHEMAS[pick].has_text() || read.is_ok() == (body.len() >= SCHEMAS[pick].size));
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
    ) {
        let mut bytes = WHOLE.clone();
        for (at, byte) in changes {
            let at = at.index(bytes.len());
            bytes[at] = byte;
        }
        bytes.truncate(cut.map_or(usize::MAX, |cut| cut.index(WHOLE.len())));
        read(&bytes)?;
    }

    #[test]
    fn a_length_of_any_size_is_a_refusal_and_not_an_allocation(
        at in any::<prop::sample::Index>(),
        length in prop_oneof![Just(u64::MAX), Just(u64::MAX / 2), Just(1 << 40), Just(1 << 28), any::<u64>()],
        is_cut in any::<bool>(),
    ) {
        let mut bytes = WHOLE.clone();
        let at = at.index(bytes.len() - 8);
        bytes[at..at + 8].copy_from_slice(&length.to_le_bytes());
        bytes.truncate(WHOLE.len() - usize::from(is_cut));
        read(&bytes)?;
    }
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
    let definition = Definition::parse(&format!("A a\n{rule}\nMSG: A\nA a\n")).unwrap();
    assert!(definition.decode(&[0, 1, 0, 0, 1, 2, 3]).unwrap_err().contains("messages deep"));
    let definition = Definition::parse(&format!("A[18446744073709551615] a\n{rule}\nMSG: A\n")).unwrap();
    assert!(definition.decode(&[0, 1, 0, 0, 1, 2, 3]).unwrap_err().contains("more values than"));
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
