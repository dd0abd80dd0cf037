//! Reading a log of any bytes ends, with a flight or with an error in words, and takes memory by the size of
//! the file.

#[path = "support/dataflash.rs"]
#[allow(dead_code, reason = "other tests use the rest")]
mod dataflash;
#[path = "support/lz4.rs"]
mod lz4;
#[path = "support/parquet.rs"]
mod parquet_file;
#[allow(dead_code, reason = "other tests use the rest")]
mod support;

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;
use std::path::Path;

use flights::{FlightSet, FlightsError};
use parquet::basic::{Compression, Encoding};
use parquet::file::properties::{WriterProperties, WriterPropertiesBuilder, WriterVersion};
use support::{Motion, crc32};

/// Memory that reading may hold for each byte of a log, and besides: rows of two bytes make rows of numbers, and the
/// definition of an array in a few bytes makes a table of its 65536 elements. A row of commands has room for
/// twelve rotors.
const HELD_PER_BYTE: usize = 1000;
const HELD_BESIDES: usize = 40 << 20;

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

const CSV: &str = r#"format = "csv"
[channels]
time = { columns = ["t"], unit = "s" }
command = { columns = ["m1", "m2", "m3", "m4"], unit = "count" }
position = { columns = ["px", "py", "pz"], unit = "m" }
velocity = { columns = ["vx", "vy", "vz"], unit = "m/s" }
attitude = { columns = ["qx", "qy", "qz", "qw"] }
angular_velocity = { columns = ["wx", "wy", "wz"], unit = "rad/s" }
"#;

const CRAZYFLIE: &str = r#"format = "crazyflie"
[channels]
command = { fields = ["motor.m1", "motor.m2", "motor.m3", "motor.m4"], unit = "count" }
specific_force = { fields = ["acc.x", "acc.y", "acc.z"], unit = "g" }
"#;

const ULOG: &str = r#"format = "ulog"
[channels]
specific_force = { topic = "sensor_combined" }
battery_voltage = { topic = "battery", fields = ["cell[1].volts"], unit = "V" }
"#;

const DATAFLASH: &str = r#"format = "dataflash"
[channels]
attitude = { topic = "ATT" }
angular_velocity = { topic = "IMU:1" }
"#;

const MCAP: &str = "format = \"mcap\"\n";

const PARQUET: &str = r#"format = "parquet"
[channels]
time = { columns = ["t"], unit = "s" }
command = { columns = ["m1", "m2", "m3", "m4"], unit = "count" }
position = { columns = ["px", "py", "pz"], unit = "m" }
"#;

/// The first `rows` of a flight in Parquet, packed so.
fn parquet(rows: usize, properties: WriterPropertiesBuilder) -> Vec<u8> {
    let mut columns = parquet_file::columns(&csv(rows));
    columns.truncate(8);
    columns[1].declared = "required int64 m1".to_owned();
    parquet_file::file(&columns, 25, properties.build())
}

/// Ways to pack a file.
fn packings() -> [WriterPropertiesBuilder; 5] {
    let packed = |compression| WriterProperties::builder().set_compression(compression);
    [
        WriterProperties::builder().set_dictionary_enabled(false),
        packed(Compression::SNAPPY).set_writer_version(WriterVersion::PARQUET_2_0),
        packed(Compression::GZIP(Default::default())),
        packed(Compression::ZSTD(Default::default()))
            .set_dictionary_enabled(false)
            .set_writer_version(WriterVersion::PARQUET_2_0),
        packed(Compression::LZ4_RAW).set_dictionary_enabled(false).set_encoding(Encoding::BYTE_STREAM_SPLIT),
    ]
}

/// Reads a log with these bytes as its one flight, believing its units.
fn read(head: &str, log: &[u8]) -> Result<FlightSet, FlightsError> {
    read_as(head, "trust_units = true", log)
}

