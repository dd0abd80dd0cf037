//! Output of a process: its log in the run directory, bounded, and its last words, bounded and safe to print.

use crate::output_file::LOG_START;
use diagnostics::{printable_line, shortened};
use rustix::fs::{FallocateFlags, fallocate};
use std::fs::{File, OpenOptions};
use std::io::{self, Read as _, Seek as _, SeekFrom};
use std::path::Path;

/// Bytes of a log in the run directory that may take up room: that folder is often memory.
const KEPT_BYTES: u64 = 16 * 1024 * 1024;
/// Bytes at the end of a log that are read: a panic's message stands in front of its backtrace.
const TAIL_BYTES: u64 = 64 * 1024;
/// Lines that are shown.
const LINES: usize = 20;
/// Lines that are shown if the line with the error stands above them: layouts of two messages are as long.
const ERROR_LINES: usize = 160;
/// Characters of a line that are shown: a line without end fills neither memory nor terminal.
const LINE_CHARS: usize = 600;

/// Words that the standard library writes when a thread panics.
const PANIC: &[u8] = b"panicked at";
/// Start of the line with which a program reports the error that ended it.
const ERROR: &[u8] = b"error: ";

/// Returns the last lines of the log at `path`; empty if it cannot be read. After a panic, the lines begin at the
/// last panic's message. Otherwise they reach back to the last error, if that is near the end.
/// Everything that a terminal would interpret is escaped, and so are bytes that are not UTF-8.
pub fn last_words(path: &Path) -> Vec<String> {
    let (bytes, is_cut) = tail(path).unwrap_or_default();
    let bytes = bytes.strip_prefix(LOG_START.as_bytes()).unwrap_or(&bytes);
    // A blank line at the end says nothing, and the first line of a part is a part.
    let mut lines: Vec<&[u8]> = bytes.trim_ascii_end().split(|&byte| byte == b'\n').collect();
    if is_cut && lines.len() > 1 {
        lines.remove(0);
    }
    if bytes.trim_ascii_end().is_empty() {
        return Vec::new();
    }
    let is_panic = |line: &&[u8]| line.windows(PANIC.len()).any(|part| part == PANIC);
    if let Some(start) = lines.iter().rposition(is_panic) {
        return lines[start..].iter().take(LINES).map(|line| printable(line)).collect();
    }
    let last = lines.len().saturating_sub(LINES);
    let is_error =
        |line: &&[u8]| line.len() >= ERROR.len() && line[..ERROR.len()].eq_ignore_ascii_case(ERROR);
    let error = lines.iter().rposition(is_error).filter(|error| lines.len() - error <= ERROR_LINES);
    lines[last.min(error.unwrap_or(last))..].iter().map(|line| printable(line)).collect()
}

/// Gives back the room of all but the end of the log at `path`. Its length does not change, so that its writer goes
/// on behind its end. The removed part reads as zeros. A file system that cannot do this keeps the whole log.
pub fn bound(path: &Path) {
    let Ok(length) = path.metadata().map(|log| log.len()) else { return };
    let Some(gone) = length.checked_sub(KEPT_BYTES).filter(|&gone| gone > KEPT_BYTES) else { return };
    if let Ok(file) = OpenOptions::new().write(true).open(path) {
        let _ = fallocate(&file, FallocateFlags::PUNCH_HOLE | FallocateFlags::KEEP_SIZE, 0, gone);
    }
}

/// The last bytes of a file, and whether there are more in front of them.
fn tail(path: &Path) -> io::Result<(Vec<u8>, bool)> {
    let mut file = File::open(path)?;
    // A log may be a device, whose end cannot be looked at.
    if !file.metadata()?.is_file() {
        return Ok((Vec::new(), false));
    }
    let start = file.metadata()?.len().saturating_sub(TAIL_BYTES);
    file.seek(SeekFrom::Start(start))?;
    let mut bytes = Vec::new();
    file.take(TAIL_BYTES).read_to_end(&mut bytes)?;
    Ok((bytes, start > 0))
}

/// `line` as text that a terminal prints and does not obey: control characters and bytes that are not UTF-8 are
/// escaped as in a Rust string; the middle of a long line is left out.
fn printable(line: &[u8]) -> String {
    let mut text = String::new();
    for chunk in line.utf8_chunks() {
        // Other systems write the end of a line as `\r\n`.
        let valid: String = chunk.valid().replace('\t', " ").replace('\r', "");
        text.push_str(&printable_line(&valid));
        chunk.invalid().iter().for_each(|byte| text.push_str(&format!("\\x{byte:02x}")));
    }
    shortened(&text, LINE_CHARS).into_owned()
}

