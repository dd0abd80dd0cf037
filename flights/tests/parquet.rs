//! Parquet files, read through a flights file.

use crate::parquet_file as file;
use crate::support;
use file::{Column, columns};
use flights::Flight;
use parquet::basic::{Compression, Encoding};
use parquet::file::properties::{WriterProperties, WriterPropertiesBuilder, WriterVersion};
use support::{Motion, Place};

const CHANNELS: &str = r#"
time = { columns = ["t"], unit = "s" }
command = { columns = ["m1", "m2", "m3", "m4"], unit = "count" }
position = { columns = ["px", "py", "pz"], unit = "m" }
attitude = { columns = ["qx", "qy", "qz", "qw"] }
angular_velocity = { columns = ["wx", "wy", "wz"], unit = "rad/s" }
specific_force = { columns = ["fx", "fy", "fz"], unit = "m/s^2" }
battery_voltage = { columns = ["v"], unit = "V" }
"#;

fn load(log: &[u8], channels: &str, extra: &str) -> Result<Flight, String> {
    load_as("log.parquet", log, channels, extra)
}

fn load_as(name: &str, log: &[u8], channels: &str, extra: &str) -> Result<Flight, String> {
    let place = Place::new();
    place.write(name, log);
    place.load(name, channels, extra).map_err(|error| error.to_string())
}

/// A change of a column.
type Change<'a> = &'a dyn Fn(&mut Column);

