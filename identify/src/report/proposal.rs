//! The next flight, as reports hold it.

use crate::search::questions::Question;
use serde::Serialize;
use std::fmt;

/// Standard errors from which on a question counts as answered: its wrong answer then passes the verdict's test (5 %, to one side) in
/// less than one flight of ten.
pub const SEPARATED: f64 = 3.0;

/// A proposed flight, and the separation that it is expected to give.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Proposal {
    /// The open questions.
    pub answers: Vec<Answer>,
    /// The course, part by part; empty if no flight within the limits says anything.
    pub course: Vec<Part>,
    /// Length of the flight in s.
    pub duration_s: f64,
    /// Limits that it keeps.
    pub limits: Limits,
    /// Values that the simulated flight reaches.
    pub reached: Limits,
    /// Limit to raise; `None` if every question is answered, or no limit that was tried helps.
    pub advice: Option<String>,
    /// True if the search was stopped before its end.
    pub was_stopped: bool,
}

/// A question, and the separation that the flight is expected to give.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Answer {
    /// The question.
    pub question: Question,
    /// Expected separation in standard errors.
    pub separation: f64,
    /// The manoeuvre that says most on it.
    pub manoeuvre: Option<String>,
}

/// A part of the course.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Part {
    /// Begin in s.
    pub from_s: f64,
    /// End in s.
    pub to_s: f64,
    /// Manoeuvre.
    pub manoeuvre: String,
    /// Description for a pilot.
    pub description: String,
}

/// Limits of a flight, or the values that it reaches.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Limits {
    /// Least and greatest position along x, y and z of the world, in m.
    pub room_m: [[f64; 2]; 3],
    /// Greatest speed in m/s.
    pub speed_max_m_s: f64,
    /// Greatest tilt in degrees.
    pub tilt_max_deg: f64,
}

impl Answer {
    /// True if the flight is expected to answer the question.
    #[must_use]
    pub fn is_separated(&self) -> bool {
        self.separation >= SEPARATED
    }
}

impl Proposal {
    /// True if the flight is expected to answer at least one question.
    #[must_use]
    pub fn is_worth_flying(&self) -> bool {
        self.answers.iter().any(Answer::is_separated)
    }

    /// Sentences for each question, and the limit to raise.
    #[must_use]
    pub fn sentences(&self) -> Vec<String> {
        let mut sentences: Vec<String> = self.answers.iter().map(Answer::sentences).collect();
        sentences.extend(self.advice.iter().map(|advice| format!("{advice}.")));
        sentences
    }
}

impl Answer {
    fn sentences(&self) -> String {
        let Self { question, separation, .. } = self;
        let (by, needed) = (self.by(), if self.is_separated() { "" } else { ", and 3 are needed" });
        format!(
            "Open question: {question}. The best flight separates its answers by {separation:.1} standard errors{by}{needed}."
        )
    }

    /// The manoeuvre that says most, for a sentence.
    fn by(&self) -> String {
        self.manoeuvre.as_ref().map_or(String::new(), |name| format!(", most of it from {name}"))
    }
}

/// A line of the report.
impl fmt::Display for Answer {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { question, separation, .. } = self;
        let (by, doubt) = (self.by(), if self.is_separated() { "" } else { "; 3 are needed" });
        write!(f, "{question}: expected separation {separation:.1} standard errors{by}{doubt}")
    }
}

impl fmt::Display for Limits {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let axis = |name: &str, [low, high]: [f64; 2]| format!("{name} {low:.2} to {high:.2} m");
        let [x, y, z] = self.room_m;
        let room = [axis("x", x), axis("y", y), axis("z", z)].join(", ");
        write!(f, "{room}, {:.2} m/s, tilt {:.1} deg", self.speed_max_m_s, self.tilt_max_deg)
    }
}

impl fmt::Display for Proposal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let stopped = if self.was_stopped { " (the search was stopped)" } else { "" };
        if self.course.is_empty() {
            writeln!(f, "\nnext flight: none within the limits{stopped}")?;
        } else if self.is_worth_flying() {
            writeln!(f, "\nnext flight: {:.1} s, next-flight.toml{stopped}", self.duration_s)?;
        } else {
            writeln!(
                f,
                "\nnext flight: none worth flying within the limits; the best has {:.1} s{stopped}",
                self.duration_s
            )?;
        }
        writeln!(f, "  limits:  {}", self.limits)?;
        if !self.course.is_empty() {
            writeln!(f, "  reaches: {}", self.reached)?;
        }
        self.answers.iter().try_for_each(|answer| writeln!(f, "  {answer}"))?;
        self.advice.iter().try_for_each(|advice| writeln!(f, "  {advice}"))?;
        self.course.iter().try_for_each(|Part { from_s, to_s, manoeuvre, description }| {
            writeln!(f, "  {from_s:5.1} to {to_s:5.1} s  {manoeuvre}: {description}")
        })
    }
}

#[cfg(test)]
impl Proposal {
    /// A proposal without a course: one question, its separation, and a limit to raise.
    pub(crate) fn of_one_question(question: Question, separation: f64) -> Self {
        let limits =
            Limits { room_m: [[-1.0, 1.0], [-1.0, 1.0], [1.0, 2.0]], speed_max_m_s: 0.5, tilt_max_deg: 5.0 };
        Self {
            answers: vec![Answer { question, separation, manoeuvre: None }],
            course: Vec::new(),
            duration_s: 0.0,
            limits,
            reached: limits,
            advice: Some("Raise speed_max_m_s".to_owned()),
            was_stopped: false,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_flight_that_decides_nothing_is_told_with_the_limit_to_raise() {
        let question = Question::Names { effect: "rotor-drag", rival: "parasitic-drag" };
        let mut proposal = Proposal::of_one_question(question, 1.2);
        assert!(!proposal.is_worth_flying());
        let text = proposal.to_string();
        assert!(text.contains("none within the limits") && text.contains("Raise speed_max_m_s"), "{text}");
        assert!(text.contains("1.2 standard errors; 3 are needed"), "{text}");
        proposal.answers[0].separation = 4.0;
        assert!(proposal.is_worth_flying() && !proposal.to_string().contains("3 are needed"), "{proposal}");
    }
}
