//! CSV files as programs write them, read through a flights file.

use crate::support;
use flights::Flight;
use support::{Motion, Place, crc32};

const CHANNELS: &str = r#"
time = { columns = ["t"], unit = "s" }
command = { columns = ["m1", "m2", "m3", "m4"], unit = "count" }
position = { columns = ["px", "py", "pz"], unit = "m" }
attitude = { columns = ["qx", "qy", "qz", "qw"] }
angular_velocity = { columns = ["wx", "wy", "wz"], unit = "rad/s" }
specific_force = { columns = ["fx", "fy", "fz"], unit = "m/s^2" }
"#;

fn plain() -> Flight {
    load(Motion::default().csv().as_bytes(), CHANNELS, "").unwrap()
}

fn load(log: &[u8], channels: &str, extra: &str) -> Result<Flight, String> {
    let place = Place::new();
    place.write("log.csv", log);
    place.load("log.csv", channels, extra).map_err(|error| error.to_string())
}

/// The flight is the plain one, and nothing is noted.
fn same(name: &str, flight: Result<Flight, String>) {
    let (flight, plain) = (flight.unwrap_or_else(|error| panic!("{name}: {error}")), plain());
    assert_eq!(flight.notes, [""; 0], "{name}");
    assert!(flight.command.values == plain.command.values, "{name}");
    let near = |a: &[[f64; 3]], b: &[[f64; 3]]| {
        a.len() == b.len() && a.iter().flatten().zip(b.iter().flatten()).all(|(a, b)| (a - b).abs() < 1e-9)
    };
    assert!(near(&flight.position.values, &plain.position.values), "{name}");
    assert!(near(&flight.angular_velocity.values, &plain.angular_velocity.values), "{name}");
    assert!(near(&flight.specific_force.values, &plain.specific_force.values), "{name}");
    assert!(
        flight.attitude.time_s.iter().zip(&plain.attitude.time_s).all(|(a, b)| (a - b).abs() < 1e-9),
        "{name}"
    );
}

fn says(name: &str, refused: Result<Flight, String>, parts: &[&str]) {
    let text = refused.map(|flight| flight.notes).expect_err(name);
    parts.iter().for_each(|part| assert!(text.contains(part), "{name}: `{part}` is not in: {text}"));
    assert!(text.contains("flights.toml:"), "{name}: {text}");
    assert!(text.chars().all(|character| !character.is_control() || character == '\n'), "{name}: {text:?}");
}

/// The columns by number, `offset` columns to the right.
fn by_number(offset: usize) -> String {
    let names = [
        "t", "m1", "m2", "m3", "m4", "px", "py", "pz", "vx", "vy", "vz", "qx", "qy", "qz", "qw", "wx", "wy",
        "wz",
    ];
    let names = names.into_iter().chain(["fx", "fy", "fz"]);
    names.enumerate().fold(CHANNELS.to_owned(), |text, (place, name)| {
        text.replace(&format!("\"{name}\""), &(place + 1 + offset).to_string())
    })
}

