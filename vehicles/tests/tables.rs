//! Tables of measurements as programs write them: read, or refused with the line and the key.

use vehicles::table::{Delimiter, Dialect, Table};

/// Content of every readable table of these tests.
const WANTED: [&str; 3] = ["t", "x", "y"];
const TIMES: [f64; 3] = [0.5, 1.25, 2.0];

fn read(bytes: &[u8], wanted: &[&str], dialect: &Dialect) -> Result<Table, String> {
    Table::parse(bytes, wanted, dialect)
        .and_then(|table| table.check_lengths().map(|()| table))
        .map_err(|error| error.to_string())
}

fn column(table: &Table, name: &str) -> Vec<f64> {
    table.numbers(table.column(name).unwrap_or_else(|error| panic!("{error}"))).collect()
}

#[test]
fn tables_are_read_as_programs_write_them() {
    let plain = "t,x,y\n0.5,1,-1\n1.25,2,-2\n2,3,-3\n";
    let by_blanks = plain.replace(',', " ");
    let with_comma = plain.replace(',', ";").replace('.', ",");
    let mut utf16 = vec![0xFF, 0xFE];
    utf16.extend(plain.encode_utf16().flat_map(u16::to_le_bytes));
    let explorer: String = (0..180).map(|line| format!("\"key {line}\",{line}\n")).collect();
    let cases: Vec<(&str, Vec<u8>)> = vec![
        ("commas", plain.into()),
        ("semicolons", plain.replace(',', ";").into()),
        ("tabs", plain.replace(',', "\t").into()),
        ("blanks", by_blanks.clone().into()),
        ("columns of blanks", by_blanks.replace(' ', "    ").replace('\n', "  \n  ").into()),
        ("blanks and names in quotation marks", by_blanks.replacen("x y", "\"x\" \"y\"", 1).into()),
        ("line ends of Windows", plain.replace('\n', "\r\n").into()),
        ("line ends of old systems", plain.replace('\n', "\r").into()),
        ("a byte order mark", format!("\u{feff}{plain}").into()),
        ("UTF-16", utf16),
        ("sep=", format!("sep=;\r\n{}", plain.replace(',', ";")).into()),
        ("sep= in quotation marks", format!("\"SEP=|\"\n{}", plain.replace(',', "|")).into()),
        ("sep=, and blank lines", format!("\nsep=,\n\n{plain}").into()),
        ("comments", format!("# made by \"a\n# 2031-01-02, at noon\n{plain}").into()),
        ("comments of MATLAB", format!("% made by a logger\n\n{plain}").into()),
        ("comments of C", format!("// made by a logger\n{plain}").into()),
        ("a header within a comment", format!("# {plain}").into()),
        (
            "a header within a comment, rows by blanks",
            format!("# t,x,y\n{}", by_blanks.split_once('\n').unwrap().1).into(),
        ),
        (
            "lines above",
            format!("\"Product\",\"Recorder of mine\"\n\"craft\",\"test\"\n\"minthrottle\",1070\n{plain}")
                .into(),
        ),
        ("200 lines above", format!("{explorer}{plain}").into()),
        ("lines above, of other lengths", format!("Take,1.23,a,b,c,d\n\nt,Marker\n{plain}").into()),
        ("decimal commas", with_comma.clone().into()),
        ("decimal commas by tabs", with_comma.replace(';', "\t").into()),
        ("decimal commas by blanks", with_comma.replace(';', " ").into()),
        ("decimal commas in quotation marks", "t,x,y\n\"0,5\",1,-1\n\"1,25\",2,-2\n2,3,-3\n".into()),
        ("other columns with commas", "t;x;y;note\n0.5;1;-1;1,5\n1.25;2;-2;2,5\n2;3;-3;3,5\n".into()),
        ("other columns twice", "t,x,y,z,z\n0.5,1,-1,0,0\n1.25,2,-2,0,0\n2,3,-3,0,0\n".into()),
        ("empty cells at the end", "t,x,y\n0.5,1,-1,\n1.25,2,-2,,\n2,3,-3,\n".into()),
    ];
    for (name, bytes) in cases {
        let table =
            read(&bytes, &WANTED, &Dialect::default()).unwrap_or_else(|error| panic!("{name}: {error}"));
        assert_eq!(column(&table, "t"), TIMES, "{name}");
        assert_eq!(column(&table, "x"), [1.0, 2.0, 3.0], "{name}");
        assert_eq!(column(&table, "#3"), [-1.0, -2.0, -3.0], "{name}");
    }
}

#[test]
fn a_decimal_comma_behind_many_whole_numbers_is_found() {
    let text = format!("t;x;y\n{}0,5;1;-1\n", "0;1;-1\n".repeat(5000));
    let table = read(text.as_bytes(), &WANTED, &Dialect::default()).unwrap();
    assert_eq!(column(&table, "t").last(), Some(&0.5));
}

