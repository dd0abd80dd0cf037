//! The next flight of `identify`: a flight within stated limits that separates the rivals of the verdict best.
//!
//! | room | content |
//! |---|---|
//! | `family` | the manoeuvres, one row for each |
//! | `course` | manoeuvres one after another: their manifest, their set points |
//! | `flying` | simulated flights in this process |
//! | `limits` | limits of the flights file, or those that the flights reached |
//! | `search` | every manoeuvre under every hypothesis, and the best that they make together |

mod course;
mod family;
mod flying;
mod limits;
mod search;

use anyhow::{Context, Result};
use course::{Course, commented, named, within};
use hummingbus::flights::FlightSet;
use hummingbus::vehicles::Vehicle;
use identify::proposal::{Answer, Part, Proposal, SEPARATED};
use identify::run::Outcome;
use identify::{OpenQuestions, vehicle_file};
use limits::{Bounds, Raised};
use runtime::event::StopToken;
use search::{Flown, Simulator};
use std::path::Path;

pub use course::SET_POINTS_START;

/// First line of the manifest.
pub const MANIFEST_START: &str = "# Next flight, proposed by hummingbus identify.";
/// Further lines of its comment.
const HEAD: &str = "\
It flies the identified vehicle as it is: hummingbus run next-flight.toml
A real vehicle flies the set points of next-flight.csv. Add the log to the flights file with role = \"fit\", and identify again.
Separations are what simulations under the rival names expect, in standard errors of the comparison that identify makes.
";
/// Name of the manifest in the folder.
pub const MANIFEST: &str = "next-flight.toml";
/// Name of the set points in the folder.
pub const SET_POINTS: &str = "next-flight.csv";

/// A separation below this, in standard errors, counts as zero: no raising of a single limit makes an answer
/// of it.
const NO_SEPARATION: f64 = 0.3;

/// Advice where no limit helps.
const NOT_SHOWN: &str = "No manoeuvre answers what stays open, even if the limits are raised. Log another sensor, fly with \
    another load, or declare another effect";

/// A proposal and its files.
pub struct NextFlight {
    /// For the report.
    pub proposal: Proposal,
    /// Texts of the manifest and of the set points; `None` if no flight is worth flying.
    pub files: Option<(String, String)>,
}

/// Searches the flight that separates the open questions of `outcome` best; `vehicle` is the new vehicle file, which the files
/// of `set` hold.
///
/// # Errors
/// If the files of a hypothesis cannot be made.
pub fn propose(
    set: &FlightSet,
    outcome: &Outcome,
    questions: OpenQuestions,
    vehicle: &Path,
    stop: &StopToken,
    say: &(dyn Fn(&str) + Sync),
) -> Result<NextFlight> {
    let bounds = Bounds::of(set);
    let questions = questions.expecting(bounds.duration_s);
    let files = set.files.branch();
    let folder = vehicle.parent().unwrap_or(Path::new("."));
    let facts = Vehicle::load_from(&files, vehicle)?;
    let mut vehicles = vec![named(vehicle)?];
    for at in 1..questions.hypotheses() {
        let path = named(&folder.join(format!("hypothesis-{at}.toml")))?;
        let text = vehicle_file::text(&files, &set.vehicle, &questions.effects(at), &outcome.report)?;
        files.keep(Path::new(&path), text.into_bytes());
        vehicles.push(path);
    }
    let manifest = std::path::absolute(folder.join(MANIFEST))?;
    let simulator = Simulator {
        questions: &questions,
        vehicles: &vehicles,
        facts: &facts,
        files: &files,
        path: &manifest,
        stop,
    };
    let tell = |text: &str| {
        let text = text.to_owned();
        move |done: usize, all: usize| say(&format!("next flight{text}: {done} of {all} manoeuvres"))
    };
    let flown = simulator.family(&bounds, &tell(""))?;
    let found = best(&simulator, &bounds, &flown)?;
    let advice = match &found {
        Some((_, answers)) if answers.iter().all(Answer::is_separated) => None,
        _ if stop.count() > 0 => None,
        _ => {
            let now: Vec<f64> = match &found {
                Some((_, answers)) => answers.iter().map(|answer| answer.separation).collect(),
                None => vec![0.0; questions.questions().count()],
            };
            raised(&simulator, &bounds, &flown, &now, &tell)?
        }
    };
    Ok(written(&simulator, &bounds, found, advice, stop))
}

/// A flight that was found, and the answers that it is expected to give.
type Found = (Chosen, Vec<Answer>);