#[test]
fn files_are_read_as_programs_write_them() {
    let plain = Motion::default().csv();
    let rows = plain.split_once('\n').unwrap().1;
    let semicolons = plain.replace(',', ";");
    let utf16: Vec<u8> = plain.encode_utf16().flat_map(u16::to_be_bytes).collect();
    same("blanks", load(plain.replace(',', " ").as_bytes(), CHANNELS, ""));
    same("comments", load(format!("# by a logger\n{plain}").as_bytes(), CHANNELS, ""));
    same("sep=", load(format!("sep=,\n{plain}").as_bytes(), CHANNELS, ""));
    same("lines above", load(format!("\"a\",\"b\"\n\"c\",1\n{plain}").as_bytes(), CHANNELS, ""));
    same("decimal commas", load(semicolons.replace('.', ",").as_bytes(), CHANNELS, ""));
    same("UTF-16", load(&utf16, CHANNELS, ""));
    same("by number", load(plain.as_bytes(), &by_number(0), ""));
    same("no header", load(rows.as_bytes(), &by_number(0), ""));
    same("no header, said so", load(rows.as_bytes(), &by_number(0), "csv = { header = false }"));
    same("bars", load(plain.replace(',', "|").as_bytes(), CHANNELS, ""));
    let quoted =
        plain.split_once('\n').unwrap().0.split(',').map(|name| format!("\"{name}\"")).collect::<Vec<_>>();
    same(
        "names in marks behind blanks",
        load(format!("{}\n{rows}", quoted.join(", ")).as_bytes(), CHANNELS, ""),
    );
    let framed: String =
        plain.lines().enumerate().map(|(row, line)| format!("{row};{}\n", line.replace(',', ";"))).collect();
    same("a number in front", load(framed.as_bytes(), &by_number(1), ""));
    let twice = plain.replacen(",px,", ",qx,", 1);
    same(
        "a name twice",
        load(twice.as_bytes(), &CHANNELS.replace("\"px\"", "6").replace("\"qx\"", "12"), ""),
    );
    same("a key", load(format!("t,m1,m2\n{plain}").as_bytes(), CHANNELS, "csv.header_line = 2"));
    same(
        "a key of the delimiter",
        load(plain.replace(',', "|").as_bytes(), CHANNELS, "csv.delimiter = \"|\""),
    );
    let stamp = |line: &str| {
        let (time, rest) = line.split_once(',').unwrap();
        let second = 86_395.0 + time.parse::<f64>().unwrap_or(0.0);
        let (day, second) = if second < 86_400.0 { ("02", second) } else { ("03", second - 86_400.0) };
        let (hour, minute) = ((second / 3600.0).floor(), (second / 60.0).floor() % 60.0);
        format!("2031-01-{day} {hour:02}:{minute:02}:{:05.2},{rest}\n", second % 60.0)
    };
    let clock = "t,".to_owned() + plain.split_once(',').unwrap().1.split_once('\n').unwrap().0 + "\n";
    let clock = clock + &rows.lines().map(stamp).collect::<String>();
    same("times of day", load(clock.as_bytes(), &CHANNELS.replace("\"s\"", "\"wall clock\""), ""));
}

#[test]
fn minus_signs_of_unicode_are_read() {
    let plain = Motion::default().csv();
    assert!(plain.contains(",-"), "the log has negative numbers");
    same("commas", load(plain.replace(",-", ",\u{2212}").as_bytes(), CHANNELS, ""));
    let semicolons = plain.replace(',', ";").replace('.', ",").replace(";-", ";\u{2212}");
    same("decimal commas", load(semicolons.as_bytes(), CHANNELS, ""));
}

/// The position alone, the cells of `px` written by `cell`.
fn with_cells(cell: impl Fn(usize, &str) -> String) -> String {
    let plain = Motion::default().csv();
    let (header, rows) = plain.split_once('\n').unwrap();
    let line = |(row, line): (usize, &str)| {
        let mut cells: Vec<String> = line.split(',').map(str::to_owned).collect();
        cells[5] = cell(row, &cells[5]);
        cells.join(";") + "\n"
    };
    format!("{}\n{}", header.replace(',', ";"), rows.lines().enumerate().map(line).collect::<String>())
}