/// The same with other keys of the flight; checks the memory that reading holds.
fn read_as(head: &str, keys: &str, log: &[u8]) -> Result<FlightSet, FlightsError> {
    let text = format!(
        "vehicle = \"v.toml\"\n{head}[[flight]]\nname = \"f\"\nfile = \"log\"\nrole = \"fit\"\n{keys}\n"
    );
    let file = |path: &Path| {
        let vehicle = vehicles::reference::HUMMINGBIRD.as_bytes();
        Ok(if path.ends_with("v.toml") { vehicle.to_vec() } else { log.to_vec() })
    };
    let before = HELD.get();
    HELD_MAX.set(before);
    let read = FlightSet::parse(Path::new("flights.toml"), text, &file);
    let held = usize::try_from(HELD_MAX.get() - before).unwrap();
    assert!(held < HELD_BESIDES + HELD_PER_BYTE * log.len(), "{held} bytes for a log of {}", log.len());
    if let Ok(set) = &read {
        for flight in &set.flights {
            assert!(flight.check_span(2.0).is_ok());
            let _ = flights::write_csv(flight, Path::new("/dev/null"));
        }
    }
    read
}

/// The words with which a log is refused.
fn refused(head: &str, log: &[u8]) -> String {
    read(head, log).unwrap_err().to_string()
}

/// The first `rows` of a flight at 100 Hz as a CSV file.
fn csv(rows: usize) -> String {
    Motion::default().csv().lines().take(rows + 1).map(|line| line.to_owned() + "\n").collect()
}

/// Numbers that look like chance and are the same on every machine.
struct Chance(u64);

impl Chance {
    fn below(&mut self, bound: usize) -> usize {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        usize::try_from(self.0 >> 11).unwrap() % bound.max(1)
    }

    fn range(&mut self, length: usize) -> std::ops::Range<usize> {
        let from = self.below(length);
        from..(from + 1 + self.below(64)).min(length)
    }

    /// Changes `bytes` in a way that damages lengths, numbers or the order of their parts.
    fn change(&mut self, bytes: &mut Vec<u8>, words: &[&[u8]]) {
        if bytes.is_empty() {
            return;
        }
        let at = self.below(bytes.len());
        match self.below(8) {
            0 => bytes[at] = u8::try_from(self.below(256)).unwrap(),
            1 => bytes[at] ^= 1 << self.below(8),
            2 => bytes.truncate(at),
            3 => drop(bytes.drain(self.range(bytes.len()))),
            4 => {
                let part = bytes[self.range(bytes.len())].to_vec();
                bytes.splice(at..at, part);
            }
            5 => {
                let size = 1 << self.below(4);
                let end = (at + size).min(bytes.len());
                let fill = [0, 0x7F, 0xFF][self.below(3)];
                bytes[at..end].fill(fill);
            }
            _ => {
                let word = words[self.below(words.len())];
                let end = (at + self.below(2) * word.len()).min(bytes.len());
                bytes.splice(at..end, word.iter().copied());
            }
        }
    }
}

/// Reads `count` logs, each of `whole` with one to five changes; returns how many of them gave a flight.
fn mutated(head: &str, whole: &[u8], words: &[&[u8]], count: usize, close: impl Fn(&mut Vec<u8>)) -> usize {
    let mut chance = Chance(0x9E37_79B9_7F4A_7C15);
    let mut flights = 0;
    for _ in 0..count {
        let mut bytes = whole.to_vec();
        for _ in 0..=chance.below(5) {
            chance.change(&mut bytes, words);
        }
        close(&mut bytes);
        flights += usize::from(read(head, &bytes).is_ok());
    }
    flights
}

const LENGTHS: [&[u8]; 6] = [
    &[0xFF; 4],
    &[0xFF; 8],
    &[0, 0, 0, 0x10, 0, 0, 0, 0],
    &[0xFF, 0xFF, 0xFF, 0x7F],
    &[0, 0, 0, 0, 0, 0, 0, 0],
    &[0xFF, 0xFF],
];

