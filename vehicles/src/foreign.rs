//! File formats that are taken for another one, by their first bytes: names them, and the tool that converts each.

use std::fmt;

use crate::encoding;

/// A file that is not of the format that its reader expects.
///
/// ```
/// let found = vehicles::foreign::of(b"\x1f\x8b\x08\x00...").unwrap();
/// assert_eq!(found.to_string(), "it is compressed (gzip), which is not read here; unpack it: `gunzip FILE`");
/// assert!(vehicles::foreign::of(b"t,x\n0,1\n").is_none());
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Foreign {
    /// Name of the format, as "it is NAME".
    pub name: &'static str,
    /// Way to a file that is read.
    pub advice: &'static str,
}

impl fmt::Display for Foreign {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "it is {}, which is not read here; {}", self.name, self.advice)
    }
}

impl std::error::Error for Foreign {}

const EXPORT: &str = "load it in the program that wrote it, and write it as CSV";
const FROM_PYTHON: &str = "load it with NumPy, and write it as CSV: `numpy.savetxt(FILE, rows, delimiter=\",\", header=\"t,...\", \
                           comments=\"\")`";
const FROM_PANDAS: &str = "load it with pandas, and write it as CSV: `frame.to_csv(FILE, index=False)`";
const FROM_MATLAB: &str = "load it in MATLAB, and write it as CSV: `writetable(struct2table(...), FILE)`";
const FROM_SPREADSHEET: &str = "save the sheet as CSV";
const IN_UTF32: &str = "a text in UTF-32";
const TO_UTF8: &str = "write it as UTF-8: `iconv -f UTF-32 -t UTF-8 FILE > FILE.csv`";
const DATAFLASH_TEXT: &str = "a dataflash log as text (ArduPilot's .log)";
const FROM_DATAFLASH_TEXT: &str = "name the .BIN of the same flight in a flights file, or write a message as CSV: \
                                   `mavlogdump.py --format csv --types IMU FILE.log > FILE.csv` (Python package pymavlink)";
const IN_FLIGHTS: &str = "a flights file can name it (docs/flights.md); here, write it as CSV";