#[cfg(test)]
mod tests {
    use super::{KEPT_BYTES, LINE_CHARS, LINES, bound, last_words, printable};
    use std::io::Write as _;

    fn lines_of(log: &[u8]) -> Vec<String> {
        let mut file = tempfile::NamedTempFile::new().unwrap();
        file.write_all(log).unwrap();
        last_words(file.path())
    }

    #[test]
    fn the_last_lines_are_shown_and_a_panic_from_its_message_on() {
        let numbered: String = (0..100).map(|n| format!("line {n}\n")).collect();
        let lines = lines_of(numbered.as_bytes());
        assert_eq!(
            (lines.len(), lines[0].as_str(), lines[LINES - 1].as_str()),
            (LINES, "line 80", "line 99")
        );
        let panic = format!("thread 'main' panicked at src/x.rs:1:1:\nthe propeller came off\n{numbered}");
        assert_eq!(lines_of(panic.as_bytes())[1], "the propeller came off");
        assert!(lines_of(b"").is_empty() && lines_of(b"\n\n").is_empty());
        assert!(last_words("/nowhere/log".as_ref()).is_empty());
        assert!(last_words("/dev/zero".as_ref()).is_empty(), "a device has no end");
    }

    #[test]
    fn an_error_of_many_lines_is_shown_from_its_first_on() {
        let rows: String = (0..60).map(|n| format!("  row {n}\n")).collect();
        let lines = lines_of(format!("before\nError: layout mismatch on topic /a/b\n{rows}").as_bytes());
        assert_eq!((lines.len(), lines[0].as_str()), (61, "Error: layout mismatch on topic /a/b"));
        let lines = lines_of(b"the battery is low\nerror: it is empty\n");
        assert_eq!(lines, ["the battery is low", "error: it is empty"]);
        let lines = lines_of(format!("error: long ago\n{}", rows.repeat(9)).as_bytes());
        assert_eq!((lines.len(), lines[0].as_str()), (LINES, "  row 40"));
    }

    #[test]
    fn a_line_without_end_is_cut() {
        let lines = lines_of(&vec![b'x'; 5_000_000]);
        assert_eq!(lines.len(), 1);
        assert!(lines[0].chars().count() < LINE_CHARS + 50, "{}", lines[0]);
        assert!(lines[0].contains("characters left out"));
    }

    #[test]
    fn a_flood_is_read_from_its_end() {
        let mut flood = b"panicked at the very start\n".to_vec();
        flood.extend(b"noise noise noise noise\n".repeat(100_000));
        flood.extend(b"the last line\n");
        let lines = lines_of(&flood);
        assert_eq!((lines.len(), lines[LINES - 1].as_str()), (LINES, "the last line"));
    }

    #[test]
    fn a_log_that_has_grown_long_keeps_its_end_and_takes_up_little() {
        use std::os::unix::fs::MetadataExt as _;
        let mut file = tempfile::NamedTempFile::new().unwrap();
        let line = [&[b'x'; 1023][..], b"\n"].concat();
        (0..4 * KEPT_BYTES / 1024).for_each(|_| file.write_all(&line).unwrap());
        file.write_all(b"the last line\n").unwrap();
        bound(file.path());
        let log = file.as_file().metadata().unwrap();
        assert!(log.blocks() * 512 < 2 * KEPT_BYTES && log.len() > 4 * KEPT_BYTES, "{log:?}");
        assert_eq!(last_words(file.path()).last().unwrap(), "the last line");
    }

    #[test]
    fn nothing_reaches_a_terminal_raw() {
        assert_eq!(printable(b"\x1b]0;owned\x07\x1b[2J"), "\\u{1b}]0;owned\\u{7}\\u{1b}[2J");
        assert_eq!(printable(b"caf\xc3\xa9 \xff\xfe\tend\r"), "café \\xff\\xfe end");
        // CSI as one character of the upper control set, and a change of direction.
        assert_eq!(printable("\u{9b}2J \u{202e}".as_bytes()), "\\u{9b}2J \\u{202e}");
    }
}