#[test]
fn thousands_of_changed_csv_files_end_in_words_or_in_a_flight() {
    let words: Vec<&[u8]> = [
        "\"", "\"\"", ",", "\n", "\r", "1e308", "-1e308", "1e16", "1e-300", "nan", "inf", "1e999", ";", "\t",
    ]
    .map(str::as_bytes)
    .to_vec();
    let flights = mutated(CSV, csv(40).as_bytes(), &words, 4000, |_| {});
    assert!(flights > 400 && flights < 4000, "{flights} of 4000 gave a flight");
}

#[test]
fn thousands_of_changed_crazyflie_logs_end_in_words_or_in_a_flight() {
    let whole = support::crazyflie_log(20);
    let content = &whole[..whole.len() - 4];
    let flights =
        mutated(CRAZYFLIE, content, &LENGTHS, 4000, |bytes| bytes.extend(crc32(bytes).to_le_bytes()));
    assert!(flights > 100 && flights < 4000, "{flights} of 4000 gave a flight");
}

#[test]
fn thousands_of_changed_ulogs_end_in_words_or_in_a_flight() {
    let words: Vec<&[u8]> =
        LENGTHS.into_iter().chain([&b"[65535]"[..], b"[4294967296]", b"battery ", b"cell"]).collect();
    let flights = mutated(ULOG, &support::ulog(20), &words, 4000, |_| {});
    assert!(flights > 100 && flights < 4000, "{flights} of 4000 gave a flight");
}

#[test]
fn thousands_of_changed_dataflash_logs_end_in_words_or_in_a_flight() {
    let words: Vec<&[u8]> =
        LENGTHS.into_iter().chain([&b"\xA3\x95"[..], b"\xA3\x95\x80", b"FMT\0", b"Q", b"#"]).collect();
    let flights = mutated(DATAFLASH, &dataflash::log(20, true), &words, 4000, |_| {});
    assert!(flights > 100 && flights < 4000, "{flights} of 4000 gave a flight");
}

#[test]
fn thousands_of_changed_bags_end_in_words_or_in_a_flight() {
    for compression in [None, Some(mcap::Compression::Zstd)] {
        let whole = support::bag(10, compression);
        let flights = mutated(MCAP, &whole, &LENGTHS, 2000, |_| {});
        assert!(flights > 100 && flights < 2000, "{flights} of 2000 gave a flight");
    }
    let whole = lz4::chunks(&support::bag(10, None), |records| records);
    let flights = mutated(MCAP, &whole, &LENGTHS, 2000, |_| {});
    // It has no summary, and one chunk: hardly a change leaves it whole.
    assert!(flights > 5 && flights < 2000, "{flights} of 2000 gave a flight");
}

#[test]
fn thousands_of_changed_parquet_files_end_in_words_or_in_a_flight() {
    for properties in packings() {
        let whole = parquet(40, properties);
        assert!(read(PARQUET, &whole).is_ok());
        let flights = mutated(PARQUET, &whole, &LENGTHS, 2000, |_| {});
        assert!(flights > 20 && flights < 2000, "{flights} of 2000 gave a flight");
    }
}

#[test]
fn every_byte_of_a_parquet_file_can_be_any_other_without_more_memory() {
    for properties in packings() {
        let whole = parquet(30, properties);
        for at in 0..whole.len() {
            // A bit, all bits, or the byte 0x7F: one of them at each place, since a file is read whole each time.
            let mut bytes = whole.clone();
            bytes[at] ^= [0x01, 0x80, 0xFF, whole[at] ^ 0x7F][at % 4];
            let _ = read(PARQUET, &bytes);
            let mut bytes = whole.clone();
            let end = (at + 5).min(bytes.len());
            bytes[at..end].fill(0xFF);
            let _ = read(PARQUET, &bytes);
        }
    }
}