// If these cells were left out, the others would be chosen by their values.
#[test]
fn numbers_in_a_form_that_is_not_read_are_refused_and_words_are_not() {
    let in_brackets = |_: usize, cell: &str| {
        cell.strip_prefix('-').map_or_else(|| cell.to_owned(), |size| format!("({size})"))
    };
    let told = ["column `px`", "expected a number, found `(", "and the like in ", " of 1001 cells"];
    says("brackets for negative numbers", load(with_cells(in_brackets).as_bytes(), CHANNELS, ""), &told);
    let with_unit =
        |row: usize, cell: &str| if row.is_multiple_of(3) { format!("{cell} m") } else { cell.to_owned() };
    says(
        "units in cells",
        load(with_cells(with_unit).as_bytes(), CHANNELS, ""),
        &["line 2, column `px`", " m`"],
    );
    for word in ["", "nan", "N/A", "-1.#IND"] {
        let words =
            |row: usize, cell: &str| if row.is_multiple_of(3) { word.to_owned() } else { cell.to_owned() };
        let notes = load(with_cells(words).as_bytes(), CHANNELS, "").unwrap().notes;
        assert!(
            notes[0].contains("position: 334 of 1001 samples have no finite number"),
            "{word}: {notes:?}"
        );
    }
    let once =
        |row: usize, cell: &str| if row.is_multiple_of(50) { format!("({cell})") } else { cell.to_owned() };
    assert!(load(with_cells(once).as_bytes(), CHANNELS, "").is_ok());
}

#[test]
fn files_that_need_a_key_are_refused_with_it() {
    let plain = Motion::default().csv();
    let rows = plain.split_once('\n').unwrap().1;
    let dated = plain.replace("\n", "\n2031-01-02 10:00:0");
    says(
        "no header",
        load(rows.as_bytes(), CHANNELS, ""),
        &["line 1", "header", "`0.00`", "\"#1\"", "csv.header_line"],
    );
    for (what, delimiter) in [("no header, blanks", " "), ("no header, tabs", "\t")] {
        let loaded = load(rows.replace(',', delimiter).as_bytes(), CHANNELS, "");
        says(what, loaded, &["line 1", "expected a header", "found numbers (`0.00`, ", "\"#1\""]);
    }
    says(
        "dates",
        load(dated.as_bytes(), CHANNELS, ""),
        &["`time`", "2031-01-02 10:00:0", "line 2, column `t`", "wall clock"],
    );
    says(
        "a name twice",
        load(plain.replacen(",px,", ",qx,", 1).as_bytes(), CHANNELS, ""),
        &["`qx` stands 2 times", "6, 12", "\"#6\""],
    );
    says(
        "words",
        load(plain.replace(",100,", ",on,").as_bytes(), CHANNELS, ""),
        &["`command`", "line 2, column `m1`", "`on`"],
    );
    says(
        "escapes",
        load(b"\x1b[31mt\x07,x,yes,another\n0,1,2,3\n", CHANNELS, ""),
        &["no column `t`", "\\u{1b}[31mt\\u{7}, x"],
    );
    says("commas", load(plain.replace('.', ",").as_bytes(), CHANNELS, ""), &["line 2", "decimal"]);
    says("a wrong key", load(plain.as_bytes(), CHANNELS, "csv.decimal = \";\""), &["decimal"]);
    says(
        "a wrong line",
        load(plain.as_bytes(), CHANNELS, "csv.header_line = 5000"),
        &["csv.header_line", "1002 lines"],
    );
    says(
        "number 0",
        load(plain.as_bytes(), &CHANNELS.replace("\"px\"", "0"), ""),
        &["number of a column from 1"],
    );
    says(
        "number 99",
        load(plain.as_bytes(), &CHANNELS.replace("\"px\"", "99"), ""),
        &["no column `#99`", "29 columns"],
    );
    says("empty", load(b"", CHANNELS, ""), &["empty"]);
    let start = |lines: usize| plain.lines().take(lines).map(|line| format!("{line}\n")).collect::<String>();
    let blank = format!("{}{}\n", start(1), ",".repeat(28));
    for (what, text, parts) in [
        ("header alone", start(1), ["log.csv", "line 1: expected at least 2 rows", "found none"]),
        ("a row without cells", blank, ["log.csv", "line 1: expected at least 2 rows", "found none"]),
        (
            "one row",
            start(2),
            ["log.csv", "line 2: expected at least 2 rows", "found 1 before the file ends"],
        ),
    ] {
        says(what, load(text.as_bytes(), CHANNELS, ""), &parts);
    }
}