/// The made-up flight, of which `change` changes columns by their names.
fn changed(change: &[(&str, Change<'_>)]) -> Vec<u8> {
    let mut columns = columns(&Motion::default().csv());
    for column in &mut columns {
        let name = column.declared.split(' ').next_back().unwrap().to_owned();
        change.iter().filter(|(changed, _)| *changed == name).for_each(|(_, change)| change(column));
    }
    file::file(&columns, 400, WriterProperties::builder().set_compression(Compression::SNAPPY).build())
}

/// Declares a column as `declared`, and multiplies its cells by `factor` behind a summand.
fn typed(declared: &'static str, summand: f64, factor: f64) -> impl Fn(&mut Column) {
    move |column| {
        column.declared = declared.to_owned();
        column.cells.iter_mut().flatten().for_each(|cell| *cell = (*cell + summand) * factor);
    }
}

/// The flight of the CSV file, and the same one of Parquet, are equal within `tolerance`.
fn same(name: &str, flight: Result<Flight, String>, tolerance: f64) {
    let flight = flight.unwrap_or_else(|error| panic!("{name}: {error}"));
    let plain = load_as("log.csv", Motion::default().csv().as_bytes(), CHANNELS, "").unwrap();
    assert_eq!(flight.notes, [""; 0], "{name}");
    let near =
        |a: &[f64], b: &[f64]| a.len() == b.len() && a.iter().zip(b).all(|(a, b)| (a - b).abs() <= tolerance);
    assert!(near(&flight.position.time_s, &plain.position.time_s), "{name}: times");
    assert!(near(flight.command.values.as_flattened(), plain.command.values.as_flattened()), "{name}");
    assert!(near(flight.attitude.values.as_flattened(), plain.attitude.values.as_flattened()), "{name}");
    assert!(near(flight.position.values.as_flattened(), plain.position.values.as_flattened()), "{name}");
    let voltages = [&flight, &plain].map(|flight| flight.battery_voltage.values.as_flattened());
    assert!(near(voltages[0], voltages[1]), "{name}");
}

fn says(name: &str, refused: Result<Flight, String>, parts: &[&str]) {
    let text = refused.map(|flight| flight.notes).expect_err(name);
    parts.iter().for_each(|part| assert!(text.contains(part), "{name}: `{part}` is not in: {text}"));
    assert!(text.contains("flights.toml:"), "{name}: {text}");
}

#[test]
fn files_are_read_however_their_columns_are_packed() {
    let columns = columns(&Motion::default().csv());
    let builder = WriterProperties::builder;
    let gzip = Compression::GZIP(Default::default());
    let zstd = Compression::ZSTD(Default::default());
    let cases: [(&str, WriterPropertiesBuilder); 9] = [
        ("plain", builder().set_dictionary_enabled(false)),
        ("dictionaries", builder()),
        ("version 2", builder().set_writer_version(WriterVersion::PARQUET_2_0)),
        ("snappy", builder().set_compression(Compression::SNAPPY)),
        ("gzip", builder().set_compression(gzip)),
        ("zstd", builder().set_compression(zstd).set_writer_version(WriterVersion::PARQUET_2_0)),
        ("lz4", builder().set_compression(Compression::LZ4_RAW)),
        ("split", builder().set_dictionary_enabled(false).set_encoding(Encoding::BYTE_STREAM_SPLIT)),
        ("small pages", builder().set_data_page_row_count_limit(70).set_write_batch_size(70)),
    ];
    for (name, properties) in cases {
        for group in [300, 2000] {
            same(name, load(&file::file(&columns, group, properties.clone().build()), CHANNELS, ""), 0.0);
        }
    }
    let file = file::file(&columns, 300, builder().build());
    same("by number", load(&file, &CHANNELS.replace("\"px\"", "6"), ""), 0.0);
    same("another name", load_as("log", &file, CHANNELS, ""), 0.0);
    same("a format", load_as("log", &file, CHANNELS, "format = \"parquet\""), 0.0);
}

#[test]
fn columns_of_all_types_of_numbers_are_read() {
    let whole = |declared: &'static str| typed(declared, 0.0, 1.0);
    let of_types = changed(&[
        ("m1", &whole("required int32 m1 (INTEGER(8,true))")),
        ("m2", &whole("optional int32 m2 (INTEGER(32,false))")),
        ("m3", &whole("optional int64 m3 (INTEGER(64,false))")),
        ("m4", &whole("required float m4")),
        ("pz", &typed("optional int64 pz (DECIMAL(18,9))", 0.0, 1e9)),
        ("v", &typed("required boolean v", -10.0, 1.0)),
    ]);
    let channels = CHANNELS.replace("[\"v\"], unit", "[\"v\"], scale = 11, offset = 0.5, unit");
    let flight = load(&of_types, &channels, "").unwrap();
    assert!(flight.battery_voltage.values.iter().all(|value| *value == [11.5]));
    let plain = load_as("log.csv", Motion::default().csv().as_bytes(), CHANNELS, "").unwrap();
    assert_eq!(flight.command, plain.command);
    let off = flight.position.values.iter().zip(&plain.position.values).map(|(a, b)| (a[2] - b[2]).abs());
    assert!(off.fold(0.0, f64::max) < 1e-9);
}

/// As pyarrow writes decimal fractions and float16.
#[test]
fn fractions_in_blocks_of_bytes_are_read() {
    let decimal = typed("optional fixed_len_byte_array(8) px (DECIMAL(18,9))", 0.0, 1e9);
    let long = typed("required fixed_len_byte_array(16) py (DECIMAL(38,9))", 0.0, 1e9);
    let half = typed("optional fixed_len_byte_array(2) wx (FLOAT16)", 0.0, 1.0);
    let log = changed(&[("px", &decimal), ("py", &long), ("wx", &half)]);
    let flight = load(&log, CHANNELS, "").unwrap();
    let plain = load_as("log.csv", Motion::default().csv().as_bytes(), CHANNELS, "").unwrap();
    let furthest = |a: &[[f64; 3]], b: &[[f64; 3]]| {
        let both = a.as_flattened().iter().zip(b.as_flattened());
        both.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
    };
    assert_eq!(flight.position.values.len(), 1001);
    assert!(furthest(&flight.position.values, &plain.position.values) < 1e-9);
    assert_eq!(flight.angular_velocity.values.len(), 1001);
    assert!(furthest(&flight.angular_velocity.values, &plain.angular_velocity.values) < 4e-3);
    let blocks = changed(&[("px", &typed("required fixed_len_byte_array(8) px", 0.0, 1.0))]);
    says("blocks", load(&blocks, CHANNELS, ""), &["column `px`", "found blocks of bytes"]);
}

#[test]
fn times_have_the_unit_of_their_type_or_the_declared_one() {
    let since_1970 = 1.9e9;
    let without = CHANNELS.replace("[\"t\"], unit = \"s\"", "[\"t\"]");
    for (declared, factor) in [
        ("required int64 t (TIMESTAMP(MICROS,true))", 1e6),
        ("required int64 t (TIMESTAMP(NANOS,false))", 1e9),
        ("optional int64 t (TIMESTAMP_MILLIS)", 1e3),
        ("required int64 t (TIME(MICROS,true))", 1e6),
    ] {
        let log = changed(&[("t", &typed(declared, since_1970, factor))]);
        same(declared, load(&log, &without, ""), 1e-6);
        same(declared, load(&log, &CHANNELS.replace("\"s\"", "\"wall clock\""), ""), 1e-6);
    }
    let log = changed(&[("t", &typed("required int64 t (TIMESTAMP(MICROS,true))", since_1970, 1e6))]);
    same("the same unit", load(&log, &CHANNELS.replace("\"s\"", "\"us\""), ""), 1e-6);
    says(
        "another unit",
        load(&log, CHANNELS, ""),
        &["`time.unit`", "expected \"us\" or no unit", "column `t` has a type of times", "found \"s\""],
    );
    let plain = changed(&[("t", &typed("required int64 t", 0.0, 1e9))]);
    same("a declared unit", load(&plain, &CHANNELS.replace("\"s\"", "\"ns\""), ""), 1e-9);
    says(
        "no unit",
        load(&plain, &without, ""),
        &["`time.unit`", "\"ns\", as the type of the column says none", "found (none)"],
    );
    says("a wrong unit", load(&plain, CHANNELS, ""), &["`unit = \"ns\"` would fit"]);
}

#[test]
fn empty_cells_are_left_out_and_recordings_chosen_as_in_csv() {
    let with_gaps = changed(&[("px", &|column: &mut Column| {
        column.cells.iter_mut().step_by(10).for_each(|cell| *cell = None);
    })]);
    let flight = load(&with_gaps, CHANNELS, "").unwrap();
    assert_eq!(flight.notes, ["position: 101 of 1001 samples have no finite number; left out"]);
    let again = |column: &mut Column| column.cells[600..].iter_mut().flatten().for_each(|t| *t -= 6.0);
    let twice = changed(&[("t", &again)]);
    says("two recordings", load(&twice, CHANNELS, ""), &["2 recordings", "again in row 601", "`recording`"]);
    let second = load(&twice, CHANNELS, "recording = 2").unwrap();
    let plain = load_as("log.csv", Motion::default().csv().as_bytes(), CHANNELS, "").unwrap();
    assert_eq!(second.position.values, plain.position.values[600..]);
    let falling = |column: &mut Column| column.cells.reverse();
    says(
        "falling",
        load(&changed(&[("t", &falling)]), CHANNELS, ""),
        &["fall in 1000 of 1000 steps", "10 s in row 1 to 9.99 s in row 2", "column `t`"],
    );
}

/// A column of lists, as pyarrow writes it, and pages that are packed in a way that is not read.
#[test]
fn lists_and_other_compressions_are_named() {
    let schema = "message log { required double t; optional group gyro (LIST) { repeated group list { optional \
                  double element; } } }";
    let schema = std::sync::Arc::new(parquet::schema::parser::parse_message_type(schema).unwrap());
    let mut writer =
        parquet::file::writer::SerializedFileWriter::new(Vec::new(), schema, Default::default()).unwrap();
    let mut group = writer.next_row_group().unwrap();
    let mut times = group.next_column().unwrap().unwrap();
    times.typed::<parquet::data_type::DoubleType>().write_batch(&[0.0, 0.1], None, None).unwrap();
    times.close().unwrap();
    let mut lists = group.next_column().unwrap().unwrap();
    let numbers = lists.typed::<parquet::data_type::DoubleType>();
    numbers.write_batch(&[1.0; 6], Some(&[3; 6]), Some(&[0, 1, 1, 0, 1, 1])).unwrap();
    lists.close().unwrap();
    group.close().unwrap();
    let channels = "time = { columns = [\"t\"], unit = \"s\" }\nangular_velocity = { columns = [\"gyro\"], unit = \"rad/s\" }";
    let lists = load(&writer.into_inner().unwrap(), channels, "");
    says("lists", lists, &["column `gyro`", "expected one number in each row, found lists"]);
    // The codec of a column is the fourth field of its metadata: zstd (6) becomes brotli (4).
    let properties = WriterProperties::builder().set_compression(Compression::ZSTD(Default::default()));
    let packed = file::file(&columns(&Motion::default().csv()), 2000, properties.build());
    let brotli = with_codec(&packed, 6, 4);
    says(
        "brotli",
        load(&brotli, CHANNELS, ""),
        &["compression by snappy, gzip, zstd or lz4_raw", "by brotli"],
    );
}

/// The file with another number in the fields of the footer that name a codec: behind the path of a column, `t` (one name
/// of one letter).
fn with_codec(file: &[u8], codec: u8, other: u8) -> Vec<u8> {
    let mut changed = file.to_vec();
    // The path (a list of one text of one byte), and a field one further (i32) with the codec, as a zigzag number.
    let sought = [0x19, 0x18, 0x01, b't', 0x15, 2 * codec];
    let at = file.windows(sought.len()).position(|window| window == sought).expect("the column's codec");
    changed[at + sought.len() - 1] = 2 * other;
    changed
}

#[test]
fn what_cannot_be_read_is_refused_with_what_it_is() {
    let whole = changed(&[]);
    let texts = changed(&[("px", &typed("required binary px (UTF8)", 0.0, 1.0))]);
    says("texts", load(&texts, CHANNELS, ""), &["`position`", "column `px`", "found texts"]);
    let named = CHANNELS.replace("\"px\"", "\"x\"");
    says("a name", load(&whole, &named, ""), &["no column `x`", "it has t, m1", "choose from this list"]);
    let twice = changed(&[("vx", &typed("optional double px", 0.0, 1.0))]);
    says("a name twice", load(&twice, CHANNELS, ""), &["`px` stands 2 times", "6, 9", "\"#6\""]);
    same("of which one is chosen", load(&twice, &CHANNELS.replace("\"px\"", "6"), ""), 0.0);
    let topic = CHANNELS.replace("columns = [\"v\"]", "topic = \"b\", columns = [\"v\"]");
    says("a topic", load(&whole, &topic, ""), &["`topic`", "a Parquet file has no topics"]);
    says("cut", load(&whole[..whole.len() / 2], CHANNELS, ""), &["`PAR1` at the end", "it is cut"]);
    says("a form", load(&whole, CHANNELS, "csv = { header_line = 2 }"), &["`csv`", "a CSV file"]);
    let encrypted = [b"PARE", &whole[4..whole.len() - 4], b"PARE"].concat();
    says("encrypted", load(&encrypted, CHANNELS, "format = \"parquet\""), &["encrypted"]);
    let empty = changed(&[("px", &|column: &mut Column| column.cells.fill(None))]);
    says("no number", load(&empty, CHANNELS, ""), &["column `px`", "expected numbers", "none in any row"]);
}
