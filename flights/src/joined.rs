//! A log in several files: its parts, one after the other on one clock.

use std::path::{Path, PathBuf};

use crate::clean::longest_growing;
use crate::error::{LogError, Spot};
use crate::log::{Log, Samples};

/// Advice on files that are not parts of one log.
const ADVICE: &str = "write all parts with the same columns and types, or make a flight of each file";

/// A part of a log.
pub struct LogPart {
    /// The file.
    pub file: PathBuf,
    /// Its content.
    pub log: Box<dyn Log>,
}

/// A log in several files. Times are on the clock of the first.
pub struct Joined {
    parts: Vec<LogPart>,
}

impl Joined {
    /// The log with these parts, in the order of time; there is one at least.
    ///
    /// # Errors
    /// If their columns differ.
    pub fn of(parts: Vec<LogPart>) -> Result<Self, LogError> {
        let joined = Self { parts };
        for part in &joined.parts[1..] {
            joined.check_columns(part)?;
        }
        Ok(joined)
    }

    /// Refuses a part whose columns are not those of the first.
    fn check_columns(&self, part: &LogPart) -> Result<(), LogError> {
        let first = &self.parts[0];
        let (expected, found) = (first.log.columns(), part.log.columns());
        let Some(at) = (0..expected.len().max(found.len())).find(|at| expected.get(*at) != found.get(*at))
        else {
            return Ok(());
        };
        let named = |columns: &[String]| columns.get(at).map_or("no column".to_owned(), |name| shown(name));
        let expected = format!("{} as column {}, as in {}", named(&expected), at + 1, first.file.display());
        Err(part.refused(LogError::unexpected(Spot::Whole, expected, named(&found), ADVICE)))
    }

    /// Refuses a topic that has another type in some part than in the first.
    fn check_type(&self, topic: &str) -> Result<(), LogError> {
        let kind = |part: &LogPart| part.log.topics().into_iter().find(|(name, _)| name == topic);
        let Some((_, first)) = kind(&self.parts[0]) else { return Ok(()) };
        for part in &self.parts[1..] {
            if let Some((_, other)) = kind(part).filter(|(_, other)| *other != first) {
                let at = Spot::Named("topic", topic.to_owned());
                let expected = format!("the type {first}, as in {}", self.parts[0].file.display());
                return Err(part.refused(LogError::unexpected(at, expected, other, ADVICE)));
            }
        }
        Ok(())
    }

    /// Notes of the parts: those of all parts once, others with the file in front.
    fn merged(&self, notes: &[Vec<String>]) -> Vec<String> {
        let is_common = |note: &String| notes.iter().all(|others| others.contains(note));
        let mut merged: Vec<String> = notes[0].iter().filter(|note| is_common(note)).cloned().collect();
        for (part, notes) in self.parts.iter().zip(notes) {
            let of_part = notes.iter().filter(|note| !is_common(note));
            merged.extend(of_part.map(|note| format!("{}: {note}", part.file.display())));
        }
        merged
    }
}

fn shown(name: &str) -> String {
    format!("`{}`", vehicles::table::shown(name))
}

impl LogPart {
    /// Fault of this part.
    fn refused(&self, cause: LogError) -> LogError {
        LogError::Part { file: self.file.clone(), cause: Box::new(cause) }
    }
}

/// Times of a part's first and last samples.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Span {
    from_s: f64,
    to_s: f64,
}

impl Span {
    /// The span of `time_s` without stray stamps; `None` without any time.
    fn of(time_s: &[f64]) -> Option<Self> {
        let finite: Vec<f64> = time_s.iter().copied().filter(|time_s| time_s.is_finite()).collect();
        let is_kept = longest_growing(&finite);
        let mut kept = finite.iter().zip(is_kept).filter(|(_, is_kept)| *is_kept).map(|(time_s, _)| *time_s);
        let from_s = kept.next()?;
        Some(Self { from_s, to_s: kept.next_back().unwrap_or(from_s) })
    }
}

/// Refuses a part that does not lie behind the one before it.
fn check_order(before: (&Path, Span), after: (&LogPart, Span)) -> Result<(), LogError> {
    let ((first, a), (part, b)) = (before, after);
    if b.from_s >= a.to_s {
        return Ok(());
    }
    let found = format!("times from {:.3} s to {:.3} s", b.from_s, b.to_s);
    let expected = format!(
        "times after those of {}, which has {:.3} s to {:.3} s: a list names the parts of one log in the order of time",
        first.display(),
        a.from_s,
        a.to_s
    );
    let advice = if b.from_s > a.from_s {
        "the parts overlap: cut one of them, or make a flight of each if the clock starts again in each file"
    } else if b.to_s <= a.from_s {
        "list the files in the order of time"
    } else {
        "if the clock starts again in each file, make a flight of each; if one is a copy, leave it out"
    };
    Err(part.refused(LogError::unexpected(Spot::Whole, expected, found, advice)))
}

impl Log for Joined {
    fn samples(&self, topic: Option<&str>, names: &[String]) -> Result<Samples, LogError> {
        topic.map_or(Ok(()), |topic| self.check_type(topic))?;
        let origin_ns = self.parts[0].log.origin_ns();
        let (mut whole, mut notes) = (Samples::default(), Vec::new());
        let mut before: Option<(&Path, Span)> = None;
        for (index, part) in self.parts.iter().enumerate() {
            let mut samples = part.log.samples(topic, names).map_err(|cause| part.refused(cause))?;
            let later_s = (part.log.origin_ns() - origin_ns) as f64 * 1e-9;
            samples.time_s.iter_mut().for_each(|time_s| *time_s += later_s);
            let span = Span::of(&samples.time_s);
            if let Some((before, span)) = before.zip(span) {
                check_order(before, (part, span))?;
            }
            if index > 0 {
                let from_s = before.map_or(f64::NEG_INFINITY, |(_, span)| span.to_s);
                whole.seams.push((from_s, span.map_or(f64::INFINITY, |span| span.from_s)));
            }
            before = span.map(|span| (part.file.as_path(), span)).or(before);
            whole.time_s.append(&mut samples.time_s);
            whole.rows.append(&mut samples.rows);
            notes.push(samples.notes);
        }
        whole.notes = self.merged(&notes);
        Ok(whole)
    }

    fn check_clocks(&self, topics: &[&str]) -> Result<(), LogError> {
        self.parts
            .iter()
            .try_for_each(|part| part.log.check_clocks(topics).map_err(|cause| part.refused(cause)))
    }

    fn topics(&self) -> Vec<(String, String)> {
        self.parts[0].log.topics()
    }

    fn origin_ns(&self) -> i128 {
        self.parts[0].log.origin_ns()
    }

    fn columns(&self) -> Vec<String> {
        self.parts[0].log.columns()
    }
}