#[test]
fn foreign_files_are_named_whatever_they_are_called() {
    let kinds: [(&[u8], &str); 6] = [
        (b"#ROSBAG V2.0\n\x00\x01\x02", "rosbags-convert"),
        (b"SQLite format 3\x00\x1b[31m", "mcap convert"),
        (b"H Product:Blackbox flight data recorder\n\x00\x01", "blackbox_decode"),
        (b"\x1f\x8b\x08\x00\xff\xfe", "gunzip"),
        (b"PK\x03\x04\x00\x00", "unzip"),
        (b"version https://git-lfs.github.com/spec/v1\noid sha256:0\nsize 1\n", "git lfs pull"),
    ];
    let place = Place::new();
    for name in ["log.csv", "log.ulg", "log.mcap", "log"] {
        for (bytes, advice) in kinds {
            place.write(name, bytes);
            let refused = place.load(name, CHANNELS, "").map_err(|error| error.to_string());
            says(name, refused, &[advice, "not read"]);
        }
    }
    let mut old = b"\xbc\x01\x00\x01\x00\x00\x00fixedFrequency\x00\x11\x00motor.m1(H)\x00".to_vec();
    old.extend(crc32(&old).to_le_bytes());
    place.write("log", &old);
    let refused =
        place.load("log", &CHANNELS.replace("time", "# time"), "").map_err(|error| error.to_string());
    let plain = CHANNELS.replace("time", "# time");
    for (key, extra) in [("`csv`", "csv = { header_line = 2 }"), ("`recording`", "recording = 1")] {
        let refused = place.load("log", &plain, extra).map_err(|error| error.to_string());
        says(key, refused, &[key, "a CSV file", "remove it"]);
    }
    says("a Crazyflie's version 1", refused, &["version 1", "newer firmware"]);
}

#[test]
fn several_recordings_in_a_file_are_refused_or_chosen() {
    let plain = Motion::default().csv();
    let rows = plain.split_once('\n').unwrap().1;
    let later = Motion { length_unit: 0.5, ..Motion::default() }.csv();
    let whole = format!("{later}{rows}");
    let refused = |text: &str, extra: &str| load(text.as_bytes(), CHANNELS, extra);
    says(
        "two",
        refused(&whole, ""),
        &["`time`", "2 recordings", "line 1003", "from 10 s to 0 s", "recording"],
    );
    says("two files", refused(&format!("{plain}{plain}{rows}"), ""), &["3 recordings", "line 1004, 2005"]);
    says("the third", refused(&whole, "recording = 3"), &["`recording`", "3 of 2"]);
    says("none", refused(&whole, "recording = 0"), &["recording"]);
    same("the second", refused(&whole, "recording = 2"));
    same("the only one", refused(&plain, "recording = 1"));
    let first = refused(&whole, "recording = 1\ntrust_units = true").unwrap();
    assert_eq!((first.position.values.len(), first.position.values[0][1]), (1001, 0.5));
    // A step back of some samples is not a recording of its own.
    let late: Vec<&str> = plain.lines().collect();
    let late = [&late[..500], &late[495..]].concat().join("\n");
    assert_eq!(refused(&late, "").unwrap().position.values.len(), 1001);
}

