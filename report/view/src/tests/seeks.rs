//! An hour's recording is read piece by piece. The tests count the bytes that an answer reads from the file;
//! `scripts/seeks` measures the time that it takes.

use super::{MS, asked, cdr};
use crate::Shown;
use crate::curves::{CurvesRequest, curves};
use crate::entry::Entry;
use crate::frames::{FramesRequest, frames};
use bus::Message as _;
use bus::announcement::Announcement;
use bus::messages::{PlantState, SetPoint};
use recorder::reader::Recording;
use recorder::writer::RecordingWriter;
use std::path::Path;
use std::sync::atomic::AtomicBool;

const SECONDS: u32 = 3600;
const STATES_A_SECOND: u32 = 20;
const SECOND_NS: u64 = 1000 * MS;
/// Altitude of the set point of the first second.
const EARLY_M: f64 = 1.5;
/// Bytes that an answer without a block reads: those of the counter itself.
const NOTHING: u64 = 1000;

fn time_ns(tick: u32) -> u64 {
    u64::from(tick) * SECOND_NS / u64::from(STATES_A_SECOND)
}

/// A state whose digits do not compress: blocks are then as long as they look. `position.x` is the tick.
fn state_at(tick: u32) -> PlantState {
    let number = |index: u32| f64::from(16 * tick + index).sqrt();
    PlantState {
        position: [f64::from(tick), number(1), number(2)].into(),
        velocity: [number(3), number(4), number(5)].into(),
        angular_velocity: [number(6), number(7), number(8)].into(),
        specific_force: [number(9), number(10), number(11)].into(),
        ..PlantState::default()
    }
}

/// Writes an hour with a block each second. One topic has a message in the first second alone, another one in the last.
fn write(path: &Path) {
    let mut writer = RecordingWriter::create(path).unwrap();
    let state = writer.add_channel("/plant/state", &Announcement::of(PlantState::SCHEMA)).unwrap();
    let [early, late] = ["/early/set_point", "/late/set_point"]
        .map(|topic| writer.add_channel(topic, &Announcement::of(SetPoint::SCHEMA)).unwrap());
    for second in 0..SECONDS {
        let ticks = second * STATES_A_SECOND..(second + 1) * STATES_A_SECOND;
        for tick in ticks.clone() {
            writer.write(state, tick, time_ns(tick), &cdr(&state_at(tick))).unwrap();
        }
        let rare = [(0, early), (SECONDS - 1, late)].into_iter().filter(|(when, _)| *when == second);
        for (_, channel) in rare {
            let set_point = SetPoint { altitude: EARLY_M, ..SetPoint::default() };
            writer.write(channel, ticks.end - 1, time_ns(ticks.end - 1), &cdr(&set_point)).unwrap();
        }
        writer.flush().unwrap();
    }
    writer.finish().unwrap();
}

/// Bytes that this thread has read from files so far (`proc_pid_io(5)`).
fn read_bytes() -> u64 {
    let counted =
        std::fs::read_to_string("/proc/thread-self/io").expect("the kernel counts bytes of a thread");
    counted.lines().find_map(|line| line.strip_prefix("rchar: ")?.parse().ok()).unwrap()
}

/// The result of `work`, and the bytes that it has read.
fn counted<T>(work: impl FnOnce() -> T) -> (T, u64) {
    let before = read_bytes();
    let result = work();
    (result, read_bytes() - before)
}

#[test]
fn an_hour_is_opened_and_searched_without_being_read() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("hour.mcap");
    write(&path);
    let whole = path.metadata().unwrap().len();
    let open = || Entry::of(Shown::new(Recording::salvage(&path).unwrap()).unwrap()).unwrap();
    let (entry, read) = counted(open);
    // The index at the end of the file, which is read for channels, blocks and attachments. Blocks of a flight are a hundred times as long.
    assert!(read < whole / 2, "opening has read {read} of {whole} bytes");
    let catalogue = entry.known().catalogue.clone();
    for topic in catalogue["topics"].as_array().unwrap() {
        assert!(!topic["fields"].as_array().unwrap().is_empty(), "{topic}");
    }
    require_short_seeks(&entry, whole);
    require_short_windows(&entry, whole);
    require_overview(&entry, whole);
}

/// The newest samples at a time are in its block, and in the first one.
fn require_short_seeks(entry: &Entry, whole: u64) {
    let fields = asked(&[
        ("/early/set_point", "altitude"),
        ("/late/set_point", "altitude"),
        ("/plant/state", "position.x"),
    ]);
    for number in 1..40_u32 {
        let second = number.wrapping_mul(2_654_435_761) % SECONDS;
        let tick = second * STATES_A_SECOND + 10;
        let request = FramesRequest {
            recording: 0,
            from_ns: time_ns(tick) + 1,
            step_ns: 0,
            count: 1,
            fields: fields.clone(),
        };
        let (found, read) = counted(|| frames(&entry.known().shown, &request).unwrap());
        let early = if second == 0 { f64::NAN } else { EARLY_M };
        let is_same = |(found, expected): (&f64, f64)| found.total_cmp(&expected).is_eq();
        assert!(
            found.iter().zip([early, f64::NAN, f64::from(tick)]).all(is_same),
            "second {second}: {found:?}"
        );
        assert!(read > NOTHING && read < whole / 400, "second {second} has read {read} of {whole} bytes");
    }
}

/// Length of what a playing page and a zoomed plot request: 20 s.
fn require_short_windows(entry: &Entry, whole: u64) {
    let (shown, fields) = (&entry.known().shown, asked(&[("/plant/state", "position.x")]));
    let from_ns = 1800 * SECOND_NS;
    let playing =
        FramesRequest { recording: 0, from_ns, step_ns: SECOND_NS / 6, count: 120, fields: fields.clone() };
    let (_, read) = counted(|| frames(shown, &playing).unwrap());
    assert!(read < whole / 100, "120 frames have read {read} of {whole} bytes");
    let zoomed = CurvesRequest { recording: 0, from_ns, to_ns: from_ns + 20 * SECOND_NS, bins: 800, fields };
    let (found, read) = counted(|| curves(shown, &entry.overview, &zoomed).unwrap());
    assert!(found.read == 1.0 && read < whole / 100, "curves of 20 s have read {read} of {whole} bytes");
}

/// The overview alone reads the whole file, once, in the background; curves of the hour then read nothing.
fn require_overview(entry: &Entry, whole: u64) {
    let fields = asked(&[("/plant/state", "position.x")]);
    let to_ns = u64::from(SECONDS) * SECOND_NS;
    let hour = CurvesRequest { recording: 0, from_ns: 0, to_ns, bins: 800, fields };
    let curve = || counted(|| curves(&entry.known().shown, &entry.overview, &hour).unwrap());
    let (found, read) = curve();
    assert!(found.read == 0.0 && read < NOTHING, "{read} bytes");
    let (_, read) = counted(|| entry.overview.fill(&entry.known().shown, &AtomicBool::new(false)).unwrap());
    assert!(read > whole / 2 && read < whole + whole / 10, "the overview has read {read} of {whole} bytes");
    let (found, read) = curve();
    assert!(found.read == 1.0 && read < NOTHING, "{read} bytes");
    assert_eq!(
        (found.values[0], found.values.last().copied()),
        (0.0, Some(f64::from(SECONDS * STATES_A_SECOND - 1)))
    );
}