#[test]
fn columns_are_named_by_number_without_a_header() {
    let rows = "0.5,1,-1\n1.25,2,-2\n2,3,-3\n";
    let cases = [
        rows.to_owned(),
        rows.replace(',', "\t"),
        rows.replace(',', "  "),
        rows.replace(',', ";").replace('.', ","),
        rows.replace(',', " ").replace('.', ","),
        format!("# made by a logger\n{rows}"),
        format!("\"minthrottle\",1070\nt,x,x\ns,m,m\n{rows}"),
        format!("sep=,\n{rows}"),
    ];
    for text in cases {
        for header in [None, Some(false)] {
            let dialect = Dialect { header, ..Dialect::default() };
            let table = read(text.as_bytes(), &["#1", "#3"], &dialect)
                .unwrap_or_else(|error| panic!("{text:?}: {error}"));
            assert_eq!(
                (column(&table, "#1"), column(&table, "#3")),
                (TIMES.to_vec(), vec![-1.0, -2.0, -3.0]),
                "{text:?}"
            );
            let line = text.lines().position(|line| line.starts_with("0")).unwrap() as u64 + 1;
            assert_eq!((table.rows.len(), table.rows.get(0).unwrap().line), (3, line), "{text:?}");
        }
    }
    let table = read(rows.as_bytes(), &["#1"], &Dialect::default()).unwrap();
    assert_eq!(
        table.column("#4").unwrap_err().to_string(),
        "no column `#4`; it has 3 columns; the first is \"#1\", the last \"#3\""
    );
    let named = read(b"#1,#timestamp,a\n1,2,3\n", &["#timestamp"], &Dialect::default()).unwrap();
    assert_eq!((named.column("#1"), named.column("#3"), named.column("#timestamp")), (Ok(0), Ok(2), Ok(1)));
}

#[test]
fn keys_say_what_a_file_does_not_show() {
    let dialect = |keys: &str| toml::from_str::<Dialect>(keys).unwrap_or_else(|error| panic!("{error}"));
    let cases = [
        ("header_line = 3", "t,x,y\n9,9,9\nt,x,y\n0.5,1,-1\n1.25,2,-2\n2,3,-3\n"),
        ("delimiter = \"|\"", "t|x|y\n0.5|1|-1\n1.25|2|-2\n2|3|-3\n"),
        ("delimiter = \" \"", "t x y\n0.5 1 -1\n1.25 2 -2\n2 3 -3\n"),
        ("decimal = \",\"", "t;x;y;z\n0,500;1;-1;1.5\n1,250;2;-2;1.5\n2,000;3;-3;1.5\n"),
        ("decimal = \",\"", "t;x;y\n1,250;1;-1\n1,250;2;-2\n2,000;3;-3\n"),
    ];
    for (keys, text) in cases {
        let table = read(text.as_bytes(), &WANTED, &dialect(keys))
            .unwrap_or_else(|error| panic!("{text:?}: {error}"));
        assert_eq!(
            (column(&table, "t")[1..].to_vec(), column(&table, "x")),
            (TIMES[1..].to_vec(), vec![1.0, 2.0, 3.0]),
            "{text:?}"
        );
    }
}

#[test]
fn what_is_not_shown_is_refused_with_line_and_key() {
    let cases: [(&str, &str, &[&str]); 12] = [
        ("", "4,78.8,1\n5,78.9,1\n", &["line 1", "header", "`4`, `78.8`, `1`", "\"#1\"", "csv.header_line"]),
        ("", "# a\n\n4 7 1\n5 7 1\n", &["line 3", "header"]),
        ("", "time,x,y\n0,1,2\n", &["no column `t`", "it has time, x, y", "csv.header_line", "line 1"]),
        (
            "",
            "Product,Mine\n\u{1b}[31mtime,x,y\n0,1,2\n",
            &["no column `t`", "\\u{1b}[31mtime, x, y", "line 2"],
        ),
        ("", "t,x,x,y\n0,1,2,3\n", &["column `x` stands 2 times", "columns 2, 3", "\"#2\""]),
        ("", "t;x;y\n1,234;1;1\n1,235;1;1\n", &["line 2, column `t`", "`1,234`", "csv.decimal"]),
        ("", "t;x;y\n0.5;1,5;1\n", &["line 2, column `x`", "`1,5`", "`0.5`", "line 2", "csv.decimal"]),
        (
            "",
            "t,x,y\n4,01,78,84,1,0\n4,02,78,84,1,0\n",
            &["line 2", "3 cells", "line 1", "found 6", "decimal", "semicolons"],
        ),
        ("header_line = 9", "t,x,y\n0,1,2\n", &["csv.header_line", "found 9 of 2 lines"]),
        ("header_line = 1\nheader = false", "t,x,y\n0,1,2\n", &["csv.header", "both"]),
        ("", "t,x,\"y\n0,1,2\n", &["line 1", "quotation mark"]),
        ("", "a\n# b\n t,x,y\n0,\"1,2\n", &["line 4, cell 2", "quotation mark"]),
    ];
    for (keys, text, parts) in cases {
        let dialect: Dialect = toml::from_str(keys).unwrap();
        let said = read(text.as_bytes(), &WANTED, &dialect).and_then(|table| {
            let found = WANTED.map(|name| table.column(name).map_err(|error| error.to_string()));
            found.into_iter().collect::<Result<Vec<_>, _>>()
        });
        let said = said.expect_err(text);
        parts.iter().for_each(|part| assert!(said.contains(part), "{text:?}: `{part}` is not in: {said}"));
        assert!(!said.contains('\u{1b}'), "{said:?}");
    }
}

#[test]
fn single_rows_that_are_too_long_have_no_numbers() {
    let table = read(b"t,x,y\n0.5,1,-1\n1,2,5,3,4\n2,3,-3\n", &WANTED, &Dialect::default()).unwrap();
    assert_eq!(
        column(&table, "t").iter().map(|time| time.is_nan()).collect::<Vec<_>>(),
        [false, true, false]
    );
}

#[test]
fn a_delimiter_is_one_character() {
    assert_eq!(Delimiter::try_from("\t".to_owned()), Ok(Delimiter::Byte(b'\t')));
    for keys in
        ["delimiter = \"\"", "delimiter = \"ab\"", "decimal = \"'\"", "header_line = -1", "heder_line = 1"]
    {
        assert!(toml::from_str::<Dialect>(keys).is_err(), "{keys}");
    }
}