#[test]
fn times_that_do_not_run_forward_are_refused_by_what_they_do() {
    let plain = Motion::default().csv();
    let (header, rows) = plain.split_once('\n').unwrap();
    let with_time = |of: &dyn Fn(usize, &str) -> String| -> String {
        let row = |(index, line): (usize, &str)| {
            let (time, rest) = line.split_once(',').unwrap();
            format!("{},{rest}\n", of(index, time))
        };
        format!("{header}\n{}", rows.lines().enumerate().map(row).collect::<String>())
    };
    let load = |text: &str, channels: &str| load(text.as_bytes(), channels, "");
    let falling = with_time(&|index, _| format!("{}", 10.0 - 0.01 * index as f64));
    says(
        "falling",
        load(&falling, CHANNELS),
        &[
            "`time`",
            "times that increase",
            "fall in 1000 of 1000 steps",
            "10 s in line 2 to 9.99 s in line 3",
            "column `t`",
        ],
    );
    same("counted down", load(&falling, &CHANNELS.replace("\"t\"", "\"-t\"")));
    let sorted = with_time(&|index, _| format!("{}", 0.01 * (index * 300 % 1001) as f64));
    says(
        "sorted by another column",
        load(&sorted, CHANNELS),
        &["299 of 1000 steps", "sort the rows by time"],
    );
    let still = with_time(&|_, _| "5".to_owned());
    says(
        "still",
        load(&still, CHANNELS),
        &["the same time, 5 s, in all 1001 rows, column `t`", "name the column"],
    );
    let words = with_time(&|index, time| if index % 5 == 0 { time.to_owned() } else { "late".to_owned() });
    says(
        "words",
        load(&words, CHANNELS),
        &[
            "`time`",
            "numbers in s",
            "none in 800 of 1001 rows, first `late` in line 3, column `t`",
            "wall clock",
        ],
    );
    let blank = with_time(&|index, time| if index % 5 == 0 { time.to_owned() } else { String::new() });
    says("blank", load(&blank, CHANNELS), &["none in 800 of 1001 rows, first `` in line 3, column `t`"]);
    // Spreadsheets write rows of delimiters alone below a table.
    let below = format!("{plain}{}", ",".repeat(28) + "\n" + &format!("{}\n", ",".repeat(28)).repeat(1500));
    let read = load(&below, CHANNELS).unwrap();
    assert_eq!(read.position.values.len(), 1001);
}

#[test]
fn numbers_are_scaled_before_their_unit() {
    let plain = Motion::default().csv();
    let sensor = Motion { force_unit: 4096.0 / 9.80665, length_unit: 1000.0, ..Motion::default() }.csv();
    let with = |quantity: &str, keys: &str| {
        CHANNELS.replace(&format!("{quantity}, unit"), &format!("{quantity}, {keys}, unit"))
    };
    let force = "[\"fx\", \"fy\", \"fz\"]";
    let counts = with(force, "scale = 2.44140625e-4")
        .replace("\"m/s^2\"", "\"g\"")
        .replace("unit = \"m\" ", "unit = \"mm\" ");
    same("counts of an accelerometer", load(sensor.as_bytes(), &counts, ""));
    same("an offset", load(plain.as_bytes(), &with("[\"t\"]", "scale = 1, offset = 5"), ""));
    same("ticks", load(plain.as_bytes(), &with("[\"t\"]", "scale = 1000").replace("\"s\"", "\"ms\""), ""));
    let each = with(force, "scale = [1, 2, 0.5], offset = [0.5, 0, 0]");
    let read = load(plain.as_bytes(), &each, "trust_units = true").unwrap();
    let (row, logged) = (read.specific_force.values[7], self::plain().specific_force.values[7]);
    assert!((row[0] - logged[0] - 0.5).abs() < 1e-12 && (row[1] - 2.0 * logged[1]).abs() < 1e-12, "{row:?}");
    let negated = with("[\"-fx\", \"fy\", \"fz\"]", "scale = [-1, 1, 1]");
    same("a sign and a scale", load(plain.as_bytes(), &negated, ""));
    for (keys, parts) in [
        ("scale = 0", &["`scale`", "other than 0"][..]),
        ("scale = nan", &["`scale`", "NaN"]),
        ("offset = inf", &["`offset`", "inf"]),
        ("scale = [1, 2]", &["`scale`", "a list of 3", "a list of 2"]),
        ("scale = \"2\"", &["a number, or a list"]),
    ] {
        says(keys, load(plain.as_bytes(), &with(force, keys), ""), parts);
    }
    says("a wrong scale", load(sensor.as_bytes(), &with(force, "scale = 1"), ""), &["specific_force"]);
}