#[test]
fn every_length_of_a_bag_that_claims_four_gigabytes_is_refused_without_the_memory() {
    for compression in [None, Some(mcap::Compression::Zstd)] {
        let whole = support::bag(3, compression);
        for at in 0..whole.len() - 4 {
            let mut bytes = whole.clone();
            bytes[at..at + 4].fill(0xFF);
            let _ = read(MCAP, &bytes);
        }
    }
}

#[test]
fn a_log_cut_at_any_byte_ends_in_words_or_in_a_flight() {
    let logs = [
        (CRAZYFLIE, support::crazyflie_log(5)),
        (ULOG, support::ulog(5)),
        (DATAFLASH, dataflash::log(5, true)),
        (MCAP, support::bag(3, None)),
        (PARQUET, parquet(5, WriterProperties::builder())),
    ];
    for (head, whole) in logs {
        for length in 0..whole.len() {
            let _ = read(head, &whole[..length]);
        }
    }
}

#[test]
fn an_array_that_a_ulog_claims_is_no_longer_than_a_message() {
    let mut log = b"ULog\x01\x12\x35\x01\0\0\0\0\0\0\0\0".to_vec();
    let message = |kind: u8, content: &[u8]| {
        [&u16::try_from(content.len()).unwrap().to_le_bytes()[..], &[kind], content].concat()
    };
    log.extend(message(b'F', b"sensor_combined:uint64_t timestamp;uint8_t[18446744073709551615] a;"));
    log.extend(message(b'A', b"\0\x01\0sensor_combined"));
    log.extend(message(b'D', &[1, 0, 0, 0]));
    assert!(refused(ULOG, &log).contains("longer than any message"));
    let named = format!("sensor_combined:uint64_t timestamp;uint8_t[60000] {};", "a".repeat(60_000));
    let mut log = log[..16].to_vec();
    log.extend(message(b'F', named.as_bytes()));
    log.extend(message(b'A', b"\0\x01\0sensor_combined"));
    log.extend(message(b'D', &[&[1, 0][..], &[0; 60_008]].concat()));
    assert!(refused(ULOG, &log).contains("a field name of 60000 bytes"));
}

/// Columns that stay the same, whose rows take no bytes.
fn parquet_of_equal_rows(rows: usize) -> Vec<u8> {
    let mut columns = parquet_file::columns(&csv(1));
    columns.truncate(8);
    for (index, column) in columns.iter_mut().enumerate() {
        let cell = |row: usize| Some(if index == 0 { 0.001 * row as f64 } else { 100.0 });
        column.cells = (0..rows).map(cell).collect();
    }
    columns[0].declared = "required int64 t".to_owned();
    columns[0].cells.iter_mut().flatten().for_each(|cell| *cell *= 1000.0);
    let delta = WriterProperties::builder()
        .set_column_encoding("t".into(), Encoding::DELTA_BINARY_PACKED)
        .set_column_dictionary_enabled("t".into(), false)
        .set_statistics_enabled(parquet::file::properties::EnabledStatistics::None)
        .set_compression(Compression::ZSTD(Default::default()));
    parquet_file::file(&columns, rows, delta.build())
}

#[test]
fn rows_that_take_no_bytes_are_read_up_to_a_number_by_the_size_of_the_file() {
    let head = PARQUET.replace("\"s\"", "\"ms\"");
    let log = parquet_of_equal_rows(90_000);
    assert_eq!(read(&head, &log).unwrap().flights[0].command.time_s.len(), 90_000, "{} bytes", log.len());
    let log = parquet_of_equal_rows(900_000);
    let most = format!("at most {} rows in a file of {} bytes", 100_000 + 4 * log.len(), log.len());
    let message = refused(&head, &log);
    assert!(
        message.contains(&most) && message.contains("found 900000") && message.contains("CSV"),
        "{message}"
    );
}