/// The course of a flight with its names, and what its simulation reaches.
struct Chosen {
    course: Course,
    names: Vec<(String, &'static str)>,
    reached: identify::proposal::Limits,
}

/// The best flight of the manoeuvres that were `flown`; `None` if none says anything.
fn best(simulator: &Simulator<'_>, bounds: &Bounds, flown: &[Flown]) -> Result<Option<Found>> {
    let questions = simulator.questions;
    let mut chosen = search::combined(questions, flown, bounds.duration_s, search::EXCHANGES_MAX);
    let never = StopToken::new();
    let last = simulator.unstopped(&never);
    // What keeps the limits alone may leave them behind another: then the last is left out.
    while !chosen.is_empty() {
        let course = search::course(bounds, simulator.facts.gravity_m_s2, flown, &chosen)?;
        let Some((flights, reached)) = last.fly(&course, bounds)? else {
            chosen.pop();
            continue;
        };
        let separations = questions.fitted_separations(&flights).context("the proposed flight")?;
        let names = chosen.iter().map(|at| (name(&flown[*at]), flown[*at].manoeuvre.description)).collect();
        let answers = answers(questions, flown, &chosen, &separations);
        return Ok(Some((Chosen { course, names, reached }, answers)));
    }
    Ok(None)
}

fn name(flown: &Flown) -> String {
    let Flown { manoeuvre, level, .. } = flown;
    match manoeuvre.levels {
        [_] => manoeuvre.name.to_owned(),
        _ if *level > 1.0 => format!("{} of {level:.0} deg", manoeuvre.name),
        _ => format!("{} at {:.0} %", manoeuvre.name, 100.0 * level),
    }
}

/// The answers with these separations, each with the manoeuvre that says most on it for itself.
fn answers(questions: &OpenQuestions, flown: &[Flown], chosen: &[usize], separations: &[f64]) -> Vec<Answer> {
    let alone: Vec<Vec<f64>> =
        chosen.iter().map(|at| search::separations(questions, flown, &[*at])).collect();
    let of = |(number, (question, separation)): (usize, (&identify::Question, &f64))| {
        let best = (0..chosen.len()).max_by(|a, b| alone[*a][number].total_cmp(&alone[*b][number]));
        let says = best.filter(|best| alone[*best][number] > 0.1);
        Answer {
            question: question.clone(),
            separation: *separation,
            manoeuvre: says.map(|best| name(&flown[chosen[best]])),
        }
    };
    questions.questions().zip(separations).enumerate().map(of).collect()
}

/// The limit to raise so that the questions that `now` leaves open are answered; `None` if the search was stopped before it
/// found one.
///
/// # Errors
/// As [`Simulator::family`].
fn raised<T: Fn(usize, usize) + Sync>(
    simulator: &Simulator<'_>,
    bounds: &Bounds,
    flown: &[Flown],
    now: &[f64],
    tell: &dyn Fn(&str) -> T,
) -> Result<Option<String>> {
    let questions = simulator.questions;
    let open: Vec<usize> = (0..now.len()).filter(|at| now[*at] < SEPARATED).collect();
    let mut best: Option<(usize, f64, String)> = None;
    // Where no manoeuvre shows anything, the limits are first raised together: one family of flights tells that none helps.
    let shows_nothing = |flown: &[Flown], bounds: &Bounds| {
        let chosen = search::combined(questions, flown, bounds.duration_s, 0);
        let found = search::separations(questions, flown, &chosen);
        open.iter().all(|at| found[*at] < NO_SEPARATION)
    };
    let nothing_shown = open.iter().all(|at| now[*at] < NO_SEPARATION);
    if nothing_shown && shows_nothing(flown, &Raised::Duration.on(bounds).0) {
        let (bounds, text) = Raised::All.on(bounds);
        let flown = simulator.family(&bounds, &tell(&format!(", limits raised ({text})")))?;
        if shows_nothing(&flown, &bounds) {
            return Ok((simulator.stop.count() == 0).then(|| NOT_SHOWN.to_owned()));
        }
    }
    for raised in Raised::ALL {
        let (raised_bounds, text) = raised.on(bounds);
        if raised_bounds == *bounds {
            continue;
        }
        let bounds = raised_bounds;
        let again;
        let flown = if raised == Raised::Duration {
            flown
        } else {
            again = simulator.family(&bounds, &tell(&format!(", limits raised ({text})")))?;
            &again[..]
        };
        // It only says whether a limit helps.
        let chosen = search::combined(questions, flown, bounds.duration_s, 0);
        let found = search::separations(questions, flown, &chosen);
        let answered = open.iter().filter(|at| found[**at] >= SEPARATED).count();
        let worst = open.iter().map(|at| found[*at]).fold(f64::INFINITY, f64::min);
        if best.as_ref().is_none_or(|(count, least, _)| (answered, worst) > (*count, *least)) {
            let list = open.iter().map(|at| format!("{:.1}", found[*at])).collect::<Vec<_>>().join(", ");
            let text = format!(
                "Raise {text} in [next_flight] of the flights file: the expected separation of what stays open is then {list} standard \
                 errors"
            );
            best = Some((answered, worst, text));
        }
        if answered == open.len() || simulator.stop.count() > 0 {
            break;
        }
    }
    Ok(match best {
        Some((answered, _, text)) if answered > 0 => Some(text),
        _ if simulator.stop.count() > 0 => None,
        _ => Some(NOT_SHOWN.to_owned()),
    })
}

/// The proposal and its files.
fn written(
    simulator: &Simulator<'_>,
    bounds: &Bounds,
    found: Option<Found>,
    advice: Option<String>,
    stop: &StopToken,
) -> NextFlight {
    let questions = simulator.questions;
    let limits = bounds.limits;
    let mut proposal = Proposal {
        answers: answers(questions, &[], &[], &vec![0.0; questions.questions().count()]),
        course: Vec::new(),
        duration_s: 0.0,
        limits,
        reached: limits,
        advice,
        was_stopped: stop.count() > 0,
    };
    let Some((chosen, answers)) = found else { return NextFlight { proposal, files: None } };
    proposal.answers = answers;
    let Chosen { course, names, reached } = chosen;
    proposal.duration_s = course.duration_s();
    proposal.reached = reached;
    let part = |((from_s, to_s), (manoeuvre, description)): (&(f64, f64), (String, &'static str))| Part {
        from_s: *from_s,
        to_s: *to_s,
        manoeuvre,
        description: description.to_owned(),
    };
    proposal.course = course.parts_s.iter().zip(names).map(part).collect();
    let manifest = within(course.manifest("vehicle.toml", "vehicle.toml", simulator.facts), &limits);
    let head = format!("{}\n{HEAD}{proposal}", MANIFEST_START.trim_start_matches("# "));
    let files = proposal.is_worth_flying().then(|| (commented(&head, &manifest), course.set_points()));
    NextFlight { proposal, files }
}