/// First bytes, name, advice.
type Magic = (&'static [u8], &'static str, &'static str);

const MAGIC: [Magic; 36] = [
    (b"\x89MCAP0\r\n", "a recording (MCAP)", IN_FLIGHTS),
    (b"ULog\x01\x12\x35", "a ULog of PX4", IN_FLIGHTS),
    (b"\xbc\x01\x00", "the card log of a Crazyflie, version 1", "log with newer firmware"),
    (b"\xbc\x02\x00", "the card log of a Crazyflie", IN_FLIGHTS),
    (
        b"#ROSBAG V",
        "a bag of ROS 1",
        "make a ROS 2 bag of it: `rosbags-convert --src FILE --dst FOLDER --dst-storage mcap` (Python package rosbags)",
    ),
    (
        b"SQLite format 3\0",
        "a database (SQLite; ROS 2 bags with the ending .db3 are such)",
        "make an MCAP file of the bag: `mcap convert FILE.db3 FILE.mcap`",
    ),
    (b"\xa3\x95", "a dataflash log (ArduPilot's .BIN)", IN_FLIGHTS),
    (
        b"H Product:Blackbox flight data recorder",
        "a Blackbox log (Betaflight, INAV)",
        "write it as CSV: `blackbox_decode FILE`, or export it from Blackbox Explorer",
    ),
    (b"PAR1", "a Parquet file", IN_FLIGHTS),
    (b"ORC", "an ORC file", FROM_PANDAS),
    (b"ARROW1\0\0", "an Arrow (Feather) file", FROM_PANDAS),
    (b"FEA1", "a Feather file", FROM_PANDAS),
    (b"\x93NUMPY", "a NumPy array (.npy)", FROM_PYTHON),
    (b"MATLAB 5.0 MAT-file", "a MAT-file of MATLAB", FROM_MATLAB),
    (b"MATLAB 7.3 MAT-file", "a MAT-file of MATLAB (HDF5)", FROM_MATLAB),
    (b"\x89HDF\r\n\x1a\n", "an HDF5 file", FROM_PANDAS),
    (
        b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1",
        "a document of older Office (Excel's .xls is such)",
        FROM_SPREADSHEET,
    ),
    (
        b"version https://git-lfs.github.com/spec/",
        "a pointer of Git LFS, without the file's content",
        "fetch it: `git lfs pull`",
    ),
    (
        b"/annex/objects/",
        "a pointer of git-annex, without the file's content",
        "fetch it: `git annex get FILE`",
    ),
    (b"\x1f\x8b", "compressed (gzip)", "unpack it: `gunzip FILE`"),
    (b"BZh", "compressed (bzip2)", "unpack it: `bunzip2 FILE`"),
    (b"\xfd7zXZ\0", "compressed (xz)", "unpack it: `unxz FILE`"),
    (b"\x28\xb5\x2f\xfd", "compressed (Zstandard)", "unpack it: `unzstd FILE`"),
    (b"\x04\x22\x4d\x18", "compressed (LZ4)", "unpack it: `unlz4 FILE`"),
    (b"7z\xbc\xaf\x27\x1c", "an archive (7z)", "unpack it: `7z x FILE`"),
    (b"Rar!\x1a\x07", "an archive (RAR)", "unpack it: `unrar x FILE`"),
    (b"%PDF-", "a PDF document", EXPORT),
    (b"\xff\xfe\0\0", IN_UTF32, TO_UTF8),
    (b"\0\0\xfe\xff", IN_UTF32, TO_UTF8),
    (b"\x89PNG\r\n\x1a\n", "an image (PNG)", EXPORT),
    (b"\x80\x02", "a pickle of Python", FROM_PANDAS),
    (b"\x80\x03", "a pickle of Python", FROM_PANDAS),
    (b"\x80\x04", "a pickle of Python", FROM_PANDAS),
    (b"\x80\x05", "a pickle of Python", FROM_PANDAS),
    (b"\x7fELF", "a program", "name the log"),
    (b"PK\x05\x06", "an empty archive (ZIP)", "name the log"),
];

/// Parts of the names within a ZIP archive, and the format of which they are.
const ZIPPED: [Magic; 6] = [
    (b".npy", "an archive of NumPy arrays (.npz)", FROM_PYTHON),
    (b"[Content_Types].xml", "an Excel workbook (.xlsx)", FROM_SPREADSHEET),
    (b"xl/", "an Excel workbook (.xlsx)", FROM_SPREADSHEET),
    (b"_rels/.rels", "an Excel workbook (.xlsx)", FROM_SPREADSHEET),
    (b"opendocument.spreadsheet", "a LibreOffice sheet (.ods)", FROM_SPREADSHEET),
    (
        b"",
        "an archive (ZIP; Excel's .xlsx and NumPy's .npz are such)",
        "unpack it: `unzip FILE`; of a sheet or of arrays, write CSV",
    ),
];

/// Beginnings of texts that are not tables, after blanks, in lower case.
const TEXTS: [Magic; 11] = [
    (b"fmt, 128,", DATAFLASH_TEXT, FROM_DATAFLASH_TEXT),
    (b"fmt,128,", DATAFLASH_TEXT, FROM_DATAFLASH_TEXT),
    (b"{\\rtf", "a document (RTF)", EXPORT),
    (b"<!doctype html", "a web page (HTML)", "download the file itself; the page may ask for a login"),
    (b"<html", "a web page (HTML)", "download the file itself; the page may ask for a login"),
    (b"<?xml", "XML", EXPORT),
    (b"<robot", ROBOTS[0].1, EXPORT),
    (b"<sdf", ROBOTS[1].1, EXPORT),
    (b"{", "JSON", FROM_PANDAS),
    (b"[{", "JSON", FROM_PANDAS),
    (b"rosbag2_bagfile_information:", "the metadata of a ROS 2 bag", "name the .mcap file beside it"),
];

/// Elements of robot descriptions in XML.
const ROBOTS: [(&[u8], &str); 3] = [
    (b"<robot", "a robot description (URDF)"),
    (b"<sdf", "a robot description (SDF)"),
    (b"<mujoco", "a robot description (MJCF of MuJoCo)"),
];

/// Number of bytes that are looked at for the kind of a file.
const LOOKED_AT: usize = 4096;
/// Share of control characters among the first bytes above which they are not text.
const CONTROL_SHARE: f64 = 0.1;
/// Offset and mark of a tar archive.
const TAR: (usize, &[u8]) = (257, b"ustar");

/// The format of a file with these bytes, where it is neither a text in UTF-8 or UTF-16 nor of an unknown 8-bit encoding.
#[must_use]
pub fn of(bytes: &[u8]) -> Option<Foreign> {
    if bytes.is_empty() {
        return Some(Foreign { name: "empty", advice: "copy the log again, or name another" });
    }
    if bytes.iter().all(u8::is_ascii_whitespace) {
        let name = "empty besides blanks and ends of lines";
        return Some(Foreign { name, advice: "copy the log again, or name another" });
    }
    let first = &bytes[..bytes.len().min(LOOKED_AT)];
    let named = |magic: &Magic| Foreign { name: magic.1, advice: magic.2 };
    if first.starts_with(b"PK\x03\x04") {
        let holds = |part: &[u8]| part.is_empty() || first.windows(part.len()).any(|window| window == part);
        return ZIPPED.iter().find(|magic| holds(magic.0)).map(named);
    }
    if first.get(TAR.0..).is_some_and(|rest| rest.starts_with(TAR.1)) {
        return Some(Foreign { name: "an archive (tar)", advice: "unpack it: `tar xf FILE`" });
    }
    // A short word can be the name of a column.
    let is_word = |magic: &Magic| magic.0.len() <= 4 && magic.0.is_ascii() && !has_control(magic.0);
    let is_binary = has_control(first) || !first.is_ascii();
    let is_meant = |magic: &&Magic| first.starts_with(magic.0) && (is_binary || !is_word(magic));
    let by_magic = MAGIC.iter().find(is_meant).map(named);
    by_magic.or_else(|| telemetry(first)).or_else(|| text(first)).or_else(|| binary(bytes))
}

/// True for a control character that texts do not have.
fn is_control(byte: u8) -> bool {
    byte.is_ascii_control() && !matches!(byte, b'\t' | b'\n' | b'\r' | 0x0c | 0x1a)
}

fn has_control(bytes: &[u8]) -> bool {
    bytes.iter().any(|byte| is_control(*byte))
}

/// MAVLink messages behind a time each, big-endian in microseconds since 1970, as ground stations write them.
fn telemetry(first: &[u8]) -> Option<Foreign> {
    let [0, 4..=7, _, _, _, _, _, _, 0xFE | 0xFD, ..] = first else { return None };
    Some(Foreign {
        name: "a telemetry log (MAVLink's .tlog)",
        advice: "write its messages as CSV: `mavlogdump.py --format csv --types ATTITUDE FILE.tlog > FILE.csv` (Python package \
                 pymavlink)",
    })
}

fn text(first: &[u8]) -> Option<Foreign> {
    let trimmed = first.strip_prefix(b"\xef\xbb\xbf").unwrap_or(first).trim_ascii_start();
    let begins = |magic: &&Magic| begins_with(trimmed, magic.0);
    if let Some(name) = robot(first).filter(|_| begins_with(trimmed, b"<?xml")) {
        return Some(Foreign { name, advice: EXPORT });
    }
    TEXTS.iter().find(begins).map(|magic| Foreign { name: magic.1, advice: magic.2 })
}

fn begins_with(text: &[u8], begin: &[u8]) -> bool {
    text.get(..begin.len()).is_some_and(|found| found.eq_ignore_ascii_case(begin))
}

/// Returns the name of the robot description that a text begins, behind anything above its first element.
#[must_use]
pub fn robot(text: &[u8]) -> Option<&'static str> {
    let first = &text[..text.len().min(LOOKED_AT)];
    let has = |element: &[u8]| first.windows(element.len()).any(|window| window == element);
    ROBOTS.iter().find(|(element, _)| has(element)).map(|(_, name)| *name)
}