#[test]
fn a_stray_quotation_mark_is_refused_with_its_line_and_swallows_nothing() {
    let whole = csv(200);
    assert_eq!(read(CSV, whole.as_bytes()).unwrap().flights[0].attitude.time_s.len(), 200);
    let mut lines: Vec<String> = whole.lines().map(str::to_owned).collect();
    lines[101] = lines[101].replacen(',', ",\"", 1);
    for (text, line) in [(lines.join("\n"), "line 102, cell 2"), (lines.join("\r\n"), "line 102, cell 2")] {
        let message = refused(CSV, text.as_bytes());
        assert!(message.contains(line) && message.contains("remove the mark"), "{message}");
    }
    // A second one closes the first, lines later.
    lines[150] = lines[150].replacen(',', "\",", 1);
    assert!(refused(CSV, lines.join("\n").as_bytes()).contains("line 102, cell 2"));
    // Cells that end where they should are read as ever.
    let quoted = whole.replacen("0.05,100,", "\"0.05\",\"100\",", 1).replacen("t,m1", "\"t\",\"m1\"", 1);
    assert_eq!(read(CSV, quoted.as_bytes()).unwrap().flights[0].attitude.time_s.len(), 200);
}

/// A CSV file of 200 rows with these times.
fn timed(time: impl Fn(u32) -> f64) -> String {
    let whole = csv(200);
    let mut lines = whole.lines();
    let mut text = lines.next().unwrap().to_owned() + "\n";
    for (k, line) in (0..).zip(lines) {
        text += &format!("{},{}\n", time(k), line.split_once(',').unwrap().1);
    }
    text
}

#[test]
fn stamps_further_apart_than_any_flight_are_refused_with_their_line() {
    // Nanoseconds declared as seconds behind a first row of 0, and what no unit explains.
    let since_start = timed(|k| if k == 0 { 0.0 } else { 1e16 + 1e7 * f64::from(k) });
    let no_unit = timed(|k| 1e16 * f64::from(k));
    for text in [&since_start, &no_unit] {
        let message = refused(CSV, text.as_bytes());
        for part in
            ["200 samples lie over", "from line 2, 0 s", "to line 3, 10000", "correct the unit", "`from_s`"]
        {
            assert!(message.contains(part), "`{part}` is not in: {message}");
        }
    }
    let message = read_as(CSV, "", since_start.as_bytes()).unwrap_err().to_string();
    assert!(message.contains("`unit = \"ns\"` would fit"), "{message}");
    // A stamp far ahead at the end, where nothing behind it shows that it is wrong.
    let last = timed(|k| if k == 199 { 1e9 } else { 0.01 * f64::from(k) });
    assert!(refused(CSV, last.as_bytes()).contains("to line 201, 1000000000 s"));
    // The same log, cut to where it is right.
    assert!(read_as(CSV, "to_s = 1.5", last.as_bytes()).is_ok());
}

#[test]
fn a_wide_header_over_short_rows_costs_no_more_than_the_file() {
    let header: String = (0..20_000).map(|column| format!(",c{column}")).collect();
    let rows: String = (0..20_000).map(|row| format!("{}\n", 0.01 * f64::from(row))).collect();
    let message = refused(CSV, format!("t{header}\n{rows}").as_bytes());
    assert!(message.contains("no column"), "{message}");
}

#[test]
fn a_log_with_as_many_gaps_as_rows_is_read_in_a_time_by_its_size() {
    // Rows in pairs, a long way from pair to pair: each way is a gap of all channels.
    let whole = csv(1);
    let row = whole.lines().nth(1).unwrap().split_once(',').unwrap().1.to_owned();
    let mut text = whole.lines().next().unwrap().to_owned() + "\n";
    for pair in 0..30_000 {
        for k in 0..3 {
            text += &format!("{:.2},{row}\n", f64::from(pair) + 0.01 * f64::from(k));
        }
    }
    assert!(read(CSV, text.as_bytes()).is_ok());
}