#[test]
fn an_attitude_can_be_a_rotation_matrix() {
    let names = ["r11", "r12", "r13", "r21", "r22", "r23", "r31", "r32", "r33"];
    let whole = |is_transposed: bool| -> String {
        let flight = plain();
        let text = Motion::default().csv();
        let mut lines = text.lines();
        let header = format!("{},{}\n", lines.next().unwrap(), names.join(","));
        let rows = lines.zip(&flight.attitude.values).map(|(line, [w, x, y, z])| {
            let q = nalgebra::UnitQuaternion::from_quaternion(nalgebra::Quaternion::new(*w, *x, *y, *z));
            let matrix = *q.to_rotation_matrix().matrix();
            let matrix = if is_transposed { matrix } else { matrix.transpose() };
            let cells: Vec<String> = matrix.iter().map(|part| format!("{part:.9}")).collect();
            format!("{line},{}\n", cells.join(","))
        });
        header + &rows.collect::<String>()
    };
    let declared =
        CHANNELS.replace("columns = [\"qx\", \"qy\", \"qz\", \"qw\"]", &format!("matrix = {names:?}"));
    let flight = load(whole(false).as_bytes(), &declared, "").unwrap();
    assert_eq!(flight.notes, [""; 0]);
    let near = |(a, b): (&[f64; 4], &[f64; 4])| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-6);
    assert!(flight.attitude.values.iter().zip(&plain().attitude.values).all(near));
    says("transposed", load(whole(true).as_bytes(), &declared, ""), &["column by column", "would fit"]);
    says(
        "eight",
        load(whole(false).as_bytes(), &declared.replace("\"r11\", ", ""), ""),
        &["`matrix`", "9 names", "found 8"],
    );
    says(
        "both",
        load(whole(false).as_bytes(), &declared.replace("matrix =", "columns = [\"qx\"], matrix ="), ""),
        &["both"],
    );
    let of_position = declared.replace("columns = [\"px\", \"py\", \"pz\"]", "matrix = [\"px\"]");
    says("a position", load(whole(false).as_bytes(), &of_position, ""), &["`matrix`", "`attitude` alone"]);
}

#[test]
fn a_flight_can_lie_in_several_files() {
    let plain = Motion::default().csv();
    let part = |columns: std::ops::Range<usize>, scale: f64| -> String {
        let line = |line: &str| {
            let cells: Vec<&str> = line.split(',').collect();
            let time = cells[0].parse::<f64>().map_or(cells[0].to_owned(), |time| (time * scale).to_string());
            format!("{time},{}\n", cells[columns.clone()].join(","))
        };
        plain.lines().map(line).collect()
    };
    let place = Place::new();
    place.write("log.csv", part(1..5, 1.0).as_bytes());
    place.write("imu.csv", part(15..21, 1.0).replace("t,", "stamp,").as_bytes());
    place.write("mocap.csv", part(5..15, 1e6).replace(',', ";").as_bytes());
    let imu = "file = \"imu.csv\", time = { columns = [\"stamp\"], unit = \"s\" }, columns";
    let mocap = "file = \"mocap.csv\", time = { columns = [\"t\"], unit = \"us\" }, columns";
    let of = |quantity: &str, file: &str, channels: String| {
        channels.replace(&format!("{quantity} = {{ columns"), &format!("{quantity} = {{ {file}"))
    };
    let channels = of("position", mocap, of("attitude", mocap, CHANNELS.to_owned()));
    let channels = of("angular_velocity", imu, of("specific_force", imu, channels));
    let load = |channels: &str| place.load("log.csv", channels, "").map_err(|error| error.to_string());
    same("several files", load(&channels));
    says(
        "no such file",
        load(&channels.replace("imu.csv", "no.csv")),
        &["no.csv", "`angular_velocity`", "cannot read"],
    );
    says(
        "another's time",
        load(&channels.replace("\"stamp\"", "\"t\"")),
        &["imu.csv", "no column `t`", "it has stamp"],
    );
    place.write("mocap.csv", b"\x1f\x8b\x08");
    says("a foreign file", load(&channels), &["mocap.csv", "`position`", "gunzip"]);
}