/// True for the name of a robot description that `hummingbus new vehicle` converts.
#[must_use]
pub fn is_converted(name: &str) -> bool {
    ROBOTS[..2].iter().any(|(_, converted)| *converted == name)
}

/// Bytes that are not text: only zeros, or too many control characters. UTF-16 is a text.
fn binary(bytes: &[u8]) -> Option<Foreign> {
    let first = &bytes[..bytes.len().min(LOOKED_AT)];
    if first.iter().all(|byte| *byte == 0) {
        let advice = "copy it again: it was not written to its end, or the card is damaged";
        return Some(Foreign { name: "a file of zeros", advice });
    }
    if is_utf32(first) {
        return Some(Foreign { name: IN_UTF32, advice: TO_UTF8 });
    }
    let control = first.iter().filter(|byte| is_control(**byte)).count();
    let is_binary = control as f64 > CONTROL_SHARE * first.len() as f64;
    (is_binary && encoding::utf16(bytes).is_none())
        .then_some(Foreign { name: "binary, of an unknown format", advice: EXPORT })
}

/// True for ASCII characters of four bytes each, in either order.
fn is_utf32(first: &[u8]) -> bool {
    const CHARACTERS_MIN: usize = 2;
    let characters = || first.chunks_exact(4);
    let all = |at: usize| {
        let is_ascii = |character: &[u8]| {
            (0..4).all(
                |byte| if byte == at { (1..0x80).contains(&character[byte]) } else { character[byte] == 0 },
            )
        };
        characters().len() >= CHARACTERS_MIN && characters().all(is_ascii)
    };
    all(0) || all(3)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn padded(begin: &[u8]) -> Vec<u8> {
        [begin, &(0..200).map(|k| (k * 37 % 256) as u8).collect::<Vec<_>>()].concat()
    }

    #[test]
    fn formats_are_named_by_their_first_bytes_with_what_converts_them() {
        let tar = [vec![b'a'; 257], b"ustar\x0000".to_vec()].concat();
        let in_utf32 =
            |text: &str| -> Vec<u8> { text.chars().flat_map(|c| u32::from(c).to_le_bytes()).collect() };
        let marked = [vec![0xff, 0xfe, 0, 0], in_utf32("t,x\n0,1\n")].concat();
        assert_eq!(of(&in_utf32("t,x\n0,1\n")).unwrap().name, IN_UTF32);
        assert!(of(b"\n\r\n \n").unwrap().name.starts_with("empty besides blanks"));
        let cases: [(&[u8], &str, &str); 40] = [
            (b"#ROSBAG V2.0\n", "a bag of ROS 1", "rosbags-convert"),
            (b"SQLite format 3\0", ".db3", "mcap convert"),
            (b"\xa3\x95\x80\x80YFMT", "ArduPilot", "flights file"),
            (b"H Product:Blackbox flight data recorder by N", "Blackbox", "blackbox_decode"),
            (b"\x1f\x8b\x08\0", "gzip", "gunzip"),
            (b"BZh91AY&SY\xf4\x02", "bzip2", "bunzip2"),
            (b"\xfd7zXZ\0", "xz", "unxz"),
            (b"\x28\xb5\x2f\xfd", "Zstandard", "unzstd"),
            (b"\x04\x22\x4d\x18", "LZ4", "unlz4"),
            (b"7z\xbc\xaf\x27\x1c", "7z", "7z x"),
            (b"MATLAB 5.0 MAT-file, Platform: GLNXA64", "MATLAB", "CSV"),
            (b"\x89HDF\r\n\x1a\n", "HDF5", "CSV"),
            (b"PK\x03\x04\x14\0\0\0\0\0arr_0.npy", ".npz", "NumPy"),
            (b"PK\x03\x04\x14\0[Content_Types].xml", ".xlsx", "as CSV"),
            (b"PK\x03\x04\0\0mimetypeapplication/vnd.oasis.opendocument.spreadsheet", ".ods", "as CSV"),
            (b"PK\x03\x04\x14\0log.csv", "ZIP", "unzip"),
            (b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1", ".xls", "as CSV"),
            (b"PAR1\x15\x04", "Parquet", "flights file"),
            (b"ORC\x08\x03", "ORC", "pandas"),
            (
                b"FMT, 128, 89, FMT, BBnNZ, Type,Length,Name,Format,Columns\n",
                "ArduPilot's .log",
                "mavlogdump.py",
            ),
            (b"ARROW1\0\0", "Arrow", "pandas"),
            (b"\x93NUMPY\x01\0v\0", ".npy", "NumPy"),
            (b"\x80\x04\x95", "pickle", "pandas"),
            (b"version https://git-lfs.github.com/spec/v1\noid sha256:12", "Git LFS", "git lfs pull"),
            (b"/annex/objects/SHA256E-s12", "git-annex", "git annex get"),
            (b"\xbc\x01\0\x01\0\0\0fixedFrequency", "version 1", "newer firmware"),
            (b"\xbc\x02\0\x01\0\0\0fixedFrequency", "Crazyflie", "flights file"),
            (b"ULog\x01\x12\x35\x01", "ULog", "flights file"),
            (b"\x89MCAP0\r\n\x01", "MCAP", "flights file"),
            (b"\0\x05\x9f\0\0\0\0\0\xfd\x1c", "telemetry", "mavlogdump.py"),
            (b"  <!DOCTYPE HTML><html>", "web page", "download"),
            (b"<?xml version=\"1.0\"?><log>", "XML", "CSV"),
            (b"<?xml version=\"1.0\"?>\n<!-- mine -->\n<robot>", "URDF", "CSV"),
            (b"\xef\xbb\xbf{\"t\": [0, 1]}", "JSON", "CSV"),
            (b"%PDF-1.4\n1 0 obj\n", "PDF", "CSV"),
            (b"{\\rtf1 hi}", "RTF", "CSV"),
            (&marked, "UTF-32", "iconv"),
            (b"\x7fELF\x02", "program", "name the log"),
            (b"\x01\x02\x03\x04\x05\x06\x07\x08\x00\x01\x02", "unknown format", "CSV"),
            (&tar, "tar", "tar xf"),
        ];
        for (bytes, name, advice) in cases {
            for bytes in [bytes.to_vec(), padded(bytes)] {
                let found = of(&bytes).unwrap_or_else(|| panic!("{bytes:?} is named"));
                assert!(found.name.contains(name) && found.advice.contains(advice), "{bytes:?}: {found}");
            }
        }
        assert_eq!(of(b"").unwrap().name, "empty");
        assert_eq!(of(&[0; 9000]).unwrap().name, "a file of zeros");
    }

    #[test]
    fn texts_are_not_foreign() {
        let in_utf16 = |text: &str, big: bool| -> Vec<u8> {
            text.encode_utf16()
                .flat_map(|unit| if big { unit.to_be_bytes() } else { unit.to_le_bytes() })
                .collect()
        };
        let texts: [&[u8]; 11] = [
            b"t,x\n0,1\n",
            b"PAR1,PAR2\n0,1\n",
            b"ORC,FMT\n0,1\n",
            b"\xef\xbb\xbft;x\r\n0;1\r\n",
            b"# made by a logger\nt,x\n0,1\n",
            b"\"t\",\"x\"\n0,1\n",
            b"t,\xb0C\n0,1\n",
            b"0\t1\n\x1a",
            &[b"\xff\xfe".to_vec(), in_utf16("t,x\n0,1\n", false)].concat(),
            &in_utf16("t,x\n0,1\n", true),
            &in_utf16("t,x\n0,1\n", false),
        ];
        for bytes in texts {
            assert_eq!(of(bytes), None, "{bytes:?}");
        }
    }
}
